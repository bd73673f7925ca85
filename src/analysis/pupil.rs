//! The pupil: which rays of a field get through, what ends them, and how much light that is.
//!
//! Everything is in mm in the plane through the first vertex, or across the beam where the field is
//! wide, so that pupils of several fields can be laid over each other.

use super::Estimate;
use crate::lens::FieldPoint;
use crate::pupil::{
    Accuracy, Launch, LaunchError, PupilOutline, PupilPattern, RayModel, Region, RegionKind,
    pattern_points,
};
use crate::trace::{Fate, ImagePoints, Rays, TraceSink};

/// The pupil of a field at a wavelength.
#[derive(Debug, Clone, PartialEq)]
pub struct FieldPupil {
    /// The field.
    pub field: FieldPoint,
    /// What it looks like.
    pub shape: PupilShape,
    /// How much gets through; `None` where nothing does or no beam is defined.
    pub extent: Option<PupilExtent>,
    /// The rim of the unit disc of the pupil coordinates: what would get through if the ideal
    /// entrance pupil alone limited the beam. Closed, in mm; empty where no ray can be started.
    pub disc: Vec<[f64; 2]>,
    /// Whether mm are counted across the beam instead of in the plane through the first vertex.
    pub across_beam: bool,
    /// Rays traced for all of it.
    pub rays: usize,
}

/// The light that gets through.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PupilExtent {
    /// The area that it covers, in mm².
    pub area: Estimate,
    /// The centroid of that area, in mm.
    pub centroid: [Estimate; 2],
}

/// What a pupil looks like.
#[derive(Debug, Clone, PartialEq)]
pub enum PupilShape {
    /// One piece with its edge.
    Outlined(PupilOutline),
    /// Several pieces, or one whose edge cannot be followed: a grid of the rays that get through.
    Irregular {
        /// How many separate pieces were seen.
        pieces: usize,
        /// Where those rays are, in mm.
        dots: Vec<[f64; 2]>,
    },
    /// Nothing gets through.
    Dark(RayLoss),
    /// Nothing limits the beam.
    Unbounded,
    /// No ray could be started.
    NoRays(LaunchError),
}

/// What ends the rays of a dark field.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct RayLoss {
    /// How most rays of a pattern over the unit disc end; `None` where none could be started.
    pub main_fate: Option<Fate>,
    /// How many of them end that way.
    pub count: usize,
    /// How many there are.
    pub rays: usize,
    /// Whether the chief ray is among them.
    pub includes_chief: bool,
}

/// How many points an outline has, about.
const POINTS: usize = 128;
/// Cells along a side of the grid that shows a ragged pupil.
const CELLS: usize = 45;
/// Rings of the pattern that tells where the rays of a dark field end.
const RINGS: usize = 6;

/// No sum over rays is more exact than this, relatively.
const ROUNDING: f64 = 4.0 * f64::EPSILON;

/// The pupil of a field at a wavelength; the area is as exact as asked for.
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

/// What a region looks like, and the rays that it took to see it.
fn describe_shape(region: &Region<'_>) -> (PupilShape, usize) {
    match &region.kind {
        RegionKind::Clear | RegionKind::StarShaped(_) => match region.outline(POINTS) {
            Some(outline) => {
                let rays = outline.rays;
                (PupilShape::Outlined(outline), rays)
            }
            // The edge is followed ray by ray, and one of them was not found.
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

/// How the rays at some pupil points end; points where none starts are left out.
fn trace_fates(launch: &Launch<'_>, points: &[[f64; 2]]) -> Vec<([f64; 2], Fate)> {
    let started: Vec<_> = points.iter().filter_map(|p| Some((*p, launch.ray(*p)?))).collect();
    let rays: Rays<f64> = started.iter().map(|(_, ray)| *ray).collect();
    let mut landed = ImagePoints::default();
    launch.channel().tracer.trace_batch(&rays, &mut landed);
    started.iter().enumerate().map(|(i, (p, _))| (*p, landed.fate(i))).collect()
}

impl FieldPupil {
    /// Its area over that of another, with its error: the share of the light that is left where
    /// the other is the pupil on the axis. `None` where that one is dark.
    pub fn share_of(&self, whole: Estimate) -> Option<Estimate> {
        let area = self.extent.map_or(Estimate::new(0.0, 0.0, self.rays), |light| light.area);
        let share = area.value / whole.value;
        let error = (area.error + share * whole.error) / whole.value;
        (whole.value > 0.0).then(|| Estimate::new(share, error, area.rays + whole.rays))
    }
}
