//! The cell with the cursor, the range beside it, and the keys that move them.
//!
//! As in a spreadsheet a cell is either entered, so that typing replaces its content and arrows go
//! to the next cell, or edited in place after F2 or a second click, so that arrows move in its text.

use egui::{Event, FocusDirection, Key, Modifiers, Rect, Ui};

use super::cells::CellPlace;
use super::columns::TableColumn;
use crate::lens::Lens;
use crate::studio::text_input::{EditBuffers, place_cursor_at_end, select_whole};

/// The frames after which a cell that is never drawn no longer gets the cursor.
const MAX_WAIT: u8 = 6;
/// The rows that a page key moves by.
const PAGE: isize = 10;

/// The action of a key on the range of cells.
#[derive(Debug, Clone, PartialEq)]
pub(super) enum RangeCommand {
    InsertRow,
    RemoveRows,
    Clear,
    Copy,
    Cut,
    Paste(String),
}

/// The cells of a table: its columns, and the lens whose surfaces are the rows.
#[derive(Debug, Clone, Copy)]
pub(super) struct CellGrid<'a> {
    pub(super) columns: &'a [TableColumn],
    pub(super) lens: &'a Lens,
}

impl CellGrid<'_> {
    fn column(self, place: CellPlace) -> usize {
        self.columns.iter().position(|column| *column == place.column).unwrap_or(0)
    }

    /// The cell some rows and columns away, as far as there are cells that can be edited.
    fn moved(self, from: CellPlace, [down, right]: [isize; 2]) -> CellPlace {
        let column = self.column(from).saturating_add_signed(right).min(self.columns.len() - 1);
        let row = from.row.saturating_add_signed(down).min(self.lens.surfaces.len());
        let to = CellPlace::new(row, self.columns[column]);
        if to.is_editable(self.lens) {
            return to;
        }
        let below = CellPlace { row: 1, ..to };
        let at_top = row == 0 && down < 0 && right == 0;
        if !at_top && below.is_editable(self.lens) { below } else { from }
    }

    /// The rows and columns between two cells, both included.
    pub(super) fn range(self, a: CellPlace, b: CellPlace) -> (Vec<usize>, Vec<TableColumn>) {
        let (left, right) =
            (self.column(a).min(self.column(b)), self.column(a).max(self.column(b)));
        let rows = a.row.min(b.row)..=a.row.max(b.row);
        (rows.collect(), self.columns[left..=right].to_vec())
    }
}

/// The cursor of the table.
#[derive(Debug, Default)]
pub(super) struct CellCursor {
    /// The cell with the cursor; kept while no cell has it.
    active: Option<CellPlace>,
    /// The other corner of a range.
    head: Option<CellPlace>,
    /// True while arrows move in the text of the cell.
    edits_in_place: bool,
    /// True if the cell had the keyboard when the frame began.
    has_keyboard: bool,
    /// The cell that gets the cursor in the next frame, and the frames for which it was waited for.
    pending: Option<(CellPlace, u8)>,
    /// The cells of the present frame.
    rects: Vec<(CellPlace, Rect)>,
    /// The proposal that is chosen in a list below the cell.
    pub(super) proposal: Option<usize>,
}

impl CellCursor {
    /// Moves the cursor to a cell in the next frame, so that what was typed before stays where it was
    /// typed.
    pub(super) fn move_to(&mut self, place: CellPlace) {
        self.pending = Some((place, 0));
        self.head = None;
    }

    /// The cell with the cursor, or that had it last.
    pub(super) const fn active(&self) -> Option<CellPlace> {
        self.active
    }

    /// The row to scroll to.
    pub(super) fn scroll_target(&self) -> Option<usize> {
        self.pending.map(|(place, _)| place.row).or_else(|| self.head.map(|head| head.row))
    }

    /// True if the cursor moves to another cell after this frame.
    pub(super) const fn is_moving(&self) -> bool {
        self.pending.is_some()
    }

    /// The rows and columns of the range; one cell without a range.
    pub(super) fn range(&self, grid: CellGrid<'_>) -> Option<(Vec<usize>, Vec<TableColumn>)> {
        let active = self.active?;
        Some(grid.range(active, self.head.unwrap_or(active)))
    }

