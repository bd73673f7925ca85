//! The reference sphere: where paths are compared, and where the light of a pupil is counted.
//!
//! The sphere lies about the image point of the chief ray and goes through the centre of the paraxial
//! exit pupil (Welford, *Aberrations of Optical Systems*, 1986, section 7.2). With `off` the image
//! point of a ray from the centre `C`, `d` its direction, `a = off·d`, `b² = off² − a²` and σ = 1 for
//! a sphere in front of the image, −1 behind it, the ray leaves the image point for the sphere at
//! `−a + σ b²/(R + √(R² − b²))` beyond the chief ray: no difference of two radii. Its point `Q` of
//! the sphere has the direction cosines `(C − Q)/σR = (d √(R² − b²) + σ(a d − off))/R`. For an exit
//! pupil at infinity they are those of the ray, and the path is `−a`.

use super::AnalysisError;
use crate::lens::{IdealAction, Object, Shape, Surface};
use crate::math::{Real, Vec3};
use crate::pupil::{Launch, Region};
use crate::trace::{Ray, TraceSink as _};
use serde::Serialize;

/// The form of a reference sphere.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum ReferenceForm {
    /// A sphere with this radius in mm through the centre of the paraxial exit pupil, positive if it
    /// lies in front of the image.
    ExitPupil(f64),
    /// A sphere with this radius in mm, ten focal lengths, in place of one through an exit pupil so
    /// near the image that rays miss it.
    Replaced(f64),
    /// A sphere of infinite radius: the exit pupil is at infinity.
    Infinite,
    /// A plane across the chief ray: the lens is afocal.
    Plane,
}

impl ReferenceForm {
    /// The form of the sphere of a pupil.
    ///
    /// # Errors
    /// No ray of the pupil arrives.
    pub fn of_region(region: &Region<'_>) -> Result<Self, AnalysisError> {
        Ok(ReferenceSphere::for_region(region)?.form)
    }

    /// The length from a point of a ray near the image, at `off` from the centre of the sphere, to
    /// the sphere, beyond that of the ray through the centre, in mm; `None` if the ray misses the
    /// sphere, and for a plane, which has no centre.
    pub fn length_beyond<R: Real>(self, off: Vec3<R>, direction: Vec3<R>) -> Option<R> {
        self.meet(off, direction).map(|(beyond, _)| beyond)
    }

    /// [`ReferenceForm::length_beyond`], and the cosine of the angle between the ray and the normal
    /// of the sphere where they meet.
    #[inline(always)]
    fn meet<R: Real>(self, off: Vec3<R>, direction: Vec3<R>) -> Option<(R, R)> {
        let along = off.dot(direction);
        match self {
            Self::ExitPupil(signed) | Self::Replaced(signed) => {
                let (radius, sense) = (R::from_f64(signed.abs()), R::from_f64(signed.signum()));
                let square = off.dot(off) - along * along;
                let rest = radius * radius - square;
                if !(rest >= R::ZERO) {
                    return None;
                }
                let root = rest.sqrt();
                Some((sense * square / (radius + root) - along, root / radius))
            }
            Self::Infinite => Some((-along, R::ONE)),
            Self::Plane => None,
        }
    }

    /// One over the signed radius, in 1/mm; 0 for an infinite one.
    fn curvature(self) -> f64 {
        match self {
            Self::ExitPupil(radius) | Self::Replaced(radius) => radius.recip(),
            Self::Infinite | Self::Plane => 0.0,
        }
    }
}

/// The reference sphere of a field, with the chief ray that ends at its centre.
#[derive(Debug, Clone)]
pub(super) struct ReferenceSphere {
    pub(super) center: Vec3<f64>,
    /// The pupil point of the ray that ends there.
    pub(super) chief: [f64; 2],
    /// The direction of the chief ray.
    pub(super) direction: Vec3<f64>,
    /// The optical path of the chief ray to the image, in mm.
    pub(super) path: f64,
    pub(super) form: ReferenceForm,
    index: f64,
    /// The wavelength, in mm.
    pub(super) wavelength: f64,
}

/// A ray on the reference sphere.
#[derive(Debug, Clone, Copy)]
pub(super) struct SphereRay<R> {
    /// The path difference from the chief ray, in wavelengths.
    pub(super) waves: R,
    /// The direction cosines across the axis of the line from its point of the sphere to the centre.
    pub(super) cosines: [R; 2],
}

