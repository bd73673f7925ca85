//! The effects of errors of making on the wavefront of each ray.
//!
//! One sweep of the rays back through the lens gives the derivatives of their points and slopes by all
//! numbers of the lens, and Fermat's principle those of their optical paths; the wavefront is a function
//! of these. Neither the rays nor the memory grow with the number of errors. A lens without such a sweep
//! is traced once for each different error.

use super::compensation::adjustments;
use super::covariance::MadeNumber;
use super::effects::{ErrorCombinations, combinations, different_errors};
use super::form::LinearEffects;
use super::merits::open_tracers;
use super::two_planes::TwoPlanes;
use super::wave_beam::{ArrivedField, WaveBeam, WaveRay};
use super::{Jet2, MadeKind, StopTest, ToleranceError, ToleranceScene, perturb, refuse_if_stopped};
use crate::lens::{AdjustedPart, Perturbation, System, ToleranceSheet};
use crate::math::{Dual, Real as _};
use crate::trace::{ErrorNumber, Rays, Tracer};
use nalgebra::{DMatrix, DVector};
use rayon::prelude::*;

/// A number with its derivative by an error.
type ErrorDual = Dual<f64, 1>;

/// The changes of the rays of a field by one unit of a number of the lens, and of the position of the
/// image plane in mm.
#[derive(Clone)]
struct RayChanges {
    rays: Vec<WaveRay<f64>>,
    image: f64,
}

/// The numbers on which the wavefront depends and the errors and compensators as combinations of them.
pub(super) struct WaveNumbers {
    count: usize,
    combinations: ErrorCombinations,
    /// The compensators but for the focus: combinations of numbers, or tilts of the sensor.
    adjustments: Vec<AdjustedNumbers>,
    /// The way to the derivatives of rays by the numbers.
    source: NumberSource,
}

/// The numbers that a compensator changes, or the sensor.
enum AdjustedNumbers {
    Lens(Vec<(usize, f64)>),
    Sensor(AdjustedPart),
}

/// The ways to the derivatives of rays.
enum NumberSource {
    /// By a sweep back, with these numbers of surfaces.
    Sweep(Vec<MadeNumber>),
    /// By a trace for each of these errors.
    Traces(Vec<Perturbation>),
}

impl WaveNumbers {
    /// Those of some tolerances.
    ///
    /// # Errors
    /// A lens that cannot be traced.
    pub(super) fn new(
        scene: &ToleranceScene,
        sheet: &ToleranceSheet,
    ) -> Result<Self, ToleranceError> {
        let errors = sheet.errors.iter().map(|own| own.error);
        let adjustments = adjustments(sheet);
        let in_lens = adjustments.iter().filter_map(|own| own.part.in_lens());
        let all: Vec<Perturbation> = errors.chain(in_lens).collect();
        let (source, count, every): (_, _, ErrorCombinations) =
            if open_tracers(&scene.lens.systems)?.iter().all(Tracer::has_error_slopes) {
                let (numbers, every) = combinations(scene, &all);
                let count = numbers.len();
                (NumberSource::Sweep(numbers), count, every)
            } else {
                let (different, places) = different_errors(&all);
                let every = places.iter().map(|place| vec![(*place, 1.0)]).collect();
                let count = different.len();
                (NumberSource::Traces(different), count, every)
            };
        let (own, of_lens) = every.split_at(sheet.errors.len());
        let mut of_lens = of_lens.iter().cloned();
        let adjusted = adjustments[1..].iter().map(|adjustment| match adjustment.part {
            AdjustedPart::Lens(_) => AdjustedNumbers::Lens(of_lens.next().unwrap_or_default()),
            tilt => AdjustedNumbers::Sensor(tilt),
        });
        let adjustments = adjusted.collect();
        Ok(Self { count, combinations: own.into(), adjustments, source })
    }
}

