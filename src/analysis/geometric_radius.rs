//! The largest distance of any ray of a spot from a point: a maximum over the pupil and its edge.
//!
//! In the azimuth and the share of the radius up to the edge, a pupil is a rectangle on which the
//! distance is smooth but for the corners of the edge. A lattice that contains the azimuths of these
//! shows the peaks, and the highest of them are refined.

use super::Estimate;
use crate::pupil::{Region, additive_sequence};
use crate::trace::TraceSink;
use std::f64::consts::{PI, TAU};

/// The azimuths of the lattice in half a turn.
const AZIMUTHS: usize = 24;
/// The shares of the radius of the lattice, closer towards the edge: equal steps of area.
const SHARES: usize = 8;
/// The first step of the refinement: in lattice steps of the azimuth, and in shares of the radius.
const FIRST_STEP: [f64; 2] = [0.5, 0.06];
/// The factor between the steps of the refinement.
const SHRINK: f64 = 0.25;
/// The largest number of moves and of shorter steps of the refinement.
const MAX_STEPS: usize = 40;
/// The part of the fall from a peak to the lowest of its neighbours that it may rise between them: a
/// parabola rises by a quarter, a corner by a half.
const RISE: f64 = 0.5;
/// The part of the allowed error to which a peak is refined.
const REFINED: f64 = 0.25;
/// The largest number of peaks that are refined.
const MAX_PEAKS: usize = 8;
/// The order of the sample of a pupil without a known edge.
const SAMPLE_ORDER: usize = 2;
/// Of a sample, the distances of so many farthest rays show how much farther light may reach: the
/// share of the pupil beyond a distance falls to nothing like a power of what is left, the square at
/// a corner, and the farthest of n random rays then leaves more than the difference to the 20th in
/// four of a thousand cases.
const FARTHEST: usize = 20;
/// The rays of a sample of the place where the farthest rays start, and the largest number of these.
const CLOSER_RAYS: usize = 2048;
/// The size of that place, in the box around those starts.
const MARGIN: f64 = 1.5;
/// Another sample follows if the last one reduced what is left to this part.
const CLOSER: f64 = 0.7;
const MAX_SAMPLES: usize = 12;

/// The largest distance of a ray of some pupils from a point, to a relative tolerance. The error is
/// what the distance may rise between the rays traced last.
pub(super) fn geometric_radius<'a>(
    regions: impl Iterator<Item = &'a Region<'a>>,
    center: [f64; 2],
    tolerance: f64,
) -> Estimate {
    let mut searches: Vec<PeakSearch<'_>> =
        regions.map(|region| PeakSearch { region, center, rays: 0 }).collect();
    let mut peaks: Vec<(usize, Peak)> = Vec::new();
    for (i, search) in searches.iter_mut().enumerate() {
        peaks.extend(search.peaks(REFINED * tolerance).into_iter().map(|peak| (i, peak)));
    }
    peaks.sort_by(|a, b| b.1.bound().total_cmp(&a.1.bound()));
    let (mut radius, mut most) = (0.0f64, 0.0f64);
    for (count, (i, peak)) in peaks.into_iter().enumerate() {
        if peak.bound() <= radius {
            break;
        }
        let peak =
            if count < MAX_PEAKS { searches[i].refine(peak, REFINED * tolerance) } else { peak };
        radius = radius.max(peak.distance);
        most = most.max(peak.bound());
    }
    let rays = searches.iter().map(|search| search.rays).sum();
    Estimate::new(radius, (most - radius).max(0.0), rays)
}

/// A local maximum of the distance.
#[derive(Debug, Clone, Copy)]
struct Peak {
    /// The azimuth and the share of the radius.
    place: [f64; 2],
    /// The distance there.
    distance: f64,
    /// The possible increase nearby.
    rise: f64,
}

impl Peak {
    fn bound(&self) -> f64 {
        self.distance + self.rise
    }
}

/// The farthest rays of a sample of a pupil.
struct FarthestRays {
    /// The farthest one, and by how much others may exceed it.
    peak: Peak,
    /// The places where they start.
    starts: Vec<[f64; 2]>,
}

impl FarthestRays {
    /// Points all over a box somewhat larger than that of their starts.
    fn points_around(&self) -> Vec<[f64; 2]> {
        let ranges = [0, 1].map(|k| {
            let along = || self.starts.iter().map(|start| start[k]);
            let (low, high) =
                (along().fold(f64::INFINITY, f64::min), along().fold(f64::NEG_INFINITY, f64::max));
            (0.5 * (low + high), 0.5 * MARGIN * (high - low))
        });
        let place = |i| {
            let u = additive_sequence([0.5; 2], i);
            [0, 1].map(|k| ranges[k].0 + ranges[k].1 * (2.0 * u[k] - 1.0))
        };
        (0..CLOSER_RAYS).map(place).collect()
    }
}

