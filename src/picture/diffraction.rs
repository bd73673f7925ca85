//! The decision whether a picture needs diffraction, and the part of it that is left out.
//!
//! A picture by rays has the geometric contrast G. Rays from points that are displaced as the light of the
//! unaberrated pupil spreads (see the module of spreads) multiply it by the contrast H of that pupil. The
//! contrast by diffraction D is near `G H` where aberrations are small or large, and exactly that without
//! any; in between it is not. All three are computed at some points of the picture and some frequencies: the change
//! `|D − G|` decides whether diffraction is put in, and what is left, `|D − G H|`, is an error of the picture.

use super::frame::ImageFrame;
use super::lit_directions::LitDirections;
use super::pupil_spread::PupilSpreads;
use super::{ColorBand, PictureError};
use crate::analysis::{BackwardLens, MtfCurve, diffraction_mtf, geometric_mtf};
use crate::lens::FieldPoint;
use crate::pupil::{Accuracy, RayModel};
use rayon::prelude::*;
use serde::Serialize;

/// Diffraction in a picture.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct DiffractionReport {
    /// True if it is in the picture: each point spreads its light as the unaberrated pupil of its place does.
    pub on: bool,
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
    /// The reason of the decision.
    pub reason: &'static str,
}

impl DiffractionReport {
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
    /// Diffraction for a frame of pictures of a model in some colours; it is put in if it changes contrast by
    /// more than a tolerance and less is left then.
    ///
    /// # Errors
    /// A lens that cannot be traced backwards.
    pub(super) fn new(
        (model, bands): (&RayModel, &[ColorBand]),
        frame: &ImageFrame,
        (inside, wavelengths): (&LitDirections, &[usize]),
        tolerance: f64,
    ) -> Result<Self, PictureError> {
        let f_number = model.first_order.working_f_number.map_or(f64::INFINITY, f64::abs);
        let wavelength = image_wavelength(model, model.primary);
        let cutoff = 1.0 / (wavelength * f_number);
        let frequency = (0.5 / frame.pitch).min(cutoff);
        let bound = (LARGEST_CHANGE * frequency / cutoff).min(1.0);
        let without = |reason| DiffractionReport {
            on: false,
            change: bound,
            left: bound,
            cut: 0.0,
            frequency,
            points: 0,
            reason,
        };
        let off = |reason| Ok(Self { report: without(reason), parts: None });
        if bound <= tolerance {
            return off("at most 1.27 nu lambda F of contrast");
        }
        let lens = BackwardLens::new(model, model.primary)?;
        let reach = frame.reach();
        let longest = longest(model, bands);
        let all = |factor: f64| {
            let margin = factor * longest / lit_width(inside)?;
            let directions = LitDirections::new(model, wavelengths, reach + margin, RINGS).ok()?;
            let spreads = PupilSpreads::new(&lens, &directions, reach, margin).ok()?;
            Some((directions, spreads))
        };
        let Some((directions, spreads)) = MARGINS.into_iter().find_map(all) else {
            return off("left out: the directions of light around the picture are not known");
        };
        let least = (ACCURACY * tolerance).clamp(ACCURACIES[0], ACCURACIES[1]);
        let compare = |part: &f64| compare(model, (part * reach, frequency), &spreads, least);
        let found: Vec<_> = PLACES.par_iter().filter_map(compare).collect();
        let Some([change, left]) =
            found.iter().copied().reduce(|a, b| [a[0].max(b[0]), a[1].max(b[1])])
        else {
            return off("left out: contrast by diffraction is not known anywhere in the picture");
        };
        let on = change > tolerance && left < change;
        let report = DiffractionReport {
            on,
            change,
            left: if on { left } else { change },
            cut: if on { spreads.cut(longest) } else { 0.0 },
            points: found.len(),
            reason: reason([on, change > tolerance, left > tolerance]),
            ..without("")
        };
        Ok(Self { report, parts: on.then_some((directions, spreads)) })
    }
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

/// The largest change of contrast by diffraction at a distance from the axis up to a frequency, and the largest
/// that is left of it; `None` if a contrast is not known.
fn compare(
    model: &RayModel,
    (radius, highest): (f64, f64),
    spreads: &PupilSpreads,
    tolerance: f64,
) -> Option<[f64; 2]> {
    let field = field_at(model, radius)?;
    let frequencies = COMPARED.map(|part| part * highest);
    let accuracy = Accuracy { tolerance, ..Accuracy::default() };
    let wave = diffraction_mtf(model, field, model.primary, &frequencies, accuracy).ok()?;
    let rays = geometric_mtf(model, field, model.primary, &frequencies, accuracy).ok()?;
    Some(differences((&wave, &rays), image_wavelength(model, model.primary), |shift| {
        spreads.transfer(radius, shift)
    }))
}

/// The largest differences of contrasts by diffraction and by rays, and by rays times those of a pupil.
fn differences(
    (wave, rays): (&MtfCurve, &MtfCurve),
    wavelength: f64,
    of_pupil: impl Fn([f64; 2]) -> f64,
) -> [f64; 2] {
    let mut largest = [0.0_f64; 2];
    for (d, g) in wave.points.iter().zip(&rays.points) {
        let shift = wavelength * d.frequency;
        let pairs = [
            (&d.tangential, &g.tangential, of_pupil([0.0, shift])),
            (&d.sagittal, &g.sagittal, of_pupil([shift, 0.0])),
        ];
        for (d, g, h) in pairs {
            let error = d.modulus.error + g.modulus.error;
            let apart = |share: f64| (d.re - share * g.re).hypot(d.im - share * g.im) + error;
            largest = [largest[0].max(apart(1.0)), largest[1].max(apart(h))];
        }
    }
    largest
}
