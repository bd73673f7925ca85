//! The end of a design: rims, beams that get through them, every limit kept, judgement, and the
//! refinement of the lenses as they are made.

use super::LensRequirements;
use super::as_built::{DesignedAsBuilt, RefinedLens, most_robust, refined, with_contrast};
use super::draft::{
    BeamPlan, Freedom, LensDraft, LimitCost, USED_TERMS, descend, limit_costs, traced_beams,
};
use super::judge::{JUDGEMENT_TOLERANCE, LensJudgement, judge_lens};
use super::rims::with_rims;
use super::run::Candidate;
use crate::lens::Lens;
use rayon::prelude::*;
use serde::Serialize;
use std::sync::atomic::{AtomicBool, Ordering};

/// The quality in which a designed lens is best.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum DesignMerit {
    /// The smallest spots.
    Best,
    /// The fewest elements, an aspheric surface counted as half of one.
    Simplest,
    /// The most light.
    Brightest,
    /// The smallest spots of lenses that are made.
    Robust,
}

impl DesignMerit {
    /// All of them.
    pub const ALL: [Self; 4] = [Self::Best, Self::Simplest, Self::Brightest, Self::Robust];

    /// Its name in files and reports.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Best => "best",
            Self::Simplest => "simplest",
            Self::Brightest => "brightest",
            Self::Robust => "robust",
        }
    }
}

/// A designed lens.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct DesignedLens {
    /// The quality in which it is best.
    pub merit: DesignMerit,
    /// The start and the mutations that led to it.
    pub origin: String,
    /// Its judgement.
    pub judgement: LensJudgement,
    /// Its spots as it is made; `None` if the requirements state no class of care in making.
    pub as_built: Option<DesignedAsBuilt>,
    /// The costs of its binding limits; once it is refined as it is made, of the expected spot.
    pub costs: Vec<LimitCost>,
    /// The lens.
    pub lens: Lens,
}

/// The rounds of a finish, the trials of each, and the weight of limits.
const ROUNDS: usize = 12;
const TRIALS: usize = 30;
const WEIGHT: f64 = 300.0;
/// The margin of the limits, relative to the focal length.
const MARGIN: f64 = 1e-4;
/// The rounds without a gain by this share after which a lens that keeps every limit is finished.
const PATIENCE: usize = 2;
const SMALL_GAIN: f64 = 5e-3;
/// The part of its violation by which a broken limit is tightened for the next round, and the least
/// tightening of a length, relative to the focal length.
const TIGHTENING: f64 = 1.2;
const LEAST_TIGHTENING: f64 = 1e-5;
/// The number of candidates that are finished.
const FINISHED: usize = 4;
/// The additional light of the brightest lens.
const MORE_LIGHT: f64 = 1.15;

/// The best, the simplest and the brightest lens of some candidates, each refined as it is made, and the
/// most robust one on the way; one lens may be several of them, and is then listed once. Once `stop` is
/// true, none is improved further.
pub(super) fn finished_lenses(
    pool: &[Candidate],
    asked: &LensRequirements,
    stop: &AtomicBool,
) -> Vec<DesignedLens> {
    let buildable: Vec<&Candidate> = pool.iter().filter(|c| c.is_buildable(asked)).collect();
    let mut chosen: Vec<&Candidate> = buildable.iter().take(FINISHED).copied().collect();
    let cheapest = buildable.iter().min_by(|a, b| a.price().total_cmp(&b.price()));
    chosen.extend(cheapest.filter(|c| chosen.iter().all(|other| other.value != c.value)));
    let mut all: Vec<(f64, DesignedLens)> = chosen
        .par_iter()
        .filter_map(|candidate| Some((candidate.price(), finish(candidate, asked, stop)?)))
        .collect();
    all.sort_by(|a, b| rank(&a.1.judgement).total_cmp(&rank(&b.1.judgement)));
    let Some((best_price, best)) = all.first().cloned() else { return Vec::new() };
    let mut lenses = vec![(best, asked.clone())];
    let valid = |d: &&(f64, DesignedLens)| d.1.judgement.is_valid() && d.0 < best_price;
    let simplest = all.iter().filter(valid).min_by(|a, b| a.0.total_cmp(&b.0));
    let simplest =
        simplest.map(|(_, lens)| DesignedLens { merit: DesignMerit::Simplest, ..lens.clone() });
    lenses.extend(simplest.map(|lens| (lens, asked.clone())));
    if !stop.load(Ordering::Relaxed) {
        lenses.extend(brightest(&buildable, asked, stop));
    }
    let mut lenses = as_they_are_made(&lenses, stop);
    add_element_cost(&mut lenses);
    lenses
}

