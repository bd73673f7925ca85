//! Figure 4.1: a test whether gradient descents that a random clock terminates sample the target
//! density.
//!
//! One thin singlet with its distance from the sensor, and two with both distances. Independent
//! chains of complete descents are compared with the target, weighted by time and by count, with
//! the exact rate of regenerations (4.11) and with approximate ones. The exact rate samples the
//! target if its samples are weighted by time. The approximate rate (4.16), for which the figure
//! claims the same, does not: neither with uniform regenerations nor with those from a reservoir of
//! the best, for which it was designed. It comes close, to a few hundredths in total variation,
//! only with `C` about 1 and regenerations drawn from the target itself.

use super::histogram::{HistogramGrid, deviation_in_sigmas, pool, total_variation};
use super::{
    Claim, DataTable, Effort, Experiment, ExperimentError, ExperimentOutcome, ExperimentResult,
    NamedPlot, ProgressFn, TableCell, report_progress,
};
use crate::plot::{Axis, BLACK, Canvas, Chart, Legend, PALETTE, Stroke, TextAlign, gray_level};
use crate::search::competing_clocks::{CompetingClocks, Regeneration, RegenerationRate};
use crate::search::toy::ToyLandscape;
use crate::search::{Landscape as _, Random, Temperature};
use rand::SeedableRng as _;
use rayon::prelude::*;

pub(super) const EXPERIMENT: Experiment = Experiment {
    id: "4.1",
    title: "A test of the sampling by RESTORE, on a toy problem of one and of two singlets",
    claim: "Weighted by time, it samples its target with the exact rate, not with the printed one",
    omits: "nothing of the figure",
    seconds: 10.0,
    run,
};

/// The temperature, in mm².
const TEMPERATURE: f64 = 4.0;
/// The number of bins in each direction, for one singlet and for two.
const BINS: [usize; 2] = [20, 8];
/// The number of independent chains, and of descents in each.
const CHAINS: usize = 1500;
const FEW_CHAINS: usize = 400;
const DESCENTS: usize = 200;
const FEW_DESCENTS: usize = 100;
/// The maximum length of a chain: with a rate of 0 a descent would never end.
const LONGEST: usize = 100_000;
/// `C` of (4.11), so large that the rate is positive everywhere, for one singlet and for two.
const EXACT: [f64; 2] = [6.0, 3000.0];
/// `C` of (4.16); the thesis gives none.
const PRINTED: [f64; 2] = [0.1, 1.0];
/// The regeneration (4.14) with the parameters of the searches.
const RESERVOIR: Regeneration = Regeneration::Reservoir { gamma: 0.02, size: 5 };
/// The deviation that one in a thousand tests of correct samples exceeds, in standard deviations.
const LIKELY: f64 = 3.1;
/// A deviation that tests of correct samples never reach: one in three million.
const UNLIKELY: f64 = 5.0;

/// A process under test.
#[derive(Debug, Clone, Copy)]
struct SamplingProcess {
    rate: RegenerationRate,
    regeneration: Regeneration,
}

impl SamplingProcess {
    /// All processes for a number of singlets, the exact one first and that of the thesis last.
    fn all(singlets: usize) -> Vec<Self> {
        let exact = EXACT[singlets - 1];
        let [low, high] = PRINTED.map(RegenerationRate::AsPrinted);
        let draw = Regeneration::Draw;
        let list = [
            (RegenerationRate::Exact(exact), draw),
            (RegenerationRate::WithoutDeterminant(exact), draw),
            (low, draw),
            (high, draw),
            (low, Regeneration::Target),
            (high, Regeneration::Target),
            (RegenerationRate::PreviousStep(PRINTED[1]), RESERVOIR),
            (low, RESERVOIR),
            (high, RESERVOIR),
        ];
        list.map(|(rate, regeneration)| Self { rate, regeneration }).to_vec()
    }

