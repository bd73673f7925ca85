//! Terms that keep a lens makeable: thicknesses of glass and air on the axis and at the rim, the
//! length of the lens, room behind it. Each is the square of what is missing, zero where nothing
//! is.

use super::binding::{Configuration, ResolvedSystems};
use super::first_order::slopes;
use super::sum::SumOfSquares;
use super::{Dual1, EvaluationContext, MeritError, Term};
use crate::lens::{Lens, System};
use crate::math::Real;
use serde::Serialize;

/// Adds one of the terms about gaps.
pub(super) fn add_constraints(scene: &EvaluationContext<'_>, term: Term, sum: &mut SumOfSquares) {
    for Constraint { quantity: of, min, max } in smooth_constraints(scene.zoom, scene.systems, term)
    {
        let number = BoundedLength { quantity: of, scene };
        min.into_iter().for_each(|min| number.at_least(min, sum));
        max.into_iter().for_each(|max| number.at_most(max, sum));
    }
}

/// A number of a lens and what it may be.
struct Constraint {
    quantity: ConstrainedQuantity,
    min: Option<f64>,
    max: Option<f64>,
}

/// What a term limits, with glass limited at each of its two rims in place of the larger one: which
/// of them is larger may change, and no search would find its way along that edge.
fn smooth_constraints(
    zoom: &Configuration,
    systems: &ResolvedSystems,
    term: Term,
) -> Vec<Constraint> {
    let Term::GlassEdge(min) = term else { return constraints(zoom, systems, term) };
    let at = |gap, rim| Constraint {
        quantity: ConstrainedQuantity::Edge { gap, rim },
        min: Some(min),
        max: None,
    };
    let both = |gap| [at(gap, EdgeRadius::Front), at(gap, EdgeRadius::Rear)];
    zoom.inner_gaps(true).flat_map(both).collect()
}

/// Everything that a term limits.
fn constraints(zoom: &Configuration, systems: &ResolvedSystems, term: Term) -> Vec<Constraint> {
    let last = zoom.is_glass.len() - 1;
    let both = |of, min, max| Constraint { quantity: of, min: Some(min), max: Some(max) };
    let least = |of, min| Constraint { quantity: of, min: Some(min), max: None };
    let most = |of, max| Constraint { quantity: of, min: None, max: Some(max) };
    let gaps = |glass| zoom.inner_gaps(glass);
    match term {
        Term::GlassCenter { min, max } => {
            gaps(true).map(|gap| both(ConstrainedQuantity::Center(gap), min, max)).collect()
        }
        Term::AirCenter { min, max } => {
            gaps(false).map(|gap| both(ConstrainedQuantity::Center(gap), min, max)).collect()
        }
        Term::GlassEdge(min) => gaps(true)
            .map(|gap| least(ConstrainedQuantity::Edge { gap, rim: EdgeRadius::Larger }, min))
            .collect(),
        Term::AirEdge(min) => gaps(false)
            .map(|gap| least(ConstrainedQuantity::Edge { gap, rim: EdgeRadius::Smaller }, min))
            .collect(),
        Term::TotalTrack(max) => vec![most(ConstrainedQuantity::Track, max)],
        Term::BackFocus(min) => vec![least(ConstrainedQuantity::Center(last), min)],
        Term::Steepness(max) => {
            (0..=last).map(|i| most(ConstrainedQuantity::Steepness(i), max)).collect()
        }
        Term::SemiDiameter { min, max } => zoom
            .clipping_surfaces(systems)
            .into_iter()
            .map(|i| both(ConstrainedQuantity::Rim(i), min, max))
            .collect(),
        _ => Vec::new(),
    }
}

/// A number of a lens that a term limits.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct ConstraintMargin {
    /// Which term.
    pub term: &'static str,
    /// The surface, or the one in front of the gap; the field where it is light that is limited; none
    /// for the whole lens.
    pub surface: Option<usize>,
    /// The zoom position.
    pub zoom: usize,
    /// What it is: mm, or a ratio for a steepness.
    pub value: f64,
    /// Not less than this.
    pub min: Option<f64>,
    /// Not more than this.
    pub max: Option<f64>,
}

impl ConstraintMargin {
    /// By how much it is inside of what it may be, less than 0 outside.
    pub fn slack(&self) -> f64 {
        let below = self.min.map_or(f64::INFINITY, |min| self.value - min);
        below.min(self.max.map_or(f64::INFINITY, |max| max - self.value))
    }
}

/// Every number of a lens that one of these terms limits, with what it may be.
///
/// # Errors
/// A lens that cannot be resolved.
pub fn constraint_margins(
    lens: &Lens,
    terms: impl Iterator<Item = Term>,
) -> Result<Vec<ConstraintMargin>, MeritError> {
    let terms: Vec<Term> = terms.collect();
    let mut found = Vec::new();
    for number in 0..lens.zoom_positions() {
        let zoom = Configuration::new(lens, number)?;
        let values: Vec<f64> =
            lens.variables.iter().map(|v| lens.get(v.parameter).unwrap_or(0.0)).collect();
        let systems = zoom.at(&values);
        for term in &terms {
            let margin = |Constraint { quantity: of, min, max }: Constraint| ConstraintMargin {
                term: term.name(),
                surface: of.surface(),
                zoom: number,
                value: of.length(&systems.clipped[zoom.primary]),
                min,
                max,
            };
            // What nothing limits, like the edge of a gap without rims, has no number.
            let all = constraints(&zoom, &systems, *term).into_iter().map(margin);
            found.extend(all.filter(|margin| margin.value.is_finite()));
        }
    }
    Ok(found)
}