/// The search for the peaks of one pupil.
struct PeakSearch<'a> {
    region: &'a Region<'a>,
    center: [f64; 2],
    rays: usize,
}

impl PeakSearch<'_> {
    /// The peaks of the lattice; of a pupil whose edge is not known, the farthest of many rays.
    fn peaks(&mut self, tolerance: f64) -> Vec<Peak> {
        let half = self.region.launch.is_symmetric();
        let azimuths = self.region.azimuths(if half { AZIMUTHS } else { 2 * AZIMUTHS });
        let shares: [f64; SHARES] =
            std::array::from_fn(|j| ((j + 1) as f64 / SHARES as f64).sqrt());
        let mut lattice = Vec::with_capacity(azimuths.len());
        for azimuth in &azimuths {
            let Some(radius) = self.region.pupil_radius(*azimuth) else {
                return self.farthest_sample(tolerance).into_iter().collect();
            };
            self.rays += radius.rays;
            lattice.push(self.distances(&shares.map(|share| radius.point(share))));
        }
        let peak = |(i, j, rise): (usize, usize, f64)| Peak {
            place: [azimuths[i], shares[j]],
            distance: lattice[i][j],
            rise,
        };
        local_peaks(&lattice, half).map(peak).collect()
    }

    /// The distances of the rays of some pupil points; −∞ for those that do not arrive.
    fn distances(&mut self, points: &[[f64; 2]]) -> Vec<f64> {
        self.rays += points.len();
        let [x, y] = self.center;
        let (launched, landed) = self.region.launch.trace_points(points);
        let mut distances = vec![f64::NEG_INFINITY; points.len()];
        for (ray, i) in launched.into_iter().enumerate() {
            if landed.fate(ray).is_imaged() {
                distances[i] = (landed.x[ray] - x).hypot(landed.y[ray] - y);
            }
        }
        distances
    }

    /// The farthest ray of a pupil whose edge is not known: of rays all over it, then of rays where the
    /// farthest of them start, as long as these draw together and differ by more than is allowed.
    fn farthest_sample(&mut self, tolerance: f64) -> Option<Peak> {
        let order = SAMPLE_ORDER.min(self.region.orders().checked_sub(1)?);
        let mut rays = self.farthest_of(self.region.nodes(order).points)?;
        let mut highest = rays.peak;
        for _ in 0..MAX_SAMPLES {
            if rays.peak.rise <= tolerance * highest.distance {
                break;
            }
            let Some(closer) = self.farthest_of(rays.points_around()) else { break };
            highest = highest.higher(closer.peak);
            if closer.peak.rise > CLOSER * rays.peak.rise {
                break;
            }
            rays = closer;
        }
        Some(Peak { rise: (rays.peak.bound() - highest.distance).max(0.0), ..highest })
    }

    /// The farthest rays of a sample, and by how much others may exceed them.
    fn farthest_of(&mut self, points: Vec<[f64; 2]>) -> Option<FarthestRays> {
        let distances = self.distances(&points);
        let mut rays: Vec<_> =
            distances.into_iter().zip(points).filter(|ray| ray.0.is_finite()).collect();
        rays.sort_by(|a, b| b.0.total_cmp(&a.0));
        let &(distance, place) = rays.first()?;
        // Fewer rays say nothing about how far others reach.
        let rise = rays.get(FARTHEST - 1).map_or(distance, |last| distance - last.0);
        rays.truncate(FARTHEST);
        let mirrored = self.region.launch.is_symmetric();
        let unfolded = |[x, y]: [f64; 2]| if mirrored { [x.abs(), y] } else { [x, y] };
        let starts = rays.into_iter().map(|ray| unfolded(ray.1)).collect();
        Some(FarthestRays { peak: Peak { place, distance, rise }, starts })
    }

    /// A peak that may rise by no more than a relative tolerance.
    fn refine(&mut self, mut peak: Peak, tolerance: f64) -> Peak {
        let mut step = [FIRST_STEP[0] * PI / AZIMUTHS as f64, FIRST_STEP[1]];
        for _ in 0..MAX_STEPS {
            if peak.rise <= tolerance * peak.distance {
                break;
            }
            let around = self.around(peak.place, step);
            if around.is_empty() {
                // The edge of the pupil is not known: what samples left stays.
                break;
            }
            let best = around.iter().copied().fold(peak, Peak::higher);
            if best.distance > peak.distance {
                peak = Peak { rise: peak.rise, ..best };
                continue;
            }
            peak.rise = rise(peak.distance, around.iter().map(|other| other.distance));
            if let Some(top) = self.at(vertex(&peak, &around, step)) {
                peak = Peak { rise: peak.rise, ..peak.higher(top) };
            }
            step = step.map(|size| SHRINK * size);
        }
        peak
    }

    /// The eight places at a step from one.
    fn around(&mut self, [azimuth, share]: [f64; 2], [turn, along]: [f64; 2]) -> Vec<Peak> {
        let steps = [-1.0, 0.0, 1.0].into_iter().flat_map(|i| [-1.0, 0.0, 1.0].map(|j| [i, j]));
        let others = steps.filter(|step| *step != [0.0; 2]);
        others.filter_map(|[i, j]| self.at([azimuth + i * turn, share + j * along])).collect()
    }

    /// The distance at a place, or at the nearest one of the pupil.
    fn at(&mut self, [azimuth, share]: [f64; 2]) -> Option<Peak> {
        let azimuth = azimuth.rem_euclid(TAU);
        let mirrored = self.region.launch.is_symmetric() && azimuth > PI;
        let azimuth = if mirrored { TAU - azimuth } else { azimuth };
        let place = [azimuth, share.clamp(0.0, 1.0)];
        let radius = self.region.pupil_radius(azimuth)?;
        self.rays += radius.rays;
        let distance = self.distances(&[radius.point(place[1])])[0];
        distance.is_finite().then_some(Peak { place, distance, rise: 0.0 })
    }
}

