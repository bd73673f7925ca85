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
//! the coefficients is carried back to the rays, and the rays back through the lens, all variables and frequencies at
//! once. The
//! centre of the reference sphere moves with the chief ray, unless that is blocked; its radius is held.

use super::outline::{ArcSteps, derivative};
use super::overlap::rule;
use super::overlap_slopes::{PupilPoints, TermSlopes};
use super::polynomial::{FitSample, LANES, Lanes, PolynomialBasis, SampleFit};
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
        let sphere = ReferenceSphere::focused(region)?;
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
    /// The polynomials through the samples; even in the first cosine of a pupil that is its own mirror image.
    fit: SampleFit,
    /// The first cosine of each sample, its pupil point, and the end of its ray with its path.
    first_cosines: Vec<f64>,
    points: Vec<[f64; 2]>,
    ends: Vec<(Ray<f64>, f64)>,
    arcs: Vec<CosineArc>,
    tolerance: f64,
}

/// A transfer at a spatial frequency, with what its derivatives need.
#[derive(Debug, Clone, Copy)]
pub struct TransferAtFrequency {
    /// The complex transfer, with phases counted from an image point.
    pub value: [f64; 2],
    frequency: [f64; 2],
    /// The factor that counts phases from that point in place of the centre of the sphere.
    turn: Complex,
    /// The transfer about the centre of the sphere, and the order of its overlap integral.
    centered: Complex,
    order: usize,
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
    terms: TermSlopes,
    motion: Vec<Vec<f64>>,
    /// By the centre of the sphere, which turns the phase.
    center: [f64; 2],
}

/// A frequency with the complex factor of its transfer in the number that is differentiated.
#[derive(Debug, Clone, Copy)]
struct Asked {
    shift: TransferShift,
    factor: Complex,
    /// The nodes that resolve the phase along an arc of the edge.
    along_edge: usize,
}

