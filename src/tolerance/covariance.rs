//! The covariance of the numbers of surfaces in lenses that are made.
//!
//! To first order every error of making is a combination of few numbers of surfaces: an element that
//! tilts by `α` about a pivot turns each of its surfaces by `α` and displaces it by `α` times its
//! distance from the pivot, a roll has its pivot at a centre of curvature, an irregularity adds to the
//! coefficients of r⁴ and y². Errors of the same kind in the same place add their variances, so that
//! the covariance is as large as the lens, however many tolerances there are.

use super::ToleranceError;
use super::perturb::slope_changes;
use crate::lens::{Perturbation, PerturbationKind, System, ToleranceSheet};
use crate::trace::ErrorNumber;
use std::collections::BTreeMap;

/// A number of a surface that errors of making change.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub struct MadeNumber {
    /// The surface.
    pub surface: usize,
    /// The number itself.
    pub kind: MadeKind,
}

/// The kind of a number that errors of making change.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum MadeKind {
    /// A number on which rays depend alike at every wavelength.
    Number(ErrorNumber),
    /// The relative change of the Abbe number behind the surface.
    Abbe,
}

impl MadeKind {
    /// True if the number takes a lens that is symmetric to the plane x = 0 to its mirror image where
    /// its sign changes.
    pub fn is_odd(self) -> bool {
        matches!(self, Self::Number(ErrorNumber::DecenterX | ErrorNumber::TiltY))
    }

    /// True if the number moves or turns a surface across the axis.
    pub fn is_lateral(self) -> bool {
        self.is_odd() || matches!(self, Self::Number(ErrorNumber::DecenterY | ErrorNumber::TiltX))
    }
}

/// The distance of a surface from the pivot of a body that tilts, as it depends on the lens.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct LeverArm {
    /// The place of the displaced number of the surface.
    pub number: usize,
    /// The displacement over the independent error and the distance: 1 or −1 for the tilt alone.
    pub sign: f64,
    /// The first surface of the body, from which the distance counts.
    pub first: usize,
    /// The surface.
    pub surface: usize,
    /// The derivative of the distance by the curvature of the first surface, about whose centre the
    /// body rolls; 0 for a pivot at its vertex.
    pub by_curvature: f64,
}

/// An independent error by which bodies tilt.
#[derive(Debug, Clone, PartialEq)]
pub struct TiltingBody {
    /// Its variance: for one body that of the tilt.
    pub variance: f64,
    /// The changes of the numbers of surfaces by one unit of it, by their places.
    pub changes: Vec<(usize, f64)>,
    /// The distances on which these depend.
    pub arms: Vec<LeverArm>,
}

/// The covariance of the numbers of surfaces that errors of making change.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct NumberCovariance {
    /// The numbers, in order.
    pub numbers: Vec<MadeNumber>,
    /// For each number the places of those that vary with it, and their covariances.
    pub rows: Vec<Vec<(usize, f64)>>,
    /// The bodies that tilt.
    pub bodies: Vec<TiltingBody>,
}

/// The change of numbers by one unit of an error.
pub(super) struct NumberChanges {
    pub(super) changes: Vec<(MadeNumber, f64)>,
    /// The pivot of a tilt: the radius at whose centre it stands, 0 for the vertex.
    tilt: Option<f64>,
}

/// An error of making that is independent of all others: one of a kind and place, or what errors that are
/// correlated have in common.
#[derive(Debug, Clone, PartialEq)]
pub struct IndependentError {
    /// The errors that it adds to, and their changes by one unit of it.
    pub parts: Vec<(Perturbation, f64)>,
    /// Its variance.
    pub variance: f64,
}

