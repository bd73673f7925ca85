//! The transfer function of a pupil with its derivatives by every number of the lens.
//!
//! With `f = A exp(−2πi W)` over the direction cosines, a small change of the lens moves the ray of a pupil point by
//! `δα` on the sphere and changes its path difference by `δW`. Energy moves with the rays, so that at fixed cosines
//!
//! ```text
//! δf = −2πi δW f − δα·∇f − ½ f div δα
//! ```
//!
//! and the edge moves by the rays that make it and by those that begin or cease to pass. The transfer
//! `∫ f(α + s) f*(α − s)` changes by the integral of this over the overlap of the two pupils, and along its edges.
//! `δα` and `δW` are polynomials through their values at the rays of a quadrature, as f is: what the integrals ask of
//! the coefficients is carried back to the rays, and the rays back through the lens, all variables at once. The
//! centre of the reference sphere moves with the chief ray, unless that is blocked; its radius is held.

use super::outline::{ArcSteps, derivative};
use super::polynomial::{FitSample, Parity, PolynomialBasis, SampleFit};
use super::pupil_function::{PupilFunction, TransferShift};
use super::pupil_traces::TracedLight;
use crate::analysis::AnalysisError;
use crate::analysis::reference_sphere::{ReferenceForm, ReferenceSphere};
use crate::math::quadrature::{chebyshev_points, chebyshev_weights, legendre_rule};
use crate::math::{Dual, Vec3};
use crate::pupil::{EdgeArc, Region};
use crate::trace::{AdjointSeed, Ray, Rays, SystemGradient};
use std::f64::consts::TAU;

/// The rays that a transfer function is computed from: their order of quadrature, and the degree of the polynomials
/// through them.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct TransferRays {
    /// The order of quadrature.
    order: usize,
    degree: usize,
    /// The reference sphere.
    form: ReferenceForm,
    /// The absolute error of contrast that the polynomials leave.
    pub error: f64,
}

impl TransferRays {
    /// The fewest rays found whose polynomials leave less than a tenth of a tolerance of contrast.
    ///
    /// # Errors
    /// The pupil is dark, irregular or folds.
    pub fn find(region: &Region<'_>, tolerance: f64) -> Result<Self, AnalysisError> {
        let sphere = ReferenceSphere::for_region(region)?;
        let function = PupilFunction::of_region(region, &sphere, tolerance)?;
        let (order, degree) = function.order_and_degree();
        Ok(Self { order, degree, form: sphere.form, error: function.transfer_error() })
    }
}

/// A complex number as its real and imaginary part.
type Complex = [f64; 2];

fn product([a, b]: Complex, [c, d]: Complex) -> Complex {
    [a * c - b * d, a * d + b * c]
}

/// The transfer function of a pupil.
#[derive(Debug)]
pub struct RayTransfer<'a> {
    region: Region<'a>,
    sphere: ReferenceSphere,
    function: PupilFunction,
    /// The polynomials of what is even in the first cosine of a pupil that is its own mirror image, or of all.
    even: SampleFit,
    samples: Vec<FitSample>,
    /// The pupil point of each sample, and the end of its ray with its path.
    points: Vec<[f64; 2]>,
    ends: Vec<(Ray<f64>, f64)>,
    arcs: Vec<CosineArc>,
    tolerance: f64,
}

/// The derivatives of a transfer function.
#[derive(Debug)]
pub struct TransferSlopes<'t, 'a> {
    transfer: &'t RayTransfer<'a>,
    /// The polynomials of what is odd in the first cosine, where they are others.
    odd: Option<SampleFit>,
}

/// An arc of the edge in direction cosines.
#[derive(Debug)]
struct CosineArc {
    edge: EdgeArc,
    /// The cosines at its points, and their derivatives by its parameter.
    cosines: [Vec<f64>; 2],
    slopes: [Vec<f64>; 2],
    /// The energy of the area around each point.
    shares: Vec<f64>,
    /// 1 around light, −1 around a shadow.
    sign: f64,
    /// 1 if azimuth grows along it in cosines, −1 if it falls.
    sense: f64,
}

