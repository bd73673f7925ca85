//! What an image tells of its wavefront and spot, and the papers of a lens: bounds and laws that hold
//! whatever the lens.

use super::{ROUGH, check_every_lens, edge, ensure, near, text};
use aplanat::analysis::{
    AnalysisError, Coating, GhostError, ParaxialGhost, ZernikeOrder, encircled_energy,
    geometric_mtf, rank_ghosts, spot, strehl, wavefront, zernike,
};
use aplanat::lens::FieldPoint;
use aplanat::pupil::{Accuracy, RayModel};
use aplanat::report::{
    LayoutScene, ReportError, ReportSettings, drawing_bytes, report_bytes, solids_file,
};
use std::f64::consts::TAU;
use std::path::Path;

/// The contrast of a spot falls from 1 as its second moments have it, and never rises above 1.
#[test]
fn contrast_begins_at_one_and_falls_by_the_size_of_the_spot() {
    let accuracy = Accuracy { tolerance: 1e-5, max_rays: 100_000 };
    check_every_lens(|_, model| {
        let (field, wavelength) = (edge(model), model.primary);
        let sizes = spot(model, field, accuracy).map_err(text)?;
        let rms = sizes.channels[wavelength].map_err(text)?.rms.value;
        // A phase of 0.1 at the distance of the rms.
        let frequency = 0.1 / (TAU * rms);
        let frequencies = [0.0, frequency, 30.0 * frequency];
        let curve = geometric_mtf(model, field, wavelength, &frequencies, accuracy);
        let points = curve.map_err(text)?.points;
        for value in points.iter().flat_map(|point| [point.tangential, point.sagittal]) {
            let modulus = value.modulus;
            let bound = 1.0 + modulus.error + 1e-12;
            ensure(modulus.value <= bound, || format!("a contrast of {}", modulus.value))?;
        }
        near("contrast of a plane", points[0].tangential.modulus.value, 1.0, 1e-12)?;
        let falls = [points[1].tangential, points[1].sagittal].map(|v| 1.0 - v.modulus.value);
        near("fall of the contrast", (falls[0] + falls[1]) / 0.005, 1.0, 0.05)
    });
}

/// The wavefront, the Strehl ratio and the encircled energy of a field whose wavefront is known, in
/// wavelengths and as shares.
fn check_wavefront(model: &RayModel, field: FieldPoint) -> Result<bool, String> {
    let wavelength = model.primary;
    let found = match wavefront(model, field, wavelength, ROUGH) {
        Ok(found) => found,
        // Refused by name.
        Err(AnalysisError::IdealPath | AnalysisError::Afocal | AnalysisError::FoldedPupil) => {
            return Ok(false);
        }
        Err(why) => return Err(why.to_string()),
    };
    let rms = found.rms.value;
    let fit = |count| zernike(model, field, wavelength, (ZernikeOrder::Noll, count), ROUGH);
    let [few, many] = [fit(4), fit(22)].map(|sum| sum.map_err(text));
    let (few, many) = (few?.rest, many?.rest);
    let falls = few.value <= rms + few.error + found.rms.error
        && many.value <= few.value + many.error + few.error;
    ensure(falls, || format!("rms {rms}, without 4 terms {few:?}, without 22 {many:?}"))?;
    // Beyond, images of diffraction need many rays.
    if rms > 1.0 {
        return Ok(false);
    }
    let ratio = strehl(model, field, wavelength, ROUGH).map_err(text)?;
    for share in [ratio.at_chief, ratio.best] {
        let bound = 1.0 + share.error + 1e-9;
        ensure((-share.error..=bound).contains(&share.value), || format!("Strehl {share:?}"))?;
    }
    // The mean of exp(iφ) about the mean phase has a real part of 1 - σ²/2 at least.
    let spread = TAU * (rms + found.rms.error);
    let least = (1.0 - 0.5 * spread * spread).max(0.0).powi(2);
    ensure(ratio.at_chief.value >= least - ratio.at_chief.error - 0.02, || {
        format!("Strehl {:?} of a wavefront of {rms}; expected {least} at least", ratio.at_chief)
    })?;
    ensure(ratio.best.value >= ratio.at_chief.value - ratio.best.error, || format!("{ratio:?}"))?;
    Ok(true)
}

#[test]
fn wavefronts_keep_the_bounds_of_fits_and_of_the_strehl_ratio() {
    let both = check_every_lens(|_, model| {
        Ok([check_wavefront(model, model.fields[0])?, check_wavefront(model, edge(model))?])
    });
    let sharp = both.iter().flatten().filter(|is_sharp| **is_sharp).count();
    assert!(sharp > 60, "{sharp} fields with a Strehl ratio");
}

