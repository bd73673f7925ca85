//! The Pareto front of sharpness against light: the lenses that cannot gain one without losing the
//! other.
//!
//! For each weight β the objective `L_spot + β L_throughput` (Teh, *Computational Lens Design*, eq.
//! 3.26) is minimized, starting from the result of the weight before. At the optimum the marginal
//! ray misses the centroid by √β, so weights are given as this blur. Every lens evaluated on the
//! way may join the front; dominated lenses are removed.
//!
//! A descent gives up light faster than it corrects aberrations, and does not regain light lost at
//! the start. So a chain of weights begins with a corrected lens: once corrected at the largest
//! weight, and once with frozen pupils, as without the derivative of light. From either, the
//! weights fall in one chain and rise in another. The four chains run in parallel, so that the
//! result does not depend on the number of cores. The caller owns the loop.

use super::{DescentMethod, Optimizer, start, start_annealed};
use crate::analysis::{AnalysisError, image_quality};
use crate::lens::{Lens, LensError, ParameterKind, Quantity, add_variables};
use crate::merit::{
    Goal, LimitTreatment, MAX_STEEPNESS, Merit, MeritError, PupilEdge, Term, WeightedTerm,
};
use crate::pupil::{RayModelError, limited_by_stop};
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

/// The settings of a Pareto sweep.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct ParetoSettings {
    /// The number of weights.
    pub points: usize,
    /// The local optimizer.
    pub method: DescentMethod,
    /// The maximum number of steps for each weight.
    pub steps: usize,
    /// The blur of the marginal ray √β that defines the smallest and the largest weight, relative
    /// to the focal length.
    pub blur: [f64; 2],
    /// The treatment of the pupil edge in derivatives.
    pub pupil: PupilEdge,
    /// The relative error allowed for the radius of each spot during the sweep.
    pub tolerance: f64,
    /// The factors by which a semi-diameter may shrink and grow.
    #[serde(rename = "rims")]
    pub semi_diameter_factors: [f64; 2],
}

impl Default for ParetoSettings {
    fn default() -> Self {
        Self {
            points: 20,
            method: DescentMethod::Adam,
            steps: 500,
            blur: [4e-5, 3.5e-3],
            pupil: PupilEdge::Moving,
            tolerance: 1e-3,
            semi_diameter_factors: [0.25, 1.3],
        }
    }
}

/// A lens with its sharpness and light.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct ParetoPoint {
    /// The lens.
    #[serde(skip)]
    pub lens: Lens,
    /// The weight β that it was found with, in mm²; `None` for the starting lens.
    pub weight: Option<f64>,
    /// The RMS spot radius over fields and wavelengths, in mm.
    pub spot: f64,
    /// Its estimated error, in mm.
    pub spot_error: f64,
    /// The mean area of its pupils in the first vertex plane, in mm².
    pub light: f64,
    /// Its estimated error, in mm².
    pub light_error: f64,
    /// True if light gets through at every field; without light there is no spot.
    #[serde(skip)]
    pub has_light: bool,
    /// The number of rays that these numbers are computed from.
    pub rays: usize,
}

impl ParetoPoint {
    /// Evaluates the sharpness and light of a lens; spot radii are accurate to a relative tolerance.
    ///
    /// # Errors
    /// A lens that cannot be set up, or through which no light gets.
    pub fn evaluate(lens: &Lens, weight: Option<f64>, tolerance: f64) -> Result<Self, ParetoError> {
        let quality = image_quality(lens, tolerance)?;
        let spot = quality.spot?;
        Ok(Self {
            lens: lens.clone(),
            weight,
            spot: spot.value,
            spot_error: spot.error,
            light: quality.light.value,
            light_error: quality.light.error,
            has_light: quality.is_fully_lit,
            rays: spot.rays,
        })
    }

    /// True if it is at least as sharp and as bright as another one, and better in one of the two.
    pub fn dominates(&self, other: &Self) -> bool {
        let no_worse = self.spot <= other.spot && self.light >= other.light;
        no_worse && (self.spot < other.spot || self.light > other.light)
    }
}

/// Lenses of which none dominates another in sharpness and light, in the order of increasing light.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Front {
    points: Vec<ParetoPoint>,
}

impl Front {
    /// The lenses of the front.
    pub fn points(&self) -> &[ParetoPoint] {
        &self.points
    }