/// Derivatives of a number by the coefficients of the path difference and of the cosines, and by the motion of the
/// points of each arc.
struct CoefficientSlopes {
    waves: Vec<f64>,
    cosines: [Vec<f64>; 2],
    motion: Vec<Vec<f64>>,
    /// By the centre of the sphere, which turns the phase.
    center: [f64; 2],
}

/// A frequency with the complex factor of its transfer in the number that is differentiated.
#[derive(Debug, Clone, Copy)]
struct Asked {
    shift: TransferShift,
    factor: Complex,
    /// The order of the overlap integral.
    order: usize,
}

impl<'a> RayTransfer<'a> {
    /// The transfer function of a pupil by such rays, to an absolute tolerance of its integrals.
    ///
    /// # Errors
    /// The pupil is dark, irregular or folds.
    pub fn new(
        region: &Region<'a>,
        rays: TransferRays,
        tolerance: f64,
    ) -> Result<Self, AnalysisError> {
        let sphere = ReferenceSphere::for_region(region)?.with_form(rays.form);
        let traced = TracedLight::new(region, &region.nodes(rays.order));
        let light = traced.on(&sphere)?;
        let sample = |i: usize| FitSample {
            cosines: light.cosines[i],
            values: [light.waves[i], light.energies[i] / light.amplitudes[i]],
            weight: light.energies[i],
        };
        let samples: Vec<FitSample> = (0..light.cosines.len()).map(sample).collect();
        let points = samples.iter().map(|sample| sample.cosines);
        let basis = PolynomialBasis::of_degree(points, rays.degree, light.mirrored);
        let parity = if light.mirrored { Parity::Even } else { Parity::All };
        let fit = SampleFit::new(&basis, parity, &samples);
        let (even, polynomial) = fit.ok_or(AnalysisError::IrregularPupil)?;
        let (arcs, steps) = cosine_arcs(region, &sphere, tolerance)?;
        let curves = arcs.iter().map(|arc| (arc.nodes(), arc.edge.begins_at_corner, arc.sign));
        let energy = light.energy();
        let wavelength = sphere.medium_wavelength();
        let function = PupilFunction::of_fit((polynomial, energy), wavelength, (curves, steps));
        let (region, points) = (region.clone(), light.points);
        let ends = traced.ends_of(&points);
        Ok(Self { region, sphere, function, even, samples, points, ends, arcs, tolerance })
    }

    /// The image point that phases are counted from, x and y in mm.
    pub fn center(&self) -> [f64; 2] {
        [self.sphere.center.x, self.sphere.center.y]
    }

    /// The number of rays.
    pub fn rays(&self) -> usize {
        self.points.len()
    }

    /// The complex transfer at a spatial frequency in cycles/mm, with phases counted from an image point.
    pub fn value(&self, frequency: [f64; 2], origin: [f64; 2]) -> Complex {
        let found = self.function.transfer(frequency, 0.0, self.tolerance);
        product([found.re, found.im], self.turn(frequency, origin))
    }

    /// The factor that counts phases from an image point in place of the centre of the sphere.
    fn turn(&self, frequency: [f64; 2], origin: [f64; 2]) -> Complex {
        let center = self.center();
        let along = |k: usize| frequency[k] * (center[k] - origin[k]);
        let (sin, cos) = (-TAU * (along(0) + along(1))).sin_cos();
        [cos, sin]
    }

    /// The numbers that its derivatives need.
    ///
    /// # Errors
    /// The rays do not tell the polynomials.
    pub fn slopes(&self) -> Result<TransferSlopes<'_, 'a>, AnalysisError> {
        let odd = if self.function.is_even() {
            let fit = SampleFit::new(self.even.basis(), Parity::Odd, &self.samples);
            Some(fit.ok_or(AnalysisError::IrregularPupil)?.0)
        } else {
            None
        };
        Ok(TransferSlopes { transfer: self, odd })
    }

