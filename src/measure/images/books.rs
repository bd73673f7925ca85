//! The pupils of the books: discs, rings, aberrations by name and pupils of other shapes.

use super::{Answers, INTEGRAL, ImageEntry, ImageFileError};
use crate::analysis::{PupilCurve, PupilFunction, RoundPupil};

type Done = Result<(), ImageFileError>;

/// The absolute tolerance of contrast, and the order of quadrature of intensities.
const CONTRAST: f64 = 1e-11;
const ORDER: usize = 8;
/// The bound of the intensity of pupils without aberrations.
const INTENSITY: f64 = 1e-10;

/// The pupil of entries that have lengths in λN and frequencies over the cutoff.
fn unit_pupil(obscuration: f64) -> RoundPupil {
    RoundPupil::new(0.5, 2.0, obscuration)
}

/// Points with intensities and with the energy within circles through them.
fn note_points(
    answers: &mut Answers,
    (round, pupil): (&RoundPupil, &PupilFunction),
    exact: &ImageEntry<'_>,
) -> Done {
    let (unit, points) = (round.unit(), exact.get("points").list()?);
    let radii: Result<Vec<f64>, _> =
        points.iter().map(|point| Ok(unit * point.at("r_over_lambdaN")?)).collect();
    let radii = radii?;
    let circles = round.encircled(pupil, &radii, true);
    let light = pupil.samples(ORDER);
    for ((point, radius), [energy, _]) in points.iter().zip(radii).zip(circles) {
        let intensity = light.intensity([0.6 * radius, -0.8 * radius]);
        answers.note_key(intensity, point, "intensity", |_| INTENSITY)?;
        answers.note_key(energy, point, "encircled", |_| INTEGRAL)?;
    }
    Ok(())
}

