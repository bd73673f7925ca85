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

pub use figures::{FieldFigures, Figures};
pub use finish::{Confirmed, Exchanged, Finished, Unlisted, finish};
pub use goal::goal;
pub use limits::missed;
pub use local::Local;
pub use open::opened;
pub use plan::{NoSearch, Plan, run};

use super::{
    BadRule, Kind, Landscape, Mutated, Random, Refusal, Rules, Slope, Weights, element, mutation,
};
use crate::lens::{Lens, LensError};
use crate::merit::{Goal, Merit, MeritError};
use crate::optimize::{Memory, Stretch, Stretched, stretch};
use crate::pupil::{BenchError, limited_by_stop};
use free::Freedom;

/// Why a lens cannot be searched from.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum NoLandscape {
    /// The prescription.
    #[error(transparent)]
    Lens(#[from] LensError),
    /// The beam.
    #[error(transparent)]
    Bench(#[from] BenchError),
    /// Its merit.
    #[error(transparent)]
    Merit(#[from] MeritError),
    /// A rule without meaning.
    #[error(transparent)]
    Rule(#[from] BadRule),
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
    rules: Rules,
    local: Local,
    freedom: Freedom,
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
        rules: &Rules,
        local: &Local,
    ) -> Result<Self, NoLandscape> {
        local.check()?;
        let rules = rules.checked()?;
        rules.check_kept(lens.surfaces.len())?;
        limits::check_glasses(lens, &rules)?;
        let mut start = limited_by_stop(lens)?;
        free::hold_the_rest(&mut start);
        start.check()?;
        let size = goal::size(&start);
        let asked = goal.terms.iter().find_map(|w| match w.term {
            crate::merit::Term::FocalLength(focal) => Some(focal),
            _ => None,
        });
        let freedom = Freedom { size, rims: local.rims, indices: local.indices };
        let merit = Merit::new(&free::freed(&start, &rules, freedom), goal, local.tolerance)?;
        if merit.variables().is_empty() {
            return Err(MeritError::NoVariables.into());
        }
        Ok(Self {
            light: merit.light_at_start().to_vec(),
            start,
            goal: goal.clone(),
            rules,
            local: local.clone(),
            freedom,
            focal_length: asked.unwrap_or(size),
        })
    }

    /// The same landscape, in which what every field had at the start counts as so many times as
    /// much; no shares leave it as it is.
    ///
    /// # Errors
    /// Not as many shares as fields, or one that is not positive.
    pub fn asking_each(mut self, shares: &[f64]) -> Result<Self, NoLandscape> {
        if shares.is_empty() {
            return Ok(self);
        }
        let fields = (0..self.start.zoom_positions()).map(|z| self.start.fields_at(z).values.len());
        let fits = fields.into_iter().all(|count| count == shares.len());
        if !fits || shares.iter().any(|share| !(*share > 0.0 && share.is_finite())) {
            let found = format!("{shares:?}");
            let expected = "a share above 0 for each field";
            return Err(NoLandscape::Setting { what: "the light", found, expected });
        }
        let sampled = self.merit(&self.start, self.local.tolerance)?.sampled();
        for (light, pupil) in self.light.iter_mut().flatten().zip(sampled) {
            *light *= shares[pupil.field];
        }
        Ok(self)
    }

    /// The same landscape with other areas of the pupils to compare with, in mm², by zoom position.
    ///
    /// # Errors
    /// Not as many areas as pupils, or one that is not positive.
    pub fn comparing_with(self, light: Vec<Vec<f64>>) -> Result<Self, NoLandscape> {
        let same = |(own, other): (&Vec<f64>, &Vec<f64>)| own.len() == other.len();
        let fits = self.light.len() == light.len() && self.light.iter().zip(&light).all(same);
        if !fits || light.iter().flatten().any(|area| !(*area > 0.0 && area.is_finite())) {
            let found = format!("{light:?}");
            let expected = "an area above 0 for each field";
            return Err(NoLandscape::Setting {
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
    pub fn rules(&self) -> &Rules {
        &self.rules
    }

    /// The lens with every number flagged that may change.
    pub fn freed(&self, lens: &Lens) -> Lens {
        free::freed(&free::within_bounds(lens), &self.rules, self.freedom)
    }

    /// The merit of a lens of any structure, spots good to a tolerance, light compared with that of
    /// the start.
    ///
    /// # Errors
    /// A lens without merit.
    pub fn merit(&self, lens: &Lens, tolerance: f64) -> Result<Merit, MeritError> {
        let merit = Merit::new(&self.freed(lens), &self.goal, tolerance)?;
        Ok(merit.compared_with(&self.light))
    }

    /// Rays of one gradient at a lens; none where it has no merit.
    pub fn rays(&self, lens: &Lens) -> usize {
        let merit = self.merit(lens, self.local.tolerance);
        merit.map_or(0, |merit| merit.sampled().iter().map(|spot| spot.rays).sum())
    }

    /// What losses are compared with: that of the start without the penalties of what no factory
    /// can make, which a search repairs first of all.
    pub fn scale(&self) -> f64 {
        let worth = || {
            let merit = self.merit(&self.start, self.local.tolerance).ok()?;
            let terms = merit.terms(&merit.values(&self.freed(&self.start))).ok()?;
            let optical = |name: &str| ["spot", "spot_integral", "light"].contains(&name);
            let sum: f64 =
                terms.iter().filter(|t| optical(t.term)).map(|t| t.weight * t.value).sum();
            (sum > 0.0).then_some(sum)
        };
        worth().unwrap_or_else(|| self.loss(&self.start))
    }

    /// What a lens is worth, by its own pupils.
    fn judge(&self, lens: &Lens) -> Result<f64, MeritError> {
        let merit = self.merit(lens, self.local.tolerance)?;
        merit.value(&merit.values(lens))
    }

    /// A local move of no more than so many steps: where it leads, and what that is worth.
    fn moved(
        &self,
        lens: &Lens,
        memory: &mut Memory,
        most: usize,
    ) -> Result<(Lens, f64, usize), MeritError> {
        let Local { method, steps, rate, tolerance, coarse, .. } = self.local;
        let is_coarse = memory.steps < self.local.coarse_steps;
        let merit = self.merit(lens, if is_coarse { coarse } else { tolerance })?;
        let asked = Stretch { method, steps: steps.min(most), rate };
        let Stretched { lens: mut there, before, gradients } =
            stretch(merit, &self.freed(lens), asked, memory)?;
        there.variables.clone_from(&lens.variables);
        match self.judge(&there) {
            Ok(after) if after < before || is_coarse => {
                memory.encourage();
                Ok((there, after, gradients))
            }
            Ok(after) if after < (1.0 + SLACK) * before => {
                memory.slow_down();
                Ok((there, after, gradients))
            }
            Ok(_) | Err(_) => {
                memory.discourage();
                let before = if is_coarse { self.judge(lens)? } else { before };
                Ok((lens.clone(), before, gradients))
            }
        }
    }
}

/// A move may lead to something worse by this part, since the rays of two lenses differ.
const SLACK: f64 = 0.05;

/// How often a lens is drawn before it is given up.
const DRAWS: usize = 200;

impl Landscape for LensLandscape {
    type Point = Lens;
    type Memory = Memory;

    fn loss(&self, lens: &Lens) -> f64 {
        self.judge(lens).unwrap_or(f64::INFINITY)
    }

    fn descend(&self, lens: &Lens, memory: &mut Memory) -> (Lens, f64, usize) {
        self.descend_within(lens, memory, usize::MAX)
    }

    fn descend_within(&self, lens: &Lens, memory: &mut Memory, most: usize) -> (Lens, f64, usize) {
        match self.moved(lens, memory, most) {
            Ok(moved) => moved,
            Err(_) => (lens.clone(), f64::INFINITY, 0),
        }
    }

    fn draw(&self, random: &mut Random) -> Result<Lens, Refusal> {
        let free = self.freed(&self.start);
        for _ in 0..DRAWS {
            let Some(mut lens) = draw::drawn(&free, &self.rules, self.focal_length, random) else {
                continue;
            };
            lens.variables.clone_from(&self.start.variables);
            let lens = free::within_bounds(&lens);
            if self.loss(&lens).is_finite() {
                return Ok(lens);
            }
        }
        let why = format!("none of {DRAWS} lenses that were drawn passes light");
        Err(Refusal { kind: Kind::Global, why })
    }

    fn mutate(
        &self,
        lens: &Lens,
        weights: &Weights,
        random: &mut Random,
    ) -> Result<Mutated<Lens>, Refusal> {
        let own = Kind::MUTATIONS.map(|kind| (kind, self.rules.weight(kind) * weights.of(kind)));
        let rules = Rules { weights: own.to_vec(), ..self.rules.clone() };
        mutation::propose(lens, &rules, random).map(Into::into)
    }

    fn topology(&self, lens: &Lens) -> String {
        element::topology(lens)
    }

    fn outside(&self, lens: &Lens) -> u64 {
        let [min, max] = self.rules.elements;
        let pieces = element::pieces(lens);
        (min.saturating_sub(pieces) + pieces.saturating_sub(max)) as u64
    }

    fn about(&self) -> serde_json::Value {
        serde_json::json!({
            "start": self.start,
            "goal": self.goal,
            "rules": self.rules,
            "local": self.local,
            "light": self.light,
        })
    }

    fn elements(&self, lens: &Lens) -> usize {
        element::elements(lens).len()
    }

    fn mutate_at(
        &self,
        lens: &Lens,
        element: usize,
        kind: Kind,
        random: &mut Random,
    ) -> Result<Mutated<Lens>, Refusal> {
        let rows = lens.surfaces.len();
        let Some(element) = element::elements(lens).get(element).copied() else {
            return Err(Refusal::new(kind, "there is no such element"));
        };
        // Only what lies between these surfaces may change, and it must be allowed anyway.
        let (first, last) = match kind {
            Kind::AddSinglet => (element.last, element.last + 1),
            _ => (element.first.saturating_sub(1), element.last + 1),
        };
        let mut rules = self.rules.clone().touching(first, last.min(rows - 1), rows);
        rules.kept = [0, 1].map(|end| rules.kept[end].max(self.rules.kept[end]));
        mutation::mutate(kind, lens, &rules, random).map(Into::into)
    }

    fn slope(&self, lens: &Lens) -> Option<Slope> {
        walk::slope(self, lens)
    }

    fn with_values(&self, lens: &Lens, values: &[f64]) -> Option<Lens> {
        walk::with_values(self, lens, values)
    }
}
