//! Derivatives by all lengths add up, grow with the lens, and are those of differences.

use super::{ACCURACY, check_every_lens, edge, near, text};
use aplanat::lens::{
    Aperture, Edit, FieldKind, Lens, Object, Parameter, Quantity, Surface, apply_edit,
};
use aplanat::pupil::{
    Accuracy, QuadraticIntegrand, RayModel, Region, choose_estimator, differentiate,
};
use aplanat::trace::{SurfaceGradient, SystemGradient};

/// The derivative of an integral by the logarithm of a factor of all lengths: that by each number,
/// times the number and the power of mm in its unit.
fn by_scale(model: &RayModel, by: &SystemGradient<f64>) -> f64 {
    let surfaces = &model.channels[model.primary].system.surfaces;
    let one = |(surface, by): (&Surface<f64>, &SurfaceGradient<f64>)| {
        let (curvature, _, terms) = surface.shape.numbers();
        let terms = terms.iter().zip(by.terms).enumerate();
        let asphere: f64 = terms.map(|(k, (a, by))| (2 * k + 3) as f64 * a * by).sum();
        // A surface without a rim has an infinite one, and no derivative by it.
        let rim = by.semi_diameter * surface.semi_diameter.min(f64::MAX);
        by.thickness * surface.thickness + rim - by.curvature * curvature - asphere
    };
    surfaces.iter().zip(&by.surfaces).map(one).sum()
}

/// Euler's theorem on homogeneous functions: the squared distances over the pupil grow with the
/// fourth power of all lengths, the light with the second.
#[test]
fn derivatives_by_all_lengths_add_up() {
    check_every_lens(|lens, model| {
        let depends_on_lengths_alone = lens.object == Object::Infinity
            && model.beam.field == FieldKind::Angle
            && !model.has_grin()
            && lens.surfaces.iter().all(|row| row.obstruction.is_none());
        if !depends_on_lengths_alone {
            return Ok(());
        }
        for field in [model.fields[0], edge(model)] {
            let region = Region::new(model.launch(field, model.primary).unwrap());
            let light = region.trace_pupil(9).moments;
            let accuracy = Accuracy { tolerance: 1e-4, ..ACCURACY };
            let spread = QuadraticIntegrand::spread(light.centroid);
            for (cost, power) in [(spread, 4.0), (QuadraticIntegrand::throughput(), 2.0)] {
                let (estimator, _) = choose_estimator(&region, accuracy).map_err(text)?;
                let found = differentiate(&region, &cost, estimator, accuracy);
                let found = found.map_err(text)?;
                let sum = by_scale(model, &found.gradient);
                let exact = power * cost.integrate(&light);
                let what = format!("power {power} at {} by {estimator:?}", field.y);
                near(&what, sum, exact, 5e-3 * exact.abs())?;
            }
        }
        Ok(())
    });
}

/// The spread of a lens twice as large is 16 times as large, the light four times, and so are their
/// derivatives, apart from the powers of mm in the units of the numbers. Doubling is exact.
#[test]
fn derivatives_of_doubled_lengths_are_doubled() {
    check_every_lens(|lens, model| {
        let large = apply_edit(lens, &Edit::Scale(2.0)).map_err(text)?;
        let large = RayModel::from_lens(&large, 0).map_err(text)?;
        let field = edge(model);
        let k = model.fields.iter().position(|other| *other == field).unwrap();
        let accuracy = Accuracy { tolerance: 1e-2, ..ACCURACY };
        for (spread, power) in [(true, 4), (false, 2)] {
            let by = |model: &RayModel, field| {
                let region = Region::new(model.launch(field, model.primary).unwrap());
                let light = region.trace_pupil(ORDER).moments;
                let cost = if spread {
                    QuadraticIntegrand::spread(light.centroid)
                } else {
                    QuadraticIntegrand::throughput()
                };
                let (estimator, _) = choose_estimator(&region, accuracy).map_err(text)?;
                differentiate(&region, &cost, estimator, accuracy).map_err(text)
            };
            let (small, large) = (by(model, field)?, by(&large, large.fields[k])?);
            let pairs = small.gradient.surfaces.iter().zip(&large.gradient.surfaces);
            for (i, (a, b)) in pairs.enumerate() {
                let numbers = |by: &SurfaceGradient<f64>| {
                    [by.curvature, by.conic, by.thickness, by.semi_diameter, by.terms[0]]
                };
                let grows = [1, 0, -1, -1, 3].map(|more| 2f64.powi(power + more));
                for (k, (a, b)) in numbers(a).into_iter().zip(numbers(b)).enumerate() {
                    near(
                        &format!("number {k} of surface {}, power {power}", i + 1),
                        b,
                        grows[k] * a,
                        1e-6 * (grows[k] * a).abs(),
                    )?;
                }
            }
        }
        Ok(())
    });
}

/// The derivative by the curvature of one surface, and the thickness behind it, against the
/// difference of two lenses. The rays are the same in both: those of a field that is an image height
/// would turn with the focal length.
#[test]
fn derivatives_are_differences() {
    check_every_lens(|lens, model| {
        let field = edge(model);
        let surface = lens.surfaces.len() / 2;
        let region = Region::new(model.launch(field, model.primary).unwrap());
        let light = region.trace_pupil(ORDER).moments;
        let accuracy = Accuracy { tolerance: 1e-4, ..ACCURACY };
        let cost = QuadraticIntegrand::spread(light.centroid);
        let (estimator, _) = choose_estimator(&region, accuracy).map_err(text)?;
        let found = differentiate(&region, &cost, estimator, accuracy);
        let found = found.map_err(text)?;
        let (by, off) = (&found.gradient.surfaces[surface], &found.error.surfaces[surface]);
        let length = model.first_order.efl.unwrap().abs();
        for (quantity, by, off, step) in [
            (Quantity::Curvature, by.curvature, off.curvature, 1e-4 / length),
            (Quantity::Thickness, by.thickness, off.thickness, 1e-4 * length),
        ] {
            let at = |change: f64| {
                let parameter = Parameter::new(surface, quantity);
                let mut moved = fixed_stop(lens, model);
                moved.set(parameter, moved.get(parameter).unwrap() + change);
                let model = RayModel::from_lens(&moved, 0).unwrap();
                let launch = region.launch.to_fixed().launch(&model);
                cost.integrate(&Region::new(launch).trace_pupil(ORDER).moments)
            };
            let slope = |step: f64| (at(step) - at(-step)) / (2.0 * step);
            let (near_by, far) = (slope(0.5 * step), slope(step));
            // Richardson: both are wrong by the square of the step.
            let correction = (near_by - far) / 3.0;
            let rounding = 1e-10 * cost.integrate(&light) / step;
            let error = 2e-3 * by.abs() + off + correction.abs() + rounding;
            let what = format!("{quantity:?} of surface {}", surface + 1);
            near(&what, by, near_by + correction, error)?;
        }
        Ok(())
    });
}

/// An order of quadrature that is good to some six digits.
const ORDER: usize = 7;

/// The lens whose stop is as large as its aperture makes it, and stays so when the lens changes.
fn fixed_stop(lens: &Lens, model: &RayModel) -> Lens {
    let aperture = Aperture::StopSemiDiameter(model.stop_radius());
    Lens { aperture, ..lens.clone() }
}
