//! Figure 3.10: two zoom lenses made sharper and brighter over their whole range.
//!
//! The objective is summed over three positions of each; curvatures and distances are variables,
//! semi-diameters and stop are fixed. Of the designs the one with the largest improvement at these
//! three positions is chosen; the claims are about four other positions, which neither the search
//! nor the choice has seen. There the groups follow parabolas through their three positions, with
//! the image plane in focus, for the starting lens and for the result alike.

use super::sharpness_vs_light::{
    ProgressSpan, WeightSweep, field_view, mean_blur_and_light, monochromatic, run_sweep,
};
use super::{
    Claim, DataTable, Effort, Experiment, ExperimentError, ExperimentOutcome, ExperimentResult,
    NamedPlot, ProgressFn, lens,
};
use crate::lens::{
    Aperture, FieldKind, FieldPoint, Fields, Lens, at_zoom, paraxial_image_distance,
};
use crate::optimize::pareto::ParetoPoint;
use crate::plot::{Axis, Canvas, Chart, Color, Legend, PALETTE, Stroke};
use crate::pupil::RayModel;

pub(super) const EXPERIMENT: Experiment = Experiment {
    id: "3.10",
    title: "Two zoom lenses optimized at three positions",
    claim: "Sharper and brighter over the whole range, also between the optimized positions",
    omits: "the simulated images of the test target; figures are at one wavelength",
    seconds: 100.0,
    run,
};

/// The positions compared: those of the search, and four between them.
const POSITIONS: [f64; 7] = [0.0, 0.35, 0.65, 1.0, 1.35, 1.65, 2.0];

/// True for the positions of the search.
fn is_optimized(position: usize) -> bool {
    POSITIONS[position].fract() == 0.0
}

fn run(effort: Effort, progress: &mut ProgressFn<'_>) -> ExperimentResult {
    let mut outcome = ExperimentOutcome::default();
    let lenses = [("nikkor", "zoom_nikkor_28_80"), ("tamron", "zoom_tamron_28_75_f28")];
    let count = effort.select(lenses.len(), 1);
    for (i, (name, file)) in lenses.into_iter().take(count).enumerate() {
        let zoom = monochromatic(lens(file)?);
        let weights = effort.select(10, 4);
        let plan = WeightSweep {
            semi_diameter_factors: [1.0, 1.0],
            ..WeightSweep::new(4.0, weights, effort.select(800, 60))
        };
        let [from, to] = [i, i + 1].map(|part| part as f64 / count as f64);
        let part = ProgressSpan { from, to, name };
        let designs = run_sweep(&zoom, &plan, part, progress)?;
        let before = ZoomRange::of(&designs[0].lens, &mut outcome.rays)?;
        let (lens, after) = best_design(&designs[1..], &before, &mut outcome.rays)?;
        outcome.lenses.push((format!("{name}-optimized"), lens));
        outcome.claims.extend(claims(name, &before, &after));
        outcome.tables.push(table(name, &before, &after));
        outcome.pictures.push(NamedPlot { name, canvas: draw(name, &before, &after) });
    }
    Ok(outcome)
}

/// A zoom lens at all positions compared.
struct ZoomRange {
    /// The blur in mm and the light in mm² at every position.
    points: Vec<[f64; 2]>,
    focal_lengths: Vec<f64>,
}

impl ZoomRange {
    fn of(lens: &Lens, rays: &mut usize) -> ExperimentResult<Self> {
        let mut range = Self { points: Vec::new(), focal_lengths: Vec::new() };
        for place in POSITIONS {
            let model = RayModel::from_lens(&lens_between(lens, place)?, 0)?;
            let views = model.fields.iter().map(|field| field_view(&model, *field, rays));
            range.points.push(mean_blur_and_light(&views.collect::<ExperimentResult<Vec<_>>>()?));
            range.focal_lengths.push(model.first_order.efl.unwrap_or(f64::NAN));
        }
        Ok(range)
    }

    /// Blur and light relative to another one, at a position.
    fn ratios(&self, other: &Self, i: usize) -> [f64; 2] {
        [0, 1].map(|k| self.points[i][k] / other.points[i][k])
    }

