//! One surface: form, glass, aperture and place.

use super::{CodeVWriter, number, quoted};
use crate::files::codev::file::SpecialForm;
use crate::files::report::ConversionOutcome;
use crate::files::zemax::{is_general, merged_powers};
use crate::lens::glass::{self, Glass};
use crate::lens::{
    Aperture, ApertureShape, AxisBreak, FreeformKind, IdealElement, Medium, MediumPlace, Quantity,
    Row, SurfaceAperture, SurfaceNumber,
};

/// Decentre and tilt of a surface, and the word that says what they move.
pub(in crate::files) type Place = Option<(AxisBreak, &'static str)>;

/// The place of a surface, which has none if it is centred; `None` for one that the format cannot hold
/// without a surface of its own.
pub(in crate::files) fn place(row: &Row) -> Option<Place> {
    let [x, y] = row.decenter;
    let own = row.decenter != [0.0; 2] || row.tilt != [0.0; 2];
    match (row.break_before, row.break_after) {
        (None, None) if !own => Some(None),
        (None, None) => {
            let tilt = [row.tilt[0], row.tilt[1], 0.0];
            Some(Some((AxisBreak { decenter: [x, y, 0.0], tilt }, "DAR")))
        }
        (Some(before), None) if !own => Some(Some((before, ""))),
        (Some(before), Some(after)) if !own => {
            let turn = AxisBreak { decenter: [0.0; 3], ..before };
            let same = turn.pose().inverse().then(&after.pose()).is_nearly_centred();
            same.then_some(Some((before, "BEN")))
        }
        (None, Some(after)) if !own => {
            let reverse = AxisBreak::from_pose(&after.pose().inverse());
            Some(Some((reverse, "REV")))
        }
        _ => None,
    }
}

impl CodeVWriter {
    pub(super) fn surface(&mut self, i: usize) {
        let row = self.lens.surfaces[i].clone();
        let radius = if row.curvature == 0.0 { 0.0 } else { row.curvature.recip() };
        let last = i + 1 == self.lens.surfaces.len();
        let defocus = if last { self.lens.image_solve.unwrap_or(0.0) } else { 0.0 };
        let glass = self.glass(&row.medium, MediumPlace::behind(i));
        self.line(format!("S {} {}{glass}", number(radius), number(row.thickness - defocus)));
        if row.stop {
            self.line("  STO");
        }
        if !row.comment.is_empty() {
            self.line(format!("  SLB {}", quoted(&row.comment)));
        }
        self.aperture_of(&row);
        self.form(&row);
        let [bend, gap] = [Quantity::Curvature, Quantity::Thickness]
            .map(|quantity| if self.is_variable(i, quantity) { 0 } else { 100 });
        self.line(format!("  CCY {bend}; THC {gap}"));
        self.place(&row);
        self.report.add_row_losses(SurfaceNumber::new(i), &row);
        if row.kept_aperture("seq").is_none() {
            self.report.add_aperture_loss(SurfaceNumber::new(i), &row);
        }
    }

    fn aperture_of(&mut self, row: &Row) {
        let stop = match self.lens.aperture {
            Aperture::StopSemiDiameter(radius) if row.stop => Some(radius),
            _ => None,
        };
        if let Some(lines) = row.kept_aperture("seq").filter(|_| stop.is_none()) {
            lines.iter().for_each(|line| self.line(format!("  {line}")));
            return;
        }
        if let Some(radius) = stop.or(row.semi_diameter) {
            self.line(format!("  CIR {}", number(radius)));
        }
        if let Some(inner) = row.obstruction.filter(|inner| *inner > 0.0) {
            self.line(format!("  CIR OBS {}", number(inner)));
        }
        let lines = aperture_lines(row, stop.is_some()).unwrap_or_default();
        lines.into_iter().for_each(|line| self.line(format!("  {line}")));
    }

    fn form(&mut self, row: &Row) {
        if let Some(lines) = grating_lines(row).or_else(|| form_lines(row)) {
            lines.into_iter().for_each(|line| self.line(format!("  {line}")));
            return;
        }
        phase_lines(row).into_iter().for_each(|line| self.line(format!("  {line}")));
        let aspheric = row.asphere.iter().any(|a| *a != 0.0);
        if aspheric || row.conic != 0.0 {
            self.line(if aspheric { "  ASP" } else { "  CON" });
            self.line(format!("  K {}", number(row.conic)));
        }
        for (letter, a) in "ABCDEFG".chars().zip(&row.asphere).filter(|_| aspheric) {
            self.line(format!("  {letter} {}", number(*a)));
        }
    }

    fn place(&mut self, row: &Row) {
        let Some(Some((moved, word))) = place(row) else { return };
        let [x, y, z] = moved.decenter;
        let [a, b, c] = moved.tilt;
        let all = [("XDE", x), ("YDE", y), ("ZDE", z), ("ADE", -a), ("BDE", -b), ("CDE", c)];
        for (name, value) in all.into_iter().filter(|(_, value)| *value != 0.0) {
            self.line(format!("  {name} {}", number(value)));
        }
        if !word.is_empty() {
            self.line(format!("  {word}"));
        }
    }

    /// The glass behind a surface, with a blank in front; nothing for air.
    pub(super) fn glass(&mut self, medium: &Medium, place: MediumPlace) -> String {
        match medium {
            Medium::Air => String::new(),
            Medium::Mirror => " REFL".to_owned(),
            Medium::Glass(name) => match glass::find(name) {
                Some(glass) => format!(" {}", catalogue_name(glass)),
                None => String::new(),
            },
            Medium::Model { nd, vd } => {
                let note = "each program has its own dispersion formula for nd and vd";
                self.record(ConversionOutcome::Approximated, format!("model glass {place}"), note);
                fictitious(*nd, *vd).unwrap_or_else(|| format!(" {nd}:{vd}"))
            }
            Medium::Index(_) => self.private_name(medium),
            Medium::Grin(gradient) => {
                let note = "a gradient-index medium cannot be written: its base is";
                self.record(ConversionOutcome::Dropped, format!("GRIN medium {place}"), note);
                self.glass(&gradient.base, place)
            }
        }
    }

    /// The indices without dispersion, each once.
    fn private_indices(&self) -> Vec<f64> {
        let media = self.lens.surfaces.iter().map(|row| &row.medium);
        let mut indices: Vec<f64> = Vec::new();
        for medium in std::iter::once(&self.lens.object_medium).chain(media) {
            let Medium::Index(index) = medium else { continue };
            if !indices.contains(index) {
                indices.push(*index);
            }
        }
        indices
    }

    fn private_name(&self, medium: &Medium) -> String {
        let place = |index: &f64| *medium == Medium::Index(*index);
        let number = self.private_indices().iter().position(place).unwrap_or(0);
        format!(" 'INDEX{}'", number + 1)
    }

    /// The private catalogue of the indices without dispersion.
    pub(super) fn private_glasses(&mut self) {
        let indices = self.private_indices();
        if indices.is_empty() {
            return;
        }
        self.line("PRV");
        self.line("PWL 2000.0 587.5618 300.0");
        for (i, index) in indices.into_iter().enumerate() {
            let index = number(index);
            self.line(format!("'INDEX{}' {index} {index} {index}", i + 1));
        }
        self.line("END");
    }
}

/// True for a freeform or an ideal element that the format does not have.
pub(super) fn has_no_form(row: &Row) -> bool {
    let special = row.freeform.is_some() || row.ideal.is_some();
    let ruled = grating_lines(row).is_some();
    special && !ruled && form_lines(row).is_none() && phase_lines(row).is_empty()
}

/// The lines of a grating on a conic; `None` for another row.
fn grating_lines(row: &Row) -> Option<Vec<String>> {
    let conic = row.freeform.is_none() && row.asphere.iter().all(|a| *a == 0.0);
    let Some(IdealElement::Grating { lines_per_mm, order }) = row.ideal.filter(|_| conic) else {
        return None;
    };
    // A distance of the grooves that reads back to the same frequency.
    let spacing = (lines_per_mm != 0.0).then(|| number(lines_per_mm.recip()))?;
    let mut lines = vec![format!("DIF GRT; GRO {}; GRS {spacing}", number(order))];
    if row.conic != 0.0 {
        lines.push(format!("CON; K {}", number(row.conic)));
    }
    Some(lines)
}

/// The wavelength at which phases are written, in nanometres.
const PHASE_NM: f64 = 587.5618;

/// The lines of a radial phase; none for another form.
fn phase_lines(row: &Row) -> Vec<String> {
    let Some(form) = row.freeform.as_ref().filter(|_| row.ideal.is_none()) else {
        return Vec::new();
    };
    let FreeformKind::RadialPhase { radius, order } = form.kind else { return Vec::new() };
    let order = number(order);
    let head = [format!("DIF DOE; HOR {order}; HWL {}; HCT R", number(PHASE_NM))];
    let mm = PHASE_NM * 1e-6 / std::f64::consts::TAU;
    let terms = (1..)
        .zip(&form.numbers)
        .map(|(k, a)| format!("HCO C{k} {}", number(a * mm / radius.powi(2 * k))));
    head.into_iter().chain(terms).collect()
}

/// The lines of a form that is none of revolution; `None` for another one, and for what the format does not
/// have.
fn form_lines(row: &Row) -> Option<Vec<String>> {
    let form = row.freeform.as_ref().filter(|_| row.ideal.is_none())?;
    if form.kind == FreeformKind::OddAsphere {
        let powers = merged_powers(row, form);
        let terms = (1..).zip(&powers).map(|(power, a)| format!("SCO AR{power} {}", number(*a)));
        let head = ["SPS ODD 0.0".to_owned(), format!("SCO K {}", number(row.conic))];
        return Some(head.into_iter().chain(terms).collect());
    }
    if row.asphere.iter().any(|a| *a != 0.0) {
        return None;
    }
    let conic = number(row.conic);
    match (form.kind, &form.numbers[..]) {
        (FreeformKind::Biconic, [bend, across]) => Some(vec![
            "AAS".to_owned(),
            format!("CUX {}", number(*bend)),
            format!("KY {conic}"),
            format!("KX {}", number(*across)),
        ]),
        (FreeformKind::Toroid, [bend, terms @ ..])
            if terms.first().is_none_or(|square| *square == 0.0) =>
        {
            let head = ["YTO".to_owned(), format!("CUX {}", number(*bend)), format!("K {conic}")];
            let letters = "ABCDEFG".chars().zip(terms.iter().skip(1));
            let terms = letters.map(|(letter, a)| format!("{letter} {}", number(*a)));
            Some(head.into_iter().chain(terms).collect())
        }
        (kind, numbers) => special_lines(kind, numbers, &conic),
    }
}

/// The lines of a special form; `None` for a form that is none.
fn special_lines(kind: FreeformKind, numbers: &[f64], conic: &str) -> Option<Vec<String>> {
    let (name, form) = match kind {
        FreeformKind::XyPolynomial { .. } => ("XYP", SpecialForm::XyPolynomial),
        FreeformKind::QCon { .. } => ("QCN", SpecialForm::QCon),
        FreeformKind::QBfs { .. } => ("QBF", SpecialForm::QBfs),
        FreeformKind::FringeZernike { .. } => ("ZFR", SpecialForm::FringeZernike),
        _ => return None,
    };
    if form.first() + numbers.len() > form.last() + 1 {
        return None;
    }
    let radius = number(*kind.lengths().first()?);
    let head = [format!("SPS {name} {radius}; SCO NRADIUS {radius}; SCO K {conic}")];
    let terms = (form.first()..).zip(numbers);
    let terms = terms.map(|(k, a)| format!("SCO C{k} {}", number(*a)));
    Some(head.into_iter().chain(terms).collect())
}

/// A catalogue name as CODE V has it: letters and digits, then the maker if there is one.
fn catalogue_name(glass: &Glass) -> String {
    if is_general(glass) {
        return glass.name.clone();
    }
    let letters: String = glass.name.chars().filter(char::is_ascii_alphanumeric).collect();
    format!("{}_{}", letters.to_ascii_uppercase(), glass.manufacturer)
}

/// The name of a fictitious glass, `517000.642000`; `None` for numbers that it cannot hold.
fn fictitious(nd: f64, vd: f64) -> Option<String> {
    if !(1.0..2.0).contains(&nd) || !(10.0..100.0).contains(&vd) {
        return None;
    }
    let [index, abbe] = [nd, vd].map(|value| format!("{value:?}"));
    let (index, abbe) = (index.strip_prefix("1.")?, abbe.replace('.', ""));
    Some(format!(" {index:0<6}.{abbe:0<6}"))
}

/// The commands of the apertures that are no circles about the vertex: one of each kind, all with the same
/// centre and the same angle, which `ADX`, `ADY` and `ARO` give for all apertures of a surface. `is_stop` is
/// true if the surface has a circle as the aperture of the lens.
///
/// # Errors
/// The index of the first aperture that the format cannot hold beside the others.
pub(super) fn aperture_lines(row: &Row, is_stop: bool) -> Result<Vec<String>, usize> {
    let has_circle = is_stop || row.semi_diameter.is_some() || row.obstruction.is_some();
    let mut place = has_circle.then_some(([0.0; 2], None));
    let (mut lines, mut kinds) = (Vec::new(), Vec::new());
    for (k, own) in row.apertures.iter().enumerate() {
        let is_round = matches!(own.shape, ApertureShape::Circle { .. });
        let angle = (!is_round).then_some(own.angle);
        let fits = place.is_none_or(|(center, turned): ([f64; 2], Option<f64>)| {
            center == own.center && (turned.is_none() || angle.is_none() || turned == angle)
        });
        let kind = (is_round, own.obscures());
        if !fits || kinds.contains(&kind) || (is_round && has_circle) {
            return Err(k);
        }
        lines.extend(aperture_commands(own).ok_or(k)?);
        kinds.push(kind);
        place = Some((own.center, place.and_then(|(_, turned)| turned).or(angle)));
    }
    if let Some(([x, y], angle)) = place.filter(|_| !kinds.is_empty()) {
        let places = [("ADX", x), ("ADY", y), ("ARO", angle.unwrap_or(0.0))];
        let moved = places.iter().filter(|(_, value)| *value != 0.0);
        lines.extend(moved.map(|(name, value)| format!("{name} {}", number(*value))));
    }
    Ok(lines)
}

/// The commands of an aperture without its place; `None` for one that the format does not have.
fn aperture_commands(aperture: &SurfaceAperture) -> Option<Vec<String>> {
    let kind = if aperture.obscures() { "OBS " } else { "" };
    let pair = |name: &str, [x, y]: [f64; 2]| {
        vec![format!("{name}X {kind}{}", number(x)), format!("{name}Y {kind}{}", number(y))]
    };
    match aperture.shape {
        ApertureShape::Circle { radius } => Some(vec![format!("CIR {kind}{}", number(radius))]),
        ApertureShape::Rectangle { half_width, half_height } => {
            Some(pair("RE", [half_width, half_height]))
        }
        ApertureShape::Ellipse { half_width, half_height } => {
            Some(pair("EL", [half_width, half_height]))
        }
        ApertureShape::Polygon { .. } | ApertureShape::Spider { .. } => None,
    }
}
