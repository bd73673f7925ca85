//! The rays that rims clip, and the rims that would let them through.

use std::collections::BTreeMap;

use egui::{RichText, Ui};

use crate::analysis::RayLayout;
use crate::lens::Lens;
use crate::session::Command;
use crate::studio::actions::Actions;
use crate::studio::number;
use crate::studio::panels::widgets::hint_beside;
use crate::studio::text::counted;
use crate::trace::Fate;

/// A rim that clips rays of the drawing.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct ClippingRim {
    /// The index of the surface.
    surface: usize,
    /// The number of rays that end there.
    rays: usize,
    /// The semi-diameter in mm that none of them exceeds.
    needed: f64,
}

/// The rims that clip rays of a drawing, from the first surface to the last.
pub(super) fn clipping_rims(lens: &Lens, layout: &RayLayout) -> Vec<ClippingRim> {
    let mut rims = BTreeMap::new();
    for ray in &layout.rays {
        let (Fate::Clipped(surface), Some(end)) = (ray.path.fate, ray.path.points.last()) else {
            continue;
        };
        let (surface, height) = (surface as usize, end.x.hypot(end.y));
        let rim = lens.surfaces.get(surface).and_then(|row| row.semi_diameter);
        // Obstructions and the sides of gradient-index rods clip rays too.
        if rim.is_none_or(|rim| height <= rim) {
            continue;
        }
        let clipping = ClippingRim { surface, rays: 0, needed: 0.0 };
        let clipping: &mut ClippingRim = rims.entry(surface).or_insert(clipping);
        clipping.rays += 1;
        clipping.needed = clipping.needed.max((100.0 * height).ceil() / 100.0);
    }
    rims.into_values().collect()
}

const HINT: &str = "Show the lens with this change as a candidate: the bar above the panels accepts \
    or discards it. Another rim may limit the beam then";

/// Shows the number of lost rays with a menu of the rims that clip them; a rim that is chosen is
/// shown wide enough as a candidate.
pub(super) fn lost_rays_menu(
    ui: &mut Ui,
    text: RichText,
    rims: &[ClippingRim],
    lens: &Lens,
    actions: &mut Actions,
) {
    let menu = ui.menu_button(text, |ui| {
        ui.set_min_width(300.0);
        for rim in rims {
            if hint_beside(ui.button(rim.title(lens)), HINT).clicked() {
                actions.push(Command::Preview(Some(Box::new(rim.widened(lens)))));
                ui.close();
            }
        }
        let all = ui.button("Let all rims but that of the stop follow the rays");
        if hint_beside(all, HINT).clicked() {
            actions.push(Command::Preview(Some(Box::new(with_automatic_rims(lens)))));
            ui.close();
        }
    });
    menu.response.on_hover_text(
        "Lost rays are drawn to their end, which is marked by a dot. Click for the rims that clip \
         them",
    );
}

impl ClippingRim {
    fn title(&self, lens: &Lens) -> String {
        let row = lens.surfaces.get(self.surface);
        let now = row.and_then(|row| row.semi_diameter).unwrap_or_default();
        let name = if row.is_some_and(|row| row.stop) { "stop" } else { "rim" };
        let [now, needed] = [now, self.needed].map(|mm| number::format_digits(mm, 5));
        let (surface, rays) = (self.surface + 1, counted(self.rays as u64, "ray"));
        format!("Widen the {name} of surface {surface} from {now} to {needed} mm ({rays})")
    }

    fn widened(&self, lens: &Lens) -> Lens {
        let mut wider = lens.clone();
        if let Some(row) = wider.surfaces.get_mut(self.surface) {
            row.semi_diameter = Some(self.needed);
        }
        wider
    }
}

/// The lens without fixed semi-diameters, the stop excepted.
fn with_automatic_rims(lens: &Lens) -> Lens {
    let mut wider = lens.clone();
    let others = wider.surfaces.iter_mut().filter(|row| !row.stop);
    others.for_each(|row| row.semi_diameter = None);
    wider
}
