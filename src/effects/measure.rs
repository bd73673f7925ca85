//! Measurements of what each effect does to the rays of a lens.
//!
//! A few dozen rays of every field and wavelength are enough: the measured quantities, how far rays
//! move and how near they come to a rim, are smooth over the pupil. The root mean square of a shift
//! bounds the change of the RMS radius of a spot, by the triangle inequality.

use super::absorption::absorbed_on_axis;
use super::aiming::{AimingDifference, CoarseSpot, aiming_difference};
use super::simplify::{
    at_room_temperature, centre, collimate_fields, placed_surfaces, reduce_to_conic,
};
use crate::lens::{FieldPoint, Lens, Object, ROOM_CELSIUS, Shape, System};
use crate::math::Vec3;
use crate::paraxial::Beam;
use crate::pupil::{
    Aiming, Channel, Launch, PupilPattern, RayModel, RayModelError, pattern_points,
};
use crate::trace::{Fate, Fates, GrinStepPlan, ImagePoints, Ray, Rays, TraceSink as _, Tracer};
use rayon::prelude::*;
use std::f64::consts::TAU;

/// The measurements of a lens at one zoom position. Surfaces are named by their index.
#[derive(Debug, Clone, PartialEq)]
pub struct EffectMeasurements {
    /// The number of wavelengths.
    pub wavelengths: usize,
    /// The number of surfaces that a ray crosses.
    pub surfaces: usize,
    /// The sum of the thicknesses from the first vertex to the image, each taken positive, in mm.
    pub length: f64,
    /// The smallest RMS radius of any field that has light, in mm.
    pub smallest_spot: f64,
    /// The distance between the rays of each wavelength and those of the primary one in the image
    /// plane, root mean square, for the field where it is largest, in mm.
    pub dispersion: f64,
    /// The aspheres, each with the shift of rays without its aspheric terms, in mm.
    pub aspheres: Vec<(usize, f64)>,
    /// The clearance at every given semi-diameter and obstruction.
    pub rims: Vec<RimClearance>,
    /// The number of rays that ended in each way.
    pub fates: Fates,
    /// Surfaces at which the index drops: total reflection is possible only there.
    pub index_drops: Vec<usize>,
    /// The smallest angle of any refracted ray with a surface at which the index drops, in degrees;
    /// 0 is total reflection. `None` if the index drops nowhere.
    pub critical_angle: Option<f64>,
    /// The difference that aiming at the paraxial entrance pupil makes.
    pub paraxial_aiming: AimingDifference,
    /// The distance of a finite object and the shift of rays if it is moved to infinity, both in mm.
    pub finite_object: Option<(f64, f64)>,
    /// The gradient-index gaps, each with the shift of rays if its gradient is left out, in mm.
    pub grin_gaps: Vec<(GrinStepPlan, f64)>,
    /// The tilted and decentred surfaces.
    pub poses: PlacedSurfaces,
    /// The temperature of a lens that is not at that of its catalogues, in °C, and the shift of rays
    /// with the indices of these, in mm.
    pub temperature: Option<(f64, f64)>,
    /// The largest share of light on the axis that the glasses absorb, over the wavelengths.
    pub absorption: f64,
}

/// The surfaces that are tilted or decentred, or at which the axis is broken.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct PlacedSurfaces {
    /// Their indices.
    pub surfaces: Vec<usize>,
    /// The shift of rays with all of them centred on a straight axis, in mm.
    pub shift: f64,
}

/// The clearance between the rays and the rim of a surface.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct RimClearance {
    /// The index of the surface.
    pub surface: usize,
    /// Its semi-diameter, in mm; infinite for a surface that has only an obstruction or other apertures.
    pub semi_diameter: f64,
    /// The largest distance from the axis at which a ray meets the surface that no rim stops, in mm.
    pub ray_height: f64,
    /// True if the surface is aspheric: its semi-diameter then bounds the search for the
    /// intersection.
    pub aspheric: bool,
    /// True if the surface has an obstruction or an aperture of another form, with or without a
    /// semi-diameter.
    pub obstructed: bool,
}