    /// True if a range of several cells contains this one.
    pub(super) fn is_in_range(&self, grid: CellGrid<'_>, place: CellPlace) -> bool {
        let (Some(active), Some(head)) = (self.active, self.head) else { return false };
        let (rows, columns) = grid.range(active, head);
        rows.contains(&place.row) && columns.contains(&place.column)
    }

    /// The sides of a cell at which a range of several cells ends: left, right, above, below.
    pub(super) fn range_ends(&self, grid: CellGrid<'_>, place: CellPlace) -> [bool; 4] {
        if !self.is_in_range(grid, place) {
            return [false; 4];
        }
        let Some((rows, columns)) = self.range(grid) else { return [false; 4] };
        [
            columns.first() == Some(&place.column),
            columns.last() == Some(&place.column),
            rows.first() == Some(&place.row),
            rows.last() == Some(&place.row),
        ]
    }

    /// Records a drawn cell and whether it has the cursor.
    pub(super) fn record(&mut self, place: CellPlace, rect: Rect, has_cursor: bool) {
        self.rects.push((place, rect));
        if !has_cursor || self.active == Some(place) {
            return;
        }
        self.active = Some(place);
        (self.edits_in_place, self.proposal) = (false, None);
        if self.pending.is_none() {
            self.head = None;
        }
    }

    /// Begins a frame: gives the cursor to the cell that waits for it, and reads the keys. Returns
    /// what they ask for.
    pub(super) fn begin(
        &mut self,
        ui: &Ui,
        grid: CellGrid<'_>,
        buffers: &EditBuffers,
        proposals: usize,
    ) -> Vec<RangeCommand> {
        self.rects.clear();
        let has_keyboard = |place: CellPlace| ui.memory(|memory| memory.has_focus(place.id()));
        self.has_keyboard = self.active.is_some_and(has_keyboard);
        if let Some((place, _)) = self.pending {
            self.arrive(ui, place);
        }
        let Some(active) = self.active else { return Vec::new() };
        if !ui.memory(|memory| memory.has_focus(active.id())) {
            return Vec::new();
        }
        let typing = buffers.text(active.id()).is_some();
        if typing {
            self.head = None;
            self.choose_proposal(ui, proposals);
        }
        if pressed(ui, Modifiers::NONE, Key::F2) {
            self.edits_in_place = true;
            place_cursor_at_end(ui.ctx(), active.id());
        }
        if self.edits_in_place {
            return Vec::new();
        }
        self.read_arrows(ui, grid, active, typing);
        if typing { Vec::new() } else { range_commands(ui) }
    }

    /// Gives the cursor to the cell that waits for it. Keys of this frame are already its own: between
    /// two cells no widget has the keyboard, and the toolkit would take an arrow as its own way to
    /// another widget, and Tab as the way to the first one.
    fn arrive(&mut self, ui: &Ui, place: CellPlace) {
        enter(ui, place);
        let direction =
            ui.input(|input| match (input.key_pressed(Key::Tab), input.modifiers.shift) {
                (false, _) => FocusDirection::None,
                (true, false) => FocusDirection::Next,
                (true, true) => FocusDirection::Previous,
            });
        ui.memory_mut(|memory| memory.move_focus(direction));
        if self.active != Some(place) {
            self.active = Some(place);
            (self.edits_in_place, self.proposal) = (false, None);
        }
    }

    /// Up and down choose from the list below a cell into which a name is typed.
    fn choose_proposal(&mut self, ui: &Ui, count: usize) {
        if count == 0 {
            self.proposal = None;
            return;
        }
        if pressed(ui, Modifiers::NONE, Key::ArrowDown) {
            self.proposal = Some(self.proposal.map_or(0, |i| (i + 1).min(count - 1)));
        }
        if self.proposal.is_some() && pressed(ui, Modifiers::NONE, Key::ArrowUp) {
            self.proposal = self.proposal.and_then(|i| i.checked_sub(1));
        }
    }

