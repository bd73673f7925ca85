//! Images formed on a screen: their loss, and its derivative with respect to every ray.
//!
//! Each ray contributes a quadratic B-spline footprint of three by three pixels (5.32 and 5.33), so
//! that the image changes smoothly as rays move. The evaluation takes two passes: all rays form the
//! image, then the difference from the target image gives the adjoint of each ray.

use crate::files::FileError;
use crate::grin::{Face, RayAdjoint, RayExit};
use crate::grin_design::GrinTaskError;
use crate::grin_design::task::TargetImage;
use crate::grin_design::task::geometry::{orthogonal_axes, radians};
use crate::grin_design::task::{Domain, LightGoal, LightView};
use crate::math::Vec3;

/// A ray this many pixels off the screen has no position on it.
const MAX_PIXELS_OFF: f64 = 1e6;

/// A square screen perpendicular to a beam, or at infinity, with its target image.
#[derive(Debug, Clone)]
pub(in crate::grin_design) struct Screen {
    /// The plane of the screen; `None` at infinity.
    pub(super) face: Option<Face<f64>>,
    direction: Vec3<f64>,
    axes: [Vec3<f64>; 2],
    pub(in crate::grin_design) half: f64,
    pub(in crate::grin_design) pixels: usize,
    pub(in crate::grin_design) wanted: Vec<f64>,
}

/// The pixels that a ray contributes to along one axis: the first, three weights and their
/// derivatives.
type AxisFootprint = (isize, [f64; 3], [f64; 3]);

impl Screen {
    /// A screen in the plane `face`.
    pub(super) fn new(
        face: Option<Face<f64>>,
        direction: Vec3<f64>,
        half: f64,
        (drawing, pixels): (&TargetImage, usize),
    ) -> Result<Self, FileError> {
        let wanted = drawing.render(pixels)?;
        Ok(Self { face, direction, axes: orthogonal_axes(direction), half, pixels, wanted })
    }

    fn pitch(&self) -> f64 {
        2.0 * self.half / self.pixels as f64
    }

    /// The position of a ray on the screen along both axes, in pixels from the centre of the first;
    /// at infinity by the tangents of its direction.
    fn arrival(&self, exit: &RayExit<f64>) -> Option<[f64; 2]> {
        let along = exit.v.dot(self.direction);
        let at = |axis: Vec3<f64>| match self.face {
            Some(_) => axis.dot(exit.x),
            None => axis.dot(exit.v) / along,
        };
        let place = self.axes.map(|axis| (at(axis) + self.half) / self.pitch() - 0.5);
        let seen = place.iter().all(|u| u.abs() < MAX_PIXELS_OFF) && along > 0.0;
        seen.then_some(place)
    }

    /// The pixels that a position along one axis contributes to.
    fn axis_footprint(u: f64) -> AxisFootprint {
        let nearest = u.round();
        let t = u - nearest;
        let weights = [0.5 * (0.5 - t).powi(2), 0.75 - t * t, 0.5 * (0.5 + t).powi(2)];
        (nearest as isize - 1, weights, [t - 0.5, -2.0 * t, t + 0.5])
    }

    /// The number of each pixel that a ray contributes to, and the weight with its derivatives
    /// along both axes.
    fn footprint(&self, exit: &RayExit<f64>) -> impl Iterator<Item = (usize, f64, [f64; 2])> {
        let pixels = self.pixels as isize;
        self.arrival(exit).into_iter().flat_map(move |place| {
            let [(u, wu, su), (v, wv, sv)] = place.map(Self::axis_footprint);
            (0..9).filter_map(move |k: usize| {
                let (i, j) = (k % 3, k / 3);
                let (a, b) = (u + i as isize, v + j as isize);
                let inside = a >= 0 && a < pixels && b >= 0 && b < pixels;
                let number = usize::try_from(b * pixels + a).ok()?;
                inside.then_some((number, wu[i] * wv[j], [su[i] * wv[j], wu[i] * sv[j]]))
            })
        })
    }

    /// The light of a ray, such that the image has mean 1.
    fn share(&self, rays: usize) -> f64 {
        (self.pixels * self.pixels) as f64 / rays as f64
    }

