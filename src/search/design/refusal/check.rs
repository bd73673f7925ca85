//! The checks of a specification: numbers first, then what contradicts optics.

use super::SpecificationError;
use crate::search::design::requirements::{FOCAL_LENGTH_TOLERANCE, LensRequirements};
use crate::search::design::spec::{LensSpecification, LensWish};
use std::f64::consts::PI;

/// The f-number of an image in air at which the beam fills a hemisphere (sine condition): its edge grazes
/// the image plane, so that a lens has a larger one.
const SMALLEST_F_NUMBER: f64 = 0.5;
/// The largest field, in degrees, at which a flat image without distortion is known.
const WIDEST_RECTILINEAR: f64 = 70.0;
/// The blur of the third-order spherical aberration of the best-bent thin lens of index 1.5, times
/// the cube of the f-number, relative to the focal length (Smith, *Modern Optical Engineering*).
const SINGLET_BLUR: f64 = 0.067;
/// The blur relative to the focal length above which there is no image to speak of.
const LARGEST_BLUR: f64 = 0.01;

/// Refuses numbers that cannot be meant.
pub(in crate::search::design) fn check_numbers(
    spec: &LensSpecification,
) -> Result<(), SpecificationError> {
    let is_known = |object: &&String| ["infinity", "finite"].contains(&object.as_str());
    if let Some(object) = spec.object.as_ref().filter(|object| !is_known(object)) {
        let expected = "`infinity`, or `finite` beside a magnification";
        return Err(SpecificationError::invalid("object", format!("`{object}`"), expected));
    }
    check_positive(spec)?;
    check_fields(spec)?;
    check_lists(spec)
}

fn check_positive(spec: &LensSpecification) -> Result<(), SpecificationError> {
    let zero_or_more = [
        ("half_field_deg", spec.half_field_deg),
        ("min_back_focus_mm", spec.min_back_focus_mm),
        ("max_abs_distortion", spec.max_abs_distortion),
        ("min_glass_center_mm", spec.min_glass_center_mm),
        ("min_edge_mm", spec.min_edge_mm),
        ("min_air_mm", spec.min_air_mm),
    ];
    let more = [
        ("focal_length_mm", spec.focal_length_mm),
        ("magnification", spec.magnification.map(f64::abs)),
        ("object_distance_mm", spec.object_distance_mm),
        ("wish", wished_frequency(spec)),
        ("f_number", spec.f_number),
        ("numerical_aperture", spec.numerical_aperture),
        ("image_height_mm", spec.image_height_mm),
        ("max_track_mm", spec.max_track_mm),
        ("max_semi_diameter_mm", spec.max_semi_diameter_mm),
    ];
    for (key, value) in zero_or_more {
        if let Some(value) = value.filter(|v| !(*v >= 0.0 && v.is_finite())) {
            return Err(SpecificationError::invalid(key, value.to_string(), "0 or more"));
        }
    }
    for (key, value) in more {
        if let Some(value) = value.filter(|v| !(*v > 0.0 && v.is_finite())) {
            return Err(SpecificationError::invalid(key, value.to_string(), "a number above 0"));
        }
    }
    Ok(())
}

/// The frequency of a wish for contrast, in cycles/mm.
fn wished_frequency(spec: &LensSpecification) -> Option<f64> {
    match spec.wish {
        Some(LensWish::Mtf(frequency)) => Some(frequency),
        _ => None,
    }
}

fn check_fields(spec: &LensSpecification) -> Result<(), SpecificationError> {
    let Some(fields) = &spec.fields_deg else { return Ok(()) };
    let ascending = fields.windows(2).all(|pair| pair[0] < pair[1]);
    if fields.first() != Some(&0.0) || !ascending || fields.iter().any(|f| !(*f < 90.0)) {
        let expected = "angles below 90 in ascending order, the first one 0";
        return Err(SpecificationError::invalid("fields_deg", format!("{fields:?}"), expected));
    }
    let last = fields.last().copied().unwrap_or(0.0);
    match spec.half_field_deg {
        Some(half) if (half - last).abs() > 1e-3 * half.max(last) => {
            Err(SpecificationError::Contradiction(format!(
                "the last field is {last} degrees, and `half_field_deg` is {half}; expected the \
                 same"
            )))
        }
        _ => Ok(()),
    }
}

fn check_lists(spec: &LensSpecification) -> Result<(), SpecificationError> {
    let bad = |list: &[f64], valid: fn(f64) -> bool| list.iter().any(|v| !valid(*v));
    if let Some(ums) = &spec.wavelengths_um
        && (ums.is_empty() || bad(ums, |um| um > 0.2 && um < 20.0))
    {
        let expected = "at least one length in micrometres, from 0.2 to 20";
        return Err(SpecificationError::invalid("wavelengths_um", format!("{ums:?}"), expected));
    }
    let lists = [
        ("wavelength_weights", &spec.wavelength_weights),
        ("min_relative_illumination", &spec.min_relative_illumination),
        ("min_clear_area_mm2", &spec.min_clear_area_mm2),
    ];
    for (key, list) in lists {
        if let Some(list) = list
            && (list.is_empty() || bad(list, |v| v >= 0.0 && v.is_finite()))
        {
            let expected = "numbers of 0 or more";
            return Err(SpecificationError::invalid(key, format!("{list:?}"), expected));
        }
    }
    Ok(())
}

