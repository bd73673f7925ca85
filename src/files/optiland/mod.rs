//! The lenses of the program Optiland, `.json`: reading and writing.
//!
//! Every surface has a place of its own in one frame. Here they follow an axis, which goes on behind a surface
//! beside it and breaks at mirrors. What this program has no counterpart of becomes a locked row with its
//! JSON.

mod aperture;
mod shape;
mod write;

pub(super) use write::write;

use super::error::{FileError, ParseError};
use super::foreign_lens::ForeignLens;
use super::ray_optics::without_infinities;
use super::report::{ConversionOutcome, ConversionReport};
use super::vignetting::{PupilFactors, ZoomedFactors};
use super::zemax::named_medium;
use crate::lens::glass;
use crate::lens::{
    Aperture, FieldKind, FieldPoint, Fields, IdealElement, Lens, LockedSurface, Medium, Object,
    Pose, Row, SurfaceNumber, Wavelength,
};
use crate::math::Vec3;
use serde_json::Value;

/// Object distances from this on are infinite.
const INFINITE_DISTANCE: f64 = 1e10;

/// The largest accepted number of surfaces.
const MAX_SURFACES: usize = 1000;

/// The key of what an index table of this program stands for.
const MEDIUM_KEY: &str = "aplanat_medium";

/// True for JSON that is a lens of Optiland, and no lens of this program.
pub(super) fn is_lens(text: &str) -> bool {
    let has = |key: &str| text.contains(&format!("\"{key}\""));
    text.trim_start().starts_with('{')
        && has("surface_group")
        && has("wavelengths")
        && !has("aplanat")
}

/// Reads a lens from the text of a file. `file` is its name in messages, and the name of a lens that has
/// none.
///
/// # Errors
/// Malformed JSON, a part that is missing, or an invalid lens.
pub(super) fn read(text: &str, file: &str) -> Result<ForeignLens, FileError> {
    let json: Value = serde_json::from_str(&without_infinities(text)).map_err(|error| {
        wrong(&format!("line {}", error.line()), &error.to_string(), "JSON").in_file(file)
    })?;
    let mut report = ConversionReport::default();
    let mut lens = lens(&json, &mut report).map_err(|wrong| wrong.in_file(file))?;
    super::set_origin(&mut lens, file);
    lens.check().map_err(|source| FileError::Lens { file: file.to_owned(), source })?;
    let factors = factors(&json["fields"]);
    if super::vignetting::are_usable(&factors) {
        let note = super::vignetting::LEFT_OUT;
        report.add(ConversionOutcome::Dropped, "vignetting factors", note);
    }
    let clips = lens.surfaces.iter().map(|row| row.semi_diameter.is_some()).collect();
    Ok(ForeignLens { lens, report, factors, clips, automatic: Vec::new() })
}

fn wrong(place: &str, found: &str, expected: &str) -> ParseError {
    let [place, found, expected] = [place, found, expected].map(str::to_owned);
    ParseError { place, found, expected }
}

fn number(value: &Value) -> f64 {
    value.as_f64().unwrap_or(0.0)
}

/// The curvature of a radius in mm, which is `null` or 0 for a plane.
fn curvature(radius: &Value) -> f64 {
    radius.as_f64().filter(|radius| *radius != 0.0).map_or(0.0, f64::recip)
}

