//! The decision whether a picture needs diffraction, and the part of it that is left out.
//!
//! A picture by rays has the geometric contrast G. Rays from points that are displaced as the light of the
//! unaberrated pupil spreads (see the module of spreads) multiply it by the contrast H of that pupil. The
//! contrast by diffraction D is near `G H` where aberrations are small or large, and exactly that without
//! any; in between it is not. All three are computed at some points of the picture and some frequencies: the change
//! `|D − G|` decides whether diffraction is put in, and what is left, `|D − G H|`, is an error of the picture.
//! Where that is too much, and the whole scene is at one distance, the spread of the pupil with its aberrations A
//! takes the place of both (see the module of aimed light), and `|D − A|` is left.

use super::aimed_light::AberratedLens;
use super::frame::ImageFrame;
use super::lit_directions::LitDirections;
use super::pupil_spread::PupilSpreads;
use super::{ColorBand, PictureError, Scene};
use crate::analysis::{BackwardLens, MtfCurve, diffraction_mtf, geometric_mtf};
use crate::lens::FieldPoint;
use crate::math::ComplexPair;
use crate::pupil::{Accuracy, RayModel};
use rayon::prelude::*;
use serde::Serialize;

/// Diffraction in a picture.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct DiffractionReport {
    /// True if it is in the picture: each point spreads its light as the pupil of its place does.
    pub on: bool,
    /// True if that is the pupil with its aberrations, in place of rays from all of it.
    pub aberrated: bool,
    /// The largest change of the spread's contrast over the picture.
    pub variation: f64,
    /// The largest change of contrast that diffraction makes, or a bound of it if nothing was computed.
    pub change: f64,
    /// The largest error of contrast that is left.
    pub left: f64,
    /// The share of the light of a point that falls beyond the margin up to which it is spread.
    pub cut: f64,
    /// The highest frequency compared, in cycles/mm.
    pub frequency: f64,
    /// The number of points of the picture that were compared; 0 if the bound decided, or if no comparison is
    /// possible.
    pub points: usize,
    /// The reason why the spread is that of a pupil without aberrations where those matter.
    pub without_aberrations: Option<&'static str>,
    /// The reason of the decision.
    pub reason: &'static str,
}

impl DiffractionReport {
    /// Diffraction that is left out, by a bound of the change of contrast up to a frequency.
    fn off(bound: f64, frequency: f64, reason: &'static str) -> Self {
        Self {
            on: false,
            aberrated: false,
            variation: 0.0,
            change: bound,
            left: bound,
            cut: 0.0,
            frequency,
            points: 0,
            without_aberrations: None,
            reason,
        }
    }

    /// The error of a picture as a share of mid grey, given its mean in units of that: contrast that is left
    /// changes mid grey by its share at most, and light that is cut off is missing from all of the picture.
    pub fn error(&self, mean_over_grey: f64) -> f64 {
        self.left.hypot(self.cut * mean_over_grey.max(1.0))
    }
}

/// Diffraction of a picture, ready to be put in.
#[derive(Debug)]
pub(super) struct DiffractionLight {
    pub(super) report: DiffractionReport,
    /// The directions of light as far as it spreads, and the spreads; `None` if diffraction is left out.
    pub(super) parts: Option<(LitDirections, PupilSpreads)>,
}

/// The change of contrast by diffraction over νλF, at most, for five families of aberrations.
const LARGEST_CHANGE: f64 = 1.27;
/// The reason why diffraction is left out of a scene without contrast.
const UNIFORM: &str =
    "the same light comes from every direction, of which no blur changes anything but the edge";
/// The parts of the highest frequency, and of the way to the corner, at which contrasts are compared.
const COMPARED: [f64; 3] = [0.25, 0.5, 1.0];
const PLACES: [f64; 3] = [0.0, 0.7, 1.0];
/// The share of the tolerance that is enough for contrasts, within these limits.
const ACCURACY: f64 = 0.1;
const ACCURACIES: [f64; 2] = [2e-4, 5e-3];
/// The margins that are tried, in λF: up to where light is spread. The smallest is that of the tables.
const MARGINS: [f64; 3] = [200.0, 60.0, 25.0];
/// The rings of directions.
const RINGS: usize = 12;

