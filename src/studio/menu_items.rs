//! The requests of the menu bar: menus, keyboard shortcuts, the list of shortcuts and the
//! command palette show the same items.

use std::path::PathBuf;

use egui::{Key, KeyboardShortcut, Modifiers, Theme};

use super::actions::UiAction;
use super::arrangement::Arrangement;
use super::dialogs::DialogKind;
use super::element_dialog::ElementTask;
use super::file_dialog::FileRequest;
use super::panels::PanelKind;
use super::run_items;
use crate::experiments::{self, Effort};
use crate::files::{self, VignettingChoice};
use crate::lens::{Edit, ElementEdit, Lens};
use crate::report::PaperKind;
use crate::session::{Command, PanelSetting, SessionView};

/// Something that can be asked for.
#[derive(Debug, Clone)]
pub(super) struct MenuItem {
    /// The menu in which it is.
    pub(super) menu: &'static str,
    pub(super) title: String,
    pub(super) shortcut: Option<KeyboardShortcut>,
    /// `None` while it makes no sense.
    pub(super) action: Option<UiAction>,
    pub(super) hint: &'static str,
    /// The reason why it makes no sense now, where it is not told by its title.
    pub(super) why_not: &'static str,
    /// True for a line above it in its menu.
    pub(super) separated: bool,
    /// True for a shortcut that belongs to a text field while one is edited.
    pub(super) yields_to_text: bool,
    /// The state of an item that is on or off.
    pub(super) checked: Option<bool>,
}

impl MenuItem {
    pub(super) fn new(
        menu: &'static str,
        title: impl Into<String>,
        action: impl Into<UiAction>,
    ) -> Self {
        Self::maybe(menu, title, Some(action.into()))
    }

    pub(super) fn maybe(
        menu: &'static str,
        title: impl Into<String>,
        action: Option<UiAction>,
    ) -> Self {
        Self {
            menu,
            title: title.into(),
            shortcut: None,
            action,
            hint: "",
            why_not: "",
            separated: false,
            yields_to_text: false,
            checked: None,
        }
    }

    fn key(self, modifiers: Modifiers, key: Key) -> Self {
        Self { shortcut: Some(KeyboardShortcut::new(modifiers, key)), ..self }
    }

    fn control(self, key: Key) -> Self {
        self.key(Modifiers::COMMAND, key)
    }

    fn control_shift(self, key: Key) -> Self {
        self.key(Modifiers::COMMAND.plus(Modifiers::SHIFT), key)
    }

    fn hint(self, hint: &'static str) -> Self {
        Self { hint, ..self }
    }

    fn separated(self) -> Self {
        Self { separated: true, ..self }
    }

    /// True if it can be asked for now.
    pub(super) const fn is_enabled(&self) -> bool {
        self.action.is_some()
    }
}

/// A panel with its title and its state.
#[derive(Debug, Clone, Copy)]
pub(super) struct PanelState {
    pub(super) kind: PanelKind,
    pub(super) title: &'static str,
    pub(super) is_open: bool,
}

/// The state on which the items depend.
#[derive(Debug)]
pub(super) struct MenuContext<'a> {
    pub(super) view: &'a SessionView,
    pub(super) panels: Vec<PanelState>,
    /// The panel that was brought to the front last.
    pub(super) front: PanelKind,
    /// True if that panel alone is shown.
    pub(super) maximized: bool,
    pub(super) recent: &'a [PathBuf],
    pub(super) theme: Theme,
    /// True while the candidate is the preview of an open dialog.
    pub(super) has_preview: bool,
}