/// The rings of points inside the pupil, of equal areas.
const RINGS: usize = 3;
/// The factor by which rays are denser that tell how far those between them may reach.
const DENSER: usize = 2;
/// The largest height that denser rays may still add, in what they added to that of the sparse ones: the
/// sum of a series in which every doubling adds 3/4 of the one before. Heights that are smooth over the
/// pupil add a quarter; those near the end of total reflection about 0.7.
const BETWEEN_RAYS: f64 = 3.0;
/// Square grids of rays that look for light beyond the beam, which rims may have to stop: cells along
/// a side, and half a side in radii of the pupil. They are those that the search for the pupil begins
/// with, so that it finds no light that they miss.
const STRAY: [(usize, f64); 2] = [(25, 1.6), (25, 3.2)];
/// The points on the rim of the pupil.
const ON_RIM: usize = 24;

/// Measures the effects of a lens at a zoom position.
///
/// # Errors
/// A lens or an aperture through which no ray can be traced.
pub fn measure_effects(lens: &Lens, zoom: usize) -> Result<EffectMeasurements, RayModelError> {
    measure_effects_at(lens, zoom, &lens.fields_at(zoom).values)
}

/// Measures the effects of a lens at a zoom position on some fields, in the unit of its own.
///
/// # Errors
/// A lens or an aperture through which no ray can be traced.
pub fn measure_effects_at(
    lens: &Lens,
    zoom: usize,
    fields: &[FieldPoint],
) -> Result<EffectMeasurements, RayModelError> {
    let model = RayModel { fields: fields.to_vec(), ..RayModel::from_lens(lens, zoom)? };
    let system = &model.channels[model.primary].system;
    let bundles: Vec<SampledBundle> = model
        .fields
        .par_iter()
        .flat_map_iter(|field| SampledBundle::of_field(&model, *field))
        .collect();
    Ok(EffectMeasurements {
        wavelengths: model.channels.len(),
        surfaces: system.surfaces.len(),
        length: system.total_track(),
        smallest_spot: smallest_spot(&model, &bundles),
        dispersion: dispersion(&model, &bundles),
        aspheres: aspheres(&model, &bundles)?,
        rims: rims(&model)?,
        fates: bundles.iter().fold(Fates::default(), |sum, bundle| add_fates(sum, bundle.fates)),
        index_drops: index_drops(system),
        critical_angle: bundles.iter().filter_map(|bundle| bundle.grazing).reduce(f64::min),
        paraxial_aiming: paraxial_aiming(lens, zoom, &model, &bundles)?,
        finite_object: object(lens, zoom, &model, &bundles),
        grin_gaps: grin_gaps(&model, &bundles)?,
        poses: poses(&model, &bundles)?,
        temperature: temperature(lens, zoom, &model, &bundles)?,
        absorption: absorbed_on_axis(lens, &model),
    })
}

