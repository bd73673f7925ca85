//! The surfaces between object and image, and their place on the axis.

use super::{aperture, glass};
use crate::files::codev::file::{
    CodeVDiffraction, CodeVFile, CodeVProfile, CodeVSpecial, CodeVSurface, PickupCommand,
    Placement, SpecialForm,
};
use crate::files::report::{ConversionOutcome, ConversionReport};
use crate::lens::{
    ASPHERE_TERMS, AxisBreak, BASE_NUMBERS, Freeform, FreeformKind, IdealElement, Lens,
    LockedSurface, Parameter, Pickup, Pose, Quantity, Row, Variable,
};
use crate::math::Vec3;

/// The rows of the lens.
pub(super) fn rows(file: &CodeVFile, stop: usize, report: &mut ConversionReport) -> Vec<Row> {
    let image = file.surfaces.len() - 1;
    let unit = super::unit(file);
    let radii = has_radii(file, report);
    let mut rows: Vec<Row> =
        (1..image).map(|k| Row { stop: k == stop, ..row(file, k, radii, report) }).collect();
    let defocus = defocus(file);
    let places = places(file, unit);
    let (at_image, _) = places[image];
    if let Some(last) = rows.last_mut().filter(|_| at_image.is_nearly_centred()) {
        last.thickness += defocus;
    }
    for k in 1..image {
        let (before, after) = places[k];
        let after = if k + 1 == image {
            to_image(after, rows[k - 1].thickness, &at_image, defocus)
        } else {
            after
        };
        rows[k - 1].place_on_axis(&before, &after);
        aperture::apply(&file.surfaces[k], unit, &mut rows[k - 1], report);
    }
    rows
}

/// The frame of every surface in that of the axis in front of it, and that of the axis behind in that of the
/// surface. A surface with the place of another one stands where that one does.
fn places(file: &CodeVFile, unit: f64) -> Vec<(Pose<f64>, Pose<f64>)> {
    let mut axis: Pose<f64> = Pose::centred();
    let mut stands: Vec<Pose<f64>> = Vec::with_capacity(file.surfaces.len());
    let mut places = Vec::with_capacity(file.surfaces.len());
    for (k, surface) in file.surfaces.iter().enumerate() {
        let (own, after) = surface_frames(surface, unit);
        let from = surface.reference.and_then(|source| stands.get(source));
        let before = from.map_or(own, |from| axis.inverse().then(from).then(&own));
        let stand = axis.then(&before);
        // The object stands in front of the first vertex, at any distance.
        let gap = if k == 0 { 0.0 } else { surface.thickness * unit };
        axis = stand.then(&after).then(&along(gap));
        stands.push(stand);
        places.push((before, after));
    }
    places
}

/// The frame at a distance along the axis.
fn along(distance: f64) -> Pose<f64> {
    Pose { shift: Vec3::new(0.0, 0.0, distance), ..Pose::centred() }
}

/// True if the file gives radii; a file that does not say so gives them if they are longer than 1 as a
/// rule.
fn has_radii(file: &CodeVFile, report: &mut ConversionReport) -> bool {
    if let Some(radii) = file.radii {
        return radii;
    }
    let bends = file.surfaces.iter().map(|surface| surface.bend.abs()).filter(|bend| *bend > 0.0);
    let radii = bends.map(f64::ln).sum::<f64>() > 0.0;
    let (mode, size) = if radii { ("radii", "more") } else { ("curvatures", "less") };
    let note =
        format!("the file has no RDM: {mode}, since the numbers are {size} than 1 as a rule");
    report.add(ConversionOutcome::Approximated, "RDM", note);
    radii
}

fn row(file: &CodeVFile, number: usize, radii: bool, report: &mut ConversionReport) -> Row {
    let (surface, unit) = (&file.surfaces[number], super::unit(file));
    let imported = glass::medium(file, number);
    let line = &mut report.rows[surface.row];
    if imported.outcome < line.outcome {
        (line.outcome, line.note) = (imported.outcome, imported.note);
    }
    let bend = if surface.bend == 0.0 || !radii { surface.bend } else { surface.bend.recip() };
    let comment = match &imported.missing {
        Some(name) if surface.label.is_empty() => format!("glass {name} is not known"),
        _ => surface.label.clone(),
    };
    let locked = locked(surface, unit, report);
    let form = freeform(surface).filter(|_| locked.is_none());
    let ideal = surface.grating.filter(|_| locked.is_none()).map(|own| IdealElement::Grating {
        lines_per_mm: 1.0 / (own.spacing * unit),
        order: own.order,
    });
    let is_toroid = form.as_ref().is_some_and(|form| form.kind == FreeformKind::Toroid);
    Row {
        curvature: bend / unit,
        conic: surface.conic,
        asphere: if is_toroid { Vec::new() } else { asphere(surface, unit, report) },
        freeform: form.map(|form| form.scaled(unit)),
        ideal,
        thickness: surface.thickness * unit,
        medium: imported.medium,
        locked,
        comment,
        ..Row::default()
    }
}

