//! The lenses: rays, wavefronts, point spread, contrast, distortion and light.

use super::image_lens::on_y;
use super::{Answers, INTEGRAL, ImageEntry, ImageFileError, ImageLens, closed_form, integral};
use crate::analysis::{
    AnalysisError, MtfCurve, ReferenceForm, ZernikeOrder, chief_points, diffraction_mtf,
    field_paths, geometric_mtf, illumination, irradiance, point_spread,
    polychromatic_diffraction_mtf, polychromatic_geometric_mtf, scene_irradiance, spot, wavefront,
    zernike,
};
use crate::lens::FieldPoint;
use crate::picture::Scene;
use crate::pupil::{Accuracy, Aiming, RayModel};
use crate::trace::Ray;

type Done = Result<(), ImageFileError>;

const ACCURACY: Accuracy = Accuracy { tolerance: 1e-11, max_rays: 400_000 };
/// The tolerance of contrast, below the bound of every number and no more: it costs a ray for each node.
const CONTRAST: Accuracy = Accuracy { tolerance: 3e-10, ..ACCURACY };
/// The bound of path differences, in waves, and of direction cosines.
const WAVES: f64 = 1e-8;
const COSINES: f64 = 1e-11;
/// The bound of image points of chief rays, in mm.
const POINT: f64 = 1e-11;

/// The bound of a length by first-order optics and of single rays.
fn length(exact: f64) -> f64 {
    closed_form(exact.abs() + 1.0)
}

fn lenses<'a>(file: &ImageEntry<'a>) -> Result<Vec<ImageLens<'a>>, ImageFileError> {
    ImageLens::read_all(file.value)
}

pub(super) fn first_order(file: &ImageEntry<'_>, answers: &mut Answers) -> Done {
    for lens in lenses(file)? {
        let found = lens.model(false)?.first_order;
        let exact = lens.entry.get("first_order");
        for (found, key) in [
            (found.efl, "efl"),
            (found.bfl, "bfl"),
            (found.entrance_pupil.position, "z_ep"),
            (found.exit_pupil.position, "z_xp"),
        ] {
            answers.note_key(found.unwrap_or(f64::INFINITY), &exact, key, length)?;
        }
    }
    Ok(())
}

/// The difference of an answer from none: without an end if there is one.
fn difference_from_none<T, E>(found: &Result<T, E>) -> f64 {
    if found.is_ok() { f64::INFINITY } else { 0.0 }
}

pub(super) fn paths(file: &ImageEntry<'_>, answers: &mut Answers) -> Done {
    for lens in lenses(file)? {
        // No rim clips the rays of the table.
        let open = lens.model(false)?;
        for (exact, _, field) in lens.fields()? {
            let rays = exact.get("opd").list()?;
            let points: Result<Vec<_>, _> =
                rays.iter().map(|ray| ray.pair(["px", "py"], 1.0)).collect();
            let found = field_paths(&open, field, lens.primary(), &points?);
            let Some((chief, found)) = answers.accept(found, &exact.place) else { continue };
            let ReferenceForm::ExitPupil(radius) = chief.reference else {
                answers.refused(&exact.place, "another reference sphere");
                continue;
            };
            let known = exact.get("chief");
            for (found, key) in
                [(chief.point[1], "y"), (chief.path, "path_mm"), (radius, "sphere_radius_mm")]
            {
                answers.note_key(found, &known, key, length)?;
            }
            for (found, ray) in found.into_iter().zip(&rays) {
                if ray.get("waves").is_null() {
                    answers.note(difference_from_none(&found), 0.0, WAVES, &ray.place);
                    continue;
                }
                let Some(path) = answers.accept(found, &ray.place) else { continue };
                answers.note_key(path.waves, ray, "waves", |_| WAVES)?;
                answers.note_key(path.cosines[0], ray, "alpha", |_| COSINES)?;
                answers.note_key(path.cosines[1], ray, "beta", |_| COSINES)?;
            }
        }
    }
    Ok(())
}

pub(super) fn wavefronts(file: &ImageEntry<'_>, answers: &mut Answers) -> Done {
    for lens in lenses(file)? {
        for (exact, model, field) in lens.fields()? {
            if exact.get("opd_rms_waves").is_null() {
                continue;
            }
            let w = lens.primary();
            let found = wavefront(&model, field, w, ACCURACY);
            if let Some(found) = answers.accept(found, &exact.place) {
                for (found, key) in [(found.rms, "opd_rms_waves"), (found.mean, "opd_mean_waves")] {
                    let (known, exact) = (exact.get(key), exact.get(key).at("value")?);
                    let bound = integral(&known.get("err"))?.max(WAVES);
                    answers.note(found.value, exact, bound, &known.place);
                }
            }
            let found = spot(&model, field, ACCURACY);
            let area = found.map(|found| found.channels[w].map(|channel| channel.area.value));
            let Some(area) = answers.accept(area, &exact.place) else { continue };
            let Some(area) = answers.accept(area, &exact.place) else { continue };
            // The disc of the file has its own diameter; that of the program is the paraxial entrance pupil.
            let diameter = model.first_order.entrance_pupil.diameter.unwrap_or(f64::NAN);
            let scale = (diameter / lens.entry.at("epd")?).powi(2);
            let known = exact.get("lit_area");
            answers.note(
                scale * area,
                known.at("value")?,
                integral(&known.get("err"))?,
                &known.place,
            );
        }
    }
    Ok(())
}

