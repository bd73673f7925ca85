//! One lens with its errors of making as a lens of its own: the prescription that measuring it would
//! give.
//!
//! Errors of shape and of gaps are added to the numbers of their rows, those of poses become the places
//! of surfaces, and compensators are where the adjustment has left them. The rays of the lens as designed
//! have the spot in it that was stated for the lens that was made. Its stop is as large as that of the
//! lens as designed, and its fields are those by which this was judged, on both sides of the axis: opened,
//! it shows the number that is stated for it ([`MadeLens::opened_rms`]).
//!
//! A changed medium is a model glass, fitted to the indices at the wavelengths of the lens: with one or
//! two of them it has these exactly, with more up to the part of the dispersion that no model glass has.

use super::monte_carlo::{BeamColumns, RealLens};
use super::{
    ToleranceError, ToleranceScene, adjusted::mean_spot, compensation::adjustments, merits,
    nominal::has_one_side, perturb, perturb::slope_changes,
};
use crate::lens::{
    AdjustedPart, Aperture, AxisBreak, FieldPoint, Freeform, FreeformKind, Lens, Medium,
    Perturbation, PerturbationKind, Pose, Row, System, ToleranceSheet, at_zoom, glass,
};
use crate::math::Vec3;
use crate::pupil::RayModel;
use nalgebra::{DMatrix, DVector};

/// A lens with random errors as a lens of its own.
#[derive(Debug, Clone)]
pub struct MadeLens {
    /// The lens.
    pub lens: Lens,
    /// Its number among the lenses with random errors, counted from 0.
    pub number: usize,
    /// The rms spot radius over all fields that was stated for it, with its compensators adjusted, in mm.
    pub stated_rms: f64,
    /// The same by the rays of the lens as designed through this lens; `None` if one does not arrive.
    pub traced_rms: Option<f64>,
    /// The rms spot radius over all fields that the lens shows when it is opened, with pupils of its own;
    /// `None` if a field gets no light.
    pub opened_rms: Option<f64>,
}

/// The lens with the largest adjusted spot of those whose rays arrive; `None` if there is none.
///
/// # Errors
/// An error that no prescription can have.
pub fn worst_lens(
    (lens, zoom): (&Lens, usize),
    scene: &ToleranceScene,
    sheet: &ToleranceSheet,
    real: &[RealLens],
) -> Result<Option<MadeLens>, ToleranceError> {
    let squares = real.iter().enumerate();
    let arrived = squares.filter_map(|(i, own)| Some((i, own, own.mean_square?[1])));
    let mut arrived: Vec<_> = arrived.collect();
    arrived.sort_by(|a, b| b.2.total_cmp(&a.2));
    let mut worst = None;
    for (number, own, square) in arrived.into_iter().take(LIT) {
        let mut made = made_lens((lens, zoom), scene, sheet, own)?;
        made.name = format!("{}, worst of {}", lens.name, real.len());
        let stated_rms = square.max(0.0).sqrt();
        let opened_rms = opened_rms(&made);
        let shown = opened_rms.unwrap_or(stated_rms);
        made.notes = format!(
            "Lens {} of {} with random errors of making, its compensators adjusted: its rms spot radius \
             over all fields, which are those on both sides of the axis, is {shown:.6} mm.",
            number + 1,
            real.len()
        );
        let traced_rms = held_rms(scene, &made)?;
        let found = MadeLens { lens: made, number, stated_rms, traced_rms, opened_rms };
        if opened_rms.is_some() {
            return Ok(Some(found));
        }
        worst = worst.or(Some(found));
    }
    Ok(worst)
}

/// The number of the worst lenses among which one is looked for of which no field is dark.
const LIT: usize = 8;
/// The relative error of the spots of a lens that is opened.
const OPENED: f64 = 1e-3;

/// The rms spot radius over all fields of a lens by its own pupils; `None` if a field gets no light.
fn opened_rms(lens: &Lens) -> Option<f64> {
    let scene = ToleranceScene::new(lens, 0, OPENED).ok()?;
    let found = merits(&scene.lens.systems, &scene.beam, scene.options).ok()?;
    Some(found.mean_square().max(0.0).sqrt())
}

