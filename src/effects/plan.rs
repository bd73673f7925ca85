//! The decisions: a pure function of the measurements.

use super::aiming::AimingDifference;
use super::effect::{Effect, EffectOverride, EffectOverrides};
use super::measure::{EffectMeasurements, PlacedSurfaces, RimClearance, sample_points};
use crate::lens::{ROOM_CELSIUS, SurfaceNumber};
use crate::pupil::Neglected;
use crate::trace::GrinStepPlan;
use serde::{Deserialize, Serialize};

/// A semi-diameter clips nothing if the largest ray height is below this part of it.
const NEAR_RIM: f64 = 0.98;
/// A surface reflects no ray totally if no ray leaves it within two degrees of grazing; the sine of
/// the angle of refraction there.
const NEAR_GRAZING: f64 = 0.9994;
/// The shift of a ray that a drawing does not show, as a part of the length of the lens.
const DRAWING_TOLERANCE: f64 = 1e-3;
/// The accuracy of a traced ray, in mm.
const TRACE_TOLERANCE: f64 = 1e-9;

/// The purpose that a lens is resolved for.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum TracePurpose {
    /// Exact rays: no effect that moves one of them may be left out.
    Trace,
    /// Spots, accurate to this part of the smallest one.
    Spot(f64),
    /// A drawing.
    Layout,
    /// Numbers whose change no shift of rays bounds, as derivatives, light and the merit of a lens
    /// that will change: nothing that moves a ray may be left out.
    Exact,
}

impl TracePurpose {
    /// The largest shift of rays in the image plane that may be neglected, in mm.
    fn tolerated_shift(self, measured: &EffectMeasurements) -> f64 {
        match self {
            Self::Trace => TRACE_TOLERANCE,
            Self::Spot(share) if measured.smallest_spot.is_finite() => {
                share * measured.smallest_spot
            }
            Self::Spot(_) | Self::Exact => 0.0,
            Self::Layout => DRAWING_TOLERANCE * measured.length,
        }
    }
}

/// The decision about one effect.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct EffectDecision {
    /// The effect.
    pub effect: Effect,
    /// The user's setting.
    pub choice: EffectOverride,
    /// True if the lens calls for the effect.
    pub needed: bool,
    /// True if the effect is computed.
    pub computed: bool,
    /// The surfaces at which it is computed, for an effect that belongs to surfaces.
    pub surfaces: Vec<usize>,
    /// The change that leaving the effect out makes; the decision rests on it.
    pub error: f64,
    /// The effect is needed if `error` is above this.
    pub limit: f64,
    /// The change made by what really is left out, in the same unit; 0 if nothing is.
    #[serde(rename = "left")]
    pub residual: f64,
    /// The unit of `error`, `limit` and `residual`.
    pub unit: &'static str,
    /// The reason, in a sentence.
    pub reason: String,
    /// The time that the effect takes; `None` until it is measured.
    #[serde(flatten)]
    pub cost: Option<EffectCost>,
}

impl EffectDecision {
    /// True if the lens would have the effect and it is not computed.
    fn is_left_out(&self) -> bool {
        !self.computed && (self.residual > 0.0 || self.choice == EffectOverride::Off)
    }
}

/// The time that an effect takes, measured by runs with it and without it.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize)]
pub struct EffectCost {
    /// The part of the time with the effect that leaving it out saves; negative if it costs time.
    #[serde(rename = "saves")]
    pub saved_share: f64,
    /// The same in milliseconds.
    pub saved_ms: f64,
    /// The error of `saved_ms`, by the scatter of the runs, in milliseconds.
    pub error_ms: f64,
}

/// The decisions for a lens.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct EffectPlan {
    /// One decision for each effect, in the order of [`Effect::ALL`].
    pub decisions: Vec<EffectDecision>,
    /// Aspheres that are traced as conics, by index.
    #[serde(rename = "plain")]
    pub as_conic: Vec<usize>,
    /// Surfaces traced without their semi-diameter and obstruction, by index.
    #[serde(rename = "open")]
    pub unclipped: Vec<usize>,
    /// Surfaces followed by a gradient-index gap that is traced as homogeneous, by index.
    #[serde(rename = "even")]
    pub homogeneous: Vec<usize>,
    /// The largest relative change of light by rays aimed at the paraxial entrance pupil; 0 if they
    /// are aimed at the stop.
    pub aiming_light: f64,
}

