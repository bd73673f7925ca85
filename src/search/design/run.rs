//! A design in rounds: starts, successive halving, mutations, catalogue glasses.
//!
//! Every round depends only on the state before it and on the seed, so that a run can be saved
//! between two rounds and resumed, and has the same result on any number of threads.

use super::LensRequirements;
use super::draft::{BeamPlan, Freedom, LensDraft, USED_TERMS, asphere_gains, descend};
use super::finish::{DesignedLens, finished_lenses};
use super::glasses::{exchanged, in_catalogue, snapped};
use super::judge::is_aspheric;
use super::rims::with_rims;
use super::starts::{NamedDraft, achromats, draft_of, library_starts, random_starts};
use super::thin_triplet::triplets;
use crate::lens::{Aperture, Lens, Medium, Parameter, Quantity, Variable};
use crate::search::element::piece_count;
use crate::search::mutation::perturb_as;
use crate::search::predicted_gain::drawn_by_weight;
use crate::search::{MutatedLens, MutationKind, Random, SearchRules, perturb};
use rand::{RngExt as _, SeedableRng as _};
use rayon::prelude::*;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use std::sync::atomic::{AtomicBool, Ordering};

/// The settings of a design besides its requirements.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct DesignSettings {
    /// The seed of all random numbers.
    pub seed: u64,
    /// The lenses of the library that are no starts; neither are their copies.
    pub without: Vec<String>,
    /// The largest number of lenses of the library and of random lenses at the start.
    pub starts: [usize; 2],
}

impl DesignSettings {
    /// The usual settings with this seed.
    pub fn with_seed(seed: u64) -> Self {
        Self { seed, without: Vec::new(), starts: STARTS }
    }
}

/// The stage of a design.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum DesignStage {
    /// Starts are led to the full aperture and field.
    Starts,
    /// The better half of them goes on.
    Halving,
    /// Structures are changed.
    Mutations,
    /// Glasses are those of the catalogue and are exchanged.
    Glasses,
}

/// A lens of a run.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub(super) struct Candidate {
    /// Its origin.
    pub(super) origin: String,
    pub(super) draft: LensDraft,
    /// Its merit, in mm².
    pub(super) value: f64,
}

/// A design that is run round by round.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct DesignRun {
    asked: LensRequirements,
    settings: DesignSettings,
    stage: DesignStage,
    rounds: u64,
    gradients: u64,
    pool: Vec<Candidate>,
}

/// The usual number of lenses of the library and of random lenses at the start.
const STARTS: [usize; 2] = [32, 12];
/// The number of random lenses of which the best one is a start.
const TRIES: usize = 60;
/// The largest number of elements for which a triplet is a start.
const LARGEST_FROM_TRIPLET: usize = 6;
/// The share of aperture and field at which a start is tried first.
const FIRST_LEVEL: f64 = 0.35;
/// The largest increase of that share at once, and the smallest one that is tried.
const LEVEL_STEPS: [f64; 2] = [0.25, 0.02];
/// The trials at each share.
const LEVEL_TRIALS: usize = 24;
/// The trials of a candidate in a round of halving.
const HALVING_TRIALS: usize = 72;
/// The number of candidates that stay.
const POOL: usize = 8;
/// The number of mutants of a round, and of those that go on.
const MUTANTS: usize = 12;
const CHOSEN: usize = 4;
const MUTANT_TRIALS: usize = 36;
const CHOSEN_TRIALS: usize = 120;
/// The number of candidates of one structure that stay: descendants of one lens would fill the pool
/// before others have had their descents.
const ALIKE: usize = 2;
/// The share of mutants that are mutated once more: of those that have lost an element, which get one
/// at another place, and of the others.
const TWICE: [f64; 2] = [0.7, 0.2];
/// The share of mutants with an aspheric figure on another surface, the least gain that one promises, and
/// the conic constant and coefficient that mark it.
const FIGURED: f64 = 0.25;
const LEAST_GAIN: f64 = 0.02;
const MARK: [f64; 2] = [1e-9, 1e-18];
/// The shares of the budget at which mutations end and at which the glasses are settled.
const MUTATIONS_END: f64 = 0.5;
const GLASSES_END: f64 = 0.9;
/// The weights of limits at the start and later.
const SOFT: f64 = 0.05;
const FIRM: f64 = 10.0;
/// The relative difference of merits below which two candidates are the same.
const SAME: f64 = 2e-3;