/// A lens at a zoom position with random errors and its compensators adjusted, as a lens of its own that
/// has neither variables nor tolerances.
///
/// # Errors
/// An error that no prescription can have.
pub fn made_lens(
    (lens, zoom): (&Lens, usize),
    scene: &ToleranceScene,
    sheet: &ToleranceSheet,
    real: &RealLens,
) -> Result<Lens, ToleranceError> {
    let own = sheet.errors.iter().zip(&real.errors).map(|(t, value)| (t.error, *value));
    let adjustments = adjustments(sheet);
    let positions = || adjustments.iter().zip(&real.adjustments);
    let moved = positions().filter_map(|(own, at)| Some((own.part.in_lens()?, *at)));
    let errors: Vec<(Perturbation, f64)> = own.chain(moved).filter(|(_, v)| *v != 0.0).collect();
    let systems = perturb(&scene.lens, &errors)?;
    let mut made = Lens {
        variables: Vec::new(),
        pickups: Vec::new(),
        image_solve: None,
        tolerances: None,
        ..at_zoom(lens, zoom)
    };
    set_beam(&mut made, (lens, zoom))?;
    let mut writer = MadeWriter { scene, systems: &systems, lens: &mut made };
    errors.iter().try_for_each(|(what, value)| writer.add_to_shape(*what, *value))?;
    writer.take_places();
    writer.take_media(&errors);
    let of = |part| positions().find(|(own, _)| own.part == part).map_or(0.0, |(_, at)| *at);
    let tilt = [of(AdjustedPart::SensorTiltX), of(AdjustedPart::SensorTiltY)];
    writer.place_sensor(of(AdjustedPart::Focus), tilt);
    made.check()?;
    Ok(made)
}

/// Gives a lens the beam of the lens as designed: the same stop, and the fields by which this is judged, as
/// they are in object space.
fn set_beam(made: &mut Lens, (lens, zoom): (&Lens, usize)) -> Result<(), ToleranceError> {
    let other = |why: &dyn std::fmt::Display| ToleranceError::Other(why.to_string());
    let model = RayModel::from_lens(lens, zoom).map_err(|why| other(&why))?;
    let (stop, radius) = (model.stop(), model.stop_radius());
    if let Some(row) = made.surfaces.get_mut(stop) {
        row.stop = true;
        row.semi_diameter = Some(row.semi_diameter.map_or(radius, |own| own.min(radius)));
    }
    made.aperture = Aperture::StopSemiDiameter(radius);
    let both_sides = has_one_side(&model);
    let mut fields = Vec::new();
    for field in &model.fields {
        let launch = model.launch(*field, model.primary).map_err(|why| other(&why))?;
        let (kind, point) = launch.object_field();
        made.fields.kind = kind;
        if both_sides && (point.x != 0.0 || point.y != 0.0) {
            let half = FieldPoint { weight: 0.5 * point.weight, ..point };
            fields.extend([half, FieldPoint { x: -point.x, y: -point.y, ..half }]);
        } else {
            fields.push(point);
        }
    }
    made.fields.values = fields;
    Ok(())
}

/// The rms spot radius in mm over all fields of the rays of the lens as designed through another lens,
/// without rims; `None` if one does not arrive.
fn held_rms(scene: &ToleranceScene, lens: &Lens) -> Result<Option<f64>, ToleranceError> {
    let mut systems = Vec::with_capacity(scene.lens.wavelengths.len());
    for (um, nominal) in scene.lens.wavelengths.iter().zip(&scene.lens.systems) {
        let mut system = lens.resolve(0, *um)?;
        for (surface, own) in system.surfaces.iter_mut().zip(&nominal.surfaces) {
            surface.remove_apertures();
            surface.semi_diameter = own.semi_diameter;
        }
        systems.push(system);
    }
    let landed = BeamColumns::new(&scene.beam).landings(&systems);
    Ok(landed.map(|landed| mean_spot(&landed).a.max(0.0).sqrt()))
}

/// Writes errors into a prescription.
struct MadeWriter<'a> {
    scene: &'a ToleranceScene,
    /// The lens with its errors at each wavelength.
    systems: &'a [System<f64>],
    lens: &'a mut Lens,
}

