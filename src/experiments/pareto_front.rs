//! Figure 3.6: sharpness against light. A lens is optimized with increasing weight on its light by
//! unbiased derivatives, which include the motion of the pupils, and by biased ones. For the latter
//! the light has no derivative: all weights are equivalent, and an aperture has to be chosen
//! beforehand.
//!
//! Both are compared by their hypervolume in the plane of blur and light, and by dominance among
//! designs with at least half of the light of the starting lens. With less light sharpness is
//! cheap: with the smallest aperture the biased search leaves the last field of the second lens
//! nearly dark and finds a lens that is sharper than any of the front. For the double Gauss of the
//! thesis, three designs are added that its authors' program reaches from the same start in 1,000
//! steps, evaluated here by the areas and spots of two-dimensional pupils.

use super::section::SectionPlot;
use super::sharpness_vs_light::{
    self, FieldView, ProgressSpan, WeightSweep, field_views, run_sweep, with_field_angles,
    with_scaled_aperture,
};
use super::{
    Claim, Effort, Experiment, ExperimentOutcome, ExperimentResult, NamedPlot, ProgressFn, lens,
};
use crate::lens::Lens;
use crate::optimize::pareto::{Front, ParetoPoint};
use crate::plot::{Axis, BLACK, Canvas, Chart, Color, GREY, Legend, PALETTE, Stroke, TextAlign};
use crate::pupil::{PupilPattern, RayModel, pattern_points};

pub(super) const EXPERIMENT: Experiment = Experiment {
    id: "3.6",
    title: "Sharpness against light of two double Gauss lenses",
    claim: "Unbiased gradients give a front of designs that dominates those of biased gradients",
    omits: "the designs of DiffOptics and OpticStudio, for which biased derivatives stand; the \
            simulated images of the test target",
    seconds: 35.0,
    run,
};

/// The field angles, in degrees.
pub(super) const ANGLES: [f64; 3] = [0.0, 10.0, 20.0];
/// The apertures chosen for the biased searches, relative to the start.
const OPENINGS: [f64; 5] = [0.6, 0.8, 1.0, 1.2, 1.3];
const ONE_OPENING: [f64; 1] = [1.0];
/// The minimum light of a design that is compared, relative to the starting lens.
const MIN_LIGHT: f64 = 0.5;