    /// The smallest improvement over another one at the positions of the search: above 1 if it is
    /// better at all of them.
    fn gain(&self, other: &Self) -> f64 {
        let least = (0..POSITIONS.len()).filter(|i| is_optimized(*i)).map(|i| {
            let [blur, light] = self.ratios(other, i);
            (1.0 / blur).min(1.0 + LIGHT_FACTOR * (light - 1.0))
        });
        least.fold(f64::INFINITY, f64::min)
    }
}

/// The factor by which a gain in light counts more than one in sharpness in the choice of a design.
const LIGHT_FACTOR: f64 = 20.0;

/// The design with the largest smallest improvement over the positions of the search.
fn best_design(
    designs: &[ParetoPoint],
    before: &ZoomRange,
    rays: &mut usize,
) -> ExperimentResult<(Lens, ZoomRange)> {
    let mut best: Option<(Lens, ZoomRange)> = None;
    for design in designs {
        let range = ZoomRange::of(&design.lens, rays)?;
        if best.as_ref().is_none_or(|(_, other)| range.gain(before) > other.gain(before)) {
            best = Some((design.lens.clone(), range));
        }
    }
    best.ok_or_else(|| ExperimentError::Failed("no design was found".to_owned()))
}

/// The parabola through three values at 0, 1 and 2.
fn parabola([a, b, c]: [f64; 3], t: f64) -> f64 {
    let first = b - a;
    a + t * (first + 0.5 * (t - 1.0) * (c - b - first))
}

/// The lens at a position of its range, whole numbers for its own positions, as a lens without
/// zoom.
fn lens_between(lens: &Lens, place: f64) -> ExperimentResult<Lens> {
    let positions = [0, 1, 2].map(|zoom| at_zoom(lens, zoom));
    let models = [0, 1, 2].map(|zoom| RayModel::from_lens(&positions[zoom], 0));
    let mut single = positions[0].clone();
    for i in 0..single.surfaces.len() {
        let gaps = [0, 1, 2].map(|zoom| positions[zoom].surfaces[i].thickness);
        single.surfaces[i].thickness = parabola(gaps, place);
    }
    let (mut behind, mut radii, mut focal) = ([0.0; 3], [0.0; 3], [0.0; 3]);
    for (zoom, model) in models.into_iter().enumerate() {
        let model = model?;
        let system = &model.channels[model.primary].system;
        let last = system.surfaces.len() - 2;
        behind[zoom] =
            system.surfaces[last].thickness - paraxial_image_distance(system, lens.object);
        radii[zoom] = model.stop_radius();
        focal[zoom] = model.first_order.efl.unwrap_or(f64::NAN);
    }
    single.aperture = Aperture::StopSemiDiameter(parabola(radii, place));
    single.image_solve = Some(parabola(behind, place));
    // The same corner of the image at every focal length.
    let height = |field: &FieldPoint| focal[0] * field.y.to_radians().tan();
    let heights: Vec<f64> = positions[0].fields.values.iter().map(height).collect();
    let model = RayModel::from_lens(&single, 0)?;
    let now = model.first_order.efl.unwrap_or(f64::NAN);
    let field =
        |height: f64| FieldPoint { x: 0.0, y: (height / now).atan().to_degrees(), weight: 1.0 };
    let values = heights.into_iter().map(field).collect();
    single.fields = Fields { kind: FieldKind::Angle, values };
    Ok(single)
}

/// Claims about the positions that neither the search nor the choice of the design has seen.
fn claims(name: &str, before: &ZoomRange, after: &ZoomRange) -> Vec<Claim> {
    let unseen = || (0..POSITIONS.len()).filter(|i| !is_optimized(*i));
    let ratios = |k: usize| unseen().map(move |i| after.ratios(before, i)[k]);
    vec![
        Claim::at_most(
            format!("{name}: blur relative to the start, worst between the positions"),
            ratios(0).fold(0.0, f64::max),
            1.0,
        ),
        Claim::at_least(
            format!("{name}: light relative to the start, worst between the positions"),
            ratios(1).fold(f64::INFINITY, f64::min),
            1.0,
        ),
    ]
}

