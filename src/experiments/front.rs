//! Figure 3.6: sharpness against light. The same lens is optimised with ever more weight on its
//! light, by derivatives that follow the pupils, and beside it by the biased ones, which cannot see
//! light: for them every weight is the same, and an aperture must be chosen beforehand.
//!
//! The designs of each are compared by the area that they dominate in the plane of blur and light,
//! and by who dominates whom. On the double Gauss of the thesis stand also three designs that its
//! authors' program reaches from the same start (1,000 steps; measured here by the areas and spots
//! of two-dimensional pupils).

use super::section::Section;
use super::trade::{Design, Part, composite, dominates, hypervolume, opened, optimised, prepared};
use super::{Claim, Effort, Ended, Experiment, Outcome, Picture, Watch, lens, trade};
use crate::lens::Lens;
use crate::merit::PupilEdge;
use crate::picture::{Align, Axis, BLACK, Canvas, Chart, Color, GREY, PALETTE, Stroke};
use crate::pupil::{Bench, Pattern, pattern};

pub(super) const EXPERIMENT: Experiment = Experiment {
    id: "3.6",
    title: "Sharpness against light of two double Gauss lenses",
    claim: "Unbiased gradients give a front of designs that dominates those of biased gradients",
    seconds: 120.0,
    run,
};

/// The fields of the search, in degrees.
pub(super) const ANGLES: [f64; 3] = [0.0, 10.0, 20.0];
/// Weights of the light, in mm²: at the optimum the rim ray of a pupil is `√β` off its centroid.
const BETAS: [f64; 8] = [3e-2, 1e-2, 6e-3, 4e-3, 2e-3, 1e-3, 5e-4, 1e-4];
const FEW_BETAS: [f64; 2] = [1e-2, 2e-3];
/// The apertures chosen for the biased searches, relative to the start.
const OPENINGS: [f64; 3] = [0.8, 1.0, 1.2];
const ONE_OPENING: [f64; 1] = [1.0];
pub(super) const STEPS: usize = 1500;
pub(super) const FEW_STEPS: usize = 150;

/// RMS radius in um and area of the pupil in mm² at the three fields: what the authors' program
/// makes of `double_gauss_rudolph_50` at β = 0, 2e-4 and 5e-4 mm².
const AUTHORS: [(&str, [f64; 3], [f64; 3]); 3] = [
    ("authors, beta 0", [14.0, 18.0, 41.0], [90.9, 87.9, 64.3]),
    ("authors, beta 2e-4", [17.0, 19.0, 41.0], [92.0, 90.3, 66.3]),
    ("authors, beta 5e-4", [23.0, 19.0, 43.0], [93.9, 93.1, 70.3]),
];

fn run(effort: Effort, watch: &mut Watch<'_>) -> Result<Outcome, Ended> {
    let mut outcome = Outcome::default();
    let studies = [
        ("rudolph", "double_gauss_rudolph_50", AUTHORS.as_slice()),
        ("nikkor", "double_gauss_nikkor_s_50", &[]),
    ];
    for (i, (name, file, authors)) in studies.into_iter().enumerate() {
        let start = prepared(lens(file)?, &ANGLES);
        let span = [0.5 * i as f64, 0.5 * (i + 1) as f64];
        let front = Front::of(&start, effort, span, watch)?;
        outcome.claims.extend(front.claims(name, authors));
        let designs: Vec<&Design> = front.designs().collect();
        outcome.rays += designs.iter().map(|design| design.rays).sum::<usize>();
        outcome.tables.push(trade::table(name, &designs)?);
        outcome.pictures.push(Picture { name, canvas: front.draw(name, authors)? });
    }
    Ok(outcome)
}

/// The designs of one lens.
struct Front {
    start: Design,
    unbiased: Vec<Design>,
    biased: Vec<Design>,
}

/// The design of a weight of the light.
pub(super) fn design(
    start: &Lens,
    beta: f64,
    pupil: PupilEdge,
    steps: usize,
    part: &Part<'_>,
    watch: &mut Watch<'_>,
) -> Result<Design, Ended> {
    let goal = composite(start, beta, pupil)?;
    let lens = optimised(start, &goal, steps, part, watch)?;
    Design::new(part.name.to_owned(), beta, lens)
}

