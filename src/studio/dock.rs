//! The arrangement of the panels: tabs that can be dragged side by side, on top of each other, or
//! closed and opened again from the menu.

use std::collections::HashMap;

use egui::style::ScrollAnimation;
use egui::{
    Color32, Context, FocusDirection, Frame, Id, Margin, Rect, Response, Role, Sense, Stroke,
    StrokeKind, Style, Ui, Vec2, Visuals, WidgetInfo, WidgetText, vec2,
};
use egui_tiles::{
    Behavior, SimplificationOptions, TabState, Tabs, Tile, TileId, Tiles, Tree, UiResponse,
};

use super::actions::{Actions, UiAction};
use super::arrangement::Arrangement;
use super::draw::RenderBackend;
use super::panels::{Panel, PanelKind, first_radius_field};
use crate::session::{Command, GrinCommand, PanelSetting, SessionView};

/// Makes the setting that has a panel computed or not.
type SetVisible = fn(bool) -> PanelSetting;

/// The arranged panels.
pub struct Dock {
    tree: Tree<PanelKind>,
    panels: Vec<(PanelKind, Box<dyn Panel>)>,
    /// The panel that was brought to the front last.
    front: PanelKind,
    /// The panel that alone is shown.
    maximized: Option<PanelKind>,
    /// The panel whose first widget gets the keyboard, with the frames that are left for it: while a dialog
    /// closes, none gets it.
    to_focus: Option<(PanelKind, u8)>,
    tabs: TabPlaces,
}

/// The tabs in front, each with the frames that are left to bring it into its bar, and the width of the
/// window for which that was done.
#[derive(Debug, Default)]
struct TabPlaces {
    front: HashMap<TileId, u8>,
    window_width: f32,
}

