//! The diffraction MTF of a field, and whether diffraction matters.

use super::pupil_function::PupilFunction;
use super::pupil_traces::PupilTraces;
use super::ray_pupil::RayPupil;
use super::{Interruption, never};
use crate::analysis::mtf::{curve, geometric_mtf, origin, sum_wavelengths};
use crate::analysis::reference_sphere::{ReferenceForm, ReferenceSphere};
use crate::analysis::{
    AnalysisError, ContrastLimit, Estimate, MtfCurve, MtfPoint, TransferValue, lit_region,
};
use crate::lens::FieldPoint;
use crate::pupil::{Accuracy, ConvergedList, RayModel, Region};
use crate::trace::TraceSink as _;
use rayon::prelude::*;
use serde::Serialize;
use std::f64::consts::TAU;

/// The contrast by diffraction of a field at one wavelength and some frequencies in cycles/mm;
/// errors are absolute. Where the aberrations are so large that the place of the pupil's edge on the
/// sphere matters, the change on doubling its radius is part of the error: the model of one exit pupil is not known
/// better. It is told by itself as well, and takes no part in what the tolerance asks for.
///
/// # Errors
/// The field is dark, or its pupil folds or has pieces whose edge is not known.
pub fn diffraction_mtf(
    model: &RayModel,
    field: FieldPoint,
    wavelength: usize,
    frequencies: &[f64],
    accuracy: Accuracy,
) -> Result<MtfCurve, AnalysisError> {
    diffraction_mtf_unless(model, field, wavelength, frequencies, accuracy, &never)
}

fn diffraction_mtf_unless(
    model: &RayModel,
    field: FieldPoint,
    wavelength: usize,
    frequencies: &[f64],
    accuracy: Accuracy,
    interrupted: &Interruption<'_>,
) -> Result<MtfCurve, AnalysisError> {
    if interrupted() {
        return Err(AnalysisError::Interrupted);
    }
    let region = lit_region(model, field, wavelength)?;
    let sphere = ReferenceSphere::focused(&region)?;
    let origin = origin(model, field, &region)?;
    let mut traces = PupilTraces::new(&region);
    let mut wave = |sphere: &ReferenceSphere, frequencies: &[f64], tolerance: f64| {
        let function = PupilFunction::of_traces(&mut traces, sphere, tolerance)?;
        let values = function.values(frequencies, 0.0, tolerance, interrupted)?;
        Ok::<_, AnalysisError>((function, values))
    };
    let tolerance = accuracy.tolerance;
    let (function, mut values) = wave(&sphere, frequencies, tolerance)?;
    let mut changes = vec![0.0; 2 * frequencies.len()];
    if is_uncertain(&sphere, &region) {
        let some = some_of(frequencies);
        let asked: Vec<f64> = some.iter().map(|i| frequencies[*i]).collect();
        let (_, far) = wave(&sphere.doubled(), &asked, tolerance.max(COARSE))?;
        let found: Vec<[f64; 2]> =
            some.iter().zip(&far).map(|(i, far)| change_to(&values[*i], far)).collect();
        changes = spread_changes(frequencies, &asked, &found);
    }
    if tolerance < BY_RAYS && function.transfer_error() > tolerance {
        refine(&mut values, frequencies, &function, (&region, &sphere), tolerance)?;
    }
    let limit = limit(&values, &function, tolerance);
    let offset = [sphere.center.x - origin[0], sphere.center.y - origin[1]];
    let list = ConvergedList {
        values: flatten(frequencies, &values, offset),
        errors: values.iter().flatten().flat_map(|v| [v.modulus.error, 0.0]).collect(),
        rays: function.rays(),
        orders: 1,
        converged: limit.is_none(),
    };
    Ok(curve(frequencies, origin, &list, limit).with_sphere(&changes))
}

/// The changes of the tangential and the sagittal value to those on another sphere, at most: with the errors of
/// these.
fn change_to(values: &[TransferValue; 2], far: &[TransferValue; 2]) -> [f64; 2] {
    [0, 1].map(|k| {
        let (a, b) = (&values[k], &far[k]);
        (a.re - b.re).hypot(a.im - b.im) + b.modulus.error
    })
}

