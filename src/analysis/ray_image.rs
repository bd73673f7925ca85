//! The image of a point by rays alone: the density of its light, and the share of it within circles.
//!
//! Both are sums over the rays of a quadrature of the pupil, by weight. What they count, the light on one
//! side of an edge in the image, is no smooth function of the pupil, so that the sums do not converge as fast as
//! the quadrature does; the order is raised until the changes of all shares are within the tolerance, or those of
//! the density if no shares are asked for.

use super::{AnalysisError, Estimate, SquareGrid, lit_region};
use crate::lens::FieldPoint;
use crate::pupil::{Accuracy, RayModel, Region};
use crate::trace::ImagePoints;

/// The image of a point by rays, over all wavelengths.
#[derive(Debug, Clone, PartialEq)]
pub struct RayImage {
    /// The point that places are counted from: the image point of the chief ray of the primary wavelength, or
    /// the centroid where that is lost; x and y in mm.
    pub center: [f64; 2],
    /// The share of the light in the cell about each node of a grid over the area of a cell, in 1/mm².
    pub density: SquareGrid<f64>,
    /// The error of the largest density, as a share of it.
    pub error: f64,
    /// The share of the light within circles about the centre; errors are absolute.
    pub energy: Vec<Estimate>,
    /// The radii in mm of the circles about the centre that hold the shares of the light asked for.
    pub share_radii: Vec<Estimate>,
    /// True if the shares are within the tolerance; the density, if no circles are asked for.
    pub reached: bool,
    /// The number of rays.
    pub rays: usize,
}

/// The request for an image by rays: the columns and the half width in mm of its grid, the radii of the
/// circles in mm, and the shares of the light whose circles are looked for.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct RayImageRequest<'a> {
    /// The number of columns and of rows, at least 2.
    pub count: usize,
    /// The place of the last column and of the last row, in mm.
    pub half_width: f64,
    /// The radii of the circles, in mm.
    pub radii: &'a [f64],
    /// The shares of the light whose circles are looked for, between 0 and 1.
    pub shares: &'a [f64],
}

/// The lowest order that is compared.
const FIRST_ORDER: usize = 4;
/// The error of a sum that is no smooth function of the pupil, in its last changes.
const CHANGES: f64 = 2.0;

