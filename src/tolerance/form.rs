//! The mean square spot as a quadratic function of all errors of making.
//!
//! `S(p, y) = S₀ + Σ Sᵢ pᵢ + ½ Σ Sᵢᵢ pᵢ² + Σ_{i<j} 2 <εᵢ·εⱼ> pᵢ pⱼ + y·(g + G p) + ½ y·K y` with the exact
//! first and second derivatives by each error and, between two of them, the mean product of what they
//! do to the rays (the derivative of the rays by two errors is left out). The compensators `y`, focus
//! first, are adjusted in each lens: `y = −K⁻¹ (g + G p)` as far as their travel reaches. `g`, `G` and
//! `K` are mean products too, with what a compensator does to the rays, but for the exact derivatives of
//! the best focus.

use super::compensation::Compensation;
use super::draw::draw_independent;
use super::folded::{ErrorParity, FoldedField, folded_fields};
use super::merits::Merits;
use super::mixture::ErrorMixture;
use super::{Jet2, RaySensitivity, Sensitivity, ToleranceError, ToleranceScene};
use crate::lens::{Compensator, Tolerance, ToleranceSheet};
use crate::solve::{BoxedQuadratic, scaled_pseudoinverse};
use nalgebra::{DMatrix, DVector, SymmetricEigen};
use rayon::prelude::*;

/// The position of the image plane at which a spot is judged.
#[derive(Debug, Clone, Copy, PartialEq, Eq, serde::Serialize)]
#[serde(rename_all = "snake_case")]
pub enum FocusTreatment {
    /// The image plane of the lens as designed; nothing is adjusted.
    Fixed,
    /// The best common focus of each lens, with all other compensators adjusted too.
    Refocused,
}

/// The mean square spot radius in mm² as a quadratic function of the errors.
#[derive(Debug, Clone)]
pub struct QuadraticForm {
    /// The value without errors, with compensators of any travel.
    pub nominal: f64,
    /// The first derivatives.
    pub first: Vec<f64>,
    /// The matrix of second derivatives, row by row.
    pub second: DMatrix<f64>,
    /// The compensators; `None` at the fixed image plane.
    pub adjusted: Option<AdjustedForm>,
}

/// The compensators of a lens as linear functions of its errors, and the ends of their travel: what is
/// missing there remains.
#[derive(Debug, Clone)]
pub struct AdjustedForm {
    /// The best adjustments without errors, focus first, in mm or radians.
    pub nominal: Vec<f64>,
    /// The derivatives of the best adjustments by the errors, a row for each compensator.
    pub first: DMatrix<f64>,
    /// The growth of the mean square by adjustments within their travel other than the best ones, in mm².
    travel: BoxedQuadratic,
}

impl AdjustedForm {
    /// The adjustments of the lens without errors within their travel, focus first.
    pub fn as_designed(&self) -> Vec<f64> {
        self.travel.minimum(&self.nominal)
    }

    /// The mean square spot in mm² by which a lens with these best adjustments is worse within their
    /// travel.
    fn cost(&self, best: &[f64]) -> f64 {
        if self.travel.holds(best) {
            return 0.0;
        }
        self.travel.value(&self.travel.minimum(best), best)
    }

    /// The best adjustments of a lens with these errors, whatever their travel.
    fn best(&self, errors: &[f64]) -> Vec<f64> {
        let row = |i: usize| -> f64 {
            self.first.row(i).iter().zip(errors).map(|(by, error)| by * error).sum()
        };
        self.nominal.iter().enumerate().map(|(i, nominal)| nominal + row(i)).collect()
    }
}

impl QuadraticForm {
    /// The form of a lens from its sensitivities.
    pub fn new(
        scene: &ToleranceScene,
        sensitivities: &[Sensitivity],
        focus: FocusTreatment,
        compensation: &Compensation,
    ) -> Self {
        let form = FixedForm::new(scene, sensitivities, focus, compensation);
        match focus {
            FocusTreatment::Fixed => form.without_adjustment(),
            FocusTreatment::Refocused => form.adjusted(compensation),
        }
    }

    /// The mean square spot radius of a lens with these errors, in mm²; a form knows no end at zero,
    /// so that smaller values are zero.
    pub fn at(&self, errors: &[f64]) -> f64 {
        let mut sum = self.nominal;
        for (i, error) in errors.iter().enumerate() {
            let row: f64 = errors.iter().enumerate().map(|(j, p)| self.second[(j, i)] * p).sum();
            sum += error * (self.first[i] + 0.5 * row);
        }
        let cost = |adjusted: &AdjustedForm| adjusted.cost(&adjusted.best(errors));
        sum.max(0.0) + self.adjusted.as_ref().map_or(0.0, cost)
    }