/// The largest difference of any field and wavelength; unknown if the real beam of one is not found.
fn paraxial_aiming(
    lens: &Lens,
    zoom: usize,
    model: &RayModel,
    bundles: &[SampledBundle],
) -> Result<AimingDifference, RayModelError> {
    let paraxial = RayModel::with_aiming(lens, zoom, Aiming::Paraxial)?;
    let all = model.fields.len() * model.channels.len();
    if bundles.len() < all {
        return Ok(AimingDifference::UNKNOWN);
    }
    let of_bundle = |bundle: &SampledBundle| {
        let spot = CoarseSpot::new(&bundle.landed);
        let launch = model.launch(bundle.field, bundle.wavelength).ok();
        spot.zip(launch).map(|(spot, launch)| aiming_difference(&launch, &paraxial, spot))
    };
    // A field without light is dark either way.
    let found = bundles.par_iter().filter_map(of_bundle);
    Ok(found.reduce(AimingDifference::default, AimingDifference::worst))
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

/// The sampled points of the pupil; those inside come first.
pub(super) fn sample_points() -> Vec<[f64; 2]> {
    pupil_points(RINGS, ON_RIM)
}

/// Points on rings inside the pupil, and then on its rim.
fn pupil_points(rings: usize, on_rim: usize) -> Vec<[f64; 2]> {
    let rim = (0..on_rim).map(|i| (TAU * i as f64 / on_rim as f64).sin_cos().into());
    pattern_points(PupilPattern::HexapolarInside(rings)).into_iter().chain(rim).collect()
}

/// The sampled rays of one field at one wavelength.
struct SampledBundle {
    field: FieldPoint,
    wavelength: usize,
    rays: Vec<Option<Ray<f64>>>,
    /// Their points in the image plane; `None` for a ray that is lost.
    landed: Vec<Option<Vec3<f64>>>,
    fates: Fates,
    /// The smallest angle between a refracted ray and a surface at which the index drops, in
    /// degrees; 0 for a ray that is totally reflected.
    grazing: Option<f64>,
}

impl SampledBundle {
    /// The rays of a field at all wavelengths; a field without rays is dark and has none.
    fn of_field(model: &RayModel, field: FieldPoint) -> Vec<Self> {
        let places = sample_points();
        let launches = (0..model.channels.len()).filter_map(|w| model.launch(field, w).ok());
        launches.map(|launch| Self::new(&launch, &places)).collect()
    }

    fn new(launch: &Launch<'_>, places: &[[f64; 2]]) -> Self {
        let mut bundle = Self {
            field: launch.field,
            wavelength: launch.wavelength,
            rays: launch.rays(places),
            landed: Vec::with_capacity(places.len()),
            fates: Fates::default(),
            grazing: None,
        };
        let channel = launch.channel();
        let falls = index_drops(&channel.system);
        let mut points = Vec::with_capacity(channel.system.surfaces.len());
        for ray in &bundle.rays {
            points.clear();
            let landing = ray.map(|ray| channel.tracer.visit(ray, |i, p| points.push((i, p))));
            let imaged = landing.filter(|landing| landing.fate.is_imaged());
            bundle.landed.push(imaged.map(|landing| landing.ray.point));
            let Some(landing) = landing else { continue };
            bundle.fates.count(landing.fate);
            let reflected = matches!(landing.fate, Fate::TotalReflection(_)).then_some(0.0);
            let leaving = exit_angles(&channel.system, &points).filter(|(i, _)| falls.contains(i));
            let angles = leaving.map(|(_, angle)| angle).chain(reflected);
            bundle.grazing = angles.chain(bundle.grazing).reduce(f64::min);
        }
        bundle
    }

    /// The image points of the rays inside the pupil.
    fn inside(&self) -> impl Iterator<Item = &Vec3<f64>> {
        self.landed[..self.landed.len() - ON_RIM].iter().flatten()
    }

    /// The root mean square distance of the image points from those in another lens; infinite if a
    /// ray is lost there, or if so few arrive here that they do not tell.
    fn rms_shift(&self, otherwise: impl Fn(usize, Ray<f64>) -> Option<Vec3<f64>>) -> f64 {
        let arriving = self.rays.iter().zip(&self.landed).enumerate();
        root_mean_square(arriving.filter_map(|(i, (ray, landed))| {
            let here = (*landed)?;
            Some(otherwise(i, (*ray)?).map_or(f64::INFINITY, |there| square_distance(here, there)))
        }))
    }

    /// The root mean square distance of the image points from those of the same rays of another bundle;
    /// infinite if so few arrive in both that they do not tell.
    fn rms_distance(&self, other: &Self) -> f64 {
        let pairs = self.landed.iter().zip(&other.landed);
        root_mean_square(
            pairs.filter_map(|(here, there)| Some(square_distance((*here)?, (*there)?))),
        )
    }
}

/// The square of the distance of two points of the image plane, in mm².
fn square_distance(a: Vec3<f64>, b: Vec3<f64>) -> f64 {
    (a.x - b.x).powi(2) + (a.y - b.y).powi(2)
}

/// The root of the mean of some squares; infinite if they are too few.
fn root_mean_square(squares: impl Iterator<Item = f64>) -> f64 {
    let (sum, count) = squares.fold((0.0, 0), |(sum, count), square| (sum + square, count + 1));
    if count < FEW { f64::INFINITY } else { (sum / count as f64).sqrt() }
}

/// The smallest number of rays that gives the size of a spot, or of a shift.
const FEW: usize = 8;

/// The smallest RMS radius of any field, over all wavelengths.
fn smallest_spot(model: &RayModel, bundles: &[SampledBundle]) -> f64 {
    let spot = |field: &FieldPoint| {
        let of_field = || bundles.iter().filter(|bundle| bundle.field == *field);
        let points: Vec<_> = of_field().flat_map(SampledBundle::inside).collect();
        let share = 1.0 / points.len() as f64;
        let mean = points.iter().fold(Vec3::default(), |sum, p| sum + **p) * share;
        let off = |p: &&Vec3<f64>| (p.x - mean.x).powi(2) + (p.y - mean.y).powi(2);
        let square = points.iter().map(off).sum::<f64>() * share;
        (points.len() >= FEW).then(|| square.sqrt())
    };
    model.fields.iter().filter_map(spot).fold(f64::INFINITY, f64::min)
}

/// `√(Σ share |p_λ − p|²)` over the rays that arrive at both wavelengths, of the worst field; infinite if
/// they are too few in one.
fn dispersion(model: &RayModel, bundles: &[SampledBundle]) -> f64 {
    let primary = &model.channels[model.primary].system;
    if model.channels.iter().all(|channel| channel.system == *primary) {
        return 0.0;
    }
    let weights: f64 = model.channels.iter().map(|channel| channel.weight).sum();
    let worst = |field: &FieldPoint| -> f64 {
        let find =
            |wavelength| bundles.iter().find(|b| b.field == *field && b.wavelength == wavelength);
        let square = |(wavelength, channel): (usize, &Channel)| {
            let distance = match (find(model.primary), find(wavelength)) {
                (Some(primary), Some(bundle)) => primary.rms_distance(bundle),
                // A field without a beam at either wavelength is dark.
                (None, None) => 0.0,
                _ => f64::INFINITY,
            };
            channel.weight / weights * distance.powi(2)
        };
        let others = model.channels.iter().enumerate();
        let others = others.filter(|(i, channel)| *i != model.primary && channel.weight > 0.0);
        others.map(square).sum::<f64>().sqrt()
    };
    model.fields.iter().map(worst).fold(0.0, f64::max)
}

/// The largest RMS shift of a bundle at the primary wavelength in another system.
fn largest_shift(
    model: &RayModel,
    bundles: &[SampledBundle],
    other: &System<f64>,
) -> Result<f64, RayModelError> {
    let tracer = Tracer::new(other)?;
    let land = |_, ray| {
        let landing = tracer.trace(ray);
        landing.fate.is_imaged().then_some(landing.ray.point)
    };
    let primary = bundles.iter().filter(|bundle| bundle.wavelength == model.primary);
    Ok(primary.map(|bundle| bundle.rms_shift(land)).fold(0.0, f64::max))
}

fn aspheres(
    model: &RayModel,
    bundles: &[SampledBundle],
) -> Result<Vec<(usize, f64)>, RayModelError> {
    let system = &model.channels[model.primary].system;
    let figured = (0..system.surfaces.len()).into_par_iter().filter(|i| is_aspheric(system, *i));
    let moved = |i: usize| {
        let mut plain = without_rims(model, model.primary);
        reduce_to_conic(&mut plain.surfaces[i]);
        Ok((i, largest_shift(model, bundles, &plain)?))
    };
    figured.map(moved).collect()
}

/// The gradient-index gaps, each with the shift of rays if its gradient is left out.
fn grin_gaps(
    model: &RayModel,
    bundles: &[SampledBundle],
) -> Result<Vec<(GrinStepPlan, f64)>, RayModelError> {
    let moved = |plan: &GrinStepPlan| {
        let mut glass = without_rims(model, model.primary);
        glass.surfaces[plan.surface].grin = None;
        Ok((*plan, largest_shift(model, bundles, &glass)?))
    };
    model.channels[model.primary].tracer.grin_step_plans().iter().map(moved).collect()
}

/// The tilted and decentred surfaces, with the shift of rays if all are centred.
fn poses(model: &RayModel, bundles: &[SampledBundle]) -> Result<PlacedSurfaces, RayModelError> {
    let mut centred = without_rims(model, model.primary);
    let surfaces = placed_surfaces(&centred);
    if surfaces.is_empty() {
        return Ok(PlacedSurfaces::default());
    }
    centre(&mut centred);
    Ok(PlacedSurfaces { surfaces, shift: largest_shift(model, bundles, &centred)? })
}

/// The temperature of a lens and the shift of rays with the indices of its catalogues, if that is
/// another one.
fn temperature(
    lens: &Lens,
    zoom: usize,
    model: &RayModel,
    bundles: &[SampledBundle],
) -> Result<Option<(f64, f64)>, RayModelError> {
    let celsius = lens.environment.temperature();
    if celsius == ROOM_CELSIUS {
        return Ok(None);
    }
    let primary = &model.channels[model.primary];
    let mut catalogued = at_room_temperature(lens).resolve(zoom, primary.um)?;
    remove_rims(&mut catalogued, model);
    Ok(Some((celsius, largest_shift(model, bundles, &catalogued)?)))
}

fn is_aspheric(system: &System<f64>, surface: usize) -> bool {
    matches!(system.surfaces[surface].shape, Shape::Asphere { .. })
}

/// The lens at a wavelength with no semi-diameters but those of its aspheres and, where it
/// limits the beam, that of the stop.
fn without_rims(model: &RayModel, wavelength: usize) -> System<f64> {
    let mut system = model.channels[wavelength].system.clone();
    remove_rims(&mut system, model);
    system
}

/// Removes the semi-diameters and obstructions that [`without_rims`] does not keep.
fn remove_rims(system: &mut System<f64>, model: &RayModel) {
    for i in 0..system.surfaces.len() {
        system.surfaces[i].obstruction = 0.0;
        system.surfaces[i].apertures.clear();
        let limits = !model.ends_at_disc() && i == model.stop();
        if !(is_aspheric(system, i) || limits) {
            system.surfaces[i].semi_diameter = f64::INFINITY;
        }
    }
}

/// A lens at a wavelength [`without_rims`].
struct OpenLens {
    /// That lens.
    limited: Tracer<f64>,
    /// The same without the rim of the stop.
    open: Tracer<f64>,
}

impl OpenLens {
    fn new(model: &RayModel, wavelength: usize) -> Result<Self, RayModelError> {
        let mut system = without_rims(model, wavelength);
        let limited = Tracer::new(&system)?;
        if !is_aspheric(&system, model.stop()) {
            // Rounding must not decide whether rays at its rim pass.
            system.surfaces[model.stop()].semi_diameter = f64::INFINITY;
        }
        Ok(Self { limited, open: Tracer::new(&system)? })
    }

    /// The largest heights at each surface in mm of the rays that fill the stop and arrive, those between
    /// the traced ones too, and of rays beyond the beam that arrive.
    fn heights(&self, model: &RayModel, field: FieldPoint, wavelength: usize) -> Vec<f64> {
        let mut reached = vec![0.0; self.open.surfaces()];
        if let Ok(launch) = model.launch_at_stop(field, wavelength) {
            let [sparse, dense] = [1, DENSER].map(|factor| {
                let points = pupil_points(factor * RINGS, factor * ON_RIM);
                heights(&launch, &points, &self.open)
            });
            let between = sparse.iter().zip(&dense).map(|(sparse, dense)| {
                sparse.max(*dense) + BETWEEN_RAYS * (dense - sparse).max(0.0)
            });
            raise(&mut reached, between);
        }
        if let Ok(launch) = model.launch(field, wavelength) {
            let beyond = stray_points(launch.is_symmetric());
            raise(&mut reached, heights(&launch, &beyond, &self.limited));
        }
        reached
    }
}

/// The clearance at each rim, for the light of all fields and wavelengths.
fn rims(model: &RayModel) -> Result<Vec<RimClearance>, RayModelError> {
    let lenses = (0..model.channels.len()).map(|wavelength| OpenLens::new(model, wavelength));
    let lenses = lenses.collect::<Result<Vec<_>, _>>()?;
    let reached = |field: &FieldPoint| {
        let mut reached = vec![0.0; lenses[model.primary].open.surfaces()];
        for (wavelength, lens) in lenses.iter().enumerate() {
            raise(&mut reached, lens.heights(model, *field, wavelength));
        }
        reached
    };
    let all: Vec<_> = model.fields.par_iter().map(reached).collect();
    let system = &model.channels[model.primary].system;
    let rim = |surface: usize| RimClearance {
        surface,
        semi_diameter: system.surfaces[surface].semi_diameter,
        ray_height: all.iter().map(|field| field[surface]).fold(0.0, f64::max),
        aspheric: is_aspheric(system, surface),
        obstructed: system.surfaces[surface].obstruction > 0.0
            || !system.surfaces[surface].apertures.is_empty(),
    };
    let clips = |rim: &RimClearance| rim.semi_diameter.is_finite() || rim.obstructed;
    Ok((0..system.surfaces.len()).map(rim).filter(clips).collect())
}

/// The points beyond the beam from which rays may arrive if no rim stops them; those of one half if
/// the other is its mirror image.
fn stray_points(half: bool) -> Vec<[f64; 2]> {
    let grid = |(cells, reach): (usize, f64)| {
        let step = 2.0 * reach / cells as f64;
        let at = move |i: usize| step * (i as f64 - 0.5 * (cells - 1) as f64);
        let columns = if half { cells / 2..cells } else { 0..cells };
        columns.flat_map(move |column| (0..cells).map(move |row| [at(column), at(row)]))
    };
    STRAY.into_iter().flat_map(grid).collect()
}

/// Raises the height at each surface to another one.
fn raise(reached: &mut [f64], heights: impl IntoIterator<Item = f64>) {
    reached.iter_mut().zip(heights).for_each(|(reached, height)| *reached = reached.max(height));
}

/// The largest distance from the axis in mm, at each surface, of the rays of some pupil points that
/// arrive.
fn heights(launch: &Launch<'_>, points: &[[f64; 2]], tracer: &Tracer<f64>) -> Vec<f64> {
    let rays: Rays<f64> = launch.rays(points).into_iter().flatten().collect();
    let mut landed = ImagePoints::default();
    tracer.trace_batch(&rays, &mut landed);
    let mut reached = vec![0.0_f64; tracer.surfaces()];
    for i in (0..rays.len()).filter(|i| landed.fate(*i).is_imaged()) {
        tracer.visit(rays.get(i), |i, p| reached[i] = reached[i].max(p.x.hypot(p.y)));
    }
    reached
}

fn index_drops(system: &System<f64>) -> Vec<usize> {
    let falls = |i: &usize| {
        let surface = &system.surfaces[*i];
        !surface.mirror && surface.index < system.index_before(*i)
    };
    (0..system.surfaces.len()).filter(falls).collect()
}

/// The angle between a ray and each surface that it leaves, in degrees, with the surface's index.
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
    model: &RayModel,
    bundles: &[SampledBundle],
) -> Option<(f64, f64)> {
    let Object::Finite(distance) = lens.object else { return None };
    let Some((beam, fields)) = collimate_fields(model, &Beam::for_lens(lens, zoom)) else {
        return Some((distance, f64::INFINITY));
    };
    let systems = model
        .channels
        .iter()
        .map(|channel| (channel.um, channel.weight, channel.system.clone()))
        .collect();
    // A lens that cannot be set up with an object at infinity needs the finite object.
    let far = RayModel::from_systems(systems, model.primary, beam, model.aiming);
    let far = far.and_then(|far| Ok(far.limited_by_stop()?));
    let Ok(far) = far else { return Some((distance, f64::INFINITY)) };
    let places = sample_points();
    let mut most: f64 = 0.0;
    for (field, parallel) in model.fields.iter().zip(fields) {
        let mut here =
            bundles.iter().filter(|s| s.field == *field && s.wavelength == model.primary);
        let Some(here) = here.next() else { continue };
        most = match far.launch(parallel, model.primary) {
            Ok(there) => {
                let there = SampledBundle::new(&there, &places);
                most.max(here.rms_shift(|i, _| there.landed[i]))
            }
            Err(_) => f64::INFINITY,
        };
    }
    Some((distance, most))
}
