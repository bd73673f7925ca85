//! Limit functions: the distances of rays from every limit of a surface, with second derivatives by
//! the pupil coordinates and derivatives by the lens.
//!
//! An integral over the rays that get through changes also with the position of its edge. Its
//! derivative needs a family of rays with its second derivatives by two coordinates of the pupil
//! ([`Jet`]), and at every surface functions that are negative for a ray that passes and zero at the
//! edge:
//!
//! ```text
//! rim         (r²/R² − 1)/2, and of an obstruction (1 − r²/h²)/2
//! angle       max(0, 1 − (n'/n)²) N·N − (k·N)²/n²
//! conic edge  −(1 − (1+κ) c z), or (1+κ) c² r² − 1 at an asphere
//! ```
//!
//! All are smooth on the axis and dimensionless, so that none is near its edge because of its unit.
//! With N·N = 1 the angle compares the square of the cosine of incidence with that of the critical
//! angle if the index falls, and with grazing incidence otherwise: where a sphere or conic is just
//! missed, its discriminant (k·N)² is zero, and so it is where a ray touches an asphere. A ray that
//! crosses an asphere more than once may end a family discontinuously, when another crossing becomes
//! the first; no limit function shows that.
//!
//! On the way back, derivatives are first-order jets whose values are needed. The transpose of a
//! multiplication by a jet `v + x ε + y η` is a multiplication again, of the number written as
//! `v εη + x η + y ε` in the algebra with ε² = η² = 0: the adjoint of every ray therefore runs
//! unchanged over `Dual<Dual>`, and the result is the coefficient of εη.

use super::Tracer;
use super::adjoint::{AdjointSeed, GradientSink, LimitAdjoint, SeedSource, SystemGradient};
use super::aperture::ApertureSet;
use super::batch::{BLOCK, RayBlock};
use super::interface::{Interface, SurfaceForm};
use super::single::Ray;
use super::surface_parameter::SurfaceParameter;
use crate::lens::{System, SystemError};
use crate::math::{Dual, Jet, Real, Vec3};
use crate::math::{SimdWidth, run_vectorized};

/// The number of rays in a block.
pub const LANES: usize = BLOCK;

/// A number of the algebra with ε² = η² = 0; the outer slope is the coefficient of ε.
type MixedDual<R> = Dual<Dual<R, 1>, 1>;

/// A limit function of a surface.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum LimitFunction {
    Rim,
    Obstruction,
    Angle,
    ConicEdge,
    /// A side of an aperture that is no circle about the vertex. It may lie inside the light beyond its
    /// corners; a field that moves along with it there does no harm.
    Aperture(u16),
}

impl<R: Real> Interface<R> {
    /// `max(0, n² − n'²)`.
    #[inline(always)]
    pub(super) fn index_drop2(&self) -> R {
        R::select(self.dn2 < R::ZERO, -self.dn2, R::ZERO)
    }

    /// True if a limit can end rays. A plane ends no ray by its angle unless the index falls, and the
    /// rim usually lies inside the edge of the conic.
    fn has(&self, limit: LimitFunction) -> bool {
        let surface = self.value();
        let c2 = (1.0 + surface.conic) * surface.curvature * surface.curvature;
        let flat = surface.form != SurfaceForm::Asphere && surface.curvature == 0.0;
        match limit {
            LimitFunction::Rim => surface.rim2 < f64::INFINITY,
            LimitFunction::Obstruction => surface.obstruction2 > 0.0,
            LimitFunction::Aperture(_) => true,
            LimitFunction::Angle => !flat || surface.dn2 < 0.0,
            LimitFunction::ConicEdge => {
                let closed = surface.form == SurfaceForm::Asphere
                    || surface.min_normal_z > f64::NEG_INFINITY;
                closed && c2 > 0.0 && c2 * surface.rim2 >= 1.0
            }
        }
    }
}

impl<R: Real> Interface<Jet<R>> {
    /// `N·N` at a point of the surface.
    #[inline(always)]
    fn normal_squared(&self, p: Vec3<Jet<R>>) -> Jet<R> {
        let c = self.curvature;
        let r2 = p.x * p.x + p.y * p.y;
        match self.form {
            SurfaceForm::Plane | SurfaceForm::Sphere => Jet::ONE,
            SurfaceForm::Conic => {
                let z = Jet::ONE - c * (p.z + self.conic * p.z);
                c * c * r2 + z * z
            }
            SurfaceForm::Asphere => {
                let slope = self.sag(r2).1;
                slope * slope * r2 * Jet::from_f64(4.0) + Jet::ONE
            }
        }
    }

