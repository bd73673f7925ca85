//! Wavefront and contrast of lenses with errors, and sums of shares, in the results of `tolerance`.

use super::ToleranceArgs;
use super::report::ShareOfGrowth;
use super::tables::{percent, surfaces};
use crate::cli::output::{ShortNumber, TextTable};
use crate::lens::{Lens, TableUnit, ToleranceSheet};
use crate::report::FurtherColumns;
use crate::tolerance::{
    ContrastChanges, ContrastSummary, KindShare, PartShare, RealMerit, RealMeritRequest,
    SecondDerivatives, StopTest, ToleranceError, ToleranceScene, WavefrontModel, shares_by_kind,
    shares_by_part,
};
use serde::Serialize;
use std::fmt::{self, Display};

/// The standard error of the mean merit of real lenses, relative to it, at which there are enough of them.
const ENOUGH: f64 = 0.01;
/// The share of that mean up to which a difference from what is expected is no matter.
const AGREES: f64 = 0.02;

/// The wavefront and the contrast of lenses that are made, as far as they are asked for.
#[derive(Serialize)]
pub(super) struct FurtherMerits {
    wavefront: Option<WavefrontSummary>,
    mtf: Option<ContrastSummary>,
    #[serde(skip)]
    rows: Vec<FurtherRow>,
    #[serde(skip)]
    is_stopped: bool,
}

/// The RMS wavefront in waves, at the fixed image plane and refocused.
#[derive(Serialize)]
struct WavefrontSummary {
    nominal_rms: [f64; 2],
    expected_rms: [f64; 2],
    /// The best position of the image plane in mm.
    focus: f64,
    /// The root of the mean variance of lenses with random errors by their rays.
    real: RealMerit,
}

/// The effect of one error on wavefront and contrast.
#[derive(Serialize, Default)]
pub(super) struct FurtherRow {
    #[serde(skip_serializing_if = "Option::is_none")]
    wavefront: Option<WavefrontRow>,
    #[serde(skip_serializing_if = "Option::is_none")]
    mtf: Option<ContrastRow>,
}

/// The derivatives of the variance of the wavefront, and the share in its growth.
#[derive(Serialize)]
struct WavefrontRow {
    fixed: ShareOfGrowth,
    refocused: ShareOfGrowth,
}

/// The changes of the contrast at both ends of the range of an error.
#[derive(Serialize)]
struct ContrastRow {
    fixed: Option<[f64; 2]>,
    refocused: Option<[f64; 2]>,
    /// The derivatives at the fixed image plane and adjusted, per unit of the error.
    first: Option<[f64; 2]>,
}

impl FurtherMerits {
    /// The merits that the arguments ask for, without those that are stopped.
    pub(super) fn new(
        arguments: &ToleranceArgs,
        (lens, scene, sheet): (&Lens, &ToleranceScene, &ToleranceSheet),
        stop: StopTest<'_>,
    ) -> Result<Self, ToleranceError> {
        let request =
            RealMeritRequest { seed: arguments.seed, most: arguments.samples, error: ENOUGH };
        let wavefront = || {
            let place = (lens, arguments.zoom);
            let model =
                WavefrontModel::new(place, scene, (sheet, SecondDerivatives::Traced), stop)?;
            let real = model.real_lenses(scene, sheet, request, stop)?;
            Ok((model, real))
        };
        let wavefront = unless_stopped(arguments.wavefront.then(wavefront).transpose())?;
        let contrast = |frequency: f64| {
            let place = (lens, arguments.zoom, arguments.error.0);
            ContrastChanges::with_real_lenses(place, scene, (sheet, frequency), request, stop)
        };
        let contrast = unless_stopped(arguments.mtf.map(contrast).transpose())?;
        let is_stopped = arguments.wavefront && wavefront.is_none()
            || arguments.mtf.is_some() && contrast.is_none();
        let mut rows: Vec<FurtherRow> =
            sheet.errors.iter().map(|_| FurtherRow::default()).collect();
        if let Some((model, _)) = &wavefront {
            add_wavefronts(&mut rows, model, sheet)?;
        }
        if let Some((found, _)) = &contrast {
            for (row, changes) in rows.iter_mut().zip(&found.changes) {
                let of = |plane: usize| changes.map(|changes| changes.ends[plane]);
                let first = changes.map(|changes| changes.first);
                row.mtf = Some(ContrastRow { fixed: of(0), refocused: of(1), first });
            }
        }
        let summary = |(model, real): (WavefrontModel, RealMerit)| {
            Ok::<_, ToleranceError>(WavefrontSummary {
                nominal_rms: model.nominal().map(|variance| variance.max(0.0).sqrt()),
                expected_rms: model.expected_rms(sheet)?,
                focus: model.focus(),
                real: real.root(),
            })
        };
        let wavefront = wavefront.map(summary).transpose()?;
        let mtf = contrast.map(|(found, real)| found.summary(sheet, real));
        Ok(Self { wavefront, mtf, rows, is_stopped })
    }

