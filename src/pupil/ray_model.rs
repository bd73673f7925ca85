//! A lens with its beam, ready for rays.

use crate::lens::{Aperture, FieldPoint, Lens, LensError, System, SystemError};
use crate::math::Dual;
use crate::paraxial::{Beam, FirstOrder, ParaxialError, Seidel, first_order, seidel};
use crate::trace::Tracer;

use super::launch::Launch;

/// A number with its derivatives by the two coordinates of a pupil.
pub type Dual2 = Dual<f64, 2>;

/// How pupil coordinates become rays.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Aiming {
    /// Through that point of the paraxial entrance pupil at the primary wavelength. Exact on the
    /// axis, right for narrow fields.
    Paraxial,
    /// As `Paraxial`, but shifted and stretched so that the chief ray and its neighbours cross the
    /// stop where they should: what wide fields need, at the price of one search per field.
    Chief,
    /// Through that point of the real stop, searched for every ray and wavelength by itself.
    Stop,
}

/// Beyond this miss of the stop's centre by the paraxial chief ray, in stop radii, the pupil of a
/// wide field is looked for where it is: paraxial coordinates would waste half of the beam.
pub const WIDE_AIMING_THRESHOLD: f64 = 0.25;

/// Why a lens cannot be set up.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum RayModelError {
    /// The prescription.
    #[error(transparent)]
    Lens(#[from] LensError),
    /// Its numbers.
    #[error(transparent)]
    Invalid(#[from] SystemError),
    /// Its aperture.
    #[error(transparent)]
    Undefined(#[from] ParaxialError),
}

/// A lens at one wavelength.
#[derive(Debug, Clone)]
pub struct Channel {
    /// The wavelength in micrometres.
    pub um: f64,
    /// Its share in polychromatic results.
    pub weight: f64,
    /// The lens, with the stop as large as the aperture says.
    pub system: System<f64>,
    /// The same made ready for tracing.
    pub tracer: Tracer<f64>,
    /// The same clipped by nothing, with derivatives by two pupil coordinates.
    pub(super) unclipped: Tracer<Dual2>,
}

/// A lens with its beam at one zoom position, ready for rays at every wavelength.
#[derive(Debug, Clone)]
pub struct RayModel {
    /// How it is used.
    pub beam: Beam,
    /// The field points, in the unit of the beam's field kind.
    pub fields: Vec<FieldPoint>,
    /// One entry a wavelength.
    pub channels: Vec<Channel>,
    /// Which of them is the primary one.
    pub primary: usize,
    /// First-order data at the primary wavelength.
    pub first_order: FirstOrder<f64>,
    /// How pupil coordinates become rays.
    pub aiming: Aiming,
}

impl RayModel {
    /// A lens at a zoom position, aimed as [`choose_aiming`](Self::choose_aiming) decides.
    ///
    /// # Errors
    /// A lens that cannot be resolved, or an aperture without meaning for it.
    pub fn from_lens(lens: &Lens, zoom: usize) -> Result<Self, RayModelError> {
        let mut model = Self::with_aiming(lens, zoom, Aiming::Paraxial)?;
        model.choose_aiming();
        Ok(model)
    }

    /// A lens at a zoom position, with a given aiming.
    ///
    /// # Errors
    /// As of [`from_lens`](Self::from_lens).
    pub fn with_aiming(lens: &Lens, zoom: usize, aiming: Aiming) -> Result<Self, RayModelError> {
        let system = |w: &crate::lens::Wavelength| Ok((w.um, w.weight, lens.resolve(zoom, w.um)?));
        let systems: Result<Vec<_>, LensError> = lens.wavelengths.iter().map(system).collect();
        let mut model =
            Self::from_systems(systems?, lens.primary(), Beam::for_lens(lens, zoom), aiming)?;
        model.fields.clone_from(&lens.fields_at(zoom).values);
        Ok(model)
    }

    /// Systems at several wavelengths in micrometres, each with its weight.
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
        let color = |(um, weight, mut system): (f64, f64, System<f64>)| {
            let stop = system.stop.unwrap_or(0);
            rim.into_iter().for_each(|radius| system.surfaces[stop].semi_diameter = radius);
            let tracer = Tracer::new(&system)?;
            let open = Tracer::new(&system.cast::<Dual2>())?.without_rims();
            Ok(Channel { um, weight, system, tracer, unclipped: open })
        };
        let colors: Result<Vec<_>, SystemError> = systems.into_iter().map(color).collect();
        Ok(Self {
            beam,
            fields: Vec::new(),
            channels: colors?,
            primary,
            first_order: first,
            aiming,
        })
    }

    /// The rays of a field at a wavelength.
    pub fn launch(
        &self,
        field: FieldPoint,
        wavelength: usize,
    ) -> Result<Launch<'_>, super::LaunchError> {
        Launch::new(self, field, wavelength, self.aiming)
    }

    /// The third-order sums, chromatic ones between the shortest and the longest wavelength where
    /// there are two; `None` where there is no chief ray or a gradient fills a gap.
    pub fn seidel(&self) -> Option<Seidel<f64>> {
        let by_length = |a: &&Channel, b: &&Channel| a.um.total_cmp(&b.um);
        let short = self.channels.iter().min_by(by_length)?;
        let long = self.channels.iter().max_by(by_length)?;
        let outer = (short.um < long.um).then_some((&short.system, &long.system));
        seidel(&self.channels[self.primary].system, &self.first_order, outer)
    }

    /// The same beam through a lens that has changed at one wavelength: where its stop limits it,
    /// the stop is as large as that says.
    pub(super) fn with_system(
        &self,
        wavelength: usize,
        system: System<f64>,
    ) -> Result<Self, SystemError> {
        let mut model = self.clone();
        if let Aperture::StopSemiDiameter(radius) = &mut model.beam.aperture {
            *radius = system.surfaces[self.stop()].semi_diameter;
        }
        let color = &mut model.channels[wavelength];
        color.tracer = Tracer::new(&system)?;
        color.unclipped = Tracer::new(&system.cast::<Dual2>())?.without_rims();
        color.system = system;
        Ok(model)
    }

    /// Whether the beam ends at the unit disc of the pupil coordinates; else only the surfaces
    /// limit it, the stop among them.
    pub fn ends_at_disc(&self) -> bool {
        self.aiming == Aiming::Stop || !matches!(self.beam.aperture, Aperture::StopSemiDiameter(_))
    }

    /// Whether a gradient fills a gap.
    pub fn has_grin(&self) -> bool {
        self.channels[self.primary].system.has_grin()
    }

    /// The radius of the stop in mm: as given, or the height of the paraxial marginal ray there.
    pub fn stop_radius(&self) -> f64 {
        match self.beam.aperture {
            Aperture::StopSemiDiameter(radius) => radius,
            _ => self.first_order.stop_semi_diameter,
        }
    }

    /// The surface that is the stop.
    pub fn stop(&self) -> usize {
        self.channels[self.primary].system.stop.unwrap_or(0)
    }

    /// Chooses between paraxial aiming and aiming by the real chief ray: the latter if the paraxial
    /// chief ray of the farthest field misses the centre of the stop by more than
    /// [`WIDE_AIMING_THRESHOLD`]. Returns that miss, in stop radii; `None` if the ray does not reach
    /// the stop.
    pub fn choose_aiming(&mut self) -> Option<f64> {
        let miss = self.stop_miss();
        let wide = miss.is_none_or(|miss| miss > WIDE_AIMING_THRESHOLD);
        self.aiming = if wide { Aiming::Chief } else { Aiming::Paraxial };
        miss
    }

    /// The distance of the paraxial chief ray of the farthest field from the centre of the stop, in
    /// stop radii; `None` if the ray does not reach the stop.
    fn stop_miss(&self) -> Option<f64> {
        let edge = FieldPoint { x: 0.0, y: self.beam.edge, weight: 1.0 };
        let launch = Launch::new(self, edge, self.primary, Aiming::Paraxial).ok()?;
        let [x, y] = launch.stop_point([0.0, 0.0])?;
        let miss = x.hypot(y) / self.stop_radius();
        miss.is_finite().then_some(miss)
    }
}