impl DesignRun {
    /// A design before its first round.
    pub fn new(asked: &LensRequirements, settings: &DesignSettings) -> Self {
        Self {
            asked: asked.clone(),
            settings: settings.clone(),
            stage: DesignStage::Starts,
            rounds: 0,
            gradients: 0,
            pool: Vec::new(),
        }
    }

    /// The requirements.
    pub fn requirements(&self) -> &LensRequirements {
        &self.asked
    }

    /// The settings.
    pub fn settings(&self) -> &DesignSettings {
        &self.settings
    }

    /// The stage of the next round.
    pub fn stage(&self) -> DesignStage {
        self.stage
    }

    /// The number of evaluations with derivatives so far.
    pub fn gradients(&self) -> u64 {
        self.gradients
    }

    /// The number of lenses that are kept.
    pub fn pool_size(&self) -> usize {
        self.pool.len()
    }

    /// The root of the best merit in mm, spots and squared violations together; infinite before
    /// there is a lens.
    pub fn best(&self) -> f64 {
        self.pool.first().map_or(f64::INFINITY, |candidate| candidate.value.sqrt())
    }

    /// The best lens so far with rims; `None` before there is one through which light gets.
    pub fn best_lens(&self) -> Option<Lens> {
        with_rims(&self.pool.first()?.draft, &self.asked)
    }

    /// Runs a round; `used` is the share of the budget that is used so far. Returns false if the
    /// budget allows no further one. Once `stop` is true, candidates stay as they are: a round that
    /// is ended so depends on time, and no further one may follow.
    pub fn advance(&mut self, used: f64, stop: &AtomicBool) -> bool {
        match self.stage {
            DesignStage::Starts => self.run_starts(stop),
            DesignStage::Halving => self.halve(stop),
            DesignStage::Mutations if used < MUTATIONS_END => self.mutate(stop),
            DesignStage::Mutations => self.choose_glasses(stop),
            DesignStage::Glasses if used < GLASSES_END => self.exchange(stop),
            DesignStage::Glasses => return false,
        }
        self.rounds += 1;
        !self.pool.is_empty()
    }

    /// Makes lenses that can be built of the best candidates: the best one first. Once `stop` is true,
    /// each stays as it is as soon as it can be built.
    pub fn finish(&self, stop: &AtomicBool) -> Vec<DesignedLens> {
        let snapped: Vec<Candidate> = match self.stage {
            DesignStage::Glasses => self.pool.clone(),
            _ => self.catalogued(stop),
        };
        finished_lenses(&snapped, &self.asked, stop)
    }

    /// The same of the best candidate alone, in less time.
    pub fn finish_best(&self) -> Vec<DesignedLens> {
        let mut first = self.clone();
        first.pool.truncate(1);
        let go_on = AtomicBool::new(false);
        let lenses = first.finish(&go_on);
        if lenses.is_empty() { self.finish(&go_on) } else { lenses }
    }

    /// The generator of a round: the same whatever was drawn before.
    fn random(&self, salt: u64) -> Random {
        let seed = self.settings.seed.wrapping_mul(0x9e37_79b9_7f4a_7c15);
        Random::seed_from_u64(seed ^ (self.rounds << 20) ^ salt)
    }

    fn freedom(&self) -> Freedom {
        let aspheric_surfaces = self.asked.aspheric_surfaces;
        Freedom { glasses: true, aspheric_surfaces, terms: USED_TERMS, pupil: true }
    }

    fn run_starts(&mut self, stop: &AtomicBool) {
        let mut starts = library_starts(&self.asked, &self.settings.without);
        let [library, random] = self.settings.starts;
        starts.truncate(library);
        if self.asked.elements <= 4 {
            starts.extend(achromats(&self.asked).into_iter().filter(|_| self.asked.elements > 1));
        }
        if self.asked.elements <= LARGEST_FROM_TRIPLET {
            starts.extend(triplets(&self.asked));
        }
        starts.extend(random_starts(&self.asked, random, TRIES, &mut self.random(0), stop));
        let led: Vec<(Option<Candidate>, usize)> =
            starts.par_iter().map(|start| self.lead(start, stop)).collect();
        self.take(led);
        self.stage = DesignStage::Halving;
    }