impl MenuContext<'_> {
    /// Every item of the menus that is no list of files, lenses or studies.
    pub(super) fn commands(&self) -> Vec<MenuItem> {
        [self.file(), self.edit(), self.element(), self.view(), help()].concat()
    }

    /// Every item.
    pub(super) fn all(&self) -> Vec<MenuItem> {
        let lists = [
            run_items::commands(self.view, self.has_preview),
            self.recent(),
            bundled_lenses(),
            library_lenses(),
            self.settings(),
            run_items::settings(self.view),
            studies(),
        ];
        self.commands().into_iter().chain(lists.into_iter().flatten()).collect()
    }

    pub(super) fn file(&self) -> Vec<MenuItem> {
        const MENU: &str = "File";
        let save = if self.view.path.is_some() {
            UiAction::Run(Command::Save(None))
        } else {
            FileRequest::Save.into()
        };
        let front = self.view.pareto.run.snapshot.is_some();
        vec![
            MenuItem::new(MENU, "New…", DialogKind::NewLens)
                .control(Key::N)
                .hint("Begin a lens: focal length, aperture, fields, wavelengths, object"),
            MenuItem::new(
                MENU,
                "New from specification…",
                UiAction::ShowPanel(PanelKind::Specification),
            )
            .control_shift(Key::N)
            .hint(
                "Design a lens: focal length, aperture, field, and the limits that it has to keep",
            ),
            MenuItem::new(MENU, "Open or import…", FileRequest::Open).control(Key::O),
            MenuItem::new(MENU, "Lens library…", DialogKind::Library)
                .control(Key::L)
                .hint("Browse published lenses by type, focal length, aperture and words"),
            MenuItem::new(MENU, "Add glass catalogue…", FileRequest::AddGlasses)
                .hint("The glasses of a maker, .agf, .zar or .yml; they stay for later sessions"),
            MenuItem::new(MENU, "Save", save).control(Key::S).separated(),
            MenuItem::new(MENU, "Save as…", FileRequest::Save).control_shift(Key::S),
            MenuItem::new(MENU, "Export for Zemax…", FileRequest::ExportZemax)
                .control(Key::E)
                .hint("As .zmx, or for CODE V .seq, OSLO .len and ray-optics .roa"),
            MenuItem::new(MENU, "Export a copy as JSON…", FileRequest::ExportJson),
            MenuItem::new(MENU, "Export report…", FileRequest::ExportPaper(PaperKind::Report))
                .hint("Data, layout, spots, MTF, effects and weights as PDF or HTML"),
            MenuItem::new(MENU, "Export drawing…", FileRequest::ExportPaper(PaperKind::Layout))
                .hint("The layout to scale as PDF, SVG or DXF"),
            MenuItem::new(MENU, "Export STEP…", FileRequest::ExportPaper(PaperKind::Solids))
                .hint("The elements as solids for mechanical design"),
            MenuItem::maybe(
                MENU,
                "Export the Pareto front…",
                front.then(|| FileRequest::ExportFront.into()),
            ),
            MenuItem::new(MENU, "Quit", UiAction::Quit).control(Key::Q).separated(),
        ]
    }

    pub(super) fn edit(&self) -> Vec<MenuItem> {
        const MENU: &str = "Edit";
        let step = |name: &str, title: &Option<String>, command: Command| {
            let text = title.as_ref().map_or_else(|| name.to_owned(), |t| format!("{name}: {t}"));
            let action = title.is_some().then(|| command.into());
            MenuItem { yields_to_text: true, ..MenuItem::maybe(MENU, text, action) }
        };
        vec![
            step("Undo", &self.view.undo, Command::Undo).control(Key::Z),
            step("Redo", &self.view.redo, Command::Redo).control_shift(Key::Z),
            MenuItem::new(MENU, "Find a command…", DialogKind::CommandPalette)
                .control(Key::K)
                .separated()
                .hint("Search all commands, panels, lenses and settings by words"),
        ]
    }

    pub(super) fn element(&self) -> Vec<MenuItem> {
        let lens = &self.view.lens;
        let mut items = vec![
            MenuItem::new("Element", "Add an element…", DialogKind::Element(ElementTask::Add))
                .control_shift(Key::A)
                .hint("A singlet or a cemented doublet of some focal length"),
            MenuItem::new("Element", "Add a lens from a file…", FileRequest::InsertLens)
                .hint("Insert the surfaces of a lens file behind the selected element"),
        ];
        items.extend(element_items(lens, self.view.selected));
        items.push(
            MenuItem::new(
                "Element",
                "Scale to a focal length…",
                DialogKind::Element(ElementTask::Scale),
            )
            .control_shift(Key::F)
            .separated()
            .hint("Multiply every length of the lens, so that it has this focal length"),
        );
        items
    }

    pub(super) fn view(&self) -> Vec<MenuItem> {
        const MENU: &str = "View";
        const KEYS: [Key; 10] = [
            Key::Num1,
            Key::Num2,
            Key::Num3,
            Key::Num4,
            Key::Num5,
            Key::Num6,
            Key::Num7,
            Key::Num8,
            Key::Num9,
            Key::Num0,
        ];
        let panels = self.panels.iter().enumerate().map(|(i, panel)| {
            let item = MenuItem::new(MENU, panel.title, UiAction::TogglePanel(panel.kind));
            let item = item.hint(panel.kind.contents());
            let item = MenuItem { checked: Some(panel.is_open), ..item };
            KEYS.get(i).map_or(item.clone(), |key| item.control(*key))
        });
        let mut items: Vec<MenuItem> = panels.collect();
        items.extend(self.arrangements());
        items
    }

    /// One panel alone, and the arrangements of all panels.
    fn arrangements(&self) -> [MenuItem; 6] {
        const MENU: &str = "View";
        let front = self.panels.iter().find(|panel| panel.kind == self.front);
        let (title, kind) = if self.maximized {
            ("Show all panels".to_owned(), None)
        } else {
            let title = front.map_or("panel", |panel| panel.title);
            (format!("Maximize: {title}"), Some(self.front))
        };
        let arrange = |title: &str, arrangement| {
            MenuItem::new(MENU, title, UiAction::ArrangePanels(arrangement))
        };
        [
            MenuItem::new(MENU, title, UiAction::MaximizePanel(kind))
                .key(Modifiers::NONE, Key::F11)
                .separated()
                .hint("The panel that was opened last has all the room, until all are shown again"),
            MenuItem::new(MENU, "Next panel", UiAction::StepPanel(1))
                .key(Modifiers::NONE, Key::F6)
                .hint("Gives the keyboard to the next panel that is seen"),
            MenuItem::new(MENU, "Previous panel", UiAction::StepPanel(-1))
                .key(Modifiers::SHIFT, Key::F6)
                .hint("Gives the keyboard to the previous panel that is seen"),
            arrange("Arrangement for a search", Arrangement::Search)
                .hint("The layout large, and beside it the lenses that the search has found"),
            arrange("Arrangement for a large window", Arrangement::Large)
                .hint("Most panels beside each other: from about 2000 points of width on"),
            arrange("Default arrangement", Arrangement::Default),
        ]
    }

    /// The files that were opened or saved last, the newest first.
    pub(super) fn recent(&self) -> Vec<MenuItem> {
        let open = |path: &PathBuf| {
            let title = path.display().to_string();
            MenuItem::new("Recent file", title, Command::Open(path.clone()))
        };
        self.recent.iter().map(open).collect()
    }

    /// Settings of the window and of the analyses.
    pub(super) fn settings(&self) -> Vec<MenuItem> {
        const MENU: &str = "Setting";
        let themes = [(Theme::Dark, "Dark theme"), (Theme::Light, "Light theme")];
        let themes = themes.map(|(theme, title)| {
            let item = MenuItem::new(MENU, title, UiAction::SetTheme(theme));
            MenuItem { checked: Some(self.theme == theme), ..item }
        });
        let errors = [(1e-2, "1 %"), (1e-3, "0.1 %"), (1e-4, "0.01 %")].map(|(error, text)| {
            let title = format!("Accuracy of the numbers: {text}");
            let item = MenuItem::new(MENU, title, Command::SetTolerance(error));
            MenuItem { checked: Some(self.view.settings.tolerance == error), ..item }
        });
        let rays = [5, 15, 51].map(|rays| {
            let title = format!("{rays} rays of each field in the layout");
            let item = MenuItem::new(MENU, title, Command::Show(PanelSetting::Rays(rays)));
            MenuItem { checked: Some(self.view.settings.rays == rays), ..item }
        });
        let vignetting = VignettingChoice::ALL.map(|choice| {
            let title = format!("Vignetting factors of opened files: {}", choice.name());
            let item = MenuItem::new(MENU, title, Command::SetVignetting(choice));
            MenuItem { checked: Some(self.view.vignetting == choice), ..item }
        });
        themes.into_iter().chain(errors).chain(rays).chain(vignetting).collect()
    }
}

