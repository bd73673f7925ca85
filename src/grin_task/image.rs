//! Images that light makes on a screen: the loss of a display, and its derivative by every ray.
//!
//! Each ray deposits a quadratic B-spline footprint of three by three pixels (5.32 and 5.33), so that
//! the image changes smoothly as rays move. It takes two passes: all rays make the image, then the
//! difference from the picture that is wanted tells each ray where it should go.

use super::space::{across, unit};
use super::task::{Drawing, Space};
use crate::grin::{Exit, Face, Seed};
use crate::math::Vec3;

/// Points along a side of a pixel of a drawing.
const FINE: usize = 4;

/// A square screen across the direction of a beam, and the picture that is wanted on it.
#[derive(Debug, Clone)]
pub(super) struct Screen {
    pub(super) face: Face<f64>,
    axes: [Vec3<f64>; 2],
    pub(super) half: f64,
    pub(super) pixels: usize,
    pub(super) wanted: Vec<f64>,
}

/// The pixels that a ray touches along one axis: the first, three weights and their slopes.
type Touched = (isize, [f64; 3], [f64; 3]);

impl Screen {
    pub(super) fn new(
        space: Space,
        [x, y, z]: [f64; 3],
        (half, distance, pixels): (f64, f64, usize),
        drawing: Drawing,
    ) -> Self {
        let direction = unit(Vec3::new(x, y, z));
        let mut wanted: Vec<f64> = (0..pixels * pixels).map(|n| drawing.pixel(n, pixels)).collect();
        let mean = wanted.iter().sum::<f64>() / wanted.len() as f64;
        wanted.iter_mut().for_each(|value| *value /= mean);
        let face = space.behind(direction, distance);
        Self { face, axes: across(direction), half, pixels, wanted }
    }

    fn pitch(&self) -> f64 {
        2.0 * self.half / self.pixels as f64
    }

    /// Where a point stands along an axis of the screen.
    fn touched(&self, x: Vec3<f64>, axis: usize) -> Touched {
        let u = (self.axes[axis].dot(x) + self.half) / self.pitch() - 0.5;
        let nearest = u.round();
        let t = u - nearest;
        let weights = [0.5 * (0.5 - t).powi(2), 0.75 - t * t, 0.5 * (0.5 + t).powi(2)];
        (nearest as isize - 1, weights, [t - 0.5, -2.0 * t, t + 0.5])
    }

    /// What each touched pixel gets: its number, and the weight with its slopes along both axes.
    fn footprint(&self, x: Vec3<f64>) -> impl Iterator<Item = (usize, f64, [f64; 2])> {
        let [(u, wu, su), (v, wv, sv)] = [self.touched(x, 0), self.touched(x, 1)];
        let pixels = self.pixels as isize;
        (0..9).filter_map(move |k: usize| {
            let (i, j) = (k % 3, k / 3);
            let (a, b) = (u + i as isize, v + j as isize);
            let inside = a >= 0 && a < pixels && b >= 0 && b < pixels;
            let number = usize::try_from(b * pixels + a).ok()?;
            inside.then_some((number, wu[i] * wv[j], [su[i] * wv[j], wu[i] * sv[j]]))
        })
    }

    /// The light of a ray: as many pixels as rays give an image of mean 1.
    fn share(&self, rays: usize) -> f64 {
        (self.pixels * self.pixels) as f64 / rays as f64
    }

    /// The image that rays make.
    pub(super) fn image<'a>(
        &self,
        exits: impl Iterator<Item = &'a Exit<f64>>,
        rays: usize,
    ) -> Vec<f64> {
        let (mut image, share) = (vec![0.0; self.pixels * self.pixels], self.share(rays));
        for exit in exits.filter(|exit| exit.x.is_finite()) {
            self.footprint(exit.x).for_each(|(pixel, weight, _)| image[pixel] += share * weight);
        }
        image
    }

    /// The mean square difference between an image and the picture.
    pub(super) fn difference(&self, image: &[f64]) -> f64 {
        let squares = image.iter().zip(&self.wanted).map(|(a, b)| (a - b) * (a - b));
        squares.sum::<f64>() / image.len() as f64
    }

    /// The peak signal against that difference, in dB.
    pub(super) fn quality(&self, difference: f64) -> f64 {
        let peak = self.wanted.iter().copied().fold(0.0, f64::max);
        10.0 * (peak * peak / difference).log10()
    }

    /// The derivative of that difference by the place of a ray.
    pub(super) fn seed(&self, image: &[f64], x: Vec3<f64>, rays: usize) -> Seed<f64> {
        let scale = 2.0 * self.share(rays) / (image.len() as f64 * self.pitch());
        let (mut along, mut up) = (0.0, 0.0);
        for (pixel, _, slopes) in self.footprint(x) {
            let off = image[pixel] - self.wanted[pixel];
            along += off * slopes[0];
            up += off * slopes[1];
        }
        let [u, v] = self.axes;
        Seed { x: (u * along + v * up) * scale, ..Seed::default() }
    }
}

impl Drawing {
    /// A pixel of the drawing, averaged over its area.
    fn pixel(self, n: usize, pixels: usize) -> f64 {
        let fine = (pixels * FINE) as f64;
        let at = |pixel: usize, k: usize| 2.0 * ((pixel * FINE + k) as f64 + 0.5) / fine - 1.0;
        let lit = |k: usize| self.light(at(n % pixels, k % FINE), at(n / pixels, k / FINE));
        (0..FINE * FINE).map(lit).sum::<f64>() / (FINE * FINE) as f64
    }

    /// The light at a point of the square from -1 to 1: soft edges on a dim ground.
    fn light(self, x: f64, y: f64) -> f64 {
        let dim = 0.25;
        let edge = |distance: f64| 1.0 / (1.0 + (distance / 0.03).exp());
        let drawn = match self {
            Self::Face => {
                let r = x.hypot(y);
                let ring = edge((r - 0.62).abs() - 0.08);
                let eye = |side: f64| edge((x - side * 0.24).hypot(y - 0.2) - 0.11);
                let mouth = edge(((x.hypot(y + 0.02)) - 0.36).abs() - 0.06) * edge(y + 0.16);
                ring.max(eye(-1.0)).max(eye(1.0)).max(mouth)
            }
            Self::Letter => {
                let frame = edge((x.abs().max(y.abs()) - 0.68).abs() - 0.07);
                let leg = |side: f64| edge((x - side * 0.5 * (0.45 - y) * 0.55).abs() - 0.075);
                let legs = leg(-1.0).max(leg(1.0)) * edge(y.abs() - 0.45);
                let bar = edge((y + 0.08).abs() - 0.06) * edge(x.abs() - 0.2);
                frame.max(legs).max(bar)
            }
        };
        dim + (1.0 - dim) * drawn
    }
}
