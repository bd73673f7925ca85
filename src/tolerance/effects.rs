//! The effects of errors of making on each ray, in as many rows of numbers as the lens is large.
//!
//! To first order an error is a combination of few numbers of surfaces. One sweep of the rays back
//! through the lens gives their derivatives by all of these, a second one to another image plane those
//! of their slopes: neither the rays nor the memory grow with the number of errors. A lens without such
//! a sweep (GRIN media, surfaces that are decentred, tilted or irregular by design) is traced over
//! second-order jets, once for each different error.

use super::compensation::Compensation;
use super::covariance::{MadeNumber, NumberChanges, number_changes};
use super::folded::{ErrorParity, FoldedField, RaySymmetry, folded_fields};
use super::merits::{ImageRays, Rear, merits_of, open_tracers};
use super::perturb::check_all;
use super::pupil_edge::{EdgeProducts, EdgeReference, FieldEdge, InnerRays, set_motions};
use super::pupils::{FieldPupils, PupilTreatment, ScenePupils};
use super::sensitivity::{RaySensitivity, Sensitivity, second_derivatives, sensitivities_until};
use super::sweep::SweptField;
use super::two_planes::TwoPlanes;
use super::{SpotMoments, StopTest, ToleranceError, ToleranceScene, refuse_if_stopped};
use crate::lens::Perturbation;
use crate::math::dot;
use crate::pupil::EdgeRay;
use crate::trace::Tracer;
use nalgebra::{DMatrix, DMatrixView, DVector};
use rayon::prelude::*;
use std::collections::BTreeMap;
use std::ops::Range;
use std::sync::Arc;

/// The treatment of the second derivatives of rays by errors.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum SecondDerivatives {
    /// Left out where the lens has a sweep back: the expected mean square spot misses some
    /// 1e-4 of itself, refocused some 1e-3.
    #[default]
    Neglected,
    /// Traced, by one more pass for each different error.
    Traced,
}

/// The errors of a lens as combinations of few numbers: for each error the places of its numbers and
/// their changes by one unit.
pub(super) type ErrorCombinations = Arc<[Vec<(usize, f64)>]>;

/// The effects of errors of making on the rays of a lens.
#[derive(Debug, Clone)]
pub struct RayEffects {
    fields: Vec<FieldEffects>,
    /// The parity of each number.
    parities: Vec<ErrorParity>,
    combinations: ErrorCombinations,
    /// The best common focus of the lens as designed, in mm from its image plane.
    focus: f64,
    /// The second derivatives of the moments of the mean spot by each error, per squared unit; `None` where they are
    /// left out.
    second: Option<Vec<SpotMoments<f64>>>,
}

/// The effects on the rays of one field, x of all rays before y of all, times the roots of their weights
/// and relative to their means.
#[derive(Debug, Clone)]
struct FieldEffects {
    symmetry: RaySymmetry,
    /// The place of each ray among those of all fields, and the root of its weight.
    places: Vec<(usize, f64)>,
    /// The rays of each colour, by their numbers among those of the field.
    colours: Vec<Range<usize>>,
    roots: Vec<f64>,
    /// The mean point and slopes.
    center: [f64; 4],
    offsets: DVector<f64>,
    slopes: DVector<f64>,
    /// A column for each number: the displacement of rays at the image plane.
    displacement: DMatrix<f64>,
    /// The change of their slopes.
    bend: DMatrix<f64>,
    /// The mean effects of numbers, where they come from a sweep back.
    means: NumberMeans,
    /// The edge of the pupils; `None` where these are held.
    edge: Option<FieldEdge>,
}

