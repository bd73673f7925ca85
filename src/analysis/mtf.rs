//! The modulation transfer function by rays alone: the contrast of a grating, `|mean exp(−2πi ν·x)|`
//! over the arriving beam (Hopkins and Yzuel, Optica Acta 17, 1970).
//!
//! Values are complex, about the image point of the chief ray at the primary wavelength, so that
//! those of several wavelengths can be added: lateral colour is a phase. All frequencies come from
//! the same rays.

use super::{AnalysisError, Estimate, lit_region};
use crate::lens::FieldPoint;
use crate::math::{SimdWidth, run_vectorized, sin_cos_turns};
use crate::pupil::{Accuracy, ConvergedList, Nodes, RayModel, Region, converge_resolved};
use crate::trace::{ImagePoints, TraceSink as _};
use serde::Serialize;
use std::f64::consts::{FRAC_2_PI, TAU};
use std::fmt::{self, Display};

/// The optical transfer function at one spatial frequency.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct TransferValue {
    /// The real part.
    pub re: f64,
    /// The imaginary part.
    pub im: f64,
    /// The modulus: the contrast; its error is that of the complex number, the share of the reference sphere
    /// included.
    pub modulus: Estimate,
    /// The part of that error by the choice of the reference sphere: the change on doubling its radius. No
    /// computation makes it less. 0 for contrast by rays.
    pub sphere: f64,
}

/// The contrast at one spatial frequency.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct MtfPoint {
    /// The spatial frequency, in cycles/mm.
    pub frequency: f64,
    /// For lines perpendicular to y: from the spread of light along y.
    pub tangential: TransferValue,
    /// For lines perpendicular to x.
    pub sagittal: TransferValue,
}

/// The contrast of a field against spatial frequency.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct MtfCurve {
    /// The points, in the order of the frequencies asked for.
    pub points: Vec<MtfPoint>,
    /// The image point that phases are counted from, x and y in mm.
    pub origin: [f64; 2],
    /// True if errors of the computation are within the tolerance at every frequency: without what the
    /// reference sphere leaves.
    pub reached: bool,
    /// The cause of errors above the tolerance; `None` if it was reached.
    pub limit: Option<ContrastLimit>,
    /// The largest part of an error that the choice of the reference sphere leaves.
    pub sphere: f64,
    /// The number of rays traced.
    pub rays: usize,
    /// The share of the weight of wavelengths without light, which are left out.
    pub dark_share: f64,
}

/// The cause of errors of a contrast above the tolerance, with the largest error that it leaves.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum ContrastLimit {
    /// The rest that polynomials leave of path differences and amplitudes.
    Polynomials(f64),
    /// The number of rays and of quadrature nodes.
    Nodes(f64),
}

impl ContrastLimit {
    /// The largest error that it leaves.
    pub fn error(self) -> f64 {
        let (Self::Polynomials(error) | Self::Nodes(error)) = self;
        error
    }
}

impl Display for ContrastLimit {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let what = match self {
            Self::Polynomials(_) => "what polynomials leave of the wavefront",
            Self::Nodes(_) => "the number of rays",
        };
        write!(f, "limited by {what}: {:.1e}", self.error())
    }
}

impl TransferValue {
    /// A complex value with its error.
    pub(super) fn new(re: f64, im: f64, error: f64, rays: usize) -> Self {
        Self { re, im, modulus: Estimate::new(re.hypot(im), error, rays), sphere: 0.0 }
    }

    /// The same value with what the choice of the reference sphere leaves added to its error.
    pub(super) fn with_sphere(mut self, change: f64) -> Self {
        self.modulus.error += change;
        self.sphere += change;
        self
    }

    /// The error of the computation: without what the choice of the reference sphere leaves.
    pub fn numerical_error(&self) -> f64 {
        (self.modulus.error - self.sphere).max(0.0)
    }
}

