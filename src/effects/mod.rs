//! The physical effects that a lens calls for, each decision with the number it rests on.
//!
//! [`measure_effects()`] traces a few hundred rays and measures how far each effect moves them;
//! [`plan()`] is a pure function of these [`EffectMeasurements`] and decides for each effect whether
//! it is computed, at which surfaces and why; [`build_ray_model()`] resolves the lens accordingly. An
//! effect that is left out leaves no trace in the numbers: an asphere whose aspheric terms do not
//! matter *is* a conic, a lens without dispersion *has* one wavelength.
//!
//! Every effect can be forced on or off ([`EffectOverrides`]).

mod absorption;
mod aiming;
mod apply;
mod dispersion;
mod effect;
mod measure;
mod plan;
mod simplify;

pub use absorption::transmitted_light;
pub use aiming::AimingDifference;
pub use apply::{build_ray_model, build_ray_model_at, simplify};
pub use effect::{Effect, EffectOverride, EffectOverrides};
pub use measure::{
    EffectMeasurements, PlacedSurfaces, RimClearance, measure_effects, measure_effects_at,
};
pub use plan::{EffectCost, EffectDecision, EffectPlan, TracePurpose, plan};
