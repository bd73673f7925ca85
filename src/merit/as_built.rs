//! The growth of the spots by errors of making, when each lens is refocused.
//!
//! Let `ε` be the landing of a ray relative to the centroid of its field and `s` its slope, `⟨⟩` the
//! mean over the rays of all fields. With errors that are independent and have the variances `σᵢ²`,
//!
//! ```text
//! growth = Σ σᵢ² (Aᵢ − Bᵢ²/C) + C f(Σ σᵢ² Bᵢ²/C²)     Aᵢ = ⟨|εᵢ|²⟩   Bᵢ = ⟨s·εᵢ⟩   C = ⟨|s|²⟩
//! ```
//!
//! where `εᵢ` is the derivative of `ε` by the error, the middle part what refocusing wins back, and `f`
//! the mean square that a focus of bounded travel leaves ([`excess_beyond`]; the displacements of the
//! best focus are taken as normal). Left out are the products of `ε` and its second derivatives, less than
//! a thousandth of the growth of common lenses, and the motion of pupils with errors: rays keep their
//! places in the stop. [`crate::tolerance`] counts both, and says how much they change.
//!
//! Errors are combinations of few numbers of surfaces ([`NumberCovariance`]): one sweep back for each
//! coordinate gives all `εᵢ`. Held in the direction in which the growth weighs them, they are
//! differentiated by a second sweep over dual numbers, so that the cost does not depend on the number
//! of tolerances.

use super::sampling::RaySampling;
use super::scoped_part::ScopedPart;
use super::spot::lost_ray_error;
use super::sum::{DerivativeLevel, SumOfSquares};
use super::{EvaluationContext, MeritError, SampledPupil};
use crate::lens::{Lens, LensError, System, Term, TermScope, lie_on_one_side};
use crate::math::{SimdWidth, dot, excess_beyond, run_vectorized, sum_of_products};
use crate::pupil::TracedPupil;
use crate::tolerance::{
    IndependentError, MadeKind, MadeNumber, NominalLens, NumberCovariance, graded_sheet,
    independent_errors, perturb,
};
use crate::trace::{
    ErrorDirections, ErrorNumber, ErrorRows, Landings, Rays, SystemGradient, TraceSink as _, Tracer,
};
use nalgebra::DVector;
use rayon::prelude::*;
use std::ops::Range;

/// The name of the term in errors.
const TERM: &str = "as_built";

/// The tolerances of a term.
#[derive(Debug, Clone)]
pub(super) struct MadeTolerances {
    errors: Vec<IndependentError>,
    /// The travel of the focus on either side, in mm.
    travel: f64,
    /// The semi-diameters in mm, the units of irregularities.
    semi_diameters: Vec<f64>,
}

impl MadeTolerances {
    /// The tolerances of a term about lenses that are made; `None` for another term.
    pub(super) fn of_term(
        lens: &Lens,
        zoom: usize,
        sampling: &RaySampling,
        term: Term,
    ) -> Result<Option<Self>, MeritError> {
        let Term::AsBuilt { grade } = term else { return Ok(None) };
        let nominal = nominal_lens(lens, zoom, sampling)?;
        let sheet = match (grade, &lens.tolerances) {
            (None, Some(sheet)) => sheet.clone(),
            (grade, _) => graded_sheet(lens, &nominal, grade.unwrap_or_default()),
        };
        let refuse = |why| MeritError::DoesNotApply { term: TERM, why };
        if !sheet.compensators.is_empty() {
            return Err(refuse(
                "the tolerances of the lens have compensators besides focus, which this term does not \
                 adjust; expected none, or a term with a grade",
            ));
        }
        let Ok(errors) = independent_errors(&sheet) else {
            return Err(refuse("the correlations of its tolerances contradict each other"));
        };
        let unmade: Vec<_> = sheet.errors.iter().map(|t| (t.error, 0.0)).collect();
        if perturb(&nominal, &unmade).is_err() {
            return Err(refuse("a tolerance of the lens is not possible on its surface"));
        }
        if nominal.systems.iter().any(|system| system.has_poses() || system.has_grin()) {
            return Err(refuse(
                "the lens has a GRIN medium, or a surface that is decentred, tilted or irregular",
            ));
        }
        let travel = sheet.focus_travel.unwrap_or(f64::INFINITY);
        let semi_diameters = nominal.semi_diameters;
        Ok(Some(Self { errors, travel, semi_diameters }))
    }
}

