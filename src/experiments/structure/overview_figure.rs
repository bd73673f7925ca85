//! From a lens of 1962 towards one of 1980: a search for the progress of two decades of lens
//! design.
//!
//! The start is the 50 mm double Gauss by Nippon Kogaku (US 3,560,079) with its rims opened as far
//! as its surfaces allow; the reference is the 50 mm f/1.2 by Canon (US 4,364,644), with one more
//! element and an asphere. All are evaluated alike: one colour, four image heights, the RMS radius
//! of each spot about its centroid, the clear area of each pupil. The search asks for sharp spots
//! with as much light at every field as the reference has.

use super::recorded_search::{RecordedSearch, run_to_end};
use super::{at_heights, rules};
use crate::experiments::section::SectionPlot;
use crate::experiments::sharpness_vs_light::ProgressSpan;
use crate::experiments::{
    Claim, DataTable, Effort, Experiment, ExperimentOutcome, ExperimentResult, NamedPlot,
    ProgressFn, TableCell,
};
use crate::lens::Lens;
use crate::plot::{Axis, BLACK, Canvas, Chart, PALETTE, TextAlign};
use crate::pupil::RayModel;
use crate::search::lens_landscape::{LensSummary, SearchPlan, with_open_apertures};
use crate::search::{SearchMethod, SearchRules, SearchSettings};

pub(in crate::experiments) const EXPERIMENT: Experiment = Experiment {
    id: "teaser",
    title: "From a double Gauss of 1962 towards one of 1980",
    claim: "A search finds a spherical lens as bright as the later design, and sharper",
    omits: "the rendered images",
    seconds: 600.0,
    run,
};

/// The semi-diameter up to which rims are opened at the start, in mm.
const OPENED: f64 = 20.0;
/// The maximum semi-diameter, that of the reference, in mm.
const WIDEST: f64 = 26.0;
/// The light asked for, relative to the reference: a penalty does not reach its target exactly.
const MORE: f64 = 1.02;
/// The relative accuracy of the numbers.
const EVALUATION_TOLERANCE: f64 = 1e-4;

fn run(effort: Effort, progress: &mut ProgressFn<'_>) -> ExperimentResult {
    let own = at_heights("double_gauss_nikkor_s_50")?;
    let start = with_open_apertures(&own, OPENED);
    let mark = OverviewLens::of("reference, 1980", at_heights("double_gauss_canon_fd50_f12")?)?;
    let before = OverviewLens::of("start, opened", start.clone())?;
    let shares = mark.lights().zip(before.lights()).map(|(mark, before)| MORE * mark / before);
    let plan = plan(shares.collect(), effort.select(560_000, 400));
    let mut found = vec![RecordedSearch::new(&start, &plan)?];
    let part = ProgressSpan { from: 0.0, to: 1.0, name: "search" };
    run_to_end(&mut found, part, progress)?;
    let best = OverviewLens::of("found", found[0].run.best().point.as_ref().clone())?;
    let designs = [OverviewLens::of("start, 1962", own)?, before, best, mark];
    let mut outcome = ExperimentOutcome {
        claims: claims(&designs, &found[0], effort),
        ..ExperimentOutcome::default()
    };
    outcome.rays = found[0].rays() + designs.iter().map(|d| d.figures.rays()).sum::<usize>();
    outcome.tables.push(table(&designs));
    outcome.tables.push(search(&found[0]));
    outcome.pictures.push(NamedPlot { name: "lenses", canvas: draw(&designs)? });
    outcome.lenses.push(("found".to_owned(), designs[2].lens.clone()));
    Ok(outcome)
}

/// The search, with the default number of chains.
fn plan(shares: Vec<f64>, gradients: u64) -> SearchPlan {
    let rules = SearchRules { semi_diameter: Some(WIDEST), ..rules() };
    let default = SearchPlan::default();
    let (method, gradients) = (SearchMethod::Restore, Some(gradients));
    let settings = SearchSettings { method, gradients, ..default.settings };
    SearchPlan { light: shares, rules, settings, ..default }
}

/// A lens with its numbers.
struct OverviewLens {
    name: &'static str,
    lens: Lens,
    figures: LensSummary,
}

impl OverviewLens {
    fn of(name: &'static str, lens: Lens) -> ExperimentResult<Self> {
        let figures = LensSummary::new(&lens, EVALUATION_TOLERANCE)?;
        Ok(Self { name, lens, figures })
    }

    /// The area of every pupil, in mm².
    fn lights(&self) -> impl Iterator<Item = f64> {
        self.figures.fields.iter().map(|field| field.light.value)
    }

    /// The mean area of the pupils, in mm².
    fn light(&self) -> f64 {
        self.lights().sum::<f64>() / self.figures.fields.len() as f64
    }