/// Adds to the costs of the best lens what an element fewer costs, by the simplest lens beside it.
fn add_element_cost(lenses: &mut [DesignedLens]) {
    let simplest = lenses.iter().find(|lens| lens.merit == DesignMerit::Simplest).cloned();
    let best = lenses.first_mut().filter(|best| best.merit == DesignMerit::Best);
    if let (Some(best), Some(simplest)) = (best, simplest) {
        let cost = element_cost(best, &simplest);
        best.costs.extend(cost.filter(|um| *um > 0.0).map(LimitCost::of_element));
    }
}

/// The growth of the RMS spot radius for each element that a simpler lens has fewer, in µm, as built if that is known of
/// both; `None` of lenses that differ in their aspheres or not in elements, or were chosen by their contrast.
fn element_cost(best: &DesignedLens, simpler: &DesignedLens) -> Option<f64> {
    let (a, b) = (&best.judgement, &simpler.judgement);
    let fewer = a.elements.checked_sub(b.elements).filter(|count| *count > 0)?;
    if a.aspheric_surfaces != b.aspheric_surfaces || a.contrast.is_some() {
        return None;
    }
    let made = best.as_built.zip(simpler.as_built).map(|(a, b)| b.mean - a.mean);
    Some(1e3 * made.unwrap_or(b.rms - a.rms) / fewer as f64)
}

/// Lenses that are refined as they are made, each within its requirements, and the most robust one.
fn as_they_are_made(
    lenses: &[(DesignedLens, LensRequirements)],
    stop: &AtomicBool,
) -> Vec<DesignedLens> {
    let wished = |(lens, asked): &(DesignedLens, LensRequirements)| {
        (with_contrast(lens, asked, stop), asked.clone())
    };
    let lenses: Vec<(DesignedLens, LensRequirements)> = lenses.par_iter().map(wished).collect();
    let found: Vec<RefinedLens> =
        lenses.par_iter().map(|(lens, asked)| refined(lens, asked, stop)).collect();
    let pairs = lenses.iter().zip(&found);
    let mut listed: Vec<DesignedLens> =
        pairs.map(|((lens, _), found)| found.same.as_ref().unwrap_or(lens).clone()).collect();
    let robust = listed.first().and_then(|best| most_robust(found, best));
    listed.extend(robust);
    listed
}

/// The best candidate with more light than asked for, if it then keeps every limit, and its requirements.
fn brightest(
    pool: &[&Candidate],
    asked: &LensRequirements,
    stop: &AtomicBool,
) -> Option<(DesignedLens, LensRequirements)> {
    let clear_area = asked.clear_area.iter().map(|area| MORE_LIGHT * area).collect();
    let bright = LensRequirements { clear_area, ..asked.clone() };
    let lens = finish(pool.first()?, &bright, stop)?;
    let is_valid = lens.judgement.is_valid();
    is_valid.then_some((DesignedLens { merit: DesignMerit::Brightest, ..lens }, bright))
}

/// A number that orders judgements: valid lenses by what is wished of them, the contrast that they lack or
/// their spots, then the others.
pub(super) fn rank(judgement: &LensJudgement) -> f64 {
    let lacking = judgement.contrast.map_or(judgement.rms, |contrast| 1.0 - contrast);
    if judgement.is_valid() { lacking } else { 1e3 * (1.0 + lacking) }
}

/// A lens that can be built; `None` if no light gets through. In every round the limits that the lens
/// before broke are tightened by what it broke them by, since a penalty never keeps its limit. Once
/// `stop` is true, the first lens that can be judged is the result.
fn finish(
    candidate: &Candidate,
    asked: &LensRequirements,
    stop: &AtomicBool,
) -> Option<DesignedLens> {
    let mut draft = settled(&candidate.draft, asked);
    let mut best: Option<(LensJudgement, Lens, Vec<LimitCost>)> = None;
    let mut costs = limit_costs(&draft, asked, &settling(), freedom(asked));
    let mut wanted = TightRequirements { asked: asked.clone(), edge_margin: 0.0 };
    let mut idle = 0;
    for _ in 0..ROUNDS {
        let Some(lens) = with_rims(&draft, &wanted.asked) else { break };
        idle += 1;
        if let Ok(judgement) = judge_lens(&lens, asked, JUDGEMENT_TOLERANCE) {
            wanted.tighten(asked, &judgement);
            let before = best.as_ref().map_or(f64::INFINITY, |(before, ..)| rank(before));
            if rank(&judgement) < before {
                idle = if rank(&judgement) < (1.0 - SMALL_GAIN) * before { 0 } else { idle };
                let costs = in_lens(&costs, &lens);
                best = Some((judgement, refocused(&lens, asked), costs));
            }
        }
        let is_valid = best.as_ref().is_some_and(|(found, ..)| found.is_valid());
        if idle >= PATIENCE && is_valid || best.is_some() && stop.load(Ordering::Relaxed) {
            break;
        }
        let Some(beams) = traced_beams(&lens) else { break };
        let edge_margin = wanted.edge_margin;
        let plan = BeamPlan { traced: Some(beams), edge_margin, ..settling() };
        let freedom = freedom(asked);
        let Some(found) = descend(&draft, &wanted.asked, &plan, freedom, TRIALS) else { break };
        draft = found.draft;
        costs = limit_costs(&draft, &wanted.asked, &plan, freedom);
    }
    let (judgement, lens, costs) = best?;
    let origin = candidate.origin.clone();
    let as_built = asked.as_built.and_then(|grade| DesignedAsBuilt::new(&lens, grade).ok());
    Some(DesignedLens { merit: DesignMerit::Best, origin, judgement, as_built, costs, lens })
}

