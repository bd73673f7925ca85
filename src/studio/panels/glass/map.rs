//! The map of glasses: index or partial dispersion over the Abbe number, with those of the lens marked.

use egui::{
    Color32, PointerButton, Rangef, Role, Stroke, TextStyle, Ui, Visuals, WidgetInfo, vec2,
};
use egui_plot::{
    AxisHints, Line, LineStyle, Plot, PlotPoint, PlotPoints, PlotResponse, PlotUi, Points,
};

use super::labels::{MARGIN, label_places};
use super::list::{GlassNumbers, ListedGlass};
use crate::lens::Lens;
use crate::lens::glass::{Glass, normal_partial_dispersion};
use crate::studio::palette::{Palette, color32};

/// The distance in points within which the pointer picks a glass.
const NEAR: f32 = 10.0;
/// The Abbe numbers, indices and partial dispersions that the map shows at first, and the ends of the
/// normal line.
const ABBE: [f64; 2] = [15.0, 100.0];
const INDEX: [f64; 2] = [1.4, 2.15];
const PARTIAL: [f64; 2] = [0.5, 0.68];

/// The distances in points of numbers below the map at which they begin to be shown, and are.
const NUMBERS: Rangef = Rangef { min: 22.0, max: 30.0 };
/// The radius of the mark of a glass of the lens, in points.
const MARK: f32 = 4.0;

/// The quantities on the axes of the map.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub(super) enum MapAxes {
    #[default]
    IndexAbbe,
    PartialAbbe,
    PartialIndex,
}

impl MapAxes {
    pub(super) const ALL: [(Self, &'static str); 3] = [
        (Self::IndexAbbe, "nd over vd"),
        (Self::PartialAbbe, "PgF over vd"),
        (Self::PartialIndex, "PgF over nd"),
    ];

    pub(super) fn name(self) -> &'static str {
        let entry = Self::ALL.iter().find(|(axes, _)| *axes == self);
        entry.map_or("", |(_, name)| name)
    }

    const fn titles(self) -> [&'static str; 2] {
        match self {
            Self::IndexAbbe => ["vd", "nd"],
            Self::PartialAbbe => ["vd", "PgF"],
            Self::PartialIndex => ["nd", "PgF"],
        }
    }

    const fn bounds(self) -> [[f64; 2]; 2] {
        match self {
            Self::IndexAbbe => [ABBE, INDEX],
            Self::PartialAbbe => [ABBE, PARTIAL],
            Self::PartialIndex => [INDEX, PARTIAL],
        }
    }

    /// The place of a glass; `None` if its Abbe number or partial dispersion is needed and unknown.
    fn place(self, GlassNumbers { nd, vd, partial }: GlassNumbers) -> Option<[f64; 2]> {
        match self {
            Self::IndexAbbe => (vd > 0.0).then_some([vd, nd]),
            Self::PartialAbbe => partial.filter(|_| vd > 0.0).map(|partial| [vd, partial]),
            Self::PartialIndex => Some([nd, partial?]),
        }
    }
}

/// The map in one frame.
pub(super) struct GlassMap<'a> {
    pub(super) axes: MapAxes,
    pub(super) listed: &'a [ListedGlass],
    pub(super) lens: &'a Lens,
    /// The surface whose glass is replaced.
    pub(super) surface: Option<usize>,
    /// The glass under the pointer in the table.
    pub(super) pointed: Option<&'static Glass>,
}

