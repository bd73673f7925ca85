//! The complex amplitude over a pupil as polynomials between its edges, and its transfer function.

use super::outline::PupilCurve;
use super::overlap::{OVERLAP_ORDERS, Overlap};
use super::polynomial::{FitSample, PolynomialBasis, WavePolynomial};
use super::pupil_samples::PupilSamples;
use super::ray_pupil::RayPupil;
use crate::analysis::reference_sphere::ReferenceSphere;
use crate::analysis::{AnalysisError, TransferValue};
use crate::pupil::{EdgeArc, Nodes, Region};
use std::cell::Cell;
use std::f64::consts::TAU;

/// A pupil as a function of direction cosines: the path difference and the amplitude as polynomials,
/// between the curves around its pieces.
#[derive(Debug, Clone)]
pub struct PupilFunction {
    /// The curves around the pieces, with 1 for light inside and −1 for a shadow.
    pieces: Vec<(PupilCurve, f64)>,
    polynomial: WavePolynomial,
    /// The wavelength in the image space, in mm.
    wavelength: f64,
    /// The integral of the squared amplitude.
    energy: f64,
    /// The RMS error of the polynomials: in waves, and of the relative amplitude.
    fit_error: [f64; 2],
    /// The number of rays traced.
    rays: usize,
}

/// Half of the shift of a pupil against itself in cosines, and that of the image plane in mm.
#[derive(Debug, Clone, Copy)]
struct TransferShift {
    cosines: [f64; 2],
    defocus: f64,
}