    /// Inserts a lens unless one of the front is at least as good, and removes those that it
    /// dominates. Returns true if it was inserted.
    pub fn insert(&mut self, design: ParetoPoint) -> bool {
        let no_worse = |d: &ParetoPoint| d.spot <= design.spot && d.light >= design.light;
        let sound = design.spot.is_finite() && design.light.is_finite() && design.has_light;
        if !sound || self.points.iter().any(no_worse) {
            return false;
        }
        self.points.retain(|other| !design.dominates(other));
        let place = self.points.partition_point(|other| other.light < design.light);
        self.points.insert(place, design);
        true
    }

    /// The hypervolume of the front: the area that it dominates in the plane of spot and light, up
    /// to a reference spot in mm, in multiples of that spot times a reference light in mm² (Zitzler
    /// and Thiele, PPSN V, 1998).
    pub fn hypervolume(&self, spot: f64, light: f64) -> f64 {
        let (mut covered, mut below) = (0.0, 0.0);
        for design in self.points.iter().filter(|design| design.spot < spot) {
            covered += (spot - design.spot) * (design.light - below);
            below = design.light;
        }
        covered / (spot * light)
    }

    /// The hypervolume relative to a starting lens: up to twice its spot, in multiples of its spot
    /// times its light.
    pub fn relative_hypervolume(&self, start: &ParetoPoint) -> f64 {
        self.hypervolume(REFERENCE_SPOT * start.spot, start.light)
    }
}