/// The contrast at frequencies of a key, times a scale.
fn note_contrast(
    answers: &mut Answers,
    pupil: &PupilFunction,
    (exact, key, scale): (&ImageEntry<'_>, &str, f64),
) -> Done {
    for otf in exact.get("otf").list()? {
        let found = pupil.transfer([0.0, scale * otf.at(key)?], 0.0, CONTRAST);
        answers.note_key(found.re, &otf, "value", |_| INTEGRAL)?;
        answers.note(found.im, 0.0, INTEGRAL, &otf.place);
    }
    Ok(())
}

pub(super) fn airy_discs(file: &ImageEntry<'_>, answers: &mut Answers) -> Done {
    for exact in file.get("airy").list()? {
        let round = RoundPupil::new(exact.at("wavelength_um")?, exact.at("f_number")?, 0.0);
        let Some(pupil) = answers.accept(round.function(), &exact.place) else { continue };
        note_points(answers, (&round, &pupil), &exact)?;
        note_contrast(answers, &pupil, (&exact, "frequency", 1.0))?;
    }
    Ok(())
}

pub(super) fn rings(file: &ImageEntry<'_>, answers: &mut Answers) -> Done {
    for exact in file.get("annular").list()? {
        let round = unit_pupil(exact.at("obscuration")?);
        let Some(pupil) = answers.accept(round.function(), &exact.place) else { continue };
        note_points(answers, (&round, &pupil), &exact)?;
        note_contrast(answers, &pupil, (&exact, "fraction_of_cutoff", round.unit().recip()))?;
    }
    Ok(())
}

pub(super) fn defocus(file: &ImageEntry<'_>, answers: &mut Answers) -> Done {
    for exact in file.get("defocus_otf").list()? {
        let mut round = unit_pupil(0.0);
        round.add_seidel("W020", exact.at("w20_waves")?);
        let Some(pupil) = answers.accept(round.function(), &exact.place) else { continue };
        note_contrast(answers, &pupil, (&exact, "fraction_of_cutoff", round.unit().recip()))?;
    }
    Ok(())
}

pub(super) fn aberrated_discs(file: &ImageEntry<'_>, answers: &mut Answers) -> Done {
    for exact in file.get("aberrated_disc").list()? {
        let mut round = unit_pupil(0.0);
        let unknown = || ImageFileError::new(&exact.place, "aberrations with known names");
        for (name, waves) in exact.get("seidel_waves").named_numbers()? {
            round.add_seidel(name, waves).ok_or_else(unknown)?;
        }
        for (name, waves) in exact.get("noll_waves").named_numbers()? {
            let added = name.parse().ok().and_then(|number| round.add_noll(number, waves));
            added.ok_or_else(unknown)?;
        }
        let Some(pupil) = answers.accept(round.function(), &exact.place) else { continue };
        let light = pupil.samples(ORDER);
        let strehl = light.intensity([0.0; 2]);
        answers.note_key(strehl, &exact, "strehl_at_origin", |_| INTEGRAL)?;
        for point in exact.get("psf").list()? {
            let at = point.pair(["x_over_lambdaN", "y_over_lambdaN"], round.unit())?;
            answers.note_key(light.intensity(at), &point, "value", |_| INTEGRAL)?;
        }
        for otf in exact.get("otf").list()? {
            let nu = otf.pair(["fx_over_cutoff", "fy_over_cutoff"], round.unit().recip())?;
            let found = pupil.transfer(nu, 0.0, CONTRAST);
            answers.note_key(found.re, &otf, "re", |_| INTEGRAL)?;
            answers.note_key(found.im, &otf, "im", |_| INTEGRAL)?;
        }
    }
    Ok(())
}

pub(super) fn other_pupils(file: &ImageEntry<'_>, answers: &mut Answers) -> Done {
    for exact in file.get("other_pupils").list()? {
        let pupil = PupilFunction::uniform(curves(&exact)?, exact.at("wavelength_um")?, |_| 0.0);
        let Some(pupil) = answers.accept(pupil, &exact.place) else { continue };
        let light = pupil.samples(ORDER);
        for point in exact.get("psf").list()? {
            let found = light.intensity(point.pair(["x", "y"], 1.0)?);
            answers.note_key(found, &point, "value", |_| INTEGRAL)?;
        }
        for otf in exact.get("otf").list()? {
            let found = pupil.transfer(otf.pair(["nx", "ny"], 1.0)?, 0.0, CONTRAST);
            answers.note_key(found.re, &otf, "value", |_| INTEGRAL)?;
        }
    }
    Ok(())
}

/// The edges of a pupil of another shape.
fn curves(exact: &ImageEntry<'_>) -> Result<Vec<PupilCurve>, ImageFileError> {
    let wrong =
        |entry: &ImageEntry<'_>, expected: &str| ImageFileError::new(&entry.place, expected);
    match exact.get("kind").text()? {
        "discs" => {
            let disc = |entry: ImageEntry<'_>| match entry.numbers()?[..] {
                [a, b, radius] => Ok(PupilCurve::circle([a, b], radius)),
                _ => Err(wrong(&entry, "a disc as two cosines and a radius")),
            };
            exact.get("discs").list()?.into_iter().map(disc).collect()
        }
        "polygon" => {
            let first = exact.at("first_vertex_deg")?.to_radians();
            let (sides, radius) = (exact.get("sides").count()?, exact.at("circumradius")?);
            Ok(vec![PupilCurve::regular_polygon(sides, radius, first)])
        }
        _ => {
            let (centers, radius) = (exact.get("centres").list()?, exact.at("disc_radius")?);
            let centers: Result<Vec<_>, _> = centers.iter().map(ImageEntry::numbers).collect();
            let lens = match &centers?[..] {
                [a, b] if a.len() == 2 && b.len() == 2 => {
                    PupilCurve::common_part_of_discs([[a[0], a[1], radius], [b[0], b[1], radius]])
                }
                _ => None,
            };
            Ok(vec![lens.ok_or_else(|| wrong(exact, "two discs that overlap"))?])
        }
    }
}
