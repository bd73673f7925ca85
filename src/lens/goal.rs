//! The goal of a design: what its merit function sums. A lens carries it, so that it is saved,
//! undone and handed on with the lens; the merit function itself is evaluated above this floor.

use super::LensError;
use super::ToleranceGrade;
use super::check::check_number;
use super::operand::{OperandKind, TermScope, TermSelection, check_scope};
use serde::{Deserialize, Serialize};

/// The goal of an optimization: the terms of its merit function.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Goal {
    /// The terms that are summed.
    pub terms: Vec<WeightedTerm>,
    /// Tells whether derivatives include the motion of the pupil edge.
    #[serde(default)]
    pub pupil: PupilEdge,
    /// The focal length at each zoom position relative to the first; empty for a lens without zoom
    /// positions.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub zoom_ratios: Vec<f64>,
    /// Tells how the trust-region optimizer treats the terms that limit the lens. A goal that was
    /// written before there was a choice says nothing, and means penalties.
    #[serde(default = "LimitTreatment::unsaid", skip_serializing_if = "LimitTreatment::is_unsaid")]
    pub limits: LimitTreatment,
}

/// Treatment of the terms that limit a lens by the trust-region optimizer: all but spots, wavefronts,
/// contrasts, distortion and throughput. The methods without constraints, Adam and damped least squares,
/// always take them as penalties.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum LimitTreatment {
    /// They are kept exactly, whatever their weight.
    #[default]
    Constraints,
    /// Their squared violations are added to the merit, so that they may be broken a little.
    Penalties,
}

impl LimitTreatment {
    /// The treatment by a goal in whose file there is none.
    fn unsaid() -> Self {
        Self::Penalties
    }

    #[expect(clippy::trivially_copy_pass_by_ref, reason = "the signature that serde calls")]
    fn is_unsaid(&self) -> bool {
        *self == Self::unsaid()
    }
}

/// Treatment of the edge of the pupil in derivatives.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum PupilEdge {
    /// The edge is tracked as the lens changes: values are those of the transmitted rays, and their
    /// derivatives are unbiased.
    #[default]
    Moving,
    /// The set of transmitted rays is frozen between searches for the pupil, as in most programs.
    /// Faster, but it ignores changes of the transmitted light and is biased wherever something
    /// clips.
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
    /// The part of the lens to which it applies.
    #[serde(default, skip_serializing_if = "TermScope::is_all")]
    pub scope: TermScope,
}

impl WeightedTerm {
    /// A term that applies to the whole lens.
    pub const fn new(term: Term, weight: f64) -> Self {
        Self { term, weight, scope: TermScope::ALL }
    }
}

