//! The complex amplitude over a pupil as polynomials between its edges, and its transfer function.

use super::column_sum::ColumnPair;
use super::outline::{ArcSteps, Chain, PupilCurve};
use super::overlap::{OverlapHalf, Strip};
use super::overlap_slopes::{OverlapSlopes, TermSlopes};
use super::polynomial::{FitSample, PolynomialBasis, WavePolynomial};
use super::pupil_samples::PupilSamples;
use super::pupil_traces::{PupilTraces, TracedLight};
use super::ray_pupil::RayPupil;
use crate::analysis::reference_sphere::ReferenceSphere;
use crate::analysis::{AnalysisError, TransferValue};
use crate::pupil::Region;
use std::cell::Cell;
use std::f64::consts::TAU;

/// A pupil as a function of direction cosines: the path difference and the amplitude as polynomials,
/// between the curves around its pieces.
#[derive(Debug, Clone)]
pub struct PupilFunction {
    pieces: Vec<PupilPiece>,
    polynomial: WavePolynomial,
    /// The wavelength in the image space, in mm.
    wavelength: f64,
    /// The integral of the squared amplitude.
    energy: f64,
    /// The RMS error of the polynomials: in waves, and of the relative amplitude.
    fit_error: [f64; 2],
    /// The number of rays traced.
    rays: usize,
    /// The order of quadrature whose rays the polynomials are fitted to.
    order: usize,
}

/// An arc of an edge: its points, true at a corner, and 1 around light or −1 around a shadow.
type SignedArc = (Vec<[f64; 2]>, bool, f64);

/// A piece of a pupil.
#[derive(Debug, Clone)]
struct PupilPiece {
    curve: PupilCurve,
    /// The parts of the curve along which x (0) or y (1) grows or falls.
    chains: [Vec<Chain>; 2],
    /// 1 for light inside the curve, −1 for a shadow.
    sign: f64,
}

/// Half of the shift of a pupil against itself in cosines, and that of the image plane in wavelengths.
#[derive(Debug, Clone, Copy)]
pub(super) struct TransferShift {
    pub(super) cosines: [f64; 2],
    pub(super) defocus: f64,
}

/// An overlap integral over the energy of a pupil.
#[derive(Debug, Clone, Copy)]
struct Overlap {
    /// The complex transfer.
    value: [f64; 2],
    /// Its last change.
    change: f64,
    /// The order of its quadrature.
    order: usize,
}

/// A strip of the common part of two shifted pieces.
struct OverlapPart<'a> {
    strip: Strip<'a>,
    /// The product of the signs, twice that if the strip stands for its mirror image.
    factor: f64,
    /// The nodes that resolve the phase across the strip and along its columns.
    resolved: [f64; 2],
}

/// The share of the columns and of the nodes of a column that resolve the phase, and more columns and nodes, of each
/// order. Columns come in multiples of eight, which fill vector instructions, and more of them each time, so that a
/// change of the order tells both errors. The first two are for coarse tolerances, and the third is left out then.
const ORDERS: [[f64; 3]; 12] = [
    [0.85, 2.0, 4.0],
    [1.0, 9.0, 7.0],
    [1.0, 6.0, 6.0],
    [1.12, 14.0, 10.0],
    [1.24, 22.0, 15.0],
    [1.36, 30.0, 21.0],
    [1.48, 40.0, 29.0],
    [1.6, 52.0, 40.0],
    [1.72, 68.0, 56.0],
    [1.84, 92.0, 80.0],
    [1.96, 124.0, 112.0],
    [2.08, 172.0, 160.0],
];
/// The orders of coarse and of finer tolerances, and the tolerance from which on one is coarse.
const COARSE_ORDERS: [usize; 11] = [0, 1, 3, 4, 5, 6, 7, 8, 9, 10, 11];
const FINE_ORDERS: [usize; 10] = [2, 3, 4, 5, 6, 7, 8, 9, 10, 11];
const COARSE_SUM: f64 = 3e-4;
/// The error of a sum in changes by the last raising of the order: two orders may agree by chance.
const CHANGES: f64 = 2.0;
const TOGETHER: usize = 8;
/// The largest number of nodes of a strip.
const MOST_NODES: usize = 1 << 22;

