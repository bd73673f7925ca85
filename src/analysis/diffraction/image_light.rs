//! The light of an image of a point: that of one wavelength, or of all of them by their weights.
//!
//! The images of all wavelengths add up as intensities. Each holds the share of the energy that its weight is of
//! the weights of those with light, and all are looked at about one point, so that lateral colour is seen. A
//! wavelength without light adds nothing. One whose image is refused would have added something that is not
//! known: at most its share, which is part of every error.

use super::pupil_samples::{NODES_PER_TURN, PupilSamples};
use super::{Interruption, brightest::ImageIntensity};
use crate::analysis::reference_sphere::{ReferenceForm, ReferenceSphere};
use crate::analysis::{AnalysisError, lit_region};
use crate::lens::FieldPoint;
use crate::math::Vec3;
use crate::pupil::{Accuracy, ConvergedList, RayModel};
use nalgebra::{Matrix3, Vector3};
use rayon::prelude::*;
use serde::{Deserialize, Serialize};
use std::cell::Cell;

/// The light that makes an image of a point.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum ImageLight {
    /// The wavelength of this index in the ray model alone.
    Wavelength(usize),
    /// All wavelengths by their weights.
    All,
}

/// The results of the wavelengths with light.
#[derive(Debug)]
pub(super) struct ColorParts<T> {
    /// The share of each wavelength of the weights of those with a result, and the result.
    pub(super) parts: Vec<ColorPart<T>>,
    /// The share of the weight of wavelengths without light.
    pub(super) dark_share: f64,
    /// The share of the peak of a perfect image that wavelengths with light but without a result would have, at
    /// most their share of the light or of the peak, whichever is larger.
    pub(super) refused_share: f64,
}

/// The result of a wavelength.
#[derive(Debug)]
pub(super) struct ColorPart<T> {
    pub(super) share: f64,
    pub(super) found: T,
}

impl ImageLight {
    /// The indices of the wavelengths of a model, with their weights.
    fn wavelengths(self, model: &RayModel) -> Vec<(usize, f64)> {
        match self {
            Self::Wavelength(index) => vec![(index, 1.0)],
            Self::All => {
                let weights = model.channels.iter().map(|channel| channel.weight);
                weights.enumerate().filter(|(_, weight)| *weight > 0.0).collect()
            }
        }
    }

    /// The results of all wavelengths of this light.
    ///
    /// # Errors
    /// No wavelength has a result: the reason of the first one; or an interruption.
    pub(super) fn parts<T: Send>(
        self,
        model: &RayModel,
        compute: impl Fn(usize) -> Result<T, AnalysisError> + Sync,
    ) -> Result<ColorParts<T>, AnalysisError> {
        let wavelengths = self.wavelengths(model);
        let total: f64 = wavelengths.iter().map(|(_, weight)| weight).sum();
        // The peak of a perfect image of an energy grows with the reciprocal square of the wavelength.
        let of_peak = |(index, weight): &(usize, f64)| weight / model.channels[*index].um.powi(2);
        let whole_peak: f64 = wavelengths.iter().map(of_peak).sum();
        let results: Vec<_> = wavelengths.par_iter().map(|(index, _)| compute(*index)).collect();
        let (mut parts, mut why) = (Vec::new(), None);
        let (mut dark_share, mut refused) = (0.0, [0.0; 2]);
        for (color, result) in wavelengths.iter().zip(results) {
            match result {
                Ok(found) => {
                    parts.push(ColorPart { share: color.1, found });
                }
                Err(AnalysisError::Interrupted) => return Err(AnalysisError::Interrupted),
                Err(reason) => {
                    why.get_or_insert(reason);
                    if reason.is_loss_of_light() {
                        dark_share += color.1 / total;
                    } else {
                        refused[0] += color.1 / total;
                        refused[1] += of_peak(color) / whole_peak;
                    }
                }
            }
        }
        if parts.is_empty() {
            return Err(why.unwrap_or(AnalysisError::NoLight));
        }
        let lit: f64 = parts.iter().map(|part| part.share).sum();
        parts.iter_mut().for_each(|part| part.share /= lit);
        Ok(ColorParts { parts, dark_share, refused_share: refused[0].max(refused[1]) })
    }