impl EffectPlan {
    /// The decision about an effect.
    pub fn decision(&self, effect: Effect) -> Option<&EffectDecision> {
        self.decisions.iter().find(|decision| decision.effect == effect)
    }

    /// True if an effect is computed.
    pub fn computes(&self, effect: Effect) -> bool {
        self.decision(effect).is_none_or(|decision| decision.computed)
    }

    /// True if an effect has to be taken out of a lens.
    pub(super) fn leaves_out(&self, effect: Effect) -> bool {
        self.decision(effect).is_some_and(EffectDecision::is_left_out)
    }

    /// The changes by all that is left out together; that of light without the part of dispersion,
    /// which is measured with the ray model.
    pub fn neglected(&self) -> Neglected {
        let shifts = self.decisions.iter().filter(|decision| decision.unit == "mm");
        let shift: f64 = shifts.map(|decision| decision.residual).sum();
        let ray_shift = shift * (sample_points().len() as f64).sqrt();
        Neglected { shift, ray_shift, light: self.aiming_light }
    }

    /// The effects that the user left out although the lens calls for them and that no shift of rays
    /// measures; [`EffectPlan::neglected`] does not count them.
    pub fn unmeasured(&self) -> impl Iterator<Item = Effect> {
        let lost = |decision: &&EffectDecision| {
            decision.choice == EffectOverride::Off && decision.needed && decision.unit != "mm"
        };
        self.decisions.iter().filter(lost).map(|decision| decision.effect)
    }
}

/// Decides which effects to compute for a purpose, from the measurements and the user's settings.
pub fn plan(
    measured: &EffectMeasurements,
    purpose: TracePurpose,
    overrides: &EffectOverrides,
) -> EffectPlan {
    let allowed = purpose.tolerated_shift(measured);
    let (asphere, as_conic) = asphere(measured, allowed, overrides.get(Effect::Asphere));
    let (grin, homogeneous) = grin(measured, allowed, overrides.get(Effect::GradientIndex));
    let (clipping, unclipped) = clipping(measured, overrides.get(Effect::Clipping));
    let decisions = vec![
        dispersion(measured, allowed, overrides.get(Effect::Dispersion)),
        asphere,
        clipping,
        reflection(measured, overrides.get(Effect::TotalReflection)),
        aiming(measured, (purpose, allowed), overrides.get(Effect::Aiming)),
        object(measured, allowed, overrides.get(Effect::FiniteObject)),
        grin,
        poses(measured, allowed, overrides.get(Effect::Poses)),
        temperature(measured, allowed, overrides.get(Effect::Temperature)),
        absorption(measured, overrides.get(Effect::Absorption)),
    ];
    let mut plan = EffectPlan { decisions, as_conic, unclipped, homogeneous, aiming_light: 0.0 };
    if !plan.computes(Effect::Aiming) {
        plan.aiming_light = measured.paraxial_aiming.light;
    }
    plan
}

/// A decision that rests on one number and concerns the lens as a whole.
fn lens_decision(
    effect: Effect,
    choice: EffectOverride,
    error: f64,
    limit: f64,
    unit: &'static str,
) -> EffectDecision {
    let needed = !(error <= limit);
    let computed = choice.computes(needed);
    EffectDecision {
        effect,
        choice,
        needed,
        computed,
        surfaces: Vec::new(),
        error,
        limit,
        residual: if computed { 0.0 } else { error },
        unit,
        reason: String::new(),
        cost: None,
    }
}

fn dispersion(
    measured: &EffectMeasurements,
    allowed: f64,
    choice: EffectOverride,
) -> EffectDecision {
    let decision = lens_decision(Effect::Dispersion, choice, measured.dispersion, allowed, "mm");
    let reason = match measured.wavelengths {
        1 => "there is one wavelength".to_owned(),
        count if measured.dispersion == 0.0 => {
            format!("all {count} wavelengths take the same path")
        }
        count if !measured.dispersion.is_finite() => {
            format!("too few rays of a field arrive to compare its {count} wavelengths")
        }
        count => format!(
            "the {count} wavelengths land {} apart; {}",
            micrometres(measured.dispersion),
            allowed_text(allowed)
        ),
    };
    EffectDecision { reason, ..decision }
}

