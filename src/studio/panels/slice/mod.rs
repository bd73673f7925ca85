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
mod words;

pub(in crate::studio) use controls::NODES;

use eframe::egui::{Button, Frame, Margin, Panel as Side, ScrollArea, Ui};

use super::Panel;
use crate::grin_task::View as TaskView;
use crate::math::Vec3;
use crate::session::{Command, Form, Formation, View};
use crate::studio::draw::Backing;
use crate::studio::wording::capital;
use controls::Tasks;
use images::Images;
use picture::Picture;

/// What the panel is about, before anything is open.
const WHAT: &str = "Which field of refractive index bends light as a task wants it? Open a task and \
    press Optimize: the field forms while you look at a slice of it, with rays through it. A volume \
    from a file is shown alike. Nothing is computed before something is open.";

/// The width of the numbers beside the picture; with less room than the second number they stand
/// below it, and with less height than the third there are none.
const NUMBERS: f32 = 330.0;
const ROOMY: f32 = 640.0;
const HIGH: f32 = 240.0;

/// A page of the numbers.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
enum Page {
    /// The light of every view, and what the tracing costs.
    #[default]
    Light,
    /// The loss against the steps.
    Loss,
    /// The index along a line.
    Profile,
    /// Images beside their pictures.
    Images,
}

const PAGES: [(Page, &str, &str); 4] = [
    (Page::Light, "Light", "Every view: spot or image, rays and those left out, error and time"),
    (Page::Loss, "Loss", "The loss against the steps of the search"),
    (Page::Profile, "Profile", "The index along the radius, or along a line through the slice"),
    (Page::Images, "Images", "What light makes on screens beside what is wanted there"),
];

/// The panel.
#[derive(Debug)]
pub struct GrinSlice {
    tasks: Tasks,
    picture: Picture,
    images: Images,
    page: Page,
    /// A place that was clicked, whatever slice is shown.
    pinned: Option<Vec3<f64>>,
    /// What the panel was turned to last.
    shown: Option<u64>,
}

impl GrinSlice {
    /// An empty panel.
    pub fn new(backing: Backing) -> Self {
        Self {
            tasks: Tasks::new(),
            picture: Picture::new(backing),
            images: Images::default(),
            page: Page::default(),
            pinned: None,
            shown: None,
        }
    }
}

impl Panel for GrinSlice {
    fn title(&self) -> &'static str {
        "GRIN slice"
    }

    fn ui(&mut self, ui: &mut Ui, view: &View, wishes: &mut Vec<Command>) {
        self.turn(view);
        self.tasks.bar(ui, view, wishes);
        if let Some(why) = &view.forming.failed {
            ui.colored_label(ui.visuals().error_fg_color, capital(why));
        }
        let Some(run) = view.forming.run.clone() else {
            if view.forming.opening {
                ui.weak("Opening…");
            } else {
                self.tasks.list(ui, WHAT, wishes);
            }
            return;
        };
        controls::progress(ui, view, &run);
        controls::sight(ui, view, &run, &mut self.picture, wishes);
        self.beside(ui, view, &run);
        self.picture(ui, view, &run);
    }
}

impl GrinSlice {
    /// Turns to what is newly open.
    fn turn(&mut self, view: &View) {
        let number = view.forming.run.as_ref().map(|run| run.number);
        if number != self.shown {
            self.shown = number;
            self.pinned = None;
            self.picture.fit();
            self.page = if view.forming.run.as_ref().is_some_and(|run| run.subject.task.is_none()) {
                Page::Profile
            } else {
                Page::Light
            };
        }
    }

    /// The numbers, beside the picture or below it, where there is room.
    fn beside(&mut self, ui: &mut Ui, view: &View, run: &Formation) {
        let frame = Frame::new().inner_margin(Margin { left: 8, top: 2, ..Margin::ZERO });
        let side = if ui.available_width() >= ROOMY {
            Side::right("numbers of the field").default_size(NUMBERS).size_range(240.0..=560.0)
        } else if ui.available_height() >= HIGH {
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
                Page::Light => words::light(ui, view, run),
                Page::Loss => plots::loss(ui, run),
                Page::Profile => plots::profile(ui, view),
                Page::Images => self.images.ui(ui, view, run),
            });
        });
    }

    fn pages(&mut self, ui: &mut Ui, run: &Formation) {
        let task = run.subject.task.as_ref();
        let is_image = |view: &TaskView| view.goal.is_image();
        let has_images = task.is_some_and(|task| task.views.iter().any(is_image));
        if self.page == Page::Images && !has_images {
            self.page = Page::Light;
        }
        ui.horizontal(|ui| {
            ui.spacing_mut().item_spacing.x = 2.0;
            for (page, name, hint) in PAGES {
                let enabled = match page {
                    Page::Profile => true,
                    Page::Light | Page::Loss => task.is_some(),
                    Page::Images => has_images,
                };
                let button = Button::selectable(self.page == page, name);
                if ui.add_enabled(enabled, button).on_hover_text(hint).clicked() {
                    self.page = page;
                }
            }
        });
        ui.separator();
    }

    fn picture(&mut self, ui: &mut Ui, view: &View, run: &Formation) {
        match view.forming.slice.as_deref() {
            Some(Ok(slice)) => {
                words::pinned(ui, run, &mut self.pinned);
                self.picture.ui(ui, view, slice, &mut self.pinned);
            }
            Some(Err(why)) => {
                ui.colored_label(ui.visuals().error_fg_color, capital(why));
            }
            None => {
                ui.weak("Laying the slice…");
            }
        }
    }
}

/// The wish for something of the field.
fn wish(form: Form) -> Command {
    Command::Form(form)
}