/// The commands for the element of a surface; disabled without one.
pub(super) fn element_items(lens: &Lens, surface: Option<usize>) -> Vec<MenuItem> {
    const MENU: &str = "Element";
    let around = surface.and_then(|surface| Some((surface, lens.element_around(surface)?)));
    let edit = |make: fn(usize) -> ElementEdit| {
        around.map(|(surface, _)| UiAction::from(Edit::Element(make(surface))))
    };
    let dialog = |make: fn(usize) -> ElementTask| {
        around.map(|(surface, _)| DialogKind::Element(make(surface)).into())
    };
    let reverse =
        around.map(|(_, (first, last))| UiAction::from(Edit::ReverseRows { first, last }));
    vec![
        MenuItem::maybe(MENU, "Move the element…", dialog(ElementTask::Move))
            .control_shift(Key::M)
            .separated()
            .hint("Along the axis; everything else stays where it is"),
        MenuItem::maybe(MENU, "Bend the element…", dialog(ElementTask::Bend))
            .control_shift(Key::B)
            .hint("Change its curvatures together; its focal length stays"),
        MenuItem::maybe(MENU, "Reverse the element", reverse)
            .control_shift(Key::R)
            .hint("The last surface comes first"),
        MenuItem::maybe(MENU, "Cement to the next element", edit(ElementEdit::Cement))
            .control(Key::J)
            .hint("Close the air behind it: the two facing surfaces become one"),
        MenuItem::maybe(MENU, "Split the element", edit(ElementEdit::Split))
            .control_shift(Key::J)
            .hint(
                "A cemented group at the selected surface, or one lens into two of half its power",
            ),
        MenuItem::maybe(MENU, "Remove the element", edit(ElementEdit::Remove))
            .key(Modifiers::SHIFT, Key::Delete)
            .hint("Air takes its place"),
    ]
}

