//! The merit function: a sum of weighted terms, each with its derivatives by the variables.
//!
//! Every term is a sum of squares of residuals, so that the same code serves gradient descent
//! (value and gradient) and least squares (the normal equations). Spots are integrals over the
//! pupil: their quadrature nodes are found once to a tolerance and then stay fixed in the pupil
//! while the lens changes, so that an optimizer sees a smooth function; [`Merit::resample`] finds
//! them anew. Derivatives of the rays come from the adjoint trace, those of first-order data from
//! dual numbers.
//!
//! The set of transmitted rays changes with the lens. Unless the goal freezes it, its edge is
//! tracked at every evaluation, and derivatives include its motion (Teh, *Computational Lens
//! Design*, chapter 3): an optimizer can then be asked for light, and does not mistake clipping for
//! sharpness. A goal with frozen pupils has the usual, biased derivatives.

mod as_built;
mod binding;
mod constraints;
mod contrast;
mod defaults;
mod error_rays;
mod first_order;
mod ghosts;
mod goal;
mod light;
mod limits;
mod operands;
mod sampling;
mod scoped_part;
mod spot;
mod sum;
mod transfer;
mod variable_system;
mod wavefront;

pub use crate::lens::{
    Goal, LimitTreatment, OperandKind, PupilEdge, Term, TermScope, TermSelection, WeightedTerm,
};
pub use constraints::{ConstraintMargin, constraint_margins};
pub use defaults::{GoalLimits, LensFigures, MAX_STEEPNESS, default_terms};
pub use limits::{Limit, LimitedSum};
pub use sampling::SpotSampling;
pub use variable_system::VariableSystem;

use crate::analysis::WavefrontCost;
use crate::lens::{Lens, LensError, SurfaceNumber, Variable};
use crate::math::Dual;
use crate::pupil::{
    LaunchError, QuadraticIntegrand, RayModel, RayModelError, RegionKind, TracedPupil,
};
use crate::trace::{Fate, SystemGradient};
use as_built::MadeTolerances;
use binding::Configuration;
use error_rays::ErrorRays;
use nalgebra::DVector;
use rayon::prelude::*;
use sampling::{RaySampling, SampledPupil, SamplingDemand, TRANSFER_SCALE};
use serde::Serialize;
pub use sum::{DerivativeLevel, SumOfSquares};

/// The number of variables along which derivatives are computed together.
const SLOPES: usize = 8;

/// A number with its derivatives along some variables.
type VariableDual = Dual<f64, SLOPES>;

/// The error of a merit function that cannot be set up or evaluated.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum MeritError {
    /// The prescription is invalid.
    #[error(transparent)]
    Lens(#[from] LensError),
    /// The beam cannot be set up.
    #[error(transparent)]
    RayModel(#[from] RayModelError),
    /// No rays can be launched from a field.
    #[error("field {field} at zoom position {zoom}: {cause}")]
    Launch {
        /// The field, counted from 0.
        field: usize,
        /// The zoom position, counted from 0.
        zoom: usize,
        /// The cause.
        cause: LaunchError,
    },
    /// No light gets through.
    #[error("no light gets through at field {field}, zoom position {zoom}, {um} um")]
    NoLight {
        /// The field, counted from 0.
        field: usize,
        /// The zoom position.
        zoom: usize,
        /// The wavelength in micrometres.
        um: f64,
    },
    /// A ray of a spot no longer reaches the image.
    #[error(
        "ray {ray} of field {field} at zoom position {zoom}, {um} um, is lost: {} at surface {}",
        .fate.name(), SurfaceNumber::new(.fate.surface().unwrap_or(0))
    )]
    RayLost {
        /// The ray of the field, counted from 0.
        ray: usize,
        /// The field, counted from 0.
        field: usize,
        /// The zoom position.
        zoom: usize,
        /// The wavelength.
        um: f64,
        /// The fate of the ray.
        fate: Fate,
    },
    /// A value or derivative is not finite.
    #[error("the term `{term}` is not finite")]
    NotFinite {
        /// The term.
        term: &'static str,
    },
    /// A term does not apply to the lens.
    #[error("the term `{term}` does not apply: {why}")]
    DoesNotApply {
        /// The term.
        term: &'static str,
        /// The reason.
        why: &'static str,
    },
    /// No lens near the first one keeps all limits.
    #[error("no lens near this one keeps all of these limits: {}", .limits.join("; "))]
    ConflictingLimits {
        /// The limits that contradict each other; without any of them the others can be kept.
        limits: Vec<String>,
    },
    /// The lens has no variables.
    #[error(
        "the lens has no variables that change it; flag some in the file (`\"variables\"`), or name \
         kinds of numbers to vary"
    )]
    NoVariables,
}

