//! Terms that keep a lens makeable: thicknesses of glass and air on the axis and at the rim, the
//! length of the lens, room behind it. Each is the square of what is missing, zero where nothing
//! is.

use super::binding::Zoom;
use super::first_order::slopes;
use super::sum::Sum;
use super::{Along, MeritError, Scene, Term};
use crate::lens::{Lens, System};
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
    for gap in scene.zoom.inner_gaps(glass) {
        let number = Number { of: Of::Center(gap), scene };
        number.at_least(min, sum);
        number.at_most(max, sum);
    }
}

fn edges(scene: &Scene<'_>, glass: bool, min: f64, sum: &mut Sum) {
    for gap in scene.zoom.inner_gaps(glass) {
        let Some(height) = scene.zoom.rim(gap) else { continue };
        Number { of: Of::Edge(gap, height), scene }.at_least(min, sum);
    }
}

impl Zoom {
    /// The gaps of a kind, without the last one, which leads to the image.
    fn inner_gaps(&self, glass: bool) -> impl Iterator<Item = usize> + '_ {
        (0..self.glass.len() - 1).filter(move |gap| self.glass[*gap] == glass)
    }

    /// The height at which a gap has its edge: glass reaches to the larger semi-diameter of its two
    /// surfaces, and elements can touch only within the smaller one.
    fn rim(&self, gap: usize) -> Option<f64> {
        let sizes = [self.rims[gap], self.rims.get(gap + 1).copied().flatten()];
        let edge = if self.glass[gap] { f64::max } else { f64::min };
        sizes.into_iter().flatten().reduce(edge)
    }
}

/// The smallest thicknesses that a lens has at any zoom position, in mm; infinite where it has no
/// such gap.
#[derive(Debug, Clone, Copy)]
pub(super) struct Slimmest {
    pub(super) glass_center: f64,
    pub(super) glass_edge: f64,
    pub(super) air_center: f64,
    pub(super) air_edge: f64,
}

impl Slimmest {
    pub(super) fn of(lens: &Lens) -> Result<Self, MeritError> {
        let none = f64::INFINITY;
        let mut found =
            Self { glass_center: none, glass_edge: none, air_center: none, air_edge: none };
        for number in 0..lens.zoom_positions() {
            let zoom = Zoom::new(lens, number)?;
            let values: Vec<f64> =
                lens.variables.iter().map(|v| lens.get(v.parameter).unwrap_or(0.0)).collect();
            let system = &zoom.at(&values).systems[zoom.primary];
            for gap in 0..zoom.glass.len() - 1 {
                let center = Of::Center(gap).length(system);
                let edge = zoom.rim(gap).map_or(none, |h| Of::Edge(gap, h).length(system));
                let (to_center, to_edge) = if zoom.glass[gap] {
                    (&mut found.glass_center, &mut found.glass_edge)
                } else {
                    (&mut found.air_center, &mut found.air_edge)
                };
                *to_center = to_center.min(center);
                *to_edge = to_edge.min(edge);
            }
        }
        Ok(found)
    }
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
