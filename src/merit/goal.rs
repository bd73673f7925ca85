//! What a lens is asked for.

use super::MeritError;
use super::constraints::MinimumThickness;
use crate::lens::{Lens, Object};
use crate::paraxial::{Beam, first_order};
use serde::{Deserialize, Serialize};

/// What an optimization aims at.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Goal {
    /// The terms that are summed.
    pub terms: Vec<WeightedTerm>,
    /// Whether derivatives know that the pupil moves with the lens.
    #[serde(default)]
    pub pupil: PupilEdge,
    /// The focal length at each zoom position relative to the first; a single lens needs none.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub zoom_ratios: Vec<f64>,
}

/// How the edge of the pupil is treated.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum PupilEdge {
    /// It is followed wherever the lens moves it: values are those of the light that gets through,
    /// and their derivatives are unbiased.
    #[default]
    Moving,
    /// The rays that got through when it was last looked for are kept: what most programs do.
    /// Faster, blind to light, biased wherever something clips.
    #[serde(rename = "kept")]
    Frozen,
}

/// A term and its weight.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct WeightedTerm {
    /// The term.
    pub term: Term,
    /// Its factor in the sum.
    pub weight: f64,
}

/// One thing that a lens is asked for. Every term is the mean over the zoom positions; all but
/// those about light are sums of squares.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
pub enum Term {
    /// The mean square radius of the spots about their centroids, over fields, wavelengths and
    /// zoom positions by weight, in mm².
    Spot,
    /// The integral of the square distance from the centroid over the pupil, in mm⁴: (3.24), the
    /// mean over fields and wavelengths by weight.
    SpotIntegral,
    /// Minus the area of the pupil in mm² of the first vertex plane: (3.25), the mean over fields
    /// and wavelengths by weight.
    Throughput,
    /// One minus that area over this one in mm²: (4.3).
    ThroughputLoss(f64),
    /// The mean square of what each pupil's area lacks of this share of the area that it has in the
    /// lens with which a search begins.
    Light(f64),
    /// The square of what a field's illumination lacks of this share of that on the axis: the
    /// ratio of the pupils' areas times cos⁴ of the field angle, as for a lens without distortion.
    RelativeIllumination {
        /// The field, counted from 0.
        field: usize,
        /// Not less than this.
        min: f64,
    },
    /// The square of the deviation from this of the f-number that the light on the axis has: the
    /// focal length over the diameter of a disc as large as the pupil.
    FNumber(f64),
    /// The square of the deviation of the focal length from this, in mm².
    FocalLength(f64),
    /// The mean square of the distance of the chief rays' image points from the paraxial image
    /// (`f tan θ` for an object at infinity), in mm².
    Distortion,
    /// Glass thinner or thicker than this on the axis, in mm².
    GlassCenter {
        /// Not thinner than this.
        min: f64,
        /// Not thicker than this.
        max: f64,
    },
    /// Glass thinner than this at the rim, in mm².
    GlassEdge(f64),
    /// Air thinner or thicker than this on the axis, in mm².
    AirCenter {
        /// Not thinner than this.
        min: f64,
        /// Not thicker than this.
        max: f64,
    },
    /// Air thinner than this at the rim, in mm².
    AirEdge(f64),
    /// From the first vertex to the image longer than this, in mm².
    TotalTrack(f64),
    /// From the last vertex to the image shorter than this, in mm².
    BackFocus(f64),
    /// `|curvature| × semi-diameter` larger than this at some surface; 1 is a hemisphere.
    Steepness(f64),
    /// Semi-diameters smaller or larger than this, in mm².
    SemiDiameter {
        /// Not smaller than this.
        min: f64,
        /// Not larger than this.
        max: f64,
    },
}

impl Term {
    /// What it is called in files and reports.
    pub fn name(self) -> &'static str {
        match self {
            Self::Spot => "spot",
            Self::FocalLength(_) => "focal_length",
            Self::Distortion => "distortion",
            Self::GlassCenter { .. } => "glass_center",
            Self::GlassEdge(_) => "glass_edge",
            Self::AirCenter { .. } => "air_center",
            Self::AirEdge(_) => "air_edge",
            Self::TotalTrack(_) => "total_track",
            Self::BackFocus(_) => "back_focus",
            Self::SpotIntegral => "spot_integral",
            Self::Throughput => "throughput",
            Self::ThroughputLoss(_) => "throughput_loss",
            Self::Light(_) => "light",
            Self::RelativeIllumination { .. } => "relative_illumination",
            Self::FNumber(_) => "f_number",
            Self::Steepness(_) => "steepness",
            Self::SemiDiameter { .. } => "semi_diameter",
        }
    }

    /// Whether it asks how much light gets through.
    pub fn concerns_light(self) -> bool {
        matches!(
            self,
            Self::Throughput
                | Self::ThroughputLoss(_)
                | Self::Light(_)
                | Self::RelativeIllumination { .. }
                | Self::FNumber(_)
        )
    }

    /// Refuses what a lens cannot be asked for about its light.
    fn check_light(self, lens: &Lens) -> Result<(), MeritError> {
        let refuse = |why| Err(MeritError::DoesNotApply { term: self.name(), why });
        if let Self::ThroughputLoss(v) | Self::Light(v) | Self::FNumber(v) | Self::Steepness(v) =
            self
            && !(v > 0.0)
        {
            return refuse("its number is not positive");
        }
        let axial = |zoom| lens.fields_at(zoom).values.iter().any(|f| f.x == 0.0 && f.y == 0.0);
        let needs_axis = matches!(self, Self::FNumber(_) | Self::RelativeIllumination { .. });
        if needs_axis && !(0..lens.zoom_positions()).all(axial) {
            return refuse("the lens has no field on the axis to compare with");
        }
        if let Self::RelativeIllumination { field, .. } = self {
            if lens.object != Object::Infinity {
                return refuse("the object is not at infinity");
            }
            if (0..lens.zoom_positions()).any(|z| field >= lens.fields_at(z).values.len()) {
                return refuse("the lens has no field of that number");
            }
        }
        Ok(())
    }

    fn numbers(self) -> Vec<f64> {
        match self {
            Self::Spot | Self::SpotIntegral | Self::Throughput | Self::Distortion => Vec::new(),
            Self::GlassCenter { min, max }
            | Self::AirCenter { min, max }
            | Self::SemiDiameter { min, max } => vec![min, max],
            Self::RelativeIllumination { min, .. } => vec![min],
            Self::ThroughputLoss(v)
            | Self::Light(v)
            | Self::FNumber(v)
            | Self::Steepness(v)
            | Self::FocalLength(v)
            | Self::GlassEdge(v)
            | Self::AirEdge(v)
            | Self::TotalTrack(v)
            | Self::BackFocus(v) => vec![v],
        }
    }
}

