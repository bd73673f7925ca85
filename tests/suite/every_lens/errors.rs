//! What a higher order changes, and what a plan leaves out, is in the stated errors.

use super::{ACCURACY, ROUGH, alike, check_every_lens, edge, ensure, near, text};
use aplanat::analysis::{Estimate, point_spread, rounding_error, spot};
use aplanat::effects::{
    self, Effect, EffectOverride, EffectOverrides, EffectPlan, TracePurpose, build_ray_model_at,
};
use aplanat::lens::{FieldPoint, Goal, Lens, LimitTreatment, PupilEdge, Term, WeightedTerm};
use aplanat::merit::{Merit, MeritError, TermValue};
use aplanat::pupil::{
    Accuracy, ConvergedValues, DerivativeEstimator, Nodes, PupilDerivative, QuadraticIntegrand,
    RayModel, Region, RegionKind, choose_estimator, converge, differentiate,
};
use aplanat::trace::SurfaceParameter;

/// What a higher order changes is in the stated error of a lower one, however loose: at every wavelength,
/// on the axis, in the middle and at the edge of the field.
#[test]
fn stated_errors_hold_what_a_higher_order_changes() {
    let compared: usize = check_every_lens(|_, model| {
        let mut compared = 0;
        let middle = FieldPoint { y: 0.4 * edge(model).y, ..edge(model) };
        for (field, wavelength) in [model.fields[0], middle, edge(model)]
            .into_iter()
            .flat_map(|field| (0..model.channels.len()).map(move |wavelength| (field, wavelength)))
        {
            // Another colour, or a field between those of the lens, may be dark.
            let is_given = wavelength == model.primary && field != middle;
            let region = match model.launch(field, wavelength) {
                Ok(launch) => Region::new(launch),
                Err(why) if is_given => return Err(why.to_string()),
                Err(_) => continue,
            };
            let found = |tolerance| moments_of(&region, Accuracy { tolerance, ..ACCURACY });
            let exact = match found(1e-6) {
                Ok(exact) => exact,
                Err(why) if is_given => return Err(why),
                Err(_) => continue,
            };
            let rounding = rounding_error(model);
            for tolerance in [3e-2, 1e-2, 1e-3] {
                let rough = found(tolerance)?;
                for (k, what) in ["radius", "height", "area"].into_iter().enumerate() {
                    let digits = rounding + 1e-12 * exact.values[k].abs();
                    let error = rough.errors[k] + exact.errors[k] + digits;
                    let what = format!("{what} at {}, {wavelength}, to {tolerance}", field.y);
                    near(&what, rough.values[k], exact.values[k], error)?;
                    compared += 1;
                }
            }
        }
        Ok(compared)
    })
    .into_iter()
    .sum();
    assert!(compared > 188 * 27, "{compared}");
}

/// The same for the spots of a merit function, one field and one colour at a time.
#[test]
fn stated_errors_of_merit_functions_hold_what_more_rays_change() {
    let goal = Goal {
        terms: vec![WeightedTerm::new(Term::Spot, 1.0)],
        zoom_ratios: Vec::new(),
        limits: LimitTreatment::default(),
        pupil: PupilEdge::default(),
    };
    let compared: usize = check_every_lens(|lens, model| {
        let mut compared = 0;
        for field in
            [model.fields[0], FieldPoint { y: 0.4 * edge(model).y, ..edge(model) }, edge(model)]
        {
            let mut single = lens.clone();
            single.fields.values = vec![field];
            single.wavelengths = vec![lens.wavelengths[model.primary]];
            let square = |tolerance| -> Result<TermValue, MeritError> {
                let merit = Merit::new(&single, &goal, tolerance)?;
                Ok(merit.terms(&merit.values(&single))?.remove(0))
            };
            // A field between those of the lens may be dark.
            let Ok(exact) = square(1e-6) else { continue };
            for tolerance in [3e-2, 1e-2, 1e-3] {
                let rough = square(tolerance).map_err(text)?;
                let error =
                    rough.error + exact.error + 1e-12 * exact.value + rounding_error(model).powi(2);
                let what = format!("spot at {}, to {tolerance}", field.y);
                near(&what, rough.value, exact.value, error)?;
                compared += 1;
            }
        }
        Ok(compared)
    })
    .into_iter()
    .sum();
    assert!(compared > 188 * 8, "{compared}");
}