    fn is_printed(self) -> bool {
        matches!(self.rate, RegenerationRate::AsPrinted(_) | RegenerationRate::PreviousStep(_))
    }

    /// The name of the rate, and `C`.
    fn rate(self) -> (&'static str, f64) {
        match self.rate {
            RegenerationRate::Exact(c) => ("exact (4.11)", c),
            RegenerationRate::WithoutDeterminant(c) => ("no determinant (4.13)", c),
            RegenerationRate::AsPrinted(c) => ("printed (4.16)", c),
            RegenerationRate::PreviousStep(c) => ("printed, of the step before", c),
        }
    }

    fn regeneration(self) -> &'static str {
        match self.regeneration {
            Regeneration::Draw => "anywhere",
            Regeneration::Target => "target",
            Regeneration::Reservoir { .. } => "reservoir",
        }
    }
}

/// A toy problem, its bins, and their probabilities under the target.
#[derive(Debug)]
struct ToyStudy {
    singlets: usize,
    toy: ToyLandscape,
    temperature: Temperature,
    grid: HistogramGrid,
    target: Vec<f64>,
}

impl ToyStudy {
    fn new(singlets: usize) -> ExperimentResult<Self> {
        let toy =
            if singlets == 1 { ToyLandscape::one_singlet() } else { ToyLandscape::two_singlets() };
        let cold = || ExperimentError::Failed(format!("{TEMPERATURE} is no valid temperature"));
        let temperature = Temperature::new(TEMPERATURE).ok_or_else(cold)?;
        let grid = HistogramGrid { ranges: toy.ranges(singlets), bins: BINS[singlets - 1] };
        let target = grid.bin_shares(|point| temperature.density(toy.loss(point)));
        Ok(Self { singlets, toy, temperature, grid, target })
    }

    /// Samples independent chains of several descents each.
    fn sample(
        &self,
        process: SamplingProcess,
        [chains, descents]: [usize; 2],
    ) -> ExperimentResult<ProcessSamples> {
        let chain = |seed: usize| self.chain(process, seed as u64, descents);
        let chains: ExperimentResult<Vec<ChainHistogram>> =
            (0..chains).into_par_iter().map(chain).collect();
        let chains = chains?;
        let times: Vec<Vec<f64>> = chains.iter().map(|chain| chain.times.clone()).collect();
        let counts: Vec<Vec<f64>> = chains.iter().map(|chain| chain.counts.clone()).collect();
        Ok(ProcessSamples {
            process,
            steps: chains.iter().map(|chain| chain.steps).sum(),
            clamped: chains.iter().map(|chain| chain.clamped).sum(),
            by_time: TargetComparison::new(&times, &self.target),
            by_count: TargetComparison::new(&counts, &self.target),
        })
    }

    fn chain(
        &self,
        process: SamplingProcess,
        seed: u64,
        descents: usize,
    ) -> ExperimentResult<ChainHistogram> {
        let random = Random::seed_from_u64(seed);
        let SamplingProcess { rate, regeneration } = process;
        let clocks = CompetingClocks::new(&self.toy, self.temperature, rate, regeneration, random);
        let mut clocks = clocks?;
        let nothing = || vec![0.0; self.grid.bin_count()];
        let mut chain =
            ChainHistogram { times: nothing(), counts: nothing(), steps: 0, clamped: 0 };
        let mut ended = 0;
        for sample in clocks.by_ref().take(LONGEST) {
            let bin = self.grid.bin(&sample.point);
            chain.times[bin] += sample.weight;
            chain.counts[bin] += 1.0;
            chain.steps += 1;
            ended += usize::from(sample.regenerates);
            if ended == descents {
                break;
            }
        }
        chain.clamped = clocks.clipped_rates();
        Ok(chain)
    }
}

/// The time and the counts of a chain in each bin.
#[derive(Debug)]
struct ChainHistogram {
    times: Vec<f64>,
    counts: Vec<f64>,
    steps: usize,
    clamped: u64,
}

