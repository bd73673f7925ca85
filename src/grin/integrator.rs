//! Integrators as lists of drifts and kicks.
//!
//! A drift of weight `c` over a step `h` is `x += c h v`, a kick `v += c h η ∇η`. Each is undone
//! exactly by its negative, whatever the field, so every list is reversible and symplectic.

use crate::math::Real;
use serde::{Deserialize, Serialize};

/// One part of a step; its weight is a fraction of the step.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum IntegratorOp<R> {
    /// `x += c h v`.
    Drift(R),
    /// `v += c h η ∇η`, and the optical path grows by `c h η²`.
    Kick(R),
}

/// A splitting method that advances a ray by one step.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Integrator {
    /// Velocity first, then position; order 1. For comparison with the literature:
    /// [`Self::LeapfrogDkd`] costs the same.
    SymplecticEuler,
    /// Drift, kick, drift; order 2. The ray changes direction only between straight segments, which
    /// suits grids.
    LeapfrogDkd,
    /// Kick, drift, kick; order 2.
    LeapfrogKdk,
    /// Order 4 with 3 kicks (Yoshida, Phys. Lett. A 150, 1990).
    Yoshida,
    /// Order 4 with 4 kicks (Omelyan, Mryglod and Folk, Comput. Phys. Commun. 146, 2002).
    Pefrl,
    /// Order 4 with 7 kicks (SRKN, Blanes and Moan, J. Comput. Appl. Math. 142, 2002): the most
    /// accurate per kick in smooth fields.
    BlanesMoan,
}

impl Integrator {
    /// Every integrator.
    pub const ALL: [Self; 6] = [
        Self::SymplecticEuler,
        Self::LeapfrogDkd,
        Self::LeapfrogKdk,
        Self::Yoshida,
        Self::Pefrl,
        Self::BlanesMoan,
    ];

    /// The name in files and reports.
    pub fn name(self) -> &'static str {
        match self {
            Self::SymplecticEuler => "symplectic_euler",
            Self::LeapfrogDkd => "leapfrog_dkd",
            Self::LeapfrogKdk => "leapfrog_kdk",
            Self::Yoshida => "yoshida",
            Self::Pefrl => "pefrl",
            Self::BlanesMoan => "blanes_moan",
        }
    }

    /// The name in a text.
    pub fn title(self) -> &'static str {
        match self {
            Self::SymplecticEuler => "symplectic Euler",
            Self::LeapfrogDkd => "leapfrog (drift, kick, drift)",
            Self::LeapfrogKdk => "leapfrog (kick, drift, kick)",
            Self::Yoshida => "Yoshida",
            Self::Pefrl => "PEFRL",
            Self::BlanesMoan => "Blanes-Moan",
        }
    }

    /// The order of convergence in a smooth field.
    pub fn order(self) -> u32 {
        match self {
            Self::SymplecticEuler => 1,
            Self::LeapfrogDkd | Self::LeapfrogKdk => 2,
            Self::Yoshida | Self::Pefrl | Self::BlanesMoan => 4,
        }
    }

    /// The number of field evaluations per step.
    pub fn kicks_per_step(self) -> usize {
        self.ops::<f64>().iter().filter(|op| matches!(op, IntegratorOp::Kick(_))).count()
    }

    /// The parts of a step, in order.
    pub fn ops<R: Real>(self) -> Vec<IntegratorOp<R>> {
        let drift = |c: f64| IntegratorOp::Drift(R::from_f64(c));
        let kick = |c: f64| IntegratorOp::Kick(R::from_f64(c));
        match self {
            Self::SymplecticEuler => vec![kick(1.0), drift(1.0)],
            Self::LeapfrogDkd => vec![drift(0.5), kick(1.0), drift(0.5)],
            Self::LeapfrogKdk => vec![kick(0.5), drift(1.0), kick(0.5)],
            Self::Yoshida => {
                let outer = 1.0 / (2.0 - 2f64.cbrt());
                let inner = -(2f64.cbrt()) * outer;
                let between = 0.5 * (inner + outer);
                palindrome(&[drift(0.5 * outer), kick(outer), drift(between)], kick(inner))
            }
            Self::Pefrl => {
                let (xi, lambda, chi) =
                    (0.1786178958448091, -0.2123418310626054, -0.0662645826698185);
                let half = [drift(xi), kick(0.5 * (1.0 - 2.0 * lambda)), drift(chi), kick(lambda)];
                palindrome(&half, drift(1.0 - 2.0 * (chi + xi)))
            }
            Self::BlanesMoan => {
                let b = [0.0829844064174052, 0.396309801498368, -0.0390563049223486];
                let a = [0.245298957184271, 0.604872665711080];
                let last = 0.5 - (a[0] + a[1]);
                let half =
                    [kick(b[0]), drift(a[0]), kick(b[1]), drift(a[1]), kick(b[2]), drift(last)];
                palindrome(&half, kick(1.0 - 2.0 * (b[0] + b[1] + b[2])))
            }
        }
    }
}

/// The palindrome of `half`, `middle` and the reversed `half`.
fn palindrome<R: Real>(half: &[IntegratorOp<R>], middle: IntegratorOp<R>) -> Vec<IntegratorOp<R>> {
    half.iter().copied().chain([middle]).chain(half.iter().rev().copied()).collect()
}
