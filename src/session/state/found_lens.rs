//! Lenses of a search on their way to the design: with its merit function before, with its aperture
//! behind.

use super::Session;
use crate::lens::{Aperture, Lens};
use crate::math::format_short;
use crate::merit::{Goal, Merit};
use crate::search::lens_landscape::describe_left_out;
use crate::session::structure_search::StructureSearchRequest;
use crate::session::view::Severity;
use std::mem::discriminant;

/// The relative error allowed of spots in a comparison of two lenses.
const COARSE: f64 = 1e-2;
/// The part of its light that a lens may lose with the aperture of the design.
const LIGHT_LOSS: f64 = 0.02;
/// The growth of the merit up to which the rims of a lens are left to follow its light.
const MERIT_GROWTH: f64 = 1.02;

impl Session {
    /// Gives a search the merit function of the design, unless it has one of its own, and says which
    /// terms a search cannot have.
    pub(super) fn give_goal(&mut self, request: &mut StructureSearchRequest) {
        let Some(own) = self.goal().filter(|_| request.plan.goal.is_none()) else { return };
        let mut plan = request.plan.clone();
        plan.rules.semi_diameter = plan.rules.semi_diameter.or(request.open);
        // The search itself gives the reason why a lens or a rule is refused.
        let Ok((goal, left_out)) = plan.goal_of_design(&self.lens, &own) else { return };
        request.plan.goal = Some(goal);
        if let Some(text) = describe_left_out(&left_out) {
            self.post(Severity::Note, text);
        }
    }

    /// A lens of a search with the aperture of the design in place of the stop that the search has
    /// varied, and with rims that follow the light if nobody has fixed one; and what is said of it. A
    /// lens that would be darker than the design keeps its stop.
    pub(super) fn with_design_aperture(&self, found: Lens) -> (Lens, Option<String>) {
        let design = &self.lens;
        let same_kind = discriminant(&found.aperture) == discriminant(&design.aperture);
        if same_kind || found.zoom.len() != design.zoom.len() {
            return (found, None);
        }
        let stop = aperture_text(found.aperture);
        let own = self.with_aperture_of_design(&found);
        let areas = [&own, &found, design].map(pupil_areas);
        let [Some(own_areas), Some(found_areas), Some(design_areas)] = areas else {
            let text = format!("the aperture is the {stop} now, as in the search");
            return (found, Some(text));
        };
        let asked = found_areas.iter().zip(&design_areas).map(|(found, design)| found.min(*design));
        let is_darker = |(own, asked): (&f64, f64)| *own < (1.0 - LIGHT_LOSS) * asked;
        if own_areas.iter().zip(asked).any(is_darker) {
            let text = format!(
                "the aperture is the {stop} now, as in the search: with the {} of the design the lens \
                 would be darker",
                aperture_text(design.aperture)
            );
            return (found, Some(text));
        }
        let kept = aperture_text(design.aperture);
        let text = format!("the aperture is the {kept} as before, in place of the {stop}");
        (own, Some(text))
    }

    fn with_aperture_of_design(&self, found: &Lens) -> Lens {
        let design = &self.lens;
        let mut own = Lens { aperture: design.aperture, ..found.clone() };
        for (position, before) in own.zoom.iter_mut().zip(&design.zoom) {
            position.aperture = before.aperture;
        }
        let fixed = |lens: &Lens, row: usize| lens.surfaces[row].semi_diameter.is_some();
        if !design.stop().is_some_and(|stop| fixed(design, stop))
            && let Some(stop) = own.stop()
        {
            // The search has fixed it, and the aperture sets the beam.
            own.surfaces[stop].semi_diameter = None;
        }
        if (0..design.surfaces.len()).any(|row| fixed(design, row)) {
            return own;
        }
        let mut open = own.clone();
        open.surfaces.iter_mut().for_each(|row| row.semi_diameter = None);
        let merit = |lens: &Lens| self.coarse_merit(lens).unwrap_or(f64::INFINITY);
        if merit(&open) <= MERIT_GROWTH * merit(&own) { open } else { own }
    }

    fn coarse_merit(&self, lens: &Lens) -> Option<f64> {
        let merit = Merit::new(lens, self.goal()?.as_ref(), COARSE).ok()?;
        merit.value(&merit.values(lens)).ok().filter(|value| value.is_finite())
    }
}

/// The areas of the pupils of a lens; `None` if it has no merit.
fn pupil_areas(lens: &Lens) -> Option<Vec<f64>> {
    let goal: Goal = Goal::default_for(lens).ok()?;
    Some(Merit::new(lens, &goal, COARSE).ok()?.initial_light().concat())
}

/// The name of an aperture with its value.
fn aperture_text(aperture: Aperture) -> String {
    let number = |value: f64| format_short(1e-4 * (1e4 * value).round());
    match aperture {
        Aperture::EntrancePupilDiameter(diameter) => {
            format!("entrance pupil diameter of {} mm", number(diameter))
        }
        Aperture::FNumber(f_number) => format!("f-number f/{}", number(f_number)),
        Aperture::ObjectNa(na) => format!("numerical aperture of {}", number(na)),
        Aperture::StopSemiDiameter(height) => {
            format!("semi-diameter of the stop, {} mm,", number(height))
        }
    }
}