impl RayEffects {
    /// The effects of some errors.
    ///
    /// # Errors
    /// An error that is not possible, a ray that does not arrive, and [`ToleranceError::Stopped`] once
    /// `stop` says so.
    pub fn new(
        scene: &ToleranceScene,
        errors: &[Perturbation],
        second: SecondDerivatives,
        stop: StopTest<'_>,
    ) -> Result<Self, ToleranceError> {
        let lens = &scene.lens;
        check_all(lens, errors.iter().copied())?;
        let systems = &lens.systems;
        let image = systems[lens.primary].vertex_positions().last().copied().unwrap_or_default();
        let (merits, rays) = merits_of(&Rear { systems, image }, &scene.beam, scene.options)?;
        let focus = merits.focus;
        let (different, place_of) = different_errors(errors);
        if open_tracers(systems)?.iter().all(Tracer::has_error_slopes) {
            let mut effects = Self::swept(scene, errors, (&rays, focus), stop)?;
            if second == SecondDerivatives::Traced {
                let exact = second_derivatives(scene, &different, stop)?;
                effects.second = Some(place_of.iter().map(|place| exact[*place]).collect());
            }
            return Ok(effects);
        }
        let found = sensitivities_until(lens, &scene.beam, scene.options, &different, stop)?;
        Ok(Self::by_jets(scene, (&found, &place_of), (&rays, focus)))
    }

    /// The same with the edges of the pupils, which move; without them where they are not known.
    ///
    /// # Errors
    /// As those of [`RayEffects::new`].
    pub fn with_moving_pupils(
        scene: &ToleranceScene,
        errors: &[Perturbation],
        second: SecondDerivatives,
        stop: StopTest<'_>,
    ) -> Result<Self, ToleranceError> {
        let mut effects = Self::new(scene, errors, second, stop)?;
        let PupilTreatment::Known(pupils) = &scene.pupils else { return Ok(effects) };
        let systems = &scene.lens.systems;
        if open_tracers(systems)?.iter().all(Tracer::has_error_slopes) {
            refuse_if_stopped(stop)?;
            let (numbers, _) = combinations(scene, errors);
            if let Some(edges) = effects.edges(scene, pupils, &numbers)? {
                let fields = effects.fields.iter_mut().zip(edges);
                fields.for_each(|(field, edge)| field.edge = Some(edge));
            }
        }
        Ok(effects)
    }

    /// The edges of all fields; `None` where a ray on one of them does not arrive.
    fn edges(
        &self,
        scene: &ToleranceScene,
        pupils: &ScenePupils,
        numbers: &[MadeNumber],
    ) -> Result<Option<Vec<FieldEdge>>, ToleranceError> {
        let folded = folded_fields(scene);
        let same = |(own, field): (&FoldedField<'_>, &FieldPupils)| own.number == field.first;
        if folded.len() != pupils.fields.len() || !folded.iter().zip(&pupils.fields).all(same) {
            return Ok(None);
        }
        let planes = TwoPlanes::new(scene, self.focus)?;
        let mut edges = Vec::with_capacity(folded.len());
        for (pupils, field) in pupils.fields.iter().zip(&self.fields) {
            let reference = EdgeReference {
                numbers,
                planes: [&planes.near, &planes.far],
                distance: planes.distance,
                means: &field.means,
                center: field.center,
            };
            let Some(edge) = FieldEdge::at_rest(scene, pupils, &reference) else {
                return Ok(None);
            };
            edges.push(edge);
        }
        let known = set_motions(scene, pupils, &folded, numbers, &mut edges)?;
        Ok(known.then_some(edges))
    }

    /// True if the edges of the pupils are a part of the effects.
    pub fn has_moving_pupils(&self) -> bool {
        self.fields.iter().all(|field| field.edge.is_some())
    }

    /// The share of the light that each error moves by one unit at the edges of pupils, whether it comes or goes.
    pub(super) fn moved_light(&self) -> Vec<f64> {
        let mut moved = vec![0.0; self.combinations.len()];
        for edge in self.fields.iter().filter_map(|field| field.edge.as_ref()) {
            for (sum, combination) in moved.iter_mut().zip(self.combinations.iter()) {
                *sum += edge.moved_light(combination);
            }
        }
        moved
    }

    /// For each field the limits of its edge, each with a ray there and the derivatives of the mean square
    /// spot by errors through that part of the edge, at the best focus.
    pub(super) fn edges_by_limit(&self) -> Vec<Vec<(EdgeRay, Vec<f64>)>> {
        let field = |field: &FieldEffects| {
            let Some(edge) = &field.edge else { return Vec::new() };
            let offsets = &field.offsets + self.focus * &field.slopes;
            let found = edge.by_limit(&field.inner(&self.parities, &offsets), self.focus);
            let by_errors = |(ray, by): (EdgeRay, DVector<f64>)| {
                let sum = |row: &Vec<(usize, f64)>| row.iter().map(|(m, f)| f * by[*m]).sum();
                (ray, self.combinations.iter().map(sum).collect())
            };
            found.into_iter().map(by_errors).collect()
        };
        self.fields.iter().map(field).collect()
    }

    /// By sweeps back.
    fn swept(
        scene: &ToleranceScene,
        errors: &[Perturbation],
        (rays, focus): (&ImageRays<f64>, f64),
        stop: StopTest<'_>,
    ) -> Result<Self, ToleranceError> {
        let (numbers, combinations) = combinations(scene, errors);
        let parity = |number: &MadeNumber| ErrorParity {
            odd: number.kind.is_odd(),
            lateral: number.kind.is_lateral(),
        };
        let parities: Vec<ErrorParity> = numbers.iter().map(parity).collect();
        let planes = TwoPlanes::new(scene, focus)?;
        let folded = folded_fields(scene);
        let field = |folded: &FoldedField<'_>| {
            refuse_if_stopped(stop)?;
            let mut field = FieldEffects::without_errors(scene, folded, rays);
            let (columns, means) = planes.columns(scene, folded, (&numbers, &parities))?;
            (field.displacement, field.bend) = columns;
            field.means = means;
            Ok(field)
        };
        let fields = folded.par_iter().map(field).collect::<Result<_, ToleranceError>>()?;
        Ok(Self { fields, parities, combinations, focus, second: None })
    }

