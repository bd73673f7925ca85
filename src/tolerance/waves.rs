//! The wavefront of lenses with errors of making.
//!
//! The mean over all fields of the wavefront's variance at the primary wavelength, less piston and tilt,
//! is a smooth function of an error and of the position of the image plane: second-order jets by both
//! give its growth at the fixed image plane and, with the best position taken out, refocused. It is in
//! squares of the primary wavelength; its root is the RMS wavefront.

use super::merits::merits;
use super::sensitivity::Stages;
use super::{
    Beam, Derivatives, FieldBeam, Jet2, MeritOptions, Merits, NominalLens, RealMerit,
    RealMeritRequest, StopTest, ToleranceError, ToleranceScene, perturb, refuse_if_stopped,
};
use crate::lens::{Lens, Perturbation, PerturbationKind, System, ToleranceSheet};
use crate::math::{Dual, Real};
use crate::pupil::RayModel;
use rayon::prelude::*;
use std::collections::BTreeMap;

/// A number with its first and second derivatives by two variables.
type TwoJet = Dual<Dual<f64, 2>, 2>;

/// The wavefront of a lens and what errors of making do to it.
#[derive(Debug, Clone)]
pub struct WavefrontModel {
    /// The mean variance of the lens as designed at the fixed image plane and at its best position, in
    /// squared waves.
    pub nominal: [f64; 2],
    /// That position, in mm from the image plane.
    pub focus: f64,
    /// The derivatives of the variance by each error at the fixed image plane and refocused, in squared
    /// waves per unit and squared unit of the error.
    pub errors: Vec<[Derivatives; 2]>,
    judge: WavefrontJudge,
}

impl WavefrontModel {
    /// The wavefront of a lens at a zoom position with its tolerances. Each lens is refocused for its
    /// least variance, whatever the travel; other compensators rest.
    ///
    /// # Errors
    /// A lens that focuses nothing, a field without light at the primary wavelength, a ray that does not
    /// arrive, and [`ToleranceError::Stopped`] once `stop` says so.
    pub fn new(
        (lens, zoom): (&Lens, usize),
        scene: &ToleranceScene,
        sheet: &ToleranceSheet,
        stop: StopTest<'_>,
    ) -> Result<Self, ToleranceError> {
        let options = wavefront_options(lens, zoom, scene)?;
        let judge = WavefrontJudge { options, beam: primary_beam(&scene.beam, options.primary)? };
        let focus = judge.best_plane(&scene.lens)?;
        let focused = displaced(&scene.lens, focus);
        let near = Stages::new(&scene.lens, &judge.beam, options)?;
        let far = Stages::new(&focused, &judge.beam, options)?;
        let mut different: Vec<Perturbation> = sheet.errors.iter().map(|t| t.error).collect();
        different.sort_unstable();
        different.dedup();
        let one = |error: &Perturbation| {
            refuse_if_stopped(stop)?;
            let fixed: Jet2 = Jet2::variable(Dual::variable(0.0, 0), 0);
            let fixed = near.merits(&scene.lens, options, &[(*error, fixed)])?.0;
            let moved = [(*error, 0), (image_plane(&focused), 1)]
                .map(|(what, i)| (what, TwoJet::variable(Dual::variable(0.0, i), i)));
            let refocused = judge.mean(&far.merits(&focused, options, &moved)?.0);
            Ok((*error, [judge.mean(&fixed).into(), without_focus(refocused)]))
        };
        let found: Vec<_> = different.par_iter().map(one).collect::<Result<_, ToleranceError>>()?;
        let by_error: BTreeMap<Perturbation, [Derivatives; 2]> = found.into_iter().collect();
        let of = |error| by_error.get(&error).copied().unwrap_or_default();
        let nominal = [&scene.lens, &focused]
            .map(|lens| Ok(judge.mean(&merits(&lens.systems, &judge.beam, options)?)));
        let [fixed, refocused]: [Result<f64, ToleranceError>; 2] = nominal;
        Ok(Self {
            nominal: [fixed?, refocused?],
            focus,
            errors: sheet.errors.iter().map(|t| of(t.error)).collect(),
            judge,
        })
    }