/// The samples of all chains of a process.
#[derive(Debug)]
struct ProcessSamples {
    process: SamplingProcess,
    steps: usize,
    /// The number of clipped negative rates.
    clamped: u64,
    by_time: TargetComparison,
    by_count: TargetComparison,
}

/// The comparison of samples with the target.
#[derive(Debug)]
struct TargetComparison {
    shares: Vec<f64>,
    /// The deviation from the target, in standard deviations.
    sigmas: f64,
    /// The total variation distance from the target.
    distance: f64,
}

impl TargetComparison {
    fn new(chains: &[Vec<f64>], target: &[f64]) -> Self {
        let shares = pool(chains);
        let distance = total_variation(&shares, target);
        Self { sigmas: deviation_in_sigmas(chains, target), distance, shares }
    }
}

fn run(effort: Effort, progress: &mut ProgressFn<'_>) -> ExperimentResult {
    let work = effort.select([CHAINS, DESCENTS], [FEW_CHAINS, FEW_DESCENTS]);
    let mut outcome = ExperimentOutcome::default();
    let mut table = DataTable::new("processes", &COLUMNS);
    for singlets in [1, 2] {
        let study = ToyStudy::new(singlets)?;
        let processes = SamplingProcess::all(singlets);
        let mut found = Vec::new();
        for (i, process) in processes.iter().enumerate() {
            let done = 0.5 * (singlets as f64 - 1.0 + i as f64 / processes.len() as f64);
            report_progress(progress, done, process.rate().0)?;
            let sampled = study.sample(*process, work)?;
            table.push_row(row(singlets, &sampled));
            // One paraxial ray per step.
            outcome.rays += sampled.steps;
            found.push(sampled);
        }
        outcome.claims.extend(claims(&study, &found));
        outcome.tables.push(histogram(&study, &found));
        let canvas = if singlets == 1 { curves(&study, &found) } else { maps(&study, &found) };
        let name = if singlets == 1 { "one_singlet" } else { "two_singlets" };
        outcome.pictures.push(NamedPlot { name, canvas });
    }
    outcome.tables.insert(0, table);
    Ok(outcome)
}

const COLUMNS: [&str; 10] = [
    "singlets",
    "rate",
    "constant",
    "regenerations",
    "steps",
    "negative_rates",
    "surprise_by_time",
    "distance_by_time",
    "surprise_by_count",
    "distance_by_count",
];

fn row(singlets: usize, sampled: &ProcessSamples) -> Vec<TableCell> {
    let ProcessSamples { process, steps, clamped, by_time, by_count } = sampled;
    let (rate, constant) = process.rate();
    let mut cells: Vec<TableCell> = vec![
        singlets.into(),
        rate.into(),
        constant.into(),
        process.regeneration().into(),
        (*steps).into(),
        (*clamped as f64).into(),
    ];
    for judged in [by_time, by_count] {
        cells.extend([judged.sigmas.into(), judged.distance.into()]);
    }
    cells
}

fn claims(study: &ToyStudy, found: &[ProcessSamples]) -> Vec<Claim> {
    let says = |what: &str| format!("{} singlets: {what}", study.singlets);
    let exact = &found[0];
    let printed = found.iter().filter(|sampled| sampled.process.is_printed());
    let least = |values: &mut dyn Iterator<Item = f64>| values.fold(f64::INFINITY, f64::min);
    let deviation = least(&mut printed.clone().map(|sampled| sampled.by_time.sigmas));
    let reservoir = printed.filter(|sampled| sampled.process.regeneration == RESERVOIR);
    let distance = least(&mut reservoir.map(|sampled| sampled.by_time.distance));
    vec![
        Claim::exactly(says("exact rate, steps with a negative rate"), exact.clamped as f64, 0.0),
        Claim::at_most(says("exact rate, deviation by time"), exact.by_time.sigmas, LIKELY),
        Claim::at_least(says("exact rate, deviation by count"), exact.by_count.sigmas, UNLIKELY),
        Claim::at_least(
            says("without the determinant, deviation by time"),
            found[1].by_time.sigmas,
            UNLIKELY,
        ),
        Claim::at_least(says("printed rate, smallest deviation by time"), deviation, UNLIKELY),
        Claim::at_least(
            says("printed rate, reservoir: smallest total variation by time"),
            distance,
            0.2,
        ),
    ]
}

