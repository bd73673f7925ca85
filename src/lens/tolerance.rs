//! The tolerances of a lens: how large each error of making may be, and how it is distributed.

use super::check::check_number;
use super::correlation::correlated_errors;
use super::{
    AdjustedPart, Compensator, CorrelatedErrors, ErrorCorrelation, LensError, Perturbation,
    PerturbationKind,
};
use serde::{Deserialize, Serialize};

/// The distribution of an error between plus and minus its half range.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum ErrorDistribution {
    /// Normal with half of the half range as its standard deviation, cut at the half range.
    #[default]
    NormalCut,
    /// Normal with half of the half range as its standard deviation, not cut.
    Normal,
    /// The same density everywhere.
    Uniform,
    /// A density that grows with the square of the error: parts at the ends of their tolerance.
    Parabolic,
    /// Always at one of the two ends.
    Ends,
}

impl ErrorDistribution {
    /// The standard deviation for a half range of 1.
    pub fn deviation(self) -> f64 {
        match self {
            // A standard normal variable cut at ±2 has the variance 1 − 4 φ(2)/(2 Φ(2) − 1).
            Self::NormalCut => 0.5 * 0.879_625_661_034_239_8,
            Self::Normal => 0.5,
            Self::Uniform => 1.0 / 3.0_f64.sqrt(),
            Self::Parabolic => 0.6_f64.sqrt(),
            Self::Ends => 1.0,
        }
    }
}

/// The tolerance of one error of making.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(from = "ToleranceJson", into = "ToleranceJson")]
pub struct Tolerance {
    /// The error.
    pub error: Perturbation,
    /// Half of the permitted range, in the unit of the error (angles in radians).
    pub half_range: f64,
    /// The distribution.
    pub distribution: ErrorDistribution,
}

impl Tolerance {
    /// The standard deviation of the error, in its unit.
    pub fn deviation(&self) -> f64 {
        self.half_range * self.distribution.deviation()
    }
}

/// A class of care in making.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum ToleranceGrade {
    /// The accuracy of every shop.
    Commercial,
    /// The accuracy of a good shop without a surcharge.
    #[default]
    Precision,
    /// The limit of a good shop.
    ShopLimit,
    /// Moulded plastic elements of a few millimetres.
    MouldedPlastic,
}

impl ToleranceGrade {
    /// Every class with its name, from the loosest to the tightest, moulded plastic last.
    pub const ALL: [(Self, &'static str); 4] = [
        (Self::Commercial, "Commercial"),
        (Self::Precision, "Precision"),
        (Self::ShopLimit, "Shop limit"),
        (Self::MouldedPlastic, "Moulded plastic"),
    ];
}

/// The tolerances of a lens, and what is adjusted after it is assembled.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ToleranceSheet {
    /// The tolerances.
    pub errors: Vec<Tolerance>,
    /// The largest displacement of the image plane by which focus is adjusted, in mm; `None` for an
    /// unlimited one.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub focus_travel: Option<f64>,
    /// The parts that are adjusted besides focus.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub compensators: Vec<Compensator>,
    /// The errors that are not independent.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub correlations: Vec<ErrorCorrelation>,
}

/// The keys of a tolerance in a file: angles in degrees.
#[derive(Clone, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct ToleranceJson {
    kind: PerturbationKind,
    first: usize,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    last: Option<usize>,
    half_range: f64,
    #[serde(default)]
    distribution: ErrorDistribution,
}

impl From<ToleranceJson> for Tolerance {
    fn from(keys: ToleranceJson) -> Self {
        let ToleranceJson { kind, first, last, half_range, distribution } = keys;
        let error = Perturbation { kind, first, last: last.unwrap_or(first) };
        let half_range = if kind.is_angle() { half_range.to_radians() } else { half_range };
        Self { error, half_range, distribution }
    }
}

impl From<Tolerance> for ToleranceJson {
    fn from(tolerance: Tolerance) -> Self {
        let Tolerance { error: Perturbation { kind, first, last }, half_range, distribution } =
            tolerance;
        let half_range = if kind.is_angle() { half_range.to_degrees() } else { half_range };
        Self { kind, first, last: (last != first).then_some(last), half_range, distribution }
    }
}

impl ToleranceSheet {
    /// Independent tolerances of lenses that are refocused without end.
    pub fn of_errors(errors: Vec<Tolerance>) -> Self {
        Self { errors, ..Self::default() }
    }

    /// The groups of errors that are not independent.
    ///
    /// # Errors
    /// Coefficients that no errors can have, and errors that do not exist.
    pub fn correlated_errors(&self) -> Result<Vec<CorrelatedErrors>, LensError> {
        correlated_errors(&self.correlations, self.errors.len())
    }

