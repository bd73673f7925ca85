//! Random lenses: `p_global` of (4.14).

use super::open_apertures::with_open_rims;
use super::summary::focal_length_of;
use super::variables::MAX_CURVATURE;
use crate::lens::{Lens, Medium, Parameter, Quantity, paraxial_image_distance};
use crate::search::{Random, SearchRules};
use rand::RngExt as _;

/// The maximum random gap, relative to the focal length.
const MAX_GAP: f64 = 0.2;
/// The maximum factor by which a random lens is scaled to the focal length.
const MAX_RESCALING: f64 = 4.0;

/// A random lens with the structure of `lens`. Variable curvatures and gaps are drawn uniformly, or, for a
/// `spread` below 1, that part of the way from those of the lens to such ones;
/// then the lens is scaled to a focal length in mm, focused, and its apertures opened as far as
/// there is room. `None` if it does not focus.
pub(super) fn random_lens(
    lens: &Lens,
    rules: &SearchRules,
    (focal_length, spread): (f64, f64),
    random: &mut Random,
) -> Option<Lens> {
    let mut drawn = lens.clone();
    let widest = lens.surfaces.iter().filter_map(|row| row.semi_diameter).fold(0.0, f64::max);
    let scattered: Vec<Parameter> = lens.variables.iter().map(|v| v.parameter).collect();
    for parameter in &scattered {
        let range = match parameter.quantity {
            Quantity::Curvature => [-MAX_CURVATURE / focal_length, MAX_CURVATURE / focal_length],
            Quantity::Thickness => {
                let is_glass = lens.surfaces[parameter.surface].medium != Medium::Air;
                let [min, _] = if is_glass { rules.glass_center } else { rules.air_center };
                [min, min.max(MAX_GAP * focal_length)]
            }
            _ => continue,
        };
        let value = range[0] + (range[1] - range[0]) * random.random::<f64>();
        let own = lens.get(*parameter).filter(|_| spread < 1.0);
        drawn.set(*parameter, own.map_or(value, |own| own + spread * (value - own)));
    }
    let drawn = drawn.with_pickups().ok()?;
    let factor = focal_length / focal_length_of(&drawn)?;
    if !(1.0 / MAX_RESCALING..=MAX_RESCALING).contains(&factor) {
        return None;
    }
    let mut scaled = drawn.clone();
    for parameter in &scattered {
        let value = drawn.get(*parameter)?;
        match parameter.quantity {
            Quantity::Curvature => scaled.set(*parameter, value / factor),
            Quantity::Thickness => scaled.set(*parameter, value * factor),
            _ => continue,
        };
    }
    let system = scaled.resolve(0, scaled.wavelengths[scaled.primary()].um).ok()?;
    let last = Parameter::new(scaled.surfaces.len() - 1, Quantity::Thickness);
    let gap = paraxial_image_distance(&system, scaled.object);
    if !(gap > 0.0) {
        return None;
    }
    if scattered.contains(&last) {
        scaled.set(last, gap);
    }
    Some(with_open_rims(scaled, rules.semi_diameter.unwrap_or(widest)))
}
