//! Surfaces that deflect light by a rule: a paraxial lens and a ruled grating.

use super::{FreeformKind, Row};
use crate::math::Real;
use serde::{Deserialize, Serialize};

/// A rule by which a surface deflects light beside refraction or reflection.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
pub enum IdealElement {
    /// A thin lens that images without aberrations: the slopes of a ray before and behind its plane
    /// follow `n' u' = n u − h/f`. The optical path is that of a plane wave in front of it, exact for a
    /// collimated beam; of a point at a finite distance it is not.
    Lens {
        /// The focal length f in air, in mm; negative for a diverging lens.
        focal_length: f64,
    },
    /// A grating with straight grooves parallel to x, equally spaced along y: the component of the
    /// optical direction along the surface grows by `order × wavelength × frequency` towards y. A
    /// mirror reflects the order.
    Grating {
        /// The frequency of the grooves, in 1/mm.
        lines_per_mm: f64,
        /// The diffraction order; light of order 0 is refracted or reflected.
        order: f64,
    },
}

/// The rule at one wavelength, in plain numbers.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum IdealAction<R> {
    /// A thin lens.
    Lens {
        /// One over the focal length in air, in 1/mm.
        power: R,
    },
    /// A grating.
    Grating {
        /// The growth of the optical direction along y.
        shift: R,
    },
    /// The phase of the freeform of the surface.
    Phase {
        /// The optical path that a phase of one radian in the first order adds, in mm.
        path: R,
    },
}

impl IdealElement {
    /// The name in texts.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Lens { .. } => "paraxial lens",
            Self::Grating { .. } => "grating",
        }
    }

    /// The rule at a wavelength `um` in micrometres.
    pub fn action(self, um: f64) -> IdealAction<f64> {
        match self {
            Self::Lens { focal_length } => IdealAction::Lens { power: focal_length.recip() },
            Self::Grating { lines_per_mm, order } => {
                IdealAction::Grating { shift: order * lines_per_mm * um * 1e-3 }
            }
        }
    }

    /// The same element with every length multiplied by `factor`; a grating keeps its angles.
    #[must_use]
    pub fn scaled(self, factor: f64) -> Self {
        match self {
            Self::Lens { focal_length } => Self::Lens { focal_length: focal_length * factor },
            Self::Grating { .. } => self,
        }
    }

    /// The fault of the element on a surface, as the rest of a sentence; `None` if there is none.
    pub(super) fn fault(self, row: &Row) -> Option<String> {
        if let Some(form) = row.freeform.as_ref().filter(|form| form.kind.is_phase()) {
            let (own, other) = (self.name(), form.kind.name());
            return Some(format!("a {own} and a {other} on one surface; expected one of them"));
        }
        match self {
            Self::Lens { focal_length } => {
                let plain = row.curvature == 0.0 && row.asphere.iter().all(|a| *a == 0.0);
                if !(focal_length.is_finite() && focal_length.abs() > 1e-9) {
                    return Some(format!(
                        "the focal length of the paraxial lens is {focal_length}; expected a finite \
                         one other than 0"
                    ));
                }
                let mirror = row.medium == super::Medium::Mirror;
                (mirror || !plain || row.freeform.is_some()).then(|| {
                    "a paraxial lens is a plane that light goes through; found a mirror or a curved \
                     surface"
                        .to_owned()
                })
            }
            Self::Grating { lines_per_mm, order } => {
                let finite = lines_per_mm.abs() <= 1e9 && order.abs() <= 1e9;
                (!finite).then(|| {
                    format!("the grating has {lines_per_mm} lines/mm and the order {order}")
                })
            }
        }
    }
}

impl IdealAction<f64> {
    /// The rule of a freeform at a wavelength `um` in micrometres; `None` for one that adds to the sag.
    pub(super) fn of_form(kind: FreeformKind, um: f64) -> Option<Self> {
        kind.order().map(|order| Self::Phase { path: order * um * 1e-3 / std::f64::consts::TAU })
    }
}

impl<R: Real> IdealAction<R> {
    /// The same rule with its number mapped by `f`.
    pub fn map<S: Real>(self, f: impl Fn(R) -> S) -> IdealAction<S> {
        match self {
            Self::Lens { power } => IdealAction::Lens { power: f(power) },
            Self::Grating { shift } => IdealAction::Grating { shift: f(shift) },
            Self::Phase { path } => IdealAction::Phase { path: f(path) },
        }
    }

    /// The power that first-order optics adds at the surface, in 1/mm.
    pub fn power(self) -> R {
        match self {
            Self::Lens { power } => power,
            Self::Grating { .. } | Self::Phase { .. } => R::ZERO,
        }
    }

    /// The number of the rule.
    pub fn number(self) -> R {
        match self {
            Self::Lens { power } => power,
            Self::Grating { shift } => shift,
            Self::Phase { path } => path,
        }
    }
}
