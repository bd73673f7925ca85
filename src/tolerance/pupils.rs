//! The pupils of a lens, which move with its errors.
//!
//! Rays are launched alike whatever the errors, and the rims of the lens let some of them through: an
//! error that moves a rim, or the beam where it meets one, moves the edge of the pupil. The edge of the
//! lens as designed is known from its search; in a lens that is made the same arcs are found anew.

use super::{Beam, ColourRays, FieldBeam, NominalLens, ToleranceScene};
use crate::lens::{FieldPoint, System};
use crate::pupil::{EdgeRay, FixedLaunch, RayModel, Region, RegionKind};
use crate::trace::ImagePoints;
use std::sync::Arc;

/// The treatment of pupils in lenses with errors.
#[derive(Debug, Clone)]
pub enum PupilTreatment {
    /// The rays of the lens as designed are held: the reason.
    Held(&'static str),
    /// The pupils are known, so that they can move.
    Known(Arc<ScenePupils>),
}

/// The pupils of a lens as designed.
#[derive(Debug, Clone)]
pub struct ScenePupils {
    model: RayModel,
    pub(super) fields: Vec<FieldPupils>,
}

/// The pupils of a field.
#[derive(Debug, Clone)]
pub(super) struct FieldPupils {
    point: FieldPoint,
    /// The number of the field among those of the prescription, counted from 0.
    pub(super) number: usize,
    /// The place of the field in the beam.
    pub(super) first: usize,
    /// True if the next field of the beam is the opposite one.
    has_opposite: bool,
    pub(super) colours: Vec<ColourPupil>,
}

/// The pupil of a field at one wavelength.
#[derive(Debug, Clone)]
pub(super) struct ColourPupil {
    pub(super) wavelength: usize,
    /// The weight of its rays in the field.
    pub(super) share: f64,
    launch: FixedLaunch,
    kind: RegionKind,
    /// The order of its quadrature.
    order: usize,
    /// Its area in mm², as that by which the edge's derivatives are given.
    pub(super) area: f64,
    /// The rays on its edge, each standing for its mirror image too in a symmetric pupil.
    pub(super) edge: Vec<EdgeRay>,
    /// True if it is its own mirror image, so that its order is that of half of it.
    is_half: bool,
    /// The numbers of rays by which it was found and is sampled.
    pub(super) rays: [usize; 2],
}

impl ColourPupil {
    /// The pupil of a region at an order of its quadrature; the reason why it cannot move, if so.
    pub(super) fn new(region: &Region<'_>, order: usize, share: f64) -> Result<Self, &'static str> {
        if !matches!(region.kind, RegionKind::StarShaped(_)) {
            return Err("a pupil is not one piece with one edge");
        }
        let traced = region.trace_whole_pupil(order);
        let edge = traced.edge_rays().unwrap_or_default();
        if edge.iter().any(|ray| !ray.limit.is_edge_of_aperture()) {
            return Err("a pupil ends at a critical angle or beside a surface");
        }
        Ok(Self {
            wavelength: region.launch.wavelength,
            share,
            launch: region.launch.to_fixed(),
            kind: region.kind.over_whole_turn(),
            order,
            area: traced.moments.area,
            is_half: region.launch.is_symmetric(),
            edge,
            rays: [traced.rays_traced - traced.rays.len(), traced.rays.len()],
        })
    }
}

impl FieldPupils {
    /// The pupils of the field of a prescription with a number, whose rays are those of the field of a
    /// beam with the number `first`.
    pub(super) fn new(
        (number, point): (usize, FieldPoint),
        (first, has_opposite): (usize, bool),
        colours: Vec<ColourPupil>,
    ) -> Self {
        Self { point, number, first, has_opposite, colours }
    }
}

impl ScenePupils {
    /// The pupils of a lens; the reason why they cannot move, if so.
    pub(super) fn new(model: RayModel, fields: Vec<FieldPupils>) -> Result<Self, &'static str> {
        let is_plain = |system: &System<f64>| !system.has_poses() && !system.has_grin();
        if !model.channels.iter().all(|channel| is_plain(&channel.system)) {
            return Err(
                "the lens has a GRIN medium, or is decentred, tilted or irregular by design",
            );
        }
        Ok(Self { model, fields })
    }

    /// The rays traced for a lens with errors: with its pupils found anew, and with those of the lens as
    /// designed.
    pub(super) fn rays_of_lens(&self) -> [usize; 2] {
        let mut sums = [0; 2];
        for field in &self.fields {
            let times = if field.has_opposite { 2 } else { 1 };
            for colour in &field.colours {
                sums[0] += times * (colour.rays[0] + 2 * colour.rays[1]);
                sums[1] += times * colour.rays[1];
            }
        }
        sums
    }

