//! The lens in section, with its rays.
//!
//! While a search runs, its current lens is shown over the outlines of the design; glass that the
//! design does not have is tinted.

mod handles;
mod lost_light;

use std::sync::Arc;

use egui::{
    Align, ComboBox, Context, DragValue, EventFilter, Key, Label, Layout as Arrange, Response,
    RichText, Stroke, Ui, vec2,
};
use glam::DVec2;

use super::widgets::swatch;
use super::{Panel, displayed_results, field_name, show_missing_results, zoom_name};
use crate::analysis::{LayoutRay, RayLayout};
use crate::lens::{System, added_glass};
use crate::math::Vec3;
use crate::paraxial::Handle;
use crate::session::{Analyses, AnalysisResults, Command, PanelSetting, SessionView};
use crate::studio::actions::Actions;
use crate::studio::cached::{ByAddress, Cached};
use crate::studio::draw::{BoundingBox, RenderBackend, Rgba, Scene, SceneResponse, SceneView};
use crate::studio::form::named_list;
use crate::studio::number;
use crate::studio::palette::{Palette, color32};
use crate::studio::section::SectionDrawing;
use crate::trace::Fates;
use handles::{HandleFrame, HandleLayer, handle_places, locks_row};
use lost_light::{ClippingRim, clipping_rims, lost_rays_menu};

/// The distance in points within which the pointer picks a surface.
const NEAR: f64 = 6.0;

/// The panel.
#[derive(Debug)]
pub struct LayoutPanel {
    backend: RenderBackend,
    scene_view: SceneView,
    /// The document that was drawn last: another one is shown whole.
    document: u64,
    drawing: Cached<LayoutKey, Option<LayoutDrawing>>,
    handles: HandleLayer,
}

/// The scene of a lens, with what its legend and its tooltips need.
#[derive(Debug)]
struct LayoutDrawing {
    scene: Arc<Scene>,
    /// The handles with their places, in mm.
    handles: Vec<(Handle, DVec2)>,
    full_view: BoundingBox,
    system: System<f64>,
    reached: Vec<f64>,
    fates: Fates,
    /// The rims that clip rays.
    clipping: Vec<ClippingRim>,
    /// Fields without rays, and why.
    fields_without_rays: Vec<(usize, String)>,
    /// The number of glass elements that the design does not have.
    added_glass: usize,
}

/// The key of a drawing.
#[derive(Debug, PartialEq)]
struct LayoutKey {
    /// The results that are drawn.
    results: ByAddress<AnalysisResults>,
    /// The design, drawn faintly below the lens of a search.
    reference: Option<ByAddress<AnalysisResults>>,
    palette: Palette,
}

impl LayoutPanel {
    /// An empty panel.
    pub fn new(backend: RenderBackend) -> Self {
        Self {
            backend,
            scene_view: SceneView::new("layout"),
            document: 0,
            drawing: Cached::new(),
            handles: HandleLayer::default(),
        }
    }
}

impl Panel for LayoutPanel {
    fn title(&self) -> &'static str {
        "Layout"
    }

    fn is_typing(&self, _context: &Context) -> bool {
        self.handles.is_typing()
    }

    fn ui(&mut self, ui: &mut Ui, view: &SessionView, actions: &mut Actions) {
        if self.document != view.document {
            self.document = view.document;
            self.scene_view.fit();
        }
        self.refresh(ui, view);
        self.header(ui, view, actions);
        locks_row(ui, view, actions);
        self.scene_view.hold(self.handles.before().is_some());
        let Some(Some(drawing)) = self.drawing.last() else {
            return show_missing_results(ui, view);
        };
        let label = format!("Section of {}", view.lens.name);
        let (scene, full_view) = (&drawing.scene, drawing.full_view);
        let shown = self.scene_view.show(ui, self.backend, scene, full_view, &label);
        let near = drawing.highlight_surface(ui, view, &shown);
        select_by_keys(ui, view, &shown.response, actions);
        let frame = HandleFrame { view, shown: &shown, drawing, near };
        self.handles.ui(ui, &frame, actions);
        if shown.response.clicked() && near != view.selected {
            actions.push(Command::Select(near));
        }
    }
}

