//! The results of `tolerance` as JSON and as text.

use super::ToleranceArgs;
use super::compensators::{CompensatorRow, compensator_rows, compensator_table};
use super::loosest::LoosestReport;
use super::merits::{FurtherMerits, FurtherRow, GroupedShares};
use super::units::{PowerUnits, half_range_text};
use super::warnings::warnings;
use crate::cli::output::{ShortNumber, counted};
use crate::lens::{Lens, PerturbationKind, ToleranceSheet};
use crate::report::tolerance_warnings;
use crate::tolerance::{
    AsBuiltSpot, Derivatives, FocusTreatment, MadeLens, NominalLens, PupilMotion, StoppedLenses,
    ToleranceAnalysis, ToleranceError, ToleranceScene,
};
use serde::Serialize;
use std::fmt::{self, Display};

/// The result.
#[derive(Serialize)]
pub(super) struct ToleranceReport {
    errors: usize,
    correlations: usize,
    rays: usize,
    sampling_error: f64,
    samples: usize,
    seed: u64,
    lost: usize,
    dark: usize,
    clipping: Option<[f64; 3]>,
    pupils: PupilMotion,
    pub(super) spots: [AsBuiltSpot; 2],
    compensators: Vec<CompensatorRow>,
    stopped: Option<StoppedLenses>,
    second_derivatives: bool,
    pub(super) sensitivities: Vec<SensitivityRow>,
    /// True if the text has every error, and not only the worst ones.
    #[serde(skip)]
    pub(super) shows_all: bool,
    groups: GroupedShares,
    #[serde(flatten)]
    pub(super) further: FurtherMerits,
    #[serde(flatten)]
    loosest: LoosestReport,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(super) worst: Option<WorstLens>,
    warnings: Vec<String>,
}

/// The worst of the lenses with random errors.
#[derive(Serialize)]
pub(super) struct WorstLens {
    /// Its number, counted from 0.
    number: usize,
    /// Its refocused rms spot radius in mm.
    rms: f64,
    /// The rms spot radius that the lens shows when its file is opened.
    written_rms: Option<f64>,
}

impl WorstLens {
    pub(super) fn new(made: &MadeLens) -> Self {
        Self { number: made.number, rms: made.stated_rms, written_rms: made.opened_rms }
    }
}

/// The effect of one error.
#[derive(Serialize)]
pub(super) struct SensitivityRow {
    pub(super) kind: PerturbationKind,
    pub(super) first: usize,
    pub(super) last: usize,
    pub(super) half_range: f64,
    /// The half range as text.
    #[serde(skip)]
    pub(super) stated: String,
    /// A half range of power in other units.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(super) power: Option<PowerUnits>,
    /// The standard deviation.
    sigma: f64,
    pub(super) fixed: ShareOfGrowth,
    pub(super) refocused: ShareOfGrowth,
    #[serde(flatten)]
    pub(super) further: FurtherRow,
}

/// The derivatives of the mean square spot by an error, and its share of the growth of the
/// expectation.
#[derive(Serialize)]
pub(super) struct ShareOfGrowth {
    #[serde(flatten)]
    pub(super) by: Derivatives,
    pub(super) share: f64,
}

impl ToleranceReport {
    pub(super) fn new(
        arguments: &ToleranceArgs,
        (lens, scene, sheet): (&Lens, &ToleranceScene, &ToleranceSheet),
        analysis: ToleranceAnalysis,
        (loosest, mut further): (LoosestReport, FurtherMerits),
    ) -> Result<Self, ToleranceError> {
        let mut warnings = warnings(&analysis);
        let of_a_class = arguments.grade_of(lens).is_some();
        warnings.extend(tolerance_warnings((sheet, of_a_class), &scene.lens, &analysis));
        warnings.extend(loosest.warnings());
        warnings.extend(further.warnings(sheet));
        let shares = analysis.growth_shares(sheet)?;
        Ok(Self {
            errors: sheet.errors.len(),
            correlations: sheet.correlations.len(),
            rays: scene.beam.rays(),
            sampling_error: scene.sampling_error,
            samples: analysis.samples,
            seed: arguments.seed,
            lost: analysis.lost,
            dark: analysis.dark,
            clipping: analysis.clipping,
            pupils: analysis.pupils.clone(),
            second_derivatives: analysis.has_second_derivatives,
            sensitivities: sorted(
                rows(sheet, &analysis, (&shares, &mut further), &scene.lens),
                arguments.sort,
            ),
            shows_all: arguments.all,
            groups: GroupedShares::new(lens, sheet, &shares),
            compensators: compensator_rows(&analysis),
            stopped: analysis.stopped,
            spots: analysis.spots,
            further,
            loosest,
            worst: None,
            warnings,
        })
    }
}