    /// Leads a start to the full aperture and field, unless `stop` becomes true. Where a ray is lost
    /// the share of aperture and field grows by half as much.
    fn lead(&self, start: &NamedDraft, stop: &AtomicBool) -> (Option<Candidate>, usize) {
        let (mut draft, mut used, mut value) = (start.draft.clone(), 0, f64::INFINITY);
        let aspheric_surfaces = self.asked.aspheric_surfaces;
        let (mut level, mut step) = (0.0, FIRST_LEVEL);
        while level < 1.0 {
            if stop.load(Ordering::Relaxed) || step < LEVEL_STEPS[1] {
                return (None, used);
            }
            let next = f64::min(level + step, 1.0);
            let plan = BeamPlan { difficulty: [next, next], ..BeamPlan::full(SOFT) };
            // High powers that few rays hold bend those of the next level away.
            let terms = if next < 1.0 { 1 } else { USED_TERMS };
            let freedom = Freedom { glasses: level > 0.5, aspheric_surfaces, terms, pupil: true };
            if let Some(found) = descend(&draft, &self.asked, &plan, freedom, LEVEL_TRIALS) {
                (draft, value, level) = (found.draft, found.value, next);
                used += found.gradients;
                step = f64::min(2.0 * step, LEVEL_STEPS[0]);
            } else {
                used += 1;
                step *= 0.5;
            }
        }
        (Some(Candidate { origin: start.name.clone(), draft, value }), used)
    }

    /// Takes candidates into the pool, the best first.
    fn take(&mut self, found: Vec<(Option<Candidate>, usize)>) {
        for (candidate, used) in found {
            self.gradients += used as u64;
            self.pool.extend(candidate.filter(|c| c.value.is_finite()));
        }
        self.sort();
    }

    fn sort(&mut self) {
        self.pool.sort_by(|a, b| a.value.total_cmp(&b.value));
        self.pool.dedup_by(|a, b| {
            (a.value - b.value).abs() < SAME * b.value
                && a.draft.lens.surfaces.len() == b.draft.lens.surfaces.len()
        });
    }

    /// Descends from every candidate with firm limits; those that fail are dropped. Once `stop` is
    /// true, they stay as they are.
    fn improve(
        &self,
        all: &[Candidate],
        trials: usize,
        glasses: bool,
        stop: &AtomicBool,
    ) -> Vec<(Option<Candidate>, usize)> {
        let plan = BeamPlan::full(FIRM);
        let freedom = Freedom { glasses, ..self.freedom() };
        let better = |candidate: &Candidate| {
            if stop.load(Ordering::Relaxed) {
                return (Some(candidate.clone()), 0);
            }
            let found = descend(&candidate.draft, &self.asked, &plan, freedom, trials);
            let used = found.as_ref().map_or(1, |found| found.gradients);
            let candidate = found.map(|found| Candidate {
                origin: candidate.origin.clone(),
                draft: found.draft,
                value: found.value,
            });
            (candidate, used)
        };
        all.par_iter().map(better).collect()
    }

    fn halve(&mut self, stop: &AtomicBool) {
        let keep = (self.pool.len() / 2).max(POOL);
        self.pool.truncate(keep);
        let found = self.improve(&self.pool, HALVING_TRIALS, true, stop);
        self.pool.clear();
        self.take(found);
        if self.pool.len() <= POOL {
            self.stage = DesignStage::Mutations;
        }
    }

    /// Mutates parents drawn by rank, and lets the best mutants go on.
    fn mutate(&mut self, stop: &AtomicBool) {
        let mut mutants = Vec::new();
        for i in 0..MUTANTS {
            let mut random = self.random(1 + i as u64);
            mutants.extend(self.mutant(&mut random));
        }
        let first = self.improve(&mutants, MUTANT_TRIALS, true, stop);
        let mut alive: Vec<Candidate> = Vec::new();
        for (candidate, used) in first {
            self.gradients += used as u64;
            alive.extend(candidate);
        }
        alive.sort_by(|a, b| a.value.total_cmp(&b.value));
        alive.truncate(CHOSEN);
        // The best candidate, and one of the others, go on as well.
        let mut random = self.random(0);
        if self.pool.len() > 1 {
            let other = random.random_range(1..self.pool.len());
            alive.push(self.pool.remove(other));
        }
        alive.extend((!self.pool.is_empty()).then(|| self.pool.remove(0)));
        let found = self.improve(&alive, CHOSEN_TRIALS, true, stop);
        self.take(found);
        self.keep_structures_apart();
    }

