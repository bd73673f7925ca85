//! Figures 4.4 to 4.7: what a search over structure brings, and which of its parts bring it.
//!
//! All of them start from lenses of the library in one colour, with fields at four heights of a full
//! frame. What a published lens does not keep of the usual limits, like the edge of an element, is
//! limited to what it has: so a search begins with aberrations to correct, and not with limits to
//! mend. Since nothing here reads a clock, methods are compared after as many gradients, each of
//! which costs all of them the same: one merit with all its derivatives at one lens. A step of damped
//! least squares costs as many as it tries.

pub(super) mod brute_force;
pub(super) mod front_with_mutations;
pub(super) mod metropolis;
pub(super) mod overview_figure;
pub(super) mod projection;
mod recorded_search;
mod relaxed_limits;
mod sampler_comparison;

use super::sharpness_vs_light::{focal_length, with_field_angles};
use super::{ExperimentError, lens};
use crate::lens::{Lens, at_zoom};
use crate::pupil::limited_by_stop;
use crate::search::lens_landscape::{SearchPlan, goal};
use crate::search::{SearchRules, SearchSettings};

/// Image heights in mm: from the middle of a full frame nearly to its corner.
const HEIGHTS: [f64; 4] = [0.0, 7.0, 14.0, 21.0];

/// A lens of the thesis's figures, and its file.
#[derive(Debug, Clone, Copy)]
struct StudyLens {
    name: &'static str,
    file: &'static str,
}

/// The four lenses.
const STUDY_LENSES: [StudyLens; 4] = [
    StudyLens { name: "wide-angle, 28 mm", file: "wide_nikkor_28_f28" },
    StudyLens { name: "normal, 50 mm", file: "double_gauss_nikkor_s_50" },
    StudyLens { name: "macro, 105 mm", file: "macro_micro_nikkor_105_f28" },
    StudyLens { name: "telephoto, 135 mm", file: "telephoto_nikkor_135_f28" },
];

/// A lens of the library at four image heights, in one colour, focused at infinity, limited by its
/// stop.
fn at_heights(file: &str) -> Result<Lens, ExperimentError> {
    let single = at_zoom(&lens(file)?, 0);
    let focal = focal_length(&single)?;
    let angles = HEIGHTS.map(|height| (height / focal).atan().to_degrees());
    limited_by_stop(&with_field_angles(single, &angles)).map_err(ExperimentError::from_error)
}

/// What may be done to the four lenses: the largest of them has ten elements.
fn rules() -> SearchRules {
    SearchRules { elements: [2, 12], ..SearchRules::default() }
}

/// A search of a lens with one chain, as the thesis has it, over so many gradients: sharp spots, all
/// of the light, the limits that the lens keeps.
fn plan(start: &Lens, rules: SearchRules, gradients: u64) -> Result<SearchPlan, ExperimentError> {
    let usual = goal(start, &rules, None, 1.0).map_err(ExperimentError::from_error)?;
    let kept = relaxed_limits::relax_limits(start, &usual).map_err(ExperimentError::from_error)?;
    let default = SearchPlan::default();
    let settings = SearchSettings { chains: 1, gradients: Some(gradients), ..default.settings };
    Ok(SearchPlan { goal: Some(kept), rules, settings, ..default })
}
