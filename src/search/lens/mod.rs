//! Lenses as a landscape: what a lens is worth (4.6), how it descends, how it is drawn.
//!
//! The objective is a [`Goal`] of [`merit`](crate::merit): sharpness, light at every field compared
//! with the lens at the start, focal length, and the limits of a factory as penalties. A local move
//! looks for the pupils of the lens anew and takes some steps with derivatives that know that the
//! pupils move. It is judged by the pupils where it ends; one that has led to something worse is
//! taken back.

mod draw;
mod figures;
mod finish;
mod free;
mod goal;
mod limits;
mod local;
mod open;
mod plan;
mod walk;

pub use figures::{FieldSummary, LensSummary};
pub use finish::{CrossCheck, FinalizedLens, GlassSubstitution, UnlistedGlass, finalize};
pub use goal::goal;
pub use limits::describe_violation;
pub use local::DescentSettings;
pub use open::with_open_apertures;
pub use plan::{SearchPlan, SearchSetupError, run};

use super::{
    Landscape, LossGradient, MutatedPoint, MutationError, MutationKind, MutationWeights, Random,
    RuleError, SearchRules, element, mutation,
};
use crate::lens::{Lens, LensError};
use crate::merit::{Goal, Merit, MeritError};
use crate::optimize::{DescentState, SegmentResult, SegmentSettings, run_segment};
use crate::pupil::{RayModelError, limited_by_stop};
use free::VariableRules;

