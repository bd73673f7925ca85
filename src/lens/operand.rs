//! Operands of a merit function that bound one quantity of first or third order or of a chief ray,
//! and the part of a lens to which a term applies.

use super::{Lens, LensError};
use serde::{Deserialize, Serialize};
use std::fmt;

/// A quantity of a lens that a term of the merit function bounds. Chief rays are those of the field
/// points; heights and angles of theirs are counted in the plane of the axis and the field, positive
/// to the side of the field.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum OperandKind {
    /// The thickness of a gap on the axis, in mm: every gap, or those behind the chosen surfaces.
    Gap,
    /// The distance from the first of the chosen surfaces to the vertex behind the last one, in mm;
    /// from the first surface to the image if none are chosen.
    Track,
    /// The sag of a surface at its rim, in mm.
    Sag,
    /// The height at which a chief ray meets a surface, in mm; at the image if none is chosen.
    ChiefRayHeight,
    /// The height of a chief ray in the image over that without distortion, minus 1, in percent.
    Distortion,
    /// The angle between a chief ray and the axis behind a surface, in degrees; in image space if
    /// none is chosen.
    ChiefRayAngle,
    /// The angle of incidence of a chief ray at a surface, in degrees.
    IncidenceAngle,
    /// The angle between a chief ray and the axis in image space, in degrees: zero for a telecentric
    /// lens.
    Telecentricity,
    /// Third-order spherical aberration `S₁` of the chosen surfaces together, in mm.
    SphericalAberration,
    /// Third-order coma `S₂`, in mm.
    Coma,
    /// Third-order astigmatism `S₃`, in mm.
    Astigmatism,
    /// Third-order Petzval curvature `S₄`, in mm.
    PetzvalCurvature,
    /// Third-order distortion `S₅`, in mm.
    ThirdOrderDistortion,
    /// The distance from the paraxial image at the longest wavelength to that at the shortest, in mm.
    AxialColor,
    /// The distance from the middle between the paraxial images at the shortest and the longest
    /// wavelength to that at the primary one, in mm: what is left of axial colour where these two agree.
    SecondarySpectrum,
    /// The motion of the paraxial image against the image plane, which the mount holds, when the lens warms
    /// from 0 to 40 °C, in mm: zero for an athermal lens.
    ThermalFocus,
    /// The distance from the image point of a chief ray at the longest wavelength to that at the
    /// shortest, in mm.
    LateralColor,
}

impl OperandKind {
    /// All kinds, in the order in which an editor lists them.
    pub const ALL: [Self; 17] = [
        Self::Gap,
        Self::Track,
        Self::Sag,
        Self::ChiefRayHeight,
        Self::Distortion,
        Self::ChiefRayAngle,
        Self::IncidenceAngle,
        Self::Telecentricity,
        Self::SphericalAberration,
        Self::Coma,
        Self::Astigmatism,
        Self::PetzvalCurvature,
        Self::ThirdOrderDistortion,
        Self::AxialColor,
        Self::SecondarySpectrum,
        Self::LateralColor,
        Self::ThermalFocus,
    ];

    /// Its name in files and reports.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Gap => "gap",
            Self::Track => "track",
            Self::Sag => "sag",
            Self::ChiefRayHeight => "chief_ray_height",
            Self::Distortion => "distortion",
            Self::ChiefRayAngle => "chief_ray_angle",
            Self::IncidenceAngle => "incidence_angle",
            Self::Telecentricity => "telecentricity",
            Self::SphericalAberration => "spherical_aberration",
            Self::Coma => "coma",
            Self::Astigmatism => "astigmatism",
            Self::PetzvalCurvature => "petzval_curvature",
            Self::ThirdOrderDistortion => "third_order_distortion",
            Self::AxialColor => "axial_color",
            Self::SecondarySpectrum => "secondary_spectrum",
            Self::ThermalFocus => "thermal_focus",
            Self::LateralColor => "lateral_color",
        }
    }

    /// True if it is a length in mm, which grows with the lens.
    pub const fn is_length(self) -> bool {
        !self.is_angle() && !matches!(self, Self::Distortion)
    }

    /// True if it is an angle in degrees.
    pub const fn is_angle(self) -> bool {
        matches!(self, Self::ChiefRayAngle | Self::IncidenceAngle | Self::Telecentricity)
    }

    /// True if it is a property of chief rays.
    pub const fn traces_chief_rays(self) -> bool {
        self.is_angle()
            || matches!(self, Self::ChiefRayHeight | Self::Distortion | Self::LateralColor)
    }

    /// True if it is a third-order sum.
    pub const fn is_third_order(self) -> bool {
        matches!(
            self,
            Self::SphericalAberration
                | Self::Coma
                | Self::Astigmatism
                | Self::PetzvalCurvature
                | Self::ThirdOrderDistortion
        )
    }

    /// The selections that it has.
    pub(super) const fn selections(self) -> &'static [TermSelection] {
        use TermSelection::{Fields, Surfaces, Wavelengths, Zooms};
        match self {
            Self::ChiefRayHeight | Self::ChiefRayAngle | Self::IncidenceAngle => {
                &[Surfaces, Fields, Wavelengths, Zooms]
            }
            Self::Telecentricity | Self::LateralColor => &[Fields, Wavelengths, Zooms],
            Self::Distortion => &[Fields, Zooms],
            Self::AxialColor | Self::SecondarySpectrum => &[Wavelengths, Zooms],
            Self::ThermalFocus => &[Zooms],
            // Distances, sags and third-order sums.
            _ => &[Surfaces, Zooms],
        }
    }
}