/// The columns of a strip and the nodes of each, of samples.
const SAMPLE_ORDERS: [[usize; 2]; 10] = [
    [8, 10],
    [10, 14],
    [14, 20],
    [20, 28],
    [28, 40],
    [40, 56],
    [56, 80],
    [80, 112],
    [112, 160],
    [160, 224],
];
/// The points of an arc of the edge, and the tolerance of contrast to which coarse steps along it are exact by far.
const EDGE_POINTS: usize = 40;
const COARSE_EDGE_POINTS: usize = 20;
const COARSE_EDGE: f64 = 1e-5;
/// The degree of the polynomials of a pupil that is given by a formula, and the samples that they are
/// fitted to along a side of its box.
const FORMULA_TERMS: usize = 100;
const FORMULA_SAMPLES: usize = 30;
/// The RMS that polynomials of lower degree may leave of it.
const FORMULA_LEFT: f64 = 1e-15;
/// The share of the tolerance that the polynomials may take.
const FIT_SHARE: f64 = 0.1;

impl PupilFunction {
    /// The function of a pupil of uniform amplitude whose path difference in waves is a polynomial of
    /// low degree in the cosines; the wavelength in micrometres.
    ///
    /// # Errors
    /// A pupil without area.
    pub fn uniform(
        pieces: Vec<PupilCurve>,
        wavelength_um: f64,
        waves: impl Fn([f64; 2]) -> f64,
    ) -> Result<Self, AnalysisError> {
        let light = |curve| PupilPiece::new(curve, 1.0);
        Self::formula(pieces.into_iter().map(light).collect(), wavelength_um, waves)
    }

    /// The same for a pupil with a shadow inside: the curves around the light and around the shadow.
    ///
    /// # Errors
    /// A pupil without area.
    pub fn ring(
        [outer, inner]: &[PupilCurve; 2],
        wavelength_um: f64,
        waves: impl Fn([f64; 2]) -> f64,
    ) -> Result<Self, AnalysisError> {
        let pieces = [(outer, 1.0), (inner, -1.0)];
        let piece = |(curve, sign): (&PupilCurve, f64)| PupilPiece::new(curve.clone(), sign);
        Self::formula(pieces.map(piece).to_vec(), wavelength_um, waves)
    }

    fn formula(
        pieces: Vec<PupilPiece>,
        wavelength_um: f64,
        waves: impl Fn([f64; 2]) -> f64,
    ) -> Result<Self, AnalysisError> {
        let points = || pieces.iter().flat_map(|piece| piece.curve.points());
        let basis = PolynomialBasis::new(points(), FORMULA_TERMS, false);
        let side: Vec<f64> = crate::math::quadrature::chebyshev_points(FORMULA_SAMPLES).collect();
        let cells = side.iter().flat_map(|u| side.iter().map(move |v| [*u, *v]));
        let sample = |cell: [f64; 2]| {
            let cosines = basis.in_box(cell);
            FitSample { cosines, values: [waves(cosines), 1.0], weight: 1.0 }
        };
        let samples: Vec<_> = cells.map(sample).collect();
        let (polynomial, fit_error) =
            basis.fit(&samples, [FORMULA_LEFT; 2]).ok_or(AnalysisError::NoLight)?;
        let mut function = Self {
            pieces,
            polynomial,
            wavelength: wavelength_um * 1e-3,
            energy: 1.0,
            fit_error,
            rays: 0,
            order: 0,
        };
        function.energy = function.overlap_energy();
        Ok(function)
    }

    /// The function of a lit pupil, fitted to rays until the polynomials leave less than a part of
    /// the tolerance, an absolute error of contrast.
    ///
    /// # Errors
    /// The pupil is irregular or folds, so that its cosines are no coordinates.
    pub(in crate::analysis) fn of_region(
        region: &Region<'_>,
        sphere: &ReferenceSphere,
        tolerance: f64,
    ) -> Result<Self, AnalysisError> {
        Self::of_traces(&mut PupilTraces::new(region), sphere, tolerance)
    }

