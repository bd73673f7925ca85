//! The Pareto front of sharpness against light: the lenses that cannot gain one without losing the
//! other. The sharpness is that of the spots of a lens as designed, or as built, where its merit function
//! or the settings ask for that.
//!
//! A front is found by problems of one number each, every one starting from the result of the one
//! before: for levels of light the sharpest lens with at least so much, or for weights β the least
//! `L_spot + β L_throughput` (Teh, *Computational Lens Design*, eq. 3.26). Every lens evaluated on
//! the way may join the front; dominated lenses are removed. Several chains of problems run in
//! parallel, so that the result does not depend on the number of cores. The caller owns the loop.

mod light_levels;
mod weighted_sum;

pub use weighted_sum::weighted_sum_goal;

use super::DescentMethod;
use crate::analysis::{AnalysisError, image_quality};
use crate::lens::{Lens, LensError, ParameterKind, Quantity, ToleranceGrade, add_variables};
use crate::merit::{Goal, LimitTreatment, Merit, MeritError, PupilEdge, Term, WeightedTerm};
use crate::pupil::{RayModelError, limited_by_stop};
use light_levels::LightWalk;
use rayon::prelude::*;
use serde::{Deserialize, Serialize};
use std::fmt::Debug;
use weighted_sum::WeightChain;

/// The settings of a Pareto sweep.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct ParetoSettings {
    /// The number of levels of light, or of weights.
    pub points: usize,
    /// The problems whose solutions make up the front.
    pub scalarization: Scalarization,
    /// The local optimizer of a weighted sum; for a level of light it is the trust region.
    pub method: DescentMethod,
    /// The maximum number of steps for each level or weight.
    pub steps: usize,
    /// The least and the most light that is asked for, relative to that at the start.
    pub light: [f64; 2],
    /// The blur of the marginal ray √β that defines the smallest and the largest weight, relative
    /// to the focal length.
    pub blur: [f64; 2],
    /// The treatment of the pupil edge in derivatives.
    pub pupil: PupilEdge,
    /// The relative error allowed for the radius of each spot during the sweep.
    pub tolerance: f64,
    /// The class of care in making of lenses that are compared as they are built; `None` to compare
    /// them as designed, or as the term `as_built` of the merit function of the lens says.
    pub as_built: Option<ToleranceGrade>,
    /// The factors by which a semi-diameter may shrink and grow.
    #[serde(rename = "rims")]
    pub semi_diameter_factors: [f64; 2],
}

impl Default for ParetoSettings {
    fn default() -> Self {
        Self {
            points: 20,
            scalarization: Scalarization::default(),
            method: DescentMethod::Adam,
            steps: LEVEL_STEPS,
            light: [0.4, 2.0],
            blur: [4e-5, 3.5e-3],
            pupil: PupilEdge::Moving,
            tolerance: 1e-3,
            as_built: None,
            semi_diameter_factors: [0.25, 1.3],
        }
    }
}

/// The problems of one number each whose solutions make up the front.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Scalarization {
    /// The sharpest lens with at least so much light, for levels of light. Frozen pupils have no
    /// derivative of the light, and a sweep with them is one of weighted sums all the same.
    #[default]
    EpsilonConstraint,
    /// The least weighted sum of spot and light (3.26), for weights.
    WeightedSum,
}

impl ParetoSettings {
    /// The settings of the sweep of the thesis: weighted sums, by Adam.
    pub fn weighted_sum() -> Self {
        let scalarization = Scalarization::WeightedSum;
        Self { scalarization, steps: WEIGHT_STEPS, ..Self::default() }
    }

    /// The settings of a sweep with frozen pupils to compare with.
    #[must_use]
    pub fn biased(&self) -> Self {
        let steps = match self.scalarization {
            Scalarization::WeightedSum => self.steps,
            Scalarization::EpsilonConstraint => WEIGHT_STEPS,
        };
        let scalarization = Scalarization::WeightedSum;
        Self { scalarization, steps, pupil: PupilEdge::Frozen, ..self.clone() }
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
    /// The least light that was asked for when it was found, in mm².
    pub min_light: Option<f64>,
    /// The RMS spot radius over fields and wavelengths, in mm.
    pub spot: f64,
    /// Its estimated error, in mm.
    pub spot_error: f64,
    /// The RMS spot radius as built, in mm, when each lens is refocused; `None` for lenses that are
    /// compared as designed.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub as_built: Option<AsBuiltRadius>,
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

/// The expected RMS spot radius of lenses as they are built.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct AsBuiltRadius {
    /// The radius in mm.
    pub value: f64,
    /// Its estimated error by the rays, in mm.
    pub error: f64,
}

impl ParetoPoint {
    /// The number that lenses are compared by, in mm: the RMS spot radius, as built if that is known.
    pub fn radius(&self) -> f64 {
        self.as_built.map_or(self.spot, |as_built| as_built.value)
    }