/// Energy within a circle grows with it, up to all of the light.
#[test]
fn the_energy_in_a_circle_grows_with_it() {
    let sharp = check_every_lens(|_, model| {
        let (field, wavelength) = (model.fields[0], model.primary);
        if !wavefront(model, field, wavelength, ROUGH).is_ok_and(|found| found.rms.value < 0.5) {
            return Ok(false);
        }
        let Some(f_number) = model.first_order.working_f_number else { return Ok(false) };
        let ring = 1e-3 * model.channels[wavelength].um * f_number.abs();
        let radii = [0.5, 1.0, 2.0, 4.0, 8.0].map(|radius| radius * ring);
        let spot = spot(model, field, ROUGH).map_err(text)?;
        let center = spot.channels[wavelength].map_err(text)?.centroid.map(|x| x.value);
        let energy = encircled_energy(model, field, wavelength, center, &radii, ROUGH);
        let energy = energy.map_err(text)?;
        for pair in energy.windows(2) {
            let rises = pair[1].value >= pair[0].value - pair[0].error - pair[1].error;
            ensure(rises, || format!("{energy:?}"))?;
        }
        let last = energy[4];
        ensure(last.value <= 1.0 + last.error && last.value > 0.3, || format!("{energy:?}"))?;
        Ok(true)
    });
    assert!(sharp.into_iter().filter(|is_sharp| *is_sharp).count() > 30);
}

/// Twice the reflectance is four times the ghost, and light is not made.
#[test]
fn ghosts_grow_with_the_square_of_the_reflectance() {
    let ranked = check_every_lens(|_, model| {
        let rank = |share| rank_ghosts(model, model.primary, Coating::Flat(share));
        let [one, two] = match [rank(0.01), rank(0.02)] {
            [Ok(one), Ok(two)] => [one, two],
            [Err(GhostError::NotPlain { .. } | GhostError::NoPair), _] => return Ok(false),
            [Err(why), _] | [_, Err(why)] => return Err(why.to_string()),
        };
        for ghost in &one.ghosts {
            let same =
                |other: &&ParaxialGhost| (other.first, other.second) == (ghost.first, ghost.second);
            let twin = two.ghosts.iter().find(same).ok_or("another ghost")?;
            // A cemented surface has no coating, and reflects as much as before.
            let ratio = twin.reflected / ghost.reflected;
            let is_power = [1.0, 2.0, 4.0].iter().any(|power| (ratio / power - 1.0).abs() < 1e-12);
            ensure(is_power, || format!("{ghost:?} {twin:?}"))?;
            let is_share = (0.0..=1.0).contains(&ghost.clip_factor) && ghost.flux >= 0.0;
            ensure(is_share && ghost.flux <= ghost.reflected, || format!("{ghost:?}"))?;
        }
        // Every pair of surfaces is one.
        let surfaces = (0.5 + (0.25 + 2.0 * one.ghosts.len() as f64).sqrt()).round();
        near("number of ghosts", one.ghosts.len() as f64, 0.5 * surfaces * (surfaces - 1.0), 0.1)?;
        ensure(one.direct < 1.0 && two.direct <= one.direct, || format!("{}", one.direct))?;
        Ok(true)
    });
    let ranked = ranked.into_iter().filter(|is_ranked| *is_ranked).count();
    assert!(ranked > 130, "{ranked} lenses have ghosts");
}

/// A drawing or a report has no number that is none.
fn check_paper(what: &str, bytes: &[u8]) -> Result<(), String> {
    let page = std::str::from_utf8(bytes).map_err(text)?;
    let words = page.split(|c: char| !c.is_ascii_alphanumeric());
    let wrong = words.filter(|word| ["NaN", "inf", "null"].contains(word)).count();
    ensure(wrong == 0 && page.len() > 1000, || format!("{what}: {wrong} wrong numbers"))
}

#[test]
fn every_lens_has_a_report_a_drawing_and_solids() {
    let elements = check_every_lens(|lens, _| {
        let settings = ReportSettings { tolerance: 0.1 };
        let (report, _) = report_bytes(lens, settings, Path::new("a.html")).map_err(text)?;
        check_paper("report", &report)?;
        let (layout, _) = drawing_bytes(lens, 0, None, Path::new("a.svg")).map_err(text)?;
        check_paper("layout", &layout)?;
        let bodies = LayoutScene::new(lens, 0).map_err(text)?.bodies();
        if !bodies.is_empty() {
            match drawing_bytes(lens, 0, Some(1), Path::new("a.svg")) {
                Ok((sheet, _)) => check_paper("element", &sheet)?,
                // Rims that are wider than the glass.
                Err(ReportError::Body { .. }) => {}
                Err(why) => return Err(why.to_string()),
            }
        }
        match solids_file(lens, 0, None) {
            Ok(file) => {
                check_paper("solids", file.text.as_bytes())?;
                let all = file.bodies.iter().all(|body| body.volume() > 0.0);
                ensure(all && file.bodies.len() == bodies.len(), || "solids".to_owned())?;
            }
            Err(ReportError::Bodies(_) | ReportError::NoBodies) => {}
            Err(why) => return Err(why.to_string()),
        }
        Ok(bodies.len())
    });
    assert!(elements.into_iter().sum::<usize>() > 1000);
}
