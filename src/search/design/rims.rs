//! From a draft to a lens that can be built: a diaphragm, and rims that give the beams of the
//! requirements and no more.

use super::LensRequirements;
use super::draft::LensDraft;
use super::judge::{asked_fields, asked_object, asked_wavelengths};
use crate::analysis::lit_region;
use crate::lens::{Aperture, Lens, Row, Surface, System};
use crate::pupil::RayModel;

/// The place of a diaphragm.
#[derive(Debug, Clone, Copy)]
pub(super) struct StopPlace {
    /// The surface in front of it.
    surface: usize,
    /// Its distance behind the vertex of that surface, in mm.
    distance: f64,
}

/// The share by which the beams are larger than asked for.
const SURPLUS: f64 = 1.001;
/// The factors by which the beams are widened until every field has its light.
const WIDER: [f64; 4] = [1.0008, 1.004, 1.01, 1.025];
/// The number of halvings of the share by which rims shrink.
const HALVINGS: usize = 9;
/// The largest `|curvature| × semi-diameter`.
const STEEPEST: f64 = 0.97;
/// The order of quadrature of the areas of pupils.
const AREA_ORDER: usize = 3;

impl StopPlace {
    /// The image of an entrance pupil, at this distance behind the first vertex, inside a lens: the
    /// gap in which a paraxial chief ray crosses the axis, or else the surface where it is nearest to
    /// it.
    pub(super) fn find(system: &System<f64>, pupil: f64) -> Self {
        let (mut y, mut nu, mut before) = (-pupil, 1.0, 1.0);
        let mut nearest = (f64::INFINITY, Self { surface: 0, distance: 0.0 });
        for (i, surface) in system.surfaces[..system.surfaces.len() - 1].iter().enumerate() {
            if y.abs() < nearest.0 {
                nearest = (y.abs(), Self { surface: i, distance: 0.0 });
            }
            nu -= y * (surface.index - before) * surface.shape.curvature();
            before = surface.index;
            let next = y + surface.thickness * nu / surface.index;
            let last = i + 2 == system.surfaces.len();
            if surface.index == 1.0 && !last && y * next < 0.0 {
                return Self { surface: i, distance: surface.thickness * y / (y - next) };
            }
            y = next;
        }
        nearest.1
    }

    /// The system with a plane at this place, and the index of that plane.
    pub(super) fn inserted(self, system: &System<f64>) -> (System<f64>, usize) {
        let mut system = system.clone();
        if self.distance == 0.0 {
            return (system, self.surface);
        }
        let front = &mut system.surfaces[self.surface];
        let plane = Surface::plane(front.thickness - self.distance, front.index);
        front.thickness = self.distance;
        system.surfaces.insert(self.surface + 1, plane);
        (system, self.surface + 1)
    }

    /// The lens with a diaphragm at this place.
    fn in_lens(self, lens: &Lens) -> Lens {
        let mut lens = lens.clone();
        lens.surfaces.iter_mut().for_each(|row| row.stop = false);
        if self.distance == 0.0 {
            lens.surfaces[self.surface].stop = true;
            return lens;
        }
        let front = &mut lens.surfaces[self.surface];
        let thickness = front.thickness - self.distance;
        front.thickness = self.distance;
        let row = Row { thickness, stop: true, comment: "diaphragm".to_owned(), ..Row::default() };
        lens.surfaces.insert(self.surface + 1, row);
        lens
    }
}

/// The lens of a draft with a diaphragm and rims; `None` if its beams do not get through.
pub(super) fn with_rims(draft: &LensDraft, asked: &LensRequirements) -> Option<Lens> {
    let mut lens = draft.lens.clone();
    lens.wavelengths = asked_wavelengths(asked);
    lens.fields = asked_fields(asked, &asked.fields);
    lens.object = asked_object(asked);
    let um = lens.wavelengths[lens.primary()].um;
    let place = StopPlace::find(&lens.resolve(0, um).ok()?, draft.pupil);
    let lens = place.in_lens(&lens);
    let stop = lens.stop()?;
    let mut last = None;
    for surplus in WIDER {
        let heights = super::draft::beam_heights(draft, asked, &lens, surplus)?;
        let (fitted, enough) = fit(lens.clone(), asked, &heights, stop);
        if enough {
            return Some(fitted);
        }
        last = Some(fitted);
    }
    last
}

