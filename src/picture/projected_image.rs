//! The image of a beam: the irradiance of its pixels, each with an error, and estimates from its replicates.

use super::ImageFrame;
use super::exact::{REPLICATES, gray_rms, mean_with_error};
use crate::analysis::Estimate;
use crate::grin::GrinFateCounts;

/// The rays for each pixel, on average, with which the spread of replicates tells the error: where fewer land,
/// most pixels are black in all replicates, which then agree.
const RAYS_OF_PIXEL: f64 = 4.0;

/// The image of a beam on a screen.
#[derive(Debug, Clone, PartialEq)]
pub struct ProjectedImage {
    /// The pixels' places across the axis of the beam, in mm, or in tangents of angles at infinity.
    pub frame: ImageFrame,
    /// The irradiance of the pixels, row by row from the upper left corner for an eye that looks against the light;
    /// 1 for all light of the beam spread evenly over the image.
    pub values: Vec<f64>,
    /// The standard errors of the values by sampling.
    pub errors: Vec<f64>,
    /// The number of rays.
    pub rays: usize,
    /// The fates of the rays: those that do not arrive bring no light.
    pub fates: GrinFateCounts,
    /// The number of rays that arrived beside the image.
    pub beside: usize,
    /// True if the error that was asked for is reached.
    pub reached: bool,
    /// False if the work was ended early.
    pub complete: bool,
    /// The images of the independent sets of samples.
    replicates: [Vec<f64>; REPLICATES],
}

impl ProjectedImage {
    /// The mean of replicates, of rays with these fates of which so many arrived beside the image.
    pub(super) fn new(
        frame: ImageFrame,
        replicates: [Vec<f64>; REPLICATES],
        (fates, beside): (GrinFateCounts, usize),
    ) -> Self {
        let pixels = 0..frame.pixels[0] * frame.pixels[1];
        let statistics = |pixel| mean_with_error(replicates.each_ref().map(|image| image[pixel]));
        let (values, errors) = pixels.map(statistics).unzip();
        let rays = fates.total();
        let (reached, complete) = (false, true);
        Self { frame, values, errors, rays, fates, beside, reached, complete, replicates }
    }

    /// The mean of the image: the share of the light that lands on it.
    pub fn mean(&self) -> f64 {
        mean(&self.values)
    }

    /// The share of the light that lands on the image; its error is at least the light of one ray.
    pub fn light(&self) -> Estimate {
        let found = self.estimate(mean);
        Estimate { error: found.error.max(1.0 / self.rays.max(1) as f64), ..found }
    }

    /// The number of rays that land on a pixel, on average.
    fn rays_of_pixel(&self) -> f64 {
        let landed = self.fates.arrived_count() - self.beside;
        landed as f64 / self.values.len().max(1) as f64
    }

    /// The share of the light that arrives nowhere: rays that are lost on the way.
    pub fn lost_share(&self) -> f64 {
        let lost = self.rays - self.fates.arrived_count();
        lost as f64 / self.rays.max(1) as f64
    }

    /// The root mean square error by sampling, as a share of the mean of the image, or of the pixel where that is
    /// brighter; `None` of a black image, which has no mean. Of few rays it is at least what counting them leaves.
    pub fn rms_error(&self) -> Option<f64> {
        let mean = self.mean();
        let spread = (mean > 0.0).then(|| gray_rms(&self.values, &self.errors, mean))?;
        let count = self.rays_of_pixel();
        Some(if count < RAYS_OF_PIXEL { spread.max(count.sqrt().recip()) } else { spread })
    }

    /// A number of the image, such as its correlation with another one, with its error by sampling.
    ///
    /// By the jackknife: the number is taken of the mean of all replicates and of the means without one of them. What
    /// noise alone adds to it falls with the number of replicates, which shows how much that is, and is taken away.
    pub fn estimate(&self, number: impl Fn(&[f64]) -> f64) -> Estimate {
        let n = REPLICATES as f64;
        let whole = number(&self.values);
        if !whole.is_finite() {
            return Estimate::new(whole, 0.0, self.rays);
        }
        let parts: [f64; REPLICATES] = std::array::from_fn(|left| number(&self.without(left)));
        let middle = parts.iter().sum::<f64>() / n;
        let squares: f64 = parts.iter().map(|part| (part - middle).powi(2)).sum();
        let error = ((n - 1.0) / n * squares).sqrt();
        Estimate::new(n * whole - (n - 1.0) * middle, error, self.rays)
    }