impl Peak {
    fn higher(self, other: Self) -> Self {
        if other.distance > self.distance { other } else { self }
    }
}

/// The places of a lattice that no neighbour exceeds, each with the amount by which its peak may rise.
fn local_peaks(lattice: &[Vec<f64>], half: bool) -> impl Iterator<Item = (usize, usize, f64)> {
    let places =
        lattice.iter().enumerate().flat_map(|(i, row)| (0..row.len()).map(move |j| (i, j)));
    places.filter_map(move |(i, j)| {
        let (distance, around) = (lattice[i][j], neighbours(lattice, i, j, half));
        let highest = around.iter().copied().fold(0.0, f64::max);
        (distance >= highest).then(|| (i, j, rise(distance, around)))
    })
}

/// By how much a peak may rise between its neighbours.
fn rise(distance: f64, around: impl IntoIterator<Item = f64>) -> f64 {
    let low = around.into_iter().filter(|other| other.is_finite()).fold(distance, f64::min);
    RISE * (distance - low)
}

/// The distances around one of the lattice; half a turn goes on as its mirror image, and a whole one
/// begins again.
fn neighbours(lattice: &[Vec<f64>], i: usize, j: usize, half: bool) -> Vec<f64> {
    let last = lattice.len() - 1;
    // The last azimuth of a whole turn is the first one again; a single one has no neighbours.
    let (second, last_but_one) = (1.min(last), last.saturating_sub(1));
    let (before, after) = if half { (second, last_but_one) } else { (last_but_one, second) };
    let before = if i == 0 { before } else { i - 1 };
    let after = if i == last { after } else { i + 1 };
    let columns = j.saturating_sub(1)..(j + 2).min(lattice[i].len());
    let places = [before, i, after].into_iter().flat_map(|i| columns.clone().map(move |k| (i, k)));
    places.filter(|place| *place != (i, j)).map(|(i, k)| lattice[i][k]).collect()
}

/// The vertex of the parabolas along both coordinates through a peak and its neighbours.
fn vertex(peak: &Peak, around: &[Peak], step: [f64; 2]) -> [f64; 2] {
    // The order of `PeakSearch::around`, if none of the eight is missing.
    let &[_, left, _, low, high, _, right, _] = around else { return peak.place };
    let shift = |before: Peak, after: Peak| {
        let bend = before.distance - 2.0 * peak.distance + after.distance;
        if bend < 0.0 { 0.5 * (before.distance - after.distance) / bend } else { 0.0 }
    };
    let shifts = [shift(left, right), shift(low, high)];
    [0, 1].map(|k| peak.place[k] + shifts[k].clamp(-1.0, 1.0) * step[k])
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_vertex_of_a_paraboloid_is_found_from_its_neighbours() {
        let top = [0.03, -0.004];
        let step = [0.1, 0.01];
        let at = |x: f64, y: f64| {
            let distance = 5.0 - 3.0 * (x - top[0]).powi(2) - 40.0 * (y - top[1]).powi(2);
            Peak { place: [x, y], distance, rise: 0.0 }
        };
        let shares = [-1.0, 0.0, 1.0];
        let steps = shares.into_iter().flat_map(|i| shares.map(|j| [i, j]));
        let around: Vec<Peak> = steps
            .filter(|step| *step != [0.0; 2])
            .map(|[i, j]| at(i * step[0], j * step[1]))
            .collect();
        let found = vertex(&at(0.0, 0.0), &around, step);
        assert!((found[0] - top[0]).hypot(found[1] - top[1]) < 1e-12, "{found:?}");
    }
}
