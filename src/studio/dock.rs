//! The arrangement of the panels: tabs that can be dragged side by side, on top of each other, or
//! closed and opened again from the menu.

use egui::{Color32, Context, Frame, Id, Margin, Stroke, Style, Ui, Visuals, WidgetText};
use egui_tiles::{
    Behavior, Container, Linear, LinearDir, SimplificationOptions, TabState, Tile, TileId, Tiles,
    Tree, UiResponse,
};

use super::actions::Actions;
use super::draw::RenderBackend;
use super::panels::{Panel, PanelKind};
use crate::session::{Command, GrinCommand, SessionView};

/// The arranged panels.
pub struct Dock {
    tree: Tree<PanelKind>,
    panels: Vec<(PanelKind, Box<dyn Panel>)>,
}

impl std::fmt::Debug for Dock {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Dock").field("tree", &self.tree).finish_non_exhaustive()
    }
}

impl Dock {
    /// All panels, arranged as they were left or as usual.
    pub fn new(backend: RenderBackend, left: Option<Tree<PanelKind>>) -> Self {
        let whole = |tree: &Tree<PanelKind>| {
            PanelKind::ALL.iter().all(|kind| tree.tiles.find_pane(kind).is_some())
        };
        let tree = left.filter(whole).unwrap_or_else(default_arrangement);
        Self { tree, panels: PanelKind::ALL.map(|kind| (kind, kind.panel(backend))).into() }
    }

    /// The arrangement of the panels.
    pub const fn tree(&self) -> &Tree<PanelKind> {
        &self.tree
    }

    /// Arranges all panels as usual.
    pub fn reset(&mut self) {
        self.tree = default_arrangement();
    }

    /// True if a panel is open, maybe behind another one.
    pub fn is_open(&self, kind: PanelKind) -> bool {
        self.tree.tiles.find_pane(&kind).is_some_and(|tile| self.tree.tiles.is_visible(tile))
    }

    /// True if a panel is open and not behind another one.
    fn is_visible(&self, kind: PanelKind) -> bool {
        let tile = self.tree.tiles.find_pane(&kind);
        tile.is_some_and(|tile| self.tree.active_tiles().contains(&tile))
    }

    /// Shows a panel in front of the others.
    pub fn show(&mut self, kind: PanelKind) {
        self.set_visible(kind, true);
    }

    /// Shows a panel in front of the others, or hides it if it is there already.
    pub fn toggle(&mut self, kind: PanelKind) {
        self.set_visible(kind, !self.is_visible(kind));
    }

    fn set_visible(&mut self, kind: PanelKind, open: bool) {
        if let Some(tile) = self.tree.tiles.find_pane(&kind) {
            self.tree.set_visible(tile, open);
            self.tree.make_active(|id, _| id == tile);
        }
    }

    /// The title of a panel.
    pub fn title(&self, kind: PanelKind) -> &'static str {
        let panel = self.panels.iter().find(|(other, _)| *other == kind);
        panel.map_or("", |(_, panel)| panel.title())
    }

    /// True if a text field of some panel is being edited.
    pub fn is_typing(&self, context: &Context) -> bool {
        self.panels.iter().any(|(_, panel)| panel.is_typing(context))
    }

    /// Shows all panels.
    pub fn ui(&mut self, ui: &mut Ui, view: &SessionView, actions: &mut Actions) {
        let Self { tree, panels } = self;
        tree.ui(&mut DockFrame { panels, view, actions }, ui);
        let pupils = self.is_visible(PanelKind::Pupil);
        if pupils != view.settings.pupils {
            actions.push(Command::ShowPupils(pupils));
        }
        let contrasts = self.is_visible(PanelKind::Contrast);
        if contrasts != view.settings.contrasts {
            actions.push(Command::ShowContrasts(contrasts));
        }
        let watched = self.is_visible(PanelKind::Slice);
        if watched != view.grin.is_active {
            actions.push(Command::Grin(GrinCommand::SetActive(watched)));
        }
    }
}