/// The form that is none of revolution, in the unit of the file. The coefficients of a toroid are those of
/// its curve.
fn freeform(surface: &CodeVSurface) -> Option<Freeform<f64>> {
    if let Some(phase) = &surface.diffraction {
        return Some(radial_phase(phase));
    }
    if let Some(special) = &surface.special {
        return special_form(special);
    }
    let profile = surface.profile.filter(|_| surface.locked.is_none())?;
    Some(match profile {
        CodeVProfile::Biconic => {
            let numbers = vec![surface.across, surface.conic_across];
            Freeform { kind: FreeformKind::Biconic, numbers }
        }
        CodeVProfile::Toroid => {
            let used = surface.terms.iter().rposition(|a| *a != 0.0).map_or(0, |last| last + 1);
            let terms = &surface.terms[..used.min(BASE_NUMBERS - 2)];
            let numbers = [surface.across, 0.0].into_iter().chain(terms.iter().copied()).collect();
            Freeform { kind: FreeformKind::Toroid, numbers }
        }
    })
}

/// A special form; `None` for one whose numbers cannot be traced.
fn special_form(special: &CodeVSpecial) -> Option<Freeform<f64>> {
    let radius = if special.radius == 0.0 { 1.0 } else { special.radius };
    let kind = match special.form {
        SpecialForm::XyPolynomial => FreeformKind::XyPolynomial { radius },
        SpecialForm::OddAsphere => FreeformKind::OddAsphere,
        SpecialForm::QCon => FreeformKind::QCon { radius },
        SpecialForm::QBfs => FreeformKind::QBfs { radius },
        SpecialForm::FringeZernike => FreeformKind::FringeZernike { radius },
    };
    let mut numbers = Vec::new();
    for (number, value) in special.terms.iter().filter(|(_, value)| **value != 0.0) {
        let at = number.checked_sub(special.form.first())?;
        if *number > special.form.last() {
            return None;
        }
        numbers.resize(at + 1, 0.0);
        numbers[at] = *value;
        if kind == FreeformKind::OddAsphere {
            numbers[at] /= radius.powi(i32::try_from(at + 1).unwrap_or(i32::MAX));
        }
        if numbers.len() > kind.counts()[1] {
            return None;
        }
    }
    let form = Freeform { kind, numbers };
    form.fault().is_none().then_some(form)
}

/// A phase of which `2π cₖ/λ` radians are the numbers for r in the unit of the file.
fn radial_phase(phase: &CodeVDiffraction) -> Freeform<f64> {
    let per_mm = std::f64::consts::TAU / (phase.nm * 1e-6);
    let numbers = phase.terms.iter().map(|c| c * per_mm).collect();
    Freeform { kind: FreeformKind::RadialPhase { radius: 1.0, order: phase.order }, numbers }
}

/// The coefficients up to r¹⁶.
fn asphere(surface: &CodeVSurface, unit: f64, report: &mut ConversionReport) -> Vec<f64> {
    let used = surface.terms.iter().rposition(|a| *a != 0.0).map_or(0, |last| last + 1);
    if used > ASPHERE_TERMS {
        let note = "terms in r^18 and r^20: only those up to r^16 are supported";
        let line = &mut report.rows[surface.row];
        line.outcome = ConversionOutcome::Dropped;
        note.clone_into(&mut line.note);
    }
    let terms = surface.terms[..used.min(ASPHERE_TERMS)].iter();
    terms.zip((4..).step_by(2)).map(|(a, power)| a * unit.powi(1 - power)).collect()
}

/// The command that makes a surface impossible to trace, with all its lines.
fn locked(
    surface: &CodeVSurface,
    unit: f64,
    report: &mut ConversionReport,
) -> Option<LockedSurface> {
    let lengths = (unit != 1.0).then(|| format!("UNIT {unit} mm"));
    let unknown = untraceable(surface);
    if let Some((_, line, note)) = unknown {
        for row in report.rows.iter_mut().filter(|row| row.line == Some(line)) {
            row.outcome = ConversionOutcome::Locked;
            note.clone_into(&mut row.note);
        }
    }
    let kind = surface.locked.clone().or_else(|| unknown.map(|(kind, ..)| kind.to_owned()))?;
    let lines = lengths.into_iter().chain(surface.lines.iter().cloned()).collect();
    Some(LockedSurface { kind, lines })
}

