//! The wavefront of every field at a wavelength, and what diffraction makes of a point at one or all of them.

use crate::analysis::{
    self, AnalysisError, EncircledRequest, Estimate, ImageLight, Spot, SquareGrid, Strehl,
    Wavefront, ZernikeOrder, ZernikeSum, encircled_energy_unless, grid_nodes, path_map,
    point_spread_unless, strehl_unless, zernike,
};
use crate::lens::FieldPoint;
use crate::pupil::{Accuracy, RayModel};
use crate::session::clock::{Timed, time};

/// The wavefronts of all fields.
#[derive(Debug, Clone)]
pub struct FieldWavefronts {
    /// The wavelength in micrometres.
    pub um: f64,
    /// The wavefront of each field, in order, or the reason why it has none.
    pub fields: Vec<Timed<Result<FieldWavefront, AnalysisError>>>,
}

/// The images of a point at all fields: they take far longer than the wavefronts.
#[derive(Debug, Clone)]
pub struct PointImages {
    /// The wavelength in micrometres; `None` for all of them.
    pub um: Option<f64>,
    /// The image of each field, in order, or the reason why it has none.
    pub fields: Vec<Timed<Result<PointImage, AnalysisError>>>,
}

/// The wavefront of a field.
#[derive(Debug, Clone)]
pub struct FieldWavefront {
    /// Its mean square against the reference sphere.
    pub wavefront: Wavefront,
    /// The path differences over the square about the pupil, in wavelengths.
    pub map: SquareGrid<Option<f64>>,
    /// The Zernike coefficients in Noll's order, or the reason why there are none.
    pub zernike: Result<ZernikeSum, AnalysisError>,
    /// The same in the fringe order.
    pub fringe: Result<ZernikeSum, AnalysisError>,
}

/// The image of a point by diffraction.
#[derive(Debug, Clone)]
pub struct PointImage {
    /// The Strehl ratios.
    pub strehl: Strehl,
    /// The intensity over that of a perfect peak, about the image point of the chief ray.
    pub intensity: SquareGrid<f64>,
    /// The largest error of an intensity.
    pub error: f64,
    /// The share of the light within circles about the same point, and their radii in mm.
    pub energy: Vec<(f64, Estimate)>,
    /// The same shares without aberrations: the limit that diffraction sets.
    pub perfect: Vec<f64>,
    /// The radii in mm that hold the shares of [`ENERGY_SHARES`]; `None` beyond the largest circle.
    pub share_radii: Vec<Option<Estimate>>,
    /// The number of rays.
    pub rays: usize,
}

/// The number of columns of a map of the pupil.
const MAP: usize = 101;
/// The number of columns of an image of a point.
const IMAGE: usize = 41;
/// The half width of an image in λF, and in RMS radii of the spot.
const WIDTH: [f64; 2] = [5.0, 2.5];
/// The largest half width in λF: rays to resolve an image grow with the square of its width, and the
/// next version of the design waits for them.
const WIDEST: f64 = 15.0;
/// The number of circles, the largest of which is as wide as the image.
const CIRCLES: usize = 40;
/// The shares of the light whose circles are marked in encircled energy.
pub const ENERGY_SHARES: [f64; 2] = [0.5, 0.8];
/// The number of Zernike coefficients.
const TERMS: usize = 15;
/// The tolerance of what is looked at, and the rays that it may take: with fewer than 25,000 an image of ten waves of
/// aberration aliases, and rays grow with the square of the waves.
const LOOKED_AT: Accuracy = Accuracy { tolerance: 1e-2, max_rays: 100_000 };

/// The wavefronts of all fields; `None` if it was interrupted.
pub(super) fn field_wavefronts(
    model: &RayModel,
    light: Option<ImageLight>,
    tolerance: f64,
    interrupted: &(dyn Fn() -> bool + Sync),
) -> Option<FieldWavefronts> {
    let accuracy = Accuracy { tolerance, ..Accuracy::default() };
    let wavelength = match present(model, light) {
        ImageLight::Wavelength(index) => index,
        ImageLight::All => model.primary,
    };
    let mut fields = Vec::with_capacity(model.fields.len());
    for field in &model.fields {
        if interrupted() {
            return None;
        }
        fields.push(time(|| field_wavefront(model, *field, wavelength, accuracy)));
    }
    (!interrupted()).then(|| FieldWavefronts { um: model.channels[wavelength].um, fields })
}

/// The images of a point at all fields; `None` if it was interrupted.
pub(super) fn point_images(
    model: &RayModel,
    light: Option<ImageLight>,
    spots: &[Result<Spot, AnalysisError>],
    interrupted: &(dyn Fn() -> bool + Sync),
) -> Option<PointImages> {
    let light = present(model, light);
    let mut fields = Vec::with_capacity(model.fields.len());
    for (field, spot) in model.fields.iter().zip(spots) {
        if interrupted() {
            return None;
        }
        let half_width = half_width(model, spot);
        fields.push(time(|| point_image(model, *field, (light, half_width), interrupted)));
    }
    let um = match light {
        ImageLight::Wavelength(index) => Some(model.channels[index].um),
        ImageLight::All => None,
    };
    (!interrupted()).then_some(PointImages { um, fields })
}