    /// The point that an image in all light is looked at about, in mm: the image point of the chief ray of the
    /// primary wavelength, or of the first one with light. `None` for one wavelength, whose own point it is.
    ///
    /// # Errors
    /// No wavelength has light.
    pub(super) fn origin(
        self,
        model: &RayModel,
        field: FieldPoint,
    ) -> Result<Option<Vec3<f64>>, AnalysisError> {
        let center = |wavelength: usize| {
            let region = lit_region(model, field, wavelength)?;
            Ok(Some(ReferenceSphere::focused(&region)?.center))
        };
        match self {
            Self::Wavelength(_) => Ok(None),
            Self::All => center(model.primary).or_else(|why| {
                let others = self.wavelengths(model).into_iter();
                others.map(|(index, _)| center(index)).find(Result::is_ok).unwrap_or(Err(why))
            }),
        }
    }
}

/// The intensities of one wavelength at points about the origin of an image.
#[derive(Debug)]
pub(super) struct ColorIntensities {
    /// The intensity at each point over the peak of a perfect image.
    pub(super) found: ConvergedList,
    /// The peak of a perfect image of unit energy, in 1/mm².
    pub(super) peak: f64,
    /// The relative error of that.
    pub(super) peak_error: f64,
    pub(super) form: ReferenceForm,
    /// The image point of the chief ray, x and y in mm.
    pub(super) center: [f64; 2],
}

/// The point of the sphere of a wavelength, along its light, of a point about the origin of an image.
pub(super) fn about_sphere(
    sphere: &ReferenceSphere,
    origin: Option<Vec3<f64>>,
    [x, y, z]: [f64; 3],
) -> [f64; 3] {
    let shift = origin.map_or(Vec3::default(), |origin| origin - sphere.center);
    [x + shift.x, y + shift.y, z + shift.z * sphere.direction.z.signum()]
}

/// The intensities of a wavelength at points about the origin of an image, x and y in mm and z along the light.
///
/// # Errors
/// The field is dark, its pupil folds, or the computation was interrupted.
pub(super) fn color_intensities(
    (model, field, wavelength): (&RayModel, FieldPoint, usize),
    (origin, points): (Option<Vec3<f64>>, &[[f64; 3]]),
    accuracy: Accuracy,
    interrupted: &Interruption<'_>,
) -> Result<ColorIntensities, AnalysisError> {
    let region = lit_region(model, field, wavelength)?;
    let sphere = ReferenceSphere::focused(&region)?;
    let points: Vec<[f64; 3]> =
        points.iter().map(|point| about_sphere(&sphere, origin, *point)).collect();
    let across = points.iter().map(|[x, y, _]| x.hypot(*y)).fold(0.0, f64::max);
    let along = points.iter().map(|point| point[2].abs()).fold(0.0, f64::max);
    let few_peak = Cell::new(1.0);
    let intensities = |light: &PupilSamples| {
        let intensity = |[x, y, z]: &[f64; 3]| {
            if interrupted() {
                return Err(AnalysisError::Interrupted);
            }
            // Most points lie in the image, where the way is shorter.
            Ok(if *z == 0.0 { light.intensity([*x, *y]) } else { light.intensity_at([*x, *y, *z]) })
        };
        let relative = light.peak_of_energy() / few_peak.get();
        points.iter().map(intensity).chain(std::iter::once(Ok(relative))).collect()
    };
    let least = |few: &PupilSamples| {
        few_peak.set(few.peak_of_energy());
        let spread = few.spread();
        let turns = few.turns(across) + 0.5 * spread * spread * along / few.wavelength;
        (NODES_PER_TURN * turns).ceil() as usize
    };
    let found =
        PupilSamples::converge_from(&region, &sphere, least, accuracy, interrupted, intensities);
    let mut found = found?;
    let relative = found.values.pop().unwrap_or(1.0);
    let peak_error = found.errors.pop().unwrap_or(0.0) / relative;
    let peak = few_peak.get() * relative;
    let center = [sphere.center.x, sphere.center.y];
    Ok(ColorIntensities { found, peak, peak_error, form: sphere.form, center })
}

