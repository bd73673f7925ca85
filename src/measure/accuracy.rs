//! Error against time of the contrast and of the point spread of one field.
//!
//! The same numbers are computed to rising demands. Each time they come with the error that they state, with the
//! largest difference from those of a tolerance far below all others, and with their time on the thread that asks.

use super::mtf::TransferMethod;
use super::timing::time_median;
use crate::analysis::{
    AnalysisError, ImageLight, MtfCurve, TransferValue, airy_radius, grid_nodes,
    point_spread_unless, polychromatic_diffraction_mtf_unless, polychromatic_geometric_mtf,
};
use crate::lens::FieldPoint;
use crate::pupil::{Accuracy, RayModel};
use serde::Serialize;

/// A result of one tolerance.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct AccuracyPoint {
    /// The absolute tolerance asked for.
    pub tolerance: f64,
    /// The largest error that the numbers state, without what the choice of a reference sphere leaves.
    pub stated: f64,
    /// The largest difference from the reference.
    pub error: f64,
    /// True if they say that the tolerance was reached.
    pub reached: bool,
    /// The rays traced.
    pub rays: usize,
    /// The median time on one thread, in milliseconds; that of pupils that the model has found before is not in it.
    pub ms: f64,
}

/// The tolerances of [`transfer_accuracy`], and that of its reference: the tightest one that needs no ray for every
/// node of every overlap.
const TRANSFER_TOLERANCES: [f64; 5] = [3e-2, 1e-2, 3e-3, 1e-3, 1e-4];
const TRANSFER_REFERENCE: f64 = 1e-5;
/// The tolerances of [`point_spread_accuracy`], and that of its reference.
const SPREAD_TOLERANCES: [f64; 4] = [1e-2, 1e-3, 1e-4, 1e-5];
const SPREAD_REFERENCE: f64 = 1e-9;
/// So often each result is timed while it is short.
const TURNS: usize = 5;

/// A test that is asked often whether a computation is to end early.
type Interruption<'a> = dyn Fn() -> bool + Sync + 'a;

/// Numbers of one tolerance.
struct Trial {
    /// Pairs of real and imaginary parts.
    values: Vec<[f64; 2]>,
    stated: f64,
    reached: bool,
    rays: usize,
}

/// The contrast of a field over all wavelengths at some frequencies in cycles/mm, tangential and sagittal: error
/// against time for tolerances of 3e-2 to 1e-4. Errors are those of the complex values, against a tolerance of
/// 1e-5.
///
/// # Errors
/// As those of the contrast; [`AnalysisError::Interrupted`] once `interrupted` says so.
pub fn transfer_accuracy(
    model: &RayModel,
    field: FieldPoint,
    method: TransferMethod,
    frequencies: &[f64],
    interrupted: &Interruption<'_>,
) -> Result<Vec<AccuracyPoint>, AnalysisError> {
    let trial = |tolerance: f64| {
        let accuracy = Accuracy { tolerance, ..Accuracy::default() };
        let curve = match method {
            TransferMethod::Geometric => {
                polychromatic_geometric_mtf(model, field, frequencies, accuracy)
            }
            TransferMethod::Diffraction => polychromatic_diffraction_mtf_unless(
                model,
                field,
                frequencies,
                accuracy,
                interrupted,
            ),
        };
        curve.map(|curve| Trial::of_curve(&curve))
    };
    accuracy_points((&TRANSFER_TOLERANCES, TRANSFER_REFERENCE), trial, interrupted)
}

/// The half side of the square of the image that [`point_spread_accuracy`] looks at, in Airy radii, and the points
/// along a side.
const SPREAD_WIDTH: f64 = 4.0;
const SPREAD_POINTS: usize = 24;
/// The Airy radius taken for a lens without an f-number in mm: that of f/1 in green light.
const FAST_AIRY: f64 = 0.67e-3;

/// The point spread by diffraction of a field at a wavelength at 24 by 24 points about the image point of the chief
/// ray, within four Airy radii: error against time for tolerances of 1e-2 to 1e-5 of a perfect peak, against one of
/// 1e-9.
///
/// # Errors
/// As those of the point spread; [`AnalysisError::Interrupted`] once `interrupted` says so.
pub fn point_spread_accuracy(
    model: &RayModel,
    field: FieldPoint,
    wavelength: usize,
    interrupted: &Interruption<'_>,
) -> Result<Vec<AccuracyPoint>, AnalysisError> {
    let airy = airy_radius(model).unwrap_or(FAST_AIRY);
    let points = grid_nodes(SPREAD_POINTS, SPREAD_WIDTH * airy);
    let trial = |tolerance: f64| {
        let accuracy = Accuracy { tolerance, ..Accuracy::default() };
        let image = (ImageLight::Wavelength(wavelength), points.as_slice());
        let found = point_spread_unless(model, field, image, accuracy, interrupted)?;
        let stated = found.intensities.iter().map(|at| at.error).fold(0.0, f64::max);
        let values = found.intensities.iter().map(|at| [at.value, 0.0]).collect();
        let Some(first) = found.intensities.first() else { return Err(AnalysisError::NoLight) };
        Ok(Trial { values, stated, reached: found.reached, rays: first.rays })
    };
    accuracy_points((&SPREAD_TOLERANCES, SPREAD_REFERENCE), trial, interrupted)
}

impl Trial {
    fn of_curve(curve: &MtfCurve) -> Self {
        let values = curve.points.iter().flat_map(|point| [point.tangential, point.sagittal]);
        let values: Vec<TransferValue> = values.collect();
        Self {
            stated: curve.numerical_error(),
            values: values.iter().map(|value| [value.re, value.im]).collect(),
            reached: curve.reached,
            rays: curve.rays,
        }
    }

    /// The largest difference from others.
    fn difference(&self, other: &Self) -> f64 {
        let pairs = self.values.iter().zip(&other.values);
        pairs.map(|(a, b)| (a[0] - b[0]).hypot(a[1] - b[1])).fold(0.0, f64::max)
    }
}

/// The points of all tolerances; results are interrupted between them as well.
fn accuracy_points(
    (tolerances, reference): (&[f64], f64),
    trial: impl Fn(f64) -> Result<Trial, AnalysisError>,
    interrupted: &Interruption<'_>,
) -> Result<Vec<AccuracyPoint>, AnalysisError> {
    let asked = |tolerance| {
        if interrupted() { Err(AnalysisError::Interrupted) } else { trial(tolerance) }
    };
    let exact = asked(reference)?;
    let point = |tolerance| {
        let (found, ms) = time_median(1..=TURNS, || asked(tolerance));
        let found = found?;
        let (stated, reached, rays) = (found.stated, found.reached, found.rays);
        Ok(AccuracyPoint { tolerance, stated, error: found.difference(&exact), reached, rays, ms })
    };
    tolerances.iter().copied().map(point).collect()
}