    /// The same from rays that may have been traced for another sphere.
    pub(super) fn of_traces(
        traces: &mut PupilTraces<'_>,
        sphere: &ReferenceSphere,
        tolerance: f64,
    ) -> Result<Self, AnalysisError> {
        let (pieces, edge_rays) = PupilPiece::of_traces(traces, sphere, tolerance)?;
        let orders = traces.region.orders();
        let mut rays = traces.region.rays + edge_rays;
        // What a fit leaves over what is allowed.
        let mut best: Option<(WavePolynomial, [f64; 2], f64, usize)> = None;
        let mut energy = 0.0;
        let allowed = [
            (FIT_SHARE * tolerance / TAU).max(0.1 * sphere.rounding()),
            FIT_SHARE * tolerance.max(1e-14),
        ];
        let mut order = FIRST_FIT;
        // The rays of the order before tell what a fit leaves between its own.
        if orders < FIRST_FIT {
            return Err(AnalysisError::IrregularPupil);
        }
        let before = traces.light(FIRST_FIT - 1);
        rays += before.cost;
        let mut others = FitLight::new(before, sphere)?;
        while order < orders {
            let traced = traces.light(order);
            rays += traced.cost;
            if traced.count > MOST_SAMPLES {
                break;
            }
            let light = FitLight::new(traced, sphere)?;
            energy = light.energy;
            let fit = light.fit(&others, allowed);
            others = light;
            let at_order = order;
            order += 1;
            let Some(fit) = fit else { continue };
            let excess = (fit.1[0] / allowed[0]).max(fit.1[1] / allowed[1]);
            // The next order would not do.
            order += usize::from(excess > FAR && best.is_some());
            if best.as_ref().is_none_or(|(_, _, least, _)| excess < *least) {
                best = Some((fit.0, fit.1, excess, at_order));
            }
            if excess < 1.0 {
                break;
            }
        }
        let (polynomial, fit_error, _, order) = best.ok_or(AnalysisError::IrregularPupil)?;
        Ok(Self {
            pieces,
            polynomial,
            wavelength: sphere.medium_wavelength(),
            energy,
            fit_error,
            rays,
            order,
        })
    }

    /// The function of polynomials with this energy between the arcs of closed curves, given at their Chebyshev
    /// points, with true at a corner, and with 1 around light or −1 around a shadow.
    pub(super) fn of_fit(
        (polynomial, energy): (WavePolynomial, f64),
        wavelength: f64,
        (arcs, steps): (impl Iterator<Item = SignedArc>, ArcSteps),
    ) -> Self {
        let (light, shadow): (Vec<_>, Vec<_>) = arcs.partition(|(.., sign)| *sign > 0.0);
        let piece = |(arcs, sign): (Vec<SignedArc>, f64)| {
            let arcs: Vec<_> = arcs.into_iter().map(|(nodes, corner, _)| (nodes, corner)).collect();
            PupilPiece::new(PupilCurve::in_steps(&arcs, steps), sign)
        };
        let curves =
            [(light, 1.0), (shadow, -1.0)].into_iter().filter(|(arcs, _)| !arcs.is_empty());
        let pieces = curves.map(piece).collect();
        Self { pieces, polynomial, wavelength, energy, fit_error: [0.0; 2], rays: 0, order: 0 }
    }

    /// The points of an arc of the edge, and the steps along it, for a tolerance of contrast.
    pub(super) fn edge_points(tolerance: f64) -> usize {
        if tolerance < COARSE_EDGE { EDGE_POINTS } else { COARSE_EDGE_POINTS }
    }

    /// The steps along an arc of the edge for a tolerance of contrast.
    pub(super) fn edge_steps(tolerance: f64) -> ArcSteps {
        if tolerance < COARSE_EDGE { ArcSteps::Fine } else { ArcSteps::Coarse }
    }

    /// The order of quadrature and the largest degree of the polynomials.
    pub(super) fn order_and_degree(&self) -> (usize, usize) {
        (self.order, self.polynomial.degree())
    }

    pub(super) fn polynomial(&self) -> &WavePolynomial {
        &self.polynomial
    }

    pub(super) fn energy(&self) -> f64 {
        self.energy
    }

    /// True if it is even in the first cosine.
    pub(super) fn is_even(&self) -> bool {
        self.polynomial.is_even()
    }

    /// True if there is light at a point.
    pub(super) fn covers(&self, p: [f64; 2]) -> bool {
        let inside = |piece: &PupilPiece| {
            let below = piece.chains[0].iter().filter(|chain| chain.is_below(p)).count();
            if below % 2 == 1 { piece.sign } else { 0.0 }
        };
        self.pieces.iter().map(inside).sum::<f64>() > 0.5
    }

