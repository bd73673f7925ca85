//! What each effect does to the rays of a lens, measured.
//!
//! A few dozen rays of every field and wavelength are enough: what is measured is how far rays
//! move and how near they come to a rim, both smooth over the pupil. The root mean square of a
//! displacement bounds what it does to the RMS radius of a spot, by the triangle inequality.

use super::apply::{collimate_fields, reduce_to_conic};
use crate::lens::{FieldPoint, Lens, Object, Shape, System};
use crate::math::Vec3;
use crate::paraxial::Beam;
use crate::pupil::{Aiming, Launch, PupilPattern, RayModel, RayModelError, pattern_points};
use crate::trace::{Fate, Fates, GrinStepPlan, Ray, Tracer};
use rayon::prelude::*;
use std::f64::consts::TAU;

/// What was measured of a lens at one zoom position.
#[derive(Debug, Clone, PartialEq)]
pub struct EffectMeasurements {
    /// How many wavelengths it has.
    pub wavelengths: usize,
    /// How many surfaces a ray crosses.
    pub surfaces: usize,
    /// From the first vertex to the image, in mm.
    pub length: f64,
    /// The smallest RMS radius of any field that has light, in mm.
    pub smallest_spot: f64,
    /// How far the colours lie from the primary one, root mean square over rays, in mm: of the
    /// field where that is most.
    pub dispersion: f64,
    /// The figured surfaces, and how far rays move without the figuring of each, in mm.
    pub aspheres: Vec<(usize, f64)>,
    /// Every rim that is written, and how near rays come to it.
    pub rims: Vec<RimClearance>,
    /// How the surveyed rays ended.
    pub fates: Fates,
    /// Surfaces at which the index falls, where alone total reflection is possible.
    pub index_drops: Vec<usize>,
    /// The smallest distance of any ray from total reflection, in degrees of the refracted ray
    /// from grazing; `None` where no index falls.
    pub critical_angle: Option<f64>,
    /// By how many stop radii the paraxial chief ray of the farthest field misses the centre of the
    /// stop; `None` where it does not get there.
    pub chief_ray_miss: Option<f64>,
    /// The distance of a finite object, and how far rays move if it is taken to be at infinity, in
    /// mm.
    pub finite_object: Option<(f64, f64)>,
    /// The gaps with a gradient, the steps in each, and how far rays move if it is left out, in mm.
    pub grin_gaps: Vec<(GrinStepPlan, f64)>,
}

/// How near rays come to a rim.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct RimClearance {
    /// The surface.
    pub surface: usize,
    /// Its semi-diameter, in mm; infinite for a surface that has an obstruction alone.
    pub semi_diameter: f64,
    /// How far from the axis rays meet it that nothing else stops, in mm.
    pub ray_height: f64,
    /// Whether the surface is figured: its iteration needs the rim to know where to look.
    pub aspheric: bool,
    /// Whether the surface has an obstruction as well, with or without a rim.
    pub obstructed: bool,
}

/// Rays inside the pupil in rings that stand for equal areas, and rays on its rim.
const RINGS: usize = 3;
const ON_RIM: usize = 24;
/// Where no disc limits the beam, rays up to so many times the paraxial pupil are tried.
const REACH: f64 = 1.6;

/// Measures a lens at a zoom position.
///
/// # Errors
/// A lens or aperture through which nothing can be traced.
pub fn measure_effects(lens: &Lens, zoom: usize) -> Result<EffectMeasurements, RayModelError> {
    let mut bench = RayModel::with_aiming(lens, zoom, Aiming::Paraxial)?;
    let miss = bench.stop_miss();
    if miss.is_none_or(|miss| miss > super::AIMING) {
        bench.aiming = Aiming::Chief;
    }
    let system = &bench.channels[bench.primary].system;
    let sights: Vec<SampledBundle> = bench
        .fields
        .par_iter()
        .flat_map_iter(|field| SampledBundle::of_field(&bench, *field))
        .collect();
    Ok(EffectMeasurements {
        wavelengths: bench.channels.len(),
        surfaces: system.surfaces.len(),
        length: system.total_track(),
        smallest_spot: smallest_spot(&bench, &sights),
        dispersion: dispersion(&bench, &sights),
        aspheres: aspheres(&bench, &sights)?,
        rims: rims(&bench)?,
        fates: sights.iter().fold(Fates::default(), |sum, sight| add_fates(sum, sight.fates)),
        index_drops: index_drops(system),
        critical_angle: sights.iter().filter_map(|sight| sight.grazing).reduce(f64::min),
        chief_ray_miss: miss,
        finite_object: object(lens, zoom, &bench, &sights),
        grin_gaps: grin_gaps(&bench, &sights)?,
    })
}