    /// The name of the limit of a surface, such as `rim of surface 4`.
    pub(super) fn limit_name(&self, ray: &EdgeRay) -> String {
        self.model.limit_name(crate::pupil::PupilLimit::Surface(ray.surface, ray.limit))
    }
}

/// Gives systems the rims of a lens.
pub(super) fn with_rims<R: crate::math::Real>(
    lens: &NominalLens,
    mut systems: Vec<System<R>>,
) -> Vec<System<R>> {
    for system in &mut systems {
        let rims = system.surfaces.iter_mut().zip(&lens.rims);
        for (surface, (rim, obstruction, apertures)) in rims {
            surface.semi_diameter = R::from_f64(*rim);
            surface.obstruction = R::from_f64(*obstruction);
            surface.apertures.clone_from(apertures);
        }
    }
    systems
}

/// Finds the pupils of lenses with errors.
pub(super) struct PupilFinder<'a> {
    scene: &'a ToleranceScene,
    model: &'a RayModel,
    /// For each field of the beam its colours: the rays, the form of the pupil as designed, the order of
    /// its quadrature, and the share of the colour.
    fields: Vec<Vec<TrackedPupil>>,
    /// The light of the lens as designed: the mean area of its pupils in mm².
    light: f64,
}

/// The pupil of a field of the beam at one wavelength.
struct TrackedPupil {
    wavelength: usize,
    share: f64,
    launch: FixedLaunch,
    kind: RegionKind,
    order: usize,
    /// True if the order is that of half of a symmetric pupil.
    was_half: bool,
}

impl<'a> PupilFinder<'a> {
    /// For the pupils of a scene; `None` if the opposite of a field has no rays.
    pub(super) fn new(scene: &'a ToleranceScene, pupils: &'a ScenePupils) -> Option<Self> {
        let mut fields = Vec::with_capacity(scene.beam.fields.len());
        let mut light = 0.0;
        for field in &pupils.fields {
            let own = |colour: &ColourPupil| TrackedPupil {
                wavelength: colour.wavelength,
                share: colour.share,
                launch: colour.launch,
                kind: colour.kind.clone(),
                order: colour.order,
                was_half: colour.is_half,
            };
            fields.push(field.colours.iter().map(own).collect());
            if field.has_opposite {
                let FieldPoint { x, y, weight } = field.point;
                let opposite = FieldPoint { x: -x, y: -y, weight };
                let there = |colour: &ColourPupil| {
                    let launch = pupils.model.launch(opposite, colour.wavelength).ok()?;
                    let region = Region::new(launch);
                    let launch = region.launch.to_fixed();
                    Some(TrackedPupil {
                        launch,
                        kind: region.kind.over_whole_turn(),
                        ..own(colour)
                    })
                };
                fields.push(field.colours.iter().map(there).collect::<Option<_>>()?);
            }
            let weight = |i: usize| scene.beam.fields.get(i).map_or(0.0, |own| own.weight);
            let weight = weight(field.first) * if field.has_opposite { 2.0 } else { 1.0 };
            light += weight * field.colours.iter().map(|c| c.share * c.area).sum::<f64>();
        }
        (fields.len() == scene.beam.fields.len()).then_some(Self {
            scene,
            model: &pupils.model,
            fields,
            light,
        })
    }

    /// The rays that the rims of a lens with errors let through, and the share of the light that these
    /// take; `None` if a field is dark. The rims of `systems` are those of the lens as designed.
    pub(super) fn beam(&self, systems: Vec<System<f64>>) -> Option<(Beam, f64)> {
        let systems = with_rims(&self.scene.lens, systems);
        let model = self.model.with_systems(&systems).ok()?;
        let (mut fields, mut light) = (Vec::with_capacity(self.fields.len()), 0.0);
        for (pupils, own) in self.fields.iter().zip(&self.scene.beam.fields) {
            let mut colours = Vec::with_capacity(pupils.len());
            for pupil in pupils {
                let (rays, area) = pupil.rays(&model)?;
                light += own.weight * pupil.share * area;
                colours.push(rays);
            }
            fields.push(FieldBeam { weight: own.weight, colours, chief: own.chief });
        }
        Some((Beam { fields }, 1.0 - light / self.light))
    }
}

impl TrackedPupil {
    /// The rays through a lens, and the area of the pupil in mm²; `None` without light.
    fn rays(&self, model: &RayModel) -> Option<(ColourRays, f64)> {
        let region = Region::track(&self.kind, self.launch.launch(model));
        let order = region.order_like(&self.kind, self.order);
        let nodes =
            if self.was_half { region.nodes_of_both_halves(order) } else { region.nodes(order) };
        let traced = region.trace::<ImagePoints<f64>>(&nodes);
        let total: f64 = traced.arrivals().map(|(_, weight)| weight).sum();
        if !(total > 0.0) {
            return None;
        }
        let mut colour = ColourRays::new(self.wavelength);
        let launched = nodes.points.iter().filter_map(|p| Some((*p, region.launch.ray(*p)?)));
        let launched: Vec<_> = launched.collect();
        for (i, weight) in traced.arrivals() {
            let (pupil, ray) = launched[i];
            let (weight, path) = (self.share * weight / total, region.launch.optical_path_to(ray));
            if nodes.mirrored {
                colour.push_both_sides(ray, weight, pupil, path);
            } else {
                colour.push(ray, weight, pupil, path);
            }
        }
        Some((colour, total * region.launch.area()))
    }
}
