//! A lens resolved to plain numbers, at one wavelength and one zoom position.

use super::{
    ASPHERE_TERMS, Freeform, IdealAction, MediumPlace, Pose, ProfileCoefficients,
    RotationalProfile, SurfaceAperture, SurfaceNumber, surface_aperture,
};
use crate::math::{Real, format_short};

/// The form of a surface: `z = c r² / (1 + √(1 − (1+k) c² r²)) + Σ aⱼ r^(2j+4)`.
///
/// Each form computes only what it needs: a sphere has no conic constant, and only an asphere is
/// intersected by an iteration.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Shape<R> {
    /// `z = 0`.
    Plane,
    /// A sphere.
    Sphere {
        /// One over the radius.
        curvature: R,
    },
    /// A conic of revolution.
    Conic {
        /// One over the vertex radius.
        curvature: R,
        /// The conic constant.
        conic: R,
    },
    /// A conic with a polynomial in r².
    Asphere {
        /// One over the vertex radius of the conic.
        curvature: R,
        /// The conic constant.
        conic: R,
        /// Coefficients of r⁴ to r¹⁶.
        terms: [R; ASPHERE_TERMS],
    },
}

impl<R: Real> Shape<R> {
    /// The same form with each number in another type.
    fn map<S: Real>(self, f: impl Fn(R) -> S) -> Shape<S> {
        match self {
            Self::Plane => Shape::Plane,
            Self::Sphere { curvature } => Shape::Sphere { curvature: f(curvature) },
            Self::Conic { curvature, conic } => {
                Shape::Conic { curvature: f(curvature), conic: f(conic) }
            }
            Self::Asphere { curvature, conic, terms } => {
                Shape::Asphere { curvature: f(curvature), conic: f(conic), terms: terms.map(f) }
            }
        }
    }

    /// The simplest form with these numbers.
    pub fn simplest(curvature: R, conic: R, terms: [R; ASPHERE_TERMS]) -> Self {
        if terms.iter().any(|a| a.value() != 0.0) {
            Self::Asphere { curvature, conic, terms }
        } else if conic.value() != 0.0 {
            Self::Conic { curvature, conic }
        } else if curvature.value() != 0.0 {
            Self::Sphere { curvature }
        } else {
            Self::Plane
        }
    }

    /// The simplest form with these numbers; `terms` are the coefficients of r⁴, r⁶, …, at most
    /// [`ASPHERE_TERMS`].
    ///
    /// # Errors
    /// [`SystemError::TooManyTerms`], which names `surface`.
    pub fn new(curvature: R, conic: R, terms: &[R], surface: usize) -> Result<Self, SystemError> {
        if terms.len() > ASPHERE_TERMS {
            return Err(SystemError::TooManyTerms { surface: surface.into(), found: terms.len() });
        }
        let mut all = [R::ZERO; ASPHERE_TERMS];
        all[..terms.len()].copy_from_slice(terms);
        Ok(Self::simplest(curvature, conic, all))
    }

    /// The curvature at the vertex in 1/mm, the conic constant and the coefficients of r⁴ to r¹⁶; zero
    /// where the form has none.
    pub fn numbers(&self) -> (R, R, [R; ASPHERE_TERMS]) {
        match *self {
            Self::Plane => (R::ZERO, R::ZERO, [R::ZERO; ASPHERE_TERMS]),
            Self::Sphere { curvature } => (curvature, R::ZERO, [R::ZERO; ASPHERE_TERMS]),
            Self::Conic { curvature, conic } => (curvature, conic, [R::ZERO; ASPHERE_TERMS]),
            Self::Asphere { curvature, conic, terms } => (curvature, conic, terms),
        }
    }

    /// The same surface as a conic, so that its derivative by the conic constant exists; an asphere
    /// remains an asphere.
    #[must_use]
    pub fn as_conic(self) -> Self {
        match self {
            Self::Plane | Self::Sphere { .. } | Self::Conic { .. } => {
                let (curvature, conic, _) = self.numbers();
                Self::Conic { curvature, conic }
            }
            Self::Asphere { .. } => self,
        }
    }

