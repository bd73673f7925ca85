//! What "better" means: a sum of weighted terms, each with its derivative for every variable.
//!
//! Every term is a sum of squares of residuals, so that the same text serves first-order search
//! (value and gradient) and least squares (the normal equations). Spots are integrals over the
//! pupil: their nodes are found once to a tolerance and then kept while the lens moves, so that a
//! search sees a smooth function; [`Merit::resample`] finds them anew. Derivatives of the rays come
//! from the backward pass, those of first-order data from dual numbers.
//!
//! The pupil is kept: this is the biased derivative of a spot, which ignores that the set of rays
//! that get through moves with the lens. Semi-diameters therefore clip when nodes are found, and
//! not in between.

mod binding;
mod first_order;
mod gaps;
mod goal;
mod sampling;
mod spot;
mod sum;

pub use goal::{Goal, Term, Weighted};
pub use sampling::Sampled;

use crate::lens::{Lens, LensError, Variable};
use crate::math::Dual;
use crate::pupil::{BenchError, LaunchError};
use crate::trace::Fate;
use binding::Zoom;
use sampling::Sampling;
use serde::Serialize;
pub use sum::{Detail, Sum};

/// A number with its derivative along one variable.
type Along = Dual<f64, 1>;

/// Why a lens has no merit.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum MeritError {
    /// The prescription.
    #[error(transparent)]
    Lens(#[from] LensError),
    /// The beam.
    #[error(transparent)]
    Bench(#[from] BenchError),
    /// A field without rays.
    #[error("field {field} at zoom position {zoom}: {cause}")]
    Launch {
        /// The field, counted from 0.
        field: usize,
        /// The zoom position.
        zoom: usize,
        /// Why.
        cause: LaunchError,
    },
    /// Nothing gets through.
    #[error("no light gets through at field {field}, zoom position {zoom}, {um} um")]
    NoLight {
        /// The field, counted from 0.
        field: usize,
        /// The zoom position.
        zoom: usize,
        /// The wavelength.
        um: f64,
    },
    /// A ray that belongs to the spot does not arrive any more.
    #[error(
        "ray {ray} of field {field} at zoom position {zoom}, {um} um, is lost: {} at surface {}",
        .fate.name(), .fate.surface().unwrap_or(0)
    )]
    Lost {
        /// The ray of the field, counted from 0.
        ray: usize,
        /// The field, counted from 0.
        field: usize,
        /// The zoom position.
        zoom: usize,
        /// The wavelength.
        um: f64,
        /// How it ended.
        fate: Fate,
    },
    /// A value or derivative that is not a number.
    #[error("the term `{term}` is not finite")]
    NotFinite {
        /// The term.
        term: &'static str,
    },
    /// A term that the lens cannot have.
    #[error("the term `{term}` does not apply: {why}")]
    DoesNotApply {
        /// The term.
        term: &'static str,
        /// Why not.
        why: &'static str,
    },
    /// Nothing to change.
    #[error(
        "the lens has no variables that change it; flag some in the file (`\"variables\"`), or name \
         kinds of numbers to vary"
    )]
    NoVariables,
}

/// A term of a lens.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct TermValue {
    /// What it is called.
    pub term: &'static str,
    /// Its weight.
    pub weight: f64,
    /// Its value without the weight.
    pub value: f64,
    /// The estimated error of the value.
    pub error: f64,
    /// Rays that it rests on.
    pub rays: usize,
}

/// The merit function of a lens: its goal, its variables, and the rays that it is computed from.
#[derive(Debug, Clone)]
pub struct Merit {
    goal: Goal,
    lens: Lens,
    variables: Vec<Variable>,
    zooms: Vec<Zoom>,
    samplings: Vec<Sampling>,
    tolerance: f64,
}

impl Merit {
    /// The merit function of a lens with its own variables; spots are good to `tolerance` of their
    /// radius.
    pub fn new(lens: &Lens, goal: &Goal, tolerance: f64) -> Result<Self, MeritError> {
        lens.check()?;
        let mut zooms = Vec::new();
        for zoom in 0..lens.zoom_positions() {
            zooms.push(Zoom::new(lens, zoom)?);
        }
        let mut merit = Self {
            goal: goal.clone(),
            lens: lens.clone(),
            variables: lens.variables.clone(),
            zooms,
            samplings: Vec::new(),
            tolerance,
        };
        merit.goal.check(lens)?;
        merit.resample(lens)?;
        Ok(merit)
    }