/// Keeps the aspheric terms of as few surfaces as are needed: the weakest are left out first, as long
/// as together they may be neglected.
fn asphere(
    measured: &EffectMeasurements,
    allowed: f64,
    choice: EffectOverride,
) -> (EffectDecision, Vec<usize>) {
    let total = measured.aspheres.iter().fold(0.0, |sum, (_, moved)| sum + moved);
    let decision = lens_decision(Effect::Asphere, choice, total, allowed, "mm");
    let mut weakest = measured.aspheres.clone();
    weakest.sort_by(|a, b| a.1.total_cmp(&b.1));
    let (mut as_conic, mut residual) = (Vec::new(), 0.0);
    for (surface, moved) in weakest {
        let goes = match choice {
            EffectOverride::Auto => residual + moved <= allowed,
            EffectOverride::On => false,
            EffectOverride::Off => true,
        };
        if goes {
            residual += moved;
            as_conic.push(surface);
        }
    }
    as_conic.sort_unstable();
    let kept =
        measured.aspheres.iter().map(|(surface, _)| *surface).filter(|i| !as_conic.contains(i));
    let surfaces: Vec<usize> = kept.collect();
    let reason = match measured.aspheres.len() {
        0 => "no surface is aspheric".to_owned(),
        1 => format!("without the aspheric terms of a surface {}", shift_text(total, allowed)),
        all => {
            format!("without the aspheric terms of {all} surfaces {}", shift_text(total, allowed))
        }
    };
    let computed = !surfaces.is_empty();
    (EffectDecision { computed, surfaces, residual, reason, ..decision }, as_conic)
}

/// The shift of rays in words.
fn shift_text(moved: f64, allowed: f64) -> String {
    if !moved.is_finite() {
        return "rays would be lost, or too few arrive to tell".to_owned();
    }
    format!("rays would land {} away; {}", micrometres(moved), allowed_text(allowed))
}

/// A length in mm as text in um with three digits.
fn micrometres(mm: f64) -> String {
    let um = 1e3 * mm;
    let size = um.abs();
    if size == 0.0 || !(1e-3..1e5).contains(&size) {
        return if size == 0.0 { "0 um".to_owned() } else { format!("{um:.2e} um") };
    }
    let decimals = (2 - size.log10().floor() as i32).max(0) as usize;
    format!("{um:.decimals$} um")
}

/// A share as text in percent.
fn percent(share: f64) -> String {
    match 100.0 * share {
        0.0 => "0 %".to_owned(),
        small if small < 0.01 => format!("{small:.1e} %"),
        percent => format!("{percent:.2} %"),
    }
}

/// The shift that may be neglected, in mm, as text.
fn allowed_text(allowed: f64) -> String {
    if allowed == 0.0 {
        return "nothing may be neglected".to_owned();
    }
    format!("{} may be neglected", micrometres(allowed))
}

/// Keeps the semi-diameters that a ray may reach, those that bound the iteration at an asphere, and
/// every obstruction and aperture of another form.
fn clipping(measured: &EffectMeasurements, choice: EffectOverride) -> (EffectDecision, Vec<usize>) {
    let ratio = |rim: &RimClearance| {
        if rim.ray_height == 0.0 { 0.0 } else { rim.ray_height / rim.semi_diameter }
    };
    let nearest = measured.rims.iter().map(ratio).fold(0.0, f64::max);
    let decision =
        lens_decision(Effect::Clipping, choice, nearest, NEAR_RIM, "of the semi-diameter");
    let goes = |rim: &&RimClearance| match choice {
        EffectOverride::Auto => !rim.aspheric && !rim.obstructed && ratio(rim) <= NEAR_RIM,
        EffectOverride::On => false,
        EffectOverride::Off => true,
    };
    let unclipped: Vec<usize> = measured.rims.iter().filter(goes).map(|rim| rim.surface).collect();
    let residual = measured.rims.iter().filter(goes).map(ratio).fold(0.0, f64::max);
    let kept = measured.rims.iter().map(|rim| rim.surface).filter(|i| !unclipped.contains(i));
    let surfaces: Vec<usize> = kept.collect();
    let obstructed = measured.rims.iter().filter(|rim| rim.obstructed).count();
    let obstructing = match obstructed {
        0 => String::new(),
        1 => " and at an obstruction or aperture".to_owned(),
        all => format!(" and at {all} obstructions or apertures"),
    };
    let reason = if measured.rims.is_empty() {
        "no surface has a semi-diameter, an obstruction or another aperture".to_owned()
    } else {
        let (clipped, rays) = (measured.fates.clipped, measured.fates.total());
        let limiting = measured.rims.iter().filter(|rim| ratio(rim) > NEAR_RIM).count();
        let noun = if limiting == 1 { "surface" } else { "surfaces" };
        format!(
            "rays reach {:.0} % of a semi-diameter, and come near the rim at {limiting} {noun}; \
             {clipped} of {rays} are lost there{obstructing}",
            100.0 * nearest
        )
    };
    let computed = !surfaces.is_empty();
    let needed = decision.needed || obstructed > 0;
    (EffectDecision { needed, computed, surfaces, residual, reason, ..decision }, unclipped)
}

