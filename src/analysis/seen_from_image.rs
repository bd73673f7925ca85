//! The lens as seen from a point of its image: reversed, with that point as its object.
//!
//! Light that leaves the reversed lens comes from the scene, so its last surface is a sphere around
//! the front of the lens that takes up all of it, whatever its direction. The directions in which
//! light arrives at the point are the pupil of the reversed lens, with a boundary of its own.

use super::{AnalysisError, lit_region};
use crate::lens::{FieldKind, FieldPoint, Object, Shape, Surface, System, SystemError};
use crate::math::{SimdWidth, Vec3, run_vectorized};
use crate::paraxial::Beam;
use crate::pupil::{Aiming, Dual2, Nodes, RayModel, Region, RegionKind};
use crate::trace::{Landings, Ray, Rays, TraceSink as _, Tracer};
use std::borrow::Cow;
use std::f64::consts::PI;

/// The distance of the sphere around the reversed lens that takes up all its light, in lengths of the
/// lens.
const AROUND: f64 = 1e3;
/// A ray grazes the plane through the first vertex below this direction cosine along the axis.
const GRAZING: f64 = 0.05;

/// The lens as seen from a point of its image, as a model with that point as its only field.
pub(super) struct SeenFromImage {
    pub(super) model: RayModel,
    /// Two unit vectors tangential to the image surface at the point.
    tangents: [Vec3<f64>; 2],
    /// `n'²/n²`.
    pub(super) index_ratio: f64,
}

impl SeenFromImage {
    pub(super) fn new(
        model: &RayModel,
        wavelength: usize,
        point: [f64; 2],
    ) -> Result<Self, AnalysisError> {
        let limited = limited(model).map_err(|_error| AnalysisError::NoLight)?;
        let channel = &limited.channels[wavelength];
        let [x, y] = point;
        let (image, lens) = channel.system.surfaces.split_last().ok_or(AnalysisError::NoLight)?;
        let (sag, slope) = image.shape.sag(x * x + y * y).ok_or(AnalysisError::NoLight)?;
        let last = lens.last().ok_or(AnalysisError::NoLight)?;
        let turn = turn(&channel.system);
        let distance = -turn * (last.thickness + sag);
        let beam = Beam {
            object: Object::Finite(distance),
            aperture: limited.beam.aperture,
            field: FieldKind::ObjectHeight,
            edge: x.hypot(y),
        };
        let (system, _) = surrounded(&channel.system);
        let systems = || vec![(channel.um, 1.0, system.clone())];
        let field = FieldPoint { x, y, weight: 1.0 };
        let aimed = |aiming| {
            let model = RayModel::from_systems(systems(), 0, beam, aiming).ok()?;
            let model = RayModel { fields: vec![field], ..model };
            model.launch(field, 0).is_ok().then_some(model)
        };
        let model = aimed(Aiming::Chief).or_else(|| aimed(Aiming::Paraxial));
        let slopes = [x, y].map(|v| 2.0 * v * slope * turn);
        Ok(Self {
            model: model.ok_or(AnalysisError::NoLight)?,
            tangents: tangents(slopes),
            index_ratio: index_ratio(&channel.system),
        })
    }

    /// The area in cosines against the tangent plane; `None` if no ray gets through.
    pub(super) fn solid_angle(&self, region: &Region<'_>, nodes: &Nodes) -> Option<[f64; 1]> {
        self.light(region, nodes, |_, _| 1.0)
    }

    /// The same area, each part of it times the radiance of its ray: the function is told where the ray
    /// has left the lens, and that nodes mirror others.
    pub(super) fn light(
        &self,
        region: &Region<'_>,
        nodes: &Nodes,
        radiance: impl Fn(Ray<f64>, bool) -> f64,
    ) -> Option<[f64; 1]> {
        let launch = &region.launch;
        let (launched, landed) = launch.trace_points_into::<Landings<f64>>(&nodes.points);
        let (mut sum, mut lit) = (0.0, false);
        for (ray, node) in launched.iter().enumerate() {
            if !landed.fate(ray).is_imaged() {
                continue;
            }
            let seen = radiance(landed.ray(ray), nodes.mirrored);
            let Some(ray) = launch.dual_ray(nodes.points[*node]) else { continue };
            let along = |t: Vec3<f64>| ray.direction.dot(Vec3::<Dual2>::from_f64(t)).slope;
            let [u, v] = self.tangents.map(along);
            sum += nodes.weights[*node] * seen * (u[0] * v[1] - u[1] * v[0]).abs();
            lit = true;
        }
        lit.then_some([sum])
    }
}

/// The model limited by the rims of its surfaces alone, that of the stop among them.
pub(super) fn limited(model: &RayModel) -> Result<Cow<'_, RayModel>, SystemError> {
    if model.ends_at_disc() {
        model.limited_by_stop().map(Cow::Owned)
    } else {
        Ok(Cow::Borrowed(model))
    }
}

