//! Constraints that keep a lens manufacturable: centre and edge thicknesses of glass and air, total
//! track, back focus, steepness, semi-diameters. Each contributes the square of its violation, zero
//! where it is satisfied.

use super::binding::{Configuration, ResolvedSystems};
use super::first_order::slopes_of_all;
use super::sum::{DerivativeLevel, SumOfSquares};
use super::{EvaluationContext, MeritError, Term, WeightedTerm};
use crate::analysis::clear_semi_diameters;
use crate::lens::{Lens, SurfaceNumber, System, TermScope, TermSelection};
use crate::math::Real;
use crate::pupil::RayModel;
use crate::solve::SeparateResidual;
use nalgebra::DVector;
use serde::Serialize;

/// Adds the squared violations of one of the constraints.
pub(super) fn add_constraints(
    context: &EvaluationContext<'_>,
    weighted: WeightedTerm,
    sum: &mut SumOfSquares,
) {
    let all = smooth_constraints(context.zoom, context.systems, weighted);
    let violations = |constraint: &Constraint| {
        let length: f64 = constraint.value(&context.systems.manufactured);
        let below = constraint.min.map(|min| (-1.0, min - length));
        let above = constraint.max.map(|max| (1.0, length - max));
        below.into_iter().chain(above)
    };
    // Only a model of the sum needs limits that are kept.
    let matters = |constraint: &Constraint| {
        sum.level == DerivativeLevel::Normal || violations(constraint).any(|(_, by)| by > 0.0)
    };
    let all: Vec<Constraint> = all.into_iter().filter(matters).collect();
    let slopes = if sum.level > DerivativeLevel::Value && !all.is_empty() {
        slopes_of_all(context, &all, Constraint::value)
    } else {
        vec![DVector::zeros(context.values.len()); all.len()]
    };
    for (constraint, slope) in all.iter().zip(slopes) {
        for (sign, violation) in violations(constraint) {
            let (value, slope) = (violation, &slope * sign);
            let residual = SeparateResidual { value, slope, is_one_sided: true, is_cheap: true };
            sum.add_separate(1.0, &residual);
        }
    }
}

/// A quantity of a lens with its bounds.
pub(super) struct Constraint {
    quantity: ConstrainedQuantity,
    min: Option<f64>,
    max: Option<f64>,
}

impl Constraint {
    /// Its value, in mm or as a ratio; infinite if the lens does not limit it.
    pub(super) fn value<R: Real>(&self, system: &System<R>) -> R {
        self.quantity.length(system)
    }

    /// Its margin, with a value.
    pub(super) fn margin(&self, term: Term, zoom: usize, value: f64) -> ConstraintMargin {
        let Self { quantity, min, max } = self;
        let (term, surface) = (term.name(), quantity.surface());
        let (min, max) = (*min, *max);
        ConstraintMargin { term, surface, field: None, zoom, um: None, value, min, max }
    }

    /// True if it belongs to the scope of its term.
    fn is_in(&self, scope: TermScope) -> bool {
        self.quantity.surface().is_none_or(|surface| scope.has(TermSelection::Surfaces, surface))
    }
}

/// The constraints of a term, with glass limited at both of its rims instead of at the larger one:
/// the larger one may change from one rim to the other, and the maximum has a kink there that
/// misleads a search.
pub(super) fn smooth_constraints(
    zoom: &Configuration,
    systems: &ResolvedSystems,
    weighted: WeightedTerm,
) -> Vec<Constraint> {
    let Term::GlassEdge(min) = weighted.term else {
        return constraints(zoom, systems, weighted);
    };
    let at = |gap, rim| Constraint {
        quantity: ConstrainedQuantity::Edge { gap, rim, clear: zoom.clear_rims(gap) },
        min: Some(min),
        max: None,
    };
    let both = |gap| [at(gap, EdgeRadius::Front), at(gap, EdgeRadius::Rear)];
    let all = zoom.inner_gaps(true).flat_map(both);
    all.filter(|constraint| constraint.is_in(weighted.scope)).collect()
}