/// The value of a term of the merit function.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct TermValue {
    /// The name of the term.
    pub term: &'static str,
    /// Its weight.
    pub weight: f64,
    /// Its value without the weight.
    pub value: f64,
    /// The estimated error of the value.
    pub error: f64,
    /// The number of rays that it is computed from.
    pub rays: usize,
    /// True if the rays of its pupils sample it to the tolerance that was asked for.
    pub reached: bool,
}

/// The forms of the pupils of a lens, by zoom position; none where pupils are frozen or not asked for.
#[derive(Debug, Clone, PartialEq)]
pub struct PupilForms(Vec<Vec<RegionKind>>);

/// The merit function of a lens: its goal, its variables, and the rays that sample it.
#[derive(Debug, Clone)]
pub struct Merit {
    goal: Goal,
    lens: Lens,
    variables: Vec<Variable>,
    zooms: Vec<Configuration>,
    samplings: Vec<RaySampling>,
    /// The initial areas of the pupils in mm², by zoom position.
    initial_areas: Vec<Vec<f64>>,
    /// The tolerances of terms about lenses that are made, by zoom position and term; `None` for
    /// other terms.
    tolerances: Vec<Vec<Option<MadeTolerances>>>,
    /// The rays of these terms, by zoom position; `None` where there is none.
    error_rays: Vec<Option<ErrorRays>>,
    tolerance: f64,
}

impl Merit {
    /// The merit function of a lens with its own variables; spots are good to `tolerance` of their
    /// radius.
    pub fn new(lens: &Lens, goal: &Goal, tolerance: f64) -> Result<Self, MeritError> {
        lens.check()?;
        let mut zooms = Vec::new();
        for zoom in 0..lens.zoom_positions() {
            zooms.push(Configuration::new(lens, zoom)?);
        }
        let mut merit = Self {
            goal: goal.clone(),
            lens: lens.clone(),
            variables: lens.variables.clone(),
            zooms,
            samplings: Vec::new(),
            initial_areas: Vec::new(),
            tolerances: Vec::new(),
            error_rays: Vec::new(),
            tolerance,
        };
        merit.goal.check(lens)?;
        if merit.goal.terms.iter().any(|weighted| weighted.term.concerns_temperature()) {
            merit.zooms.iter_mut().for_each(|zoom| zoom.find_temperature_changes(lens));
        }
        merit.resample(lens)?;
        merit.initial_areas = merit.samplings.iter().map(RaySampling::areas).collect();
        Ok(merit)
    }