/// Every arc of the edge is found, however short: the area of the light is then the same at all high orders,
/// but for rounding.
#[test]
fn no_arc_of_an_edge_is_missed() {
    let compared: usize = check_every_lens(|_, model| {
        let mut compared = 0;
        for part in [0.2, 0.4, 0.6, 0.7, 0.9, 1.0] {
            let field = FieldPoint { y: part * edge(model).y, ..edge(model) };
            for wavelength in 0..model.channels.len() {
                // A field between those of the lens may be dark.
                let Ok(launch) = model.launch(field, wavelength) else { continue };
                let region = Region::new(launch);
                let RegionKind::StarShaped(_) = region.kind else { continue };
                let [low, high] = [8, 10].map(|order| region.moments(&region.nodes(order)).area);
                near(&format!("area at {part}, {wavelength}"), low, high, 1e-10 * high)?;
                compared += 1;
            }
        }
        Ok(compared)
    })
    .into_iter()
    .sum();
    assert!(compared > 1000, "{compared}");
}

/// The same for images by diffraction, those of lenses far from the limit too: about a quarter of all lenses.
#[test]
fn stated_errors_of_diffraction_hold_what_a_higher_order_changes() {
    let compared: usize = check_every_lens(|lens, model| {
        if !lens.surfaces.len().is_multiple_of(4) {
            return Ok(0);
        }
        let field = edge(model);
        let Ok(exact) = point_spreads(model, field, 1e-5).map_err(text) else { return Ok(0) };
        for tolerance in [1e-2, 1e-3] {
            let rough = point_spreads(model, field, tolerance)?;
            for (k, (rough, exact)) in rough.iter().zip(&exact).enumerate() {
                let what = format!("intensity {k} at {}, to {tolerance}", field.y);
                near(&what, rough.value, exact.value, rough.error + exact.error + 1e-9)?;
            }
        }
        Ok(1)
    })
    .into_iter()
    .sum();
    assert!(compared > 30, "{compared}");
}

/// The same for derivatives by order: what a higher order changes, over the largest of its kind.
#[test]
fn stated_errors_of_derivatives_hold_what_a_higher_order_changes() {
    let compared: usize = check_every_lens(|_, model| {
        let mut compared = 0;
        for field in [model.fields[0], edge(model)] {
            let region = Region::new(model.launch(field, model.primary).unwrap());
            let center = region.trace_pupil(5).moments.centroid;
            for cost in [QuadraticIntegrand::spread(center), QuadraticIntegrand::throughput()] {
                let (estimator, _) = choose_estimator(&region, ROUGH).map_err(text)?;
                // Random rays have a standard error, which a result may exceed.
                if estimator == DerivativeEstimator::Warp {
                    continue;
                }
                let found = |tolerance| {
                    let accuracy = Accuracy { tolerance, ..ACCURACY };
                    differentiate(&region, &cost, estimator, accuracy).map_err(text)
                };
                let exact = found(1e-6)?;
                for tolerance in [1e-1, 1e-2, 1e-3] {
                    let name = |why| format!("at {}, to {tolerance}: {why}", field.y);
                    compared += compare_by_kind(&found(tolerance)?, &exact).map_err(name)?;
                }
            }
        }
        Ok(compared)
    })
    .into_iter()
    .sum();
    assert!(compared > 188 * 60, "{compared}");
}

