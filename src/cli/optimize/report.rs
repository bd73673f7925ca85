//! The printed result of `optimize`.

use super::OptimizeArgs;
use crate::cli::effects::EffectReport;
use crate::cli::glass_exchange::GlassExchangeReport;
use crate::cli::limit_prices;
use crate::cli::names::value_name;
use crate::cli::output::{ShortNumber, TextTable, or_dash, write_saved};
use crate::cli::terms::TermComparison;
use crate::lens::{Lens, Quantity, Variable};
use crate::merit::TermValue;
use crate::optimize::{LimitPrice, OptimizationEnd, OptimizationProgress};
use crate::paraxial::{Beam, first_order};
use serde::Serialize;
use std::fmt::{self, Display};

/// The steps of a run and the reason of its end.
pub(super) struct OptimizeRun {
    pub(super) steps: Vec<OptimizationProgress>,
    pub(super) ended: OptimizeEnd,
}

/// The reason why a run ended.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub(super) enum OptimizeEnd {
    /// It converged.
    Finished,
    /// The maximum number of steps was reached.
    Steps,
    /// It was stopped by Ctrl-C.
    Stopped,
}

/// A run with the terms before and after it.
pub(super) struct OptimizeOutcome<'a> {
    pub(super) search: &'a OptimizeRun,
    pub(super) ms: f64,
    /// The mean pupil area before and after, in mm².
    pub(super) light: [f64; 2],
    pub(super) before: Vec<TermValue>,
    pub(super) after: Vec<TermValue>,
    pub(super) limits: Vec<LimitPrice>,
    pub(super) glasses: Option<GlassExchangeReport>,
    pub(super) saved: SavedParts,
    pub(super) effects: EffectReport,
}

/// The parts of a result that are in files, or were not asked for there.
pub(super) struct SavedParts {
    pub(super) lens: bool,
    pub(super) history: bool,
}

/// The printed result.
#[derive(Serialize)]
pub(super) struct OptimizeReport {
    method: String,
    steps: usize,
    ended: OptimizeEnd,
    /// The reason for which the method ended by itself.
    #[serde(skip_serializing_if = "Option::is_none")]
    reason: Option<OptimizationEnd>,
    ms: f64,
    merit_before: f64,
    merit_after: f64,
    light_before: f64,
    light_after: f64,
    /// The focal length at each zoom position before and after, in mm.
    focal_lengths: Vec<FocalLengths>,
    refused_steps: usize,
    last_refusal: Option<String>,
    terms: Vec<TermComparison>,
    /// The limits that hold the best lens, with their prices.
    limits: Vec<LimitPrice>,
    variables: Vec<VariableComparison>,
    /// The exchange of glasses, if that was asked for.
    #[serde(skip_serializing_if = "Option::is_none")]
    glasses: Option<GlassExchangeReport>,
    /// True if thicknesses vary that no term limits.
    #[serde(skip)]
    free_thicknesses: bool,
    #[serde(flatten)]
    effects: EffectReport,
    out: Option<String>,
    /// The best lens, if it could not be saved.
    #[serde(skip_serializing_if = "Option::is_none")]
    lens: Option<Lens>,
    /// The steps of the history, if they could not be saved.
    #[serde(skip_serializing_if = "Option::is_none")]
    history: Option<Vec<OptimizationProgress>>,
}

/// The focal length of a lens at a zoom position, in mm; `None` for an afocal one.
#[derive(Serialize)]
struct FocalLengths {
    before: Option<f64>,
    after: Option<f64>,
}

impl FocalLengths {
    /// The focal lengths of two lenses at every zoom position.
    fn compare(before: &Lens, after: &Lens) -> Vec<Self> {
        let of = |lens: &Lens, zoom| {
            let system = lens.resolve(zoom, lens.wavelengths[lens.primary()].um).ok()?;
            first_order(&system, &Beam::for_lens(lens, zoom)).ok()?.efl
        };
        let pair = |zoom| Self { before: of(before, zoom), after: of(after, zoom) };
        (0..before.zoom_positions()).map(pair).collect()
    }
}

impl Display for FocalLengths {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "focal length {} -> {} mm", or_dash(self.before), or_dash(self.after))?;
        let Some((before, after)) = self.before.zip(self.after) else { return Ok(()) };
        write!(f, " ({:+.2} %)", 100.0 * (after / before - 1.0))
    }
}

#[derive(Serialize)]
struct VariableComparison {
    parameter: String,
    before: Option<f64>,
    after: Option<f64>,
}

/// The terms that limit thicknesses.
const THICKNESS_TERMS: [&str; 8] = [
    "glass_center",
    "glass_edge",
    "air_center",
    "air_edge",
    "total_track",
    "back_focus",
    "gap",
    "track",
];