    /// Finds the rays of the spots anew for a lens of the same structure.
    pub fn resample(&mut self, lens: &Lens) -> Result<(), MeritError> {
        let positions = 0..lens.zoom_positions();
        // A lens without light can be asked for light.
        let about_light = self.goal.terms.iter().any(|w| w.term.concerns_light());
        let dark = about_light && self.goal.pupil == PupilEdge::Moving;
        let demand = SamplingDemand::of_goal(&self.goal);
        let found: Result<Vec<_>, _> = positions
            .map(|zoom| RaySampling::new(lens, zoom, self.tolerance, dark, demand.clone()))
            .collect();
        self.samplings = found?;
        self.follow_rims(lens);
        let of_zoom = |(zoom, sampling): (usize, &RaySampling)| {
            let of_term = |w: &WeightedTerm| MadeTolerances::of_term(lens, zoom, sampling, w.term);
            self.goal.terms.iter().map(of_term).collect()
        };
        let tolerances: Result<_, _> = self.samplings.iter().enumerate().map(of_zoom).collect();
        self.tolerances = tolerances?;
        self.find_error_rays(lens)
    }

    /// Takes the edges of glass and air at the automatic rims of a lens of the same structure, which
    /// are held while the variables change.
    pub fn follow_rims(&mut self, lens: &Lens) {
        if self.goal.terms.iter().any(|weighted| weighted.term.concerns_rims()) {
            let rims = constraints::automatic_rims(lens);
            self.zooms.iter_mut().for_each(|zoom| zoom.set_clear_rims(&rims));
        }
    }

    /// The areas of the pupils of the lens with which the search began, by zoom position: what
    /// [`Term::Light`] compares with.
    pub fn initial_light(&self) -> &[Vec<f64>] {
        &self.initial_areas
    }

    /// The same merit, compared with the light of another lens of as many zoom positions, fields
    /// and wavelengths, whatever its structure.
    #[must_use]
    pub fn with_initial_light(mut self, light_at_start: &[Vec<f64>]) -> Self {
        self.initial_areas = light_at_start.to_vec();
        self
    }

    /// The same merit, which depends on the index of the gap behind each of some rows at each wavelength as
    /// well: row by row behind the values of the variables, as [`Merit::indices`] gives them.
    pub(crate) fn with_index_variables(mut self, lens: &Lens, rows: &[usize]) -> Self {
        self.zooms.iter_mut().for_each(|zoom| zoom.vary_indices(lens, rows));
        self
    }

    /// The indices of the gaps behind some rows at each wavelength, row by row.
    pub(crate) fn indices(&self, rows: &[usize]) -> Vec<f64> {
        self.zooms.first().map_or(Vec::new(), |zoom| zoom.indices(rows))
    }

    /// The goal.
    pub fn goal(&self) -> &Goal {
        &self.goal
    }

    /// The variables, in the order of all vectors.
    pub fn variables(&self) -> &[Variable] {
        &self.variables
    }

    /// The values of the variables in a lens.
    pub fn values(&self, lens: &Lens) -> Vec<f64> {
        self.variables.iter().map(|v| lens.get(v.parameter).unwrap_or(0.0)).collect()
    }

    /// The lens with these values of the variables and with its pickups resolved.
    pub fn lens(&self, values: &[f64]) -> Lens {
        let mut lens = self.lens.clone();
        for (variable, value) in self.variables.iter().zip(values) {
            lens.set(variable.parameter, *value);
        }
        // A lens that was checked has pickups that can be followed.
        lens.with_pickups().unwrap_or(lens)
    }

    /// True if light gets through at every field, zoom position and wavelength.
    pub fn has_light(&self) -> bool {
        self.samplings.iter().flat_map(|sampling| &sampling.pupils).all(|pupil| pupil.area > 0.0)
    }

    /// The sampling of each spot, by zoom position, field and wavelength; a spot without rays has
    /// no light and no weight.
    pub fn spot_samplings(&self) -> Vec<SpotSampling> {
        self.samplings.iter().flat_map(RaySampling::spot_samplings).collect()
    }

    /// The mean area of the pupils over all spots, in mm² of the first vertex plane. A goal without
    /// a term for light may gain sharpness by clipping, so compare it with that of the starting
    /// lens.
    pub fn light(&self) -> f64 {
        let sampled = self.spot_samplings();
        sampled.iter().map(|spot| spot.area).sum::<f64>() / sampled.len().max(1) as f64
    }