/// The command of a phase, a grating or a special form that cannot be traced, its line, and the reason.
fn untraceable(surface: &CodeVSurface) -> Option<(&'static str, usize, &'static str)> {
    let is_aspheric = surface.profile.is_some() || surface.special.is_some();
    if let Some(phase) = &surface.diffraction {
        let is_known = phase.is_radial && phase.nm > 0.0 && !is_aspheric;
        let note = "only a phase of powers of r (HCT R) with its wavelength (HWL) on a surface of \
                    revolution can be traced: the row is locked and rays meet its asphere alone";
        return (!is_known).then_some(("DIF DOE", phase.line, note));
    }
    if let Some(grating) = &surface.grating {
        let is_plain = !is_aspheric && surface.terms.iter().all(|a| *a == 0.0);
        let is_known = grating.spacing != 0.0 && grating.normal == [0.0, 1.0, 0.0] && is_plain;
        let note = "only a grating of known spacing (GRS) with grooves along x on a conic can be \
                    traced: the row is locked and rays meet its asphere alone";
        return (!is_known).then_some(("DIF GRT", grating.line, note));
    }
    let special = surface.special.as_ref()?;
    let is_plain = surface.profile.is_none() && surface.terms.iter().all(|a| *a == 0.0);
    let is_known = is_plain && special_form(special).is_some();
    let note = "its coefficients cannot be traced: the row is locked and rays meet its conic alone";
    (!is_known).then_some(("SPS", special.line, note))
}

/// The frame of a surface in that of the axis in front of it, and that of the axis behind in that of the
/// surface; `tilt` holds ADE and BDE, which are left-handed, and CDE, in degrees.
pub(in crate::files) fn frames(
    placement: Placement,
    decenter: [f64; 3],
    [a, b, c]: [f64; 3],
) -> (Pose<f64>, Pose<f64>) {
    let own = AxisBreak { decenter, tilt: [-a, -b, c] }.pose();
    match placement {
        Placement::Basic => (own, Pose::centred()),
        Placement::Return => (own, own.inverse()),
        Placement::Bend => (own, Pose { shift: Vec3::default(), ..own }),
        Placement::Reverse => (Pose::centred(), own.inverse()),
    }
}

fn surface_frames(surface: &CodeVSurface, unit: f64) -> (Pose<f64>, Pose<f64>) {
    frames(surface.placement, surface.decenter.map(|length| length * unit), surface.tilt)
}

/// The displacement in mm of the image plane along its axis.
pub(super) fn defocus(file: &CodeVFile) -> f64 {
    file.surfaces.last().map_or(0.0, |image| image.thickness) * super::unit(file)
}

/// True if the image plane is neither tilted nor decentred itself.
pub(super) fn has_centred_image(file: &CodeVFile) -> bool {
    let places = places(file, super::unit(file));
    places.last().is_none_or(|(image, _)| image.is_nearly_centred())
}

/// The frame behind the last surface for an image that is tilted or decentred itself, and then displaced
/// along its own axis.
fn to_image(after: Pose<f64>, gap: f64, image: &Pose<f64>, defocus: f64) -> Pose<f64> {
    if image.is_nearly_centred() {
        return after;
    }
    after.then(&along(gap)).then(image).then(&along(defocus - gap))
}

/// Adds variables and pickups.
pub(super) fn add_variables(file: &CodeVFile, lens: &mut Lens, report: &mut ConversionReport) {
    for pickup in &file.pickups {
        add_pickup(file, pickup, lens, report);
    }
    for k in 1..file.surfaces.len() - 1 {
        let surface = &file.surfaces[k];
        let free = [
            (surface.is_curvature_free, Quantity::Curvature),
            (surface.is_thickness_free, Quantity::Thickness),
        ];
        for (_, quantity) in free.into_iter().filter(|(free, _)| *free) {
            let parameter = Parameter::new(k - 1, quantity);
            let follows = lens.pickups.iter().any(|pickup| pickup.parameter == parameter);
            let focus = file.focus.is_some() && k + 2 == file.surfaces.len();
            if !(follows || focus && quantity == Quantity::Thickness) {
                lens.variables.push(Variable { parameter, min: None, max: None });
            }
        }
    }
}

/// Adds a pickup if it yields the present value; else the present value is used.
fn add_pickup(
    file: &CodeVFile,
    command: &PickupCommand,
    lens: &mut Lens,
    report: &mut ConversionReport,
) {
    let quantity = if command.is_thickness { Quantity::Thickness } else { Quantity::Curvature };
    let row = |surface: usize| Some(Parameter::new(surface.checked_sub(1)?, quantity));
    let scale = if command.is_thickness { command.scale } else { command.scale.recip() };
    let offset = command.offset * super::unit(file);
    let made = row(command.surface).zip(row(command.source)).and_then(|(parameter, source)| {
        let (present, from) = (lens.get(parameter)?, lens.get(source)?);
        let given = offset + scale * from;
        let exact = (given - present).abs() <= 1e-9 * present.abs().max(given.abs());
        let new = lens.pickups.iter().all(|pickup| pickup.parameter != parameter);
        let fits = exact && new && parameter != source && (command.is_thickness || offset == 0.0);
        fits.then_some(Pickup { parameter, source, scale, offset })
    });
    if let Some(pickup) = made {
        lens.pickups.push(pickup);
        if lens.with_pickups().is_ok() {
            return;
        }
        lens.pickups.pop();
    }
    let line = &mut report.rows[command.row];
    line.outcome = ConversionOutcome::Approximated;
    "the present value is used".clone_into(&mut line.note);
}
