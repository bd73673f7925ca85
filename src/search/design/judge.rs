//! The judgement of a lens against its requirements, by real rays through all of its rims.
//!
//! Every colour has the light that gets through at its own wavelength and the weight that is asked
//! for; the image plane stands where the sum over the fields of the mean squares is least.

use super::requirements::{FOCAL_LENGTH_TOLERANCE, NearObject};
use super::{LensRequirements, LensWish};
use crate::analysis::{
    AnalysisError, Spot, distortion, image_cone, polychromatic_geometric_mtf, spots,
};
use crate::lens::{
    FieldKind, FieldPoint, Fields, Lens, Medium, Object, Row, Wavelength,
    glass::{self, line},
};
use crate::merit::ConstraintMargin;
use crate::pupil::{Accuracy, RayModel, RayModelError};
use crate::search::element::piece_count;
use serde::Serialize;

/// The relative tolerance of the rays of a judgement.
pub const JUDGEMENT_TOLERANCE: f64 = 1e-3;
/// The number of steps of the field in which holes are looked for.
const FIELD_STEPS: usize = 10;
/// The spot between the fields, relative to the largest one at them, that counts as a hole.
const HOLE: f64 = 2.0;
/// The relative excess that rounding explains.
const ROUNDING: f64 = 1e-9;

/// The reason for which a lens cannot be judged.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum JudgementError {
    /// No rays can be traced.
    #[error(transparent)]
    Rays(#[from] RayModelError),
    /// A field has no image.
    #[error("field of {degrees} degrees: {cause}")]
    Field {
        /// The field, in degrees.
        degrees: f64,
        /// The cause.
        cause: AnalysisError,
    },
    /// The lens focuses nothing.
    #[error("the lens has no focal length or no best focus")]
    Afocal,
}

/// The image of a field.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct FieldJudgement {
    /// The field, in degrees.
    pub degrees: f64,
    /// The RMS spot radius over all wavelengths, in mm.
    pub rms: f64,
    /// The area of the beam in the plane of the first vertex at the primary wavelength, in mm².
    pub clear_area: f64,
    /// The area of the image's cone in direction cosines relative to that on the axis.
    pub relative_illumination: f64,
    /// The height of the chief ray in the image relative to `f tan θ`, or to the magnification of a near
    /// object, minus 1; 0 on the axis.
    pub distortion: f64,
    /// The mean of tangential and sagittal contrast by rays at the frequency of a wish for it.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub contrast: Option<f64>,
}

/// A quantity with its bounds and its slack.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct RequirementMargin {
    /// The quantity with its value and bounds.
    #[serde(flatten)]
    pub limit: ConstraintMargin,
    /// True if it keeps within its bounds.
    pub is_kept: bool,
}

/// The judgement of a lens.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct LensJudgement {
    /// The root of the mean over the fields of the squared RMS spot radii, in mm.
    pub rms: f64,
    /// The fields that are asked for.
    pub fields: Vec<FieldJudgement>,
    /// The largest RMS spot radius between the fields, in steps of a tenth, relative to the largest
    /// one at them.
    pub worst_between: f64,
    /// The shift of the image plane to its best position, in mm.
    pub refocus: f64,
    /// The focal length, in mm.
    pub focal_length: f64,
    /// The magnification of a near object; `None` for a distant one.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub magnification: Option<f64>,
    /// The mean contrast over the fields, tangential and sagittal, by rays, at the frequency of a wish for it.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub contrast: Option<f64>,
    /// The number of pieces of glass.
    pub elements: usize,
    /// The number of aspheric surfaces.
    pub aspheric_surfaces: usize,
    /// Everything that is limited.
    pub limits: Vec<RequirementMargin>,
    /// Other faults, in words: glasses that are not permitted, a hole between the fields.
    pub faults: Vec<String>,
}

impl LensJudgement {
    /// True if the lens keeps every limit and has no other fault.
    pub fn is_valid(&self) -> bool {
        self.faults.is_empty() && self.limits.iter().all(|margin| margin.is_kept)
    }

    /// Everything that is wrong, in words.
    pub fn failures(&self) -> Vec<String> {
        let broken = self.limits.iter().filter(|margin| !margin.is_kept);
        broken.map(|margin| failure(&margin.limit)).chain(self.faults.iter().cloned()).collect()
    }
}