    /// True if no light gets through at any spot; false for a goal without spots.
    pub fn is_dark(&self) -> bool {
        let sampled = self.spot_samplings();
        !sampled.is_empty() && sampled.iter().all(|spot| !(spot.area > 0.0))
    }

    /// The merit at these values of the variables.
    pub fn value(&self, values: &[f64]) -> Result<f64, MeritError> {
        self.evaluate(values, DerivativeLevel::Value).map(|sum| sum.value)
    }

    /// The merit, with its derivatives and the normal matrix of its residuals as `level` asks.
    pub fn evaluate(
        &self,
        values: &[f64],
        level: DerivativeLevel,
    ) -> Result<SumOfSquares, MeritError> {
        self.evaluate_with_terms(values, level).map(|(total, _)| total)
    }

    /// The merit as [`Merit::evaluate`] gives it, and the value of each term, without its weight.
    ///
    /// # Errors
    /// As [`Merit::evaluate`].
    pub fn evaluate_with_terms(
        &self,
        values: &[f64],
        level: DerivativeLevel,
    ) -> Result<(SumOfSquares, Vec<TermValue>), MeritError> {
        let (sums, _) = self.evaluate_terms(values, level)?;
        let term_value = |(sum, weighted): (&SumOfSquares, &WeightedTerm)| {
            let (error, rays) = self.error_and_rays(weighted.term, sum.value);
            let (term, weight) = (weighted.term.name(), weighted.weight);
            let reached = self.is_sampled(weighted.term);
            TermValue { term, weight, value: sum.value, error, rays, reached }
        };
        let terms = sums.iter().zip(&self.goal.terms).map(term_value).collect();
        Ok((self.weighted_sum(&sums, values.len(), level), terms))
    }

    /// The merit as [`Merit::evaluate`] gives it, and the forms of the pupils that it is an integral over:
    /// [`Merit::follow_pupils`] takes them if the lens becomes the one to go on from.
    ///
    /// # Errors
    /// As [`Merit::evaluate`].
    pub fn evaluate_with_pupils(
        &self,
        values: &[f64],
        level: DerivativeLevel,
    ) -> Result<(SumOfSquares, PupilForms), MeritError> {
        let (sums, forms) = self.evaluate_terms(values, level)?;
        Ok((self.weighted_sum(&sums, values.len(), level), forms))
    }

    /// Tracks the edges of the pupils from these forms from now on. The rays stay: only the edges, which
    /// are functions of the lens, are looked for near others.
    pub fn follow_pupils(&mut self, forms: PupilForms) {
        for (sampling, forms) in self.samplings.iter_mut().zip(forms.0) {
            sampling.follow_pupils(forms);
        }
    }

    /// The sum of the terms, each times its weight.
    fn weighted_sum(
        &self,
        sums: &[SumOfSquares],
        variables: usize,
        level: DerivativeLevel,
    ) -> SumOfSquares {
        let mut total = SumOfSquares::zero(variables, level);
        for (sum, weighted) in sums.iter().zip(&self.goal.terms) {
            total.add(sum, weighted.weight);
        }
        total
    }

    /// The value of each term, without its weight.
    pub fn terms(&self, values: &[f64]) -> Result<Vec<TermValue>, MeritError> {
        self.evaluate_with_terms(values, DerivativeLevel::Value).map(|(_, terms)| terms)
    }

