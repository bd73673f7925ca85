//! Sensitivities to semi-diameters, compared with lenses with larger and smaller ones.

use aplanat::analysis::{self, RimSensitivities, RimSensitivity};
use aplanat::files::{bundled_lenses, json};
use aplanat::lens::{Lens, Parameter, Quantity};
use aplanat::pupil::{Accuracy, DerivativeError, RayModel};

/// The change of a semi-diameter, in mm.
const STEP: f64 = 1e-3;
/// The error of a difference from quadrature and step, relative to the largest.
const LEFT: f64 = 1e-3;

/// The first lens of the library: its rims alone limit the beam.
fn double_gauss() -> Lens {
    json::read(bundled_lenses()[0].text, bundled_lenses()[0].name).unwrap()
}

/// Area and RMS radius of a field at the primary wavelength.
fn light_and_blur(lens: &Lens, field: usize) -> [f64; 2] {
    let model = RayModel::from_lens(lens, 0).unwrap();
    let accuracy = Accuracy { tolerance: 1e-8, ..Accuracy::default() };
    let spot = analysis::spot(&model, model.fields[field], accuracy).unwrap();
    let color = spot.channels[model.primary].unwrap();
    [color.light.value, color.rms.value]
}

/// The derivatives of area and RMS radius by a semi-diameter, per mm.
fn shown(lens: &Lens, field: usize, surface: usize) -> [f64; 2] {
    let parameter = Parameter::new(surface, Quantity::SemiDiameter);
    let at = |change: f64| {
        let mut moved = lens.clone();
        assert!(moved.set(parameter, lens.get(parameter).unwrap() + change));
        light_and_blur(&moved, field)
    };
    let (more, less) = (at(STEP), at(-STEP));
    [0, 1].map(|i| (more[i] - less[i]) / (2.0 * STEP))
}

fn of(lens: &Lens, field: usize, tolerance: f64) -> Result<RimSensitivities, DerivativeError> {
    let model = RayModel::from_lens(lens, 0).unwrap();
    let accuracy = Accuracy { tolerance, ..Accuracy::default() };
    analysis::rim_sensitivities(&model, model.fields[field], model.primary, accuracy)
}

fn both(effect: &RimSensitivity) -> [analysis::Estimate; 2] {
    [effect.area, effect.rms]
}

#[test]
fn semi_diameter_sensitivities_agree_with_differences() {
    let lens = double_gauss();
    for field in 0..3 {
        let rims = of(&lens, field, 1e-6).unwrap();
        let [area, rms] = light_and_blur(&lens, field);
        assert!((rims.area / area - 1.0).abs() < 1e-6, "{} {area}", rims.area);
        assert!((rims.rms / rms - 1.0).abs() < 1e-5, "{} {rms}", rims.rms);
        let effects = || rims.surfaces.iter().map(both);
        let scale = [0, 1].map(|i| effects().map(|e| e[i].value.abs()).fold(0.0, f64::max));
        // The image plane has no rim.
        for (surface, effect) in effects().enumerate().take(lens.surfaces.len()) {
            let shown = shown(&lens, field, surface);
            for i in 0..2 {
                let off = (effect[i].value - shown[i]).abs() / scale[i];
                assert!(off < LEFT, "field {field}, surface {surface}: {effect:?}, {shown:?}");
                assert!(effect[i].error <= LEFT * scale[i], "{effect:?}");
            }
        }
    }
}

#[test]
fn combined_fields_have_mean_light_and_rms_spot() {
    let lens = double_gauss();
    let [axis, edge] = [0, 2].map(|field| of(&lens, field, 1e-3).unwrap());
    let both = analysis::mean_rim_sensitivities(&[(1.0, &axis), (3.0, &edge)]).unwrap();
    assert!((both.area - 0.25 * axis.area - 0.75 * edge.area).abs() < 1e-9);
    let square = 0.25 * axis.rms.powi(2) + 0.75 * edge.rms.powi(2);
    assert!((both.rms.powi(2) - square).abs() < 1e-12);
    let front = |rims: &RimSensitivities| rims.surfaces[0].rms.value;
    let slope = 0.25 * axis.rms * front(&axis) + 0.75 * edge.rms * front(&edge);
    assert!((both.rms * front(&both) - slope).abs() < 1e-12);
    assert!(analysis::mean_rim_sensitivities(&[]).is_none());
    assert!(analysis::mean_rim_sensitivities(&[(0.0, &axis)]).is_none());
}

#[test]
fn a_field_without_light_has_no_derivative_but_a_reason() {
    let mut lens = double_gauss();
    lens.fields.values[2].y = 40.0;
    assert!(matches!(of(&lens, 2, 1e-3), Err(DerivativeError::Dark(..))));
}