impl LayoutPanel {
    fn refresh(&mut self, ui: &Ui, view: &SessionView) {
        let Some(source) = LayoutKey::of(ui, view, self.handles.before()) else {
            return self.drawing.clear();
        };
        self.drawing.get(source, LayoutDrawing::new);
    }

    fn drawing(&self) -> Option<&LayoutDrawing> {
        self.drawing.last()?.as_ref()
    }

    fn header(&mut self, ui: &mut Ui, view: &SessionView, actions: &mut Actions) {
        let size = vec2(ui.available_width(), ui.spacing().interact_size.y);
        ui.allocate_ui_with_layout(size, Arrange::right_to_left(Align::Center), |ui| {
            if ui.button("Fit").on_hover_text("Show the whole lens (double click)").clicked() {
                self.scene_view.fit();
            }
            rays(ui, view, actions);
            zoom_position(ui, view, actions);
            // A long text ends where the controls at the right begin.
            ui.with_layout(Arrange::left_to_right(Align::Center), |ui| {
                self.legend(ui, view, actions);
            });
        });
    }

    /// The colours of the fields, and the number of lost rays.
    fn legend(&self, ui: &mut Ui, view: &SessionView, actions: &mut Actions) {
        let palette = Palette::for_visuals(ui.visuals());
        let fields = view.lens.fields_at(view.settings.zoom);
        for (i, field) in fields.values.iter().enumerate() {
            let color = color32(palette.field(i));
            swatch(ui, color);
            ui.label(RichText::new(field_name(fields.kind, *field)).color(color));
            ui.add_space(4.0);
        }
        let Some(drawing) = self.drawing() else { return };
        if let Some(text) = losses_text(drawing.fates) {
            let color = color32(palette.lost_ray);
            swatch(ui, color);
            let text = RichText::new(text).color(color);
            if drawing.clipping.is_empty() || view.preview_results.is_some() {
                let hint = "Lost rays are drawn to their end, which is marked by a dot";
                ui.label(text).on_hover_text(hint);
            } else {
                lost_rays_menu(ui, text, &drawing.clipping, &view.lens, actions);
            }
        }
        if let Some([first, second]) = view.settings.ghost {
            let color = color32(palette.strong);
            swatch(ui, color);
            let text = format!("ghost {}, {}", first + 1, second + 1);
            let hint = "Light along the axis that two surfaces reflect; click to hide it";
            let label = ui.button(RichText::new(text).color(color)).on_hover_text(hint);
            if label.clicked() {
                actions.push(Command::Show(PanelSetting::Ghost(None)));
            }
        }
        if drawing.added_glass > 0 {
            swatch(ui, color32(palette.added_glass).to_opaque());
            ui.label("new glass").on_hover_text("Glass that the design does not have");
        }
        let missing = &drawing.fields_without_rays;
        if !missing.is_empty() {
            let texts = missing.iter().map(|(field, why)| format!("Field {}: {why}", field + 1));
            let text = texts.collect::<Vec<_>>().join("; ");
            let label = RichText::new(&text).color(ui.visuals().warn_fg_color);
            ui.add(Label::new(label).truncate()).on_hover_text(text);
        }
    }
}

/// The number of lost rays by cause; `None` if no ray is lost.
fn losses_text(fates: Fates) -> Option<String> {
    let causes = [
        (fates.clipped, "clipped"),
        (fates.missed, "missed a surface"),
        (fates.total_reflection, "totally reflected"),
        (fates.turned + fates.trapped, "trapped in a GRIN medium"),
    ];
    let parts: Vec<String> =
        causes.iter().filter(|(n, _)| *n > 0).map(|(n, how)| format!("{n} {how}")).collect();
    (!parts.is_empty()).then(|| format!("{} of {} rays", parts.join(", "), fates.total()))
}

fn rays(ui: &mut Ui, view: &SessionView, actions: &mut Actions) {
    let mut count = view.settings.rays;
    let drag = DragValue::new(&mut count).range(1..=501).speed(0.2).suffix(" rays");
    let drag = ui.add(drag).accessible_name("Rays of each field");
    if drag.on_hover_text("Rays of each field in the drawing").changed() {
        actions.push(Command::Show(PanelSetting::Rays(count)));
    }
}