/// The points of an arc of the edge.
const EDGE_POINTS: usize = 40;
/// The degree of the polynomials of a pupil that is given by a formula, and the samples that they are
/// fitted to along a side of its box.
const FORMULA_TERMS: usize = 100;
const FORMULA_SAMPLES: usize = 30;
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
        Self::formula(pieces.into_iter().map(|p| (p, 1.0)).collect(), wavelength_um, waves)
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
        Self::formula(vec![(outer.clone(), 1.0), (inner.clone(), -1.0)], wavelength_um, waves)
    }

    fn formula(
        pieces: Vec<(PupilCurve, f64)>,
        wavelength_um: f64,
        waves: impl Fn([f64; 2]) -> f64,
    ) -> Result<Self, AnalysisError> {
        let points = || pieces.iter().flat_map(|(piece, _)| piece.points());
        let basis = PolynomialBasis::new(points(), FORMULA_TERMS, false);
        let side: Vec<f64> = crate::math::quadrature::chebyshev_points(FORMULA_SAMPLES).collect();
        let cells = side.iter().flat_map(|u| side.iter().map(move |v| [*u, *v]));
        let sample = |cell: [f64; 2]| {
            let cosines = basis.in_box(cell);
            FitSample { cosines, values: [waves(cosines), 1.0], weight: 1.0 }
        };
        let samples: Vec<_> = cells.map(sample).collect();
        let (polynomial, fit_error) = basis.fit(&samples).ok_or(AnalysisError::NoLight)?;
        let mut function = Self {
            pieces,
            polynomial,
            wavelength: wavelength_um * 1e-3,
            energy: 1.0,
            fit_error,
            rays: 0,
        };
        function.energy = function.overlap_energy()?;
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
        let curves = region.edge_curves(EDGE_POINTS).ok_or(AnalysisError::IrregularPupil)?;
        let curve = |arcs: &[EdgeArc]| project_curve(region, sphere, arcs);
        let mut pieces = vec![(curve(&curves.outer)?, 1.0)];
        if !curves.inner.is_empty() {
            pieces.push((curve(&curves.inner)?, -1.0));
        }
        let mut rays = region.rays + 2 * curves.rays;
        let mut best: Option<(WavePolynomial, [f64; 2])> = None;
        let mut energy = 0.0;
        let allowed = (FIT_SHARE * tolerance / TAU).max(0.1 * sphere.rounding());
        for order in 2..region.orders() {
            let nodes = region.nodes(order);
            rays += nodes.rays + 2 * nodes.points.len();
            if nodes.points.len() > MOST_SAMPLES {
                break;
            }
            let (fit, light) = fit_nodes(region, sphere, &nodes)?;
            energy = light;
            let Some(fit) = fit else { continue };
            let better = best.as_ref().is_none_or(|(_, [last, _])| fit.1[0] < *last);
            let done = fit.1[0] < allowed && fit.1[1] < FIT_SHARE * tolerance.max(1e-14);
            if better {
                best = Some(fit);
            }
            if done {
                break;
            }
        }
        let (polynomial, fit_error) = best.ok_or(AnalysisError::IrregularPupil)?;
        Ok(Self {
            pieces,
            polynomial,
            wavelength: sphere.medium_wavelength(),
            energy,
            fit_error,
            rays,
        })
    }

    /// The integral of the squared amplitude between the curves.
    fn overlap_energy(&self) -> Result<f64, AnalysisError> {
        let shift = TransferShift { cosines: [0.0; 2], defocus: 0.0 };
        let light = |cosines: [f64; 2]| self.polynomial.at(cosines);
        let found = self.converge(shift, 1e-13, 1.0, &light)?;
        Ok(found.0[0])
    }

    /// The light at the nodes of a quadrature between the curves, of an order counted from 0.
    ///
    /// # Errors
    /// A curve is not star-shaped.
    pub fn samples(&self, order: usize) -> Result<PupilSamples, AnalysisError> {
        let mut samples = PupilSamples { wavelength: self.wavelength, ..PupilSamples::default() };
        for (piece, sign) in &self.pieces {
            let common = Overlap::new([piece, piece], [0.0; 2]);
            let Some(common) = common.map_err(|_error| AnalysisError::IrregularPupil)? else {
                continue;
            };
            for node in common.nodes(order.min(OVERLAP_ORDERS - 1)) {
                let [waves, amplitude] = self.polynomial.at(node.at);
                samples.cosines.push(node.at);
                samples.waves.push(waves);
                samples.amplitudes.push(sign * node.weight * amplitude);
                samples.energies.push(sign * node.weight * amplitude * amplitude);
            }
        }
        Ok(samples)
    }

    /// The optical transfer function at a spatial frequency, x and y in cycles/mm, to an
    /// absolute tolerance, with its origin at the centre of the reference sphere. The image plane may
    /// be moved by `defocus` mm along the light.
    ///
    /// # Errors
    /// The common part of the shifted pupils cannot be integrated over.
    pub fn transfer(
        &self,
        frequency: [f64; 2],
        defocus: f64,
        tolerance: f64,
    ) -> Result<TransferValue, AnalysisError> {
        if frequency == [0.0; 2] {
            return Ok(TransferValue::new(1.0, 0.0, 0.0, self.rays));
        }
        let shift = self.shift(frequency, defocus);
        let light = |cosines: [f64; 2]| self.polynomial.at(cosines);
        let ([re, im], change) = self.converge(shift, tolerance, self.energy, &light)?;
        Ok(TransferValue::new(re, im, change + self.transfer_error(), self.rays))
    }

    fn shift(&self, frequency: [f64; 2], defocus: f64) -> TransferShift {
        TransferShift { cosines: frequency.map(|nu| 0.5 * self.wavelength * nu), defocus }
    }

    /// The error of contrast by what the polynomials leave of the two phases and amplitudes.
    pub(super) fn transfer_error(&self) -> f64 {
        let [waves, amplitude] = self.fit_error;
        2f64.sqrt() * (TAU * waves + amplitude)
    }

    /// [`PupilFunction::transfer`] by a ray for each node in place of the polynomials; `None` if some node
    /// has no ray.
    ///
    /// # Errors
    /// The common part of the shifted pupils cannot be integrated over.
    pub(super) fn transfer_by_rays(
        &self,
        frequency: [f64; 2],
        pupil: &RayPupil<'_>,
        tolerance: f64,
    ) -> Result<Option<TransferValue>, AnalysisError> {
        let (traced, lost) = (Cell::new(0), Cell::new(false));
        let light = |cosines: [f64; 2]| {
            traced.set(traced.get() + 1);
            pupil.light(cosines).unwrap_or_else(|| {
                lost.set(true);
                [0.0; 2]
            })
        };
        let shift = self.shift(frequency, 0.0);
        let ([re, im], change) = self.converge(shift, tolerance, self.energy, &light)?;
        let rays = self.rays + traced.get();
        Ok((!lost.get()).then(|| TransferValue::new(re, im, change, rays)))
    }

    /// The sum over the pieces of the overlap integrals divided by an energy, and its last change.
    fn converge(
        &self,
        shift: TransferShift,
        tolerance: f64,
        energy: f64,
        light: &impl Fn([f64; 2]) -> [f64; 2],
    ) -> Result<([f64; 2], f64), AnalysisError> {
        let mut overlaps = Vec::new();
        for (first, sign) in &self.pieces {
            for (second, other) in &self.pieces {
                // The point plus the shift lies in the first, the point minus it in the second.
                let back = shift.cosines.map(|v| -v);
                let common = Overlap::new([first, second], back);
                if let Some(common) = common.map_err(|_error| AnalysisError::IrregularPupil)? {
                    overlaps.push((common, sign * other));
                }
            }
        }
        let (mut last, mut change) = ([0.0; 2], f64::INFINITY);
        if overlaps.is_empty() {
            return Ok((last, 0.0));
        }
        for order in 0..OVERLAP_ORDERS {
            let parts = overlaps.iter().map(|(common, sign)| {
                let [re, im] = self.integrate(common, shift, order, light);
                [sign * re / energy, sign * im / energy]
            });
            let now = parts.fold([0.0; 2], |sum, part| [sum[0] + part[0], sum[1] + part[1]]);
            if order > 0 {
                change = (now[0] - last[0]).hypot(now[1] - last[1]);
            }
            last = now;
            if change <= tolerance {
                break;
            }
        }
        Ok((last, change))
    }

    /// The integral over the common part of two pieces.
    fn integrate(
        &self,
        common: &Overlap,
        TransferShift { cosines: shift, defocus }: TransferShift,
        order: usize,
        light: &impl Fn([f64; 2]) -> [f64; 2],
    ) -> [f64; 2] {
        let turns = defocus / self.wavelength;
        let mut sum = [0.0; 2];
        for node in common.nodes(order) {
            let plus = [node.at[0] + shift[0], node.at[1] + shift[1]];
            let minus = [node.at[0] - shift[0], node.at[1] - shift[1]];
            let (p, m) = (light(plus), light(minus));
            let mut waves = p[0] - m[0];
            if defocus != 0.0 {
                waves -= turns * (third_cosine(plus) - third_cosine(minus));
            }
            let (sin, cos) = (TAU * waves).sin_cos();
            let amplitude = node.weight * p[1] * m[1];
            sum = [sum[0] + amplitude * cos, sum[1] - amplitude * sin];
        }
        sum
    }

    /// The number of rays traced.
    pub fn rays(&self) -> usize {
        self.rays
    }

    /// The f-number that a spatial frequency along an axis, x (0) or y (1), sees: the reciprocal of
    /// the width of the pupil in cosines, which is that of the cutoff times the wavelength.
    pub fn f_number(&self, axis: usize) -> f64 {
        let points = || self.pieces.iter().flat_map(|(piece, _)| piece.points());
        let high = points().map(|p| p[axis]).fold(f64::NEG_INFINITY, f64::max);
        let low = points().map(|p| p[axis]).fold(f64::INFINITY, f64::min);
        1.0 / (high - low)
    }
}

