//! The prescription: a row per surface, a cell per number, and a badge with the status of the
//! number.
//!
//! Rows are counted as designers do: the object is row 0, the first surface row 1, the image the
//! last one. An edit that would make the lens invalid is rejected: its text remains in the cell
//! with the reason, and the lens is unchanged.

mod actions;
mod badge;
mod badge_menu;
mod candidate;
mod cells;
mod clipboard;
mod columns;
mod cursor;
mod details;
mod fields;
mod glass;
mod radius_bounds;
mod row_numbers;
mod shapes;
mod table;
mod variables;

use std::sync::Arc;

use egui::{Button, Context, Frame, Id, Key, Margin, Panel as SidePanel, RichText, Ui};

use super::{Panel, valid_edit};
use crate::lens::glass::Glass;
use crate::lens::{Edit, Lens};
use crate::session::{AnalysisResults, SessionView};
use crate::studio::actions::Actions;
use crate::studio::text::capitalize;
use crate::studio::text_input::{EditBuffers, error_color};
use actions::RowAction;
use candidate::Candidate;
use cells::CellPlace;
use columns::TableColumn;
use cursor::{CellCursor, CellGrid, RangeCommand};
use details::SurfaceDetails;
use table::PrescriptionTable;

/// The panel.
#[derive(Debug, Default)]
pub struct PrescriptionPanel {
    buffers: EditBuffers,
    cursor: CellCursor,
    /// The reason why the last paste was refused.
    refused: Option<String>,
    /// The shape and the place of the selected surface, beside the table.
    details: SurfaceDetails,
}

impl Panel for PrescriptionPanel {
    fn title(&self) -> &'static str {
        "Prescription"
    }

    fn ui(&mut self, ui: &mut Ui, view: &SessionView, actions: &mut Actions) {
        let candidate = candidate_results(view);
        let lens = candidate.map_or(&view.lens, |results| &results.lens);
        let columns = columns::shown(ui, lens);
        let before = self.cursor.active();
        // What is above the rows stays while there is a candidate, so that they do not move.
        ui.add_enabled_ui(candidate.is_none(), |ui| self.toolbar(ui, view, actions));
        clipping_note(ui, &view.lens);
        if candidate.is_none() {
            keys(ui, view, actions);
            self.cursor_keys(ui, view, &columns, actions);
            self.error_line(ui);
            self.details.show(ui, view, actions);
        }
        let table = PrescriptionTable {
            view,
            lens: Arc::clone(lens),
            analyses: candidate.or(view.results.as_ref()).and_then(|r| r.analyses.as_ref().ok()),
            candidate: candidate
                .map(|results| Candidate { lens: &results.lens, design: &view.lens }),
            columns: &columns,
            buffers: &mut self.buffers,
            cursor: &mut self.cursor,
            actions,
            entered: None,
        };
        table.show(ui);
        if candidate.is_none() {
            self.cursor.end(ui, before);
        }
    }

    fn is_typing(&self, context: &Context) -> bool {
        self.buffers.is_typing(context) || self.details.is_typing(context)
    }
}

/// The field of the first radius.
pub(in crate::studio) fn first_radius_field() -> Id {
    table::first_radius_field()
}

impl PrescriptionPanel {
    /// The last text that was refused, where it can be read in full.
    fn error_line(&self, ui: &mut Ui) {
        let Some(why) = self.buffers.last_error().or(self.refused.as_deref()) else { return };
        let frame = Frame::new().inner_margin(Margin::symmetric(4, 2));
        SidePanel::bottom("complaint").frame(frame).show_separator_line(false).show(ui, |ui| {
            ui.label(RichText::new(why).color(error_color(ui)));
        });
    }

    /// Moves the cursor by keys, and carries out what they ask for.
    fn cursor_keys(
        &mut self,
        ui: &Ui,
        view: &SessionView,
        columns: &[TableColumn],
        actions: &mut Actions,
    ) {
        let grid = CellGrid { columns, lens: &view.lens };
        let proposals = self.proposals();
        self.take_proposal(ui, &proposals);
        let commands = self.cursor.begin(ui, grid, &self.buffers, proposals.len());
        if ui.input(|input| input.events.iter().any(is_typed)) {
            self.refused = None;
        }
        for command in commands {
            let Some(range) = self.cursor.range(grid) else { continue };
            self.refused = None;
            let edit = range_edit(ui, grid, view, &range, command);
            let edit = edit.and_then(|edit| checked(&view.lens, edit));
            match edit {
                Ok(edit) => actions.extend(edit),
                Err(why) => self.refused = Some(capitalize(&why)),
            }
        }
    }