    /// Keeps the best candidates, of one structure only a few.
    fn keep_structures_apart(&mut self) {
        let mut kept: BTreeMap<String, usize> = BTreeMap::new();
        self.pool.retain(|candidate| {
            let count = kept.entry(structure(&candidate.draft.lens)).or_insert(0);
            *count += 1;
            *count <= ALIKE
        });
        self.pool.truncate(POOL);
    }

    /// A mutant of a parent drawn with weights 1/rank; `None` if none of several mutations applies.
    fn mutant(&self, random: &mut Random) -> Option<Candidate> {
        let total: f64 = (1..=self.pool.len()).map(|rank| 1.0 / rank as f64).sum();
        let mut left = random.random::<f64>() * total;
        let drawn = self.pool.iter().enumerate().find(|(i, _)| {
            left -= 1.0 / (i + 1) as f64;
            left < 0.0
        });
        let parent = drawn.map(|(_, parent)| parent).or(self.pool.first())?;
        if self.asked.aspheric_surfaces > 0
            && random.random::<f64>() < FIGURED
            && let Some(mutant) = self.figured_mutant(parent, random)
        {
            return Some(mutant);
        }
        let rules = self.rules();
        let mut lens = with_rims(&parent.draft, &self.asked)?;
        lens.aperture = Aperture::EntrancePupilDiameter(2.0 * self.asked.beam_radius());
        lens.variables = variables(&lens);
        for _ in 0..4 {
            let Ok(mutant) = perturb(&lens, &rules, random) else { continue };
            let mut origin = format!("{}, {}", parent.origin, mutant.kind.name());
            let mut mutated = mutant.lens;
            if let Some(second) = second_mutation(&lens, &mutated, &rules, random) {
                origin = format!("{origin}, {}", second.kind.name());
                mutated = second.lens;
            }
            let Some(draft) = draft_of(&mutated, &self.asked) else { continue };
            return Some(Candidate { origin, draft, value: f64::INFINITY });
        }
        None
    }

    /// A mutant with an aspheric figure on another surface, drawn in proportion to what the derivatives
    /// promise there; `None` if nothing is promised.
    fn figured_mutant(&self, parent: &Candidate, random: &mut Random) -> Option<Candidate> {
        let mut draft = parent.draft.clone();
        let rows = draft.lens.surfaces.iter().enumerate();
        let present: Vec<usize> =
            rows.filter(|(_, row)| is_aspheric(row)).map(|(i, _)| i).collect();
        if present.len() >= self.asked.aspheric_surfaces {
            let dropped = &mut draft.lens.surfaces[present[random.random_range(0..present.len())]];
            (dropped.conic, dropped.asphere) = (0.0, Vec::new());
        }
        let mut gains = asphere_gains(&draft, &self.asked, &BeamPlan::full(FIRM));
        gains.retain(|(row, gain)| *gain > LEAST_GAIN && !present.contains(row));
        let row = drawn_by_weight(&gains, random.random())?;
        // Hardly anything: the mark of a surface that a descent makes aspheric.
        let figured = &mut draft.lens.surfaces[row];
        if figured.curvature == 0.0 {
            figured.asphere = vec![MARK[1]];
        } else {
            figured.conic = MARK[0];
        }
        let origin = format!("{}, {}", parent.origin, MutationKind::AddAsphere.name());
        Some(Candidate { origin, draft, value: f64::INFINITY })
    }

    fn rules(&self) -> SearchRules {
        let asked = &self.asked;
        SearchRules {
            elements: [1, asked.elements],
            glasses: asked.glasses.names.clone(),
            glass_center: [asked.glass_center, 0.5 * asked.track],
            glass_edge: asked.glass_edge,
            air_center: [asked.air_center, asked.track],
            air_edge: 0.0,
            semi_diameter: Some(asked.semi_diameter),
            track: Some(1.2 * asked.track),
            back_focus: Some(0.8 * asked.back_focus),
            weights: vec![(MutationKind::MoveStop, 0.0), (MutationKind::Flip, 0.3)],
            ..SearchRules::default()
        }
    }

