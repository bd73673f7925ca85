//! Terms of light: how much of it gets through, on the axis and off it.
//!
//! All of them are functions of the areas of the pupils; their derivatives are those of the edges.

use super::first_order::{efl, slopes};
use super::sampling::Pupil;
use super::sum::{Detail, Sum};
use super::{Scene, Term};
use crate::pupil::Cost;
use nalgebra::DVector;
use std::f64::consts::PI;

/// A number with its derivatives by the variables.
struct Sloped {
    value: f64,
    slope: DVector<f64>,
}

/// Adds one of the terms about light.
pub(super) fn light(scene: &Scene<'_>, term: Term, sum: &mut Sum) {
    match term {
        Term::Throughput => loss(&mean(scene, sum.detail), 1.0, 0.0, sum),
        Term::ThroughputLoss(full) => loss(&mean(scene, sum.detail), 1.0 / full, 1.0, sum),
        Term::Light(share) => kept(scene, share, sum),
        Term::RelativeIllumination { field, min } => illumination(scene, field, min, sum),
        Term::FNumber(target) => f_number(scene, target, sum),
        _ => {}
    }
}

/// Adds the squares of what the pupils lack of a share of the areas that they began with.
fn kept(scene: &Scene<'_>, share: f64, sum: &mut Sum) {
    for (i, (pupil, before)) in scene.sampling.pupils.iter().zip(scene.start).enumerate() {
        let least = share * before;
        if pupil.area < least {
            let slope = area(scene, sum.detail, |other| other == i, -1.0 / (least * pupil.weight));
            sum.residual(pupil.weight, 1.0 - pupil.area / least, &slope.slope);
        }
    }
}

/// Adds `start − factor × area`. Being no square, it is given to least squares as one: of the root
/// of what the area lacks of twice itself, which has the same derivative.
fn loss(area: &Sloped, factor: f64, start: f64, sum: &mut Sum) {
    sum.value += start - factor * area.value;
    sum.gradient.axpy(-factor, &area.slope, 1.0);
    if sum.detail == Detail::Normal && area.value > 0.0 {
        sum.normal.ger(0.25 * factor / area.value, &area.slope, &area.slope, 1.0);
    }
}

fn illumination(scene: &Scene<'_>, field: usize, min: f64, sum: &mut Sum) {
    let Some(axis) = scene.sampling.axis() else { return };
    let (here, center) = (of_field(scene, field, sum.detail), of_field(scene, axis, sum.detail));
    let cosine = scene.sampling.cosine(field).unwrap_or(1.0);
    let factor = cosine.powi(4) / center.value;
    let share = factor * here.value;
    if share < min {
        let slope = here.slope * factor - center.slope * (share / center.value);
        sum.residual(1.0, min - share, &-slope);
    }
}

fn f_number(scene: &Scene<'_>, target: f64, sum: &mut Sum) {
    let Some(axis) = scene.sampling.axis() else { return };
    let area = of_field(scene, axis, sum.detail);
    let focal = efl(&scene.systems.rimmed[scene.zoom.primary]);
    let diameter = 2.0 * (area.value / PI).sqrt();
    let number = focal.abs() / diameter;
    let by_focal = slopes(scene, sum.detail, efl) * (focal.signum() / diameter);
    let slope = by_focal - area.slope * (0.5 * number / area.value);
    sum.residual(1.0, number - target, &slope);
}

/// The mean area of the pupils by weight, in mm².
fn mean(scene: &Scene<'_>, detail: Detail) -> Sloped {
    area(scene, detail, |_| true, 1.0)
}

/// The area of the pupil of a field, the mean over wavelengths by weight.
fn of_field(scene: &Scene<'_>, field: usize, detail: Detail) -> Sloped {
    let pupils = &scene.sampling.pupils;
    let share: f64 = pupils.iter().filter(|p| p.field == field).map(|p| p.weight).sum();
    area(scene, detail, |i| pupils[i].field == field, 1.0 / share)
}

/// The areas of the pupils of some fields, each by its share and a factor.
fn area(scene: &Scene<'_>, detail: Detail, chosen: impl Fn(usize) -> bool, factor: f64) -> Sloped {
    let pupils = &scene.sampling.pupils;
    let share = |(i, p): (usize, &Pupil)| if chosen(i) { factor * p.weight } else { 0.0 };
    let shares = pupils.iter().enumerate().map(share);
    let value = shares.clone().zip(pupils).map(|(share, pupil)| share * pupil.area).sum();
    let slope = if detail == Detail::Value {
        DVector::zeros(scene.values.len())
    } else {
        let cost = |share| Cost { center: [0.0; 2], square: 0.0, constant: share };
        scene.edge_motion(shares.map(cost))
    };
    Sloped { value, slope }
}
