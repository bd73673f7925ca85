//! The mean square spot as a quadratic function of all errors of making.
//!
//! `S(p, y) = S₀ + Σ Sᵢ pᵢ + Σ <εᵢ·εⱼ> pᵢ pⱼ + y·(g + G p) + ½ y·K y` with the exact first derivatives by
//! each error and the mean products of what they do to the rays. Derivatives of rays by two errors are
//! left out; those by one error twice are a part of the form where they were traced. The compensators
//! `y`, focus first, are adjusted in each lens: `y = −K⁻¹ (g + G p)` as far as their travel reaches. `g`,
//! `G` and `K` are mean products too, with what a compensator does to the rays, but for the exact
//! derivatives of the best focus.
//!
//! All errors are combinations of few numbers of the lens: the form is one of these, as large as the
//! lens however many errors there are.

use super::compensation::Compensation;
use super::effects::{EffectProducts, ErrorCombinations, RayEffects};
use super::mixture::ErrorMixture;
use super::pupil_edge::EdgeProducts;
use super::reduced::ReducedForm;
use super::{Derivatives, ToleranceError};
use crate::lens::{Compensator, ToleranceSheet};
use crate::solve::{BoxedQuadratic, scaled_pseudoinverse};
use nalgebra::{DMatrix, DVector};

/// The position of the image plane at which a spot is judged.
#[derive(Debug, Clone, Copy, PartialEq, Eq, serde::Serialize)]
#[serde(rename_all = "snake_case")]
pub enum FocusTreatment {
    /// The image plane of the lens as designed; nothing is adjusted.
    Fixed,
    /// The best common focus of each lens, with all other compensators adjusted too.
    Refocused,
}

impl FocusTreatment {
    /// The displacement of the image plane of a lens without errors, in mm.
    fn shift(self, effects: &RayEffects, compensation: &Compensation) -> f64 {
        let travel = compensation.adjustments[0].travel;
        match self {
            Self::Fixed => 0.0,
            Self::Refocused => effects.focus().clamp(-travel, travel),
        }
    }
}

/// The mean square spot radius in mm² as a quadratic function of the errors.
#[derive(Debug, Clone)]
pub struct QuadraticForm {
    /// The value without errors, with compensators of any travel.
    pub nominal: f64,
    /// The first derivatives.
    pub first: Vec<f64>,
    /// The second derivatives.
    pub second: ErrorProducts,
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
    pub(super) travel: BoxedQuadratic,
}

/// The second derivatives of a form by its errors.
#[derive(Debug, Clone)]
pub struct ErrorProducts {
    combinations: ErrorCombinations,
    /// The second derivatives by the numbers of which errors are combinations.
    among: DMatrix<f64>,
    /// The addition of each error on the diagonal; none if there is nothing to add.
    own: Vec<f64>,
}

impl ErrorProducts {
    /// The second derivative by two errors, in mm² per product of their units.
    pub fn of(&self, i: usize, j: usize) -> f64 {
        let row = |(m, by): &(usize, f64)| {
            let other = self.combinations[j].iter();
            by * other.map(|(n, by)| by * self.among[(*m, *n)]).sum::<f64>()
        };
        let own = if i == j { self.own.get(i).copied().unwrap_or(0.0) } else { 0.0 };
        own + self.combinations[i].iter().map(row).sum::<f64>()
    }

    pub(super) fn combinations(&self) -> &[Vec<(usize, f64)>] {
        &self.combinations
    }

    pub(super) fn among(&self) -> &DMatrix<f64> {
        &self.among
    }

    /// The addition of an error on the diagonal.
    pub(super) fn own(&self, error: usize) -> f64 {
        self.own.get(error).copied().unwrap_or(0.0)
    }

    /// The sum of all second derivatives times two errors each.
    fn twice(&self, errors: &[f64]) -> f64 {
        let mut numbers = DVector::zeros(self.among.nrows());
        for (combination, error) in self.combinations.iter().zip(errors) {
            combination.iter().for_each(|(m, by)| numbers[*m] += by * error);
        }
        let own = self.own.iter().zip(errors).map(|(own, error)| own * error * error).sum::<f64>();
        own + numbers.dot(&(&self.among * &numbers))
    }
}

