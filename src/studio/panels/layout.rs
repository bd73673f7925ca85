//! The lens in section, with its rays.
//!
//! While a search runs, its current lens is shown as it bends, over the outlines of the design; glass
//! that the design does not have is tinted.

use std::sync::Arc;

use eframe::egui::{Align, ComboBox, DragValue, Layout as Arrange, RichText, Stroke, Ui};
use glam::DVec2;

use super::{Panel, field_name, no_numbers, shown, swatch, zoom_name};
use crate::lens::System;
use crate::math::Vec3;
use crate::session::{Command, DrawnRay, Layout, Numbers, Results, View, fresh_glass};
use crate::studio::draw::{Backing, Bounds, Colour, Scene, Shown, Stage};
use crate::studio::number;
use crate::studio::palette::{Palette, color32};
use crate::studio::section::Section;
use crate::trace::Fates;

/// How near the pointer must be to a surface to name it, in points.
const NEAR: f64 = 6.0;

/// The panel.
#[derive(Debug)]
pub struct LensLayout {
    backing: Backing,
    stage: Stage,
    drawing: Option<Drawing>,
}

/// What is drawn, and from what it was.
#[derive(Debug)]
struct Drawing {
    source: Source,
    scene: Arc<Scene>,
    whole: Bounds,
    system: System<f64>,
    reached: Vec<f64>,
    fates: Fates,
    /// Fields without rays, and why.
    dark: Vec<(usize, String)>,
    /// How many pieces of glass the design does not have.
    fresh: usize,
}

/// All on which a drawing depends.
#[derive(Debug, Clone)]
struct Source {
    /// What is drawn.
    shown: Arc<Results>,
    /// The design, drawn faintly below the lens of a search.
    ghost: Option<Arc<Results>>,
    palette: Palette,
}

impl PartialEq for Source {
    /// Results are compared by address, which cannot be another's while they are held.
    fn eq(&self, other: &Self) -> bool {
        let ghost = match (&self.ghost, &other.ghost) {
            (Some(a), Some(b)) => Arc::ptr_eq(a, b),
            (None, None) => true,
            _ => false,
        };
        ghost && Arc::ptr_eq(&self.shown, &other.shown) && self.palette == other.palette
    }
}

impl LensLayout {
    /// An empty panel.
    pub const fn new(backing: Backing) -> Self {
        Self { backing, stage: Stage::new("layout"), drawing: None }
    }
}

impl Panel for LensLayout {
    fn title(&self) -> &'static str {
        "Layout"
    }

    fn ui(&mut self, ui: &mut Ui, view: &View, wishes: &mut Vec<Command>) {
        self.refresh(ui, view);
        self.header(ui, view, wishes);
        let Some(drawing) = &self.drawing else { return no_numbers(ui, view) };
        let label = format!("Section of {}", view.lens.name);
        let shown = self.stage.show(ui, self.backing, &drawing.scene, drawing.whole, &label);
        let near = drawing.name_surface(ui, view, &shown);
        if shown.response.clicked() && near != view.selected {
            wishes.push(Command::Select(near));
        }
    }
}

impl LensLayout {
    fn refresh(&mut self, ui: &Ui, view: &View) {
        let Some(source) = Source::of(ui, view) else {
            self.drawing = None;
            return;
        };
        if self.drawing.as_ref().is_none_or(|drawing| drawing.source != source) {
            self.drawing = Drawing::new(source);
        }
    }

    fn header(&mut self, ui: &mut Ui, view: &View, wishes: &mut Vec<Command>) {
        ui.horizontal(|ui| {
            self.legend(ui, view);
            ui.with_layout(Arrange::right_to_left(Align::Center), |ui| {
                if ui.button("Fit").on_hover_text("Show the whole lens (double click)").clicked() {
                    self.stage.fit();
                }
                rays(ui, view, wishes);
                zoom_position(ui, view, wishes);
            });
        });
    }

