//! From the result of a search to a lens that can be manufactured: catalogue glasses, all
//! constraints satisfied exactly rather than penalized, sharpness and light confirmed by an
//! independent set of rays.
//!
//! A penalty balances the rest of the goal slightly outside its limit. So the limits are tightened
//! by a margin that grows until all constraints are satisfied.

use super::{LandscapeError, LensLandscape, LensSummary, describe_violation};
use crate::lens::{Lens, Medium, glass};
use crate::merit::{ConstraintMargin, Term, WeightedTerm, constraint_margins};
use crate::optimize::DescentState;
use crate::pupil::{PupilPattern, RayModel, Region};
use crate::search::element::{ElementKind, elements};
use crate::search::{Landscape as _, SearchRules};
use serde::Serialize;
use std::sync::Arc;

/// The maximum number of rounds, each with tighter limits.
const ROUNDS: i32 = 6;
/// Local moves per round.
const MOVES: usize = 40;
/// The margin by which limits are tightened per round: in mm, and relative for shares and ratios.
const MARGIN_STEP: [f64; 2] = [2e-3, 2e-3];
/// The factor by which the weights of constraints grow in each round.
const WEIGHT_GROWTH: f64 = 4.0;
/// The relative tolerance for the agreement of two samplings.
const AGREEMENT: f64 = 0.02;
/// The second sampling, for every field and wavelength.
const CROSS_CHECK_PATTERN: PupilPattern = PupilPattern::Sobol { count: 1 << 14, seed: 1 };
/// The tolerance of the first sampling.
const FIRST_TOLERANCE: f64 = 1e-4;

/// The result of finalizing a lens.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct FinalizedLens {
    /// The lens.
    pub lens: Lens,
    /// The substituted glasses.
    pub glasses: Vec<GlassSubstitution>,
    /// Glasses outside the rules that are retained because they touch surfaces that stay unchanged.
    pub unlisted: Vec<UnlistedGlass>,
    /// Surfaces in front of gradient-index media, which no catalogue has; each is retained.
    pub gradients: Vec<usize>,
    /// The margins of all constraints.
    pub limits: Vec<ConstraintMargin>,
    /// The pupil area of every field, in mm², with its minimum.
    pub light: Vec<ConstraintMargin>,
    /// The summary of the lens.
    pub figures: LensSummary,
    /// The comparison with an independent set of rays.
    pub confirmed: Vec<CrossCheck>,
}

/// A retained glass outside the rules.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct UnlistedGlass {
    /// The surface in front of it, a row index from 0.
    pub surface: usize,
    /// The glass.
    pub glass: String,
}

/// A substituted glass: a model glass, or one outside the rules.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct GlassSubstitution {
    /// The surface in front of it, a row index from 0.
    pub surface: usize,
    /// The original refractive index and Abbe number; no Abbe number for a constant index.
    pub was: (f64, Option<f64>),
    /// The catalogue glass.
    pub glass: String,
    /// Its index and Abbe number.
    pub is: (f64, f64),
}

/// The cross-check of a field by a second sampling of its pupil.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct CrossCheck {
    /// The zoom position.
    pub zoom: usize,
    /// The field.
    pub field: usize,
    /// The RMS spot radius of the second sampling, in mm.
    pub spot: f64,
    /// The clear pupil area of the second sampling, in mm².
    pub light: f64,
    /// True if both agree with the first sampling.
    pub agrees: bool,
}

impl FinalizedLens {
    /// Messages for all violated constraints and failed cross-checks; empty if the lens can be
    /// manufactured.
    pub fn failures(&self) -> Vec<String> {
        let limits = self.limits.iter().chain(&self.light).filter(|limit| limit.slack() < 0.0);
        let disagreements = self.confirmed.iter().filter(|field| !field.agrees);
        let disagreement = |field: &CrossCheck| {
            let CrossCheck { zoom, field, .. } = field;
            format!("field {field} at zoom {zoom}: two samplings of the pupil disagree")
        };
        limits.map(describe_violation).chain(disagreements.map(disagreement)).collect()
    }
}