    /// The mean of all replicates but one.
    fn without(&self, left: usize) -> Vec<f64> {
        let others = (REPLICATES - 1) as f64;
        let kept = |pixel: usize| {
            let images = self.replicates.iter().enumerate().filter(|(i, _)| *i != left);
            images.map(|(_, image)| image[pixel]).sum::<f64>() / others
        };
        (0..self.values.len()).map(kept).collect()
    }

    /// The difference from an independent image of the same light, relative to what the errors of both allow: root
    /// mean squares over the pixels, weighted as in [`ProjectedImage::rms_error`]. About 1 if the errors are right.
    pub fn difference(&self, other: &Self) -> f64 {
        let mean = 0.5 * (self.mean() + other.mean());
        let pairs = self.values.iter().zip(&other.values);
        let (mut found, mut allowed) = (0.0, 0.0);
        for ((a, b), (ea, eb)) in pairs.zip(self.errors.iter().zip(&other.errors)) {
            let weight = (0.5 * (a + b)).max(mean).max(f64::MIN_POSITIVE).powi(-2);
            found += weight * (a - b) * (a - b);
            allowed += weight * (ea * ea + eb * eb);
        }
        // Images without errors must not differ at all.
        if found > 0.0 { (found / allowed.max(f64::MIN_POSITIVE)).sqrt() } else { 0.0 }
    }
}

fn mean(values: &[f64]) -> f64 {
    values.iter().sum::<f64>() / values.len().max(1) as f64
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::grin::GrinFate;

    /// An image of two pixels from four replicates.
    fn image(replicates: [[f64; 2]; REPLICATES]) -> ProjectedImage {
        let frame = ImageFrame { pixels: [2, 1], pitch: 1.0, center: [0.0; 2], inverted: false };
        let fates = [GrinFate::Left; 8].into_iter().collect();
        ProjectedImage::new(frame, replicates.map(Vec::from), (fates, 0))
    }

    #[test]
    fn the_mean_of_an_image_has_the_error_of_a_mean() {
        let image = image([[1.0, 3.0], [2.0, 4.0], [3.0, 5.0], [4.0, 6.0]]);
        let light = image.light();
        let exact = (5.0_f64 / 12.0).sqrt();
        assert!((light.value - 3.5).abs() < 1e-12, "{light:?}");
        assert!((light.error - exact).abs() < 1e-12, "{light:?}");
        assert!(image.errors.iter().all(|error| (error - exact).abs() < 1e-12));
    }

    /// The square of a mean is too large by the square of its error, on average.
    #[test]
    fn the_share_of_noise_is_taken_away_from_a_square() {
        let image = image([[1.0, 0.0], [2.0, 0.0], [3.0, 0.0], [4.0, 0.0]]);
        let square = image.estimate(|values| values[0] * values[0]);
        assert!((square.value - (2.5 * 2.5 - 5.0 / 12.0)).abs() < 1e-12, "{square:?}");
    }

    #[test]
    fn a_number_that_is_infinite_has_no_jackknife() {
        let image = image([[1.0, 3.0], [2.0, 4.0], [3.0, 5.0], [4.0, 6.0]]);
        let found = image.estimate(|_| f64::INFINITY);
        assert_eq!((found.value, found.error), (f64::INFINITY, 0.0));
    }

    /// One ray of eight on two pixels: the replicates agree that one of them is black.
    #[test]
    fn an_image_of_few_rays_has_the_error_of_their_number() {
        let frame = ImageFrame { pixels: [2, 1], pitch: 1.0, center: [0.0; 2], inverted: false };
        let fates = [GrinFate::Left; 8].into_iter().collect();
        let replicates = [[1.0, 0.0], [0.0; 2], [0.0; 2], [0.0; 2]].map(Vec::from);
        let image = ProjectedImage::new(frame, replicates, (fates, 7));
        assert_eq!(image.rays_of_pixel(), 0.5);
        assert!(image.rms_error() > Some(1.41), "{:?}", image.rms_error());
    }

    #[test]
    fn a_black_image_states_what_it_would_have_seen() {
        let image = image([[0.0; 2]; REPLICATES]);
        assert_eq!(image.rms_error(), None);
        assert_eq!((image.light().value, image.light().error), (0.0, 1.0 / 8.0));
        assert_eq!(image.difference(&image), 0.0);
    }
}