    /// From the sensitivities to different errors, and the place of each error among these.
    fn by_jets(
        scene: &ToleranceScene,
        (found, place_of): (&[Sensitivity], &[usize]),
        (rays, focus): (&ImageRays<f64>, f64),
    ) -> Self {
        let field = |folded: &FoldedField<'_>| {
            let mut field = FieldEffects::without_errors(scene, folded, rays);
            let columns = |of: fn(&RaySensitivity) -> [f64; 2]| {
                let columns: Vec<_> = found.iter().map(|own| field.column(&own.rays, of)).collect();
                from_columns(2 * field.places.len(), &columns)
            };
            let both = (columns(|ray| ray.displacement), columns(|ray| ray.bend));
            (field.displacement, field.bend) = both;
            field
        };
        let exact: Vec<_> = found.iter().map(Sensitivity::second_moments).collect();
        Self {
            fields: folded_fields(scene).iter().map(field).collect(),
            parities: found.iter().map(|own| ErrorParity::of(own.error.kind)).collect(),
            combinations: place_of.iter().map(|place| vec![(*place, 1.0)]).collect(),
            focus,
            second: Some(place_of.iter().map(|place| exact[*place]).collect()),
        }
    }

    /// The number of errors.
    pub fn errors(&self) -> usize {
        self.combinations.len()
    }

    /// True if the second derivatives of rays by errors are traced.
    pub fn has_second_derivatives(&self) -> bool {
        self.second.is_some()
    }

    pub(super) fn combinations(&self) -> &ErrorCombinations {
        &self.combinations
    }

    pub(super) fn numbers(&self) -> usize {
        self.parities.len()
    }

    pub(super) fn focus(&self) -> f64 {
        self.focus
    }

    /// The second derivatives of the mean square at an image plane that is displaced by `shift`.
    pub(super) fn second(&self, shift: f64) -> Option<Vec<f64>> {
        Some(self.second.as_ref()?.iter().map(|moments| moments.at(shift)).collect())
    }

    /// The mean products at an image plane that is displaced by `shift`.
    pub(super) fn products(&self, compensation: &Compensation, shift: f64) -> EffectProducts {
        let mut parities = self.parities.clone();
        parities.extend(compensation.effects.iter().map(|effect| effect.parity));
        parities.extend([ErrorParity::EVEN; 2]);
        let mut sum = EffectProducts {
            products: DMatrix::zeros(parities.len(), parities.len()),
            bends_with_offsets: DVector::zeros(self.numbers()),
            edge: EdgeProducts::none(self.numbers()),
        };
        for field in &self.fields {
            sum.add(field, (&parities, compensation), shift);
        }
        sum
    }
}