    /// The colours of the fields, and what became of the rays.
    fn legend(&self, ui: &mut Ui, view: &View) {
        let palette = Palette::of(ui.visuals());
        let fields = view.lens.fields_at(view.settings.zoom);
        for (i, field) in fields.values.iter().enumerate() {
            let color = color32(palette.field(i));
            swatch(ui, color);
            ui.label(RichText::new(field_name(fields.kind, *field)).color(color));
            ui.add_space(4.0);
        }
        let Some(drawing) = &self.drawing else { return };
        if let Some(text) = losses(drawing.fates) {
            let color = color32(palette.lost);
            swatch(ui, color);
            ui.label(RichText::new(text).color(color))
                .on_hover_text("Rays are drawn to the place where they are lost, with a dot there");
        }
        if drawing.fresh > 0 {
            swatch(ui, color32(palette.fresh).to_opaque());
            ui.label("new glass").on_hover_text("Glass that the design does not have");
        }
        for (field, why) in &drawing.dark {
            ui.colored_label(ui.visuals().warn_fg_color, format!("Field {}: {why}", field + 1));
        }
    }
}

/// How many rays are lost, by cause; nothing where none is.
fn losses(fates: Fates) -> Option<String> {
    let causes = [
        (fates.clipped, "clipped"),
        (fates.missed, "missed a surface"),
        (fates.total_reflection, "totally reflected"),
        (fates.turned + fates.trapped, "kept by a gradient"),
    ];
    let parts: Vec<String> =
        causes.iter().filter(|(n, _)| *n > 0).map(|(n, how)| format!("{n} {how}")).collect();
    (!parts.is_empty()).then(|| format!("{} of {} rays", parts.join(", "), fates.total()))
}

fn rays(ui: &mut Ui, view: &View, wishes: &mut Vec<Command>) {
    let mut count = view.settings.rays;
    let drag = DragValue::new(&mut count).range(1..=501).speed(0.2).suffix(" rays");
    let drag = ui.add(drag).accessible_name("Rays of each field");
    if drag.on_hover_text("Rays of each field in the drawing").changed() {
        wishes.push(Command::ShowRays(count));
    }
}

fn zoom_position(ui: &mut Ui, view: &View, wishes: &mut Vec<Command>) {
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
    shown.response.accessible_name("Zoom position");
    if chosen != view.settings.zoom {
        wishes.push(Command::ShowZoom(chosen));
    }
}

impl Source {
    fn of(ui: &Ui, view: &View) -> Option<Self> {
        let shown = Arc::clone(shown(view)?.0);
        let ghost = view.results.clone().filter(|design| !Arc::ptr_eq(design, &shown));
        Some(Self { shown, ghost, palette: Palette::of(ui.visuals()) })
    }
}

impl Drawing {
    fn new(source: Source) -> Option<Self> {
        let numbers = source.shown.numbers.as_ref().ok()?;
        let (bench, layout) = (&numbers.bench.value, &numbers.layout.value);
        let palette = source.palette;
        let system = bench.colors[bench.primary].system.clone();
        let section = Section::new(&system, &layout.reached);
        let mut scene = Scene::on(palette.background);
        if let Some(Ok(design)) = source.ghost.as_ref().map(|ghost| &ghost.numbers) {
            draw_ghost(&mut scene, design, &palette);
        }
        let fresh =
            source.ghost.as_ref().map(|design| fresh_glass(&source.shown.lens, &design.lens));
        let fresh = fresh.unwrap_or_default();
        section.draw_glass(&mut scene, &palette, &fresh);
        layout.rays.iter().for_each(|ray| draw_ray(&mut scene, ray, &palette));
        section.draw_outlines(&mut scene, &palette);
        draw_image(&mut scene, &section, layout, &palette);
        Some(Self {
            scene: Arc::new(scene),
            whole: whole(&section, layout)?,
            reached: layout.reached.clone(),
            fates: layout.fates,
            dark: layout.dark.clone(),
            fresh: fresh.len(),
            system,
            source,
        })
    }

