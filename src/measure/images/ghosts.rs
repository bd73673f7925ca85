//! Ghosts of two reflections: first-order optics and single rays.

use super::image_lens::on_y;
use super::{Answers, ImageEntry, ImageFileError, ImageLens, closed_form};
use crate::analysis::{Coating, GhostPath, ParaxialGhost, rank_ghosts};
use crate::lens::{Aperture, FieldKind, Object};
use crate::math::Vec3;
use crate::paraxial::Beam;
use crate::pupil::{Aiming, RayModel};
use crate::trace::{Fate, Ray};

type Done = Result<(), ImageFileError>;

/// The bound of numbers by first-order optics, which the file has with 15 digits of paths through 30 surfaces.
fn first_order_bound(exact: f64) -> f64 {
    1e-10 * exact.abs() + 1e-13
}

/// The absolute bound of the end of a ray in mm and of its cosines, and the relative one of its light.
const RAY: f64 = 1e-10;
const LIGHT: f64 = 1e-9;

/// The lens of the ghosts with its indices at one wavelength, all rims clipping.
fn ghost_model(file: &ImageEntry<'_>) -> Result<RayModel, ImageFileError> {
    let ghosts = file.get("ghosts");
    let id = ghosts.get("lens").text()?;
    let lens = ImageLens::read_all(file.value)?.into_iter().find(|lens| lens.id() == id);
    let missing = || ImageFileError::new(&ghosts.place, "the id of a lens");
    let lens = lens.ok_or_else(missing)?;
    let clipped = lens.model(true)?;
    let mut system = clipped.channels[lens.primary()].system.clone();
    let indices = ghosts.get("indices").numbers()?;
    system.surfaces.iter_mut().zip(indices).for_each(|(surface, index)| surface.index = index);
    let aperture = Aperture::EntrancePupilDiameter(ghosts.at("epd")?);
    let edge = 10.0;
    let beam = Beam { object: Object::Infinity, aperture, field: FieldKind::Angle, edge };
    let color = (ghosts.at("wavelength_um")?, 1.0, system);
    let model = RayModel::from_systems(vec![color], 0, beam, Aiming::Paraxial);
    let model =
        model.map_err(|why| ImageFileError::new(&ghosts.place, format!("a lens: {why}")))?;
    Ok(RayModel { fields: vec![on_y(0.0)], ..model })
}

pub(super) fn first_order(file: &ImageEntry<'_>, answers: &mut Answers) -> Done {
    let (exact, model) = (file.get("ghosts"), ghost_model(file)?);
    let ranking = rank_ghosts(&model, 0, Coating::Bare);
    let Some(ranking) = answers.accept(ranking, &exact.place) else { return Ok(()) };
    answers.note_key(ranking.ghosts.len() as f64, &exact, "pairs", |_| 0.0)?;
    answers.note_key(ranking.direct, &exact, "transmission_direct", closed_form)?;
    answers.note_key(ranking.flux, &exact, "ghost_flux_share", closed_form)?;
    for known in exact.get("ghosts").list()? {
        let pair = pair(&known)?;
        let same = |ghost: &&ParaxialGhost| [ghost.first, ghost.second] == pair;
        let found = ranking.ghosts.iter().find(same).ok_or("no such pair");
        let Some(ghost) = answers.accept(found, &known.place) else { continue };
        let ([[a, b], [c, d]], none) = (ghost.matrix, f64::INFINITY);
        for (found, key) in [
            (a, "A"),
            (b, "B"),
            (c, "C"),
            (d, "D"),
            (ghost.focal_length.unwrap_or(none), "ghost_focal_length"),
            (ghost.focus.unwrap_or(none), "ghost_image_from_image_plane"),
            (ghost.radius, "sensor_radius_full_beam"),
            (ghost.clip_factor, "clip_factor"),
            (ghost.height_per_tangent, "height_per_tan"),
            (ghost.reflected, "reflectance_product"),
            (ghost.transmitted, "transmitted"),
            (ghost.irradiance, "irradiance_over_entrance"),
        ] {
            answers.note_key(found, &known, key, first_order_bound)?;
        }
        note_surface(answers, ghost.clipped_at, &known.get("clipped_at"))?;
    }
    Ok(())
}

/// The surfaces of the first and of the second reflection.
fn pair(entry: &ImageEntry<'_>) -> Result<[usize; 2], ImageFileError> {
    Ok([entry.get("first_reflection").count()?, entry.get("second_reflection").count()?])
}

/// Compares the number of a surface or of a step, or none.
fn note_surface(answers: &mut Answers, found: Option<usize>, known: &ImageEntry<'_>) -> Done {
    let exact = if known.is_null() { None } else { Some(known.count()?) };
    answers.note(f64::from(u8::from(found != exact)), 0.0, 0.0, &known.place);
    Ok(())
}

pub(super) fn real_rays(file: &ImageEntry<'_>, answers: &mut Answers) -> Done {
    let model = ghost_model(file)?;
    let (system, mm) = (&model.channels[0].system, 1e-3 * model.channels[0].um);
    for exact in file.get("ghosts").get("real_meridional_rays").list()? {
        let (sin, cos) = exact.at("field_deg")?.to_radians().sin_cos();
        let point = Vec3::new(0.0, exact.at("y0")?, 0.0);
        let ray = Ray { point, direction: Vec3::new(0.0, sin, cos) };
        let path = GhostPath::new(system, pair(&exact)?);
        let Some(path) = answers.accept(path, &exact.place) else { continue };
        let clipped = path.trace(ray, mm, Coating::Bare).traced;
        let path = path.without_rims();
        let free = path.trace(ray, mm, Coating::Bare);
        let fate = match exact.get("status").text()? {
            "ok" => "imaged",
            "tir" => "total_reflection",
            "miss" => "missed",
            other => other,
        };
        let arrives = fate == "imaged" || fate == "clipped";
        let found = if arrives { clipped.fate } else { free.traced.fate };
        let wrong = found.name() != fate;
        answers.note(f64::from(u8::from(wrong)), 0.0, 0.0, &exact.get("status").place);
        let keys = if arrives { ["clipped_step", "clipped_surface"] } else { ["step", "surface"] };
        note_loss(answers, (&path, found), &exact, keys)?;
        if arrives {
            let Ray { point, direction } = free.traced.ray;
            for (found, key) in [(point.y, "y"), (direction.y, "M"), (direction.z, "N")] {
                answers.note_key(found, &exact, key, |_| RAY)?;
            }
            for (found, key) in free.intensity.into_iter().zip(["intensity_s", "intensity_p"]) {
                answers.note_key(found, &exact, key, |light| LIGHT * light)?;
            }
        }
    }
    Ok(())
}

/// Compares the step and the surface where a ray is lost.
fn note_loss(
    answers: &mut Answers,
    (path, fate): (&GhostPath, Fate),
    exact: &ImageEntry<'_>,
    [step, surface]: [&str; 2],
) -> Done {
    note_surface(answers, fate.surface(), &exact.get(step))?;
    note_surface(answers, path.lost_at(fate), &exact.get(surface))
}
