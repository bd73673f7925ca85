//! Writing of a lens for Optiland.
//!
//! Glasses are written as tables of their indices with the glass of this program beside, so that the rays are
//! the same at the wavelengths of the lens.

use super::{MEDIUM_KEY, aperture, shape};
use crate::files::error::FileError;
use crate::files::index_table::glass_table;
use crate::files::plain_lens::plain_lens;
use crate::files::report::{ConversionOutcome, ConversionReport};
use crate::lens::{
    Aperture, FieldKind, IdealElement, Lens, LensError, Medium, Object, Pose, Row, Surface,
    SurfaceNumber,
};
use serde_json::{Value, json};

/// Stands for an infinite number, which JSON does not have and Python reads as `Infinity`.
const INFINITE: &str = "\u{1}infinite";

/// The text of the file, and the report of everything that is not exact. `file` is its name in messages.
///
/// # Errors
/// An invalid lens, or a part of it that rays meet and the format cannot hold.
pub(in crate::files) fn write(
    lens: &Lens,
    file: &str,
) -> Result<(String, ConversionReport), FileError> {
    let unusable = |source| FileError::Lens { file: file.to_owned(), source };
    let lens = plain_lens(lens).map_err(unusable)?;
    if let Some(found) = unwritable(&lens) {
        let (file, expected) = (file.to_owned(), ".zmx or .json for it".to_owned());
        return Err(FileError::Unsuitable { file, found, expected });
    }
    let mut writer = OptilandWriter { lens, report: ConversionReport::default() };
    let model = writer.model().map_err(unusable)?;
    writer.report_losses();
    let text = format!("{model:#}\n");
    let word = |sign: &str| json!(format!("{sign}{INFINITE}")).to_string();
    let text = text.replace(&word("-"), "-Infinity").replace(&word(""), "Infinity");
    Ok((text, writer.report))
}

/// The first part that the format cannot hold although rays meet it.
fn unwritable(lens: &Lens) -> Option<String> {
    if lens.zoom.len() > 1 {
        return Some(format!("{} zoom positions, which the file cannot hold", lens.zoom.len()));
    }
    lens.surfaces.iter().enumerate().find_map(|(i, row)| {
        let what = unwritable_row(row)?;
        Some(format!("{what} of surface {}, which the file cannot hold", SurfaceNumber::new(i)))
    })
}

fn unwritable_row(row: &Row) -> Option<&'static str> {
    if shape::write(row, &Value::Null).is_none() {
        return Some("the freeform");
    }
    if !row.apertures.iter().all(aperture::is_writable) {
        return Some("an ellipse that is turned, an aperture");
    }
    if matches!(row.ideal, Some(IdealElement::Grating { .. })) {
        return Some("the grating");
    }
    matches!(row.medium, Medium::Grin(_)).then_some("the gradient-index medium")
}

/// The radius of a curvature.
pub(super) fn radius(curvature: f64) -> Value {
    if curvature == 0.0 { json!(INFINITE) } else { json!(curvature.recip()) }
}

/// A coordinate system in the frame of the file.
fn coordinate_system(pose: &Pose<f64>) -> Value {
    let [r0, r1, r2] = pose.turn;
    let cosine = r2.y.hypot(r2.z);
    let ry = (-r2.x).atan2(cosine);
    let (rx, rz) = if cosine > 1e-14 {
        (r2.y.atan2(r2.z), r1.x.atan2(r0.x))
    } else {
        ((-r1.z).atan2(r1.y), 0.0)
    };
    let plain = |value: f64| if value == 0.0 { 0.0 } else { value };
    json!({
        "x": plain(pose.shift.x), "y": plain(pose.shift.y), "z": plain(pose.shift.z),
        "rx": plain(rx), "ry": plain(ry), "rz": plain(rz), "reference_cs": null,
    })
}

/// An interaction of light with a surface.
fn interaction(row: &Row) -> Value {
    let reflects = row.medium == Medium::Mirror;
    let mut model = json!({
        "type": "RefractiveReflectiveModel", "is_reflective": reflects,
        "coating": null, "bsdf": null,
    });
    if let Some(IdealElement::Lens { focal_length }) = row.ideal {
        model["type"] = "ThinLensInteractionModel".into();
        model["focal_length"] = focal_length.into();
    }
    model
}

/// A file that is being written.
struct OptilandWriter {
    /// The lens, with pickups and focus resolved.
    lens: Lens,
    report: ConversionReport,
}

impl OptilandWriter {
    fn model(&mut self) -> Result<Value, LensError> {
        let (kind, value) = match self.lens.aperture {
            Aperture::EntrancePupilDiameter(diameter) => ("EPD", diameter),
            Aperture::FNumber(number) => ("imageFNO", number),
            Aperture::ObjectNa(na) => ("objectNA", na),
            Aperture::StopSemiDiameter(radius) => ("float_by_stop_size", 2.0 * radius),
        };
        Ok(json!({
            "version": 1.0,
            "name": plain_text(&self.lens.name),
            "aperture": {"type": kind, "value": value},
            "fields": self.fields(),
            "wavelengths": self.wavelengths(),
            "apodization": null,
            "pickups": [],
            "solves": {"solves": []},
            "surface_group": {"surfaces": self.surfaces()?},
        }))
    }