impl AdjustedForm {
    /// The adjustments of the lens without errors within their travel, focus first.
    pub fn as_designed(&self) -> Vec<f64> {
        self.travel.minimum(&self.nominal)
    }

    /// The mean square spot in mm² by which a lens with these best adjustments is worse within their
    /// travel.
    pub(super) fn cost(&self, best: &[f64]) -> f64 {
        if self.travel.holds(best) {
            return 0.0;
        }
        self.travel.value(&self.travel.minimum(best), best)
    }

    /// The adjustments of a lens with these errors within their travel, focus first.
    pub fn with_errors(&self, errors: &[f64]) -> Vec<f64> {
        self.travel.minimum(&self.best(errors))
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
    /// The form of a lens from the effects of its errors.
    pub fn new(effects: &RayEffects, focus: FocusTreatment, compensation: &Compensation) -> Self {
        let products = effects.products(compensation, focus.shift(effects, compensation));
        Self::of((effects, &products, products.edge()), focus, compensation)
    }

    /// The form with the motion of the edges of pupils where it is known, and that with the pupils held.
    pub(super) fn with_moving_and_held_pupils(
        effects: &RayEffects,
        focus: FocusTreatment,
        compensation: &Compensation,
    ) -> [Self; 2] {
        let products = effects.products(compensation, focus.shift(effects, compensation));
        let of = |edge| Self::of((effects, &products, edge), focus, compensation);
        let moving = of(products.edge());
        if !effects.has_moving_pupils() {
            return [moving.clone(), moving];
        }
        [moving, of(&EdgeProducts::none(effects.numbers()))]
    }

    fn of(
        (effects, products, edge): (&RayEffects, &EffectProducts, &EdgeProducts),
        focus: FocusTreatment,
        compensation: &Compensation,
    ) -> Self {
        let form = FixedForm::new((effects, products, edge), focus, compensation);
        match focus {
            FocusTreatment::Fixed => form.without_adjustment(),
            FocusTreatment::Refocused => form.adjusted(&compensation.adjustments),
        }
    }

    /// The mean square spot radius of a lens with these errors, in mm²; a form knows no end at zero,
    /// so that smaller values are zero.
    pub fn at(&self, errors: &[f64]) -> f64 {
        let linear: f64 = self.first.iter().zip(errors).map(|(by, error)| by * error).sum();
        let sum = self.nominal + linear + 0.5 * self.second.twice(errors);
        let cost = |adjusted: &AdjustedForm| adjusted.cost(&adjusted.best(errors));
        sum.max(0.0) + self.adjusted.as_ref().map_or(0.0, cost)
    }

    /// The mean square spot radius without errors in mm², with each compensator within its travel.
    pub fn as_designed(&self) -> f64 {
        let cost = |adjusted: &AdjustedForm| adjusted.cost(&adjusted.nominal);
        self.nominal.max(0.0) + self.adjusted.as_ref().map_or(0.0, cost)
    }

    /// The derivatives of the mean square by an error of the lens as designed, of which compensators at the ends of
    /// their travel stay there.
    pub fn derivatives(&self, error: usize) -> Derivatives {
        let value = self.as_designed();
        let (mut first, mut second) = (self.first[error], self.second.of(error, error));
        if let Some(adjusted) = &self.adjusted {
            let (slope, curvature) = adjusted.travel.derivatives_of_least(&adjusted.nominal);
            let best = adjusted.first.column(error);
            first += slope.dot(&best);
            second += best.dot(&(curvature * best));
        }
        Derivatives { value, first, second }
    }

    /// True if a compensator may travel to a stop. The form is no quadratic one then.
    pub fn has_stops(&self) -> bool {
        self.adjusted.as_ref().is_some_and(|adjusted| adjusted.travel.has_stops())
    }

    /// The growth of the expected mean square spot radius by each error in mm², half of what it shares
    /// with others included.
    ///
    /// Where compensators may end at stops, it is `½ σ² E[∂²S/∂p²]` as the mean over all errors from none to those of
    /// the tolerances, by random lenses (Price, IRE Trans. Inf. Theory 4 (1958) 69: exact for normal errors). What
    /// stops cost is scaled for other errors, so that the sum is that of the lenses whatever their distributions.
    ///
    /// # Errors
    /// Correlations that no errors can have.
    pub fn growth(&self, sheet: &ToleranceSheet) -> Result<Vec<f64>, ToleranceError> {
        let mixture = ErrorMixture::new(sheet)?;
        Ok(self.growth_by(&mixture, self.stop_curvature(sheet)?.as_ref()))
    }

    /// The expected mean square spot radius in mm². Compensators that may travel to a stop count as if they had none.
    ///
    /// # Errors
    /// Correlations that no errors can have.
    pub fn expectation(&self, sheet: &ToleranceSheet) -> Result<f64, ToleranceError> {
        let form = self.without_stops();
        let growth = form.growth_by(&ErrorMixture::new(sheet)?, form.held_curvature().as_ref());
        Ok(form.as_designed() + growth.iter().sum::<f64>())
    }

    /// The same form without stops that a compensator may travel to.
    fn without_stops(&self) -> Self {
        let mut form = self.clone();
        if let Some(adjusted) = &mut form.adjusted {
            adjusted.travel = adjusted.travel.without_stops();
        }
        form
    }

    /// The second derivatives by the best adjustments of the mean square that stops cost, as the mean over lenses
    /// with random errors, times a factor with which all errors together cost what these lenses do; `None` where
    /// nothing has a stop.
    pub(super) fn stop_curvature(
        &self,
        sheet: &ToleranceSheet,
    ) -> Result<Option<DMatrix<f64>>, ToleranceError> {
        if !self.has_stops() {
            return Ok(self.held_curvature());
        }
        self.reduced(sheet)?.stop_curvature(&sheet.errors)
    }

    /// The same where compensators have unlimited travels or none.
    fn held_curvature(&self) -> Option<DMatrix<f64>> {
        let adjusted = self.adjusted.as_ref().filter(|own| own.travel.is_bounded())?;
        Some(adjusted.travel.derivatives_of_least(&adjusted.nominal).1)
    }

    /// The second derivative by two errors with such second derivatives by the best adjustments.
    pub(super) fn second_with_stops(
        &self,
        (i, j): (usize, usize),
        stops: Option<&DMatrix<f64>>,
    ) -> f64 {
        let cost = self.adjusted.as_ref().zip(stops).map_or(0.0, |(adjusted, stops)| {
            adjusted.first.column(i).dot(&(stops * adjusted.first.column(j)))
        });
        self.second.of(i, j) + cost
    }

    fn growth_by(&self, mixture: &ErrorMixture, stops: Option<&DMatrix<f64>>) -> Vec<f64> {
        let of = |i: usize| {
            let covariances = mixture.covariances(i).iter();
            let product =
                |(j, value): &(usize, f64)| value * self.second_with_stops((i, *j), stops);
            0.5 * covariances.map(product).sum::<f64>()
        };
        (0..self.first.len()).map(of).collect()
    }

    /// The form in few combinations of the errors that carry nearly all of it.
    pub(super) fn reduced(&self, sheet: &ToleranceSheet) -> Result<ReducedForm, ToleranceError> {
        Ok(ReducedForm::new(self, &ErrorMixture::new(sheet)?))
    }
}

/// A growth below this share of the mean square is rounding, of which nothing has a share.
const ROUNDING: f64 = 1e-12;

/// The share of each error in the growth of the expectation of each form; correlated errors share what they do
/// together.
///
/// # Errors
/// Correlations that no errors can have.
pub(super) fn growth_shares(
    forms: &[QuadraticForm; 2],
    sheet: &ToleranceSheet,
) -> Result<Vec<[f64; 2]>, ToleranceError> {
    let [fixed, adjusted] = forms.each_ref().map(|form| form.growth(sheet));
    let (fixed, adjusted) = (fixed?, adjusted?);
    let total = |form: &QuadraticForm, growth: &[f64]| {
        let rounding = ROUNDING * form.as_designed().max(f64::MIN_POSITIVE);
        growth.iter().sum::<f64>().abs().max(rounding)
    };
    let totals = [total(&forms[0], &fixed), total(&forms[1], &adjusted)];
    let pairs = fixed.into_iter().zip(adjusted);
    Ok(pairs.map(|(a, b)| [a / totals[0], b / totals[1]]).collect())
}

/// Numbers of all rays, of which the mean squares make a form, with their derivatives: each times the root of
/// the weight of its ray.
pub(super) struct LinearEffects {
    /// Without errors.
    pub(super) offsets: DVector<f64>,
    /// By each number of the lens, a column each.
    pub(super) numbers: DMatrix<f64>,
    /// By a displacement of the image plane.
    pub(super) by_focus: DVector<f64>,
    /// By the other compensators.
    pub(super) adjustments: Vec<DVector<f64>>,
    /// The mean products of the numbers of rays with their second derivatives by the displacement and each number.
    pub(super) mixed: Vec<f64>,
    /// The same by the displacement twice.
    pub(super) bend: f64,
    /// The errors as combinations of numbers.
    pub(super) combinations: ErrorCombinations,
    /// The second derivative of the mean square by each error, where it is known.
    pub(super) exact: Option<Vec<f64>>,
    /// The position of the image plane in mm.
    pub(super) focus: f64,
}

impl LinearEffects {
    /// The form at the image plane of these effects.
    pub(super) fn fixed(self) -> QuadraticForm {
        FixedForm::of_effects(self).without_adjustment()
    }

