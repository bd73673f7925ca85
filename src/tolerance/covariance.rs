//! The covariance of the numbers of surfaces in lenses that are made.
//!
//! To first order every error of making is a combination of few numbers of surfaces: an element that
//! tilts by `α` about a pivot turns each of its surfaces by `α` and displaces it by `α` times its
//! distance from the pivot, a roll has its pivot at a centre of curvature, an irregularity adds to the
//! coefficients of r⁴ and y². Errors of the same kind in the same place add their variances, so that
//! the covariance is as large as the lens, however many tolerances there are.

use crate::lens::{Perturbation, PerturbationKind, System, Tolerance};
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
    /// The displacement over the tilt and the distance: 1 or −1.
    pub sign: f64,
    /// The first surface of the body, from which the distance counts.
    pub first: usize,
    /// The surface.
    pub surface: usize,
    /// The derivative of the distance by the curvature of the first surface, about whose centre the
    /// body rolls; 0 for a pivot at its vertex.
    pub by_curvature: f64,
}

/// A body that tilts.
#[derive(Debug, Clone, PartialEq)]
pub struct TiltingBody {
    /// The variance of its tilt.
    pub variance: f64,
    /// The changes of the numbers of its surfaces over the tilt, by their places.
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

impl NumberCovariance {
    /// The covariance that tolerances give the numbers of a lens. The unit of an irregularity is the
    /// semi-diameter of its surface.
    pub fn new(tolerances: &[Tolerance], system: &System<f64>, semi_diameters: &[f64]) -> Self {
        let mut variances: BTreeMap<Perturbation, f64> = BTreeMap::new();
        for tolerance in tolerances {
            *variances.entry(tolerance.error).or_insert(0.0) += tolerance.deviation().powi(2);
        }
        variances.retain(|_, variance| *variance > 0.0);
        let vertices = system.vertex_positions();
        let of = |error: &Perturbation| number_changes(*error, system, &vertices, semi_diameters);
        let effects: Vec<(Perturbation, f64, NumberChanges)> =
            variances.iter().map(|(error, variance)| (*error, *variance, of(error))).collect();
        let mut covariance = Self::with_numbers(&effects);
        for (error, variance, effect) in &effects {
            covariance.add(*error, *variance, effect);
        }
        covariance
    }

    /// No covariance yet of the numbers that errors change; an Abbe number comes with its index.
    fn with_numbers(effects: &[(Perturbation, f64, NumberChanges)]) -> Self {
        let mut numbers: Vec<MadeNumber> = Vec::new();
        for (number, _) in effects.iter().flat_map(|(_, _, effect)| &effect.changes) {
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

    fn add(&mut self, error: Perturbation, variance: f64, effect: &NumberChanges) {
        let places: Vec<(usize, f64)> =
            effect.changes.iter().filter_map(|(n, by)| Some((self.place(*n)?, *by))).collect();
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
        if let Some(radius) = effect.tilt {
            let arms = self.arms(error, &places, radius);
            self.bodies.push(TiltingBody { variance, changes: places, arms });
        }
    }

    /// The distances on which the changes by a tilt depend.
    fn arms(&self, error: Perturbation, places: &[(usize, f64)], radius: f64) -> Vec<LeverArm> {
        let arm = |(number, _): &(usize, f64)| {
            let MadeNumber { surface, kind } = self.numbers[*number];
            let sign = match kind {
                MadeKind::Number(ErrorNumber::DecenterX) => 1.0,
                MadeKind::Number(ErrorNumber::DecenterY) => -1.0,
                _ => return None,
            };
            // The distance is Z − Z₁ − 1/c.
            let by_curvature = radius * radius;
            Some(LeverArm { number: *number, sign, first: error.first, surface, by_curvature })
        };
        places.iter().filter_map(arm).collect()
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