    /// The RMS spot radius over all fields in mm; infinite if a field has no light.
    fn spot(&self) -> f64 {
        let fields = &self.figures.fields;
        let square = |spot: Option<crate::analysis::Estimate>| {
            spot.map_or(f64::INFINITY, |spot| spot.value * spot.value)
        };
        (fields.iter().map(|field| square(field.spot)).sum::<f64>() / fields.len() as f64).sqrt()
    }
}

fn claims(
    [_, before, found, mark]: &[OverviewLens; 4],
    search: &RecordedSearch,
    effort: Effort,
) -> Vec<Claim> {
    let um = |design: &OverviewLens| 1e3 * design.spot();
    let merits = [search.run.best().loss, search.start()];
    let says = "merit of the lens found, against half of that of the start";
    let mut claims = vec![Claim::at_most(says, merits[0], 0.5 * merits[1]).in_unit("mm^2")];
    // A test is too short for more.
    if effort == Effort::Full {
        let sharper = format!("blur of the lens found, against that of `{}`", before.name);
        claims.push(Claim::at_most(sharper, um(found), um(before)).in_unit("um"));
        let brighter = "mean light of the lens found, against that of the reference";
        claims.push(Claim::at_least(brighter, found.light(), mark.light()).in_unit("mm^2"));
        let sharper = "blur of the lens found, against that of the reference";
        claims.push(Claim::at_most(sharper, um(found), um(mark)).in_unit("um"));
    }
    claims
}

fn table(designs: &[OverviewLens]) -> DataTable {
    let columns = [
        "design",
        "elements",
        "focal_length_mm",
        "track_mm",
        "field_deg",
        "rms_mm",
        "rms_error_mm",
        "area_mm2",
        "area_error_mm2",
    ];
    let mut table = DataTable::new("designs", &columns);
    for OverviewLens { name, figures, .. } in designs {
        for field in &figures.fields {
            let focal = figures.focal_lengths[0].unwrap_or(f64::NAN);
            let spot = field.spot.map_or([f64::NAN; 2], |spot| [spot.value, spot.error]);
            let whole = [figures.elements as f64, focal, figures.track, field.y];
            let light = [field.light.value, field.light.error];
            let numbers = whole.into_iter().chain(spot).chain(light);
            table.push_row(std::iter::once((*name).into()).chain(numbers.map(TableCell::from)));
        }
    }
    table
}

/// The best merit during the search.
fn search(search: &RecordedSearch) -> DataTable {
    let mut table = DataTable::new("course", &["gradients", "best"]);
    let mut last = f64::INFINITY;
    for mark in &search.marks {
        if mark.best < last {
            last = mark.best;
            table.push_row([mark.gradients as f64, mark.best].map(TableCell::from));
        }
    }
    table
}

/// Draws every lens with its rays and its numbers.
fn draw(designs: &[OverviewLens]) -> ExperimentResult<Canvas> {
    let mut canvas = Canvas::new([1340, 60 + 330 * designs.len() as u32]);
    for (i, design) in designs.iter().enumerate() {
        draw_design(&mut canvas, design, 60.0 + 330.0 * i as f64)?;
    }
    Ok(canvas)
}

fn draw_design(canvas: &mut Canvas, design: &OverviewLens, top: f64) -> ExperimentResult<()> {
    let model = RayModel::from_lens(&design.lens, 0)?;
    let section = SectionPlot::new(&model.channels[0].system);
    let [z, y] = section.extent();
    let (x, y) = (Axis::linear("", z), Axis::linear("", y));
    let chart = Chart::new([60.0, top], [760.0, top + 260.0], x, y).with_equal_scales();
    let (name, figures) = (design.name, &design.figures);
    // The font of plots has no bar.
    let topology = figures.topology.replace('|', "-");
    let title = format!("{name}: {} elements, {topology}", figures.elements);
    canvas.text([60.0, top - 30.0], &title, BLACK, TextAlign::Left);
    for (i, field) in model.fields.iter().enumerate() {
        let launch = model.launch(*field, model.primary)?;
        let color = PALETTE[i % PALETTE.len()];
        for ray in -2..=2 {
            section.draw_ray(canvas, &chart, &launch, [0.0, 0.45 * f64::from(ray)], color);
        }
        let numbers = &figures.fields[i];
        let spot = numbers.spot.map_or(f64::NAN, |spot| 1e3 * spot.value);
        let light = numbers.light.value;
        let text = format!("{:.1} deg: {spot:.0} um rms, {light:.0} mm^2", numbers.y);
        canvas.text([840.0, top + 40.0 + 34.0 * i as f64], &text, color, TextAlign::Left);
    }
    let all = format!("all: {:.0} um rms, {:.0} mm^2", 1e3 * design.spot(), design.light());
    canvas.text([840.0, top + 190.0], &all, BLACK, TextAlign::Left);
    section.draw(canvas, &chart);
    Ok(())
}