    /// The form with all compensators adjusted, focus first.
    pub(super) fn adjusted(self, adjustments: &[Compensator]) -> QuadraticForm {
        FixedForm::of_effects(self).adjusted(adjustments)
    }
}

/// The form before anything is adjusted but the focus of the lens as designed, by numbers of the lens.
struct FixedForm {
    nominal: f64,
    first: DVector<f64>,
    among: DMatrix<f64>,
    /// The same with the pupils held.
    held: DMatrix<f64>,
    /// The second derivative of the mean square by each error with the pupils held, where it is known.
    exact: Option<Vec<f64>>,
    combinations: ErrorCombinations,
    /// The position of these numbers, in mm from the image plane.
    focus: f64,
    /// The derivatives by compensators: alone, with the numbers, and with each other.
    by_adjustment: DVector<f64>,
    by_both: DMatrix<f64>,
    among_adjustments: DMatrix<f64>,
}

impl FixedForm {
    /// The form at an image plane from the mean products there and what edges of pupils add to them.
    fn new(
        (effects, products, edge): (&RayEffects, &EffectProducts, &EdgeProducts),
        focus: FocusTreatment,
        compensation: &Compensation,
    ) -> Self {
        let (count, adjustments) = (effects.numbers(), compensation.adjustments.len());
        let by_focus = |m: usize| {
            products.with_slopes(m) + products.bend_with_offsets(m) + edge.with_slopes[m]
        };
        let held = 2.0 * products.among(count);
        let first = |m: usize| 2.0 * (products.with_offsets(m) + edge.with_offsets[m]);
        let mut form = Self {
            nominal: products.offsets(),
            first: DVector::from_fn(count, |m, _| first(m)),
            among: &held + 2.0 * &edge.among,
            held,
            exact: effects.second(focus.shift(effects, compensation)),
            combinations: ErrorCombinations::clone(effects.combinations()),
            focus: focus.shift(effects, compensation),
            by_adjustment: DVector::zeros(adjustments),
            by_both: DMatrix::zeros(adjustments, count),
            among_adjustments: DMatrix::zeros(adjustments, adjustments),
        };
        for m in 0..count {
            form.by_both[(0, m)] = 2.0 * by_focus(m);
        }
        form.by_adjustment[0] = 2.0 * products.offsets_with_slopes();
        form.among_adjustments[(0, 0)] = 2.0 * products.slopes();
        for a in 1..adjustments {
            let own = count + a - 1;
            form.by_adjustment[a] = 2.0 * products.with_offsets(own);
            for m in 0..count {
                form.by_both[(a, m)] = 2.0 * products.of(own, m);
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

    fn of_effects(effects: LinearEffects) -> Self {
        let LinearEffects { offsets, numbers, by_focus, adjustments, .. } = effects;
        let columns = || std::iter::once(&by_focus).chain(&adjustments);
        let count = 1 + adjustments.len();
        let mut form = Self {
            nominal: offsets.norm_squared(),
            first: 2.0 * numbers.tr_mul(&offsets),
            among: 2.0 * numbers.tr_mul(&numbers),
            held: DMatrix::zeros(0, 0),
            exact: effects.exact,
            combinations: effects.combinations,
            focus: effects.focus,
            by_adjustment: DVector::zeros(count),
            by_both: DMatrix::zeros(count, numbers.ncols()),
            among_adjustments: DMatrix::zeros(count, count),
        };
        form.held = form.among.clone();
        for (a, column) in columns().enumerate() {
            form.by_adjustment[a] = 2.0 * column.dot(&offsets);
            form.by_both.set_row(a, &(2.0 * numbers.tr_mul(column)).transpose());
            for (b, other) in columns().enumerate() {
                form.among_adjustments[(a, b)] = 2.0 * column.dot(other);
            }
        }
        for (m, mixed) in effects.mixed.iter().enumerate() {
            form.by_both[(0, m)] += 2.0 * mixed;
        }
        // A position that is no least one has no curvature of its own.
        let curvature = form.among_adjustments[(0, 0)] + 2.0 * effects.bend;
        if curvature > 0.0 {
            form.among_adjustments[(0, 0)] = curvature;
        }
        form
    }

    /// Numbers by each error from those by each number of the lens.
    fn by_errors<'a>(&'a self, by: &'a DVector<f64>) -> impl Iterator<Item = f64> + 'a {
        let sum = |row: &Vec<(usize, f64)>| row.iter().map(|(m, factor)| factor * by[*m]).sum();
        self.combinations.iter().map(sum)
    }

    /// The additions of second derivatives of rays on the diagonal.
    fn own(&self) -> Vec<f64> {
        let combinations = ErrorCombinations::clone(&self.combinations);
        let products = ErrorProducts { combinations, among: self.held.clone(), own: Vec::new() };
        let exact = self.exact.iter().flatten().enumerate();
        exact.map(|(i, exact)| exact - products.of(i, i)).collect()
    }

    fn without_adjustment(self) -> QuadraticForm {
        let (first, own) = (self.by_errors(&self.first).collect(), self.own());
        let Self { nominal, among, combinations, .. } = self;
        let second = ErrorProducts { combinations, among, own };
        QuadraticForm { nominal, first, second, adjusted: None }
    }

    /// The form at the least over all adjustments.
    fn adjusted(self, adjustments: &[Compensator]) -> QuadraticForm {
        let inverse = scaled_pseudoinverse(&self.among_adjustments);
        let at_rest = -(&inverse * &self.by_adjustment);
        let by_numbers = -(&inverse * &self.by_both);
        let nominal = self.nominal + 0.5 * self.by_adjustment.dot(&at_rest);
        let first = &self.first + self.by_both.tr_mul(&at_rest);
        let first = self.by_errors(&first).collect();
        let mut by_errors = DMatrix::zeros(by_numbers.nrows(), self.combinations.len());
        for a in 0..by_numbers.nrows() {
            let row = by_numbers.row(a).transpose();
            self.by_errors(&row).enumerate().for_each(|(i, by)| by_errors[(a, i)] = by);
        }
        let own = self.own();
        let among = self.among + self.by_both.transpose() * &by_numbers;
        let mut best: Vec<f64> = at_rest.iter().copied().collect();
        best[0] += self.focus;
        let range = |own: &Compensator| [-own.travel, own.travel];
        let ranges = adjustments.iter().map(range).collect();
        let travel = BoxedQuadratic::new(self.among_adjustments, ranges);
        let adjusted = Some(AdjustedForm { nominal: best, first: by_errors, travel });
        let second = ErrorProducts { combinations: self.combinations, among, own };
        QuadraticForm { nominal, first, second, adjusted }
    }
}
