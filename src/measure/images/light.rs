//! Coatings, photons, sensors and blur by formula.

use super::{Answers, ImageEntry, ImageFileError, closed_form};
use crate::analysis::{ThinFilm, film_reflectance};
use crate::picture::{
    SensorModel, black_body_photons, photons_of_wavelength, smear_contrast, thin_lens_blur,
};

type Done = Result<(), ImageFileError>;

/// Shares below this of the incident light are rounding.
const DARK: f64 = 1e-16;
/// The relative bounds of the mean and of the variance of a sensor's numbers: the file has ten to twelve digits.
const MEAN: f64 = 2e-11;
const VARIANCE: f64 = 2e-9;

pub(super) fn coatings(file: &ImageEntry<'_>, answers: &mut Answers) -> Done {
    for exact in file.get("fresnel").list()? {
        let film = |film: &ImageEntry<'_>| {
            Ok(ThinFilm { index: film.at("n")?, thickness: 1e-6 * film.at("nm")? })
        };
        let films = exact.get("layers_from_the_incident_side").list()?;
        let films: Result<Vec<ThinFilm>, ImageFileError> = films.iter().map(film).collect();
        let (indices, mm) = (exact.pair(["n0", "ns"], 1.0)?, 1e-3 * exact.at("wavelength_um")?);
        let cosine = exact.at("angle_deg")?.to_radians().cos();
        let [s, p] = film_reflectance(&films?, indices, mm, cosine);
        for (found, key) in [(s, "R_s"), (p, "R_p"), (0.5 * (s + p), "R")] {
            answers.note_key(found, &exact, key, |share| closed_form(share) + DARK)?;
        }
    }
    Ok(())
}

pub(super) fn photons(file: &ImageEntry<'_>, answers: &mut Answers) -> Done {
    for exact in file.get("photons").list()? {
        let (lux, side) = (exact.at("illuminance_lux")?, 1e-3 * exact.at("pixel_um")?);
        let found =
            photons_of_wavelength(lux, side, exact.at("seconds")?, exact.at("wavelength_um")?);
        answers.note_key(found, &exact, "photons", closed_form)?;
    }
    for exact in file.get("black_body_photon_radiance").list()? {
        let range = exact.pair(["from_nm", "to_nm"], 1e-3)?;
        let found = black_body_photons(exact.at("kelvin")?, range);
        answers.note_key(found, &exact, "photons_per_s_m2_sr", closed_form)?;
    }
    Ok(())
}

pub(super) fn sensors(file: &ImageEntry<'_>, answers: &mut Answers) -> Done {
    for exact in file.get("noise").list()? {
        let bits = exact.get("bits");
        let few = |bits: usize| u32::try_from(bits).ok();
        let sensor = SensorModel {
            quantum_efficiency: exact.at("quantum_efficiency")?,
            full_well: exact.at("full_well_e")?,
            dark_current: exact.at("dark_e")?,
            read_noise: exact.at("read_noise_e")?,
            gain: exact.at("gain_dn_per_e")?,
            black_level: exact.at("black_level_dn")?,
            bits: few(bits.count()?).ok_or_else(|| ImageFileError::new(&bits.place, "few bits"))?,
        };
        let checked = sensor.check();
        let dark = sensor.dark_current;
        for level in exact.get("levels").list()? {
            if answers.accept(checked.as_ref().map_err(ToString::to_string), &level.place).is_none()
            {
                continue;
            }
            let photons = level.at("photons")?;
            let [mean, variance] = sensor.exact_moments(photons, dark);
            answers.note_key(mean, &level, "mean", |mean| MEAN * mean)?;
            answers.note_key(variance, &level, "variance", |variance| VARIANCE * variance)?;
            let [mean, variance] = sensor.linear_moments(photons, dark);
            let ratio = sensor.signal_to_noise(photons, dark);
            let ideal = [(mean, "ideal_mean"), (variance, "ideal_variance"), (ratio, "ideal_snr")];
            for (found, key) in ideal {
                answers.note_key(found, &level, key, |exact| closed_form(1.0 + exact))?;
            }
        }
    }
    Ok(())
}

pub(super) fn blur(file: &ImageEntry<'_>, answers: &mut Answers) -> Done {
    for exact in file.get("motion").list()? {
        let found = smear_contrast(exact.at("smear_mm")?, exact.at("frequency")?);
        answers.note_key(found, &exact, "factor", closed_form)?;
    }
    for exact in file.get("thin_lens_blur").list()? {
        let [focal, f_number] = exact.pair(["focal_length", "f_number"], 1.0)?;
        let [focus, object] = exact.pair(["focus_mm", "object_mm"], 1.0)?;
        let [image, diameter] = thin_lens_blur(focal, f_number, focus, object);
        answers.note_key(image, &exact, "image_distance", closed_form)?;
        answers.note_key(diameter, &exact, "blur_diameter_mm", closed_form)?;
    }
    Ok(())
}