    /// The estimated error of a term and the number of its rays.
    fn error_and_rays(&self, term: Term, value: f64) -> (f64, usize) {
        let sampled = self.spot_samplings();
        let worst = sampled.iter().fold(0.0, |e: f64, s| e.max(s.error));
        let rays = sampled.iter().map(|s| s.rays).sum();
        match term {
            Term::Spot | Term::SpotIntegral | Term::Wavefront => (2.0 * worst * value, rays),
            Term::AsBuilt { .. } => {
                let of_errors = || self.error_rays.iter().flatten();
                let thinned = of_errors().map(|rays| rays.error).fold(0.0, f64::max);
                let more: usize = of_errors().map(|rays| rays.sampling.rays()).sum();
                ((2.0 * worst + thinned) * value, rays + more)
            }
            Term::Strehl => (self.transfer_error(), rays),
            Term::GeometricMtf { .. } | Term::Mtf { .. } => {
                let worst = self.transfer_error();
                (worst * (2.0 * value.max(0.0).sqrt() + worst), rays)
            }
            _ if term.concerns_light() => (worst * value.abs(), rays),
            Term::Distortion => (0.0, self.chief_ray_count()),
            Term::Operand { kind, .. } if kind.traces_chief_rays() => (0.0, self.chief_ray_count()),
            _ => (0.0, 0),
        }
    }

    /// The largest estimated error of a transfer.
    fn transfer_error(&self) -> f64 {
        self.samplings.iter().map(|sampling| sampling.transfer_error).fold(0.0, f64::max)
    }

    /// True if the rays of the pupils sample a term to the tolerance.
    fn is_sampled(&self, term: Term) -> bool {
        let worst = self.spot_samplings().iter().fold(0.0, |e: f64, s| e.max(s.error));
        match term {
            Term::GeometricMtf { .. } | Term::Mtf { .. } | Term::Strehl => {
                self.transfer_error() <= TRANSFER_SCALE * self.tolerance
            }
            _ if term.is_of_rays() || term.concerns_light() => worst <= self.tolerance,
            _ => true,
        }
    }

    fn chief_ray_count(&self) -> usize {
        self.samplings.iter().map(RaySampling::chief_count).sum()
    }

    /// The sum of squares of each term, averaged over the zoom positions, and the forms of the pupils.
    fn evaluate_terms(
        &self,
        values: &[f64],
        level: DerivativeLevel,
    ) -> Result<(Vec<SumOfSquares>, PupilForms), MeritError> {
        let mut sums = vec![SumOfSquares::zero(values.len(), level); self.goal.terms.len()];
        let mut forms = Vec::with_capacity(self.zooms.len());
        self.visit_positions(values, |context| {
            forms.push(context.pupil_forms());
            self.add_terms(context, |_| true, &mut sums)
        })?;
        self.average(&mut sums)?;
        Ok((sums, PupilForms(forms)))
    }

    /// Makes means over the zoom positions of sums over them.
    fn average(&self, sums: &mut [SumOfSquares]) -> Result<(), MeritError> {
        for (sum, weighted) in sums.iter_mut().zip(&self.goal.terms) {
            let scope = weighted.scope;
            let positions = (0..self.zooms.len()).filter(|i| scope.has(TermSelection::Zooms, *i));
            sum.scale(1.0 / positions.count() as f64);
            if !sum.is_finite() {
                return Err(MeritError::NotFinite { term: weighted.term.name() });
            }
        }
        Ok(())
    }

