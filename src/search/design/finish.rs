//! The end of a design: rims, beams that get through them, every limit kept, judgement.

use super::LensRequirements;
use super::draft::{BeamPlan, Freedom, LensDraft, LimitCost, descend, limit_costs, traced_beams};
use super::judge::{JUDGEMENT_TOLERANCE, LensJudgement, judge_lens};
use super::rims::with_rims;
use super::run::Candidate;
use crate::lens::Lens;
use rayon::prelude::*;
use serde::Serialize;

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
    /// The costs of its binding limits.
    pub costs: Vec<LimitCost>,
    /// The lens.
    pub lens: Lens,
}

/// The rounds of a finish, the trials of each, and the weight of limits.
const ROUNDS: usize = 6;
const TRIALS: usize = 30;
const WEIGHT: f64 = 300.0;
/// The margins of the limits in the rounds, relative to the focal length.
const MARGINS: [f64; ROUNDS] = [0.0, 1e-4, 2e-4, 5e-4, 1e-3, 2e-3];
/// The number of candidates that are finished.
const FINISHED: usize = 4;
/// The additional light of the brightest lens.
const MORE_LIGHT: f64 = 1.15;

/// The best, the simplest and the brightest lens of some candidates; one lens may be several of
/// them, and is then listed once.
pub(super) fn finished_lenses(pool: &[Candidate], asked: &LensRequirements) -> Vec<DesignedLens> {
    let buildable: Vec<&Candidate> = pool.iter().filter(|c| c.is_buildable(asked)).collect();
    let mut chosen: Vec<&Candidate> = buildable.iter().take(FINISHED).copied().collect();
    let cheapest = buildable.iter().min_by(|a, b| a.price().total_cmp(&b.price()));
    chosen.extend(cheapest.filter(|c| chosen.iter().all(|other| other.value != c.value)));
    let mut all: Vec<(f64, DesignedLens)> = chosen
        .par_iter()
        .filter_map(|candidate| Some((candidate.price(), finish(candidate, asked)?)))
        .collect();
    all.sort_by(|a, b| rank(&a.1.judgement).total_cmp(&rank(&b.1.judgement)));
    let Some((best_price, best)) = all.first().cloned() else { return Vec::new() };
    let mut lenses = vec![best];
    let valid = |d: &&(f64, DesignedLens)| d.1.judgement.is_valid() && d.0 < best_price;
    let simplest = all.iter().filter(valid).min_by(|a, b| a.0.total_cmp(&b.0));
    lenses.extend(
        simplest.map(|(_, lens)| DesignedLens { merit: DesignMerit::Simplest, ..lens.clone() }),
    );
    lenses.extend(brightest(&buildable, asked));
    lenses
}

/// The best candidate with more light than asked for, if it then keeps every limit.
fn brightest(pool: &[&Candidate], asked: &LensRequirements) -> Option<DesignedLens> {
    let clear_area = asked.clear_area.iter().map(|area| MORE_LIGHT * area).collect();
    let bright = LensRequirements { clear_area, ..asked.clone() };
    let lens = finish(pool.first()?, &bright)?;
    lens.judgement.is_valid().then_some(DesignedLens { merit: DesignMerit::Brightest, ..lens })
}

/// A number that orders judgements: valid lenses by their spots, then the others.
fn rank(judgement: &LensJudgement) -> f64 {
    if judgement.is_valid() { judgement.rms } else { 1e3 * (1.0 + judgement.rms) }
}

/// A lens that can be built; `None` if no light gets through.
fn finish(candidate: &Candidate, asked: &LensRequirements) -> Option<DesignedLens> {
    let mut draft = settled(&candidate.draft, asked);
    let mut best: Option<(LensJudgement, Lens, Vec<LimitCost>)> = None;
    let mut costs = limit_costs(&draft, asked, &settling(), freedom(asked));
    for margin in MARGINS {
        let Some(lens) = with_rims(&draft, asked) else { break };
        if let Ok(judgement) = judge_lens(&lens, asked, JUDGEMENT_TOLERANCE)
            && best.as_ref().is_none_or(|(before, ..)| rank(&judgement) < rank(before))
        {
            let costs = in_lens(&costs, &lens);
            best = Some((judgement, refocused(&lens, asked), costs));
        }
        let Some(beams) = traced_beams(&lens) else { break };
        let plan = BeamPlan { traced: Some(beams), margin, ..BeamPlan::full(WEIGHT) };
        let freedom = freedom(asked);
        let Some(found) = descend(&draft, asked, &plan, freedom, TRIALS) else { break };
        draft = found.draft;
        costs = limit_costs(&draft, asked, &plan, freedom);
    }
    let (judgement, lens, costs) = best?;
    let origin = candidate.origin.clone();
    Some(DesignedLens { merit: DesignMerit::Best, origin, judgement, costs, lens })
}

fn freedom(asked: &LensRequirements) -> Freedom {
    Freedom { glasses: false, aspheric_surfaces: asked.aspheric_surfaces, pupil: true }
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
    BeamPlan { margin: 1e-4, ..BeamPlan::full(WEIGHT) }
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