    /// Finds the rays of the spots anew for a lens of the same structure.
    pub fn resample(&mut self, lens: &Lens) -> Result<(), MeritError> {
        let positions = 0..lens.zoom_positions();
        let found: Result<Vec<_>, _> =
            positions.map(|zoom| Sampling::new(lens, zoom, self.tolerance)).collect();
        self.samplings = found?;
        Ok(())
    }

    /// What it aims at.
    pub fn goal(&self) -> &Goal {
        &self.goal
    }

    /// The variables, in the order of all vectors.
    pub fn variables(&self) -> &[Variable] {
        &self.variables
    }

    /// The values of the variables in a lens.
    pub fn values(&self, lens: &Lens) -> Vec<f64> {
        self.variables.iter().map(|v| lens.get(v.parameter).unwrap_or(0.0)).collect()
    }

    /// The lens with these values of the variables, and pickups that follow them.
    pub fn lens(&self, values: &[f64]) -> Lens {
        let mut lens = self.lens.clone();
        for (variable, value) in self.variables.iter().zip(values) {
            lens.set(variable.parameter, *value);
        }
        // A lens that was checked has pickups that can be followed.
        lens.with_pickups().unwrap_or(lens)
    }

    /// How the spots are sampled, by zoom position, field and wavelength; a spot without rays has no
    /// light and counts nothing.
    pub fn sampled(&self) -> Vec<Sampled> {
        self.samplings.iter().flat_map(Sampling::sampled).collect()
    }

    /// The mean share of the paraxial entrance pupil that gets through, over all spots. A goal
    /// without a term for light may buy sharpness by clipping it, so it is worth a look.
    pub fn light(&self) -> f64 {
        let sampled = self.sampled();
        sampled.iter().map(|spot| spot.light).sum::<f64>() / sampled.len().max(1) as f64
    }

    /// The merit at these values of the variables.
    pub fn value(&self, values: &[f64]) -> Result<f64, MeritError> {
        self.sum(values, Detail::Value).map(|sum| sum.value)
    }

    /// The merit, its derivatives, and, where asked for, the normal equations of its residuals.
    pub fn sum(&self, values: &[f64], detail: Detail) -> Result<Sum, MeritError> {
        let mut total = Sum::zero(values.len(), detail);
        for weighted in &self.goal.terms {
            let sum = self.term(weighted.term, values, detail)?;
            total.add(&sum, weighted.weight);
        }
        Ok(total)
    }

    /// Every term by itself.
    pub fn terms(&self, values: &[f64]) -> Result<Vec<TermValue>, MeritError> {
        let report = |weighted: &Weighted| {
            let sum = self.term(weighted.term, values, Detail::Value)?;
            let (error, rays) = self.trust(weighted.term, sum.value);
            let (term, weight) = (weighted.term.name(), weighted.weight);
            Ok(TermValue { term, weight, value: sum.value, error, rays })
        };
        self.goal.terms.iter().map(report).collect()
    }

    /// Estimated error and rays of a term.
    fn trust(&self, term: Term, value: f64) -> (f64, usize) {
        match term {
            Term::Spot => {
                let sampled = self.sampled();
                let worst = sampled.iter().fold(0.0, |e: f64, s| e.max(s.error));
                (2.0 * worst * value, sampled.iter().map(|s| s.rays).sum())
            }
            Term::Distortion => (0.0, self.samplings.iter().map(Sampling::chiefs).sum()),
            _ => (0.0, 0),
        }
    }

    fn term(&self, term: Term, values: &[f64], detail: Detail) -> Result<Sum, MeritError> {
        let mut sum = Sum::zero(values.len(), detail);
        for (zoom, sampling) in self.zooms.iter().zip(&self.samplings) {
            let systems = zoom.at(values);
            let scene = Scene { zoom, sampling, systems: &systems, values };
            match term {
                Term::Spot => spot::spot(&scene, &mut sum)?,
                Term::Distortion => spot::distortion(&scene, &mut sum)?,
                Term::FocalLength(target) => {
                    first_order::focal_length(
                        &scene,
                        self.goal.target(zoom.number, target),
                        &mut sum,
                    );
                }
                _ => gaps::gaps(&scene, term, &mut sum),
            }
        }
        sum.scale(1.0 / self.zooms.len() as f64);
        if sum.is_finite() { Ok(sum) } else { Err(MeritError::NotFinite { term: term.name() }) }
    }
}

/// A lens at one zoom position and some values of the variables.
struct Scene<'a> {
    zoom: &'a Zoom,
    sampling: &'a Sampling,
    systems: &'a binding::Systems,
    values: &'a [f64],
}
