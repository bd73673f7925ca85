//! The part of the edge of a pupil in the derivatives of the mean square spot.
//!
//! The mean of `h` over the rays of a pupil of area `A` changes where `h` does and where the edge moves:
//!
//! ```text
//! d⟨h⟩ = ⟨dh⟩ + 1/A Σ (h − ⟨h⟩) dA     dA = ∂A/∂M dM
//! ```
//!
//! The sum is over rays on the edge, each with the change `dA` of the area by its part of it, which
//! follows from the change of its margin `M` at the limit there (Reynolds' transport theorem, as in
//! `pupil::differentiate`). With `ε` the distance of a ray from the centroid of its field and `εᵢ` its
//! derivative by an error, the mean square `S = ⟨|ε|²⟩` has by that
//!
//! ```text
//! Sᵢ  gains  1/A Σ (|ε|² − ⟨|ε|²⟩) dAᵢ
//! ½ Sᵢⱼ  gains  Xᵢⱼ + Xⱼᵢ     Xᵢⱼ = 1/A Σ (ε·εᵢ − ⟨ε·εᵢ⟩) dAⱼ
//! ```
//!
//! to first order in the motion of the edge: its square, and what it does to compensators in the lens,
//! are left out.

use super::covariance::{MadeKind, MadeNumber};
use super::folded::{ErrorParity, FoldedField, RaySymmetry};
use super::pupils::{FieldPupils, ScenePupils, with_rims};
use super::sweep::SweptField;
use super::{NominalLens, ToleranceError, ToleranceScene, perturb};
use crate::lens::{Perturbation, PerturbationKind, System};
use crate::math::{Dual, dot};
use crate::pupil::EdgeRay;
use crate::trace::{ErrorNumber, Ray, Rays, Tracer};
use nalgebra::{DMatrix, DVector};
use rayon::prelude::*;
use std::ops::Range;

/// Numbers that margins are differentiated by at once.
const LANES: usize = 8;

type MarginDual = Dual<f64, LANES>;

/// The rays on the edges of the pupils of a field.
#[derive(Debug, Clone)]
pub(super) struct FieldEdge {
    pub(super) rays: Vec<EdgeRay>,
    /// The rays of each colour.
    colours: Vec<Range<usize>>,
    /// The distances from the centroid, x of all rays before y of all, and the slopes relative to their mean.
    offsets: DVector<f64>,
    slopes: DVector<f64>,
    /// A column for each number: the displacement relative to the mean over the pupils, and the change of
    /// the slopes.
    displacement: DMatrix<f64>,
    bend: DMatrix<f64>,
    /// A column for each number: the change of the area at each ray, relative to the area of its pupil and
    /// times the weight of that.
    motion: DMatrix<f64>,
}

/// The numbers of the lens, the planes to which rays are swept, and the means over a field to which its
/// edge is related.
pub(super) struct EdgeReference<'a> {
    pub(super) numbers: &'a [MadeNumber],
    /// The tracers to the image plane and to the other one, and their distance in mm.
    pub(super) planes: [&'a [Tracer<f64>]; 2],
    pub(super) distance: f64,
    /// For each number, along x and along y, the mean effect at both planes.
    pub(super) means: &'a [[[f64; 2]; 2]],
    /// The mean point and slopes of the field.
    pub(super) center: [f64; 4],
}

impl FieldEdge {
    /// The edge of a field, whose motion is not known yet; `None` if a ray there does not arrive.
    pub(super) fn at_rest(
        scene: &ToleranceScene,
        pupils: &FieldPupils,
        reference: &EdgeReference<'_>,
    ) -> Option<Self> {
        let (mut rays, mut colours, mut traced) = (Vec::new(), Vec::new(), Vec::new());
        for pupil in &pupils.colours {
            let start = rays.len();
            rays.extend_from_slice(&pupil.edge);
            colours.push(start..rays.len());
            let own: Rays<f64> = pupil.edge.iter().map(|edge| edge.ray).collect();
            traced.push((pupil.wavelength, own));
        }
        let [near, far] =
            reference.planes.map(|tracers| SweptField::of_rays(scene, tracers, &traced).ok());
        let (near, far) = (near?, far?);
        let (count, numbers) = (rays.len(), reference.numbers);
        let both = |of: [&[f64]; 2], center: [f64; 2]| {
            let along = |axis: usize| of[axis].iter().map(move |value| value - center[axis]);
            DVector::from_iterator(2 * count, along(0).chain(along(1)))
        };
        let [x, y, u, v] = reference.center;
        let mut edge = Self {
            offsets: both(near.offsets(), [x, y]),
            slopes: both(near.slopes(), [u, v]),
            displacement: DMatrix::zeros(2 * count, numbers.len()),
            bend: DMatrix::zeros(2 * count, numbers.len()),
            motion: DMatrix::zeros(count, numbers.len()),
            rays,
            colours,
        };
        let mut rows = [vec![0.0; count], vec![0.0; count]];
        for (m, axis) in (0..numbers.len()).flat_map(|m| [(m, 0), (m, 1)]) {
            near.number_effect(axis, numbers[m], &mut rows[0]);
            far.number_effect(axis, numbers[m], &mut rows[1]);
            let [at_near, at_far] = reference.means[m][axis];
            for (k, (near, far)) in rows[0].iter().zip(&rows[1]).enumerate() {
                let by = [near - at_near, far - at_far];
                edge.displacement[(axis * count + k, m)] = by[0];
                edge.bend[(axis * count + k, m)] = (by[1] - by[0]) / reference.distance;
            }
        }
        let is_finite = edge.offsets.iter().chain(edge.bend.iter()).all(|value| value.is_finite());
        is_finite.then_some(edge)
    }

