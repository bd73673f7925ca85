//! The light of a scene along many rays at once, in one colour.
//!
//! Planes and paintings are the same for all rays, and what they ask of a ray has no branch: the loop over rays
//! lies inside that over planes and runs through vector registers. The numbers are those of single rays.

use super::exact::luminance;
use super::pattern::{PaintLine, Pattern};
use super::scene::{Radiance, Scene, SceneLayer};
use crate::math::{SimdWidth, run_vectorized};
use crate::trace::Rays;

/// The number of rays that are looked at together.
pub(super) const LINE: usize = 64;

/// The colour of three in which radiance is seen, or the only one: luminance.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct SeenColor {
    pub(super) color: usize,
    pub(super) colors: usize,
}

impl SeenColor {
    /// The radiance that the colour sees.
    #[inline(always)]
    pub(super) fn of(self, radiance: Radiance) -> f64 {
        if self.colors == 3 { radiance[self.color] } else { luminance(radiance) }
    }
}

/// Rays from one on, as many as are looked at together.
#[derive(Clone, Copy)]
struct RayLine<'a> {
    x: &'a [f64],
    y: &'a [f64],
    z: &'a [f64],
    l: &'a [f64],
    m: &'a [f64],
    n: &'a [f64],
    seconds: &'a [f64],
}

impl Scene {
    /// The radiance along rays that lead away from the lens, each at a time in seconds, in a colour.
    pub(super) fn light_along(
        &self,
        rays: &Rays<f64>,
        seconds: &[f64],
        seen: SeenColor,
        light: &mut Vec<f64>,
    ) {
        light.clear();
        light.resize(rays.len(), 0.0);
        for (i, light) in light.chunks_mut(LINE).enumerate() {
            let part = i * LINE..i * LINE + light.len();
            let line = RayLine {
                x: &rays.x[part.clone()],
                y: &rays.y[part.clone()],
                z: &rays.z[part.clone()],
                l: &rays.l[part.clone()],
                m: &rays.m[part.clone()],
                n: &rays.n[part.clone()],
                seconds: &seconds[part],
            };
            run_vectorized(
                SimdWidth::detect(),
                #[inline(always)]
                || self.light_of_line(line, seen, light),
            );
        }
    }

    #[inline(always)]
    fn light_of_line(&self, rays: RayLine<'_>, seen: SeenColor, light: &mut [f64]) {
        let (mut open, mut paint) = ([1.0; LINE], PaintLine::new(light.len()));
        for layer in self.layers() {
            layer.meet_line(rays, &mut paint);
            layer.pattern.paint_line(layer.half_size, seen, &mut paint);
            for (i, light) in light.iter_mut().enumerate() {
                let share = if paint.is_met[i] > 0.0 { open[i] * paint.cover[i] } else { 0.0 };
                *light += share * if share > 0.0 { paint.level[i] } else { 0.0 };
                open[i] -= share;
            }
        }
        let behind = seen.of(self.background());
        light.iter_mut().zip(open).for_each(|(light, open)| *light += open * behind);
    }
}

impl SceneLayer {
    /// The points of the painting that rays meet.
    #[inline(always)]
    fn meet_line(&self, rays: RayLine<'_>, paint: &mut PaintLine) {
        let count = paint.count;
        let RayLine { x, y, z, l, m, n, seconds } = rays;
        let (l, m, n, seconds) = (&l[..count], &m[..count], &n[..count], &seconds[..count]);
        let (x, y, z) = (&x[..count], &y[..count], &z[..count]);
        let (center, velocity, half_size) = (self.center, self.velocity, self.half_size);
        let far = self.distance.is_none();
        let distance = self.distance.unwrap_or(0.0);
        let [across, along] = &mut paint.place;
        for i in 0..count {
            let ahead = (-distance - z[i]) / n[i];
            let right = if far { -l[i] / n[i] } else { x[i] + ahead * l[i] };
            let up = if far { -m[i] / n[i] } else { y[i] + ahead * m[i] };
            let right = right - center[0] - seconds[i] * velocity[0];
            let up = up - center[1] - seconds[i] * velocity[1];
            let is_ahead = (n[i] < 0.0) & (far | (ahead > 0.0));
            let is_inside = (right.abs() <= half_size[0]) & (up.abs() <= half_size[1]);
            (across[i], along[i]) = (right, up);
            paint.is_met[i] = if is_ahead & is_inside { 1.0 } else { 0.0 };
        }
    }
}