/// Refuses what no lens can do.
pub(in crate::search::design) fn check_feasible(
    spec: &LensSpecification,
    asked: &LensRequirements,
) -> Result<(), SpecificationError> {
    check_lengths(asked)?;
    let impossible = |text: String| Err(SpecificationError::Impossible(text));
    let n = asked.f_number;
    if n <= SMALLEST_F_NUMBER {
        return impossible(format!(
            "f/{n}; an image in air has an f-number above {SMALLEST_F_NUMBER}, where the beam fills \
             a hemisphere"
        ));
    }
    if asked.track <= asked.back_focus {
        return impossible(format!(
            "a back focus of {} mm within a track of {} mm",
            asked.back_focus, asked.track
        ));
    }
    if asked.elements == 0 {
        return impossible("an image without an element".to_owned());
    }
    if asked.track < asked.back_focus + asked.glass_center {
        return impossible(format!(
            "a track of {} mm leaves less than the {} mm of one element before the back focus of \
             {} mm",
            asked.track, asked.glass_center, asked.back_focus
        ));
    }
    check_field(spec, asked)?;
    check_light(asked)?;
    let cube = (n * asked.elements as f64).powi(3);
    if asked.aspheric_surfaces == 0 && SINGLET_BLUR / cube > LARGEST_BLUR {
        let pieces = if asked.elements == 1 { "1 spherical element" } else { "2 elements" };
        return impossible(format!(
            "{pieces} at f/{n}; the spherical aberration alone blurs by {:.1} % of the focal \
             length",
            100.0 * SINGLET_BLUR / cube
        ));
    }
    Ok(())
}

fn check_lengths(asked: &LensRequirements) -> Result<(), SpecificationError> {
    let count = asked.fields.len();
    let lists = [
        ("min_relative_illumination", &asked.relative_illumination),
        ("min_clear_area_mm2", &asked.clear_area),
    ];
    for (key, list) in lists {
        if list.len() != count {
            let found = format!("{} numbers for {count} fields", list.len());
            return Err(SpecificationError::invalid(key, found, "one for each field"));
        }
    }
    if asked.wavelengths.iter().all(|(_, weight)| *weight == 0.0) {
        let expected = "a weight above 0";
        return Err(SpecificationError::invalid("wavelength_weights", "zeros".into(), expected));
    }
    Ok(())
}

fn check_field(
    spec: &LensSpecification,
    asked: &LensRequirements,
) -> Result<(), SpecificationError> {
    let half = asked.half_field();
    let angle = half.to_radians();
    // A fisheye images at f times the angle.
    let of_fisheye = if half > 0.0 { 1.0 - angle / angle.tan() } else { 0.0 };
    if half >= 90.0 || (half > WIDEST_RECTILINEAR && asked.distortion < of_fisheye) {
        return Err(SpecificationError::Impossible(format!(
            "a field of {} degrees with a distortion of at most {}; beyond {} degrees no lens \
             images to f tan(theta), and a fisheye has {of_fisheye:.3}",
            2.0 * half,
            asked.distortion,
            2.0 * WIDEST_RECTILINEAR
        )));
    }
    let Some(height) = spec.image_height_mm else { return Ok(()) };
    let ideal = asked.focal_length * angle.tan();
    let off = (height / ideal - 1.0).abs();
    if half > 0.0 && off > asked.distortion + FOCAL_LENGTH_TOLERANCE {
        return Err(SpecificationError::Impossible(format!(
            "an image height of {height} mm at {half} degrees; f tan(theta) is {ideal:.3} mm, and \
             the distortion is at most {}",
            asked.distortion
        )));
    }
    Ok(())
}

fn check_light(asked: &LensRequirements) -> Result<(), SpecificationError> {
    let widest = asked.clear_area.iter().copied().fold(0.0, f64::max);
    let rim = (widest / PI).sqrt();
    if asked.semi_diameter < rim {
        return Err(SpecificationError::Impossible(format!(
            "a beam of {widest} mm^2 through a semi-diameter of {} mm; the first surface has at \
             least {rim:.3} mm",
            asked.semi_diameter
        )));
    }
    let full = PI / 4.0 * (asked.focal_length / SMALLEST_F_NUMBER).powi(2);
    if widest > full {
        return Err(SpecificationError::Impossible(format!(
            "a beam of {widest} mm^2 at a focal length of {} mm; that is below f/{SMALLEST_F_NUMBER}",
            asked.focal_length
        )));
    }
    Ok(())
}