    /// The transfer at a frequency, and the order of the quadrature of its integral.
    pub(super) fn transfer_and_order(
        &self,
        frequency: [f64; 2],
        tolerance: f64,
    ) -> ([f64; 2], usize) {
        let shift = self.shift(frequency, 0.0);
        let sum = |part: &OverlapPart<'_>, counts| self.column_sum(part, shift, counts);
        let found = self.converge(shift, tolerance, self.energy, &sum);
        found.map_or(([0.0; 2], 0), |found| (found.value, found.order))
    }

    /// Adds the derivatives of the real part of a complex factor times the overlap integral of an order, by what a
    /// displacement of the light does; the nodes along an arc of the edge that resolve the phase there as well.
    pub(super) fn add_overlap_slopes(
        &self,
        (shift, order): (TransferShift, usize),
        factor: [f64; 2],
        by: &mut TermSlopes,
    ) -> usize {
        let mut slopes = OverlapSlopes::new(&self.polynomial, shift, factor);
        let mut along_edge = 0;
        for part in self.parts(shift) {
            let counts = part.counts(order);
            slopes.add(&part.strip, part.factor, counts, by);
            along_edge = along_edge.max(counts[0] + counts[1]);
        }
        along_edge
    }

    /// The integral of the squared amplitude between the curves.
    fn overlap_energy(&self) -> f64 {
        let shift = TransferShift { cosines: [0.0; 2], defocus: 0.0 };
        let whole =
            self.converge(shift, 1e-13, 1.0, &|part, counts| self.column_sum(part, shift, counts));
        whole.map_or(0.0, |whole| whole.value[0])
    }

    /// The light at the nodes of a quadrature between the curves, of an order from 0 to 9.
    pub fn samples(&self, order: usize) -> PupilSamples {
        let mut samples = PupilSamples { wavelength: self.wavelength, ..PupilSamples::default() };
        let order = order.min(SAMPLE_ORDERS.len() - 1);
        for PupilPiece { chains, sign, .. } in &self.pieces {
            let strips = Strip::of_overlap(0, [&chains[0]; 2], [0.0; 2], OverlapHalf::None);
            for node in strips.iter().flat_map(|strip| strip.nodes(SAMPLE_ORDERS[order])) {
                let [waves, amplitude] = self.polynomial.at(node.at);
                samples.cosines.push(node.at);
                samples.waves.push(waves);
                samples.amplitudes.push(sign * node.weight * amplitude);
                samples.energies.push(sign * node.weight * amplitude * amplitude);
            }
        }
        samples
    }

    /// The optical transfer function at a spatial frequency, x and y in cycles/mm, to an
    /// absolute tolerance, with its origin at the centre of the reference sphere. The image plane may
    /// be moved by `defocus` mm along the light.
    pub fn transfer(&self, frequency: [f64; 2], defocus: f64, tolerance: f64) -> TransferValue {
        if frequency == [0.0; 2] {
            return TransferValue::new(1.0, 0.0, 0.0, self.rays);
        }
        let shift = self.shift(frequency, defocus);
        let sum = |part: &OverlapPart<'_>, counts| self.column_sum(part, shift, counts);
        let left = self.transfer_error();
        // The sum takes what the polynomials leave of the tolerance, or of half of it.
        let tolerance = (tolerance - left).max(0.5 * tolerance);
        // Shifted pupils that are apart have nothing in common, whatever is left out of them.
        let Some(found) = self.converge(shift, tolerance, self.energy, &sum) else {
            return TransferValue::new(0.0, 0.0, 0.0, self.rays);
        };
        let [re, im] = found.value;
        TransferValue::new(re, im, found.change + left, self.rays)
    }

    pub(super) fn shift(&self, frequency: [f64; 2], defocus: f64) -> TransferShift {
        let cosines = frequency.map(|nu| 0.5 * self.wavelength * nu);
        TransferShift { cosines, defocus: defocus / self.wavelength }
    }

    /// The error of contrast by what the polynomials leave of the phases and amplitudes: at most their RMS for
    /// each of the two pupils (Cauchy and Schwarz), which often have the same sign.
    pub(super) fn transfer_error(&self) -> f64 {
        let [waves, amplitude] = self.fit_error;
        2.0 * (TAU * waves + amplitude)
    }