/// A broken limit, in words.
fn failure(limit: &ConstraintMargin) -> String {
    let name = limit.term.replace('_', " ");
    let place = limit.place().map_or(String::new(), |place| format!(" of {place}"));
    let number = |value: f64| {
        let text = format!("{value:.6}");
        text.trim_end_matches('0').trim_end_matches('.').to_owned()
    };
    let value = number(limit.value);
    let found = if COUNTED.contains(&limit.term) {
        format!("{value} {name}{place}")
    } else {
        format!("{name}{place} {value}")
    };
    match (limit.min, limit.max) {
        (Some(min), _) if limit.value < min => {
            format!("{found}; at least {} required", number(min))
        }
        (_, Some(max)) => format!("{found}; at most {} allowed", number(max)),
        _ => found,
    }
}

/// The limits of numbers of things.
const COUNTED: [&str; 2] = ["elements", "aspheric_surfaces"];

/// Judges a lens: its own fields, wavelengths and zoom positions are replaced by what is asked for.
///
/// # Errors
/// A lens without an image at one of the fields.
pub fn judge_lens(
    lens: &Lens,
    asked: &LensRequirements,
    tolerance: f64,
) -> Result<LensJudgement, JudgementError> {
    let accuracy = Accuracy { tolerance, ..Accuracy::default() };
    let mut lens = as_asked(lens, asked, &asked.fields)?;
    let first = traced_spots(&RayModel::from_lens(&lens, 0)?, asked, accuracy)?;
    let refocus = common_focus(&first, asked).ok_or(JudgementError::Afocal)?;
    if let Some(last) = lens.surfaces.last_mut() {
        last.thickness += refocus;
    }
    let model = RayModel::from_lens(&lens, 0)?;
    let focal_length = model.first_order.efl.ok_or(JudgementError::Afocal)?;
    let fields = judge_fields(&model, &first, refocus, asked, accuracy)?;
    let mean = fields.iter().map(|f| f.rms * f.rms).sum::<f64>() / fields.len() as f64;
    let contrasts: Option<Vec<f64>> = fields.iter().map(|field| field.contrast).collect();
    let largest = fields.iter().map(|f| f.rms).fold(0.0, f64::max);
    let between = largest_between(&lens, asked, accuracy);
    let mut judgement = LensJudgement {
        rms: mean.sqrt(),
        worst_between: between.as_ref().map_or(f64::INFINITY, |rms| rms / largest),
        refocus,
        focal_length,
        magnification: asked.object.and(model.first_order.magnification),
        contrast: contrasts.map(|all| all.iter().sum::<f64>() / all.len() as f64),
        elements: piece_count(&lens),
        aspheric_surfaces: lens.surfaces.iter().filter(|row| is_aspheric(row)).count(),
        limits: Vec::new(),
        faults: foreign_glasses(&lens, asked),
        fields,
    };
    if let Err(dark) = between {
        judgement.faults.push(dark.to_string());
    } else if judgement.worst_between > HOLE {
        judgement.faults.push(format!(
            "between the fields the spot is {:.2} times the largest one at them; expected at most \
             {HOLE}",
            judgement.worst_between
        ));
    }
    judgement.limits = limits(&lens, asked, &judgement);
    Ok(judgement)
}

/// The lens with the fields and wavelengths that are asked for, at its first zoom position.
fn as_asked(lens: &Lens, asked: &LensRequirements, fields: &[f64]) -> Result<Lens, RayModelError> {
    let mut lens = lens.clone();
    lens.wavelengths = asked_wavelengths(asked);
    lens.fields = asked_fields(asked, fields);
    (lens.object, lens.merit) = (asked_object(asked), None);
    lens.variables.clear();
    let solved = lens.resolve(0, line::D)?;
    for (row, surface) in lens.surfaces.iter_mut().zip(&solved.surfaces) {
        row.thickness = surface.thickness;
    }
    lens.image_solve = None;
    lens.aperture = lens.aperture_at(0);
    lens.zoom.clear();
    lens.pickups.clear();
    Ok(lens)
}

