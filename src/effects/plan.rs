//! The decisions: a pure function of what was measured.

use super::apply::decided;
use super::survey::EffectMeasurements;
use super::{Effect, EffectOverride, EffectOverrides};
use serde::{Deserialize, Serialize};

/// Rays are aimed at the real stop where the paraxial chief ray misses its centre by more than so
/// many stop radii: paraxial coordinates would waste much of the beam.
pub const AIMING: f64 = crate::pupil::WIDE_AIMING_THRESHOLD;

/// A rim that no ray comes nearer than this, in semi-diameters, clips nothing.
const NEAR_RIM: f64 = 0.98;
/// A surface that no ray leaves within two degrees of grazing reflects nothing totally; the sine
/// of the angle of refraction there.
const NEAR_GRAZING: f64 = 0.9994;
/// What a drawing of a lens shows: a thousandth of its length.
const DRAWING_TOLERANCE: f64 = 1e-3;
/// What a traced ray is exact to, in mm.
const TRACE_TOLERANCE: f64 = 1e-9;

/// What a lens is resolved for.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum TracePurpose {
    /// Rays as such: nothing that moves one of them may be left out.
    Trace,
    /// Spots, good to this share of the smallest one.
    Spot(f64),
    /// A drawing.
    Layout,
    /// Searching, with spots good to this share of the smallest one.
    Optimize(f64),
}

impl TracePurpose {
    /// By how much rays may move, in mm.
    fn tolerated_shift(self, facts: &EffectMeasurements) -> f64 {
        match self {
            Self::Trace => TRACE_TOLERANCE,
            Self::Spot(share) | Self::Optimize(share) if facts.smallest_spot.is_finite() => {
                share * facts.smallest_spot
            }
            Self::Spot(_) | Self::Optimize(_) => 0.0,
            Self::Layout => DRAWING_TOLERANCE * facts.length,
        }
    }
}

/// What was decided about one effect.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct EffectDecision {
    /// Which effect.
    pub effect: Effect,
    /// What the person said.
    pub choice: EffectOverride,
    /// Whether the lens calls for it.
    pub needed: bool,
    /// Whether it is computed.
    pub computed: bool,
    /// The surfaces at which it is computed, where it belongs to surfaces.
    pub surfaces: Vec<usize>,
    /// The number that the decision rests on: what changes if the effect is left out.
    pub error: f64,
    /// The effect is needed where the number is above this.
    pub limit: f64,
    /// What really is left out, in the same unit: 0 where nothing is.
    pub left: f64,
    /// What these numbers are measured in.
    pub unit: &'static str,
    /// Why, in a sentence.
    pub reason: String,
    /// The share of the work of tracing that leaving it out saves or would save, by count of
    /// ray-surfaces.
    pub saves: f64,
    /// The same in milliseconds for the task; the engine reads no clock, so whoever does fills
    /// this in.
    pub saved_ms: Option<f64>,
}

/// All decisions for a lens.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct EffectPlan {
    /// One decision an effect, in the order of [`Effect::ALL`].
    pub decisions: Vec<EffectDecision>,
    /// Figured surfaces whose figuring is left out.
    pub plain: Vec<usize>,
    /// Surfaces whose rim, and obstruction, is left out.
    pub open: Vec<usize>,
    /// Surfaces whose gap is taken as glass without its gradient.
    pub even: Vec<usize>,
}

impl EffectPlan {
    /// What was decided about an effect.
    pub fn decision(&self, effect: Effect) -> Option<&EffectDecision> {
        self.decisions.iter().find(|decision| decision.effect == effect)
    }

    /// Whether an effect is computed.
    pub fn computes(&self, effect: Effect) -> bool {
        self.decision(effect).is_none_or(|decision| decision.computed)
    }
}

/// What to compute for a task, from what was measured and what a person chose.
pub fn plan(
    facts: &EffectMeasurements,
    task: TracePurpose,
    choices: &EffectOverrides,
) -> EffectPlan {
    let allowed = task.tolerated_shift(facts);
    let (asphere, plain) = asphere(facts, allowed, choices.get(Effect::Asphere));
    let (gradient, even) = grin(facts, allowed, choices.get(Effect::Gradient));
    let (clipping, open) = clipping(facts, choices.get(Effect::Clipping));
    let decisions = vec![
        dispersion(facts, allowed, choices.get(Effect::Dispersion)),
        asphere,
        clipping,
        reflection(facts, choices.get(Effect::TotalReflection)),
        aiming(facts, choices.get(Effect::Aiming)),
        object(facts, allowed, choices.get(Effect::FiniteObject)),
        gradient,
    ];
    EffectPlan { decisions, plain, open, even }
}