/// The lens at its wavelengths, with semi-diameters that its rays need where none are written.
fn nominal_lens(
    lens: &Lens,
    zoom: usize,
    sampling: &RaySampling,
) -> Result<NominalLens, MeritError> {
    let systems: Result<Vec<System<f64>>, _> =
        lens.wavelengths.iter().map(|w| lens.resolve(zoom, w.um)).collect();
    let systems = systems?;
    let mut heights = vec![0.0_f64; lens.surfaces.len() + 1];
    for (system, channel) in systems.iter().zip(&sampling.channels) {
        let tracer = Tracer::new(system).map_err(LensError::from)?.without_rims();
        for i in 0..channel.rays.len() {
            tracer.visit(channel.rays.get(i), |surface, p| {
                heights[surface] = heights[surface].max(p.x.hypot(p.y));
            });
        }
    }
    let written = lens.surfaces.iter().zip(heights);
    Ok(NominalLens {
        systems,
        wavelengths: lens.wavelengths.iter().map(|w| w.um).collect(),
        primary: lens.primary(),
        semi_diameters: written.map(|(row, height)| row.semi_diameter.unwrap_or(height)).collect(),
        rims: Vec::new(),
    })
}

/// The effect of the numbers of surfaces on rays, relative to the centroids of their fields.
struct NumberEffects {
    /// For x and y, a row for each number: a value for each ray.
    by_number: [Vec<Vec<f64>>; 2],
    /// The slopes of the rays.
    slopes: [Vec<f64>; 2],
}

impl NumberEffects {
    /// The effects on some rays that all arrive, not centred yet.
    fn new(
        tracer: &Tracer<f64>,
        rays: &Rays<f64>,
        covariance: &NumberCovariance,
        dispersion: &[f64],
    ) -> Self {
        let found = tracer.error_slopes(rays);
        let row = |axis: usize, MadeNumber { surface, kind }: &MadeNumber| match kind {
            MadeKind::Number(number) => found.rows.row(axis, *surface, *number).to_vec(),
            // n → n_p + (n − n_p)/(1 + v)
            MadeKind::Abbe => {
                let by_index = found.rows.row(axis, *surface, ErrorNumber::Index);
                by_index.iter().map(|by| -dispersion[*surface] * by).collect()
            }
        };
        let rows = |axis: usize| covariance.numbers.iter().map(|n| row(axis, n)).collect();
        let by_number = [rows(0), rows(1)];
        Self { by_number, slopes: found.slopes }
    }

    fn covaried(&self, covariance: &NumberCovariance) -> CovariedEffects {
        let mut products = vec![0.0; self.slopes[0].len()];
        let mut rows = [Vec::new(), Vec::new()];
        for (own, rows) in self.by_number.iter().zip(&mut rows) {
            for (row, covariances) in own.iter().zip(&covariance.rows) {
                let mut sum = Vec::new();
                combine(covariances, own, &mut sum);
                add_products(row, &sum, &mut products);
                rows.push(sum);
            }
        }
        CovariedEffects { rows, products }
    }

    /// Subtracts the values at the centroid of the field of some rays.
    fn center(&mut self, rays: Range<usize>, center: &FieldCenter) {
        for axis in 0..2 {
            for (row, mean) in self.by_number[axis].iter_mut().zip(&center.by_number[axis]) {
                row[rays.clone()].iter_mut().for_each(|value| *value -= mean);
            }
            let mean = center.slopes[axis];
            self.slopes[axis][rays.clone()].iter_mut().for_each(|value| *value -= mean);
        }
    }
}

/// The effects of numbers with those of others that are correlated with them.
#[derive(Default)]
struct CovariedEffects {
    /// For x and y and each number, the sum of the effects of all numbers, each by its covariance with it.
    rows: [Vec<Vec<f64>>; 2],
    /// For each ray, the sum over both axes and all numbers of these sums times the effect of the number.
    products: Vec<f64>,
}