impl MadeWriter<'_> {
    fn add_to_shape(&mut self, what: Perturbation, value: f64) -> Result<(), ToleranceError> {
        let Perturbation { kind, first, .. } = what;
        let surfaces = self.lens.surfaces.len();
        let radius = self.scene.lens.semi_diameters.get(first).copied().unwrap_or(1.0);
        let missing = ToleranceError::NoSuchSurface { what, surfaces };
        let row = self.lens.surfaces.get_mut(first).ok_or(missing)?;
        match kind {
            PerturbationKind::Curvature => row.curvature += value,
            PerturbationKind::Conic => row.conic += value,
            PerturbationKind::Asphere => add_fourth(row, value),
            PerturbationKind::AsphereSlope => {
                let [curvature, fourth] = slope_changes(radius);
                row.curvature += curvature * value;
                add_fourth(row, fourth * value);
            }
            PerturbationKind::Irregularity => {
                add_fourth(row, 0.5 * value / radius.powi(4));
                if !add_astigmatism(row, 0.5 * value, radius) {
                    let why = "cannot be written beside the form of the surface";
                    return Err(ToleranceError::NotPossible { what, why });
                }
            }
            _ => {}
        }
        Ok(())
    }

    /// The gaps, and the places of the surfaces that the errors have moved.
    fn take_places(&mut self) {
        let primary = self.scene.lens.primary;
        let (own, nominal) = (&self.systems[primary], &self.scene.lens.systems[primary]);
        let rows = self.lens.surfaces.iter_mut().zip(&own.surfaces).zip(&nominal.surfaces);
        for ((row, own), nominal) in rows {
            row.thickness = own.thickness;
            if let Some(pose) = own.pose.filter(|pose| Some(*pose) != nominal.pose) {
                let axis = own.axis.unwrap_or_else(Pose::centred);
                row.place_on_axis(&pose, &pose.inverse().then(&axis));
            }
        }
    }

    /// The media that the errors have changed; all of them where they have a temperature, which no model
    /// glass has.
    fn take_media(&mut self, errors: &[(Perturbation, f64)]) {
        let is_of_medium = |kind| matches!(kind, PerturbationKind::Index | PerturbationKind::Abbe);
        let has_temperature = self.lens.environment.celsius.take().is_some();
        for i in 0..self.lens.surfaces.len() {
            let mut own = errors.iter().filter(|(what, _)| what.first == i);
            let changed = own.any(|(what, _)| is_of_medium(what.kind));
            let medium = &self.lens.surfaces[i].medium;
            let is_glass = !matches!(medium, Medium::Air | Medium::Mirror);
            if changed || (has_temperature && is_glass) {
                let indices: Vec<(f64, f64)> = self
                    .scene
                    .lens
                    .wavelengths
                    .iter()
                    .zip(self.systems)
                    .map(|(um, system)| (*um, system.surfaces[i].index))
                    .collect();
                self.set_medium(i, fitted_medium(&indices));
            }
        }
    }

    fn set_medium(&mut self, surface: usize, medium: Medium) {
        match &mut self.lens.surfaces[surface].medium {
            Medium::Grin(gradient) => gradient.base = medium,
            Medium::Mirror => {}
            other => *other = medium,
        }
    }

    /// Moves the image plane along the axis by `focus` mm and tilts it there.
    fn place_sensor(&mut self, focus: f64, tilt: [f64; 2]) {
        let Some(row) = self.lens.surfaces.last_mut() else { return };
        row.thickness += focus;
        if tilt == [0.0; 2] {
            return;
        }
        let along = Vec3::new(0.0, 0.0, row.thickness);
        let turned = Pose::new([0.0; 2], tilt);
        let pose = Pose { shift: along - turned.direction_out(along), ..turned };
        let before = row.break_after.as_ref().map_or_else(Pose::centred, AxisBreak::pose);
        row.break_after = Some(AxisBreak::from_pose(&before.then(&pose)));
    }
}

/// Adds to the coefficient of r⁴.
fn add_fourth(row: &mut Row, value: f64) {
    match row.asphere.first_mut() {
        Some(own) => *own += value,
        None => row.asphere.push(value),
    }
}

/// The place of the coefficient of y² among those of an XY polynomial.
const SQUARE_OF_Y: usize = 4;

/// Adds `depth (y/radius)²` to the sag; false for a form that has no such term.
fn add_astigmatism(row: &mut Row, depth: f64, radius: f64) -> bool {
    let form = row.freeform.get_or_insert_with(|| {
        let kind = FreeformKind::XyPolynomial { radius };
        Freeform { kind, numbers: Vec::new() }
    });
    let FreeformKind::XyPolynomial { radius: own } = form.kind else { return false };
    if form.numbers.len() <= SQUARE_OF_Y {
        form.numbers.resize(SQUARE_OF_Y + 1, 0.0);
    }
    form.numbers[SQUARE_OF_Y] += depth * (own / radius).powi(2);
    true
}

/// The smallest Abbe number of a model glass.
const LEAST_ABBE: f64 = 1.0;

