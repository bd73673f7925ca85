//! Charts of curves in rows, one row for each field of a lens, as pixels and on paper.

use super::{
    Axis, BLACK, Canvas, Chart, Color, GREY, Legend, LinePattern, PALETTE, PaperChart, Pen, Stroke,
    TextAlign, VectorDrawing, described_svg, wrapped,
};
use png::EncodingError;

/// A curve in pieces: it is not drawn where a quantity has no value.
#[derive(Debug, Clone, PartialEq)]
pub struct ChartCurve {
    /// Its name in the legend.
    pub name: String,
    /// Its colour, by its number in [`PALETTE`]; [`ChartCurve::NEUTRAL`] for grey.
    pub color: usize,
    /// Dashes instead of a full line.
    pub dashed: bool,
    /// The points of each piece.
    pub pieces: Vec<Vec<[f64; 2]>>,
}

impl ChartCurve {
    /// A full curve through the points that have a value.
    pub fn new(
        name: impl Into<String>,
        color: usize,
        points: impl IntoIterator<Item = (f64, Option<f64>)>,
    ) -> Self {
        let mut pieces = vec![Vec::new()];
        for (x, y) in points {
            match (y, pieces.last_mut()) {
                (Some(y), Some(piece)) => piece.push([x, y]),
                _ => pieces.push(Vec::new()),
            }
        }
        pieces.retain(|piece| !piece.is_empty());
        Self { name: name.into(), color: color % PALETTE.len(), dashed: false, pieces }
    }

    /// Crosses of a size in the unit of the axes.
    pub fn crosses(name: impl Into<String>, color: usize, points: &[[f64; 2]], size: f64) -> Self {
        let arm = 0.5 * size;
        let cross = |[x, y]: &[f64; 2]| {
            [vec![[x - arm, *y], [x + arm, *y]], vec![[*x, y - arm], [*x, y + arm]]]
        };
        let pieces = points.iter().flat_map(cross).collect();
        Self { name: name.into(), color: color % PALETTE.len(), dashed: false, pieces }
    }

    /// Upright lines from a floor to each point.
    pub fn bars(name: impl Into<String>, color: usize, points: &[[f64; 2]], floor: f64) -> Self {
        let pieces = points.iter().map(|[x, y]| vec![[*x, floor], [*x, *y]]).collect();
        Self { name: name.into(), color: color % PALETTE.len(), dashed: false, pieces }
    }

    /// The colour of a curve that belongs to no field and no wavelength, as a limit.
    pub const NEUTRAL: usize = usize::MAX;

    /// The same in grey.
    #[must_use]
    pub fn neutral(self) -> Self {
        Self { color: Self::NEUTRAL, ..self }
    }

    /// Its colour on paper.
    fn drawn_color(&self) -> Color {
        if self.color == Self::NEUTRAL { GREY } else { PALETTE[self.color % PALETTE.len()] }
    }

    /// The same with dashes.
    #[must_use]
    pub fn dashed(self) -> Self {
        Self { dashed: true, ..self }
    }

    /// Its points with the two quantities exchanged, as for a curve that is drawn upright.
    #[must_use]
    pub fn transposed(mut self) -> Self {
        self.pieces.iter_mut().flatten().for_each(|point| point.reverse());
        self
    }
}

