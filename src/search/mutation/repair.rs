//! Repair of a mutated lens: finds missing semi-diameters, trims rims to where surfaces do not
//! cross, and refuses what is not a lens.
//!
//! The semi-diameter of a new surface follows from the rays that pass it, limited by the edge
//! thickness of its glass and of the air beside it. Existing rims shrink only where their surfaces
//! would cross.

use super::refusal::Refusal;
use crate::lens::{Lens, System};
use crate::paraxial::Beam;
use crate::pupil::{Aiming, RayModel, RayModelError};
use crate::search::SearchRules;
use crate::search::element::glass_gaps;
use crate::trace::{Ray, Tracer};

/// Pupil points of the rays that determine the width of a beam; some lie outside the paraxial
/// pupil, where the stop clips them if it is the limit.
const FAN: [[f64; 2]; 13] = [
    [0.0, 0.0],
    [0.0, 0.3],
    [0.0, -0.3],
    [0.0, 0.6],
    [0.0, -0.6],
    [0.0, 0.85],
    [0.0, -0.85],
    [0.0, 1.0],
    [0.0, -1.0],
    [0.0, 1.15],
    [0.0, -1.15],
    [0.6, 0.0],
    [1.0, 0.0],
];

/// The factor on the height of the outermost ray, so that rounding does not clip it at the rim.
const MARGIN: f64 = 1.01;

/// Finds the semi-diameters of the `rimless` rows and trims those of the others.
///
/// # Errors
/// The reason that it is not a lens: surfaces that cross on the axis, no light, a system that
/// cannot be traced, or a limit of the rules that the lens `before` satisfied or violated by less.
pub(super) fn repair(
    before: &Lens,
    lens: &mut Lens,
    rimless: &[usize],
    rules: &SearchRules,
) -> Result<(), Refusal> {
    check_vertex_order(lens)?;
    check_limits(before, lens, rules)?;
    for row in rimless {
        lens.surfaces[*row].semi_diameter = Some(largest_semi_diameter(lens, *row, rules));
    }
    trim_rims(lens, rimless, rules);
    let extents = ray_extents(lens)?;
    let found: Vec<f64> = rimless.iter().map(|row| MARGIN * extents[*row]).collect();
    let common = found.iter().fold(0.0, |most: f64, found| most.max(*found));
    for row in rimless {
        let rim = &mut lens.surfaces[*row].semi_diameter;
        *rim = rim.map(|most| most.min(common));
    }
    Ok(())
}

/// Checks that no vertex lies in front of the previous one.
fn check_vertex_order(lens: &Lens) -> Result<(), Refusal> {
    for row in 0..lens.surfaces.len() - 1 {
        let sense = lens.light_direction(row);
        for zoom in 0..lens.zoom_positions() {
            let gap = sense * lens.thickness_at(row, zoom).unwrap_or(0.0);
            if !(gap >= 0.0) {
                return Err(Refusal::CrossingSurfaces);
            }
        }
    }
    Ok(())
}

/// Checks the limits of the rules on the whole lens.
fn check_limits(before: &Lens, lens: &Lens, rules: &SearchRules) -> Result<(), Refusal> {
    let last = |lens: &Lens, zoom| lens.thickness_at(lens.surfaces.len() - 1, zoom).unwrap_or(0.0);
    let track = |lens: &Lens, zoom| {
        let rows = 0..lens.surfaces.len();
        rows.filter_map(|row| lens.thickness_at(row, zoom)).map(f64::abs).sum::<f64>()
    };
    for zoom in 0..lens.zoom_positions() {
        let (long, was) = (track(lens, zoom), track(before, zoom));
        if rules.track.is_some_and(|most| long > most.max(was)) {
            return Err(Refusal::TooLong);
        }
        if lens.image_solve.is_some() {
            continue;
        }
        let (back, was) = (last(lens, zoom).abs(), last(before, zoom).abs());
        if rules.back_focus.is_some_and(|least| back < least.min(was)) {
            return Err(Refusal::BackFocusTooShort);
        }
    }
    Ok(())
}

