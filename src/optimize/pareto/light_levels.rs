//! The ε-constraint method (Haimes, Lasdon, Wismer, IEEE Trans. SMC 1 (1971) 296): for each of a
//! sequence of levels of light, the sharpest lens that has at least that much.
//!
//! Unlike a weighted sum it reaches every part of a front, convex or not, and the levels tell
//! beforehand which light the front spans. Each level is a descent in the trust region under limits
//! from the lens of the level before. Every trial that is accepted on the way is a candidate for
//! the front: those that the merit function tells to be worse than others are not evaluated.

use super::{
    EVALUATION_TOLERANCE, FIRST, MIN_LIGHT, ParetoPoint, ParetoSettings, STEPS_PER_SLICE,
    SweepChain, as_built_term,
};
use crate::lens::Lens;
use crate::merit::{
    Goal, LimitTreatment, MAX_STEEPNESS, Merit, MeritError, PupilEdge, Term, WeightedTerm,
};
use crate::optimize::Optimizer as _;
use crate::optimize::limited::LimitedOptimizer;

/// The violation of a limit, in its unit, up to which a trial may join the front.
const KEPT: f64 = 1e-6;
/// The share of the light that is asked for by which a level may be missed.
const REACHED: f64 = 1e-6;
/// The smallest gain of light, relative to the light, for which levels are spread anew.
const WORTHWHILE: f64 = 1e-3;

/// A walk through levels of light.
#[derive(Debug)]
pub(super) struct LightWalk {
    /// The lens of the latest level.
    lens: Lens,
    /// Its light, in multiples of that at the start.
    share: f64,
    settings: WalkSettings,
    /// The areas of the pupils at the start, by zoom position.
    areas_at_start: Vec<Vec<f64>>,
    /// The levels to come, the next one last.
    levels: Vec<Level>,
    active: Option<ActiveLevel>,
    /// Lenses that were accepted since the last evaluation.
    candidates: Vec<AcceptedTrial>,
    /// The radius and the light of the lenses that were evaluated and that no other one dominates.
    known: Vec<[f64; 2]>,
    /// True once the levels above the reachable light were spread anew.
    is_spread: bool,
    refused: Option<String>,
}

/// The numbers that stay the same on a walk.
#[derive(Debug, Clone)]
struct WalkSettings {
    /// The goal without the light that is asked for.
    goal: Goal,
    /// Its term for lenses as built, if there is one.
    made: Option<Term>,
    /// The mean area of the pupils at the start, in mm².
    light: f64,
    /// The steps of a level.
    steps: usize,
    /// The relative tolerance of the spot radii.
    tolerance: f64,
}

/// Light that is asked for.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Level {
    /// In multiples of the light at the start.
    share: f64,
    /// The steps that it may take.
    steps: usize,
}

/// The descent of one level.
#[derive(Debug)]
struct ActiveLevel {
    share: f64,
    search: Box<LimitedOptimizer>,
    remaining_steps: usize,
}

/// A lens with its spot and light as the merit function has them.
#[derive(Debug)]
struct AcceptedTrial {
    numbers: [f64; 2],
    lens: Lens,
    share: f64,
}

/// The direction in which a walk leaves the light of the start.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum FirstTurn {
    /// To the brightest lens, and from there to the darkest one.
    Brighter,
    /// To the darkest lens, and from there to the brightest one.
    Darker,
}

impl LightWalk {
    /// The walks of a sweep from a lens with this mean area of its pupils in mm². A walk up to the
    /// brightest lens ends in other lenses than one down from it.
    pub(super) fn all(
        lens: &Lens,
        light: f64,
        settings: &ParetoSettings,
    ) -> Result<Vec<Self>, MeritError> {
        let ParetoSettings { steps, tolerance, .. } = *settings;
        let made = as_built_term(lens, settings);
        let goal = spot_goal(lens, made)?;
        let walk = WalkSettings { goal, made, light, steps, tolerance };
        let shares = settings.light_shares();
        let turns = [FirstTurn::Brighter, FirstTurn::Darker].into_iter();
        turns.map(|turn| Self::new(lens, &walk, &shares, turn)).collect()
    }