/// Shrinks the rims from those that let every beam through to those that leave the areas that are
/// asked for; false if they do not. `heights` are those of the axial beam and of all beams at every row.
fn fit(
    mut lens: Lens,
    asked: &LensRequirements,
    heights: &[[f64; 2]],
    stop: usize,
) -> (Lens, bool) {
    let mut best = lens.clone();
    let [mut low, mut high] = [0.0, 1.0];
    // The rim of the diaphragm gives the light on the axis, whatever the others are.
    let stop_rim = |lens: &mut Lens, radius: f64| {
        lens.surfaces[stop].semi_diameter = Some(radius);
        lens.aperture = Aperture::StopSemiDiameter(radius);
    };
    for step in 0..HALVINGS {
        let share = if step == 0 { 0.0 } else { 0.5 * (low + high) };
        for (row, [axial, all]) in lens.surfaces.iter_mut().zip(heights) {
            let open = (axial + (all.max(*axial) - axial) * (1.0 - share)).max(1.0005 * axial);
            let steepest = STEEPEST / row.curvature.abs().max(1e-12);
            row.semi_diameter = Some(open.min(asked.semi_diameter).min(steepest));
        }
        stop_rim(&mut lens, heights[stop][0]);
        let enough = has_light(&lens, asked);
        if enough {
            best.clone_from(&lens);
            low = share;
        } else {
            high = share;
        }
        if step == 0 && !enough {
            return (lens, false);
        }
    }
    (best, true)
}

/// True if every field has the clear area that is asked for.
fn has_light(lens: &Lens, asked: &LensRequirements) -> bool {
    let Ok(model) = RayModel::from_lens(lens, 0) else { return false };
    let enough = |(field, least): (&crate::lens::FieldPoint, &f64)| {
        lit_region(&model, *field, model.primary)
            .is_ok_and(|region| region.trace_pupil(AREA_ORDER).moments.area >= SURPLUS * least)
    };
    model.fields.iter().zip(&asked.clear_area).all(enough)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::search::design::LensSpecification;
    use crate::search::design::starts::library_starts;

    /// Three planes, which leave a chief ray straight.
    fn planes() -> System<f64> {
        let gap = |thickness| Surface::plane(thickness, 1.0);
        let surfaces = vec![gap(4.0), gap(6.0), gap(10.0), gap(0.0)];
        System { index_before: 1.0, surfaces, stop: None }
    }

    #[test]
    fn a_stop_is_in_the_gap_where_the_chief_ray_crosses_the_axis() {
        let place = StopPlace::find(&planes(), 5.5);
        assert_eq!(place.surface, 1);
        assert!((place.distance - 1.5).abs() < 1e-12, "{}", place.distance);
        let (system, stop) = place.inserted(&planes());
        assert_eq!(stop, 2);
        let gaps: Vec<f64> = system.surfaces.iter().map(|s| s.thickness).collect();
        assert_eq!(gaps, [4.0, 1.5, 4.5, 10.0, 0.0]);
    }

    /// The entrance pupil of a stop behind a lens is where paraxial optics has it.
    #[test]
    fn the_pupil_of_a_stop_behind_a_lens_leads_back_to_it() {
        let mut system = planes();
        system.surfaces[0] = Surface {
            shape: crate::lens::Shape::Sphere { curvature: 0.02 },
            ..Surface::plane(3.0, 1.5)
        };
        system.surfaces[1] = Surface::plane(8.0, 1.0);
        // From a stop 2 mm behind the second surface, backwards: l = −2 · 1.5 − 3 in glass, then
        // 1/l' = 1.5/(−l) reversed through the first surface of power 0.01.
        let inside = 3.0 + 2.0 * 1.5;
        let pupil = 1.0 / (1.5 / inside - 0.01);
        let place = StopPlace::find(&system, pupil);
        assert_eq!(place.surface, 1);
        assert!((place.distance - 2.0).abs() < 1e-12, "{}", place.distance);
    }

    #[test]
    fn rims_leave_the_areas_that_are_asked_for_and_little_more() {
        let spec: LensSpecification = serde_json::from_str(
            r#"{"focal_length_mm": 60.0, "f_number": 5.0, "half_field_deg": 15.0, "max_elements": 4}"#,
        )
        .unwrap();
        let mut asked = LensRequirements::complete(&spec).unwrap().0;
        let axis = asked.clear_area[0];
        asked.clear_area.iter_mut().skip(1).for_each(|area| *area = 0.6 * axis);
        let mut tight = false;
        for start in library_starts(&asked, &[]).iter().take(8) {
            let Some(lens) = with_rims(&start.draft, &asked) else { continue };
            if !has_light(&lens, &asked) {
                continue;
            }
            let model = RayModel::from_lens(&lens, 0).unwrap();
            let area = |field: &crate::lens::FieldPoint| {
                let region = lit_region(&model, *field, model.primary).unwrap();
                region.trace_pupil(4).moments.area / axis
            };
            let areas: Vec<f64> = model.fields.iter().map(area).collect();
            assert!((1.0..1.1).contains(&areas[0]), "{}: {areas:?}", start.name);
            let least = areas[1..].iter().copied().fold(f64::INFINITY, f64::min);
            assert!(least >= 0.6, "{}: {areas:?}", start.name);
            // Not below the beam on the axis, which is more than enough in a slow and thin lens.
            tight = least < 0.66;
            if tight {
                break;
            }
        }
        assert!(tight, "no rim gives no more light than was asked for");
    }
}