impl DiffractionLight {
    fn off(report: DiffractionReport) -> Self {
        Self { report, parts: None }
    }

    /// Diffraction for a frame of pictures of a model in some colours; it is put in if it changes contrast by
    /// more than a tolerance and less is left then.
    ///
    /// # Errors
    /// A lens that cannot be traced backwards.
    pub(super) fn new(
        (model, bands): (&RayModel, &[ColorBand]),
        frame: &ImageFrame,
        (inside, wavelengths): (&LitDirections, &[usize]),
        (tolerance, scene): (f64, &Scene),
    ) -> Result<Self, PictureError> {
        let f_number = model.first_order.working_f_number.map_or(f64::INFINITY, f64::abs);
        let wavelength = image_wavelength(model, model.primary);
        let cutoff = 1.0 / (wavelength * f_number);
        let frequency = (0.5 / frame.pitch).min(cutoff);
        let bound = (LARGEST_CHANGE * frequency / cutoff).min(1.0);
        let without = |reason| DiffractionReport::off(bound, frequency, reason);
        let off = |reason| Ok(Self::off(without(reason)));
        if scene.is_uniform() {
            return Ok(Self::off(DiffractionReport::off(0.0, frequency, UNIFORM)));
        }
        if bound <= tolerance {
            return off("at most 1.27 nu lambda F of contrast");
        }
        let reach = frame.reach();
        let longest = longest(model, bands);
        let size = (reach, longest / lit_width(inside).unwrap_or(0.0));
        let Some((directions, spreads)) = unaberrated((model, bands), wavelengths, size)? else {
            return off("left out: the directions of light around the picture are not known");
        };
        let least = (ACCURACY * tolerance).clamp(ACCURACIES[0], ACCURACIES[1]);
        let contrasts = PLACES.par_iter().filter_map(|part| {
            PlaceContrast::new((model, bands), (part * reach, frequency), least)
        });
        let contrasts = Contrasts(contrasts.collect());
        if contrasts.0.is_empty() {
            return off("left out: contrast by diffraction is not known anywhere in the picture");
        }
        let change = contrasts.largest(PlaceContrast::change);
        let matters = change > tolerance;
        let lens = AberratedLens { model, bands, directions: &directions, scene };
        let left = contrasts.largest(|place| place.left(&spreads, true));
        let trial = contrasts.aberrated((&spreads, left), &lens, (reach, tolerance), matters);
        let (mut spreads, left, refused) = match trial {
            AberratedTrial::Better(own, less) => (own, less, None),
            AberratedTrial::NotNeeded => (spreads, left, None),
            AberratedTrial::Refused(why) => (spreads, left, Some(why)),
        };
        let on = matters && left < change;
        let aberrated = on && spreads.aimed.is_some();
        let report = DiffractionReport {
            on,
            aberrated,
            variation: spreads.variation(&compared_shifts(frequency * wavelength)),
            change,
            left: if on { left } else { change },
            cut: if on { spreads.cut(longest) } else { 0.0 },
            points: contrasts.0.len(),
            reason: if aberrated { ABERRATED } else { reason([on, matters, left > tolerance]) },
            without_aberrations: refused,
            ..without("")
        };
        spreads.is_even = report.variation <= tolerance;
        Ok(Self { report, parts: on.then_some((directions, spreads)) })
    }
}

/// The shifts of the pupil along both axes, in cosines, at which contrasts are compared, given the largest.
fn compared_shifts(largest: f64) -> Vec<[f64; 2]> {
    let along = COMPARED.iter().map(|part| part * largest);
    along.flat_map(|shift| [[shift, 0.0], [0.0, shift]]).collect()
}