    /// A walk from a lens, which is corrected first, through levels in multiples of its light.
    fn new(
        lens: &Lens,
        settings: &WalkSettings,
        shares: &[f64],
        turn: FirstTurn,
    ) -> Result<Self, MeritError> {
        let goal = with_light(&settings.goal, 1.0);
        let merit = Merit::new(lens, &goal, settings.tolerance)?;
        Ok(Self {
            lens: lens.clone(),
            share: 1.0,
            areas_at_start: merit.initial_light().to_vec(),
            levels: levels(shares, turn, settings.steps),
            settings: settings.clone(),
            active: None,
            candidates: Vec::new(),
            known: Vec::new(),
            is_spread: false,
            refused: None,
        })
    }

    /// Starts the next level that can be started; false if none is left.
    fn start_next(&mut self) -> bool {
        while let Some(Level { share, steps }) = self.levels.pop() {
            match self.descent(share) {
                Ok(search) => {
                    let search = Box::new(search);
                    self.active = Some(ActiveLevel { share, search, remaining_steps: steps });
                    return true;
                }
                Err(cause) => self.refused = Some(cause.to_string()),
            }
        }
        false
    }

    fn descent(&self, share: f64) -> Result<LimitedOptimizer, MeritError> {
        let WalkSettings { goal, tolerance, .. } = &self.settings;
        let merit = Merit::new(&self.lens, &with_light(goal, share), *tolerance)?;
        LimitedOptimizer::new(
            merit.with_initial_light(&self.areas_at_start),
            &self.lens,
            *tolerance,
        )
    }

    /// Takes a step of the active level, and ends the level with its last one.
    fn step(&mut self) {
        let Some(active) = &mut self.active else { return };
        let progress = active.search.step();
        active.remaining_steps -= 1;
        let is_last = progress.finished || active.remaining_steps == 0;
        if progress.accepted > 0.0 || is_last {
            if is_last {
                active.search.verify_best();
            }
            self.candidates.extend(active.candidate(self.settings.light));
        }
        if is_last {
            self.end_level();
        }
    }

    /// Goes on from the lens of the level if it has its light, and otherwise leaves out what cannot
    /// be reached.
    fn end_level(&mut self) {
        let Some(ActiveLevel { share, search, .. }) = self.active.take() else { return };
        let found = search.light_share().filter(|_| search.is_kept_but_for_light(KEPT));
        let reached = found.filter(|found| *found >= share * (1.0 - REACHED));
        if let Some(found) = reached {
            self.lens.clone_from(search.best());
            self.share = found;
            return;
        }
        let light = share * self.settings.light;
        let cause = match search.conflict() {
            [] => "the steps did not suffice".to_owned(),
            limits => limits.join("; "),
        };
        self.refused = Some(format!("no lens near with {light:.4} mm^2 of light: {cause}"));
        self.leave_out(share, found.unwrap_or(self.share));
    }

    /// Removes levels of at least some light from those to come. The first time those that were
    /// next are spread over what was reached beyond the latest level.
    fn leave_out(&mut self, share: f64, reached: f64) {
        let mut highest = share;
        let rises = |level: &&Level| level.share > std::mem::replace(&mut highest, level.share);
        let next = self.levels.iter().rev().take_while(rises).count();
        let most = reached.max(self.share);
        self.levels.retain(|level| level.share <= most);
        let gain = reached - self.share;
        if self.is_spread || gain <= WORTHWHILE * self.share {
            return;
        }
        self.is_spread = true;
        let steps = self.settings.steps;
        let part = |k: usize| self.share + gain * k as f64 / (next + 2) as f64;
        let spread: Vec<Level> =
            (1..=next + 1).rev().map(|k| Level { share: part(k), steps }).collect();
        self.levels.extend(spread);
    }