/// The frames until a tab bar has found the place of its arrows, and until a closed dialog is forgotten.
const FRAMES: u8 = 4;

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
        let tree = left.filter(whole).unwrap_or_else(|| Arrangement::Default.tree());
        let panels = PanelKind::ALL.map(|kind| (kind, kind.panel(backend))).into();
        Self {
            tree,
            panels,
            front: PanelKind::Layout,
            maximized: None,
            to_focus: None,
            tabs: TabPlaces::default(),
        }
    }

    /// The arrangement of the panels.
    pub const fn tree(&self) -> &Tree<PanelKind> {
        &self.tree
    }

    /// Arranges all panels.
    pub fn arrange(&mut self, arrangement: Arrangement) {
        self.maximized = None;
        self.tree = arrangement.tree();
    }

    /// The panel that was brought to the front last.
    pub const fn front(&self) -> PanelKind {
        self.front
    }

    /// The panel that alone is shown.
    pub const fn maximized(&self) -> Option<PanelKind> {
        self.maximized
    }

    /// Shows one panel alone, or all panels.
    pub fn maximize(&mut self, kind: Option<PanelKind>) {
        self.maximized = kind;
        self.front = kind.unwrap_or(self.front);
    }

    /// True if a panel is open, maybe behind another one.
    pub fn is_open(&self, kind: PanelKind) -> bool {
        self.tree.tiles.find_pane(&kind).is_some_and(|tile| self.tree.tiles.is_visible(tile))
    }

    /// True if a panel is open and not behind another one.
    pub fn is_visible(&self, kind: PanelKind) -> bool {
        if let Some(shown) = self.maximized {
            return shown == kind;
        }
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

    /// Gives the keyboard to the first widget of a panel, of the table to its first number.
    pub fn put_keyboard_in(&mut self, context: &Context, kind: PanelKind) {
        if kind == PanelKind::Prescription {
            context.memory_mut(|memory| memory.request_focus(first_radius_field()));
        } else {
            self.to_focus = Some((kind, FRAMES));
        }
        context.request_repaint();
    }

    /// Shows a panel in front of the others unless it is seen already.
    pub fn bring_forward(&mut self, kind: PanelKind) {
        if !self.is_visible(kind) {
            self.show(kind);
        }
    }

    /// The panel some places behind the one that was in front last, among those that are seen. It is the
    /// one in front from now on.
    pub fn panel_beside(&mut self, step: isize) -> PanelKind {
        let shown: Vec<PanelKind> =
            PanelKind::ALL.into_iter().filter(|kind| self.is_visible(*kind)).collect();
        let at = shown.iter().position(|kind| *kind == self.front);
        let count = shown.len().cast_signed();
        let next = at.map(|at| (at.cast_signed() + step).rem_euclid(count.max(1)).cast_unsigned());
        self.front =
            next.and_then(|at| shown.get(at)).or(shown.first()).copied().unwrap_or(self.front);
        self.front
    }

    fn set_visible(&mut self, kind: PanelKind, open: bool) {
        self.maximized = None;
        self.front = kind;
        self.tabs.front.clear();
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
        if let Some(kind) = self.maximized {
            self.maximized_ui(ui, kind, view, actions);
        } else {
            let Self { tree, panels, front, to_focus, tabs, .. } = self;
            tabs.begin_frame(ui);
            tree.ui(
                &mut DockFrame { panels, front, to_focus, tabs, active: None, view, actions },
                ui,
            );
        }
        self.request_analyses(view, actions);
        let watched = self.is_visible(PanelKind::Slice);
        if watched != view.grin.is_active {
            actions.push(Command::Grin(GrinCommand::SetActive(watched)));
        }
    }

    /// Asks for the analyses of those panels alone that are visible.
    fn request_analyses(&self, view: &SessionView, actions: &mut Actions) {
        let settings = &view.settings;
        let asked: [(PanelKind, bool, SetVisible); 10] = [
            (PanelKind::Pupil, settings.pupils, PanelSetting::Pupils),
            (PanelKind::Contrast, settings.contrasts, PanelSetting::Contrasts),
            (PanelKind::Wavefront, settings.wavefronts, PanelSetting::Wavefronts),
            (PanelKind::Fans, settings.fans, PanelSetting::Fans),
            (PanelKind::FieldCurves, settings.field_curves, PanelSetting::FieldCurves),
            (PanelKind::Footprint, settings.footprints, PanelSetting::Footprints),
            (PanelKind::SpotMap, settings.spot_map, PanelSetting::SpotMap),
            (PanelKind::Ghosts, settings.ghosts, PanelSetting::Ghosts),
            (PanelKind::Picture, settings.picture, PanelSetting::Picture),
            (PanelKind::Tolerances, settings.tolerances, PanelSetting::Tolerances),
        ];
        for (panel, computed, setting) in asked {
            let visible = self.is_visible(panel);
            if visible != computed {
                actions.push(Command::Show(setting(visible)));
            }
        }
    }

    /// Shows one panel alone, below a bar with its title.
    fn maximized_ui(
        &mut self,
        ui: &mut Ui,
        kind: PanelKind,
        view: &SessionView,
        actions: &mut Actions,
    ) {
        let title = self.title(kind);
        let frame = Frame::new().fill(ui.visuals().panel_fill).inner_margin(Margin::same(5));
        frame.show(ui, |ui| {
            ui.horizontal(|ui| {
                ui.strong(title);
                let hint = "Show this panel among the others again (F11)";
                if ui.button("Show all panels").on_hover_text(hint).clicked() {
                    actions.push(UiAction::MaximizePanel(None));
                }
            });
            ui.set_min_size(ui.available_size());
            if let Some((_, panel)) = self.panels.iter_mut().find(|(other, _)| *other == kind) {
                begin_focus(ui, kind, &mut self.to_focus);
                panel.ui(ui, view, actions);
            }
        });
    }
}

/// Lets the next widget have the keyboard if the panel is the one that gets it.
fn begin_focus(ui: &Ui, kind: PanelKind, to_focus: &mut Option<(PanelKind, u8)>) {
    let Some((_, left)) = to_focus.filter(|(other, _)| *other == kind) else { return };
    let start = Id::unique("start of the panel");
    let is_done = ui.memory(egui::Memory::focused).is_some_and(|id| id != start);
    if left == 0 || (left < FRAMES && is_done) {
        *to_focus = None;
        return;
    }
    *to_focus = Some((kind, left - 1));
    ui.memory_mut(|memory| {
        memory.request_focus(start);
        memory.move_focus(FocusDirection::Next);
    });
    let place = Rect::from_min_size(ui.cursor().min, Vec2::ZERO);
    ui.interact(place, start, Sense::focusable_noninteractive());
    ui.request_repaint();
}