/// Turns the result of a search on this landscape into a lens that can be manufactured.
///
/// # Errors
/// The lens has no merit, or no glass is permitted.
pub fn finalize(landscape: &LensLandscape, lens: &Lens) -> Result<FinalizedLens, LandscapeError> {
    let (mut lens, glasses, unlisted) = with_catalogue_glasses(lens, &landscape.rules)?;
    for round in 0..ROUNDS {
        let tight = landscape.tighten(round);
        // Limits that cannot all hold are broken by a little each, and tightened in the next round.
        let (mut memory, mut at) = (DescentState::with_penalties(), Arc::new(lens.clone()));
        let mut best = tight.loss(&at);
        for _ in 0..MOVES {
            let (there, loss, _) = tight.descend(&at, &mut memory);
            if loss < best {
                best = loss;
                lens.clone_from(&there);
            }
            at = there;
        }
        let light = landscape.light_margins(&lens)?;
        let limits = landscape.limits(&lens)?;
        if limits.iter().chain(&light).all(|limit| limit.slack() >= 0.0) {
            break;
        }
    }
    let figures = LensSummary::new(&lens, FIRST_TOLERANCE)?;
    Ok(FinalizedLens {
        limits: landscape.limits(&lens)?,
        light: landscape.light_margins(&lens)?,
        confirmed: cross_check(&lens, &figures)?,
        gradients: gradient_surfaces(&lens),
        glasses,
        unlisted,
        figures,
        lens,
    })
}

impl LensLandscape {
    /// The margins of all constraints of the goal and of the number of elements.
    pub(super) fn limits(&self, lens: &Lens) -> Result<Vec<ConstraintMargin>, LandscapeError> {
        let mut limits = vec![self.element_count_margin(lens)];
        limits.extend(constraint_margins(lens, self.goal.terms.iter().copied())?);
        if self.goal.terms.iter().any(|w| matches!(w.term, Term::Operand { .. })) {
            let merit = self.merit(lens, FIRST_TOLERANCE)?;
            limits.extend(merit.operand_margins(&merit.values(lens))?);
        }
        Ok(limits)
    }

    /// The pupil area of every field and wavelength with the minimum of the goal.
    pub(super) fn light_margins(
        &self,
        lens: &Lens,
    ) -> Result<Vec<ConstraintMargin>, LandscapeError> {
        let share = self.goal.terms.iter().find_map(|w| match w.term {
            Term::Light(share) => Some(share),
            _ => None,
        });
        let Some(share) = share else { return Ok(Vec::new()) };
        let areas = self.merit(lens, FIRST_TOLERANCE)?.spot_samplings();
        let before = self.light.iter().flatten();
        let margin = |(spot, before): (&crate::merit::SpotSampling, &f64)| ConstraintMargin {
            term: "light",
            surface: Some(spot.field),
            field: None,
            zoom: spot.zoom,
            um: Some(spot.um),
            value: spot.area,
            min: Some(share * before),
            max: None,
        };
        Ok(areas.iter().zip(before).map(margin).collect())
    }

    /// The same landscape with tighter and more strongly weighted constraints.
    fn tighten(&self, round: i32) -> Self {
        let [mm, part] = MARGIN_STEP.map(|first| first * f64::from(round + 1));
        let harder = WEIGHT_GROWTH.powi(round);
        let tighter = |w: &WeightedTerm| {
            let term = match w.term {
                Term::GlassCenter { min, max } => {
                    Term::GlassCenter { min: min + mm, max: max - mm }
                }
                Term::AirCenter { min, max } => Term::AirCenter { min: min + mm, max: max - mm },
                Term::SemiDiameter { min, max } => Term::SemiDiameter { min, max: max - mm },
                Term::GlassEdge(min) => Term::GlassEdge(min + mm),
                Term::AirEdge(min) => Term::AirEdge(min + mm),
                Term::TotalTrack(max) => Term::TotalTrack(max - mm),
                Term::BackFocus(min) => Term::BackFocus(min + mm),
                Term::Steepness(max) => Term::Steepness(max * (1.0 - part)),
                Term::Light(share) => Term::Light(share * (1.0 + part)),
                Term::Operand { kind, min, max } if min != max => {
                    let step = if kind.is_length() { mm } else { part };
                    let (min, max) = (min.map(|min| min + step), max.map(|max| max - step));
                    Term::Operand { kind, min, max }
                }
                other => return WeightedTerm { term: other, ..*w },
            };
            WeightedTerm { term, weight: w.weight * harder, ..*w }
        };
        let mut tight = self.clone();
        tight.goal.terms = self.goal.terms.iter().map(tighter).collect();
        tight
    }
}