/// The values of [`NumberEffects`] at the centroid of a field.
struct FieldCenter {
    by_number: [Vec<f64>; 2],
    slopes: [f64; 2],
}

/// The rays of one wavelength.
struct MadeChannel {
    tracer: Tracer<f64>,
    effects: NumberEffects,
    covaried: CovariedEffects,
    /// For x and y, the effect on each ray of all numbers together, each by its covariance with the
    /// displacement of the focus; empty unless derivatives are asked for.
    along_focus: [Vec<f64>; 2],
    /// The weight of each ray in the term.
    weights: Vec<f64>,
    /// The index less that at the primary wavelength, behind each surface.
    dispersion: Vec<f64>,
}

/// The growth of the spots and what its derivatives need.
struct Growth<'a> {
    context: &'a EvaluationContext<'a>,
    covariance: NumberCovariance,
    channels: Vec<MadeChannel>,
    centers: Vec<FieldCenter>,
    /// `⟨s·ε⟩` for each number; what the displacement of the best focus is proportional to.
    focus: Vec<f64>,
    /// The covariance times that.
    covaried_focus: Vec<f64>,
    value: f64,
    /// The derivatives of the growth by `Σ σᵢ² Bᵢ²` and by `C`.
    by_focus: f64,
    by_slopes: f64,
}

/// Adds the growth of the mean square spots by errors of making.
pub(super) fn add_growth(
    context: &EvaluationContext<'_>,
    tolerances: &MadeTolerances,
    scope: TermScope,
    sum: &mut SumOfSquares,
) -> Result<(), MeritError> {
    let context = &context.with_error_rays();
    let mut growth = Growth::new(context, tolerances, scope)?;
    sum.value += growth.value;
    if sum.level == DerivativeLevel::Value {
        return Ok(());
    }
    growth.find_along_focus();
    let gradient = growth.gradient() + growth.edge_motion()?;
    sum.gradient += &gradient;
    if sum.level == DerivativeLevel::Normal && growth.value > 0.0 {
        // The growth as the square of one residual, its root.
        sum.normal.ger(0.25 / growth.value, &gradient, &gradient, 1.0);
    }
    Ok(())
}

/// The growth of the mean square spots by errors of making, in mm².
pub(super) fn growth(
    context: &EvaluationContext<'_>,
    tolerances: &MadeTolerances,
    scope: TermScope,
) -> Result<f64, MeritError> {
    Growth::new(&context.with_error_rays(), tolerances, scope).map(|growth| growth.value)
}

impl<'a> Growth<'a> {
    fn new(
        context: &'a EvaluationContext<'a>,
        tolerances: &MadeTolerances,
        scope: TermScope,
    ) -> Result<Self, MeritError> {
        let part = ScopedPart::new(context, scope)?;
        let primary = &context.systems.unclipped[context.zoom.primary];
        let MadeTolerances { errors, travel, semi_diameters } = tolerances;
        let covariance = NumberCovariance::new(errors, primary, semi_diameters);
        let wavelengths = (0..context.sampling.channels.len()).into_par_iter();
        let channels: Result<Vec<_>, MeritError> =
            wavelengths.map(|w| MadeChannel::new(context, w, part, &covariance)).collect();
        let mut growth = Self {
            context,
            focus: vec![0.0; covariance.numbers.len()],
            covaried_focus: Vec::new(),
            covariance,
            channels: channels?,
            centers: Vec::new(),
            value: 0.0,
            by_focus: 0.0,
            by_slopes: 0.0,
        };
        growth.center_fields();
        growth.channels.par_iter_mut().for_each(|channel| channel.covary(&growth.covariance));
        growth.find_focus();
        growth.find_value(*travel);
        Ok(growth)
    }