    fn fields(&self) -> Value {
        let fields = &self.lens.fields;
        let kind = match fields.kind {
            FieldKind::Angle => "AngleField",
            FieldKind::ObjectHeight => "ObjectHeightField",
            FieldKind::ImageHeight => "ParaxialImageHeightField",
        };
        let points = fields.projected_points();
        let weights = fields.values.iter().map(|field| field.weight);
        let field = |([x, y], weight): (&[f64; 2], f64)| json!({"x": x, "y": y, "vx": 0.0, "vy": 0.0, "weight": weight});
        let values: Vec<Value> = points.iter().zip(weights).map(field).collect();
        let definition = json!({"field_type": kind});
        json!({"fields": values, "telecentric": false, "field_definition": definition})
    }

    fn wavelengths(&self) -> Value {
        let primary = self.lens.primary();
        let wave = |(i, wave): (usize, &crate::lens::Wavelength)| {
            let (um, weight) = (wave.um, wave.weight);
            json!({"value": um, "is_primary": i == primary, "unit": "um", "weight": weight})
        };
        let waves: Vec<Value> = self.lens.wavelengths.iter().enumerate().map(wave).collect();
        json!({"wavelengths": waves, "polarization": "ignore"})
    }

    /// The frames of the surfaces themselves and of the image.
    fn frames(&self) -> Result<Vec<Pose<f64>>, LensError> {
        let system = self.lens.resolve(0, self.lens.wavelengths[self.lens.primary()].um)?;
        let own = |(frame, surface): (Pose<f64>, &Surface<f64>)| {
            surface.pose.as_ref().map_or(frame, |pose| frame.then(pose))
        };
        Ok(system.frames().into_iter().zip(&system.surfaces).map(own).collect())
    }

    /// The object, the surfaces and the image.
    fn surfaces(&mut self) -> Result<Vec<Value>, LensError> {
        let frames = self.frames()?;
        let mut present = self.medium(&self.lens.object_medium);
        let distance = match self.lens.object {
            Object::Infinity => json!(format!("-{INFINITE}")),
            Object::Finite(distance) => json!(-distance),
        };
        let mut cs = coordinate_system(&Pose::centred());
        cs["z"] = distance;
        let plane = |cs: Value| json!({"type": "Plane", "cs": cs, "radius": INFINITE});
        let mut all = vec![json!({
            "type": "ObjectSurface", "geometry": plane(cs), "material_post": present,
            "comment": "",
        })];
        for (i, frame) in frames.iter().take(self.lens.surfaces.len()).enumerate() {
            let row = self.lens.surfaces[i].clone();
            if row.medium != Medium::Mirror {
                present = self.medium(&row.medium);
            }
            all.push(self.surface(i, &row, &coordinate_system(frame), &present));
        }
        let image = frames.last().map_or_else(Pose::centred, |frame| *frame);
        all.push(json!({
            "type": "Surface", "thickness": 0.0,
            "geometry": plane(coordinate_system(&image)), "material_post": present,
            "is_stop": false, "aperture": null, "comment": "",
            "interaction_model": interaction(&Row::default()),
        }));
        Ok(all)
    }

    fn surface(&mut self, i: usize, row: &Row, cs: &Value, medium: &Value) -> Value {
        self.report.add_row_losses(SurfaceNumber::new(i), row);
        self.report.add_aperture_loss(SurfaceNumber::new(i), row);
        let stop = match self.lens.aperture {
            Aperture::StopSemiDiameter(radius) if row.stop => Some(radius),
            _ => None,
        };
        let aperture = aperture::write(row, stop, INFINITE);
        json!({
            "type": "Surface",
            "thickness": row.thickness,
            "geometry": shape::write(row, cs),
            "material_post": medium,
            "is_stop": row.stop,
            "aperture": aperture,
            "comment": plain_text(&row.comment),
            "interaction_model": interaction(row),
        })
    }

    fn medium(&self, medium: &Medium) -> Value {
        let propagation = json!({"class": "HomogeneousPropagation"});
        let index = match medium {
            Medium::Index(index) => *index,
            _ => 1.0,
        };
        let Some(table) = glass_table(&self.lens.wavelengths, medium) else {
            return json!({
                "type": "IdealMaterial", "propagation_model": propagation,
                "index": index, "absorp": 0.0,
            });
        };
        let (waves, indices): (Vec<f64>, Vec<f64>) = table.into_iter().unzip();
        let name = match medium {
            Medium::Glass(name) => name.clone(),
            Medium::Model { nd, vd } => format!("{nd}:{vd}"),
            _ => String::new(),
        };
        json!({
            "type": "DataMaterial", "propagation_model": propagation, "name": name,
            "definition": {
                "dispersion": {"kind": "tabulated", "wavelengths_um": waves, "indices": indices},
                "extinction": null,
            },
            "bounds": "clamp",
            "metadata": {MEDIUM_KEY: medium},
        })
    }

    fn report_losses(&mut self) {
        let lens = &self.lens;
        let dropped = [
            (lens.merit.is_some(), "merit function"),
            (lens.tolerances.is_some(), "tolerances"),
            (!lens.variables.is_empty(), "variables"),
            (!lens.pickups.is_empty(), "pickups"),
            (lens.image_solve.is_some(), "focus solve"),
            (!lens.source.is_empty() || !lens.notes.is_empty(), "source and notes"),
        ];
        for (_, what) in dropped.into_iter().filter(|(is_there, _)| *is_there) {
            let note = "the present numbers alone are written";
            self.report.add(ConversionOutcome::Dropped, what, note);
        }
        let note = "as tables of their indices, exact at the wavelengths of the lens";
        self.report.add(ConversionOutcome::Used, "glasses", note);
    }
}

/// A text without control characters.
fn plain_text(text: &str) -> String {
    text.chars().map(|c| if c.is_control() { ' ' } else { c }).collect()
}
