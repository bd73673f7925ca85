//! A lens under design: refracting surfaces and a pupil, without diaphragm and rims.
//!
//! Its beams are ellipses with the areas that are asked for, in a pupil that moves freely along the
//! axis; a diaphragm and rims that give such beams are found at the end. So the merit needs no search
//! for the edge of a pupil, and light cannot be traded for sharpness.

mod beams;
mod limits;
mod merit;
mod parameter;

pub(super) use beams::{BeamPlan, traced_beams};
pub(super) use merit::{DraftMerit, beam_heights};
pub(super) use parameter::{DraftParameter, Freedom, USED_TERMS};

use super::LensRequirements;
use crate::lens::{Lens, Medium};
use crate::solve::TrustRegion;
use serde::{Deserialize, Serialize};

/// A lens under design.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct LensDraft {
    /// The refracting surfaces, the first one marked as the stop, without rims.
    pub(super) lens: Lens,
    /// The distance of the entrance pupil behind the first vertex, in mm.
    pub(super) pupil: f64,
}

impl LensDraft {
    /// True if every medium is air or a glass with an index and an Abbe number.
    pub(super) fn is_plain(lens: &Lens) -> bool {
        let plain = |medium: &Medium| {
            matches!(medium, Medium::Air | Medium::Glass(_) | Medium::Model { .. })
        };
        lens.object_medium == Medium::Air && lens.surfaces.iter().all(|row| plain(&row.medium))
    }
}

/// The cost of a limit.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct LimitCost {
    /// The limit.
    pub term: &'static str,
    /// The surface, or the one in front of the gap, counted from 0; `None` for the whole lens.
    pub surface: Option<usize>,
    /// The decrease of the RMS spot radius over the fields, in µm, by a bound looser by 1 mm; for a
    /// distortion in mm of the image. `None` for what is no length.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub um_per_mm: Option<f64>,
    /// The same by 1 % less light at every field; `None` for a length.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub um_per_percent: Option<f64>,
    /// The growth of the RMS spot radius by one element fewer, in µm, as far as the simplest lens tells; `None` for
    /// every other limit.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub um_per_element: Option<f64>,
}

impl LimitCost {
    /// The cost of a length.
    pub(super) fn of_length(term: &'static str, surface: Option<usize>, um_per_mm: f64) -> Self {
        let um_per_mm = Some(um_per_mm);
        Self { term, surface, um_per_mm, um_per_percent: None, um_per_element: None }
    }

    /// The cost of the light of all fields.
    pub(super) fn of_light(um_per_percent: f64) -> Self {
        let (term, surface) = ("light", None);
        let um_per_percent = Some(um_per_percent);
        Self { term, surface, um_per_mm: None, um_per_percent, um_per_element: None }
    }

    /// The cost of one element fewer.
    pub(super) fn of_element(um_per_element: f64) -> Self {
        let (term, surface) = ("elements", None);
        let um_per_element = Some(um_per_element);
        Self { term, surface, um_per_mm: None, um_per_percent: None, um_per_element }
    }

    /// The number by which costs are ordered.
    pub(super) fn size(&self) -> f64 {
        self.um_per_mm.or(self.um_per_percent).or(self.um_per_element).unwrap_or(0.0)
    }
}

/// The costs of all limits that hold a draft, those that cost most first; empty if its beams do not
/// get through.
pub(super) fn limit_costs(
    draft: &LensDraft,
    asked: &LensRequirements,
    plan: &BeamPlan,
    freedom: Freedom,
) -> Vec<LimitCost> {
    let merit = DraftMerit::new(draft, asked, plan, freedom);
    let mut costs = merit.and_then(|mut merit| merit.limit_costs()).unwrap_or_default();
    costs.sort_by(|a, b| b.size().total_cmp(&a.size()));
    costs.extend(light_cost(draft, asked, plan, freedom).map(LimitCost::of_light));
    costs
}

/// The decrease of the RMS spot radius in µm by beams of 1 % less light: by the lens as it is, since at a
/// minimum what its variables gain is of second order.
fn light_cost(
    draft: &LensDraft,
    asked: &LensRequirements,
    plan: &BeamPlan,
    freedom: Freedom,
) -> Option<f64> {
    let rms = |plan: &BeamPlan| DraftMerit::new(draft, asked, plan, freedom)?.rms();
    let gain = 1e3 * (rms(plan)? - rms(&plan.dimmed(0.01))?);
    (gain > 0.0).then_some(gain)
}