fn add_fates(a: Fates, b: Fates) -> Fates {
    Fates {
        imaged: a.imaged + b.imaged,
        missed: a.missed + b.missed,
        clipped: a.clipped + b.clipped,
        total_reflection: a.total_reflection + b.total_reflection,
        turned: a.turned + b.turned,
        trapped: a.trapped + b.trapped,
    }
}

/// The points of the pupil that are looked at; those inside come first.
fn sample_points(bench: &RayModel) -> Vec<[f64; 2]> {
    let reach = if bench.ends_at_disc() { 1.0 } else { REACH };
    let rim = (0..ON_RIM).map(|i| (TAU * i as f64 / ON_RIM as f64).sin_cos().into());
    let inside = pattern_points(PupilPattern::HexapolarInside(RINGS)).into_iter();
    inside.map(|p| p.map(|v| v * reach)).chain(rim).collect()
}

/// The surveyed rays of one field at one wavelength.
struct SampledBundle {
    field: FieldPoint,
    wavelength: usize,
    rays: Vec<Option<Ray<f64>>>,
    /// Where they land; `None` for a ray that is lost.
    landed: Vec<Option<Vec3<f64>>>,
    fates: Fates,
    /// The smallest angle between a ray and a surface that it leaves where the index falls, in
    /// degrees; 0 for one that is totally reflected.
    grazing: Option<f64>,
}

impl SampledBundle {
    /// The rays of a field at all wavelengths; a field without rays is dark and has none.
    fn of_field(bench: &RayModel, field: FieldPoint) -> Vec<Self> {
        let places = sample_points(bench);
        let launches = (0..bench.channels.len()).filter_map(|w| bench.launch(field, w).ok());
        launches.map(|launch| Self::new(&launch, &places)).collect()
    }

    fn new(launch: &Launch<'_>, places: &[[f64; 2]]) -> Self {
        let mut sight = Self {
            field: launch.field,
            wavelength: launch.wavelength,
            rays: places.iter().map(|p| launch.ray(*p)).collect(),
            landed: Vec::with_capacity(places.len()),
            fates: Fates::default(),
            grazing: None,
        };
        let color = launch.channel();
        let falls = index_drops(&color.system);
        let mut points = Vec::with_capacity(color.system.surfaces.len());
        for ray in &sight.rays {
            points.clear();
            let landing = ray.map(|ray| color.tracer.visit(ray, |i, p| points.push((i, p))));
            let imaged = landing.filter(|landing| landing.fate.is_imaged());
            sight.landed.push(imaged.map(|landing| landing.ray.point));
            let Some(landing) = landing else { continue };
            sight.fates.count(landing.fate);
            let reflected = matches!(landing.fate, Fate::TotalReflection(_)).then_some(0.0);
            let leaving = exit_angles(&color.system, &points).filter(|(i, _)| falls.contains(i));
            let angles = leaving.map(|(_, angle)| angle).chain(reflected);
            sight.grazing = angles.chain(sight.grazing).reduce(f64::min);
        }
        sight
    }

    /// Where the rays inside the pupil land.
    fn inside(&self) -> impl Iterator<Item = &Vec3<f64>> {
        self.landed[..self.landed.len() - ON_RIM].iter().flatten()
    }

    /// The root mean square distance of the rays from where they land otherwise, both from the
    /// axis; infinite where a ray gets lost.
    fn rms_shift(&self, otherwise: impl Fn(usize, Ray<f64>) -> Option<Vec3<f64>>) -> f64 {
        let (mut sum, mut count) = (0.0, 0);
        for (i, (ray, landed)) in self.rays.iter().zip(&self.landed).enumerate() {
            let (Some(ray), Some(here)) = (ray, landed) else { continue };
            let there = otherwise(i, *ray);
            sum += there.map_or(f64::INFINITY, |t| (t.x - here.x).powi(2) + (t.y - here.y).powi(2));
            count += 1;
        }
        if count == 0 { 0.0 } else { (sum / f64::from(count)).sqrt() }
    }
}

