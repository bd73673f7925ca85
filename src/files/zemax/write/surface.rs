//! The surfaces, with the object plane in front and the image plane behind.

use super::{ZemaxWriter, number, numbers, one_line};
use crate::files::report::ConversionOutcome;
use crate::files::zemax::freeform::{self, FormLines};
use crate::files::zemax::glass as zemax_glass;
use crate::files::zemax::gradient;
use crate::lens::glass;
use crate::lens::{
    Aperture, ApertureShape, LockedSurface, Medium, MediumPlace, Object, Parameter, Pickup,
    Quantity, Row, SurfaceAperture, SurfaceNumber,
};

impl ZemaxWriter {
    pub(super) fn surfaces(&mut self) {
        self.object();
        for i in 0..self.lens.surfaces.len() {
            self.row(i);
        }
        let image = self.numbers.last().map_or(1, |numbers| numbers.gap + 1);
        self.line(format!("SURF {image}"));
        self.plane("0.0");
    }

    fn object(&mut self) {
        self.line("SURF 0");
        let distance = match self.lens.object {
            Object::Infinity => "INFINITY".to_owned(),
            Object::Finite(distance) => number(distance),
        };
        self.plane(&distance);
        let medium = self.lens.object_medium.clone();
        self.glass(&medium, MediumPlace::Object, false);
    }

    /// The object or the image plane.
    fn plane(&mut self, thickness: &str) {
        self.surface_line("TYPE STANDARD");
        self.surface_line("CURV 0.0 0 0 0 0 \"\"");
        self.surface_line(format!("DISZ {thickness}"));
        self.surface_line("DIAM 0 0 0 0 1 \"\"");
    }

    fn row(&mut self, i: usize) {
        let row = self.lens.surfaces[i].clone();
        self.breaks_before(i);
        self.line(format!("SURF {}", self.numbers[i].surface));
        if row.stop {
            self.surface_line("STOP");
        }
        let aspheric = row.asphere.iter().any(|a| *a != 0.0);
        let form = freeform::row_lines(&row);
        let graded = self.gradient(i, aspheric || form.is_some());
        self.surface_line(match (&row.locked, &form, aspheric, graded.is_some()) {
            (Some(locked), ..) => format!("TYPE {}", locked.kind),
            (None, Some(form), ..) => format!("TYPE {}", form.kind),
            (None, None, true, _) => "TYPE EVENASPH".to_owned(),
            (None, None, false, true) => format!("TYPE {}", gradient::KIND),
            (None, None, false, false) => "TYPE STANDARD".to_owned(),
        });
        if !row.comment.is_empty() {
            self.surface_line(format!("COMM {}", one_line(&row.comment)));
        }
        self.curvature(i, row.curvature);
        if row.conic != 0.0 {
            self.surface_line(format!("CONI {}", number(row.conic)));
        }
        if self.is_variable(i, Quantity::Conic) {
            self.surface_line("VCON");
        }
        if let Some(locked) = &row.locked {
            self.locked_lines(i, locked);
        } else if let Some(form) = &form {
            self.form_lines(i, form);
        } else if aspheric {
            self.terms(i, &row.asphere);
        }
        self.index_gradient(i, graded.iter().flatten());
        if self.breaks[i].behind.is_empty() {
            self.thickness(i, row.thickness);
        } else {
            self.surface_line("DISZ 0.0");
        }
        let variable = self.is_variable(i, Quantity::Index);
        if graded.is_none() {
            self.glass(&row.medium, MediumPlace::behind(i), variable);
        }
        self.semi_diameter(&row);
        if row.hyperhemisphere {
            self.report_hyperhemisphere(i);
        }
        self.breaks_behind(i);
    }

    /// The parameters of a surface that cannot be traced, as its file has them.
    fn locked_lines(&mut self, i: usize, locked: &LockedSurface) {
        if locked.lines.iter().any(|line| line.starts_with("UNIT ")) {
            let what = format!("surface {}: {}", SurfaceNumber::new(i), locked.kind);
            let note = "its parameters are in another unit than millimetres and are not written";
            self.record(ConversionOutcome::Dropped, what, note);
            return;
        }
        let parameters = |line: &&String| {
            ["PARM ", "XDAT ", "VPAR "].iter().any(|keyword| line.starts_with(keyword))
        };
        for line in locked.lines.iter().filter(parameters) {
            self.surface_line(line);
        }
    }

    /// The parameters and the extra data of a freeform, then the parameters that vary.
    fn form_lines(&mut self, i: usize, form: &FormLines) {
        for (parameter, value) in &form.parameters {
            self.surface_line(format!("PARM {parameter} {}", number(*value)));
        }
        for (place, value) in form.extra.iter().enumerate() {
            self.surface_line(format!("XDAT {} {} 0 0 1 0 0", place + 1, number(*value)));
        }
        for (parameter, _) in &form.parameters {
            let varied = freeform::varied_number(form.kind, *parameter);
            if varied.is_some_and(|k| self.is_variable(i, Quantity::Freeform(k))) {
                self.surface_line(format!("VPAR {parameter}"));
            }
        }
    }

