//! The spot over the whole field: a map of its radius.

use super::{AnalysisError, Estimate, SquareGrid, spot};
use crate::lens::FieldPoint;
use crate::pupil::{Accuracy, RayModel};
use rayon::prelude::*;
use std::collections::BTreeMap;

/// The spot over the whole field.
#[derive(Debug, Clone, PartialEq)]
pub struct SpotMap {
    /// The RMS spot radius in mm over the square about the disc of the farthest field, in the unit of
    /// the fields; `None` beside the disc, and an error where no light arrives.
    pub grid: SquareGrid<Option<Result<Estimate, AnalysisError>>>,
    /// The number of rays.
    pub rays: usize,
}

/// The spot radius of the fields of a square grid with an odd number of columns. Fields at the same
/// distance from the axis of a lens with rotational symmetry have the same spot.
///
/// # Errors
/// All fields are on the axis, or the computation was interrupted.
pub fn spot_map(
    model: &RayModel,
    count: usize,
    accuracy: Accuracy,
    interrupted: impl Fn() -> bool + Sync,
) -> Result<SpotMap, AnalysisError> {
    let height = |field: &FieldPoint| field.x.hypot(field.y);
    let farthest = model.fields.iter().map(height).fold(0.0, f64::max);
    if farthest == 0.0 {
        return Err(AnalysisError::OnlyAxis);
    }
    let steps = grid_steps(count);
    let half = (count / 2) as i64;
    let symmetric = model.channels.iter().all(|c| c.system.has_rotational_symmetry());
    let key = |step: &[i64; 2]| {
        let [x, y] = *step;
        if symmetric { [0, x * x + y * y] } else { [x, y] }
    };
    let is_inside = |step: &&[i64; 2]| step[0] * step[0] + step[1] * step[1] <= half * half;
    let distinct: BTreeMap<[i64; 2], FieldPoint> = steps
        .iter()
        .filter(is_inside)
        .map(|step| (key(step), field_at(step, farthest / half as f64, symmetric)))
        .collect();
    let radius = |(key, field): (&[i64; 2], &FieldPoint)| {
        if interrupted() {
            return Err(AnalysisError::Interrupted);
        }
        Ok((*key, spot(model, *field, accuracy).map(|spot| spot.rms)))
    };
    let found: Result<BTreeMap<_, _>, _> = distinct.par_iter().map(radius).collect();
    let found = found?;
    let value = |step: &[i64; 2]| is_inside(&step).then(|| found[&key(step)]);
    let values = steps.iter().map(value).collect();
    let rays = found.values().flatten().map(|radius| radius.rays).sum();
    Ok(SpotMap { grid: SquareGrid { count, half_width: farthest, values }, rays })
}

/// The columns and the rows of the nodes of a square grid, counted from its centre.
fn grid_steps(count: usize) -> Vec<[i64; 2]> {
    let half = (count / 2) as i64;
    let side = -half..=half;
    side.clone().flat_map(|y| side.clone().map(move |x| [x, y])).collect()
}

/// The field of a node, on the y axis for a lens with rotational symmetry.
fn field_at([x, y]: &[i64; 2], step: f64, symmetric: bool) -> FieldPoint {
    let [x, y] = [*x as f64, *y as f64].map(|steps| step * steps);
    let [x, y] = if symmetric { [0.0, x.hypot(y)] } else { [x, y] };
    FieldPoint { x, y, weight: 1.0 }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::analysis::grid_nodes;

    fn model(change: impl Fn(&mut crate::lens::Lens)) -> RayModel {
        let bundled =
            crate::files::bundled_lenses().iter().find(|lens| lens.name == "tessar_50_f28");
        let bundled = bundled.unwrap();
        let mut lens = crate::files::parse(bundled.text.as_bytes(), bundled.name).unwrap().lens;
        change(&mut lens);
        RayModel::from_lens(&lens, 0).unwrap()
    }

    /// The map has the spots of the fields themselves, symmetric or not.
    #[test]
    fn a_map_has_the_spots_of_its_fields() {
        let accuracy = Accuracy { tolerance: 1e-4, ..Accuracy::default() };
        let tilted = model(|lens| lens.surfaces[2].tilt = [0.0, 0.5]);
        for model in [model(|_| {}), tilted] {
            let map = spot_map(&model, 5, accuracy, || false).unwrap().grid;
            let edge = map.half_width;
            for (node, value) in grid_nodes(5, edge).into_iter().zip(&map.values) {
                let [x, y] = node;
                let Some(found) = value else {
                    assert!(x.hypot(y) > edge);
                    continue;
                };
                let alone = spot(&model, FieldPoint { x, y, weight: 1.0 }, accuracy).unwrap().rms;
                let found = found.as_ref().unwrap();
                let off = (found.value - alone.value).abs();
                assert!(off <= found.error + alone.error + 1e-9, "{node:?}: {off}");
            }
        }
    }

    #[test]
    fn a_map_of_the_axis_alone_is_refused_and_one_can_be_interrupted() {
        let axis = model(|lens| lens.fields.values.truncate(1));
        let found = spot_map(&axis, 5, Accuracy::default(), || false);
        assert_eq!(found, Err(AnalysisError::OnlyAxis));
        let stopped = spot_map(&model(|_| {}), 5, Accuracy::default(), || true);
        assert_eq!(stopped, Err(AnalysisError::Interrupted));
    }
}
