//! The images of the views of a design task in a gradient-index field, as pictures: with a stated error, and beside
//! their targets.
//!
//! The loss of a task forms its image of the rays that it needs for a gradient, each spread over some pixels so that
//! the image changes smoothly. Here a pixel is the light on its area, and there are as many rays as its error needs.

use super::projected_light::{
    LightProjection, LightScreen, ProjectionProgress, ProjectionSettings, screen_frame,
};
use super::{ProjectedImage, ProjectionError};
use crate::analysis::Estimate;
use crate::grin_design::{GrinField, GrinTask, ImageLight, ViewImage};

/// The image of a view beside its target.
#[derive(Debug, Clone, PartialEq)]
pub struct ProjectedView {
    /// The image and its target, rows from the bottom.
    pub image: ViewImage,
    /// The image with its errors and the fates of its rays.
    pub light: ProjectedImage,
}

impl ProjectedView {
    /// Follows the light of a view through a field.
    ///
    /// # Errors
    /// A screen that is too large, a domain without extent, or fewer rays than replicates.
    pub fn new(
        field: &GrinField,
        light: ImageLight,
        settings: &ProjectionSettings,
        progress: ProjectionProgress<'_>,
    ) -> Result<Self, ProjectionError> {
        let ImageLight { beam, setup, dark } = light;
        let frame = screen_frame(dark.half, dark.pixels)?;
        let screens = vec![LightScreen { face: setup.screen, frame }];
        let projection = LightProjection::new(field.index_field(), setup, beam, screens)?;
        let light = projection.render(settings, progress)?.swap_remove(0);
        let image = with_light(&dark, &light.values);
        Ok(Self { image, light })
    }

    /// The peak signal-to-noise ratio in dB. The noise of sampling is taken away: it is that of the image with any
    /// number of rays.
    pub fn quality(&self) -> Estimate {
        self.estimate(ViewImage::psnr)
    }

    /// The correlation coefficient of image and target, at most 1.
    pub fn correlation(&self) -> Estimate {
        let found = self.estimate(ViewImage::correlation);
        Estimate { value: found.value.clamp(-1.0, 1.0), ..found }
    }

    /// Quality, correlation and error of the pixels for a title.
    pub fn summary(&self) -> String {
        let Some(error) = self.light.rms_error() else {
            return "no light on the screen".to_owned();
        };
        let [quality, correlation] = [self.quality(), self.correlation()];
        format!(
            "{:.1} ± {:.1} dB, correlation {:.3}, pixels ± {:.1} %",
            quality.value,
            quality.error,
            correlation.value,
            100.0 * error
        )
    }

    /// A number of the image beside its target, with its error by sampling.
    pub fn estimate(&self, number: impl Fn(&ViewImage) -> f64) -> Estimate {
        self.light.estimate(|values| number(&with_light(&self.image, values)))
    }
}

/// The screen of an image with other light, whose rows are from the top.
fn with_light(image: &ViewImage, values: &[f64]) -> ViewImage {
    let rows = values.chunks(image.pixels.max(1)).rev();
    ViewImage { formed: rows.flatten().copied().collect(), ..image.clone() }
}

/// The images of all views of a task in a field; `None` for a view whose goal is no image. An image that is ended
/// early is the last one.
///
/// # Errors
/// A target that is not available, or an image that cannot be made.
pub fn project_views(
    task: &GrinTask,
    field: &GrinField,
    settings: &ProjectionSettings,
    progress: ProjectionProgress<'_>,
) -> Result<Vec<Option<ProjectedView>>, ProjectionError> {
    let lights = task.image_light(field)?;
    let count = lights.len() as f64;
    let mut views = Vec::new();
    for (i, light) in lights.into_iter().enumerate() {
        let mut part = |share: f64| progress((i as f64 + share) / count);
        let view = light.map(|light| ProjectedView::new(field, light, settings, &mut part));
        let view = view.transpose()?;
        let is_ended = view.as_ref().is_some_and(|view| !view.light.complete);
        views.push(view);
        if is_ended {
            break;
        }
    }
    Ok(views)
}
