//! File dialogs: the desktop's own, in a thread of its own so that the window stays responsive, or
//! a text field for a path if the desktop has no dialog.

use std::path::{MAIN_SEPARATOR, Path, PathBuf};
use std::sync::mpsc::{Receiver, TryRecvError, channel};
use std::thread;

use egui::Key;

use super::text_input::select_characters;
use crate::report::{FigureFormat, FigureKind, PaperKind};

/// The purpose for which a path is asked.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum FileRequest {
    /// To read a lens from it, of any known form.
    Open,
    /// To insert the surfaces of a lens file behind the selected element.
    InsertLens,
    /// To add the glass catalogue of a maker.
    AddGlasses,
    /// To write the report on the file of another program as text.
    SaveImportReport,
    /// To write the lens in our own form.
    Save,
    /// To write the lens as Zemax or, by the extension, another program reads it.
    ExportZemax,
    /// To write a copy of the lens in our own form.
    ExportJson,
    /// To write a front into a folder.
    ExportFront,
    /// To write the data and pictures of an experiment into it.
    ExperimentFolder,
    /// To resume a search over structure.
    OpenSearch,
    /// To save a search over structure to it.
    SaveSearch,
    /// To write the lens of a generation of a search.
    ExportSearchLens(u64),
    /// To read a task or a volume of a gradient-index field.
    OpenField,
    /// To write the gradient-index field, with this number of nodes along a side.
    SaveField(usize),
    /// To read a picture as the scene of another one.
    OpenScene,
    /// To write the picture of a scene.
    SavePicture,
    /// To write a report, the layout or the solids of the lens.
    ExportPaper(PaperKind),
    /// To write what an analysis shows.
    ExportFigure(FigureKind, FigureFormat),
}

impl FileRequest {
    const fn title(self) -> &'static str {
        match self {
            Self::Open => "Open a lens",
            Self::InsertLens => "Add a lens from a file",
            Self::AddGlasses => "Add a glass catalogue",
            Self::SaveImportReport => "Save the import report",
            Self::Save => "Save the lens",
            Self::ExportZemax => {
                "Export the lens for Zemax (.zmx), CODE V (.seq), OSLO (.len) or ray-optics (.roa)"
            }
            Self::ExportJson => "Export a copy of the lens",
            Self::ExportFront => "Export the front into a folder",
            Self::ExperimentFolder => "Save the experiment into a folder",
            Self::OpenSearch => "Resume a search",
            Self::SaveSearch => "Save the search",
            Self::ExportSearchLens(_) => "Export the lens of the search",
            Self::OpenField => "Open a GRIN task or a volume",
            Self::SaveField(_) => "Save the volume",
            Self::OpenScene => "Open a picture as a scene",
            Self::SavePicture => "Save the picture",
            Self::ExportPaper(PaperKind::Report) => "Export the prescription report",
            Self::ExportPaper(PaperKind::Layout) => "Export the drawing of the layout",
            Self::ExportPaper(PaperKind::Solids) => "Export the elements as solids",
            Self::ExportPaper(PaperKind::ToleranceTable) => "Export the table of tolerances",
            Self::ExportPaper(PaperKind::ToleranceCharts) => "Export the charts of tolerances",
            Self::ExportPaper(PaperKind::Figure(_)) => "Export the analysis",
            Self::ExportFigure(_, FigureFormat::Table) => "Export the numbers of the analysis",
            Self::ExportFigure(..) => "Export the charts of the analysis",
        }
    }

    const fn extensions(self) -> &'static [&'static str] {
        match self {
            Self::Open | Self::InsertLens => {
                &["json", "zmx", "ZMX", "zar", "ZAR", "seq", "SEQ", "len", "LEN", "roa"]
            }
            Self::Save | Self::ExportJson | Self::OpenSearch | Self::SaveSearch => &["json"],
            Self::ExportSearchLens(_) => &["json", "zmx"],
            Self::AddGlasses => &["agf", "AGF", "zar", "ZAR", "yml", "YML", "yaml", "YAML"],
            Self::ExportZemax => &["zmx", "seq", "len", "roa"],
            Self::OpenField => &["json", "npz"],
            Self::SaveField(_) => &["npz", "json"],
            Self::OpenScene => &["png", "PNG", "jpg", "JPG", "jpeg", "JPEG"],
            Self::SavePicture => &["png"],
            Self::SaveImportReport => &["txt"],
            Self::ExportPaper(kind) => kind.extensions(),
            Self::ExportFigure(_, FigureFormat::Table) => &["csv", "png", "svg", "pdf"],
            Self::ExportFigure(_, FigureFormat::Image) => &["png", "csv", "svg", "pdf"],
            Self::ExportFigure(_, FigureFormat::Vector) => &["svg", "csv", "png", "pdf"],
            Self::ExportFigure(_, FigureFormat::Page) => &["pdf", "csv", "png", "svg"],
            Self::ExportFront | Self::ExperimentFolder => &[],
        }
    }

    /// The name of the filter for the extensions.
    const fn filter_name(self) -> &'static str {
        match self {
            Self::OpenField | Self::SaveField(_) => "GRIN fields",
            Self::OpenScene | Self::SavePicture | Self::ExportPaper(PaperKind::ToleranceCharts) => {
                "Pictures"
            }
            Self::AddGlasses => "Glass catalogues",
            Self::ExportPaper(PaperKind::Report) | Self::SaveImportReport => "Reports",
            Self::ExportPaper(PaperKind::Layout) => "Drawings",
            Self::ExportPaper(PaperKind::Solids) => "Solids",
            Self::ExportPaper(PaperKind::ToleranceTable) => "Tables",
            Self::ExportFigure(..) | Self::ExportPaper(PaperKind::Figure(_)) => "Tables and charts",
            _ => "Lenses",
        }
    }

    /// True if the user types the name of a new file.
    fn asks_for_name(self) -> bool {
        self.is_save() && !matches!(self, Self::ExportFront | Self::ExperimentFolder)
    }

    /// True if the file is written.
    fn is_save(self) -> bool {
        let reads = [
            Self::Open,
            Self::InsertLens,
            Self::AddGlasses,
            Self::OpenSearch,
            Self::OpenField,
            Self::OpenScene,
        ];
        !reads.contains(&self)
    }

    /// The path with the extension that it needs, if it has none.
    fn with_extension(self, path: PathBuf) -> PathBuf {
        match self.extensions().first() {
            Some(extension) if self.is_save() && path.extension().is_none() => {
                path.with_extension(extension)
            }
            _ => path,
        }
    }
}

