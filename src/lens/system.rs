//! A lens resolved to plain numbers: one wavelength, one zoom position.

use super::{ASPHERE_TERMS, ProfileCoefficients, RotationalProfile};
use crate::math::{Real, format_short};

/// The form of a surface: `z = c r² / (1 + √(1 − (1+k) c² r²)) + Σ aⱼ r^(2j+4)`.
///
/// What is left out is not computed: a plane is no sphere, a sphere has no conic constant, and
/// only an asphere needs an iteration.
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

    /// The simplest form with these numbers, coefficients of r⁴, r⁶, ... as far as there are any.
    ///
    /// # Errors
    /// More coefficients than the model has.
    pub fn new(curvature: R, conic: R, terms: &[R], surface: usize) -> Result<Self, SystemError> {
        if terms.len() > ASPHERE_TERMS {
            return Err(SystemError::TooManyTerms { surface, found: terms.len() });
        }
        let mut all = [R::ZERO; ASPHERE_TERMS];
        all[..terms.len()].copy_from_slice(terms);
        Ok(Self::simplest(curvature, conic, all))
    }

    /// Curvature at the vertex, conic constant and polynomial, zero where the form has none.
    pub fn numbers(&self) -> (R, R, [R; ASPHERE_TERMS]) {
        match *self {
            Self::Plane => (R::ZERO, R::ZERO, [R::ZERO; ASPHERE_TERMS]),
            Self::Sphere { curvature } => (curvature, R::ZERO, [R::ZERO; ASPHERE_TERMS]),
            Self::Conic { curvature, conic } => (curvature, conic, [R::ZERO; ASPHERE_TERMS]),
            Self::Asphere { curvature, conic, terms } => (curvature, conic, terms),
        }
    }

    /// The same surface written as a conic, so that its derivative by the conic constant exists;
    /// an asphere stays one.
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

    /// The same surface written as an asphere, so that its derivatives by the coefficients exist.
    #[must_use]
    pub fn as_asphere(self) -> Self {
        let (curvature, conic, terms) = self.numbers();
        Self::Asphere { curvature, conic, terms }
    }

    /// The curvature at the vertex.
    pub fn curvature(&self) -> R {
        self.numbers().0
    }

    /// The sag at the square `r2` of the distance from the axis, and its derivative by `r2`;
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

/// One surface and the gap behind it, in numbers.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Surface<R> {
    /// Its form.
    pub shape: Shape<R>,
    /// The distance along the axis to the next vertex, in mm; unused at the last surface.
    pub thickness: R,
    /// The index behind the surface, positive after mirrors too; of a gradient that on the axis at
    /// the vertex.
    pub index: R,
    /// How the index of the gap varies; `None` for glass.
    pub grin: Option<ProfileCoefficients<R>>,
    /// Rays farther from the axis are clipped, the rim itself passes; infinite where nothing is.
    pub semi_diameter: R,
    /// Rays nearer to the axis are clipped, the edge itself passes; 0 where nothing is obstructed.
    pub obstruction: R,
    /// Whether it reflects.
    pub mirror: bool,
    /// Whether the far half of the sphere or ellipsoid counts too.
    pub hyperhemisphere: bool,
}

/// A lens in plain numbers. The last surface is where rays are collected, as a rule the image
/// plane.
#[derive(Debug, Clone, PartialEq)]
pub struct System<R> {
    /// The index in front of the first surface.
    pub index_before: R,
    /// The surfaces in the order in which light meets them, the image plane last.
    pub surfaces: Vec<Surface<R>>,
    /// The surface that is the aperture stop, if one is marked.
    pub stop: Option<usize>,
}

/// A number that no ray can be traced with.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum SystemError {
    /// Nothing to trace through.
    #[error("the lens has no surfaces")]
    NoSurfaces,
    /// Not finite, or so large or small that its square is not.
    #[error(
        "{what} of surface {surface} is {}; expected a finite number below 1e100",
        format_short(*found)
    )]
    NotFinite {
        /// What about the surface.
        what: &'static str,
        /// The surface, counted from 0.
        surface: usize,
        /// The value.
        found: f64,
    },
    /// An index that is not positive.
    #[error("index {place} is {}; expected a positive finite number", format_short(*found))]
    Index {
        /// `before surface 0` or `after surface 3`.
        place: String,
        /// The value.
        found: f64,
    },
    /// A negative semi-diameter, or none.
    #[error("semi-diameter of surface {surface} is {found}; expected zero or more")]
    SemiDiameter {
        /// The surface, counted from 0.
        surface: usize,
        /// The value.
        found: f64,
    },
    /// An obstruction that is negative or leaves no light.
    #[error(
        "obstruction of surface {surface} is {found}; expected zero or more, and less than the \
         semi-diameter {semi_diameter}"
    )]
    Obstruction {
        /// The surface, counted from 0.
        surface: usize,
        /// The value.
        found: f64,
        /// The semi-diameter.
        semi_diameter: f64,
    },
    /// More coefficients than the model has.
    #[error("surface {surface} has {found} asphere coefficients; expected at most 7 (r^4 to r^16)")]
    TooManyTerms {
        /// The surface, counted from 0.
        surface: usize,
        /// How many there are.
        found: usize,
    },
    /// A gradient where none can be traced.
    #[error("the gradient after surface {surface} {why}")]
    Grin {
        /// The surface, counted from 0.
        surface: usize,
        /// Why not.
        why: String,
    },
    /// A ray that starts nowhere or goes nowhere.
    #[error("ray {ray}: {found}; expected a finite start and a direction of length 1 within 1e-9")]
    Ray {
        /// Which ray of the batch, counted from 0.
        ray: usize,
        /// What is wrong with it.
        found: String,
    },
}