    fn read_arrows(&mut self, ui: &Ui, grid: CellGrid<'_>, active: CellPlace, typing: bool) {
        let (far, waiting) = (isize::MAX, self.pending);
        let steps = [
            (Key::ArrowUp, [-1, 0], true),
            (Key::ArrowDown, [1, 0], true),
            (Key::ArrowLeft, [0, -1], false),
            (Key::ArrowRight, [0, 1], false),
            (Key::PageUp, [-PAGE, 0], true),
            (Key::PageDown, [PAGE, 0], true),
            (Key::Home, [0, -far], false),
            (Key::End, [0, far], false),
        ];
        for (key, step, while_typing) in steps {
            if typing && !while_typing {
                continue;
            }
            if !typing && pressed(ui, Modifiers::SHIFT, key) {
                self.head = Some(grid.moved(self.head.unwrap_or(active), step));
            } else if pressed(ui, Modifiers::COMMAND, key) {
                self.move_to(grid.moved(active, step.map(|n| n.signum().saturating_mul(far))));
            } else if pressed(ui, Modifiers::NONE, key) {
                self.move_to(grid.moved(active, step));
            }
        }
        if self.pending != waiting {
            ui.memory_mut(|memory| memory.surrender_focus(active.id()));
        }
    }

    /// Ends a frame: reads the mouse, and waits for a cell that has not been drawn yet.
    pub(super) fn end(&mut self, ui: &Ui, before: Option<CellPlace>) {
        self.read_mouse(ui, before);
        let Some((place, frames)) = self.pending else { return };
        // The Tab key may have led on from it already.
        let has_arrived = ui.memory(|memory| memory.has_focus(place.id()))
            || frames > 0 && ui.input(|input| input.key_pressed(Key::Tab));
        let drawn = has_arrived && self.rects.iter().any(|(other, _)| *other == place);
        self.pending = (!drawn && frames < MAX_WAIT).then_some((place, frames + 1));
        ui.ctx().request_repaint();
    }

    /// A drag from the cell with the cursor and a click with Shift span a range.
    fn read_mouse(&mut self, ui: &Ui, before: Option<CellPlace>) {
        let (pointer, shift) = ui.input(|input| (input.pointer.clone(), input.modifiers.shift));
        let under = |at| self.rects.iter().find(|(_, rect)| rect.contains(at)).map(|cell| cell.0);
        let Some(place) = pointer.interact_pos().and_then(under) else { return };
        if pointer.primary_pressed() {
            if let Some(before) = before.filter(|_| shift) {
                self.move_to(before);
                (self.active, self.head) = (Some(before), Some(place));
            } else {
                let is_second = self.has_keyboard && before == Some(place);
                self.edits_in_place = is_second && self.active == before;
                self.head = None;
            }
        } else if pointer.primary_down() && !shift {
            let start = pointer.press_origin().and_then(under);
            if start.is_some()
                && start == self.active
                && (self.head.is_some() || start != Some(place))
            {
                self.head = Some(place);
            }
        }
    }
}

fn pressed(ui: &Ui, modifiers: Modifiers, key: Key) -> bool {
    let same = |held: Modifiers| held.shift == modifiers.shift && held.command == modifiers.command;
    ui.input_mut(|input| {
        let count = input.events.len();
        input.events.retain(|event| {
            !matches!(event, Event::Key { key: k, pressed: true, modifiers: held, .. }
                if *k == key && same(*held) && !held.alt)
        });
        input.events.len() < count
    })
}

/// Takes the keys that act on a range out of the input.
fn range_commands(ui: &Ui) -> Vec<RangeCommand> {
    let mut commands = Vec::new();
    for (key, command) in [
        (Key::Insert, RangeCommand::InsertRow),
        (Key::Delete, RangeCommand::RemoveRows),
        (Key::Backspace, RangeCommand::Clear),
    ] {
        if pressed(ui, Modifiers::NONE, key) {
            commands.push(command);
        }
    }
    ui.input_mut(|input| {
        input.events.retain(|event| {
            commands.push(match event {
                Event::Copy => RangeCommand::Copy,
                Event::Cut => RangeCommand::Cut,
                Event::Paste(text) => RangeCommand::Paste(text.clone()),
                _ => return true,
            });
            false
        });
    });
    commands
}

/// Gives a cell the cursor with all of its text selected, so that typing replaces it.
fn enter(ui: &Ui, place: CellPlace) {
    let id = place.id();
    if ui.memory(|memory| memory.has_focus(id)) {
        return;
    }
    select_whole(ui.ctx(), id);
    ui.memory_mut(|memory| memory.request_focus(id));
}
