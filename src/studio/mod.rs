//! The window: panels read a view and push commands.
//!
//! **A panel changes nothing**: it gets a view of the design and writes down actions.

mod actions;
mod app;
pub mod arrangement;
mod cached;
mod candidate_bar;
pub mod colormap;
mod command_palette;
mod dialogs;
pub mod dock;
pub mod draw;
mod dropped;
mod element_dialog;
mod experiment_window;
pub mod file_dialog;
mod form;
pub mod input_order;
mod library_window;
mod manual;
mod menu;
mod menu_items;
mod new_lens;
pub mod number;
pub mod palette;
pub mod panels;
mod run_items;
pub mod section;
mod session_benchmark;
mod shortcut_list;
mod stored_picture;
pub mod text;
pub mod text_input;
pub mod theme;
mod thumbnails;
mod unsaved;
pub mod window;
mod window_benchmark;

pub use actions::{Actions, UiAction};
pub use app::Studio;
pub use dialogs::DialogKind;
pub use element_dialog::ElementTask;
pub use window_benchmark::{WindowMetrics, measure_window};

use std::path::Path;

use window::{Persistence, StudioError};

use crate::files;
use crate::lens::{Lens, blank};
use crate::session::{Command, Session};

/// Opens the studio on a file, or on the first lens that comes with the program, and returns once
/// the window is closed.
///
/// # Errors
/// No window can open: see [`StudioError`]. A file that cannot be read is reported in the window.
pub fn run(path: Option<&Path>) -> Result<(), StudioError> {
    window::open_window(Persistence::Enabled, |context, backend| {
        let wake = context.egui_ctx.clone();
        let mut session = Session::new(first_lens(), move || wake.request_repaint())?;
        if let Some(folder) = eframe::storage_dir("aplanat") {
            session.set_save_folder(folder.join("searches"));
            session.set_field_folder(folder.join("fields"));
            session.set_design_folder(folder.join("designs"));
            let wake = context.egui_ctx.clone();
            session.set_journal_folder(folder.join("journals"), move || wake.request_repaint())?;
        }
        if path.is_none() {
            session.recover();
        }
        let mut studio = Studio::new(session, backend, Persistence::Enabled, context.storage);
        if let Some(path) = path {
            studio.apply(&context.egui_ctx, Command::Open(path.to_owned()));
            studio.session_mut().tell_unfinished();
        }
        Ok(Box::new(studio))
    })
}

/// The lens that the studio opens with.
fn first_lens() -> Lens {
    let first = files::bundled_lenses().first();
    let read = first.and_then(|lens| files::parse(lens.text.as_bytes(), lens.name).ok());
    read.map_or_else(blank, |opened| opened.lens)
}
