//! The loosest tolerances for a spot or a yield: found by the quadratic form, with their prices, and
//! confirmed by real lenses.

use super::{
    PriceClass, QuadraticForm, StopTest, ToleranceError, ToleranceScene, bounded_tolerances,
    form_yield, loosest_for_yield, loosest_tolerances, price_classes, refuse_lost_lenses,
    traced_lenses,
};
use crate::lens::{Lens, Tolerance, ToleranceSheet};
use serde::{Deserialize, Serialize};

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

impl LoosestGoal {
    /// The largest rms of a good lens in mm, if the goal names one.
    pub const fn limit(self) -> Option<f64> {
        match self {
            Self::Rms(_) => None,
            Self::Yield { rms, .. } => Some(rms),
        }
    }

    /// Refuses a goal that the lens without errors does not reach, by the form of its errors alone.
    ///
    /// # Errors
    /// [`ToleranceError::BelowNominal`].
    pub fn check(self, form: &QuadraticForm) -> Result<(), ToleranceError> {
        let (Self::Rms(found) | Self::Yield { rms: found, .. }) = self;
        let nominal = form.as_designed();
        if found * found > nominal {
            return Ok(());
        }
        Err(ToleranceError::BelowNominal { found, nominal: nominal.sqrt() })
    }
}

/// The aim of the loosest tolerances and their confirmation.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct LoosestRequest {
    /// The aim.
    pub goal: LoosestGoal,
    /// The largest rms of a good lens in mm, for the yields; `None` for none.
    pub limit: Option<f64>,
    /// The seed of the real lenses.
    pub seed: u64,
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
    /// The number of these lenses.
    pub lenses: usize,
}

/// The number of real lenses that confirm the tolerances.
const CONFIRMING: usize = 100;
/// The share of the mean square spot up to which the form and these lenses are said to agree.
const CONFIRMED: f64 = 0.05;

impl LoosestTolerances {
    /// The loosest tolerances of a lens by a form of its errors, refocused, of which `moving_pupils` says
    /// whether pupils move in it; fewer real lenses confirm them once `stop` says so.
    ///
    /// # Errors
    /// A goal that the lens without errors does not reach, and tolerances with which most lenses lose rays.
    pub fn new(
        (lens, scene): (&Lens, &ToleranceScene),
        (form, moving_pupils): (&QuadraticForm, bool),
        sheet: &ToleranceSheet,
        request: LoosestRequest,
        stop: StopTest<'_>,
    ) -> Result<Self, ToleranceError> {
        let found = match request.goal {
            LoosestGoal::Rms(rms) => loosest_tolerances(form, sheet, rms * rms)?,
            LoosestGoal::Yield { rms, share } => loosest_for_yield(form, sheet, rms, share)?,
        };
        let (errors, held) = bounded_tolerances(lens, &scene.lens, (&sheet.errors, &found));
        let prices = price_classes(lens, &scene.lens, &errors);
        let sheet = ToleranceSheet { errors, ..sheet.clone() };
        let mut loosest = Self { sheet, prices, held, good: None, confirmed: None, lenses: 0 };
        if let Some(limit) = request.limit {
            let both = [loosest.sheet.clone(), loosest.by_class()];
            let [own, by_class] = both.map(|sheet| form_yield(form, &sheet, limit));
            loosest.good = Some([own?, by_class?]);
        }
        loosest.confirm(scene, (form, moving_pupils), (request.seed, stop))?;
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

    /// The relative difference of the mean square of the real lenses from that by the form, if it is so
    /// large that the tolerances are not to be trusted.
    pub fn disagreement(&self) -> Option<f64> {
        let [real, form] = self.confirmed?;
        let apart = (real / form).powi(2) - 1.0;
        (apart.abs() > CONFIRMED).then_some(apart)
    }

    /// Traces lenses with random errors within the tolerances.
    fn confirm(
        &mut self,
        scene: &ToleranceScene,
        (form, moving_pupils): (&QuadraticForm, bool),
        (seed, stop): (u64, StopTest<'_>),
    ) -> Result<(), ToleranceError> {
        let drawn = (seed, CONFIRMING);
        let lenses = traced_lenses((scene, moving_pupils), &self.sheet, drawn, stop)?;
        let arrived: Vec<[f64; 2]> = lenses
            .iter()
            .filter_map(|lens| Some([lens.mean_square?[1], form.at(&lens.errors)]))
            .collect();
        refuse_lost_lenses(lenses.len() - arrived.len(), lenses.len(), "the loosest tolerances")?;
        let sum = |i: usize| arrived.iter().map(|pair| pair[i]).sum::<f64>();
        let mean = |i: usize| sum(i) / arrived.len() as f64;
        self.lenses = arrived.len();
        self.confirmed = (!arrived.is_empty()).then(|| [mean(0).sqrt(), mean(1).sqrt()]);
        Ok(())
    }
}
