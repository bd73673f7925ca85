//! The range over which a drag can move the numbers of a lens, and the cause of its ends.

use crate::lens::{Lens, Parameter, Quantity, Row, SurfaceNumber};
use std::fmt;

/// The largest part of the radius at which a surface ends that its rim may reach.
const MAX_STEEPNESS: f64 = 0.999;

/// The cause that ends the range of a number.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum DragLimit {
    /// A gap would change its sign.
    Gap(SurfaceNumber),
    /// A surface would end inside its rim.
    Rim(SurfaceNumber),
    /// A variable is at its bound.
    Bound(Parameter),
    /// The number is positive.
    Positive,
    /// A field angle has reached its largest value.
    FieldAngle,
    /// A numerical aperture has reached its largest value.
    Aperture,
    /// There are no more surfaces.
    LensEnd,
}

impl fmt::Display for DragLimit {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Gap(surface) => write!(f, "the gap after surface {surface} is used up"),
            Self::Rim(surface) => write!(f, "surface {surface} would not reach its rim"),
            Self::Bound(parameter) => write!(f, "the {parameter} is at the bound of its variable"),
            Self::Positive => f.write_str("it cannot be smaller"),
            Self::FieldAngle => f.write_str("the field angle cannot be larger"),
            Self::Aperture => f.write_str("the aperture cannot be larger"),
            Self::LensEnd => f.write_str("the lens ends there"),
        }
    }
}

/// The range of a parameter in a drag, with what ends it below and above: gaps keep their sign,
/// surfaces reach their rims, variables stay between their bounds.
pub(super) fn parameter_range(lens: &Lens, parameter: Parameter) -> [(f64, DragLimit); 2] {
    let [mut low, mut high] = natural_range(lens, parameter);
    if let Some(variable) = lens.variable(parameter) {
        let bound = DragLimit::Bound(parameter);
        if let Some(min) = variable.min.filter(|min| *min > low.0) {
            low = (min, bound);
        }
        if let Some(max) = variable.max.filter(|max| *max < high.0) {
            high = (max, bound);
        }
    }
    [low, high]
}

fn natural_range(lens: &Lens, parameter: Parameter) -> [(f64, DragLimit); 2] {
    let surface = SurfaceNumber::new(parameter.surface);
    let row = lens.row_at(parameter.surface, parameter.zoom).unwrap_or_default();
    match parameter.quantity {
        Quantity::Curvature => {
            let most = steepest(&row);
            [-most, most].map(|end| (end, DragLimit::Rim(surface)))
        }
        Quantity::SemiDiameter => {
            let edge = MAX_STEEPNESS * row.shape().edge();
            [(0.0, DragLimit::Positive), (edge, DragLimit::Rim(surface))]
        }
        Quantity::Thickness => {
            let limit = DragLimit::Gap(surface);
            if lens.light_direction(parameter.surface) < 0.0 {
                [(f64::NEG_INFINITY, limit), (0.0, limit)]
            } else {
                [(0.0, limit), (f64::INFINITY, limit)]
            }
        }
        _ => [(f64::NEG_INFINITY, DragLimit::Positive), (f64::INFINITY, DragLimit::Positive)],
    }
}

/// The largest curvature with which a surface reaches its rim, in 1/mm.
fn steepest(row: &Row) -> f64 {
    let rim = row.semi_diameter.unwrap_or(0.0);
    let square = (1.0 + row.conic) * rim * rim;
    if square > 0.0 && !row.hyperhemisphere { MAX_STEEPNESS / square.sqrt() } else { f64::INFINITY }
}