/// The constraints of a term within its scope.
fn constraints(
    zoom: &Configuration,
    systems: &ResolvedSystems,
    weighted: WeightedTerm,
) -> Vec<Constraint> {
    if !weighted.scope.has(TermSelection::Zooms, zoom.zoom) {
        return Vec::new();
    }
    let mut all = constraints_everywhere(zoom, systems, weighted.term);
    all.retain(|constraint| constraint.is_in(weighted.scope));
    all
}

/// The constraints of a term.
fn constraints_everywhere(
    zoom: &Configuration,
    systems: &ResolvedSystems,
    term: Term,
) -> Vec<Constraint> {
    let last = zoom.is_glass.len() - 1;
    let both = |quantity, min, max| Constraint { quantity, min: Some(min), max: Some(max) };
    let least = |quantity, min| Constraint { quantity, min: Some(min), max: None };
    let most = |quantity, max| Constraint { quantity, min: None, max: Some(max) };
    let gaps = |glass| zoom.inner_gaps(glass);
    let edge = |gap, rim| ConstrainedQuantity::Edge { gap, rim, clear: zoom.clear_rims(gap) };
    let steepness = |surface| {
        let [clear, _] = zoom.clear_rims(surface);
        ConstrainedQuantity::Steepness { surface, clear }
    };
    match term {
        Term::GlassCenter { min, max } => {
            gaps(true).map(|gap| both(ConstrainedQuantity::Center(gap), min, max)).collect()
        }
        Term::AirCenter { min, max } => {
            gaps(false).map(|gap| both(ConstrainedQuantity::Center(gap), min, max)).collect()
        }
        Term::GlassEdge(min) => {
            gaps(true).map(|gap| least(edge(gap, EdgeRadius::Larger), min)).collect()
        }
        Term::AirEdge(min) => {
            gaps(false).map(|gap| least(edge(gap, EdgeRadius::Smaller), min)).collect()
        }
        Term::TotalTrack(max) => vec![most(ConstrainedQuantity::Track, max)],
        Term::BackFocus(min) => vec![least(ConstrainedQuantity::Center(last), min)],
        Term::Steepness(max) => (0..=last).map(|i| most(steepness(i), max)).collect(),
        Term::SemiDiameter { min, max } => zoom
            .clipping_surfaces(systems)
            .into_iter()
            .map(|i| both(ConstrainedQuantity::Rim(i), min, max))
            .collect(),
        _ => Vec::new(),
    }
}

/// A constrained quantity of a lens with its value and its bounds.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct ConstraintMargin {
    /// The name of the term.
    pub term: &'static str,
    /// The surface, or the one in front of the gap, counted from 0; the field if it limits fields;
    /// `None` for the whole lens.
    pub surface: Option<usize>,
    /// The field, counted from 0, of a quantity that belongs to a surface and a field.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub field: Option<usize>,
    /// The zoom position, counted from 0.
    pub zoom: usize,
    /// The wavelength in micrometres if the light at one of them is limited.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub um: Option<f64>,
    /// Its value: in mm, or a ratio for a steepness or for light.
    pub value: f64,
    /// The lower bound.
    pub min: Option<f64>,
    /// The upper bound.
    pub max: Option<f64>,
}

/// The limits of single fields.
const FIELD_LIMITS: [&str; 4] = ["light", "relative_illumination", "clear_area", "distortion"];

impl ConstraintMargin {
    /// The constrained surface, or the field with the wavelength, as it is displayed; `None` for the
    /// whole lens.
    pub fn place(&self) -> Option<String> {
        let Some(index) = self.surface else {
            return self.field.map(|field| format!("field {field}"));
        };
        if let Some(field) = self.field {
            return Some(format!("surface {}, field {field}", SurfaceNumber::new(index)));
        }
        Some(match self.um {
            Some(um) => format!("field {index} at {um} um"),
            None if FIELD_LIMITS.contains(&self.term) => format!("field {index}"),
            None => format!("surface {}", SurfaceNumber::new(index)),
        })
    }