pub(super) fn zernike_sums(file: &ImageEntry<'_>, answers: &mut Answers) -> Done {
    for lens in lenses(file)? {
        for (exact, model, field) in lens.fields()? {
            let terms = exact.get("zernike_noll").list_or_none()?;
            if terms.is_empty() {
                continue;
            }
            let order = (ZernikeOrder::Noll, terms.len());
            let found = zernike(&model, field, lens.primary(), order, ACCURACY);
            let Some(found) = answers.accept(found, &exact.place) else { continue };
            for (found, term) in found.coefficients.iter().zip(&terms) {
                answers.note_key(found.value, term, "waves", |_| WAVES)?;
            }
        }
    }
    Ok(())
}

pub(super) fn point_spreads(file: &ImageEntry<'_>, answers: &mut Answers) -> Done {
    for lens in lenses(file)? {
        for (exact, model, field) in lens.fields()? {
            let known = exact.get("psf").list_or_none()?;
            let points: Result<Vec<_>, _> =
                known.iter().map(|point| point.pair(["x", "y"], 1.0)).collect();
            let points = points?;
            if points.is_empty() {
                continue;
            }
            let found = point_spread(&model, field, lens.primary(), &points, ACCURACY);
            let Some(found) = answers.accept(found, &exact.place) else { continue };
            for (found, point) in found.intensities.iter().zip(&known) {
                let bound = integral(&point.get("err"))?;
                answers.note_key(found.value, point, "value", |_| bound)?;
            }
        }
    }
    Ok(())
}

