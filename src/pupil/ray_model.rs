//! A lens with its beam, ready for tracing.

use super::found_pupils::FoundPupils;
use crate::lens::{Aperture, FieldPoint, Lens, LensError, Surface, System, SystemError};
use crate::math::Dual;
use crate::paraxial::{Beam, FirstOrder, ParaxialError, Seidel, first_order, seidel};
use crate::trace::Tracer;

/// A number with its derivatives by the two coordinates of a pupil.
pub type Dual2 = Dual<f64, 2>;

/// The map from pupil coordinates to rays.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Aiming {
    /// The ray goes through that point of the paraxial entrance pupil at the primary wavelength.
    /// Exact on the axis, accurate for narrow fields.
    Paraxial,
    /// As `Paraxial`, but shifted and scaled so that the chief ray and its neighbours cross the
    /// stop at the right points, at the cost of one search per field and wavelength. A beam that
    /// the rim of the stop limits has the same rays either way.
    Chief,
    /// The ray goes through that point of the real stop; each ray and wavelength is searched for by
    /// itself.
    Stop,
}

/// The measure of integrals over a pupil.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum PupilMeasure {
    /// Equal areas of the arriving beam weigh alike: the energy of a beam of uniform irradiance.
    #[default]
    ArrivingBeam,
    /// Equal areas of pupil coordinates weigh alike. It differs from the arriving beam only where
    /// every ray is aimed at the stop, and serves comparison with tables made so.
    Coordinates,
}

