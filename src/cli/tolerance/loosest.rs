//! The loosest tolerances in the results of `tolerance`.

use super::tables::{percent, surfaces};
use super::units::half_range_text;
use crate::cli::output::{ShortNumber, TextTable};
use crate::lens::Tolerance;
use crate::tolerance::{LoosestTolerances, NominalLens, PriceClass};
use serde::Serialize;
use std::fmt::{self, Display};

/// The loosest tolerances with their prices, if they are asked for.
#[derive(Serialize)]
pub(super) struct LoosestReport {
    loosest: Option<Vec<Tolerance>>,
    prices: Option<LoosestPrices>,
    #[serde(skip)]
    found: Option<LoosestTolerances>,
    /// The half ranges as text.
    #[serde(skip)]
    stated: Vec<String>,
}

/// The prices of the loosest tolerances, and the yield with them.
#[derive(Serialize)]
struct LoosestPrices {
    /// The price class of each tolerance; `None` where classes say nothing.
    classes: Vec<Option<PriceClass>>,
    /// The share of good lenses with the loosest tolerances, and with each as its class has it; `None`
    /// without a limit.
    good: Option<[f64; 2]>,
    /// The refocused root mean square of lenses with random errors within these tolerances, by their
    /// rays and by the quadratic model on the same errors, in mm.
    confirmed: Option<[f64; 2]>,
}

impl LoosestReport {
    pub(super) fn new(found: Option<LoosestTolerances>, lens: &NominalLens) -> Self {
        let prices = |found: &LoosestTolerances| LoosestPrices {
            classes: found.prices.iter().map(|price| price.map(|(class, _)| class)).collect(),
            good: found.good,
            confirmed: found.confirmed,
        };
        let text = |own: &Tolerance| half_range_text(own, lens);
        Self {
            loosest: found.as_ref().map(|found| found.sheet.errors.clone()),
            prices: found.as_ref().map(prices),
            stated: found.iter().flat_map(|found| &found.sheet.errors).map(text).collect(),
            found,
        }
    }

    pub(super) fn warnings(&self) -> Vec<String> {
        let mut warnings = Vec::new();
        let Some(found) = &self.found else { return warnings };
        if found.held > 0 {
            warnings.push(format!(
                "{} of the loosest tolerances are held at ten times the commercial class, or ten \
                 times what they were: the quadratic model would have them wider",
                found.held
            ));
        }
        if let Some(apart) = found.disagreement() {
            warnings.push(format!(
                "with the loosest tolerances the mean square spot of {} lenses by their rays differs \
                 from the quadratic model by {:.0} %; the tolerances are not to be trusted so far",
                found.lenses,
                100.0 * apart
            ));
        }
        warnings
    }
}

impl LoosestReport {
    fn table(&self, tolerances: &[Tolerance], classes: &[Option<PriceClass>]) -> TextTable {
        let mut table = TextTable::new(&["loosest tolerances", "surfaces", "half range", "class"]);
        for ((Tolerance { error, .. }, class), stated) in
            tolerances.iter().zip(classes).zip(&self.stated)
        {
            table.row([
                error.kind.name().to_owned(),
                surfaces(error.first, error.last),
                stated.clone(),
                class.map_or("", PriceClass::name).to_owned(),
            ]);
        }
        table
    }
}

impl Display for LoosestReport {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Some((found, prices)) = self.found.as_ref().zip(self.prices.as_ref()) else {
            return Ok(());
        };
        writeln!(f, "\n{}", self.table(&found.sheet.errors, &prices.classes))?;
        if let Some([good, by_class]) = found.good {
            let [good, by_class] = [good, by_class].map(percent);
            writeln!(f, "yield by the quadratic model: {good}; each at its class: {by_class}")?;
        }
        if let Some([real, form]) = found.confirmed.map(|rms| rms.map(ShortNumber)) {
            writeln!(
                f,
                "refocused rms of {} lenses with them: {real} mm by rays, {form} mm by the quadratic \
                 model",
                found.lenses
            )?;
        }
        Ok(())
    }
}
