//! Writing of a lens as a model of ray-optics.
//!
//! Glasses are written as tables of their indices, which the other program interpolates: at the wavelengths
//! of the lens the table has the very index of this program.

use super::MODEL_KEY;
use crate::files::codev::place;
use crate::files::error::FileError;
use crate::files::first_order_beam::FirstOrderBeam;
use crate::files::index_table::glass_table;
use crate::files::plain_lens::plain_lens;
use crate::files::report::{ConversionOutcome, ConversionReport};
use crate::files::vignetting::beam_reach;
use crate::lens::glass;
use crate::lens::{
    Aperture, ApertureShape, AxisBreak, FieldKind, FreeformKind, Lens, LensError, Medium,
    MediumPlace, Object, Row, SurfaceAperture, SurfaceNumber,
};
use serde_json::{Value, json};

/// The version of the other program whose classes are written.
const VERSION: &str = "0.9.8";
/// The object distance that stands for infinity.
const FAR: f64 = 1e10;
/// The wavelength at which phases are written, in nanometres.
const PHASE_NM: f64 = 587.5618;

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
    let mut writer = RayOpticsWriter { lens, report: ConversionReport::default() };
    let model = writer.model().map_err(unusable)?;
    writer.report_losses();
    Ok((format!("{model:#}\n"), writer.report))
}

/// The first part that the format cannot hold although rays meet it.
fn unwritable(lens: &Lens) -> Option<String> {
    if lens.zoom.len() > 1 {
        return Some(format!("{} zoom positions, which a .roa file cannot hold", lens.zoom.len()));
    }
    lens.surfaces.iter().enumerate().find_map(|(i, row)| {
        let what = unwritable_row(row)?;
        let surface = SurfaceNumber::new(i);
        Some(format!("{what} of surface {surface}, which a .roa file cannot hold"))
    })
}

fn unwritable_row(row: &Row) -> Option<&'static str> {
    let kind = row.freeform.as_ref().map(|form| form.kind);
    let is_known =
        matches!(kind, None | Some(FreeformKind::OddAsphere | FreeformKind::RadialPhase { .. }));
    if !is_known {
        return Some("the freeform");
    }
    if row.ideal.is_some() {
        return Some("the ideal element");
    }
    if row.apertures.iter().any(|own| figure(own).is_none()) {
        return Some("an aperture, a polygon or arms,");
    }
    if matches!(row.medium, Medium::Grin(_)) {
        return Some("the gradient-index medium");
    }
    place(row).is_none().then_some("the break of the axis together with a tilt")
}

/// An object of a class of the other program.
fn instance(module: &str, class: &str, attributes: Value) -> Value {
    object([
        ("__instance_type__", json!([format!("rayoptics.{module}"), class])),
        ("attributes", attributes),
    ])
}

/// A medium, whose classes are in a package of their own.
fn medium_instance(module: &str, class: &str, attributes: Value) -> Value {
    object([
        ("__instance_type__", json!([format!("opticalglass.{module}"), class])),
        ("slots", json!({})),
        ("attributes", attributes),
    ])
}

fn object<const N: usize>(entries: [(&str, Value); N]) -> Value {
    Value::Object(entries.into_iter().map(|(key, value)| (key.to_owned(), value)).collect())
}

/// An array of numbers.
fn array(numbers: &[f64]) -> Value {
    json!({"__ndarray__": numbers, "dtype": "float64", "shape": [numbers.len()]})
}

/// A file that is being written.
struct RayOpticsWriter {
    /// The lens, with pickups and focus resolved.
    lens: Lens,
    report: ConversionReport,
}

impl RayOpticsWriter {
    fn record(&mut self, outcome: ConversionOutcome, what: impl AsRef<str>, note: &str) {
        self.report.add(outcome, what.as_ref(), note);
    }

    fn model(&mut self) -> Result<Value, LensError> {
        let system = json!({
            "title": self.lens.name, "initials": "", "_dimensions": "mm",
            "temperature": 20.0, "pressure": 760.0,
        });
        let paraxial = json!({
            "sys": [], "ax": [], "pr": [], "ztwp": [], "opt_inv": 1.0,
            "y_star": null, "ybar_star": null, "seq_mapping": null,
        });
        let tree = json!({"root_node": {"id_key": "0", "tag": "#group#root", "name": "root"}});
        let profiles = self.profiles();
        let attributes = json!({
            "ro_version": VERSION,
            "radius_mode": true,
            "specsheet": null,
            "system_spec": instance("optical.opticalmodel", "SystemSpec", system),
            "seq_model": self.sequence()?,
            "optical_spec": self.specification()?,
            "parax_model": instance("parax.paraxialdesign", "ParaxialModel", paraxial),
            "ele_model": instance("elem.elements", "ElementModel", json!({})),
            "part_tree": instance("elem.parttree", "PartTree", tree),
            "profile_dict": profiles,
            "parts_dict": {},
        });
        Ok(json!({"optical_model": instance("optical.opticalmodel", "OpticalModel", attributes)}))
    }