impl MtfCurve {
    /// The same curve with what the choice of the reference sphere leaves, tangential and sagittal one after the
    /// other.
    pub(super) fn with_sphere(mut self, changes: &[f64]) -> Self {
        for (point, change) in self.points.iter_mut().zip(changes.chunks_exact(2)) {
            point.tangential = point.tangential.with_sphere(change[0]);
            point.sagittal = point.sagittal.with_sphere(change[1]);
        }
        self.sphere = largest_by_sphere(&self.points);
        self
    }

    /// The largest error of the computation: without what the choice of the reference sphere leaves.
    pub fn numerical_error(&self) -> f64 {
        let values = self.points.iter().flat_map(|point| [point.tangential, point.sagittal]);
        values.map(|value| value.numerical_error()).fold(0.0, f64::max)
    }
}

/// The geometric contrast of a field at one wavelength and some frequencies in cycles/mm;
/// errors are absolute. Frequencies whose phase no affordable nodes resolve leave the others their own error.
///
/// # Errors
/// The field is dark.
pub fn geometric_mtf(
    model: &RayModel,
    field: FieldPoint,
    wavelength: usize,
    frequencies: &[f64],
    accuracy: Accuracy,
) -> Result<MtfCurve, AnalysisError> {
    let mut curve = common_mtf(model, field, wavelength, frequencies, accuracy)?;
    let highest = frequencies.iter().fold(0.0f64, |highest, nu| highest.max(nu.abs()));
    let is_low = |nu: &f64| nu.abs() < 0.5 * highest;
    let low: Vec<f64> = frequencies.iter().copied().filter(is_low).collect();
    if curve.reached || low.is_empty() {
        return Ok(curve);
    }
    let lower = geometric_mtf(model, field, wavelength, &low, accuracy)?;
    let points = curve.points.iter_mut().filter(|point| is_low(&point.frequency));
    points.zip(lower.points).for_each(|(point, own)| *point = own);
    curve.rays += lower.rays;
    Ok(curve)
}

/// The same from nodes that all frequencies share.
fn common_mtf(
    model: &RayModel,
    field: FieldPoint,
    wavelength: usize,
    frequencies: &[f64],
    accuracy: Accuracy,
) -> Result<MtfCurve, AnalysisError> {
    let region = lit_region(model, field, wavelength)?;
    let origin = origin(model, field, &region)?;
    let numbers = |nodes: &Nodes| transfer(&region, nodes, origin, frequencies);
    let half = Accuracy { tolerance: accuracy.tolerance / CHANGES, ..accuracy };
    let ones = |list: &[f64]| vec![1.0; list.len()];
    let phase = PhaseNodes::new(&region, frequencies);
    let found = phase.converge(&region, half, frequencies, numbers);
    let least = phase.most_along().ceil() as usize;
    let found = found.or_else(|| converge_resolved(&region, half, least, numbers, ones));
    let mut found = found.ok_or(AnalysisError::NoLight)?;
    found.errors.iter_mut().for_each(|error| *error *= CHANGES);
    let largest = found.errors.iter().copied().fold(0.0, f64::max);
    let limit = (!found.converged).then_some(ContrastLimit::Nodes(largest));
    Ok(curve(frequencies, origin, &found, limit))
}

/// The error of a contrast in changes by the last raising of the order. Its integrand oscillates, so
/// that changes do not fall evenly: those of one spot in two directions differ by up to 1.5 times
/// the sum of the last changes.
const CHANGES: f64 = 2.0;

/// The Gauss nodes that resolve the phase of a frequency over a pupil.
#[derive(Debug, Clone)]
struct PhaseNodes {
    /// The azimuths of some radii and the nodes along each, and the largest distance between two of them.
    along: Vec<(f64, f64)>,
    apart: f64,
    /// The azimuths for each radian of an arc.
    around: f64,
}