    /// The same surface as an asphere, so that its derivatives by the coefficients exist.
    #[must_use]
    pub fn as_asphere(self) -> Self {
        let (curvature, conic, terms) = self.numbers();
        Self::Asphere { curvature, conic, terms }
    }

    /// The same surface with these added to its curvature, to its conic constant and to its coefficient
    /// of r⁴; a form without one of these numbers ignores it, but a plane becomes a sphere.
    #[must_use]
    pub fn with_added(self, by_curvature: R, by_conic: R, by_fourth: R) -> Self {
        match self {
            Self::Plane => Self::Sphere { curvature: by_curvature },
            Self::Sphere { curvature } => Self::Sphere { curvature: curvature + by_curvature },
            Self::Conic { curvature, conic } => {
                Self::Conic { curvature: curvature + by_curvature, conic: conic + by_conic }
            }
            Self::Asphere { curvature, conic, mut terms } => {
                terms[0] += by_fourth;
                let (curvature, conic) = (curvature + by_curvature, conic + by_conic);
                Self::Asphere { curvature, conic, terms }
            }
        }
    }

    /// The same form with all lengths times a factor: a curvature is divided by it, a coefficient of `rⁿ` by
    /// its power `n − 1`.
    #[must_use]
    pub fn scaled(self, factor: f64) -> Self {
        let by = |power: i32| R::from_f64(factor.powi(-power));
        match self {
            Self::Plane => Self::Plane,
            Self::Sphere { curvature } => Self::Sphere { curvature: curvature * by(1) },
            Self::Conic { curvature, conic } => Self::Conic { curvature: curvature * by(1), conic },
            Self::Asphere { curvature, conic, mut terms } => {
                for (term, power) in terms.iter_mut().zip((3..).step_by(2)) {
                    *term = *term * by(power);
                }
                Self::Asphere { curvature: curvature * by(1), conic, terms }
            }
        }
    }

    /// The curvature at the vertex, in 1/mm.
    pub fn curvature(&self) -> R {
        self.numbers().0
    }

    /// The sag in mm at the square `r2` of the distance from the axis, and its derivative by `r2`;
    /// `None` beyond the edge of the surface.
    #[inline(always)]
    pub fn sag(&self, r2: R) -> Option<(R, R)> {
        let (c, k, terms) = self.numbers();
        let radicand = R::ONE - (R::ONE + k) * c * c * r2;
        if radicand < R::ZERO {
            return None;
        }
        let root = radicand.sqrt();
        let (mut sum, mut slope) = (R::ZERO, R::ZERO);
        for a in terms.into_iter().rev() {
            slope = slope * r2 + sum;
            sum = sum * r2 + a;
        }
        // sum = Σ aⱼ r2^j, slope its derivative; the polynomial is r2² times the sum.
        let polynomial = sum * r2 * r2;
        let polynomial_slope = (slope * r2 + sum + sum) * r2;
        Some((c * r2 / (R::ONE + root) + polynomial, c / (root + root) + polynomial_slope))
    }
}

