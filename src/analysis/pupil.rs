//! The pupil of a field: its outline, the limits that make it, and its area.
//!
//! Lengths are in mm in the plane through the first vertex, or, if the field of view is wide,
//! perpendicular to the beam, so that pupils of several fields can be compared in one drawing.

use super::Estimate;
use crate::lens::FieldPoint;
use crate::pupil::{
    Accuracy, Launch, LaunchError, PupilOutline, PupilPattern, RayModel, Region, RegionKind,
    pattern_points,
};
use crate::trace::{Fate, TraceSink};

/// The pupil of a field at a wavelength.
#[derive(Debug, Clone, PartialEq)]
pub struct FieldPupil {
    /// The field.
    pub field: FieldPoint,
    /// The shape.
    pub shape: PupilShape,
    /// The area and centroid; `None` if nothing gets through or no beam is defined.
    pub extent: Option<PupilExtent>,
    /// The rim of the unit disc of the pupil coordinates: the pupil if the ideal entrance pupil
    /// alone limited the beam. A closed curve, in mm; empty if no ray can be launched.
    pub disc: Vec<[f64; 2]>,
    /// True if lengths are perpendicular to the beam and not in the plane through the first vertex.
    pub across_beam: bool,
    /// The number of rays traced for all of it.
    pub rays: usize,
}

/// The area and the centroid of the light that gets through.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PupilExtent {
    /// The area, in mm².
    pub area: Estimate,
    /// The x and y of the centroid, in mm.
    pub centroid: [Estimate; 2],
}

/// The shape of a pupil.
#[derive(Debug, Clone, PartialEq)]
pub enum PupilShape {
    /// One piece with its outline.
    Outlined(PupilOutline),
    /// Several pieces, or one without a known outline: a grid of the rays that get through.
    Irregular {
        /// The number of separate pieces found.
        pieces: usize,
        /// The positions of those rays, in mm.
        dots: Vec<[f64; 2]>,
    },
    /// Nothing gets through.
    Dark(RayLoss),
    /// Nothing limits the beam.
    Unbounded,
    /// No ray could be launched.
    NoRays(LaunchError),
}

/// The loss of the rays of a dark field.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct RayLoss {
    /// The fate of most rays of a pattern over the unit disc; `None` if none could be launched.
    pub main_fate: Option<Fate>,
    /// The number of rays with that fate.
    pub count: usize,
    /// The number of rays of the pattern.
    pub rays: usize,
    /// True if the chief ray has that fate.
    pub includes_chief: bool,
}

/// The approximate number of points of an outline.
const POINTS: usize = 128;
/// The number of cells along a side of the grid that shows an irregular pupil.
const CELLS: usize = 45;
/// The rings of the pattern that shows the fates of the rays of a dark field.
const RINGS: usize = 6;

/// The relative rounding error of a sum over rays.
const ROUNDING: f64 = 4.0 * f64::EPSILON;

/// The pupil of a field at a wavelength, its area to the given accuracy.
pub fn pupil(
    model: &RayModel,
    field: FieldPoint,
    wavelength: usize,
    accuracy: Accuracy,
) -> FieldPupil {
    match model.launch(field, wavelength) {
        Ok(launch) => from_region(&Region::new(launch), accuracy),
        Err(why) => FieldPupil {
            field,
            shape: PupilShape::NoRays(why),
            extent: None,
            disc: Vec::new(),
            across_beam: false,
            rays: 0,
        },
    }
}

fn from_region(region: &Region<'_>, accuracy: Accuracy) -> FieldPupil {
    let extent = region.extent(accuracy);
    let (form, drawn) = describe_shape(region);
    let light = extent.map(|found| {
        let size = [found.values[0], found.values[0].sqrt(), found.values[0].sqrt()];
        let number = |i: usize| {
            let rounding = ROUNDING * size[i];
            Estimate::new(found.values[i], found.errors[i].max(rounding), found.rays)
        };
        PupilExtent { area: number(0), centroid: [number(1), number(2)] }
    });
    let searched = extent.map_or(region.rays, |found| found.rays);
    let launch = &region.launch;
    FieldPupil {
        field: launch.field,
        shape: form,
        extent: light,
        disc: launch.rim(POINTS / 2),
        across_beam: launch.is_across_beam(),
        rays: searched + drawn,
    }
}