/// The image of a field by rays over all wavelengths, each by its weight and its light.
///
/// # Errors
/// No wavelength has light, or [`AnalysisError::Interrupted`], which is asked for before every order.
pub fn ray_image(
    model: &RayModel,
    field: FieldPoint,
    request: RayImageRequest<'_>,
    accuracy: Accuracy,
    interrupted: &(dyn Fn() -> bool + Sync),
) -> Result<RayImage, AnalysisError> {
    let regions: Vec<_> = (0..model.channels.len()).map(|w| lit_region(model, field, w)).collect();
    let lit: Vec<(f64, &Region<'_>)> = model
        .channels
        .iter()
        .zip(&regions)
        .filter_map(|(channel, region)| Some((channel.weight, region.as_ref().ok()?)))
        .filter(|(weight, _)| *weight > 0.0)
        .collect();
    if lit.is_empty() {
        let why = regions.iter().find_map(|region| region.as_ref().err().copied());
        return Err(why.unwrap_or(AnalysisError::NoLight));
    }
    let orders = lit.iter().map(|(_, region)| region.orders()).min().unwrap_or(0);
    let mut center = model.chief_point(field, model.primary).ok();
    let mut before: Option<LightSums> = None;
    let mut rays = 0;
    for order in FIRST_ORDER.min(orders.saturating_sub(1))..orders {
        if interrupted() {
            return Err(AnalysisError::Interrupted);
        }
        let light = arrived_light(&lit, order);
        rays += light.rays;
        let center = *center.get_or_insert_with(|| light.centroid());
        let sums = LightSums::new(&light, center, request).ok_or(AnalysisError::NoLight)?;
        let errors = before.as_ref().map(|before| sums.errors(before));
        let is_within = errors.as_ref().is_some_and(|found| found.deciding() <= accuracy.tolerance);
        let is_last = order + 1 == orders || rays >= accuracy.max_rays * lit.len();
        if let Some(errors) = errors.filter(|_| is_within || is_last) {
            return Ok(sums.image((center, request), errors, (is_within, rays)));
        }
        before = Some(sums);
    }
    Err(AnalysisError::NoLight)
}

/// Rays where they arrive: x and y in mm, and their light.
struct ArrivedLight {
    points: Vec<[f64; 3]>,
    rays: usize,
}

impl ArrivedLight {
    fn centroid(&self) -> [f64; 2] {
        let light: f64 = self.points.iter().map(|point| point[2]).sum();
        [0, 1].map(|k| {
            self.points.iter().map(|p| p[2] * p[k]).sum::<f64>() / light.max(f64::MIN_POSITIVE)
        })
    }
}

fn arrived_light(lit: &[(f64, &Region<'_>)], order: usize) -> ArrivedLight {
    let mut light = ArrivedLight { points: Vec::new(), rays: 0 };
    for (weight, region) in lit {
        let nodes = region.nodes(order);
        light.rays += nodes.points.len() + nodes.rays;
        let landed = region.trace::<ImagePoints<f64>>(&nodes);
        let unit = weight * region.launch.area();
        for (i, share) in landed.arrivals() {
            let [x, y] = [landed.sink.x[i], landed.sink.y[i]];
            if landed.mirrored {
                // A node stands for its mirror image as well.
                light.points.push([x, y, 0.5 * unit * share]);
                light.points.push([-x, y, 0.5 * unit * share]);
            } else {
                light.points.push([x, y, unit * share]);
            }
        }
    }
    light
}

/// Light in cells and within circles, as shares.
struct LightSums {
    cells: Vec<f64>,
    circles: Vec<f64>,
    /// The shares whose circles are looked for, with their radii in mm.
    share_radii: Vec<(f64, f64)>,
    distances: RayDistances,
}

/// The distances of rays from a point, ascending, with the share of the light up to each.
struct RayDistances {
    distances: Vec<f64>,
    within: Vec<f64>,
}

impl RayDistances {
    fn new(light: &ArrivedLight, [cx, cy]: [f64; 2]) -> Self {
        let mut rays: Vec<[f64; 2]> =
            light.points.iter().map(|[x, y, share]| [(x - cx).hypot(y - cy), *share]).collect();
        rays.sort_by(|a, b| a[0].total_cmp(&b[0]));
        let total: f64 = rays.iter().map(|ray| ray[1]).sum();
        let mut sum = 0.0;
        let mut up_to = |ray: &[f64; 2]| {
            sum += ray[1] / total;
            sum
        };
        let within = rays.iter().map(&mut up_to).collect();
        Self { distances: rays.iter().map(|ray| ray[0]).collect(), within }
    }

    /// The distance up to which there is a share of the light.
    fn radius(&self, share: f64) -> f64 {
        let at = self.within.partition_point(|within| *within < share);
        let last = self.distances.len().saturating_sub(1);
        self.distances.get(at.min(last)).copied().unwrap_or(0.0)
    }

    /// The share of the light within a distance.
    fn share_within(&self, radius: f64) -> f64 {
        let count = self.distances.partition_point(|distance| *distance <= radius);
        count.checked_sub(1).map_or(0.0, |last| self.within[last])
    }
}

/// The errors of sums.
struct SumErrors {
    circles: Vec<f64>,
    density: f64,
    share_radii: Vec<f64>,
}

impl SumErrors {
    /// The error that the tolerance is for: that of the shares within circles, or of the density without any.
    fn deciding(&self) -> f64 {
        self.circles.iter().copied().reduce(f64::max).unwrap_or(self.density)
    }
}

impl LightSums {
    /// `None` without light.
    fn new(light: &ArrivedLight, [cx, cy]: [f64; 2], request: RayImageRequest<'_>) -> Option<Self> {
        let RayImageRequest { count, half_width, radii, shares } = request;
        let distances = RayDistances::new(light, [cx, cy]);
        let mut sums = Self {
            cells: vec![0.0; count * count],
            circles: vec![0.0; radii.len()],
            share_radii: shares.iter().map(|share| (*share, distances.radius(*share))).collect(),
            distances,
        };
        let step = 2.0 * half_width / (count.max(2) - 1) as f64;
        let mut total = 0.0;
        for [x, y, share] in &light.points {
            total += share;
            let [dx, dy] = [x - cx, y - cy];
            let cell = [dx, dy].map(|off| ((off + half_width) / step).round());
            if cell.iter().all(|place| *place >= 0.0 && *place < count as f64) {
                sums.cells[cell[1] as usize * count + cell[0] as usize] += share;
            }
            for (sum, _) in sums.circles.iter_mut().zip(radii).filter(|(_, r)| dx.hypot(dy) <= **r)
            {
                *sum += share;
            }
        }
        if !(total > 0.0) {
            return None;
        }
        sums.cells.iter_mut().for_each(|share| *share /= total * step * step);
        sums.circles.iter_mut().for_each(|share| *share = (*share / total).min(1.0));
        Some(sums)
    }

    fn peak(&self) -> f64 {
        self.cells.iter().copied().fold(0.0, f64::max)
    }

    /// The largest error of the circles for each of them, that of the largest density as a share of it, and those of
    /// the radii of shares.
    fn errors(&self, before: &Self) -> SumErrors {
        let change = |(a, b): (&f64, &f64)| CHANGES * (a - b).abs();
        // A circle jumps over whole rows of rays: that of one alone may stand still by chance.
        let circles = self.circles.iter().zip(&before.circles).map(change).fold(0.0, f64::max);
        let share_radii = self.radius_errors(before, circles);
        let circles = vec![circles; self.circles.len()];
        let peak = self.peak().max(f64::MIN_POSITIVE);
        let cells = self.cells.iter().zip(&before.cells).map(change);
        let density = cells.fold(0.0, f64::max) / peak;
        SumErrors { circles, density, share_radii }
    }

    /// The errors of the radii of shares: their changes, and those by the largest error of a share, `circles` or that
    /// within one of these radii, since the radius is the distance of one ray, which may stand still by chance.
    fn radius_errors(&self, before: &Self, circles: f64) -> Vec<f64> {
        let both = || self.share_radii.iter().zip(&before.share_radii);
        let by_radius = |((share, _), (_, radius)): (&(f64, f64), &(f64, f64))| {
            CHANGES * (self.distances.share_within(*radius) - share).abs()
        };
        let by_share = both().map(by_radius).fold(circles, f64::max);
        let error = |((share, radius), (_, earlier)): (&(f64, f64), &(f64, f64))| {
            let [low, high] = [-by_share, by_share].map(|by| self.distances.radius(share + by));
            (CHANGES * (radius - earlier).abs()).max(0.5 * (high - low))
        };
        both().map(error).collect()
    }

    fn image(
        self,
        (center, request): ([f64; 2], RayImageRequest<'_>),
        errors: SumErrors,
        (reached, rays): (bool, usize),
    ) -> RayImage {
        let energy = self.circles.iter().zip(errors.circles);
        let share_radii = self.share_radii.iter().zip(errors.share_radii);
        RayImage {
            center,
            energy: energy.map(|(share, error)| Estimate::new(*share, error, rays)).collect(),
            share_radii: share_radii
                .map(|((_, radius), error)| Estimate::new(*radius, error, rays))
                .collect(),
            density: SquareGrid {
                count: request.count,
                half_width: request.half_width,
                values: self.cells,
            },
            error: errors.density,
            reached,
            rays,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::lens::{Aperture, IdealElement, Medium, blank};

    fn never() -> bool {
        false
    }

    /// A point out of the focus of a lens without aberrations is an even disc, whose radius is that of the pupil
    /// by similar triangles: the share within a circle is the square of its radius.
    #[test]
    fn a_defocused_point_is_an_even_disc() {
        let mut lens = blank();
        lens.aperture = Aperture::EntrancePupilDiameter(10.0);
        lens.surfaces.truncate(1);
        let plane = &mut lens.surfaces[0];
        (plane.medium, plane.thickness) = (Medium::Air, 90.0);
        plane.ideal = Some(IdealElement::Lens { focal_length: 100.0 });
        let model = RayModel::from_lens(&lens, 0).unwrap();
        let radius = 5.0 * 10.0 / 100.0;
        let radii = [0.25, 0.5, 0.8, 1.1].map(|part| part * radius);
        let shares = [0.5, 0.8];
        let request =
            RayImageRequest { count: 21, half_width: 0.6, radii: &radii, shares: &shares };
        let accuracy = Accuracy { tolerance: 1e-2, ..Accuracy::default() };
        let found = ray_image(&model, model.fields[0], request, accuracy, &never).unwrap();
        for (radius_part, share) in [0.25, 0.5, 0.8, 1.1].into_iter().zip(&found.energy) {
            let exact = f64::min(radius_part * radius_part, 1.0);
            assert!((share.value - exact).abs() <= share.error.max(1e-12), "{share:?} {exact}");
            assert!(share.error <= 2e-2, "{share:?}");
        }
        for (share, found) in shares.into_iter().zip(&found.share_radii) {
            let exact = radius * share.sqrt();
            assert!((found.value - exact).abs() <= found.error, "{found:?} {exact}");
            assert!(found.error < 0.05 * exact, "{found:?}");
        }
        let even = 1.0 / (std::f64::consts::PI * radius * radius);
        // The cells that the disc covers, and those beside it.
        let node = |i: usize| 0.06 * (i as f64 - 10.0);
        for (i, density) in found.density.values.iter().enumerate() {
            let off = node(i % 21).hypot(node(i / 21));
            let expected = if off < radius - 0.045 { Some(even) } else { None };
            let expected = expected.or((off > radius + 0.045).then_some(0.0));
            let wrong = expected.map_or(0.0, |expected| (density - expected).abs());
            assert!(wrong <= 0.3 * even, "cell {i}: {density} for {expected:?}");
        }
        let whole: f64 = found.density.values.iter().sum::<f64>() * 0.06 * 0.06;
        assert!((whole - 1.0).abs() < 1e-9, "{whole}");
        let stopped = ray_image(&model, model.fields[0], request, accuracy, &|| true);
        assert_eq!(stopped, Err(AnalysisError::Interrupted));
    }
}
