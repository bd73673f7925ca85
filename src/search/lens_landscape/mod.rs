//! The search problem of lens design: the loss (4.6), descent and mutation of lenses.
//!
//! The objective is a [`Goal`] of [`merit`](crate::merit): sharpness, light at every field relative
//! to the start, focal length, and the limits of manufacturing as penalties. A local move finds the
//! pupils of the lens anew and takes some optimization steps with derivatives that include the
//! motion of the pupils. It is evaluated with the pupils of the new lens; a move that made the lens
//! worse is undone. Where moves by penalties gain little, the next ones keep the limits as constraints.

mod aspheres;
mod descent_settings;
mod displacement;
mod finalize;
mod langevin_units;
mod local_move;
mod minimum;
mod open_apertures;
mod plan;
mod random_start;
mod saddle;
mod settle;
mod summary;
mod variables;
mod violations;

pub use aspheres::AsphereGain;
pub use descent_settings::DescentSettings;
pub use finalize::{CrossCheck, FinalizedLens, GlassSubstitution, UnlistedGlass, finalize};
pub use local_move::gains_little;
pub use minimum::{MinimumPlace, SAME_MINIMUM, curvature_signs, has_same_glasses};
pub use open_apertures::with_open_apertures;
pub use plan::{SearchPlan, SearchSetupError, describe_left_out, run};
pub use saddle::SaddlePoint;
pub use summary::{FieldSummary, LensSummary};
pub use violations::describe_violation;

use super::{
    Landscape, LossGradient, MutatedPoint, MutationError, MutationKind, MutationWeights, Random,
    Refusal, RuleError, SearchRules, Settlement, element, mutation,
};
use crate::lens::{Lens, LensError, Parameter, Quantity};
use crate::merit::{Goal, Merit, MeritError};
use crate::optimize::DescentState;
use crate::pupil::{RayModelError, limited_by_stop};
use std::sync::Arc;
use variables::VariableRules;