    /// Takes the effect of the error with a number.
    pub(super) fn row(&mut self, number: usize) -> FurtherRow {
        self.rows.get_mut(number).map(std::mem::take).unwrap_or_default()
    }

    pub(super) fn warnings(&self, sheet: &ToleranceSheet) -> Vec<String> {
        let mut warnings = Vec::new();
        if self.is_stopped {
            let text = "stopped before the wavefront or the contrast was known; they are left out";
            warnings.push(text.to_owned());
        }
        let wavefront = self.wavefront.as_ref().map(|own| (own.expected_rms, own.real));
        let contrast = self.mtf.as_ref().and_then(|own| Some((own.expected?, own.real)));
        for (name, (expected, real)) in wavefront
            .map(|own| ("wavefront", own))
            .into_iter()
            .chain(contrast.map(|own| ("MTF", own)))
        {
            if let Some([fixed, refocused]) = real.differs_from(expected, AGREES) {
                let [fixed, refocused] = [fixed, refocused].map(|apart| 100.0 * apart);
                warnings.push(format!(
                    "{name}: {} lenses by their rays differ from what the derivatives expect by \
                     {fixed:.1} % (refocused {refocused:.1} %); those by rays count",
                    real.lenses
                ));
            }
        }
        let expected = self.mtf.as_ref().and_then(|own| own.expected);
        if expected.is_some_and(|expected| expected.iter().any(|contrast| *contrast < 0.0)) {
            warnings.push(format!(
                "MTF, expected: {BELOW_ZERO}, as no contrast is: the errors are too large for the derivatives that it \
                 is expected by; the contrast of lenses by their rays counts"
            ));
        }
        if self.mtf.is_some() && !sheet.correlations.is_empty() {
            let text = "the expected contrast counts correlated errors as independent";
            warnings.push(text.to_owned());
        }
        warnings
    }

    /// The heads of the columns of the text.
    pub(super) fn heads(&self) -> Vec<&'static str> {
        let wavefront = self.wavefront.iter().map(|_| "share wavefront");
        wavefront.chain(self.mtf.iter().map(|_| "MTF at worst")).collect()
    }

    /// The further columns of the table as CSV.
    pub(super) fn columns(&self, sheet: &ToleranceSheet) -> FurtherColumns {
        let units = sheet.errors.iter().map(|own| own.error.kind.table_unit());
        let cells = self.rows.iter().zip(units).map(|(row, unit)| row.csv(unit)).collect();
        FurtherColumns { heads: self.csv_head(), cells }
    }

    /// Their heads, each behind a comma.
    fn csv_head(&self) -> String {
        let mut head = String::new();
        if self.wavefront.is_some() {
            head += ",wavefront_fixed_first (waves^2/unit),wavefront_fixed_second (waves^2/unit^2),\
                     wavefront_fixed_share,wavefront_refocused_first (waves^2/unit),\
                     wavefront_refocused_second (waves^2/unit^2),wavefront_refocused_share";
        }
        if self.mtf.is_some() {
            head += ",mtf_fixed_low,mtf_fixed_high,mtf_refocused_low,mtf_refocused_high,\
                     mtf_fixed_first (1/unit),mtf_refocused_first (1/unit)";
        }
        head
    }
}

impl FurtherRow {
    /// The cells of the further columns of the text, refocused.
    pub(super) fn cells(&self) -> Vec<String> {
        let wavefront = self.wavefront.iter().map(|own| percent(own.refocused.share));
        let worst = |own: &ContrastRow| {
            own.refocused.map_or("lost".to_owned(), |[low, high]| format!("{:+.3}", low.min(high)))
        };
        wavefront.chain(self.mtf.iter().map(worst)).collect()
    }

    /// The cells of the further columns of CSV, each behind a comma, in the unit of the error.
    fn csv(&self, TableUnit { factor, .. }: TableUnit) -> String {
        let parts = self.wavefront.iter().flat_map(|own| [&own.fixed, &own.refocused]);
        let derivatives = |part: &ShareOfGrowth| {
            let (first, second) = (part.by.first / factor, part.by.second / (factor * factor));
            format!(",{first},{second},{}", part.share)
        };
        let first = |own: &ContrastRow| own.first.map(|own| own.map(|by| by / factor));
        let changes = self.mtf.iter().flat_map(|own| [own.fixed, own.refocused, first(own)]);
        let ends = |ends: Option<[f64; 2]>| {
            ends.map_or(",,".to_owned(), |[low, high]| format!(",{low},{high}"))
        };
        parts.map(derivatives).chain(changes.map(ends)).collect()
    }
}