/// The parts of a lens from which the scope of a term selects.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum TermSelection {
    /// Surfaces, or the gaps behind them.
    Surfaces,
    /// Field points.
    Fields,
    /// Wavelengths.
    Wavelengths,
    /// Zoom positions.
    Zooms,
}

impl TermSelection {
    /// All of them.
    pub const ALL: [Self; 4] = [Self::Surfaces, Self::Fields, Self::Wavelengths, Self::Zooms];
}

impl fmt::Display for TermSelection {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Surfaces => "surfaces",
            Self::Fields => "fields",
            Self::Wavelengths => "wavelengths",
            Self::Zooms => "zoom positions",
        })
    }
}

/// The first and the last index of a selection, both counted from 0.
pub type IndexRange = [usize; 2];

/// The part of a lens to which a term of the merit function applies: everything, or a range of
/// surfaces, fields, wavelengths or zoom positions.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct TermScope {
    /// The surfaces; `None` for all.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub surfaces: Option<IndexRange>,
    /// The field points; `None` for all.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub fields: Option<IndexRange>,
    /// The wavelengths; `None` for all, or for the primary one where a chief ray is traced.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub wavelengths: Option<IndexRange>,
    /// The zoom positions; `None` for all.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub zooms: Option<IndexRange>,
}

impl TermScope {
    /// The scope that selects everything.
    pub const ALL: Self = Self { surfaces: None, fields: None, wavelengths: None, zooms: None };

    /// True if it selects everything.
    pub fn is_all(&self) -> bool {
        *self == Self::ALL
    }

    /// The range of a selection; `None` for everything.
    pub const fn range(self, selection: TermSelection) -> Option<IndexRange> {
        match selection {
            TermSelection::Surfaces => self.surfaces,
            TermSelection::Fields => self.fields,
            TermSelection::Wavelengths => self.wavelengths,
            TermSelection::Zooms => self.zooms,
        }
    }

    /// The range of a selection, to change it.
    pub const fn range_mut(&mut self, selection: TermSelection) -> &mut Option<IndexRange> {
        match selection {
            TermSelection::Surfaces => &mut self.surfaces,
            TermSelection::Fields => &mut self.fields,
            TermSelection::Wavelengths => &mut self.wavelengths,
            TermSelection::Zooms => &mut self.zooms,
        }
    }

    /// True if a selection has this index.
    pub fn has(self, selection: TermSelection, index: usize) -> bool {
        self.range(selection).is_none_or(|[first, last]| (first..=last).contains(&index))
    }
}

/// The largest index of a selection in a lens. Rays and distances may also be asked for at the image,
/// which counts as the surface behind the last one.
pub fn last_index(lens: &Lens, selection: TermSelection, image: bool) -> usize {
    let zooms = 0..lens.zoom_positions();
    match selection {
        TermSelection::Surfaces => (lens.surfaces.len() + usize::from(image)).saturating_sub(1),
        TermSelection::Fields => {
            let counts = zooms.map(|zoom| lens.fields_at(zoom).values.len());
            counts.min().unwrap_or(0).saturating_sub(1)
        }
        TermSelection::Wavelengths => lens.wavelengths.len().saturating_sub(1),
        TermSelection::Zooms => lens.zoom_positions().saturating_sub(1),
    }
}

/// Refuses a scope whose ranges run backwards, whatever the lens.
pub(super) fn check_scope(name: &str, scope: TermScope) -> Result<(), LensError> {
    for selection in TermSelection::ALL {
        if let Some([first, last]) = scope.range(selection).filter(|[first, last]| first > last) {
            let text = format!(
                "the term `{name}` of the merit function has the {selection} {first} to {last}; \
                 expected a first that is not behind the last"
            );
            return Err(LensError::Inconsistent(text));
        }
    }
    Ok(())
}
