//! `tolerance`: what manufacturing errors do to a lens.

mod checkpoint;
mod compensators;
mod merits;
mod plots;
mod power;

use self::checkpoint::RandomLensSource;
use self::compensators::{CompensatorRow, compensator_rows, compensator_table, stop_warning};
use self::merits::{FurtherMerits, FurtherRow, GroupedShares};
use crate::cli::error::CliError;
use crate::cli::failures::Failures;
use crate::cli::input::{LensFile, LoadedLens, Tolerance as RelativeError};
use crate::cli::output::{Output, ShortNumber, TextTable};
use crate::cli::output_paths::OutputPaths;
use crate::cli::progress::{note_if_stopped, stop_flag};
use crate::files::{self, FileLock};
use crate::lens::{Compensator, Lens, PerturbationKind, SurfaceNumber, Tolerance, ToleranceSheet};
use crate::tolerance::{
    AsBuiltSpot, Derivatives, ErrorModel, MadeLens, NominalLens, PriceClass, QuadraticForm,
    RealLens, SecondDerivatives, StopTest, StoppedLenses, ToleranceAnalysis, ToleranceError,
    ToleranceGrade, ToleranceRequest, ToleranceScene, bounded_tolerances, form_yield, graded_sheet,
    loosest_for_yield, loosest_tolerances, price_classes, real_lenses, refuse_lost_lenses,
    worst_lens,
};
use power::PowerUnits;
use serde::Serialize;
use std::fmt::{self, Display};
use std::path::PathBuf;
use std::sync::atomic::{AtomicBool, Ordering};

fn parse_sample_count(text: &str) -> Result<usize, &'static str> {
    text.parse().ok().filter(|count| *count >= 2).ok_or("expected a whole number, 2 or more")
}

/// Shows what manufacturing errors do to a lens: sensitivities, expected spot, quantiles, yield
#[derive(Debug, clap::Args)]
#[command(after_long_help = include_str!("../help/tolerance.txt"))]
pub(super) struct ToleranceArgs {
    #[command(flatten)]
    lens: LensFile,

    /// A class of tolerances in place of those of the lens file; precision where it has none
    #[arg(long, value_enum, value_name = "GRADE")]
    grade: Option<ToleranceGrade>,

    /// Lenses with random errors whose rays are traced; two at least, or nothing tells the error of
    /// the quadratic model
    #[arg(long, default_value_t = 500, value_name = "N", value_parser = parse_sample_count)]
    samples: usize,

    /// The seed of the random errors
    #[arg(long, default_value_t = 1, value_name = "N")]
    seed: u64,

    /// Tolerance of the radius of each spot by its sampling: `0.1%` or `1e-3`
    #[arg(long, default_value = "0.1%", value_name = "TOLERANCE")]
    error: RelativeError,

    /// The zoom position, counted from 0
    #[arg(long, default_value_t = 0, value_name = "N")]
    zoom: usize,

    /// The largest rms spot radius of a good lens in mm: adds the yield, the share of good lenses
    #[arg(long, value_name = "MM")]
    rms: Option<f64>,

    /// Adds the loosest tolerances with which the expected refocused rms is this, in mm
    #[arg(long, value_name = "MM")]
    loosest: Option<f64>,

    /// Adds the loosest tolerances with which this share of the lenses is good by --rms, refocused
    #[arg(long, value_name = "SHARE", requires = "rms", conflicts_with = "loosest")]
    loosest_yield: Option<RelativeError>,

    /// A part that is adjusted after assembly, with its largest travel in mm or degrees, beside what the file
    /// names: `focus=0.3`, `sensor_tilt_x=0.2`, `thickness@3=0.1`, `element_decenter_y@3-4=0.05`
    #[arg(long = "compensator", value_name = "KIND@SURFACES=TRAVEL")]
    compensators: Vec<Compensator>,

    /// Adds the second derivatives of rays to the quadratic model, which leaves them out: one more pass of all
    /// rays for each error
    #[arg(long)]
    second_derivatives: bool,

    /// Adds what the errors do to the RMS wavefront at the primary wavelength
    #[arg(long)]
    wavefront: bool,

    /// Adds what the errors do to the geometric contrast at this frequency in cycles/mm
    #[arg(long, value_name = "FREQUENCY")]
    mtf: Option<f64>,

