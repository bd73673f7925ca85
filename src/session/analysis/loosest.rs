//! The loosest tolerances for a spot or a yield, found by the quadratic form and confirmed by rays.

use crate::lens::{Lens, Tolerance, ToleranceSheet};
use crate::tolerance::{
    PriceClass, QuadraticForm, ToleranceError, ToleranceScene, bounded_tolerances, form_yield,
    loosest_for_yield, loosest_tolerances, price_classes, real_lenses, refuse_lost_lenses,
};
use serde::{Deserialize, Serialize};
use std::sync::atomic::AtomicBool;

/// The aim of the loosest tolerances, refocused.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum LoosestGoal {
    /// This root of the expected mean square spot radius in mm.
    Rms(f64),
    /// This share of the lenses with an rms spot radius of at most `rms` mm.
    Yield {
        /// The largest rms of a good lens in mm.
        rms: f64,
        /// The share of good lenses, 0.9 for 90 %.
        share: f64,
    },
}

/// The loosest tolerances, with their prices.
#[derive(Debug, Clone)]
pub struct LoosestTolerances {
    /// The tolerances; errors and their order are those of the lens.
    pub sheet: ToleranceSheet,
    /// The price of each and the half range of its class; `None` where classes say nothing.
    pub prices: Vec<Option<(PriceClass, f64)>>,
    /// The number of those that are not as wide as the form has them.
    pub held: usize,
    /// The share of good lenses by the form with these tolerances, and with each as its class has it;
    /// `None` without a limit.
    pub good: Option<[f64; 2]>,
    /// The refocused root mean square of lenses with these tolerances in mm, by rays and by the form on
    /// the same errors; `None` if no rays arrive.
    pub confirmed: Option<[f64; 2]>,
}

/// The number of real lenses that confirm the tolerances, and their seed.
const CONFIRMING: usize = 100;
const SEED: u64 = 1;

impl LoosestTolerances {
    pub(super) fn new(
        (lens, scene): (&Lens, &ToleranceScene),
        form: &QuadraticForm,
        sheet: &ToleranceSheet,
        goal: LoosestGoal,
    ) -> Result<Self, ToleranceError> {
        let (found, limit) = match goal {
            LoosestGoal::Rms(rms) => (loosest_tolerances(form, sheet, rms * rms)?, None),
            LoosestGoal::Yield { rms, share } => {
                (loosest_for_yield(form, sheet, rms, share)?, Some(rms))
            }
        };
        let (errors, held) = bounded_tolerances(lens, &scene.lens, (&sheet.errors, &found));
        let prices = price_classes(lens, &scene.lens, &errors);
        let sheet = ToleranceSheet { errors, ..sheet.clone() };
        let mut loosest = Self { sheet, prices, held, good: None, confirmed: None };
        if let Some(limit) = limit {
            let both = [loosest.sheet.clone(), loosest.by_class()];
            let [own, by_class] = both.map(|sheet| form_yield(form, &sheet, limit));
            loosest.good = Some([own?, by_class?]);
        }
        loosest.confirmed = confirmed(scene, form, &loosest.sheet)?;
        Ok(loosest)
    }

    /// The same tolerances, each as wide as its class has it.
    pub fn by_class(&self) -> ToleranceSheet {
        let by_class = |(own, price): (&Tolerance, &Option<(PriceClass, f64)>)| {
            let half_range = price.map_or(own.half_range, |(_, half_range)| half_range);
            Tolerance { half_range, ..*own }
        };
        let errors = self.sheet.errors.iter().zip(&self.prices).map(by_class).collect();
        ToleranceSheet { errors, ..self.sheet.clone() }
    }
}

/// The refocused root mean square of lenses with random errors, by rays and by the form.
fn confirmed(
    scene: &ToleranceScene,
    form: &QuadraticForm,
    sheet: &ToleranceSheet,
) -> Result<Option<[f64; 2]>, ToleranceError> {
    let lenses = real_lenses(scene, sheet, SEED, CONFIRMING, 0, &AtomicBool::new(false))?;
    let pair = |errors: &[f64], square: f64| [square, form.at(errors)];
    let arrived: Vec<[f64; 2]> =
        lenses.iter().filter_map(|lens| Some(pair(&lens.errors, lens.mean_square?[1]))).collect();
    refuse_lost_lenses(lenses.len() - arrived.len(), lenses.len(), "the loosest tolerances")?;
    let mean = |i: usize| arrived.iter().map(|pair| pair[i]).sum::<f64>() / arrived.len() as f64;
    Ok((!arrived.is_empty()).then(|| [mean(0).sqrt(), mean(1).sqrt()]))
}