/// The gain that an aspheric figure of each surface without one promises, by row: the predicted decrease of
/// the merit relative to it by the conic constant or by the coefficient of r⁴, whichever is larger.
pub(super) fn asphere_gains(
    draft: &LensDraft,
    asked: &LensRequirements,
    plan: &BeamPlan,
) -> Vec<(usize, f64)> {
    let aspheric_surfaces = draft.lens.surfaces.len();
    let freedom = Freedom { glasses: false, aspheric_surfaces, terms: 1, pupil: true };
    let merit = DraftMerit::new(draft, asked, plan, freedom);
    merit.and_then(|mut merit| merit.asphere_gains()).unwrap_or_default()
}

/// The result of a descent.
#[derive(Debug, Clone)]
pub(super) struct DraftDescent {
    /// The lens.
    pub(super) draft: LensDraft,
    /// Its merit, in mm².
    pub(super) value: f64,
    /// The number of evaluations with derivatives.
    pub(super) gradients: usize,
}

/// The number of trials between two measurements of the heights of the beams at the surfaces.
const ROUND: usize = 12;

/// Descends from a draft by this many trials; `None` if its beams do not get through.
pub(super) fn descend(
    draft: &LensDraft,
    asked: &LensRequirements,
    plan: &BeamPlan,
    freedom: Freedom,
    trials: usize,
) -> Option<DraftDescent> {
    let mut now = DraftDescent { draft: draft.clone(), value: f64::INFINITY, gradients: 0 };
    let mut region = None;
    while now.gradients < trials {
        let mut merit = DraftMerit::new(&now.draft, asked, plan, freedom)?;
        let steps = ROUND.min(trials - now.gradients);
        let (values, value, used) = take_trials(&mut merit, &mut region, steps)?;
        now = DraftDescent {
            draft: merit.draft_at(&values),
            value,
            gradients: now.gradients + used.max(1),
        };
    }
    Some(now)
}

/// Trials of one round: the values at their end, the merit, and the number of evaluations. The
/// region goes on from one round to the next unless it has vanished.
fn take_trials(
    merit: &mut DraftMerit<'_>,
    kept: &mut Option<TrustRegion>,
    trials: usize,
) -> Option<(Vec<f64>, f64, usize)> {
    let mut values = merit.start();
    let mut point = merit.evaluate(&values)?;
    let mut region = kept.take().unwrap_or_else(|| TrustRegion::new(values.len()));
    let mut used = 1;
    while used < trials.max(2) {
        let room = merit.room(&values);
        let Some(step) = region.propose(&point, &room) else { break };
        let next: Vec<f64> = values.iter().zip(step.change.iter()).map(|(v, d)| v + d).collect();
        used += 1;
        match merit.evaluate(&next) {
            None => region.note_failure(&step),
            Some(to) => {
                if region.note_trial(&step, &step.change, &point, &to) {
                    (values, point) = (next, to);
                }
            }
        }
        if region.is_exhausted(&point) {
            return Some((values, point.value, used));
        }
    }
    *kept = Some(region);
    Some((values, point.value, used))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::search::design::LensSpecification;
    use crate::search::design::starts::achromats;

    #[test]
    fn a_descent_improves_a_draft_with_the_trials_that_it_has() {
        let spec: LensSpecification = serde_json::from_str(
            r#"{"focal_length_mm": 60.0, "f_number": 5.0, "half_field_deg": 3.0, "max_elements": 2}"#,
        )
        .unwrap();
        let asked = LensRequirements::complete(&spec).unwrap().0;
        let mut draft = achromats(&asked).swap_remove(0).draft;
        draft.lens.surfaces[1].curvature *= 0.9;
        let plan = BeamPlan::full(1.0);
        let freedom =
            Freedom { glasses: true, aspheric_surfaces: 0, terms: USED_TERMS, pupil: true };
        let mut merit = DraftMerit::new(&draft, &asked, &plan, freedom).unwrap();
        let start = merit.start();
        let before = merit.evaluate(&start).unwrap().value;
        let descent = |trials| descend(&draft, &asked, &plan, freedom, trials).unwrap();
        let (few, many) = (descent(6), descent(40));
        assert!(few.value < 0.5 * before && few.gradients <= 8, "{before} {few:?}");
        assert!(many.value < few.value && many.gradients > 20, "{} {}", many.value, few.value);
    }

    #[test]
    fn the_entrance_pupil_may_be_anywhere_in_the_lens() {
        let spec: LensSpecification = serde_json::from_str(
            r#"{"focal_length_mm": 60.0, "f_number": 5.0, "half_field_deg": 3.0}"#,
        )
        .unwrap();
        let asked = LensRequirements::complete(&spec).unwrap().0;
        let draft = achromats(&asked).swap_remove(0).draft;
        let [low, high] = DraftParameter::Pupil.range(&draft, &asked);
        assert!(low <= -0.5 * asked.track && high >= asked.track, "{low} {high}");
    }
}