/// So many frequencies are compared on two spheres one by one; of more, every third.
const EACH: usize = 12;
const EVERY: usize = 3;
/// The change between frequencies that are compared is at most this times the largest of those nearby, and so many
/// on either side are near.
const BETWEEN: f64 = 1.5;
const NEAR: usize = 2;

/// The indices of the frequencies that are compared on two spheres.
fn some_of(frequencies: &[f64]) -> Vec<usize> {
    let mut all: Vec<usize> = (0..frequencies.len()).collect();
    if all.len() <= EACH {
        return all;
    }
    all.sort_by(|i, j| frequencies[*i].abs().total_cmp(&frequencies[*j].abs()));
    let last = all.len() - 1;
    (0..=last).filter(|k| k % EVERY == 0 || *k == last).map(|k| all[k]).collect()
}

/// The changes at all frequencies, tangential and sagittal one after the other, from those at some: between them
/// from the largest of the nearest ones.
fn spread_changes(frequencies: &[f64], some: &[f64], changes: &[[f64; 2]]) -> Vec<f64> {
    if some.len() == frequencies.len() {
        return changes.iter().flatten().copied().collect();
    }
    let at = |nu: &f64| {
        if let Some(k) = some.iter().position(|known| known == nu) {
            return changes[k];
        }
        let next = some.partition_point(|known| known.abs() < nu.abs());
        let near = next.saturating_sub(NEAR)..(next + NEAR).min(some.len());
        let most = |part: usize| near.clone().map(|k| changes[k][part]).fold(0.0, f64::max);
        [BETWEEN * most(0), BETWEEN * most(1)]
    };
    frequencies.iter().flat_map(at).collect()
}

/// The cause of errors above a tolerance, if they are.
fn limit(
    values: &[[TransferValue; 2]],
    function: &PupilFunction,
    tolerance: f64,
) -> Option<ContrastLimit> {
    let error = values.iter().flatten().map(|value| value.modulus.error).fold(0.0, f64::max);
    let left = function.transfer_error();
    let by_polynomials = left >= 0.5 * error;
    let limit =
        if by_polynomials { ContrastLimit::Polynomials(left) } else { ContrastLimit::Nodes(error) };
    (error > tolerance).then_some(limit)
}

/// The tolerance below which rays replace polynomials that are not exact enough: a thousand times the
/// work, for digits that no chart shows.
const BY_RAYS: f64 = 1e-5;

