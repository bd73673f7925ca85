//! The light that makes the image of a beam: its square, the way it is traced, and the screen with
//! its target. A renderer of pictures follows more of it than a loss needs.

use crate::grin::GrinSetup;
use crate::grin_design::evaluation::screen::image_screen;
use crate::grin_design::evaluation::views::plan_views;
use crate::grin_design::field::GrinField;
use crate::grin_design::task::source::RaySet;
use crate::grin_design::task::{GrinTask, LightView, SquareBeam};
use crate::grin_design::{GrinTaskError, ViewImage};

/// The beam of a view whose goal is an image, with its screen.
#[derive(Debug, Clone, PartialEq)]
pub struct ImageLight {
    /// The light before the domain.
    pub beam: SquareBeam,
    /// The way rays are traced. They end on the plane of the screen, or on the boundary of the
    /// domain if the screen is at infinity.
    pub setup: GrinSetup<f64>,
    /// The screen with its target, and with an image that is black.
    pub dark: ViewImage,
}

impl GrinTask {
    /// The light of every view in a field; `None` for a view whose goal is no image.
    ///
    /// # Errors
    /// A target image that is not available, or a domain without extent.
    pub fn image_light(&self, field: &GrinField) -> Result<Vec<Option<ImageLight>>, GrinTaskError> {
        let setups = plan_views(self, field.index_field(), RaySet::Scoring)?;
        let light = |(view, setup)| self.light_of(view, setup);
        self.views.iter().zip(setups).map(light).collect()
    }

    /// The way in which the rays of every view are traced through a field.
    ///
    /// # Errors
    /// A domain without extent.
    pub fn tracing_setups(&self, field: &GrinField) -> Result<Vec<GrinSetup<f64>>, GrinTaskError> {
        plan_views(self, field.index_field(), RaySet::Scoring)
    }

    fn light_of(
        &self,
        view: &LightView,
        setup: GrinSetup<f64>,
    ) -> Result<Option<ImageLight>, GrinTaskError> {
        let space = view.space.unwrap_or(self.space);
        let beam = view.source.beam(space);
        let Some((beam, screen)) = beam.zip(image_screen(view, space)?) else { return Ok(None) };
        let (pixels, half, target) = (screen.pixels, screen.half, screen.wanted);
        let dark = ViewImage { pixels, half, formed: vec![0.0; target.len()], target };
        Ok(Some(ImageLight { beam, setup, dark }))
    }
}