/// Asks for files, one at a time.
#[derive(Debug, Default)]
pub struct FileDialog {
    native: Option<(FileRequest, Receiver<Option<PathBuf>>)>,
    prompt: Option<(FileRequest, String)>,
    /// True until the line has had the cursor.
    is_new: bool,
    /// The path whose file may be replaced once the user says so again.
    existing: Option<PathBuf>,
}

impl FileDialog {
    /// Asks with the desktop's dialog, or with a line to type into where it has none.
    pub fn ask(&mut self, context: &egui::Context, purpose: FileRequest, near: Option<&Path>) {
        if self.native.is_some() {
            return;
        }
        match has_native_dialogs().then(|| open_native(context, purpose, near)) {
            Some(Ok(answer)) => self.native = Some((purpose, answer)),
            Some(Err(error)) => {
                log::warn!("no file dialog: {error}");
                self.ask_in_window(purpose, near);
            }
            None => self.ask_in_window(purpose, near),
        }
    }

    /// True while a dialog is open.
    pub const fn is_open(&self) -> bool {
        self.native.is_some() || self.prompt.is_some()
    }

    /// Asks with a line to type a path into.
    pub fn ask_in_window(&mut self, purpose: FileRequest, near: Option<&Path>) {
        let near =
            if purpose == FileRequest::ExperimentFolder { near.and_then(folder_of) } else { near };
        let mut start = near.map(|path| path.display().to_string()).unwrap_or_default();
        if near.is_some_and(Path::is_dir) && !start.ends_with(MAIN_SEPARATOR) {
            start.push(MAIN_SEPARATOR);
        }
        self.prompt = Some((purpose, start));
        self.is_new = true;
    }

    /// Shows the line, if there is one, and gives the file once it is chosen.
    pub fn ui(&mut self, context: &egui::Context) -> Option<(FileRequest, PathBuf)> {
        self.native_answer().or_else(|| self.prompt_answer(context))
    }

    fn native_answer(&mut self) -> Option<(FileRequest, PathBuf)> {
        let (purpose, answer) = self.native.as_ref()?;
        let path = match answer.try_recv() {
            Err(TryRecvError::Empty) => return None,
            Err(TryRecvError::Disconnected) => None,
            Ok(path) => path.map(|path| (*purpose, purpose.with_extension(path))),
        };
        self.native = None;
        path
    }