/// True if a lens varies thicknesses that none of these terms limits.
fn has_free_thicknesses(lens: &Lens, terms: &[TermValue]) -> bool {
    let is_thickness = |variable: &Variable| variable.parameter.quantity == Quantity::Thickness;
    let is_limited = terms.iter().any(|term| THICKNESS_TERMS.contains(&term.term));
    lens.variables.iter().any(is_thickness) && !is_limited
}

impl OptimizeReport {
    pub(super) fn new(
        args: &OptimizeArgs,
        lens: &Lens,
        best: &Lens,
        found: OptimizeOutcome<'_>,
    ) -> Self {
        let OptimizeOutcome { search, ms, light, before, after, limits, glasses, saved, effects } =
            found;
        let merit = |terms: &[TermValue]| terms.iter().map(|t| t.weight * t.value).sum();
        let refusals = || search.steps.iter().filter_map(|step| step.refused.as_ref());
        let variable = |v: &Variable| VariableComparison {
            parameter: v.parameter.to_string(),
            before: lens.get(v.parameter),
            after: best.get(v.parameter),
        };
        Self {
            method: value_name(&args.method),
            steps: search.steps.len(),
            ended: search.ended,
            reason: search.steps.last().and_then(|step| step.end),
            ms,
            merit_before: merit(&before),
            merit_after: merit(&after),
            light_before: light[0],
            light_after: light[1],
            focal_lengths: FocalLengths::compare(lens, best),
            refused_steps: refusals().count(),
            last_refusal: refusals().next_back().cloned(),
            free_thicknesses: has_free_thicknesses(lens, &after),
            terms: TermComparison::compare(&before, &after),
            limits,
            variables: lens.variables.iter().map(variable).collect(),
            glasses,
            effects,
            out: saved.lens.then(|| args.out.display().to_string()),
            lens: (!saved.lens).then(|| best.clone()),
            history: (!saved.history).then(|| search.steps.clone()),
        }
    }
}

/// The number of variables in the text.
const SHOWN_VARIABLES: usize = 30;

impl OptimizeReport {
    fn write_variables(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let mut table = TextTable::new(&["variable", "before", "after"]);
        for VariableComparison { parameter, before, after } in
            self.variables.iter().take(SHOWN_VARIABLES)
        {
            table.row([parameter.clone(), or_dash(*before), or_dash(*after)]);
        }
        write!(f, "{table}")?;
        match self.variables.len().saturating_sub(SHOWN_VARIABLES) {
            0 => writeln!(f),
            more => writeln!(f, "{more} more in --json\n"),
        }
    }
}

/// The terms that depend on the transmitted light.
const LIGHT_TERMS: [&str; 6] =
    ["throughput", "throughput_loss", "light", "mean_light", "relative_illumination", "f_number"];

impl Display for OptimizeReport {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { steps, ms, merit_before, merit_after, .. } = self;
        let ended = match (self.ended, self.reason) {
            (OptimizeEnd::Finished, Some(reason)) => reason.text(),
            (OptimizeEnd::Finished, None) => "converged",
            (OptimizeEnd::Steps, _) => "the maximum number of steps was reached",
            (OptimizeEnd::Stopped, _) => "stopped",
        };
        writeln!(f, "{steps} steps in {:.3} s: {ended}", 1e-3 * ms)?;
        if let Some(refusal) = &self.last_refusal {
            writeln!(f, "{} steps rejected or shortened, the last: {refusal}", self.refused_steps)?;
        }
        if let Some(glasses) = &self.glasses {
            write!(f, "{glasses}")?;
        }
        writeln!(f, "merit {} -> {}", ShortNumber(*merit_before), ShortNumber(*merit_after))?;
        let [before, after] = [self.light_before, self.light_after];
        let change = 100.0 * (after / before - 1.0);
        let light = [ShortNumber(before), ShortNumber(after)];
        writeln!(
            f,
            "light {} -> {} mm^2 ({change:+.1} %), mean over the spots",
            light[0], light[1]
        )?;
        self.focal_lengths.iter().try_for_each(|focal| writeln!(f, "{focal}"))?;
        let asks = self.terms.iter().any(|term| LIGHT_TERMS.contains(&term.term));
        if change < -1.0 && !asks {
            writeln!(
                f,
                "  no term depends on the light: part of the sharpness was gained by clipping"
            )?;
        }
        if self.free_thicknesses {
            writeln!(f, "  no term limits thicknesses, but thicknesses vary")?;
        }
        writeln!(f)?;
        let table = TermComparison::table(&self.terms);
        writeln!(f, "{table}")?;
        if let Some(note) = TermComparison::note(&self.terms) {
            writeln!(f, "{note}")?;
        }
        limit_prices::write(&self.limits, *merit_after, f)?;
        self.write_variables(f)?;
        writeln!(f, "{}", self.effects)?;
        write_saved(f, self.out.as_deref(), self.lens.as_ref())
    }
}
