//! The Strehl ratio: at the image point of the chief ray, and at the brightest point in space.

use super::blur::BlurPeaks;
use super::brightest::{ImageIntensity as _, brightest, highest};
use super::image_light::{ColorSample, ColorSamples, ImageLight, about_sphere};
use super::point_spread::spread_at;
use super::pupil_samples::PupilSamples;
use super::{Interruption, never};
use crate::analysis::reference_sphere::ReferenceSphere;
use crate::analysis::{AnalysisError, Estimate, lit_region};
use crate::lens::FieldPoint;
use crate::pupil::{Accuracy, ConvergedList, RayModel};

/// The Strehl ratios of a field.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Strehl {
    /// The intensity at the image point of the chief ray, over that of the same pupil without
    /// aberrations.
    pub at_chief: Estimate,
    /// The largest intensity found in space.
    pub best: Estimate,
    /// The position of that point from the image point of the chief ray: x, y and along the axis, in
    /// mm.
    pub best_at: [f64; 3],
    /// True if all of the blur was searched, and no brighter point was found. False if it is too large for
    /// that, and the best point is only brighter than those around it; false over several wavelengths too,
    /// where it is the brightest one near those of the single wavelengths.
    pub is_brightest: bool,
    /// True if the tolerance was reached.
    pub reached: bool,
}

impl Strehl {
    /// The name of the largest intensity: "best", or "locally best" if not all of the blur was looked at.
    pub fn best_name(&self) -> &'static str {
        if self.is_brightest { "best" } else { "locally best" }
    }
}

/// The Strehl ratios of a field at a wavelength; errors are absolute. The error of the best one counts
/// the quadrature; `is_brightest` tells if all of the blur was looked at.
///
/// # Errors
/// The field is dark or its pupil folds.
pub fn strehl(
    model: &RayModel,
    field: FieldPoint,
    wavelength: usize,
    accuracy: Accuracy,
) -> Result<Strehl, AnalysisError> {
    strehl_unless(model, field, ImageLight::Wavelength(wavelength), accuracy, &never)
}

/// The same in one or all wavelengths unless it is interrupted, which is asked for before every order of the
/// quadrature and in the search. Over several wavelengths the ratio is that of intensities in the light of all to
/// the peak of images without aberrations about one point.
///
/// # Errors
/// The same at every wavelength, and [`AnalysisError::Interrupted`].
pub fn strehl_unless(
    model: &RayModel,
    field: FieldPoint,
    light: ImageLight,
    accuracy: Accuracy,
    interrupted: &Interruption<'_>,
) -> Result<Strehl, AnalysisError> {
    match light {
        ImageLight::Wavelength(index) => {
            let found = BrightestOfColor::find((model, field, index), accuracy, interrupted)?;
            Ok(found.strehl())
        }
        ImageLight::All => strehl_of_all(model, field, accuracy, interrupted),
    }
}

/// The search for the brightest point of the light of one wavelength.
struct BrightestOfColor {
    sphere: ReferenceSphere,
    peaks: BlurPeaks,
    /// The intensities at the centre of the sphere and at the brightest point.
    found: ConvergedList,
    /// That point from the centre of the sphere, along the light, in mm.
    best_at: [f64; 3],
    /// The light at the last nodes.
    light: PupilSamples,
}

impl BrightestOfColor {
    fn find(
        (model, field, wavelength): (&RayModel, FieldPoint, usize),
        accuracy: Accuracy,
        interrupted: &Interruption<'_>,
    ) -> Result<Self, AnalysisError> {
        let region = lit_region(model, field, wavelength)?;
        let sphere = ReferenceSphere::focused(&region)?;
        let peaks = BlurPeaks::find(&region, &sphere, accuracy, interrupted)?;
        let (mut best_at, mut last) = ([0.0; 3], PupilSamples::default());
        let ratios = |light: &PupilSamples| {
            best_at = brightest(light, &peaks.points);
            last.clone_from(light);
            Ok(vec![light.intensity([0.0; 2]), light.intensity_at(best_at)])
        };
        let least = |_: &PupilSamples| peaks.nodes;
        let found =
            PupilSamples::converge_from(&region, &sphere, least, accuracy, interrupted, ratios)?;
        Ok(Self { sphere, found, best_at, light: last, peaks })
    }

    fn strehl(&self) -> Strehl {
        let Self { sphere, peaks, found, best_at, .. } = self;
        let [x, y, z] = sphere.place_of(*best_at);
        let rays = found.rays + peaks.rays;
        let estimate = |k: usize| Estimate::new(found.values[k], found.errors[k], rays);
        Strehl {
            at_chief: estimate(0),
            best: estimate(1),
            best_at: [x, y, z * sphere.direction.z.signum()],
            is_brightest: peaks.is_whole,
            reached: found.converged,
        }
    }
}

/// The Strehl ratios in the light of all wavelengths: the search begins at the brightest point of each.
fn strehl_of_all(
    model: &RayModel,
    field: FieldPoint,
    accuracy: Accuracy,
    interrupted: &Interruption<'_>,
) -> Result<Strehl, AnalysisError> {
    let light = ImageLight::All;
    let origin = light.origin(model, field)?;
    let colors = light.parts(model, |wavelength| {
        BrightestOfColor::find((model, field, wavelength), accuracy, interrupted)
    })?;
    if let [only] = colors.parts.as_slice()
        && colors.refused_share == 0.0
        && about_sphere(&only.found.sphere, origin, [0.0; 3]) == [0.0; 3]
    {
        return Ok(only.found.strehl());
    }
    let rays: usize =
        colors.parts.iter().map(|part| part.found.found.rays + part.found.peaks.rays).sum();
    let sphere = colors.parts.first().map(|part| part.found.sphere.clone());
    let sense = sphere.as_ref().map_or(1.0, |sphere| sphere.direction.z.signum());
    let mut starts = vec![[0.0; 3]];
    let mut samples = Vec::new();
    for part in colors.parts {
        let BrightestOfColor { sphere, best_at, light, .. } = part.found;
        let shift = about_sphere(&sphere, origin, [0.0; 3]);
        starts.push([0, 1, 2].map(|k| best_at[k] - shift[k]));
        samples.push(ColorSample { share: part.share, shift, light });
    }
    let best = highest(&ColorSamples::new(samples), starts.iter());
    let found =
        spread_at((model, field), (light, origin), &[[0.0; 3], best], accuracy, interrupted)?;
    let [at_chief, best_ratio] = found.intensities[..] else { return Err(AnalysisError::NoLight) };
    let counted = |ratio: Estimate| Estimate { rays: ratio.rays + rays, ..ratio };
    let best = sphere.map_or(best, |sphere| sphere.place_of(best));
    Ok(Strehl {
        at_chief: counted(at_chief),
        best: counted(best_ratio),
        best_at: [best[0], best[1], best[2] * sense],
        is_brightest: false,
        reached: found.reached,
    })
}
