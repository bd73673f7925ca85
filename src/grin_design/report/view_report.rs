//! The image of every view, traced with the scoring rays, beside its target. Needs no gradient and
//! no optimization.

use crate::grin::{GrinRay, GrinSetup, GrinTracer, IndexField, Integrator, RayExit};
use crate::grin_design::GrinTaskError;
use crate::grin_design::evaluation::loss::ViewResult;
use crate::grin_design::evaluation::outcome::is_valid;
use crate::grin_design::evaluation::screen::peak_signal_to_noise;
use crate::grin_design::evaluation::targets::measure_targets;
use crate::grin_design::evaluation::views::{ViewRays, plan_views, view_rays};
use crate::grin_design::field::GrinField;
use crate::grin_design::task::GrinTask;
use crate::grin_design::task::geometry::length;
use crate::grin_design::task::source::RaySet;

/// Rays used to estimate the tracing error.
const SAMPLE: usize = 64;

/// The image of a view on its screen beside its target: rows from the bottom, as many as columns,
/// both of mean 1 where all light arrives.
#[derive(Debug, Clone, PartialEq)]
pub struct ViewImage {
    /// Pixels along a side.
    pub pixels: usize,
    /// Half the side of the screen, in mm.
    pub half: f64,
    /// The target image.
    pub target: Vec<f64>,
    /// The image formed by the light.
    pub formed: Vec<f64>,
}

/// The result of a view with its image and tracing error.
#[derive(Debug, Clone, PartialEq)]
pub struct ViewReport {
    /// Loss, spot, quality and outcomes of the rays; without retracing, so that no ray is known to
    /// be chaotic.
    pub result: ViewResult,
    /// Its image, if its goal is one.
    pub image: Option<ViewImage>,
    /// The integrator.
    pub integrator: Integrator,
    /// The length of a step, in mm.
    pub step: f64,
    /// The largest change of an exit when the step is halved, in mm; `None` where no ray of the
    /// sample arrives with both.
    pub error: Option<f64>,
    /// The number of rays in that sample.
    pub sample: usize,
}

impl GrinTask {
    /// The results of all views in a field, those of weight 0 included.
    ///
    /// # Errors
    /// A reference volume that has not been read, or a domain without extent.
    pub fn report_views(&self, field: &GrinField) -> Result<Vec<ViewReport>, GrinTaskError> {
        let field = field.index_field();
        let setups = plan_views(self, field, RaySet::Scoring)?;
        view_rays(self, &measure_targets(self)?, &setups, RaySet::Scoring)?
            .iter()
            .map(|view| report_view(view, field))
            .collect()
    }
}

fn report_view(view: &ViewRays, field: &dyn IndexField<f64>) -> Result<ViewReport, GrinTaskError> {
    let GrinSetup { integrator, step, .. } = view.setup;
    let exits = GrinTracer::new(field, view.setup.clone())?.trace_batch(&view.rays);
    let image = view.screen.as_ref().map(|screen| ViewImage {
        pixels: screen.pixels,
        half: screen.half,
        target: screen.wanted.clone(),
        formed: ViewRays::image(screen, &exits),
    });
    let (error, sample) = step_error(view, field, &exits)?;
    Ok(ViewReport { result: view.result(&exits, 0.0), image, integrator, step, error, sample })
}

/// The largest change of exits when the step is halved, over a sample of the rays, and the size of
/// the sample.
fn step_error(
    view: &ViewRays,
    field: &dyn IndexField<f64>,
    exits: &[RayExit<f64>],
) -> Result<(Option<f64>, usize), GrinTaskError> {
    let stride = view.rays.len().div_ceil(SAMPLE).max(1);
    let rays: Vec<GrinRay<f64>> = view.rays.iter().step_by(stride).copied().collect();
    let halved = GrinSetup { step: 0.5 * view.setup.step, ..view.setup.clone() };
    let finer = GrinTracer::new(field, halved)?.trace_batch(&rays);
    let pairs = exits.iter().step_by(stride).zip(&finer);
    let both = pairs.filter(|(a, b)| is_valid(a) && is_valid(b));
    Ok((both.map(|(a, b)| length(a.x - b.x)).reduce(f64::max), rays.len()))
}

impl ViewImage {
    /// The peak signal-to-noise ratio in dB: the square of the target's peak over the mean squared
    /// difference of image and target.
    pub fn psnr(&self) -> f64 {
        let squares = self.formed.iter().zip(&self.target).map(|(a, b)| (a - b) * (a - b));
        peak_signal_to_noise(&self.target, squares.sum::<f64>() / self.formed.len() as f64)
    }

    /// The fraction of the light that falls on the screen.
    pub fn light_share(&self) -> f64 {
        mean(&self.formed)
    }

    /// The correlation coefficient of image and target, pixel by pixel: 1 for images that differ by
    /// contrast alone, 0 for a uniform image.
    pub fn correlation(&self) -> f64 {
        let (a, b) = (mean(&self.formed), mean(&self.target));
        let product = |v: &[f64], v0: f64, w: &[f64], w0: f64| {
            v.iter().zip(w).map(|(v, w)| (v - v0) * (w - w0)).sum::<f64>()
        };
        let both = product(&self.formed, a, &self.target, b);
        let square =
            product(&self.formed, a, &self.formed, a) * product(&self.target, b, &self.target, b);
        if square > 0.0 { both / square.sqrt() } else { 0.0 }
    }
}

fn mean(values: &[f64]) -> f64 {
    values.iter().sum::<f64>() / values.len() as f64
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_image_is_like_itself_and_unlike_an_even_one() {
        let wanted = vec![0.5, 1.5, 0.25, 1.75];
        let of = |made: Vec<f64>| ViewImage {
            pixels: 2,
            half: 1.0,
            target: wanted.clone(),
            formed: made,
        };
        assert!((of(wanted.clone()).correlation() - 1.0).abs() < 1e-12);
        assert!((of(wanted.iter().map(|w| 2.0 - w).collect()).correlation() + 1.0).abs() < 1e-12);
        assert_eq!(of(vec![0.5; 4]).correlation(), 0.0);
        assert_eq!(of(vec![0.5; 4]).light_share(), 0.5);
        let off = of(wanted.iter().map(|w| w + 0.175).collect());
        assert!((off.psnr() - 20.0).abs() < 1e-12, "a tenth of the peak: {}", off.psnr());
    }
}
