//! Default goals: what a designer asks of a lens unless he says otherwise. The numbers of this
//! policy are defined here, once.

use super::constraints::MinimumThickness;
use super::goal::focal_lengths;
use super::{Goal, LimitTreatment, MeritError, PupilEdge, Term, WeightedTerm};
use crate::lens::{Lens, Medium, Row, ToleranceGrade};
use std::f64::consts::PI;

/// The steepness of a surface, `|curvature| × semi-diameter`, up to which it counts as easy to
/// manufacture; 1 is a hemisphere.
pub const MAX_STEEPNESS: f64 = 0.9;
/// The spot radius that outweighs all of the light, relative to the focal length.
const LIGHT_IN_SPOT: f64 = 0.02;
/// The weight of the squared deviation of the focal length, relative to that of the spots.
const FOCAL_LENGTH_WEIGHT: f64 = 1e-2;
/// The factor by which a lens may become longer.
const TRACK_GROWTH: f64 = 1.2;
/// The part of the back focus that has to remain.
const BACK_FOCUS_RETAINED: f64 = 0.8;
/// The violation of a steepness that counts as much as a spot of this radius, relative to the focal
/// length.
const STEEPNESS_IN_SPOT: f64 = 0.1;
/// The relative illumination asked of the last field.
const CORNER_ILLUMINATION: f64 = 0.5;

/// The radius of the blur of an RMS wavefront of one wave, over wavelength and f-number.
const WAVE_BLUR: f64 = 8.0;
/// The radius of the blur of an image without any of its Strehl ratio, likewise.
const STREHL_BLUR: f64 = 1.2;
/// A wavelength of visible light, in mm.
const PRIMARY: f64 = 5.5e-4;
/// The spatial frequency of a proposed contrast, in cycles/mm, and its minimum: those of a picture on
/// film.
const MTF_FREQUENCY: f64 = 30.0;
const MTF_MIN: f64 = 0.5;
/// The largest irradiance of a proposed ghost over that at the entrance of the lens: an average ghost of bare glass
/// as wide as the entrance pupil.
const GHOST_IRRADIANCE: f64 = 2e-3;

/// The limits that a lens has to satisfy, with the weight 1 for squared violations in mm².
#[derive(Debug, Clone, PartialEq)]
pub struct GoalLimits {
    /// The minimum and maximum centre thickness of glass, in mm.
    pub glass_center: [f64; 2],
    /// The minimum edge thickness of glass, in mm.
    pub glass_edge: f64,
    /// The minimum and maximum centre thickness of air gaps, in mm.
    pub air_center: [f64; 2],
    /// The minimum edge thickness of air gaps, in mm.
    pub air_edge: f64,
    /// The maximum of `|curvature| × semi-diameter`.
    pub steepness: f64,
    /// The maximum semi-diameter in mm, if there is one.
    pub semi_diameter: Option<f64>,
    /// The maximum total track in mm; by default a fifth more than that of the lens.
    pub track: Option<f64>,
    /// The minimum back focus in mm; by default four fifths of that of the lens.
    pub back_focus: Option<f64>,
}

/// The measured figures of a lens from which [`default_terms`] takes its targets; `None` for those
/// that are unknown.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct LensFigures {
    /// The focal length, in mm.
    pub focal_length: Option<f64>,
    /// The mean area of the pupils in the first vertex plane, in mm².
    pub light: Option<f64>,
    /// The area of the pupil on the axis, in mm².
    pub axial_light: Option<f64>,
    /// The mean square radius of the spots, in mm².
    pub mean_square_spot: Option<f64>,
}

impl Goal {
    /// The merit function of a lens: its own, or else the default one.
    ///
    /// # Errors
    /// As [`Goal::default_for`].
    pub fn of_lens(lens: &Lens) -> Result<Self, MeritError> {
        lens.merit.clone().map_or_else(|| Self::default_for(lens), Ok)
    }

    /// The default goal for a lens: sharp spots at its focal length and with its light, thicknesses
    /// of glass and air that can be manufactured or are no smaller than they are, and a track at
    /// most a fifth longer than it is.
    ///
    /// # Errors
    /// A lens without first-order data.
    pub fn default_for(lens: &Lens) -> Result<Self, MeritError> {
        Self::default_at(lens, None)
    }

