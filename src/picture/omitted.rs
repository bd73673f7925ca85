//! The effects that a picture leaves out, each with the number that it rests on where there is one.

use super::ImageFrame;
use crate::analysis::diffraction_gate;
use crate::lens::FieldPoint;
use crate::pupil::RayModel;
use serde::Serialize;

/// An effect that is not in a picture.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct OmittedEffect {
    /// The name of the effect.
    pub effect: &'static str,
    /// The largest change of contrast that it would make, if that was computed.
    pub change: Option<f64>,
    /// The reason, or the meaning of the number.
    pub reason: &'static str,
}

/// The effects that a picture by rays leaves out. The change by diffraction is that on the axis, up to
/// half of a period per pixel.
pub fn omitted_effects(model: &RayModel, frame: &ImageFrame, tolerance: f64) -> Vec<OmittedEffect> {
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
    let none = |effect, reason| OmittedEffect { effect, change: None, reason };
    vec![
        OmittedEffect { effect: "diffraction", change, reason },
        none("losses", "surfaces and glasses take nothing away"),
        none("ghosts", "surfaces reflect nothing"),
    ]
}