    fn prompt_answer(&mut self, context: &egui::Context) -> Option<(FileRequest, PathBuf)> {
        let (purpose, text) = self.prompt.as_mut()?;
        let purpose = *purpose;
        let path = purpose.with_extension(PathBuf::from(text.trim()));
        let replaces = self.existing.as_ref() == Some(&path);
        let mut done = false;
        let modal = egui::Modal::new(egui::Id::unique("path")).show(context, |ui| {
            ui.heading(purpose.title());
            let label = ui.label("Path");
            let line = egui::TextEdit::singleline(text).desired_width(420.0);
            let field = ui.add(line).labelled_by(label.id);
            // A field that has no cursor yet forgets what is selected in it.
            if self.is_new && field.has_focus() {
                self.is_new = false;
                select_characters(ui.ctx(), field.id, stem_of(text));
            }
            if !field.lost_focus() {
                field.request_focus();
            }
            if replaces {
                let words = format!("{} exists already.", path.display());
                ui.colored_label(ui.visuals().warn_fg_color, words);
            }
            ui.horizontal(|ui| {
                let words = if replaces { "Replace the file" } else { "OK" };
                done = ui.button(words).clicked() || ui.input(|i| i.key_pressed(Key::Enter));
                if ui.button("Cancel").clicked() {
                    ui.close();
                }
            });
        });
        if done && purpose.is_save() && path.is_file() && !replaces {
            self.existing = Some(path);
            return None;
        }
        if done && !text.trim().is_empty() {
            (self.prompt, self.existing) = (None, None);
            return Some((purpose, path));
        }
        if modal.should_close() {
            (self.prompt, self.existing) = (None, None);
        }
        None
    }
}

/// The characters of the name of a file in its path, without folder and extension: what is typed first
/// replaces the name that is proposed.
fn stem_of(path: &str) -> std::ops::Range<usize> {
    let name = path.rfind(['/', MAIN_SEPARATOR]).map_or(0, |at| at + 1);
    let dot = path[name..].rfind('.').filter(|at| *at > 0).map_or(path.len(), |at| name + at);
    let count = |end: usize| path[..end].chars().count();
    count(name)..count(dot)
}

/// The folder itself, or that of a file.
fn folder_of(path: &Path) -> Option<&Path> {
    if path.is_dir() { Some(path) } else { path.parent() }
}

fn open_native(
    context: &egui::Context,
    purpose: FileRequest,
    near: Option<&Path>,
) -> std::io::Result<Receiver<Option<PathBuf>>> {
    let (give, answer) = channel();
    let mut dialog = rfd::FileDialog::new().set_title(purpose.title());
    if !purpose.extensions().is_empty() {
        dialog = dialog.add_filter(purpose.filter_name(), purpose.extensions());
    }
    if let Some(directory) = near.and_then(folder_of).filter(|dir| dir.is_dir()) {
        dialog = dialog.set_directory(directory);
    }
    let file = near.filter(|path| purpose.asks_for_name() && !path.is_dir());
    if let Some(name) = file.and_then(Path::file_name) {
        dialog = dialog.set_file_name(name.to_string_lossy());
    }
    let context = context.clone();
    thread::Builder::new().name("file dialog".into()).spawn(move || {
        let path = match purpose {
            FileRequest::Open
            | FileRequest::InsertLens
            | FileRequest::OpenSearch
            | FileRequest::OpenScene
            | FileRequest::OpenField => dialog.pick_file(),
            FileRequest::ExportFront | FileRequest::ExperimentFolder => dialog.pick_folder(),
            _ => dialog.save_file(),
        };
        // Nobody listens when the window was closed before the dialog.
        drop(give.send(path));
        context.request_repaint();
    })?;
    Ok(answer)
}

/// True if the desktop has a file dialog: on Linux it comes over the session bus or from `zenity`.
fn has_native_dialogs() -> bool {
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
    fn the_name_of_a_file_is_what_is_typed_over() {
        for (path, name) in [
            ("/home/a b/New lens f 2.8.json", "New lens f 2.8"),
            ("lens.json", "lens"),
            ("/a.b/lens", "lens"),
            ("/a/Prüf.ü/.lens", ".lens"),
            ("/a/", ""),
            ("", ""),
        ] {
            let chosen: String =
                path.chars().take(stem_of(path).end).skip(stem_of(path).start).collect();
            assert_eq!(chosen, name, "{path}");
        }
    }

    #[test]
    fn a_written_file_gets_its_extension() {
        let complete =
            |purpose: FileRequest, path: &str| purpose.with_extension(PathBuf::from(path));
        assert_eq!(complete(FileRequest::Save, "a/lens"), PathBuf::from("a/lens.json"));
        assert_eq!(complete(FileRequest::Save, "a/lens.v2"), PathBuf::from("a/lens.v2"));
        assert_eq!(complete(FileRequest::ExportZemax, "lens"), PathBuf::from("lens.zmx"));
        let report = FileRequest::ExportPaper(PaperKind::Report);
        assert_eq!(complete(report, "lens"), PathBuf::from("lens.pdf"));
        assert_eq!(complete(report, "lens.html"), PathBuf::from("lens.html"));
        assert_eq!(complete(FileRequest::Open, "lens"), PathBuf::from("lens"));
        assert_eq!(complete(FileRequest::ExportFront, "front"), PathBuf::from("front"));
    }
}