/// The sensitivities, that with the largest share first.
fn sorted(mut rows: Vec<SensitivityRow>, order: FocusTreatment) -> Vec<SensitivityRow> {
    let share = |row: &SensitivityRow| match order {
        FocusTreatment::Fixed => row.fixed.share,
        FocusTreatment::Refocused => row.refocused.share,
    };
    rows.sort_by(|a, b| share(b).total_cmp(&share(a)));
    rows
}

/// The sensitivities, in the order of the errors.
fn rows(
    sheet: &ToleranceSheet,
    analysis: &ToleranceAnalysis,
    (shares, further): (&[[f64; 2]], &mut FurtherMerits),
    lens: &NominalLens,
) -> Vec<SensitivityRow> {
    let both = sheet.errors.iter().zip(shares.iter().copied()).enumerate();
    both.map(|(i, (tolerance, [fixed, refocused]))| {
        let sigma = tolerance.deviation();
        let [by_fixed, by_adjusted] =
            analysis.forms.each_ref().map(|form| form.derivatives(i).without_rounding(sigma));
        SensitivityRow {
            kind: tolerance.error.kind,
            first: tolerance.error.first,
            last: tolerance.error.last,
            half_range: tolerance.half_range,
            stated: half_range_text(tolerance, lens),
            power: PowerUnits::new(tolerance, lens),
            sigma,
            fixed: ShareOfGrowth { by: by_fixed, share: fixed },
            refocused: ShareOfGrowth { by: by_adjusted, share: refocused },
            further: further.row(i),
        }
    })
    .collect()
}

impl Display for ToleranceReport {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        writeln!(
            f,
            "{}, {}{} rays, {} lenses by Monte Carlo; spots as rms in mm\n",
            counted(self.errors, "manufacturing error"),
            match self.correlations {
                0 => String::new(),
                count => format!("{}, ", counted(count, "correlation")),
            },
            self.rays,
            self.samples
        )?;
        writeln!(f, "{}", self.spot_table())?;
        writeln!(f, "{}", compensator_table(&self.compensators))?;
        writeln!(f, "{}", self.sensitivity_table())?;
        write!(f, "{}", self.groups)?;
        write!(f, "{}", self.further)?;
        writeln!(f, "{}", pupil_line(&self.pupils))?;
        if let Some([fixed, refocused, light]) = self.clipping.map(|c| c.map(|v| 100.0 * v)) {
            writeln!(
                f,
                "rims would change the mean square by {fixed:.2} % (refocused \
                 {refocused:.2} %) and take {light:.2} % of the light"
            )?;
        }
        write!(f, "{}", self.loosest)?;
        if let Some(WorstLens { number, rms, written_rms }) = &self.worst {
            let written = written_rms.map_or_else(String::new, |written| {
                format!(", {} mm as its file is opened", ShortNumber(written))
            });
            let (number, rms) = (number + 1, ShortNumber(*rms));
            writeln!(f, "worst lens: number {number}, refocused rms {rms} mm{written}")?;
        }
        self.warnings.iter().try_for_each(|warning| writeln!(f, "warning: {warning}"))
    }
}

/// The decision about moving pupils with its reason and what it costs or saves.
fn pupil_line(pupils: &PupilMotion) -> String {
    let PupilMotion { moves, reason, rays, .. } = pupils;
    let cost = rays.map_or_else(String::new, |[found, held]| {
        format!("; {found} rays a lens with its pupils found anew, {held} with those of the design")
    });
    format!("moving pupils: {}, {reason}{cost}", if *moves { "on" } else { "off" })
}