    /// The derivatives of numbers of a ray on the sphere by its landing: of its path difference and of its cosines.
    fn seed(&self, ray: Ray<f64>, path: f64, by: [f64; 3]) -> AdjointSeed<f64> {
        let vector = |v: Vec3<f64>, first: usize| {
            let variable = |value, axis| Dual::<f64, 7>::variable(value, first + axis);
            Vec3::new(variable(v.x, 0), variable(v.y, 1), variable(v.z, 2))
        };
        let dual = Ray { point: vector(ray.point, 0), direction: vector(ray.direction, 3) };
        let Some(found) = self.sphere.project(dual, Dual::variable(path, 6)) else {
            return AdjointSeed::default();
        };
        let [a, b] = found.cosines;
        let slope =
            |k: usize| by[0] * found.waves.slope[k] + by[1] * a.slope[k] + by[2] * b.slope[k];
        let vector = |first: usize| Vec3::new(slope(first), slope(first + 1), slope(first + 2));
        AdjointSeed { point: vector(0), direction: vector(3), opl: slope(6) }
    }

    /// The parts of an arc whose points moved back by the whole shift lie in the pupil.
    fn lit_parts(
        &self,
        arc: &CosineArc,
        places: &[f64],
        shift: TransferShift,
        sense: f64,
    ) -> Vec<(f64, f64)> {
        let is_lit = |u: f64| {
            let place = arc.place(&chebyshev_weights(places, u));
            self.function.covers([0, 1].map(|k| place[k] - 2.0 * sense * shift.cosines[k]))
        };
        let step = 1.0 / ARC_PARTS as f64;
        let lit: Vec<bool> = (0..=ARC_PARTS).map(|i| is_lit(step * i as f64)).collect();
        let mut parts = Vec::new();
        for i in 0..ARC_PARTS {
            let (from, to) = (step * i as f64, step * (i + 1) as f64);
            match (lit[i], lit[i + 1]) {
                (true, true) => parts.push((from, to)),
                (false, false) => {}
                (true, false) => parts.push((from, change(is_lit, from, to))),
                (false, true) => parts.push((change(is_lit, to, from), to)),
            }
        }
        parts
    }
}

impl TransferSlopes<'_, '_> {
    /// The polynomials of what is even in the first cosine, and of what is odd.
    fn fits(&self) -> [&SampleFit; 2] {
        let even = &self.transfer.even;
        [even, self.odd.as_ref().unwrap_or(even)]
    }

    /// The derivative of the real part of `factor` times the transfer at a frequency, by every number of the lens.
    pub fn gradient(
        &self,
        frequency: [f64; 2],
        origin: [f64; 2],
        factor: [f64; 2],
    ) -> SystemGradient<f64> {
        let transfer = self.transfer;
        let factor = product(factor, transfer.turn(frequency, origin));
        let [even, odd] = self.fits();
        let mut by = CoefficientSlopes {
            waves: vec![0.0; even.terms()],
            cosines: [odd, even].map(|fit| vec![0.0; fit.terms()]),
            motion: transfer.arcs.iter().map(|arc| vec![0.0; arc.shares.len()]).collect(),
            center: [0.0; 2],
        };
        let function = &transfer.function;
        let shift = function.shift(frequency, 0.0);
        let (value, order) = function.transfer_and_order(frequency, transfer.tolerance);
        // Where the mirror image cancels the sine, its factor asks for nothing.
        let is_real = function.is_even() && frequency[1] == 0.0;
        let factor = if is_real { [factor[0], 0.0] } else { factor };
        let factor = factor.map(|part| part / function.energy());
        let asked = Asked { shift, factor, order };
        self.add_interior(asked, &mut by);
        let [value, turned] = product(factor, value);
        by.center = frequency.map(|nu| TAU * nu * turned * function.energy());
        for (arc, number) in transfer.arcs.iter().zip(0..) {
            self.add_arc(asked, (arc, number), value, &mut by);
        }
        self.by_numbers(&by)
    }