    /// A file in which the lenses of Monte Carlo are saved: a run that was stopped, or one with more
    /// --samples, goes on from there
    #[arg(long, value_name = "FILE")]
    checkpoint: Option<PathBuf>,

    /// A file for the table of sensitivities, as CSV
    #[arg(long, value_name = "FILE")]
    csv: Option<PathBuf>,

    /// A file for the lens with the largest refocused spot of those with random errors, as a lens of its
    /// own (.json, .zmx)
    #[arg(long, value_name = "FILE")]
    worst: Option<PathBuf>,

    /// A file for the worst errors, the distribution and the yield as a picture: PNG or SVG
    #[arg(long, value_name = "FILE")]
    plot: Option<PathBuf>,
}

impl ToleranceArgs {
    pub(super) fn run(&self, output: &Output) -> Result<(), CliError> {
        self.check_paths()?;
        self.check_numbers()?;
        let opened = self.lens.open()?;
        opened.check_zoom(self.zoom)?;
        let _lock = self.checkpoint.as_deref().map(FileLock::acquire).transpose()?;
        let refuse = |source: ToleranceError| tolerance_error(&opened, &source);
        let stop = stop_flag();
        let stops = || stop.load(Ordering::Relaxed);
        let scene = ToleranceScene::new_until(&opened.lens, self.zoom, self.error.0, &stops);
        let scene = scene.map_err(refuse)?;
        let sheet = self.sheet(&opened, &scene)?;
        let mut failures = Failures::default();
        let analysis = self.analysis((&opened, &scene, &sheet), &stops, &mut failures)?;
        refuse_lost_lenses(analysis.lost, analysis.samples, "these tolerances").map_err(refuse)?;
        let form = &analysis.forms[1];
        let loosest = match self.loosest(form, &sheet).transpose().map_err(refuse)? {
            Some(found) => {
                let errors = (&sheet.errors[..], &found[..]);
                let (bounded, held) = bounded_tolerances(&opened.lens, &scene.lens, errors);
                let loosest = ToleranceSheet { errors: bounded, ..sheet.clone() };
                let place = (&opened.lens, &scene);
                let loosest = Loosest::new(loosest, form, self.rms, place).map_err(refuse)?;
                let confirmed = loosest.confirmed(form, &scene, held, (self.seed, &stop));
                Some(confirmed.map_err(refuse)?)
            }
            None => None,
        };
        let further = FurtherMerits::new(self, (&opened.lens, &scene, &sheet), &stops);
        let further = further.map_err(refuse)?;
        note_if_stopped(&stop);
        let worst = self.worst(&opened, &scene, &sheet, &analysis.real).map_err(refuse)?;
        let lens = (&opened.lens, &scene, &sheet);
        let mut report =
            ToleranceReport::new(self, lens, analysis, (loosest, further)).map_err(refuse)?;
        report.worst = worst.as_ref().map(WorstLens::new);
        if let Some(path) = &self.csv {
            failures.note(files::write_atomic(path, report.csv().as_bytes()));
        }
        if let (Some(path), Some(worst)) = (&self.worst, &worst) {
            failures.note(files::save(&worst.lens, path));
        }
        if let Some(path) = &self.plot {
            let spots = (&report.spots, report.samples);
            failures.note(plots::save(path, &opened.lens.name, &report.sensitivities, spots));
        }
        failures.note(output.print(&report));
        failures.into_result()
    }

    /// The worst lens, if it is asked for.
    fn worst(
        &self,
        opened: &LoadedLens,
        scene: &ToleranceScene,
        sheet: &ToleranceSheet,
        real: &[RealLens],
    ) -> Result<Option<MadeLens>, ToleranceError> {
        if self.worst.is_none() {
            return Ok(None);
        }
        worst_lens((&opened.lens, self.zoom), scene, sheet, real)
    }