/// One surface and the gap behind it, in plain numbers.
#[derive(Debug, Clone, PartialEq)]
pub struct Surface<R> {
    /// The form of the surface.
    pub shape: Shape<R>,
    /// The distance along the axis to the next vertex, in mm; unused at the last surface.
    pub thickness: R,
    /// The index behind the surface, positive after mirrors too; of a GRIN medium the index on the
    /// axis at the vertex.
    pub index: R,
    /// The coefficients of the GRIN medium in the gap; `None` for a homogeneous one.
    pub grin: Option<ProfileCoefficients<R>>,
    /// The radius of the clear aperture in mm; rays farther from the axis are clipped, those exactly
    /// on the rim pass. Infinite for an unlimited surface.
    pub semi_diameter: R,
    /// The radius of the central obstruction in mm; rays nearer to the axis are clipped, those
    /// exactly on its edge pass. 0 for none.
    pub obstruction: R,
    /// The apertures and obscurations that are no circles about the vertex, in the surface's own frame.
    pub apertures: Vec<SurfaceAperture>,
    /// True for a mirror.
    pub mirror: bool,
    /// True if the far half of the sphere or ellipsoid belongs to the surface too.
    pub hyperhemisphere: bool,
    /// The position of the surface if it is decentred or tilted; `None` for a centred one.
    pub pose: Option<Pose<R>>,
    /// The frame of the axis behind the surface in that of the axis in front of it, both with their
    /// origin at the vertex; `None` where the axis is not broken.
    pub axis: Option<Pose<R>>,
    /// The coefficient of y², in 1/mm, that is added to the sag in the surface's own frame: the part of
    /// an irregularity that is not rotationally symmetric. `None` for a surface of revolution.
    pub astigmatism: Option<R>,
    /// The form that the sag has beside the conic and its even powers; `None` for none.
    pub freeform: Option<Box<Freeform<R>>>,
    /// The rule by which the surface deflects light beside; `None` for none.
    pub ideal: Option<IdealAction<R>>,
}

/// A lens in plain numbers. Rays end at the last surface, as a rule the image plane.
#[derive(Debug, Clone, PartialEq)]
pub struct System<R> {
    /// The index in front of the first surface.
    pub index_before: R,
    /// The surfaces in the order in which light meets them, the image plane last.
    pub surfaces: Vec<Surface<R>>,
    /// The surface that is the aperture stop, if one is marked.
    pub stop: Option<usize>,
}

/// A system or ray that cannot be traced.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum SystemError {
    /// There is no surface.
    #[error("the lens has no surfaces")]
    NoSurfaces,
    /// A number is not finite, or its square would not be.
    #[error(
        "{what} of surface {surface} is {}; expected a finite number below 1e100",
        format_short(*found)
    )]
    NotFinite {
        /// The name of the number.
        what: &'static str,
        /// The surface.
        surface: SurfaceNumber,
        /// The value.
        found: f64,
    },
    /// A refractive index is not positive.
    #[error("index {place} is {}; expected a positive finite number", format_short(*found))]
    Index {
        /// The gap.
        place: MediumPlace,
        /// The value.
        found: f64,
    },
    /// A semi-diameter is negative or not a number.
    #[error("semi-diameter of surface {surface} is {found}; expected zero or more")]
    SemiDiameter {
        /// The surface.
        surface: SurfaceNumber,
        /// The value.
        found: f64,
    },
    /// An obstruction is negative or blocks all light.
    #[error(
        "obstruction of surface {surface} is {found}; expected zero or more, and less than the \
         semi-diameter {semi_diameter}"
    )]
    Obstruction {
        /// The surface.
        surface: SurfaceNumber,
        /// The value.
        found: f64,
        /// The semi-diameter.
        semi_diameter: f64,
    },
    /// An aperture that is no circle about the vertex has a fault.
    #[error("aperture {aperture} of surface {surface} {why}")]
    Aperture {
        /// The surface.
        surface: SurfaceNumber,
        /// The number of the aperture, from 1.
        aperture: usize,
        /// The fault, as the rest of a sentence.
        why: String,
    },
    /// A surface has more asphere coefficients than [`ASPHERE_TERMS`].
    #[error("surface {surface} has {found} asphere coefficients; expected at most 7 (r^4 to r^16)")]
    TooManyTerms {
        /// The surface.
        surface: SurfaceNumber,
        /// The number of coefficients.
        found: usize,
    },
    /// A GRIN medium cannot be traced.
    #[error("the GRIN medium after surface {surface} {why}")]
    Grin {
        /// The surface in front of it.
        surface: SurfaceNumber,
        /// The reason, as the rest of a sentence.
        why: String,
    },
    /// A method that supports centred surfaces only meets another one.
    #[error(
        "surface {surface} is decentred, tilted, irregular, a freeform or an ideal element, or the axis \
         is broken there, which {what} does not support{hint}"
    )]
    Posed {
        /// The surface.
        surface: SurfaceNumber,
        /// The method, as the subject of a sentence.
        what: &'static str,
        /// The expected value, if there is one.
        hint: &'static str,
    },
    /// The start or the direction of a ray is not valid.
    #[error(
        "ray {ray}: {found}; expected a start of finite numbers up to 1e100 mm and a direction of \
         length 1 within 1e-9"
    )]
    Ray {
        /// The index of the ray in its batch.
        ray: usize,
        /// The fault.
        found: String,
    },
}