    #[inline(always)]
    fn limit_values(
        &self,
        limit: LimitFunction,
        block: &RayBlock<Jet<R>>,
        slants: &[Jet<R>; BLOCK],
        lanes: &mut [Jet<R>; BLOCK],
    ) {
        for j in 0..BLOCK {
            lanes[j] = self.limit_value(limit, block.state(j).0, slants[j]);
        }
    }

    /// A limit function, from the point and `k·N`.
    #[inline(always)]
    fn limit_value(&self, limit: LimitFunction, p: Vec3<Jet<R>>, a: Jet<R>) -> Jet<R> {
        let r2 = p.x * p.x + p.y * p.y;
        let c2 = (R::ONE + self.conic.value) * self.curvature.value;
        let minus_one = Jet::constant(-R::ONE);
        match limit {
            LimitFunction::Rim => {
                let half = R::from_f64(0.5);
                r2.scaled(half / self.rim2.value) - Jet::constant(half)
            }
            LimitFunction::Obstruction => {
                let half = R::from_f64(0.5);
                Jet::constant(half) - r2.scaled(half / self.obstruction2.value)
            }
            // Not of the surface alone: see `aperture_values`.
            LimitFunction::Aperture(_) => minus_one,
            LimitFunction::Angle => {
                let inverse = R::ONE / self.n2.value;
                let loss = self.index_drop2().value * inverse;
                let m = if loss > R::ZERO { self.normal_squared(p) } else { Jet::ZERO };
                m.scaled(loss) - (a * a).scaled(inverse)
            }
            LimitFunction::ConicEdge if self.form == SurfaceForm::Asphere => {
                r2.scaled(c2 * self.curvature.value) + minus_one
            }
            LimitFunction::ConicEdge => p.z.scaled(c2) + minus_one,
        }
    }
}

/// The limit function of a side of an aperture: minus the distance from it, whichever side of its line a ray
/// is on, in units of the extent of the apertures.
fn aperture_values<R: Real>(
    apertures: Option<&ApertureSet<Jet<R>>>,
    side: u16,
    block: &RayBlock<Jet<R>>,
    lanes: &mut [Jet<R>; BLOCK],
) {
    let Some(apertures) = apertures else { return };
    let scale = Jet::from_f64(1.0 / apertures.extent());
    for (j, lane) in lanes.iter_mut().enumerate() {
        let margin = apertures.margin(side, block.state(j).0) * scale;
        *lane = if margin < Jet::ZERO { margin } else { -margin };
    }
}

/// A block of rays that have arrived, each with its derivatives by two pupil coordinates, and the
/// derivatives with which their adjoint starts.
#[derive(Debug)]
pub struct JetBlock<R> {
    /// The x and y coordinates of the landings, in mm.
    pub landing: [[Jet<R>; LANES]; 2],
    /// The limit functions, negative for rays that pass.
    pub limits: Vec<[Jet<R>; LANES]>,
    /// The derivative of the result by x and y of the landings, to be filled in.
    pub by_landing: [[R; LANES]; 2],
    /// The derivative of the result by each limit function, to be filled in: by its value and by its
    /// two slopes.
    pub by_limit: Vec<[[R; 3]; LANES]>,
}

/// A system prepared for derivatives of integrals over the rays that get through it.
#[derive(Debug, Clone)]
pub struct WarpTracer<R> {
    forward: Tracer<Jet<R>>,
    backward: Tracer<MixedDual<R>>,
    /// The limit functions with the index of their surface, in the order of surfaces.
    limits: Vec<(usize, LimitFunction)>,
}