    /// Sets the motion of some rays by the numbers of a part from the slopes of their margins, times a weight.
    fn set_motion(
        &mut self,
        rays: Range<usize>,
        weight: f64,
        part: &[usize],
        slopes: &[[f64; LANES]],
    ) {
        for k in rays {
            let factor = weight * self.rays[k].by_margin;
            for (number, slope) in part.iter().zip(&slopes[k]) {
                self.motion[(k, *number)] = factor * slope;
            }
        }
    }

    /// The products of x and of y of each ray with those of other numbers of it, summed.
    fn product(&self, a: &[f64], b: &[f64], ray: usize) -> f64 {
        let count = self.rays.len();
        a[ray] * b[ray] + a[count + ray] * b[count + ray]
    }
}

/// Sets the motion of the edges of all fields by each number; false if it is not known.
///
/// # Errors
/// A lens that cannot be traced.
pub(super) fn set_motions(
    scene: &ToleranceScene,
    pupils: &ScenePupils,
    folded: &[FoldedField<'_>],
    numbers: &[MadeNumber],
    edges: &mut [FieldEdge],
) -> Result<bool, ToleranceError> {
    let parts = parts_of(numbers);
    let of_part = |part: &Vec<usize>| {
        let own: Vec<MadeNumber> = part.iter().map(|i| numbers[*i]).collect();
        let first = own.iter().map(|number| number.surface).min().unwrap_or(0);
        let systems = with_rims(&scene.lens, with_variables(&scene.lens, &own)?);
        let tracers = systems.iter().map(Tracer::new).collect::<Result<Vec<_>, _>>()?;
        let fields = pupils.fields.iter().zip(&*edges);
        let slopes = fields.map(|(own, edge)| margin_slopes(own, edge, (&tracers, first)));
        Ok(slopes.collect::<Vec<_>>())
    };
    let slopes: Result<Vec<_>, ToleranceError> = parts.par_iter().map(of_part).collect();
    for (part, of_fields) in parts.iter().zip(slopes?) {
        for (field, slopes) in of_fields.into_iter().enumerate() {
            let (edge, own) = (&mut edges[field], &pupils.fields[field]);
            for (colour, pupil) in own.colours.iter().enumerate() {
                let weight = folded[field].weight * pupil.share / pupil.area;
                edge.set_motion(edge.colours[colour].clone(), weight, part, &slopes);
            }
        }
    }
    Ok(edges.iter().all(|edge| edge.motion.iter().all(|value| value.is_finite())))
}

/// The places of numbers that are differentiated by together: those that leave the surfaces centred and even
/// by themselves, since only these are traced in blocks.
fn parts_of(numbers: &[MadeNumber]) -> Vec<Vec<usize>> {
    let is_placed = |number: &MadeNumber| {
        number.kind.is_lateral() || number.kind == MadeKind::Number(ErrorNumber::Astigmatism)
    };
    let (placed, centred): (Vec<usize>, Vec<usize>) =
        (0..numbers.len()).partition(|i| is_placed(&numbers[*i]));
    let parts = centred.chunks(LANES).chain(placed.chunks(LANES));
    parts.map(<[usize]>::to_vec).collect()
}

/// The derivatives of the margin of each ray on the edges of a field, at its limit, by the numbers that
/// are variables of these tracers, of surfaces from `first` on: zero at limits in front of it.
fn margin_slopes(
    pupils: &FieldPupils,
    edge: &FieldEdge,
    (tracers, first): (&[Tracer<MarginDual>], usize),
) -> Vec<[f64; LANES]> {
    let mut slopes = Vec::with_capacity(edge.rays.len());
    for (range, pupil) in edge.colours.iter().zip(&pupils.colours) {
        let own = &edge.rays[range.clone()];
        for group in own.chunk_by(|a, b| (a.surface, a.limit) == (b.surface, b.limit)) {
            let EdgeRay { surface, limit, .. } = group[0];
            if surface < first {
                slopes.extend(group.iter().map(|_| [0.0; LANES]));
                continue;
            }
            let rays: Rays<MarginDual> = group.iter().map(|own| cast(own.ray)).collect();
            let margins = tracers[pupil.wavelength].margins_at(&rays, surface, limit);
            slopes.extend(margins.into_iter().map(|margin| margin.slope));
        }
    }
    slopes
}

fn cast(ray: Ray<f64>) -> Ray<MarginDual> {
    ray.cast()
}

/// The lens at each wavelength with some of its numbers as variables.
fn with_variables(
    lens: &NominalLens,
    numbers: &[MadeNumber],
) -> Result<Vec<System<MarginDual>>, ToleranceError> {
    let variable = |lane: usize| MarginDual::variable(0.0, lane);
    let errors = numbers.iter().enumerate();
    let errors: Vec<_> =
        errors.filter_map(|(lane, own)| Some((perturbation_of(*own)?, variable(lane)))).collect();
    let mut systems = perturb(lens, &errors)?;
    for (lane, MadeNumber { surface, kind }) in numbers.iter().enumerate() {
        if *kind == MadeKind::Number(ErrorNumber::Astigmatism) {
            for system in &mut systems {
                let own = &mut system.surfaces[*surface];
                // An asphere has the crossing that finds the term.
                own.shape = own.shape.as_asphere();
                own.astigmatism = Some(own.astigmatism.unwrap_or_default() + variable(lane));
            }
        }
    }
    Ok(systems)
}

/// The error of making that changes a number alone; `None` if there is none.
fn perturbation_of(MadeNumber { surface, kind }: MadeNumber) -> Option<Perturbation> {
    let kind = match kind {
        MadeKind::Abbe => PerturbationKind::Abbe,
        MadeKind::Number(number) => match number {
            ErrorNumber::Curvature => PerturbationKind::Curvature,
            ErrorNumber::Conic => PerturbationKind::Conic,
            ErrorNumber::Fourth => PerturbationKind::Asphere,
            ErrorNumber::Astigmatism => return None,
            ErrorNumber::Thickness => PerturbationKind::Thickness,
            ErrorNumber::Index => PerturbationKind::Index,
            ErrorNumber::DecenterX => PerturbationKind::SurfaceDecenterX,
            ErrorNumber::DecenterY => PerturbationKind::SurfaceDecenterY,
            ErrorNumber::TiltX => PerturbationKind::SurfaceTiltX,
            ErrorNumber::TiltY => PerturbationKind::SurfaceTiltY,
        },
    };
    Some(Perturbation::of_surface(kind, surface))
}

/// The rays inside the pupils of a field: distances from the centroid, times the roots of weights.
pub(super) struct InnerRays<'a> {
    pub(super) symmetry: RaySymmetry,
    pub(super) parities: &'a [ErrorParity],
    /// The rays of each colour, and the roots of the weights of all rays.
    pub(super) colours: &'a [Range<usize>],
    pub(super) roots: &'a [f64],
    pub(super) offsets: &'a DVector<f64>,
    pub(super) slopes: &'a DVector<f64>,
}