/// The errors without repetition, and for each error its place among these.
pub(super) fn different_errors(errors: &[Perturbation]) -> (Vec<Perturbation>, Vec<usize>) {
    let (mut places, mut different) = (BTreeMap::new(), Vec::new());
    let place = |error: &Perturbation| {
        *places.entry(*error).or_insert_with(|| {
            different.push(*error);
            different.len() - 1
        })
    };
    let place_of = errors.iter().map(place).collect();
    (different, place_of)
}

/// The numbers that errors change, in order, and the errors as combinations of them.
pub(super) fn combinations(
    scene: &ToleranceScene,
    errors: &[Perturbation],
) -> (Vec<MadeNumber>, ErrorCombinations) {
    let lens = &scene.lens;
    let primary = &lens.systems[lens.primary];
    let vertices = primary.vertex_positions();
    let of = |error: &Perturbation| {
        let NumberChanges { changes, .. } =
            number_changes(*error, primary, &vertices, &lens.semi_diameters);
        changes
    };
    let changes: Vec<_> = errors.iter().map(of).collect();
    let mut numbers: Vec<MadeNumber> =
        changes.iter().flatten().map(|(number, _)| *number).collect();
    numbers.sort_unstable();
    numbers.dedup();
    let place = |(number, by): (MadeNumber, f64)| Some((numbers.binary_search(&number).ok()?, by));
    let row = |changes: Vec<(MadeNumber, f64)>| changes.into_iter().filter_map(place).collect();
    let combinations = changes.into_iter().map(row).collect();
    (numbers, combinations)
}

fn from_columns(rows: usize, columns: &[DVector<f64>]) -> DMatrix<f64> {
    if columns.is_empty() { DMatrix::zeros(rows, 0) } else { DMatrix::from_columns(columns) }
}

impl TwoPlanes {
    /// The displacements and the bends by each number, a column each, and the mean effects.
    fn columns(
        &self,
        scene: &ToleranceScene,
        folded: &FoldedField<'_>,
        (numbers, parities): (&[MadeNumber], &[ErrorParity]),
    ) -> Result<(NumberColumns, NumberMeans), ToleranceError> {
        let near = SweptField::new(scene, &self.near, folded)?;
        let far = SweptField::new(scene, &self.far, folded)?;
        let rays = near.weights().len();
        let mut displacement = DMatrix::zeros(2 * rays, numbers.len());
        let mut bend = DMatrix::zeros(2 * rays, numbers.len());
        let roots: Vec<f64> = near.weights().iter().map(|w| (w * folded.weight).sqrt()).collect();
        let mut rows = [vec![0.0; rays], vec![0.0; rays]];
        let mut means = vec![[[0.0; 2]; 2]; numbers.len()];
        let columns = numbers.iter().zip(parities).enumerate();
        for (m, number, parity, axis) in
            columns.flat_map(|(m, (number, parity))| [0, 1].map(|axis| (m, *number, *parity, axis)))
        {
            let cancels = folded.symmetry.cancels_mean(axis, parity);
            means[m][axis] = [
                centred_effect(&near, (axis, number), cancels, &mut rows[0]),
                centred_effect(&far, (axis, number), cancels, &mut rows[1]),
            ];
            let own = (2 * m + axis) * rays..(2 * m + axis + 1) * rays;
            let displacement = &mut displacement.as_mut_slice()[own.clone()];
            let bend = &mut bend.as_mut_slice()[own];
            let both = displacement.iter_mut().zip(bend).zip(&roots);
            for (((displacement, bend), root), (near, far)) in
                both.zip(rows[0].iter().zip(&rows[1]))
            {
                *displacement = root * near;
                *bend = root * (far - near) / self.distance;
            }
        }
        Ok(((displacement, bend), means))
    }
}

/// The displacements and the bends of rays, a column for each number.
type NumberColumns = (DMatrix<f64>, DMatrix<f64>);

/// For each number, along x and along y, the mean effect at the image plane and at the other one.
type NumberMeans = Vec<[[f64; 2]; 2]>;

/// The derivative of x or y of each ray by a number, relative to its mean, which is 0 where it cancels; the
/// mean is returned.
fn centred_effect(
    swept: &SweptField,
    (axis, number): (usize, MadeNumber),
    cancels: bool,
    effect: &mut [f64],
) -> f64 {
    swept.number_effect(axis, number, effect);
    let mean = if cancels { 0.0 } else { dot(swept.weights(), effect) };
    effect.iter_mut().for_each(|value| *value -= mean);
    mean
}