    /// The mean square spot radius without errors in mm², with each compensator within its travel.
    pub fn as_designed(&self) -> f64 {
        let cost = |adjusted: &AdjustedForm| adjusted.cost(&adjusted.nominal);
        self.nominal.max(0.0) + self.adjusted.as_ref().map_or(0.0, cost)
    }

    /// The growth of the expected mean square spot radius by each error in mm², half of what it shares
    /// with others included, with compensators whose travel has no end.
    ///
    /// # Errors
    /// Correlations that no errors can have.
    pub fn growth(&self, sheet: &ToleranceSheet) -> Result<Vec<f64>, ToleranceError> {
        let mixture = ErrorMixture::new(sheet)?;
        let of = |i: usize| {
            let covariances = mixture.covariances(i).iter();
            0.5 * covariances.map(|(j, value)| value * self.second[(i, *j)]).sum::<f64>()
        };
        Ok((0..sheet.errors.len()).map(of).collect())
    }

    /// The expected mean square spot radius in mm², with compensators whose travel has no end.
    ///
    /// # Errors
    /// Correlations that no errors can have.
    pub fn expectation(&self, sheet: &ToleranceSheet) -> Result<f64, ToleranceError> {
        Ok(self.nominal + self.growth(sheet)?.iter().sum::<f64>())
    }

    /// The form in few combinations of the errors that carry nearly all of it.
    pub(super) fn reduced(&self, sheet: &ToleranceSheet) -> Result<ReducedForm, ToleranceError> {
        let mixture = ErrorMixture::new(sheet)?;
        let scaled = mixture.scaled(&self.second);
        let count = sheet.errors.len();
        let trace: f64 = (0..count).map(|i| scaled[(i, i)]).sum();
        let (kept, eigenvectors) = principal(scaled);
        let mut rows = vec![mixture.by_independent(&self.first)];
        let adjusted = self.adjusted.clone();
        for row in adjusted.iter().flat_map(|adjusted| adjusted.first.row_iter()) {
            rows.push(mixture.by_independent(&row.iter().copied().collect::<Vec<_>>()));
        }
        let own = rows.len();
        let deviations = mixture.deviations();
        for column in eigenvectors.column_iter() {
            rows.push(column.iter().zip(deviations).map(|(v, deviation)| v / deviation).collect());
        }
        let directions = DMatrix::from_fn(rows.len(), count, |row, i| rows[row][i]);
        let neglected = 0.5 * (trace - kept.iter().sum::<f64>());
        let (nominal, values) = (self.nominal, kept);
        Ok(ReducedForm { nominal, neglected, values, own, directions, adjusted })
    }
}

/// The form before anything is adjusted but the focus of the lens as designed.
struct FixedForm {
    nominal: f64,
    first: Vec<f64>,
    second: DMatrix<f64>,
    /// The best focus without errors, in mm from the image plane.
    focus: f64,
    /// The derivatives by compensators: alone, with the errors, and with each other.
    by_adjustment: DVector<f64>,
    by_both: DMatrix<f64>,
    among_adjustments: DMatrix<f64>,
}

impl FixedForm {
    fn new(
        scene: &ToleranceScene,
        sensitivities: &[Sensitivity],
        focus: FocusTreatment,
        compensation: &Compensation,
    ) -> Self {
        let count = sensitivities.len();
        let shift = match (focus, sensitivities.first()) {
            (FocusTreatment::Refocused, Some(any)) => any.focus().value,
            _ => 0.0,
        };
        let products = RayProducts::new(scene, sensitivities, compensation, shift);
        let adjustments = compensation.adjustments.len();
        let mut form = Self {
            nominal: 0.0,
            first: Vec::with_capacity(count),
            second: 2.0 * products.among(count),
            focus: shift,
            by_adjustment: DVector::zeros(adjustments),
            by_both: DMatrix::zeros(adjustments, count),
            among_adjustments: DMatrix::zeros(adjustments, adjustments),
        };
        for (i, sensitivity) in sensitivities.iter().enumerate() {
            let (own, by_focus) = spot_at(&sensitivity.merits, shift);
            form.nominal = own.value.value;
            form.first.push(own.slope[0].value);
            form.second[(i, i)] = own.slope[0].slope[0];
            form.by_both[(0, i)] = 2.0 * by_focus.slope[0].value;
        }
        if let Some(any) = sensitivities.first() {
            form.among_adjustments[(0, 0)] = 2.0 * any.merits.mean.c.value.value;
        }
        for a in 1..adjustments {
            let own = count + a - 1;
            form.by_adjustment[a] = 2.0 * products.with_offsets(own);
            for i in 0..count {
                form.by_both[(a, i)] = 2.0 * products.of(own, i);
            }
            let with_focus = 2.0 * products.with_slopes(own);
            form.among_adjustments[(a, 0)] = with_focus;
            form.among_adjustments[(0, a)] = with_focus;
            for b in 1..adjustments {
                form.among_adjustments[(a, b)] = 2.0 * products.of(own, count + b - 1);
            }
        }
        form
    }