    /// Draws the selected surface and the one under the pointer bold; the latter is named and
    /// given back, the image plane excepted.
    fn name_surface(&self, ui: &Ui, view: &View, shown: &Shown) -> Option<usize> {
        let section = Section::new(&self.system, &self.reached);
        let count = self.system.surfaces.len();
        let near = shown.pointer().and_then(|(at, mm)| section.surface_near(at, NEAR * mm));
        let selected = view.selected.filter(|surface| *surface < count && near != view.selected);
        for surface in selected.into_iter().chain(near) {
            let curve = section.outline_of(surface);
            let curve = curve.into_iter().map(|mm| shown.on_screen(mm)).collect();
            let stroke = Stroke::new(2.5, ui.visuals().selection.stroke.color);
            ui.painter_at(shown.response.rect).line(curve, stroke);
        }
        let near = near?;
        shown.response.clone().on_hover_text_at_pointer(self.describe(view, near));
        (near < view.lens.surfaces.len()).then_some(near)
    }

    fn describe(&self, view: &View, surface: usize) -> String {
        let Some(row) = view.lens.surfaces.get(surface) else { return "Image plane".to_owned() };
        let shape = &self.system.surfaces[surface].shape;
        let radius = number::show(number::radius(shape.curvature()));
        let stop = if row.stop { ", the stop" } else { "" };
        let first = format!("Surface {}, radius {radius} mm{stop}", surface + 1);
        let limit = row.semi_diameter.map(|limit| {
            format!("\nsemi-diameter {} mm: rays beyond it are clipped", number::show(limit))
        });
        let reached = self
            .reached
            .get(surface)
            .map(|height| format!("\nrays reach {} mm", number::show_digits(*height, 5)));
        first + &limit.unwrap_or_default() + &reached.unwrap_or_default()
    }
}

/// The outlines of the design, to compare with.
fn draw_ghost(scene: &mut Scene, design: &Numbers, palette: &Palette) {
    let bench = &design.bench.value;
    let system = &bench.colors[bench.primary].system;
    Section::new(system, &design.layout.value.reached).draw_ghost(scene, palette.faint);
}

/// The lowest and the highest place of the image plane that rays reach, with some room.
fn image(layout: &Layout) -> Option<(f64, f64)> {
    let arrived = layout.rays.iter().filter(|ray| ray.path.fate.is_imaged());
    let ends = arrived.filter_map(|ray| Some(DVec2::splat(ray.path.points.last()?.y)));
    let Bounds { min, max } = Bounds::around(ends)?;
    let room = 0.06 * (max.y - min.y);
    Some((min.y - room, max.y + room))
}

fn draw_image(scene: &mut Scene, section: &Section<'_>, layout: &Layout, palette: &Palette) {
    let z = section.image();
    let (low, high) = image(layout).unwrap_or_default();
    let reach = low.abs().max(high.abs()).max(section.highest());
    let (low, high) = (low.min(-0.4 * reach), high.max(0.4 * reach));
    scene.line(DVec2::new(z, low), DVec2::new(z, high), 1.5, palette.strong);
}

/// What *fit* shows: the lens, the image and where the rays come from.
fn whole(section: &Section<'_>, layout: &Layout) -> Option<Bounds> {
    let lens = section.bounds()?;
    let z = section.image();
    let ends = image(layout).map(|(low, high)| [DVec2::new(z, low), DVec2::new(z, high)]);
    let high = 1.4 * section.highest();
    let starts = layout.rays.iter().filter_map(|ray| ray.path.points.first());
    let starts = starts.map(|start| DVec2::new(start.z, start.y.clamp(-high, high)));
    Bounds::around([lens.min, lens.max].into_iter().chain(ends.into_iter().flatten()).chain(starts))
}

/// A ray in the colour of its field; a lost one in red to the dot where it ends.
fn draw_ray(scene: &mut Scene, ray: &DrawnRay, palette: &Palette) {
    let points: Vec<DVec2> =
        ray.path.points.iter().map(|p: &Vec3<f64>| DVec2::new(p.z, p.y)).collect();
    if ray.path.fate.is_imaged() {
        return scene.polyline(&points, 1.0, with_alpha(palette.field(ray.field), 190));
    }
    scene.polyline(&points, 1.0, with_alpha(palette.lost, 110));
    if let Some(end) = points.last() {
        scene.dot(*end, 5.0, palette.lost);
    }
}

const fn with_alpha([r, g, b, _]: Colour, alpha: u8) -> Colour {
    [r, g, b, alpha]
}