impl FieldEffects {
    /// The rays of a field with their offsets from the centroid and their slopes.
    fn without_errors(
        scene: &ToleranceScene,
        folded: &FoldedField<'_>,
        rays: &ImageRays<f64>,
    ) -> Self {
        let before = scene.beam.fields[..folded.number].iter().flat_map(|field| &field.colours);
        let start: usize = before.map(|colour| colour.rays.len()).sum();
        let own = &rays[folded.number];
        let mut mean = [0.0; 4];
        for (ray, weight) in own {
            mean.iter_mut().zip(ray).for_each(|(sum, value)| *sum += weight * value);
        }
        let (mut places, mut from, mut colours) = (Vec::new(), 0, Vec::new());
        for colour in &folded.field.colours {
            let (own, first) = (folded.rays(colour), places.len());
            places.extend(own.map(|(i, weight)| (from + i, (weight * folded.weight).sqrt())));
            colours.push(first..places.len());
            from += colour.rays.len();
        }
        let column = |first: usize| {
            let axis = |axis: usize| {
                let of = move |(i, root): &(usize, f64)| {
                    root * (own[*i].0[first + axis] - mean[first + axis])
                };
                places.iter().map(of)
            };
            DVector::from_iterator(2 * places.len(), axis(0).chain(axis(1)))
        };
        let (offsets, slopes) = (column(0), column(2));
        let none = DMatrix::zeros(2 * places.len(), 0);
        let roots = places.iter().map(|(_, root)| *root).collect();
        Self {
            symmetry: folded.symmetry,
            places: places.iter().map(|(i, root)| (start + i, *root)).collect(),
            colours,
            roots,
            center: mean,
            offsets,
            slopes,
            displacement: none.clone(),
            bend: none,
            means: Vec::new(),
            edge: None,
        }
    }

    /// The rays inside the pupils at an image plane where they have these distances from the centroid.
    fn inner<'a>(
        &'a self,
        parities: &'a [ErrorParity],
        offsets: &'a DVector<f64>,
    ) -> InnerRays<'a> {
        InnerRays {
            symmetry: self.symmetry,
            parities,
            colours: &self.colours,
            roots: &self.roots,
            offsets,
            slopes: &self.slopes,
        }
    }

    /// All effects at an image plane that is displaced by `shift`, where the rays have these distances from the
    /// centroid: those of numbers, of compensators besides focus, the slopes, and the distances.
    fn displaced(
        &self,
        (parities, compensation): (&[ErrorParity], &Compensation),
        shift: f64,
        offsets: &DVector<f64>,
    ) -> DisplacedEffects {
        let (order, classes) = classes_of(parities, self.symmetry);
        let (numbers, last) = (self.displacement.ncols(), parities.len() - 1);
        let mut values = Vec::with_capacity(self.offsets.len() * parities.len());
        for number in &order {
            match *number {
                number if number == last => values.extend_from_slice(offsets.as_slice()),
                number if number + 1 == last => values.extend_from_slice(self.slopes.as_slice()),
                number if number < numbers => {
                    let rows = number * self.offsets.len()..(number + 1) * self.offsets.len();
                    let bend = &self.bend.as_slice()[rows.clone()];
                    let both = self.displacement.as_slice()[rows].iter().zip(bend);
                    values.extend(both.map(|(displacement, bend)| displacement + shift * bend));
                }
                number => {
                    let rays = &compensation.effects[number - numbers].rays;
                    let displacement = self.column(rays, |ray| ray.displacement);
                    let bend = self.column(rays, |ray| ray.bend);
                    values.extend_from_slice((displacement + shift * bend).as_slice());
                }
            }
        }
        DisplacedEffects { order, classes, values }
    }

    /// The column of an effect that is known for all rays of all fields.
    fn column(&self, rays: &[RaySensitivity], of: fn(&RaySensitivity) -> [f64; 2]) -> DVector<f64> {
        let axis = |axis: usize| {
            self.places.iter().map(move |(place, root)| root * of(&rays[*place])[axis])
        };
        DVector::from_iterator(2 * self.places.len(), axis(0).chain(axis(1)))
    }
}