    /// The analysis, whose real lenses are read from the checkpoint and saved there.
    fn analysis(
        &self,
        (opened, scene, sheet): (&LoadedLens, &ToleranceScene, &ToleranceSheet),
        stop: StopTest<'_>,
        failures: &mut Failures,
    ) -> Result<ToleranceAnalysis, CliError> {
        let refuse = |source: ToleranceError| tolerance_error(opened, &source);
        let lens = Lens { tolerances: Some(sheet.clone()), ..opened.lens.clone() };
        let source = RandomLensSource::new(&lens, self.zoom, self.error.0, self.seed);
        let known = match self.checkpoint.as_deref() {
            Some(path) => source.known(path)?,
            None => Vec::new(),
        };
        let second = if self.second_derivatives {
            SecondDerivatives::Traced
        } else {
            SecondDerivatives::Neglected
        };
        let request = ToleranceRequest { seed: self.seed, samples: self.samples, limit: self.rms };
        let model = ErrorModel::new(scene, sheet, second, stop).map_err(refuse)?;
        let mut failed = None;
        let save = |lenses: &[RealLens]| {
            let saved = self.checkpoint.as_deref().map(|path| source.save(path, lenses));
            failed = saved.and_then(Result::err);
        };
        let found = model.analyze_on((scene, sheet), request, stop, (&known, save));
        let failed = failed.map(|why| CliError::Failed(why.to_string()));
        failures.note(failed.map_or(Ok(()), Err));
        found.map_err(refuse)
    }

    fn check_paths(&self) -> Result<(), CliError> {
        let mut paths = OutputPaths::reading([("the lens", self.lens.path())]);
        paths.file("--checkpoint", self.checkpoint.as_deref(), &["json"])?;
        paths.file("--csv", self.csv.as_deref(), &["csv"])?;
        paths.file("--worst", self.worst.as_deref(), &["json", "zmx"])?;
        paths.file("--plot", self.plot.as_deref(), &plots::EXTENSIONS)
    }

    /// The loosest tolerances that are asked for.
    fn loosest(
        &self,
        form: &QuadraticForm,
        sheet: &ToleranceSheet,
    ) -> Option<Result<Vec<Tolerance>, ToleranceError>> {
        match (self.loosest, self.loosest_yield, self.rms) {
            (Some(rms), ..) => Some(loosest_tolerances(form, sheet, rms * rms)),
            (None, Some(share), Some(limit)) => {
                Some(loosest_for_yield(form, sheet, limit, share.0))
            }
            _ => None,
        }
    }

    fn check_numbers(&self) -> Result<(), CliError> {
        let numbers = [
            ("--rms", self.rms, "mm"),
            ("--loosest", self.loosest, "mm"),
            ("--mtf", self.mtf, "cycles/mm"),
        ];
        for (name, value, unit) in numbers {
            if let Some(found) = value.filter(|v| !(*v > 0.0 && v.is_finite())) {
                let text = format!("{name}: found {found}; expected more than 0, in {unit}");
                return Err(CliError::Input(text));
            }
        }
        Ok(())
    }

    /// The tolerances of the lens file, or those of the class, with the compensators that are asked for.
    fn sheet(
        &self,
        opened: &LoadedLens,
        scene: &ToleranceScene,
    ) -> Result<ToleranceSheet, CliError> {
        let mut sheet = match (&opened.lens.tolerances, self.grade) {
            (Some(sheet), None) => sheet.clone(),
            (_, grade) => graded_sheet(&opened.lens, &scene.lens, grade.unwrap_or_default()),
        };
        self.compensators.iter().for_each(|own| sheet.set_compensator(*own));
        let with = Lens { tolerances: Some(sheet.clone()), ..opened.lens.clone() };
        with.check().map_err(|why| CliError::Input(format!("{}: {why}", opened.file)))?;
        Ok(sheet)
    }
}

fn tolerance_error(opened: &LoadedLens, source: &ToleranceError) -> CliError {
    let text = format!("{}: {source}", opened.file);
    match source {
        ToleranceError::MostLost { .. } | ToleranceError::Stopped => CliError::Failed(text),
        _ => CliError::Input(text),
    }
}