/// An arc that is looked at.
#[derive(Debug, Clone, Copy)]
struct LookedArc<'t> {
    arc: &'t CosineArc,
    /// The places of its points from 0 to 1, and the cosines at the ends of its parts.
    places: &'t [f64],
    ends: &'t [[f64; 2]],
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
        let sphere = ReferenceSphere::focused(region)?.with_form(rays.form);
        let traced = TracedLight::new(region, &region.nodes(rays.order));
        let light = traced.on(&sphere)?;
        let sample = |i: usize| FitSample {
            cosines: light.cosines[i],
            values: [light.waves[i], light.energies[i] / light.amplitudes[i]],
            weight: light.energies[i],
        };
        // The displacement of a mirrored pupil is divided by the first cosine.
        let usable = |i: &usize| !light.mirrored || light.cosines[*i][0] != 0.0;
        let usable: Vec<usize> = (0..light.cosines.len()).filter(usable).collect();
        let samples: Vec<FitSample> = usable.iter().map(|i| sample(*i)).collect();
        let points = samples.iter().map(|sample| sample.cosines);
        let basis = PolynomialBasis::of_degree(points, rays.degree, light.mirrored);
        let fit = SampleFit::new(&basis, &samples);
        let (fit, polynomial) = fit.ok_or(AnalysisError::IrregularPupil)?;
        let (arcs, steps) = cosine_arcs(region, &sphere, tolerance)?;
        let curves = arcs.iter().map(|arc| (arc.nodes(), arc.edge.begins_at_corner, arc.sign));
        let energy = light.energy();
        let wavelength = sphere.medium_wavelength();
        let function = PupilFunction::of_fit((polynomial, energy), wavelength, (curves, steps));
        let points: Vec<[f64; 2]> = usable.iter().map(|i| light.points[*i]).collect();
        let region = region.clone();
        let ends = traced.ends_of(&points);
        let first_cosines = samples.iter().map(|sample| sample.cosines[0]).collect();
        Ok(Self { region, sphere, function, fit, first_cosines, points, ends, arcs, tolerance })
    }

    /// The image point that phases are counted from, x and y in mm.
    pub fn center(&self) -> [f64; 2] {
        [self.sphere.center.x, self.sphere.center.y]
    }

    /// The number of rays.
    pub fn rays(&self) -> usize {
        self.points.len()
    }

    /// The transfer at a spatial frequency in cycles/mm, with phases counted from an image point.
    pub fn at(&self, frequency: [f64; 2], origin: [f64; 2]) -> TransferAtFrequency {
        let (centered, order) = self.function.transfer_and_order(frequency, self.tolerance);
        let turn = self.turn(frequency, origin);
        let value = product(centered, turn);
        TransferAtFrequency { value, frequency, turn, centered, order }
    }

    /// The factor that counts phases from an image point in place of the centre of the sphere.
    fn turn(&self, frequency: [f64; 2], origin: [f64; 2]) -> Complex {
        let center = self.center();
        let along = |k: usize| frequency[k] * (center[k] - origin[k]);
        let (sin, cos) = (-TAU * (along(0) + along(1))).sin_cos();
        [cos, sin]
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

    /// The derivatives of a sum by every number of the lens: of the real parts of transfers, each times a complex
    /// factor.
    pub fn gradient(
        &self,
        asked: impl IntoIterator<Item = (TransferAtFrequency, [f64; 2])>,
    ) -> SystemGradient<f64> {
        let function = &self.function;
        let mut by = CoefficientSlopes {
            terms: TermSlopes::zero(self.fit.terms()),
            motion: self.arcs.iter().map(|arc| vec![0.0; arc.shares.len()]).collect(),
            center: [0.0; 2],
        };
        let mut parts = Vec::new();
        let mut value = 0.0;
        for (at, factor) in asked {
            let factor = product(factor, at.turn);
            let shift = function.shift(at.frequency, 0.0);
            // Where the mirror image cancels the sine, its factor asks for nothing.
            let is_real = function.is_even() && at.frequency[1] == 0.0;
            let factor = if is_real { [factor[0], 0.0] } else { factor };
            let factor = factor.map(|part| part / function.energy());
            let along_edge = function.add_overlap_slopes((shift, at.order), factor, &mut by.terms);
            let [own, turned] = product(factor, at.centered);
            value += own;
            for k in [0, 1] {
                by.center[k] += TAU * at.frequency[k] * turned * function.energy();
            }
            parts.push(Asked { shift, factor, along_edge });
        }
        for (arc, number) in self.arcs.iter().zip(0..) {
            self.add_arc((&parts, value), (arc, number), &mut by);
        }
        self.by_numbers(&by)
    }

    /// Adds what an arc of the edge brings: the flux of its rays through it, and that of its motion among the rays,
    /// which changes the energy as well.
    fn add_arc(
        &self,
        (asked, value): (&[Asked], f64),
        (arc, number): (&CosineArc, usize),
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
        let end = |i| arc.place(&chebyshev_weights(&places, i as f64 / ARC_PARTS as f64));
        let ends: Vec<[f64; 2]> = (0..=ARC_PARTS).map(end).collect();
        let looked = LookedArc { arc, places: &places, ends: &ends };
        let mut points = PupilPoints::new(self.function.polynomial());
        for one in asked {
            for sense in [1.0, -1.0] {
                self.add_lit_parts((*one, sense), looked, &mut points, (number, by));
            }
        }
    }

    /// Adds the nodes of an arc that have light across it.
    fn add_lit_parts(
        &self,
        (asked, sense): (Asked, f64),
        looked: LookedArc<'_>,
        points: &mut PupilPoints<'_>,
        (number, by): (usize, &mut CoefficientSlopes),
    ) {
        for (from, to) in self.lit_parts(looked, asked.shift, sense) {
            let count = ((to - from) * asked.along_edge as f64).ceil() as usize + EDGE_NODES;
            let node = |(u, weight)| (from + u * (to - from), weight * (to - from));
            let nodes: Vec<(f64, f64)> = rule(count).into_iter().map(node).collect();
            for nodes in nodes.chunks(LANES) {
                Self::add_edge_nodes((asked, sense), (looked, nodes), points, (number, by));
            }
        }
    }

    /// The parts of an arc whose points moved back by the whole shift lie in the pupil.
    fn lit_parts(
        &self,
        LookedArc { arc, places, ends }: LookedArc<'_>,
        shift: TransferShift,
        sense: f64,
    ) -> Vec<(f64, f64)> {
        let is_lit = |place: [f64; 2]| {
            self.function.covers([0, 1].map(|k| place[k] - 2.0 * sense * shift.cosines[k]))
        };
        let is_lit_at = |u: f64| is_lit(arc.place(&chebyshev_weights(places, u)));
        let lit: Vec<bool> = ends.iter().map(|place| is_lit(*place)).collect();
        let end = |i: usize| i as f64 / ARC_PARTS as f64;
        let mut parts = Vec::new();
        let mut from = 0.0;
        for i in 0..ARC_PARTS {
            match (lit[i], lit[i + 1]) {
                (true, false) => parts.push((from, change(is_lit_at, end(i), end(i + 1)))),
                (false, true) => from = change(is_lit_at, end(i + 1), end(i)),
                _ => {}
            }
        }
        if lit[ARC_PARTS] {
            parts.push((from, 1.0));
        }
        parts
    }

    /// Adds some nodes of the edge, each given by its place on the arc from 0 to 1 and by its weight.
    fn add_edge_nodes(
        (Asked { shift, factor, .. }, sense): (Asked, f64),
        (LookedArc { arc, places, .. }, nodes): (LookedArc<'_>, &[(f64, f64)]),
        points: &mut PupilPoints<'_>,
        (number, by): (usize, &mut CoefficientSlopes),
    ) {
        let shares: Vec<Vec<f64>> =
            nodes.iter().map(|(u, _)| chebyshev_weights(places, *u)).collect();
        // Nodes that are not there repeat the last one without a weight.
        let lanes = |of: &dyn Fn(usize) -> f64| -> Lanes {
            std::array::from_fn(|k| of(k.min(nodes.len() - 1)))
        };
        let weights: Lanes =
            std::array::from_fn(|k| nodes.get(k).map_or(0.0, |(_, weight)| *weight));
        let place = [0, 1].map(|k| lanes(&|i| mixed(&arc.cosines[k], &shares[i])));
        let slope = [0, 1].map(|k| lanes(&|i| mixed(&arc.slopes[k], &shares[i])));
        let other = [0, 1].map(|k| place[k].map(|v| v - 2.0 * sense * shift.cosines[k]));
        let [other_waves, other_amplitude] = points.light_at(&other);
        let [waves, amplitude] = points.light_at(&place);
        let flux: Lanes = std::array::from_fn(|k| {
            let (sin, cos) = (-TAU * sense * (waves[k] - other_waves[k])).sin_cos();
            let size = weights[k] * arc.sign * amplitude[k] * other_amplitude[k];
            product(factor, [size * cos, size * sin])[0]
        });
        let outwards = |sign: f64, axis: usize| -> Lanes {
            std::array::from_fn(|k| sign * arc.sense * flux[k] * slope[axis][k])
        };
        points.add_displacements(&place, [outwards(-1.0, 1), outwards(1.0, 0)], &mut by.terms);
        for (k, shares) in shares.iter().enumerate() {
            let density = flux[k] / (amplitude[k] * amplitude[k]);
            let moved = by.motion[number].iter_mut().zip(shares.iter().zip(&arc.shares));
            moved.for_each(|(by, (share, energy))| *by += density * share * energy);
        }
    }

    /// The derivatives by every number of the lens.
    fn by_numbers(&self, by: &CoefficientSlopes) -> SystemGradient<f64> {
        let waves = self.fit.by_samples(&by.terms.waves);
        let [mut across, along] = by.terms.cosines.each_ref().map(|list| self.fit.by_samples(list));
        if self.function.is_even() {
            // Its polynomial is that of the displacement over the first cosine.
            let over = across.iter_mut().zip(&self.first_cosines);
            over.for_each(|(by, cosine)| *by /= cosine);
        }
        let launch = &self.region.launch;
        let chief = &self.sphere.chief;
        let points = self.points.iter().chain([chief]);
        let rays: Rays<f64> = points.filter_map(|p| launch.ray(*p)).collect();
        let seed = |(i, (ray, path)): (usize, &(Ray<f64>, f64))| {
            self.seed(*ray, *path, [waves[i], across[i], along[i]])
        };
        let mut seeds: Vec<AdjointSeed<f64>> = self.ends.iter().enumerate().map(seed).collect();
        // Numbers of rays on the sphere depend on their distance from its centre.
        let mut center = seeds.iter().fold(Vec3::default(), |sum, seed| sum - seed.point);
        center.x = if self.function.is_even() { 0.0 } else { center.x + by.center[0] };
        center.y += by.center[1];
        seeds.push(AdjointSeed { point: center, ..AdjointSeed::default() });
        let seed = |i: usize| seeds.get(i).copied().unwrap_or_default();
        let mut total = launch.channel().tracer.gradient(&rays, seed);
        let arcs: Vec<&EdgeArc> = self.arcs.iter().map(|arc| &arc.edge).collect();
        total.add(&self.region.motion_of_arcs(&arcs, &by.motion), 1.0);
        total
    }
}

/// The parts of an arc that are looked at for light across it, and the nodes of a whole arc besides those that its
/// phase needs.
const ARC_PARTS: usize = 24;
const EDGE_NODES: usize = 10;
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