    /// Evaluates the candidates that no other lens of the walk dominates.
    fn evaluate_candidates(&mut self) -> Vec<ParetoPoint> {
        let mut found = Vec::new();
        // The latest ones are those that most others lead to.
        for candidate in std::mem::take(&mut self.candidates).into_iter().rev() {
            if self.is_dominated(candidate.numbers) {
                continue;
            }
            let asked = Some(candidate.share * self.settings.light);
            let point = ParetoPoint::evaluate(&candidate.lens, None, EVALUATION_TOLERANCE);
            let made = self.settings.made;
            let point = point.and_then(|point| point.with_as_built(made, EVALUATION_TOLERANCE));
            // A spot without the fields that are dark would seem sharp.
            if let Ok(point) = point
                && point.has_light
            {
                self.learn([point.radius(), point.light]);
                self.learn(candidate.numbers);
                found.push(ParetoPoint { min_light: asked, ..point });
            }
        }
        found
    }

    fn is_dominated(&self, [spot, light]: [f64; 2]) -> bool {
        self.known.iter().any(|known| known[0] <= spot && known[1] >= light)
    }

    fn learn(&mut self, numbers: [f64; 2]) {
        if !self.is_dominated(numbers) {
            let [spot, light] = numbers;
            self.known.retain(|known| known[0] < spot || known[1] > light);
            self.known.push(numbers);
        }
    }
}

impl SweepChain for LightWalk {
    fn run_slice(&mut self) -> Vec<ParetoPoint> {
        for _ in 0..STEPS_PER_SLICE {
            if self.active.is_none() && !self.start_next() {
                break;
            }
            self.step();
        }
        self.evaluate_candidates()
    }

    fn remaining_steps(&self) -> usize {
        let coming: usize = self.levels.iter().map(|level| level.steps).sum();
        coming + self.active.as_ref().map_or(0, |active| active.remaining_steps)
    }

    fn take_refusal(&mut self) -> Option<String> {
        self.refused.take()
    }
}

impl ActiveLevel {
    /// The current lens if it keeps the limits but for the light that is asked for.
    fn candidate(&self, light_at_start: f64) -> Option<AcceptedTrial> {
        let search = &self.search;
        let light = light_at_start * search.light_share()?;
        let is_kept = search.is_kept_but_for_light(KEPT);
        is_kept.then(|| AcceptedTrial {
            numbers: [search.objective().max(0.0).sqrt(), light],
            lens: search.current().clone(),
            share: self.share,
        })
    }
}

/// The levels of a walk, the next one last: a correction at the light of the start, those on one
/// side of it, then all.
fn levels(shares: &[f64], turn: FirstTurn, steps: usize) -> Vec<Level> {
    let level = |share: &f64| Level { share: *share, steps };
    let (rising, falling) = (shares.iter().map(level), shares.iter().rev().map(level));
    let mut walk = vec![Level { share: 1.0, steps: FIRST * steps }];
    match turn {
        FirstTurn::Brighter => {
            walk.extend(rising.filter(|level| level.share > 1.0));
            walk.extend(falling);
        }
        FirstTurn::Darker => {
            walk.extend(falling.filter(|level| level.share < 1.0));
            walk.extend(rising);
        }
    }
    walk.reverse();
    walk
}

/// The goal of a walk without the light that is asked for: sharp spots, as built if `made` is a term for
/// that, under the limits of the
/// default goal, limited steepness, and a minimum of light at every field.
///
/// # Errors
/// A lens without first-order data.
fn spot_goal(lens: &Lens, made: Option<Term>) -> Result<Goal, MeritError> {
    let default_goal = Goal::default_for(lens)?;
    let mut terms = default_goal.terms;
    for weighted in terms.iter_mut().filter(|weighted| weighted.term == Term::Spot) {
        weighted.term = made.unwrap_or(Term::Spot);
    }
    terms.retain(|w| !matches!(w.term, Term::Light(_)));
    terms.push(WeightedTerm::new(Term::Steepness(MAX_STEEPNESS), 1.0));
    terms.push(WeightedTerm::new(Term::Light(MIN_LIGHT), super::goal_size(lens).powi(2)));
    terms.push(WeightedTerm::new(Term::MeanLight(1.0), super::goal_size(lens).powi(2)));
    let limits = LimitTreatment::Constraints;
    Ok(Goal { terms, pupil: PupilEdge::Moving, limits, zoom_ratios: default_goal.zoom_ratios })
}