impl InnerRays<'_> {
    /// The mean product over a colour of two numbers of each ray.
    fn mean(&self, colour: usize, a: &[f64], b: &[f64]) -> f64 {
        let count = self.roots.len();
        let range = self.colours[colour].clone();
        let roots = &self.roots[range.clone()];
        let weight = dot(roots, roots);
        let along = |from: usize| {
            let own = from + range.start..from + range.end;
            dot(&a[own.clone()], &b[own])
        };
        (along(0) + along(count)) / weight.max(f64::MIN_POSITIVE)
    }

    /// The same of distances and these displacements by a number, which cancel where that is odd.
    fn mean_by(&self, colour: usize, number: usize, displacement: &[f64]) -> f64 {
        if self.symmetry.mirrored && self.parities[number].odd {
            return 0.0;
        }
        self.mean(colour, self.offsets.as_slice(), displacement)
    }

    /// True if the sum over the edge vanishes for an even quantity and the motion by a number.
    fn cancels(&self, number: usize) -> bool {
        self.symmetry.cancels_product(self.parities[number], ErrorParity::EVEN)
    }
}

/// The addition to mean products by the motion of edges.
#[derive(Debug, Clone)]
pub(super) struct EdgeProducts {
    /// To those of displacements with distances, and with slopes.
    pub(super) with_offsets: DVector<f64>,
    pub(super) with_slopes: DVector<f64>,
    /// To those of two displacements.
    pub(super) among: DMatrix<f64>,
}