    /// The variance of lenses with random errors by their rays, in squared waves: as the model has it, each
    /// refocused for its own least variance, other compensators at rest.
    ///
    /// # Errors
    /// Correlations that no errors can have, an error of making that is not possible, and
    /// [`ToleranceError::Stopped`] if there is no lens yet.
    pub fn real_lenses(
        &self,
        scene: &ToleranceScene,
        sheet: &ToleranceSheet,
        request: RealMeritRequest,
        stop: StopTest<'_>,
    ) -> Result<RealMerit, ToleranceError> {
        RealMerit::new(sheet, request, stop, |errors| {
            self.judge.lens((&scene.lens, self.focus), errors)
        })
    }

    /// The growth of the expected variance by each error alone, in squared waves, at the fixed image
    /// plane and refocused.
    pub fn growth(&self, sheet: &ToleranceSheet) -> Vec<[f64; 2]> {
        let pairs = sheet.errors.iter().zip(&self.errors);
        let half = |deviation: f64| 0.5 * deviation * deviation;
        pairs.map(|(t, by)| by.map(|by| half(t.deviation()) * by.second)).collect()
    }

    /// The share of each error in the sum of these.
    pub fn growth_shares(&self, sheet: &ToleranceSheet) -> Vec<[f64; 2]> {
        let growth = self.growth(sheet);
        let total = |i: usize| growth.iter().map(|by| by[i]).sum::<f64>().abs();
        let totals = [0, 1].map(|i| total(i).max(f64::MIN_POSITIVE));
        growth.iter().map(|by| [by[0] / totals[0], by[1] / totals[1]]).collect()
    }

    /// The root of the expected variance of lenses that are made in waves, at the fixed image plane and
    /// refocused: errors count as independent.
    pub fn expected_rms(&self, sheet: &ToleranceSheet) -> [f64; 2] {
        let growth = self.growth(sheet);
        [0, 1].map(|i| {
            let sum: f64 = growth.iter().map(|by| by[i]).sum();
            (self.nominal[i] + sum).max(0.0).sqrt()
        })
    }
}

/// The distance of an exit pupil at infinity in mm.
const FAR: f64 = 1e6;

/// The reference sphere of a lens: through the centre of its paraxial exit pupil.
fn wavefront_options(
    lens: &Lens,
    zoom: usize,
    scene: &ToleranceScene,
) -> Result<MeritOptions, ToleranceError> {
    let model =
        RayModel::from_lens(lens, zoom).map_err(|why| ToleranceError::Other(why.to_string()))?;
    let first_order = &model.first_order;
    if first_order.efl.is_none() {
        let text = "the lens focuses nothing, so that its wavefront has no reference sphere; \
                    expected a lens with a focal length";
        return Err(ToleranceError::Other(text.to_owned()));
    }
    let primary = scene.lens.primary;
    let vertices = scene.lens.systems[primary].vertex_positions();
    let last = vertices.get(vertices.len().saturating_sub(2)).copied().unwrap_or_default();
    let pupil = first_order.exit_pupil.position.map_or(-FAR, |position| last + position);
    let um = scene.lens.wavelengths[primary];
    Ok(MeritOptions { primary, wavefront: Some((pupil, um * 1e-3)) })
}

/// The rays of the primary wavelength alone.
fn primary_beam(beam: &Beam, primary: usize) -> Result<Beam, ToleranceError> {
    let of_field = |(number, field): (usize, &FieldBeam)| {
        let own = field.colours.iter().filter(|colour| colour.wavelength == primary);
        let colours: Vec<_> = own.cloned().collect();
        if colours.is_empty() {
            let text = format!("no light of field {} at the primary wavelength", number + 1);
            return Err(ToleranceError::Other(text));
        }
        Ok(FieldBeam { colours, ..field.clone() })
    };
    let fields = beam.fields.iter().enumerate().map(of_field).collect::<Result<_, _>>()?;
    Ok(Beam { fields })
}

/// The gap in front of the image plane.
fn image_plane(lens: &NominalLens) -> Perturbation {
    let last = lens.systems[lens.primary].surfaces.len().saturating_sub(2);
    Perturbation::of_surface(PerturbationKind::Thickness, last)
}