    /// The coefficients of a gradient-index medium, then those that vary.
    fn index_gradient<'a>(
        &mut self,
        i: usize,
        coefficients: impl Iterator<Item = &'a (usize, f64)> + Clone,
    ) {
        for (parameter, value) in coefficients.clone() {
            self.surface_line(format!("PARM {parameter} {}", number(*value)));
        }
        for (parameter, _) in coefficients {
            let quantity = gradient::variable_quantity(gradient::KIND, *parameter);
            if quantity.is_some_and(|quantity| self.is_variable(i, quantity)) {
                self.surface_line(format!("VPAR {parameter}"));
            }
        }
    }

    fn report_hyperhemisphere(&mut self, i: usize) {
        let note = "the other program decides by itself if the far half of the surface counts";
        self.record(
            ConversionOutcome::Dropped,
            format!("hyperhemisphere of surface {}", SurfaceNumber::new(i)),
            note,
        );
    }

    /// The parameters of a surface whose gap is a gradient-index medium that the format has.
    fn gradient(&self, i: usize, aspheric: bool) -> Option<Vec<(usize, f64)>> {
        match &self.lens.surfaces[i].medium {
            Medium::Grin(gradient) if !aspheric => gradient::parameters(gradient),
            _ => None,
        }
    }

    fn is_variable(&self, surface: usize, quantity: Quantity) -> bool {
        self.lens.variable(Parameter::new(surface, quantity)).is_some()
    }

    /// The pickup of a number from the same number of another surface, if there is one.
    fn pickup(&self, surface: usize, quantity: Quantity) -> Option<Pickup> {
        let parameter = Parameter::new(surface, quantity);
        let mut pickups = self.lens.pickups.iter();
        let is_it = |p: &&Pickup| {
            p.parameter == parameter && p.source.quantity == quantity && p.source.zoom.is_none()
        };
        pickups.find(is_it).copied()
    }

    fn curvature(&mut self, i: usize, curvature: f64) {
        let solve = match self.pickup(i, Quantity::Curvature) {
            Some(pickup) => {
                let surface = self.numbers[pickup.source.surface].surface;
                let scale = number(pickup.scale);
                format!("4 {surface} {scale} {}", number(pickup.offset))
            }
            None if self.is_variable(i, Quantity::Curvature) => "1 0 0 0".to_owned(),
            None => "0 0 0 0".to_owned(),
        };
        self.surface_line(format!("CURV {} {solve} \"\"", number(curvature)));
    }

    /// The asphere coefficients, from parameter 2 on; parameter 1 belongs to r², which the conic contains.
    fn terms(&mut self, i: usize, asphere: &[f64]) {
        self.surface_line("PARM 1 0.0");
        for (term, a) in asphere.iter().enumerate() {
            self.surface_line(format!("PARM {} {}", term + 2, number(*a)));
        }
        for term in 0..crate::lens::ASPHERE_TERMS {
            if self.is_variable(i, Quantity::Asphere(term)) {
                self.surface_line(format!("VPAR {}", term + 2));
            }
        }
    }

    pub(super) fn thickness(&mut self, i: usize, thickness: f64) {
        self.surface_line(format!("DISZ {}", number(thickness)));
        let parameter = Parameter::new(i, Quantity::Thickness);
        if self.has_focus_solve() && i + 1 == self.lens.surfaces.len() {
            self.surface_line("MAZH 0 0");
        } else if let Some(pickup) = self.pickup(i, Quantity::Thickness) {
            let surface = self.numbers[pickup.source.surface].gap;
            let line = format!("PZUP {surface} {} 0", numbers([pickup.scale, pickup.offset]));
            self.surface_line(line);
        } else if let Some(variable) = self.lens.variable(parameter).copied() {
            let bounds = variable.min.zip(variable.max).filter(|(low, high)| low < high);
            let (low, high) = bounds.unwrap_or((0.0, 0.0));
            self.surface_line(format!("VDSZ {}", numbers([low, high])));
        }
    }

    fn glass(&mut self, medium: &Medium, place: MediumPlace, variable: bool) {
        let vary = i32::from(variable);
        match medium {
            Medium::Air => {}
            Medium::Mirror => self.surface_line("GLAS MIRROR 0 0 1.5 40 0 0 0 0 0 0"),
            Medium::Index(n) => {
                self.surface_line(format!(
                    "GLAS ___BLANK 1 0 {} 0 {vary} 0 0 0 0",
                    numbers([*n, 0.0])
                ));
            }
            Medium::Model { nd, vd } => {
                let line = format!("GLAS ___BLANK 1 0 {} 0 {vary} 0 0 0 0", numbers([*nd, *vd]));
                self.surface_line(line);
                let note = "each program has its own dispersion formula for nd and vd";
                self.record(ConversionOutcome::Approximated, format!("model glass {place}"), note);
            }
            Medium::Glass(name) => self.catalogue_glass(name, place),
            Medium::Grin(gradient) => {
                self.glass(&gradient.base, place, variable);
                let note = "only r^2 to r^6 and z to z^3 of an index without dispersion behind a conic \
                            can be written: its coefficients are dropped";
                self.record(
                    ConversionOutcome::Dropped,
                    format!("gradient-index medium {place}"),
                    note,
                );
            }
        }
    }

    fn catalogue_glass(&mut self, name: &str, place: MediumPlace) {
        let Some(glass) = glass::find(name) else { return };
        let bare: String = glass.name.split_whitespace().collect();
        let values = numbers([glass.nd, glass.vd]);
        self.surface_line(format!("GLAS {bare} 0 0 {values} 0 0 0 0 0 0"));
        if zemax_glass::is_general(glass) {
            let note = "a material without a maker: its data in the other program may differ";
            self.record(ConversionOutcome::Approximated, format!("glass {place}: {name}"), note);
        }
    }

    /// The semi-diameter, and the aperture by which it and the obstruction clip: a surface has one
    /// aperture there, with an outer and an inner radius.
    fn semi_diameter(&mut self, row: &Row) {
        let aperture = match self.lens.aperture {
            Aperture::StopSemiDiameter(radius) if row.stop => Some(radius),
            _ => row.semi_diameter,
        };
        match aperture {
            Some(radius) => self.surface_line(format!("DIAM {} 1 0 0 1 \"\"", number(radius))),
            None => self.surface_line("DIAM 0 0 0 0 1 \"\""),
        }
        if let Some(lines) = row.kept_aperture("zmx") {
            lines.iter().for_each(|line| self.surface_line(line));
            return;
        }
        if !row.apertures.is_empty() {
            let lines = aperture_lines(row).unwrap_or_default();
            lines.into_iter().for_each(|line| self.surface_line(line));
            return;
        }
        let inner = row.obstruction.filter(|radius| *radius > 0.0);
        match (row.semi_diameter, inner) {
            (Some(outer), Some(inner)) => self.clap(&number(inner), outer),
            (Some(outer), None) => self.clap("0", outer),
            (None, Some(inner)) => self.surface_line(format!("OBSC 0 {} 0", number(inner))),
            (None, None) => {}
        }
    }

    fn clap(&mut self, inner: &str, outer: f64) {
        self.surface_line(clap_line(inner, outer));
    }
}