/// The result.
#[derive(Serialize)]
struct ToleranceReport {
    errors: usize,
    correlations: usize,
    rays: usize,
    sampling_error: f64,
    samples: usize,
    seed: u64,
    lost: usize,
    dark: usize,
    clipping: Option<[f64; 3]>,
    spots: [AsBuiltSpot; 2],
    compensators: Vec<CompensatorRow>,
    stopped: Option<StoppedLenses>,
    second_derivatives: bool,
    sensitivities: Vec<SensitivityRow>,
    groups: GroupedShares,
    #[serde(flatten)]
    further: FurtherMerits,
    loosest: Option<Vec<Tolerance>>,
    prices: Option<LoosestPrices>,
    #[serde(skip_serializing_if = "Option::is_none")]
    worst: Option<WorstLens>,
    warnings: Vec<String>,
}

/// The worst of the lenses with random errors.
#[derive(Serialize)]
struct WorstLens {
    /// Its number, counted from 0.
    number: usize,
    /// Its refocused rms spot radius in mm.
    rms: f64,
    /// The same by rays through the lens that is written.
    written_rms: Option<f64>,
}

impl WorstLens {
    fn new(made: &MadeLens) -> Self {
        Self { number: made.number, rms: made.stated_rms, written_rms: made.traced_rms }
    }
}

/// The loosest tolerances.
struct Loosest {
    sheet: ToleranceSheet,
    prices: LoosestPrices,
    warnings: Vec<String>,
}

/// The number of real lenses by which the loosest tolerances are confirmed.
const CONFIRMING: usize = 100;
/// The share of the mean square spot up to which the form and these lenses are said to agree.
const CONFIRMED: f64 = 0.05;

/// The prices of the loosest tolerances, and the yield with them.
#[derive(Serialize)]
struct LoosestPrices {
    /// The price class of each tolerance; `None` where classes say nothing.
    classes: Vec<Option<PriceClass>>,
    /// The share of good lenses with the loosest tolerances, and with each as its class has it; `None`
    /// without a limit.
    good: Option<[f64; 2]>,
    /// The refocused root mean square of lenses with random errors within these tolerances, by their
    /// rays and by the quadratic model on the same errors, in mm.
    confirmed: Option<[f64; 2]>,
}

impl Loosest {
    fn new(
        sheet: ToleranceSheet,
        form: &QuadraticForm,
        limit: Option<f64>,
        (lens, scene): (&Lens, &ToleranceScene),
    ) -> Result<Self, ToleranceError> {
        let prices = price_classes(lens, &scene.lens, &sheet.errors);
        let by_class = |(tolerance, price): (&Tolerance, &Option<(PriceClass, f64)>)| {
            let half_range = price.map_or(tolerance.half_range, |(_, half_range)| half_range);
            Tolerance { half_range, ..*tolerance }
        };
        let errors = sheet.errors.iter().zip(&prices).map(by_class).collect();
        let by_class = ToleranceSheet { errors, ..sheet.clone() };
        let good = match limit {
            Some(limit) => {
                Some([form_yield(form, &sheet, limit)?, form_yield(form, &by_class, limit)?])
            }
            None => None,
        };
        let classes = prices.into_iter().map(|price| price.map(|(class, _)| class)).collect();
        let prices = LoosestPrices { classes, good, confirmed: None };
        Ok(Self { sheet, prices, warnings: Vec::new() })
    }

    /// Confirmed by rays of lenses with these tolerances, of which `held` are not as wide as the form
    /// has them.
    fn confirmed(
        mut self,
        form: &QuadraticForm,
        scene: &ToleranceScene,
        held: usize,
        (seed, stop): (u64, &AtomicBool),
    ) -> Result<Self, ToleranceError> {
        if held > 0 {
            self.warnings.push(format!(
                "{held} of the loosest tolerances are held at ten times the commercial class, or ten \
                 times what they were: the quadratic model would have them wider"
            ));
        }
        let lenses = real_lenses(scene, &self.sheet, seed, CONFIRMING, 0, stop)?;
        let arrived: Vec<[f64; 2]> = lenses
            .iter()
            .filter_map(|lens| Some([lens.mean_square?[1], form.at(&lens.errors)]))
            .collect();
        refuse_lost_lenses(lenses.len() - arrived.len(), lenses.len(), "the loosest tolerances")?;
        if arrived.is_empty() {
            return Ok(self);
        }
        let mean =
            |i: usize| arrived.iter().map(|pair| pair[i]).sum::<f64>() / arrived.len() as f64;
        let [real, by_form] = [mean(0), mean(1)];
        self.prices.confirmed = Some([real.sqrt(), by_form.sqrt()]);
        if (real - by_form).abs() > CONFIRMED * by_form {
            self.warnings.push(format!(
                "with the loosest tolerances the mean square spot of {} lenses by their rays differs \
                 from the quadratic model by {:.0} %; the tolerances are not to be trusted so far",
                arrived.len(),
                100.0 * (real / by_form - 1.0)
            ));
        }
        Ok(self)
    }
}

