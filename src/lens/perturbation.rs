//! Manufacturing errors: what is not as the prescription says, each one number.

use serde::{Deserialize, Serialize};

/// The kind of an error of making. Angles are in radians; an error about x tilts the y axis towards
/// +z, one about y tilts the z axis towards +x.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum PerturbationKind {
    /// Adds to the curvature, in 1/mm.
    Curvature,
    /// Adds to the conic constant.
    Conic,
    /// Adds to the coefficient of r⁴, in mm⁻³.
    Asphere,
    /// Adds `A/2 (ρ⁴ + ρy²)` to the sag, half spherical aberration and half astigmatism, where ρ is the
    /// distance from the axis in semi-diameters; A in mm.
    Irregularity,
    /// Adds `s/2 (ρ⁴ − ρ²)` semi-diameters to the sag, a zone between centre and rim whose slope at the rim is s:
    /// what a slope error is beyond power. To first order that is a curvature and a coefficient of r⁴; s is an
    /// angle.
    AsphereSlope,
    /// Adds to the gap behind the surface, in mm; everything behind moves, the image plane included.
    Thickness,
    /// Adds to the gap behind the surface and takes as much from the next gap, in mm.
    ThicknessAdjusted,
    /// Adds to the index in the gap behind the surface, at all wavelengths.
    Index,
    /// Changes the Abbe number in the gap behind the surface relatively: 0.01 is one per cent.
    Abbe,
    /// Decentres one surface along x, in mm.
    SurfaceDecenterX,
    /// Decentres one surface along y, in mm.
    SurfaceDecenterY,
    /// Tilts one surface about x at its vertex; at the rear of an element this is its wedge.
    SurfaceTiltX,
    /// Tilts one surface about y at its vertex.
    SurfaceTiltY,
    /// Decentres an element or group along x, in mm.
    ElementDecenterX,
    /// Decentres an element or group along y, in mm.
    ElementDecenterY,
    /// Tilts an element or group about x at its first vertex.
    ElementTiltX,
    /// Tilts an element or group about y at its first vertex.
    ElementTiltY,
    /// Tilts an element or group about x at the centre of curvature of its first surface: it rolls on
    /// its seat.
    ElementRollX,
    /// Tilts an element or group about y at the centre of curvature of its first surface.
    ElementRollY,
}

/// An error of making: its kind and the surfaces that it concerns.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub struct Perturbation {
    /// The kind.
    pub kind: PerturbationKind,
    /// The surface, or the first one of the element or group.
    pub first: usize,
    /// The last surface of the element or group, or the surface again.
    pub last: usize,
}

impl PerturbationKind {
    /// All kinds.
    pub const ALL: [Self; 19] = [
        Self::Curvature,
        Self::Conic,
        Self::Asphere,
        Self::Irregularity,
        Self::AsphereSlope,
        Self::Thickness,
        Self::ThicknessAdjusted,
        Self::Index,
        Self::Abbe,
        Self::SurfaceDecenterX,
        Self::SurfaceDecenterY,
        Self::SurfaceTiltX,
        Self::SurfaceTiltY,
        Self::ElementDecenterX,
        Self::ElementDecenterY,
        Self::ElementTiltX,
        Self::ElementTiltY,
        Self::ElementRollX,
        Self::ElementRollY,
    ];

    /// True if the error moves several surfaces as one rigid body.
    pub fn moves_a_body(self) -> bool {
        self >= Self::ElementDecenterX
    }

    /// True for the errors of the gap behind the surface.
    pub fn is_of_gap(self) -> bool {
        matches!(self, Self::Thickness | Self::ThicknessAdjusted | Self::Index | Self::Abbe)
    }

    /// True for a tilt or a slope, whose value is an angle.
    pub fn is_angle(self) -> bool {
        matches!(
            self,
            Self::AsphereSlope
                | Self::SurfaceTiltX
                | Self::SurfaceTiltY
                | Self::ElementTiltX
                | Self::ElementTiltY
                | Self::ElementRollX
                | Self::ElementRollY
        )
    }

    /// True for the errors that break the symmetry about the axis.
    pub fn breaks_symmetry(self) -> bool {
        self == Self::Irregularity || self >= Self::SurfaceDecenterX
    }

    /// The name for tables.
    pub fn name(self) -> &'static str {
        match self {
            Self::Curvature => "power",
            Self::Conic => "conic",
            Self::Asphere => "asphere r^4",
            Self::Irregularity => "irregularity",
            Self::AsphereSlope => "asphere slope",
            Self::Thickness => "thickness",
            Self::ThicknessAdjusted => "thickness, gap adjusted",
            Self::Index => "index",
            Self::Abbe => "Abbe number",
            Self::SurfaceDecenterX => "surface decenter x",
            Self::SurfaceDecenterY => "surface decenter y",
            Self::SurfaceTiltX => "surface tilt x",
            Self::SurfaceTiltY => "surface tilt y",
            Self::ElementDecenterX => "element decenter x",
            Self::ElementDecenterY => "element decenter y",
            Self::ElementTiltX => "element tilt x",
            Self::ElementTiltY => "element tilt y",
            Self::ElementRollX => "element roll x",
            Self::ElementRollY => "element roll y",
        }
    }
}

/// The unit in which tables show an error.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct TableUnit {
    /// Its name in a file, `1` for a number without one.
    pub name: &'static str,
    /// The number of them in one unit of the computation, which is in mm, radians and shares.
    pub factor: f64,
}

impl PerturbationKind {
    /// The unit in which tables show this error: tilts in minutes of arc, the Abbe number in per cent.
    pub fn table_unit(self) -> TableUnit {
        let unit = |name| TableUnit { name, factor: 1.0 };
        match self {
            _ if self.is_angle() => {
                TableUnit { name: "arcmin", factor: 60.0 * 1.0_f64.to_degrees() }
            }
            Self::Abbe => TableUnit { name: "%", factor: 100.0 },
            Self::Curvature => unit("1/mm"),
            Self::Asphere => unit("1/mm^3"),
            Self::Conic | Self::Index => unit("1"),
            _ => unit("mm"),
        }
    }
}

impl Perturbation {
    /// An error of one surface, or of the gap behind it.
    pub fn of_surface(kind: PerturbationKind, surface: usize) -> Self {
        Self { kind, first: surface, last: surface }
    }
}