/// The items of the help menu, its studies excepted.
pub(super) fn help() -> Vec<MenuItem> {
    const MENU: &str = "Help";
    vec![
        MenuItem::new(MENU, "Manual", DialogKind::Manual).key(Modifiers::NONE, Key::F1),
        MenuItem::new(MENU, "Keyboard shortcuts", DialogKind::Shortcuts).control(Key::Slash),
    ]
}

/// The lenses that come with the program.
pub(super) fn bundled_lenses() -> Vec<MenuItem> {
    let lenses = files::bundled_lenses().iter();
    lenses.map(|lens| MenuItem::new("Lens", lens.title, UiAction::OpenBundled(lens))).collect()
}

/// The lenses of the library that are not in the menu of bundled ones.
fn library_lenses() -> Vec<MenuItem> {
    let bundled = files::bundled_lenses();
    let more = files::library_lenses().iter();
    let more = more.filter(|lens| bundled.iter().all(|known| known.name != lens.name));
    more.map(|lens| MenuItem::new("Lens", lens.title.as_str(), UiAction::OpenLibrary(lens, None)))
        .collect()
}

/// The studies of the thesis.
pub(super) fn studies() -> Vec<MenuItem> {
    let start = |study: &experiments::Experiment| {
        let command = Command::StartExperiment { id: study.id.to_owned(), effort: Effort::Full };
        MenuItem::new("Study", format!("{}  {}", study.id, study.title), command)
    };
    experiments::ALL.iter().map(start).collect()
}