/// The samples of a fit for each term: fewer do not tell the highest azimuthal frequencies apart.
const TERM_SAMPLES: usize = 4;
/// The largest number of samples of a fit.
const MOST_SAMPLES: usize = 4000;

/// The third cosine of a direction.
pub(super) fn third_cosine([a, b]: [f64; 2]) -> f64 {
    (1.0 - a * a - b * b).max(0.0).sqrt()
}

/// The polynomials of the light at some nodes with their errors, and its energy.
type NodeFit = (Option<(WavePolynomial, [f64; 2])>, f64);

fn fit_nodes(
    region: &Region<'_>,
    sphere: &ReferenceSphere,
    nodes: &Nodes,
) -> Result<NodeFit, AnalysisError> {
    let light = PupilSamples::of_nodes(region, sphere, nodes)?;
    let sample = |i: usize| {
        let amplitude = light.energies[i] / light.amplitudes[i];
        FitSample {
            cosines: light.cosines[i],
            values: [light.waves[i], amplitude],
            weight: light.energies[i],
        }
    };
    let samples: Vec<_> = (0..light.cosines.len()).map(sample).collect();
    let points = samples.iter().map(|sample| sample.cosines);
    let basis = PolynomialBasis::new(points, samples.len() / TERM_SAMPLES, light.mirrored);
    let energy = light.energy();
    // The amplitude is of the order of one over the size of the pupil.
    let scale = light.peak() / energy;
    let fit = basis.fit(&samples);
    Ok((fit.map(|(polynomial, [waves, rest])| (polynomial, [waves, rest * scale])), energy))
}

/// A curve of the pupil in cosines.
fn project_curve(
    region: &Region<'_>,
    sphere: &ReferenceSphere,
    arcs: &[EdgeArc],
) -> Result<PupilCurve, AnalysisError> {
    let launch = &region.launch;
    let place = |p: &[f64; 2]| {
        let end = launch.unclipped_landing(*p)?;
        let found = sphere.project(end.ray, end.opl)?;
        Some(found.cosines.map(|cosine| cosine.value))
    };
    let arc = |arc: &EdgeArc| {
        let points: Option<Vec<_>> = arc.points.iter().map(place).collect();
        Some((points?, arc.begins_at_corner))
    };
    let arcs: Option<Vec<_>> = arcs.iter().map(arc).collect();
    Ok(PupilCurve::from_arcs(&arcs.ok_or(AnalysisError::IrregularPupil)?))
}
