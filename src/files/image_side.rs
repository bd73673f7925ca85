//! The side of the image plane that light meets.
//!
//! Rays here meet a plane from the side that the sense of travel says. In other programs they meet it from
//! either, and a tilted image plane of theirs may face away.

use super::probe_rays::ProbeLaunch;
use super::report::{ConversionOutcome, ConversionReport};
use crate::lens::{FieldPoint, Lens, Pose};
use crate::math::Vec3;
use crate::trace::{Fate, Tracer};
use std::f64::consts::PI;

/// Turns the image plane of an imported lens over, about its x axis, if the rays of the first field miss it
/// for its side alone.
pub(super) fn face_image(lens: &mut Lens, report: &mut ConversionReport) {
    let tilted = lens.surfaces.last().is_some_and(|row| row.break_after.is_some());
    if !tilted || reaches_image(lens) != Some(false) {
        return;
    }
    let mut turned = lens.clone();
    turn_image(&mut turned);
    if reaches_image(&turned) == Some(true) {
        *lens = turned;
        let note = "it faced away from the light: turned over about its x axis";
        report.add(ConversionOutcome::Approximated, "image plane", note);
    }
}

/// True if a ray of the first field reaches the image, false if it misses the image alone, `None` if it is
/// lost elsewhere.
fn reaches_image(lens: &Lens) -> Option<bool> {
    let system = lens.resolve(0, lens.wavelengths[lens.primary()].um).ok()?;
    let tracer = Tracer::new(&system).ok()?;
    let launch = ProbeLaunch::new(lens, 0).ok()?;
    let field = lens.fields.values.first().copied();
    let field = field.unwrap_or(FieldPoint { x: 0.0, y: 0.0, weight: 1.0 });
    let image = system.surfaces.len() - 1;
    let fates = launch.many_rays(field, 7).map(|ray| tracer.trace(ray).fate);
    fates.fold(None, |found, fate| match fate {
        Fate::Imaged => Some(true),
        fate if fate.surface() == Some(image) => found.or(Some(false)),
        _ => found,
    })
}

/// Turns the frame of the image plane by half a turn about its x axis.
fn turn_image(lens: &mut Lens) {
    let Some(last) = lens.surfaces.last_mut() else { return };
    let before = last.break_before.map_or_else(Pose::centred, |axis| axis.pose());
    let after = last.break_after.map_or_else(Pose::centred, |axis| axis.pose());
    let along = |z| Pose { shift: Vec3::new(0.0, 0.0, z), ..Pose::centred() };
    let half = Pose::new([0.0; 2], [PI, 0.0]);
    let gap = last.thickness;
    let turned = after.then(&along(gap)).then(&half).then(&along(-gap));
    last.place_on_axis(&before, &turned);
}
