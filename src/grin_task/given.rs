//! Reference and initial fields: given by a formula, or by a volume file.

use super::check::INDEX_ROUNDING;
use super::medium::GrinField;
use super::range::IndexBound;
use super::task::{Domain, InitialField, ReferenceField};
use crate::files::{self, FileError, Volume};
use crate::grin::IndexField;
use crate::grin::field::{
    GridError, Luneburg, Maxwell, Parabolic, Plume, ProfileField, RegularGrid, Sech, Tricubic,
    Trilinear,
};
use crate::math::{Real, Vec3};
use std::path::Path;

/// The relative rounding error of an index stored with four bytes.
const SINGLE_PRECISION: f64 = 5e-7;

/// A reference or initial field that is not available.
#[derive(Debug, thiserror::Error)]
pub enum ReferenceFieldError {
    /// The file cannot be read.
    #[error(transparent)]
    File(#[from] FileError),
    /// The values do not make a field.
    #[error("{file}: {source}")]
    Values {
        /// The file.
        file: String,
        /// The cause.
        source: GridError,
    },
    /// An index below 1.
    #[error(
        "{file}: node {node:?} has the index {found}; expected 1 or more; the index of a raw volume \
         is offset + scale * number, and a number has its lowest byte first"
    )]
    Index {
        /// The file.
        file: String,
        /// The node, counted from 0 along x, y and z.
        node: [usize; 3],
        /// The index there.
        found: f64,
    },
    /// An index beyond the limits of the task.
    #[error(
        "{file}: the index is {found} at {at:?} mm; expected {} to {}, the limits of the task",
        expected[0], expected[1]
    )]
    BeyondLimits {
        /// The file.
        file: String,
        /// The index farthest beyond the limits.
        found: f64,
        /// Its position, in mm.
        at: [f64; 3],
        /// The smallest and the largest index.
        expected: [f64; 2],
    },
    /// The volume does not cover the domain.
    #[error("{file}: reaches from {low} to {high} mm along {axis}; expected all of {expected:?}")]
    TooSmall {
        /// The file.
        file: String,
        /// `x`, `y` or `z`.
        axis: char,
        /// The lower end of the volume, in mm.
        low: f64,
        /// The upper end of the volume, in mm.
        high: f64,
        /// The extent of the domain, in mm.
        expected: [f64; 2],
    },
}

/// The trilinear field of a volume in a file.
pub(super) fn read_field<R: Real>(path: &Path) -> Result<Trilinear<R>, ReferenceFieldError> {
    let Volume { grid, values } = files::read_volume(path)?;
    let wrong = |source| ReferenceFieldError::Values { file: path.display().to_string(), source };
    if let Some(n) = values.iter().position(|index| !(*index >= 1.0 - INDEX_ROUNDING)) {
        let (file, node) = (path.display().to_string(), node_place(grid.counts(), n));
        return Err(ReferenceFieldError::Index { file, node, found: values[n] });
    }
    let (low, spacing) = (Vec3::from_f64(grid.low()), Vec3::from_f64(grid.spacing()));
    let grid = RegularGrid::new(grid.counts(), low, spacing).map_err(wrong)?;
    Trilinear::new(grid, values.into_iter().map(R::from_f64).collect()).map_err(wrong)
}

/// The position of a node in a grid.
fn node_place([nx, ny, _]: [usize; 3], n: usize) -> [usize; 3] {
    [n % nx, n / nx % ny, n / nx / ny]
}

/// The index at every point.
type IndexFunction = Box<dyn Fn(Vec3<f64>) -> f64>;

impl InitialField {
    /// The index of the initial field.
    pub(super) fn index(&self) -> Result<IndexFunction, ReferenceFieldError> {
        Ok(match self {
            Self::Uniform(index) => {
                let index = *index;
                Box::new(move |_| index)
            }
            Self::Volume(path) => {
                let volume = read_field::<f64>(path)?;
                Box::new(move |p| volume.sample(p).index)
            }
        })
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

impl ReferenceField {
    /// The field sampled on a grid.
    ///
    /// # Errors
    /// A volume that cannot be read, or an invalid grid.
    pub fn sample_on_grid<R: Real>(
        &self,
        cubic: bool,
        nodes: usize,
        half: f64,
    ) -> Result<Box<dyn IndexField<R>>, ReferenceFieldError> {
        let exact = self.field::<R>()?;
        let value = |p: Vec3<R>| exact.sample(p).index;
        let wrong = |source| ReferenceFieldError::Values { file: format!("{nodes} nodes"), source };
        let half = R::from_f64(half);
        if cubic {
            let cells = nodes.saturating_sub(1);
            return Ok(Box::new(Tricubic::approximate(cells, half, value).map_err(wrong)?));
        }
        let grid = RegularGrid::cube(nodes, half).map_err(wrong)?;
        Ok(Box::new(Trilinear::from_function(grid, value).map_err(wrong)?))
    }

    /// The field.
    ///
    /// # Errors
    /// A volume that cannot be read.
    pub fn field<R: Real>(&self) -> Result<Box<dyn IndexField<R>>, ReferenceFieldError> {
        let c = R::from_f64;
        Ok(match self {
            Self::Luneburg { radius } => Box::new(ProfileField::sphere(Luneburg::new(c(*radius)))),
            Self::Maxwell { centre, radius } => {
                Box::new(ProfileField::sphere(Maxwell::new(c(*centre), c(*radius))))
            }
            Self::Secant { axis, a } => {
                Box::new(ProfileField::cylinder(Sech::new(c(*axis), c(*a))))
            }
            Self::Parabolic { axis, g } => {
                Box::new(ProfileField::cylinder(Parabolic::new(c(*axis), c(*g))))
            }
            Self::Plume { ambient, contrast, half } => {
                Box::new(Plume::new(c(*ambient), c(*contrast), c(*half)))
            }
            Self::Volume(path) => Box::new(read_field(path)?),
        })
    }
}