/// The effects on the rays of a field, in classes of which the products do not cancel.
struct DisplacedEffects {
    /// The effects in the order of their columns.
    order: Vec<usize>,
    /// The columns of each class.
    classes: Vec<Range<usize>>,
    /// The columns one after the other.
    values: Vec<f64>,
}

/// Effects of these parities in an order in which those of a class follow each other, and the classes: products
/// with another class cancel.
fn classes_of(parities: &[ErrorParity], symmetry: RaySymmetry) -> (Vec<usize>, Vec<Range<usize>>) {
    let (mut order, mut classes) = (Vec::with_capacity(parities.len()), Vec::new());
    let mut rest: Vec<usize> = (0..parities.len()).collect();
    while let Some(first) = rest.first() {
        let first = parities[*first];
        let cancels = |i: &usize| symmetry.cancels_product(first, parities[*i]);
        let (others, class): (Vec<usize>, Vec<usize>) = rest.iter().partition(|i| cancels(i));
        classes.push(order.len()..order.len() + class.len());
        order.extend(class);
        rest = others;
    }
    (order, classes)
}

/// Mean products over the rays of all fields: of numbers, then compensators besides focus, then slopes,
/// then distances from the centroids.
pub(super) struct EffectProducts {
    products: DMatrix<f64>,
    bends_with_offsets: DVector<f64>,
    /// The addition by the motion of the edges of pupils.
    edge: EdgeProducts,
}

impl EffectProducts {
    fn add(
        &mut self,
        field: &FieldEffects,
        (parities, compensation): (&[ErrorParity], &Compensation),
        shift: f64,
    ) {
        let numbers = field.displacement.ncols();
        let rows = field.offsets.len();
        let offsets = &field.offsets + shift * &field.slopes;
        let displaced = field.displaced((parities, compensation), shift, &offsets);
        for class in &displaced.classes {
            let own = &displaced.values[class.start * rows..class.end * rows];
            let own = DMatrixView::from_slice(own, rows, class.len());
            let found = own.transpose() * own;
            let order = &displaced.order[class.clone()];
            for (j, to) in order.iter().enumerate() {
                for (i, from) in order.iter().enumerate() {
                    self.products[(*from, *to)] += found[(i, j)];
                }
            }
        }
        if let Some(edge) = &field.edge {
            let mut columns: Vec<&[f64]> = vec![&[]; parities.len()];
            let in_order = displaced.values.chunks(rows.max(1)).zip(&displaced.order);
            in_order.for_each(|(column, number)| columns[*number] = column);
            let inner = field.inner(&parities[..numbers], &offsets);
            self.edge.add(edge, &inner, shift, &columns);
        }
        let bends = field.bend.tr_mul(&offsets);
        for (m, parity) in parities[..numbers].iter().enumerate() {
            if !field.symmetry.cancels_product(*parity, ErrorParity::EVEN) {
                self.bends_with_offsets[m] += bends[m];
            }
        }
    }

    /// The addition to the products of numbers by the motion of the edges of pupils.
    pub(super) fn edge(&self) -> &EdgeProducts {
        &self.edge
    }

    pub(super) fn of(&self, i: usize, j: usize) -> f64 {
        self.products[(i, j)]
    }

    /// The products among the first rows.
    pub(super) fn among(&self, rows: usize) -> DMatrix<f64> {
        self.products.view((0, 0), (rows, rows)).into_owned()
    }

    pub(super) fn with_slopes(&self, i: usize) -> f64 {
        self.products[(i, self.products.ncols() - 2)]
    }

    pub(super) fn with_offsets(&self, i: usize) -> f64 {
        self.products[(i, self.products.ncols() - 1)]
    }

    pub(super) fn bend_with_offsets(&self, number: usize) -> f64 {
        self.bends_with_offsets[number]
    }

    /// The mean square of the slopes.
    pub(super) fn slopes(&self) -> f64 {
        self.with_slopes(self.products.ncols() - 2)
    }

    /// The mean product of slopes and distances from the centroids, in mm.
    pub(super) fn offsets_with_slopes(&self) -> f64 {
        self.with_offsets(self.products.ncols() - 2)
    }

    /// The mean square of the distances from the centroids, in mm².
    pub(super) fn offsets(&self) -> f64 {
        self.with_offsets(self.products.ncols() - 1)
    }
}