impl Pattern {
    /// The paint at the places of a line, in a colour.
    #[inline(always)]
    pub(super) fn paint_line(&self, half_size: [f64; 2], seen: SeenColor, paint: &mut PaintLine) {
        match self {
            Self::Uniform { radiance, cover } => {
                paint.level.fill(seen.of(*radiance));
                paint.cover.fill(*cover);
            }
            Self::Checkerboard(count) => paint.checkerboard(2.0 * half_size[1] / count),
            Self::SlantedEdge => paint.slanted_edge(),
            Self::Star(sectors) if Self::is_whole_star(*sectors) => {
                paint.star(*sectors as u32, half_size[0].min(half_size[1]));
            }
            _ => paint.by_point(self, half_size, seen),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::Vec3;
    use crate::trace::Ray;

    fn patterns() -> Vec<Pattern> {
        vec![
            Pattern::Uniform { radiance: [0.5, 0.25, 1.0], cover: 0.5 },
            Pattern::Ball { radiance: [1.0, 0.7, 0.2], lit_from: [0.4, -0.3] },
            Pattern::Checkerboard(6.0),
            Pattern::SlantedEdge,
            Pattern::Star(36.0),
            Pattern::Star(7.5),
            Pattern::Bars,
        ]
    }

    /// Rays in all directions, some of them backwards, one along the axis and one without a direction.
    fn rays() -> Vec<Ray<f64>> {
        let ray = |i: usize| {
            let (x, y) = ((0.37 * i as f64).sin(), (0.61 * i as f64).cos());
            let n = if i % 9 == 8 { 0.5 } else { -0.7 - 0.2 * (1.3 * i as f64).sin() };
            let direction = Vec3::new(0.4 * y * x, 0.3 * y, n);
            Ray { point: Vec3::new(5.0 * x, 3.0 * y, 0.1 * x), direction }
        };
        let along = Ray { direction: Vec3::new(0.0, 0.0, -1.0), ..ray(0) };
        let none = Ray { direction: Vec3::new(0.0, 0.0, 0.0), ..ray(0) };
        (0..200).map(ray).chain([along, none]).collect()
    }

    #[test]
    fn many_rays_see_what_each_of_them_sees() {
        for pattern in patterns() {
            let layer = |distance, half_size, pattern| SceneLayer {
                distance,
                center: [0.02, -0.01],
                half_size,
                velocity: [3.0, 1.0],
                pattern,
            };
            let veil = Pattern::Uniform { radiance: [0.3, 0.2, 0.1], cover: 0.25 };
            let layers = vec![
                layer(Some(40.0), [4.0, 6.0], veil),
                layer(Some(90.0), [30.0, 20.0], pattern.clone()),
                layer(None, [0.4, 0.3], pattern.clone()),
            ];
            let scene = Scene::new(layers, [0.1, 0.2, 0.3], 1.0).unwrap();
            let rays = rays();
            let seconds: Vec<f64> = (0..rays.len()).map(|i| 1e-3 * (i % 5) as f64).collect();
            let columns: Rays<f64> = rays.iter().copied().collect();
            for (color, colors) in [(0, 3), (2, 3), (0, 1)] {
                let (seen, mut light) = (SeenColor { color, colors }, Vec::new());
                scene.light_along(&columns, &seconds, seen, &mut light);
                for ((ray, seconds), light) in rays.iter().zip(&seconds).zip(&light) {
                    let exact = seen.of(scene.radiance(ray, *seconds));
                    assert!((light - exact).abs() < 1e-14, "{pattern:?} {ray:?}: {light} {exact}");
                }
            }
        }
    }
}