/// The keys of a contrast: its modulus, its error, and the beginning of those of its parts.
type ContrastKeys = [&'static str; 3];
const DIFFRACTION: ContrastKeys = ["diffraction", "err", ""];
const RAYS: ContrastKeys = ["geometric", "geometric_err", "geometric_"];

/// Compares contrasts of a list, all frequencies at once; that of all wavelengths by its modulus alone.
fn note_contrasts(
    answers: &mut Answers,
    (known, [modulus, error, prefix]): (&ImageEntry<'_>, ContrastKeys),
    is_complex: bool,
    curve: impl Fn(&[f64]) -> Result<MtfCurve, AnalysisError>,
) -> Done {
    let entries = known.list_or_none()?;
    let frequencies: Result<Vec<f64>, _> =
        entries.iter().map(|entry| entry.at("frequency")).collect();
    let frequencies = frequencies?;
    if frequencies.is_empty() {
        return Ok(());
    }
    let Some(found) = answers.accept(curve(&frequencies), &known.place) else { return Ok(()) };
    for (point, entry) in found.points.iter().zip(&entries) {
        let is_tangential = entry.get("lines").text()? == "tangential";
        let value = if is_tangential { point.tangential } else { point.sagittal };
        let bound = integral(&entry.get(error))?;
        answers.note_key(value.modulus.value, entry, modulus, |_| bound)?;
        if is_complex {
            answers.note_key(value.re, entry, &format!("{prefix}re"), |_| bound)?;
            answers.note_key(value.im, entry, &format!("{prefix}im"), |_| bound)?;
        }
    }
    Ok(())
}

pub(super) fn contrast(file: &ImageEntry<'_>, answers: &mut Answers) -> Done {
    for lens in lenses(file)? {
        let w = lens.primary();
        for (exact, model, field) in lens.fields()? {
            let known = exact.get("mtf");
            note_contrasts(answers, (&known, DIFFRACTION), true, |nu| {
                diffraction_mtf(&model, field, w, nu, CONTRAST)
            })?;
            note_contrasts(answers, (&known, RAYS), true, |nu| {
                geometric_mtf(&model, field, w, nu, CONTRAST)
            })?;
        }
    }
    Ok(())
}

pub(super) fn contrast_of_colors(file: &ImageEntry<'_>, answers: &mut Answers) -> Done {
    for lens in lenses(file)? {
        for (exact, model, field) in lens.fields()? {
            let known = exact.get("poly").get("mtf");
            note_contrasts(answers, (&known, DIFFRACTION), false, |nu| {
                polychromatic_diffraction_mtf(&model, field, nu, CONTRAST)
            })?;
            note_contrasts(answers, (&known, RAYS), false, |nu| {
                polychromatic_geometric_mtf(&model, field, nu, CONTRAST)
            })?;
        }
    }
    Ok(())
}

pub(super) fn chief_rays(file: &ImageEntry<'_>, answers: &mut Answers) -> Done {
    for lens in lenses(file)? {
        let paraxial = lens.model(false)?;
        let systems =
            paraxial.channels.iter().map(|c| (c.um, c.weight, c.system.clone())).collect();
        let through_stop =
            RayModel::from_systems(systems, lens.primary(), paraxial.beam, Aiming::Stop);
        let through_stop = answers.accept(through_stop, lens.id());
        for exact in lens.entry.get("distortion").get("points").list()? {
            let field = direction([exact.at("x_deg")?, exact.at("y_deg")?]);
            for (model, key) in
                [(Some(&paraxial), "paraxial_pupil"), (through_stop.as_ref(), "stop_centre")]
            {
                let Some(model) = model else { continue };
                let points = chief_points(model, field);
                for (point, color) in points.into_iter().zip(exact.get("colors").list()?) {
                    note_chief_ray(answers, point, &color.get(key))?;
                }
            }
        }
    }
    Ok(())
}

/// Compares the image point of a chief ray; where the file has no ray it has no numbers.
fn note_chief_ray(answers: &mut Answers, point: Option<[f64; 2]>, known: &ImageEntry<'_>) -> Done {
    let exact = known.list()?;
    if exact.iter().any(ImageEntry::is_null) {
        return Ok(());
    }
    let missing = point.ok_or("no chief ray");
    let Some(point) = answers.accept(missing, &known.place) else { return Ok(()) };
    for (found, exact) in point.into_iter().zip(exact) {
        answers.note(found, exact.number()?, POINT, &known.place);
    }
    Ok(())
}

/// The field whose light has the tangents of these two angles in degrees: its angle, divided by azimuth.
fn direction(degrees: [f64; 2]) -> FieldPoint {
    let slopes = degrees.map(|angle| angle.to_radians().tan());
    let length = slopes[0].hypot(slopes[1]);
    let angle = length.atan().to_degrees();
    let [x, y] = slopes.map(|slope| if length > 0.0 { angle * slope / length } else { 0.0 });
    FieldPoint { x, y, weight: 1.0 }
}

pub(super) fn illuminations(file: &ImageEntry<'_>, answers: &mut Answers) -> Done {
    let scene = file.get("scene");
    for lens in lenses(file)? {
        let (w, open) = (lens.primary(), lens.model(true)?);
        for exact in lens.entry.get("irradiance").list()? {
            let field = on_y(exact.at("field_deg")?);
            let model = RayModel { fields: vec![field], ..open.clone() };
            for light in illumination(&model, w, ACCURACY) {
                answers.note_key(light.cone.value, &exact, "forward_cone", |_| INTEGRAL)?;
                answers.note_key(light.point[1], &exact, "centroid_y", |_| INTEGRAL)?;
            }
            let found = irradiance(&model, w, [0.0, exact.at("image_y")?], ACCURACY);
            let bound = integral(&exact.get("backward_err"))?;
            let Some(found) = answers.accept(found, &exact.place) else { continue };
            answers.note_key(found.value, &exact, "backward_projected_solid_angle", |_| bound)?;
        }
        if scene.get("lens").text()? == lens.id() {
            note_scene(answers, (&open, w), &scene)?;
        }
    }
    Ok(())
}

/// Compares the irradiance of a white scene and of waves at points of the image.
fn note_scene(
    answers: &mut Answers,
    (model, wavelength): (&RayModel, usize),
    scene: &ImageEntry<'_>,
) -> Done {
    for point in scene.get("points").list()? {
        let at = point.pair(["x", "y"], 1.0)?;
        let white = point.get("uniform");
        let found = irradiance(model, wavelength, at, ACCURACY);
        if let Some(found) = answers.accept(found, &white.place) {
            answers.note_key(found.value, &white, "value", |_| INTEGRAL)?;
        }
        for wave in point.get("scenes").list()? {
            let far = wave.get("kind").text()? == "infinity";
            let [x, y] = wave.pair(if far { ["fx", "fy"] } else { ["gx", "gy"] }, 1.0)?;
            let distance = if far { None } else { Some(wave.at("distance")?) };
            let scene = Scene::wave([x, y, wave.at("phase")?], distance);
            let Some(scene) = answers.accept(scene, &wave.place) else { continue };
            let radiance = |ray: &Ray<f64>| scene.radiance(ray, 0.0)[0];
            let found = scene_irradiance(model, wavelength, at, radiance, ACCURACY);
            let Some(found) = answers.accept(found, &wave.place) else { continue };
            answers.note_key(found.value, &wave, "value", |_| INTEGRAL)?;
        }
    }
    Ok(())
}
