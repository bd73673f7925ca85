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
    /// Most panels beside each other, for a large window.
    Large,
}

impl Arrangement {
    /// All panels, arranged.
    pub(super) fn tree(self) -> Tree<PanelKind> {
        match self {
            Self::Default => default_arrangement(),
            Self::Search => search_arrangement(),
            Self::Large => large_arrangement(),
        }
    }
}

/// The panels of the light in the image.
const LIGHT: [PanelKind; 9] = [
    PanelKind::Spot,
    PanelKind::Fans,
    PanelKind::Contrast,
    PanelKind::Wavefront,
    PanelKind::Pupil,
    PanelKind::FieldCurves,
    PanelKind::SpotMap,
    PanelKind::Footprint,
    PanelKind::Ghosts,
];

/// The large panels, which stand above the table.
const DRAWINGS: [PanelKind; 5] = [
    PanelKind::Layout,
    PanelKind::Slice,
    PanelKind::Picture,
    PanelKind::Glass,
    PanelKind::Specification,
];

fn default_arrangement() -> Tree<PanelKind> {
    use PanelKind as Kind;
    let mut tiles = Tiles::default();
    let facts = tabs(&mut tiles, &[Kind::FirstOrder, Kind::Effects]);
    let light = tabs(&mut tiles, &LIGHT);
    let better = [Kind::Optimizer, Kind::Pareto, Kind::Search, Kind::History, Kind::ImportReport];
    let better = tabs(&mut tiles, &better);
    let drawings = tabs(&mut tiles, &DRAWINGS);
    let table = [Kind::Prescription, Kind::System, Kind::Zoom, Kind::Tolerances, Kind::Seidel];
    let table = tabs(&mut tiles, &table);
    let table = row(&mut tiles, &[(table, 0.71), (facts, 0.29)]);
    let left = column(&mut tiles, &[(drawings, 0.52), (table, 0.48)]);
    let right = column(&mut tiles, &[(light, 0.44), (better, 0.56)]);
    let root = row(&mut tiles, &[(left, 0.652), (right, 0.348)]);
    Tree::new(Id::unique("dock"), root, tiles)
}

fn search_arrangement() -> Tree<PanelKind> {
    use PanelKind as Kind;
    let mut tiles = Tiles::default();
    let drawings = tabs(&mut tiles, &DRAWINGS);
    let light = tabs(&mut tiles, &LIGHT);
    let numbers = [
        Kind::Prescription,
        Kind::System,
        Kind::Zoom,
        Kind::Tolerances,
        Kind::Seidel,
        Kind::FirstOrder,
        Kind::Effects,
        Kind::ImportReport,
    ];
    let numbers = tabs(&mut tiles, &numbers);
    let better = tabs(&mut tiles, &[Kind::Search, Kind::Optimizer, Kind::Pareto, Kind::History]);
    let below = row(&mut tiles, &[(numbers, 0.5), (light, 0.5)]);
    let left = column(&mut tiles, &[(drawings, 0.58), (below, 0.42)]);
    let root = row(&mut tiles, &[(left, 0.55), (better, 0.45)]);
    Tree::new(Id::unique("dock"), root, tiles)
}

fn large_arrangement() -> Tree<PanelKind> {
    use PanelKind as Kind;
    let mut tiles = Tiles::default();
    let drawings = tabs(&mut tiles, &[Kind::Layout, Kind::Slice, Kind::Specification, Kind::Glass]);
    let table = tabs(&mut tiles, &[Kind::Prescription]);
    let system = tabs(&mut tiles, &[Kind::System, Kind::Zoom, Kind::Tolerances]);
    let table = row(&mut tiles, &[(table, 0.66), (system, 0.34)]);
    let left = column(&mut tiles, &[(drawings, 0.54), (table, 0.46)]);
    let spots = tabs(&mut tiles, &[Kind::Spot, Kind::Fans, Kind::Pupil]);
    let contrast = [
        Kind::Contrast,
        Kind::Wavefront,
        Kind::FieldCurves,
        Kind::SpotMap,
        Kind::Footprint,
        Kind::Ghosts,
        Kind::Picture,
    ];
    let contrast = tabs(&mut tiles, &contrast);
    let facts = tabs(&mut tiles, &[Kind::FirstOrder, Kind::Effects]);
    let sums = tabs(&mut tiles, &[Kind::Seidel]);
    let numbers = row(&mut tiles, &[(facts, 0.42), (sums, 0.58)]);
    let middle = column(&mut tiles, &[(spots, 0.3), (contrast, 0.3), (numbers, 0.4)]);
    let better = tabs(&mut tiles, &[Kind::Optimizer, Kind::Search, Kind::Pareto]);
    let history = tabs(&mut tiles, &[Kind::History, Kind::ImportReport]);
    let right = column(&mut tiles, &[(better, 0.58), (history, 0.42)]);
    let root = row(&mut tiles, &[(left, 0.46), (middle, 0.3), (right, 0.24)]);
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

#[cfg(test)]
mod tests {
    use super::*;
    use std::collections::HashSet;

    #[test]
    fn every_arrangement_has_every_panel_once() {
        let kinds = |arrangement: Arrangement| {
            let tree = arrangement.tree();
            let panes = tree.tiles.tiles().filter_map(|tile| match tile {
                Tile::Pane(kind) => Some(format!("{kind:?}")),
                Tile::Container(_) => None,
            });
            panes.collect::<Vec<_>>()
        };
        let all: HashSet<_> = kinds(Arrangement::Default).into_iter().collect();
        for arrangement in [Arrangement::Default, Arrangement::Search, Arrangement::Large] {
            let found = kinds(arrangement);
            assert_eq!(found.len(), all.len(), "{arrangement:?}");
            assert_eq!(found.into_iter().collect::<HashSet<_>>(), all, "{arrangement:?}");
        }
    }
}