/// The largest semi-diameter that the rules permit for a surface by itself.
fn largest_semi_diameter(lens: &Lens, row: usize, rules: &SearchRules) -> f64 {
    let curvature = lens.surfaces[row].curvature.abs();
    let steep = if curvature > 0.0 { rules.steepness / curvature } else { f64::INFINITY };
    let rims = lens.surfaces.iter().filter_map(|row| row.semi_diameter);
    // A beam is assumed nowhere wider than twice the widest surface.
    let most = rims.fold(0.0, f64::max);
    let natural = if most > 0.0 { 2.0 * most } else { f64::INFINITY };
    steep.min(rules.semi_diameter.unwrap_or(f64::INFINITY)).min(natural)
}

/// Shrinks rims until every gap has its minimum edge thickness: that of the rules beside new
/// surfaces, 0 elsewhere.
fn trim_rims(lens: &mut Lens, rimless: &[usize], rules: &SearchRules) {
    let glass = glass_gaps(lens);
    for gap in 0..lens.surfaces.len() - 1 {
        let new = [gap, gap + 1].map(|row| rimless.contains(&row));
        let floor = match (new.contains(&true), glass[gap + 1]) {
            (false, _) => 0.0,
            (true, true) => rules.glass_edge,
            (true, false) => rules.air_edge,
        };
        let Some(most) = clear_height(lens, gap, floor) else { continue };
        for (row, new_row) in [gap, gap + 1].into_iter().zip(new) {
            // The size of the stop is the aperture; beside a new surface only the new one gives
            // way.
            let stays = !new_row && (lens.surfaces[row].stop || new.contains(&true));
            let rim = &mut lens.surfaces[row].semi_diameter;
            if !stays && rim.is_none_or(|rim| rim > most) {
                *rim = Some(most);
            }
        }
    }
}

/// The height up to which a gap is at least as long as `floor`; `None` if it is up to the rim.
fn clear_height(lens: &Lens, gap: usize, floor: f64) -> Option<f64> {
    let rim = |row: usize| lens.surfaces[row].semi_diameter.unwrap_or(f64::INFINITY);
    let rim = rim(gap).min(rim(gap + 1));
    if rim == f64::INFINITY {
        return None;
    }
    let sense = lens.light_direction(gap);
    let zooms = (0..lens.zoom_positions()).filter_map(|zoom| lens.thickness_at(gap, zoom));
    let center = zooms.fold(f64::INFINITY, |least, length| least.min(sense * length));
    let (front, rear) = (lens.surfaces[gap].shape(), lens.surfaces[gap + 1].shape());
    let floor = floor.min(center);
    let is_clear = |height: f64| {
        let square = height * height;
        match (front.sag(square), rear.sag(square)) {
            (Some((a, _)), Some((b, _))) => center + sense * (b - a) >= floor - 1e-12 * rim,
            _ => false,
        }
    };
    let heights = (1..=8).map(|i| rim * f64::from(i) / 8.0);
    let high = heights.into_iter().find(|height| !is_clear(*height))?;
    let (mut low, mut high) = (high - rim / 8.0, high);
    for _ in 0..30 {
        let middle = 0.5 * (low + high);
        *(if is_clear(middle) { &mut low } else { &mut high }) = middle;
    }
    Some(low.max(0.0))
}

/// The largest height at each surface of rays that reach the image, over all zoom positions and
/// fields.
fn ray_extents(lens: &Lens) -> Result<Vec<f64>, Refusal> {
    let mut extents = vec![0.0; lens.surfaces.len() + 1];
    let mut heights = extents.clone();
    let mut lit = false;
    for zoom in 0..lens.zoom_positions() {
        let model = primary_ray_model(lens, zoom)?;
        for field in &lens.fields_at(zoom).values {
            let Ok(launch) = model.launch(*field, 0) else { continue };
            let rays = FAN.iter().filter_map(|point| launch.ray(*point));
            for ray in rays {
                lit |= widen_extents(&mut extents, &mut heights, &launch.channel().tracer, ray);
            }
        }
    }
    if lit { Ok(extents) } else { Err(Refusal::NoLight) }
}