fn lens(json: &Value, report: &mut ConversionReport) -> Result<Lens, ParseError> {
    let surfaces = json["surface_group"]["surfaces"].as_array().map(Vec::as_slice);
    let surfaces = surfaces.unwrap_or_default();
    if surfaces.len() < 3 || surfaces.len() > MAX_SURFACES {
        let found = format!("{} surfaces", surfaces.len());
        let expected = "an object, up to 998 surfaces and an image";
        return Err(wrong("surface_group", &found, expected));
    }
    let image = surfaces.len() - 1;
    let stop = (1..image).find(|k| surfaces[*k]["is_stop"].as_bool() == Some(true));
    let stop = stop.unwrap_or_else(|| {
        let note = "no stop in the file: the first surface";
        report.add(ConversionOutcome::Approximated, "is_stop", note);
        1
    });
    let mut lens = Lens {
        name: json["name"].as_str().unwrap_or_default().to_owned(),
        object: object(surfaces)?,
        object_medium: medium(&surfaces[0]["material_post"], "the object", report),
        aperture: beam_aperture(&json["aperture"])?,
        fields: fields(&json["fields"], report)?,
        wavelengths: wavelengths(&json["wavelengths"]["wavelengths"])?,
        ..crate::lens::blank()
    };
    lens.surfaces =
        (1..image).map(|k| Row { stop: k == stop, ..row(&surfaces[k], k, report) }).collect();
    place(&mut lens.surfaces, surfaces, report);
    report_solves(json, report);
    for end in [0, image] {
        if curvature(&surfaces[end]["geometry"]["radius"]) != 0.0 {
            let what = if end == 0 { "object" } else { "image" };
            let note = "object and image are planes in this program";
            report.add(ConversionOutcome::Dropped, what, note);
        }
    }
    Ok(lens)
}

/// Reports what decides numbers of the file, which are taken as they are.
fn report_solves(json: &Value, report: &mut ConversionReport) {
    let count = |list: &Value| list.as_array().map_or(0, Vec::len);
    for (what, found) in [("pickups", &json["pickups"]), ("solves", &json["solves"]["solves"])] {
        if count(found) > 0 {
            report.add(ConversionOutcome::Approximated, what, "the present numbers are used");
        }
    }
}

/// The pose of a surface in the frame of the file.
fn frame(surface: &Value) -> Pose<f64> {
    coordinate_system(&surface["geometry"]["cs"], 0)
}

/// The pose of a coordinate system, which may stand in another one.
fn coordinate_system(cs: &Value, depth: usize) -> Pose<f64> {
    let [x, y, z, rx, ry, rz] = ["x", "y", "z", "rx", "ry", "rz"].map(|key| number(&cs[key]));
    let ([sx, cx], [sy, cy], [sz, cz]) = (sine_cosine(rx), sine_cosine(ry), sine_cosine(rz));
    // About x first, then about the fixed y and the fixed z.
    let turn = [
        Vec3::new(cz * cy, cz * sy * sx - sz * cx, cz * sy * cx + sz * sx),
        Vec3::new(sz * cy, sz * sy * sx + cz * cx, sz * sy * cx - cz * sx),
        Vec3::new(-sy, cy * sx, cy * cx),
    ];
    let own = Pose { shift: Vec3::new(x, y, z), turn };
    let outer = &cs["reference_cs"];
    if outer.is_object() && depth < 16 {
        return coordinate_system(outer, depth + 1).then(&own);
    }
    own
}

fn sine_cosine(angle: f64) -> [f64; 2] {
    let (sin, cos) = angle.sin_cos();
    [sin, cos]
}

/// The position of the object, measured along the axis through the frame of the file.
fn object(surfaces: &[Value]) -> Result<Object, ParseError> {
    let place = &surfaces[0]["geometry"]["cs"]["z"];
    let distance = place.as_f64().map(|z| frame(&surfaces[1]).shift.z - z);
    match distance {
        None => Ok(Object::Infinity),
        Some(distance) if distance.abs() >= INFINITE_DISTANCE => Ok(Object::Infinity),
        Some(0.0) => Err(wrong("the object", "an object at the first surface", "another distance")),
        Some(distance) => Ok(Object::Finite(distance)),
    }
}

/// The frame at a distance along the axis.
fn along(distance: f64) -> Pose<f64> {
    Pose { shift: Vec3::new(0.0, 0.0, distance), ..Pose::centred() }
}

/// True for a frame that stands on the axis, at any distance.
fn is_on_axis(pose: &Pose<f64>) -> bool {
    let shift = Vec3::new(pose.shift.x, pose.shift.y, 0.0);
    Pose { shift, ..*pose }.is_nearly_centred()
}