/// Keeps all gradient-index gaps or none, and reports the steps in each.
fn grin(
    measured: &EffectMeasurements,
    allowed: f64,
    choice: EffectOverride,
) -> (EffectDecision, Vec<usize>) {
    let total = measured.grin_gaps.iter().fold(0.0, |sum, (_, moved)| sum + moved);
    let decision = lens_decision(Effect::GradientIndex, choice, total, allowed, "mm");
    let goes = !decision.computed;
    let all: Vec<usize> = measured.grin_gaps.iter().map(|(plan, _)| plan.surface).collect();
    let (homogeneous, surfaces) = if goes { (all, Vec::new()) } else { (Vec::new(), all) };
    let reason = if measured.grin_gaps.is_empty() {
        "no gap has a refractive index that varies".to_owned()
    } else {
        format!("without it {}; {}", shift_text(total, allowed), step_text(measured))
    };
    let computed = !surfaces.is_empty();
    let residual = if goes { total } else { 0.0 };
    (EffectDecision { computed, surfaces, residual, reason, ..decision }, homogeneous)
}

/// The steps in every gradient-index gap, in words.
fn step_text(measured: &EffectMeasurements) -> String {
    let of = |(plan, _): &(GrinStepPlan, f64)| {
        format!(
            "behind surface {} in {} steps ({} evaluations of the index), accurate to {:.0e} mm",
            SurfaceNumber::new(plan.surface),
            plan.steps,
            plan.kicks,
            plan.error
        )
    };
    measured.grin_gaps.iter().map(of).collect::<Vec<_>>().join(", ")
}

/// The test is the sign of the number whose square root refraction needs anyway: it cannot be left
/// out, and leaving it out would save nothing.
fn reflection(measured: &EffectMeasurements, choice: EffectOverride) -> EffectDecision {
    let nearest = measured.critical_angle.map_or(0.0, |angle| angle.to_radians().cos());
    let decision = lens_decision(
        Effect::TotalReflection,
        choice,
        nearest,
        NEAR_GRAZING,
        "of the critical sine",
    );
    let reason = match measured.critical_angle {
        None => "the index falls at no surface that rays leave".to_owned(),
        Some(_) if measured.fates.total_reflection > 0 => {
            let EffectMeasurements { fates, .. } = measured;
            format!("{} of {} rays are totally reflected", fates.total_reflection, fates.total())
        }
        Some(angle) => format!("no ray leaves a surface at less than {angle:.1} degrees to it"),
    };
    let kept = if choice == EffectOverride::Off {
        "; the test is part of refraction and remains"
    } else {
        ""
    };
    let reason = reason + kept;
    let computed = !measured.index_drops.is_empty();
    EffectDecision {
        computed,
        residual: 0.0,
        surfaces: measured.index_drops.clone(),
        reason,
        ..decision
    }
}