/// Directions of light as far as it spreads, and the spreads of pupils without aberrations, up to `reach` mm from the
/// axis; the longest wavelength over the width of the light is given. `None` where directions are not known.
fn unaberrated(
    (model, bands): (&RayModel, &[ColorBand]),
    wavelengths: &[usize],
    (reach, unit): (f64, f64),
) -> Result<Option<(LitDirections, PupilSpreads)>, PictureError> {
    if !unit.is_finite() {
        return Ok(None);
    }
    let lens = BackwardLens::for_picture(model, model.primary)?;
    let all = |factor: f64| {
        let margin = factor * unit;
        let directions = LitDirections::new(model, wavelengths, reach + margin, RINGS).ok()?;
        let lens = (&lens, offsets(bands));
        let spreads = PupilSpreads::new(lens, &directions, reach, margin).ok()?;
        Some((directions, spreads))
    };
    Ok(MARGINS.into_iter().find_map(all))
}

/// Contrasts at places of a picture.
struct Contrasts(Vec<PlaceContrast>);

impl Contrasts {
    fn largest(&self, error: impl Fn(&PlaceContrast) -> f64) -> f64 {
        self.0.iter().map(error).fold(0.0, f64::max)
    }

    /// The spreads of pupils with their aberrations, if those of pupils alone leave too much.
    fn aberrated(
        &self,
        (plain, left): (&PupilSpreads, f64),
        lens: &AberratedLens<'_>,
        (reach, tolerance): (f64, f64),
        matters: bool,
    ) -> AberratedTrial {
        if !matters || left <= tolerance {
            return AberratedTrial::NotNeeded;
        }
        if !lens.scene.is_at_one_distance() {
            return AberratedTrial::Refused("the scene is not at one distance");
        }
        let Some(own) = lens.spreads(reach, plain.margin) else {
            return AberratedTrial::Refused(
                "a chief ray is lost, or the wavefront is too steep for the table of spreads",
            );
        };
        let less = self.largest(|place| place.left(&own, false));
        if less < left {
            AberratedTrial::Better(own, less)
        } else {
            AberratedTrial::Refused("a spread with aberrations would be no nearer")
        }
    }
}

/// The spread of pupils with their aberrations, tried in place of that of pupils alone.
enum AberratedTrial {
    /// Pupils alone are good enough.
    NotNeeded,
    /// The spreads, and what they leave.
    Better(PupilSpreads, f64),
    /// The reason why pupils alone are taken.
    Refused(&'static str),
}

/// The reason for a spread with aberrations.
const ABERRATED: &str =
    "it changes contrast; the spread of the pupil with its aberrations is put in";

/// The number of wavelengths of each colour that come before it.
pub(super) fn offsets(bands: &[ColorBand]) -> Vec<usize> {
    let counts = bands.iter().map(|band| band.wavelengths.len());
    counts
        .scan(0, |sum, count| {
            *sum += count;
            Some(*sum - count)
        })
        .collect()
}

/// The reason for a spread that is `on` or not, by whether it matters and whether much is left.
fn reason(decided: [bool; 3]) -> &'static str {
    match decided {
        [true, _, false] => "it changes contrast; the spread of the unaberrated pupil is put in",
        [true, _, true] => {
            "it changes contrast; the spread of the unaberrated pupil is put in, and aberrations change \
             that spread"
        }
        [false, true, _] => {
            "left out although it changes contrast: the spread of the unaberrated pupil would be no better"
        }
        [false, false, _] => "the change of contrast is small",
    }
}

/// The wavelength in the image space in mm.
pub(super) fn image_wavelength(model: &RayModel, wavelength: usize) -> f64 {
    let channel = &model.channels[wavelength];
    let index = channel.system.index_before(channel.system.surfaces.len().saturating_sub(1));
    1e-3 * channel.um / index.abs()
}

/// The longest wavelength of some colours in the image space, in mm.
fn longest(model: &RayModel, bands: &[ColorBand]) -> f64 {
    let all = bands.iter().flat_map(|band| &band.wavelengths);
    all.map(|(w, _)| image_wavelength(model, *w)).fold(0.0, f64::max)
}