    /// The image formed by rays.
    pub(super) fn image<'a>(
        &self,
        exits: impl Iterator<Item = &'a RayExit<f64>>,
        rays: usize,
    ) -> Vec<f64> {
        let (mut image, share) = (vec![0.0; self.pixels * self.pixels], self.share(rays));
        for exit in exits {
            self.footprint(exit).for_each(|(pixel, weight, _)| image[pixel] += share * weight);
        }
        image
    }

    /// The mean square difference between an image and the target.
    pub(super) fn difference(&self, image: &[f64]) -> f64 {
        let squares = image.iter().zip(&self.wanted).map(|(a, b)| (a - b) * (a - b));
        squares.sum::<f64>() / image.len() as f64
    }

    /// The peak signal-to-noise ratio of that difference, in dB.
    pub(super) fn psnr(&self, difference: f64) -> f64 {
        peak_signal_to_noise(&self.wanted, difference)
    }

    /// The derivative of that difference with respect to the exit of a ray.
    pub(super) fn adjoint(
        &self,
        image: &[f64],
        exit: &RayExit<f64>,
        rays: usize,
    ) -> RayAdjoint<f64> {
        let scale = 2.0 * self.share(rays) / (image.len() as f64 * self.pitch());
        let (mut along, mut up) = (0.0, 0.0);
        for (pixel, _, slopes) in self.footprint(exit) {
            let off = image[pixel] - self.wanted[pixel];
            along += off * slopes[0];
            up += off * slopes[1];
        }
        let [u, v] = self.axes;
        let by_place = (u * along + v * up) * scale;
        if self.face.is_some() {
            return RayAdjoint { x: by_place, ..RayAdjoint::default() };
        }
        // The tangents are v/(v·d), whose derivative is 1/(v·d) minus v d/(v·d)².
        let forward = exit.v.dot(self.direction);
        let turned = by_place - self.direction * (by_place.dot(exit.v) / forward);
        let v = if forward > 0.0 { turned * (1.0 / forward) } else { Vec3::default() };
        RayAdjoint { v, ..RayAdjoint::default() }
    }
}

/// The peak signal-to-noise ratio of a mean squared difference from a target, in dB.
pub(in crate::grin_design) fn peak_signal_to_noise(target: &[f64], difference: f64) -> f64 {
    let peak = target.iter().copied().fold(0.0, f64::max);
    10.0 * (peak * peak / difference).log10()
}

/// The plane behind the domain in which the light of a view is evaluated; `None` for its boundary
/// or infinity.
pub(super) fn screen_face(view: &LightView, space: Domain) -> Option<Face<f64>> {
    match (&view.goal, &view.source) {
        (LightGoal::Image { distance, .. } | LightGoal::Ring { distance, .. }, source) => {
            Some(space.plane_behind(source.axis()?, *distance))
        }
        _ => None,
    }
}

/// The image screen of a view.
pub(in crate::grin_design) fn image_screen(
    view: &LightView,
    space: Domain,
) -> Result<Option<Screen>, GrinTaskError> {
    let Some(direction) = view.source.axis() else { return Ok(None) };
    let (half, drawing, pixels) = match &view.goal {
        LightGoal::Image { drawing, half, pixels, .. } => (*half, drawing, *pixels),
        LightGoal::Far { drawing, angle, pixels } => (radians(*angle).tan(), drawing, *pixels),
        _ => return Ok(None),
    };
    let screen = Screen::new(screen_face(view, space), direction, half, (drawing, pixels));
    let place = || format!("view {}", view.name);
    screen
        .map(Some)
        .map_err(|source| GrinTaskError::Picture { place: place(), source: Box::new(source) })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_screen_is_upright_for_an_eye_that_looks_against_the_light() {
        let [x, y, z] = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
        let [x, y, z] = [x, y, z].map(|[x, y, z]| Vec3::new(x, y, z));
        // The direction of light, right and up.
        for (d, right, up) in [(z, y, -x), (y, -z, -x), (x, z, -y), (-z, -y, -x)] {
            let screen = Screen::new(None, d, 1.0, (&TargetImage::Face, 8)).unwrap();
            assert_eq!(screen.axes, [right, up], "{d:?}");
            // The mouth of the face is below its eyes.
            let light = |row: usize| screen.wanted[8 * row..][..8].iter().sum::<f64>();
            assert!(light(2) > light(3), "rows from the bottom");
        }
    }

    #[test]
    fn a_difference_of_a_tenth_of_the_peak_is_20_decibels() {
        let light = Vec3::new(0.0, 0.0, 1.0);
        let mut screen = Screen::new(None, light, 1.0, (&TargetImage::Face, 8)).unwrap();
        for peak in [0.5, 1.0, 4.0] {
            screen.wanted = (0..64).map(|i| peak * f64::from(i) / 63.0).collect();
            let image: Vec<f64> = screen.wanted.iter().map(|w| w + 0.1 * peak).collect();
            let decibels = screen.psnr(screen.difference(&image));
            assert!((decibels - 20.0).abs() < 1e-12, "{peak}: {decibels}");
        }
    }
}