    /// The pool with glasses of the catalogue.
    fn catalogued(&self, stop: &AtomicBool) -> Vec<Candidate> {
        let snap = |candidate: &Candidate| {
            let draft = snapped(&candidate.draft, &self.asked);
            Candidate { draft, ..candidate.clone() }
        };
        let snapped: Vec<Candidate> = self.pool.iter().take(POOL).map(snap).collect();
        let found = self.improve(&snapped, CHOSEN_TRIALS, false, stop);
        // One without gradients stayed as it was: its value is that with the glasses before.
        let mut all: Vec<(bool, Candidate)> =
            found.into_iter().filter_map(|(c, used)| Some((used == 0, c?))).collect();
        all.sort_by(|a, b| a.0.cmp(&b.0).then(a.1.value.total_cmp(&b.1.value)));
        all.into_iter().map(|(_, candidate)| candidate).collect()
    }

    fn choose_glasses(&mut self, stop: &AtomicBool) {
        let catalogued = self.catalogued(stop);
        // The values of candidates that stayed as they were are those with the glasses before.
        if stop.load(Ordering::Relaxed) {
            return;
        }
        self.pool = catalogued;
        self.gradients += (self.pool.len() * CHOSEN_TRIALS) as u64;
        self.stage = DesignStage::Glasses;
    }

    /// Exchanges a glass of one of the best candidates.
    fn exchange(&mut self, stop: &AtomicBool) {
        let mut random = self.random(0);
        let of = (self.rounds as usize) % self.pool.len().clamp(1, 3);
        let Some(parent) = self.pool.get(of).cloned() else { return };
        let trials = exchanged(&parent.draft, &self.asked, &mut random);
        let mutants: Vec<Candidate> =
            trials.into_iter().map(|draft| Candidate { draft, ..parent.clone() }).collect();
        let tried = self.improve(&mutants, MUTANT_TRIALS, false, stop);
        // The values of mutants that stayed as they were are those of their parent.
        if stop.load(Ordering::Relaxed) {
            return;
        }
        let mut alive: Vec<Candidate> = Vec::new();
        for (candidate, used) in tried {
            self.gradients += used as u64;
            alive.extend(candidate);
        }
        alive.sort_by(|a, b| a.value.total_cmp(&b.value));
        alive.truncate(2);
        let promising = |c: &Candidate| c.value < 1.5 * parent.value;
        alive.retain(promising);
        alive.push(parent);
        let found = self.improve(&alive, HALVING_TRIALS, false, stop);
        let best = found.into_iter().filter_map(|(candidate, used)| {
            self.gradients += used as u64;
            candidate
        });
        let best = best.min_by(|a, b| a.value.total_cmp(&b.value));
        if let Some(best) = best {
            self.pool[of] = best;
        }
        self.pool.sort_by(|a, b| a.value.total_cmp(&b.value));
    }
}

/// Another mutation of a mutant, if it is to have one and it applies: one that has fewer elements than its
/// parent gets an element, since a smaller lens is seldom better.
fn second_mutation(
    parent: &Lens,
    mutant: &Lens,
    rules: &SearchRules,
    random: &mut Random,
) -> Option<MutatedLens> {
    let is_smaller = piece_count(mutant) < piece_count(parent);
    let share = if is_smaller { TWICE[0] } else { TWICE[1] };
    if random.random::<f64>() >= share {
        return None;
    }
    let mutated = if is_smaller {
        perturb_as(MutationKind::AddSinglet, mutant, rules, random)
    } else {
        perturb(mutant, rules, random)
    };
    mutated.ok()
}

/// The pattern of glass and air with the signs of the powers of all pieces in air; a bent lens has the same,
/// unlike the signs of its curvatures.
fn structure(lens: &Lens) -> String {
    let pieces = lens.surfaces.windows(2).map(|pair| match pair[0].medium {
        Medium::Air => '|',
        _ if pair[0].curvature > pair[1].curvature => '+',
        _ => '-',
    });
    pieces.collect()
}

/// All curvatures and gaps as variables.
fn variables(lens: &Lens) -> Vec<Variable> {
    let shape = [Quantity::Curvature, Quantity::Thickness];
    let all = (0..lens.surfaces.len()).flat_map(|row| shape.map(|q| Parameter::new(row, q)));
    let is_shape = |p: &Parameter| {
        p.quantity == Quantity::Thickness || lens.surfaces[p.surface].comment != "diaphragm"
    };
    let all = all.filter(is_shape);
    all.map(|parameter| Variable { parameter, min: None, max: None }).collect()
}

impl Candidate {
    /// The number of elements, an aspheric surface counted as half of one.
    pub(super) fn price(&self) -> f64 {
        let rows = self.draft.lens.surfaces.iter();
        let aspheric = rows.filter(|row| is_aspheric(row)).count();
        piece_count(&self.draft.lens) as f64 + 0.5 * aspheric as f64
    }