    /// The surfaces and gaps. Without rims the other program computes its apertures.
    fn sequence(&mut self) -> Result<Value, LensError> {
        let reach = beam_reach(&self.lens, &Vec::new(), 0..1)?;
        let count = self.lens.surfaces.len();
        let mut surfaces = vec![plane("Obj", 0)];
        surfaces.extend((0..count).map(|i| self.surface(i, reach[i])));
        surfaces.push(plane("Img", count + 1));
        let has_rims = self
            .lens
            .surfaces
            .iter()
            .any(|row| row.semi_diameter.is_some() || !row.apertures.is_empty());
        let attributes = json!({
            "ifcs": surfaces,
            "gaps": self.gaps(),
            "z_dir": self.directions(),
            "stop_surface": self.lens.stop().map_or(1, |stop| stop + 1),
            "cur_surface": count,
            "do_apertures": !has_rims,
        });
        Ok(instance("seq.sequential", "SequentialModel", attributes))
    }

    /// The sense of travel in every gap: 1, or −1 behind an odd number of mirrors.
    fn directions(&self) -> Vec<i32> {
        let mirrors = self.lens.surfaces.iter().scan(1, |sense, row| {
            *sense *= if row.medium == Medium::Mirror { -1 } else { 1 };
            Some(*sense)
        });
        std::iter::once(1).chain(mirrors).collect()
    }

    fn surface(&mut self, i: usize, reach: Option<f64>) -> Value {
        let row = self.lens.surfaces[i].clone();
        self.report.add_row_losses(SurfaceNumber::new(i), &row);
        self.report.add_aperture_loss(SurfaceNumber::new(i), &row);
        let mut rims: Vec<Value> = row.semi_diameter.iter().map(|radius| circle(*radius)).collect();
        let hole = row.obstruction.filter(|radius| *radius > 0.0);
        let hole = hole.map(|radius| ApertureShape::Circle { radius });
        let hole = hole.map(SurfaceAperture::obscuration);
        rims.extend(hole.iter().chain(&row.apertures).filter_map(figure));
        let mirror = row.medium == Medium::Mirror;
        let mut attributes = json!({
            "label": row.comment,
            "delta_n": 0.0,
            "decenter": place(&row).flatten().map(decenter),
            "max_aperture": row.semi_diameter.or(reach).unwrap_or(1.0),
            "clear_apertures": rims,
            "edge_apertures": [],
            "interact_mode": if mirror { "reflect" } else { "transmit" },
            "profile_id": (i + 1).to_string(),
        });
        if let (Some(phase), Some(surface)) = (phase(&row), attributes.as_object_mut()) {
            surface.insert("phase_element".to_owned(), phase);
        }
        instance("elem.surface", "Surface", attributes)
    }

    /// The shapes by their numbers; object and image are planes.
    fn profiles(&self) -> Value {
        let plane = || instance("elem.profiles", "Spherical", json!({"cv": 0.0}));
        let rows = self.lens.surfaces.iter().map(profile);
        let all = std::iter::once(plane()).chain(rows).chain(std::iter::once(plane()));
        let named = all.enumerate().map(|(i, profile)| (i.to_string(), profile));
        Value::Object(named.collect())
    }

    fn gaps(&mut self) -> Vec<Value> {
        let distance = match self.lens.object {
            Object::Infinity => FAR,
            Object::Finite(distance) => distance,
        };
        let medium = self.lens.object_medium.clone();
        let mut present = self.medium(&medium, MediumPlace::Object);
        let mut gaps = vec![gap(distance, &present)];
        for i in 0..self.lens.surfaces.len() {
            let row = self.lens.surfaces[i].clone();
            if row.medium != Medium::Mirror {
                present = self.medium(&row.medium, MediumPlace::behind(i));
            }
            gaps.push(gap(row.thickness, &present));
        }
        gaps
    }

    fn medium(&mut self, medium: &Medium, place: MediumPlace) -> Value {
        match medium {
            Medium::Air | Medium::Mirror => medium_instance("opticalmedium", "Air", json!({})),
            Medium::Index(n) => {
                let data = json!({"label": format!("{n}"), "n": n, "_catalog_name": "user"});
                medium_instance("opticalmedium", "ConstantIndex", data)
            }
            Medium::Model { nd, vd } => {
                // Each program has a dispersion formula of its own for these two numbers.
                let note = "a table of its indices, with nd and vd beside it";
                self.record(ConversionOutcome::Used, format!("model glass {place}"), note);
                let mut data = self.table(medium);
                data["label"] = format!("{nd},{vd}").into();
                data["_catalog"] = "model".into();
                data[MODEL_KEY] = json!([nd, vd]);
                medium_instance("opticalmedium", "InterpolatedMedium", data)
            }
            Medium::Glass(name) => self.table_of_glass(name),
            // Refused before.
            Medium::Grin(gradient) => self.medium(&gradient.base, place),
        }
    }