fn displaced(lens: &NominalLens, distance: f64) -> NominalLens {
    let mut lens = lens.clone();
    let last = image_plane(&lens).first;
    for system in &mut lens.systems {
        system.surfaces[last].thickness += distance;
    }
    lens
}

/// The derivatives by the first variable at the best value of the second one.
fn without_focus(jet: TwoJet) -> Derivatives {
    let value = jet.value.value;
    let [first, by_plane] = [0, 1].map(|i| jet.value.slope[i]);
    let second = |i: usize, j: usize| jet.slope[i].slope[j];
    let (both, bend) = (second(0, 1), second(1, 1));
    if !(bend > 0.0) {
        return Derivatives { value, first, second: second(0, 0) };
    }
    Derivatives {
        value: value - 0.5 * by_plane * by_plane / bend,
        first: first - by_plane * both / bend,
        second: second(0, 0) - both * both / bend,
    }
}

/// The rays by which wavefronts are judged.
#[derive(Debug, Clone)]
struct WavefrontJudge {
    options: MeritOptions,
    beam: Beam,
}

/// Steps to the best image plane: the variance is nearly a quadratic function of its position.
const STEPS: usize = 4;
/// The same for a lens with errors, which begins near it.
const LENS_STEPS: usize = 2;

impl WavefrontJudge {
    /// The mean variance over all fields.
    fn mean<R: Real>(&self, merits: &Merits<R>) -> R {
        let weighted = merits.wavefronts.iter().zip(&self.beam.fields);
        weighted.fold(R::ZERO, |sum, (wavefront, field)| {
            sum + wavefront.tilt_removed * R::from_f64(field.weight)
        })
    }

    /// The variance of a lens with errors at its image plane, and at its own best one, which is looked for from
    /// a displacement; `None` if a ray does not arrive.
    fn lens(
        &self,
        (lens, focus): (&NominalLens, f64),
        errors: &[(Perturbation, f64)],
    ) -> Result<Option<[f64; 2]>, ToleranceError> {
        let arrived = |found: Result<f64, ToleranceError>| match found {
            Err(ToleranceError::RayLost { .. }) => Ok(None),
            other => other.map(Some),
        };
        let systems = perturb(lens, errors)?;
        let judged = merits(&systems, &self.beam, self.options);
        let Some(fixed) = arrived(judged.map(|own| self.mean(&own)))? else { return Ok(None) };
        let mut focus = focus;
        let mut least = fixed;
        for _ in 0..LENS_STEPS {
            let mut moved: Vec<System<Jet2>> = systems.iter().map(System::cast).collect();
            let last = image_plane(lens).first;
            let variable = Jet2::variable(Dual::variable(0.0, 0), 0);
            let shift = Jet2::from_f64(focus) + variable;
            moved.iter_mut().for_each(|system| system.surfaces[last].thickness += shift);
            let judged = match merits(&moved, &self.beam, self.options) {
                Err(ToleranceError::RayLost { .. }) => return Ok(None),
                judged => judged?,
            };
            let Derivatives { value, first, second } = self.mean(&judged).into();
            if !(second > 0.0) {
                least = least.min(value);
                break;
            }
            focus -= first / second;
            least = value - 0.5 * first * first / second;
        }
        Ok(Some([fixed, least.max(0.0)]))
    }

    /// The displacement of the image plane in mm at which the mean variance is least.
    fn best_plane(&self, lens: &NominalLens) -> Result<f64, ToleranceError> {
        let mut focus = 0.0;
        for _ in 0..STEPS {
            let lens = displaced(lens, focus);
            let stages = Stages::new(&lens, &self.beam, self.options)?;
            let plane = [(image_plane(&lens), Jet2::variable(Dual::variable(0.0, 0), 0))];
            let found: Derivatives =
                self.mean(&stages.merits(&lens, self.options, &plane)?.0).into();
            if !(found.second > 0.0) {
                break;
            }
            focus -= found.first / found.second;
        }
        Ok(focus)
    }
}
