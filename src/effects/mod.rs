//! Which physical effects a lens calls for, each decision with the number it rests on.
//!
//! [`measure_effects()`] traces a few hundred rays and measures what each effect does; [`plan()`] is a pure
//! function of these [`EffectMeasurements`] and says for each effect whether it is computed, where and why;
//! [`build_ray_model()`] resolves the lens accordingly. What is left out is not there: a surface whose figuring
//! does not matter *is* a conic, a lens without dispersion *has* one wavelength.
//!
//! Nobody has to agree: every effect can be forced on or off ([`EffectOverrides`]).

mod apply;
mod plan;
mod survey;

pub use apply::{build_ray_model, simplify};
pub use plan::{AIMING, EffectDecision, EffectPlan, TracePurpose, plan};
pub use survey::{EffectMeasurements, RimClearance, measure_effects};

use serde::{Deserialize, Serialize};

/// A physical effect that costs time and may not matter.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Effect {
    /// The index of glass depends on the wavelength: more than one wavelength is traced.
    Dispersion,
    /// A figured surface is met by iteration.
    Asphere,
    /// Rays are lost at rims.
    Clipping,
    /// Rays are lost by total reflection.
    TotalReflection,
    /// Rays are aimed at the real stop, not at its paraxial image.
    Aiming,
    /// The object is so near that its rays are not parallel.
    FiniteObject,
    /// A gap is filled with a gradient, through which rays go step by step.
    Gradient,
}

impl Effect {
    /// Every effect, in the order of a table.
    pub const ALL: [Self; 7] = [
        Self::Dispersion,
        Self::Asphere,
        Self::Clipping,
        Self::TotalReflection,
        Self::Aiming,
        Self::FiniteObject,
        Self::Gradient,
    ];

    /// What it is called in reports and menus.
    pub fn name(self) -> &'static str {
        match self {
            Self::Dispersion => "dispersion",
            Self::Asphere => "asphere iteration",
            Self::Clipping => "clipping",
            Self::TotalReflection => "total reflection",
            Self::Aiming => "ray aiming",
            Self::FiniteObject => "finite object",
            Self::Gradient => "gradient index",
        }
    }
}

/// Whether an effect is computed.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum EffectOverride {
    /// As planned from the lens.
    #[default]
    Auto,
    /// Always.
    On,
    /// Never.
    Off,
}

/// What a person decides about effects; what is not mentioned is left to the plan.
#[derive(Debug, Clone, PartialEq, Eq, Default, Serialize, Deserialize)]
pub struct EffectOverrides(Vec<(Effect, EffectOverride)>);

impl EffectOverrides {
    /// Whether an effect is computed.
    pub fn get(&self, effect: Effect) -> EffectOverride {
        let chosen = self.0.iter().find(|(other, _)| *other == effect);
        chosen.map_or(EffectOverride::Auto, |(_, choice)| *choice)
    }

    /// Decides about an effect.
    pub fn set(&mut self, effect: Effect, choice: EffectOverride) {
        self.0.retain(|(other, _)| *other != effect);
        if choice != EffectOverride::Auto {
            self.0.push((effect, choice));
            self.0.sort_unstable_by_key(|(effect, _)| *effect);
        }
    }

    /// The same with one more decision.
    #[must_use]
    pub fn with(mut self, effect: Effect, choice: EffectOverride) -> Self {
        self.set(effect, choice);
        self
    }
}