    /// The same point with the radius of a term for lenses as built, if there is one.
    ///
    /// # Errors
    /// A lens to which the term does not apply.
    fn with_as_built(self, made: Option<Term>, tolerance: f64) -> Result<Self, ParetoError> {
        let Some(term) = made else { return Ok(self) };
        let mut lens = self.lens.clone();
        if lens.variables.is_empty() {
            add_variables(&mut lens, &[ParameterKind::Curvatures]);
        }
        let goal = Goal {
            terms: vec![WeightedTerm::new(term, 1.0)],
            pupil: PupilEdge::Frozen,
            zoom_ratios: Vec::new(),
            limits: LimitTreatment::Penalties,
        };
        let merit = Merit::new(&lens, &goal, tolerance)?;
        let terms = merit.terms(&merit.values(&lens))?;
        let [square, error] = terms.first().map_or([0.0; 2], |term| [term.value, term.error]);
        let value = square.max(0.0).sqrt();
        let error = if value > 0.0 { 0.5 * error / value } else { 0.0 };
        Ok(Self { as_built: Some(AsBuiltRadius { value, error }), ..self })
    }

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
            min_light: None,
            spot: spot.value,
            spot_error: spot.error,
            as_built: None,
            light: quality.light.value,
            light_error: quality.light.error,
            has_light: quality.is_fully_lit,
            rays: spot.rays,
        })
    }

    /// True if it is at least as sharp and as bright as another one, and better in one of the two.
    pub fn dominates(&self, other: &Self) -> bool {
        let (own, theirs) = (self.radius(), other.radius());
        let no_worse = own <= theirs && self.light >= other.light;
        no_worse && (own < theirs || self.light > other.light)
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
        let radius = design.radius();
        let no_worse = |d: &ParetoPoint| d.radius() <= radius && d.light >= design.light;
        let sound = radius.is_finite() && design.light.is_finite() && design.has_light;
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
        for design in self.points.iter().filter(|design| design.radius() < spot) {
            covered += (spot - design.radius()) * (design.light - below);
            below = design.light;
        }
        covered / (spot * light)
    }

    /// The hypervolume relative to a starting lens: up to twice its spot, in multiples of its spot
    /// times its light.
    pub fn relative_hypervolume(&self, start: &ParetoPoint) -> f64 {
        self.hypervolume(REFERENCE_SPOT * start.radius(), start.light)
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
    /// A weighted sum of the light and of the spots as built is asked for.
    #[error(
        "a front of lenses as built is one of levels of light; expected these, with derivatives that \
         follow the edge of the pupil"
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

/// The default maximum numbers of steps for a level of light and for a weight.
const LEVEL_STEPS: usize = 60;
const WEIGHT_STEPS: usize = 500;
/// The most light that may be asked for, relative to the start.
const MOST_LIGHT: f64 = 100.0;
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
    chains: Vec<Box<dyn SweepChain>>,
    front: Front,
    evaluated: Vec<[f64; 2]>,
    /// The steps of all chains at the start.
    total: usize,
}