/// Refuses a lens through which the optical paths are not known.
pub(super) fn check_paths(launch: &Launch<'_>) -> Result<(), AnalysisError> {
    let surfaces = &launch.channel().system.surfaces;
    let is_lens = |s: &Surface<f64>| matches!(s.ideal, Some(IdealAction::Lens { .. }));
    let Some(first) = surfaces.iter().position(is_lens) else { return Ok(()) };
    let is_plane = |s: &Surface<f64>| {
        let is_flat = s.curvature() == 0.0 && !matches!(s.shape, Shape::Asphere { .. });
        is_flat && s.freeform.is_none() && s.grin.is_none() && s.ideal.is_none()
    };
    let (before, behind) = (&surfaces[..first], &surfaces[first + 1..]);
    let is_collimated = launch.model.beam.object == Object::Infinity;
    let is_known = is_collimated && before.iter().all(is_plane) && !behind.iter().any(is_lens);
    if is_known { Ok(()) } else { Err(AnalysisError::IdealPath) }
}

/// A sphere closer to the image than this many errors of its rays is replaced.
const CLEAR_OF_RAYS: f64 = 4.0;
/// The radius of the sphere in its place, in focal lengths.
const REPLACED: f64 = 10.0;

impl ReferenceSphere {
    /// The sphere of a launch about the image point of its chief ray.
    pub(super) fn new(launch: &Launch<'_>) -> Option<Self> {
        Self::about(launch, [0.0, 0.0])
    }

    /// The sphere of a pupil: about the image point of the chief ray, or of the ray at the centroid
    /// of the pupil if the chief ray is lost; away from the image if the exit pupil lies there.
    pub(super) fn for_region(region: &Region<'_>) -> Result<Self, AnalysisError> {
        check_paths(&region.launch)?;
        let nodes = region.nodes(1.min(region.orders().saturating_sub(1)));
        let (launched, landed) = region.launch.trace_points(&nodes.points);
        let lit: Vec<usize> =
            (0..launched.len()).filter(|ray| landed.fate(*ray).is_imaged()).collect();
        let centroid = || {
            let weight = |ray: &usize| nodes.weights[launched[*ray]];
            let total: f64 = lit.iter().map(weight).sum();
            let mean = |i: usize| {
                let part = |ray: &usize| weight(ray) * nodes.points[launched[*ray]][i] / total;
                lit.iter().map(part).sum()
            };
            [if nodes.mirrored { 0.0 } else { mean(0) }, mean(1)]
        };
        let sphere = Self::new(&region.launch).or_else(|| Self::about(&region.launch, centroid()));
        let mut sphere = sphere.ok_or(AnalysisError::NoChief)?;
        let off = |ray: &usize| {
            (landed.x[*ray] - sphere.center.x).hypot(landed.y[*ray] - sphere.center.y)
        };
        let farthest = lit.iter().map(off).fold(0.0, f64::max);
        sphere.keep_clear_of(farthest, &region.launch);
        Ok(sphere)
    }

    /// The sphere of a pupil whose light is focused.
    ///
    /// # Errors
    /// As those of [`ReferenceSphere::for_region`], and an afocal lens, whose plane has no centre.
    pub(super) fn focused(region: &Region<'_>) -> Result<Self, AnalysisError> {
        let sphere = Self::for_region(region)?;
        if sphere.form == ReferenceForm::Plane { Err(AnalysisError::Afocal) } else { Ok(sphere) }
    }

    /// The displacement along the light at which the phases of the sphere's cosines, which are linear in it, are
    /// those of an image plane displaced by `shift` mm, and the factor of frequencies there: the way from the exit
    /// pupil, along the chief ray, is another one.
    ///
    /// # Errors
    /// A plane that lies at the exit pupil or beyond it.
    pub(super) fn displaced(&self, shift: f64) -> Result<(f64, f64), AnalysisError> {
        let factor = 1.0 + shift * self.form.curvature() / self.direction.z.abs();
        if factor > 0.0 { Ok((shift / factor, factor)) } else { Err(AnalysisError::BeyondPupil) }
    }