/// Curves over the same axes.
#[derive(Debug, Clone, PartialEq)]
pub struct CurveChart {
    /// The words above it.
    pub title: String,
    /// The names of the quantities to the right and upwards, with their units.
    pub axes: [&'static str; 2],
    /// The curves.
    pub curves: Vec<ChartCurve>,
    /// True for the same scale on both axes, as in a map.
    pub is_map: bool,
}

impl CurveChart {
    /// A chart whose axes have scales of their own.
    pub fn new(title: impl Into<String>, axes: [&'static str; 2], curves: Vec<ChartCurve>) -> Self {
        Self { title: title.into(), axes, curves, is_map: false }
    }

    /// A map: both axes have the same scale.
    pub fn map(title: impl Into<String>, axes: [&'static str; 2], curves: Vec<ChartCurve>) -> Self {
        Self { is_map: true, ..Self::new(title, axes, curves) }
    }

    /// The first curve of each name.
    fn named_curves(&self) -> impl Iterator<Item = &ChartCurve> {
        let is_first = |i: usize| self.curves[..i].iter().all(|c| c.name != self.curves[i].name);
        self.curves.iter().enumerate().filter(move |(i, _)| is_first(*i)).map(|(_, curve)| curve)
    }

    /// The axes, which contain all curves.
    fn drawn_axes(&self) -> [Axis; 2] {
        let values = |k: usize| {
            let points = self.curves.iter().flat_map(|curve| curve.pieces.iter().flatten());
            points.map(move |point| point[k])
        };
        let axes = [0, 1].map(|k| Axis::linear(self.axes[k], values(k)));
        if self.is_map { Axis::equally_scaled(axes, CHART) } else { axes }
    }
}

/// Charts in rows below a title, with a legend beside each row.
#[derive(Debug, Clone, PartialEq)]
pub struct CurveSheet {
    /// The title.
    pub title: String,
    /// The charts of each row; those of a row share the legend of the first one.
    pub rows: Vec<Vec<CurveChart>>,
    /// The sentences below the charts, as of the error, the rays and the time of their numbers.
    pub caption: Vec<String>,
}

/// The size of a chart and the room around it, in mm.
const CHART: [f64; 2] = [80.0, 50.0];
const ROOM: [f64; 2] = [24.0, 24.0];
/// The height of a title of one line, that of each further line, and the width of the legend, in mm.
const TITLE: f64 = 10.0;
const TITLE_LINE: f64 = 4.4;
const LEGEND: f64 = 52.0;
/// The height of a line of the caption and of its letters, in mm.
const CAPTION: [f64; 2] = [3.6, 2.4];
/// The sentences of a caption up to which each begins on a line of its own.
const MOST_SENTENCES: usize = 12;
/// The number of pixels of a millimetre.
const PIXELS: f64 = 8.0;

impl CurveSheet {
    /// Width and height, in mm.
    fn size(&self) -> [f64; 2] {
        let lines = self.caption_lines().len() as f64;
        [self.width(), self.caption_top() + lines * CAPTION[0]]
    }

    fn width(&self) -> f64 {
        let columns = self.rows.iter().map(Vec::len).max().unwrap_or(0).max(1) as f64;
        columns * (CHART[0] + ROOM[0]) + LEGEND
    }

    /// The upper edge of the caption, in mm.
    fn caption_top(&self) -> f64 {
        self.title_height() + self.rows.len().max(1) as f64 * (CHART[1] + ROOM[1])
    }

    /// The caption in one text.
    fn description(&self) -> String {
        self.caption.join("; ")
    }

    /// The lines of a text, each no wider than the sheet in the letters of pixels, which are wider than those on
    /// paper.
    fn lines(&self, text: &str) -> Vec<String> {
        let width = PIXELS * (self.width() - ROOM[0]);
        wrapped(text, Canvas::letters(width as usize), Canvas::letters_of)
    }

    /// The lines of the caption; its sentences begin on lines of their own unless they are many.
    fn caption_lines(&self) -> Vec<String> {
        if self.caption.len() > MOST_SENTENCES {
            return self.lines(&self.description());
        }
        self.caption.iter().flat_map(|sentence| self.lines(sentence)).collect()
    }

    /// The lines of the title with the height of each above the first chart, in mm.
    fn placed_title(&self) -> impl Iterator<Item = (f64, String)> {
        let lines = self.lines(&self.title).into_iter().enumerate();
        lines.map(|(i, line)| (TITLE_LINE * i as f64, line))
    }

    fn title_height(&self) -> f64 {
        TITLE + TITLE_LINE * self.lines(&self.title).len().saturating_sub(1) as f64
    }

    /// The lines of the caption with their left upper corners, in mm.
    fn placed_caption(&self) -> impl Iterator<Item = ([f64; 2], String)> {
        let top = self.caption_top();
        let lines = self.caption_lines().into_iter().enumerate();
        lines.map(move |(i, line)| ([0.5 * ROOM[0], top + CAPTION[0] * i as f64], line))
    }

    /// The sheet as PNG, with title and caption as texts of the file too.
    ///
    /// # Errors
    /// A text that PNG does not hold.
    pub fn png(&self) -> Result<Vec<u8>, EncodingError> {
        let texts = [("Title", self.title.clone()), ("Description", self.description())];
        self.canvas().described_png(&texts)
    }

    /// The sheet as SVG, with title and caption as elements of the file too.
    pub fn svg(&self) -> String {
        described_svg(&self.drawing(), &self.title, &self.description())
    }

    /// The upper left corner of a chart, in mm.
    fn corner(&self, row: usize, column: usize) -> [f64; 2] {
        let [width, height] = [0, 1].map(|k| CHART[k] + ROOM[k]);
        let top = self.title_height() + 0.4 * ROOM[1];
        [0.75 * ROOM[0] + column as f64 * width, top + row as f64 * height]
    }

    /// All charts with their corners, in mm.
    fn charts(&self) -> impl Iterator<Item = ([f64; 2], &CurveChart)> {
        self.rows.iter().enumerate().flat_map(move |(row, charts)| {
            let of_row = charts.iter().enumerate();
            of_row.map(move |(column, chart)| (self.corner(row, column), chart))
        })
    }

    /// The curves of the first chart of each row, with the corner of its legend, in mm.
    fn legends(&self) -> impl Iterator<Item = ([f64; 2], &CurveChart)> {
        let left = self.size()[0] - LEGEND;
        let rows = self.rows.iter().enumerate();
        rows.filter_map(move |(row, charts)| {
            Some(([left, self.corner(row, 0)[1]], charts.first()?))
        })
    }

    /// The sheet on paper.
    pub fn drawing(&self) -> VectorDrawing {
        let mut sheet = VectorDrawing::new(self.size());
        for (down, line) in self.placed_title() {
            sheet.text([0.5 * ROOM[0], 0.6 * TITLE + down], line, 3.4, TextAlign::Left);
        }
        let pen = |curve: &ChartCurve| {
            let pattern = if curve.dashed { LinePattern::Dashes } else { LinePattern::Full };
            Pen::colored(curve.drawn_color()).with_width(0.35).with_pattern(pattern)
        };
        for (corner, chart) in self.charts() {
            let axes = PaperChart::new(corner, CHART, chart.drawn_axes());
            axes.draw(&mut sheet, &chart.title);
            for curve in &chart.curves {
                for piece in &curve.pieces {
                    let points: Vec<_> = piece.iter().map(|p| axes.to_sheet(*p)).collect();
                    sheet.line(&points, pen(curve));
                }
            }
        }
        for ([x, top], chart) in self.legends() {
            for (i, curve) in chart.named_curves().enumerate() {
                let y = top + 4.6 * i as f64;
                sheet.line(&[[x, y], [x + 8.0, y]], pen(curve));
                sheet.text([x + 10.0, y + 0.9], curve.name.clone(), 2.6, TextAlign::Left);
            }
        }
        for ([x, y], line) in self.placed_caption() {
            sheet.text([x, y + CAPTION[1]], line, CAPTION[1], TextAlign::Left);
        }
        sheet
    }

    /// The sheet in pixels, eight to a millimetre.
    pub fn canvas(&self) -> Canvas {
        let mut canvas = Canvas::new(self.size().map(|mm| (PIXELS * mm).round() as u32));
        let scaled = |point: [f64; 2]| point.map(|mm| PIXELS * mm);
        let stroke = |curve: &ChartCurve| {
            if curve.dashed { Stroke::Dashed } else { Stroke::Solid }
        };
        for (down, line) in self.placed_title() {
            let at = scaled([0.5 * ROOM[0], 0.2 * TITLE + down]);
            canvas.text(at, &line, BLACK, TextAlign::Left);
        }
        for (corner, chart) in self.charts() {
            let end = [corner[0] + CHART[0], corner[1] + CHART[1]];
            let [x, y] = chart.drawn_axes();
            let axes = Chart::new(scaled(corner), scaled(end), x, y);
            axes.draw(&mut canvas, &chart.title);
            for curve in &chart.curves {
                for piece in &curve.pieces {
                    canvas.curve(&axes.to_pixels(piece), curve.drawn_color(), stroke(curve));
                }
            }
        }
        for (corner, chart) in self.legends() {
            let mut legend = Legend::new(scaled(corner));
            for curve in chart.named_curves() {
                legend.curve(&mut canvas, &curve.name, curve.drawn_color(), stroke(curve));
            }
        }
        for (corner, line) in self.placed_caption() {
            canvas.text(scaled(corner), &line, GREY, TextAlign::Left);
        }
        canvas
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::plot::Mark;

    fn sheet() -> CurveSheet {
        let points =
            [(0.0, Some(1.0)), (1.0, Some(3.0)), (2.0, None), (3.0, Some(5.0)), (4.0, Some(4.0))];
        let curve = ChartCurve::new("blue", 0, points);
        let chart = CurveChart::new("y 14°", ["pupil", "mm"], vec![curve]);
        CurveSheet {
            title: "fans".to_owned(),
            rows: vec![vec![chart.clone(), chart.clone()], vec![chart]],
            caption: Vec::new(),
        }
    }

    /// The caption is in the drawing, in the pixels and in the texts of the files, and no line leaves the sheet.
    #[test]
    fn the_caption_stands_below_the_charts_and_in_the_texts_of_the_files() {
        let note = "RMS 4.25 ± 1.0e-3 µm, 1024 rays, 2.50 ms".to_owned();
        let sheet = CurveSheet { caption: vec![note; 9], ..sheet() };
        let lines = sheet.caption_lines();
        assert!(lines.len() > 1 && sheet.caption.join(" ") == lines.join(" "), "{lines:?}");
        let joined = CurveSheet { caption: vec![sheet.caption[0].clone(); 20], ..self::sheet() };
        assert_eq!(joined.caption_lines().join(" "), joined.description());
        let bare = self::sheet().size();
        assert_eq!(sheet.size(), [bare[0], bare[1] + lines.len() as f64 * CAPTION[0]]);
        for line in &lines {
            assert!(crate::plot::text_width(line, CAPTION[1]) < sheet.width() - ROOM[0], "{line}");
        }
        let svg = sheet.svg();
        assert!(svg.contains("<title>fans</title>\n<desc>RMS 4.25 ± 1.0e-3"), "{svg}");
        assert!(svg.contains(&format!(">{}</text>", lines[0])), "{svg}");
        let bytes = sheet.png().unwrap();
        let reader = png::Decoder::new(std::io::Cursor::new(&bytes)).read_info().unwrap();
        let texts = &reader.info().utf8_text;
        assert_eq!(texts[1].get_text().unwrap(), sheet.description());
        let below =
            sheet.canvas().pixels()[3 * (8.0 * bare[0] * 8.0 * bare[1]) as usize..].to_vec();
        assert!(below.contains(&GREY[0]), "no letter below the charts");
    }

    #[test]
    fn a_curve_is_interrupted_where_it_has_no_value() {
        let pieces = sheet().rows[0][0].curves[0].pieces.clone();
        assert_eq!(pieces, [vec![[0.0, 1.0], [1.0, 3.0]], vec![[3.0, 5.0], [4.0, 4.0]]]);
        let none = ChartCurve::new("", 0, [(0.0, None), (1.0, None)]);
        assert_eq!(none.pieces, Vec::<Vec<[f64; 2]>>::new());
        let bare = CurveSheet { title: String::new(), rows: Vec::new(), caption: Vec::new() };
        assert!(bare.drawing().marks.is_empty());
    }

    /// The axes end at whole steps: 0 to 4 and 1 to 5.
    #[test]
    fn the_points_of_a_curve_lie_at_their_places_on_paper() {
        let drawing = sheet().drawing();
        let [x, y] = sheet().corner(1, 0);
        let first = [x, y + CHART[1]];
        let found = drawing.marks.iter().any(|mark| match mark {
            Mark::Line { points, .. } => {
                let close = |a: [f64; 2], b: [f64; 2]| (a[0] - b[0]).hypot(a[1] - b[1]) < 1e-9;
                points.len() == 2
                    && close(points[0], first)
                    && close(points[1], [x + 0.25 * CHART[0], y + 0.5 * CHART[1]])
            }
            _ => false,
        });
        assert!(found);
    }

    #[test]
    fn a_sheet_becomes_a_picture_in_the_colour_of_its_curves() {
        let canvas = sheet().canvas();
        assert_eq!(canvas.size(), sheet().size().map(|mm| (8.0 * mm) as u32));
        assert!(canvas.pixels().chunks(3).any(|pixel| pixel == PALETTE[0]));
    }
}