/// The light that was chosen if the model has it, since another lens may have fewer wavelengths; else the primary
/// one.
fn present(model: &RayModel, light: Option<ImageLight>) -> ImageLight {
    match light {
        Some(ImageLight::Wavelength(index)) if index < model.channels.len() => {
            ImageLight::Wavelength(index)
        }
        Some(ImageLight::All) if model.channels.len() > 1 => ImageLight::All,
        _ => ImageLight::Wavelength(model.primary),
    }
}

fn field_wavefront(
    model: &RayModel,
    field: FieldPoint,
    wavelength: usize,
    accuracy: Accuracy,
) -> Result<FieldWavefront, AnalysisError> {
    let wavefront = analysis::wavefront(model, field, wavelength, accuracy)?;
    let map = path_map(model, field, wavelength, MAP)?;
    let sum = |order| zernike(model, field, wavelength, (order, TERMS), accuracy);
    let (zernike, fringe) = (sum(ZernikeOrder::Noll), sum(ZernikeOrder::Fringe));
    Ok(FieldWavefront { wavefront, map, zernike, fringe })
}

fn point_image(
    model: &RayModel,
    field: FieldPoint,
    (light, half_width): (ImageLight, f64),
    interrupted: &(dyn Fn() -> bool + Sync),
) -> Result<PointImage, AnalysisError> {
    let nodes = grid_nodes(IMAGE, half_width);
    let spread = point_spread_unless(model, field, (light, &nodes), LOOKED_AT, interrupted)?;
    let part = |k: usize| half_width * (k + 1) as f64 / CIRCLES as f64;
    let radii: Vec<f64> = (0..CIRCLES).map(part).collect();
    let circles = EncircledRequest { center: [0.0; 2], radii: &radii, shares: &ENERGY_SHARES };
    let found = encircled_energy_unless(model, field, (light, circles), LOOKED_AT, interrupted)?;
    let values = spread.intensities.iter().map(|intensity| intensity.value).collect();
    Ok(PointImage {
        strehl: strehl_unless(model, field, light, LOOKED_AT, interrupted)?,
        intensity: SquareGrid { count: IMAGE, half_width, values },
        error: spread.intensities.iter().map(|intensity| intensity.error).fold(0.0, f64::max),
        energy: radii.into_iter().zip(found.energy).collect(),
        perfect: found.perfect.iter().map(|share| share.value).collect(),
        share_radii: found.share_radii,
        rays: spread.strehl.rays,
    })
}

/// The half width of an image in mm: that of diffraction, or of a spot that is somewhat larger.
pub(super) fn half_width(model: &RayModel, spot: &Result<Spot, AnalysisError>) -> f64 {
    let f_number = model.first_order.working_f_number.unwrap_or(1.0).abs();
    let unit = model.channels[model.primary].um * 1e-3 * f_number;
    let color = spot.as_ref().ok().and_then(|spot| spot.channels.get(model.primary)?.as_ref().ok());
    let rms = color.map_or(0.0, |color| color.rms.value);
    (WIDTH[1] * rms).min(WIDEST * unit).max(WIDTH[0] * unit)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::files;
    use std::sync::atomic::{AtomicUsize, Ordering};

    /// The image of a point takes longest where it is blurred: the next version of the design waits neither
    /// for the end of a field nor for the rest of its image.
    #[test]
    fn wavefronts_are_interrupted_within_the_image_of_a_point() {
        let bundled = files::bundled_lenses().iter().find(|lens| lens.name == "singlet_la1131");
        let lens = files::json::read(bundled.map_or("", |lens| lens.text), "singlet").unwrap();
        let model = RayModel::from_lens(&lens, 0).unwrap();
        let (field, unit) = (model.fields[0], half_width(&model, &Err(AnalysisError::NoLight)));
        let (primary, whole) = (ImageLight::Wavelength(model.primary), AtomicUsize::new(0));
        let asked_of = |asked: &AtomicUsize, most: usize| {
            let interrupted = || asked.fetch_add(1, Ordering::SeqCst) >= most;
            point_image(&model, field, (primary, unit), &interrupted).map(|image| image.rays)
        };
        asked_of(&whole, usize::MAX).unwrap();
        // Every point of the image and every ring is a place to end at.
        let whole = whole.into_inner();
        assert!(whole > IMAGE * IMAGE + CIRCLES, "it was asked {whole} times");
        for most in [0, 1, IMAGE, whole - 2] {
            let asked = AtomicUsize::new(0);
            assert_eq!(asked_of(&asked, most), Err(AnalysisError::Interrupted), "after {most}");
            let more = asked.into_inner() - most;
            assert!(more < 100, "it was asked {more} times after {most}");
        }
    }
}