/// A term (operand) of the merit function. Every term is the mean over the zoom positions; all
/// except those of light are sums of squares.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
pub enum Term {
    /// The mean square radius of the spots about their centroids, over fields, wavelengths and
    /// zoom positions by weight, in mm².
    Spot,
    /// The expected mean square radius of the spots of lenses that are made, in mm²: that of
    /// [`Term::Spot`], and what errors of making add to it after each lens is refocused, by the
    /// tolerances of the lens.
    AsBuilt {
        /// A class of tolerances in place of those of the lens.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        grade: Option<ToleranceGrade>,
    },
    /// The integral of the square distance from the centroid over the pupil, in mm⁴: (3.24), the
    /// mean over fields and wavelengths by weight.
    SpotIntegral,
    /// The mean square wavefront, in squared waves of each wavelength: path differences from a sphere
    /// about the image point that makes them least, over fields and wavelengths by weight.
    Wavefront,
    /// The rest of 1 that the Strehl ratio lacks, about the image point that makes it largest nearby: the intensity
    /// there over that of the same rays without path differences, over fields and wavelengths by weight.
    Strehl,
    /// The mean squared shortfall of the geometric modulation transfer, tangential and sagittal, from
    /// a minimum, over fields by weight.
    GeometricMtf {
        /// The spatial frequency at the image, in cycles/mm.
        frequency: f64,
        /// The minimum modulation, at most 1.
        min: f64,
    },
    /// The same of the modulation transfer by diffraction.
    Mtf {
        /// The spatial frequency at the image, in cycles/mm.
        frequency: f64,
        /// The minimum modulation, at most 1.
        min: f64,
    },
    /// The mean squared shortfall of the widths of ghosts by first-order optics, relative to the width at which
    /// their irradiance is a share of that at the entrance of the lens, over all pairs of surfaces that reflect. A
    /// ghost that is wide enough asks for nothing.
    Ghosts {
        /// The largest irradiance inside a ghost over that at the entrance of the lens.
        irradiance: f64,
        /// The share that every surface next to air reflects; `None` for bare glass.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        reflectance: Option<f64>,
    },
    /// The negative area of the pupil in the first vertex plane, in mm²: (3.25), the weighted mean
    /// over fields and wavelengths.
    Throughput,
    /// One minus the ratio of the mean pupil area to this area in mm²: (4.3).
    ThroughputLoss(f64),
    /// The mean squared shortfall of the area of each pupil from this fraction of its area in the
    /// starting lens; on the axis, of the area that each rim would leave by itself.
    Light(f64),
    /// The squared shortfall of the mean area of the pupils over fields and wavelengths by weight
    /// from this fraction of that of the starting lens.
    MeanLight(f64),
    /// The squared shortfall of a field's relative illumination from a minimum: the ratio of its
    /// pupil area to that on the axis, times cos⁴ of the field angle, as for a lens without
    /// distortion.
    RelativeIllumination {
        /// The field, counted from 0.
        field: usize,
        /// The minimum relative illumination.
        min: f64,
    },
    /// The squared deviation of the f-number on the axis from this: the focal length over the
    /// diameter of a disc with the area of the pupil.
    FNumber(f64),
    /// The squared deviation of the focal length from this length in mm, in mm².
    FocalLength(f64),
    /// The mean square of the distance of the chief rays' image points from the paraxial image
    /// (`f tan θ` for an object at infinity), in mm².
    Distortion,
    /// Squared violations of limits to the centre thickness of glass, in mm².
    GlassCenter {
        /// The minimum thickness, in mm.
        min: f64,
        /// The maximum thickness, in mm.
        max: f64,
    },
    /// Squared shortfall of the edge thickness of glass from this minimum in mm, in mm².
    GlassEdge(f64),
    /// Squared violations of limits to the centre thickness of air gaps, in mm².
    AirCenter {
        /// Not thinner than this.
        min: f64,
        /// Not thicker than this.
        max: f64,
    },
    /// Squared shortfall of the edge thickness of air gaps from this minimum in mm, in mm².
    AirEdge(f64),
    /// Squared excess of the total track, first vertex to image, over this maximum in mm, in mm².
    TotalTrack(f64),
    /// Squared shortfall of the back focus, last vertex to image, from this minimum in mm, in mm².
    BackFocus(f64),
    /// Squared excess of `|curvature| × semi-diameter` of each surface over this maximum; 1 is a
    /// hemisphere.
    Steepness(f64),
    /// Squared violations of limits to the semi-diameters, in mm².
    SemiDiameter {
        /// The minimum semi-diameter, in mm.
        min: f64,
        /// The maximum semi-diameter, in mm.
        max: f64,
    },
    /// Squared violations of the bounds of a quantity, in the square of its unit.
    Operand {
        /// The quantity.
        kind: OperandKind,
        /// The lower bound; `None` for none.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        min: Option<f64>,
        /// The upper bound; `None` for none. A target has two equal bounds.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        max: Option<f64>,
    },
}