    /// Calls `visit` with the lens at every zoom position and its pupils, as far as a term needs
    /// them.
    fn visit_positions(
        &self,
        values: &[f64],
        mut visit: impl FnMut(&EvaluationContext<'_>) -> Result<(), MeritError>,
    ) -> Result<(), MeritError> {
        if !self.needs_pupil_edges() {
            return self.visit_without_pupils(values, visit);
        }
        self.visit_without_pupils(values, |context| {
            let EvaluationContext { zoom, sampling, .. } = *context;
            let model = zoom.ray_model(context.systems, &self.lens, sampling.aiming)?;
            let traced_pupils = &sampling.trace_pupils(&model, true)[..];
            sampling.check_light(traced_pupils)?;
            check_edge_motion(&model, traced_pupils)?;
            let sampling = &sampling.with_pupils(&model, traced_pupils);
            let of_errors = context.errors.map(|rays| {
                let traced = rays.sampling.trace_forms(&model, traced_pupils);
                (rays.sampling.with_pupils(&model, &traced), traced)
            });
            let errors = of_errors
                .as_ref()
                .map(|(sampling, traced_pupils)| PupilRays { sampling, traced_pupils });
            visit(&EvaluationContext { sampling, traced_pupils, errors, ..*context })
        })
    }

    /// Calls `visit` with the lens at every zoom position as it is without rays.
    fn visit_without_pupils(
        &self,
        values: &[f64],
        mut visit: impl FnMut(&EvaluationContext<'_>) -> Result<(), MeritError>,
    ) -> Result<(), MeritError> {
        let positions = self.zooms.iter().zip(&self.samplings).zip(&self.initial_areas);
        for (((zoom, sampling), initial_areas), error_rays) in positions.zip(&self.error_rays) {
            let systems = &zoom.at(values)?;
            let errors = error_rays
                .as_ref()
                .map(|rays| PupilRays { sampling: &rays.sampling, traced_pupils: &[] });
            visit(&EvaluationContext {
                zoom,
                sampling,
                systems,
                values,
                initial_areas,
                traced_pupils: &[],
                errors,
            })?;
        }
        Ok(())
    }

    /// True if some term depends on the edges of the pupils.
    fn needs_pupil_edges(&self) -> bool {
        let needs = |term: Term| term.is_of_rays() || term.concerns_light();
        self.goal.pupil == PupilEdge::Moving && self.goal.terms.iter().any(|w| needs(w.term))
    }

    /// Adds the chosen terms at a zoom position.
    fn add_terms(
        &self,
        context: &EvaluationContext<'_>,
        chosen: impl Fn(Term) -> bool,
        sums: &mut [SumOfSquares],
    ) -> Result<(), MeritError> {
        let zoom = context.zoom.zoom;
        let terms = sums.iter_mut().zip(&self.goal.terms).zip(&self.tolerances[zoom]);
        for ((sum, weighted), tolerances) in terms.filter(|((_, weighted), _)| {
            chosen(weighted.term) && weighted.scope.has(TermSelection::Zooms, zoom)
        }) {
            let scope = weighted.scope;
            match weighted.term {
                Term::Spot => spot::add_spot(context, spot::Normalization::PupilArea, scope, sum)?,
                Term::AsBuilt { .. } => {
                    spot::add_spot(context, spot::Normalization::PupilArea, scope, sum)?;
                    if let Some(tolerances) = tolerances {
                        as_built::add_growth(context, tolerances, scope, sum)?;
                    }
                }
                Term::SpotIntegral => {
                    spot::add_spot(context, spot::Normalization::Unnormalized, scope, sum)?;
                }
                Term::Wavefront => {
                    wavefront::add_wavefront(context, WavefrontCost::MeanSquare, scope, sum)?;
                }
                Term::Strehl => {
                    wavefront::add_wavefront(context, WavefrontCost::StrehlLoss, scope, sum)?;
                }
                Term::GeometricMtf { frequency, min } => {
                    contrast::add_contrast_shortfall(context, [frequency, min], scope, sum)?;
                }
                Term::Mtf { frequency, min } => {
                    let tolerance = TRANSFER_SCALE * self.tolerance;
                    let asked = transfer::TransferAsked { frequency, min, tolerance };
                    transfer::add_transfer_shortfall(context, asked, scope, sum)?;
                }
                Term::Ghosts { irradiance, reflectance } => {
                    ghosts::add_ghosts(context, irradiance, reflectance, sum)?;
                }
                Term::Distortion => spot::add_distortion(context, scope, sum)?,
                Term::FocalLength(target) => {
                    let target = self.goal.target(context.zoom.zoom, target);
                    first_order::focal_length(context, target, sum);
                }
                Term::Operand { .. } => operands::add_operand(context, *weighted, sum)?,
                term if term.concerns_light() => light::add_light_term(context, *weighted, sum),
                _ => constraints::add_constraints(context, *weighted, sum),
            }
        }
        Ok(())
    }
}

/// Refuses pupils whose edges' motion is unknown: irregular ones of a lens without a warp field.
fn check_edge_motion(model: &RayModel, pupils: &[TracedPupil<'_>]) -> Result<(), MeritError> {
    if !model.has_warp_field() && pupils.iter().any(TracedPupil::is_irregular) {
        let why = "the pupil is disconnected or not star-shaped, and the motion of its edge is unknown \
                   then in a lens with a gradient index, or with a tilted, decentred, freeform or ideal surface; \
                   expected a goal with frozen pupils";
        return Err(MeritError::DoesNotApply { term: "pupil", why });
    }
    Ok(())
}

/// A lens at one zoom position and some values of the variables.
struct EvaluationContext<'a> {
    zoom: &'a Configuration,
    sampling: &'a RaySampling,
    systems: &'a binding::ResolvedSystems,
    values: &'a [f64],
    /// The initial areas of the pupils, in mm².
    initial_areas: &'a [f64],
    /// The traced pupils of the sampling; empty if pupils are frozen.
    traced_pupils: &'a [TracedPupil<'a>],
    /// The rays of errors of making, where a term asks for them.
    errors: Option<PupilRays<'a>>,
}

/// The rays of all pupils of a lens.
#[derive(Clone, Copy)]
struct PupilRays<'a> {
    sampling: &'a RaySampling,
    /// Empty if pupils are frozen.
    traced_pupils: &'a [TracedPupil<'a>],
}