    /// The rays of a field at each wavelength.
    fn rays_of_field(&self, field: usize) -> impl Iterator<Item = (usize, Range<usize>)> + '_ {
        let channels = self.context.sampling.channels.iter().enumerate();
        channels.map(move |(wavelength, channel)| (wavelength, channel.range(field)))
    }

    /// True if the rays of a field stand for their mirror images too.
    fn is_mirrored(&self, field: usize) -> bool {
        self.context.sampling.channels.iter().all(|channel| channel.mirrored[field])
    }

    /// Makes all effects relative to the centroids of the fields.
    fn center_fields(&mut self) {
        for field in 0..self.context.sampling.fields.len() {
            let center = self.field_center(field);
            let rays: Vec<_> = self.rays_of_field(field).collect();
            for (wavelength, rays) in rays {
                self.channels[wavelength].effects.center(rays, &center);
            }
            self.centers.push(center);
        }
    }

    fn field_center(&self, field: usize) -> FieldCenter {
        let rays: Vec<_> = self.rays_of_field(field).collect();
        let share: f64 =
            rays.iter().flat_map(|(w, rays)| &self.channels[*w].weights[rays.clone()]).sum();
        let mean = |row: &dyn Fn(&NumberEffects) -> &[f64]| {
            let part = |(wavelength, rays): &(usize, Range<usize>)| {
                let channel = &self.channels[*wavelength];
                let (weights, row) = (&channel.weights[rays.clone()], row(&channel.effects));
                run_vectorized(
                    SimdWidth::detect(),
                    #[inline(always)]
                    || dot(weights, &row[rays.clone()]),
                )
            };
            if share > 0.0 { rays.iter().map(part).sum::<f64>() / share } else { 0.0 }
        };
        // What changes its sign in the mirror image has no mean.
        let mirrored = self.is_mirrored(field);
        let numbers = |axis: usize| {
            let of = |(place, number): (usize, &MadeNumber)| {
                let cancels = mirrored && (axis == 0) != number.kind.is_odd();
                if cancels { 0.0 } else { mean(&|effects| &effects.by_number[axis][place]) }
            };
            self.covariance.numbers.iter().enumerate().map(of).collect()
        };
        let x = if mirrored { 0.0 } else { mean(&|effects| &effects.slopes[0]) };
        let slopes = [x, mean(&|effects| &effects.slopes[1])];
        FieldCenter { by_number: [numbers(0), numbers(1)], slopes }
    }

    /// Finds the mean products of slopes and effects. In a lens whose fields stand for those on the
    /// other side of the axis too, no error across the axis displaces the common focus.
    fn find_focus(&mut self) {
        let two_sided = lie_on_one_side(&self.context.sampling.fields);
        for field in 0..self.context.sampling.fields.len() {
            let mirrored = self.is_mirrored(field);
            let rays: Vec<_> = self.rays_of_field(field).collect();
            for (sum, number) in self.focus.iter_mut().zip(0..) {
                let kind = self.covariance.numbers[number].kind;
                if (two_sided && kind.is_lateral()) || (mirrored && kind.is_odd()) {
                    continue;
                }
                for (wavelength, rays) in &rays {
                    *sum += self.channels[*wavelength].focus_product(number, rays.clone());
                }
            }
        }
        self.covaried_focus = self.covariance.times(&self.focus);
    }

    /// Finds the growth and its derivatives by the sums that it consists of.
    fn find_value(&mut self, travel: f64) {
        let channels = self.channels.par_iter();
        let squares: Vec<f64> = channels.map(MadeChannel::mean_square).collect();
        let slopes: f64 = self.channels.iter().map(MadeChannel::slope_square).sum();
        let focus: f64 = self.focus.iter().zip(&self.covaried_focus).map(|(a, b)| a * b).sum();
        let variance = focus / (slopes * slopes);
        let [left, by_variance] = excess_beyond(variance, travel);
        self.value = squares.iter().sum::<f64>() - focus / slopes + slopes * left;
        self.by_focus = (by_variance - 1.0) / slopes;
        self.by_slopes = variance + left - 2.0 * variance * by_variance;
    }

    /// The derivatives by the variables with the edges of the pupils held.
    fn gradient(&self) -> DVector<f64> {
        let zoom = self.context.zoom;
        let parts: Vec<[SystemGradient<f64>; 2]> = self
            .channels
            .par_iter()
            .enumerate()
            .map(|(i, c)| self.channel_gradient(i, c))
            .collect();
        let mut by_variables = DVector::zeros(self.context.values.len());
        for (wavelength, [own, primary]) in parts.iter().enumerate() {
            by_variables += zoom.by_variables(self.context.systems, wavelength, own);
            by_variables += zoom.by_variables(self.context.systems, zoom.primary, primary);
        }
        by_variables
    }

    /// The derivatives by the numbers of the system of one wavelength, and by those of the primary one.
    fn channel_gradient(
        &self,
        wavelength: usize,
        channel: &MadeChannel,
    ) -> [SystemGradient<f64>; 2] {
        let rays = &self.context.sampling.channels[wavelength].rays;
        let surfaces = channel.tracer.surfaces();
        let mut directions = ErrorDirections {
            rows: ErrorRows::zeros(rays.len(), surfaces, 2),
            weights: channel.weights.iter().map(|w| 2.0 * w).collect(),
            slopes: [self.slope_factors(channel, 0), self.slope_factors(channel, 1)],
        };
        let mut of_index = SystemGradient::zero(surfaces);
        let mut primary = SystemGradient::zero(surfaces);
        for axis in 0..2 {
            self.add_lever_arms(channel, axis, &mut primary);
            let slopes = &channel.effects.slopes[axis];
            for (place, MadeNumber { surface, kind }) in self.covariance.numbers.iter().enumerate()
            {
                let covaried = &channel.covaried.rows[axis][place];
                // The part that is due to the displacement of the focus.
                let displaced = self.by_focus * self.covaried_focus[place];
                let (number, factor) = match kind {
                    MadeKind::Number(number) => (*number, 1.0),
                    MadeKind::Abbe => (ErrorNumber::Index, -channel.dispersion[*surface]),
                };
                let row = directions.rows.row_mut(axis, *surface, number);
                add_combination(row, factor, covaried, factor * displaced, slopes);
                if *kind == MadeKind::Abbe {
                    let by_index = self.index_row(channel, axis, *surface);
                    let dot = |row: &[f64]| weighted_dot(&channel.weights, row, by_index);
                    let by_dispersion = -2.0 * (dot(covaried) + displaced * dot(slopes));
                    of_index.surfaces[*surface].index += by_dispersion;
                    primary.surfaces[*surface].index -= by_dispersion;
                }
            }
        }
        let mut own = channel.tracer.error_direction_gradient(rays, &directions);
        own.add(&of_index, 1.0);
        [own, primary]
    }

    /// The effects of the index behind a surface, whose place there is where that of the Abbe number is.
    fn index_row<'c>(&self, channel: &'c MadeChannel, axis: usize, surface: usize) -> &'c [f64] {
        let kind = MadeKind::Number(ErrorNumber::Index);
        let place = self.covariance.place(MadeNumber { surface, kind });
        place.map_or(&[], |place| &channel.effects.by_number[axis][place])
    }

    /// The derivative of the growth by the slope of each ray.
    fn slope_factors(&self, channel: &MadeChannel, axis: usize) -> Vec<f64> {
        let along = &channel.along_focus[axis];
        let factor = |((weight, along), slope): ((&f64, &f64), &f64)| {
            2.0 * weight * (self.by_focus * along + self.by_slopes * slope)
        };
        channel.weights.iter().zip(along).zip(&channel.effects.slopes[axis]).map(factor).collect()
    }

    /// Finds what derivatives need of each channel.
    fn find_along_focus(&mut self) {
        let by_focus = &self.covaried_focus;
        self.channels
            .par_iter_mut()
            .for_each(|channel| channel.along_focus = along_focus(&channel.effects, by_focus));
    }

    /// Adds the derivatives by the distances of surfaces from the pivots of tilting bodies.
    fn add_lever_arms(
        &self,
        channel: &MadeChannel,
        axis: usize,
        gradient: &mut SystemGradient<f64>,
    ) {
        let (effects, slopes) = (&channel.effects.by_number[axis], &channel.effects.slopes[axis]);
        let mut tilted = Vec::new();
        for body in &self.covariance.bodies {
            combine(&body.changes, effects, &mut tilted);
            let focus: f64 = body.changes.iter().map(|(place, by)| by * self.focus[*place]).sum();
            let factor = self.by_focus * focus;
            tilted.iter_mut().zip(slopes).for_each(|(to, slope)| *to += factor * slope);
            for arm in &body.arms {
                let shifted = &effects[arm.number];
                let product = weighted_dot(&channel.weights, &tilted, shifted);
                let by_distance = 2.0 * body.variance * arm.sign * product;
                gradient.surfaces[arm.first].curvature += by_distance * arm.by_curvature;
                let gaps = &mut gradient.surfaces[arm.first..arm.surface];
                gaps.iter_mut().for_each(|gap| gap.thickness += by_distance);
            }
        }
    }

    /// The derivatives by the variables of the motion of the edges of the pupils.
    fn edge_motion(&self) -> Result<DVector<f64>, MeritError> {
        if self.context.traced_pupils.is_empty() {
            return Ok(DVector::zeros(self.context.values.len()));
        }
        let of_channels: Vec<Vec<f64>> = self
            .channels
            .par_iter()
            .map(|c| self.costs(&c.effects, &c.covaried, &c.along_focus))
            .collect();
        self.context.sum_over_pupils(|sampled, traced| {
            let range = self.context.sampling.channels[sampled.wavelength].range(sampled.field);
            let channel = &self.channels[sampled.wavelength];
            let weights = &channel.weights[range.clone()];
            let share: f64 = weights.iter().sum();
            if !(share > 0.0) {
                return Ok(None);
            }
            let costs = &of_channels[sampled.wavelength][range];
            let mean = weights.iter().zip(costs).map(|(w, cost)| w * cost).sum::<f64>() / share;
            self.edge_of_pupil(sampled, traced, [share / sampled.moments.area, mean]).map(Some)
        })
    }

    fn edge_of_pupil(
        &self,
        sampled: &SampledPupil,
        traced: &TracedPupil<'_>,
        [factor, mean]: [f64; 2],
    ) -> Result<SystemGradient<f64>, MeritError> {
        let channel = &self.channels[sampled.wavelength];
        let costs = |rays: &Rays<f64>| {
            let mut landed = Landings::default();
            channel.tracer.trace_batch(rays, &mut landed);
            let (covariance, all) = (&self.covariance, 0..rays.len());
            let mut effects =
                NumberEffects::new(&channel.tracer, rays, covariance, &channel.dispersion);
            effects.center(all.clone(), &self.centers[sampled.field]);
            let along = along_focus(&effects, &self.covaried_focus);
            let costs = self.costs(&effects, &effects.covaried(covariance), &along);
            let excess = |i: usize| if landed.fate(i).is_imaged() { costs[i] - mean } else { 0.0 };
            all.map(|i| factor * excess(i)).collect()
        };
        let why = "the pupil is disconnected or not star-shaped, and the motion of its edge is \
                   unknown; expected a goal with frozen pupils";
        traced.edge_motion_of_rays(costs).ok_or(MeritError::DoesNotApply { term: TERM, why })
    }

    /// The derivative of the growth by the weight of each ray, from effects and covaried ones.
    fn costs(
        &self,
        effects: &NumberEffects,
        covaried: &CovariedEffects,
        along_focus: &[Vec<f64>; 2],
    ) -> Vec<f64> {
        let mut costs = covaried.products.clone();
        for (along, slopes) in along_focus.iter().zip(&effects.slopes) {
            for (cost, (along, slope)) in costs.iter_mut().zip(along.iter().zip(slopes)) {
                *cost += slope * (2.0 * self.by_focus * along + self.by_slopes * slope);
            }
        }
        costs
    }
}