    /// [`PupilFunction::transfer`] by a ray for each node in place of the polynomials; `None` if some node
    /// has no ray.
    pub(super) fn transfer_by_rays(
        &self,
        frequency: [f64; 2],
        pupil: &RayPupil<'_>,
        tolerance: f64,
    ) -> Option<TransferValue> {
        let (traced, lost) = (Cell::new(0), Cell::new(false));
        let shift = self.shift(frequency, 0.0);
        let light = |cosines: [f64; 2]| {
            traced.set(traced.get() + 1);
            pupil.light(cosines).unwrap_or_else(|| {
                lost.set(true);
                [0.0; 2]
            })
        };
        let sum = |part: &OverlapPart<'_>, counts: [usize; 2]| {
            let nodes = part.strip.nodes(counts).into_iter();
            nodes.fold([0.0; 2], |[re, im], node| {
                let [p, m] = [1.0, -1.0]
                    .map(|sign| light([0, 1].map(|k| node.at[k] + sign * shift.cosines[k])));
                let (sin, cos) = (TAU * (p[0] - m[0])).sin_cos();
                let amplitude = node.weight * p[1] * m[1];
                [re + amplitude * cos, im - amplitude * sin]
            })
        };
        let Some(found) = self.converge(shift, tolerance, self.energy, &sum) else {
            return Some(TransferValue::new(0.0, 0.0, 0.0, self.rays));
        };
        let ([re, im], rays) = (found.value, self.rays + traced.get());
        (!lost.get()).then(|| TransferValue::new(re, im, found.change, rays))
    }

    /// The strips of the common parts of all pairs of pieces.
    fn parts(&self, shift: TransferShift) -> Vec<OverlapPart<'_>> {
        // Along columns across the shift both polynomials have the same argument.
        let [x, y] = shift.cosines;
        let axis = usize::from(x.abs() <= y.abs());
        let half = match (self.polynomial.is_even(), x == 0.0, y == 0.0) {
            (true, true, _) => OverlapHalf::Along,
            (true, _, true) => OverlapHalf::Across,
            _ => OverlapHalf::None,
        };
        let copies = if half == OverlapHalf::None { 1.0 } else { 2.0 };
        let mut parts = Vec::new();
        for first in &self.pieces {
            for second in &self.pieces {
                // The point plus the shift lies in the first, the point minus it in the second.
                let chains = [&first.chains[axis][..], &second.chains[axis]];
                let back = shift.cosines.map(|v| -v);
                let factor = copies * first.sign * second.sign;
                for strip in Strip::of_overlap(axis, chains, back, half) {
                    let resolved = ColumnPair::resolving_nodes(&self.polynomial, &strip, shift);
                    parts.push(OverlapPart { strip, factor, resolved });
                }
            }
        }
        parts
    }

    /// The sum over the strips of overlap integrals divided by an energy; `None` if there is no overlap. A sum with too
    /// few nodes for its phase is none, and its error is that of any contrast.
    fn converge(
        &self,
        shift: TransferShift,
        tolerance: f64,
        energy: f64,
        sum: &impl Fn(&OverlapPart<'_>, [usize; 2]) -> [f64; 2],
    ) -> Option<Overlap> {
        let parts = self.parts(shift);
        // The mirror image cancels the sine if the shift is across the line of symmetry.
        let sine = if self.polynomial.is_even() && shift.cosines[1] == 0.0 { 0.0 } else { 1.0 };
        let mut last = Overlap { value: [0.0; 2], change: 1.0, order: 0 };
        if parts.is_empty() {
            return None;
        }
        let orders: &[usize] = if tolerance < COARSE_SUM { &FINE_ORDERS } else { &COARSE_ORDERS };
        for order in orders.iter().copied() {
            let nodes = |part: &OverlapPart<'_>| part.counts(order).iter().product::<usize>();
            if parts.iter().any(|part| nodes(part) > MOST_NODES) {
                break;
            }
            let mut now = [0.0; 2];
            for part in &parts {
                let [re, im] = sum(part, part.counts(order));
                now[0] += part.factor * re / energy;
                now[1] += sine * part.factor * im / energy;
            }
            let before = last.value;
            (last.value, last.order) = (now, order);
            if order > orders[0] {
                last.change = CHANGES * (now[0] - before[0]).hypot(now[1] - before[1]);
                if last.change <= tolerance {
                    break;
                }
            }
        }
        Some(last)
    }

    /// The overlap integral of the polynomials over a strip.
    fn column_sum(
        &self,
        part: &OverlapPart<'_>,
        shift: TransferShift,
        counts: [usize; 2],
    ) -> [f64; 2] {
        ColumnPair::new(&self.polynomial, &part.strip, shift, counts[0]).sum(counts[1])
    }

    /// The number of rays traced.
    pub fn rays(&self) -> usize {
        self.rays
    }

    /// The f-number that a spatial frequency along an axis, x (0) or y (1), sees: the reciprocal of
    /// the width of the pupil in cosines, which is that of the cutoff times the wavelength.
    pub fn f_number(&self, axis: usize) -> f64 {
        let points = || self.pieces.iter().flat_map(|piece| piece.curve.points());
        let high = points().map(|p| p[axis]).fold(f64::NEG_INFINITY, f64::max);
        let low = points().map(|p| p[axis]).fold(f64::INFINITY, f64::min);
        1.0 / (high - low)
    }
}