impl PupilSamples {
    /// The peak of an image without aberrations that holds unit energy, in 1/mm²: `∫ |U|² dx dy` over the whole
    /// plane is `λ² ∫ A² dα dβ` (Parseval).
    pub(super) fn peak_of_energy(&self) -> f64 {
        self.peak().powi(2) / (self.wavelength.powi(2) * self.energy())
    }
}

/// The light of all wavelengths about the origin of an image, in shares of the peak of a perfect image.
#[derive(Debug)]
pub(super) struct ColorSamples {
    parts: Vec<ColorSample>,
}

/// The light of a wavelength.
#[derive(Debug)]
pub(super) struct ColorSample {
    /// Its share of the peak of a perfect image.
    pub(super) share: f64,
    /// The origin of the image from the centre of its sphere, along its light.
    pub(super) shift: [f64; 3],
    pub(super) light: PupilSamples,
}

impl ColorSamples {
    /// The light of samples, whose shares are those of the energy.
    pub(super) fn new(mut parts: Vec<ColorSample>) -> Self {
        parts.iter_mut().for_each(|part| part.share *= part.light.peak_of_energy());
        let whole: f64 = parts.iter().map(|part| part.share).sum();
        parts.iter_mut().for_each(|part| part.share /= whole);
        Self { parts }
    }
}

impl ColorSample {
    fn place(&self, point: [f64; 3]) -> [f64; 3] {
        [0, 1, 2].map(|k| point[k] + self.shift[k])
    }
}

impl ImageIntensity for ColorSamples {
    fn intensity_at(&self, point: [f64; 3]) -> f64 {
        let of = |part: &ColorSample| part.share * part.light.intensity_at(part.place(point));
        self.parts.iter().map(of).sum()
    }

    fn slopes_at(&self, point: [f64; 3]) -> (Vector3<f64>, Matrix3<f64>) {
        let mut sum = (Vector3::zeros(), Matrix3::zeros());
        for part in &self.parts {
            let (gradient, curvature) = part.light.slopes_at(part.place(point));
            sum.0 += gradient * part.share;
            sum.1 += curvature * part.share;
        }
        sum
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::files;

    /// A wavelength without light changes nothing but its share; one that is refused might have added its own.
    #[test]
    fn what_is_left_out_is_counted_by_its_cause() {
        let bundled = files::bundled_lenses().iter().find(|lens| lens.name == "achromat_ac254_100");
        let lens = files::json::read(bundled.map_or("", |lens| lens.text), "achromat").unwrap();
        let model = RayModel::from_lens(&lens, 0).unwrap();
        let without_blue = |reason: AnalysisError| {
            let found = |wavelength| if wavelength == 0 { Err(reason) } else { Ok(wavelength) };
            ImageLight::All.parts(&model, found)
        };
        let dark = without_blue(AnalysisError::NoLight).unwrap();
        assert!((dark.dark_share - 1.0 / 3.0).abs() < 1e-12 && dark.refused_share == 0.0);
        let shares: Vec<f64> = dark.parts.iter().map(|part| part.share).collect();
        assert_eq!(shares, [0.5, 0.5]);
        let refused = without_blue(AnalysisError::FoldedPupil).unwrap();
        // The peak of a perfect image in blue light is higher than that of the others.
        assert!(refused.refused_share > 0.4 && refused.refused_share < 0.45, "{refused:?}");
        let none = ImageLight::All.parts::<()>(&model, |_| Err(AnalysisError::FoldedPupil));
        assert_eq!(none.unwrap_err(), AnalysisError::FoldedPupil);
    }
}