/// The nodes of each order: the share of those that resolve the phase of the highest frequency everywhere, and more
/// of them along a radius and along an arc. The first order is for coarse tolerances: few parts of a pupil have the
/// steepest phase, and a change of the order tells when it has too few nodes.
const ORDERS: [[f64; 3]; 10] = [
    [0.88, 3.0, 5.0],
    [1.0, 5.0, 8.0],
    [1.15, 7.0, 10.0],
    [1.3, 10.0, 14.0],
    [1.45, 14.0, 20.0],
    [1.6, 20.0, 28.0],
    [1.75, 28.0, 40.0],
    [1.9, 40.0, 56.0],
    [2.05, 56.0, 80.0],
    [2.2, 80.0, 112.0],
];
/// The tolerance of a change from which on the first order is for.
const COARSE: f64 = 1e-4;
/// Radii are near to each other if they are not farther apart than those looked at, but for rounding.
const NEAR: f64 = 1.0 + 1e-9;
/// The numbers of so many frequencies do not all agree by chance; of fewer, a part of the error before a change of
/// the order is left at least.
const MANY: usize = 6;
const LEAST_FALL: f64 = 1.0 / 6.0;
/// So often the changes of few frequencies count: two directions of one spot differ by up to 1.7 times the sum of
/// their changes.
const FEW_CHANGES: f64 = 2.0;

/// For the numbers of each frequency, their largest change among all frequencies up to it: single numbers agree
/// by chance.
fn changes_up_to(frequencies: &[f64], values: &[f64], before: &[f64]) -> Vec<f64> {
    let change = |k: usize| (values[k] - before[k]).abs();
    let mut order: Vec<usize> = (0..frequencies.len()).collect();
    order.sort_by(|i, j| frequencies[*i].abs().total_cmp(&frequencies[*j].abs()));
    let mut errors = vec![0.0; values.len()];
    let mut largest = 0.0;
    for i in order {
        let numbers = 4 * i..4 * (i + 1);
        largest = numbers.clone().map(change).fold(largest, f64::max);
        errors[numbers].fill(largest);
    }
    errors
}

impl PhaseNodes {
    /// Those of the highest frequency. Gauss rules need π times the change of the phase in turns by the angle of
    /// Chebyshev points, looked at on some radii.
    fn new(region: &Region<'_>, frequencies: &[f64]) -> Self {
        let radii = region.radii();
        let points: Vec<[f64; 2]> = radii.iter().flat_map(|(_, points)| points).copied().collect();
        let (launched, landed) = region.launch.trace_points(&points);
        let mut places = vec![None; points.len()];
        for (ray, point) in launched.into_iter().enumerate() {
            let arrives = landed.fate(ray).is_imaged();
            places[point] = arrives.then(|| [landed.x[ray], landed.y[ray]]);
        }
        let count = radii.first().map_or(1, |(_, points)| points.len());
        let change = |a: &[Option<[f64; 2]>], b: &[Option<[f64; 2]>]| {
            let near = a.iter().zip(b).filter_map(|(a, b)| (*a).zip(*b));
            near.map(|([a, b], [c, d])| (a - c).abs().max((b - d).abs())).fold(0.0, f64::max)
        };
        let highest = frequencies.iter().fold(0.0f64, |highest, nu| highest.max(nu.abs()));
        // Eight steps of angle along a radius, and of azimuth over half a turn.
        let along = places.chunks(count).map(|line| 8.0 * highest * change(line, &line[1..]));
        let around = 4.0 * highest * change(&places, &places[count.min(places.len())..]);
        let azimuths = radii.iter().map(|(azimuth, _)| *azimuth);
        let apart = radii.windows(2).map(|pair| pair[1].0 - pair[0].0).fold(0.0, f64::max);
        Self { along: azimuths.zip(along).collect(), apart, around }
    }