impl EdgeProducts {
    pub(super) fn none(numbers: usize) -> Self {
        Self {
            with_offsets: DVector::zeros(numbers),
            with_slopes: DVector::zeros(numbers),
            among: DMatrix::zeros(numbers, numbers),
        }
    }

    /// Adds the edge of a field at an image plane that is displaced by `shift`, where its inner rays are and have
    /// these displacements by each number.
    pub(super) fn add(
        &mut self,
        edge: &FieldEdge,
        inner: &InnerRays<'_>,
        shift: f64,
        displacements: &[&[f64]],
    ) {
        let (squares, slopes) = edge.differences(inner, shift);
        let displaced = &edge.displacement + shift * &edge.bend;
        let offsets = &edge.offsets + shift * &edge.slopes;
        let numbers = displaced.ncols();
        let mut by = DMatrix::zeros(edge.rays.len(), numbers);
        for m in 0..numbers {
            let column = displaced.column(m);
            for (colour, range) in edge.colours.iter().enumerate() {
                let mean = inner.mean_by(colour, m, displacements[m]);
                for k in range.clone() {
                    by[(k, m)] = edge.product(offsets.as_slice(), column.as_slice(), k) - mean;
                }
            }
        }
        let cross = by.transpose() * &edge.motion;
        for i in 0..numbers {
            let motion = edge.motion.column(i);
            if !inner.cancels(i) {
                self.with_offsets[i] += 0.5 * squares.dot(&motion);
                self.with_slopes[i] += slopes.dot(&motion);
            }
            for j in 0..numbers {
                if !inner.symmetry.cancels_product(inner.parities[i], inner.parities[j]) {
                    self.among[(i, j)] += cross[(i, j)] + cross[(j, i)];
                }
            }
        }
    }
}

impl FieldEdge {
    /// At each ray the square of the distance less its mean over the pupil, and the product of distance
    /// and slope less its mean.
    fn differences(&self, inner: &InnerRays<'_>, shift: f64) -> (DVector<f64>, DVector<f64>) {
        let offsets = &self.offsets + shift * &self.slopes;
        let count = self.rays.len();
        let (mut squares, mut slopes) = (DVector::zeros(count), DVector::zeros(count));
        let (inside, inner_slopes) = (inner.offsets.as_slice(), inner.slopes.as_slice());
        for (colour, range) in self.colours.iter().enumerate() {
            let means =
                [inner.mean(colour, inside, inside), inner.mean(colour, inside, inner_slopes)];
            for k in range.clone() {
                let own = offsets.as_slice();
                squares[k] = self.product(own, own, k) - means[0];
                slopes[k] = self.product(own, self.slopes.as_slice(), k) - means[1];
            }
        }
        (squares, slopes)
    }

    /// The light that comes or goes at the edge by one unit of an error that changes these numbers.
    pub(super) fn moved_light(&self, combination: &[(usize, f64)]) -> f64 {
        let at = |k: usize| {
            let parts = combination.iter().map(|(m, by)| by * self.motion[(k, *m)]);
            parts.sum::<f64>().abs()
        };
        (0..self.rays.len()).map(at).sum()
    }

    /// For each limit of the edge a ray there, and the derivatives of the mean square spot by the numbers
    /// of the lens through that part of the edge alone.
    pub(super) fn by_limit(
        &self,
        inner: &InnerRays<'_>,
        shift: f64,
    ) -> Vec<(EdgeRay, DVector<f64>)> {
        let (squares, _) = self.differences(inner, shift);
        let mut found: Vec<(EdgeRay, DVector<f64>)> = Vec::new();
        for (k, ray) in self.rays.iter().enumerate() {
            let by = squares[k] * self.motion.row(k).transpose();
            let same =
                |own: &&mut (EdgeRay, _)| (own.0.surface, own.0.limit) == (ray.surface, ray.limit);
            match found.iter_mut().find(same) {
                Some((_, sum)) => *sum += by,
                None => found.push((*ray, by)),
            }
        }
        found
    }
}