/// The largest magnitude whose square, which tracing needs, is finite with certainty.
const LARGEST: f64 = 1e100;

fn check_finite(what: &'static str, surface: usize, found: f64) -> Result<(), SystemError> {
    if found.abs() <= LARGEST {
        Ok(())
    } else {
        Err(SystemError::NotFinite { what, surface: surface.into(), found })
    }
}

fn check_index(place: MediumPlace, found: f64) -> Result<(), SystemError> {
    if found > 0.0 && found <= LARGEST { Ok(()) } else { Err(SystemError::Index { place, found }) }
}

impl Surface<f64> {
    /// The largest distance from the vertex in mm at which light passes: the semi-diameter, or what other
    /// apertures leave of it.
    pub fn outer_radius(&self) -> f64 {
        self.apertures.iter().map(SurfaceAperture::reach).fold(self.semi_diameter, f64::min)
    }
}

impl<R: Real> System<R> {
    /// Checks that rays can be traced through the system.
    ///
    /// # Errors
    /// The first number that makes that impossible.
    pub fn check(&self) -> Result<(), SystemError> {
        if self.surfaces.is_empty() {
            return Err(SystemError::NoSurfaces);
        }
        check_index(MediumPlace::Object, self.index_before.value())?;
        self.surfaces.iter().enumerate().try_for_each(|(i, surface)| surface.check(i))?;
        let mut gaps = (0..self.surfaces.len()).filter(|i| self.surfaces[*i].grin.is_some());
        gaps.try_for_each(|i| self.check_grin(i))
    }

    /// Checks that a GRIN medium lies between two refracting surfaces without a far half.
    fn check_grin(&self, i: usize) -> Result<(), SystemError> {
        let refuse = |why: &str| Err(SystemError::Grin { surface: i.into(), why: why.to_owned() });
        match (&self.surfaces[i], self.surfaces.get(i + 1)) {
            (_, None) => refuse("has no surface behind it"),
            (front, Some(back)) if front.mirror || back.mirror => {
                refuse("touches a mirror, which is not supported; expected refracting surfaces")
            }
            (front, Some(back)) if front.hyperhemisphere || back.hyperhemisphere => refuse(
                "touches a hyperhemisphere, which is not supported; expected surfaces that end at \
                 their equator",
            ),
            (front, Some(back)) if front.is_mounted() || back.is_mounted() => refuse(
                "touches a decentred, tilted, irregular or freeform surface, which is not supported; \
                 expected centred surfaces of revolution",
            ),
            _ => Ok(()),
        }
    }

    /// The index profile of the gap behind a surface; `None` for a homogeneous medium.
    pub fn grin_profile(&self, surface: usize) -> Option<RotationalProfile<R>> {
        self.surfaces.get(surface)?.grin_profile()
    }

    /// True if any surface is decentred, tilted, irregular, a freeform or an ideal element.
    pub fn has_poses(&self) -> bool {
        self.surfaces.iter().any(Surface::is_mounted)
    }