/// A decision that rests on one number and belongs to the lens as a whole.
fn lens_decision(
    effect: Effect,
    choice: EffectOverride,
    error: f64,
    limit: f64,
    unit: &'static str,
) -> EffectDecision {
    let needed = !(error <= limit);
    let computed = decided(choice, needed);
    EffectDecision {
        effect,
        choice,
        needed,
        computed,
        surfaces: Vec::new(),
        error,
        limit,
        left: if computed { 0.0 } else { error },
        unit,
        reason: String::new(),
        saves: 0.0,
        saved_ms: None,
    }
}

fn dispersion(facts: &EffectMeasurements, allowed: f64, choice: EffectOverride) -> EffectDecision {
    let decision = lens_decision(Effect::Dispersion, choice, facts.dispersion, allowed, "mm");
    let reason = match facts.wavelengths {
        1 => "there is one wavelength".to_owned(),
        colors if facts.dispersion == 0.0 => {
            format!("all {colors} wavelengths take the same way")
        }
        colors => format!(
            "the {colors} wavelengths land {:.3} um apart; {:.3} um may be neglected",
            1e3 * facts.dispersion,
            1e3 * allowed
        ),
    };
    EffectDecision { reason, saves: 1.0 - 1.0 / facts.wavelengths as f64, ..decision }
}

/// Keeps the figuring of as few surfaces as are needed: the weakest ones go first, as long as
/// together they may be neglected.
fn asphere(
    facts: &EffectMeasurements,
    allowed: f64,
    choice: EffectOverride,
) -> (EffectDecision, Vec<usize>) {
    let total = facts.aspheres.iter().fold(0.0, |sum, (_, moved)| sum + moved);
    let decision = lens_decision(Effect::Asphere, choice, total, allowed, "mm");
    let mut weakest = facts.aspheres.clone();
    weakest.sort_by(|a, b| a.1.total_cmp(&b.1));
    let (mut plain, mut left) = (Vec::new(), 0.0);
    for (surface, moved) in weakest {
        let goes = match choice {
            EffectOverride::Auto => left + moved <= allowed,
            EffectOverride::On => false,
            EffectOverride::Off => true,
        };
        if goes {
            left += moved;
            plain.push(surface);
        }
    }
    plain.sort_unstable();
    let kept = facts.aspheres.iter().map(|(surface, _)| *surface).filter(|i| !plain.contains(i));
    let surfaces: Vec<usize> = kept.collect();
    let reason = match facts.aspheres.len() {
        0 => "no surface is figured".to_owned(),
        1 => format!("without the figuring of a surface {}", shift_text(total, allowed)),
        all => format!("without the figuring of {all} surfaces {}", shift_text(total, allowed)),
    };
    let figured = facts.aspheres.len() as f64;
    let work = facts.surfaces as f64 + figured * (ASPHERE_COST - 1.0);
    let saves = figured * (ASPHERE_COST - 1.0) / work;
    let computed = !surfaces.is_empty();
    (EffectDecision { computed, surfaces, left, reason, saves, ..decision }, plain)
}

/// What rays would do, in words.
fn shift_text(moved: f64, allowed: f64) -> String {
    if !moved.is_finite() {
        return "rays would be lost".to_owned();
    }
    let [moved, allowed] = [moved, allowed].map(|mm| 1e3 * mm);
    format!("rays would land {moved:.3} um away; {allowed:.3} um may be neglected")
}

/// What a crossing of a figured surface costs, in crossings of a sphere.
const ASPHERE_COST: f64 = 15.0;

/// Keeps the rims that a ray may reach, those that tell an iteration where to look, and whatever
/// obstructs.
fn clipping(facts: &EffectMeasurements, choice: EffectOverride) -> (EffectDecision, Vec<usize>) {
    let ratio = |rim: &super::RimClearance| {
        if rim.ray_height == 0.0 { 0.0 } else { rim.ray_height / rim.semi_diameter }
    };
    let nearest = facts.rims.iter().map(ratio).fold(0.0, f64::max);
    let decision =
        lens_decision(Effect::Clipping, choice, nearest, NEAR_RIM, "of the semi-diameter");
    let goes = |rim: &&super::RimClearance| match choice {
        EffectOverride::Auto => !rim.aspheric && !rim.obstructed && ratio(rim) <= NEAR_RIM,
        EffectOverride::On => false,
        EffectOverride::Off => true,
    };
    let open: Vec<usize> = facts.rims.iter().filter(goes).map(|rim| rim.surface).collect();
    let left = facts.rims.iter().filter(goes).map(ratio).fold(0.0, f64::max);
    let kept = facts.rims.iter().map(|rim| rim.surface).filter(|i| !open.contains(i));
    let surfaces: Vec<usize> = kept.collect();
    let obstructed = facts.rims.iter().filter(|rim| rim.obstructed).count();
    let obstructing = match obstructed {
        0 => String::new(),
        1 => " and at an obstruction".to_owned(),
        all => format!(" and at {all} obstructions"),
    };
    let reason = if facts.rims.is_empty() {
        "no surface has a semi-diameter or an obstruction".to_owned()
    } else {
        let (clipped, rays) = (facts.fates.clipped, facts.fates.total());
        let limiting = facts.rims.iter().filter(|rim| ratio(rim) > NEAR_RIM).count();
        format!(
            "rays come to {:.0} % of a semi-diameter, and near the rim at {limiting} surfaces; \
             {clipped} of {rays} are lost there{obstructing}",
            100.0 * nearest
        )
    };
    let computed = !surfaces.is_empty();
    let needed = decision.needed || obstructed > 0;
    (EffectDecision { needed, computed, surfaces, left, reason, ..decision }, open)
}