/// Fewer rays than this say nothing about the size of a spot.
const FEW: usize = 8;

/// The smallest RMS radius of a field, all colours together.
fn smallest_spot(bench: &RayModel, sights: &[SampledBundle]) -> f64 {
    let spot = |field: &FieldPoint| {
        let of_field = || sights.iter().filter(|sight| sight.field == *field);
        let points: Vec<_> = of_field().flat_map(SampledBundle::inside).collect();
        let share = 1.0 / points.len() as f64;
        let mean = points.iter().fold(Vec3::default(), |sum, p| sum + **p) * share;
        let off = |p: &&Vec3<f64>| (p.x - mean.x).powi(2) + (p.y - mean.y).powi(2);
        let square = points.iter().map(off).sum::<f64>() * share;
        (points.len() >= FEW).then(|| square.sqrt())
    };
    bench.fields.iter().filter_map(spot).fold(f64::INFINITY, f64::min)
}

/// `√(Σ share |p_λ − p|²)` over the rays that arrive in both colours, of the worst field.
fn dispersion(bench: &RayModel, sights: &[SampledBundle]) -> f64 {
    let weights: f64 = bench.channels.iter().map(|color| color.weight).sum();
    let worst = |field: &FieldPoint| -> f64 {
        let of_field = |sight: &&SampledBundle| sight.field == *field;
        let primary = sights.iter().filter(of_field).find(|s| s.wavelength == bench.primary);
        let square = |sight: &SampledBundle| {
            let share = bench.channels[sight.wavelength].weight / weights;
            let there = |i: usize, _| primary.and_then(|p| p.landed[i]).or(sight.landed[i]);
            share * sight.rms_shift(there).powi(2)
        };
        sights.iter().filter(of_field).map(square).sum::<f64>().sqrt()
    };
    bench.fields.iter().map(worst).fold(0.0, f64::max)
}

/// The largest way that rays at the primary wavelength move in another system.
fn largest_shift(
    bench: &RayModel,
    sights: &[SampledBundle],
    other: &System<f64>,
) -> Result<f64, RayModelError> {
    let tracer = Tracer::new(other)?;
    let land = |_, ray| {
        let landing = tracer.trace(ray);
        landing.fate.is_imaged().then_some(landing.ray.point)
    };
    let primary = sights.iter().filter(|sight| sight.wavelength == bench.primary);
    Ok(primary.map(|sight| sight.rms_shift(land)).fold(0.0, f64::max))
}

fn aspheres(
    bench: &RayModel,
    sights: &[SampledBundle],
) -> Result<Vec<(usize, f64)>, RayModelError> {
    let system = &bench.channels[bench.primary].system;
    let figured = (0..system.surfaces.len()).into_par_iter().filter(|i| is_aspheric(system, *i));
    let moved = |i: usize| {
        let mut plain = without_rims(bench);
        reduce_to_conic(&mut plain.surfaces[i]);
        Ok((i, largest_shift(bench, sights, &plain)?))
    };
    figured.map(moved).collect()
}

/// The gradients, each with what leaving it out does.
fn grin_gaps(
    bench: &RayModel,
    sights: &[SampledBundle],
) -> Result<Vec<(GrinStepPlan, f64)>, RayModelError> {
    let moved = |plan: &GrinStepPlan| {
        let mut glass = without_rims(bench);
        glass.surfaces[plan.surface].grin = None;
        Ok((*plan, largest_shift(bench, sights, &glass)?))
    };
    bench.channels[bench.primary].tracer.grin_step_plans().iter().map(moved).collect()
}

fn is_aspheric(system: &System<f64>, surface: usize) -> bool {
    matches!(system.surfaces[surface].shape, Shape::Asphere { .. })
}

/// The lens at the primary wavelength with the rims of its figured surfaces alone, and that of the
/// stop where it limits the beam.
fn without_rims(bench: &RayModel) -> System<f64> {
    let mut system = bench.channels[bench.primary].system.clone();
    for i in 0..system.surfaces.len() {
        system.surfaces[i].obstruction = 0.0;
        let limits = !bench.ends_at_disc() && i == bench.stop();
        if !(is_aspheric(&system, i) || limits) {
            system.surfaces[i].semi_diameter = f64::INFINITY;
        }
    }
    system
}

