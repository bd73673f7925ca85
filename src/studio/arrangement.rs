//! The arrangements of the panels that the window offers.

use egui::Id;
use egui_tiles::{Container, Linear, LinearDir, Tile, TileId, Tiles, Tree};

use super::panels::PanelKind;

/// An arrangement of all panels.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Arrangement {
    /// The drawings with the numbers of the lens below; beside them how good it is and how to make
    /// it better.
    Default,
    /// The layout large with the numbers of the lens below; beside them the search, as high as the
    /// window.
    Search,
}

impl Arrangement {
    /// All panels, arranged.
    pub(super) fn tree(self) -> Tree<PanelKind> {
        match self {
            Self::Default => default_arrangement(),
            Self::Search => search_arrangement(),
        }
    }
}

fn default_arrangement() -> Tree<PanelKind> {
    use PanelKind as Kind;
    let mut tiles = Tiles::default();
    let facts = tabs(&mut tiles, &[Kind::FirstOrder, Kind::Effects]);
    let light =
        tabs(&mut tiles, &[Kind::Spot, Kind::Pupil, Kind::Contrast, Kind::Picture, Kind::Seidel]);
    let better = tabs(&mut tiles, &[Kind::Optimizer, Kind::Pareto, Kind::Search, Kind::History]);
    let drawings = tabs(&mut tiles, &[Kind::Layout, Kind::Slice]);
    let table = tabs(&mut tiles, &[Kind::Prescription, Kind::System, Kind::Zoom]);
    let table = row(&mut tiles, &[(table, 0.71), (facts, 0.29)]);
    let left = column(&mut tiles, &[(drawings, 0.52), (table, 0.48)]);
    let right = column(&mut tiles, &[(light, 0.44), (better, 0.56)]);
    let root = row(&mut tiles, &[(left, 0.665), (right, 0.335)]);
    Tree::new(Id::unique("dock"), root, tiles)
}

fn search_arrangement() -> Tree<PanelKind> {
    use PanelKind as Kind;
    let mut tiles = Tiles::default();
    let drawings = tabs(&mut tiles, &[Kind::Layout, Kind::Slice]);
    let light =
        tabs(&mut tiles, &[Kind::Spot, Kind::Pupil, Kind::Contrast, Kind::Picture, Kind::Seidel]);
    let numbers = [Kind::Prescription, Kind::System, Kind::Zoom, Kind::FirstOrder, Kind::Effects];
    let numbers = tabs(&mut tiles, &numbers);
    let better = tabs(&mut tiles, &[Kind::Search, Kind::Optimizer, Kind::Pareto, Kind::History]);
    let below = row(&mut tiles, &[(numbers, 0.5), (light, 0.5)]);
    let left = column(&mut tiles, &[(drawings, 0.58), (below, 0.42)]);
    let root = row(&mut tiles, &[(left, 0.55), (better, 0.45)]);
    Tree::new(Id::unique("dock"), root, tiles)
}

/// Panels behind each other, the first one in front.
fn tabs(tiles: &mut Tiles<PanelKind>, kinds: &[PanelKind]) -> TileId {
    let panes = kinds.iter().map(|kind| tiles.insert_pane(*kind)).collect();
    tiles.insert_tab_tile(panes)
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