/// The medium with these indices at some wavelengths in micrometres: a constant index, or the model glass
/// that is nearest to them.
fn fitted_medium(indices: &[(f64, f64)]) -> Medium {
    let mean = indices.iter().map(|(_, n)| n).sum::<f64>() / indices.len().max(1) as f64;
    let is_constant = indices.iter().all(|(_, n)| (n - mean).abs() < 1e-12);
    if is_constant || indices.len() < 2 {
        return Medium::Index(mean);
    }
    // A model glass is linear in nd − 1 and in its mean dispersion.
    let at = |nd: f64, spread: f64, um: f64| glass::model_index(1.0 + nd, nd / spread, um) - 1.0;
    let slopes = |um: f64| {
        let one = at(1.0, 0.02, um);
        let by_spread = (at(1.0, 0.04, um) - one) / 0.02;
        [one - 0.02 * by_spread, by_spread]
    };
    let matrix = DMatrix::from_fn(indices.len(), 2, |i, j| slopes(indices[i].0)[j]);
    let values = DVector::from_iterator(indices.len(), indices.iter().map(|(_, n)| n - 1.0));
    let Ok(found) = matrix.svd(true, true).solve(&values, 1e-12) else {
        return Medium::Index(mean);
    };
    let (nd, vd) = (1.0 + found[0], found[0] / found[1]);
    if vd > LEAST_ABBE { Medium::Model { nd, vd } } else { Medium::Index(mean) }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::files::{bundled_lenses, json};
    use crate::lens::{Compensator, ToleranceGrade};
    use crate::tolerance::{graded_sheet, real_lenses};
    use std::sync::atomic::AtomicBool;

    fn lens(name: &str) -> Lens {
        let found = bundled_lenses().iter().find(|bundled| bundled.name == name).unwrap();
        json::read(found.text, name).unwrap()
    }

    fn worst(lens: &Lens, compensators: &[&str]) -> MadeLens {
        let scene = ToleranceScene::new(lens, 0, 1e-2).unwrap();
        let mut sheet = graded_sheet(lens, &scene.lens, ToleranceGrade::Commercial);
        let read = |text: &&str| text.parse::<Compensator>().unwrap();
        compensators.iter().map(read).for_each(|own| sheet.set_compensator(own));
        let never = AtomicBool::new(false);
        let real = real_lenses(&scene, &sheet, 3, 12, 0, &never).unwrap();
        worst_lens((lens, 0), &scene, &sheet, &real).unwrap().unwrap()
    }

    fn apart(made: &MadeLens) -> f64 {
        (made.traced_rms.unwrap() / made.stated_rms - 1.0).abs()
    }

    /// All kinds of errors of a class at one wavelength, where a model glass has every index.
    #[test]
    fn the_written_lens_has_the_spot_that_was_stated_for_it() {
        let mut triplet = lens("cooke_triplet_100_f27");
        triplet.wavelengths.truncate(1);
        triplet.wavelengths[0].primary = true;
        triplet.wavelengths[0].weight = 1.0;
        let made = worst(&triplet, &[]);
        assert!(apart(&made) < 1e-9, "{made:?}");
        let text = json::write(&made.lens);
        let again = json::read(&text, "made").unwrap();
        assert_eq!(again.surfaces.len(), triplet.surfaces.len());
        let adjusted = ["focus=0.05", "sensor_tilt_x=1", "element_decenter_y@3-4=0.05"];
        let made = worst(&triplet, &adjusted);
        assert!(apart(&made) < 1e-7, "{} {:?}", made.stated_rms, made.traced_rms);
    }

    /// With more wavelengths a model glass lacks a part of the dispersion.
    #[test]
    fn a_fitted_glass_changes_the_spot_by_little() {
        for name in ["cooke_triplet_100_f27", "achromat_ac254_100"] {
            let made = worst(&lens(name), &[]);
            assert!(apart(&made) < 0.02, "{name}: {} {:?}", made.stated_rms, made.traced_rms);
        }
    }

    #[test]
    fn a_model_glass_is_fitted_to_itself() {
        let of = |um: f64| (um, glass::model_index(1.62, 36.3, um));
        let found = fitted_medium(&[0.4861, 0.5876, 0.6563].map(of));
        let Medium::Model { nd, vd } = found else { panic!("{found:?}") };
        assert!((nd - 1.62).abs() < 1e-9 && (vd - 36.3).abs() < 1e-6, "{nd} {vd}");
        assert_eq!(fitted_medium(&[(0.5, 1.5), (0.6, 1.5)]), Medium::Index(1.5));
    }
}
