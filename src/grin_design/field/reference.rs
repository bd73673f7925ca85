//! Reference and initial fields: given by a formula, or by a volume file.

use crate::files::{self, Volume};
use crate::grin::IndexField;
use crate::grin::field::{
    Luneburg, Maxwell, Parabolic, Plume, ProfileField, RegularGrid, Sech, Tricubic, Trilinear,
};
use crate::grin_design::ReferenceFieldError;
use crate::grin_design::task::checks::INDEX_ROUNDING;
use crate::grin_design::task::{InitialField, ReferenceField};
use crate::math::{Real, Vec3};
use std::path::Path;

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
    pub(in crate::grin_design) fn index(&self) -> Result<IndexFunction, ReferenceFieldError> {
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
