//! Checks of the volumes of a task: their extent and the range of their index.

use super::grin_field::GrinField;
use super::index_bounds::IndexBound;
use super::reference::read_field;
use crate::grin_design::task::{Domain, GrinTask, InitialField, LightGoal, ReferenceField};
use crate::grin_design::{GrinTaskError, ReferenceFieldError};
use std::path::Path;

/// The relative rounding error of an index stored with four bytes.
const SINGLE_PRECISION: f64 = 5e-7;

impl GrinTask {
    /// Refuses volumes that cannot be read or do not cover their domain, and an initial volume that
    /// violates the limits.
    pub(in crate::grin_design) fn check_volumes(&self) -> Result<(), GrinTaskError> {
        let check = |place: String, path: &Path, space: Domain| {
            check_extent(path, space).map_err(|source| GrinTaskError::Field { place, source })
        };
        if let InitialField::Volume(path) = &self.start {
            check("start".to_owned(), path, self.space)?;
            check_index_range(path, &self.spaces(), [self.limits.low, self.limits.high])
                .map_err(|source| GrinTaskError::Field { place: "start".to_owned(), source })?;
        }
        if let Some(ReferenceField::Volume(path)) = &self.exact {
            check("exact".to_owned(), path, self.space)?;
        }
        for view in &self.views {
            if let LightGoal::Like { field: ReferenceField::Volume(path), .. } = &view.goal {
                check(format!("view {}", view.name), path, view.space.unwrap_or(self.space))?;
            }
        }
        Ok(())
    }
}

/// Refuses a volume that ends before a domain does by more than half a voxel: beyond its last nodes
/// a field is only extrapolated.
pub(super) fn check_extent(path: &Path, space: Domain) -> Result<(), ReferenceFieldError> {
    let grid = *read_field::<f64>(path)?.grid();
    let (low, spacing, counts) = (grid.low(), grid.spacing(), grid.counts());
    let [from, to] = space.corners();
    let axes = [
        ('x', low.x, spacing.x, counts[0], [from.x, to.x]),
        ('y', low.y, spacing.y, counts[1], [from.y, to.y]),
        ('z', low.z, spacing.z, counts[2], [from.z, to.z]),
    ];
    for (axis, low, spacing, count, expected) in axes {
        let high = low + spacing * (count - 1) as f64;
        if low > expected[0] + 0.5 * spacing || high < expected[1] - 0.5 * spacing {
            let file = path.display().to_string();
            return Err(ReferenceFieldError::TooSmall { file, axis, low, high, expected });
        }
    }
    Ok(())
}

/// Refuses a volume with an index beyond limits within some domains, up to the rounding of four
/// bytes.
pub(super) fn check_index_range(
    path: &Path,
    spaces: &[Domain],
    expected: [f64; 2],
) -> Result<(), ReferenceFieldError> {
    let medium = GrinField::Trilinear(read_field::<f64>(path)?);
    let [low, high] =
        [IndexBound::Low, IndexBound::High].map(|bound| medium.extreme_index(spaces, bound));
    let beyond = [(low, expected[0] - low.0), (high, high.0 - expected[1])];
    match beyond.into_iter().find(|(_, by)| *by > SINGLE_PRECISION) {
        None => Ok(()),
        Some(((found, at), _)) => {
            let file = path.display().to_string();
            Err(ReferenceFieldError::BeyondLimits { file, found, at: [at.x, at.y, at.z], expected })
        }
    }
}