/// The histograms in the plots: the target, and three samplings of it.
fn plotted_histograms<'a>(
    study: &'a ToyStudy,
    found: &'a [ProcessSamples],
) -> [(&'static str, &'a [f64]); 4] {
    let printed = &found[found.len() - 1];
    [
        ("target", &study.target),
        ("exact rate, by time", &found[0].by_time.shares),
        ("exact rate, by count", &found[0].by_count.shares),
        ("printed rate, reservoir, by time", &printed.by_time.shares),
    ]
}

fn histogram(study: &ToyStudy, found: &[ProcessSamples]) -> DataTable {
    let shares = ["target", "exact_by_time", "exact_by_count", "printed_by_time"];
    let places: &[&str] = if study.singlets == 1 { &["gap_mm"] } else { &["gap_mm", "back_mm"] };
    let name = if study.singlets == 1 { "one_singlet" } else { "two_singlets" };
    let mut table = DataTable::new(name, &[places, &shares].concat());
    let shown = plotted_histograms(study, found);
    for bin in 0..study.grid.bin_count() {
        let shares = shown.iter().map(|(_, shares)| shares[bin]);
        table.push_row(study.grid.bin_center(bin).into_iter().chain(shares).map(Into::into));
    }
    table
}

fn curves(study: &ToyStudy, found: &[ProcessSamples]) -> Canvas {
    let mut canvas = Canvas::new([1000, 760]);
    let shown = plotted_histograms(study, found);
    let x = Axis::linear("distance from the sensor, mm", study.toy.alone);
    let shares = shown.iter().flat_map(|(_, shares)| shares.iter().copied());
    let chart =
        Chart::new([130.0, 170.0], [940.0, 640.0], x, Axis::linear("", shares.chain([0.0])));
    chart.draw(&mut canvas, "probability of each bin");
    let mut legend = Legend::new([130.0, 20.0]);
    for (i, (name, shares)) in shown.into_iter().enumerate() {
        let color = if i == 0 { BLACK } else { PALETTE[i - 1] };
        let stroke = if i == 0 { Stroke::Solid } else { Stroke::Dashed };
        let place = |bin: usize| [study.grid.bin_center(bin)[0], shares[bin]];
        let points: Vec<[f64; 2]> = (0..shares.len()).map(place).collect();
        canvas.curve(&chart.to_pixels(&points), color, stroke);
        legend.curve(&mut canvas, name, color, stroke);
    }
    canvas
}

fn maps(study: &ToyStudy, found: &[ProcessSamples]) -> Canvas {
    let cell = 48;
    let size = (cell * study.grid.bins) as f64;
    let [gap, back] = study.toy.pair;
    let mut canvas = Canvas::new([2 * (size as u32 + 80), 2 * (size as u32 + 80)]);
    let darkest = study.target.iter().copied().fold(0.0, f64::max);
    for (i, (name, shares)) in plotted_histograms(study, found).into_iter().enumerate() {
        let corner = [i % 2, i / 2].map(|k| 40.0 + k as f64 * (size + 80.0));
        canvas.text([corner[0], corner[1] - 24.0], name, BLACK, TextAlign::Left);
        let tones: Vec<_> = shares.iter().map(|share| gray_level(1.0 - share / darkest)).collect();
        canvas.raster(corner, study.grid.bins, cell, &tones);
        let ends = format!("gap {} to {} mm, down {} to {} mm", gap[0], gap[1], back[0], back[1]);
        canvas.text([corner[0], corner[1] + size + 6.0], &ends, BLACK, TextAlign::Left);
    }
    canvas
}