/// The direction of z in the reversed lens against that in the lens: −1, but 1 after an odd number of
/// mirrors.
fn turn(system: &System<f64>) -> f64 {
    -system.light_direction(system.surfaces.len().saturating_sub(2))
}

fn index_ratio(system: &System<f64>) -> f64 {
    let behind = system.index_before(system.surfaces.len() - 1);
    (behind / system.index_before).powi(2)
}

/// The reversed lens with a sphere around its front in place of the object, and the radius of that
/// sphere in mm: any light that leaves the lens comes from the scene.
pub(super) fn surrounded(system: &System<f64>) -> (System<f64>, f64) {
    let rims = system.surfaces.iter().map(|surface| surface.semi_diameter);
    let widest = rims.filter(|rim| rim.is_finite()).fold(1.0, f64::max);
    let radius = AROUND * (system.total_track() + widest);
    let mut reversed = system.reversed(radius);
    if let Some(last) = reversed.surfaces.last_mut() {
        let shape = Shape::Sphere { curvature: -1.0 / radius };
        *last = Surface { shape, hyperhemisphere: true, ..Surface::plane(0.0, last.index) };
    }
    (reversed, radius)
}

/// Two unit vectors at right angles in the tangent plane of a surface with these slopes.
fn tangents([p, q]: [f64; 2]) -> [Vec3<f64>; 2] {
    let unit = |v: Vec3<f64>| v * (1.0 / v.dot(v).sqrt());
    let first = unit(Vec3::new(1.0, 0.0, p));
    let rest = Vec3::new(0.0, 1.0, q);
    [first, unit(rest - first * rest.dot(first))]
}

/// The edge of the set of directions from which light arrives at the point `(0, y)` of the image at a
/// wavelength: the direction cosines along x and y of about `count` rays on it, in order around it, that
/// lead from the image to the scene. A square around the set if it is irregular.
///
/// # Errors
/// No light arrives at the point, or the edge is not known.
pub fn lit_outline(
    model: &RayModel,
    wavelength: usize,
    y: f64,
    count: usize,
) -> Result<Vec<[f64; 2]>, AnalysisError> {
    let seen = SeenFromImage::new(model, wavelength, [0.0, y])?;
    let region = lit_region(&seen.model, seen.model.fields[0], 0)?;
    let half = outline_half(&region, count.div_ceil(2).max(8));
    let mirrored = half.iter().rev().map(|[x, y]| [-x, *y]);
    let around: Vec<[f64; 2]> = half.iter().copied().chain(mirrored).collect();
    let cosines =
        |p: &[f64; 2]| region.launch.ray(*p).map(|ray| [ray.direction.x, ray.direction.y]);
    let edge: Vec<[f64; 2]> = around.iter().filter_map(cosines).collect();
    if edge.len() < 8 { Err(AnalysisError::IrregularPupil) } else { Ok(edge) }
}

/// Points on the edge of a pupil that is its own mirror image, from its top to its bottom, in pupil
/// coordinates.
fn outline_half(region: &Region<'_>, steps: usize) -> Vec<[f64; 2]> {
    if let RegionKind::Irregular { square: ([x, y], half), annulus: None, .. } = region.kind {
        let (right, top, bottom) = (x.abs() + half, y + half, y - half);
        let along = |t: f64| match t {
            t if t < 1.0 => [t * right, top],
            t if t < 2.0 => [right, top + (t - 1.0) * (bottom - top)],
            t => [(3.0 - t) * right, bottom],
        };
        return (0..=steps).map(|i| along(3.0 * i as f64 / steps as f64)).collect();
    }
    let part = |i: usize| i as f64 / steps as f64;
    let at = |i: usize| region.pupil_radius(PI * part(i)).map(|radius| radius.point(1.0));
    (0..=steps).filter_map(at).collect()
}

/// The error of a ray of a picture behind a gap with a GRIN medium, as a part of the length of the gap.
const PICTURE_GRIN: f64 = 1e-7;

/// A lens traced backwards at one wavelength, from points of its image to the rays of the scene that
/// arrive there.
#[derive(Debug, Clone)]
pub struct BackwardLens {
    tracer: Tracer<f64>,
    image: Surface<f64>,
    /// The distance from the last surface to the vertex of the image, in mm.
    back: f64,
    turn: f64,
    radius: f64,
    /// The irradiance of the image over the projected solid angle for a scene of radiance 1: `n'²/n²`.
    pub index_ratio: f64,
}

impl BackwardLens {
    /// The lens of a model at a wavelength, limited by its rims and its stop.
    ///
    /// # Errors
    /// Numbers that cannot be traced.
    pub fn new(model: &RayModel, wavelength: usize) -> Result<Self, SystemError> {
        Self::with_tracer(model, wavelength, Tracer::new)
    }

