//! The surfaces between object and image, and their place on the axis.

use super::{aperture, glass};
use crate::files::codev::file::{
    CodeVDiffraction, CodeVFile, CodeVProfile, CodeVSurface, PickupCommand, Placement,
};
use crate::files::report::{ConversionOutcome, ConversionReport};
use crate::lens::{
    ASPHERE_TERMS, AxisBreak, BASE_NUMBERS, Freeform, FreeformKind, Lens, LockedSurface, Parameter,
    Pickup, Pose, Quantity, Row, Variable,
};
use crate::math::Vec3;

/// The rows of the lens.
pub(super) fn rows(file: &CodeVFile, stop: usize, report: &mut ConversionReport) -> Vec<Row> {
    let image = file.surfaces.len() - 1;
    let unit = super::unit(file);
    let radii = has_radii(file, report);
    let mut rows: Vec<Row> =
        (1..image).map(|k| Row { stop: k == stop, ..row(file, k, radii, report) }).collect();
    let defocus = file.surfaces[image].thickness * unit;
    let at_image = before_image(file, unit);
    if let Some(last) = rows.last_mut().filter(|_| at_image.is_nearly_centred()) {
        last.thickness += defocus;
    }
    for k in 1..image {
        let (before, after) = surface_frames(&file.surfaces[k], unit);
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
    let is_toroid = form.as_ref().is_some_and(|form| form.kind == FreeformKind::Toroid);
    Row {
        curvature: bend / unit,
        conic: surface.conic,
        asphere: if is_toroid { Vec::new() } else { asphere(surface, unit, report) },
        freeform: form.map(|form| form.scaled(unit)),
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
    let unknown = surface
        .diffraction
        .as_ref()
        .filter(|phase| !phase.is_radial || !(phase.nm > 0.0) || surface.profile.is_some());
    if let Some(phase) = unknown {
        let note = "only a phase of powers of r (HCT R) with its wavelength (HWL) on a surface of \
                    revolution can be traced: the row is locked and rays meet its asphere alone";
        for row in report.rows.iter_mut().filter(|row| row.line == Some(phase.line)) {
            row.outcome = ConversionOutcome::Locked;
            note.clone_into(&mut row.note);
        }
    }
    let kind = surface.locked.clone().or_else(|| unknown.map(|_| "DIF DOE".to_owned()))?;
    let lines = lengths.into_iter().chain(surface.lines.iter().cloned()).collect();
    Some(LockedSurface { kind, lines })
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

fn before_image(file: &CodeVFile, unit: f64) -> Pose<f64> {
    file.surfaces.last().map_or_else(Pose::centred, |image| surface_frames(image, unit).0)
}

/// The frame behind the last surface for an image that is tilted or decentred itself, and then displaced
/// along its own axis.
fn to_image(after: Pose<f64>, gap: f64, image: &Pose<f64>, defocus: f64) -> Pose<f64> {
    if image.is_nearly_centred() {
        return after;
    }
    let along = |z| Pose { shift: Vec3::new(0.0, 0.0, z), ..Pose::centred() };
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
