//! Which physical effects a lens calls for, each decision with the number it rests on.
//!
//! [`survey()`] traces a few hundred rays and measures what each effect does; [`plan()`] is a pure
//! function of these [`Facts`] and says for each effect whether it is computed, where and why;
//! [`bench()`] resolves the lens accordingly. What is left out is not there: a surface whose figuring
//! does not matter *is* a conic, a lens without dispersion *has* one wavelength.
//!
//! Nobody has to agree: every effect can be forced on or off ([`Choices`]).

mod apply;
mod plan;
mod survey;

pub use apply::{bench, simplify};
pub use plan::{AIMING, Decision, Plan, Task, plan};
pub use survey::{Facts, Rim, survey};

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
pub enum Choice {
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
pub struct Choices(Vec<(Effect, Choice)>);

impl Choices {
    /// Whether an effect is computed.
    pub fn of(&self, effect: Effect) -> Choice {
        let chosen = self.0.iter().find(|(other, _)| *other == effect);
        chosen.map_or(Choice::Auto, |(_, choice)| *choice)
    }

    /// Decides about an effect.
    pub fn choose(&mut self, effect: Effect, choice: Choice) {
        self.0.retain(|(other, _)| *other != effect);
        if choice != Choice::Auto {
            self.0.push((effect, choice));
            self.0.sort_unstable_by_key(|(effect, _)| *effect);
        }
    }

    /// The same with one more decision.
    #[must_use]
    pub fn with(mut self, effect: Effect, choice: Choice) -> Self {
        self.choose(effect, choice);
        self
    }
}