/// The independent errors of some tolerances. Those of the same kind in the same place are one.
///
/// # Errors
/// Correlations that no errors can have.
pub fn independent_errors(sheet: &ToleranceSheet) -> Result<Vec<IndependentError>, ToleranceError> {
    let groups = sheet.correlated_errors()?;
    let mut is_alone = vec![true; sheet.errors.len()];
    groups.iter().flat_map(|group| &group.errors).for_each(|error| is_alone[*error] = false);
    let mut variances: BTreeMap<Perturbation, f64> = BTreeMap::new();
    for (tolerance, _) in sheet.errors.iter().zip(&is_alone).filter(|(_, alone)| **alone) {
        *variances.entry(tolerance.error).or_insert(0.0) += tolerance.deviation().powi(2);
    }
    variances.retain(|_, variance| *variance > 0.0);
    let alone = variances.into_iter();
    let mut independent: Vec<IndependentError> = alone
        .map(|(error, variance)| IndependentError { parts: vec![(error, 1.0)], variance })
        .collect();
    for group in &groups {
        let count = group.errors.len();
        independent.extend((0..count).map(|k| {
            let part = |i: usize| {
                let own = &sheet.errors[group.errors[i]];
                (own.error, own.deviation() * group.factor[(i, k)])
            };
            let parts = (k..count).map(part).filter(|(_, factor)| *factor != 0.0).collect();
            IndependentError { parts, variance: 1.0 }
        }));
    }
    Ok(independent)
}

/// The changes of numbers by each part of an independent error.
type PartChanges = Vec<(Perturbation, f64, NumberChanges)>;

impl NumberCovariance {
    /// The covariance that independent errors give the numbers of a lens. The unit of an irregularity is
    /// the semi-diameter of its surface.
    pub fn new(errors: &[IndependentError], system: &System<f64>, semi_diameters: &[f64]) -> Self {
        let vertices = system.vertex_positions();
        let of = |error: &IndependentError| -> PartChanges {
            let changes = |(error, factor): &(Perturbation, f64)| {
                (*error, *factor, number_changes(*error, system, &vertices, semi_diameters))
            };
            error.parts.iter().map(changes).collect()
        };
        let effects: Vec<PartChanges> = errors.iter().map(of).collect();
        let mut covariance = Self::with_numbers(effects.iter().flatten());
        for (error, parts) in errors.iter().zip(&effects) {
            covariance.add(error.variance, parts);
        }
        covariance
    }

    /// No covariance yet of the numbers that errors change; an Abbe number comes with its index.
    fn with_numbers<'a>(
        effects: impl Iterator<Item = &'a (Perturbation, f64, NumberChanges)>,
    ) -> Self {
        let mut numbers: Vec<MadeNumber> = Vec::new();
        for (number, _) in effects.flat_map(|(_, _, effect)| &effect.changes) {
            numbers.push(*number);
            if number.kind == MadeKind::Abbe {
                numbers.push(MadeNumber { kind: MadeKind::Number(ErrorNumber::Index), ..*number });
            }
        }
        numbers.sort_unstable();
        numbers.dedup();
        let rows = vec![Vec::new(); numbers.len()];
        Self { numbers, rows, bodies: Vec::new() }
    }

    /// The place of a number.
    pub fn place(&self, number: MadeNumber) -> Option<usize> {
        self.numbers.binary_search(&number).ok()
    }

    /// Adds an independent error.
    fn add(&mut self, variance: f64, parts: &PartChanges) {
        let mut sums: BTreeMap<usize, f64> = BTreeMap::new();
        let mut arms = Vec::new();
        for (error, factor, effect) in parts {
            for (number, by) in &effect.changes {
                if let Some(place) = self.place(*number) {
                    *sums.entry(place).or_insert(0.0) += factor * by;
                }
            }
            if let Some(radius) = effect.tilt {
                arms.extend(self.arms((*error, *factor), effect, radius));
            }
        }
        let places: Vec<(usize, f64)> = sums.into_iter().collect();
        for (row, by_row) in &places {
            for (column, by_column) in &places {
                let product = variance * by_row * by_column;
                let entries = &mut self.rows[*row];
                match entries.iter_mut().find(|(place, _)| place == column) {
                    Some((_, sum)) => *sum += product,
                    None => entries.push((*column, product)),
                }
            }
        }
        if !arms.is_empty() {
            self.bodies.push(TiltingBody { variance, changes: places, arms });
        }
    }

    /// The distances on which the changes by a tilt depend, which is `factor` times an independent error.
    fn arms(
        &self,
        (error, factor): (Perturbation, f64),
        effect: &NumberChanges,
        radius: f64,
    ) -> Vec<LeverArm> {
        let arm = |(number, _): &(MadeNumber, f64)| {
            let MadeNumber { surface, kind } = *number;
            let sign = match kind {
                MadeKind::Number(ErrorNumber::DecenterX) => factor,
                MadeKind::Number(ErrorNumber::DecenterY) => -factor,
                _ => return None,
            };
            // The distance is Z − Z₁ − 1/c.
            let by_curvature = radius * radius;
            let number = self.place(*number)?;
            Some(LeverArm { number, sign, first: error.first, surface, by_curvature })
        };
        effect.changes.iter().filter_map(arm).collect()
    }

    /// The covariance times a vector, number by number.
    pub fn times(&self, vector: &[f64]) -> Vec<f64> {
        let sum = |row: &Vec<(usize, f64)>| row.iter().map(|(i, v)| v * vector[*i]).sum();
        self.rows.iter().map(sum).collect()
    }
}