/// Traces a ray and, if it reaches the image without travelling backwards, widens the extents; true
/// if it does.
fn widen_extents(
    extents: &mut [f64],
    heights: &mut [f64],
    tracer: &Tracer<f64>,
    ray: Ray<f64>,
) -> bool {
    let landing = tracer.visit(ray, |surface, point| heights[surface] = point.x.hypot(point.y));
    let arrived = landing.fate.is_imaged() && landing.first_backward_surface.is_none();
    if arrived {
        for (extent, height) in extents.iter_mut().zip(heights) {
            *extent = extent.max(*height);
        }
    }
    arrived
}

/// The ray model at the primary wavelength.
fn primary_ray_model(lens: &Lens, zoom: usize) -> Result<RayModel, Refusal> {
    let um = lens.wavelengths[lens.primary()].um;
    let system: System<f64> = lens.resolve(zoom, um)?;
    let beam = Beam::for_lens(lens, zoom);
    let model = RayModel::from_systems(vec![(um, 1.0, system)], 0, beam, Aiming::Chief)?;
    Ok(model.limited_by_stop().map_err(RayModelError::from)?)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::lens::blank;

    /// Two surfaces of the same radius, 8 mm apart, with a gap that grows outwards.
    fn growing_gap(rims: [f64; 2]) -> Lens {
        let mut lens = blank();
        lens.surfaces.truncate(2);
        lens.surfaces[0].curvature = -0.02;
        lens.surfaces[1].curvature = 0.02;
        lens.surfaces[0].thickness = 8.0;
        for (row, rim) in lens.surfaces.iter_mut().zip(rims) {
            row.semi_diameter = Some(rim);
        }
        lens
    }

    #[test]
    fn a_gap_is_clear_up_to_the_smaller_rim() {
        // The other way round each sag takes R − √(R² − h²) away.
        let open = growing_gap([30.0, 30.0]);
        assert_eq!(clear_height(&open, 0, 2.0), None);
        let mut closing = open;
        closing.surfaces[0].curvature = 0.02;
        closing.surfaces[1].curvature = -0.02;
        let sag: f64 = 0.5 * (8.0 - 2.0);
        let exact = (2.0 * 50.0 * sag - sag * sag).sqrt();
        let found = clear_height(&closing, 0, 2.0).unwrap();
        assert!((found - exact).abs() < 1e-6, "{found} {exact}");
        // Neither surface reaches that height if one of them does not.
        for rims in [[30.0, 15.0], [15.0, 30.0]] {
            let mut small = closing.clone();
            for (row, rim) in small.surfaces.iter_mut().zip(rims) {
                row.semi_diameter = Some(rim);
            }
            assert_eq!(clear_height(&small, 0, 2.0), None, "{rims:?}");
        }
    }

    #[test]
    fn a_surface_is_no_wider_than_its_steepness_the_rules_and_twice_the_others_allow() {
        let mut lens = growing_gap([10.0, 12.0]);
        let rules = SearchRules { semi_diameter: None, steepness: 0.8, ..SearchRules::default() };
        let largest = |lens: &Lens, rules: &SearchRules| largest_semi_diameter(lens, 0, rules);
        // Twice the widest of 12 mm; the sine of the slope at 40 mm would be 0.8.
        assert_eq!(largest(&lens, &rules), 24.0);
        let narrow = SearchRules { semi_diameter: Some(20.0), ..rules.clone() };
        assert_eq!(largest(&lens, &narrow), 20.0);
        lens.surfaces[0].curvature = -0.05;
        assert!((largest(&lens, &rules) - 16.0).abs() < 1e-12);
        lens.surfaces.iter_mut().for_each(|row| row.semi_diameter = None);
        lens.surfaces[0].curvature = 0.0;
        assert_eq!(largest(&lens, &rules), f64::INFINITY);
    }
}
