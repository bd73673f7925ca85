//! The options of a structure search: merit function, constraints and settings.

use crate::cli::error::CliError;
use crate::cli::input::{self, Tolerance};
use crate::cli::output::{ShortNumber, print_note};
use crate::lens::{FieldKind, FieldPoint, Fields, Lens, Object, ToleranceGrade, Wavelength};
use crate::merit::Goal;
use crate::optimize::DescentMethod;
use crate::search::lens_landscape::{
    DescentSettings, LandscapeError, SearchPlan, describe_left_out, with_open_apertures,
};
use crate::search::{MutationKind, SearchRules, Temperature, element};
use std::path::{Path, PathBuf};
use std::str::FromStr;

/// The options of a structure search.
#[derive(Debug, clap::Args)]
pub(in crate::cli) struct SearchPlanArgs {
    /// The merit function, as JSON; absent: that of the lens file, or sharp spots with the present light
    /// and focal length
    #[arg(long, value_name = "FILE")]
    goal: Option<PathBuf>,

    /// Minimizes the spots of lenses that are made with the tolerances of this class, in place of the
    /// spots as designed
    #[arg(long, value_enum, value_name = "GRADE")]
    as_built: Option<ToleranceGrade>,

    /// The target focal length in mm; absent: the present one
    #[arg(long, value_name = "MM", conflicts_with = "goal", allow_negative_numbers = true)]
    focal_length: Option<f64>,

    /// Minimum light of every field relative to the start: one number, or one for each field
    #[arg(
        long,
        value_name = "SHARES",
        default_value = "1",
        value_delimiter = ',',
        allow_hyphen_values = true,
        conflicts_with = "goal"
    )]
    light: Vec<f64>,

    /// The constraints and permitted mutations, as JSON
    #[arg(long, value_name = "FILE")]
    rules: Option<PathBuf>,

    /// The smallest and the largest number of elements: `4..8`
    #[arg(long, value_name = "RANGE")]
    elements: Option<ElementRange>,

    /// The largest diameter of a surface in mm
    #[arg(long, value_name = "MM", allow_negative_numbers = true)]
    max_diameter: Option<f64>,

    /// The longest track in mm; absent: 1.2 times the present one
    #[arg(long, value_name = "MM", allow_negative_numbers = true)]
    max_track: Option<f64>,

    /// The shortest back focus in mm; absent: 0.8 times the present one
    #[arg(long, value_name = "MM", allow_negative_numbers = true)]
    min_back_focus: Option<f64>,

    /// The largest number of aspheric surfaces, each of which counts as half an element; absent: none is added
    #[arg(long, value_name = "N")]
    aspheres: Option<usize>,

    /// Mutations without paraxial projection
    #[arg(long)]
    no_projection: bool,

    /// Kinds of mutations to exclude: `add_singlet`, `remove_singlet`, `glue`, `split`, `drop_layer`,
    /// `bend`, `flip`, `exchange_glass`, `move_stop`, `add_asphere`, `remove_asphere`, `displacement`,
    /// `global_draw`
    #[arg(long, value_name = "KINDS", value_delimiter = ',')]
    forbid: Vec<MutationArg>,

    /// Opens every semi-diameter as far as the neighbours allow, at most to this one in mm; removes the
    /// diaphragm
    #[arg(long, value_name = "MM", allow_negative_numbers = true)]
    open: Option<f64>,

    /// Varies every curvature and gap, whatever the variables of the file
    #[arg(long)]
    free: bool,

    /// Image heights in mm that replace the fields, as angles `atan(h / focal length)`
    #[arg(long, value_name = "HEIGHTS", value_delimiter = ',', allow_hyphen_values = true)]
    heights: Vec<f64>,

    /// One wavelength in um that replaces those of the lens
    #[arg(long, value_name = "UM", allow_negative_numbers = true)]
    wavelength: Option<f64>,

    /// The number of chains that share the reservoir; an iterated local search has --trials in their place
    #[arg(long, value_name = "N")]
    chains: Option<usize>,

    /// The number of mutants that race in an iterated local search
    #[arg(long, value_name = "N")]
    trials: Option<usize>,

    /// The number of lenses in the reservoir; absent: 5, or 16 different minima of an iterated local search
    #[arg(long, value_name = "N")]
    reservoir: Option<usize>,

    /// Temperature of `restore` and `metropolis`, 0 or more, or `infinite`; absent: the density of the start is one half
    #[arg(long, value_name = "T", allow_negative_numbers = true)]
    temperature: Option<TemperatureArg>,

    /// The rate at which descents of `restore` end at random; the larger, the shorter they are
    #[arg(long, value_name = "C", allow_negative_numbers = true)]
    c: Option<f64>,

    /// The share of regenerations of `restore` that draw a lens globally
    #[arg(long, value_name = "SHARE", allow_negative_numbers = true)]
    gamma: Option<f64>,

    /// The method of the local steps; absent: trust-region, or that of the checkpoint if there is one
    #[arg(long, value_enum)]
    pub(in crate::cli) descent: Option<DescentMethod>,

    /// The number of steps of a local move
    #[arg(long, value_name = "N", default_value_t = DescentSettings::default().steps)]
    steps: usize,

    /// Tolerance of the radius of each spot: `1%` or `1e-2`
    #[arg(long, default_value = "1e-2", value_name = "TOLERANCE")]
    error: Tolerance,
}