/// The smaller width of the set of directions on the axis, in cosines.
fn lit_width(directions: &LitDirections) -> Option<f64> {
    let [_, half] = directions.bounds(0.0)?;
    Some(2.0 * half[0].min(half[1])).filter(|width| *width > 0.0)
}

/// The field of a model whose chief ray lands at a distance in mm from the axis.
pub(super) fn field_at(model: &RayModel, radius: f64) -> Option<FieldPoint> {
    let field = |y: f64| FieldPoint { x: 0.0, y, weight: 1.0 };
    if radius == 0.0 {
        return Some(field(0.0));
    }
    let height = |y: f64| {
        let launch = model.launch(field(y), model.primary).ok()?;
        let point = launch.unclipped_landing([0.0; 2])?.ray.point.value();
        Some(point.x.hypot(point.y)).filter(|height| *height > 0.0)
    };
    let sizes = model.fields.iter().map(|own| own.x.hypot(own.y));
    let mut y = sizes.fold(0.0, f64::max);
    for _ in 0..4 {
        y *= radius / height(y)?;
    }
    Some(field(y)).filter(|_| y.is_finite())
}

/// The contrasts of a lens at a distance from the axis.
struct PlaceContrast {
    radius: f64,
    /// Their colour and the number of its wavelength, and that in the image space in mm.
    light: [usize; 2],
    wavelength: f64,
    wave: MtfCurve,
    rays: MtfCurve,
    /// −1 if they are those of a point on the other side of the axis, else 1.
    side: f64,
}

impl PlaceContrast {
    /// The contrasts of the middle colour up to a frequency; `None` if one is not known.
    fn new(
        (model, bands): (&RayModel, &[ColorBand]),
        (radius, highest): (f64, f64),
        tolerance: f64,
    ) -> Option<Self> {
        let color = bands.len() / 2;
        let middle = bands[color].wavelengths.len() / 2;
        let wavelength = bands[color].wavelengths[middle].0;
        let field = field_at(model, radius)?;
        let frequencies = COMPARED.map(|part| part * highest);
        let accuracy = Accuracy { tolerance, ..Accuracy::default() };
        let launch = model.launch(field, wavelength).ok()?;
        let height = launch.unclipped_landing([0.0; 2])?.ray.point.y.value;
        Some(Self {
            radius,
            light: [color, middle],
            wavelength: image_wavelength(model, wavelength),
            wave: diffraction_mtf(model, field, wavelength, &frequencies, accuracy).ok()?,
            rays: geometric_mtf(model, field, wavelength, &frequencies, accuracy).ok()?,
            side: if height < 0.0 { -1.0 } else { 1.0 },
        })
    }

    /// The largest change of contrast by diffraction.
    fn change(&self) -> f64 {
        self.largest(|rays, _| rays)
    }

    /// The largest part of the contrast that is left by spreads, times that by rays or without it.
    fn left(&self, spreads: &PupilSpreads, with_rays: bool) -> f64 {
        self.largest(|[re, im], shift| {
            let [a, b] = spreads.transfer(self.light, self.radius, shift);
            // Mirrored on the other side of the axis, which along x changes nothing.
            let b = self.side * b;
            if with_rays { [a * re, a * im] } else { [a, b] }
        })
    }

    /// The largest difference of the contrast by diffraction from what is made of that by rays and of a shift in
    /// cosines.
    fn largest(&self, made: impl Fn(ComplexPair, [f64; 2]) -> ComplexPair) -> f64 {
        let mut largest = 0.0_f64;
        for (d, g) in self.wave.points.iter().zip(&self.rays.points) {
            let shift = self.wavelength * d.frequency;
            let pairs = [
                (&d.tangential, &g.tangential, [0.0, shift]),
                (&d.sagittal, &g.sagittal, [shift, 0.0]),
            ];
            for (d, g, shift) in pairs {
                let error = d.modulus.error + g.modulus.error;
                let [re, im] = made([g.re, g.im], shift);
                largest = largest.max((d.re - re).hypot(d.im - im) + error);
            }
        }
        largest
    }
}
