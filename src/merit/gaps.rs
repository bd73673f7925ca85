//! Terms that keep a lens makeable: thicknesses of glass and air on the axis and at the rim, the
//! length of the lens, room behind it. Each is the square of what is missing, zero where nothing
//! is.

use super::binding::{Systems, Zoom};
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
        Term::Steepness(max) => {
            for surface in 0..=last {
                Number { of: Of::Steepness(surface), scene }.at_most(max, sum);
            }
        }
        Term::SemiDiameter { min, max } => {
            for surface in scene.zoom.rims(scene.systems) {
                let number = Number { of: Of::Rim(surface), scene };
                number.at_least(min, sum);
                number.at_most(max, sum);
            }
        }
        _ => {}
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
        Number { of: Of::Edge { gap, glass }, scene }.at_least(min, sum);
    }
}

impl Zoom {
    /// The gaps of a kind, without the last one, which leads to the image.
    fn inner_gaps(&self, glass: bool) -> impl Iterator<Item = usize> + '_ {
        (0..self.glass.len() - 1).filter(move |gap| self.glass[*gap] == glass)
    }

    /// The surfaces that have a rim.
    fn rims(&self, found: &Systems) -> Vec<usize> {
        let surfaces = &found.rimmed[self.primary].surfaces;
        (0..self.glass.len()).filter(|i| surfaces[*i].semi_diameter.is_finite()).collect()
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
            let system = &zoom.at(&values).rimmed[zoom.primary];
            for gap in 0..zoom.glass.len() - 1 {
                let center = Of::Center(gap).length(system);
                let edge = Of::Edge { gap, glass: zoom.glass[gap] }.length(system);
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

/// A number that a term is about.
#[derive(Clone, Copy)]
enum Of {
    Center(usize),
    /// Glass reaches to the larger semi-diameter of its two surfaces, and elements can touch only
    /// within the smaller one; infinite where neither is limited.
    Edge {
        gap: usize,
        glass: bool,
    },
    Track,
    /// `|curvature| × semi-diameter`: 1 for a hemisphere; 0 where nothing limits the surface.
    Steepness(usize),
    Rim(usize),
}

impl Of {
    /// In mm, lengths counted along the light.
    fn length<R: Real>(self, system: &System<R>) -> R {
        match self {
            Self::Center(gap) => along_light(system, gap),
            Self::Edge { gap, glass } => {
                let (before, behind) = (&system.surfaces[gap], &system.surfaces[gap + 1]);
                let Some(height) = edge_height(before.semi_diameter, behind.semi_diameter, glass)
                else {
                    return R::from_f64(f64::INFINITY);
                };
                let sags = sag_at(behind, height) - sag_at(before, height);
                let sense = if is_backwards(system, gap) { -R::ONE } else { R::ONE };
                along_light(system, gap) + sense * sags
            }
            Self::Track => {
                let gaps = 0..system.surfaces.len() - 1;
                gaps.fold(R::ZERO, |sum, gap| sum + along_light(system, gap))
            }
            Self::Steepness(surface) => {
                let surface = &system.surfaces[surface];
                let limited = surface.semi_diameter.value() < f64::INFINITY;
                if limited {
                    (surface.shape.curvature() * surface.semi_diameter).abs()
                } else {
                    R::ZERO
                }
            }
            Self::Rim(surface) => system.surfaces[surface].semi_diameter,
        }
    }
}

/// The height at which a gap has its edge.
fn edge_height<R: Real>(before: R, behind: R, glass: bool) -> Option<R> {
    let limited = [before, behind].into_iter().filter(|rim| rim.value() < f64::INFINITY);
    let outer = |a: R, b: R| if (a > b) == glass { a } else { b };
    limited.reduce(outer)
}

/// The sag at a height, at the edge of the surface where it ends before.
fn sag_at<R: Real>(surface: &crate::lens::Surface<R>, height: R) -> R {
    let (c, k, _) = surface.shape.numbers();
    let square = (1.0 + k.value()) * c.value() * c.value();
    let edge = if square > 0.0 { 0.999 / square.sqrt() } else { f64::INFINITY };
    let height = if height.value() < edge { height } else { R::from_f64(edge) };
    surface.shape.sag(height * height).map_or(R::ZERO, |(z, _)| z)
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
        self.of.length(&self.scene.systems.rimmed[self.scene.zoom.primary])
    }

    fn residual(&self, r: f64, sum: &mut Sum) {
        let slope = slopes(self.scene, sum.detail, |system: &System<Along>| self.of.length(system));
        sum.residual(1.0, r, &slope);
    }
}