fn table(name: &'static str, before: &ZoomRange, after: &ZoomRange) -> DataTable {
    let columns = [
        "place",
        "start_focal_length_mm",
        "start_blur_mm",
        "start_light_mm2",
        "focal_length_mm",
        "blur_mm",
        "light_mm2",
    ];
    let mut table = DataTable::new(name, &columns);
    for (i, place) in POSITIONS.into_iter().enumerate() {
        let of = |range: &ZoomRange| {
            let [blur, light] = range.points[i];
            [range.focal_lengths[i], blur, light]
        };
        let numbers = std::iter::once(place).chain(of(before)).chain(of(after));
        table.push_row(numbers.map(Into::into));
    }
    table
}

/// Draws blur and light over the focal length, before and after.
fn draw(name: &str, before: &ZoomRange, after: &ZoomRange) -> Canvas {
    let mut canvas = Canvas::new([1500, 760]);
    let ranges: [(&str, &ZoomRange, Color); 2] =
        [("start", before, PALETTE[1]), ("optimized", after, PALETTE[0])];
    let focal = ranges.iter().flat_map(|(_, range, _)| range.focal_lengths.iter().copied());
    let x = Axis::linear("focal length, mm", focal);
    let values = |k: usize| {
        let all = ranges.iter().flat_map(move |(_, range, _)| range.points.iter());
        all.map(move |point| SCALES[k] * point[k]).chain([0.0])
    };
    let charts = [
        Chart::new(
            [120.0, 150.0],
            [700.0, 640.0],
            x.clone(),
            Axis::linear("blur (rms), um", values(0)),
        ),
        Chart::new([860.0, 150.0], [1440.0, 640.0], x, Axis::linear("light, mm^2", values(1))),
    ];
    for (k, chart) in charts.iter().enumerate() {
        chart.draw(&mut canvas, name);
        for (_, range, color) in ranges {
            let places = range.focal_lengths.iter().zip(&range.points);
            let places: Vec<[f64; 2]> =
                places.map(|(f, point)| chart.to_pixel([*f, SCALES[k] * point[k]])).collect();
            canvas.marked_curve(&places, color, Stroke::Solid);
        }
    }
    let mut legend = Legend::new([120.0, 20.0]);
    for (label, _, color) in ranges {
        legend.curve(&mut canvas, label, color, Stroke::Solid);
    }
    canvas
}

/// The factors of the plotted quantities: mm to um, and mm² unchanged.
const SCALES: [f64; 2] = [1e3, 1.0];

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_parabola_goes_through_its_three_values() {
        let values = [4.0, -1.0, 2.5];
        for (i, value) in values.into_iter().enumerate() {
            assert!((parabola(values, i as f64) - value).abs() < 1e-12);
        }
        assert!((parabola([0.0, 1.0, 4.0], 1.5) - 2.25).abs() < 1e-12);
    }

    #[test]
    fn only_what_is_sharper_and_not_darker_at_all_positions_of_the_search_is_a_gain() {
        let range = |blur: f64, light: f64| ZoomRange {
            points: POSITIONS.map(|_| [blur, light]).to_vec(),
            focal_lengths: Vec::new(),
        };
        let before = range(0.02, 50.0);
        assert_eq!(before.gain(&before), 1.0);
        assert!(range(0.01, 60.0).gain(&before) > 1.5);
        assert!(range(0.01, 45.0).gain(&before) < 1.0, "sharper and darker");
        assert!(range(0.03, 60.0).gain(&before) < 1.0, "brighter and less sharp");
        let mut worse = range(0.01, 60.0);
        worse.points[3] = [0.03, 60.0];
        assert!(worse.gain(&before) < 1.0);
        // Between the positions of the search it may be worse.
        worse.points[3] = [0.01, 60.0];
        worse.points[1] = [0.03, 60.0];
        assert!(worse.gain(&before) > 1.5);
    }
}