/// Writes the places of all surfaces and of the image into the rows. The axis goes on behind a surface that
/// is decentred or tilted. It breaks at a mirror, and in front of the image, if what comes next does not
/// stand on it.
fn place(rows: &mut [Row], surfaces: &[Value], report: &mut ConversionReport) {
    let frames: Vec<Pose<f64>> = surfaces.iter().skip(1).map(frame).collect();
    let image = frames.len() - 1;
    let mut axis = along(frames[0].shift.z);
    for (k, row) in rows.iter_mut().enumerate() {
        let (own, next) = (&frames[k], &frames[k + 1]);
        let before = axis.inverse().then(own);
        let ahead = axis.inverse().then(next);
        // No row behind can place the image.
        let may_break = row.medium == Medium::Mirror || k + 1 == image;
        if may_break && !is_on_axis(&ahead) {
            let ahead = own.inverse().then(next);
            // The mirror stands at minus this distance on the axis of the next surface.
            row.thickness = -ahead.inverse().shift.z;
            row.place_on_axis(&before, &ahead.then(&along(-row.thickness)));
            axis = *next;
        } else {
            row.thickness = ahead.shift.z;
            row.place_on_axis(&before, &before.inverse());
            axis = axis.then(&along(ahead.shift.z));
        }
    }
    for (row, surface) in rows.iter_mut().zip(surfaces.iter().skip(1)) {
        aperture::read(row, &surface["aperture"], report);
    }
}

fn row(surface: &Value, number_in_file: usize, report: &mut ConversionReport) -> Row {
    let place = format!("surface {}", SurfaceNumber::new(number_in_file - 1));
    let action = &surface["interaction_model"];
    let reflects = [action, surface].iter().any(|own| own["is_reflective"] == true);
    let behind = medium(&surface["material_post"], &place, report);
    let mut row = Row {
        medium: if reflects { Medium::Mirror } else { behind },
        comment: surface["comment"].as_str().unwrap_or_default().to_owned(),
        ..Row::default()
    };
    let mut lost = shape::read(&surface["geometry"], &mut row).err();
    match action["type"].as_str().unwrap_or("RefractiveReflectiveModel") {
        "RefractiveReflectiveModel" => {}
        "ThinLensInteractionModel" => {
            let focal_length = action["focal_length"].as_f64().filter(|f| *f != 0.0);
            row.ideal = focal_length.map(|focal_length| IdealElement::Lens { focal_length });
            let note = "a paraxial lens; its optical path is that of a plane wave in front of it";
            report.add(ConversionOutcome::Approximated, &format!("{place}: thin lens"), note);
        }
        other => lost = Some(other.to_owned()),
    }
    if let Some(kind) = lost {
        (row.freeform, row.ideal) = (None, None);
        let note = "cannot be traced: the row is locked and rays meet its conic alone";
        report.add(ConversionOutcome::Locked, &format!("{place}: {kind}"), note);
        row.locked = Some(LockedSurface { kind, lines: vec![surface.to_string()] });
    }
    row
}

/// The medium of a material.
fn medium(material: &Value, place: &str, report: &mut ConversionReport) -> Medium {
    let own = &material["metadata"][MEDIUM_KEY];
    match serde_json::from_value::<Medium>(own.clone()) {
        Ok(Medium::Glass(name)) if glass::find(&name).is_none() => {}
        Ok(medium) if !own.is_null() => return medium,
        _ => {}
    }
    let index = number(&material["index"]);
    match material["type"].as_str().unwrap_or_default() {
        "IdealMaterial" if index == 1.0 => Medium::Air,
        "IdealMaterial" => Medium::Index(index),
        "Mirror" | "Air" => Medium::Air,
        "AbbeMaterial" => Medium::Model { nd: index, vd: number(&material["abbe"]) },
        kind => {
            let named = material["name"].as_str().or_else(|| material["filename"].as_str());
            let maker = material["reference"].as_str().or_else(|| material["catalog"].as_str());
            let makers: Vec<String> = maker.into_iter().map(str::to_ascii_uppercase).collect();
            let name = named.unwrap_or(kind);
            let imported = named_medium(name, &makers);
            if imported.outcome != ConversionOutcome::Used {
                let what = format!("material {name} behind {place}");
                report.add(imported.outcome, &what, imported.note);
            }
            imported.medium
        }
    }
}