/// The reason why a lens cannot be traced.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum RayModelError {
    /// The prescription is invalid.
    #[error(transparent)]
    Lens(#[from] LensError),
    /// Its numbers cannot be traced.
    #[error(transparent)]
    Invalid(#[from] SystemError),
    /// Its aperture has no meaning for it.
    #[error(transparent)]
    Undefined(#[from] ParaxialError),
}

/// The changes of results by the effects that a model leaves out.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Neglected {
    /// The root mean square shift of rays in the image plane, in mm.
    pub shift: f64,
    /// The largest shift of a single ray there, in mm.
    pub ray_shift: f64,
    /// The relative change of the light of a field.
    pub light: f64,
}

/// A lens at one wavelength.
#[derive(Debug, Clone)]
pub struct Channel {
    /// The wavelength in micrometres.
    pub um: f64,
    /// The weight in polychromatic results.
    pub weight: f64,
    /// The resolved lens; its stop is as large as the aperture defines.
    pub system: System<f64>,
    /// The tracer of the system.
    pub tracer: Tracer<f64>,
    /// The same without semi-diameters and obstructions, with derivatives by the two pupil
    /// coordinates.
    pub(super) unclipped: Tracer<Dual2>,
    /// The same in plain numbers.
    pub(super) open: Tracer<f64>,
    /// The same up to and including the stop.
    pub(super) to_stop: Tracer<f64>,
}

/// A lens with its beam at one zoom position, ready for tracing at every wavelength.
#[derive(Debug, Clone)]
pub struct RayModel {
    /// The object, aperture and field of view.
    pub beam: Beam,
    /// The field points, in the unit of the beam's field kind.
    pub fields: Vec<FieldPoint>,
    /// The lens at each wavelength.
    pub channels: Vec<Channel>,
    /// The index of the primary wavelength.
    pub primary: usize,
    /// First-order data at the primary wavelength.
    pub first_order: FirstOrder<f64>,
    /// The map from pupil coordinates to rays.
    pub aiming: Aiming,
    /// The effects that are left out: part of the errors of results.
    pub neglected: Neglected,
    /// The measure of integrals over a pupil.
    pub measure: PupilMeasure,
    /// The pupils found so far for its own fields; a clone begins without any.
    pub found: FoundPupils,
}

impl RayModel {
    /// A lens at a zoom position, with a given aiming.
    ///
    /// # Errors
    /// A lens that cannot be resolved, or an aperture without meaning for it.
    pub fn with_aiming(lens: &Lens, zoom: usize, aiming: Aiming) -> Result<Self, RayModelError> {
        let system = |w: &crate::lens::Wavelength| Ok((w.um, w.weight, lens.resolve(zoom, w.um)?));
        let systems: Result<Vec<_>, LensError> = lens.wavelengths.iter().map(system).collect();
        let mut model =
            Self::from_systems(systems?, lens.primary(), Beam::for_lens(lens, zoom), aiming)?;
        model.fields.clone_from(&lens.fields_at(zoom).values);
        Ok(model)
    }

    /// The model of systems at several wavelengths, each given with its wavelength in micrometres
    /// and its weight.
    ///
    /// # Errors
    /// Numbers that cannot be traced, or an aperture without meaning for the lens.
    pub fn from_systems(
        systems: Vec<(f64, f64, System<f64>)>,
        primary: usize,
        beam: Beam,
        aiming: Aiming,
    ) -> Result<Self, RayModelError> {
        let first = first_order(&systems[primary].2, &beam)?;
        let rim = match (beam.aperture, aiming) {
            (Aperture::StopSemiDiameter(_), Aiming::Stop) => Some(f64::INFINITY),
            (Aperture::StopSemiDiameter(radius), Aiming::Paraxial | Aiming::Chief) => Some(radius),
            _ => None,
        };
        let channel = |(um, weight, mut system): (f64, f64, System<f64>)| {
            let stop = system.stop.unwrap_or(0);
            rim.into_iter().for_each(|radius| system.surfaces[stop].semi_diameter = radius);
            let tracer = Tracer::new(&system)?;
            let unclipped = Tracer::new(&system.cast::<Dual2>())?.without_rims();
            let open = tracer.clone().without_rims();
            let to_stop = open.up_to(stop);
            Ok(Channel { um, weight, system, tracer, unclipped, open, to_stop })
        };
        let channels: Result<Vec<_>, SystemError> = systems.into_iter().map(channel).collect();
        Ok(Self {
            beam,
            fields: Vec::new(),
            channels: channels?,
            primary,
            first_order: first,
            aiming,
            neglected: Neglected::default(),
            measure: PupilMeasure::default(),
            found: FoundPupils::default(),
        })
    }

    /// The same beam through other systems, one for each wavelength, with rims of their own.
    ///
    /// # Errors
    /// Numbers that cannot be traced.
    pub fn with_systems(&self, systems: &[System<f64>]) -> Result<Self, SystemError> {
        let stop = self.stop();
        let channel = |(own, system): (&Channel, &System<f64>)| {
            let tracer = Tracer::new(system)?;
            let unclipped = Tracer::new(&system.cast::<Dual2>())?.without_rims();
            let open = tracer.clone().without_rims();
            let to_stop = open.up_to(stop);
            let (um, weight, system) = (own.um, own.weight, system.clone());
            Ok(Channel { um, weight, system, tracer, unclipped, open, to_stop })
        };
        let channels: Result<_, SystemError> =
            self.channels.iter().zip(systems).map(channel).collect();
        Ok(Self {
            channels: channels?,
            fields: self.fields.clone(),
            first_order: self.first_order.clone(),
            found: FoundPupils::default(),
            ..*self
        })
    }

    /// Leaves out all wavelengths but the primary one, which then has all the weight.
    pub(crate) fn keep_primary_wavelength(&mut self) {
        self.channels.swap(0, self.primary);
        self.channels.truncate(1);
        self.channels[0].weight = 1.0;
        self.primary = 0;
        self.found = FoundPupils::default();
    }

    /// The Seidel sums; the chromatic ones between the shortest and the longest wavelength if there
    /// are two. `None` if there is no chief ray or a gap is filled with a gradient-index medium.
    pub fn seidel(&self) -> Option<Seidel<f64>> {
        let by_length = |a: &&Channel, b: &&Channel| a.um.total_cmp(&b.um);
        let short = self.channels.iter().min_by(by_length)?;
        let long = self.channels.iter().max_by(by_length)?;
        let outer = (short.um < long.um).then_some((&short.system, &long.system));
        seidel(&self.channels[self.primary].system, &self.first_order, outer)
    }

    /// The same beam through another system at one wavelength. A stop that limits the beam takes
    /// its semi-diameter from the system.
    pub(super) fn with_system(
        &self,
        wavelength: usize,
        system: System<f64>,
    ) -> Result<Self, SystemError> {
        let (mut model, stop) = (self.clone(), self.stop());
        if let Aperture::StopSemiDiameter(radius) = &mut model.beam.aperture {
            *radius = system.surfaces[stop].semi_diameter;
        }
        let channel = &mut model.channels[wavelength];
        channel.tracer = Tracer::new(&system)?;
        channel.open = channel.tracer.clone().without_rims();
        channel.to_stop = channel.open.up_to(stop);
        channel.unclipped = Tracer::new(&system.cast::<Dual2>())?.without_rims();
        channel.system = system;
        Ok(model)
    }

    /// True if the beam ends at the unit disc of the pupil coordinates; otherwise only the surfaces
    /// limit it, the stop among them.
    pub fn ends_at_disc(&self) -> bool {
        self.aiming == Aiming::Stop || !matches!(self.beam.aperture, Aperture::StopSemiDiameter(_))
    }

    /// True if a gap is filled with a gradient-index medium.
    pub fn has_grin(&self) -> bool {
        self.channels[self.primary].system.has_grin()
    }

    /// True if the warp field of the lens is known, by which the derivative of a pupil of any form can be
    /// sampled.
    pub fn has_warp_field(&self) -> bool {
        let system = &self.channels[self.primary].system;
        !system.has_grin() && !system.surfaces.iter().any(Surface::is_mounted)
    }

    /// The radius of the stop in mm: as given, or the height of the paraxial marginal ray there.
    pub fn stop_radius(&self) -> f64 {
        match self.beam.aperture {
            Aperture::StopSemiDiameter(radius) => radius,
            _ => self.first_order.stop_semi_diameter,
        }
    }

    /// The index of the stop surface.
    pub fn stop(&self) -> usize {
        self.channels[self.primary].system.stop.unwrap_or(0)
    }
}