fn gradient_surfaces(lens: &Lens) -> Vec<usize> {
    let is_one = |i: &usize| matches!(lens.surfaces[*i].medium, Medium::Grin(_));
    (0..lens.surfaces.len()).filter(is_one).collect()
}

/// Replaces model glasses and glasses outside the rules by the nearest permitted one. Glasses that
/// touch surfaces that stay unchanged are retained.
fn with_catalogue_glasses(
    lens: &Lens,
    rules: &SearchRules,
) -> Result<(Lens, Vec<GlassSubstitution>, Vec<UnlistedGlass>), LandscapeError> {
    let mut real = lens.clone();
    let (mut exchanged, mut unlisted) = (Vec::new(), Vec::new());
    let rows = lens.surfaces.len();
    for element in elements(lens).iter().filter(|e| matches!(e.kind, ElementKind::Glass(_))) {
        for surface in element.first..element.last {
            let was = match &lens.surfaces[surface].medium {
                Medium::Model { nd, vd } => (*nd, (*vd > 0.0).then_some(*vd)),
                Medium::Index(n) => (*n, None),
                Medium::Glass(name) => match glass::find(name).filter(|g| !is_listed(g, rules)) {
                    Some(glass)
                        if rules.may_change(surface, rows)
                            && rules.may_change(surface + 1, rows) =>
                    {
                        (glass.nd, Some(glass.vd))
                    }
                    Some(glass) => {
                        unlisted.push(UnlistedGlass { surface, glass: glass.full_name() });
                        continue;
                    }
                    None => continue,
                },
                Medium::Air | Medium::Mirror | Medium::Grin(_) => continue,
            };
            let found = nearest_glass(was, lens, rules).ok_or_else(|| LandscapeError::Setting {
                what: "the list of glasses",
                found: rules.glasses.join(", "),
                expected: "one with data at every wavelength of the lens",
            })?;
            let glass = found.full_name();
            real.surfaces[surface].medium = Medium::Glass(glass.clone());
            exchanged.push(GlassSubstitution { surface, was, glass, is: (found.nd, found.vd) });
        }
    }
    // The index of a catalogue glass is not a variable.
    let exists = |v: &crate::lens::Variable| real.get(v.parameter).is_some();
    let variables = lens.variables.iter().filter(|v| exists(v)).copied().collect();
    real.variables = variables;
    Ok((real, exchanged, unlisted))
}

/// The differences of index and Abbe number that count as one unit of distance.
const GLASS_DISTANCE_UNIT: [f64; 2] = [0.01, 1.0];

fn is_listed(glass: &glass::Glass, rules: &SearchRules) -> bool {
    rules.allows_glass(&glass.full_name())
}

fn nearest_glass(
    (nd, vd): (f64, Option<f64>),
    lens: &Lens,
    rules: &SearchRules,
) -> Option<&'static glass::Glass> {
    let allowed = |glass: &&glass::Glass| {
        is_listed(glass, rules) && lens.wavelengths.iter().all(|w| glass.index(w.um).is_some())
    };
    let distance = |glass: &glass::Glass| {
        let off = vd.map_or(0.0, |vd| (glass.vd - vd) / GLASS_DISTANCE_UNIT[1]);
        ((glass.nd - nd) / GLASS_DISTANCE_UNIT[0]).hypot(off)
    };
    let all = glass::catalogue().iter().filter(allowed);
    all.min_by(|a, b| distance(a).total_cmp(&distance(b)))
}

