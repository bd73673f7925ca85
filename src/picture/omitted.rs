//! The effects that a picture leaves out, each with the number that it rests on where there is one.

use super::ImageFrame;
use super::diffraction::DiffractionReport;
use super::ghost_light::GhostReport;
use super::losses::LossReport;
use crate::analysis::{Coating, diffraction_gate, rank_ghosts};
use crate::lens::FieldPoint;
use crate::pupil::RayModel;
use serde::Serialize;

/// An effect that is not in a picture.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct OmittedEffect {
    /// The name of the effect.
    pub effect: &'static str,
    /// The largest change that it would make, if that was computed.
    pub change: Option<f64>,
    /// The reason, or the meaning of the number.
    pub reason: &'static str,
}

/// The effects that a picture has of those it may leave out; `None` where nothing of one was computed.
#[derive(Debug, Clone, Copy, Default)]
pub struct IncludedEffects<'a> {
    /// Diffraction.
    pub diffraction: Option<&'a DiffractionReport>,
    /// The losses at surfaces and in glasses.
    pub losses: Option<&'a LossReport>,
    /// Ghosts.
    pub ghosts: Option<&'a GhostReport>,
}

/// The effects that a picture by rays leaves out which has neither diffraction nor losses nor ghosts; see
/// [`omitted_beside`].
pub fn omitted_effects(model: &RayModel, frame: &ImageFrame, tolerance: f64) -> Vec<OmittedEffect> {
    omitted_beside(model, frame, tolerance, IncludedEffects::default())
}

/// The effects that a picture by rays leaves out, given what it has. The change by diffraction is that of
/// contrast up to half of a period per pixel, on the axis if nobody computed more.
pub fn omitted_beside(
    model: &RayModel,
    frame: &ImageFrame,
    tolerance: f64,
    included: IncludedEffects<'_>,
) -> Vec<OmittedEffect> {
    let IncludedEffects { diffraction, losses, ghosts } = included;
    let diffraction = match diffraction {
        None => Some(omitted_diffraction(model, frame, tolerance)),
        Some(report) if report.on => None,
        Some(DiffractionReport { change, reason, .. }) => {
            Some(OmittedEffect { effect: "diffraction", change: Some(*change), reason })
        }
    };
    let mut left_out: Vec<_> = diffraction.into_iter().collect();
    left_out.push(match losses {
        // Bare surfaces on the axis.
        None => omitted_losses(model),
        Some(losses) => OmittedEffect {
            effect: "polarisation",
            change: Some(losses.polarisation),
            reason: "light is taken for unpolarised at every surface; the difference of both \
                     polarisations over their sum",
        },
    });
    match ghosts {
        None => left_out.push(OmittedEffect {
            effect: "ghosts",
            change: None,
            reason: "surfaces reflect nothing; --coating says how they would",
        }),
        Some(ghosts) if !ghosts.on => left_out.push(OmittedEffect {
            effect: "ghosts",
            change: Some(ghosts.change),
            reason: "the light of all where it is brightest, as a share of mid grey",
        }),
        Some(_) if losses.is_some_and(|losses| losses.absorbed > 0.0) => {
            left_out.push(OmittedEffect {
                effect: "absorption of ghosts",
                change: losses.map(|losses| losses.absorbed),
                reason: "ghosts lose nothing in glass, which they cross at least once more than the image; \
                         of the light on the axis the image loses this share",
            });
        }
        Some(_) => {}
    }
    left_out
}

/// The losses, which are known where the lens has bare surfaces and no mirrors.
fn omitted_losses(model: &RayModel) -> OmittedEffect {
    let ranking = rank_ghosts(model, model.primary, Coating::Bare).ok();
    let reason = if ranking.is_some() {
        "of the light on the axis bare surfaces would take this; white loses the same, so that a picture exposed \
         for white does not change; --coating counts it"
    } else {
        "surfaces take no light; white would lose the same, so that a picture exposed for white does not change"
    };
    OmittedEffect { effect: "losses", change: ranking.map(|ranking| 1.0 - ranking.direct), reason }
}

/// Diffraction of which only the axis is known.
fn omitted_diffraction(model: &RayModel, frame: &ImageFrame, tolerance: f64) -> OmittedEffect {
    let axis = FieldPoint { x: 0.0, y: 0.0, weight: 1.0 };
    let highest = 0.5 / frame.pitch;
    let gate = diffraction_gate(model, axis, model.primary, highest, tolerance);
    let (change, reason) = match gate {
        Ok(gate) => match gate.change {
            Some(change) => (Some(change.value), "the change of contrast on the axis, computed"),
            None => (Some(gate.bound), "at most 1.27 nu lambda F"),
        },
        Err(_) => (None, "the change of contrast on the axis is not known"),
    };
    OmittedEffect { effect: "diffraction", change, reason }
}