    /// True if the lens is the same after any turn about its axis.
    pub fn has_rotational_symmetry(&self) -> bool {
        self.surfaces.iter().all(|surface| {
            let is_centred = surface.pose.is_none() && surface.axis.is_none();
            let is_grating = matches!(surface.ideal, Some(IdealAction::Grating { .. }));
            let is_round = surface.freeform.as_ref().is_none_or(|form| form.kind.is_round());
            let is_clear = surface.has_round_apertures();
            is_centred && is_round && is_clear && surface.astigmatism.is_none() && !is_grating
        })
    }

    /// True if all apertures are the same after any turn about the vertex of their surface.
    pub fn has_round_apertures(&self) -> bool {
        self.surfaces.iter().all(Surface::has_round_apertures)
    }

    /// True if the axis is broken at any surface.
    pub fn has_broken_axis(&self) -> bool {
        self.surfaces.iter().any(|surface| surface.axis.is_some())
    }

    /// True if the whole lens mirrors itself at the y-z plane: no surface is decentred along x or
    /// tilted about y.
    pub fn mirrors_in_x(&self) -> bool {
        self.surfaces.iter().all(Surface::mirrors_in_x)
    }

    /// True if any gap is filled with a GRIN medium.
    pub fn has_grin(&self) -> bool {
        self.surfaces.iter().any(|surface| surface.grin.is_some())
    }

    /// The same system over another number type, without derivatives.
    pub fn cast<S: Real>(&self) -> System<S> {
        let cast = |value: R| S::from_f64(value.value());
        System {
            index_before: cast(self.index_before),
            surfaces: self.surfaces.iter().map(|surface| surface.map(cast)).collect(),
            stop: self.stop,
        }
    }

    /// The index in front of a surface.
    pub fn index_before(&self, surface: usize) -> R {
        if surface == 0 { self.index_before } else { self.surfaces[surface - 1].index }
    }
}

impl<R: Real> Surface<R> {
    /// A plane without apertures, with a homogeneous medium behind it.
    pub fn plane(thickness: R, index: R) -> Self {
        Self {
            shape: Shape::Plane,
            thickness,
            index,
            semi_diameter: R::from_f64(f64::INFINITY),
            obstruction: R::ZERO,
            apertures: Vec::new(),
            mirror: false,
            hyperhemisphere: false,
            grin: None,
            pose: None,
            axis: None,
            astigmatism: None,
            freeform: None,
            ideal: None,
        }
    }

    /// True if the surface is decentred, tilted, irregular, a freeform or an ideal element, or the axis is
    /// broken there.
    pub fn is_mounted(&self) -> bool {
        let placed = self.pose.is_some() || self.axis.is_some();
        let shaped = self.astigmatism.is_some() || self.freeform.is_some();
        placed || shaped || self.ideal.is_some()
    }

    /// The curvature of the section with the y-z plane at the vertex, in 1/mm, which first-order optics
    /// takes; an irregularity is left out.
    pub fn curvature(&self) -> R {
        let Some(form) = &self.freeform else { return self.shape.curvature() };
        form.vertex_curvatures(&self.shape)[1]
    }

    /// The power in 1/mm that a paraxial lens, or a phase in the section with the y-z plane, adds to that
    /// of refraction.
    pub fn added_power(&self) -> R {
        match (self.ideal, &self.freeform) {
            (Some(IdealAction::Phase { path }), Some(form)) => {
                -(path * form.phase_bends(R::ZERO, R::ZERO)[2])
            }
            (ideal, _) => ideal.map_or(R::ZERO, IdealAction::power),
        }
    }

    /// True if the surface and the axis behind it mirror themselves at the y-z plane.
    fn mirrors_in_x(&self) -> bool {
        let upright = |pose: &Pose<R>| {
            pose.shift.x == R::ZERO && pose.turn[0].y == R::ZERO && pose.turn[0].z == R::ZERO
        };
        let even = self.freeform.as_ref().is_none_or(|form| form.mirrors_in_x());
        // Half of a pupil would not tell the derivative by the position of a figure.
        let even = even && surface_aperture::are_round(&self.apertures);
        even && self.pose.as_ref().is_none_or(upright) && self.axis.as_ref().is_none_or(upright)
    }