impl Front {
    fn of(
        start: &Lens,
        effort: Effort,
        [from, to]: [f64; 2],
        watch: &mut Watch<'_>,
    ) -> Result<Self, Ended> {
        let betas = effort.pick(BETAS.as_slice(), &FEW_BETAS);
        let openings = effort.pick(OPENINGS.as_slice(), &ONE_OPENING);
        let steps = effort.pick(STEPS, FEW_STEPS);
        let share = (to - from) / (betas.len() + openings.len()) as f64;
        let at = |i: usize| (from + share * i as f64, from + share * (i + 1) as f64);
        let (mut unbiased, mut biased) = (Vec::new(), Vec::new());
        for (i, beta) in betas.iter().enumerate() {
            let (name, (from, to)) = (format!("unbiased, beta {beta:e}"), at(i));
            let part = Part { from, to, name: &name };
            let begin = unbiased.last().map_or(start, |before: &Design| &before.lens);
            unbiased.push(design(begin, *beta, PupilEdge::Moving, steps, &part, watch)?);
        }
        for (i, opening) in openings.iter().enumerate() {
            let (name, (from, to)) = (format!("biased, opened {opening}"), at(betas.len() + i));
            let part = Part { from, to, name: &name };
            let start = opened(start, *opening);
            biased.push(design(&start, 0.0, PupilEdge::Kept, steps, &part, watch)?);
        }
        let start = Design::new("start".to_owned(), 0.0, start.clone())?;
        Ok(Self { start, unbiased, biased })
    }

    fn designs(&self) -> impl Iterator<Item = &Design> {
        std::iter::once(&self.start).chain(&self.unbiased).chain(&self.biased)
    }

    fn claims(&self, name: &str, authors: &[(&str, [f64; 3], [f64; 3])]) -> Vec<Claim> {
        let points = |designs: &[Design]| designs.iter().map(Design::point).collect::<Vec<_>>();
        let (unbiased, biased) = (points(&self.unbiased), points(&self.biased));
        let worst = [self.start.blur(), 0.0];
        let whole = worst[0] * self.start.light();
        let [front, without] = [&unbiased, &biased].map(|p| hypervolume(p, worst) / whole);
        let beaten = |p: &[f64; 2]| unbiased.iter().any(|mine| dominates(*mine, *p));
        let left = biased.iter().filter(|p| !beaten(p)).count();
        let mut claims = vec![
            Claim::at_least(
                format!("{name}: hypervolume of the unbiased designs, start 1 by 1"),
                front,
                without,
            ),
            Claim::at_least(
                format!("{name}: hypervolume of the biased designs, start 1 by 1"),
                without,
                0.0,
            ),
            Claim::at_most(
                format!("{name}: biased designs that no unbiased one dominates"),
                left as f64,
                0.0,
            ),
        ];
        for (author, rms, area) in authors {
            let mean = |values: &[f64; 3]| values.iter().sum::<f64>() / 3.0;
            let squares = rms.map(|um| (1e-3 * um).powi(2));
            let point = [mean(&squares).sqrt(), mean(area)];
            let better = self.unbiased.iter().filter(|mine| dominates(mine.point(), point)).count();
            claims.push(Claim::at_least(
                format!("{name}: unbiased designs that dominate `{author}`"),
                better as f64,
                1.0,
            ));
        }
        claims
    }

