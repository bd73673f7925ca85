//! The decision whether the pupils of lenses with errors are found anew.
//!
//! The forms are known with the motion of the edges of pupils and without it: if that changes the spots
//! of lenses by more than a thousandth, the pupils move in the form and in real lenses alike. The square of
//! the light that moves at the edges, which the form leaves out, counts as a change too. Else real
//! lenses keep the rays of the lens as designed, which takes a fraction of the rays.

use super::pupils::ScenePupils;
use super::{QuadraticForm, RayEffects, ToleranceError};
use crate::lens::ToleranceSheet;
use serde::Serialize;

/// The relative change of the rms of spots from which on pupils move.
const MATTERS: f64 = 1e-3;

/// The decision whether pupils move.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct PupilMotion {
    /// True if the pupils are found anew in lenses with errors, and their edges are a part of the forms.
    pub moves: bool,
    /// The relative change of the rms of spots by the motion: of its mean, and its deviation. `None` where
    /// it is not known.
    pub change: Option<[f64; 2]>,
    /// The reason in words.
    pub reason: String,
    /// The rays of a lens with its pupils found anew, and with those of the lens as designed; `None`
    /// where pupils cannot move.
    pub rays: Option<[usize; 2]>,
}

impl PupilMotion {
    /// Pupils that are held for a reason.
    pub(super) fn held(reason: &str) -> Self {
        Self { moves: false, change: None, reason: reason.to_owned(), rays: None }
    }

    /// By the forms with the motion of edges and without it, each at the fixed image plane and refocused.
    ///
    /// # Errors
    /// Correlations that no errors can have.
    pub(super) fn new(
        pupils: &ScenePupils,
        effects: &RayEffects,
        sheet: &ToleranceSheet,
        (with, without): (&[QuadraticForm; 2], &[QuadraticForm; 2]),
    ) -> Result<Self, ToleranceError> {
        let moved = effects.moved_light();
        let square = deviation(sheet, |i| moved[i]).powi(2);
        let mut change = [0.0_f64; 2];
        for (with, without) in with.iter().zip(without) {
            let (expected, held) = (with.expectation(sheet)?, without.expectation(sheet)?);
            let twice = 2.0 * held.max(f64::MIN_POSITIVE);
            let apart = |i: usize| with.derivatives(i).first - without.derivatives(i).first;
            let mean = ((expected - held) / twice).abs() + square;
            let found = [mean, deviation(sheet, apart) / twice];
            if found[0] + found[1] > change[0] + change[1] {
                change = found;
            }
        }
        let moves = change[0] + change[1] > MATTERS;
        let [mean, deviation] = change.map(|value| 100.0 * value);
        let place = strongest_place(pupils, effects, sheet);
        let numbers = format!("{mean:.2} % of the mean rms, {deviation:.2} % of its scatter");
        let reason = match (moves, place) {
            (true, Some(place)) => format!("{numbers}; most by the {place}"),
            _ => format!("{numbers}, below {} %", 100.0 * MATTERS),
        };
        Ok(Self { moves, change: Some(change), reason, rays: Some(pupils.rays_of_lens()) })
    }
}

/// The standard deviation of a sum of errors, each times a factor; correlations are left out.
fn deviation(sheet: &ToleranceSheet, factor: impl Fn(usize) -> f64) -> f64 {
    let errors = sheet.errors.iter().enumerate();
    errors.map(|(i, own)| (own.deviation() * factor(i)).powi(2)).sum::<f64>().sqrt()
}

/// The limit through which the edge does most to the spots, and its field, in words.
fn strongest_place(
    pupils: &ScenePupils,
    effects: &RayEffects,
    sheet: &ToleranceSheet,
) -> Option<String> {
    let by_field = effects.edges_by_limit();
    let fields = pupils.fields.iter().zip(&by_field);
    let places = fields.flat_map(|(field, limits)| {
        limits.iter().map(move |(ray, by)| (field.number, ray, deviation(sheet, |i| by[i])))
    });
    let (field, ray, _) = places.max_by(|a, b| a.2.total_cmp(&b.2))?;
    Some(format!("{}, field {}", pupils.limit_name(ray), field + 1))
}
