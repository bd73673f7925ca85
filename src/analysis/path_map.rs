//! Path differences over the pupil, as a map of them has it.

use super::{AnalysisError, field_paths};
use crate::lens::FieldPoint;
use crate::pupil::RayModel;

/// Numbers at the nodes of a square grid about zero, row by row from below.
#[derive(Debug, Clone, PartialEq)]
pub struct SquareGrid<T> {
    /// The number of columns and of rows, at least 2.
    pub count: usize,
    /// The coordinate of the last column and of the last row.
    pub half_width: f64,
    /// The numbers.
    pub values: Vec<T>,
}

/// The coordinates of the columns, and of the rows, of a square grid.
pub fn grid_sides(count: usize, half_width: f64) -> Vec<f64> {
    (0..count).map(|i| half_width * (2.0 * i as f64 / (count - 1) as f64 - 1.0)).collect()
}

/// The nodes of a square grid, row by row from below.
pub fn grid_nodes(count: usize, half_width: f64) -> Vec<[f64; 2]> {
    let side = grid_sides(count, half_width);
    side.iter().flat_map(|y| side.iter().map(|x| [*x, *y])).collect()
}

/// The path differences of a field over the square about the unit disc of the pupil, in wavelengths;
/// `None` beside the disc and where no light arrives.
///
/// # Errors
/// A field without a wavefront.
pub fn path_map(
    model: &RayModel,
    field: FieldPoint,
    wavelength: usize,
    count: usize,
) -> Result<SquareGrid<Option<f64>>, AnalysisError> {
    let nodes = grid_nodes(count, 1.0);
    let (_, paths) = field_paths(model, field, wavelength, &nodes)?;
    let is_inside = |node: &[f64; 2]| node[0].hypot(node[1]) <= 1.0;
    let waves = nodes
        .iter()
        .zip(paths)
        .map(|(node, path)| path.ok().filter(|_| is_inside(node)).map(|path| path.waves));
    Ok(SquareGrid { count, half_width: 1.0, values: waves.collect() })
}