impl MadeChannel {
    fn new(
        context: &EvaluationContext<'_>,
        wavelength: usize,
        part: ScopedPart,
        covariance: &NumberCovariance,
    ) -> Result<Self, MeritError> {
        let channel = &context.sampling.channels[wavelength];
        let system = &context.systems.unclipped[wavelength];
        let primary = &context.systems.unclipped[context.zoom.primary];
        let tracer = Tracer::new(system).map_err(LensError::from)?;
        let mut landed = Landings::default();
        tracer.trace_batch(&channel.rays, &mut landed);
        if let Some(i) = (0..channel.rays.len()).find(|i| !landed.fate(*i).is_imaged()) {
            return Err(lost_ray_error(context, wavelength, i, landed.fate(i)));
        }
        let pairs = system.surfaces.iter().zip(&primary.surfaces);
        let dispersion: Vec<f64> = pairs.map(|(own, primary)| own.index - primary.index).collect();
        let effects = NumberEffects::new(&tracer, &channel.rays, covariance, &dispersion);
        let mut weights = channel.weights.clone();
        for field in 0..context.sampling.fields.len() {
            let factor = part.factor(field, wavelength);
            weights[channel.range(field)].iter_mut().for_each(|weight| *weight *= factor);
        }
        let (covaried, along_focus) = Default::default();
        Ok(Self { tracer, effects, covaried, along_focus, weights, dispersion })
    }