/// How far from the axis rays meet each surface that arrive where only those rims clip that have
/// to.
fn rims(bench: &RayModel) -> Result<Vec<RimClearance>, RayModelError> {
    let tracer = Tracer::new(&without_rims(bench))?;
    let count = tracer.surfaces();
    let reached = |field: &FieldPoint| -> Vec<f64> {
        let mut reached = vec![0.0; count];
        for launch in (0..bench.channels.len()).filter_map(|w| bench.launch(*field, w).ok()) {
            for ray in sample_points(bench).into_iter().filter_map(|p| launch.ray(p)) {
                let mut heights = vec![0.0; count];
                let landing = tracer.visit(ray, |i, p| heights[i] = p.x.hypot(p.y));
                if landing.fate.is_imaged() {
                    reached.iter_mut().zip(heights).for_each(|(r, h)| *r = h.max(*r));
                }
            }
        }
        reached
    };
    let all: Vec<_> = bench.fields.par_iter().map(reached).collect();
    let system = &bench.channels[bench.primary].system;
    let rim = |surface: usize| RimClearance {
        surface,
        semi_diameter: system.surfaces[surface].semi_diameter,
        ray_height: all.iter().map(|field| field[surface]).fold(0.0, f64::max),
        aspheric: is_aspheric(system, surface),
        obstructed: system.surfaces[surface].obstruction > 0.0,
    };
    let clips = |rim: &RimClearance| rim.semi_diameter.is_finite() || rim.obstructed;
    Ok((0..count).map(rim).filter(clips).collect())
}

fn index_drops(system: &System<f64>) -> Vec<usize> {
    let falls = |i: &usize| {
        let surface = &system.surfaces[*i];
        !surface.mirror && surface.index < system.index_before(*i)
    };
    (0..system.surfaces.len()).filter(falls).collect()
}

/// The angle between a ray and each surface that it leaves, in degrees.
fn exit_angles<'a>(
    system: &'a System<f64>,
    points: &'a [(usize, Vec3<f64>)],
) -> impl Iterator<Item = (usize, f64)> + 'a {
    points.windows(2).filter_map(move |pair| {
        let [(i, here), (_, next)] = pair else { return None };
        let surface = &system.surfaces[*i];
        let along =
            Vec3::new(next.x - here.x, next.y - here.y, next.z + surface.thickness - here.z);
        let (_, slope) = surface.shape.sag(here.x * here.x + here.y * here.y)?;
        let normal = Vec3::new(-2.0 * slope * here.x, -2.0 * slope * here.y, 1.0);
        let sine = along.dot(normal).abs() / (along.dot(along) * normal.dot(normal)).sqrt();
        Some((*i, sine.min(1.0).asin().to_degrees()))
    })
}

fn object(
    lens: &Lens,
    zoom: usize,
    bench: &RayModel,
    sights: &[SampledBundle],
) -> Option<(f64, f64)> {
    let Object::Finite(distance) = lens.object else { return None };
    let Some((beam, fields)) = collimate_fields(bench, &Beam::for_lens(lens, zoom)) else {
        return Some((distance, f64::INFINITY));
    };
    let systems =
        bench.channels.iter().map(|color| (color.um, color.weight, color.system.clone())).collect();
    // What cannot be set up or launched from infinity calls for the finite object.
    let Ok(far) = RayModel::from_systems(systems, bench.primary, beam, bench.aiming) else {
        return Some((distance, f64::INFINITY));
    };
    let places = sample_points(bench);
    let mut most: f64 = 0.0;
    for (field, parallel) in bench.fields.iter().zip(fields) {
        let mut here = sights.iter().filter(|s| s.field == *field && s.wavelength == bench.primary);
        let Some(here) = here.next() else { continue };
        most = match far.launch(parallel, bench.primary) {
            Ok(there) => {
                let there = SampledBundle::new(&there, &places);
                most.max(here.rms_shift(|i, _| there.landed[i]))
            }
            Err(_) => f64::INFINITY,
        };
    }
    Some((distance, most))
}
