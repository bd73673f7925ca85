//! Asking for a file: the desktop's own dialog in a thread of its own, so that the window goes on
//! meanwhile, or a line to type a path into where the desktop has no dialog.

use std::path::{Path, PathBuf};
use std::sync::mpsc::{Receiver, TryRecvError, channel};
use std::thread;

use eframe::egui::{self, Key};

/// What a file is asked for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Purpose {
    /// To read a lens from it, of any known form.
    Open,
    /// To write the lens in our own form.
    Save,
    /// To write the lens as Zemax reads it.
    ExportZemax,
    /// To write a copy of the lens in our own form.
    ExportJson,
    /// To write a front into a folder.
    ExportFront,
    /// To write the data and pictures of an experiment into it.
    ExperimentFolder,
    /// To go on with a search over structure.
    OpenSearch,
    /// To save a search over structure to it.
    SaveSearch,
    /// To write the lens of a generation of a search.
    ExportFound(u64),
    /// To read a task or a volume from it, and look at the gradient-index field.
    OpenField,
    /// To write the gradient-index field, with so many nodes along a side.
    SaveField(usize),
}

impl Purpose {
    const fn title(self) -> &'static str {
        match self {
            Self::Open => "Open a lens",
            Self::Save => "Save the lens",
            Self::ExportZemax => "Export the lens for Zemax",
            Self::ExportJson => "Export a copy of the lens",
            Self::ExportFront => "Export the front into a folder",
            Self::ExperimentFolder => "Save the experiment into a folder",
            Self::OpenSearch => "Go on with a search",
            Self::SaveSearch => "Save the search",
            Self::ExportFound(_) => "Export the lens of the search",
            Self::OpenField => "Open a GRIN task or a volume",
            Self::SaveField(_) => "Save the volume",
        }
    }

    const fn extensions(self) -> &'static [&'static str] {
        match self {
            Self::Open => &["json", "zmx", "ZMX"],
            Self::Save | Self::ExportJson | Self::OpenSearch | Self::SaveSearch => &["json"],
            Self::ExportFound(_) => &["json", "zmx"],
            Self::ExportZemax => &["zmx"],
            Self::OpenField => &["json", "npz"],
            Self::SaveField(_) => &["npz", "json"],
            Self::ExportFront | Self::ExperimentFolder => &[],
        }
    }

    /// What files of this kind are called.
    const fn kind(self) -> &'static str {
        if matches!(self, Self::OpenField | Self::SaveField(_)) { "GRIN fields" } else { "Lenses" }
    }

    /// Whether the name of a new file is asked for.
    fn names_a_file(self) -> bool {
        self.is_written() && !matches!(self, Self::ExportFront | Self::ExperimentFolder)
    }

    /// Whether the file is written.
    fn is_written(self) -> bool {
        !matches!(self, Self::Open | Self::OpenSearch | Self::OpenField)
    }

    /// The path with the extension that it needs, if it has none.
    fn complete(self, path: PathBuf) -> PathBuf {
        match self.extensions().first() {
            Some(extension) if self.is_written() && path.extension().is_none() => {
                path.with_extension(extension)
            }
            _ => path,
        }
    }
}

/// Asks for files, one at a time.
#[derive(Debug, Default)]
pub struct Chooser {
    asked: Option<(Purpose, Receiver<Option<PathBuf>>)>,
    typed: Option<(Purpose, String)>,
}

impl Chooser {
    /// Asks with the desktop's dialog, or with a line to type into where it has none.
    pub fn ask(&mut self, context: &egui::Context, purpose: Purpose, near: Option<&Path>) {
        if self.asked.is_some() {
            return;
        }
        match has_dialogs().then(|| open_dialog(context, purpose, near)) {
            Some(Ok(answer)) => self.asked = Some((purpose, answer)),
            Some(Err(error)) => {
                log::warn!("no file dialog: {error}");
                self.ask_for_path(purpose, near);
            }
            None => self.ask_for_path(purpose, near),
        }
    }

    /// Whether a question waits for its answer.
    pub const fn is_open(&self) -> bool {
        self.asked.is_some() || self.typed.is_some()
    }