/// The change of light counts as the same part of the smallest spot, so that one number compares
/// with the tolerance.
fn aiming(
    measured: &EffectMeasurements,
    (purpose, allowed): (TracePurpose, f64),
    choice: EffectOverride,
) -> EffectDecision {
    let AimingDifference { shift, light, rays } = measured.paraxial_aiming;
    // Spots and drawings are of all rays together; elsewhere each has its place in the pupil.
    let shift = match purpose {
        TracePurpose::Trace | TracePurpose::Exact => shift.max(rays),
        TracePurpose::Spot(_) | TracePurpose::Layout => shift,
    };
    let as_shift = |light: f64| if light == 0.0 { 0.0 } else { light * measured.smallest_spot };
    let decision = lens_decision(Effect::Aiming, choice, shift.max(as_shift(light)), allowed, "mm");
    let reason = if shift.is_finite() {
        format!(
            "aimed at the paraxial entrance pupil, {} would change by {}, light by up to {}; {}",
            if shift == rays { "rays" } else { "chief rays or spots" },
            micrometres(shift),
            percent(light),
            allowed_text(allowed)
        )
    } else {
        "rays aimed at the paraxial entrance pupil do not reach the stop".to_owned()
    };
    EffectDecision { reason, ..decision }
}

fn object(measured: &EffectMeasurements, allowed: f64, choice: EffectOverride) -> EffectDecision {
    let moved = measured.finite_object.map_or(0.0, |(_, moved)| moved);
    let decision = lens_decision(Effect::FiniteObject, choice, moved, allowed, "mm");
    let reason = match measured.finite_object {
        None => "the object is at infinity".to_owned(),
        Some((distance, moved)) => {
            format!("from infinity instead of {distance} mm {}", shift_text(moved, allowed))
        }
    };
    let computed = decision.computed && measured.finite_object.is_some();
    EffectDecision { computed, reason, ..decision }
}

/// Keeps all tilts and decentres or none: a break of the axis is taken back by another one.
fn poses(measured: &EffectMeasurements, allowed: f64, choice: EffectOverride) -> EffectDecision {
    let PlacedSurfaces { surfaces, shift } = &measured.poses;
    let decision = lens_decision(Effect::Poses, choice, *shift, allowed, "mm");
    let reason = match surfaces.len() {
        0 => "every surface is centred on the axis".to_owned(),
        1 => format!("with the surface centred {}", shift_text(*shift, allowed)),
        all => format!("with {all} surfaces centred {}", shift_text(*shift, allowed)),
    };
    let computed = decision.computed && !surfaces.is_empty();
    let surfaces = if computed { surfaces.clone() } else { Vec::new() };
    EffectDecision { computed, surfaces, reason, ..decision }
}

fn temperature(
    measured: &EffectMeasurements,
    allowed: f64,
    choice: EffectOverride,
) -> EffectDecision {
    let moved = measured.temperature.map_or(0.0, |(_, moved)| moved);
    let decision = lens_decision(Effect::Temperature, choice, moved, allowed, "mm");
    let reason = match measured.temperature {
        None => "the lens is at the temperature of its catalogues".to_owned(),
        Some((celsius, moved)) => format!(
            "with the indices of {ROOM_CELSIUS} in place of {celsius} C {}",
            shift_text(moved, allowed)
        ),
    };
    let computed = decision.computed && measured.temperature.is_some();
    EffectDecision { computed, reason, ..decision }
}

/// No ray moves and no spot changes by what glasses absorb: it is left out unless it is asked for.
fn absorption(measured: &EffectMeasurements, choice: EffectOverride) -> EffectDecision {
    let share = measured.absorption;
    let unit = "of the light";
    // No share is above all of the light.
    let decision = lens_decision(Effect::Absorption, choice, share, 1.0, unit);
    let reason = if share > 0.0 {
        let share = percent(share);
        format!("spots count rays and not their light, of which glasses absorb {share} on the axis")
    } else {
        "no glass of the lens is known to absorb light".to_owned()
    };
    let computed = decision.computed && share > 0.0;
    EffectDecision { computed, residual: 0.0, reason, ..decision }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lengths_have_three_digits_and_no_long_row_of_zeros() {
        for (mm, text) in [
            (0.0, "0 um"),
            (0.0123, "12.3 um"),
            (-0.5, "-500 um"),
            (2.0, "2000 um"),
            (1.234e-5, "0.0123 um"),
            (2.5e-8, "2.50e-5 um"),
            (1234.0, "1.23e6 um"),
        ] {
            assert_eq!(micrometres(mm), text);
        }
    }
}
