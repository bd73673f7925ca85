//! The mass of the glass, and the light that it absorbs.
//!
//! A model glass has neither: the nearest glass of the catalogue of which both are known stands for it, and
//! is named.

use crate::cli::output::ShortNumber;
use crate::lens::{Lens, Medium, SurfaceNumber, at_zoom, glass};
use crate::report::{LayoutScene, LensBody};
use serde::Serialize;

/// The wavelengths in µm at which the transmission is told: glass absorbs blue light first.
const WAVELENGTHS: [f64; 5] = [0.4, 0.42, 0.45, 0.55, 0.65];

/// The glass of a lens.
#[derive(Serialize, Clone)]
pub(super) struct Material {
    /// The mass in g of all elements; `None` if that of one is not known, or its solid cannot be made.
    mass_g: Option<f64>,
    /// Empty where no absorption is known.
    internal_transmission: Vec<Transmission>,
    /// The surfaces in front of media whose transmission is not known, which is taken as 1.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    unknown_transmission: Vec<SurfaceNumber>,
    /// The glasses that stand for model glasses.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    nearest_glasses: Vec<NearestGlass>,
}

/// A glass that stands for a model glass.
#[derive(Serialize, Clone)]
struct NearestGlass {
    surface: SurfaceNumber,
    glass: String,
}

/// The light that the glass lets through along the axis, without what surfaces reflect.
#[derive(Serialize, Clone)]
struct Transmission {
    um: f64,
    /// `None` where a known glass has no data at this wavelength.
    share: Option<f64>,
}

impl Material {
    /// The glass of a lens at a zoom position; `None` for a lens without any.
    pub(super) fn new(lens: &Lens, zoom: usize) -> Option<Self> {
        let mut lens = at_zoom(lens, zoom);
        let nearest_glasses = replace_models(&mut lens);
        let is_filled = |medium: &Medium| !matches!(medium, Medium::Air | Medium::Mirror);
        let filled: Vec<usize> =
            (0..lens.surfaces.len()).filter(|i| is_filled(&lens.surfaces[*i].medium)).collect();
        if filled.is_empty() {
            return None;
        }
        let (known, unknown): (Vec<usize>, Vec<usize>) =
            filled.into_iter().partition(|i| has_transmission(&lens.surfaces[*i].medium));
        let transmission = |um: f64| Transmission { um, share: share(&lens, &known, um) };
        Some(Self {
            mass_g: mass(&lens),
            internal_transmission: if known.is_empty() {
                Vec::new()
            } else {
                WAVELENGTHS.into_iter().map(transmission).collect()
            },
            unknown_transmission: unknown.into_iter().map(SurfaceNumber::new).collect(),
            nearest_glasses,
        })
    }

    /// The lines of the report.
    pub(super) fn text(&self) -> String {
        let mass = self
            .mass_g
            .map_or_else(|| "mass unknown".to_owned(), |mass| format!("{} g", ShortNumber(mass)));
        let passed = |at: &Transmission| {
            let share = at.share.map_or_else(|| "?".to_owned(), |share| format!("{share:.3}"));
            format!("{share} at {:.0} nm", 1e3 * at.um)
        };
        let list: Vec<String> = self.internal_transmission.iter().map(passed).collect();
        if list.is_empty() {
            return format!("glass           {mass}; absorption unknown") + &self.models_text();
        }
        let mut text = format!("glass           {mass}; passes on the axis {}", list.join(", "));
        if !self.unknown_transmission.is_empty() {
            let numbers: Vec<String> =
                self.unknown_transmission.iter().map(SurfaceNumber::to_string).collect();
            text += "\n                (absorption unknown behind surface ";
            text += &numbers.join(", ");
            text += ", taken as none)";
        }
        text + &self.models_text()
    }

    /// The glasses that stand for model glasses; empty if there is no model glass.
    fn models_text(&self) -> String {
        if self.nearest_glasses.is_empty() {
            return String::new();
        }
        let named = |NearestGlass { surface, glass }: &NearestGlass| {
            format!("{glass} behind surface {surface}")
        };
        let all: Vec<String> = self.nearest_glasses.iter().map(named).collect();
        format!("\n                (of the nearest glasses to model glasses: {})", all.join(", "))
    }
}

/// Replaces model glasses by the nearest of the catalogue whose density and transmission are known, and
/// returns these.
fn replace_models(lens: &mut Lens) -> Vec<NearestGlass> {
    let mut found = Vec::new();
    for (i, row) in lens.surfaces.iter_mut().enumerate() {
        let Medium::Model { nd, vd } = row.medium else { continue };
        let is_known = |glass: &&glass::Glass| {
            glass.density.is_some()
                && glass.properties().is_some_and(|known| !known.transmission.is_empty())
        };
        let from = |glass: &glass::Glass| glass::distance(glass, nd, vd);
        let known = glass::catalogue().iter().filter(is_known);
        let Some(nearest) = known.min_by(|a, b| from(a).total_cmp(&from(b))) else { continue };
        let (surface, glass) = (SurfaceNumber::new(i), nearest.full_name());
        row.medium = Medium::Glass(glass.clone());
        found.push(NearestGlass { surface, glass });
    }
    found
}

/// The mass of all elements in g.
fn mass(lens: &Lens) -> Option<f64> {
    let bodies = LayoutScene::new(lens, 0).ok()?.bodies();
    let masses = bodies.iter().map(|body| body.solid().ok().and_then(LensBody::mass));
    let total: Option<f64> = masses.sum();
    total.filter(|mass| mass.is_finite())
}

fn has_transmission(medium: &Medium) -> bool {
    let Medium::Glass(name) = medium else { return false };
    let properties = glass::find(name).and_then(|glass| glass.properties());
    properties.is_some_and(|known| !known.transmission.is_empty())
}

/// The share of the light on the axis that passes the glass of some gaps.
fn share(lens: &Lens, gaps: &[usize], um: f64) -> Option<f64> {
    let absorbed =
        |gap: &usize| Some(lens.absorbance(*gap, um)? * lens.surfaces[*gap].thickness.abs());
    let absorbed: Option<f64> = gaps.iter().map(absorbed).sum();
    absorbed.map(|absorbed| (-absorbed).exp())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::lens::blank;

    fn singlet(medium: Medium) -> Lens {
        let mut lens = blank();
        lens.surfaces[0].curvature = 0.01;
        lens.surfaces[0].medium = medium;
        lens.surfaces.iter_mut().for_each(|row| row.semi_diameter = Some(5.0));
        lens
    }

    #[test]
    fn the_nearest_glass_stands_for_a_model_glass_and_is_named() {
        let named = Material::new(&singlet(Medium::Glass("SCHOTT N-BK7".to_owned())), 0).unwrap();
        let model = Material::new(&singlet(Medium::Model { nd: 1.5169, vd: 64.1 }), 0).unwrap();
        assert!(named.nearest_glasses.is_empty() && !named.text().contains("nearest"));
        let [one] = &model.nearest_glasses[..] else { panic!("{}", model.text()) };
        let found = glass::find(&one.glass).unwrap();
        assert!((found.nd - 1.5168).abs() < 1e-3, "{}", one.glass);
        assert!(model.text().contains(&format!("{} behind surface 1", one.glass)));
        assert!((model.mass_g.unwrap() / named.mass_g.unwrap() - 1.0).abs() < 0.1);
        assert!(model.unknown_transmission.is_empty() && !model.internal_transmission.is_empty());
    }
}