    /// Asks with a line to type a path into.
    pub fn ask_for_path(&mut self, purpose: Purpose, near: Option<&Path>) {
        let near =
            if purpose == Purpose::ExperimentFolder { near.and_then(Path::parent) } else { near };
        let start = near.map(|path| path.display().to_string()).unwrap_or_default();
        self.typed = Some((purpose, start));
    }

    /// Shows the line, if there is one, and gives the file once it is chosen.
    pub fn ui(&mut self, context: &egui::Context) -> Option<(Purpose, PathBuf)> {
        self.answered().or_else(|| self.typed_path(context))
    }

    fn answered(&mut self) -> Option<(Purpose, PathBuf)> {
        let (purpose, answer) = self.asked.as_ref()?;
        let path = match answer.try_recv() {
            Err(TryRecvError::Empty) => return None,
            Err(TryRecvError::Disconnected) => None,
            Ok(path) => path.map(|path| (*purpose, purpose.complete(path))),
        };
        self.asked = None;
        path
    }

    fn typed_path(&mut self, context: &egui::Context) -> Option<(Purpose, PathBuf)> {
        let (purpose, text) = self.typed.as_mut()?;
        let purpose = *purpose;
        let mut done = false;
        let modal = egui::Modal::new(egui::Id::unique("path")).show(context, |ui| {
            ui.heading(purpose.title());
            let label = ui.label("Path");
            let line = egui::TextEdit::singleline(text).desired_width(420.0);
            let field = ui.add(line).labelled_by(label.id);
            if !field.lost_focus() {
                field.request_focus();
            }
            ui.horizontal(|ui| {
                done = ui.button("OK").clicked() || ui.input(|i| i.key_pressed(Key::Enter));
                if ui.button("Cancel").clicked() {
                    ui.close();
                }
            });
        });
        let path = PathBuf::from(text.trim());
        if done && !path.as_os_str().is_empty() {
            self.typed = None;
            return Some((purpose, purpose.complete(path)));
        }
        if modal.should_close() {
            self.typed = None;
        }
        None
    }
}

fn open_dialog(
    context: &egui::Context,
    purpose: Purpose,
    near: Option<&Path>,
) -> std::io::Result<Receiver<Option<PathBuf>>> {
    let (give, answer) = channel();
    let mut dialog = rfd::FileDialog::new().set_title(purpose.title());
    if !purpose.extensions().is_empty() {
        dialog = dialog.add_filter(purpose.kind(), purpose.extensions());
    }
    if let Some(directory) = near.and_then(Path::parent).filter(|dir| dir.is_dir()) {
        dialog = dialog.set_directory(directory);
    }
    if let Some(name) = near.and_then(Path::file_name).filter(|_| purpose.names_a_file()) {
        dialog = dialog.set_file_name(name.to_string_lossy());
    }
    let context = context.clone();
    thread::Builder::new().name("file dialog".into()).spawn(move || {
        let path = match purpose {
            Purpose::Open | Purpose::OpenSearch | Purpose::OpenField => dialog.pick_file(),
            Purpose::ExportFront | Purpose::ExperimentFolder => dialog.pick_folder(),
            _ => dialog.save_file(),
        };
        // Nobody listens when the window was closed before the dialog.
        drop(give.send(path));
        context.request_repaint();
    })?;
    Ok(answer)
}

/// Whether a dialog can be expected: on Linux it comes over the session bus or from `zenity`.
fn has_dialogs() -> bool {
    if !cfg!(target_os = "linux") {
        return true;
    }
    let bus = std::env::var_os("DBUS_SESSION_BUS_ADDRESS").is_some();
    let paths = std::env::var_os("PATH").unwrap_or_default();
    bus || std::env::split_paths(&paths).any(|dir| dir.join("zenity").is_file())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_written_file_gets_its_extension() {
        let complete = |purpose: Purpose, path: &str| purpose.complete(PathBuf::from(path));
        assert_eq!(complete(Purpose::Save, "a/lens"), PathBuf::from("a/lens.json"));
        assert_eq!(complete(Purpose::Save, "a/lens.v2"), PathBuf::from("a/lens.v2"));
        assert_eq!(complete(Purpose::ExportZemax, "lens"), PathBuf::from("lens.zmx"));
        assert_eq!(complete(Purpose::Open, "lens"), PathBuf::from("lens"));
        assert_eq!(complete(Purpose::ExportFront, "front"), PathBuf::from("front"));
    }
}
