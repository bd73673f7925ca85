//! Reference and initial fields: given by a formula, or by a volume file.

use crate::grin::IndexField;
use crate::grin::field::{
    GridError, Luneburg, Maxwell, Parabolic, Plume, ProfileField, RegularGrid, Sech, Tricubic,
    Trilinear,
};
use crate::grin_design::ReferenceFieldError;
use crate::grin_design::task::{InitialField, ReferenceField, VolumeFile};
use crate::math::{Real, Vec3};

/// The index at every point.
type IndexFunction<'a> = Box<dyn Fn(Vec3<f64>) -> f64 + 'a>;

/// The field of a volume file that has been read.
fn volume(file: &VolumeFile) -> Result<&Trilinear<f64>, ReferenceFieldError> {
    file.content().ok_or_else(|| ReferenceFieldError::NotRead { file: file.name() })
}

/// The same field in another number type.
fn cast<R: Real>(volume: &Trilinear<f64>) -> Result<Trilinear<R>, GridError> {
    let grid = volume.grid();
    let (low, spacing) = (Vec3::from_f64(grid.low()), Vec3::from_f64(grid.spacing()));
    let values = volume.parameters().iter().copied().map(R::from_f64).collect();
    Trilinear::new(RegularGrid::new(grid.counts(), low, spacing)?, values)
}

impl InitialField {
    /// The index of the initial field.
    pub(in crate::grin_design) fn index(&self) -> Result<IndexFunction<'_>, ReferenceFieldError> {
        Ok(match self {
            Self::Uniform(index) => {
                let index = *index;
                Box::new(move |_| index)
            }
            Self::Volume(file) => {
                let volume = volume(file)?;
                Box::new(move |p| volume.sample(p).index)
            }
        })
    }
}

impl ReferenceField {
    /// The field sampled on a grid.
    ///
    /// # Errors
    /// A volume that has not been read, or an invalid grid.
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
    /// A volume that has not been read.
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
            Self::Volume(file) => {
                let wrong = |source| ReferenceFieldError::Values { file: file.name(), source };
                Box::new(cast(volume(file)?).map_err(wrong)?)
            }
        })
    }
}