/// The effect of one error.
#[derive(Serialize)]
struct SensitivityRow {
    kind: PerturbationKind,
    first: usize,
    last: usize,
    half_range: f64,
    /// A half range of power in other units.
    #[serde(skip_serializing_if = "Option::is_none")]
    power: Option<PowerUnits>,
    /// The standard deviation.
    sigma: f64,
    fixed: ShareOfGrowth,
    refocused: ShareOfGrowth,
    #[serde(flatten)]
    further: FurtherRow,
}

/// The derivatives of the mean square spot by an error, and its share of the growth of the
/// expectation.
#[derive(Serialize)]
struct ShareOfGrowth {
    #[serde(flatten)]
    by: Derivatives,
    share: f64,
}

impl ToleranceReport {
    fn new(
        arguments: &ToleranceArgs,
        (lens, scene, sheet): (&Lens, &ToleranceScene, &ToleranceSheet),
        analysis: ToleranceAnalysis,
        (loosest, mut further): (Option<Loosest>, FurtherMerits),
    ) -> Result<Self, ToleranceError> {
        let mut warnings = warnings(&analysis);
        warnings.extend(loosest.iter().flat_map(|loosest| loosest.warnings.clone()));
        warnings.extend(further.warnings(sheet));
        let (loosest, prices) = loosest.map(|l| (l.sheet.errors, l.prices)).unzip();
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
            second_derivatives: analysis.has_second_derivatives,
            sensitivities: rows(sheet, &analysis, (&shares, &mut further), &scene.lens),
            groups: GroupedShares::new(lens, sheet, &shares),
            compensators: compensator_rows(&analysis),
            stopped: analysis.stopped,
            spots: analysis.spots,
            further,
            loosest,
            prices,
            worst: None,
            warnings,
        })
    }

    fn csv(&self) -> String {
        let mut text = "kind,first,last,half_range,sigma,fixed_first,fixed_second,fixed_share,\
                        refocused_first,refocused_second,refocused_share"
            .to_owned();
        text.push_str(&self.further.csv_head());
        text.push_str("\r\n");
        for row in &self.sensitivities {
            let numbers = [&row.fixed, &row.refocused]
                .map(|part| format!("{},{},{}", part.by.first, part.by.second, part.share));
            let place = format!("{},{},{}", row.kind.name(), row.first, row.last);
            let range = format!("{},{}", row.half_range, row.sigma);
            text.push_str(&[place, range, numbers.join(",")].join(","));
            text.push_str(&row.further.csv());
            text.push_str("\r\n");
        }
        text
    }
}

/// The sensitivities, sorted by their share after refocusing.
fn rows(
    sheet: &ToleranceSheet,
    analysis: &ToleranceAnalysis,
    (shares, further): (&[[f64; 2]], &mut FurtherMerits),
    lens: &NominalLens,
) -> Vec<SensitivityRow> {
    let both = sheet.errors.iter().zip(shares.iter().copied()).enumerate();
    let mut rows: Vec<SensitivityRow> = both
        .map(|(i, (tolerance, [fixed, refocused]))| {
            let [by_fixed, by_adjusted] = analysis.forms.each_ref().map(|form| Derivatives {
                value: form.nominal,
                first: form.first[i],
                second: form.second.of(i, i),
            });
            let sigma = tolerance.deviation();
            SensitivityRow {
                kind: tolerance.error.kind,
                first: tolerance.error.first,
                last: tolerance.error.last,
                half_range: tolerance.half_range,
                power: PowerUnits::new(tolerance, lens),
                sigma,
                fixed: ShareOfGrowth { by: by_fixed, share: fixed },
                refocused: ShareOfGrowth { by: by_adjusted, share: refocused },
                further: further.row(i),
            }
        })
        .collect();
    rows.sort_by(|a, b| b.refocused.share.total_cmp(&a.refocused.share));
    rows
}