impl Term {
    /// The name of the term in files and reports.
    pub fn name(self) -> &'static str {
        match self {
            Self::Spot => "spot",
            Self::AsBuilt { .. } => "as_built",
            Self::FocalLength(_) => "focal_length",
            Self::Distortion => "distortion",
            Self::GlassCenter { .. } => "glass_center",
            Self::GlassEdge(_) => "glass_edge",
            Self::AirCenter { .. } => "air_center",
            Self::AirEdge(_) => "air_edge",
            Self::TotalTrack(_) => "total_track",
            Self::BackFocus(_) => "back_focus",
            Self::SpotIntegral => "spot_integral",
            Self::Wavefront => "wavefront",
            Self::Strehl => "strehl",
            Self::GeometricMtf { .. } => "geometric_mtf",
            Self::Mtf { .. } => "mtf",
            Self::Ghosts { .. } => "ghosts",
            Self::Throughput => "throughput",
            Self::ThroughputLoss(_) => "throughput_loss",
            Self::Light(_) => "light",
            Self::MeanLight(_) => "mean_light",
            Self::RelativeIllumination { .. } => "relative_illumination",
            Self::FNumber(_) => "f_number",
            Self::Steepness(_) => "steepness",
            Self::SemiDiameter { .. } => "semi_diameter",
            Self::Operand { kind, .. } => kind.name(),
        }
    }

    /// The least and the largest value of a term that bounds a quantity on both sides.
    const fn range(self) -> Option<[f64; 2]> {
        match self {
            Self::GlassCenter { min, max }
            | Self::AirCenter { min, max }
            | Self::SemiDiameter { min, max }
            | Self::Operand { min: Some(min), max: Some(max), .. } => Some([min, max]),
            _ => None,
        }
    }

    /// The targets and limits of the term.
    pub(crate) fn numbers(self) -> Vec<f64> {
        match self {
            Self::Spot
            | Self::AsBuilt { .. }
            | Self::SpotIntegral
            | Self::Wavefront
            | Self::Strehl
            | Self::Throughput
            | Self::Distortion => Vec::new(),
            Self::GeometricMtf { frequency, min } | Self::Mtf { frequency, min } => {
                vec![frequency, min]
            }
            Self::Ghosts { irradiance, reflectance } => {
                std::iter::once(irradiance).chain(reflectance).collect()
            }
            Self::GlassCenter { min, max }
            | Self::AirCenter { min, max }
            | Self::SemiDiameter { min, max } => vec![min, max],
            Self::RelativeIllumination { min, .. } => vec![min],
            Self::Operand { min, max, .. } => min.into_iter().chain(max).collect(),
            Self::ThroughputLoss(v)
            | Self::Light(v)
            | Self::MeanLight(v)
            | Self::FNumber(v)
            | Self::Steepness(v)
            | Self::FocalLength(v)
            | Self::GlassEdge(v)
            | Self::AirEdge(v)
            | Self::TotalTrack(v)
            | Self::BackFocus(v) => vec![v],
        }
    }

    /// The selections that the scope of the term may have.
    pub const fn selections(self) -> &'static [TermSelection] {
        use TermSelection::{Fields, Surfaces, Wavelengths, Zooms};
        match self {
            Self::Spot
            | Self::AsBuilt { .. }
            | Self::SpotIntegral
            | Self::Wavefront
            | Self::Strehl
            | Self::GeometricMtf { .. }
            | Self::Mtf { .. }
            | Self::Throughput
            | Self::ThroughputLoss(_)
            | Self::Light(_)
            | Self::MeanLight(_) => &[Fields, Wavelengths, Zooms],
            Self::Distortion => &[Fields, Zooms],
            Self::GlassCenter { .. }
            | Self::GlassEdge(_)
            | Self::AirCenter { .. }
            | Self::AirEdge(_)
            | Self::Steepness(_)
            | Self::SemiDiameter { .. } => &[Surfaces, Zooms],
            Self::RelativeIllumination { .. }
            | Self::FNumber(_)
            | Self::FocalLength(_)
            | Self::TotalTrack(_)
            | Self::BackFocus(_)
            | Self::Ghosts { .. } => &[Zooms],
            Self::Operand { kind, .. } => kind.selections(),
        }
    }
}

impl Term {
    /// True if the surfaces of its scope stand for the gaps behind them.
    pub(super) const fn is_of_gaps(self) -> bool {
        matches!(
            self,
            Self::GlassCenter { .. }
                | Self::GlassEdge(_)
                | Self::AirCenter { .. }
                | Self::AirEdge(_)
                | Self::Operand { kind: OperandKind::Gap | OperandKind::Track, .. }
        )
    }

    /// True if it compares the lens at several temperatures.
    pub const fn concerns_temperature(self) -> bool {
        matches!(self, Self::Operand { kind: OperandKind::ThermalFocus, .. })
    }