    fn check(&self, i: usize) -> Result<(), SystemError> {
        self.check_pose(i)?;
        let (curvature, conic, terms) = self.shape.numbers();
        check_finite("curvature", i, curvature.value())?;
        check_finite("conic constant", i, conic.value())?;
        terms.iter().try_for_each(|a| check_finite("asphere coefficient", i, a.value()))?;
        check_finite("thickness", i, self.thickness.value())?;
        check_index(MediumPlace::behind(i), self.index.value())?;
        if let Some(grade) = &self.grin {
            grade.terms.iter().try_for_each(|a| check_finite("GRIN coefficient", i, a.value()))?;
        }
        for (k, aperture) in self.apertures.iter().enumerate() {
            if let Some(why) = aperture.fault() {
                return Err(SystemError::Aperture { surface: i.into(), aperture: k + 1, why });
            }
        }
        let (semi_diameter, obstruction) = (self.semi_diameter.value(), self.obstruction.value());
        if !(semi_diameter >= 0.0) {
            return Err(SystemError::SemiDiameter { surface: i.into(), found: semi_diameter });
        }
        let leaves_light = obstruction > 0.0 && obstruction < semi_diameter;
        if obstruction == 0.0 || leaves_light && obstruction <= LARGEST {
            Ok(())
        } else {
            Err(SystemError::Obstruction { surface: i.into(), found: obstruction, semi_diameter })
        }
    }

    fn check_pose(&self, i: usize) -> Result<(), SystemError> {
        if let Some(astigmatism) = self.astigmatism {
            check_finite("astigmatism", i, astigmatism.value())?;
        }
        if let Some(ideal) = self.ideal {
            check_finite("power or deflection", i, ideal.number().value())?;
        }
        if let Some(form) = &self.freeform {
            form.numbers.iter().try_for_each(|a| check_finite("freeform number", i, a.value()))?;
        }
        for Pose { shift, turn } in [self.pose, self.axis].into_iter().flatten() {
            for v in [shift, turn[0], turn[1], turn[2]] {
                [v.x, v.y, v.z].iter().try_for_each(|c| check_finite("pose", i, c.value()))?;
            }
        }
        Ok(())
    }

    /// The index profile of the gap behind the surface; `None` for a homogeneous medium.
    pub fn grin_profile(&self) -> Option<RotationalProfile<R>> {
        self.grin.map(|grade| RotationalProfile { base: self.index, coefficients: grade })
    }

    /// True if all apertures are the same after any turn about the vertex.
    pub fn has_round_apertures(&self) -> bool {
        surface_aperture::are_round(&self.apertures)
    }

    /// Removes what clips: the clear aperture, the obstruction and the other apertures.
    pub fn remove_apertures(&mut self) {
        self.semi_diameter = R::from_f64(f64::INFINITY);
        self.obstruction = R::ZERO;
        self.apertures.clear();
    }

    /// The same surface with every number mapped by `f`.
    pub fn map<S: Real>(&self, f: impl Fn(R) -> S) -> Surface<S> {
        Surface {
            shape: self.shape.map(&f),
            thickness: f(self.thickness),
            index: f(self.index),
            grin: self.grin.map(|grin| grin.map(&f)),
            semi_diameter: f(self.semi_diameter),
            obstruction: f(self.obstruction),
            apertures: self.apertures.clone(),
            mirror: self.mirror,
            hyperhemisphere: self.hyperhemisphere,
            pose: self.pose.map(|pose| pose.map(&f)),
            axis: self.axis.map(|axis| axis.map(&f)),
            astigmatism: self.astigmatism.map(&f),
            freeform: self.freeform.as_ref().map(|form| Box::new(form.map(&f))),
            ideal: self.ideal.map(|ideal| ideal.map(&f)),
        }
    }
}