fn clap_line(inner: &str, outer: f64) -> String {
    format!("CLAP {inner} {} 0", number(outer))
}

/// The lines of the apertures of a row with some that are no circles about the vertex: an aperture, an
/// obscuration and a spider with the same centre, none of them turned.
///
/// # Errors
/// The index of the first aperture that the format cannot hold beside the others.
pub(super) fn aperture_lines(row: &Row) -> Result<Vec<String>, usize> {
    let (mut lines, mut kinds, mut center) = (Vec::new(), Vec::new(), None);
    if let Some(radius) = row.semi_diameter {
        let inner = row.obstruction.map_or_else(|| "0".to_owned(), number);
        lines.push(clap_line(&inner, radius));
        // A hole in the circle is an obscuration too.
        kinds = if row.obstruction.is_some() { vec!["AP", "OB"] } else { vec!["AP"] };
        center = Some([0.0; 2]);
    } else if let Some(radius) = row.obstruction {
        lines.push(format!("OBSC 0 {} 0", number(radius)));
        (kinds, center) = (vec!["OB"], Some([0.0; 2]));
    }
    for (k, own) in row.apertures.iter().enumerate() {
        let (kind, line) = aperture_line(own).ok_or(k)?;
        if kinds.contains(&kind) || center.is_some_and(|at| at != own.center) {
            return Err(k);
        }
        lines.push(line);
        kinds.push(kind);
        center = Some(own.center);
    }
    if let Some([x, y]) = center.filter(|at| *at != [0.0; 2]) {
        lines.push(format!("OBDC {} 0", numbers([x, y])));
    }
    Ok(lines)
}

/// The kind and the line of an aperture without its place; `None` for one that the format does not have.
fn aperture_line(aperture: &SurfaceAperture) -> Option<(&'static str, String)> {
    let kind = if aperture.obscures() { "OB" } else { "AP" };
    let is_round = matches!(aperture.shape, ApertureShape::Circle { .. });
    if aperture.angle != 0.0 && !is_round {
        return None;
    }
    let line = match (&aperture.shape, aperture.obscures()) {
        (ApertureShape::Circle { radius }, true) => format!("OBSC 0 {} 0", number(*radius)),
        (ApertureShape::Circle { radius }, false) => format!("CLAP 0 {} 0", number(*radius)),
        (ApertureShape::Rectangle { half_width, half_height }, _) => {
            format!("SQ{kind} {} 0", numbers([*half_width, *half_height]))
        }
        (ApertureShape::Ellipse { half_width, half_height }, _) => {
            format!("EL{kind} {} 0", numbers([*half_width, *half_height]))
        }
        (ApertureShape::Spider { arms, width }, _) => {
            return Some(("SPID", format!("SPID {} {arms} 0", number(*width))));
        }
        (ApertureShape::Polygon { .. }, _) => return None,
    };
    Some((kind, line))
}