    /// The nodes along a radius at an azimuth: those of the radii looked at on both sides, or of all.
    fn along(&self, azimuth: f64) -> f64 {
        let is_near = |other: f64| {
            let off = (other - azimuth).abs();
            off.min(TAU - off) <= NEAR * self.apart
        };
        let near = self.along.iter().filter(|(other, _)| is_near(*other)).map(|(_, nodes)| *nodes);
        near.reduce(f64::max).unwrap_or_else(|| self.most_along())
    }

    /// The nodes along any radius.
    fn most_along(&self) -> f64 {
        self.along.iter().map(|(_, nodes)| *nodes).fold(0.0, f64::max)
    }

    /// The nodes of an order; `None` if rules have not so many.
    fn nodes(&self, region: &Region<'_>, order: usize) -> Option<Nodes> {
        let [growth, radii, azimuths] = ORDERS[order];
        let azimuths = |arc: f64| (growth * self.around * arc + azimuths).ceil() as usize;
        let radii = |azimuth: f64| (growth * self.along(azimuth) + radii).ceil() as usize;
        region.nodes_along(azimuths, radii)
    }

    /// Raises the order until some numbers change by less than the tolerance; `None` if no order has so many
    /// nodes.
    fn converge(
        &self,
        region: &Region<'_>,
        accuracy: Accuracy,
        frequencies: &[f64],
        numbers: impl Fn(&Nodes) -> Option<Vec<f64>>,
    ) -> Option<ConvergedList> {
        let mut rays = region.rays;
        let mut before: Option<ConvergedList> = None;
        let many = frequencies.len() >= MANY;
        let start = usize::from(!many || accuracy.tolerance < COARSE);
        for order in start..ORDERS.len() {
            let Some(nodes) = self.nodes(region, order) else { break };
            let cost = nodes.points.len() + nodes.rays;
            if order > start + 1 && rays + cost > accuracy.max_rays {
                break;
            }
            rays += cost;
            let values = numbers(&nodes)?;
            let (times, fall) = if many { (1.0, 0.0) } else { (FEW_CHANGES, LEAST_FALL) };
            let errors = match &before {
                None => vec![f64::INFINITY; values.len()],
                Some(before) => {
                    // A first change has no error before it.
                    let least =
                        |earlier: f64| if earlier < f64::INFINITY { fall * earlier } else { 0.0 };
                    let error =
                        |(change, earlier): (f64, &f64)| (times * change).max(least(*earlier));
                    let changes = changes_up_to(frequencies, &values, &before.values);
                    changes.into_iter().zip(&before.errors).map(error).collect()
                }
            };
            let is_told = order > start + 1 || many;
            let converged = is_told && errors.iter().all(|error| *error <= accuracy.tolerance);
            before = Some(ConvergedList { values, errors, rays, orders: order - start, converged });
            if converged {
                break;
            }
        }
        before.filter(|found| found.errors.iter().all(|error| error.is_finite()))
    }
}

/// The curve of converged numbers: four a frequency, the real and imaginary parts of the tangential
/// and the sagittal value.
pub(super) fn curve(
    frequencies: &[f64],
    origin: [f64; 2],
    found: &ConvergedList,
    limit: Option<ContrastLimit>,
) -> MtfCurve {
    let value = |k: usize| {
        let (v, e) = (&found.values[k..k + 2], &found.errors[k..k + 2]);
        TransferValue::new(v[0], v[1], e[0].hypot(e[1]), found.rays)
    };
    let point = |(i, frequency): (usize, &f64)| MtfPoint {
        frequency: *frequency,
        tangential: value(4 * i),
        sagittal: value(4 * i + 2),
    };
    MtfCurve {
        points: frequencies.iter().enumerate().map(point).collect(),
        origin,
        reached: limit.is_none(),
        limit,
        sphere: 0.0,
        rays: found.rays,
        dark_share: 0.0,
    }
}

