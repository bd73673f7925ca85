//! The cost of the derivatives of merit terms of sharpness, by every number of a lens.
//!
//! The value of a term and its gradient are timed on one thread with the rays that reach a tolerance; both find the
//! edges of the pupils anew. The gradient is compared with central differences of the fourth order.

use super::timing::time_median;
use crate::lens::{Lens, Parameter, Quantity, Variable, at_zoom};
use crate::merit::{
    DerivativeLevel, Goal, LimitTreatment, Merit, MeritError, PupilEdge, Term, WeightedTerm,
};
use crate::paraxial::{Beam, first_order};
use rayon::ThreadPool;
use serde::Serialize;

/// The cost of the derivatives of a term.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct TermCost {
    /// The name of the term.
    pub term: &'static str,
    /// Its value.
    pub value: f64,
    /// The error that it states.
    pub error: f64,
    /// True if the rays reach the tolerance. If they do not, as where too few resolve the phase of many waves, the
    /// gradient of the integral and differences of the sum have little to do with each other.
    pub reached: bool,
    /// The median time of a value, in milliseconds.
    pub value_ms: f64,
    /// The median time of a value with its gradient, in milliseconds.
    pub gradient_ms: f64,
    /// The largest difference of a derivative from central differences, over the largest one; each times a step of
    /// its variable.
    pub difference: f64,
    /// The error of the gradient by its rays: the largest difference of a derivative from that by rays that are
    /// twenty times as accurate, over the largest one; each times a step of its variable. `None` if there are no rays
    /// that accurate, or if all derivatives are 0.
    pub gradient_error: Option<f64>,
    /// The variable whose derivative differs most from central differences; `None` where nothing does.
    pub at: Option<String>,
    /// The reason why there is no such term; the numbers are 0 then.
    pub refused: Option<String>,
}

/// The costs of the derivatives of some terms.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct TermCosts {
    /// The number of variables.
    pub variables: usize,
    /// The tolerance of the rays.
    pub tolerance: f64,
    /// The spatial frequency of contrast, in cycles/mm.
    pub frequency: f64,
    /// A row for each term.
    pub rows: Vec<TermCost>,
}

/// The factor by which the rays are more accurate that tell the error of a gradient.
const FINER: f64 = 20.0;
/// The times that a value is timed.
const TURNS: usize = 15;

/// Measures the terms of sharpness of a lens at a zoom position, with contrast at a frequency in cycles/mm and rays
/// that reach a tolerance, of contrast five times that, by every curvature, conic, asphere coefficient, thickness, index
/// and semi-diameter that the lens has, on the thread of a pool.
///
/// # Errors
/// A lens without a merit.
pub fn measure_term_costs(
    lens: &Lens,
    zoom: usize,
    (frequency, tolerance): (f64, f64),
    pool: &ThreadPool,
) -> Result<TermCosts, MeritError> {
    let lens = with_all_variables(&at_zoom(lens, zoom));
    let steps = Steps::new(&lens)?;
    let terms = [
        Term::Spot,
        Term::Wavefront,
        Term::Strehl,
        Term::GeometricMtf { frequency, min: 1.0 },
        Term::Mtf { frequency, min: 1.0 },
    ];
    let row = |term: Term| {
        let found = pool.install(|| cost(&lens, term, &steps, tolerance));
        found.unwrap_or_else(|why| TermCost {
            term: term.name(),
            value: 0.0,
            error: 0.0,
            reached: false,
            value_ms: 0.0,
            gradient_ms: 0.0,
            difference: 0.0,
            gradient_error: None,
            at: None,
            refused: Some(why.to_string()),
        })
    };
    let rows = terms.into_iter().map(row).collect();
    Ok(TermCosts { variables: lens.variables.len(), tolerance, frequency, rows })
}

/// The lens with every number of its surfaces as a variable.
fn with_all_variables(lens: &Lens) -> Lens {
    let mut lens = lens.with_pickups().unwrap_or_else(|_| lens.clone());
    lens.pickups.clear();
    let quantities = |i: usize| {
        let row = &lens.surfaces[i];
        let conic = (row.conic != 0.0).then_some(Quantity::Conic);
        let powers = row.asphere.iter().enumerate().filter(|(_, value)| **value != 0.0);
        let powers: Vec<Quantity> = powers.map(|(k, _)| Quantity::Asphere(k)).collect();
        let index = lens.get(Parameter::new(i, Quantity::Index)).map(|_| Quantity::Index);
        let rim = row.semi_diameter.map(|_| Quantity::SemiDiameter);
        let always = [Quantity::Curvature, Quantity::Thickness];
        always.into_iter().chain(conic).chain(powers).chain(index).chain(rim).collect::<Vec<_>>()
    };
    let of_surface = |i: usize| {
        quantities(i).into_iter().map(move |quantity| Variable {
            parameter: Parameter::new(i, quantity),
            min: None,
            max: None,
        })
    };
    let variables: Vec<Variable> = (0..lens.surfaces.len()).flat_map(of_surface).collect();
    lens.variables = variables;
    lens
}

/// The steps of central differences: a small part of a wavelength in paths. Phases turn by a whole wavelength, so that
/// steps that are small against the lens but not against that differ from a derivative by themselves.
struct Steps {
    /// The change of a sag at the largest rim, in mm.
    length: f64,
    focal_length: f64,
    largest_rim: f64,
}

/// The change of a sag, in wavelengths: differences of the fourth order are wrong by 1e-5 of the change of a phase of
/// several times that, and paths are rounded at 1e-10 wavelengths.
const WAVES: f64 = 0.01;
/// The change of a semi-diameter as a part of the largest one: only what is on the edge changes.
const RIM_STEP: f64 = 1e-5;