/// The wavefront of a lens of which the rays arrive so with its derivatives, at its image plane and at the best
/// position of that.
///
/// # Errors
/// A ray that does not arrive, and [`ToleranceError::Stopped`] once `stop` says so.
pub(super) fn wave_effects(
    (scene, beam): (&ToleranceScene, &WaveBeam),
    numbers: &WaveNumbers,
    (arrived, focus): (&[ArrivedField<f64>], f64),
    stop: StopTest<'_>,
) -> Result<[LinearEffects; 2], ToleranceError> {
    let traced = match &numbers.source {
        NumberSource::Traces(errors) => Some(traced_changes(scene, beam, errors, stop)?),
        NumberSource::Sweep(_) => None,
    };
    let planes = TwoPlanes::new(scene, 0.0)?;
    let field = |(i, arrived): (usize, &ArrivedField<f64>)| {
        refuse_if_stopped(stop)?;
        let changes = match (&numbers.source, &traced) {
            (NumberSource::Sweep(numbers), _) => {
                swept_changes((scene, &planes, beam), (i, arrived), numbers)?
            }
            (NumberSource::Traces(_), traced) => traced
                .iter()
                .flatten()
                .map(|changes| changes[i].clone())
                .collect::<Vec<RayChanges>>(),
        };
        Ok([0.0, focus].map(|plane| FieldWaves::new((beam, i), arrived, &changes, plane)))
    };
    let fields = arrived.par_iter().enumerate().map(field);
    let fields: Vec<[FieldWaves; 2]> = fields.collect::<Result<_, ToleranceError>>()?;
    let of = |plane: usize| {
        let fields: Vec<&FieldWaves> = fields.iter().map(|both| &both[plane]).collect();
        linear_effects(&fields, numbers, [0.0, focus][plane])
    };
    Ok([of(0), of(1)])
}

/// The changes of all fields by each error, by a trace for each.
fn traced_changes(
    scene: &ToleranceScene,
    beam: &WaveBeam,
    errors: &[Perturbation],
    stop: StopTest<'_>,
) -> Result<Vec<Vec<RayChanges>>, ToleranceError> {
    let one = |error: &Perturbation| {
        refuse_if_stopped(stop)?;
        let systems: Vec<System<ErrorDual>> =
            perturb(&scene.lens, &[(*error, Dual::variable(0.0, 0))])?;
        let field = |field: ArrivedField<ErrorDual>| RayChanges {
            rays: field.rays.iter().map(|ray| ray.map(|value| value.slope[0])).collect(),
            image: field.image.slope[0],
        };
        Ok(beam.trace(&systems)?.into_iter().map(field).collect())
    };
    errors.par_iter().map(one).collect()
}

/// The changes of the rays of a field by each number, by a sweep back.
fn swept_changes(
    (scene, planes, beam): (&ToleranceScene, &TwoPlanes, &WaveBeam),
    (field, arrived): (usize, &ArrivedField<f64>),
    numbers: &[MadeNumber],
) -> Result<Vec<RayChanges>, ToleranceError> {
    let rays: Rays<f64> = beam.fields[field].rays.iter().map(|(ray, _)| *ray).collect();
    let colours = [(beam.primary, rays)];
    let swept = planes.rays(scene, field, &colours)?;
    let paths = planes.near[beam.primary].error_paths(&colours[0].1);
    let at_rest = swept.at_rest();
    let change = |number: &MadeNumber| {
        let held = match number.kind {
            MadeKind::Number(kind) => Some(paths.row(number.surface, kind)),
            // The index at the primary wavelength does not depend on the Abbe number.
            MadeKind::Abbe => None,
        };
        let ray = |(i, [dx, dy, du, dv]): (usize, [f64; 4])| {
            let [_, _, u, v] = at_rest[i];
            let end =
                arrived.sense * arrived.index * (u * dx + v * dy) / (1.0 + u * u + v * v).sqrt();
            [dx, dy, du, dv, held.map_or(0.0, |held| held[i]) + end]
        };
        let changes = swept.changes(std::iter::once((number, 1.0))).into_iter();
        let moves = number.kind == MadeKind::Number(ErrorNumber::Thickness);
        RayChanges {
            rays: changes.enumerate().map(ray).collect(),
            image: if moves { 1.0 } else { 0.0 },
        }
    };
    Ok(numbers.iter().map(change).collect())
}

/// The wavefront of a field at a position of its image plane, less piston and tilt, times the roots of the
/// weights of its rays.
struct FieldWaves {
    offsets: DVector<f64>,
    /// A column for each number.
    numbers: DMatrix<f64>,
    /// By a displacement of the image plane.
    by_focus: DVector<f64>,
    /// The mean products of the wavefront with its second derivatives by the displacement and each number,
    /// and by the displacement twice.
    mixed: Vec<f64>,
    bend: f64,
    /// The point of the chief ray in mm.
    chief: [f64; 2],
}

