//! Edits of whole elements: what is locked is held, and a change of the focal length is told.

use super::Session;
use crate::files;
use crate::lens::{Edit, ElementEdit, Lens};
use crate::math::format_short;
use crate::paraxial::hold_after_edit;
use crate::session::drag::{held_text, moved_text, rounded};
use crate::session::view::Severity;

/// The least relative change of a focal length that is told: smaller ones are not seen in its digits.
const TOLD_CHANGE: f64 = 1e-5;

impl Session {
    /// The lens that an edit has made of the design, with what is locked held again where the edit is one of
    /// the structure, and what is told of it.
    pub(super) fn after_element_edit(
        &self,
        edit: &Edit,
        lens: Lens,
    ) -> (Lens, Option<(Severity, String)>) {
        if !matches!(edit, Edit::Element(_) | Edit::ReverseRows { .. }) {
            return (lens, None);
        }
        let settings = &self.drag.settings;
        if settings.locks.is_empty() || !keeps_the_glass(edit) {
            let told = self.focal_length_text(&lens);
            return (lens, told.map(|text| (Severity::Note, text)));
        }
        match hold_after_edit(&self.lens, &lens, settings) {
            Ok(held) => {
                let told = moved_text(&held.moved).map(|moved| held_text(settings, &moved));
                (held.lens, told.map(|text| (Severity::Note, text)))
            }
            Err(why) => {
                let changed = self.focal_length_text(&lens);
                let parts = [Some(why.to_string()), changed];
                let told = parts.into_iter().flatten().collect::<Vec<_>>().join("; ");
                (lens, Some((Severity::Warning, told)))
            }
        }
    }

    /// The focal length of the design before an edit and after it, and what restores it; `None` if it has not
    /// changed or there was none.
    fn focal_length_text(&self, after: &Lens) -> Option<String> {
        let zoom = self.settings.zoom;
        let before = files::focal_length(&self.lens, zoom).ok()?;
        let text = |value: f64| format_short(rounded(value));
        let Ok(now) = files::focal_length(after, zoom) else {
            return Some(format!("the focal length was {} mm; now there is none", text(before)));
        };
        if (now - before).abs() <= TOLD_CHANGE * before.abs() {
            return None;
        }
        // Scaling changes no sign.
        let remedy = "; Element > Scale to a focal length restores it";
        let remedy = if now * before > 0.0 { remedy } else { "" };
        let (before, now) = (text(before), text(now));
        Some(format!("the focal length has changed from {before} to {now} mm{remedy}"))
    }
}

/// True for an edit that arranges the glass of the lens in another way: one that adds glass or takes it away
/// means to change the lens, and a move or a bend is a number that was typed.
const fn keeps_the_glass(edit: &Edit) -> bool {
    matches!(
        edit,
        Edit::ReverseRows { .. } | Edit::Element(ElementEdit::Cement(_) | ElementEdit::Split(_))
    )
}