/// The radius of a spot, relative to the focal length, that is given away for all of the light.
const LIGHT_IN_SPOT: f64 = 0.02;

impl Goal {
    /// What a designer would ask of a lens first: sharp spots at the focal length it has and with
    /// the light it has, glass and air that can be made or are no thinner than they are, nothing
    /// longer than it is by more than a fifth.
    pub fn default_for(lens: &Lens) -> Result<Self, MeritError> {
        let focal_lengths = focal_lengths(lens)?;
        let first = focal_lengths[0];
        let size = first.map_or_else(|| lens.total_track(), f64::abs);
        let mut terms = vec![WeightedTerm { term: Term::Spot, weight: 1.0 }];
        if let Some(first) = first {
            terms.push(WeightedTerm { term: Term::FocalLength(first), weight: 1e-2 });
        }
        let now = MinimumThickness::measure(lens)?;
        let (glass, air) = (0.012 * size, 0.002 * size);
        for term in [
            Term::GlassCenter { min: now.glass_center.clamp(0.0, glass), max: 0.5 * size },
            Term::GlassEdge(now.glass_edge.clamp(0.0, 0.8 * glass)),
            Term::AirCenter { min: now.air_center.clamp(0.0, air), max: 3.0 * lens.total_track() },
            Term::AirEdge(now.air_edge.clamp(0.0, 0.5 * air)),
            Term::TotalTrack(1.2 * lens.total_track()),
        ] {
            terms.push(WeightedTerm { term, weight: 1.0 });
        }
        terms.push(WeightedTerm { term: Term::Light(1.0), weight: (LIGHT_IN_SPOT * size).powi(2) });
        let zoom_ratios = match first {
            Some(first) if lens.zoom.len() > 1 => {
                focal_lengths.iter().map(|f| f.unwrap_or(first) / first).collect()
            }
            _ => Vec::new(),
        };
        Ok(Self { terms, pupil: PupilEdge::default(), zoom_ratios })
    }

    /// Refuses what a lens cannot be asked for.
    pub fn check(&self, lens: &Lens) -> Result<(), MeritError> {
        let refuse = |why| Err(MeritError::DoesNotApply { term: "goal", why });
        if self.terms.is_empty() {
            return refuse("it has no terms");
        }
        if !self.zoom_ratios.is_empty() && self.zoom_ratios.len() != lens.zoom_positions() {
            return refuse("it has not one of `zoom_ratios` for each zoom position");
        }
        for WeightedTerm { term, weight } in &self.terms {
            let refuse = |why| Err(MeritError::DoesNotApply { term: term.name(), why });
            if !(weight.is_finite() && *weight >= 0.0) {
                return refuse("its weight is not a number of zero or more");
            }
            if !term.numbers().iter().all(|v| v.is_finite()) {
                return refuse("its target is not finite");
            }
            if let [min, max] = term.numbers()[..]
                && min > max
            {
                return refuse("its smallest thickness is larger than its largest");
            }
            let focal = matches!(term, Term::FocalLength(_) | Term::FNumber(_));
            if focal && focal_lengths(lens)?.contains(&None) {
                return refuse("the lens is afocal");
            }
            term.check_light(lens)?;
        }
        Ok(())
    }

    /// The focal length wanted at a zoom position.
    pub(super) fn target(&self, zoom: usize, first: f64) -> f64 {
        first * self.zoom_ratios.get(zoom).copied().unwrap_or(1.0)
    }
}

/// The focal length at every zoom position; `None` for an afocal lens.
fn focal_lengths(lens: &Lens) -> Result<Vec<Option<f64>>, MeritError> {
    let um = lens.wavelengths[lens.primary()].um;
    let focal_length = |zoom| {
        let system = lens.resolve(zoom, um)?;
        let first = first_order(&system, &Beam::for_lens(lens, zoom));
        let first = first.map_err(crate::pupil::RayModelError::from)?;
        Ok(first.efl)
    };
    (0..lens.zoom_positions()).map(focal_length).collect()
}