/// Replaces values by those of a ray for each node, where there are such rays: polynomials are not exact
/// enough. All frequencies by themselves, at the same time.
fn refine(
    values: &mut [[TransferValue; 2]],
    frequencies: &[f64],
    function: &PupilFunction,
    (region, sphere): (&Region<'_>, &ReferenceSphere),
    tolerance: f64,
) -> Result<(), AnalysisError> {
    let pupil = RayPupil::new(region, sphere)?;
    let better = |([t, s], nu): (&mut [TransferValue; 2], &f64)| {
        if *nu != 0.0 {
            let pairs = [(t, [0.0, *nu]), (s, [*nu, 0.0])];
            for (value, frequency) in pairs {
                let found = function.transfer_by_rays(frequency, &pupil, tolerance);
                *value = found.unwrap_or(*value);
            }
        }
        Ok(())
    };
    values.par_iter_mut().zip(frequencies).try_for_each(better)
}

/// The least tolerance of contrast on a second sphere.
const COARSE: f64 = 1e-4;
/// The uncertainty of paths between two spheres, in wavelengths, below which it does not matter.
const CERTAIN: f64 = 1e-3;

/// True if paths between two spheres are uncertain by more than a part of a wavelength: by the square
/// of a ray's error over twice the radius.
fn is_uncertain(sphere: &ReferenceSphere, region: &Region<'_>) -> bool {
    let (ReferenceForm::ExitPupil(radius) | ReferenceForm::Replaced(radius)) = sphere.form else {
        return false;
    };
    let (_, landed) = region.launch.trace_points(&region.nodes(2).points);
    let arrived = (0..landed.x.len()).filter(|i| landed.fate(*i).is_imaged());
    let square = |i: usize| {
        (landed.x[i] - sphere.center.x).powi(2) + (landed.y[i] - sphere.center.y).powi(2)
    };
    let farthest = arrived.map(square).fold(0.0, f64::max);
    farthest > 2.0 * radius.abs() * CERTAIN * sphere.wavelength
}

/// The complex values with their phases counted from the common origin.
fn flatten(frequencies: &[f64], values: &[[TransferValue; 2]], offset: [f64; 2]) -> Vec<f64> {
    let turned = |value: &TransferValue, frequency: f64, off: f64| {
        let (sin, cos) = (-TAU * frequency * off).sin_cos();
        [value.re * cos - value.im * sin, value.re * sin + value.im * cos]
    };
    let both = |(frequency, [t, s]): (&f64, &[TransferValue; 2])| {
        [turned(t, *frequency, offset[1]), turned(s, *frequency, offset[0])]
    };
    frequencies.iter().zip(values).flat_map(both).flatten().collect()
}

impl PupilFunction {
    /// The tangential and sagittal values at some frequencies.
    fn values(
        &self,
        frequencies: &[f64],
        defocus: f64,
        tolerance: f64,
        interrupted: &Interruption<'_>,
    ) -> Result<Vec<[TransferValue; 2]>, AnalysisError> {
        let at = |nu: &f64| {
            if interrupted() {
                return Err(AnalysisError::Interrupted);
            }
            Ok([[0.0, *nu], [*nu, 0.0]].map(|nu| self.transfer(nu, defocus, tolerance)))
        };
        frequencies.iter().map(at).collect()
    }
}

/// The contrast by diffraction of a field over all wavelengths: the sum of the complex values by
/// weight.
///
/// # Errors
/// Every wavelength is dark or refused.
pub fn polychromatic_diffraction_mtf(
    model: &RayModel,
    field: FieldPoint,
    frequencies: &[f64],
    accuracy: Accuracy,
) -> Result<MtfCurve, AnalysisError> {
    polychromatic_diffraction_mtf_unless(model, field, frequencies, accuracy, never)
}

/// The same unless it is interrupted, which is asked for before every frequency of every wavelength.
///
/// # Errors
/// The same, and [`AnalysisError::Interrupted`].
pub fn polychromatic_diffraction_mtf_unless(
    model: &RayModel,
    field: FieldPoint,
    frequencies: &[f64],
    accuracy: Accuracy,
    interrupted: impl Fn() -> bool + Sync,
) -> Result<MtfCurve, AnalysisError> {
    let whole = sum_wavelengths(model, |wavelength| {
        diffraction_mtf_unless(model, field, wavelength, frequencies, accuracy, &interrupted)
    });
    // A sum over a part of the wavelengths is of no use.
    if interrupted() { Err(AnalysisError::Interrupted) } else { whole }
}

/// The contrast by diffraction of a field at one wavelength and frequency against displacements of the
/// image plane along the light in mm, from the rays of one pupil; the frequency of a point is the
/// displacement. Errors are those of [`diffraction_mtf`]; planes at the exit pupil or beyond it are left out.
///
/// # Errors
/// As of [`diffraction_mtf`], and no plane that is left.
pub fn through_focus_mtf(
    model: &RayModel,
    field: FieldPoint,
    wavelength: usize,
    frequency: f64,
    displacements: &[f64],
    accuracy: Accuracy,
) -> Result<Vec<MtfPoint>, AnalysisError> {
    let region = lit_region(model, field, wavelength)?;
    let sphere = ReferenceSphere::focused(&region)?;
    let mut traces = PupilTraces::new(&region);
    let near = DisplacedContrast::new(&mut traces, &sphere, accuracy.tolerance)?;
    let doubled = sphere.doubled();
    let coarse = accuracy.tolerance.max(COARSE);
    let far = is_uncertain(&sphere, &region)
        .then(|| DisplacedContrast::new(&mut traces, &doubled, coarse))
        .transpose()?;
    let reached: Vec<f64> =
        displacements.iter().copied().filter(|shift| sphere.displaced(*shift).is_ok()).collect();
    if reached.is_empty() {
        return Err(AnalysisError::BeyondPupil);
    }
    let at = |shift: &f64| {
        let mut values = near.at(frequency, *shift)?;
        if let Some(far) = &far {
            let change = change_to(&values, &far.at(frequency, *shift)?);
            values = [0, 1].map(|k| values[k].with_sphere(change[k]));
        }
        let [tangential, sagittal] = values;
        Ok(MtfPoint { frequency: *shift, tangential, sagittal })
    };
    reached.iter().map(at).collect()
}

/// The contrast of a pupil against the displacement of the image plane.
struct DisplacedContrast<'a> {
    sphere: &'a ReferenceSphere,
    function: PupilFunction,
    tolerance: f64,
}

