//! The lines of the table of an element drawing: what ISO 10110 asks for, from the lens and its
//! tolerances.

use crate::lens::{Lens, PerturbationKind, Shape, SurfaceNumber};
use crate::math::ShortNumber;
use crate::report::body::LensBody;
use crate::report::materials::{index_and_abbe, material_name};

/// Half the wavelength of the fringes, in mm: that of the green line of mercury.
const HALF_FRINGE: f64 = 0.5 * 546.07e-6;

/// The tolerances of an element in a lens.
#[derive(Debug, Clone, Copy)]
pub(super) struct ElementTolerances<'a> {
    pub(super) lens: &'a Lens,
    pub(super) body: &'a LensBody,
}

impl ElementTolerances<'_> {
    /// The half range of an error of a surface or of the gap behind it, in the unit of the error.
    fn of(&self, kind: PerturbationKind, surface: usize) -> Option<f64> {
        let errors = &self.lens.tolerances.as_ref()?.errors;
        let own = errors.iter().filter(|t| t.error.kind == kind && t.error.first == surface);
        own.map(|tolerance| tolerance.half_range).reduce(f64::min)
    }

    /// The gap of the element: the surface that comes first in the lens.
    fn gap(&self) -> usize {
        self.body.surfaces[0].min(self.body.surfaces[1])
    }

    /// The thickness on the axis.
    pub(super) fn thickness(&self) -> String {
        let kinds = [PerturbationKind::Thickness, PerturbationKind::ThicknessAdjusted];
        let half = kinds.into_iter().filter_map(|kind| self.of(kind, self.gap())).reduce(f64::min);
        with_tolerance(&ShortNumber(self.body.thickness).to_string(), half)
    }

    /// Power and irregularity in fringes.
    fn form(&self, side: usize) -> String {
        let surface = self.body.surfaces[side];
        let height = self.body.heights[side];
        let power = self.of(PerturbationKind::Curvature, surface);
        let fringes = power.map(|c| 0.5 * c * height * height / HALF_FRINGE);
        let irregularity =
            self.of(PerturbationKind::Irregularity, surface).map(|depth| depth / HALF_FRINGE);
        let number = |v: Option<f64>| v.map_or_else(|| "-".to_owned(), short);
        match (fringes, irregularity) {
            (None, None) => "3/ -".to_owned(),
            (power, None) => format!("3/ {}", number(power)),
            (power, irregularity) => format!("3/ {}({})", number(power), number(irregularity)),
        }
    }

    fn centring(&self, side: usize) -> String {
        let kinds = [PerturbationKind::SurfaceTiltX, PerturbationKind::SurfaceTiltY];
        let surface = self.body.surfaces[side];
        let tilt = kinds.into_iter().filter_map(|kind| self.of(kind, surface)).reduce(f64::min);
        let minutes = tilt.map(|angle| format!("{}'", short(60.0 * angle.to_degrees())));
        format!("4/ {}", minutes.unwrap_or_else(|| "-".to_owned()))
    }
}

/// A number with three digits.
fn short(value: f64) -> String {
    let decimals = (2 - value.abs().max(1e-12).log10().floor() as i32).clamp(0, 12) as usize;
    let text = format!("{value:.decimals$}");
    if text.contains('.') {
        text.trim_end_matches('0').trim_end_matches('.').to_owned()
    } else {
        text
    }
}

fn with_tolerance(text: &str, half: Option<f64>) -> String {
    half.map_or_else(|| text.to_owned(), |half| format!("{text} \u{b1} {}", short(half)))
}

/// The lines of a surface.
pub(super) fn surface_column(of: &ElementTolerances<'_>, side: usize) -> Vec<String> {
    let body = of.body;
    let mut lines = vec![radius_text(&body.shapes[side], side)];
    lines.extend(form_lines(of, side));
    lines.push(format!("\u{d8}e {}", ShortNumber(2.0 * body.heights[side])));
    lines.extend(aperture_line(of, side));
    lines.push("Protective chamfer -".to_owned());
    lines.push(of.form(side));
    lines.push(of.centring(side));
    lines.push("5/ -".to_owned());
    lines
}

/// The line of apertures that are no circles: the first one, and how many there are beside it.
fn aperture_line(of: &ElementTolerances<'_>, side: usize) -> Option<String> {
    let apertures = &of.lens.surfaces.get(of.body.surfaces[side])?.apertures;
    let first = apertures.first()?;
    let effective = if first.obscures() { "" } else { "e " };
    let more = match apertures.len() - 1 {
        0 => String::new(),
        more => format!(" and {more} more"),
    };
    Some(format!("{effective}{}{more}", first.short_text()))
}

/// The radius with its sign: CX for a surface that bulges out of the glass, CC for a hollow one.
fn radius_text(shape: &Shape<f64>, side: usize) -> String {
    let (curvature, _, _) = shape.numbers();
    if curvature == 0.0 {
        return "R plane".to_owned();
    }
    let outwards = (curvature > 0.0) == (side == 0);
    let sign = if outwards { "CX" } else { "CC" };
    format!("R {} {sign}", ShortNumber(1.0 / curvature.abs()))
}

/// The conic constant and the coefficients of an asphere, in the coordinates of the lens.
fn form_lines(of: &ElementTolerances<'_>, side: usize) -> Vec<String> {
    let (_, conic, terms) = of.body.shapes[side].numbers();
    if conic == 0.0 && terms.iter().all(|a| *a == 0.0) {
        return Vec::new();
    }
    let listed = terms.iter().enumerate().filter(|(_, a)| **a != 0.0);
    let terms: Vec<String> = listed.map(|(k, a)| format!("A{} {a:.5e}", 4 + 2 * k)).collect();
    let mut lines = vec![format!("asphere, k {}", ShortNumber(conic))];
    if !terms.is_empty() {
        lines.push(terms.join("  "));
    }
    lines
}

/// The lines of the material.
pub(super) fn material_column(of: &ElementTolerances<'_>) -> Vec<String> {
    let medium = &of.body.medium;
    let gap = of.gap();
    let mut lines = vec![material_name(medium)];
    if let Some((nd, vd)) = index_and_abbe(medium) {
        let index = of.of(PerturbationKind::Index, gap);
        lines.push(with_tolerance(&format!("nd {nd:.6}"), index));
        if let Some(vd) = vd {
            let abbe = of.of(PerturbationKind::Abbe, gap).map(|share| share * vd);
            lines.push(with_tolerance(&format!("vd {vd:.2}"), abbe));
        }
    }
    if matches!(medium, crate::lens::Medium::Grin(_)) {
        lines.push(format!("gradient index: see the lens, gap behind {}", SurfaceNumber::new(gap)));
    }
    lines.extend(["0/ -", "1/ -", "2/ -"].map(str::to_owned));
    lines
}