/// Why a lens cannot be searched from.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum LandscapeError {
    /// The prescription.
    #[error(transparent)]
    Lens(#[from] LensError),
    /// The beam.
    #[error(transparent)]
    Bench(#[from] RayModelError),
    /// Its merit.
    #[error(transparent)]
    Merit(#[from] MeritError),
    /// A rule without meaning.
    #[error(transparent)]
    Rule(#[from] RuleError),
    /// Limits that no lens keeps.
    #[error("no lens keeps these limits: {0}")]
    Impossible(String),
    /// A setting without meaning.
    #[error("{what} is {found}; expected {expected}")]
    Setting {
        /// Which one.
        what: &'static str,
        /// Its value.
        found: String,
        /// What it should be.
        expected: &'static str,
    },
}

/// Lenses, each worth what a goal says.
#[derive(Debug, Clone)]
pub struct LensLandscape {
    start: Lens,
    goal: Goal,
    rules: SearchRules,
    local: DescentSettings,
    variable_rules: VariableRules,
    /// The areas of the pupils of the start, by zoom position.
    light: Vec<Vec<f64>>,
    /// The focal length that is asked for, or that of the start, in mm.
    focal_length: f64,
}

impl LensLandscape {
    /// Lenses like this one. It is limited by its stop from now on: an aperture that is a pupil or a
    /// cone becomes the semi-diameter of the stop. Of the numbers that a person has flagged as
    /// variables, the bounds hold; where curvatures or gaps are among them, those that are not
    /// flagged are held.
    ///
    /// # Errors
    /// A lens without merit, or settings without meaning.
    pub fn new(
        lens: &Lens,
        goal: &Goal,
        rules: &SearchRules,
        local: &DescentSettings,
    ) -> Result<Self, LandscapeError> {
        local.check()?;
        let rules = rules.normalize()?;
        rules.check_fixed_ends(lens.surfaces.len())?;
        limits::check_glasses(lens, &rules)?;
        let mut start = limited_by_stop(lens)?;
        free::freeze_others(&mut start);
        start.check()?;
        let size = goal::reference_length(&start);
        let asked = goal.terms.iter().find_map(|w| match w.term {
            crate::merit::Term::FocalLength(focal) => Some(focal),
            _ => None,
        });
        let freedom = VariableRules { size, rims: local.rims, indices: local.indices };
        let merit =
            Merit::new(&free::with_variables(&start, &rules, freedom), goal, local.tolerance)?;
        if merit.variables().is_empty() {
            return Err(MeritError::NoVariables.into());
        }
        Ok(Self {
            light: merit.initial_light().to_vec(),
            start,
            goal: goal.clone(),
            rules,
            local: local.clone(),
            variable_rules: freedom,
            focal_length: asked.unwrap_or(size),
        })
    }

    /// The same landscape, in which what every field had at the start counts as so many times as
    /// much; no shares leave it as it is.
    ///
    /// # Errors
    /// Not as many shares as fields, or one that is not positive.
    pub fn with_field_light(mut self, shares: &[f64]) -> Result<Self, LandscapeError> {
        if shares.is_empty() {
            return Ok(self);
        }
        let fields = (0..self.start.zoom_positions()).map(|z| self.start.fields_at(z).values.len());
        let fits = fields.into_iter().all(|count| count == shares.len());
        if !fits || shares.iter().any(|share| !(*share > 0.0 && share.is_finite())) {
            let found = format!("{shares:?}");
            let expected = "a share above 0 for each field";
            return Err(LandscapeError::Setting { what: "the light", found, expected });
        }
        let sampled = self.merit(&self.start, self.local.tolerance)?.spot_samplings();
        for (light, pupil) in self.light.iter_mut().flatten().zip(sampled) {
            *light *= shares[pupil.field];
        }
        Ok(self)
    }

    /// The same landscape with other areas of the pupils to compare with, in mm², by zoom position.
    ///
    /// # Errors
    /// Not as many areas as pupils, or one that is not positive.
    pub fn with_reference_light(self, light: Vec<Vec<f64>>) -> Result<Self, LandscapeError> {
        let same = |(own, other): (&Vec<f64>, &Vec<f64>)| own.len() == other.len();
        let fits = self.light.len() == light.len() && self.light.iter().zip(&light).all(same);
        if !fits || light.iter().flatten().any(|area| !(*area > 0.0 && area.is_finite())) {
            let found = format!("{light:?}");
            let expected = "an area above 0 for each field";
            return Err(LandscapeError::Setting {
                what: "the light to compare with",
                found,
                expected,
            });
        }
        Ok(Self { light, ..self })
    }

    /// The lens at the start: limited by its stop, held numbers marked by bounds that coincide.
    pub fn start(&self) -> &Lens {
        &self.start
    }

    /// What is asked for.
    pub fn goal(&self) -> &Goal {
        &self.goal
    }

    /// What may be done.
    pub fn rules(&self) -> &SearchRules {
        &self.rules
    }

    /// The lens with every number flagged that may change.
    pub fn with_variables(&self, lens: &Lens) -> Lens {
        free::with_variables(&free::clamp_to_bounds(lens), &self.rules, self.variable_rules)
    }

    /// The merit of a lens of any structure, spots good to a tolerance, light compared with that of
    /// the start.
    ///
    /// # Errors
    /// A lens without merit.
    pub fn merit(&self, lens: &Lens, tolerance: f64) -> Result<Merit, MeritError> {
        let merit = Merit::new(&self.with_variables(lens), &self.goal, tolerance)?;
        Ok(merit.with_initial_light(&self.light))
    }

    /// Rays of one gradient at a lens; none where it has no merit.
    pub fn rays_per_gradient(&self, lens: &Lens) -> usize {
        let merit = self.merit(lens, self.local.tolerance);
        merit.map_or(0, |merit| merit.spot_samplings().iter().map(|spot| spot.rays).sum())
    }

    /// What losses are compared with: that of the start without the penalties of what no factory
    /// can make, which a search repairs first of all.
    pub fn loss_scale(&self) -> f64 {
        let worth = || {
            let merit = self.merit(&self.start, self.local.tolerance).ok()?;
            let terms = merit.terms(&merit.values(&self.with_variables(&self.start))).ok()?;
            let optical = |name: &str| ["spot", "spot_integral", "light"].contains(&name);
            let sum: f64 =
                terms.iter().filter(|t| optical(t.term)).map(|t| t.weight * t.value).sum();
            (sum > 0.0).then_some(sum)
        };
        worth().unwrap_or_else(|| self.loss(&self.start))
    }

    /// What a lens is worth, by its own pupils.
    fn evaluate(&self, lens: &Lens) -> Result<f64, MeritError> {
        let merit = self.merit(lens, self.local.tolerance)?;
        merit.value(&merit.values(lens))
    }

    /// A local move of no more than so many steps: where it leads, and what that is worth.
    fn try_move(
        &self,
        lens: &Lens,
        memory: &mut DescentState,
        most: usize,
    ) -> Result<(Lens, f64, usize), MeritError> {
        let DescentSettings { method, steps, rate, tolerance, coarse, .. } = self.local;
        let is_coarse = memory.steps < self.local.coarse_steps;
        let merit = self.merit(lens, if is_coarse { coarse } else { tolerance })?;
        let asked = SegmentSettings { method, steps: steps.min(most), rate };
        let SegmentResult { lens: mut there, initial_merit: before, gradients } =
            run_segment(merit, &self.with_variables(lens), asked, memory)?;
        there.variables.clone_from(&lens.variables);
        match self.evaluate(&there) {
            Ok(after) if after < before || is_coarse => {
                memory.grow_step();
                Ok((there, after, gradients))
            }
            Ok(after) if after < (1.0 + SLACK) * before => {
                memory.shrink_step();
                Ok((there, after, gradients))
            }
            Ok(_) | Err(_) => {
                memory.restart_slower();
                let before = if is_coarse { self.evaluate(lens)? } else { before };
                Ok((lens.clone(), before, gradients))
            }
        }
    }
}

/// A move may lead to something worse by this part, since the rays of two lenses differ.
const SLACK: f64 = 0.05;

/// How often a lens is drawn before it is given up.
const MAX_DRAWS: usize = 200;

impl Landscape for LensLandscape {
    type Point = Lens;
    type Memory = DescentState;

    fn loss(&self, lens: &Lens) -> f64 {
        self.evaluate(lens).unwrap_or(f64::INFINITY)
    }

    fn descend(&self, lens: &Lens, memory: &mut DescentState) -> (Lens, f64, usize) {
        self.descend_within(lens, memory, usize::MAX)
    }

    fn descend_within(
        &self,
        lens: &Lens,
        memory: &mut DescentState,
        most: usize,
    ) -> (Lens, f64, usize) {
        match self.try_move(lens, memory, most) {
            Ok(moved) => moved,
            Err(_) => (lens.clone(), f64::INFINITY, 0),
        }
    }

    fn draw(&self, random: &mut Random) -> Result<Lens, MutationError> {
        let free = self.with_variables(&self.start);
        for _ in 0..MAX_DRAWS {
            let Some(mut lens) = draw::random_lens(&free, &self.rules, self.focal_length, random)
            else {
                continue;
            };
            lens.variables.clone_from(&self.start.variables);
            let lens = free::clamp_to_bounds(&lens);
            if self.loss(&lens).is_finite() {
                return Ok(lens);
            }
        }
        let why = format!("none of {MAX_DRAWS} lenses that were drawn passes light");
        Err(MutationError { kind: MutationKind::Global, why })
    }

    fn mutate(
        &self,
        lens: &Lens,
        weights: &MutationWeights,
        random: &mut Random,
    ) -> Result<MutatedPoint<Lens>, MutationError> {
        let own =
            MutationKind::MUTATIONS.map(|kind| (kind, self.rules.weight(kind) * weights.of(kind)));
        let rules = SearchRules { weights: own.to_vec(), ..self.rules.clone() };
        mutation::propose(lens, &rules, random).map(Into::into)
    }

    fn topology(&self, lens: &Lens) -> String {
        element::topology(lens)
    }

    fn structure_violation(&self, lens: &Lens) -> u64 {
        let [min, max] = self.rules.elements;
        let pieces = element::piece_count(lens);
        (min.saturating_sub(pieces) + pieces.saturating_sub(max)) as u64
    }

    fn fingerprint(&self) -> serde_json::Value {
        serde_json::json!({
            "start": self.start,
            "goal": self.goal,
            "rules": self.rules,
            "local": self.local,
            "light": self.light,
        })
    }

    fn element_count(&self, lens: &Lens) -> usize {
        element::elements(lens).len()
    }

    fn mutate_at(
        &self,
        lens: &Lens,
        element: usize,
        kind: MutationKind,
        random: &mut Random,
    ) -> Result<MutatedPoint<Lens>, MutationError> {
        let rows = lens.surfaces.len();
        let Some(element) = element::elements(lens).get(element).copied() else {
            return Err(MutationError::new(kind, "there is no such element"));
        };
        // Only what lies between these surfaces may change, and it must be allowed anyway.
        let (first, last) = match kind {
            MutationKind::AddSinglet => (element.last, element.last + 1),
            _ => (element.first.saturating_sub(1), element.last + 1),
        };
        let mut rules = self.rules.clone().restricted_to(first, last.min(rows - 1), rows);
        rules.kept = [0, 1].map(|end| rules.kept[end].max(self.rules.kept[end]));
        mutation::mutate(kind, lens, &rules, random).map(Into::into)
    }

    fn loss_gradient(&self, lens: &Lens) -> Option<LossGradient> {
        walk::loss_gradient(self, lens)
    }

    fn with_values(&self, lens: &Lens, values: &[f64]) -> Option<Lens> {
        walk::with_values(self, lens, values)
    }
}