fn warnings(analysis: &ToleranceAnalysis) -> Vec<String> {
    let mut warnings = Vec::new();
    for spot in analysis.spots.iter().filter(|spot| !spot.form_agrees) {
        let [apart, error] = spot.difference.map(|v| 100.0 * v / spot.form_mean_rms);
        warnings.push(format!(
            "{}: the quadratic model differs from Monte Carlo by {apart:.2} % ± {error:.2} %; the \
             corrected numbers count",
            focus_name(spot)
        ));
    }
    warnings.extend(stop_warning(analysis.stopped));
    for spot in analysis.spots.iter().filter(|spot| !spot.rims_agree) {
        let [change, error] =
            spot.clipping.unwrap_or_default().map(|v| 100.0 * v / spot.form_mean_rms);
        warnings.push(format!(
            "{}: rims that clip change the mean rms by {change:.2} % ± {error:.2} %; the errors of the \
             means count that, the quantiles and the yield leave it out",
            focus_name(spot)
        ));
    }
    if analysis.dark > 0 {
        warnings.push(format!(
            "in {} of {} lenses with rims a field gets no light; what rims change leaves these out",
            analysis.dark, analysis.with_rims
        ));
    }
    if analysis.lost > 0 {
        warnings.push(format!(
            "{} of {} lenses lose rays and count as bad; the means leave them out",
            analysis.lost, analysis.samples
        ));
    }
    warnings
}

fn focus_name(spot: &AsBuiltSpot) -> String {
    let name = serde_json::to_value(spot.focus).unwrap_or_default();
    name.as_str().unwrap_or_default().to_owned()
}

/// The number of sensitivities in the text.
const SHOWN: usize = 20;

impl Display for ToleranceReport {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        writeln!(
            f,
            "{} manufacturing errors, {}{} rays, {} lenses by Monte Carlo; spots as rms in mm\n",
            self.errors,
            match self.correlations {
                0 => String::new(),
                1 => "1 correlation, ".to_owned(),
                count => format!("{count} correlations, "),
            },
            self.rays,
            self.samples
        )?;
        writeln!(f, "{}", self.spot_table())?;
        writeln!(f, "{}", compensator_table(&self.compensators))?;
        writeln!(f, "{}", self.sensitivity_table())?;
        write!(f, "{}", self.groups)?;
        write!(f, "{}", self.further)?;
        if let Some([fixed, refocused, light]) = self.clipping.map(|c| c.map(|v| 100.0 * v)) {
            writeln!(
                f,
                "the pupil is held; rims would change the mean square by {fixed:.2} % (refocused \
                 {refocused:.2} %) and take {light:.2} % of the light"
            )?;
        }
        if let Some((loosest, prices)) = self.loosest.as_ref().zip(self.prices.as_ref()) {
            writeln!(f, "\n{}", loosest_table(loosest, &prices.classes))?;
            if let Some([good, by_class]) = prices.good {
                let [good, by_class] = [good, by_class].map(percent);
                writeln!(f, "yield by the quadratic model: {good}; each at its class: {by_class}")?;
            }
            if let Some([real, form]) = prices.confirmed.map(|rms| rms.map(ShortNumber)) {
                writeln!(
                    f,
                    "refocused rms of {CONFIRMING} lenses with them: {real} mm by rays, {form} mm by \
                     the quadratic model"
                )?;
            }
        }
        if let Some(WorstLens { number, rms, written_rms }) = &self.worst {
            let written = written_rms.map_or_else(String::new, |written| {
                format!(", {} mm by the same rays as it is written", ShortNumber(written))
            });
            let (number, rms) = (number + 1, ShortNumber(*rms));
            writeln!(f, "worst lens: number {number}, refocused rms {rms} mm{written}")?;
        }
        self.warnings.iter().try_for_each(|warning| writeln!(f, "warning: {warning}"))
    }
}