    /// The limited quantity with its place and its bounds, in words.
    pub fn name(&self) -> String {
        let place = self.place().map_or(String::new(), |place| format!(" of {place}"));
        let zoom =
            if self.zoom > 0 { format!(" at zoom position {}", self.zoom) } else { String::new() };
        let bounds = match (self.min, self.max) {
            (Some(min), Some(max)) if min == max => format!("= {}", rounded(min)),
            (Some(min), Some(max)) => format!("from {} to {}", rounded(min), rounded(max)),
            (Some(min), None) => format!(">= {}", rounded(min)),
            (None, max) => format!("<= {}", rounded(max.unwrap_or(f64::INFINITY))),
        };
        format!("{}{place}{zoom} {bounds}", self.term.replace('_', " "))
    }

    /// The distance to the nearest bound, negative if the constraint is violated.
    pub fn slack(&self) -> f64 {
        let below = self.min.map_or(f64::INFINITY, |min| self.value - min);
        below.min(self.max.map_or(f64::INFINITY, |max| max - self.value))
    }
}

/// A bound with six digits: one that was computed has as many as there are.
fn rounded(bound: f64) -> f64 {
    format!("{bound:.5e}").parse().unwrap_or(bound)
}

/// The constrained quantities of a lens for some terms, with their bounds.
///
/// # Errors
/// A lens that cannot be resolved.
pub fn constraint_margins(
    lens: &Lens,
    terms: impl Iterator<Item = WeightedTerm>,
) -> Result<Vec<ConstraintMargin>, MeritError> {
    let terms: Vec<WeightedTerm> = terms.collect();
    let mut found = Vec::new();
    let mut clear = None;
    for number in 0..lens.zoom_positions() {
        let mut zoom = Configuration::new(lens, number)?;
        if terms.iter().any(|weighted| weighted.term.concerns_rims()) {
            let clear = clear.get_or_insert_with(|| automatic_rims(lens));
            zoom.set_clear_rims(clear);
        }
        let values: Vec<f64> =
            lens.variables.iter().map(|v| lens.get(v.parameter).unwrap_or(0.0)).collect();
        let systems = zoom.at(&values)?;
        for weighted in &terms {
            let margin = |constraint: Constraint| {
                constraint.margin(weighted.term, number, constraint.value(&systems.manufactured))
            };
            // An unlimited quantity, such as the edge of a gap that no light reaches, is infinite.
            let all = constraints(&zoom, &systems, *weighted).into_iter().map(margin);
            found.extend(all.filter(|margin| margin.value.is_finite()));
        }
    }
    Ok(found)
}

impl Configuration {
    /// The gaps of glass, or of air, without the last one, which leads to the image.
    fn inner_gaps(&self, glass: bool) -> impl Iterator<Item = usize> + '_ {
        (0..self.is_glass.len() - 1).filter(move |gap| self.is_glass[*gap] == glass)
    }

    /// The surfaces with a finite semi-diameter.
    fn clipping_surfaces(&self, found: &ResolvedSystems) -> Vec<usize> {
        let surfaces = &found.manufactured.surfaces;
        (0..self.is_glass.len()).filter(|i| surfaces[*i].semi_diameter.is_finite()).collect()
    }
}