/// Requirements that are tighter than what is asked for where a lens has broken them.
struct TightRequirements {
    asked: LensRequirements,
    /// The addition to the least thicknesses of glass and air at rims, in mm.
    edge_margin: f64,
}

impl TightRequirements {
    /// Tightens every requirement that a lens breaks by a little more than its violation.
    fn tighten(&mut self, asked: &LensRequirements, judgement: &LensJudgement) {
        let least = LEAST_TIGHTENING * asked.focal_length;
        let mut edge: f64 = 0.0;
        for margin in judgement.limits.iter().filter(|margin| !margin.is_kept) {
            let limit = &margin.limit;
            let excess = TIGHTENING * -limit.slack() + least;
            match limit.term {
                "total_track" => self.asked.track -= excess,
                "back_focus" => self.asked.back_focus += excess,
                "distortion" => {
                    self.asked.distortion *= 1.0 - excess / asked.distortion.max(excess);
                }
                "glass_edge" | "air_edge" => edge = edge.max(excess),
                _ => {}
            }
        }
        self.edge_margin += edge;
        for (i, field) in judgement.fields.iter().enumerate() {
            let area = asked.clear_area[i] / field.clear_area;
            let light = asked.relative_illumination[i] / field.relative_illumination;
            let short = area.max(light) - 1.0;
            if short > 0.0 {
                self.asked.clear_area[i] *= 1.0 + TIGHTENING * short + LEAST_TIGHTENING;
            }
        }
    }
}

fn freedom(asked: &LensRequirements) -> Freedom {
    Freedom {
        glasses: false,
        aspheric_surfaces: asked.aspheric_surfaces,
        terms: USED_TERMS,
        pupil: true,
    }
}

/// The costs with the surfaces of a lens, which has a diaphragm that its draft has not.
fn in_lens(costs: &[LimitCost], lens: &Lens) -> Vec<LimitCost> {
    let diaphragm = lens.surfaces.iter().position(|row| row.stop && row.comment == "diaphragm");
    let behind = |row: usize| diaphragm.is_some_and(|stop| row >= stop);
    let moved = |cost: &LimitCost| {
        let surface = cost.surface.map(|row| if behind(row) { row + 1 } else { row });
        LimitCost { surface, ..cost.clone() }
    };
    costs.iter().map(moved).collect()
}

/// The beams and the heavy limits of the first descent of a finish.
fn settling() -> BeamPlan {
    BeamPlan { margin: MARGIN, ..BeamPlan::full(WEIGHT) }
}

/// The draft after a descent with heavy limits.
fn settled(draft: &LensDraft, asked: &LensRequirements) -> LensDraft {
    descend(draft, asked, &settling(), freedom(asked), 2 * TRIALS)
        .map_or_else(|| draft.clone(), |found| found.draft)
}