/// The largest part of an error that the choice of the reference sphere leaves.
pub(super) fn largest_by_sphere(points: &[MtfPoint]) -> f64 {
    let parts = points.iter().flat_map(|point| [point.tangential.sphere, point.sagittal.sphere]);
    parts.fold(0.0, f64::max)
}

/// The image point that phases are counted from: that of the chief ray at the primary wavelength, or
/// of the first ray of the pupil if the chief ray is lost.
pub(super) fn origin(
    model: &RayModel,
    field: FieldPoint,
    region: &Region<'_>,
) -> Result<[f64; 2], AnalysisError> {
    model.chief_point(field, model.primary).or_else(|_| {
        let landed = region.trace::<ImagePoints<f64>>(&region.nodes(0));
        let first = landed.arrivals().next().ok_or(AnalysisError::NoLight)?.0;
        let x = if landed.mirrored { 0.0 } else { landed.sink.x[first] };
        Ok([x, landed.sink.y[first]])
    })
}

/// The mean of `exp(−2πiν x)` over the light of some nodes, with distances from an origin: for each
/// frequency in cycles/mm the real and imaginary part of the tangential value, then of the sagittal
/// one. `None` if no ray arrives.
pub fn transfer(
    region: &Region<'_>,
    nodes: &Nodes,
    origin: [f64; 2],
    frequencies: &[f64],
) -> Option<Vec<f64>> {
    let mut sums = [0, 1].map(|_| vec![[[0.0; LANES]; 2]; frequencies.len()]);
    let mut area = [[[0.0; LANES]; 2]];
    for from in (0..nodes.points.len()).step_by(TRACED) {
        let part = from..(from + TRACED).min(nodes.points.len());
        let (points, weights) = (nodes.points[part.clone()].to_vec(), nodes.weights[part].to_vec());
        let landed = region.trace::<ImagePoints<f64>>(&Nodes { points, weights, ..*nodes });
        let lost = |i: &usize| !landed.sink.fate(*i).is_imaged();
        let mut weights = landed.weights.clone();
        (0..weights.len()).filter(lost).for_each(|i| weights[i] = 0.0);
        for (axis, places) in [&landed.sink.x, &landed.sink.y].into_iter().enumerate() {
            add_waves([places, &weights], origin[axis], frequencies, &mut sums[axis]);
        }
        // Summed like the others, so that the contrast of frequency 0 is exactly 1.
        add_waves([&landed.sink.x, &weights], 0.0, &[0.0], &mut area);
    }
    let total = |parts: &LaneSum| parts.map(|lanes| lanes.iter().sum::<f64>());
    let [area, _] = total(&area[0]);
    // The mirror image of a half pupil cancels the sine.
    let across = if nodes.mirrored { 0.0 } else { 1.0 };
    let both = sums[1].iter().map(total).zip(sums[0].iter().map(total));
    let values = both.flat_map(|([tr, ti], [sr, si])| [tr, ti, sr, across * si]);
    let values: Vec<f64> = values.map(|sum| sum / area).collect();
    (area > 0.0).then_some(values)
}

/// The largest relative departure of frequencies from equal steps, and the fewest that are worth it.
const EQUAL: f64 = 1e-12;
const FEW: usize = 6;
/// The number of rays whose phases are computed together, and of equal steps that they are turned by before
/// they are computed anew, so that rounding does not grow.
const TOGETHER: usize = 32;
/// The number of nodes that are traced together, which stay in the cache.
const TRACED: usize = 2048;
/// The partial sums of a frequency, which vector instructions add to.
const LANES: usize = 8;
const TURNED: usize = 64;

/// The step of equally spaced frequencies; `None` for others, and for few.
fn equal_steps(frequencies: &[f64]) -> Option<f64> {
    let [first, .., last] = frequencies else { return None };
    let step = (last - first) / (frequencies.len() - 1) as f64;
    let is_even = |(i, nu): (usize, &f64)| {
        (nu - first - i as f64 * step).abs() <= EQUAL * (first.abs() + last.abs())
    };
    (frequencies.len() >= FEW && frequencies.iter().enumerate().all(is_even)).then_some(step)
}