impl EvaluationContext<'_> {
    /// The same with the rays of errors of making.
    fn with_error_rays(&self) -> Self {
        match self.errors {
            Some(PupilRays { sampling, traced_pupils }) => {
                EvaluationContext { sampling, traced_pupils, ..*self }
            }
            None => EvaluationContext { ..*self },
        }
    }

    /// The forms of the pupils; none if pupils are frozen.
    fn pupil_forms(&self) -> Vec<RegionKind> {
        self.traced_pupils.iter().map(|pupil| pupil.form().clone()).collect()
    }

    /// The derivatives by the variables that the motion of the pupils' edges contributes to
    /// integrals with these integrands, one for each pupil; zeros if pupils are frozen.
    fn edge_motion(&self, costs: impl Iterator<Item = QuadraticIntegrand>) -> DVector<f64> {
        let costs: Vec<QuadraticIntegrand> = costs.collect();
        let pupils = self.traced_pupils.par_iter().zip(&self.sampling.pupils).zip(&costs);
        let asked = pupils.filter(|(_, cost)| cost.square != 0.0 || cost.constant != 0.0);
        let motions: Vec<DVector<f64>> = asked
            .map(|((traced, pupil), cost)| {
                let by_number = traced.robust_edge_motion(cost);
                self.zoom.by_variables(self.systems, pupil.wavelength, &by_number)
            })
            .collect();
        motions.into_iter().fold(DVector::zeros(self.values.len()), |total, motion| total + motion)
    }

    /// The sum of the derivatives by the variables that `of` gives for traced pupils; zeros if pupils
    /// are frozen.
    fn sum_over_pupils(
        &self,
        of: impl Fn(&SampledPupil, &TracedPupil<'_>) -> Result<Option<SystemGradient<f64>>, MeritError>
        + Sync,
    ) -> Result<DVector<f64>, MeritError> {
        let pupils = self.traced_pupils.par_iter().zip(&self.sampling.pupils);
        let motions = pupils.map(|(traced, pupil)| {
            let by_number = of(pupil, traced)?;
            Ok(by_number.map(|by| self.zoom.by_variables(self.systems, pupil.wavelength, &by)))
        });
        let motions: Result<Vec<_>, MeritError> = motions.collect();
        let zero = DVector::zeros(self.values.len());
        Ok(motions?.into_iter().flatten().fold(zero, |total, motion| total + motion))
    }
}