    /// A catalogue glass as a table of indices.
    fn table_of_glass(&self, name: &str) -> Value {
        let Some(glass) = glass::find(name) else {
            return medium_instance("opticalmedium", "Air", json!({}));
        };
        let mut data = self.table(&Medium::Glass(name.to_owned()));
        data["label"] = glass.name.clone().into();
        data["_catalog"] = glass.manufacturer.clone().into();
        medium_instance("opticalmedium", "InterpolatedMedium", data)
    }

    /// A table of indices; the other program interpolates between its entries.
    fn table(&self, medium: &Medium) -> Value {
        let table = glass_table(&self.lens.wavelengths, medium).unwrap_or_default();
        let (nm, n): (Vec<f64>, Vec<f64>) = table.into_iter().map(|(um, n)| (um * 1e3, n)).unzip();
        json!({"wvls": nm, "rndx": n, "kvals": null, "kvals_wvls": null})
    }

    fn specification(&mut self) -> Result<Value, LensError> {
        let attributes = json!({
            "spectral_region": self.spectrum(),
            "pupil": self.pupil()?,
            "field_of_view": self.fields(),
            "defocus": instance(
                "raytr.opticalspec",
                "FocusRange",
                json!({"focus_shift": 0.0, "defocus_range": 0.0}),
            ),
        });
        Ok(instance("raytr.opticalspec", "OpticalSpecs", attributes))
    }

    fn spectrum(&self) -> Value {
        let waves = &self.lens.wavelengths;
        let attributes = json!({
            "wavelengths": waves.iter().map(|wave| wave.um * 1e3).collect::<Vec<_>>(),
            "spectral_wts": waves.iter().map(|wave| wave.weight).collect::<Vec<_>>(),
            "reference_wvl": self.lens.primary(),
            "coating_wvl": 550.0,
        });
        instance("raytr.opticalspec", "WvlSpec", attributes)
    }

    fn pupil(&mut self) -> Result<Value, LensError> {
        let (space, kind, value) = match self.lens.aperture {
            Aperture::EntrancePupilDiameter(diameter) => ("object", "epd", diameter),
            Aperture::FNumber(number) => ("image", "f/#", number),
            Aperture::ObjectNa(na) => ("object", "NA", na),
            Aperture::StopSemiDiameter(_) => {
                let note = "as the diameter of the paraxial entrance pupil";
                self.record(ConversionOutcome::Approximated, "aperture", note);
                ("object", "epd", 2.0 * FirstOrderBeam::new(&self.lens)?.pupil_radius)
            }
        };
        let attributes = json!({
            "value": value,
            "_key": ["aperture", space, kind],
            "pupil_rays": [[0.0, 0.0], [1.0, 0.0], [-1.0, 0.0], [0.0, 1.0], [0.0, -1.0]],
            "ray_labels": ["00", "+X", "-X", "+Y", "-Y"],
        });
        Ok(instance("raytr.opticalspec", "PupilSpec", attributes))
    }

    fn fields(&self) -> Value {
        let fields = &self.lens.fields;
        let (space, kind) = match fields.kind {
            FieldKind::Angle => ("object", "angle"),
            FieldKind::ObjectHeight => ("object", "height"),
            FieldKind::ImageHeight => ("image", "height"),
        };
        let points = fields.projected_points();
        let largest = points.iter().map(|[x, y]| x.hypot(*y)).fold(0.0, f64::max);
        let field = |([x, y], weight): (&[f64; 2], f64)| {
            let attributes = json!({
                "x": x, "y": y, "wt": weight,
                "vux": 0.0, "vuy": 0.0, "vlx": 0.0, "vly": 0.0, "aim_pt": null,
            });
            instance("raytr.opticalspec", "Field", attributes)
        };
        let weights = fields.values.iter().map(|point| point.weight);
        let attributes = json!({
            "_key": ["field", space, kind],
            "value": largest,
            "is_relative": false,
            "index_label_type": "auto",
            "index_labels": vec![""; points.len()],
            "fields": points.iter().zip(weights).map(field).collect::<Vec<_>>(),
        });
        instance("raytr.opticalspec", "FieldSpec", attributes)
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
            self.record(ConversionOutcome::Dropped, what, "the present numbers alone are written");
        }
        let note = "elements are no part of the file: `rebuild_from_seq()` makes them there";
        self.record(ConversionOutcome::Used, "surfaces and gaps", note);
    }
}

