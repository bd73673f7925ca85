//! Another merit than the spot over real lenses: as many lenses with random errors as its mean needs.

use super::analysis::mean_with_error;
use super::draw::draw_errors;
use super::mixture::ErrorMixture;
use super::{StopTest, ToleranceError, refuse_if_stopped};
use crate::lens::{Perturbation, ToleranceSheet};
use rayon::prelude::*;
use serde::Serialize;

/// The random lenses of a merit.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct RealMeritRequest {
    /// The seed of the errors: the lenses are those of the spots with the same seed.
    pub seed: u64,
    /// The largest number of lenses.
    pub most: usize,
    /// The standard error of the mean, relative to it, at which there are enough of them.
    pub error: f64,
}

/// A merit of lenses with random errors, at the fixed image plane and refocused.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct RealMerit {
    /// The mean.
    pub mean: [f64; 2],
    /// Its standard error.
    pub error: [f64; 2],
    /// The number of lenses whose rays arrive.
    pub lenses: usize,
    /// The number of others.
    pub lost: usize,
    /// True if the standard error is as small as was asked for.
    pub reached: bool,
}

/// The number of lenses that are traced in parallel before their mean is judged.
const PART: usize = 64;

impl RealMerit {
    /// The merit of lenses by `judge`, which has `None` for one of which a ray does not arrive; more lenses
    /// are traced until their mean is known. Once `stop` says so it is that of the lenses so far.
    ///
    /// # Errors
    /// Correlations that no errors can have, an error of making that is not possible, and
    /// [`ToleranceError::Stopped`] if there is no lens yet.
    pub(super) fn new(
        sheet: &ToleranceSheet,
        request: RealMeritRequest,
        stop: StopTest<'_>,
        judge: impl Fn(&[(Perturbation, f64)]) -> Result<Option<[f64; 2]>, ToleranceError> + Sync,
    ) -> Result<Self, ToleranceError> {
        let mixture = ErrorMixture::new(sheet)?;
        let lens = |number: usize| {
            let drawn = draw_errors((&sheet.errors, &mixture), request.seed, number as u64);
            let errors: Vec<_> =
                sheet.errors.iter().zip(drawn).map(|(own, value)| (own.error, value)).collect();
            if stop() { Ok(Err(())) } else { judge(&errors).map(Ok) }
        };
        let mut values: Vec<Option<[f64; 2]>> = Vec::new();
        loop {
            let part = values.len()..request.most.min(values.len() + PART);
            let part: Vec<_> = part.into_par_iter().map(lens).collect::<Result<_, _>>()?;
            let is_stopped = part.iter().any(Result::is_err);
            values.extend(part.into_iter().map_while(Result::ok));
            let found = Self::of(&values, request.error);
            if is_stopped && found.lenses == 0 {
                refuse_if_stopped(&|| true)?;
            }
            if is_stopped || found.reached || values.len() >= request.most {
                return Ok(found);
            }
        }
    }

    fn of(values: &[Option<[f64; 2]>], wanted: f64) -> Self {
        let arrived: Vec<[f64; 2]> = values.iter().flatten().copied().collect();
        let both = [0, 1].map(|i| {
            let own: Vec<f64> = arrived.iter().map(|value| value[i]).collect();
            mean_with_error(&own)
        });
        let reached =
            arrived.len() > 1 && both.iter().all(|[mean, error]| *error <= wanted * mean.abs());
        Self {
            mean: both.map(|[mean, _]| mean),
            error: both.map(|[_, error]| error),
            lenses: arrived.len(),
            lost: values.len() - arrived.len(),
            reached,
        }
    }

    /// The same as roots: of a mean of squares.
    #[must_use]
    pub fn root(&self) -> Self {
        let mean = self.mean.map(|mean| mean.max(0.0).sqrt());
        let error = [0, 1].map(|i| 0.5 * self.error[i] / mean[i].max(f64::MIN_POSITIVE));
        Self { mean, error, ..*self }
    }

    /// The relative differences of values from these means, where they are more than three standard errors
    /// and more than this share of the mean.
    pub fn differs_from(&self, values: [f64; 2], share: f64) -> Option<[f64; 2]> {
        let apart = [0, 1].map(|i| self.mean[i] - values[i]);
        let matters =
            |i: usize| apart[i].abs() > (3.0 * self.error[i]).max(share * self.mean[i].abs());
        let relative = [0, 1].map(|i| apart[i] / values[i].abs().max(f64::MIN_POSITIVE));
        (matters(0) || matters(1)).then_some(relative)
    }
}
