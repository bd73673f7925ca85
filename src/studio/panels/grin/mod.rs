//! A slice through a gradient-index field with rays bending through it, live while the field forms.
//!
//! A task that comes with the program or from a file is worked on in the background; a volume is
//! only looked at. Index, slope, change and error are colours with contours; the pointer reads them
//! anywhere, and a click keeps the place.

mod controls;
mod images;
mod legend;
mod picture;
mod plots;
mod text;

pub(in crate::studio) use controls::DEFAULT_NODES;

use egui::{Button, Frame, Margin, Panel as Side, ScrollArea, Ui};

use super::Panel;
use crate::grin_design::LightView as TaskView;
use crate::math::Vec3;
use crate::session::{GrinRun, SessionView};
use crate::studio::actions::Actions;
use crate::studio::draw::RenderBackend;
use crate::studio::text::capitalize;
use controls::TaskMenu;
use images::ViewImages;
use picture::SlicePicture;

/// The introduction that is shown before a document is open.
const INTRODUCTION: &str = "A task prescribes where light must go; the optimizer finds the \
    field of refractive index that sends it there. Open a task and press Optimize: the slice shows \
    the field and its rays. A volume from a file can be inspected in the same way.";

/// The width of the side panel; with less room than the second number it is below the drawing, and
/// with less height than the third it is hidden.
const SIDE_WIDTH: f32 = 330.0;
const MIN_WIDTH: f32 = 640.0;
const MIN_HEIGHT: f32 = 240.0;

/// A page of the numbers.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
enum GrinPage {
    /// The results of every view, and the cost of the tracing.
    #[default]
    Light,
    /// The loss against the steps.
    Loss,
    /// The index along a line.
    Profile,
    /// Images beside their pictures.
    Images,
}

const PAGES: [(GrinPage, &str, &str); 4] = [
    (GrinPage::Light, "Light", "Every view: spot or image, rays and excluded rays, error and time"),
    (GrinPage::Loss, "Loss", "The loss against the steps of the optimization"),
    (GrinPage::Profile, "Profile", "The index along the radius, or along a line through the slice"),
    (GrinPage::Images, "Images", "Images on the screens beside their targets"),
];

/// The panel.
#[derive(Debug)]
pub struct GrinPanel {
    tasks: TaskMenu,
    picture: SlicePicture,
    images: ViewImages,
    page: GrinPage,
    /// A pinned point, in any slice.
    pinned: Option<Vec3<f64>>,
    /// The document that was shown last.
    shown_run: Option<u64>,
}

impl GrinPanel {
    /// An empty panel.
    pub fn new(backend: RenderBackend) -> Self {
        Self {
            tasks: TaskMenu::new(),
            picture: SlicePicture::new(backend),
            images: ViewImages::default(),
            page: GrinPage::default(),
            pinned: None,
            shown_run: None,
        }
    }
}

impl Panel for GrinPanel {
    fn title(&self) -> &'static str {
        "GRIN slice"
    }

    fn ui(&mut self, ui: &mut Ui, view: &SessionView, actions: &mut Actions) {
        self.sync_page(view);
        self.tasks.bar(ui, view, actions);
        if let Some(why) = &view.grin.run.error {
            ui.colored_label(ui.visuals().error_fg_color, capitalize(why));
        }
        let Some(run) = view.grin.run.snapshot.clone() else {
            if view.grin.opening {
                ui.weak("Opening…");
            } else {
                self.tasks.list(ui, INTRODUCTION, actions);
            }
            return;
        };
        controls::progress(ui, view, &run);
        controls::slice_controls(ui, view, &run, &mut self.picture, actions);
        self.side_panel(ui, view, &run);
        self.picture(ui, view, &run);
    }
}

impl GrinPanel {
    /// Turns to the page of a newly opened document.
    fn sync_page(&mut self, view: &SessionView) {
        let number = view.grin.run.id.map(|run| run.number);
        if number != self.shown_run {
            self.shown_run = number;
            self.pinned = None;
            self.picture.fit();
            self.page =
                if view.grin.run.snapshot.as_ref().is_some_and(|run| run.document.task.is_none()) {
                    GrinPage::Profile
                } else {
                    GrinPage::Light
                };
        }
    }

    /// The side panel, beside the drawing or below it, if there is room.
    fn side_panel(&mut self, ui: &mut Ui, view: &SessionView, run: &GrinRun) {
        let frame = Frame::new().inner_margin(Margin { left: 8, top: 2, ..Margin::ZERO });
        let side = if ui.available_width() >= MIN_WIDTH {
            Side::right("numbers of the field").default_size(SIDE_WIDTH).size_range(240.0..=560.0)
        } else if ui.available_height() >= MIN_HEIGHT {
            let half = 0.45 * ui.available_height();
            Side::bottom("numbers below the field").exact_size(half)
        } else {
            return;
        };
        side.frame(frame).show(ui, |ui| {
            self.pages(ui, run);
            let scroll =
                ScrollArea::vertical().id_salt(self.page as u8).auto_shrink([false, false]);
            scroll.show(ui, |ui| match self.page {
                GrinPage::Light => text::light_page(ui, view, run),
                GrinPage::Loss => plots::loss_plot(ui, run),
                GrinPage::Profile => plots::profile_plot(ui, view),
                GrinPage::Images => self.images.ui(ui, view, run),
            });
        });
    }

    fn pages(&mut self, ui: &mut Ui, run: &GrinRun) {
        let task = run.document.task.as_ref();
        let is_image = |view: &TaskView| view.goal.is_image();
        let has_images = task.is_some_and(|task| task.views.iter().any(is_image));
        if self.page == GrinPage::Images && !has_images {
            self.page = GrinPage::Light;
        }
        ui.horizontal(|ui| {
            ui.spacing_mut().item_spacing.x = 2.0;
            for (page, name, hint) in PAGES {
                let enabled = match page {
                    GrinPage::Profile => true,
                    GrinPage::Light | GrinPage::Loss => task.is_some(),
                    GrinPage::Images => has_images,
                };
                let button = Button::selectable(self.page == page, name);
                if ui.add_enabled(enabled, button).on_hover_text(hint).clicked() {
                    self.page = page;
                }
            }
        });
        ui.separator();
    }

    fn picture(&mut self, ui: &mut Ui, view: &SessionView, run: &GrinRun) {
        match view.grin.slice.as_deref() {
            Some(Ok(slice)) => {
                text::pinned_line(ui, run, &mut self.pinned);
                self.picture.ui(ui, view, slice, &mut self.pinned);
            }
            Some(Err(why)) => {
                ui.colored_label(ui.visuals().error_fg_color, capitalize(why));
            }
            None => {
                ui.weak("Computing the slice…");
            }
        }
    }
}