fn zoom_position(ui: &mut Ui, view: &SessionView, actions: &mut Actions) {
    let lens = &view.lens;
    if lens.zoom_positions() < 2 {
        return;
    }
    let name = |i: usize| zoom_name(lens, i);
    let mut chosen = view.settings.zoom;
    let combo = ComboBox::from_id_salt("zoom position").selected_text(name(chosen));
    let shown = combo.show_ui(ui, |ui| {
        for i in 0..lens.zoom_positions() {
            ui.selectable_value(&mut chosen, i, name(i));
        }
    });
    named_list(ui, shown, "Zoom position");
    if chosen != view.settings.zoom {
        actions.push(Command::ShowZoom(chosen));
    }
}

impl LayoutKey {
    /// The lenses to draw: that of a search over the design, the design over that before a drag.
    fn of(ui: &Ui, view: &SessionView, before: Option<&Arc<AnalysisResults>>) -> Option<Self> {
        let shown = displayed_results(view)?.0;
        let reference = before.or(view.results.as_ref());
        let reference = reference.filter(|design| !Arc::ptr_eq(design, shown));
        Some(Self {
            results: shown.into(),
            reference: reference.map(Into::into),
            palette: Palette::for_visuals(ui.visuals()),
        })
    }
}

impl LayoutDrawing {
    fn new(source: &LayoutKey) -> Option<Self> {
        let numbers = source.results.analyses.as_ref().ok()?;
        let (model, layout) = (&numbers.ray_model.value, &numbers.layout.value);
        let palette = source.palette;
        let system = model.channels[model.primary].system.clone();
        let reached = &numbers.semi_diameters.value;
        let section = SectionDrawing::new(&system, reached);
        let mut scene = Scene::on(palette.background);
        if let Some(Ok(design)) = source.reference.as_ref().map(|reference| &reference.analyses) {
            draw_reference(&mut scene, design, &palette);
        }
        let added =
            source.reference.as_ref().map(|design| added_glass(&source.results.lens, &design.lens));
        let added = added.unwrap_or_default();
        section.draw_glass(&mut scene, &palette, &added);
        layout.rays.iter().for_each(|ray| draw_ray(&mut scene, ray, &palette));
        for ray in &numbers.ghost_rays {
            let points: Vec<DVec2> = ray.iter().map(|p| DVec2::new(p.z, p.y)).collect();
            scene.polyline(&points, 1.2, palette.strong);
        }
        section.draw_outlines(&mut scene, &palette);
        draw_image(&mut scene, &section, layout, &palette);
        Some(Self {
            scene: Arc::new(scene),
            handles: handle_places(&source.results),
            full_view: full_view(&section, layout)?,
            reached: reached.clone(),
            fates: layout.fates,
            clipping: clipping_rims(&source.results.lens, layout),
            fields_without_rays: layout.errors.clone(),
            added_glass: added.len(),
            system,
        })
    }

    /// Draws the selected surface and the one under the pointer bold; the latter is named and
    /// given back, the image plane excepted.
    fn highlight_surface(
        &self,
        ui: &Ui,
        view: &SessionView,
        shown: &SceneResponse,
    ) -> Option<usize> {
        let section = SectionDrawing::new(&self.system, &self.reached);
        let count = self.system.surfaces.len();
        let near = shown.pointer().and_then(|(at, mm)| section.surface_near(at, NEAR * mm));
        let selected = view.selected.filter(|surface| *surface < count && near != view.selected);
        for surface in selected.into_iter().chain(near) {
            let curve = section.surface(surface);
            let curve = curve.into_iter().map(|mm| shown.to_screen(mm)).collect();
            let stroke = Stroke::new(2.5, ui.visuals().selection.stroke.color);
            ui.painter_at(shown.response.rect).line(curve, stroke);
        }
        let near = near?;
        // While a handle is dragged its numbers stand where the explanation would.
        if view.drag.progress.is_none() {
            shown.response.clone().on_hover_text_at_pointer(self.describe(view, near));
        }
        (near < view.lens.surfaces.len()).then_some(near)
    }

    fn describe(&self, view: &SessionView, surface: usize) -> String {
        let Some(row) = view.lens.surfaces.get(surface) else { return "Image plane".to_owned() };
        let shape = &self.system.surfaces[surface].shape;
        let radius = number::format_number(number::radius(shape.curvature()));
        let stop = if row.stop { ", the stop" } else { "" };
        let first = format!("Surface {}, radius {radius} mm{stop}", surface + 1);
        let limit = row.semi_diameter.map(|limit| {
            format!(
                "\nsemi-diameter {} mm: rays beyond it are clipped",
                number::format_number(limit)
            )
        });
        let reached = self
            .reached
            .get(surface)
            .map(|height| format!("\nrays reach {} mm", number::format_digits(*height, 5)));
        first + &limit.unwrap_or_default() + &reached.unwrap_or_default()
    }
}

