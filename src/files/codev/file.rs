//! The content of a sequence file before it is interpreted. Lengths are in the unit of the file.

use crate::lens::FieldKind;
use std::collections::BTreeMap;

/// The content of a file.
#[derive(Debug, Default)]
pub(super) struct CodeVFile {
    /// Millimetres per unit.
    pub(super) unit: Option<f64>,
    /// True if surfaces are given by radii, false if by curvatures.
    pub(super) radii: Option<bool>,
    pub(super) title: String,
    pub(super) notes: Vec<String>,
    pub(super) aperture: Option<ApertureCommand>,
    pub(super) waves_nm: Vec<f64>,
    pub(super) wave_weights: Vec<f64>,
    /// From 1.
    pub(super) reference: Option<usize>,
    pub(super) field_kind: Option<FieldKind>,
    pub(super) fields_x: Vec<f64>,
    pub(super) fields_y: Vec<f64>,
    pub(super) field_weights: Vec<f64>,
    /// The vignetting factors of each field: VUX, VLX, VUY and VLY.
    pub(super) vignetting: [Vec<f64>; 4],
    /// The object first, the image last.
    pub(super) surfaces: Vec<CodeVSurface>,
    /// True from `SI` on.
    pub(super) is_complete: bool,
    /// True if a command of the whole lens follows the surfaces, which are all there then.
    pub(super) is_followed: bool,
    /// The surface of the stop, from 0 for the object.
    pub(super) stop: Option<usize>,
    /// True if the image distance is the paraxial one, with the row of the report.
    pub(super) focus: Option<usize>,
    /// The wavelengths in nanometres of a private catalogue.
    pub(super) private_nm: Vec<f64>,
    /// The indices of the private glasses at these wavelengths, by name in upper case.
    pub(super) private: BTreeMap<String, Vec<f64>>,
    pub(super) in_private: bool,
    pub(super) positions: usize,
    pub(super) zoomed: Vec<ZoomCommand>,
    pub(super) pickups: Vec<PickupCommand>,
}

/// The definition of the beam width.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum ApertureCommand {
    Diameter(f64),
    FNumber(f64),
    ImageNa(f64),
    ObjectNa(f64),
}

/// One surface.
#[derive(Debug, Clone, Default)]
pub(super) struct CodeVSurface {
    /// The radius or the curvature; 0 is a plane in both.
    pub(super) bend: f64,
    pub(super) thickness: f64,
    pub(super) glass: Option<String>,
    /// The row of the report with the glass.
    pub(super) row: usize,
    pub(super) conic: f64,
    /// Coefficients of r⁴ to r²⁰.
    pub(super) terms: [f64; 9],
    pub(super) clip: Option<f64>,
    pub(super) obstruction: Option<f64>,
    /// The form, if it is none of revolution.
    pub(super) profile: Option<CodeVProfile>,
    /// The curvature of the section with the x-z plane.
    pub(super) across: f64,
    /// The conic constant of that section.
    pub(super) conic_across: f64,
    /// The diffractive phase on the surface (`DIF DOE`).
    pub(super) diffraction: Option<CodeVDiffraction>,
    /// The special form (`SPS`).
    pub(super) special: Option<CodeVSpecial>,
    /// The grating on the surface (`DIF GRT`).
    pub(super) grating: Option<CodeVGrating>,
    /// The surface whose place the decentre and the tilt start from (`GLB`, `RET`).
    pub(super) reference: Option<usize>,
    /// The half widths of an aperture that is no circle.
    pub(super) outline: CodeVOutline,
    /// The half widths of an obscuration that is no circle.
    pub(super) block: CodeVOutline,
    /// The displacement of the apertures.
    pub(super) offset: [f64; 2],
    /// The angle in degrees by which the apertures are turned about their centre (`ARO`).
    pub(super) turn: f64,
    /// The lines of the commands of apertures, but for centred circles.
    pub(super) aperture_lines: Vec<usize>,
    pub(super) label: String,
    pub(super) decenter: [f64; 3],
    /// ADE, BDE and CDE in degrees.
    pub(super) tilt: [f64; 3],
    pub(super) placement: Placement,
    pub(super) is_curvature_free: bool,
    pub(super) is_thickness_free: bool,
    /// The command that makes the surface impossible to trace.
    pub(super) locked: Option<String>,
    pub(super) lines: Vec<String>,
}

/// The half widths of a rectangle (`REX`, `REY`) or an ellipse (`ELX`, `ELY`).
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct CodeVOutline {
    pub(super) is_ellipse: bool,
    pub(super) half: [Option<f64>; 2],
}