/// A sequence of descents, each starting from the result of the one before.
trait SweepChain: Send + Sync + Debug {
    /// Takes up to [`STEPS_PER_SLICE`] steps; returns lenses found on the way.
    fn run_slice(&mut self) -> Vec<ParetoPoint>;
    /// The maximum number of remaining steps.
    fn remaining_steps(&self) -> usize;
    /// The latest reason for which a descent could not start or did not reach what was asked, once.
    fn take_refusal(&mut self) -> Option<String>;
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
        let made = as_built_term(lens, settings);
        if made.is_some() && settings.effective_scalarization() == Scalarization::WeightedSum {
            return Err(ParetoError::AsBuilt);
        }
        let lens = with_sweep_variables(&limited_by_stop(lens)?, settings.semi_diameter_factors);
        lens.check()?;
        let start = ParetoPoint::evaluate(&lens, None, EVALUATION_TOLERANCE)?;
        let start = start.with_as_built(made, EVALUATION_TOLERANCE)?;
        let chains = chains(&lens, start.light, settings)?;
        let mut front = Front::default();
        front.insert(start.clone());
        let total = remaining_steps(&chains);
        Ok(Self { start, chains, front, evaluated: Vec::new(), total })
    }

    /// Advances every chain by up to 25 steps, on all cores.
    pub fn step(&mut self) -> SweepProgress {
        let found: Vec<Vec<ParetoPoint>> =
            self.chains.par_iter_mut().map(|chain| chain.run_slice()).collect();
        let mut joined = 0;
        for design in found.into_iter().flatten() {
            self.evaluated.push([design.radius(), design.light]);
            joined += usize::from(self.front.insert(design));
        }
        let left = remaining_steps(&self.chains);
        let refused = self.chains.iter_mut().filter_map(|chain| chain.take_refusal()).last();
        // Levels that cannot be reached may be replaced by more steps than they had.
        self.total = self.total.max(left);
        let (done, total) = (self.total - left, self.total);
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
        let [dark, bright] = self.light;
        if !(dark > 0.0 && dark <= bright && bright <= MOST_LIGHT) {
            let expected = "0 < least <= most <= 100 times that at the start";
            return refuse("the light", format!("{dark} to {bright}"), expected);
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

    /// The scalarization that is possible with the pupils of these settings.
    fn effective_scalarization(&self) -> Scalarization {
        match self.pupil {
            PupilEdge::Moving => self.scalarization,
            PupilEdge::Frozen => Scalarization::WeightedSum,
        }
    }

    /// The levels of light relative to that at the start, ascending.
    fn light_shares(&self) -> Vec<f64> {
        geometric_sequence(self.light, self.points)
    }

    /// The weights in mm², ascending.
    fn weights(&self, focal_length: f64) -> Vec<f64> {
        let blurs = geometric_sequence(self.blur, self.points).into_iter();
        blurs.map(|blur| (focal_length * blur).powi(2)).collect()
    }
}

/// Numbers with equal ratios between two ends; one number is the first end.
fn geometric_sequence([low, high]: [f64; 2], count: usize) -> Vec<f64> {
    let last = (count - 1).max(1) as f64;
    (0..count).map(|i| low * (high / low).powf(i as f64 / last)).collect()
}

/// The spot radius in mm at which a violated minimum of light outweighs sharpness.
fn goal_size(lens: &Lens) -> f64 {
    1e-3 * lens.total_track()
}

/// The chains of a sweep from a lens with this mean area of its pupils in mm².
fn chains(
    lens: &Lens,
    light: f64,
    settings: &ParetoSettings,
) -> Result<Vec<Box<dyn SweepChain>>, ParetoError> {
    if settings.effective_scalarization() == Scalarization::WeightedSum {
        let goal = weighted_sum_goal(lens, light, settings.pupil)?;
        // A lens without a merit is an error of the sweep, not of a single weight.
        Merit::new(lens, &goal, settings.tolerance)?;
        let chains = WeightChain::all(lens, &goal, settings).into_iter();
        return Ok(chains.map(|chain| Box::new(chain) as Box<dyn SweepChain>).collect());
    }
    let walks = LightWalk::all(lens, light, settings)?.into_iter();
    Ok(walks.map(|walk| Box::new(walk) as Box<dyn SweepChain>).collect())
}

fn remaining_steps(chains: &[Box<dyn SweepChain>]) -> usize {
    chains.iter().map(|chain| chain.remaining_steps()).sum()
}

/// The term for lenses as built that a sweep compares by: that of the settings, or else that of the merit
/// function of the lens; `None` for lenses as designed.
pub fn as_built_term(lens: &Lens, settings: &ParetoSettings) -> Option<Term> {
    if let Some(grade) = settings.as_built {
        return Some(Term::AsBuilt { grade: Some(grade) });
    }
    let terms = lens.merit.iter().flat_map(|goal| &goal.terms).map(|weighted| weighted.term);
    terms.into_iter().find(|term| matches!(term, Term::AsBuilt { .. }))
}

/// The lens with the variables of a sweep and the bounds of its semi-diameters.
fn with_sweep_variables(lens: &Lens, [narrow, wide]: [f64; 2]) -> Lens {
    let mut lens = lens.clone();
    let own: Vec<_> = lens.variables.clone();
    if own.is_empty() {
        add_variables(&mut lens, &[ParameterKind::Curvatures, ParameterKind::Thicknesses]);
    }
    add_variables(&mut lens, &[ParameterKind::SemiDiameters]);
    let sizes: Vec<Option<f64>> = lens.variables.iter().map(|v| lens.get(v.parameter)).collect();
    for (variable, size) in lens.variables.iter_mut().zip(sizes) {
        if let (Quantity::SemiDiameter, Some(size)) = (variable.parameter.quantity, size) {
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
}