/// The plane of the object or the image.
fn plane(label: &str, profile: usize) -> Value {
    let attributes = json!({
        "label": label, "delta_n": 0.0, "decenter": null, "max_aperture": 1.0,
        "clear_apertures": [], "edge_apertures": [],
        "interact_mode": "dummy", "profile_id": profile.to_string(),
    });
    instance("elem.surface", "Surface", attributes)
}

fn circle(radius: f64) -> Value {
    let attributes = json!({"radius": radius, "x_offset": 0.0, "y_offset": 0.0, "rotation": 0.0});
    instance("elem.surface", "Circular", attributes)
}

/// An aperture of another form; `None` for one that the format does not have.
fn figure(own: &SurfaceAperture) -> Option<Value> {
    let [x, y] = own.center;
    let (class, mut attributes) = match own.shape {
        ApertureShape::Circle { radius } => ("Circular", json!({"radius": radius})),
        ApertureShape::Rectangle { half_width, half_height } => {
            ("Rectangular", json!({"x_half_width": half_width, "y_half_width": half_height}))
        }
        ApertureShape::Ellipse { half_width, half_height } => {
            ("Elliptical", json!({"x_half_width": half_width, "y_half_width": half_height}))
        }
        ApertureShape::Polygon { .. } | ApertureShape::Spider { .. } => return None,
    };
    for (key, value) in [("x_offset", x), ("y_offset", y), ("rotation", own.angle)] {
        attributes[key] = json!(value);
    }
    if own.obscures() {
        attributes["is_obscuration"] = json!(true);
    }
    Some(instance("elem.surface", class, attributes))
}

/// Decentre and tilt of a surface; angles about x and y are left-handed there.
fn decenter((moved, word): (AxisBreak, &'static str)) -> Value {
    let kind = match word {
        "DAR" => "dec and return",
        "BEN" => "bend",
        "REV" => "reverse",
        _ => "decenter",
    };
    let [a, b, c] = moved.tilt;
    let attributes = json!({
        "_dtype": kind,
        "dec": array(&moved.decenter),
        "euler": array(&[-a, -b, c]),
        "rot_pt": array(&[0.0; 3]),
        "rot_mat": null,
    });
    instance("elem.surface", "DecenterData", attributes)
}

fn gap(thickness: f64, medium: &Value) -> Value {
    instance("seq.gap", "Gap", json!({"thi": thickness, "medium": medium}))
}

/// The shape of a surface.
fn profile(row: &Row) -> Value {
    let is_odd = row.freeform.as_ref().is_some_and(|form| form.kind == FreeformKind::OddAsphere);
    let has_terms = row.asphere.iter().any(|a| *a != 0.0);
    let (class, attributes) = if is_odd {
        let terms = odd_terms(row);
        let numbers = json!({"cv": row.curvature, "ec": row.conic + 1.0, "coefs": terms});
        ("RadialPolynomial", numbers)
    } else if has_terms {
        let terms: Vec<f64> = std::iter::once(0.0).chain(row.asphere.iter().copied()).collect();
        ("EvenPolynomial", json!({"cv": row.curvature, "cc": row.conic, "coefs": terms}))
    } else if row.conic != 0.0 {
        ("Conic", json!({"cv": row.curvature, "cc": row.conic}))
    } else {
        ("Spherical", json!({"cv": row.curvature}))
    };
    instance("elem.profiles", class, attributes)
}

/// The coefficients of r, r², r³, …, of an odd asphere together with those of r⁴, r⁶, … of the row.
fn odd_terms(row: &Row) -> Vec<f64> {
    let odd = row.freeform.as_ref().map_or(&[][..], |form| &form.numbers[..]);
    let even = if row.asphere.is_empty() { 0 } else { 2 * row.asphere.len() + 2 };
    let mut terms = vec![0.0; odd.len().max(even)];
    odd.iter().zip(&mut terms).for_each(|(a, term)| *term += a);
    for (k, a) in row.asphere.iter().enumerate() {
        terms[2 * k + 3] += a;
    }
    terms
}

/// The diffractive phase of a surface, as optical paths at one wavelength.
fn phase(row: &Row) -> Option<Value> {
    let form = row.freeform.as_ref()?;
    let FreeformKind::RadialPhase { radius, order } = form.kind else { return None };
    let mm = PHASE_NM * 1e-6 / std::f64::consts::TAU;
    let terms = (1..).zip(&form.numbers).map(|(k, a)| a * mm / radius.powi(2 * k));
    let attributes = json!({
        "label": "",
        "coefficients": terms.collect::<Vec<f64>>(),
        "ref_wl": PHASE_NM,
        "order": order,
        "phase_fct_module": "rayoptics.oprops.doe",
        "phase_fct_name": "radial_phase_fct",
    });
    Some(instance("oprops.doe", "DiffractiveElement", attributes))
}