    /// Multiplies its lengths by a factor.
    fn scale(&mut self, factor: f64) {
        match self {
            Self::FocalLength(length)
            | Self::GlassEdge(length)
            | Self::AirEdge(length)
            | Self::TotalTrack(length)
            | Self::BackFocus(length) => *length *= factor,
            Self::GlassCenter { min, max }
            | Self::AirCenter { min, max }
            | Self::SemiDiameter { min, max } => {
                *min *= factor;
                *max *= factor;
            }
            Self::ThroughputLoss(area) => *area *= factor * factor,
            Self::GeometricMtf { frequency, .. } | Self::Mtf { frequency, .. } => {
                *frequency /= factor;
            }
            Self::Operand { kind, min, max } if kind.is_length() => {
                min.iter_mut().chain(max).for_each(|bound| *bound *= factor);
            }
            Self::Spot
            | Self::AsBuilt { .. }
            | Self::SpotIntegral
            | Self::Wavefront
            | Self::Strehl
            | Self::Throughput
            | Self::Light(_)
            | Self::MeanLight(_)
            | Self::RelativeIllumination { .. }
            | Self::FNumber(_)
            | Self::Distortion
            | Self::Ghosts { .. }
            | Self::Operand { .. }
            | Self::Steepness(_) => {}
        }
    }

    /// The power of mm in the unit of its value.
    fn power(self) -> i32 {
        match self {
            Self::SpotIntegral => 4,
            Self::ThroughputLoss(_)
            | Self::GeometricMtf { .. }
            | Self::Mtf { .. }
            | Self::Ghosts { .. }
            | Self::Light(_)
            | Self::MeanLight(_)
            | Self::RelativeIllumination { .. }
            | Self::FNumber(_)
            | Self::Steepness(_) => 0,
            Self::Operand { kind, .. } if !kind.is_length() => 0,
            _ => 2,
        }
    }
}

impl Goal {
    /// Follows a lens whose lengths are multiplied by a factor: the targets keep their proportion to
    /// the lens, and the weights keep the balance of the terms.
    pub(super) fn scale(&mut self, factor: f64) {
        for WeightedTerm { term, weight, .. } in &mut self.terms {
            term.scale(factor);
            *weight *= factor.powi(2 - term.power());
        }
    }

    /// Follows surfaces or zoom positions that are inserted, removed or reversed: `map` tells the new
    /// index of each, or `None` for one that is gone. A term about nothing that is left is removed.
    pub(super) fn renumber(
        &mut self,
        selection: TermSelection,
        map: impl Fn(Term, usize) -> Option<usize>,
    ) {
        self.terms.retain_mut(|weighted| {
            let term = weighted.term;
            if let (Term::RelativeIllumination { field, .. }, TermSelection::Fields) =
                (&mut weighted.term, selection)
            {
                let Some(moved) = map(term, *field) else { return false };
                *field = moved;
            }
            let Some([first, last]) = weighted.scope.range(selection) else { return true };
            let moved = (first..=last).filter_map(|i| map(weighted.term, i));
            let ends = moved.fold(None, |ends: Option<[usize; 2]>, i| {
                Some(ends.map_or([i, i], |[low, high]| [low.min(i), high.max(i)]))
            });
            *weighted.scope.range_mut(selection) = ends;
            ends.is_some()
        });
    }

    /// The goal of a lens that is only its zoom position of this index.
    pub(super) fn restrict_to_zoom(&mut self, zoom: usize) {
        let ratio = self.zoom_ratios.get(zoom).copied().unwrap_or(1.0);
        self.zoom_ratios.clear();
        self.terms.retain(|weighted| weighted.scope.has(TermSelection::Zooms, zoom));
        for WeightedTerm { term, scope, .. } in &mut self.terms {
            scope.zooms = None;
            if let Term::FocalLength(target) = term {
                *target *= ratio;
            }
        }
    }

    /// Checks the weights and targets, whatever the lens.
    pub(super) fn check_numbers(&self) -> Result<(), LensError> {
        for WeightedTerm { term, weight, scope } in &self.terms {
            let name = term.name();
            let what = format!("the weight of the term `{name}` of the merit function");
            check_number(what, *weight, *weight >= 0.0, "zero or more")?;
            for target in term.numbers() {
                let what = format!("a target of the term `{name}` of the merit function");
                check_number(what, target, true, "a finite number")?;
            }
            check_scope(name, *scope)?;
            if let Some([min, max]) = term.range()
                && min > max
            {
                let text = format!(
                    "the term `{name}` of the merit function has the minimum {min} and the \
                     maximum {max}; expected no more than the maximum"
                );
                return Err(LensError::Inconsistent(text));
            }
        }
        Ok(())
    }
}