fn unless_stopped<T>(
    found: Result<Option<T>, ToleranceError>,
) -> Result<Option<T>, ToleranceError> {
    match found {
        Err(ToleranceError::Stopped) => Ok(None),
        found => found,
    }
}

fn add_wavefronts(
    rows: &mut [FurtherRow],
    model: &WavefrontModel,
    sheet: &ToleranceSheet,
) -> Result<(), ToleranceError> {
    let shares = model.growth_shares(sheet)?;
    for (i, (row, shares)) in rows.iter_mut().zip(&shares).enumerate() {
        let by = model.derivatives(i);
        let share = |i: usize| ShareOfGrowth { by: by[i], share: shares[i] };
        row.wavefront = Some(WavefrontRow { fixed: share(0), refocused: share(1) });
    }
    Ok(())
}

impl Display for FurtherMerits {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let mut table = TextTable::new(&["", "fixed focus", "refocused"]);
        let mut row = |name: String, [fixed, refocused]: [f64; 2]| {
            table.row([name, merit_text(fixed), merit_text(refocused)]);
        };
        if let Some(own) = &self.wavefront {
            row("RMS wavefront as designed, waves".to_owned(), own.nominal_rms);
            row("root of the expected variance, waves".to_owned(), own.expected_rms);
            real_row(&mut row, "the same", own.real);
        }
        if let Some(own) = &self.mtf {
            let ContrastSummary { frequency, nominal, expected, sampling_error, real } = own;
            let at = format!("MTF at {} cycles/mm", ShortNumber(*frequency));
            row(format!("{at} as designed ± {sampling_error:.0e}"), *nominal);
            if let Some(expected) = expected {
                row(format!("{at}, expected"), *expected);
            }
            real_row(&mut row, &at, *real);
        }
        if self.wavefront.is_none() && self.mtf.is_none() {
            return Ok(());
        }
        writeln!(f, "{table}")
    }
}

/// A merit as text. Below 0, which no merit is, the errors are too large for its derivatives.
fn merit_text(merit: f64) -> String {
    if merit < 0.0 { BELOW_ZERO.to_owned() } else { ShortNumber(merit).to_string() }
}

const BELOW_ZERO: &str = "below 0";

/// The row of a merit of real lenses, with the larger of its two errors.
fn real_row(row: &mut impl FnMut(String, [f64; 2]), name: &str, real: RealMerit) {
    let RealMerit { mean, error, lenses, lost, .. } = real;
    let lost = if lost > 0 { format!(", {lost} more lose rays") } else { String::new() };
    let error = error[0].max(error[1]);
    row(format!("{name}, {lenses} lenses by rays ± {error:.0e}{lost}"), mean);
}

/// The shares of errors, summed over the parts of the lens and over the kinds of errors.
#[derive(Serialize)]
pub(super) struct GroupedShares {
    by_part: Vec<PartShare>,
    by_kind: Vec<KindShare>,
}

/// The number of parts in the text.
const SHOWN: usize = 12;

impl GroupedShares {
    pub(super) fn new(lens: &Lens, sheet: &ToleranceSheet, shares: &[[f64; 2]]) -> Self {
        Self {
            by_part: shares_by_part(lens, sheet, shares),
            by_kind: shares_by_kind(sheet, shares),
        }
    }
}

impl Display for GroupedShares {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let head = ["part", "surfaces", "errors", "share fixed", "share refocused"];
        let mut table = TextTable::new(&head);
        for own in self.by_part.iter().take(SHOWN) {
            table.row([
                own.part.name().to_owned(),
                surfaces(own.first, own.last),
                own.errors.to_string(),
                percent(own.fixed),
                percent(own.refocused),
            ]);
        }
        if let Some(rest) = self.by_part.get(SHOWN..).filter(|rest| !rest.is_empty()) {
            let sum = |of: fn(&PartShare) -> f64| percent(rest.iter().map(of).sum());
            let errors: usize = rest.iter().map(|own| own.errors).sum();
            let (fixed, refocused) = (sum(|own| own.fixed), sum(|own| own.refocused));
            let name = format!("{} more", rest.len());
            table.row([name, String::new(), errors.to_string(), fixed, refocused]);
        }
        writeln!(f, "{table}")?;
        let mut table = TextTable::new(&["kind", "errors", "share fixed", "share refocused"]);
        for own in &self.by_kind {
            table.row([
                own.kind.name().to_owned(),
                own.errors.to_string(),
                percent(own.fixed),
                percent(own.refocused),
            ]);
        }
        writeln!(f, "{table}")
    }
}