/// A range of numbers of elements: `4..8`.
#[derive(Debug, Clone, Copy)]
struct ElementRange([usize; 2]);

impl FromStr for ElementRange {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let ends = text.split_once("..").map(|(low, high)| (low.parse(), high.parse()));
        match ends {
            Some((Ok(low), Ok(high))) if 0 < low && low <= high => Ok(Self([low, high])),
            _ => Err("expected two numbers of 1 or more, the smaller one first, as `4..8`".into()),
        }
    }
}

/// A temperature: a number, or `infinite`.
#[derive(Debug, Clone, Copy)]
struct TemperatureArg(Temperature);

impl FromStr for TemperatureArg {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let value = if text == "infinite" { Ok(f64::INFINITY) } else { text.parse() };
        let found = value.ok().and_then(Temperature::new);
        found.map(Self).ok_or_else(|| "expected 0 or more, or `infinite`".to_owned())
    }
}

/// A kind of mutation, by name.
#[derive(Debug, Clone, Copy)]
struct MutationArg(MutationKind);

impl FromStr for MutationArg {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let name = |kind: MutationKind| kind.name().replace(' ', "_");
        let all = MutationKind::PERTURBATIONS.into_iter().chain([MutationKind::Global]);
        let found = all.clone().find(|kind| name(*kind) == text.replace('-', "_"));
        let known: Vec<String> = all.map(name).collect();
        found.map(Self).ok_or_else(|| format!("expected one of {}", known.join(", ")))
    }
}

fn positive(name: &str, value: Option<f64>) -> Result<Option<f64>, CliError> {
    match value {
        Some(v) if !(v > 0.0 && v.is_finite()) => {
            Err(CliError::Input(format!("{name}: found {}; expected more than 0", ShortNumber(v))))
        }
        value => Ok(value),
    }
}

/// The accepted range of focal lengths of either sign, in mm.
const FOCAL_LENGTHS: [f64; 2] = [1e-9, 1e9];

impl SearchPlanArgs {
    /// The files that are read, each with its option.
    pub(in crate::cli) fn files(&self) -> impl Iterator<Item = (&'static str, &Path)> {
        let goal = self.goal.as_deref().map(|path| ("--goal", path));
        goal.into_iter().chain(self.rules.as_deref().map(|path| ("--rules", path)))
    }

    /// The merit function of a plan without one: that of the lens, if there is one, for lenses that are made if
    /// that was asked for; and the names of its terms that a search cannot have.
    ///
    /// # Errors
    /// A lens without first-order data; a merit function without the spots that are asked for as built.
    pub(in crate::cli) fn give_goal(
        &self,
        plan: &mut SearchPlan,
        lens: &Lens,
    ) -> Result<(), LandscapeError> {
        let own = lens.merit.clone().filter(|_| plan.goal.is_none());
        let usual = (plan.goal.is_none() && self.as_built.is_some()).then(|| Goal::of_lens(lens));
        if let Some(own) = own.map_or(usual.transpose()?, Some) {
            let (goal, left_out) = plan.goal_of_design(lens, &own)?;
            plan.goal = Some(goal);
            if let Some(text) = describe_left_out(&left_out) {
                print_note(format!("note: {text}"));
            }
        }
        if let Some(goal) = plan.goal.as_mut().filter(|_| self.as_built.is_some()) {
            if !goal.terms.iter().any(|weighted| weighted.term.is_of_spots()) {
                return Err(LandscapeError::Setting {
                    what: "--as-built",
                    found: "a merit function without a term `spot`".to_owned(),
                    expected: "one",
                });
            }
            *goal = goal.clone().as_built(self.as_built);
        }
        Ok(())
    }