    /// The place of a point about the centre at which linear phases of the sphere's cosines are those of light from
    /// its points: across the axis and along the light, in mm. Near enough that it lies behind the exit pupil.
    pub(super) fn place_of(&self, linear: [f64; 3]) -> [f64; 3] {
        let [x, y, z] = linear;
        let Vec3 { x: dx, y: dy, z: dz } = self.direction;
        // Along the chief ray.
        let along = dx * x + dy * y + dz.abs() * z;
        let rest = 1.0 - along * self.form.curvature();
        if rest > 0.0 { linear.map(|part| part / rest) } else { linear }
    }

    fn about(launch: &Launch<'_>, p: [f64; 2]) -> Option<Self> {
        let chief = launch.unclipped_landing(p)?;
        let path = launch.optical_path_to(launch.ray(p)?) + chief.opl.value;
        let system = &launch.channel().system;
        let (center, direction) = (chief.ray.point.value(), chief.ray.direction.value());
        let last = system.surfaces.len().checked_sub(2)?;
        let first_order = &launch.model.first_order;
        let form = match (first_order.efl, first_order.exit_pupil.position) {
            (None, _) => ReferenceForm::Plane,
            (Some(_), None) => ReferenceForm::Infinite,
            (Some(_), Some(z)) => {
                let away = center - Vec3::new(0.0, 0.0, z - system.surfaces[last].thickness);
                let sense = if away.z * direction.z < 0.0 { -1.0 } else { 1.0 };
                ReferenceForm::ExitPupil(sense * away.dot(away).sqrt())
            }
        };
        let index = system.surfaces[last].index;
        let wavelength = launch.channel().um * 1e-3;
        Some(Self { center, chief: p, direction, path, form, index, wavelength })
    }

    /// The same about the same point, in another form.
    pub(super) fn with_form(self, form: ReferenceForm) -> Self {
        Self { form, ..self }
    }

    /// Replaces a sphere that rays with errors up to `farthest` may miss.
    fn keep_clear_of(&mut self, farthest: f64, launch: &Launch<'_>) {
        if let ReferenceForm::ExitPupil(radius) = self.form
            && radius.abs() < CLEAR_OF_RAYS * farthest
        {
            let focal = launch.model.first_order.efl.unwrap_or(1.0).abs();
            self.form = ReferenceForm::Replaced(REPLACED * focal.max(farthest));
        }
    }

    /// The same sphere with twice the radius; the same one if that is infinite.
    pub(super) fn doubled(&self) -> Self {
        let form = match self.form {
            ReferenceForm::ExitPupil(radius) => ReferenceForm::ExitPupil(2.0 * radius),
            ReferenceForm::Replaced(radius) => ReferenceForm::Replaced(2.0 * radius),
            ReferenceForm::Infinite | ReferenceForm::Plane => self.form,
        };
        Self { form, ..self.clone() }
    }

    /// A ray at the image on the sphere, from its optical path up to the image; `None` if it misses
    /// the sphere.
    #[inline(always)]
    pub(super) fn project<R: Real>(&self, ray: Ray<R>, path: R) -> Option<SphereRay<R>> {
        let off = ray.point - Vec3::from_f64(self.center);
        let d = ray.direction;
        let (beyond, to_center) = if self.form == ReferenceForm::Plane {
            let chief = Vec3::from_f64(self.direction);
            (-(off.dot(chief) / d.dot(chief)), d)
        } else {
            let (beyond, cosine) = self.form.meet(off, d)?;
            let across = (d * off.dot(d) - off) * R::from_f64(self.form.curvature());
            (beyond, d * cosine + across)
        };
        let difference = R::from_f64(self.path) - path - R::from_f64(self.index) * beyond;
        let waves = difference * R::from_f64(1.0 / self.wavelength);
        Some(SphereRay { waves, cosines: [to_center.x, to_center.y] })
    }

    /// The wavelength in the image space, in mm.
    pub(super) fn medium_wavelength(&self) -> f64 {
        self.wavelength / self.index
    }

    /// The rounding error of a path, in wavelengths.
    pub(super) fn rounding(&self) -> f64 {
        let radius = match self.form {
            ReferenceForm::ExitPupil(radius) | ReferenceForm::Replaced(radius) => radius.abs(),
            ReferenceForm::Infinite | ReferenceForm::Plane => 0.0,
        };
        8.0 * f64::EPSILON * self.path.abs().max(radius) / self.wavelength
    }
}