    /// Adds a compensator in place of one of the same part.
    pub fn set_compensator(&mut self, compensator: Compensator) {
        if compensator.part == AdjustedPart::Focus {
            self.focus_travel = Some(compensator.travel);
            return;
        }
        self.compensators.retain(|own| own.part != compensator.part);
        self.compensators.push(compensator);
    }

    /// Removes an error, from correlations too; a number that is none changes nothing.
    pub fn remove_error(&mut self, number: usize) {
        if number >= self.errors.len() {
            return;
        }
        self.errors.remove(number);
        for ErrorCorrelation { errors, .. } in &mut self.correlations {
            errors.retain(|own| *own != number);
            errors.iter_mut().for_each(|own| *own -= usize::from(*own > number));
        }
        self.correlations.retain(|correlation| correlation.errors.len() > 1);
    }

    fn check_compensators(&self, surfaces: usize) -> Result<(), LensError> {
        for (place, compensator) in self.compensators.iter().enumerate() {
            compensator.check(surfaces)?;
            if self.compensators[..place].iter().any(|other| other.part == compensator.part) {
                let name = compensator.part.name();
                let text = format!("the compensator `{name}` of one part is there twice");
                return Err(LensError::Inconsistent(text));
            }
        }
        Ok(())
    }

    /// Checks the numbers and that the surfaces exist; `surfaces` is their number.
    pub(super) fn check(&self, surfaces: usize) -> Result<(), LensError> {
        for (place, Tolerance { error, half_range, .. }) in self.errors.iter().enumerate() {
            let name = format!("errors[{place}] of the tolerances (`{}`)", error.kind.name());
            let what = format_args!("half range of {name}");
            check_number(what, *half_range, *half_range >= 0.0, "zero or more")?;
            let (first, last) = (error.first + 1, error.last + 1);
            let refuse = |expected: &str| {
                let text = format!("{name} names surfaces {first} to {last}; expected {expected}");
                Err(LensError::Inconsistent(text))
            };
            if first > last {
                return refuse("the first one in front of the last one");
            }
            if last > surfaces {
                return refuse(&format!("1 to {surfaces}"));
            }
            if first != last && !error.kind.moves_a_body() {
                return refuse("one: `last` is for elements and groups");
            }
        }
        let travel = self.focus_travel.unwrap_or(0.0);
        check_number("travel of the focus", travel, travel >= 0.0, "zero or more, in mm")?;
        self.check_compensators(surfaces)?;
        self.correlated_errors().map(|_| ())
    }

    /// Maps the surfaces of all tolerances and compensators; those of which one is mapped to `None` are
    /// removed, from correlations too.
    pub(super) fn renumber(&mut self, map: impl Fn(PerturbationKind, usize) -> Option<usize>) {
        let mapped = |part: Perturbation| {
            let Perturbation { kind, first, last } = part;
            let ends = (map(kind, first)?, map(kind, last)?);
            let (first, last) = (ends.0.min(ends.1), ends.0.max(ends.1));
            Some(Perturbation { kind, first, last })
        };
        let mut places = Vec::with_capacity(self.errors.len());
        let mut kept = Vec::with_capacity(self.errors.len());
        for tolerance in &self.errors {
            let error = mapped(tolerance.error);
            places.push(error.map(|_| kept.len()));
            kept.extend(error.map(|error| Tolerance { error, ..*tolerance }));
        }
        self.errors = kept;
        for ErrorCorrelation { errors, .. } in &mut self.correlations {
            *errors = errors.iter().filter_map(|i| places.get(*i).copied()?).collect();
        }
        self.correlations.retain(|correlation| correlation.errors.len() > 1);
        let compensator = |own: &Compensator| {
            let part = match own.part {
                AdjustedPart::Lens(part) => AdjustedPart::Lens(mapped(part)?),
                other => other,
            };
            Some(Compensator { part, ..*own })
        };
        self.compensators = self.compensators.iter().filter_map(compensator).collect();
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn correlations_follow_the_errors_that_stay() {
        let error = |surface| Tolerance {
            error: Perturbation::of_surface(PerturbationKind::Thickness, surface),
            half_range: 0.1,
            distribution: ErrorDistribution::default(),
        };
        let mut sheet = ToleranceSheet::of_errors((0..4).map(error).collect());
        let correlation =
            |errors: &[usize]| ErrorCorrelation { errors: errors.to_vec(), coefficient: 0.5 };
        sheet.correlations = vec![correlation(&[0, 1]), correlation(&[0, 2, 3])];
        sheet.remove_error(1);
        assert_eq!(sheet.errors.len(), 3);
        assert_eq!(sheet.correlations, [correlation(&[0, 1, 2])]);
        sheet.remove_error(7);
        assert_eq!(sheet.errors.len(), 3);
    }
}
