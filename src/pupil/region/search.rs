//! The search for the region of a pupil.
//!
//! Sixteen rays at the rim decide whether anything clips. If so, a coarse grid of rays shows the
//! position of the light, the number of its pieces, and whether it is star-shaped about a point;
//! then the edge is searched for from there.

use super::dark_points::DarkPoints;
use super::edge_search::margin_minima;
use super::kind::{Region, RegionKind};
use super::light_grid::LightGrid;
use crate::lens::SurfaceAperture;
use crate::pupil::launch::Launch;
use std::f64::consts::{PI, TAU};

/// The number of rays at the rim that decide whether a pupil is clear.
const RIM_RAYS: usize = 16;
/// The number of points of the rim that blocked points of surfaces are compared with.
const RIM_CURVE: usize = 256;
/// The points between the middle of an aperture and each of its ends at which light is looked for.
const FRAME_STEPS: usize = 16;
/// The part of a step that the last point stays away from the end, so that rounding does not block it.
const ROUNDED: f64 = 1e-6;

impl<'a> Region<'a> {
    /// The region of a launch, searched for unless the model remembers it.
    pub fn new(launch: Launch<'a>) -> Self {
        let search = || search(&launch);
        let own = launch.found_pupils();
        let (kind, rays) = own.map_or_else(search, |own| own.region(&launch.to_fixed(), search));
        Self { launch, kind, rays }
    }
}

impl<'a> Region<'a> {
    /// The region of a launch whose light is looked for by `light` in place of a search of the whole plane.
    pub(super) fn around(
        launch: Launch<'a>,
        light: impl FnOnce(&Launch<'_>, &mut usize) -> Option<LightGrid>,
    ) -> Self {
        let (kind, rays) = search_around(&launch, light);
        Self { launch, kind, rays }
    }
}

/// Searches for the region of a launch.
fn search(launch: &Launch<'_>) -> (RegionKind, usize) {
    search_around(launch, LightGrid::around_light)
}

fn search_around(
    launch: &Launch<'_>,
    light: impl FnOnce(&Launch<'_>, &mut usize) -> Option<LightGrid>,
) -> (RegionKind, usize) {
    let mut rays = 0;
    if launch.model.stop_radius() == 0.0 {
        return (RegionKind::Dark, rays);
    }
    let shadows = launch.obstruction_centers();
    if launch.model.ends_at_disc() && launch.is_clear(&shadows, &mut rays) {
        return (RegionKind::Clear, rays);
    }
    let Some(grid) = light(launch, &mut rays) else {
        return (RegionKind::Dark, rays);
    };
    let kind = grid.classify(launch, &shadows);
    rays += match &kind {
        RegionKind::StarShaped(boundary) => boundary.rays,
        RegionKind::Irregular { annulus: Some(annulus), .. } => annulus.rays(),
        _ => 0,
    };
    (kind, rays)
}

/// The pupil point at an azimuth of the rim.
fn rim_point(azimuth: f64) -> [f64; 2] {
    azimuth.sin_cos().into()
}

/// The point of the unit disc nearest to another one.
fn nearest_in_disc([x, y]: [f64; 2]) -> [f64; 2] {
    let outside = x.hypot(y).max(1.0);
    [x / outside, y / outside]
}

impl Launch<'_> {
    /// The centre of the shadow of every obstruction and obscuration, inside the pupil or not: the pupil
    /// point of the ray through its middle. `None` for an obstruction that was not found.
    fn obstruction_centers(&self) -> Vec<Option<[f64; 2]>> {
        let surfaces = || self.channel().system.surfaces.iter().enumerate();
        let obstructed = surfaces().filter(|(_, surface)| surface.obstruction > 0.0);
        let circles = obstructed.map(|(i, _)| self.through_point(i, [0.0; 2]));
        let apertures = surfaces().flat_map(|(i, surface)| {
            let own = surface.apertures.iter();
            own.filter(|own| own.obscures()).map(move |own| (i, own.middle()))
        });
        let middles = apertures.filter_map(|(i, middle)| self.through_point(i, middle));
        // The middle of a aperture may lie outside of it.
        circles.chain(middles.filter(|p| !self.transmits(*p)).map(Some)).collect()
    }

    /// The pupil points of the rays through the centres of all apertures that are no circles about a vertex.
    pub(super) fn frame_centers(&self) -> Vec<[f64; 2]> {
        let centers = self.frames().map(|(i, frame)| (i, frame.middle()));
        centers.filter_map(|(i, middle)| self.through_point(i, middle)).collect()
    }

    /// The pupil points of rays through points of these apertures, from the middle to the ends of each.
    pub(super) fn frame_points(&self) -> Vec<[f64; 2]> {
        let along = |(i, frame): (usize, &SurfaceAperture)| {
            let middle = frame.middle();
            let ends = frame.ends();
            let part = |k: usize| (k as f64 - ROUNDED) / FRAME_STEPS as f64;
            let parts = move |end: [f64; 2]| {
                let at = move |t: f64| [0, 1].map(|k| middle[k] + t * (end[k] - middle[k]));
                (1..=FRAME_STEPS).map(move |k| at(part(k)))
            };
            let points: Vec<_> = ends.into_iter().flat_map(parts).collect();
            points.into_iter().filter_map(move |p| self.through_point(i, p)).collect::<Vec<_>>()
        };
        self.frames().flat_map(along).collect()
    }

    /// The apertures of the lens that are no circles about a vertex and let light through inside.
    fn frames(&self) -> impl Iterator<Item = (usize, &SurfaceAperture)> {
        let surfaces = self.channel().system.surfaces.iter().enumerate();
        surfaces.flat_map(|(i, surface)| {
            surface.apertures.iter().filter(|own| !own.obscures()).map(move |own| (i, own))
        })
    }

    /// True if the whole disc gets through, judged by the margins of rays at its rim, at the minima
    /// of margins in between, and by the ray nearest to the centre of each shadow, which may be too
    /// small for all of them.
    fn is_clear(&self, shadows: &[Option<[f64; 2]>], rays: &mut usize) -> bool {
        let half = self.is_symmetric();
        let step = if half { PI / (RIM_RAYS - 1) as f64 } else { TAU / RIM_RAYS as f64 };
        let mut margins = Vec::with_capacity(RIM_RAYS);
        for i in 0..RIM_RAYS {
            *rays += 1;
            let Some(found) = self.margins_if_passing(rim_point(step * i as f64)) else {
                return false;
            };
            margins.push(found);
        }
        *rays += 1;
        let mut margins_at = |p: [f64; 2]| {
            *rays += 1;
            self.margins_if_passing(p)
        };
        let passes_dips = margin_minima(&margins, half).into_iter().all(|dip| {
            let margin = |place: f64| margins_at(rim_point(step * place))?.get(dip.margin).copied();
            let place = dip.lowest(margin);
            margins_at(rim_point(step * place)).is_some()
        });
        let passes = |p: [f64; 2]| self.margins_if_passing(p).is_some();
        *rays += shadows.len();
        let dark = DarkPoints::of(&self.channel().system);
        let rim = || -> Vec<[f64; 2]> {
            (0..RIM_CURVE).map(|i| rim_point(TAU * i as f64 / RIM_CURVE as f64)).collect()
        };
        passes([0.0, 0.0])
            && passes_dips
            && (dark.is_empty() || !dark.are_lit(self, &rim(), None))
            && shadows.iter().all(|shadow| shadow.is_some_and(|p| passes(nearest_in_disc(p))))
    }
}