/// Partial sums of the real and the imaginary part at a frequency.
type LaneSum = [[f64; LANES]; 2];

/// Adds `w exp(−2πiν (x − x₀))` of rays, given by columns of x and w, at each frequency.
fn add_waves(
    [places, weights]: [&[f64]; 2],
    origin: f64,
    frequencies: &[f64],
    sums: &mut [LaneSum],
) {
    let step = equal_steps(frequencies);
    let run = if step.is_some() { TURNED } else { 1 };
    run_vectorized(
        SimdWidth::detect(),
        #[inline(always)]
        || {
            for (places, weights) in places.chunks(TOGETHER).zip(weights.chunks(TOGETHER)) {
                // Places without a ray have no weight.
                let (mut x, mut w) = ([0.0; TOGETHER], [0.0; TOGETHER]);
                x[..places.len()].iter_mut().zip(places).for_each(|(x, place)| *x = place - origin);
                w[..weights.len()].copy_from_slice(weights);
                let turn = waves(&x, &[1.0; TOGETHER], step.unwrap_or(0.0));
                for (frequencies, sums) in frequencies.chunks(run).zip(sums.chunks_mut(run)) {
                    add_turned(waves(&x, &w, frequencies[0]), &turn, sums);
                }
            }
        },
    );
}

/// Real and imaginary parts of some rays.
type Waves = [[f64; TOGETHER]; 2];

/// `w exp(−2πiν x)` of some rays.
#[inline(always)]
fn waves(x: &[f64; TOGETHER], w: &[f64; TOGETHER], frequency: f64) -> Waves {
    let mut waves = [[0.0; TOGETHER]; 2];
    for k in 0..TOGETHER {
        let (sin, cos) = sin_cos_turns(frequency * x[k]);
        (waves[0][k], waves[1][k]) = (w[k] * cos, -w[k] * sin);
    }
    waves
}

/// Adds the waves of some rays to the first of some sums, to each next one turned once more.
#[inline(always)]
fn add_turned([mut re, mut im]: Waves, [cos, sin]: &Waves, sums: &mut [LaneSum]) {
    for [re_sum, im_sum] in sums {
        for from in (0..TOGETHER).step_by(LANES) {
            for k in 0..LANES {
                re_sum[k] += re[from + k];
                im_sum[k] += im[from + k];
            }
        }
        for k in 0..TOGETHER {
            let turned = re[k] * cos[k] - im[k] * sin[k];
            im[k] = re[k] * sin[k] + im[k] * cos[k];
            re[k] = turned;
        }
    }
}

/// The contrast of a perfect lens with a round pupil at a fraction of the frequency where it ends.
pub fn perfect_contrast(fraction: f64) -> f64 {
    let f = fraction.abs();
    if f >= 1.0 { 0.0 } else { (f.acos() - f * (1.0 - f * f).sqrt()) * FRAC_2_PI }
}

/// The geometric contrast of a field over all wavelengths: the sum of the complex values by weight.
///
/// # Errors
/// Every wavelength is dark.
pub fn polychromatic_geometric_mtf(
    model: &RayModel,
    field: FieldPoint,
    frequencies: &[f64],
    accuracy: Accuracy,
) -> Result<MtfCurve, AnalysisError> {
    sum_wavelengths(model, |wavelength| {
        geometric_mtf(model, field, wavelength, frequencies, accuracy)
    })
}