    fn without_adjustment(self) -> QuadraticForm {
        let Self { nominal, first, second, .. } = self;
        QuadraticForm { nominal, first, second, adjusted: None }
    }

    /// The form at the least over all adjustments.
    fn adjusted(self, compensation: &Compensation) -> QuadraticForm {
        let inverse = scaled_pseudoinverse(&self.among_adjustments);
        let at_rest = -(&inverse * &self.by_adjustment);
        let by_errors = -(&inverse * &self.by_both);
        let nominal = self.nominal + 0.5 * self.by_adjustment.dot(&at_rest);
        let change = self.by_both.tr_mul(&at_rest);
        let first = self.first.iter().zip(change.iter()).map(|(a, b)| a + b).collect();
        let second = self.second + self.by_both.transpose() * &by_errors;
        let mut best: Vec<f64> = at_rest.iter().copied().collect();
        best[0] += self.focus;
        let range = |own: &Compensator| [-own.travel, own.travel];
        let ranges = compensation.adjustments.iter().map(range).collect();
        let travel = BoxedQuadratic::new(self.among_adjustments, ranges);
        let adjusted = Some(AdjustedForm { nominal: best, first: by_errors, travel });
        QuadraticForm { nominal, first, second, adjusted }
    }
}

/// The mean square spot at a displaced image plane, and half of its derivative by the displacement.
fn spot_at(merits: &Merits<Jet2>, shift: f64) -> (Jet2, Jet2) {
    use crate::math::Real as _;
    let shift = Jet2::from_f64(shift);
    (merits.mean.at(shift), merits.mean.b + merits.mean.c * shift)
}

/// The share of the form whose scatter, though not its mean, is left out of samples.
const NEGLECTED: f64 = 1e-4;

/// The eigenvalues of a symmetric matrix that carry nearly all of it, with their eigenvectors as columns.
///
/// A matrix of mean products has few of them: they are those of its first pivoted Cholesky factors. One
/// of which these leave too much, as it is not positive, is decomposed as a whole.
fn principal(matrix: DMatrix<f64>) -> (Vec<f64>, DMatrix<f64>) {
    let (values, vectors) = if let Some(factors) = few_factors(&matrix) {
        let small = SymmetricEigen::new(factors.tr_mul(&factors));
        let mut vectors = factors * small.eigenvectors;
        for (mut column, value) in vectors.column_iter_mut().zip(small.eigenvalues.iter()) {
            column *= 1.0 / value.max(f64::MIN_POSITIVE).sqrt();
        }
        (small.eigenvalues, vectors)
    } else {
        let SymmetricEigen { eigenvectors, eigenvalues } = SymmetricEigen::new(matrix);
        (eigenvalues, eigenvectors)
    };
    let mut order: Vec<usize> = (0..values.len()).collect();
    order.sort_by(|a, b| values[*b].abs().total_cmp(&values[*a].abs()));
    let total: f64 = values.iter().map(|v| v.abs()).sum();
    let (mut kept, mut sum) = (Vec::new(), 0.0);
    for m in order {
        if sum >= (1.0 - NEGLECTED) * total {
            break;
        }
        sum += values[m].abs();
        kept.push(m);
    }
    let columns = DMatrix::from_fn(vectors.nrows(), kept.len(), |i, k| vectors[(i, kept[k])]);
    (kept.iter().map(|m| values[*m]).collect(), columns)
}