/// A form that is none of revolution.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum CodeVProfile {
    /// A cylinder (`CYL`) or a curve in the y-z plane that is turned about a line parallel to y (`YTO`).
    Toroid,
    /// A biconic (`AAS`).
    Biconic,
}

/// A diffractive phase, `Σ cₖ r^(2k)` in the unit of the file at one wavelength.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct CodeVDiffraction {
    /// The line of the command that begins it.
    pub(super) line: usize,
    /// The diffraction order (`HOR`).
    pub(super) order: f64,
    /// The wavelength of the coefficients in nanometres (`HWL`), 0 if the file does not say it.
    pub(super) nm: f64,
    /// True for powers of r (`HCT R`), the one form that is known.
    pub(super) is_radial: bool,
    /// The coefficients (`HCO`).
    pub(super) terms: Vec<f64>,
}

/// A special form: its name, its unit of length and its coefficients by number. The conic constant is that
/// of the surface.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct CodeVSpecial {
    /// The line of the command that begins it.
    pub(super) line: usize,
    pub(super) form: SpecialForm,
    /// The radius by which coordinates are divided (`NRADIUS`); 0 for none.
    pub(super) radius: f64,
    pub(super) terms: BTreeMap<usize, f64>,
}

/// The special forms that can be traced.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum SpecialForm {
    /// `XYP`: C2 x, C3 y, C4 x², C5 xy, C6 y², ….
    XyPolynomial,
    /// `ODD`: C2 r, C3 r², ….
    OddAsphere,
    /// `QCN`: the strong asphere of Forbes, from C4 on.
    QCon,
    /// `QBF`: the mild asphere of Forbes, from C3 on.
    QBfs,
    /// `ZFR`: the fringe order of Zernike, from C4 on; C3 is the radius.
    FringeZernike,
}

impl SpecialForm {
    /// The forms with their names.
    pub(super) const ALL: [(&str, Self); 5] = [
        ("XYP", Self::XyPolynomial),
        ("ODD", Self::OddAsphere),
        ("QCN", Self::QCon),
        ("QBF", Self::QBfs),
        ("ZFR", Self::FringeZernike),
    ];

    /// The number of the coefficient that is the first number of the form here.
    pub(super) const fn first(self) -> usize {
        match self {
            Self::XyPolynomial | Self::OddAsphere => 2,
            Self::QBfs => 3,
            Self::QCon | Self::FringeZernike => 4,
        }
    }

    /// The number of the last coefficient; those behind mean something else.
    pub(super) const fn last(self) -> usize {
        match self {
            Self::XyPolynomial => 66,
            Self::OddAsphere => 31,
            Self::QBfs | Self::QCon => 16,
            Self::FringeZernike => 40,
        }
    }

    /// The number of the coefficient that is the conic constant.
    pub(super) const fn conic(self) -> usize {
        match self {
            Self::XyPolynomial | Self::OddAsphere | Self::FringeZernike => 1,
            Self::QBfs | Self::QCon => 17,
        }
    }
}

/// A grating with straight grooves parallel to x.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct CodeVGrating {
    /// The line of the command that begins it.
    pub(super) line: usize,
    /// The diffraction order (`GRO`).
    pub(super) order: f64,
    /// The distance of the grooves (`GRS`), 0 if the file does not say it.
    pub(super) spacing: f64,
    /// The normal of the planes of the grooves (`GRX`, `GRY`, `GRZ`).
    pub(super) normal: [f64; 3],
}

/// The frames that the decentre and the tilt of a surface move.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub(in crate::files) enum Placement {
    /// The surface and everything behind it.
    #[default]
    Basic,
    /// The surface alone (`DAR`).
    Return,
    /// The surface, and the tilt once more what is behind it (`BEN`).
    Bend,
    /// Everything behind the surface, in reverse (`REV`).
    Reverse,
}

/// The commands of vignetting factors, in the order of [`CodeVFile::vignetting`].
pub(super) const FACTORS: [&str; 4] = ["VUX", "VLX", "VUY", "VLY"];

/// A command of the zoom table: one value for each position.
#[derive(Debug)]
pub(super) struct ZoomCommand {
    pub(super) name: String,
    /// Surface or field, from 1.
    pub(super) target: usize,
    pub(super) values: Vec<f64>,
    /// The row of the report.
    pub(super) row: usize,
}

/// A pickup of the same number of another surface.
#[derive(Debug)]
pub(super) struct PickupCommand {
    /// True for a thickness, false for a radius.
    pub(super) is_thickness: bool,
    pub(super) surface: usize,
    pub(super) source: usize,
    pub(super) scale: f64,
    pub(super) offset: f64,
    /// The row of the report.
    pub(super) row: usize,
}