/// Selects the next or the previous surface by an arrow key while the drawing has the keyboard: its handles
/// are then those that the Tab key reaches.
fn select_by_keys(ui: &Ui, view: &SessionView, drawing: &Response, actions: &mut Actions) {
    if !drawing.has_focus() {
        return;
    }
    let kept = EventFilter { horizontal_arrows: true, ..EventFilter::default() };
    ui.memory_mut(|memory| memory.set_focus_lock_filter(drawing.id, kept));
    let pressed = |key| ui.input(|input| input.key_pressed(key));
    let last = view.lens.surfaces.len().saturating_sub(1);
    let surface = match (pressed(Key::ArrowLeft), pressed(Key::ArrowRight), view.selected) {
        (true, false, at) => at.map_or(last, |at| at.saturating_sub(1)),
        (false, true, at) => at.map_or(0, |at| (at + 1).min(last)),
        _ => return,
    };
    actions.push(Command::Select(Some(surface)));
}

/// The outlines of the design, to compare with.
fn draw_reference(scene: &mut Scene, design: &Analyses, palette: &Palette) {
    let model = &design.ray_model.value;
    let system = &model.channels[model.primary].system;
    SectionDrawing::new(system, &design.semi_diameters.value).draw_reference(scene, palette.faint);
}

/// The lowest and the highest place of the image plane that rays reach, with some room.
fn image_extent(section: &SectionDrawing<'_>, layout: &RayLayout) -> Option<(f64, f64)> {
    let arrived = layout.rays.iter().filter(|ray| ray.path.fate.is_imaged());
    let height = |point: &Vec3<f64>| DVec2::splat(section.image_height(*point));
    let ends = arrived.filter_map(|ray| ray.path.points.last().map(height));
    let BoundingBox { min, max } = BoundingBox::around(ends)?;
    let margin = 0.06 * (max.y - min.y);
    Some((min.y - margin, max.y + margin))
}

fn draw_image(
    scene: &mut Scene,
    section: &SectionDrawing<'_>,
    layout: &RayLayout,
    palette: &Palette,
) {
    let (low, high) = image_extent(section, layout).unwrap_or_default();
    let reach = low.abs().max(high.abs()).max(section.max_height());
    let (low, high) = (low.min(-0.4 * reach), high.max(0.4 * reach));
    scene.line(section.image_point(low), section.image_point(high), 1.5, palette.strong);
}

/// The extent that *Fit* shows: the lens, the image and the starts of the rays.
fn full_view(section: &SectionDrawing<'_>, layout: &RayLayout) -> Option<BoundingBox> {
    let lens = section.bounds()?;
    let ends = image_extent(section, layout);
    let ends = ends.map(|(low, high)| [section.image_point(low), section.image_point(high)]);
    let high = 1.4 * section.max_height();
    let starts = layout.rays.iter().filter_map(|ray| ray.path.points.first());
    let starts = starts.map(|start| DVec2::new(start.z, start.y.clamp(-high, high)));
    BoundingBox::around(
        [lens.min, lens.max].into_iter().chain(ends.into_iter().flatten()).chain(starts),
    )
}

/// A ray in the colour of its field; a lost one in red to the dot where it ends.
fn draw_ray(scene: &mut Scene, ray: &LayoutRay, palette: &Palette) {
    let points: Vec<DVec2> =
        ray.path.points.iter().map(|p: &Vec3<f64>| DVec2::new(p.z, p.y)).collect();
    if ray.path.fate.is_imaged() {
        return scene.polyline(&points, 1.0, with_alpha(palette.field(ray.field), 190));
    }
    scene.polyline(&points, 1.0, with_alpha(palette.lost_ray, 110));
    if let Some(end) = points.last() {
        scene.dot(*end, 5.0, palette.lost_ray);
    }
}

const fn with_alpha([r, g, b, _]: Rgba, alpha: u8) -> Rgba {
    [r, g, b, alpha]
}