impl<R: Real> WarpTracer<R> {
    /// Prepares a system.
    ///
    /// # Errors
    /// A number that cannot be traced with (see [`System::check`]), or a GRIN medium, whose steps
    /// would have to carry second derivatives.
    pub fn new(system: &System<f64>) -> Result<Self, SystemError> {
        if let Some(surface) = system.surfaces.iter().position(|s| s.grin.is_some()) {
            let why =
                "has no warp field; expected the method `boundary` or `difference`".to_owned();
            return Err(SystemError::Grin { surface: surface.into(), why });
        }
        if let Some(surface) = system.surfaces.iter().position(crate::lens::Surface::is_mounted) {
            let hint = "; expected the method `boundary` or `difference`";
            return Err(SystemError::Posed {
                surface: surface.into(),
                what: "the warp field",
                hint,
            });
        }
        let forward = Tracer::new(&system.cast::<Jet<R>>())?;
        let kinds = [
            LimitFunction::Rim,
            LimitFunction::Obstruction,
            LimitFunction::Angle,
            LimitFunction::ConicEdge,
        ];
        let all = |i: usize| {
            let sides = forward.apertures.of(i).map_or(0, ApertureSet::sides);
            let apertures = (0..sides).map(|side| LimitFunction::Aperture(side as u16));
            kinds.into_iter().chain(apertures).map(move |limit| (i, limit)).collect::<Vec<_>>()
        };
        let limits = (0..forward.surfaces()).flat_map(all);
        let limits = limits.filter(|(i, limit)| forward.interfaces[*i].has(*limit)).collect();
        let mut backward = Tracer::<MixedDual<R>>::new(&system.cast())?;
        // The square of an infinite number has no slopes.
        backward.interfaces.iter_mut().for_each(|i| i.rim2 = MixedDual::from_f64(i.rim2.value()));
        Ok(Self { forward, backward, limits })
    }

    /// The number of surfaces, including the image plane.
    pub fn surfaces(&self) -> usize {
        self.forward.surfaces()
    }

    /// The derivative by every number of the system, for fixed rays, of a sum over the rays at the
    /// given points of the pupil; `fill` sets the derivatives of the sum by the landings of a block
    /// of rays and by their limit functions. All rays should arrive; lost rays do not contribute.
    pub fn gradient(
        &self,
        points: &[[R; 2]],
        ray: impl Fn([R; 2]) -> Ray<Jet<R>>,
        fill: impl Fn(&[[R; 2]; LANES], &mut JetBlock<R>),
    ) -> SystemGradient<R> {
        let mut gradient = SystemGradient::zero(self.surfaces());
        let mut workspace = WarpWorkspace::new(self);
        let width = SimdWidth::detect();
        for points in points.chunks(BLOCK) {
            let mut all = [points[0]; BLOCK];
            all[..points.len()].copy_from_slice(points);
            // Compiled apart: all in one is too large to be vectorized.
            let block = run_vectorized(
                width,
                #[inline(always)]
                || {
                    self.forward(
                        &mut workspace,
                        points.len(),
                        #[inline(always)]
                        |j| ray(all[j]),
                    )
                },
            );
            run_vectorized(
                width,
                #[inline(always)]
                || fill(&all, &mut workspace.jets),
            );
            run_vectorized(
                width,
                #[inline(always)]
                || {
                    workspace.distribute_limits(&self.limits);
                    let (block, sum) = (block.map(first_order), &mut MixedPart(&mut gradient));
                    self.backward.backward(
                        block,
                        &workspace.distances,
                        points.len(),
                        &workspace,
                        sum,
                    );
                },
            );
        }
        gradient
    }

    /// Traces a block and stores the limit functions and the distance to each surface.
    #[inline(always)]
    fn forward(
        &self,
        workspace: &mut WarpWorkspace<R>,
        count: usize,
        ray: impl Fn(usize) -> Ray<Jet<R>>,
    ) -> RayBlock<Jet<R>> {
        let mut block: RayBlock<_> = RayBlock::new();
        block.fill(self.forward.index_before, ray);
        // Rays that only fill up the block count as lost.
        block.code[count..].fill(Jet::ONE);
        let mut limits = self.limits.iter().zip(&mut workspace.jets.limits).peekable();
        for (i, interface) in self.forward.interfaces.iter().enumerate() {
            // Local, so that the compiler knows that it does not overlap the block.
            let mut crossings = [[Jet::ZERO; BLOCK]; 2];
            block.cross_with(
                interface,
                i as u32,
                #[inline(always)]
                |j, met| (crossings[0][j], crossings[1][j]) = (met.s, met.a),
            );
            let [distances, slants] = crossings;
            for (to, from) in workspace.distances[i].iter_mut().zip(&distances) {
                *to = first_order(*from);
            }
            while let Some(((_, limit), lanes)) = limits.next_if(|((surface, _), _)| *surface == i)
            {
                // Constant inside the loops, so that these have no branch.
                match limit {
                    LimitFunction::Rim => {
                        interface.limit_values(LimitFunction::Rim, &block, &slants, lanes);
                    }
                    LimitFunction::Obstruction => {
                        interface.limit_values(LimitFunction::Obstruction, &block, &slants, lanes);
                    }
                    LimitFunction::Angle => {
                        interface.limit_values(LimitFunction::Angle, &block, &slants, lanes);
                    }
                    LimitFunction::ConicEdge => {
                        interface.limit_values(LimitFunction::ConicEdge, &block, &slants, lanes);
                    }
                    LimitFunction::Aperture(side) => {
                        aperture_values(self.forward.apertures.of(i), *side, &block, lanes);
                    }
                }
            }
        }
        workspace.jets.landing = [block.x, block.y];
        block
    }
}