impl ToleranceReport {
    fn spot_table(&self) -> TextTable {
        let mut table = TextTable::new(&["", "fixed focus", "refocused"]);
        let both = |of: &dyn Fn(&AsBuiltSpot) -> String| [of(&self.spots[0]), of(&self.spots[1])];
        let mut row = |name: String, of: &dyn Fn(&AsBuiltSpot) -> String| {
            let [fixed, refocused] = both(of);
            table.row([name, fixed, refocused]);
        };
        let short = |value: f64| ShortNumber(value).to_string();
        row("as designed".into(), &|s| short(s.nominal_rms));
        row("root of the expected mean square".into(), &|s| short(s.form_root_mean_square));
        row("mean, quadratic model".into(), &|s| short(s.form_mean_rms));
        row("mean, corrected by Monte Carlo".into(), &|s| with_error(s.mean_rms));
        row("Monte Carlo minus quadratic model".into(), &|s| with_error(s.difference));
        for (i, quantile) in self.spots[0].quantiles.iter().enumerate() {
            let name = format!("{:.0} % of the lenses, at most", 100.0 * quantile.share);
            row(name, &|s| short(s.quantiles[i].corrected));
        }
        if self.spots[0].good.is_some() {
            row("yield".into(), &|s| s.good.map_or(String::new(), |g| percent(g.corrected)));
            row("yield by Monte Carlo, 95 % interval".into(), &|s| {
                let ends = s.good.map_or([0.0; 2], |g| g.interval);
                format!("{} to {}", percent(ends[0]), percent(ends[1]))
            });
        }
        table
    }

    fn sensitivity_table(&self) -> TextTable {
        let mut head = vec!["error", "surfaces", "half range", "share fixed", "share refocused"];
        head.extend(self.further.heads());
        let mut table = TextTable::new(&head);
        for row in self.sensitivities.iter().take(SHOWN) {
            let own = [
                row.kind.name().to_owned(),
                surfaces(row.first, row.last),
                row.power.map_or_else(
                    || half_range(row.kind, row.half_range),
                    |power| power.to_string(),
                ),
                percent(row.fixed.share),
                percent(row.refocused.share),
            ];
            table.row(own.into_iter().chain(row.further.cells()));
        }
        let more = self.sensitivities.len().saturating_sub(SHOWN);
        if more > 0 {
            let rest = |of: fn(&SensitivityRow) -> f64| {
                self.sensitivities[SHOWN..].iter().map(of).sum::<f64>()
            };
            let shares = [rest(|row| row.fixed.share), rest(|row| row.refocused.share)];
            let [fixed, refocused] = shares.map(percent);
            let own = [format!("{more} more"), String::new(), String::new(), fixed, refocused];
            let none = self.further.heads().into_iter().map(|_| String::new());
            table.row(own.into_iter().chain(none));
        }
        table
    }
}

/// A share in percent, without the sign of a number that rounds to 0.
fn percent(share: f64) -> String {
    let rounded = (1e3 * share).round() / 10.0 + 0.0;
    format!("{rounded:.1} %")
}

fn with_error([value, error]: [f64; 2]) -> String {
    format!("{} ± {error:.1e}", ShortNumber(value))
}

fn surfaces(first: usize, last: usize) -> String {
    let number = SurfaceNumber::new;
    if first == last {
        number(first).to_string()
    } else {
        format!("{}-{}", number(first), number(last))
    }
}

/// A half range with its unit; angles in minutes of arc.
fn half_range(kind: PerturbationKind, value: f64) -> String {
    let unit = match kind {
        _ if kind.is_angle() => return format!("{}'", ShortNumber(60.0 * value.to_degrees())),
        PerturbationKind::Abbe => return format!("{} %", ShortNumber(100.0 * value)),
        PerturbationKind::Curvature => " /mm",
        PerturbationKind::Conic | PerturbationKind::Asphere | PerturbationKind::Index => "",
        _ => " mm",
    };
    format!("{}{unit}", ShortNumber(value))
}

fn loosest_table(tolerances: &[Tolerance], classes: &[Option<PriceClass>]) -> TextTable {
    let mut table = TextTable::new(&["loosest tolerances", "surfaces", "half range", "class"]);
    for (Tolerance { error, half_range: range, .. }, class) in tolerances.iter().zip(classes) {
        table.row([
            error.kind.name().to_owned(),
            surfaces(error.first, error.last),
            half_range(error.kind, *range),
            class.map_or("", PriceClass::name).to_owned(),
        ]);
    }
    table
}
