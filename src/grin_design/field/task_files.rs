//! Reading the files of a task: reference and initial volumes, and target images.

use super::grin_field::GrinField;
use super::index_bounds::IndexBound;
use crate::files::{self, Volume, read_grayscale};
use crate::grin::field::Trilinear;
use crate::grin_design::task::checks::INDEX_ROUNDING;
use crate::grin_design::task::{
    Domain, GrinTask, InitialField, LightGoal, ReferenceField, TargetImage, VolumeFile,
};
use crate::grin_design::{GrinTaskError, ReferenceFieldError};
use std::path::{Path, PathBuf};

/// The relative rounding error of an index stored with four bytes.
const SINGLE_PRECISION: f64 = 5e-7;

impl GrinTask {
    /// Reads the files that the task names, and checks their content. A task without files needs
    /// no reading; files that have been read are not read again.
    ///
    /// # Errors
    /// A file that cannot be read, an image without light in its central square, a volume that does
    /// not cover its domain, or an initial volume that violates the limits.
    pub fn read_files(&self) -> Result<(), GrinTaskError> {
        for (i, view) in self.views.iter().enumerate() {
            if let LightGoal::Image { drawing, pixels, .. }
            | LightGoal::Far { drawing, pixels, .. } = &view.goal
            {
                read_image(drawing, *pixels, &format!("views, number {i}, goal, drawing"))?;
            }
        }
        if let InitialField::Volume(file) = &self.start {
            let range = [self.limits.low, self.limits.high];
            read_volume(file, self.space)
                .and_then(|volume| check_index_range(file, volume, &self.spaces(), range))
                .map_err(|source| GrinTaskError::Field {
                    place: "start".to_owned(),
                    source: Box::new(source),
                })?;
        }
        if let Some(ReferenceField::Volume(file)) = &self.exact {
            read_volume(file, self.space).map_err(|source| GrinTaskError::Field {
                place: "exact".to_owned(),
                source: Box::new(source),
            })?;
        }
        for view in &self.views {
            if let LightGoal::Like { field: ReferenceField::Volume(file), .. } = &view.goal {
                let place = format!("view {}", view.name);
                read_volume(file, view.space.unwrap_or(self.space))
                    .map_err(|source| GrinTaskError::Field { place, source: Box::new(source) })?;
            }
        }
        Ok(())
    }
}

impl GrinTask {
    /// The paths of all files that the task is made from, with those that their headers name.
    pub fn files(&self) -> Vec<PathBuf> {
        let mut volumes: Vec<&VolumeFile> = Vec::new();
        let mut paths: Vec<PathBuf> = Vec::new();
        for view in &self.views {
            match &view.goal {
                LightGoal::Image { drawing: TargetImage::File(file), .. }
                | LightGoal::Far { drawing: TargetImage::File(file), .. } => {
                    paths.push(file.path().to_owned());
                }
                LightGoal::Like { field: ReferenceField::Volume(file), .. } => volumes.push(file),
                _ => {}
            }
        }
        if let InitialField::Volume(file) = &self.start {
            volumes.push(file);
        }
        if let Some(ReferenceField::Volume(file)) = &self.exact {
            volumes.push(file);
        }
        paths.extend(volumes.into_iter().flat_map(|file| files::volume_files(file.path())));
        paths
    }
}

/// Reads an image and checks that it has light.
fn read_image(image: &TargetImage, pixels: usize, place: &str) -> Result<(), GrinTaskError> {
    let TargetImage::File(file) = image else { return Ok(()) };
    let read = file.read(read_grayscale).and_then(|_| image.render(pixels));
    let refused =
        |source| GrinTaskError::Picture { place: place.to_owned(), source: Box::new(source) };
    read.map(|_| ()).map_err(refused)
}

/// Reads a volume and checks that it covers a domain.
fn read_volume(file: &VolumeFile, space: Domain) -> Result<&Trilinear<f64>, ReferenceFieldError> {
    let volume = file.read(read_field)?;
    check_extent(file, volume, space)?;
    Ok(volume)
}

/// The trilinear field of a volume file.
fn read_field(path: &Path) -> Result<Trilinear<f64>, ReferenceFieldError> {
    let Volume { grid, values } = files::read_volume(path)?;
    let file = path.display().to_string();
    if let Some(n) = values.iter().position(|index| !(*index >= 1.0 - INDEX_ROUNDING)) {
        let [nx, ny, _] = grid.counts();
        let node = [n % nx, n / nx % ny, n / nx / ny];
        return Err(ReferenceFieldError::Index { file, node, found: values[n] });
    }
    Trilinear::new(grid, values).map_err(|source| ReferenceFieldError::Values { file, source })
}

/// Refuses a volume that ends before a domain does by more than half a voxel: beyond its last nodes
/// a field is only extrapolated.
fn check_extent(
    file: &VolumeFile,
    volume: &Trilinear<f64>,
    space: Domain,
) -> Result<(), ReferenceFieldError> {
    let grid = volume.grid();
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
            let file = file.name();
            return Err(ReferenceFieldError::TooSmall { file, axis, low, high, expected });
        }
    }
    Ok(())
}

/// Refuses a volume with an index beyond limits within some domains, up to the rounding of four
/// bytes.
fn check_index_range(
    file: &VolumeFile,
    volume: &Trilinear<f64>,
    spaces: &[Domain],
    expected: [f64; 2],
) -> Result<(), ReferenceFieldError> {
    let field = GrinField::Trilinear(volume.clone());
    let [low, high] =
        [IndexBound::Low, IndexBound::High].map(|bound| field.extreme_index(spaces, bound));
    let beyond = [(low, expected[0] - low.0), (high, high.0 - expected[1])];
    match beyond.into_iter().find(|(_, by)| *by > SINGLE_PRECISION) {
        None => Ok(()),
        Some(((found, at), _)) => Err(ReferenceFieldError::BeyondLimits {
            file: file.name(),
            found,
            at: [at.x, at.y, at.z],
            expected,
        }),
    }
}