/// A jet without its second derivatives.
#[inline(always)]
fn first_order<R: Real>(jet: Jet<R>) -> MixedDual<R> {
    let [x, y] = jet.slope;
    Dual {
        value: Dual { value: jet.value, slope: [y] },
        slope: [Dual { value: x, slope: [R::ZERO] }],
    }
}

/// The derivatives by a jet as a number of the algebra.
#[inline(always)]
fn transposed<R: Real>([value, x, y]: [R; 3]) -> MixedDual<R> {
    Dual { value: Dual { value: R::ZERO, slope: [x] }, slope: [Dual { value: y, slope: [value] }] }
}

/// The buffers for a block, allocated once.
struct WarpWorkspace<R> {
    jets: JetBlock<R>,
    distances: Vec<[MixedDual<R>; BLOCK]>,
    limit_adjoints: Vec<LimitAdjoint<MixedDual<R>>>,
}

impl<R: Real> WarpWorkspace<R> {
    fn new(tracer: &WarpTracer<R>) -> Self {
        let (surfaces, limits) = (tracer.forward.surfaces(), tracer.limits.len());
        let zero = [Jet::ZERO; BLOCK];
        let jets = JetBlock {
            landing: [zero; 2],
            limits: vec![zero; limits],
            by_landing: [[R::ZERO; BLOCK]; 2],
            by_limit: vec![[[R::ZERO; 3]; BLOCK]; limits],
        };
        let distances = vec![[MixedDual::ZERO; BLOCK]; surfaces];
        let none = [MixedDual::ZERO; BLOCK];
        let limits = vec![
            LimitAdjoint {
                rim: none,
                angle: none,
                obstruction: None,
                conic_edge: None,
                apertures: Vec::new(),
            };
            surfaces
        ];
        Self { jets, distances, limit_adjoints: limits }
    }

    /// Moves the derivatives that were filled in to their surfaces.
    #[inline(always)]
    fn distribute_limits(&mut self, limits: &[(usize, LimitFunction)]) {
        for ((surface, limit), by_limit) in limits.iter().zip(&self.jets.by_limit) {
            let limits = &mut self.limit_adjoints[*surface];
            let lanes = match limit {
                LimitFunction::Rim => &mut limits.rim,
                LimitFunction::Obstruction => {
                    limits.obstruction.get_or_insert([MixedDual::ZERO; BLOCK])
                }
                LimitFunction::Angle => &mut limits.angle,
                LimitFunction::Aperture(side) => limits.side(*side),
                LimitFunction::ConicEdge => {
                    limits.conic_edge.get_or_insert([MixedDual::ZERO; BLOCK])
                }
            };
            for (derivative, by_limit) in lanes.iter_mut().zip(by_limit) {
                *derivative = transposed(*by_limit);
            }
        }
    }
}

impl<R: Real> SeedSource<MixedDual<R>> for WarpWorkspace<R> {
    #[inline(always)]
    fn seed(&self, j: usize) -> AdjointSeed<MixedDual<R>> {
        let by = |i: usize| transposed([self.jets.by_landing[i][j], R::ZERO, R::ZERO]);
        AdjointSeed { point: Vec3::new(by(0), by(1), MixedDual::ZERO), ..AdjointSeed::default() }
    }

    #[inline(always)]
    fn limit_adjoint(&self, surface: usize) -> Option<&LimitAdjoint<MixedDual<R>>> {
        Some(&self.limit_adjoints[surface])
    }
}

/// Adds the coefficients of εη to a gradient.
struct MixedPart<'a, R>(&'a mut SystemGradient<R>);

impl<R: Real> GradientSink<MixedDual<R>> for MixedPart<'_, R> {
    #[inline(always)]
    fn add_lanes(
        &mut self,
        surface: Option<usize>,
        slot: SurfaceParameter,
        lanes: &[MixedDual<R>; BLOCK],
    ) {
        let top = std::array::from_fn(|j| lanes[j].slope[0].slope[0]);
        self.0.add_lanes(surface, slot, &top);
    }
}