    /// True if every glass is permitted.
    pub(super) fn is_buildable(&self, asked: &LensRequirements) -> bool {
        in_catalogue(&self.draft.lens, asked)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::lens::{Row, blank};
    use crate::search::design::LensSpecification;

    fn with_pool(stage: DesignStage) -> DesignRun {
        let spec: LensSpecification = serde_json::from_str(
            r#"{"focal_length_mm": 60.0, "f_number": 6.0, "half_field_deg": 2.0, "max_elements": 3}"#,
        )
        .unwrap();
        let asked = LensRequirements::complete(&spec).unwrap().0;
        let candidate = |start: NamedDraft| Candidate {
            origin: start.name,
            draft: start.draft,
            value: f64::INFINITY,
        };
        let mut run = DesignRun::new(&asked, &DesignSettings::with_seed(3));
        run.pool = achromats(&asked).into_iter().take(1).map(candidate).collect();
        run.stage = stage;
        run
    }

    #[test]
    fn mutants_compete_until_half_of_the_budget_is_used_and_glasses_follow() {
        let stop = AtomicBool::new(false);
        let mut run = with_pool(DesignStage::Mutations);
        let (rules, asked) = (run.rules(), run.requirements());
        assert!(rules.track >= Some(asked.track) && rules.back_focus <= Some(asked.back_focus));
        assert!(run.advance(0.2, &stop) && run.stage() == DesignStage::Mutations);
        let names = MutationKind::MUTATIONS.map(MutationKind::name);
        let is_mutant = |c: &Candidate| names.iter().any(|name| c.origin.ends_with(name));
        assert!(run.pool.iter().any(is_mutant), "{:?}", run.pool);
        assert!(run.pool.is_sorted_by_key(|c| c.value) && run.best().is_finite());
        assert!(run.pool.iter().all(|c| piece_count(&c.draft.lens) <= 3));
        assert!(run.advance(0.5, &stop) && run.stage() == DesignStage::Glasses);
        assert!(run.pool.iter().all(|c| in_catalogue(&c.draft.lens, &run.asked)));
        assert!(!run.advance(0.95, &stop));
    }

    /// Of the descendants of one lens few stay, so that there is room for other structures.
    #[test]
    fn few_candidates_of_one_structure_stay() {
        let mut run = with_pool(DesignStage::Mutations);
        let parent = run.pool[0].clone();
        let valued = |value: f64| Candidate { value, ..parent.clone() };
        run.pool = (1..=5).map(|value| valued(f64::from(value))).collect();
        // A doublet with the signs of its powers exchanged.
        let mut other = valued(6.0);
        other.draft.lens.surfaces.iter_mut().for_each(|row| row.curvature *= -1.0);
        assert_ne!(structure(&other.draft.lens), structure(&parent.draft.lens));
        run.pool.push(other);
        run.keep_structures_apart();
        let values: Vec<f64> = run.pool.iter().map(|candidate| candidate.value).collect();
        assert_eq!(values, [1.0, 2.0, 6.0]);
    }

    #[test]
    fn a_structure_tells_glass_from_air_and_the_signs_of_powers() {
        let surfaces = |rows: &[(f64, bool)]| {
            let row = |(curvature, is_glass): &(f64, bool)| Row {
                curvature: *curvature,
                medium: if *is_glass { Medium::Model { nd: 1.5, vd: 60.0 } } else { Medium::Air },
                ..Row::default()
            };
            Lens { surfaces: rows.iter().map(row).collect(), ..blank() }
        };
        let rows = [(0.02, true), (-0.01, true), (0.01, false), (-0.03, true), (0.0, false)];
        assert_eq!(structure(&surfaces(&rows)), "+-|-");
    }

    /// A piece costs 1, an aspheric surface half of that.
    #[test]
    fn a_candidate_costs_its_pieces_and_its_aspheres() {
        let run = with_pool(DesignStage::Mutations);
        let mut candidate = run.pool[0].clone();
        let pieces = piece_count(&candidate.draft.lens) as f64;
        assert!(pieces >= 2.0 && candidate.price() == pieces);
        candidate.draft.lens.surfaces[0].conic = -0.7;
        candidate.draft.lens.surfaces[1].asphere = vec![1e-6];
        assert_eq!(candidate.price(), pieces + 1.0);
    }
}