impl Steps {
    fn new(lens: &Lens) -> Result<Self, MeritError> {
        let um = lens.wavelengths[lens.primary()].um;
        let system = lens.resolve(0, um)?;
        let data = first_order(&system, &Beam::for_lens(lens, 0));
        let data = data.map_err(crate::pupil::RayModelError::from)?;
        let rims = lens.surfaces.iter().filter_map(|row| row.semi_diameter);
        let focal_length = data.efl.map_or(100.0, f64::abs);
        let largest = rims.fold(0.0, f64::max);
        let largest_rim = if largest > 0.0 { largest } else { 0.2 * focal_length };
        Ok(Self { length: WAVES * 1e-3 * um, focal_length, largest_rim })
    }

    /// A step that changes a path by about the same whatever the number.
    fn of(&self, quantity: Quantity) -> f64 {
        let sag = |power: i32| self.length / self.largest_rim.powi(power);
        match quantity {
            Quantity::Curvature => 2.0 * sag(2),
            Quantity::Conic => 8.0 * sag(4) * self.focal_length.powi(3),
            Quantity::Asphere(term) => sag(2 * term as i32 + 4),
            // A defocus changes paths by half of the square of the aperture.
            Quantity::Thickness => self.length * (self.focal_length / self.largest_rim).powi(2),
            Quantity::SemiDiameter => RIM_STEP * self.largest_rim,
            Quantity::Index | Quantity::Grin(_) | Quantity::Freeform(_) => sag(1),
        }
    }
}

fn cost(lens: &Lens, term: Term, steps: &Steps, tolerance: f64) -> Result<TermCost, MeritError> {
    let goal = Goal {
        terms: vec![WeightedTerm::new(term, 1.0)],
        zoom_ratios: Vec::new(),
        limits: LimitTreatment::default(),
        pupil: PupilEdge::Moving,
    };
    let merit = Merit::new(lens, &goal, tolerance)?;
    let values = merit.values(lens);
    let found = merit.terms(&values)?;
    let timed = |level| time_median(3..=TURNS, || merit.evaluate(&values, level));
    let (value, value_ms) = timed(DerivativeLevel::Value);
    let (sum, gradient_ms) = timed(DerivativeLevel::Gradient);
    let (value, sum) = (value?.value, sum?);
    let step_of = |variable: &Variable| steps.of(variable.parameter.quantity);
    let scales: Vec<f64> = merit.variables().iter().map(step_of).collect();
    let exact = exact_gradient(lens, &goal, (&values, tolerance / FINER));
    let gradient_error =
        exact.and_then(|exact| largest_change(sum.gradient.as_slice(), &exact, &scales));
    let (mut largest, mut difference, mut at) = (0.0f64, 0.0f64, None);
    for (i, variable) in merit.variables().iter().enumerate() {
        let step = scales[i];
        let moved = |offset: f64| {
            let mut moved = values.clone();
            moved[i] += offset * step;
            merit.value(&moved)
        };
        let change = (8.0 * (moved(1.0)? - moved(-1.0)?) - (moved(2.0)? - moved(-2.0)?)) / 12.0;
        largest = largest.max(change.abs());
        let off = (change - step * sum.gradient[i]).abs();
        if off > difference {
            (difference, at) = (off, Some(variable.parameter.to_string()));
        }
    }
    let (error, reached) = found.first().map_or((0.0, false), |term| (term.error, term.reached));
    let difference = if largest > 0.0 { difference / largest } else { 0.0 };
    Ok(TermCost {
        term: term.name(),
        value,
        error,
        reached,
        value_ms,
        gradient_ms,
        difference,
        gradient_error,
        at,
        refused: None,
    })
}

/// The gradient by rays that reach a tolerance; `None` if none do.
fn exact_gradient(
    lens: &Lens,
    goal: &Goal,
    (values, tolerance): (&[f64], f64),
) -> Option<Vec<f64>> {
    let merit = Merit::new(lens, goal, tolerance).ok()?;
    let is_reached = merit.terms(values).ok()?.iter().all(|term| term.reached);
    let found = merit.evaluate(values, DerivativeLevel::Gradient).ok().filter(|_| is_reached)?;
    Some(found.gradient.as_slice().to_vec())
}

/// The largest difference of a derivative from the exact one over the largest exact one, each times its scale; `None`
/// if that is 0.
fn largest_change(found: &[f64], exact: &[f64], scales: &[f64]) -> Option<f64> {
    let sizes = exact.iter().zip(scales).map(|(exact, scale)| (exact * scale).abs());
    let size = sizes.fold(0.0, f64::max);
    let pairs = found.iter().zip(exact).zip(scales);
    let mut changes = pairs.map(|((a, b), scale)| ((a - b) * scale).abs());
    // `max` would ignore NaN.
    let change = changes.try_fold(0.0, |most: f64, x| x.is_finite().then(|| most.max(x)));
    (size > 0.0).then(|| change.map_or(f64::INFINITY, |change| change / size))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_change_is_relative_to_the_largest_derivative_in_its_scale() {
        assert_eq!(largest_change(&[1.0, 9.0], &[2.0, 8.0], &[1.0, 0.5]), Some(0.25));
        assert_eq!(largest_change(&[1.0], &[0.0], &[2.0]), None);
        let lost = largest_change(&[f64::NAN, 1.0], &[1.0, 1.0], &[1.0, 1.0]);
        assert_eq!(lost, Some(f64::INFINITY));
    }
}