/// Compares the derivatives by each kind of number with exact ones, within the stated errors of the kind; the
/// number of kinds.
fn compare_by_kind(rough: &PupilDerivative, exact: &PupilDerivative) -> Result<usize, String> {
    let mut compared = 0;
    for slot in SurfaceParameter::all() {
        let all = exact.gradient.surfaces.iter().zip(&rough.gradient.surfaces);
        let off = all.map(|(a, b)| (a.by(slot) - b.by(slot)).abs()).fold(0.0, f64::max);
        let largest = exact.gradient.largest(slot);
        // Numbers without an effect are dropped at either order.
        let error = rough.error.largest(slot) + exact.error.largest(slot) + 1e-9 * largest;
        ensure(off <= error, || format!("{slot:?}: off by {off:e} of {largest:e}, not {error:e}"))?;
        compared += 1;
    }
    Ok(compared)
}

/// The intensities in the image of a field, at its chief ray and beside.
fn point_spreads(
    model: &RayModel,
    field: FieldPoint,
    tolerance: f64,
) -> Result<Vec<Estimate>, String> {
    let points = [[0.0, 0.0], [0.0, 1e-3], [2e-3, 1e-3], [0.0, -5e-3]];
    let accuracy = Accuracy { tolerance, max_rays: 30_000 };
    let found = point_spread(model, field, model.primary, &points, accuracy).map_err(text)?;
    Ok(found.intensities)
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

/// What a plan leaves out is in the stated errors, those of the light too, up to the square of the
/// tolerance for aspheric terms and gradients; whether the lens does not call for it or somebody has switched the search of the chief ray off.
#[test]
fn stated_errors_hold_what_a_plan_leaves_out() {
    let planned = check_every_lens(|lens, model| {
        let measured = effects::measure_effects(lens, 0).map_err(text)?;
        let plan = |aiming| {
            let overrides = EffectOverrides::default().with(Effect::Aiming, aiming);
            effects::plan(&measured, TracePurpose::Spot(ROUGH.tolerance), &overrides)
        };
        let [auto, not_aimed] = [EffectOverride::Auto, EffectOverride::Off].map(plan);
        let fields = changes_are_stated(lens, model, &auto);
        let fields = fields.map_err(|why| format!("planned, {why}"))?;
        ensure(fields == 2, || format!("planned: {fields} fields have light"))?;
        // Where no ray through the paraxial pupil reaches the stop, the error is infinite.
        if not_aimed.neglected().shift.is_finite() {
            let not_aimed = changes_are_stated(lens, model, &not_aimed);
            not_aimed.map_err(|why| format!("not aimed, {why}"))?;
        }
        Ok([!auto.computes(Effect::Aiming), !auto.unclipped.is_empty()])
    });
    for k in [0, 1] {
        assert!(planned.iter().any(|left_out| left_out[k]), "nothing is left out");
    }
}

/// Compares the spots of a lens and its light, on the axis and at the edge of the field, with what a
/// plan leaves out and without; the number of fields that have light without.
fn changes_are_stated(lens: &Lens, model: &RayModel, plan: &EffectPlan) -> Result<usize, String> {
    let planned = build_ray_model_at(lens, 0, &model.fields, plan).map_err(text)?;
    let last = model.fields.iter().position(|field| *field == edge(model)).unwrap();
    let mut fields = 0;
    for k in [0, last] {
        let exact = spot(model, model.fields[k], ROUGH).map_err(text)?;
        // A field that is dark has no number, and says so.
        let Ok(found) = spot(&planned, planned.fields[k], ROUGH) else { continue };
        let at = |what: &str| format!("{what} at {}", model.fields[k].y);
        alike(&at("radius"), exact.rms, found.rms)?;
        let error =
            exact.light.error + found.light.error + ROUGH.tolerance.powi(2) * exact.light.value;
        near(&at("light"), exact.light.value, found.light.value, error)?;
        fields += 1;
    }
    Ok(fields)
}