    /// True if one wavelength replaces those of the lens.
    pub(in crate::cli) fn has_wavelength(&self) -> bool {
        self.wavelength.is_some()
    }

    /// The plan of a search of this lens.
    pub(in crate::cli) fn plan(&self, lens: &Lens) -> Result<SearchPlan, CliError> {
        let rules = self.rules(lens)?;
        let mut plan = SearchPlan { rules, light: self.light.clone(), ..SearchPlan::default() };
        self.light.iter().try_for_each(|share| positive("--light", Some(*share)).map(drop))?;
        plan.focal_length = match self.focal_length {
            Some(focal) if !(FOCAL_LENGTHS[0]..=FOCAL_LENGTHS[1]).contains(&focal.abs()) => {
                let text = "expected a number other than 0, up to 1e9 mm";
                let text = format!("--focal-length: found {}; {text}", ShortNumber(focal));
                return Err(CliError::Input(text));
            }
            focal => focal,
        };
        plan.goal = self.goal.as_deref().map(input::read_json).transpose()?;
        plan.local.tolerance = self.error.0;
        plan.local.coarse = self.error.0;
        plan.local.steps = self.steps;
        plan.local.method = self.descent.unwrap_or(plan.local.method);
        let settings = &mut plan.settings;
        settings.chains = self.chains.unwrap_or(settings.chains);
        settings.trials = self.trials.unwrap_or(settings.trials);
        settings.reservoir = self.reservoir;
        settings.temperature = self.temperature.map(|heat| heat.0);
        settings.c = self.c.unwrap_or(settings.c);
        settings.gamma = self.gamma.unwrap_or(settings.gamma);
        Ok(plan)
    }

    fn rules(&self, lens: &Lens) -> Result<SearchRules, CliError> {
        let read = self.rules.as_deref().map(input::read_json).transpose()?;
        let mut rules: SearchRules = read.unwrap_or_default();
        rules.aspheres = self.aspheres.unwrap_or(rules.aspheres);
        rules = match self.elements {
            Some(ElementRange(elements)) => SearchRules { elements, ..rules },
            None if self.rules.is_none() => rules.admit_element_count(element::piece_count(lens)),
            None => rules,
        };
        let widest = positive("--max-diameter", self.max_diameter)?.map(|d| 0.5 * d);
        let open = positive("--open", self.open)?;
        rules.semi_diameter = widest.or(rules.semi_diameter).or(open);
        rules.track = positive("--max-track", self.max_track)?.or(rules.track);
        let room = positive("--min-back-focus", self.min_back_focus)?;
        rules.back_focus = room.or(rules.back_focus);
        rules.projection &= !self.no_projection;
        for MutationArg(kind) in &self.forbid {
            rules.exclude(*kind);
        }
        Ok(rules)
    }

    /// The start of the search.
    pub(in crate::cli) fn start_lens(&self, lens: &Lens) -> Result<Lens, CliError> {
        let mut start = lens.clone();
        if self.free {
            start.variables.clear();
        }
        if !self.heights.is_empty() {
            start.fields = self.fields(&start)?;
            start.zoom.iter_mut().for_each(|position| position.fields = None);
        }
        if let Some(um) = positive("--wavelength", self.wavelength)? {
            let primary = lens.wavelengths[lens.primary()].um;
            if let (Err(why), Ok(_)) = (lens.resolve(0, um), lens.resolve(0, primary)) {
                return Err(CliError::Input(format!("--wavelength: {why}")));
            }
            start.wavelengths = vec![Wavelength { um, weight: 1.0, primary: true }];
        }
        Ok(self.open.map_or_else(|| start.clone(), |limit| with_open_apertures(&start, limit)))
    }

    fn fields(&self, lens: &Lens) -> Result<Fields, CliError> {
        let Some(focal) = self.focal_length.filter(|_| lens.object == Object::Infinity) else {
            let text = "--heights: expected --focal-length beside it, and an object at infinity";
            return Err(CliError::Input(text.into()));
        };
        if let Some(height) = self.heights.iter().find(|h| !h.is_finite()) {
            let text = format!("--heights: found {}; expected mm", ShortNumber(*height));
            return Err(CliError::Input(text));
        }
        let angle =
            |h: &f64| FieldPoint { x: 0.0, y: (h / focal).atan().to_degrees(), weight: 1.0 };
        Ok(Fields { kind: FieldKind::Angle, values: self.heights.iter().map(angle).collect() })
    }
}