/// The same goal that asks for this much light, in multiples of that at the start.
fn with_light(goal: &Goal, share: f64) -> Goal {
    let mut goal = goal.clone();
    for weighted in &mut goal.terms {
        if let Term::MeanLight(least) = &mut weighted.term {
            *least = share;
        }
    }
    goal
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::optimize::pareto::with_sweep_variables;
    use crate::pupil::limited_by_stop;

    fn walk(shares: &[f64], turn: FirstTurn) -> LightWalk {
        let found = crate::files::bundled_lenses();
        let found = found.iter().find(|b| b.name == "tessar_50_f28").unwrap();
        let lens = crate::files::json::read(found.text, found.name).unwrap();
        let lens = with_sweep_variables(&limited_by_stop(&lens).unwrap(), [0.5, 1.5]);
        let goal = spot_goal(&lens, None).unwrap();
        let settings = WalkSettings { goal, made: None, light: 200.0, steps: 10, tolerance: 1e-2 };
        LightWalk::new(&lens, &settings, shares, turn).unwrap()
    }

    fn coming(walk: &LightWalk) -> Vec<f64> {
        walk.levels.iter().rev().map(|level| level.share).collect()
    }

    #[test]
    fn a_walk_goes_to_one_end_first_and_then_through_all_levels() {
        let shares = [0.5, 0.8, 1.25, 2.0];
        let brighter = walk(&shares, FirstTurn::Brighter);
        assert_eq!(coming(&brighter), [1.0, 1.25, 2.0, 2.0, 1.25, 0.8, 0.5]);
        let darker = walk(&shares, FirstTurn::Darker);
        assert_eq!(coming(&darker), [1.0, 0.8, 0.5, 0.5, 0.8, 1.25, 2.0]);
        assert_eq!(darker.remaining_steps(), (FIRST + 6) * 10);
    }

    /// Levels above the reachable light are replaced, once, by as many below it.
    #[test]
    fn light_that_cannot_be_reached_is_replaced_by_light_that_can() {
        let mut walk = walk(&[0.5, 1.5, 2.0, 3.0], FirstTurn::Brighter);
        walk.levels.truncate(walk.levels.len() - 2);
        assert_eq!(coming(&walk), [2.0, 3.0, 3.0, 2.0, 1.5, 0.5]);
        walk.share = 1.0;
        walk.levels.pop();
        walk.leave_out(2.0, 1.8);
        let [found, expected] = [coming(&walk), vec![1.0 + 0.8 / 3.0, 1.0 + 1.6 / 3.0, 1.5, 0.5]];
        assert_eq!(found.len(), expected.len());
        let near = |(a, b): (&f64, &f64)| (a - b).abs() < 1e-12;
        assert!(found.iter().zip(&expected).all(near), "{found:?}");
        (walk.share, walk.levels) = (1.4, walk.levels[..2].to_vec());
        walk.leave_out(1.6, 1.55);
        assert_eq!(coming(&walk), [1.5, 0.5]);
    }

    #[test]
    fn lenses_that_others_dominate_are_not_evaluated() {
        let mut walk = walk(&[1.0], FirstTurn::Darker);
        walk.learn([2.0, 5.0]);
        assert!(walk.is_dominated([2.0, 5.0]) && walk.is_dominated([3.0, 4.0]));
        assert!(!walk.is_dominated([1.9, 1.0]) && !walk.is_dominated([9.0, 5.1]));
        walk.learn([1.0, 6.0]);
        assert_eq!(walk.known, [[1.0, 6.0]]);
    }
}