/// The wavelengths that are asked for; the one nearest to the d line is primary.
pub(super) fn asked_wavelengths(asked: &LensRequirements) -> Vec<Wavelength> {
    let off = |um: f64| (um - line::D).abs();
    let all = || asked.wavelengths.iter().enumerate();
    let near = all().min_by(|a, b| off(a.1.0).total_cmp(&off(b.1.0))).map_or(0, |(i, _)| i);
    let wavelength =
        |(i, &(um, weight)): (usize, &(f64, f64))| Wavelength { um, weight, primary: i == near };
    all().map(wavelength).collect()
}

/// The object that is asked for.
pub(super) fn asked_object(asked: &LensRequirements) -> Object {
    asked.object.map_or(Object::Infinity, |object| Object::Finite(object.distance))
}

/// Fields at these angles in degrees; of a near object the points that the first vertex sees there, below
/// the axis as a distant point at a positive angle is.
pub(super) fn asked_fields(asked: &LensRequirements, degrees: &[f64]) -> Fields {
    let point = |y: f64| FieldPoint { x: 0.0, y, weight: 1.0 };
    let (kind, values) = match asked.object {
        None => (FieldKind::Angle, degrees.iter().map(|angle| point(*angle)).collect()),
        Some(object) => {
            let height = |angle: &f64| point(-object.distance * angle.to_radians().tan());
            (FieldKind::ObjectHeight, degrees.iter().map(height).collect())
        }
    };
    Fields { kind, values }
}

/// The angle of a field in degrees.
fn field_angle(asked: &LensRequirements, field: &FieldPoint) -> f64 {
    let of_near = |object: NearObject| (-field.y / object.distance).atan().to_degrees();
    asked.object.map_or(field.y, of_near)
}

fn traced_spots(
    model: &RayModel,
    asked: &LensRequirements,
    accuracy: Accuracy,
) -> Result<Vec<Spot>, JudgementError> {
    let named = |(spot, field): (Result<Spot, AnalysisError>, &FieldPoint)| {
        let degrees = field_angle(asked, field);
        let dark = |cause| JudgementError::Field { degrees, cause };
        let spot = spot.map_err(dark)?;
        if spot.is_fully_lit { Ok(spot) } else { Err(dark(AnalysisError::NoLight)) }
    };
    spots(model, accuracy).into_iter().zip(&model.fields).map(named).collect()
}

/// The mean square radius of a spot in mm² with the image plane moved by `defocus` mm: every colour
/// has its weight, however much of its light gets through.
fn mean_square(spot: &Spot, asked: &LensRequirements, defocus: f64) -> f64 {
    let weighted = || {
        let weights = asked.wavelengths.iter().map(|(_, weight)| *weight);
        weights.zip(&spot.channels).filter_map(|(w, channel)| Some((w, channel.as_ref().ok()?)))
    };
    let total: f64 = weighted().map(|(w, _)| w).sum();
    let center = [0, 1].map(|i| {
        weighted().map(|(w, channel)| w * channel.centroid_at(defocus)[i]).sum::<f64>() / total
    });
    let square = |(w, channel): (f64, &crate::analysis::MonochromaticSpot)| {
        let at = channel.centroid_at(defocus);
        let off = [0, 1].map(|i| at[i] - center[i]);
        w * (channel.rms_at(defocus).powi(2) + off[0] * off[0] + off[1] * off[1])
    };
    weighted().map(square).sum::<f64>() / total
}

/// The shift of the image plane in mm that makes the sum over the fields of the mean squares least.
fn common_focus(spots: &[Spot], asked: &LensRequirements) -> Option<f64> {
    // The sum is a parabola in the defocus: three points give its minimum.
    let at =
        |defocus: f64| -> f64 { spots.iter().map(|spot| mean_square(spot, asked, defocus)).sum() };
    let (left, middle, right) = (at(-1.0), at(0.0), at(1.0));
    let curvature = left - 2.0 * middle + right;
    (curvature > 0.0).then(|| 0.5 * (left - right) / curvature)
}