    /// The plane of blur and light, and the lenses at its ends with their spots.
    fn draw(&self, name: &str, authors: &[(&str, [f64; 3], [f64; 3])]) -> Result<Canvas, Ended> {
        let mut canvas = Canvas::new([1900, 1000]);
        let um = |design: &Design| [1e3 * design.blur(), design.light()];
        let mean = |values: &[f64; 3]| values.iter().sum::<f64>() / 3.0;
        let theirs: Vec<[f64; 2]> = authors
            .iter()
            .map(|(_, rms, area)| [mean(&rms.map(|um| um * um)).sqrt(), mean(area)])
            .collect();
        let sets: [(&str, Vec<[f64; 2]>, Color); 4] = [
            ("start", vec![um(&self.start)], BLACK),
            ("biased gradient", self.biased.iter().map(um).collect(), PALETTE[1]),
            ("unbiased gradient", self.unbiased.iter().map(um).collect(), PALETTE[0]),
            ("the authors' program", theirs, GREY),
        ];
        let all = || sets.iter().flat_map(|set| &set.1);
        let x = Axis::linear("blur (rms), um", all().map(|p| p[0]).chain([0.0]));
        let y = Axis::linear("area of the pupil, mm^2", all().map(|p| p[1]).chain([0.0]));
        let chart = Chart::new([120.0, 200.0], [840.0, 880.0], x, y);
        chart.draw(&mut canvas, name);
        for (i, (label, points, color)) in sets.iter().filter(|s| !s.1.is_empty()).enumerate() {
            let place = [130.0, 20.0 + 28.0 * i as f64];
            canvas.marks(&[[place[0], place[1] + 7.0]], *color);
            canvas.text([place[0] + 20.0, place[1]], label, BLACK, Align::Left);
            canvas.marks(&chart.places(points), *color);
        }
        let shown = [self.unbiased.first(), self.unbiased.last(), self.biased.first()];
        for (i, design) in shown.into_iter().flatten().enumerate() {
            lens_and_spot(&mut canvas, design, 90.0 + 310.0 * i as f64)?;
        }
        Ok(canvas)
    }
}

/// Half the side of a spot diagram, in mm.
const SPOT: f64 = 0.1;

/// A lens with its rays, and the spots of its fields beside it.
fn lens_and_spot(canvas: &mut Canvas, design: &Design, top: f64) -> Result<(), Ended> {
    let bench = Bench::of(&design.lens, 0).map_err(Ended::from_error)?;
    let section = Section::new(&bench.colors[0].system);
    let [z, y] = section.extent();
    let axes = (Axis::linear("", z), Axis::linear("", y));
    let chart = Chart::new([960.0, top], [1460.0, top + 220.0], axes.0, axes.1).to_scale();
    canvas.text([960.0, top - 40.0], &design.name, BLACK, Align::Left);
    for (i, field) in bench.fields.iter().enumerate() {
        let launch = bench.launch(*field, bench.primary).map_err(Ended::from_error)?;
        let color = PALETTE[i % PALETTE.len()];
        for ray in -2..=2 {
            section.draw_ray(canvas, &chart, &launch, [0.0, 0.45 * f64::from(ray)], color);
        }
        let middle = [1545.0 + 120.0 * i as f64, top + 110.0];
        let rays = pattern(Pattern::Hexapolar(8));
        let tracer = &launch.color().tracer;
        let landings = rays.iter().filter_map(|p| Some(tracer.trace(launch.ray(*p)?)));
        let lit = landings.filter(|landing| landing.fate.is_imaged());
        let lit: Vec<[f64; 2]> =
            lit.map(|landing| [landing.ray.point.x, landing.ray.point.y]).collect();
        let count = lit.len().max(1) as f64;
        let center = [0, 1].map(|k| lit.iter().map(|p| p[k]).sum::<f64>() / count);
        for p in &lit {
            let off = [0, 1].map(|k| (p[k] - center[k]) / SPOT * 55.0);
            if off[0].abs() < 58.0 && off[1].abs() < 100.0 {
                canvas.square([middle[0] + off[0], middle[1] - off[1]], 1, color);
            }
        }
        let text = format!("{} deg", field.y);
        canvas.text([middle[0], top + 215.0], &text, BLACK, Align::Middle);
    }
    section.draw(canvas, &chart);
    let bar = [[1600.0, top - 10.0], [1655.0, top - 10.0]];
    canvas.curve(&bar, BLACK, Stroke::Solid);
    canvas.text([1670.0, top - 17.0], "0.1 mm", BLACK, Align::Left);
    Ok(())
}