/// The reasons that a lens cannot be the start of a search.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum LandscapeError {
    /// The prescription is invalid.
    #[error(transparent)]
    Lens(#[from] LensError),
    /// The ray model cannot be set up.
    #[error(transparent)]
    RayModel(#[from] RayModelError),
    /// The merit function cannot be evaluated.
    #[error(transparent)]
    Merit(#[from] MeritError),
    /// A rule is invalid.
    #[error(transparent)]
    Rule(#[from] RuleError),
    /// No light gets through the start.
    #[error("no light gets through; expected a lens that forms an image")]
    NoLight,
    /// Constraints that no lens can satisfy.
    #[error("no lens can satisfy these constraints: {0}")]
    Impossible(String),
    /// A setting is invalid.
    #[error("{what} is {found}; expected {expected}")]
    Setting {
        /// The setting.
        what: &'static str,
        /// Its value.
        found: String,
        /// The valid values.
        expected: &'static str,
    },
}

/// The landscape of lenses with a goal as the loss.
#[derive(Debug, Clone)]
pub struct LensLandscape {
    start: Arc<Lens>,
    goal: Goal,
    rules: SearchRules,
    local: DescentSettings,
    variable_rules: VariableRules,
    /// The reference areas of the pupils, by zoom position: those of the start unless set
    /// otherwise.
    light: Vec<Vec<f64>>,
    /// The target focal length, or that of the start, in mm.
    focal_length: f64,
}

/// The most surfaces of a lens whose structure is searched: a gradient of more takes minutes.
const MAX_SURFACES: usize = 200;

/// Refuses a lens with too many surfaces.
fn check_size(lens: &Lens) -> Result<(), LandscapeError> {
    let found = lens.surfaces.len();
    if found <= MAX_SURFACES {
        return Ok(());
    }
    let what = "the number of surfaces";
    Err(LandscapeError::Setting { what, found: found.to_string(), expected: "at most 200" })
}

/// Refuses a lens whose surfaces or media change with the zoom position: mutations know the gaps alone.
fn check_zoom_numbers(lens: &Lens) -> Result<(), LandscapeError> {
    let mut numbers = lens.zoom.iter().flat_map(|position| &position.numbers);
    let other = numbers.find(|own| own.quantity != Quantity::Thickness);
    other.map_or(Ok(()), |own| {
        Err(LandscapeError::Setting {
            what: "a number that differs between the zoom positions",
            found: format!("the {}", Parameter::new(own.surface, own.quantity)),
            expected: "thicknesses, aperture and fields alone",
        })
    })
}

impl LensLandscape {
    /// The landscape of lenses that start from this one. The start becomes limited by its stop: an
    /// aperture given as a pupil or cone is replaced by the semi-diameter of the stop. The bounds
    /// of variables hold; if curvatures or gaps are among the variables, all others stay fixed.
    ///
    /// # Errors
    /// The lens has no merit, or a setting is invalid.
    pub fn new(
        lens: &Lens,
        goal: &Goal,
        rules: &SearchRules,
        local: &DescentSettings,
    ) -> Result<Self, LandscapeError> {
        local.check()?;
        check_size(lens)?;
        check_zoom_numbers(lens)?;
        let rules = rules.normalize()?;
        rules.check_fixed_ends(lens.surfaces.len())?;
        violations::check_glasses(lens, &rules)?;
        violations::check_scopes(goal)?;
        let mut start = limited_by_stop(lens)?;
        variables::freeze_others(&mut start);
        start.check()?;
        let size = summary::reference_length(&start);
        let asked = goal.terms.iter().find_map(|w| match w.term {
            crate::merit::Term::FocalLength(focal) => Some(focal),
            _ => None,
        });
        let freedom =
            VariableRules { size, semi_diameters: local.semi_diameters, indices: local.indices };
        let merit =
            Merit::new(&variables::with_variables(&start, &rules, freedom), goal, local.tolerance)?;
        if merit.variables().is_empty() {
            return Err(MeritError::NoVariables.into());
        }
        Ok(Self {
            light: merit.initial_light().to_vec(),
            start: Arc::new(start),
            goal: goal.clone(),
            rules,
            local: local.clone(),
            variable_rules: freedom,
            focal_length: asked.unwrap_or(size),
        })
    }

    /// The same landscape with the light of every field at the start multiplied by a share; without
    /// shares it is unchanged.
    ///
    /// # Errors
    /// The number of shares differs from that of the fields, or a share is not positive.
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

    /// The same landscape with other reference areas of the pupils, in mm², by zoom position.
    ///
    /// # Errors
    /// The number of areas differs from that of the pupils, or an area is not positive.
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

    /// The start: limited by its stop, with fixed parameters marked by equal bounds.
    pub fn start(&self) -> &Arc<Lens> {
        &self.start
    }

    /// The target focal length of the start, in mm.
    pub fn focal_length(&self) -> f64 {
        self.focal_length
    }

    /// The rules.
    pub fn rules(&self) -> &SearchRules {
        &self.rules
    }

    /// The lens with every parameter marked as a variable that may change.
    pub fn with_variables(&self, lens: &Lens) -> Lens {
        variables::with_variables(
            &variables::clamp_to_bounds(lens),
            &self.rules,
            self.variable_rules,
        )
    }

    /// The relative tolerance of spot radii in local moves.
    pub fn tolerance(&self) -> f64 {
        self.local.tolerance
    }

    /// The merit function of a lens of any structure, with a relative tolerance of spot radii and
    /// the light relative to that of the start.
    ///
    /// # Errors
    /// The lens has no merit.
    pub fn merit(&self, lens: &Lens, tolerance: f64) -> Result<Merit, MeritError> {
        let merit = Merit::new(&self.with_variables(lens), &self.goal, tolerance)?;
        Ok(merit.with_initial_light(&self.light))
    }

    /// The number of rays of one gradient at a lens; 0 if it has no merit.
    pub fn rays_per_gradient(&self, lens: &Lens) -> usize {
        let merit = self.merit(lens, self.local.tolerance);
        merit.map_or(0, |merit| merit.spot_samplings().iter().map(|spot| spot.rays).sum())
    }

    /// A random lens with a merit, its numbers at most this part of the way from those of the start to any that
    /// are permitted; `None` if none was found.
    pub fn draw_near(&self, spread: f64, random: &mut Random) -> Option<Arc<Lens>> {
        let free = self.with_variables(&self.start);
        let range = (self.focal_length, spread);
        (0..MAX_DRAWS).find_map(|_| {
            let mut lens = random_start::random_lens(&free, &self.rules, range, random)?;
            lens.variables.clone_from(&self.start.variables);
            let lens = Arc::new(variables::clamp_to_bounds(&lens));
            self.loss(&lens).is_finite().then_some(lens)
        })
    }

    /// The reference for losses: that of the start without the penalties of the manufacturing
    /// limits, which a search reduces first.
    pub fn loss_scale(&self) -> f64 {
        let optical_merit = || {
            let merit = self.merit(&self.start, self.local.tolerance).ok()?;
            let terms = merit.terms(&merit.values(&self.with_variables(&self.start))).ok()?;
            let names = ["spot", "spot_integral", "wavefront", "geometric_mtf", "light"];
            let optical = |name: &str| names.contains(&name);
            let sum: f64 =
                terms.iter().filter(|t| optical(t.term)).map(|t| t.weight * t.value).sum();
            (sum > 0.0).then_some(sum)
        };
        optical_merit().unwrap_or_else(|| self.loss(&self.start))
    }

    /// The rules with the relative frequencies of mutations multiplied by weights.
    fn weighted_rules(&self, weights: &MutationWeights) -> SearchRules {
        let own = MutationKind::PERTURBATIONS
            .map(|kind| (kind, self.rules.weight(kind) * weights.of(kind)));
        SearchRules { weights: own.to_vec(), ..self.rules.clone() }
    }

    /// The loss of a lens with its own pupils.
    fn evaluate(&self, lens: &Lens) -> Result<f64, MeritError> {
        let merit = self.merit(lens, self.local.tolerance)?;
        Ok(self.priced(lens, merit.value(&merit.values(lens))?))
    }
}

/// The maximum number of random lenses that are tried.
const MAX_DRAWS: usize = 200;

impl Landscape for LensLandscape {
    type Point = Arc<Lens>;
    type Memory = DescentState;

    fn loss(&self, lens: &Arc<Lens>) -> f64 {
        self.evaluate(lens).unwrap_or(f64::INFINITY)
    }

    fn descend(&self, lens: &Arc<Lens>, memory: &mut DescentState) -> (Arc<Lens>, f64, usize) {
        self.descend_within(lens, memory, usize::MAX)
    }

    fn descend_within(
        &self,
        lens: &Arc<Lens>,
        memory: &mut DescentState,
        most: usize,
    ) -> (Arc<Lens>, f64, usize) {
        match self.try_move(lens, memory, most) {
            Ok(moved) => (moved.lens, moved.loss, moved.gradients),
            Err(_) => (lens.clone(), f64::INFINITY, 0),
        }
    }

    fn has_ended(&self, memory: &DescentState) -> bool {
        memory.has_ended
    }

    fn allow_long_moves(&self, memory: &mut DescentState) {
        memory.largest_multiple = Some(local_move::LARGEST_MULTIPLE);
    }

    fn draw(&self, random: &mut Random) -> Result<Arc<Lens>, MutationError> {
        let none = || MutationError::new(MutationKind::Global, Refusal::NoRandomLens);
        self.draw_near(1.0, random).ok_or_else(none)
    }

    fn mutate(
        &self,
        lens: &Arc<Lens>,
        weights: &MutationWeights,
        random: &mut Random,
    ) -> Result<MutatedPoint<Arc<Lens>>, MutationError> {
        let rules = self.weighted_rules(weights);
        match mutation::draw_kind(&MutationKind::MUTATIONS, &rules, random)? {
            MutationKind::AddAsphere => self.add_asphere(lens, &rules, random),
            kind => mutation::mutate(kind, lens, &rules, random).map(Into::into),
        }
    }

    fn perturb(
        &self,
        lens: &Arc<Lens>,
        weights: &MutationWeights,
        random: &mut Random,
    ) -> Result<MutatedPoint<Arc<Lens>>, MutationError> {
        let rules = self.weighted_rules(weights);
        match mutation::draw_kind(&MutationKind::PERTURBATIONS, &rules, random)? {
            MutationKind::AddAsphere => self.add_asphere(lens, &rules, random),
            MutationKind::AddSinglet if rules.saddles => self.add_at_saddle(lens, &rules, random),
            MutationKind::Displacement => self.displaced(lens, random),
            kind => mutation::perturb_as(kind, lens, &rules, random).map(Into::into),
        }
    }

    fn weight(&self, kind: MutationKind) -> f64 {
        self.rules.weight(kind)
    }

    fn topology(&self, lens: &Arc<Lens>) -> String {
        let glass = element::topology(lens);
        match self.priced_aspheres(lens) {
            0 => glass,
            count => format!("{glass}, {count} aspheric"),
        }
    }

    fn settle(&self, lens: &Arc<Lens>) -> Settlement<Arc<Lens>> {
        self.settlement(lens)
    }

    fn is_same_minimum(&self, one: &Arc<Lens>, other: &Arc<Lens>) -> bool {
        self.are_at_one_minimum(one, other)
    }

    fn structure_violation(&self, lens: &Arc<Lens>) -> u64 {
        let [min, max] = self.rules.elements;
        let (pieces, aspheres) = (element::piece_count(lens), self.priced_aspheres(lens));
        let excess = (2 * pieces + aspheres).saturating_sub(2 * max).div_ceil(2);
        let many = aspheres.saturating_sub(self.rules.aspheres);
        (min.saturating_sub(pieces) + excess + many) as u64
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

    fn element_count(&self, lens: &Arc<Lens>) -> usize {
        element::elements(lens).len()
    }

    fn mutate_at(
        &self,
        lens: &Arc<Lens>,
        element: usize,
        kind: MutationKind,
        random: &mut Random,
    ) -> Result<MutatedPoint<Arc<Lens>>, MutationError> {
        let rows = lens.surfaces.len();
        let Some(element) = element::elements(lens).get(element).copied() else {
            return Err(MutationError::new(kind, Refusal::NoElement));
        };
        // Only what lies between these surfaces may change, within the rules.
        let (first, last) = match kind {
            MutationKind::AddSinglet => (element.last, element.last + 1),
            _ => (element.first.saturating_sub(1), element.last + 1),
        };
        let mut rules = self.rules.clone().restricted_to(first, last.min(rows - 1), rows);
        rules.fixed_ends = [0, 1].map(|end| rules.fixed_ends[end].max(self.rules.fixed_ends[end]));
        mutation::mutate(kind, lens, &rules, random).map(Into::into)
    }

    fn loss_gradient(&self, lens: &Arc<Lens>) -> Option<LossGradient> {
        langevin_units::loss_gradient(self, lens)
    }

    fn with_values(&self, lens: &Arc<Lens>, values: &[f64]) -> Option<Arc<Lens>> {
        langevin_units::with_values(self, lens, values).map(Arc::new)
    }
}
