//! Warnings about a lens that cannot be manufactured or used as written: negative gaps, semi-diameters
//! beyond the surface, an aperture beyond the stop, fields without rays.

use crate::analysis::check_some_light;
use crate::cli::output::ShortNumber;
use crate::lens::{FieldPoint, Lens, Medium, SurfaceNumber, System};
use crate::pupil::RayModel;
use crate::trace::Fates;
use serde::Serialize;

/// The largest ratio of the stop that the aperture asks for to its semi-diameter that is within what
/// prescriptions round.
const LARGEST_STOP: f64 = 1.05;

/// A warning about a lens.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub(super) struct LensCheck {
    /// The surface, or the one in front of the gap; `None` for the whole lens.
    #[serde(skip_serializing_if = "Option::is_none")]
    surface: Option<usize>,
    /// The text of the warning.
    found: String,
}

impl LensCheck {
    pub(super) fn line(&self) -> String {
        let place = self
            .surface
            .map(|i| format!("surface {}: ", SurfaceNumber::new(i)))
            .unwrap_or_default();
        format!("  {place}{}", self.found)
    }
}

/// Checks the gaps and semi-diameters of a lens, its fields, and the fates of its rays.
/// `stop_radius` is the radius in mm of the stop that the aperture asks for.
pub(super) fn checks(
    system: &System<f64>,
    media: &[Medium],
    model: &RayModel,
    stop_radius: f64,
    fates: Fates,
) -> Vec<LensCheck> {
    let rows = media.len();
    let mut checks: Vec<LensCheck> = (0..rows).filter_map(|i| rim(system, i)).collect();
    checks.extend(stop(system, stop_radius));
    checks.extend(model.fields.iter().filter_map(|field| field_without_rays(model, field)));
    // Behind a mirror gaps are negative, and the edge thickness has another meaning.
    let straight = media.iter().position(|m| *m == Medium::Mirror).unwrap_or(rows);
    checks.extend((0..straight.min(rows - 1)).filter_map(|i| gap(system, i)));
    checks.extend(no_light(model, fates));
    checks
}

/// Checks that a ray of the entrance pupil reaches the image. Where none does, parts of the pupil between
/// them may still be lit, which the search for its boundary tells.
fn no_light(model: &RayModel, fates: Fates) -> Option<LensCheck> {
    let lost = fates.total();
    if fates.imaged > 0 || lost == 0 {
        return None;
    }
    let fields = || model.fields.iter().map(|field| (model, *field));
    let found = match check_some_light(fields()) {
        Err(_) => format!("no light: none of {lost} rays reaches the image"),
        Ok(()) => format!(
            "none of {lost} rays over the entrance pupil reaches the image: light passes in small \
             parts of it"
        ),
    };
    Some(LensCheck { surface: None, found })
}

/// Checks for parts that first-order data or rays leave out: tilts, breaks of the axis, and surfaces that
/// cannot be traced.
pub(super) fn unusual_parts(lens: &Lens) -> Vec<LensCheck> {
    let rows = || lens.surfaces.iter().enumerate();
    let locked = rows().filter_map(|(i, row)| {
        let kind = &row.locked.as_ref()?.kind;
        let found = format!("{kind} cannot be traced: rays meet its conic or asphere alone");
        Some(LensCheck { surface: Some(i), found })
    });
    let mut checks: Vec<LensCheck> = locked.collect();
    if rows().any(|(_, row)| row.pose().is_some() || row.axis().is_some()) {
        let found = "surfaces are decentred or tilted, or the axis is broken: first-order data and \
                     Seidel sums are those of the straightened axis";
        checks.push(LensCheck { surface: None, found: found.to_owned() });
    }
    for (i, row) in rows() {
        if row.hyperhemisphere && !row.has_far_half() {
            let found = "a hyperhemisphere without a far half, which only a sphere or an ellipsoid has: \
                         `hyper` changes nothing";
            checks.push(LensCheck { surface: Some(i), found: found.to_owned() });
        }
        if let Some(ideal) = row.ideal {
            let found = format!(
                "{}: Seidel sums leave it out; the optical path of a paraxial lens is that of a plane \
                 wave in front of it",
                ideal.name()
            );
            checks.push(LensCheck { surface: Some(i), found });
        }
        let Some(form) = &row.freeform else { continue };
        if let Some(order) = form.kind.order() {
            let found = format!(
                "{}: all light is taken to be in the order {order}, and Seidel sums leave the phase out",
                form.kind.name()
            );
            checks.push(LensCheck { surface: Some(i), found });
            continue;
        }
        let found = format!(
            "{}: first-order data are those of the y-z section, and Seidel sums leave its powers \
             beyond the curvature out",
            form.kind.name()
        );
        checks.push(LensCheck { surface: Some(i), found });
    }
    checks
}

/// Checks that the surface extends to its semi-diameter.
fn rim(system: &System<f64>, i: usize) -> Option<LensCheck> {
    let surface = &system.surfaces[i];
    let sd = surface.semi_diameter;
    if !sd.is_finite() || surface.hyperhemisphere || surface.section_sag(sd).is_some() {
        return None;
    }
    let found = format!("the semi-diameter {sd} mm is beyond the edge of the surface");
    Some(LensCheck { surface: Some(i), found })
}

/// Checks that the beam that the aperture asks for, `asked` mm wide at the stop from the axis, fits
/// through the rim there.
fn stop(system: &System<f64>, asked: f64) -> Option<LensCheck> {
    let surface = system.stop?;
    let rim = system.surfaces.get(surface)?.semi_diameter;
    if asked <= LARGEST_STOP * rim {
        return None;
    }
    let found = format!(
        "the aperture asks for a stop of {} mm, but its semi-diameter is {rim} mm, which clips",
        ShortNumber(asked)
    );
    Some(LensCheck { surface: Some(surface), found })
}

/// Checks that rays of a field can be launched at all wavelengths.
fn field_without_rays(model: &RayModel, field: &FieldPoint) -> Option<LensCheck> {
    let mut launches = (0..model.channels.len()).map(|channel| model.launch(*field, channel));
    let error = launches.find_map(Result::err)?;
    let [x, y] = [field.x, field.y].map(ShortNumber);
    Some(LensCheck { surface: None, found: format!("field x {x}, y {y}: {error}") })
}

/// Checks the thickness of a gap on the axis and at the edge.
fn gap(system: &System<f64>, i: usize) -> Option<LensCheck> {
    let [before, behind] = [&system.surfaces[i], &system.surfaces[i + 1]];
    let check = |found| Some(LensCheck { surface: Some(i), found });
    if before.thickness < 0.0 {
        return check(format!("the gap behind it is {} mm", before.thickness));
    }
    let rims = [before.semi_diameter, behind.semi_diameter];
    let height = rims.into_iter().filter(|sd| sd.is_finite()).reduce(f64::min)?;
    let sag = |surface: &crate::lens::Surface<f64>| surface.section_sag(height);
    let edge = before.thickness + sag(behind)? - sag(before)?;
    if edge >= 0.0 {
        return None;
    }
    check(format!("the gap behind it is {edge:.4} mm at {height} mm from the axis"))
}