impl Configuration {
    /// The gaps of a kind, without the last one, which leads to the image.
    fn inner_gaps(&self, glass: bool) -> impl Iterator<Item = usize> + '_ {
        (0..self.is_glass.len() - 1).filter(move |gap| self.is_glass[*gap] == glass)
    }

    /// The surfaces that have a rim.
    fn clipping_surfaces(&self, found: &ResolvedSystems) -> Vec<usize> {
        let surfaces = &found.clipped[self.primary].surfaces;
        (0..self.is_glass.len()).filter(|i| surfaces[*i].semi_diameter.is_finite()).collect()
    }
}

/// The smallest thicknesses that a lens has at any zoom position, in mm; infinite where it has no
/// such gap.
#[derive(Debug, Clone, Copy)]
pub(super) struct MinimumThickness {
    pub(super) glass_center: f64,
    pub(super) glass_edge: f64,
    pub(super) air_center: f64,
    pub(super) air_edge: f64,
}

impl MinimumThickness {
    pub(super) fn measure(lens: &Lens) -> Result<Self, MeritError> {
        let none = f64::INFINITY;
        let mut found =
            Self { glass_center: none, glass_edge: none, air_center: none, air_edge: none };
        for number in 0..lens.zoom_positions() {
            let zoom = Configuration::new(lens, number)?;
            let values: Vec<f64> =
                lens.variables.iter().map(|v| lens.get(v.parameter).unwrap_or(0.0)).collect();
            let system = &zoom.at(&values).clipped[zoom.primary];
            for gap in 0..zoom.is_glass.len() - 1 {
                let center = ConstrainedQuantity::Center(gap).length(system);
                let rim = if zoom.is_glass[gap] { EdgeRadius::Larger } else { EdgeRadius::Smaller };
                let edge = ConstrainedQuantity::Edge { gap, rim }.length(system);
                let (to_center, to_edge) = if zoom.is_glass[gap] {
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
enum ConstrainedQuantity {
    Center(usize),
    /// The thickness at a rim; infinite where that is not limited.
    Edge {
        gap: usize,
        rim: EdgeRadius,
    },
    Track,
    /// `|curvature| × semi-diameter`: 1 for a hemisphere; 0 where nothing limits the surface.
    Steepness(usize),
    Rim(usize),
}

/// Where a gap has its edge.
#[derive(Clone, Copy)]
enum EdgeRadius {
    /// Glass reaches to the larger semi-diameter of its two surfaces.
    Larger,
    /// Elements can touch only within the smaller one.
    Smaller,
    /// That of the surface in front.
    Front,
    /// That of the one behind.
    Rear,
}

impl EdgeRadius {
    /// Its semi-diameter; none where nothing limits it.
    fn height<R: Real>(self, front: R, rear: R) -> Option<R> {
        let limited = |rim: &R| rim.value() < f64::INFINITY;
        let both = [front, rear].into_iter().filter(limited);
        match self {
            Self::Larger => both.reduce(|a, b| if a > b { a } else { b }),
            Self::Smaller => both.reduce(|a, b| if a > b { b } else { a }),
            Self::Front => Some(front).filter(limited),
            Self::Rear => Some(rear).filter(limited),
        }
    }
}

impl ConstrainedQuantity {
    fn surface(self) -> Option<usize> {
        match self {
            Self::Center(at) | Self::Edge { gap: at, .. } | Self::Steepness(at) | Self::Rim(at) => {
                Some(at)
            }
            Self::Track => None,
        }
    }

    /// In mm, lengths counted along the light.
    fn length<R: Real>(self, system: &System<R>) -> R {
        match self {
            Self::Center(gap) => along_light(system, gap),
            Self::Edge { gap, rim } => {
                let (before, behind) = (&system.surfaces[gap], &system.surfaces[gap + 1]);
                let Some(height) = rim.height(before.semi_diameter, behind.semi_diameter) else {
                    return R::from_f64(f64::INFINITY);
                };
                let sags = sag_at(behind, height) - sag_at(before, height);
                let sense = system.light_direction(gap);
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

/// The sag at a distance from the axis, or near the edge of the surface where it ends before.
fn sag_at<R: Real>(surface: &crate::lens::Surface<R>, height: R) -> R {
    // The slope of the sag is infinite at the edge itself.
    let edge = 0.999 * surface.shape.edge();
    let height = if height.value() < edge { height } else { R::from_f64(edge) };
    surface.shape.sag(height * height).map_or(R::ZERO, |(z, _)| z)
}

fn along_light<R: Real>(system: &System<R>, gap: usize) -> R {
    system.light_direction(gap) * system.surfaces[gap].thickness
}

/// A length of a lens, to be kept on one side of a bound.
struct BoundedLength<'a> {
    quantity: ConstrainedQuantity,
    scene: &'a EvaluationContext<'a>,
}

impl BoundedLength<'_> {
    fn at_least(&self, min: f64, sum: &mut SumOfSquares) {
        let length = self.value();
        if length < min {
            self.residual(length - min, sum);
        }
    }

    fn at_most(&self, max: f64, sum: &mut SumOfSquares) {
        let length = self.value();
        if length > max {
            self.residual(length - max, sum);
        }
    }

    fn value(&self) -> f64 {
        self.quantity.length(&self.scene.systems.clipped[self.scene.zoom.primary])
    }

    fn residual(&self, r: f64, sum: &mut SumOfSquares) {
        let slope =
            slopes(self.scene, sum.level, |system: &System<Dual1>| self.quantity.length(system));
        sum.add_residual(1.0, r, &slope);
    }
}
