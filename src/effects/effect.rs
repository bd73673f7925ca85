//! The physical effects, and the user's overrides of what is planned for them.

use serde::{Deserialize, Serialize};

/// A physical effect that costs time and may not matter.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Effect {
    /// The index of glass depends on the wavelength: more than one wavelength is traced.
    Dispersion,
    /// Aspheric terms: the intersection with the surface takes an iteration.
    Asphere,
    /// Rays are lost at semi-diameters and obstructions.
    Clipping,
    /// Rays are lost by total reflection.
    TotalReflection,
    /// Rays are aimed at the real stop, not at its paraxial image.
    Aiming,
    /// The object is so near that its rays are not parallel.
    FiniteObject,
    /// A gap is filled with a gradient-index medium, through which rays are traced step by step.
    #[serde(rename = "gradient")]
    GradientIndex,
    /// Surfaces are tilted or decentred, or the axis is broken: rays are turned into the frame of each.
    Poses,
    /// The lens is at another temperature than its glasses are catalogued for.
    Temperature,
    /// The glasses absorb light: rays have weights by their ways through them.
    Absorption,
}

impl Effect {
    /// Every effect, in the order of a table.
    pub const ALL: [Self; 10] = [
        Self::Dispersion,
        Self::Asphere,
        Self::Clipping,
        Self::TotalReflection,
        Self::Aiming,
        Self::FiniteObject,
        Self::GradientIndex,
        Self::Poses,
        Self::Temperature,
        Self::Absorption,
    ];

    /// The name in reports and menus.
    pub fn name(self) -> &'static str {
        match self {
            Self::Dispersion => "dispersion",
            Self::Asphere => "asphere iteration",
            Self::Clipping => "clipping",
            Self::TotalReflection => "total reflection",
            Self::Aiming => "ray aiming",
            Self::FiniteObject => "finite object",
            Self::GradientIndex => "gradient index",
            Self::Poses => "tilts, decentres",
            Self::Temperature => "temperature",
            Self::Absorption => "absorption",
        }
    }
}

/// The user's setting for one effect.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum EffectOverride {
    /// Computed if the lens calls for it.
    #[default]
    Auto,
    /// Always computed.
    On,
    /// Never computed.
    Off,
}

impl EffectOverride {
    /// True if an effect is computed that the lens calls for, or not (`needed`).
    pub(super) fn computes(self, needed: bool) -> bool {
        match self {
            Self::Auto => needed,
            Self::On => true,
            Self::Off => false,
        }
    }
}

/// The user's settings for all effects; an effect without one is [`EffectOverride::Auto`].
#[derive(Debug, Clone, PartialEq, Eq, Default, Serialize, Deserialize)]
pub struct EffectOverrides(Vec<(Effect, EffectOverride)>);

impl EffectOverrides {
    /// The setting for an effect.
    pub fn get(&self, effect: Effect) -> EffectOverride {
        let chosen = self.0.iter().find(|(other, _)| *other == effect);
        chosen.map_or(EffectOverride::Auto, |(_, choice)| *choice)
    }

    /// Changes the setting for an effect.
    pub fn set(&mut self, effect: Effect, choice: EffectOverride) {
        self.0.retain(|(other, _)| *other != effect);
        if choice != EffectOverride::Auto {
            self.0.push((effect, choice));
            self.0.sort_unstable_by_key(|(effect, _)| *effect);
        }
    }

    /// The same settings with one changed.
    #[must_use]
    pub fn with(mut self, effect: Effect, choice: EffectOverride) -> Self {
        self.set(effect, choice);
        self
    }
}