/// The lens with its image plane at the best focus.
fn refocused(lens: &Lens, asked: &LensRequirements) -> Lens {
    let mut lens = lens.clone();
    if let (Ok(judgement), Some(last)) =
        (judge_lens(&lens, asked, JUDGEMENT_TOLERANCE), lens.surfaces.last_mut())
    {
        last.thickness += judgement.refocus;
    }
    lens
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::search::design::LensSpecification;
    use crate::search::design::glasses::snapped;
    use crate::search::design::starts::achromats;
    use std::slice;

    fn finished() -> (LensRequirements, LensDraft, Lens) {
        let spec: LensSpecification = serde_json::from_str(
            r#"{"focal_length_mm": 60.0, "f_number": 6.0, "half_field_deg": 2.0, "max_elements": 3}"#,
        )
        .unwrap();
        let asked = LensRequirements::complete(&spec).unwrap().0;
        let draft = settled(&achromats(&asked)[0].draft, &asked);
        let lens = with_rims(&draft, &asked).unwrap();
        (asked, draft, lens)
    }

    #[test]
    fn lenses_that_keep_their_limits_come_first_and_sharper_ones_before_others() {
        let (asked, _, lens) = finished();
        let mut kept = judge_lens(&lens, &asked, JUDGEMENT_TOLERANCE).unwrap();
        kept.faults.clear();
        kept.limits.clear();
        let with = |rms: f64, fault: bool| {
            let mut judgement = LensJudgement { rms, ..kept.clone() };
            judgement.faults.extend(fault.then(|| "a fault".to_owned()));
            rank(&judgement)
        };
        let order = [(0.01, false), (0.02, false), (0.005, true), (0.5, true)];
        let ranks = order.map(|(rms, fault)| with(rms, fault));
        assert!(ranks.windows(2).all(|pair| pair[0] < pair[1]), "{ranks:?}");
    }

    #[test]
    fn a_refocused_lens_is_in_focus() {
        let (asked, _, mut lens) = finished();
        lens.surfaces.last_mut().unwrap().thickness += 0.3;
        let off = |lens: &Lens| judge_lens(lens, &asked, JUDGEMENT_TOLERANCE).unwrap().refocus;
        assert!(off(&lens).abs() > 0.1, "{}", off(&lens));
        let sharp = refocused(&lens, &asked);
        assert!(off(&sharp).abs() < 0.01, "{}", off(&sharp));
    }

    /// A lens that is longer than what is asked for pays for its length.
    #[test]
    fn a_limit_that_is_broken_has_a_cost() {
        let (mut asked, draft, lens) = finished();
        asked.track = lens.total_track() - 2.0;
        let costs = limit_costs(&draft, &asked, &settling(), freedom(&asked));
        let track = costs.iter().find(|cost| cost.term == "total_track").unwrap();
        assert!(track.um_per_mm > Some(0.0) && track.surface.is_none(), "{costs:?}");
        let lengths = &costs[..costs.len() - 1];
        assert!(lengths.windows(2).all(|pair| pair[0].um_per_mm >= pair[1].um_per_mm), "{costs:?}");
        let light = costs.last().unwrap();
        assert!(light.term == "light" && light.um_per_percent > Some(0.0), "{costs:?}");
    }

    #[test]
    fn an_element_fewer_costs_what_the_simplest_lens_lacks() {
        let (asked, draft, lens) = finished();
        let judgement = judge_lens(&lens, &asked, JUDGEMENT_TOLERANCE).unwrap();
        let candidate = Candidate { origin: "an achromat".to_owned(), draft, value: 0.0 };
        let lens = finish(&candidate, &asked, &AtomicBool::new(true)).unwrap();
        let of = |merit, elements: usize, rms: f64| DesignedLens {
            merit,
            judgement: LensJudgement { rms, elements, ..judgement.clone() },
            costs: Vec::new(),
            as_built: None,
            ..lens.clone()
        };
        let cost = |elements: usize, rms: f64| {
            let best = of(DesignMerit::Best, 6, 0.010);
            let mut lenses = [best, of(DesignMerit::Simplest, elements, rms)];
            add_element_cost(&mut lenses);
            lenses[0].costs.first().and_then(|cost| cost.um_per_element)
        };
        assert!((cost(4, 0.016).unwrap() - 3.0).abs() < 1e-9);
        assert_eq!(cost(6, 0.016), None);
        assert_eq!(cost(4, 0.009), None);
    }

    /// A lens without a simpler one beside it is not the simplest as well.
    #[test]
    fn a_lens_is_listed_once() {
        let (asked, draft, _) = finished();
        let draft = settled(&snapped(&draft, &asked), &asked);
        let candidate = Candidate { origin: "an achromat".to_owned(), draft, value: 0.0 };
        let lenses = finished_lenses(slice::from_ref(&candidate), &asked, &AtomicBool::new(false));
        assert!(lenses[0].judgement.is_valid(), "{:?}", lenses[0].judgement.failures());
        assert!(lenses.iter().all(|lens| lens.merit != DesignMerit::Simplest));
        // A request to end leaves the lens that there is.
        let broken_off =
            finished_lenses(slice::from_ref(&candidate), &asked, &AtomicBool::new(true));
        assert_eq!(broken_off.len(), 1);
        assert!(rank(&broken_off[0].judgement) >= rank(&lenses[0].judgement));
    }
}
