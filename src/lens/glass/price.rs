//! The price of a glass relative to N-BK7: of its maker, of a person's list, or estimated.
//!
//! Free data have no prices. Makers' own catalogues have, and win; a person may state others. For the
//! rest the family of a glass, as its place on the map of glasses gives it away, tells the order of
//! magnitude: ordinary glasses cost 1 to 4 times as much as N-BK7, lanthanum glasses 3 to 8 times, short
//! flints 10 times, and fluorides with fluorophosphates 8 to 30 times.

use super::{Glass, GlassStatus, added, normal_partial_dispersion, normalize};
use serde::Serialize;
use std::collections::HashMap;
use std::sync::{PoisonError, RwLock};

/// The origin of a price.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum PriceSource {
    /// The catalogue of the maker.
    Maker,
    /// The list of a person.
    Person,
    /// The class of its family.
    Estimated,
}

/// The price of a glass.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct GlassPrice {
    /// The price per weight, relative to that of N-BK7; of an estimate the middle of its class.
    pub relative: f64,
    /// Its origin.
    pub source: PriceSource,
}

/// The classes of estimated prices.
const CLASSES: [f64; 11] = [1.0, 1.5, 2.0, 3.0, 4.0, 6.0, 8.0, 10.0, 15.0, 20.0, 30.0];

/// Parts of the names that makers give lanthanum glasses.
const LANTHANUM: [&str; 7] = ["LAK", "LAF", "LAS", "LAH", "LAM", "LAL", "LAC"];

/// The prices of a person's list by normalized full names.
static PERSON: RwLock<Option<HashMap<String, f64>>> = RwLock::new(None);

/// Sets the prices that a person states, by full names of glasses, in place of those before.
pub fn set_prices(prices: impl IntoIterator<Item = (String, f64)>) {
    let prices = prices.into_iter().map(|(name, price)| (normalize(&name), price));
    *PERSON.write().unwrap_or_else(PoisonError::into_inner) = Some(prices.collect());
}

impl Glass {
    /// Its price: of its own catalogue, or of an added catalogue that has a glass of the same name; else
    /// of a person's list; else that of its class.
    pub fn price(&self) -> GlassPrice {
        let name = normalize(&self.full_name());
        let of = |glass: &Self| glass.properties().and_then(|known| known.relative_cost);
        let maker = of(self).or_else(|| added::find(&name).and_then(of));
        let person = || {
            let list = PERSON.read().unwrap_or_else(PoisonError::into_inner);
            list.as_ref()?.get(&name).copied()
        };
        let (relative, source) = match (maker, person()) {
            (Some(price), _) => (price, PriceSource::Maker),
            (None, Some(price)) => (price, PriceSource::Person),
            (None, None) => (self.estimated_price(), PriceSource::Estimated),
        };
        GlassPrice { relative, source }
    }

    /// The class of its price by its family and its status: what is not in stock costs half as much again.
    fn estimated_price(&self) -> f64 {
        let rare = matches!(
            self.properties().and_then(|known| known.status),
            Some(GlassStatus::Special | GlassStatus::Obsolete)
        );
        let price = self.family_price() * if rare { 1.5 } else { 1.0 };
        let distance = |class: &f64| (class / price).ln().abs();
        let nearest = CLASSES.into_iter().min_by(|a, b| distance(a).total_cmp(&distance(b)));
        nearest.unwrap_or(price)
    }

    /// The price of its family.
    fn family_price(&self) -> f64 {
        match self.manufacturer.as_str() {
            "PLASTIC" => return 1.0,
            "FUSED_SILICA" => return 3.0,
            "CRYSTAL" => return 30.0,
            _ => {}
        }
        let (nd, vd, name) = (self.nd, self.vd, self.name.to_uppercase());
        let deviation =
            self.partial_dispersion().map_or(0.0, |p| p - normal_partial_dispersion(vd));
        let share = |from: f64, length: f64| ((nd - from) / length).clamp(0.0, 1.0);
        // Fluorides and fluorophosphates.
        match vd {
            94.0.. => return 20.0,
            88.0..94.0 => return 15.0,
            75.0..88.0 => return 8.0,
            _ => {}
        }
        let is_short_flint = nd < 1.66 && (38.0..58.0).contains(&vd) && deviation < -0.0045;
        if is_short_flint || name.contains("KZF") {
            return 10.0;
        }
        // Barium glasses end, and lanthanum glasses begin, at this line.
        let beyond_barium = vd > 28.0 && nd > 1.64 + 0.0048 * (60.5 - vd);
        if beyond_barium || LANTHANUM.iter().any(|part| name.contains(part)) {
            return 3.0 + 5.0 * share(1.65, 0.25);
        }
        if nd > 1.87 || deviation > 0.02 {
            return 6.0;
        }
        1.0 + 3.0 * share(1.53, 0.32)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::lens::glass::{find, known};

    /// The ranges of the rule: ordinary 1 to 4, lanthanum 3 to 8, short flints 10, fluorides 8 to 30.
    #[test]
    fn a_price_without_a_catalogue_is_that_of_the_family() {
        for (name, [low, high]) in [
            ("SCHOTT N-BK7", [1.0, 1.0]),
            ("SCHOTT F2", [1.0, 4.0]),
            ("CDGM H-K9LA", [1.0, 1.0]),
            ("SCHOTT N-SK16", [1.0, 4.0]),
            ("SCHOTT N-SF6", [1.0, 4.0]),
            ("SCHOTT N-LAK9", [3.0, 8.0]),
            ("SCHOTT N-LAF7", [3.0, 8.0]),
            ("OHARA S-LAH79", [3.0, 12.0]),
            ("SCHOTT N-KZFS4", [10.0, 15.0]),
            ("SCHOTT N-KZFS11", [10.0, 15.0]),
            ("OHARA S-FPL53", [10.0, 30.0]),
            ("CRYSTAL CAF2", [10.0, 30.0]),
        ] {
            let GlassPrice { relative, source } = find(name).unwrap().price();
            assert!((low..=high).contains(&relative), "{name}: {relative}");
            assert_eq!(source, PriceSource::Estimated);
            assert!(CLASSES.contains(&relative), "{name}: {relative}");
        }
        let all: Vec<f64> = known().map(|glass| glass.price().relative).collect();
        let cheap = all.iter().filter(|price| **price <= 3.0).count();
        assert!(4 * cheap > all.len() && cheap < all.len(), "{cheap} of {}", all.len());
    }
}