/// The smallest thicknesses of a lens over all zoom positions, in mm; infinite if it has no such
/// gap.
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
        let clear = automatic_rims(lens);
        for number in 0..lens.zoom_positions() {
            let mut zoom = Configuration::new(lens, number)?;
            zoom.set_clear_rims(&clear);
            let values: Vec<f64> =
                lens.variables.iter().map(|v| lens.get(v.parameter).unwrap_or(0.0)).collect();
            let system = &zoom.at(&values)?.manufactured;
            for gap in 0..zoom.is_glass.len() - 1 {
                let center = ConstrainedQuantity::Center(gap).length(system);
                let rim = if zoom.is_glass[gap] { EdgeRadius::Larger } else { EdgeRadius::Smaller };
                let clear = zoom.clear_rims(gap);
                let edge = ConstrainedQuantity::Edge { gap, rim, clear }.length(system);
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

/// A quantity that a constraint limits.
#[derive(Clone, Copy)]
enum ConstrainedQuantity {
    Center(usize),
    /// The thickness at a rim; infinite if the surfaces have none. `clear` are the semi-diameters of
    /// the light at both surfaces, which stand for rims that nobody has fixed.
    Edge {
        gap: usize,
        rim: EdgeRadius,
        clear: [f64; 2],
    },
    Track,
    /// `|curvature| × semi-diameter`: 1 for a hemisphere; 0 if the surface has no rim.
    Steepness {
        surface: usize,
        clear: f64,
    },
    Rim(usize),
}

/// The radius at which the edge thickness of a gap is measured.
#[derive(Clone, Copy)]
enum EdgeRadius {
    /// Glass reaches to the larger semi-diameter of its two surfaces.
    Larger,
    /// Elements can touch only within the smaller one.
    Smaller,
    /// The semi-diameter of the surface in front.
    Front,
    /// The semi-diameter of the surface behind.
    Rear,
}

impl EdgeRadius {
    /// The radius; `None` if the surfaces have no rim.
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
            Self::Center(at)
            | Self::Edge { gap: at, .. }
            | Self::Steepness { surface: at, .. }
            | Self::Rim(at) => Some(at),
            Self::Track => None,
        }
    }

    /// Its value, lengths in mm along the direction of light.
    fn length<R: Real>(self, system: &System<R>) -> R {
        match self {
            Self::Center(gap) => along_light(system, gap),
            Self::Edge { gap, rim, clear } => {
                let (before, behind) = (&system.surfaces[gap], &system.surfaces[gap + 1]);
                let rims = [made_rim(before, clear[0]), made_rim(behind, clear[1])];
                let Some(height) = rim.height(rims[0], rims[1]) else {
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
            Self::Steepness { surface, clear } => {
                let surface = &system.surfaces[surface];
                let rim = made_rim(surface, clear);
                if rim.value() < f64::INFINITY {
                    (surface.curvature() * rim).abs()
                } else {
                    R::ZERO
                }
            }
            Self::Rim(surface) => system.surfaces[surface].semi_diameter,
        }
    }
}

/// The semi-diameter of a surface: as it is fixed, or that of the light.
fn made_rim<R: Real>(surface: &crate::lens::Surface<R>, clear: f64) -> R {
    let fixed = surface.semi_diameter;
    if fixed.value() < f64::INFINITY { fixed } else { R::from_f64(clear) }
}

/// The clear semi-diameters in mm of the surfaces whose rims nobody has fixed; infinite for the others
/// and where no light arrives.
pub(super) fn automatic_rims(lens: &Lens) -> Vec<f64> {
    let is_automatic = |row: &crate::lens::Row| row.semi_diameter.is_none();
    let open = vec![f64::INFINITY; lens.surfaces.len()];
    if !lens.surfaces.iter().any(is_automatic) {
        return open;
    }
    let positions = 0..lens.zoom_positions();
    let models: Vec<RayModel> =
        positions.filter_map(|zoom| RayModel::from_lens(lens, zoom).ok()).collect();
    let clear = clear_semi_diameters(&models);
    let rows = lens.surfaces.iter().zip(clear.into_iter().chain(open));
    let rim = |(row, clear): (&crate::lens::Row, f64)| {
        if is_automatic(row) && clear > 0.0 { clear } else { f64::INFINITY }
    };
    rows.map(rim).collect()
}

/// The sag at a distance from the axis, or close to the edge of the surface if it ends before.
pub(super) fn sag_at<R: Real>(surface: &crate::lens::Surface<R>, height: R) -> R {
    // The slope of the sag is infinite at the edge itself.
    let edge = 0.999 * surface.shape.edge();
    let height = if height.value() < edge { height } else { R::from_f64(edge) };
    surface.shape.sag(height * height).map_or(R::ZERO, |(z, _)| z)
}

pub(super) fn along_light<R: Real>(system: &System<R>, gap: usize) -> R {
    system.light_direction(gap) * system.surfaces[gap].thickness
}