/// Columns `f` of which the sum of `f fᵀ` is a matrix but for a tenth of what may be left out; `None` if
/// there are none, or as many as the matrix has.
fn few_factors(matrix: &DMatrix<f64>) -> Option<DMatrix<f64>> {
    let count = matrix.nrows();
    let mut rest: Vec<f64> = (0..count).map(|i| matrix[(i, i)]).collect();
    let left = |rest: &[f64]| rest.iter().map(|value| value.abs()).sum::<f64>();
    let enough = 0.1 * NEGLECTED * left(&rest);
    let mut factors: Vec<DVector<f64>> = Vec::new();
    while left(&rest) > enough {
        let (pivot, own) = rest.iter().copied().enumerate().max_by(|a, b| a.1.total_cmp(&b.1))?;
        if factors.len() + 1 >= count || !(own > 0.0) {
            return None;
        }
        let mut column = matrix.column(pivot).into_owned();
        for factor in &factors {
            column.axpy(-factor[pivot], factor, 1.0);
        }
        column *= 1.0 / own.sqrt();
        rest.iter_mut().zip(column.iter()).for_each(|(rest, by)| *rest -= by * by);
        factors.push(column);
    }
    (!factors.is_empty()).then(|| DMatrix::from_columns(&factors))
}

/// The row of [`ReducedForm::directions`] for the first derivatives; those of the best adjustments come
/// next.
const LINEAR: usize = 0;

/// The number of lenses whose errors are combined at once.
const LENSES: u64 = 256;

/// A quadratic form in few combinations of its variables.
pub(super) struct ReducedForm {
    nominal: f64,
    /// The mean of the part that is left out, for the tolerances themselves.
    neglected: f64,
    /// The eigenvalue of each combination.
    values: Vec<f64>,
    /// The number of rows of `directions` in front of the combinations.
    own: usize,
    /// The first derivatives of the form, those of the best adjustments, and the combinations, all by
    /// independent errors.
    directions: DMatrix<f64>,
    adjusted: Option<AdjustedForm>,
}

impl ReducedForm {
    /// The terms of the form for this many lenses with random errors, and for all multiples of these.
    pub(super) fn random_lenses(
        &self,
        tolerances: &[Tolerance],
        seed: u64,
        count: u64,
    ) -> Vec<ErrorMultiples> {
        let part = |part: u64| {
            let lenses = part * LENSES..count.min((part + 1) * LENSES);
            let mut errors = DMatrix::zeros(tolerances.len(), (lenses.end - lenses.start) as usize);
            for (number, mut column) in lenses.zip(errors.column_iter_mut()) {
                draw_independent(tolerances, seed, number, column.as_mut_slice());
            }
            let along = &self.directions * errors;
            along.column_iter().map(|along| self.multiples(along.as_slice())).collect::<Vec<_>>()
        };
        let parts = (0..count.div_ceil(LENSES)).into_par_iter().map(part);
        parts.collect::<Vec<_>>().into_iter().flatten().collect()
    }

    fn multiples(&self, along: &[f64]) -> ErrorMultiples {
        let kept = self.values.iter().zip(&along[self.own..]);
        let square: f64 = kept.map(|(value, along)| 0.5 * value * along * along).sum();
        ErrorMultiples {
            linear: along[LINEAR],
            square: self.neglected + square,
            adjustments: along[LINEAR + 1..self.own].to_vec(),
        }
    }

    /// The mean square spot radius of a lens with a multiple of some errors, in mm².
    pub(super) fn at_multiple(&self, errors: &ErrorMultiples, factor: f64) -> f64 {
        let ErrorMultiples { linear, square, adjustments } = errors;
        let sum = self.nominal + factor * (linear + factor * square);
        let cost = |own: &AdjustedForm| own.cost(&own.best_of(adjustments, factor));
        sum.max(0.0) + self.adjusted.as_ref().map_or(0.0, cost)
    }

    /// The adjustments of a lens with some errors within their travel, focus first; none at the fixed
    /// image plane.
    pub(super) fn adjustments(&self, errors: &ErrorMultiples) -> Vec<f64> {
        let within =
            |own: &AdjustedForm| own.travel.minimum(&own.best_of(&errors.adjustments, 1.0));
        self.adjusted.as_ref().map_or_else(Vec::new, within)
    }
}