impl PupilPiece {
    /// The light and, if there is one, the shadow in it, on a sphere; and the number of rays.
    fn of_traces(
        traces: &mut PupilTraces<'_>,
        sphere: &ReferenceSphere,
        tolerance: f64,
    ) -> Result<(Vec<Self>, usize), AnalysisError> {
        let points = PupilFunction::edge_points(tolerance);
        let (curves, rays) =
            traces.curves(sphere, (points, PupilFunction::edge_steps(tolerance)))?;
        let pieces = curves.into_iter().zip([1.0, -1.0]);
        Ok((pieces.map(|(curve, sign)| Self::new(curve, sign)).collect(), rays))
    }

    fn new(curve: PupilCurve, sign: f64) -> Self {
        Self { chains: [0, 1].map(|axis| curve.chains(axis)), curve, sign }
    }
}

impl OverlapPart<'_> {
    /// The columns and the nodes of each, of an order.
    fn counts(&self, order: usize) -> [usize; 2] {
        let [share, columns, nodes] = ORDERS[order];
        let count = |k: usize| (self.resolved[k] * share + [columns, nodes][k]).ceil() as usize;
        [count(0).next_multiple_of(TOGETHER), count(1)]
    }
}

/// The first order whose nodes polynomials are fitted to, and the RMS over the one allowed that two orders
/// more are for.
const FIRST_FIT: usize = 2;
const FAR: f64 = 300.0;
/// The samples of a fit for each term: fewer do not tell the highest azimuthal frequencies apart.
const TERM_SAMPLES: usize = 4;
/// The largest number of samples of a fit.
const MOST_SAMPLES: usize = 4000;

/// The light at some nodes, to fit polynomials to and to check them.
struct FitLight {
    samples: Vec<FitSample>,
    mirrored: bool,
    energy: f64,
    /// Makes an amplitude a number of the order of one: the size of the pupil.
    scale: f64,
}

impl FitLight {
    fn new(traced: &TracedLight, sphere: &ReferenceSphere) -> Result<Self, AnalysisError> {
        let light = traced.on(sphere)?;
        let sample = |i: usize| FitSample {
            cosines: light.cosines[i],
            values: [light.waves[i], light.energies[i] / light.amplitudes[i]],
            weight: light.energies[i],
        };
        let energy = light.energy();
        Ok(Self {
            samples: (0..light.cosines.len()).map(sample).collect(),
            mirrored: light.mirrored,
            energy,
            scale: light.peak() / energy,
        })
    }

    /// The polynomials nearest to this light, with what they leave of it or of other light, whichever is more.
    fn fit(&self, others: &Self, allowed: [f64; 2]) -> Option<(WavePolynomial, [f64; 2])> {
        let points = self.samples.iter().map(|sample| sample.cosines);
        let basis = PolynomialBasis::new(points, self.samples.len() / TERM_SAMPLES, self.mirrored);
        let allowed = [allowed[0], allowed[1] / self.scale];
        let (polynomial, own) = basis.fit(&self.samples, allowed)?;
        let between = polynomial.rest(&others.samples);
        let left = [0, 1].map(|k| own[k].max(between[k]));
        Some((polynomial, [left[0], left[1] * self.scale]))
    }
}