    /// Finds the covaried effects, once the effects are centred.
    fn covary(&mut self, covariance: &NumberCovariance) {
        self.covaried = self.effects.covaried(covariance);
    }

    /// The sum of the products of slopes and the effects of a number over some rays.
    fn focus_product(&self, number: usize, rays: Range<usize>) -> f64 {
        let of = |axis: usize| {
            let slopes = &self.effects.slopes[axis][rays.clone()];
            let effects = &self.effects.by_number[axis][number][rays.clone()];
            weighted_dot(&self.weights[rays.clone()], slopes, effects)
        };
        of(0) + of(1)
    }

    /// The sum over all numbers of their effects' products, each by its covariance.
    fn mean_square(&self) -> f64 {
        self.weights.iter().zip(&self.covaried.products).map(|(w, product)| w * product).sum()
    }

    fn slope_square(&self) -> f64 {
        let of = |slopes: &Vec<f64>| weighted_dot(&self.weights, slopes, slopes);
        self.effects.slopes.iter().map(of).sum()
    }
}

/// For x and y, the effect on each ray of all numbers together, each times a factor.
fn along_focus(effects: &NumberEffects, factors: &[f64]) -> [Vec<f64>; 2] {
    let all: Vec<(usize, f64)> = factors.iter().copied().enumerate().collect();
    [0, 1].map(|axis: usize| {
        let mut sum = Vec::new();
        combine(&all, &effects.by_number[axis], &mut sum);
        sum.resize(effects.slopes[axis].len(), 0.0);
        sum
    })
}