impl AdjustedForm {
    /// The best adjustments with changes by errors times a factor.
    fn best_of(&self, changes: &[f64], factor: f64) -> Vec<f64> {
        self.nominal.iter().zip(changes).map(|(nominal, by)| nominal + factor * by).collect()
    }
}

/// The additions of errors to the form: to first order, to second order, and to the best adjustments.
pub(super) struct ErrorMultiples {
    linear: f64,
    square: f64,
    adjustments: Vec<f64>,
}

/// Mean products over the rays of all fields of what errors and compensators do to them.
struct RayProducts {
    /// Of errors, then compensators besides focus, then slopes, then distances from the centroids.
    products: DMatrix<f64>,
    slopes: usize,
}

impl RayProducts {
    /// The products at an image plane that is displaced by `shift`.
    fn new(
        scene: &ToleranceScene,
        sensitivities: &[Sensitivity],
        compensation: &Compensation,
        shift: f64,
    ) -> Self {
        let errors = sensitivities.iter().map(|s| RayRow {
            parity: ErrorParity::of(s.error.kind),
            rays: &s.rays,
            shift,
            slope: false,
        });
        let adjusted = compensation.effects.iter().map(|effect| RayRow {
            parity: effect.parity,
            rays: &effect.rays,
            shift,
            slope: false,
        });
        let even = |rays, slope| RayRow { parity: ErrorParity::EVEN, rays, shift: 0.0, slope };
        let slopes = sensitivities.len() + compensation.effects.len();
        let mut rows: Vec<RayRow<'_>> = errors.chain(adjusted).collect();
        rows.extend(sensitivities.first().map(|any| even(&any.rays[..], true)));
        if !compensation.offsets.is_empty() {
            rows.push(even(&compensation.offsets, false));
        }
        let mut products = DMatrix::zeros(rows.len(), rows.len());
        let mut starts = vec![0];
        for field in &scene.beam.fields {
            let rays: usize = field.colours.iter().map(|colour| colour.rays.len()).sum();
            starts.push(starts[starts.len() - 1] + rays);
        }
        for field in folded_fields(scene) {
            add_field(&mut products, &field, &rows, starts[field.number]);
        }
        Self { products, slopes }
    }

    fn of(&self, i: usize, j: usize) -> f64 {
        self.products[(i, j)]
    }

    /// The products among the errors.
    fn among(&self, errors: usize) -> DMatrix<f64> {
        self.products.view((0, 0), (errors, errors)).into_owned()
    }

    fn with_slopes(&self, i: usize) -> f64 {
        self.products[(i, self.slopes)]
    }

    fn with_offsets(&self, i: usize) -> f64 {
        self.products[(i, self.slopes + 1)]
    }
}

/// Numbers of all rays whose products are asked for.
struct RayRow<'a> {
    parity: ErrorParity,
    rays: &'a [RaySensitivity],
    /// The displacement of the image plane in mm.
    shift: f64,
    /// True for the slopes in place of the displacements.
    slope: bool,
}

impl RayRow<'_> {
    /// The numbers of a ray along x and y times a factor.
    fn weighted(&self, ray: usize, factor: f64) -> [f64; 2] {
        let RaySensitivity { displacement: [x, y], slope, bend: [u, v] } = &self.rays[ray];
        let [x, y] = if self.slope { *slope } else { [x + self.shift * u, y + self.shift * v] };
        [factor * x, factor * y]
    }
}

/// Adds the products over the rays of a field, of which the first one is at `start`.
fn add_field(
    products: &mut DMatrix<f64>,
    field: &FoldedField<'_>,
    rows: &[RayRow<'_>],
    start: usize,
) {
    let (mut places, mut from) = (Vec::new(), start);
    for colour in &field.field.colours {
        places.extend(field.rays(colour).map(|(i, weight)| (from + i, weight)));
        from += colour.rays.len();
    }
    places.iter_mut().for_each(|(_, weight)| *weight = (*weight * field.weight).sqrt());
    let mut values = Vec::with_capacity(2 * places.len() * rows.len());
    for row in rows {
        values.extend(places.iter().flat_map(|(place, root)| row.weighted(*place, *root)));
    }
    let values = DMatrix::from_vec(2 * places.len(), rows.len(), values);
    let found = values.transpose() * &values;
    for (i, row) in rows.iter().enumerate() {
        for (j, other) in rows.iter().enumerate() {
            if !field.symmetry.cancels_product(row.parity, other.parity) {
                products[(i, j)] += found[(i, j)];
            }
        }
    }
}