impl FieldWaves {
    fn new(
        (beam, number): (&WaveBeam, usize),
        arrived: &ArrivedField<f64>,
        changes: &[RayChanges],
        plane: f64,
    ) -> Self {
        let field = &beam.fields[number];
        let roots: Vec<f64> = field.weights.iter().map(|w| (w * field.weight).sqrt()).collect();
        let column = |waves: &[Jet2], of: fn(&Jet2) -> f64| {
            let mut values: Vec<f64> = waves.iter().map(of).collect();
            field.remove_tilt(&mut values);
            let scaled = values.iter().zip(&roots).map(|(value, root)| value * root);
            DVector::from_iterator(roots.len(), scaled)
        };
        let at_rest = beam.waves(&arrived.map(Jet2::from_f64), twice_displaced(plane));
        let offsets = column(&at_rest, |jet| jet.value.value);
        let by_focus = column(&at_rest, |jet| jet.slope[0].value);
        let bend = offsets.dot(&column(&at_rest, |jet| jet.slope[0].slope[0]));
        let mut numbers = DMatrix::zeros(roots.len(), changes.len());
        let mut mixed = Vec::with_capacity(changes.len());
        for (m, change) in changes.iter().enumerate() {
            let waves = beam.waves(&arrived.changed(change), displaced(plane));
            numbers.set_column(m, &column(&waves, |jet| jet.value.slope[0]));
            mixed.push(offsets.dot(&column(&waves, |jet| jet.slope[0].slope[0])));
        }
        let [x, y, u, v, _] = arrived.chief();
        let chief = [x + plane * u, y + plane * v];
        Self { offsets, numbers, by_focus, mixed, bend, chief }
    }

    /// The effect of a tilt of the sensor: it displaces the image plane of a field in proportion to its height.
    fn by_tilt(&self, tilt: AdjustedPart) -> DVector<f64> {
        let lever = if tilt == AdjustedPart::SensorTiltX { self.chief[1] } else { -self.chief[0] };
        lever * &self.by_focus
    }
}

/// A displacement of the image plane with its derivative, of which no number depends on an error.
fn displaced(plane: f64) -> Jet2 {
    Dual { value: Dual::constant(plane), slope: [Dual::constant(1.0)] }
}

/// The same, differentiated twice.
fn twice_displaced(plane: f64) -> Jet2 {
    Jet2::variable(Dual::variable(plane, 0), 0)
}

impl ArrivedField<f64> {
    /// The rays with their derivatives by a number.
    fn changed(&self, changes: &RayChanges) -> ArrivedField<Jet2> {
        let along = |value: f64, slope: f64| Jet2::constant(Dual { value, slope: [slope] });
        let both = self.rays.iter().zip(&changes.rays);
        let ray = |(ray, by): (&WaveRay<f64>, &WaveRay<f64>)| {
            std::array::from_fn(|i| along(ray[i], by[i]))
        };
        ArrivedField {
            rays: both.map(ray).collect(),
            sense: self.sense,
            index: Jet2::from_f64(self.index),
            image: along(self.image, changes.image),
        }
    }
}

/// The effects on all fields, one after the other.
fn linear_effects(fields: &[&FieldWaves], numbers: &WaveNumbers, focus: f64) -> LinearEffects {
    let rows: usize = fields.iter().map(|field| field.offsets.len()).sum();
    let column = |of: &dyn Fn(&FieldWaves) -> DVector<f64>| {
        let parts = fields.iter().flat_map(|field| of(field).data.as_vec().clone());
        DVector::from_iterator(rows, parts)
    };
    let mut by_numbers = DMatrix::zeros(rows, numbers.count);
    let mut from = 0;
    for field in fields {
        by_numbers.rows_mut(from, field.offsets.len()).copy_from(&field.numbers);
        from += field.offsets.len();
    }
    let adjusted = numbers.adjustments.iter().map(|adjustment| match adjustment {
        AdjustedNumbers::Sensor(tilt) => column(&|field| field.by_tilt(*tilt)),
        AdjustedNumbers::Lens(parts) => {
            let mut sum = DVector::zeros(rows);
            parts.iter().for_each(|(m, by)| sum.axpy(*by, &by_numbers.column(*m), 1.0));
            sum
        }
    });
    let adjustments = adjusted.collect();
    let mixed = |m: usize| fields.iter().map(|field| field.mixed[m]).sum();
    LinearEffects {
        offsets: column(&|field| field.offsets.clone()),
        adjustments,
        by_focus: column(&|field| field.by_focus.clone()),
        mixed: (0..numbers.count).map(mixed).collect(),
        bend: fields.iter().map(|field| field.bend).sum(),
        numbers: by_numbers,
        combinations: ErrorCombinations::clone(&numbers.combinations),
        exact: None,
        focus,
    }
}
