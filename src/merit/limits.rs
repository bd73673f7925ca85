//! The limits of a lens as constraints: their values, their bounds and their derivatives.
//!
//! Lengths, shapes and the focal length follow from the numbers of the lens alone, and an optimizer
//! can keep them without tracing a ray; the limits of light come from the pupils. The limits that
//! need no rays come first.

use super::constraints::{Constraint, ConstraintMargin, smooth_constraints};
use super::first_order::{focal_length_of, slopes_of_all};
use super::light::{
    WithGradient, axial_f_number, light_shares, mean_light, relative_illumination, total_weight,
};
use super::operands::operand_values;
use super::sum::{DerivativeLevel, SumOfSquares};
use super::{EvaluationContext, Merit, MeritError, PupilForms, Term, VariableDual, WeightedTerm};
use crate::lens::{System, TermSelection};
use crate::solve::SeparateResidual;
use nalgebra::DVector;

/// A limited number of a lens, with its derivatives.
#[derive(Debug, Clone, PartialEq)]
pub struct Limit {
    /// The number with its bounds; an equality has two equal ones.
    pub margin: ConstraintMargin,
    /// Its derivatives by the variables; zeros unless they are asked for.
    pub slope: DVector<f64>,
    /// The weight of its squared violation in the goal.
    pub weight: f64,
}

/// The merit without the terms that are constraints, and these.
#[derive(Debug, Clone, PartialEq)]
pub struct LimitedSum {
    /// The sum of the other terms.
    pub objective: SumOfSquares,
    /// The limits.
    pub limits: Vec<Limit>,
    /// The forms of the pupils, which [`Merit::follow_pupils`] takes.
    pub pupils: PupilForms,
}

/// A number of a resolved lens that is limited and needs no rays.
enum Mechanical {
    FocalLength,
    Constraint(Constraint),
}

impl Mechanical {
    fn value(&self, context: &EvaluationContext<'_>) -> f64 {
        match self {
            Self::FocalLength => focal_length_of(&context.systems.clipped[context.zoom.primary]),
            Self::Constraint(constraint) => constraint.value(&context.systems.manufactured),
        }
    }

    fn of(&self, system: &System<VariableDual>) -> VariableDual {
        match self {
            Self::FocalLength => focal_length_of(system),
            Self::Constraint(constraint) => constraint.value(system),
        }
    }
}

impl Merit {
    /// True if the goal has terms that are constraints.
    pub fn has_limits(&self) -> bool {
        self.goal.terms.iter().any(|w| self.goal.is_constraint(w.term))
    }

    /// The merit without the terms that are constraints, and these with their derivatives.
    ///
    /// # Errors
    /// As [`Merit::evaluate`].
    pub fn evaluate_with_limits(
        &self,
        values: &[f64],
        level: DerivativeLevel,
    ) -> Result<LimitedSum, MeritError> {
        let mut sums = vec![SumOfSquares::zero(values.len(), level); self.goal.terms.len()];
        let (mut limits, mut of_light) = (Vec::new(), Vec::new());
        let mut forms = Vec::with_capacity(self.zooms.len());
        self.visit_positions(values, |context| {
            forms.push(context.pupil_forms());
            self.add_terms(context, |term| !self.goal.is_constraint(term), &mut sums)?;
            self.add_mechanical_limits(context, level, &mut limits);
            self.add_light_limits(context, level, &mut of_light);
            self.add_operand_limits(context, level, &mut of_light)
        })?;
        self.average(&mut sums)?;
        let objective = self.weighted_sum(&sums, values.len(), level);
        limits.append(&mut of_light);
        match limits.iter().find(|limit| !limit.is_finite()) {
            Some(limit) => Err(MeritError::NotFinite { term: limit.margin.term }),
            None => Ok(LimitedSum { objective, limits, pupils: PupilForms(forms) }),
        }
    }

    /// The limits that need no rays, which come first among all.
    ///
    /// # Errors
    /// A lens without first-order data.
    pub fn mechanical_limits(
        &self,
        values: &[f64],
        level: DerivativeLevel,
    ) -> Result<Vec<Limit>, MeritError> {
        let mut limits = Vec::new();
        self.visit_without_pupils(values, |context| {
            self.add_mechanical_limits(context, level, &mut limits);
            Ok(())
        })?;
        match limits.iter().find(|limit| !limit.is_finite()) {
            Some(limit) => Err(MeritError::NotFinite { term: limit.margin.term }),
            None => Ok(limits),
        }
    }

    /// The residuals of the terms that need no rays, with their derivatives, as
    /// [`SumOfSquares::separate`] has them.
    ///
    /// # Errors
    /// A lens without first-order data.
    pub fn residuals_without_rays(
        &self,
        values: &[f64],
    ) -> Result<Vec<SeparateResidual>, MeritError> {
        let level = DerivativeLevel::Normal;
        let mut sums = vec![SumOfSquares::zero(values.len(), level); self.goal.terms.len()];
        self.visit_without_pupils(values, |context| {
            self.add_terms(context, Term::is_without_rays, &mut sums)
        })?;
        self.average(&mut sums)?;
        let residuals = self.weighted_sum(&sums, values.len(), level).separate;
        Ok(residuals.into_iter().filter(|residual| residual.is_cheap).collect())
    }