impl GlassMap<'_> {
    /// Shows the map; the glass under the pointer, and whether it was clicked.
    pub(super) fn show(&self, ui: &mut Ui, height: f32) -> Option<(ListedGlass, bool)> {
        let ([x, y], [[left, right], [low, high]]) = (self.axes.titles(), self.axes.bounds());
        let visuals = ui.visuals().clone();
        let plot = Plot::new(self.axes.name())
            .height(height)
            .grid_color(visuals.widgets.noninteractive.bg_stroke.color)
            .custom_x_axes(vec![AxisHints::new_x().label(x).label_spacing(NUMBERS)])
            .y_axis_label(y)
            .invert_x(self.axes != MapAxes::PartialIndex)
            .default_x_bounds(left, right)
            .default_y_bounds(low, high)
            .allow_scroll(false)
            .show_crosshair(false)
            .label_formatter(|_| None)
            .set_margin_fraction(vec2(0.02, 0.02));
        let shown = plot.show(ui, |plot| self.paint(plot, &visuals));
        let (name, count) = (self.axes.name(), self.listed.len());
        let label = format!("Map of glasses, {name}: {count}");
        shown.response.widget_info(|| WidgetInfo::labeled(Role::Image, true, &label));
        self.label_marks(ui, &shown);
        self.hovered(ui, &shown)
    }

    fn paint(&self, plot: &mut PlotUi<'_>, visuals: &Visuals) {
        if self.axes == MapAxes::PartialAbbe {
            let ends = ABBE.map(|vd| [vd, normal_partial_dispersion(vd)]).to_vec();
            let line = Line::new("normal line", ends).style(LineStyle::dashed_loose());
            plot.line(line.color(visuals.weak_text_color()).width(1.0));
        }
        let all = self.listed.iter().filter_map(|listed| self.axes.place(listed.numbers()));
        let all: Vec<[f64; 2]> = all.collect();
        let color = color32(Palette::for_visuals(visuals).glass).to_opaque();
        points(plot, "glasses", all, (1.8, color, true));
        if let Some(place) = self.pointed.and_then(|glass| self.place_of(glass)) {
            points(plot, "pointed", vec![place], (5.0, visuals.hyperlink_color, false));
        }
        for (place, surfaces) in self.marks() {
            let color = self.mark_color(&surfaces, visuals);
            points(plot, "glass of the lens", vec![place], (MARK, color, true));
        }
    }

    fn mark_color(&self, surfaces: &[usize], visuals: &Visuals) -> Color32 {
        let chosen = self.surface.is_some_and(|surface| surfaces.contains(&surface));
        if chosen { visuals.selection.stroke.color } else { visuals.warn_fg_color }
    }

    /// Names the surfaces beside the marks of their glasses, above the points of all other glasses.
    fn label_marks(&self, ui: &Ui, shown: &PlotResponse<()>) {
        let (painter, frame) = (ui.painter_at(shown.response.rect), *shown.transform.frame());
        let visuals = ui.visuals();
        let label = |([x, y], surfaces): ([f64; 2], Vec<usize>)| {
            let place = shown.transform.position_from_point(&PlotPoint::new(x, y));
            let numbers: Vec<String> = surfaces.iter().map(|i| (i + 1).to_string()).collect();
            let color = self.mark_color(&surfaces, visuals);
            let font = TextStyle::Body.resolve(ui.style());
            (place, painter.layout_no_wrap(numbers.join(", "), font, color), color)
        };
        let labels = self.marks().into_iter().map(label);
        let labels: Vec<_> = labels.filter(|(place, ..)| frame.contains(*place)).collect();
        let sizes: Vec<_> = labels.iter().map(|(place, text, _)| (*place, text.size())).collect();
        let places = label_places(&sizes, MARK, frame);
        for ((place, text, color), label) in labels.into_iter().zip(places) {
            painter.line_segment([place, label.clamp(place)], Stroke::new(1.0, color));
            let ground = visuals.extreme_bg_color.gamma_multiply(0.85);
            painter.rect_filled(label.expand(MARGIN), 2.0, ground);
            painter.galley(label.min, text, color);
        }
    }

    fn place_of(&self, glass: &'static Glass) -> Option<[f64; 2]> {
        self.axes.place(ListedGlass::new(glass).numbers())
    }

    /// The places of the glasses of the lens, each with its surfaces.
    fn marks(&self) -> Vec<([f64; 2], Vec<usize>)> {
        let mut marks: Vec<([f64; 2], Vec<usize>)> = Vec::new();
        for (i, row) in self.lens.surfaces.iter().enumerate() {
            let numbers = GlassNumbers::of(&row.medium);
            let Some(place) = numbers.and_then(|numbers| self.axes.place(numbers)) else {
                continue;
            };
            match marks.iter_mut().find(|(known, _)| *known == place) {
                Some((_, surfaces)) => surfaces.push(i),
                None => marks.push((place, vec![i])),
            }
        }
        marks
    }

    /// Names the glass under the pointer, and says whether it was clicked.
    fn hovered(&self, ui: &Ui, shown: &PlotResponse<()>) -> Option<(ListedGlass, bool)> {
        let pointer = shown.response.hover_pos()?;
        let on_screen = |listed: &ListedGlass| {
            let [x, y] = self.axes.place(listed.numbers())?;
            Some(shown.transform.position_from_point(&PlotPoint::new(x, y)))
        };
        let distance = |listed: &&ListedGlass| {
            on_screen(listed).map_or(f32::INFINITY, |place| place.distance(pointer))
        };
        let found = self.listed.iter().min_by(|a, b| distance(a).total_cmp(&distance(b)))?;
        if distance(&found) > NEAR {
            return None;
        }
        if let Some(place) = on_screen(found) {
            let ring = ui.visuals().selection.stroke;
            ui.painter_at(shown.response.rect).circle_stroke(place, 5.0, ring);
        }
        let response = shown.response.clone().on_hover_text_at_pointer(found.describe());
        Some((*found, response.clicked_by(PointerButton::Primary)))
    }
}

fn points(
    plot: &mut PlotUi<'_>,
    name: &str,
    places: Vec<[f64; 2]>,
    (radius, color, filled): (f32, Color32, bool),
) {
    let points = Points::new(name, PlotPoints::from(places)).radius(radius).color(color);
    plot.points(points.filled(filled).allow_hover(false));
}