    /// The default goal for a lens that is to have a focal length in mm, by default the one that it
    /// has: a longer one leaves room for a longer track. An afocal lens is asked for none.
    ///
    /// # Errors
    /// A lens without first-order data.
    pub fn default_at(lens: &Lens, target: Option<f64>) -> Result<Self, MeritError> {
        let focal_lengths = focal_lengths(lens)?;
        let first = focal_lengths[0].map(|own| target.unwrap_or(own));
        let [track, _] = focused_gaps(lens);
        let track = track * growth(target, focal_lengths[0]);
        let size = first.map_or(track, f64::abs);
        let now = MinimumThickness::measure(lens)?;
        let (glass, air) = (0.012 * size, 0.002 * size);
        let mut terms = vec![unit(Term::Spot)];
        terms.extend(first.map(focal_length));
        terms.extend(
            [
                Term::GlassCenter {
                    min: now.glass_center.max(0.0).min(glass),
                    max: thickest(lens, size),
                },
                Term::GlassEdge(now.glass_edge.max(0.0).min(0.8 * glass)),
                Term::AirCenter { min: now.air_center.max(0.0).min(air), max: 3.0 * track },
                Term::AirEdge(now.air_edge.max(0.0).min(0.5 * air)),
                Term::TotalTrack(TRACK_GROWTH * track),
            ]
            .map(unit),
        );
        terms.push(in_spots(Term::Light(1.0), size));
        let zoom_ratios = zoom_ratios(lens, &focal_lengths);
        Ok(Self {
            terms,
            pupil: PupilEdge::default(),
            zoom_ratios,
            limits: LimitTreatment::default(),
        })
    }

    /// Sharp spots at a focal length in mm, by default that of the lens, at every field at least
    /// the fraction `light` of its light, and limits as penalties (4.6). The focal length applies to
    /// the first zoom position; the others keep their ratios to it.
    ///
    /// # Errors
    /// A lens without first-order data.
    pub fn with_limits(
        lens: &Lens,
        limits: &GoalLimits,
        target: Option<f64>,
        light: f64,
    ) -> Result<Self, MeritError> {
        let focal_lengths = focal_lengths(lens)?;
        let target = target.or(focal_lengths[0]);
        let [track, rear] = focused_gaps(lens);
        let size = target.map_or(track, f64::abs);
        let mut terms = vec![unit(Term::Spot)];
        terms.extend(target.map(focal_length));
        terms.push(in_spots(Term::Light(light), size));
        let [[glass_min, glass_max], [air_min, air_max]] = [limits.glass_center, limits.air_center];
        terms.extend(
            [
                Term::GlassCenter { min: glass_min, max: glass_max },
                Term::GlassEdge(limits.glass_edge),
                Term::AirCenter { min: air_min, max: air_max },
                Term::AirEdge(limits.air_edge),
                Term::TotalTrack(limits.track.unwrap_or(TRACK_GROWTH * track)),
                Term::BackFocus(limits.back_focus.unwrap_or(BACK_FOCUS_RETAINED * rear)),
            ]
            .map(unit),
        );
        let weight = (STEEPNESS_IN_SPOT * size).powi(2);
        terms.push(WeightedTerm::new(Term::Steepness(limits.steepness), weight));
        terms.extend(limits.semi_diameter.map(|max| unit(Term::SemiDiameter { min: 0.0, max })));
        let zoom_ratios = zoom_ratios(lens, &focal_lengths);
        let limits = LimitTreatment::Penalties;
        Ok(Self { terms, pupil: PupilEdge::Moving, zoom_ratios, limits })
    }
}

/// The factor by which a lens grows when it is scaled to a longer focal length, else 1.
fn growth(target: Option<f64>, present: Option<f64>) -> f64 {
    let ratio = target.zip(present).map_or(1.0, |(target, present)| target / present);
    if ratio.is_finite() { ratio.max(1.0) } else { 1.0 }
}