fn beam_aperture(aperture: &Value) -> Result<Aperture, ParseError> {
    let value = number(&aperture["value"]);
    if !(value > 0.0) {
        return Err(wrong("aperture", &format!("the aperture {value}"), "a number above 0"));
    }
    match aperture["type"].as_str().or_else(|| aperture["ap_type"].as_str()) {
        Some("EPD") => Ok(Aperture::EntrancePupilDiameter(value)),
        Some("imageFNO") => Ok(Aperture::FNumber(value)),
        Some("objectNA") => Ok(Aperture::ObjectNa(value)),
        Some("float_by_stop_size") => Ok(Aperture::StopSemiDiameter(0.5 * value)),
        other => {
            let found = format!("the aperture {}", other.unwrap_or("without a type"));
            let expected = "EPD, imageFNO, objectNA or float_by_stop_size";
            Err(wrong("aperture", &found, expected))
        }
    }
}

fn fields(group: &Value, report: &mut ConversionReport) -> Result<Fields, ParseError> {
    let named = group["field_definition"]["field_type"].as_str();
    let name = named.or_else(|| group["field_type"].as_str()).unwrap_or_default();
    let kind = match name {
        "AngleField" | "angle" => FieldKind::Angle,
        "ObjectHeightField" | "object_height" => FieldKind::ObjectHeight,
        "ParaxialImageHeightField" | "paraxial_image_height" => FieldKind::ImageHeight,
        "RealImageHeightField" | "real_image_height" => {
            let note = "real image heights are read as paraxial ones";
            report.add(ConversionOutcome::Approximated, "fields", note);
            FieldKind::ImageHeight
        }
        other => {
            let expected = "angles, object heights or image heights";
            return Err(wrong("fields", &format!("the fields `{other}`"), expected));
        }
    };
    if group["telecentric"] == true {
        let note = "telecentric object space: chief rays pass through the centre of the stop here";
        report.add(ConversionOutcome::Dropped, "telecentric", note);
    }
    let point = |field: &Value| {
        let [x, y] = ["x", "y"].map(|key| number(&field[key]));
        let weight = field["weight"].as_f64().unwrap_or(1.0);
        match kind {
            FieldKind::Angle => FieldPoint::from_projected_angles([x, y], weight),
            FieldKind::ObjectHeight | FieldKind::ImageHeight => FieldPoint { x, y, weight },
        }
    };
    let values: Vec<FieldPoint> =
        group["fields"].as_array().into_iter().flatten().map(point).collect();
    if values.is_empty() {
        return Err(wrong("fields", "no field", "one at least"));
    }
    Ok(Fields { kind, values })
}

/// The vignetting factors of the fields, by which the pupil shrinks along x and y.
fn factors(group: &Value) -> ZoomedFactors {
    let own = |field: &Value| PupilFactors {
        compression: ["vx", "vy"].map(|key| number(&field[key])),
        ..PupilFactors::default()
    };
    vec![group["fields"].as_array().into_iter().flatten().map(own).collect()]
}

fn wavelengths(list: &Value) -> Result<Vec<Wavelength>, ParseError> {
    let wave = |own: &Value| {
        let unit = match own["unit"].as_str().unwrap_or("um") {
            "nm" => 1e-3,
            "mm" => 1e3,
            "cm" => 1e4,
            "m" => 1e6,
            _ => 1.0,
        };
        Wavelength {
            um: number(&own["value"]) * unit,
            weight: own["weight"].as_f64().unwrap_or(1.0),
            primary: own["is_primary"] == true,
        }
    };
    let waves: Vec<Wavelength> = list.as_array().into_iter().flatten().map(wave).collect();
    if waves.is_empty() {
        return Err(wrong("wavelengths", "no wavelength", "one at least"));
    }
    Ok(waves)
}