    /// Adds the integral over the overlap of the two pupils.
    fn add_interior(&self, Asked { shift, factor, order }: Asked, by: &mut CoefficientSlopes) {
        let [even, odd] = self.fits();
        let function = &self.transfer.function;
        for (node, weight) in function.overlap_nodes(shift, order) {
            let [plus, minus] = [1.0, -1.0].map(|sign| {
                let place = [0, 1].map(|k| node[k] + sign * shift.cosines[k]);
                let at = even.basis().at_point(place);
                (function.polynomial().with_slopes(&at), at)
            });
            let ([w_plus, a_plus], [w_minus, a_minus]) = (plus.0, minus.0);
            let (sin, cos) = (-TAU * (w_plus[0] - w_minus[0])).sin_cos();
            let size = weight * a_plus[0] * a_minus[0];
            let [re, im] = product(factor, [size * cos, size * sin]);
            for (sign, at, w, a) in
                [(1.0, &plus.1, w_plus, a_plus), (-1.0, &minus.1, w_minus, a_minus)]
            {
                even.add_terms(at, sign * TAU * im, [0.0; 2], &mut by.waves);
                // −Re(c ∂f/f) of the first factor, of the conjugate of the second.
                let along = |k: usize| -(re * a[1 + k] / a[0] + sign * TAU * im * w[1 + k]);
                odd.add_terms(at, along(0), [-0.5 * re, 0.0], &mut by.cosines[0]);
                even.add_terms(at, along(1), [0.0, -0.5 * re], &mut by.cosines[1]);
            }
        }
    }

    /// Adds what an arc of the edge brings: the flux of its rays through it, and that of its motion among the rays,
    /// which changes the energy as well.
    fn add_arc(
        &self,
        asked: Asked,
        (arc, number): (&CosineArc, usize),
        value: f64,
        by: &mut CoefficientSlopes,
    ) {
        let places: Vec<f64> = chebyshev_points(arc.shares.len()).collect();
        let motion = &mut by.motion[number];
        for (at, weight) in legendre_rule(arc.shares.len()) {
            let shares = chebyshev_weights(&places, *at);
            let energies = shares.iter().zip(&arc.shares);
            let moved = motion.iter_mut().zip(energies);
            moved.for_each(|(by, (share, energy))| {
                *by -= arc.sign * weight * value * share * energy;
            });
        }
        for sense in [1.0, -1.0] {
            for (from, to) in self.transfer.lit_parts(arc, &places, asked.shift, sense) {
                for (u, weight) in legendre_rule(ARC_NODES) {
                    let at = chebyshev_weights(&places, from + u * (to - from));
                    self.add_edge_node(
                        asked,
                        (arc, number),
                        (&at, weight * (to - from), sense),
                        by,
                    );
                }
            }
        }
    }

    /// Adds a node of the edge, given by the shares of the points of its arc.
    fn add_edge_node(
        &self,
        Asked { shift, factor, .. }: Asked,
        (arc, number): (&CosineArc, usize),
        (at, weight, sense): (&[f64], f64, f64),
        by: &mut CoefficientSlopes,
    ) {
        let [even, odd] = self.fits();
        let function = &self.transfer.function;
        let (place, slope) = (arc.place(at), arc.slope(at));
        let basis = even.basis().at_point(place);
        let other = [0, 1].map(|k| place[k] - 2.0 * sense * shift.cosines[k]);
        let [waves, amplitude] = function.polynomial().at(place);
        let [other_waves, other_amplitude] = function.polynomial().at(other);
        let (sin, cos) = (-TAU * sense * (waves - other_waves)).sin_cos();
        let size = weight * arc.sign * amplitude * other_amplitude;
        let flux = product(factor, [size * cos, size * sin])[0];
        let outwards = arc.sense * flux;
        odd.add_terms(&basis, -outwards * slope[1], [0.0; 2], &mut by.cosines[0]);
        even.add_terms(&basis, outwards * slope[0], [0.0; 2], &mut by.cosines[1]);
        let moved = by.motion[number].iter_mut().zip(at.iter().zip(&arc.shares));
        let density = flux / (amplitude * amplitude);
        moved.for_each(|(by, (share, energy))| *by += density * share * energy);
    }