/// The drawings with the numbers of the lens below it; beside them how good it is and the search.
fn default_arrangement() -> Tree<PanelKind> {
    let mut tiles = Tiles::default();
    let mut pane = |kind: PanelKind| tiles.insert_pane(kind);
    let [layout, slice, spot, pupil, contrast, table, system, zoom] = [
        PanelKind::Layout,
        PanelKind::Slice,
        PanelKind::Spot,
        PanelKind::Pupil,
        PanelKind::Contrast,
        PanelKind::Prescription,
        PanelKind::System,
        PanelKind::Zoom,
    ]
    .map(&mut pane);
    let [optimizer, pareto, search, history, first, effects] = [
        PanelKind::Optimizer,
        PanelKind::Pareto,
        PanelKind::Search,
        PanelKind::History,
        PanelKind::FirstOrder,
        PanelKind::Effects,
    ]
    .map(&mut pane);
    let facts = tiles.insert_tab_tile(vec![first, effects]);
    let light = tiles.insert_tab_tile(vec![spot, pupil, contrast]);
    let better = tiles.insert_tab_tile(vec![optimizer, pareto, search, history]);
    let drawings = tiles.insert_tab_tile(vec![layout, slice]);
    let table = tiles.insert_tab_tile(vec![table, system, zoom]);
    let table = row(&mut tiles, &[(table, 0.71), (facts, 0.29)]);
    let left = column(&mut tiles, &[(drawings, 0.52), (table, 0.48)]);
    let right = column(&mut tiles, &[(light, 0.44), (better, 0.56)]);
    let root = row(&mut tiles, &[(left, 0.665), (right, 0.335)]);
    Tree::new(Id::unique("dock"), root, tiles)
}

fn row(tiles: &mut Tiles<PanelKind>, parts: &[(TileId, f32)]) -> TileId {
    linear_tile(tiles, LinearDir::Horizontal, parts)
}

fn column(tiles: &mut Tiles<PanelKind>, parts: &[(TileId, f32)]) -> TileId {
    linear_tile(tiles, LinearDir::Vertical, parts)
}

fn linear_tile(
    tiles: &mut Tiles<PanelKind>,
    direction: LinearDir,
    parts: &[(TileId, f32)],
) -> TileId {
    let mut linear = Linear::new(direction, parts.iter().map(|(tile, _)| *tile).collect());
    for (tile, share) in parts {
        linear.shares.set_share(*tile, *share);
    }
    tiles.insert_new(Tile::Container(Container::Linear(linear)))
}

/// The panels in one frame.
struct DockFrame<'a> {
    panels: &'a mut Vec<(PanelKind, Box<dyn Panel>)>,
    view: &'a SessionView,
    actions: &'a mut Actions,
}

impl Behavior<PanelKind> for DockFrame<'_> {
    fn pane_ui(&mut self, ui: &mut Ui, _tile: TileId, kind: &mut PanelKind) -> UiResponse {
        let panel = self.panels.iter_mut().find(|(other, _)| other == kind);
        if let Some((_, panel)) = panel {
            let frame = Frame::new().fill(ui.visuals().panel_fill).inner_margin(Margin::same(5));
            frame.show(ui, |ui| {
                ui.set_min_size(ui.available_size());
                panel.ui(ui, self.view, self.actions);
            });
        }
        UiResponse::None
    }

    fn tab_title_for_pane(&mut self, kind: &PanelKind) -> WidgetText {
        let panel = self.panels.iter().find(|(other, _)| other == kind);
        panel.map_or("", |(_, panel)| panel.title()).into()
    }

    fn is_tab_closable(&self, _tiles: &Tiles<PanelKind>, _tile: TileId) -> bool {
        true
    }

    /// A closed panel is hidden, so that the menu can bring it back to its place.
    fn on_tab_close(&mut self, tiles: &mut Tiles<PanelKind>, tile: TileId) -> bool {
        tiles.set_visible(tile, false);
        false
    }

    fn simplification_options(&self) -> SimplificationOptions {
        SimplificationOptions { all_panes_must_have_tabs: true, ..SimplificationOptions::default() }
    }

    fn tab_bar_height(&self, _style: &Style) -> f32 {
        24.0
    }

    fn gap_width(&self, _style: &Style) -> f32 {
        3.0
    }

    fn tab_bar_color(&self, visuals: &Visuals) -> Color32 {
        if visuals.dark_mode { visuals.extreme_bg_color } else { visuals.widgets.inactive.bg_fill }
    }

    fn tab_outline_stroke(
        &self,
        _visuals: &Visuals,
        _tiles: &Tiles<PanelKind>,
        _tile: TileId,
        _state: &TabState,
    ) -> Stroke {
        Stroke::NONE
    }

    fn tab_text_color(
        &self,
        visuals: &Visuals,
        _tiles: &Tiles<PanelKind>,
        _tile: TileId,
        state: &TabState,
    ) -> Color32 {
        if state.active { visuals.strong_text_color() } else { visuals.weak_text_color() }
    }
}