    /// The glasses that are proposed below the cell with the cursor.
    fn proposals(&self) -> Vec<&'static Glass> {
        let active = self.cursor.active().filter(|place| place.column == TableColumn::Glass);
        let typed = active.and_then(|place| self.buffers.text(place.id()));
        typed.map(glass::suggestions).unwrap_or_default()
    }

    /// Enter and Tab take the proposal that was chosen by the arrows.
    fn take_proposal(&mut self, ui: &Ui, proposals: &[&'static Glass]) {
        let Some(glass) = self.cursor.proposal.and_then(|i| proposals.get(i)) else { return };
        let ends = ui.input(|i| i.key_pressed(Key::Enter) || i.key_pressed(Key::Tab));
        if let Some(place) = self.cursor.active().filter(|_| ends) {
            self.buffers.replace(place.id(), glass.full_name());
            self.cursor.proposal = None;
        }
    }

    fn toolbar(&mut self, ui: &mut Ui, view: &SessionView, actions: &mut Actions) {
        let lens = &view.lens;
        let in_cell = self.cursor.active().and_then(CellPlace::surface);
        let row = view.selected.or(in_cell).filter(|row| *row < lens.surfaces.len());
        ui.horizontal_wrapped(|ui| {
            for action in actions::ALL {
                let edit = row.and_then(|row| action.edit(lens, row));
                let button = ui.add_enabled(edit.is_some(), Button::new(action.title()).small());
                let button = button.on_hover_text(action.hint());
                let button = button.on_disabled_hover_text("Select a row by its number first.");
                if let Some(edit) = edit.filter(|_| button.clicked()) {
                    actions.push(edit);
                }
            }
            variables::menu(ui, lens, actions);
            columns::menu(ui, lens);
            self.details.toggle(ui);
        });
    }
}

fn is_typed(event: &egui::Event) -> bool {
    matches!(event, egui::Event::Text(_) | egui::Event::Key { pressed: true, .. })
}

/// The results of the candidate that all panels show; `None` while they show the design.
fn candidate_results(view: &SessionView) -> Option<&Arc<AnalysisResults>> {
    view.candidate.as_ref().filter(|candidate| candidate.shown)?;
    view.preview_results.as_ref()
}

/// The edit that a key asks for in a range of cells; `None` if it only copies.
fn range_edit(
    ui: &Ui,
    grid: CellGrid<'_>,
    view: &SessionView,
    range: &(Vec<usize>, Vec<TableColumn>),
    command: RangeCommand,
) -> Result<Option<Edit>, String> {
    let (lens, zoom) = (grid.lens, view.settings.zoom);
    let surfaces = || range.0.iter().filter_map(|row| row.checked_sub(1));
    match command {
        RangeCommand::InsertRow => Ok(surfaces().next().map(|at| actions::insert_edit(lens, at))),
        RangeCommand::RemoveRows => Ok(remove_edit(surfaces().rev().collect())),
        RangeCommand::Clear => clipboard::clear_edit(grid, zoom, range).map(Some),
        RangeCommand::Copy | RangeCommand::Cut => {
            ui.ctx().copy_text(clipboard::copied_text(lens, zoom, range));
            let cut = command == RangeCommand::Cut;
            cut.then(|| clipboard::clear_edit(grid, zoom, range)).transpose()
        }
        RangeCommand::Paste(text) => clipboard::paste_edit(grid, zoom, range, &text).map(Some),
    }
}

/// Removes surfaces, the last one first.
fn remove_edit(surfaces: Vec<usize>) -> Option<Edit> {
    match surfaces[..] {
        [] => None,
        [surface] => Some(Edit::RemoveRow(surface)),
        _ => {
            let title = format!("remove {} surfaces", surfaces.len());
            let edits = surfaces.into_iter().map(Edit::RemoveRow).collect();
            Some(Edit::Sequence { title, edits })
        }
    }
}

/// The edit if the lens stays valid, else the reason why not.
fn checked(lens: &Lens, edit: Option<Edit>) -> Result<Option<Edit>, String> {
    edit.map(|edit| valid_edit(lens, edit)).transpose()
}

/// Says once what clips, in a lens with fixed and automatic semi-diameters.
fn clipping_note(ui: &mut Ui, lens: &Lens) {
    let id = Id::unique("fixed semi-diameters clip");
    let fixed = lens.surfaces.iter().any(|row| row.semi_diameter.is_some());
    let mixed = fixed && lens.surfaces.iter().any(|row| row.semi_diameter.is_none());
    let read: bool = ui.data_mut(|data| data.get_persisted(id)).unwrap_or_default();
    if !mixed || read {
        return;
    }
    ui.horizontal_wrapped(|ui| {
        ui.weak("Only fixed semi-diameters (badge U) clip rays; the grey ones follow the light.");
        if ui.small_button("Understood").clicked() {
            ui.data_mut(|data| data.insert_persisted(id, true));
        }
    });
}

/// Insert and Delete work on the selected row while no text is being edited.
fn keys(ui: &Ui, view: &SessionView, actions: &mut Actions) {
    let Some(row) = view.selected.filter(|_| !ui.ctx().egui_wants_keyboard_input()) else {
        return;
    };
    for (key, action) in [(Key::Delete, RowAction::Remove), (Key::Insert, RowAction::InsertBefore)]
    {
        if ui.input(|input| input.key_pressed(key)) {
            actions.extend(action.edit(&view.lens, row));
        }
    }
}