    fn add_mechanical_limits(
        &self,
        context: &EvaluationContext<'_>,
        level: DerivativeLevel,
        limits: &mut Vec<Limit>,
    ) {
        let mut numbers = Vec::new();
        let first = limits.len();
        for weighted in self.goal.terms.iter().filter(|w| self.goal.is_constraint(w.term)) {
            for (number, margin) in self.mechanical_numbers(context, *weighted) {
                numbers.push(number);
                let slope = DVector::zeros(context.values.len());
                limits.push(Limit { margin, slope, weight: weighted.weight });
            }
        }
        if level > DerivativeLevel::Value {
            let slopes = slopes_of_all(context, &numbers, Mechanical::of);
            limits[first..].iter_mut().zip(slopes).for_each(|(limit, slope)| limit.slope = slope);
        }
    }

    /// The limited numbers of a term that need no rays; those that nothing limits are left out, such
    /// as the edge of a gap without rims.
    fn mechanical_numbers(
        &self,
        context: &EvaluationContext<'_>,
        weighted: WeightedTerm,
    ) -> Vec<(Mechanical, ConstraintMargin)> {
        let (number, term) = (context.zoom.zoom, weighted.term);
        if !weighted.scope.has(TermSelection::Zooms, number) {
            return Vec::new();
        }
        if let Term::FocalLength(target) = term {
            let target = Some(self.goal.target(number, target));
            let value = Mechanical::FocalLength.value(context);
            let (term, surface, um) = (term.name(), None, None);
            let margin = ConstraintMargin {
                term,
                surface,
                field: None,
                zoom: number,
                um,
                value,
                min: target,
                max: target,
            };
            return vec![(Mechanical::FocalLength, margin)];
        }
        let measured = |constraint: Constraint| {
            let value = constraint.value(&context.systems.manufactured);
            let margin = constraint.margin(term, number, value);
            (Mechanical::Constraint(constraint), margin)
        };
        let all = smooth_constraints(context.zoom, context.systems, weighted);
        all.into_iter().map(measured).filter(|(_, margin)| margin.value != f64::INFINITY).collect()
    }

    fn add_light_limits(
        &self,
        context: &EvaluationContext<'_>,
        level: DerivativeLevel,
        limits: &mut Vec<Limit>,
    ) {
        let zoom = context.zoom.zoom;
        let here = |w: &&WeightedTerm| w.scope.has(TermSelection::Zooms, zoom);
        let asked = self.goal.terms.iter().filter(|w| self.goal.is_constraint(w.term));
        for weighted in asked.filter(here) {
            let (term, zoom, weight) = (weighted.term.name(), context.zoom.zoom, weighted.weight);
            let mut add =
                |surface, um, found: WithGradient, [min, max]: [Option<f64>; 2], weight| {
                    let WithGradient { value, slope } = found;
                    let (field, value) = (None, value);
                    let margin =
                        ConstraintMargin { term, surface, field, zoom, um, value, min, max };
                    limits.push(Limit { margin, slope, weight });
                };
            match weighted.term {
                Term::Light(share) => {
                    for (pupil, now) in light_shares(context, weighted.scope, level) {
                        let um = context.sampling.channels[pupil.wavelength].um;
                        let part = pupil.weight / total_weight(context, weighted.scope);
                        let weight = weight * part / (share * share);
                        add(Some(pupil.field), Some(um), now, [Some(share), None], weight);
                    }
                }
                Term::MeanLight(share) => {
                    let now = mean_light(context, weighted.scope, level);
                    add(None, None, now, [Some(share), None], weight / (share * share));
                }
                Term::RelativeIllumination { field, min } => {
                    if let Some(found) = relative_illumination(context, field, level) {
                        add(Some(field), None, found, [Some(min), None], weight);
                    }
                }
                Term::FNumber(target) => {
                    if let Some(found) = axial_f_number(context, level) {
                        add(None, None, found, [Some(target); 2], weight);
                    }
                }
                _ => {}
            }
        }
    }
}

impl Merit {
    /// Adds the bounded quantities that are constraints.
    fn add_operand_limits(
        &self,
        context: &EvaluationContext<'_>,
        level: DerivativeLevel,
        limits: &mut Vec<Limit>,
    ) -> Result<(), MeritError> {
        for weighted in self.goal.terms.iter().filter(|w| self.goal.is_constraint(w.term)) {
            for found in operand_values(context, *weighted, level)? {
                let weight = weighted.weight;
                limits.push(Limit { margin: found.margin, slope: found.slope, weight });
            }
        }
        Ok(())
    }

    /// The quantities that terms of the goal bound, with their bounds.
    ///
    /// # Errors
    /// A chief ray that does not reach the image.
    pub fn operand_margins(&self, values: &[f64]) -> Result<Vec<ConstraintMargin>, MeritError> {
        let mut margins = Vec::new();
        self.visit_without_pupils(values, |context| {
            for weighted in &self.goal.terms {
                let found = operand_values(context, *weighted, DerivativeLevel::Value)?;
                margins.extend(found.into_iter().map(|found| found.margin));
            }
            Ok(())
        })?;
        Ok(margins)
    }
}

impl Limit {
    /// The bounds; infinite where there is none.
    pub fn bounds(&self) -> [f64; 2] {
        let ConstraintMargin { min, max, .. } = self.margin;
        [min.unwrap_or(f64::NEG_INFINITY), max.unwrap_or(f64::INFINITY)]
    }

    /// The amount by which the limit is broken, 0 if it is kept.
    pub fn violation(&self) -> f64 {
        (-self.margin.slack()).max(0.0)
    }

    fn is_finite(&self) -> bool {
        self.margin.value.is_finite() && self.slope.iter().all(|v| v.is_finite())
    }
}