/// The error of a Pareto sweep that cannot start.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum ParetoError {
    /// The lens.
    #[error(transparent)]
    RayModel(#[from] RayModelError),
    /// The prescription is invalid.
    #[error(transparent)]
    Lens(#[from] LensError),
    /// No light gets through it.
    #[error(transparent)]
    NoLight(#[from] AnalysisError),
    /// The lens has no merit.
    #[error(transparent)]
    Merit(#[from] MeritError),
    /// The merit function of the lens asks for what a front does not compare.
    #[error(
        "the merit function of the lens has the term `as_built`, and a front compares lenses as they \
         are designed; expected the term `spot` in its place, or `aplanat optimize --as-built`"
    )]
    AsBuilt,
    /// A setting is out of its range.
    #[error("{what} is {found}; expected {expected}")]
    Settings {
        /// The setting.
        what: &'static str,
        /// Its value.
        found: String,
        /// The values allowed.
        expected: &'static str,
    },
}

/// The largest spot that counts for the hypervolume, relative to that of the starting lens.
const REFERENCE_SPOT: f64 = 2.0;
/// The steps of the initial correction of a chain, in multiples of the steps per weight.
const FIRST: usize = 3;
/// The number of steps of a chain between two reports.
const STEPS_PER_SLICE: usize = 25;
/// The relative accuracy of the numbers that lenses are compared by.
const EVALUATION_TOLERANCE: f64 = 1e-4;
/// The fraction of its light that every field has to retain.
const MIN_LIGHT: f64 = 0.1;

/// A Pareto sweep in progress.
#[derive(Debug)]
pub struct ParetoSweep {
    /// The starting lens, limited by its stop.
    pub start: ParetoPoint,
    settings: ParetoSettings,
    chains: Vec<SweepChain>,
    front: Front,
    evaluated: Vec<[f64; 2]>,
    done: usize,
}

/// A sequence of weights, each starting from the result of the one before.
#[derive(Debug)]
struct SweepChain {
    lens: Lens,
    goal: Goal,
    /// The weight and the treatment of the pupil of the initial correction, until it has begun.
    first_correction: Option<(f64, PupilEdge)>,
    /// The remaining weights, the next one last.
    weights: Vec<f64>,
    method: DescentMethod,
    steps: usize,
    tolerance: f64,
    active: Option<ActiveDescent>,
    refused: Option<String>,
}

/// The descent for one weight.
#[derive(Debug)]
struct ActiveDescent {
    weight: f64,
    search: Box<dyn Optimizer>,
    /// The number of steps that it may still take.
    remaining_steps: usize,
}

/// The progress of a sweep after one call of [`ParetoSweep::step`].
#[derive(Debug, Clone, PartialEq)]
pub struct SweepProgress {
    /// The number of steps so far over all chains; steps that a descent did not need count as
    /// taken.
    pub done: usize,
    /// The total number of steps.
    pub total: usize,
    /// The number of lenses that joined the front.
    pub joined: usize,
    /// The reason for which the latest descent could not start, if any.
    pub refused: Option<String>,
    /// True if all weights are done.
    pub finished: bool,
}

impl ParetoSweep {
    /// Prepares a sweep. In a lens without variables all curvatures, thicknesses and semi-diameters
    /// become variables; in one with variables the semi-diameters are added to them.
    ///
    /// # Errors
    /// A lens without a merit, or a setting out of its range.
    pub fn new(lens: &Lens, settings: &ParetoSettings) -> Result<Self, ParetoError> {
        settings.check()?;
        check_goal(lens)?;
        let lens = with_sweep_variables(&limited_by_stop(lens)?, settings.semi_diameter_factors);
        lens.check()?;
        let start = ParetoPoint::evaluate(&lens, None, EVALUATION_TOLERANCE)?;
        let goal = weighted_sum_goal(&lens, start.light, settings.pupil)?;
        let weights = settings.weights(goal_focal_length(&goal, &lens));
        let last = weights.last().copied().unwrap_or(0.0);
        let begin = [(last, goal.pupil), (0.0, PupilEdge::Frozen)];
        let both = begin.into_iter().flat_map(|begin| [(begin, true), (begin, false)]);
        let chain = |(begin, falling)| SweepChain {
            lens: lens.clone(),
            goal: goal.clone(),
            first_correction: Some(begin),
            // The next one is the last.
            weights: if falling {
                weights.clone()
            } else {
                weights.iter().rev().copied().collect()
            },
            method: settings.method,
            steps: settings.steps,
            tolerance: settings.tolerance,
            active: None,
            refused: None,
        };
        let chains: Vec<SweepChain> = both.map(chain).collect();
        // A lens without a merit is an error of the sweep, not of a single weight.
        Merit::new(&lens, &goal, settings.tolerance)?;
        let mut front = Front::default();
        front.insert(start.clone());
        let settings = settings.clone();
        Ok(Self { start, settings, chains, front, evaluated: Vec::new(), done: 0 })
    }

    /// Advances every chain by up to 25 steps, on all cores.
    pub fn step(&mut self) -> SweepProgress {
        let found: Vec<Vec<ParetoPoint>> =
            self.chains.par_iter_mut().map(SweepChain::run_slice).collect();
        let mut joined = 0;
        for design in found.into_iter().flatten() {
            self.evaluated.push([design.spot, design.light]);
            joined += usize::from(self.front.insert(design));
        }
        let left: usize = self.chains.iter().map(SweepChain::remaining_steps).sum();
        self.done = self.total() - left;
        let refused = self.chains.iter_mut().filter_map(|chain| chain.refused.take()).last();
        let (done, total) = (self.done, self.total());
        SweepProgress { done, total, joined, refused, finished: left == 0 }
    }

    /// The front so far.
    pub fn front(&self) -> &Front {
        &self.front
    }

    /// The spot in mm and the light in mm² of every lens evaluated.
    pub fn evaluated(&self) -> &[[f64; 2]] {
        &self.evaluated
    }

    /// The hypervolume of the front against twice the spot of the lens at the start.
    pub fn hypervolume(&self) -> f64 {
        self.front.relative_hypervolume(&self.start)
    }

    fn total(&self) -> usize {
        self.settings.steps * self.chains.len() * (self.settings.points + FIRST)
    }
}

impl ParetoSettings {
    fn check(&self) -> Result<(), ParetoError> {
        let refuse =
            |what, found: String, expected| Err(ParetoError::Settings { what, found, expected });
        let [low, high] = self.blur;
        let [narrow, wide] = self.semi_diameter_factors;
        if self.points == 0 || self.points > 1000 {
            return refuse("the number of points", self.points.to_string(), "1 to 1000");
        }
        if self.steps == 0 {
            return refuse("the number of steps", "0".to_owned(), "at least 1");
        }
        if !(low > 0.0 && low <= high && high < 1.0) {
            return refuse("the blur", format!("{low} to {high}"), "0 < smallest <= largest < 1");
        }
        if !(narrow > 0.0 && narrow <= 1.0 && wide >= 1.0 && wide.is_finite()) {
            return refuse(
                "the range of semi-diameters",
                format!("{narrow} to {wide}"),
                "0 < a <= 1 <= b",
            );
        }
        if !(self.tolerance > 0.0 && self.tolerance < 1.0) {
            return refuse("the tolerance", self.tolerance.to_string(), "between 0 and 1");
        }
        Ok(())
    }

    /// The weights in mm², ascending.
    fn weights(&self, focal_length: f64) -> Vec<f64> {
        let [low, high] = self.blur;
        let last = (self.points - 1).max(1) as f64;
        let blur = |i: usize| focal_length * low * (high / low).powf(i as f64 / last);
        (0..self.points).map(|i| blur(i).powi(2)).collect()
    }
}

impl SweepChain {
    /// Takes the next steps and evaluates the resulting lens.
    fn run_slice(&mut self) -> Vec<ParetoPoint> {
        if self.active.is_none() {
            self.start_next();
        }
        let Some(ActiveDescent { weight, search, remaining_steps: left }) = &mut self.active else {
            return Vec::new();
        };
        for _ in 0..STEPS_PER_SLICE.min(*left) {
            *left -= 1;
            if search.step().finished {
                *left = 0;
                break;
            }
        }
        let judge =
            |lens: &Lens| ParetoPoint::evaluate(lens, Some(*weight), EVALUATION_TOLERANCE).ok();
        if *left > 0 {
            return judge(search.current()).into_iter().collect();
        }
        search.verify_best();
        self.lens.clone_from(search.best());
        let found = judge(&self.lens);
        self.active = None;
        found.into_iter().collect()
    }

    fn start_next(&mut self) {
        let begin = self.first_correction.take();
        let left = if begin.is_some() { FIRST * self.steps } else { self.steps };
        let next = begin.or_else(|| Some((self.weights.pop()?, self.goal.pupil)));
        let Some((weight, pupil)) = next else { return };
        let mut goal = Goal { pupil, ..self.goal.clone() };
        if weight > 0.0 {
            goal.terms.push(WeightedTerm::new(Term::Throughput, weight));
        }
        let search = match self.method {
            DescentMethod::Adam => start_annealed(&self.lens, &goal, self.tolerance, left),
            DescentMethod::TrustRegion | DescentMethod::DampedLeastSquares => {
                start(self.method, &self.lens, &goal, self.tolerance)
            }
        };
        match search {
            Ok(search) => {
                self.active = Some(ActiveDescent { weight, search, remaining_steps: left });
            }
            Err(cause) => self.refused = Some(cause.to_string()),
        }
    }

    /// The maximum number of remaining steps.
    fn remaining_steps(&self) -> usize {
        let coming = self.weights.len() + if self.first_correction.is_some() { FIRST } else { 0 };
        coming * self.steps + self.active.as_ref().map_or(0, |running| running.remaining_steps)
    }
}

/// The objective (3.26) without its term for light, for a lens with this mean area of its pupils in
/// mm²: the integrals of the spots, and the constraints of the default goal: focal length,
/// thicknesses that can be manufactured, limited steepness, and a minimum of light at every field.
///
/// # Errors
/// A lens without first-order data.
pub fn weighted_sum_goal(lens: &Lens, light: f64, pupil: PupilEdge) -> Result<Goal, MeritError> {
    let default_goal = Goal::default_for(lens)?;
    let mut terms = vec![WeightedTerm::new(Term::SpotIntegral, 1.0)];
    // The integral of a spot is its mean square radius times the light, so the other terms are
    // scaled by the light too.
    let others =
        default_goal.terms.into_iter().filter(|w| !matches!(w.term, Term::Spot | Term::Light(_)));
    terms.extend(others.map(|w| WeightedTerm { weight: light * w.weight, ..w }));
    terms.push(WeightedTerm::new(Term::Steepness(MAX_STEEPNESS), light));
    // No field may go dark: an empty spot would be the sharpest of all.
    let light_term = terms[0].weight * light * goal_size(lens).powi(2);
    terms.push(WeightedTerm::new(Term::Light(MIN_LIGHT), light_term));
    Ok(Goal {
        terms,
        pupil,
        zoom_ratios: default_goal.zoom_ratios,
        limits: LimitTreatment::Penalties,
    })
}

/// Refuses a merit function of the lens that counts how it is made.
fn check_goal(lens: &Lens) -> Result<(), ParetoError> {
    let mut terms = lens.merit.iter().flat_map(|goal| &goal.terms);
    let is_as_built = |weighted: &WeightedTerm| matches!(weighted.term, Term::AsBuilt { .. });
    if terms.any(is_as_built) { Err(ParetoError::AsBuilt) } else { Ok(()) }
}

/// The spot radius in mm at which a violated minimum of light outweighs sharpness.
fn goal_size(lens: &Lens) -> f64 {
    1e-3 * lens.total_track()
}

/// The target focal length of the goal in mm, or the total track of an afocal lens.
fn goal_focal_length(goal: &Goal, lens: &Lens) -> f64 {
    let asked = goal.terms.iter().find_map(|w| match w.term {
        Term::FocalLength(focal) => Some(focal.abs()),
        _ => None,
    });
    asked.unwrap_or_else(|| lens.total_track())
}

/// The lens with the variables of a sweep and the bounds of its semi-diameters.
fn with_sweep_variables(lens: &Lens, [narrow, wide]: [f64; 2]) -> Lens {
    let mut lens = lens.clone();
    let own: Vec<_> = lens.variables.clone();
    if own.is_empty() {
        add_variables(&mut lens, &[ParameterKind::Curvatures, ParameterKind::Thicknesses]);
    }
    add_variables(&mut lens, &[ParameterKind::SemiDiameters]);
    let sizes: Vec<Option<f64>> = lens.surfaces.iter().map(|row| row.semi_diameter).collect();
    for variable in &mut lens.variables {
        if let (Quantity::SemiDiameter, Some(size)) =
            (variable.parameter.quantity, sizes[variable.parameter.surface])
        {
            variable.min = variable.min.or(Some(narrow * size));
            variable.max = variable.max.or(Some(wide * size));
        }
    }
    lens
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::lens::{Parameter, Variable, blank};

    #[test]
    fn the_blurs_of_a_sweep_are_a_geometric_sequence_between_their_ends() {
        let settings =
            ParetoSettings { points: 6, blur: [2e-5, 7e-3], ..ParetoSettings::default() };
        let blurs: Vec<f64> = settings.weights(80.0).into_iter().map(f64::sqrt).collect();
        assert_eq!(blurs.len(), 6);
        assert!((blurs[0] / (80.0 * 2e-5) - 1.0).abs() < 1e-12, "{blurs:?}");
        assert!((blurs[5] / (80.0 * 7e-3) - 1.0).abs() < 1e-12, "{blurs:?}");
        let ratio = (7e-3f64 / 2e-5).powf(0.2);
        assert!(blurs.windows(2).all(|pair| (pair[1] / pair[0] / ratio - 1.0).abs() < 1e-12));
        let one = ParetoSettings { points: 1, ..settings };
        assert_eq!(one.weights(80.0), [(80.0f64 * 2e-5).powi(2)]);
    }

    /// Rims may vary by the factors of the sweep, but for the bounds that they have already.
    #[test]
    fn the_rims_of_a_sweep_are_bounded_by_factors_of_their_size() {
        let mut lens = blank();
        lens.surfaces[1].semi_diameter = Some(8.0);
        let own = Parameter::new(1, Quantity::SemiDiameter);
        lens.variables.push(Variable { parameter: own, min: None, max: Some(9.0) });
        let free = with_sweep_variables(&lens, [0.5, 1.25]);
        let bounds = |surface: usize| {
            let rim = Parameter::new(surface, Quantity::SemiDiameter);
            let found = free.variables.iter().find(|variable| variable.parameter == rim).unwrap();
            [found.min, found.max]
        };
        assert_eq!([bounds(0), bounds(1)], [[Some(5.0), Some(12.5)], [Some(4.0), Some(9.0)]]);
    }

    /// The first correction of a chain is the descent of its goal with the pupil of the correction.
    #[test]
    fn a_chain_begins_with_the_pupil_of_its_correction() {
        let found = crate::files::bundled_lenses();
        let found = found.iter().find(|b| b.name == "double_gauss_rudolph_50").unwrap();
        let lens = crate::files::json::read(found.text, found.name).unwrap();
        let lens = with_sweep_variables(&limited_by_stop(&lens).unwrap(), [0.5, 1.5]);
        let goal = weighted_sum_goal(&lens, 100.0, PupilEdge::Moving).unwrap();
        let method = DescentMethod::TrustRegion;
        let descent = |pupil: PupilEdge| {
            let goal = Goal { pupil, ..goal.clone() };
            let mut search = start(method, &lens, &goal, 1e-2).unwrap();
            (0..3).for_each(|_| drop(search.step()));
            search.current().clone()
        };
        assert!(descent(PupilEdge::Frozen) != descent(PupilEdge::Moving));
        let mut chain = SweepChain {
            lens: lens.clone(),
            goal: goal.clone(),
            first_correction: Some((0.0, PupilEdge::Frozen)),
            weights: Vec::new(),
            method,
            steps: 1,
            tolerance: 1e-2,
            active: None,
            refused: None,
        };
        chain.start_next();
        let mut search = chain.active.unwrap().search;
        (0..3).for_each(|_| drop(search.step()));
        assert!(*search.current() == descent(PupilEdge::Frozen));
    }
}