/// Keeps as few gradients as are needed, and says in how many steps.
fn grin(
    facts: &EffectMeasurements,
    allowed: f64,
    choice: EffectOverride,
) -> (EffectDecision, Vec<usize>) {
    let total = facts.grin_gaps.iter().fold(0.0, |sum, (_, moved)| sum + moved);
    let decision = lens_decision(Effect::Gradient, choice, total, allowed, "mm");
    let goes = !decision.computed;
    let all: Vec<usize> = facts.grin_gaps.iter().map(|(plan, _)| plan.surface).collect();
    let (even, surfaces) = if goes { (all, Vec::new()) } else { (Vec::new(), all) };
    let reason = if facts.grin_gaps.is_empty() {
        "no gap is filled with a gradient that varies".to_owned()
    } else {
        format!("without it {}; {}", shift_text(total, allowed), step_text(facts))
    };
    let kicks: u32 = facts.grin_gaps.iter().map(|(plan, _)| plan.kicks).sum();
    let saves = f64::from(kicks) / (facts.surfaces as f64 + f64::from(kicks));
    let computed = !surfaces.is_empty();
    let left = if goes { total } else { 0.0 };
    (EffectDecision { computed, surfaces, left, reason, saves, ..decision }, even)
}

/// The steps of every gap with a gradient, in words.
fn step_text(facts: &EffectMeasurements) -> String {
    let of = |(plan, _): &(crate::trace::GrinStepPlan, f64)| {
        format!(
            "behind surface {} in {} steps ({} times the index is asked), good to {:.0e} mm",
            plan.surface, plan.steps, plan.kicks, plan.error
        )
    };
    facts.grin_gaps.iter().map(of).collect::<Vec<_>>().join(", ")
}

/// The test is the sign of the number whose root refraction takes anyway: it cannot be left out
/// and would save nothing.
fn reflection(facts: &EffectMeasurements, choice: EffectOverride) -> EffectDecision {
    let nearest = facts.critical_angle.map_or(0.0, |angle| angle.to_radians().cos());
    let decision = lens_decision(
        Effect::TotalReflection,
        choice,
        nearest,
        NEAR_GRAZING,
        "of the critical sine",
    );
    let reason = match facts.critical_angle {
        None => "the index falls at no surface that rays leave".to_owned(),
        Some(_) if facts.fates.total_reflection > 0 => {
            let EffectMeasurements { fates, .. } = facts;
            format!("{} of {} rays are totally reflected", fates.total_reflection, fates.total())
        }
        Some(angle) => format!("no ray leaves a surface at less than {angle:.1} degrees to it"),
    };
    let kept = if choice == EffectOverride::Off {
        "; the test is part of refraction and stays"
    } else {
        ""
    };
    let reason = reason + kept;
    let computed = !facts.index_drops.is_empty();
    EffectDecision { computed, left: 0.0, surfaces: facts.index_drops.clone(), reason, ..decision }
}

/// What a search for the chief ray costs, in rays of a spot: some steps with derivatives.
const CHIEF_RAYS: f64 = 20.0;
/// The rays of a spot.
const SPOT_RAYS: f64 = 100.0;

fn aiming(facts: &EffectMeasurements, choice: EffectOverride) -> EffectDecision {
    let miss = facts.chief_ray_miss.unwrap_or(f64::INFINITY);
    let decision = lens_decision(Effect::Aiming, choice, miss, AIMING, "stop radii");
    let reason = match facts.chief_ray_miss {
        Some(miss) => format!(
            "the paraxial chief ray of the farthest field misses the centre of the stop by \
             {:.0} % of its radius",
            100.0 * miss
        ),
        None => "the paraxial chief ray of the farthest field does not reach the stop".to_owned(),
    };
    let saves = CHIEF_RAYS / (CHIEF_RAYS + SPOT_RAYS);
    EffectDecision { reason, saves, ..decision }
}

fn object(facts: &EffectMeasurements, allowed: f64, choice: EffectOverride) -> EffectDecision {
    let moved = facts.finite_object.map_or(0.0, |(_, moved)| moved);
    let decision = lens_decision(Effect::FiniteObject, choice, moved, allowed, "mm");
    let reason = match facts.finite_object {
        None => "the object is at infinity".to_owned(),
        Some((distance, moved)) => {
            format!("from infinity instead of {distance} mm {}", shift_text(moved, allowed))
        }
    };
    let computed = decision.computed && facts.finite_object.is_some();
    EffectDecision { computed, reason, ..decision }
}
