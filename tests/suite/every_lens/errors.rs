//! What a higher order changes is in the stated errors.

use super::{ACCURACY, check_every_lens, edge, near};
use aplanat::analysis::rounding_error;
use aplanat::pupil::{Accuracy, ConvergedValues, Nodes, Region, converge};

/// What a higher order changes is in the stated error of a lower one.
#[test]
fn stated_errors_hold_what_a_higher_order_changes() {
    check_every_lens(|_, model| {
        for field in [model.fields[0], edge(model)] {
            let region = Region::new(model.launch(field, model.primary).unwrap());
            let found = |tolerance| moments_of(&region, Accuracy { tolerance, ..ACCURACY });
            let (rough, exact) = (found(1e-3)?, found(1e-6)?);
            let rounding = rounding_error(model);
            for (k, what) in ["radius", "height", "area"].into_iter().enumerate() {
                let digits = rounding + 1e-12 * exact.values[k];
                let error = rough.errors[k] + exact.errors[k] + digits;
                near(&format!("{what} at {}", field.y), rough.values[k], exact.values[k], error)?;
            }
        }
        Ok(())
    });
}

/// The radius, the height and the area of the light of a pupil.
fn moments_of(region: &Region<'_>, accuracy: Accuracy) -> Result<ConvergedValues<3>, String> {
    let numbers = |nodes: &Nodes| {
        let light = region.moments(nodes);
        (light.area > 0.0).then(|| [light.rms_radius(), light.centroid[1], light.area])
    };
    let scales = |[radius, _, area]: &[f64; 3]| [*radius, *radius, *area];
    converge(region, accuracy, numbers, scales).ok_or_else(|| "no light".to_owned())
}