/// Name, RMS spot radii in um and pupil areas in mm² at the three fields.
type PublishedValues = (&'static str, [f64; 3], [f64; 3]);

/// The results of the authors' program for `double_gauss_rudolph_50` at three β in mm².
const PUBLISHED: [PublishedValues; 3] = [
    ("authors, beta 0", [14.0, 18.0, 41.0], [90.9, 87.9, 64.3]),
    ("authors, beta 2e-4", [17.0, 19.0, 41.0], [92.0, 90.3, 66.3]),
    ("authors, beta 5e-4", [23.0, 19.0, 43.0], [93.9, 93.1, 70.3]),
];

/// The sweep that finds the designs of a front.
fn plan(effort: Effort) -> WeightSweep {
    WeightSweep::new(4.0, effort.select(14, 8), 1200)
}

fn run(effort: Effort, progress: &mut ProgressFn<'_>) -> ExperimentResult {
    let mut outcome = ExperimentOutcome::default();
    let lenses = [
        ("rudolph", "double_gauss_rudolph_50", PUBLISHED.as_slice()),
        ("nikkor", "double_gauss_nikkor_s_50", &[]),
    ];
    let count = effort.select(lenses.len(), 1);
    for (i, (name, file, authors)) in lenses.into_iter().take(count).enumerate() {
        let start = with_field_angles(lens(file)?, &ANGLES);
        let span = [i, i + 1].map(|part| part as f64 / count as f64);
        let study = FrontStudy::of(&start, effort, span, progress)?;
        outcome.claims.extend(study.claims(name, authors, &mut outcome.rays)?);
        outcome.tables.push(sharpness_vs_light::table(name, &study.designs(), &mut outcome.rays)?);
        outcome.lenses.extend(study.lenses(name));
        outcome.pictures.push(NamedPlot { name, canvas: study.draw(name, authors)? });
    }
    Ok(outcome)
}

/// The designs of one lens.
struct FrontStudy {
    start: ParetoPoint,
    unbiased: Front,
    biased: Front,
}

impl FrontStudy {
    fn of(
        start: &Lens,
        effort: Effort,
        [from, to]: [f64; 2],
        progress: &mut ProgressFn<'_>,
    ) -> ExperimentResult<Self> {
        let openings = effort.select(OPENINGS.as_slice(), &ONE_OPENING);
        let plan = plan(effort).and_back();
        let middle = from + 0.6 * (to - from);
        let part = ProgressSpan { from, to: middle, name: "unbiased gradient" };
        let found = run_sweep(start, &plan, part, progress)?;
        let start_design = found[0].clone();
        let unbiased = front(found);
        let mut biased = Vec::new();
        let share = (to - middle) / openings.len() as f64;
        for (i, opening) in openings.iter().enumerate() {
            let from = middle + share * i as f64;
            let name = format!("biased gradient, opened {opening}");
            let part = ProgressSpan { from, to: from + share, name: &name };
            let found =
                run_sweep(&with_scaled_aperture(start, *opening), &plan.biased(), part, progress)?;
            biased.extend(found.into_iter().next_back());
        }
        Ok(Self { start: start_design, unbiased, biased: front(biased) })
    }

    fn designs(&self) -> Vec<(&'static str, &ParetoPoint)> {
        let unbiased = self.unbiased.points().iter().map(|design| ("unbiased", design));
        let biased = self.biased.points().iter().map(|design| ("biased", design));
        std::iter::once(("start", &self.start)).chain(unbiased).chain(biased).collect()
    }

    /// The designs of the unbiased front, named by their weights.
    fn lenses(&self, name: &str) -> impl Iterator<Item = (String, Lens)> {
        let weighted = self.unbiased.points().iter();
        weighted
            .filter_map(move |d| Some((format!("{name}-beta-{:.1e}", d.weight?), d.lens.clone())))
    }

    fn claims(
        &self,
        name: &str,
        authors: &[PublishedValues],
        rays: &mut usize,
    ) -> ExperimentResult<Vec<Claim>> {
        let Self { start, unbiased, biased } = self;
        let [front, other] = [unbiased, biased].map(|front| front.relative_hypervolume(start));
        let is_dominated =
            |design: &&ParetoPoint| unbiased.points().iter().any(|u| u.dominates(design));
        let lit = biased.points().iter().filter(|design| design.light >= MIN_LIGHT * start.light);
        let left = lit.filter(|design| !is_dominated(design)).count();
        let mut claims = vec![
            Claim::at_least(
                format!(
                    "{name}: hypervolume of the unbiased front, against that of the biased one"
                ),
                front,
                other,
            ),
            Claim::at_most(
                format!(
                    "{name}: biased designs with half the light that no unbiased one dominates"
                ),
                left as f64,
                0.0,
            ),
        ];
        if authors.is_empty() {
            return Ok(claims);
        }
        let all = unbiased.points().iter().map(|design| field_views(&design.lens, rays));
        let all = all.collect::<ExperimentResult<Vec<_>>>()?;
        for theirs in authors {
            let better = all.iter().filter(|views| dominates_published(views, theirs)).count();
            let says = format!("{name}: designs better than `{}` at every field", theirs.0);
            claims.push(Claim::at_least(says, better as f64, 1.0));
        }
        Ok(claims)
    }

    /// Draws the plane of blur and light, and the lenses at the ends of the front with their spots.
    fn draw(&self, name: &str, authors: &[PublishedValues]) -> ExperimentResult<Canvas> {
        let sets = [
            ("start", design_points([&self.start]), BLACK),
            ("biased gradient", design_points(self.biased.points()), PALETTE[1]),
            ("unbiased gradient", design_points(self.unbiased.points()), PALETTE[0]),
            ("the authors' program", authors.iter().map(published_means).collect(), GREY),
        ];
        let front = self.unbiased.points();
        let shown = [
            ("sharpest", front.first()),
            ("brightest", front.last()),
            ("biased, sharpest", self.biased.points().first()),
        ];
        draw_fronts(1900, name, &sets, shown)
    }
}

/// Points in the plane of blur and light, with their name and colour.
pub(super) type DesignSet<'a> = (&'a str, Vec<[f64; 2]>, Color);

/// Blur in um and light in mm² of designs.
pub(super) fn design_points<'a>(
    designs: impl IntoIterator<Item = &'a ParetoPoint>,
) -> Vec<[f64; 2]> {
    designs.into_iter().map(|design| [1e3 * design.spot, design.light]).collect()
}