fn judge_fields(
    model: &RayModel,
    spots: &[Spot],
    refocus: f64,
    asked: &LensRequirements,
    accuracy: Accuracy,
) -> Result<Vec<FieldJudgement>, JudgementError> {
    let axis = FieldPoint { x: 0.0, y: 0.0, weight: 1.0 };
    let cone = |field: FieldPoint| {
        let cone = image_cone(model, field, model.primary, accuracy);
        let degrees = field_angle(asked, &field);
        cone.map_err(|cause| JudgementError::Field { degrees, cause })
    };
    let full = cone(axis)?.value;
    let judged = |spot: &Spot| {
        let degrees = field_angle(asked, &spot.field);
        let dark = |cause| JudgementError::Field { degrees, cause };
        let primary = spot.channels[model.primary].as_ref().map_err(|cause| dark(*cause))?;
        let height = distortion(model, spot.field, model.primary).map_err(dark)?;
        Ok(FieldJudgement {
            degrees,
            rms: mean_square(spot, asked, refocus).max(0.0).sqrt(),
            clear_area: primary.light.value,
            relative_illumination: cone(spot.field)?.value / full,
            distortion: height.distortion.unwrap_or(0.0),
            contrast: wished_contrast(model, spot.field, asked, accuracy).map_err(dark)?,
        })
    };
    spots.iter().map(judged).collect()
}

/// The mean of tangential and sagittal contrast of a field at the frequency of a wish for it.
fn wished_contrast(
    model: &RayModel,
    field: FieldPoint,
    asked: &LensRequirements,
    accuracy: Accuracy,
) -> Result<Option<f64>, AnalysisError> {
    let LensWish::Mtf(frequency) = asked.wish else { return Ok(None) };
    let curve = polychromatic_geometric_mtf(model, field, &[frequency], accuracy)?;
    let point = curve.points.first().ok_or(AnalysisError::NoLight)?;
    Ok(Some(0.5 * (point.tangential.modulus.value + point.sagittal.modulus.value)))
}

/// The largest RMS spot radius over the field in steps of a tenth, in mm.
fn largest_between(
    lens: &Lens,
    asked: &LensRequirements,
    accuracy: Accuracy,
) -> Result<f64, JudgementError> {
    let half = asked.half_field();
    let steps = (0..=FIELD_STEPS).map(|i| half * i as f64 / FIELD_STEPS as f64);
    let between = as_asked(lens, asked, &steps.collect::<Vec<_>>())?;
    let spots = traced_spots(&RayModel::from_lens(&between, 0)?, asked, accuracy)?;
    let squares = spots.iter().map(|spot| mean_square(spot, asked, 0.0));
    Ok(squares.fold(0.0, f64::max).max(0.0).sqrt())
}

/// True if a surface is neither a sphere nor a plane.
pub(super) fn is_aspheric(row: &Row) -> bool {
    (row.conic != 0.0 && row.curvature != 0.0) || row.asphere.iter().any(|term| *term != 0.0)
}

fn foreign_glasses(lens: &Lens, asked: &LensRequirements) -> Vec<String> {
    let is_foreign = |medium: &&Medium| match medium {
        Medium::Air => false,
        Medium::Glass(name) => {
            let full = glass::find(name).map(glass::Glass::full_name);
            full.is_none_or(|full| !asked.glasses.allows(&full))
        }
        Medium::Model { nd, vd } => !asked.glasses.allows_model(*nd, *vd),
        Medium::Index(_) | Medium::Mirror | Medium::Grin(_) => true,
    };
    let media = lens.surfaces.iter().map(|row| &row.medium).filter(is_foreign);
    let name = |medium: &Medium| match medium {
        Medium::Glass(name) => name.clone(),
        Medium::Model { nd, vd } => format!("nd {nd}, vd {vd}"),
        Medium::Index(n) => format!("the index {n}"),
        Medium::Mirror => "a mirror".to_owned(),
        Medium::Air | Medium::Grin(_) => "a gradient".to_owned(),
    };
    media.map(|medium| format!("{}: not one of the permitted glasses", name(medium))).collect()
}

/// A gap between two refracting surfaces; planes in air, such as a diaphragm, are part of it.
#[derive(Debug, Clone, Copy)]
pub(super) struct LensGap {
    /// The row in front of it.
    pub(super) front: usize,
    /// The row behind it.
    pub(super) rear: usize,
    /// True if it is filled with glass.
    pub(super) is_glass: bool,
}