/// The sum of the curves of all wavelengths by weight; dark ones are left out and their share is
/// kept.
pub(super) fn sum_wavelengths(
    model: &RayModel,
    curve: impl Fn(usize) -> Result<MtfCurve, AnalysisError>,
) -> Result<MtfCurve, AnalysisError> {
    let curves: Vec<_> = (0..model.channels.len()).map(curve).collect();
    let weighted = || model.channels.iter().map(|channel| channel.weight).zip(&curves);
    let lit: Vec<(f64, &MtfCurve)> =
        weighted().filter_map(|(w, curve)| Some((w, curve.as_ref().ok()?))).collect();
    let total: f64 = weighted().map(|(weight, _)| weight).sum();
    let light: f64 = lit.iter().map(|(weight, _)| weight).sum();
    let first = lit.iter().find(|(weight, _)| *weight > 0.0);
    let Some((_, first)) = first else {
        let reason = curves.iter().find_map(|curve| curve.as_ref().err().copied());
        return Err(reason.unwrap_or(AnalysisError::NoLight));
    };
    let rays = lit.iter().map(|(_, curve)| curve.rays).sum();
    let limits = lit.iter().filter_map(|(_, curve)| curve.limit);
    let sum = |of: &dyn Fn(&MtfCurve) -> TransferValue| {
        let mean = |part: &dyn Fn(&TransferValue) -> f64| -> f64 {
            lit.iter().map(|(weight, curve)| weight / light * part(&of(curve))).sum()
        };
        let error = mean(&|v| v.numerical_error());
        TransferValue::new(mean(&|v| v.re), mean(&|v| v.im), error, rays)
            .with_sphere(mean(&|v| v.sphere))
    };
    let point = |i: usize| MtfPoint {
        frequency: first.points[i].frequency,
        tangential: sum(&|curve| curve.points[i].tangential),
        sagittal: sum(&|curve| curve.points[i].sagittal),
    };
    let points: Vec<MtfPoint> = (0..first.points.len()).map(point).collect();
    Ok(MtfCurve {
        sphere: largest_by_sphere(&points),
        points,
        origin: first.origin,
        reached: lit.iter().all(|(_, curve)| curve.reached),
        limit: limits.max_by(|a, b| a.error().total_cmp(&b.error())),
        rays,
        dark_share: (total - light) / total,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn phases_turned_in_steps_are_those_of_each_frequency() {
        let ray = |i: usize| 0.05 * (1.7 * i as f64).sin();
        let places: Vec<f64> = (0..77).map(ray).collect();
        let weights: Vec<f64> = (0..77).map(|i| 1.0 + f64::from(i % 5)).collect();
        let even: Vec<f64> = (0..200).map(|i| 0.5 * f64::from(i)).collect();
        assert_eq!(equal_steps(&even), Some(0.5));
        let found = |frequencies: &[f64]| {
            let mut sums = vec![[[0.0; LANES]; 2]; frequencies.len()];
            add_waves([&places, &weights], 0.01, frequencies, &mut sums);
            let total = |parts: &LaneSum| parts.map(|lanes| lanes.iter().sum::<f64>());
            sums.iter().map(total).collect::<Vec<_>>()
        };
        let turned = found(&even);
        for (nu, sum) in even.iter().zip(&turned) {
            let angles = places.iter().map(|x| TAU * nu * (x - 0.01));
            let parts = angles.zip(&weights).map(|(angle, w)| [w * angle.cos(), -w * angle.sin()]);
            let exact = parts.fold([0.0; 2], |sum, part| [sum[0] + part[0], sum[1] + part[1]]);
            assert!((0..2).all(|k| (sum[k] - exact[k]).abs() < 1e-11), "{nu}: {sum:?} {exact:?}");
            let alone = found(&[*nu])[0];
            assert!((0..2).all(|k| (alone[k] - exact[k]).abs() < 1e-12), "{nu}: {alone:?}");
        }
        assert_eq!(turned[0], [weights.iter().sum(), 0.0]);
        for uneven in [&[1.0, 2.0, 3.0, 4.0, 5.0, 7.0][..], &[10.0, 20.0], &[3.0]] {
            assert_eq!(equal_steps(uneven), None);
        }
    }
}
