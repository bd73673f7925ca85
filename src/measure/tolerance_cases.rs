//! The errors that a benchmark of tolerances takes, and the cost of what it compares besides the spot.

use super::ToleranceBenchmarkError;
use super::timing::time_median;
use super::trace::BenchmarkError;
use crate::lens::{
    ErrorDistribution, Lens, Perturbation, PerturbationKind, Pose, System, Tolerance,
    ToleranceSheet,
};
use crate::tolerance::{
    ContrastChanges, NominalLens, SecondDerivatives, ToleranceScene, WavefrontModel, perturb,
};
use crate::trace::{Landings, Rays, TraceSink as _, Tracer};
use rayon::ThreadPool;
use serde::Serialize;
use std::collections::BTreeSet;

/// The half ranges of errors that no class of tolerances has, in mm, in mm of sag at the rim, and in radians.
const DECENTER: f64 = 0.02;
const SAG: f64 = 1e-4;
const ANGLE: f64 = 3e-4;

/// The tolerances of a class filled up to a number with different errors of further kinds, as far as the lens has
/// so many.
pub(super) fn filled_sheet(
    sheet: ToleranceSheet,
    lens: &NominalLens,
    count: usize,
) -> ToleranceSheet {
    let mut known: BTreeSet<Perturbation> = sheet.errors.iter().map(|own| own.error).collect();
    let mut errors = sheet.errors;
    for kind in PerturbationKind::ALL {
        let bodies = errors.iter().filter(|own| own.error.kind.moves_a_body());
        let bodies: BTreeSet<_> = bodies.map(|own| (own.error.first, own.error.last)).collect();
        let surfaces = (0..lens.semi_diameters.len()).map(|i| (i, i)).collect();
        let places: BTreeSet<(usize, usize)> = if kind.moves_a_body() { bodies } else { surfaces };
        for (first, last) in places {
            let error = Perturbation { kind, first, last };
            let half_range = half_range(lens, error);
            let is_possible = half_range > 0.0
                && half_range.is_finite()
                && perturb(lens, &[(error, 0.5 * half_range)]).is_ok();
            if errors.len() < count && is_possible && known.insert(error) {
                let distribution = ErrorDistribution::default();
                errors.push(Tolerance { error, half_range, distribution });
            }
        }
    }
    errors.truncate(count);
    ToleranceSheet::of_errors(errors)
}

/// A half range of an error of any kind.
fn half_range(lens: &NominalLens, error: Perturbation) -> f64 {
    let system: &System<f64> = &lens.systems[lens.primary];
    let (radius, shape) = (lens.semi_diameters[error.first], &system.surfaces[error.first].shape);
    let fourth = SAG / radius.powi(4);
    match error.kind {
        PerturbationKind::Curvature => 2.0 * SAG / (radius * radius),
        PerturbationKind::Conic => 8.0 * fourth / shape.curvature().abs().powi(3),
        PerturbationKind::Asphere => fourth,
        PerturbationKind::Irregularity => SAG,
        PerturbationKind::Index => 5e-4,
        PerturbationKind::Abbe => 5e-3,
        PerturbationKind::Thickness
        | PerturbationKind::ThicknessAdjusted
        | PerturbationKind::SurfaceDecenterX
        | PerturbationKind::SurfaceDecenterY
        | PerturbationKind::ElementDecenterX
        | PerturbationKind::ElementDecenterY => DECENTER,
        PerturbationKind::AsphereSlope
        | PerturbationKind::SurfaceTiltX
        | PerturbationKind::SurfaceTiltY
        | PerturbationKind::ElementTiltX
        | PerturbationKind::ElementTiltY
        | PerturbationKind::ElementRollX
        | PerturbationKind::ElementRollY => ANGLE,
    }
}

/// The rays of a centred lens, and of the same lens as one of which every surface has a pose: the centred one.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct PoseCost {
    /// The time of a ray of the centred lens, one core, in nanoseconds.
    pub centred_ns: f64,
    /// That of the lens with poses.
    pub posed_ns: f64,
    /// The number of rays whose landings differ in any bit.
    pub different: usize,
}

/// The cost of poses, which a centred lens does not pay; `None` for a lens that has some.
pub(super) fn pose_cost(
    scene: &ToleranceScene,
    one: &ThreadPool,
) -> Result<Option<PoseCost>, ToleranceBenchmarkError> {
    if scene.lens.systems.iter().any(System::has_poses) {
        return Ok(None);
    }
    let centred = scene.lens.systems[scene.lens.primary].clone();
    let mut moved = centred.clone();
    moved.surfaces.iter_mut().for_each(|surface| surface.pose = Some(Pose::centred()));
    let fields = scene.beam.fields.iter().flat_map(|field| &field.colours);
    let own = fields.filter(|colour| colour.wavelength == scene.lens.primary);
    let rays: Rays<f64> = own.flat_map(|colour| colour.rays.iter().copied()).collect();
    let timed = |system: &System<f64>| {
        let tracer = Tracer::new(system).map_err(BenchmarkError::from)?;
        let mut landed = Landings::default();
        let trace = || tracer.trace_batch(&rays, &mut landed);
        let ((), ms) = one.install(|| time_median(9..=99, trace));
        Ok::<_, ToleranceBenchmarkError>((landed, 1e6 * ms / rays.len().max(1) as f64))
    };
    let ((centred, centred_ns), (moved, posed_ns)) = (timed(&centred)?, timed(&moved)?);
    let differs = |i: &usize| {
        centred.ray(*i) != moved.ray(*i)
            || centred.opl[*i] != moved.opl[*i]
            || centred.fate(*i) != moved.fate(*i)
    };
    let different = (0..rays.len()).filter(differs).count();
    Ok(Some(PoseCost { centred_ns, posed_ns, different }))
}

/// The time of the derivatives of the wavefront and of the contrast by all errors, on one core, in milliseconds.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct MeritSweepCost {
    /// The variance of the wavefront at the primary wavelength, with all products of errors.
    pub wavefront_ms: f64,
    /// The frequency of the contrast in cycles/mm.
    pub frequency: f64,
    /// The contrast at that, with both ends of the range of every error.
    pub contrast_ms: f64,
}

/// The frequency in cycles/mm.
const FREQUENCY: f64 = 20.0;

/// These times of a lens whose spots have a relative accuracy.
pub(super) fn merit_sweep_cost(
    (lens, scene, accuracy): (&Lens, &ToleranceScene, f64),
    sheet: &ToleranceSheet,
    one: &ThreadPool,
) -> Result<MeritSweepCost, ToleranceBenchmarkError> {
    let never = || false;
    let errors = (sheet, SecondDerivatives::Neglected);
    let wavefront = || WavefrontModel::new((lens, 0), scene, errors, &never);
    let contrast = || ContrastChanges::new((lens, 0, accuracy), scene, (sheet, FREQUENCY), &never);
    let (waves, wavefront_ms) = one.install(|| time_median(3..=9, wavefront));
    let (contrasts, contrast_ms) = one.install(|| time_median(1..=3, contrast));
    waves?;
    contrasts?;
    Ok(MeritSweepCost { wavefront_ms, frequency: FREQUENCY, contrast_ms })
}