impl LensGap {
    /// The gaps of a lens in order, without the one to the image.
    pub(super) fn all(lens: &Lens) -> Vec<Self> {
        let mut before = &lens.object_medium;
        let mut refracting = Vec::new();
        for (i, row) in lens.surfaces.iter().enumerate() {
            if row.medium != *before || *before != Medium::Air {
                refracting.push(i);
            }
            before = &row.medium;
        }
        let gap = |pair: &[usize]| {
            let is_glass = lens.surfaces[pair[0]].medium != Medium::Air;
            Self { front: pair[0], rear: pair[1], is_glass }
        };
        refracting.windows(2).map(gap).collect()
    }

    /// Its length on the axis, in mm.
    pub(super) fn center(&self, lens: &Lens) -> f64 {
        lens.surfaces[self.front..self.rear].iter().map(|row| row.thickness).sum()
    }

    /// Its length at the smaller rim of its two surfaces, in mm; `None` without rims.
    pub(super) fn edge(&self, lens: &Lens) -> Option<f64> {
        let [front, rear] = [self.front, self.rear].map(|row| &lens.surfaces[row]);
        let rim = front.semi_diameter?.min(rear.semi_diameter?);
        let sag = |row: &Row| row.shape().clamped_sag(rim);
        Some(self.center(lens) + sag(rear) - sag(front))
    }
}

/// The margins of everything that is limited.
fn limits(lens: &Lens, asked: &LensRequirements, found: &LensJudgement) -> Vec<RequirementMargin> {
    let mut all = Vec::new();
    let mut add = |term, surface, value: f64, min: Option<f64>, max: Option<f64>| {
        let (field, um) = (None, None);
        let limit = ConstraintMargin { term, surface, field, zoom: 0, um, value, min, max };
        let size = min.or(max).map_or(1.0, |bound| bound.abs().max(1.0));
        let is_kept = limit.slack() >= -ROUNDING * size;
        all.push(RequirementMargin { limit, is_kept });
    };
    let f = asked.focal_length;
    let [shortest, longest] = [-1.0, 1.0].map(|sign| f * (1.0 + sign * FOCAL_LENGTH_TOLERANCE));
    match (asked.object, found.magnification) {
        (Some(object), magnification) => {
            let range = [1.0, -1.0]
                .map(|sign| Some(object.magnification * (1.0 + sign * FOCAL_LENGTH_TOLERANCE)));
            let magnification = magnification.unwrap_or(0.0);
            add("magnification", None, magnification, range[0], range[1]);
        }
        (None, _) => {
            add("focal_length", None, found.focal_length, Some(shortest), Some(longest));
        }
    }
    let back = lens.surfaces.last().map_or(0.0, |row| row.thickness);
    add("back_focus", None, back, Some(asked.back_focus), None);
    add("total_track", None, lens.total_track(), None, Some(asked.track));
    add("elements", None, found.elements as f64, None, Some(asked.elements as f64));
    let aspheric = found.aspheric_surfaces as f64;
    add("aspheric_surfaces", None, aspheric, None, Some(asked.aspheric_surfaces as f64));
    let rims = lens.surfaces.iter().map(|row| row.semi_diameter.unwrap_or(f64::INFINITY));
    let widest = rims.fold(0.0, f64::max);
    add("semi_diameter", None, widest, None, Some(asked.semi_diameter));
    for gap in LensGap::all(lens) {
        let at = Some(gap.front);
        let edge = gap.edge(lens).unwrap_or(f64::NEG_INFINITY);
        if gap.is_glass {
            add("glass_center", at, gap.center(lens), Some(asked.glass_center), None);
            add("glass_edge", at, edge, Some(asked.glass_edge), None);
        } else {
            add("air_center", at, gap.center(lens), Some(asked.air_center), None);
            add("air_edge", at, edge, Some(0.0), None);
        }
    }
    for (i, field) in found.fields.iter().enumerate() {
        add("clear_area", Some(i), field.clear_area, Some(asked.clear_area[i]), None);
        let light = asked.relative_illumination[i];
        add("relative_illumination", Some(i), field.relative_illumination, Some(light), None);
        let range = [-asked.distortion, asked.distortion];
        add("distortion", Some(i), field.distortion, Some(range[0]), Some(range[1]));
    }
    all
}
