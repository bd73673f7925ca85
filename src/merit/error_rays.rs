//! The rays on which errors of making are judged.
//!
//! What an error does to a ray varies less over the pupil than the aberrations of the lens, and only a part
//! of the merit is due to errors: fewer rays are enough for them than for the spot. Orders of quadrature
//! are lowered, all pupils by the same number, as long as what errors add changes by less than a part of the
//! tolerance.

use super::as_built::{MadeTolerances, growth};
use super::sampling::RaySampling;
use super::{DerivativeLevel, EvaluationContext, Merit, MeritError, PupilRays, SumOfSquares, spot};
use crate::lens::{Lens, TermScope};

/// The largest change of what errors add by having fewer rays, relative to it and as a part of the
/// tolerance: comparisons of lenses that are nearly equal are not to be about rays.
const SHARE: f64 = 0.3;

/// The rays of the errors of making at one zoom position.
#[derive(Debug, Clone)]
pub(super) struct ErrorRays {
    pub(super) sampling: RaySampling,
    /// The change of the terms by having fewer rays than spots have, relative to them.
    pub(super) error: f64,
}

impl Merit {
    /// Finds the rays of the terms about lenses that are made.
    pub(super) fn find_error_rays(&mut self, lens: &Lens) -> Result<(), MeritError> {
        self.error_rays = vec![None; self.zooms.len()];
        if self.tolerances.iter().flatten().all(Option::is_none) {
            return Ok(());
        }
        let values = &self.values(lens)[..];
        let mut found = Vec::with_capacity(self.zooms.len());
        for (zoom, sampling) in self.zooms.iter().zip(&self.samplings) {
            let systems = &zoom.at(values)?;
            found.push(self.thinned_rays(&EvaluationContext {
                zoom,
                sampling,
                systems,
                values,
                initial_areas: &[],
                traced_pupils: &[],
                errors: None,
            })?);
        }
        self.error_rays = found;
        Ok(())
    }

    /// The fewest rays that are enough; `None` if no term asks for any.
    fn thinned_rays(
        &self,
        context: &EvaluationContext<'_>,
    ) -> Result<Option<ErrorRays>, MeritError> {
        let of_terms = self.goal.terms.iter().zip(&self.tolerances[context.zoom.zoom]);
        let asked: Vec<(TermScope, &MadeTolerances)> =
            of_terms.filter_map(|(w, made)| Some((w.scope, made.as_ref()?))).collect();
        if asked.is_empty() {
            return Ok(None);
        }
        let model = context.zoom.ray_model(context.systems, &self.lens, context.sampling.aiming)?;
        let growths = |sampling: &RaySampling| -> Result<Vec<f64>, MeritError> {
            let errors = Some(PupilRays { sampling, traced_pupils: &[] });
            let context = EvaluationContext { errors, ..*context };
            asked.iter().map(|(scope, made)| growth(&context, made, *scope)).collect()
        };
        let mut thinned =
            ErrorRays { sampling: context.sampling.for_errors(&model, 0), error: 0.0 };
        let most = growths(&thinned.sampling)?;
        let mut merits = Vec::with_capacity(most.len());
        for ((scope, _), growth) in asked.iter().zip(&most) {
            let mut sum = SumOfSquares::zero(0, DerivativeLevel::Value);
            spot::add_spot(context, spot::Normalization::PupilArea, *scope, &mut sum)?;
            merits.push(sum.value + growth);
        }
        for fewer in 1..=context.sampling.highest_order() {
            let sampling = context.sampling.for_errors(&model, fewer);
            // A ray that is lost at a lower order is a reason for the higher one.
            let Ok(found) = growths(&sampling) else { break };
            let changes = || found.iter().zip(&most).map(|(few, most)| (few - most).abs());
            let mut allowed = most.iter().map(|growth| SHARE * self.tolerance * growth);
            if !changes().all(|change| allowed.next().is_some_and(|allowed| change <= allowed)) {
                break;
            }
            let relative = changes().zip(&merits).map(|(change, merit)| change / merit);
            let error = relative.fold(0.0, f64::max);
            thinned = ErrorRays { sampling, error };
        }
        Ok(Some(thinned))
    }
}