/// The changes of numbers by one unit of an error.
pub(super) fn number_changes(
    error: Perturbation,
    system: &System<f64>,
    vertices: &[f64],
    semi_diameters: &[f64],
) -> NumberChanges {
    let Perturbation { kind, first, last } = error;
    let at = |surface: usize, number: ErrorNumber| MadeNumber {
        surface,
        kind: MadeKind::Number(number),
    };
    let alone = |number: ErrorNumber| vec![(at(first, number), 1.0)];
    let radius = 1.0 / system.surfaces[first].shape.curvature();
    let tilt = match kind {
        PerturbationKind::ElementTiltX | PerturbationKind::ElementTiltY => Some(0.0),
        PerturbationKind::ElementRollX | PerturbationKind::ElementRollY => Some(radius),
        _ => None,
    };
    let body = |number: ErrorNumber| (first..=last).map(|i| (at(i, number), 1.0)).collect();
    let turned = |turn: ErrorNumber, shift: ErrorNumber, sign: f64| {
        let arm = |i: usize| vertices[i] - vertices[first] - tilt.unwrap_or(0.0);
        let both = |i: usize| [(at(i, turn), 1.0), (at(i, shift), sign * arm(i))];
        (first..=last).flat_map(both).collect()
    };
    let changes = match kind {
        PerturbationKind::Curvature => alone(ErrorNumber::Curvature),
        PerturbationKind::Conic => alone(ErrorNumber::Conic),
        PerturbationKind::Asphere => alone(ErrorNumber::Fourth),
        PerturbationKind::Irregularity => {
            let square = semi_diameters[first].powi(2);
            let fourth = (at(first, ErrorNumber::Fourth), 0.5 / (square * square));
            vec![fourth, (at(first, ErrorNumber::Astigmatism), 0.5 / square)]
        }
        PerturbationKind::AsphereSlope => {
            let [curvature, fourth] = slope_changes(semi_diameters[first]);
            let numbers = [ErrorNumber::Curvature, ErrorNumber::Fourth].map(|own| at(first, own));
            vec![(numbers[0], curvature), (numbers[1], fourth)]
        }
        PerturbationKind::Thickness => alone(ErrorNumber::Thickness),
        PerturbationKind::ThicknessAdjusted => {
            let number = ErrorNumber::Thickness;
            vec![(at(first, number), 1.0), (at(first + 1, number), -1.0)]
        }
        PerturbationKind::Index => alone(ErrorNumber::Index),
        PerturbationKind::Abbe => vec![(MadeNumber { surface: first, kind: MadeKind::Abbe }, 1.0)],
        PerturbationKind::SurfaceDecenterX => alone(ErrorNumber::DecenterX),
        PerturbationKind::SurfaceDecenterY => alone(ErrorNumber::DecenterY),
        PerturbationKind::SurfaceTiltX => alone(ErrorNumber::TiltX),
        PerturbationKind::SurfaceTiltY => alone(ErrorNumber::TiltY),
        PerturbationKind::ElementDecenterX => body(ErrorNumber::DecenterX),
        PerturbationKind::ElementDecenterY => body(ErrorNumber::DecenterY),
        PerturbationKind::ElementTiltX | PerturbationKind::ElementRollX => {
            turned(ErrorNumber::TiltX, ErrorNumber::DecenterY, -1.0)
        }
        PerturbationKind::ElementTiltY | PerturbationKind::ElementRollY => {
            turned(ErrorNumber::TiltY, ErrorNumber::DecenterX, 1.0)
        }
    };
    NumberChanges { changes, tilt }
}