/// Draws the plane of blur and light, and some lenses with their spots beside it.
pub(super) fn draw_fronts(
    width: u32,
    title: &str,
    sets: &[DesignSet<'_>],
    shown: [(&str, Option<&ParetoPoint>); 3],
) -> ExperimentResult<Canvas> {
    let mut canvas = Canvas::new([width, 1000]);
    let all = || sets.iter().flat_map(|(_, points, _)| points);
    let x = Axis::linear("blur (rms), um", all().map(|p| p[0]).chain([0.0]));
    let y = Axis::linear("area of the pupil, mm^2", all().map(|p| p[1]).chain([0.0]));
    let chart = Chart::new([120.0, 200.0], [840.0, 880.0], x, y);
    chart.draw(&mut canvas, title);
    let mut legend = Legend::new([130.0, 20.0]);
    for (label, points, color) in sets.iter().filter(|(_, points, _)| !points.is_empty()) {
        legend.marker(&mut canvas, label, *color);
        canvas.markers(&chart.to_pixels(points), *color);
    }
    for (i, (name, design)) in shown.into_iter().enumerate() {
        if let Some(design) = design {
            draw_lens_and_spots(&mut canvas, name, &design.lens, 90.0 + 310.0 * i as f64)?;
        }
    }
    Ok(canvas)
}

/// The front of some designs.
fn front(designs: Vec<ParetoPoint>) -> Front {
    let mut front = Front::default();
    designs.into_iter().for_each(|design| {
        front.insert(design);
    });
    front
}

/// True if every field is at least as sharp and as bright as that published.
fn dominates_published(views: &[FieldView], (_, rms, area): &PublishedValues) -> bool {
    let fields = views.iter().zip(rms).zip(area);
    views.len() == rms.len()
        && fields.into_iter().all(|((view, rms), area)| {
            1e3 * (view.rms[0] + view.rms[1]) <= *rms && view.area[0] - view.area[1] >= *area
        })
}

/// Blur in um and light in mm² of a published design, computed as for a [`ParetoPoint`].
fn published_means((_, rms, area): &PublishedValues) -> [f64; 2] {
    let mean = |values: &[f64; 3]| values.iter().sum::<f64>() / 3.0;
    [mean(&rms.map(|um| um * um)).sqrt(), mean(area)]
}

/// Half the side of a spot diagram, in mm.
const SPOT: f64 = 0.1;

/// Draws a lens with its rays, and the spots of its fields beside it.
fn draw_lens_and_spots(
    canvas: &mut Canvas,
    name: &str,
    lens: &Lens,
    top: f64,
) -> ExperimentResult<()> {
    let model = RayModel::from_lens(lens, 0)?;
    let section = SectionPlot::new(&model.channels[0].system);
    let [z, y] = section.extent();
    let (x, y) = (Axis::linear("", z), Axis::linear("", y));
    let chart = Chart::new([960.0, top], [1460.0, top + 220.0], x, y).with_equal_scales();
    canvas.text([960.0, top - 40.0], name, BLACK, TextAlign::Left);
    for (i, field) in model.fields.iter().enumerate() {
        let launch = model.launch(*field, model.primary)?;
        let color = PALETTE[i % PALETTE.len()];
        for ray in -2..=2 {
            section.draw_ray(canvas, &chart, &launch, [0.0, 0.45 * f64::from(ray)], color);
        }
        let middle = [1545.0 + 120.0 * i as f64, top + 110.0];
        let tracer = &launch.channel().tracer;
        let rays = pattern_points(PupilPattern::Hexapolar(8));
        let landings = rays.iter().filter_map(|p| Some(tracer.trace(launch.ray(*p)?)));
        let lit: Vec<[f64; 2]> = landings
            .filter(|landing| landing.fate.is_imaged())
            .map(|landing| [landing.ray.point.x, landing.ray.point.y])
            .collect();
        let count = lit.len().max(1) as f64;
        let center = [0, 1].map(|k| lit.iter().map(|p| p[k]).sum::<f64>() / count);
        for p in &lit {
            let off = [0, 1].map(|k| (p[k] - center[k]) / SPOT * 55.0);
            if off[0].abs() < 58.0 && off[1].abs() < 100.0 {
                canvas.square([middle[0] + off[0], middle[1] - off[1]], 1, color);
            }
        }
        let angle = format!("{} deg", (10.0 * field.y).round() / 10.0);
        canvas.text([middle[0], top + 215.0], &angle, BLACK, TextAlign::Middle);
    }
    section.draw(canvas, &chart);
    canvas.curve(&[[1600.0, top - 10.0], [1655.0, top - 10.0]], BLACK, Stroke::Solid);
    canvas.text([1670.0, top - 17.0], "0.1 mm", BLACK, TextAlign::Left);
    Ok(())
}
