//! Turned fields have turned images; a lens that is twice as large has spots twice as large.

use super::{ACCURACY, ROUGH, alike, check_every_lens, edge, near, text};
use aplanat::analysis::{
    Estimate, Spot, distortion, field_curvature, geometric_mtf, illumination, spot, wavefront,
};
use aplanat::lens::{Edit, FieldPoint, apply_edit};
use aplanat::pupil::RayModel;

/// What is read off a field, for comparison with a mirrored one.
struct Read {
    spot: Spot,
    distortion: Option<f64>,
    foci: [Option<f64>; 2],
    wavefront: Estimate,
    contrast: [Estimate; 2],
}

impl Read {
    fn new(model: &RayModel, field: FieldPoint) -> Result<Self, String> {
        let spot = spot(model, field, ROUGH).map_err(text)?;
        let foci = field_curvature(model, field, model.primary).map_err(text)?;
        let frequency = 0.1 / spot.rms.value.max(1e-9);
        let contrast =
            geometric_mtf(model, field, model.primary, &[frequency], ACCURACY).map_err(text)?;
        Ok(Self {
            spot,
            distortion: distortion(model, field, model.primary).map_err(text)?.distortion,
            foci: [foci.tangential, foci.sagittal],
            wavefront: wavefront(model, field, model.primary, ROUGH).map_err(text)?.rms,
            contrast: [contrast.points[0].tangential, contrast.points[0].sagittal]
                .map(|v| v.modulus),
        })
    }
}

/// The same field to the other side and along x: a rotationally symmetric lens has the same image
/// there, turned.
#[test]
fn turned_fields_have_turned_images() {
    check_every_lens(|_, model| {
        let field = edge(model);
        let up = Read::new(model, field)?;
        let down = Read::new(model, FieldPoint { y: -field.y, ..field })?;
        let right = Read::new(model, FieldPoint { x: field.y, y: 0.0, ..field })?;
        let [_, y] = up.spot.centroid;
        for (name, read, [across, along], sign) in
            [("down", &down, [0, 1], -1.0), ("right", &right, [1, 0], 1.0)]
        {
            let at = |what: &str| format!("{name}, {what}");
            alike(&at("radius"), up.spot.rms, read.spot.rms)?;
            alike(&at("light"), up.spot.light, read.spot.light)?;
            alike(&at("largest radius"), up.spot.radius, read.spot.radius)?;
            alike(&at("wavefront"), up.wavefront, read.wavefront)?;
            let there = read.spot.centroid[along];
            alike(&at("centroid"), y, Estimate { value: sign * there.value, ..there })?;
            let aside = read.spot.centroid[across];
            near(&at("centroid aside"), aside.value, 0.0, aside.error.max(1e-12))?;
            for (a, b) in up.foci.iter().zip(read.foci) {
                let [a, b] = [a.unwrap_or(0.0), b.unwrap_or(0.0)];
                near(&at("focus"), a, b, 1e-7 * (1.0 + a.abs()))?;
            }
            let [a, b] = [up.distortion, read.distortion].map(Option::unwrap_or_default);
            near(&at("distortion"), a, b, 1e-9)?;
            let [tangential, sagittal] = read.contrast;
            let contrast = if along == 1 { [tangential, sagittal] } else { [sagittal, tangential] };
            for (a, b) in up.contrast.into_iter().zip(contrast) {
                alike(&at("contrast"), a, b)?;
            }
        }
        Ok(())
    });
}

/// Lengths that double are the same design: spots double, angles and ratios stay. Doubling is exact
/// in binary, so that every number agrees to rounding.
#[test]
fn doubled_lengths_double_the_spots() {
    check_every_lens(|lens, model| {
        let large = apply_edit(lens, &Edit::Scale(2.0)).map_err(text)?;
        let large = RayModel::from_lens(&large, 0).unwrap();
        let [a, b] = [model, &large].map(|model| model.first_order.working_f_number.unwrap());
        near("f-number", b / a, 1.0, 1e-12)?;
        for (field, twice) in model.fields.iter().zip(&large.fields).skip(1).step_by(2) {
            let at = |what: &str| format!("{what} at {}", field.y);
            let [a, b] = [spot(model, *field, ROUGH), spot(&large, *twice, ROUGH)];
            let (a, b) = (a.map_err(text)?, b.map_err(text)?);
            near(&at("radius"), b.rms.value / a.rms.value, 2.0, 2e-6)?;
            near(&at("largest radius"), b.radius.value / a.radius.value, 2.0, 2e-6)?;
            near(&at("light"), b.light.value / a.light.value, 4.0, 1e-9)?;
            let [a, b] = [(model, field), (&large, twice)]
                .map(|(model, field)| distortion(model, *field, model.primary));
            let (a, b) = (a.map_err(text)?, b.map_err(text)?);
            near(&at("height"), b.height, 2.0 * a.height, 1e-9 * (1.0 + a.height.abs()))?;
            let [a, b] = [(model, field), (&large, twice)].map(|(model, field)| {
                wavefront(model, *field, model.primary, ROUGH).map(|wave| wave.rms)
            });
            let (a, b) = (a.map_err(text)?, b.map_err(text)?);
            let error = a.error + b.error;
            near(&at("wavefront"), b.value, 2.0 * a.value, 1e-6 * a.value + 2.0 * error)?;
        }
        let [a, b] = [model, &large].map(|model| illumination(model, model.primary, ROUGH));
        for (a, b) in a.iter().zip(&b) {
            near("illumination", b.cone.value, a.cone.value, 1e-9 * a.cone.value)?;
        }
        Ok(())
    });
}