impl<'a> DisplacedContrast<'a> {
    fn new(
        traces: &mut PupilTraces<'_>,
        sphere: &'a ReferenceSphere,
        tolerance: f64,
    ) -> Result<Self, AnalysisError> {
        let function = PupilFunction::of_traces(traces, sphere, tolerance)?;
        Ok(Self { sphere, function, tolerance })
    }

    /// The tangential and the sagittal value at a displacement along the light in mm.
    fn at(&self, frequency: f64, shift: f64) -> Result<[TransferValue; 2], AnalysisError> {
        let (linear, factor) = self.sphere.displaced(shift)?;
        let values = self.function.values(&[factor * frequency], linear, self.tolerance, &never)?;
        Ok(values[0])
    }
}

/// The decision whether contrast needs diffraction.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct DiffractionGate {
    /// True if diffraction has to be computed.
    pub on: bool,
    /// The largest change of contrast that diffraction can make: 1.27 ν λ F at the highest frequency,
    /// at most 1.
    pub bound: f64,
    /// The largest change that it makes at the frequencies compared; `None` if the bound decided.
    pub change: Option<Estimate>,
    /// The change that is allowed.
    pub tolerance: f64,
}

/// The change of contrast by diffraction over νλF, at most, for five families of aberrations.
const LARGEST_CHANGE: f64 = 1.27;
/// The parts of the highest frequency at which both contrasts are compared.
const COMPARED: [f64; 3] = [0.25, 0.5, 1.0];

/// Decides whether the contrast of a field at a wavelength up to a frequency in cycles/mm needs
/// diffraction: by a bound, or else by computing both at three frequencies.
///
/// # Errors
/// The field is dark, or the bound does not decide and its pupil cannot be integrated over.
pub fn diffraction_gate(
    model: &RayModel,
    field: FieldPoint,
    wavelength: usize,
    highest: f64,
    tolerance: f64,
) -> Result<DiffractionGate, AnalysisError> {
    let f_number = model.first_order.working_f_number.map_or(f64::INFINITY, f64::abs);
    let bound = LARGEST_CHANGE * highest * model.channels[wavelength].um * 1e-3 * f_number;
    let bound = bound.min(1.0);
    if bound <= tolerance {
        return Ok(DiffractionGate { on: false, bound, change: None, tolerance });
    }
    let frequencies = COMPARED.map(|part| part * highest);
    let accuracy = Accuracy { tolerance: 0.1 * tolerance, ..Accuracy::default() };
    let wave = diffraction_mtf(model, field, wavelength, &frequencies, accuracy)?;
    let rays = geometric_mtf(model, field, wavelength, &frequencies, accuracy)?;
    let differences = wave.points.iter().zip(&rays.points).flat_map(|(d, g)| {
        let difference = |d: &TransferValue, g: &TransferValue| {
            let error = d.modulus.error + g.modulus.error;
            ((d.modulus.value - g.modulus.value).abs(), error)
        };
        [difference(&d.tangential, &g.tangential), difference(&d.sagittal, &g.sagittal)]
    });
    let (largest, error) =
        differences.fold((0.0, 0.0), |a: (f64, f64), b| if b.0 > a.0 { b } else { a });
    let change = Estimate::new(largest, error, wave.rays + rays.rays);
    Ok(DiffractionGate { on: largest > tolerance, bound, change: Some(change), tolerance })
}
