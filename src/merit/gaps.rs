//! Terms that keep a lens makeable: thicknesses of glass and air on the axis and at the rim, the
//! length of the lens, room behind it. Each is the square of what is missing, zero where nothing
//! is.

use super::first_order::slopes;
use super::sum::Sum;
use super::{Along, Scene, Term};
use crate::lens::System;
use crate::math::Real;

/// Adds one of the terms about gaps.
pub(super) fn gaps(scene: &Scene<'_>, term: Term, sum: &mut Sum) {
    let last = scene.zoom.glass.len() - 1;
    match term {
        Term::GlassCenter { min, max } => centers(scene, true, (min, max), sum),
        Term::AirCenter { min, max } => centers(scene, false, (min, max), sum),
        Term::GlassEdge(min) => edges(scene, true, min, sum),
        Term::AirEdge(min) => edges(scene, false, min, sum),
        Term::TotalTrack(max) => {
            let number = Number { of: Of::Track, scene };
            number.at_most(max, sum);
        }
        Term::BackFocus(min) => {
            let number = Number { of: Of::Center(last), scene };
            number.at_least(min, sum);
        }
        Term::Spot | Term::Distortion | Term::FocalLength(_) => {}
    }
}

fn centers(scene: &Scene<'_>, glass: bool, (min, max): (f64, f64), sum: &mut Sum) {
    for gap in inner_gaps(scene, glass) {
        let number = Number { of: Of::Center(gap), scene };
        number.at_least(min, sum);
        number.at_most(max, sum);
    }
}

fn edges(scene: &Scene<'_>, glass: bool, min: f64, sum: &mut Sum) {
    for gap in inner_gaps(scene, glass) {
        let rims = &scene.zoom.rims;
        let sizes = [rims[gap], rims.get(gap + 1).copied().flatten()];
        let Some(height) = sizes.into_iter().flatten().reduce(f64::max) else { continue };
        Number { of: Of::Edge(gap, height), scene }.at_least(min, sum);
    }
}

/// The gaps of a kind, without the last one, which leads to the image.
fn inner_gaps(scene: &Scene<'_>, glass: bool) -> Vec<usize> {
    let count = scene.zoom.glass.len() - 1;
    (0..count).filter(|gap| scene.zoom.glass[*gap] == glass).collect()
}

/// A length that a term is about.
#[derive(Clone, Copy)]
enum Of {
    Center(usize),
    Edge(usize, f64),
    Track,
}

impl Of {
    /// In mm, counted along the light.
    fn length<R: Real>(self, system: &System<R>) -> R {
        match self {
            Self::Center(gap) => along_light(system, gap),
            Self::Edge(gap, height) => {
                let (before, behind) = (&system.surfaces[gap], &system.surfaces[gap + 1]);
                let sags = sag_at(behind, height) - sag_at(before, height);
                let sense = if is_backwards(system, gap) { -R::ONE } else { R::ONE };
                along_light(system, gap) + sense * sags
            }
            Self::Track => {
                let gaps = 0..system.surfaces.len() - 1;
                gaps.fold(R::ZERO, |sum, gap| sum + along_light(system, gap))
            }
        }
    }
}

/// The sag at a height, at the edge of the surface where it ends before.
fn sag_at<R: Real>(surface: &crate::lens::Surface<R>, height: f64) -> R {
    let (c, k, _) = surface.shape.numbers();
    let square = (1.0 + k.value()) * c.value() * c.value();
    let edge = if square > 0.0 { 0.999 / square.sqrt() } else { f64::INFINITY };
    let height = height.min(edge);
    surface.shape.sag(R::from_f64(height * height)).map_or(R::ZERO, |(z, _)| z)
}

fn is_backwards<R>(system: &System<R>, gap: usize) -> bool {
    system.surfaces[..=gap].iter().filter(|surface| surface.mirror).count() % 2 == 1
}

fn along_light<R: Real>(system: &System<R>, gap: usize) -> R {
    let thickness = system.surfaces[gap].thickness;
    if is_backwards(system, gap) { -thickness } else { thickness }
}

/// A length of a lens, to be kept on one side of a bound.
struct Number<'a> {
    of: Of,
    scene: &'a Scene<'a>,
}

impl Number<'_> {
    fn at_least(&self, min: f64, sum: &mut Sum) {
        let length = self.value();
        if length < min {
            self.residual(length - min, sum);
        }
    }

    fn at_most(&self, max: f64, sum: &mut Sum) {
        let length = self.value();
        if length > max {
            self.residual(length - max, sum);
        }
    }

    fn value(&self) -> f64 {
        self.of.length(&self.scene.systems.systems[self.scene.zoom.primary])
    }

    fn residual(&self, r: f64, sum: &mut Sum) {
        let slope = slopes(self.scene, sum.detail, |system: &System<Along>| self.of.length(system));
        sum.residual(1.0, r, &slope);
    }
}