/// The shape of a region, and the number of rays traced to find it.
fn describe_shape(region: &Region<'_>) -> (PupilShape, usize) {
    match &region.kind {
        RegionKind::Clear | RegionKind::StarShaped(_) => match region.outline(POINTS) {
            Some(outline) => {
                let rays = outline.rays;
                (PupilShape::Outlined(outline), rays)
            }
            // The outline is traced ray by ray, and one of them was not found.
            None => irregular_shape(region, 1, ([0.0; 2], 1.0)),
        },
        RegionKind::Irregular { pieces, square, .. } => irregular_shape(region, *pieces, *square),
        RegionKind::Dark => {
            let loss = ray_loss(&region.launch);
            (PupilShape::Dark(loss), loss.rays)
        }
        RegionKind::Unbounded => (PupilShape::Unbounded, 0),
    }
}

fn irregular_shape(
    region: &Region<'_>,
    pieces: usize,
    (center, half): ([f64; 2], f64),
) -> (PupilShape, usize) {
    let launch = &region.launch;
    let step = 2.0 / CELLS as f64;
    let at = |i: usize| half * (step * (i as f64 + 0.5) - 1.0);
    let place = |i: usize| [center[0] + at(i % CELLS), center[1] + at(i / CELLS)];
    let inside = |p: &[f64; 2]| !launch.model.ends_at_disc() || p[0].hypot(p[1]) <= 1.0;
    let points: Vec<_> = (0..CELLS * CELLS).map(place).filter(inside).collect();
    let ends = trace_fates(launch, &points);
    let lit = ends.iter().filter(|(_, fate)| fate.is_imaged());
    let dots = lit.filter_map(|(p, _)| launch.crossing(*p)).collect();
    (PupilShape::Irregular { pieces, dots }, points.len())
}

fn ray_loss(launch: &Launch<'_>) -> RayLoss {
    let ends = trace_fates(launch, &pattern_points(PupilPattern::Hexapolar(RINGS)));
    let count = |fate: Fate| ends.iter().filter(|(_, other)| *other == fate).count();
    let lost = ends.iter().map(|(_, fate)| *fate).filter(|fate| !fate.is_imaged());
    let most = lost.max_by_key(|fate| (count(*fate), *fate));
    let chief = ends.iter().find(|(p, _)| *p == [0.0; 2]).map(|(_, fate)| *fate);
    RayLoss {
        main_fate: most,
        count: most.map_or(0, count),
        rays: ends.len(),
        includes_chief: chief.is_some() && chief == most,
    }
}

/// The fates of the rays at some pupil points, without the points from which none can be launched.
fn trace_fates(launch: &Launch<'_>, points: &[[f64; 2]]) -> Vec<([f64; 2], Fate)> {
    let (launched, landed) = launch.trace_points(points);
    launched.iter().enumerate().map(|(ray, i)| (points[*i], landed.fate(ray))).collect()
}

impl FieldPupil {
    /// The ratio of its area to that of another pupil, with its error: the vignetting if the other
    /// is the pupil on the axis. `None` if that one is dark.
    pub fn share_of(&self, whole: Estimate) -> Option<Estimate> {
        let area = self.extent.map_or(Estimate::new(0.0, 0.0, self.rays), |light| light.area);
        let share = area.value / whole.value;
        let error = (area.error + share * whole.error) / whole.value;
        (whole.value > 0.0).then(|| Estimate::new(share, error, area.rays + whole.rays))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_share_of_a_pupil_has_the_errors_of_both_areas() {
        let area = |value: f64, error: f64| Estimate::new(value, error, 10);
        let extent = PupilExtent { area: area(3.0, 0.3), centroid: [area(0.0, 0.0); 2] };
        let pupil = FieldPupil {
            field: FieldPoint { x: 0.0, y: 0.0, weight: 1.0 },
            shape: PupilShape::Unbounded,
            extent: Some(extent),
            disc: Vec::new(),
            across_beam: false,
            rays: 10,
        };
        let share = pupil.share_of(area(4.0, 0.1)).unwrap();
        assert_eq!((share.value, share.rays), (0.75, 20));
        assert!((share.error - (0.3 + 0.75 * 0.1) / 4.0).abs() < 1e-15);
        assert!(pupil.share_of(area(0.0, 0.0)).is_none());
    }
}