impl TabPlaces {
    fn begin_frame(&mut self, ui: &Ui) {
        let width = ui.ctx().content_rect().width();
        if width != self.window_width {
            *self = Self { window_width: width, ..Self::default() };
        }
    }

    /// Scrolls the bar of a tab that has come to the front, or whose window has another width, to it.
    fn keep_in_view(&mut self, is_in_front: bool, tile: TileId, tab: &Response) {
        if !is_in_front {
            self.front.remove(&tile);
            return;
        }
        let left = self.front.entry(tile).or_insert(FRAMES);
        if *left > 0 {
            *left -= 1;
            tab.scroll_to_me_animation(None, ScrollAnimation::none());
            tab.ctx.request_repaint();
        }
    }
}

/// A small button with the sign of a maximized window.
fn maximize_button(ui: &mut Ui, name: &str) -> Response {
    let (rect, response) = ui.allocate_exact_size(Vec2::splat(20.0), Sense::click());
    response.widget_info(|| WidgetInfo::labeled(Role::Button, true, name));
    let color = if response.hovered() || response.has_focus() {
        ui.visuals().strong_text_color()
    } else {
        ui.visuals().weak_text_color()
    };
    let sign = Rect::from_center_size(rect.center(), vec2(11.0, 9.0));
    let painter = ui.painter();
    painter.rect_stroke(sign, 1.0, Stroke::new(1.0, color), StrokeKind::Inside);
    let title = sign.with_max_y(sign.top() + 2.5);
    painter.rect_filled(title, 1.0, color);
    response.on_hover_text(format!("{name}: give it all the room"))
}

/// The panels in one frame.
struct DockFrame<'a> {
    panels: &'a mut Vec<(PanelKind, Box<dyn Panel>)>,
    /// The panel that was brought to the front last.
    front: &'a mut PanelKind,
    to_focus: &'a mut Option<(PanelKind, u8)>,
    tabs: &'a mut TabPlaces,
    /// The tab in front of the bar that is being drawn.
    active: Option<TileId>,
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
                begin_focus(ui, *kind, self.to_focus);
                panel.ui(ui, self.view, self.actions);
            });
        }
        UiResponse::None
    }

    fn tab_title_for_pane(&mut self, kind: &PanelKind) -> WidgetText {
        let panel = self.panels.iter().find(|(other, _)| other == kind);
        panel.map_or("", |(_, panel)| panel.title()).into()
    }

    fn on_tab_button(
        &mut self,
        tiles: &mut Tiles<PanelKind>,
        tile: TileId,
        button_response: Response,
    ) -> Response {
        if let (true, Some(Tile::Pane(kind))) = (button_response.clicked(), tiles.get(tile)) {
            *self.front = *kind;
        }
        self.tabs.keep_in_view(self.active == Some(tile), tile, &button_response);
        button_response
    }

    /// A button that gives the panel in front all the room. It is drawn before the tabs of its bar.
    fn top_bar_right_ui(
        &mut self,
        tiles: &Tiles<PanelKind>,
        ui: &mut Ui,
        _tile: TileId,
        tabs: &Tabs,
        _scroll_offset: &mut f32,
    ) {
        self.active = tabs.active;
        let Some(Tile::Pane(kind)) = tabs.active.and_then(|tile| tiles.get(tile)) else { return };
        let title = self.panels.iter().find(|(other, _)| other == kind);
        let title = format!("Maximize {}", title.map_or("", |(_, panel)| panel.title()));
        if maximize_button(ui, &title).clicked() {
            self.actions.push(UiAction::MaximizePanel(Some(*kind)));
        }
    }

    /// Only the tab in front has a sign to close it: more tabs fit beside each other.
    fn is_tab_closable(&self, _tiles: &Tiles<PanelKind>, tile: TileId) -> bool {
        self.active == Some(tile)
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