/// Evaluates every field again with Sobol points over a disc around its pupil.
fn cross_check(lens: &Lens, figures: &LensSummary) -> Result<Vec<CrossCheck>, LandscapeError> {
    let mut all = Vec::new();
    for first in &figures.fields {
        let model = RayModel::from_lens(lens, first.zoom)?;
        let field = model.fields[first.field];
        let total: f64 = model.channels.iter().map(|color| color.weight).sum();
        let (mut light, mut sum, mut mean, mut square) = (0.0, 0.0, [0.0; 2], 0.0);
        for (i, color) in model.channels.iter().enumerate() {
            let Ok(launch) = model.launch(field, i) else { continue };
            let region = Region::new(launch);
            let moments = region.moments(&region.pattern_nodes(CROSS_CHECK_PATTERN));
            let share = color.weight / total;
            light += share * moments.area;
            if moments.area > 0.0 {
                let [x, y] = moments.centroid;
                sum += share;
                mean = [mean[0] + share * x, mean[1] + share * y];
                square += share * (moments.spread / moments.area + x * x + y * y);
            }
        }
        let [x, y] = mean.map(|m| m / sum);
        let spot = (square / sum - x * x - y * y).max(0.0).sqrt();
        let close = |a: f64, b: f64| (a - b).abs() <= AGREEMENT * b.abs();
        let sharp = first.spot.is_none_or(|first| close(spot, first.value));
        let agrees = sharp && close(light, first.light.value);
        all.push(CrossCheck { zoom: first.zoom, field: first.field, spot, light, agrees });
    }
    Ok(all)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_second_sampling_confirms_what_is_true_and_nothing_else() {
        let found =
            crate::files::bundled_lenses().iter().find(|b| b.name == "tessar_50_f28").unwrap();
        let mut lens = crate::files::json::read(found.text, found.name).unwrap();
        // A field in no plane of the coordinates, so that its spot is beside both.
        let field = &mut lens.fields.values[1];
        (field.x, field.y) = (0.6 * field.y, 0.8 * field.y);
        lens.fields.values = vec![*field];
        let figures = LensSummary::new(&lens, 1e-4).unwrap();
        let agrees = |change: &dyn Fn(&mut LensSummary)| {
            let mut figures = figures.clone();
            change(&mut figures);
            cross_check(&lens, &figures).unwrap()[0].agrees
        };
        assert!(agrees(&|_| {}));
        assert!(!agrees(&|figures| figures.fields[0].light.value *= 1.05));
        assert!(!agrees(&|figures| figures.fields[0].light.value *= 0.95));
        for factor in [0.95, 1.05] {
            let spot = |figures: &mut LensSummary| {
                figures.fields[0].spot.iter_mut().for_each(|spot| spot.value *= factor);
            };
            assert!(!agrees(&spot), "{factor}");
        }
    }

    /// A lens within a tightened bound is within the bound as well.
    #[test]
    fn tightened_bounds_lie_inside_of_the_bounds() {
        let found =
            crate::files::bundled_lenses().iter().find(|b| b.name == "tessar_50_f28").unwrap();
        let lens = crate::files::json::read(found.text, found.name).unwrap();
        let mut landscape =
            crate::search::lens_landscape::SearchPlan::default().landscape(&lens).unwrap();
        let gap =
            Term::Operand { kind: crate::merit::OperandKind::Gap, min: Some(1.0), max: Some(9.0) };
        landscape.goal.terms =
            vec![WeightedTerm::new(gap, 1.0), WeightedTerm::new(Term::BackFocus(30.0), 1.0)];
        for round in 0..3 {
            let tight = landscape.tighten(round).goal.terms;
            let Term::Operand { min: Some(min), max: Some(max), .. } = tight[0].term else {
                panic!("{tight:?}");
            };
            assert!(min > 1.0 && max < 9.0 && min < max, "{min} {max}");
            assert!(matches!(tight[1].term, Term::BackFocus(min) if min > 30.0));
            assert!(tight[0].weight >= 1.0);
        }
    }
}