    /// The same for pictures: rays through GRIN media may be wrong by a ten-millionth of a gap, far less than a
    /// pixel, which takes a part of the steps.
    ///
    /// # Errors
    /// Numbers that cannot be traced.
    pub fn for_picture(model: &RayModel, wavelength: usize) -> Result<Self, SystemError> {
        let prepare = |system: &_| Tracer::with_grin_tolerance(system, PICTURE_GRIN);
        Self::with_tracer(model, wavelength, prepare)
    }

    fn with_tracer(
        model: &RayModel,
        wavelength: usize,
        prepare: impl Fn(&System<f64>) -> Result<Tracer<f64>, SystemError>,
    ) -> Result<Self, SystemError> {
        let limited = limited(model)?;
        let system = &limited.channels[wavelength].system;
        let [.., last, image] = &system.surfaces[..] else { return Err(SystemError::NoSurfaces) };
        let (reversed, radius) = surrounded(system);
        Ok(Self {
            tracer: prepare(&reversed)?,
            image: image.clone(),
            back: last.thickness,
            turn: turn(system),
            radius,
            index_ratio: index_ratio(system),
        })
    }

    /// The ray from a point of the image, x and y in mm, with these direction cosines along x and y,
    /// and the share of its solid angle in direction cosines that counts for the irradiance: 1 on a
    /// plane image, the cosines against the normal of the image over that against the axis on a
    /// curved one. `None` where the image surface or the direction does not exist.
    pub fn ray(&self, [x, y]: [f64; 2], [l, m]: [f64; 2]) -> Option<(Ray<f64>, f64)> {
        let (sag, slope) = self.image.shape.sag(x * x + y * y)?;
        let square = 1.0 - l * l - m * m;
        if !(square > 0.0) {
            return None;
        }
        let n = square.sqrt();
        let point = Vec3::new(x, y, self.turn * (self.back + sag));
        let [p, q] = [x, y].map(|v| 2.0 * v * slope * self.turn);
        let share = ((n - l * p - m * q) / (n * (1.0 + p * p + q * q).sqrt())).max(0.0);
        Some((Ray { point, direction: Vec3::new(l, m, n) }, share))
    }

    /// Traces rays backwards.
    pub fn trace(&self, rays: &Rays<f64>, landings: &mut Landings<f64>) {
        self.tracer.trace_batch(rays, landings);
    }

    /// The rays of the scene whose light traced rays follow, as [`BackwardLens::scene_ray`]; those of lost
    /// rays have no direction.
    pub fn scene_rays(&self, landed: &Landings<f64>, rays: &mut Rays<f64>) {
        let count = landed.x.len();
        let Rays { x, y, z, l, m, n } = rays;
        [&mut *x, y, z, l, m, n].into_iter().for_each(|column| column.resize(count, 0.0));
        let (x, y, z) = (&mut x[..count], &mut y[..count], &mut z[..count]);
        let (l, m, n) = (&mut l[..count], &mut m[..count], &mut n[..count]);
        let [px, py, pz] = [&landed.x[..count], &landed.y[..count], &landed.z[..count]];
        let [dx, dy, dz] = [&landed.l[..count], &landed.m[..count], &landed.n[..count]];
        run_vectorized(
            SimdWidth::detect(),
            #[inline(always)]
            || {
                for i in 0..count {
                    let point = Vec3::new(px[i], py[i], pz[i]);
                    let direction = Vec3::new(dx[i], dy[i], dz[i]);
                    let found = self.scene_ray(Ray { point, direction });
                    (x[i], y[i], z[i]) = (found.point.x, found.point.y, found.point.z);
                    let d = found.direction;
                    (l[i], m[i], n[i]) = (d.x, d.y, d.z);
                }
            },
        );
    }

    /// A traced ray in the frame of the first vertex of the lens, where its optical path ends; its direction
    /// leads away from the lens.
    pub(crate) fn exit(&self, landed: Ray<f64>) -> Ray<f64> {
        let Ray { point: p, direction: d } = landed;
        Ray {
            point: Vec3::new(p.x, p.y, self.turn * (p.z + self.radius)),
            direction: Vec3::new(d.x, d.y, self.turn * d.z),
        }
    }

    /// The ray of the scene whose light a traced ray follows, in the frame of the first vertex of the
    /// lens; its direction leads away from the lens. It starts in the plane through that vertex, or
    /// closest to the vertex if it grazes that plane.
    #[inline(always)]
    pub fn scene_ray(&self, landed: Ray<f64>) -> Ray<f64> {
        let Ray { point: p, direction: d } = landed;
        let point = Vec3::new(p.x, p.y, self.turn * (p.z + self.radius));
        let direction = Vec3::new(d.x, d.y, self.turn * d.z);
        let beyond =
            if direction.z.abs() > GRAZING { point.z / direction.z } else { point.dot(direction) };
        Ray { point: point - direction * beyond, direction }
    }
}