/// Every kind of term once, with targets that the lens satisfies or nearly satisfies at a zoom
/// position, and with weights in proportion to its spots: what an editor of goals offers.
pub fn default_terms(lens: &Lens, zoom: usize, figures: &LensFigures) -> Vec<WeightedTerm> {
    let positive = |value: Option<f64>, otherwise: f64| {
        value.filter(|v| v.is_finite() && *v > 0.0).unwrap_or(otherwise)
    };
    let efl = figures.focal_length.unwrap_or(100.0);
    let size = positive(Some(efl.abs()), 100.0);
    let axial_light = positive(figures.axial_light, 0.01 * size * size);
    let light = positive(figures.light, axial_light);
    let spot = positive(figures.mean_square_spot, 1e-6 * size * size);
    let f_number = size / (2.0 * (axial_light / PI).sqrt());
    let track = lens.total_track();
    let field = lens.fields_at(zoom).values.len().saturating_sub(1);
    let [narrowest, widest] = semi_diameter_range(lens, size);
    let given_away = light_weight(size);
    let weighted = |term, weight| WeightedTerm::new(term, weight);
    vec![
        unit(Term::Spot),
        unit(Term::AsBuilt { grade: Some(ToleranceGrade::Precision) }),
        weighted(Term::SpotIntegral, 1.0 / light),
        weighted(Term::Strehl, (STREHL_BLUR * f_number * PRIMARY).powi(2)),
        weighted(Term::Wavefront, (WAVE_BLUR * f_number * PRIMARY).powi(2)),
        weighted(Term::GeometricMtf { frequency: MTF_FREQUENCY, min: MTF_MIN }, spot),
        weighted(Term::Mtf { frequency: MTF_FREQUENCY, min: MTF_MIN }, spot),
        weighted(Term::Ghosts { irradiance: GHOST_IRRADIANCE, reflectance: None }, given_away),
        weighted(Term::Light(1.0), given_away),
        weighted(Term::MeanLight(1.0), given_away),
        weighted(Term::FNumber(f_number), given_away / f_number.powi(2)),
        weighted(Term::RelativeIllumination { field, min: CORNER_ILLUMINATION }, given_away),
        weighted(Term::ThroughputLoss(light), spot),
        weighted(Term::Throughput, spot / light),
        unit(Term::FocalLength(efl)),
        unit(Term::Distortion),
        unit(Term::GlassCenter { min: 0.01 * size, max: thickest(lens, size) }),
        unit(Term::GlassEdge(0.01 * size)),
        unit(Term::AirCenter { min: 0.002 * size, max: 3.0 * track }),
        unit(Term::AirEdge(0.001 * size)),
        unit(Term::TotalTrack(TRACK_GROWTH * track)),
        unit(Term::BackFocus(lens.surfaces.last().map_or(0.0, |row| row.thickness))),
        weighted(Term::Steepness(largest_steepness(lens).max(MAX_STEEPNESS)), given_away),
        unit(Term::SemiDiameter { min: 0.5 * narrowest, max: 1.5 * widest }),
    ]
}

/// The total track and the last gap of a lens in mm, the image plane where its solve has it: what is
/// written of the last gap is from before the last edit.
fn focused_gaps(lens: &Lens) -> [f64; 2] {
    let written = [lens.total_track(), lens.surfaces.last().map_or(0.0, |row| row.thickness)];
    if lens.image_solve.is_none() {
        return written;
    }
    let um = lens.wavelengths.get(lens.primary()).map_or(0.0, |wavelength| wavelength.um);
    let system = lens.resolve(0, um).ok();
    let solved = system.and_then(|system| {
        let last = system.surfaces.get(lens.surfaces.len().checked_sub(1)?)?;
        Some([system.total_track(), last.thickness])
    });
    solved.unwrap_or(written)
}

fn unit(term: Term) -> WeightedTerm {
    WeightedTerm::new(term, 1.0)
}

fn focal_length(target: f64) -> WeightedTerm {
    WeightedTerm::new(Term::FocalLength(target), FOCAL_LENGTH_WEIGHT)
}

/// A term of light for a lens of this focal length.
fn in_spots(term: Term, size: f64) -> WeightedTerm {
    WeightedTerm::new(term, light_weight(size))
}

/// The weight of a loss of all light, in mm², for a lens of this focal length.
fn light_weight(size: f64) -> f64 {
    (LIGHT_IN_SPOT * size).powi(2)
}

/// The focal lengths of the zoom positions relative to the first; empty without zoom.
fn zoom_ratios(lens: &Lens, focal_lengths: &[Option<f64>]) -> Vec<f64> {
    match focal_lengths[0] {
        Some(first) if lens.zoom.len() > 1 => {
            focal_lengths.iter().map(|f| f.unwrap_or(first) / first).collect()
        }
        _ => Vec::new(),
    }
}

/// Half of a size, or the thickest glass if there is thicker one, in mm: a rod is longer than its
/// focal length.
fn thickest(lens: &Lens, size: f64) -> f64 {
    let glass = |row: &&Row| !matches!(row.medium, Medium::Air | Medium::Mirror);
    let rows = lens.surfaces.iter().filter(glass);
    rows.map(|row| row.thickness.abs()).fold(0.5 * size, f64::max)
}

/// The largest `|curvature| × semi-diameter` of the surfaces; 0 for those without semi-diameter.
fn largest_steepness(lens: &Lens) -> f64 {
    let rows = lens.surfaces.iter();
    rows.map(|row| (row.curvature * row.semi_diameter.unwrap_or(0.0)).abs()).fold(0.0, f64::max)
}

/// The smallest semi-diameter, at most `size`, and the largest one, at least a tenth of it.
fn semi_diameter_range(lens: &Lens, size: f64) -> [f64; 2] {
    let rims = || lens.surfaces.iter().filter_map(|row| row.semi_diameter);
    [rims().fold(size, f64::min), rims().fold(0.0, f64::max).max(0.1 * size)]
}