/// Beyond this the squares that tracing needs are no longer finite.
const LARGEST: f64 = 1e100;

fn check_finite(what: &'static str, surface: usize, found: f64) -> Result<(), SystemError> {
    if found.abs() <= LARGEST {
        Ok(())
    } else {
        Err(SystemError::NotFinite { what, surface, found })
    }
}

fn check_index(place: impl FnOnce() -> String, found: f64) -> Result<(), SystemError> {
    if found > 0.0 && found <= LARGEST {
        Ok(())
    } else {
        Err(SystemError::Index { place: place(), found })
    }
}

impl<R: Real> System<R> {
    /// Refuses numbers that no ray can be traced with.
    pub fn check(&self) -> Result<(), SystemError> {
        if self.surfaces.is_empty() {
            return Err(SystemError::NoSurfaces);
        }
        check_index(|| "before surface 0".to_owned(), self.index_before.value())?;
        self.surfaces.iter().enumerate().try_for_each(|(i, surface)| surface.check(i))?;
        let mut graded = (0..self.surfaces.len()).filter(|i| self.surfaces[*i].grin.is_some());
        graded.try_for_each(|i| self.check_grin(i))
    }

    /// A gradient needs two faces: refracting ones that no ray meets from behind their equator.
    fn check_grin(&self, i: usize) -> Result<(), SystemError> {
        let refuse = |why: &str| Err(SystemError::Grin { surface: i, why: why.to_owned() });
        match (&self.surfaces[i], self.surfaces.get(i + 1)) {
            (_, None) => refuse("has no surface behind it"),
            (face, Some(next)) if face.mirror || next.mirror => {
                refuse("touches a mirror, which is not supported; expected refracting faces")
            }
            (face, Some(next)) if face.hyperhemisphere || next.hyperhemisphere => refuse(
                "touches a hyper-hemisphere, which is not supported; expected faces on this side \
                 of their equator",
            ),
            _ => Ok(()),
        }
    }

    /// The gradient in the gap behind a surface, if there is one.
    pub fn gradient(&self, surface: usize) -> Option<RotationalProfile<R>> {
        self.surfaces.get(surface)?.gradient()
    }

    /// Whether any gap is filled with a gradient.
    pub fn has_grin(&self) -> bool {
        self.surfaces.iter().any(|surface| surface.grin.is_some())
    }

    /// The same numbers as another number type, without derivatives.
    pub fn cast<S: Real>(&self) -> System<S> {
        let lift = |value: R| S::from_f64(value.value());
        System {
            index_before: lift(self.index_before),
            surfaces: self.surfaces.iter().map(|surface| surface.map(lift)).collect(),
            stop: self.stop,
        }
    }

    /// The index in front of a surface.
    pub fn index_before(&self, surface: usize) -> R {
        if surface == 0 { self.index_before } else { self.surfaces[surface - 1].index }
    }
}

impl<R: Real> Surface<R> {
    fn check(&self, i: usize) -> Result<(), SystemError> {
        let (curvature, conic, terms) = self.shape.numbers();
        check_finite("curvature", i, curvature.value())?;
        check_finite("conic constant", i, conic.value())?;
        terms.iter().try_for_each(|a| check_finite("asphere coefficient", i, a.value()))?;
        check_finite("thickness", i, self.thickness.value())?;
        check_index(|| format!("after surface {i}"), self.index.value())?;
        if let Some(grade) = &self.grin {
            grade
                .terms
                .iter()
                .try_for_each(|a| check_finite("gradient coefficient", i, a.value()))?;
        }
        let (semi_diameter, obstruction) = (self.semi_diameter.value(), self.obstruction.value());
        if !(semi_diameter >= 0.0) {
            return Err(SystemError::SemiDiameter { surface: i, found: semi_diameter });
        }
        let leaves_light = obstruction > 0.0 && obstruction < semi_diameter;
        if obstruction == 0.0 || leaves_light && obstruction <= LARGEST {
            Ok(())
        } else {
            Err(SystemError::Obstruction { surface: i, found: obstruction, semi_diameter })
        }
    }

    /// The gradient in the gap behind, if there is one.
    pub fn gradient(&self) -> Option<RotationalProfile<R>> {
        self.grin.map(|grade| RotationalProfile { base: self.index, coefficients: grade })
    }

    /// Takes away what clips: rim and obstruction.
    pub fn remove_apertures(&mut self) {
        self.semi_diameter = R::from_f64(f64::INFINITY);
        self.obstruction = R::ZERO;
    }

    /// The same surface with every number mapped.
    pub fn map<S: Real>(&self, f: impl Fn(R) -> S) -> Surface<S> {
        let shape = match self.shape {
            Shape::Plane => Shape::Plane,
            Shape::Sphere { curvature } => Shape::Sphere { curvature: f(curvature) },
            Shape::Conic { curvature, conic } => {
                Shape::Conic { curvature: f(curvature), conic: f(conic) }
            }
            Shape::Asphere { curvature, conic, terms } => {
                Shape::Asphere { curvature: f(curvature), conic: f(conic), terms: terms.map(&f) }
            }
        };
        Surface {
            shape,
            thickness: f(self.thickness),
            index: f(self.index),
            grin: self.grin.map(|grade| grade.map(&f)),
            semi_diameter: f(self.semi_diameter),
            obstruction: f(self.obstruction),
            mirror: self.mirror,
            hyperhemisphere: self.hyperhemisphere,
        }
    }
}
