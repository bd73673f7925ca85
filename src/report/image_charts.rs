//! Spot diagrams and contrast curves of a lens as figures of a report.

use crate::analysis::{MtfCurve, MtfPoint, SpotPoints};
use crate::plot::{Axis, LinePattern, PALETTE, PaperChart, Pen, TextAlign, VectorDrawing};

/// The width of a figure, in mm.
pub(super) const FIGURE: f64 = 174.0;
/// The side of the square of one spot diagram and the gap between two, in mm.
const CELL: f64 = 38.0;
const GAP: f64 = 5.0;
/// The radius of a point of a spot diagram, in mm.
const POINT: f64 = 0.13;
/// The height of the contrast chart, in mm.
const CHART: f64 = 72.0;

/// The spot of a field, ready to be drawn.
pub(super) struct SpotCell {
    /// The name of the field.
    pub(super) name: String,
    /// The common centroid, in mm; `None` for a dark field.
    pub(super) centroid: Option<[f64; 2]>,
    /// The image points of every wavelength.
    pub(super) points: Vec<SpotPoints>,
}

/// The spots of all fields at one scale, about their centroids, with the Airy disc of this radius in mm
/// where there is one.
pub(super) fn spot_figure(cells: &[SpotCell], airy: Option<f64>) -> (VectorDrawing, f64) {
    let side = half_side(cells, airy);
    let columns = (((FIGURE + GAP) / (CELL + GAP)) as usize).clamp(1, cells.len().max(1));
    let rows = cells.len().div_ceil(columns);
    let mut figure = VectorDrawing::new([FIGURE, rows as f64 * (CELL + 7.0)]);
    for (i, cell) in cells.iter().enumerate() {
        let corner =
            [(i % columns) as f64 * (CELL + GAP), (i / columns) as f64 * (CELL + 7.0) + 4.0];
        draw_cell(&mut figure, cell, corner, side, airy);
    }
    (figure, 2.0 * side)
}

fn draw_cell(
    figure: &mut VectorDrawing,
    cell: &SpotCell,
    [left, top]: [f64; 2],
    side: f64,
    airy: Option<f64>,
) {
    let middle = [left + 0.5 * CELL, top + 0.5 * CELL];
    figure.rectangle([left, top], [left + CELL, top + CELL], Pen::FRAME.with_width(0.15));
    figure.text([middle[0], top - 1.0], cell.name.clone(), 2.5, TextAlign::Middle);
    let Some(centroid) = cell.centroid else {
        figure.text(middle, "no light", 2.8, TextAlign::Middle);
        return;
    };
    let unit = 0.5 * CELL / side;
    for dots in &cell.points {
        let color = PALETTE[dots.wavelength % PALETTE.len()];
        for p in &dots.points {
            let x = middle[0] + unit * (p[0] - centroid[0]);
            let y = middle[1] - unit * (p[1] - centroid[1]);
            let inside = (x - middle[0]).abs().max((y - middle[1]).abs()) < 0.5 * CELL - POINT;
            if inside {
                let corners =
                    [[x - POINT, y - POINT], [x + POINT, y - POINT], [x + POINT, y + POINT]];
                figure.area(&[&corners[..], &[[x - POINT, y + POINT]]].concat(), color);
            }
        }
    }
    if let Some(radius) = airy.filter(|radius| *radius < side) {
        figure.circle(middle, unit * radius, Pen::THIN);
    }
}

/// Half the side in mm of a square into which every spot fits, rounded up to 1, 2 or 5.
fn half_side(cells: &[SpotCell], airy: Option<f64>) -> f64 {
    let reach = |cell: &SpotCell| {
        let center = cell.centroid.unwrap_or([0.0; 2]);
        let points = cell.points.iter().flat_map(|dots| &dots.points);
        points.map(|p| (p[0] - center[0]).abs().max((p[1] - center[1]).abs())).fold(0.0, f64::max)
    };
    let most = cells.iter().map(reach).fold(1.1 * airy.unwrap_or(0.0), f64::max).max(1e-9);
    let power = 10f64.powf(most.log10().floor());
    let sides = [1.0, 2.0, 5.0, 10.0];
    power * sides.into_iter().find(|side| side * power >= most).unwrap_or(10.0)
}

/// The contrast of some fields against spatial frequency: tangential full, sagittal dashed.
pub(super) fn contrast_figure(curves: &[(String, &MtfCurve)]) -> VectorDrawing {
    let mut figure = VectorDrawing::new([FIGURE, CHART + 22.0]);
    let frequencies = || curves.iter().flat_map(|(_, curve)| &curve.points).map(|p| p.frequency);
    let axes = [
        Axis::linear("cycles/mm", frequencies().chain([0.0])),
        Axis::linear("contrast", [0.0, 1.0]),
    ];
    let chart = PaperChart::new([12.0, 8.0], [FIGURE - 58.0, CHART], axes);
    chart.draw(&mut figure, "");
    for (i, (name, curve)) in curves.iter().enumerate() {
        let pen = Pen::colored(PALETTE[i % PALETTE.len()]).with_width(0.35);
        let along = |of: fn(&MtfPoint) -> f64| -> Vec<[f64; 2]> {
            curve.points.iter().map(|p| chart.to_sheet([p.frequency, of(p)])).collect()
        };
        figure.line(&along(|p| p.tangential.modulus.value), pen);
        let dashed = pen.with_pattern(LinePattern::Dashes);
        figure.line(&along(|p| p.sagittal.modulus.value), dashed);
        let y = 11.0 + 4.6 * i as f64;
        figure.line(&[[FIGURE - 42.0, y - 0.9], [FIGURE - 34.0, y - 0.9]], pen);
        figure.text([FIGURE - 32.0, y], name.clone(), 2.6, TextAlign::Left);
    }
    let y = 13.0 + 4.6 * curves.len() as f64;
    figure.text([FIGURE - 42.0, y], "full: tangential", 2.4, TextAlign::Left);
    figure.text([FIGURE - 42.0, y + 4.0], "dashed: sagittal", 2.4, TextAlign::Left);
    figure
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::plot::Mark;
    use crate::trace::Fates;

    /// Points of a spot keep their places about the centroid, at the scale that the figure states.
    #[test]
    fn the_points_of_a_spot_are_drawn_in_its_cell_to_scale() {
        let points = vec![[0.3, 1.05], [0.45, 1.2], [0.3, 1.35], [0.15, 1.2]];
        let of_color =
            |points| SpotPoints { field: 0, wavelength: 0, points, fates: Fates::default() };
        let cell = SpotCell {
            name: "axis".to_owned(),
            centroid: Some([0.3, 1.2]),
            points: vec![of_color(points.clone())],
        };
        let (figure, shown) = spot_figure(&[cell], None);
        let middle_of = |mark: &Mark| match mark {
            Mark::Area { points, .. } => {
                let n = points.len() as f64;
                Some([0, 1].map(|k| points.iter().map(|p| p[k]).sum::<f64>() / n))
            }
            _ => None,
        };
        let drawn: Vec<[f64; 2]> = figure.marks.iter().filter_map(middle_of).collect();
        assert_eq!(drawn.len(), points.len());
        let scale = CELL / shown;
        let middle = [0.5 * CELL, 4.0 + 0.5 * CELL];
        for (at, p) in drawn.iter().zip(&points) {
            let x = middle[0] + scale * (p[0] - 0.3);
            let y = middle[1] - scale * (p[1] - 1.2);
            assert!((at[0] - x).hypot(at[1] - y) < 1e-9, "{at:?} for {p:?}");
        }
    }
}