    /// The derivatives by every number of the lens.
    fn by_numbers(&self, by: &CoefficientSlopes) -> SystemGradient<f64> {
        let [even, odd] = self.fits();
        let transfer = self.transfer;
        let waves = even.by_samples(&by.waves);
        let across = odd.by_samples(&by.cosines[0]);
        let along = even.by_samples(&by.cosines[1]);
        let launch = &transfer.region.launch;
        let chief = &transfer.sphere.chief;
        let points = transfer.points.iter().chain([chief]);
        let rays: Rays<f64> = points.filter_map(|p| launch.ray(*p)).collect();
        let seed = |(i, (ray, path)): (usize, &(Ray<f64>, f64))| {
            transfer.seed(*ray, *path, [waves[i], across[i], along[i]])
        };
        let mut seeds: Vec<AdjointSeed<f64>> = transfer.ends.iter().enumerate().map(seed).collect();
        // Numbers of rays on the sphere depend on their distance from its centre.
        let mut center = seeds.iter().fold(Vec3::default(), |sum, seed| sum - seed.point);
        center.x = if transfer.function.is_even() { 0.0 } else { center.x + by.center[0] };
        center.y += by.center[1];
        seeds.push(AdjointSeed { point: center, ..AdjointSeed::default() });
        let seed = |i: usize| seeds.get(i).copied().unwrap_or_default();
        let mut total = launch.channel().tracer.gradient(&rays, seed);
        let arcs: Vec<&EdgeArc> = transfer.arcs.iter().map(|arc| &arc.edge).collect();
        total.add(&transfer.region.motion_of_arcs(&arcs, &by.motion), 1.0);
        total
    }
}

/// The parts of an arc that are looked at for light across it, and the nodes of each.
const ARC_PARTS: usize = 24;
const ARC_NODES: usize = 5;
/// The halvings that find where light across an arc ends.
const HALVINGS: usize = 34;

/// The last place from a lit one towards another where there is light.
fn change(is_lit: impl Fn(f64) -> bool, mut lit: f64, mut dark: f64) -> f64 {
    for _ in 0..HALVINGS {
        let middle = 0.5 * (lit + dark);
        if is_lit(middle) {
            lit = middle;
        } else {
            dark = middle;
        }
    }
    lit
}

impl CosineArc {
    fn nodes(&self) -> Vec<[f64; 2]> {
        let [a, b] = &self.cosines;
        a.iter().zip(b).map(|(a, b)| [*a, *b]).collect()
    }

    fn place(&self, shares: &[f64]) -> [f64; 2] {
        self.cosines.each_ref().map(|values| mixed(values, shares))
    }

    fn slope(&self, shares: &[f64]) -> [f64; 2] {
        self.slopes.each_ref().map(|values| mixed(values, shares))
    }
}

fn mixed(values: &[f64], shares: &[f64]) -> f64 {
    values.iter().zip(shares).map(|(value, share)| value * share).sum()
}

/// The arcs of the edges of a pupil in direction cosines, and the steps of their curves.
fn cosine_arcs(
    region: &Region<'_>,
    sphere: &ReferenceSphere,
    tolerance: f64,
) -> Result<(Vec<CosineArc>, ArcSteps), AnalysisError> {
    let count = PupilFunction::edge_points(tolerance);
    let curves = region.edge_curves(count).ok_or(AnalysisError::IrregularPupil)?;
    let mut all = Vec::new();
    for (arcs, sign) in [(curves.outer, 1.0), (curves.inner, -1.0)] {
        let of_curve: Option<Vec<CosineArc>> =
            arcs.into_iter().map(|edge| cosine_arc(region, sphere, edge, sign)).collect();
        let mut of_curve = of_curve.ok_or(AnalysisError::IrregularPupil)?;
        let nodes: Vec<[f64; 2]> = of_curve.iter().flat_map(CosineArc::nodes).collect();
        let next = nodes.iter().cycle().skip(1);
        let area: f64 = nodes.iter().zip(next).map(|(a, b)| a[1] * b[0] - a[0] * b[1]).sum();
        of_curve.iter_mut().for_each(|arc| arc.sense = area.signum());
        all.extend(of_curve);
    }
    Ok((all, PupilFunction::edge_steps(tolerance)))
}

fn cosine_arc(
    region: &Region<'_>,
    sphere: &ReferenceSphere,
    edge: EdgeArc,
    sign: f64,
) -> Option<CosineArc> {
    let ends = region.launch.unclipped_landings(edge.points.iter().copied());
    let mut cosines = [Vec::new(), Vec::new()];
    for end in ends {
        let (ray, path) = end?;
        let found = sphere.project(ray, path)?.cosines;
        cosines.iter_mut().zip(found).for_each(|(list, cosine)| list.push(cosine.value));
    }
    let slopes = cosines.each_ref().map(|values| derivative(values));
    let shares = edge.points.iter().map(|p| region.launch.beam_share(*p)).collect();
    Some(CosineArc { edge, cosines, slopes, shares, sign, sense: 1.0 })
}