/// Makes a row the sum of some others, each times a factor.
fn combine(factors: &[(usize, f64)], rows: &[Vec<f64>], sum: &mut Vec<f64>) {
    sum.clear();
    sum.resize(rows.first().map_or(0, Vec::len), 0.0);
    run_vectorized(
        SimdWidth::detect(),
        #[inline(always)]
        || {
            for (place, factor) in factors {
                for (to, value) in sum.iter_mut().zip(&rows[*place]) {
                    *to += factor * value;
                }
            }
        },
    );
}

fn weighted_dot(weights: &[f64], a: &[f64], b: &[f64]) -> f64 {
    run_vectorized(
        SimdWidth::detect(),
        #[inline(always)]
        || sum_of_products([weights, a, b]),
    )
}

/// Adds two rows, each times a factor, to a sum.
fn add_combination(sum: &mut [f64], by_a: f64, a: &[f64], by_b: f64, b: &[f64]) {
    run_vectorized(
        SimdWidth::detect(),
        #[inline(always)]
        || {
            for (to, (a, b)) in sum.iter_mut().zip(a.iter().zip(b)) {
                *to += by_a * a + by_b * b;
            }
        },
    );
}

/// Adds the products of two rows to a sum.
fn add_products(a: &[f64], b: &[f64], sum: &mut [f64]) {
    run_vectorized(
        SimdWidth::detect(),
        #[inline(always)]
        || {
            for (to, (a, b)) in sum.iter_mut().zip(a.iter().zip(b)) {
                *to += a * b;
            }
        },
    );
}
