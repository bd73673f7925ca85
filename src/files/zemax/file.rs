//! The content of a `.zmx` file before it is interpreted. Lengths are in the unit of the file.

use crate::files::outline::OutlineForm;

/// The content of a file.
#[derive(Debug)]
pub(super) struct ZemaxFile {
    /// Millimetres per unit.
    pub(super) unit: f64,
    pub(super) name: String,
    pub(super) notes: Vec<String>,
    pub(super) aperture: Option<(ApertureLine, usize)>,
    pub(super) fields: FieldLines,
    /// The vignetting factors of each field: VDX, VDY, VCX, VCY and VAN.
    pub(super) vignetting: [Vec<f64>; 5],
    pub(super) waves: WaveLines,
    /// Names of glass catalogues, in the order in which they are searched.
    pub(super) catalogues: Vec<String>,
    pub(super) surfaces: Vec<ZemaxSurface>,
    /// The number of configurations.
    pub(super) configurations: usize,
    pub(super) operands: Vec<ConfigurationOperand>,
    /// The operands of the tolerance editor.
    pub(super) tolerances: Vec<ToleranceLine>,
}

/// An operand of the tolerance editor.
#[derive(Debug)]
pub(super) struct ToleranceLine {
    pub(super) name: String,
    /// Its two whole numbers, as a rule surfaces.
    pub(super) places: [usize; 2],
    pub(super) min: f64,
    pub(super) max: f64,
    pub(super) line: usize,
}

impl Default for ZemaxFile {
    fn default() -> Self {
        Self {
            unit: 1.0,
            name: String::new(),
            notes: Vec::new(),
            aperture: None,
            fields: FieldLines::default(),
            vignetting: [const { Vec::new() }; 5],
            waves: WaveLines::default(),
            catalogues: Vec::new(),
            surfaces: Vec::new(),
            configurations: 1,
            operands: Vec::new(),
            tolerances: Vec::new(),
        }
    }
}

/// The definition of the beam width.
#[derive(Debug, Clone, Copy)]
pub(super) enum ApertureLine {
    Diameter(f64),
    FNumber { value: f64, working: bool },
    ObjectNa(f64),
    ObjectConeDegrees(f64),
    FloatByStop,
}

/// The lines of the field points.
#[derive(Debug, Default)]
pub(super) struct FieldLines {
    /// 0 angle, 1 object height, 2 paraxial image height, 3 real image height, 4 theodolite; with
    /// its line.
    pub(super) kind: Option<(usize, usize)>,
    pub(super) count: Option<usize>,
    pub(super) x: Vec<f64>,
    pub(super) y: Vec<f64>,
    pub(super) weights: Vec<f64>,
}

/// The lines of the wavelengths.
#[derive(Debug, Default)]
pub(super) struct WaveLines {
    pub(super) count: Option<usize>,
    /// Index from 1, micrometres, weight, line.
    pub(super) numbered: Vec<(usize, f64, f64, usize)>,
    /// Micrometres, in the older spelling.
    pub(super) list: Vec<f64>,
    pub(super) weights: Vec<f64>,
    /// Index from 1 of the primary wavelength, and its line.
    pub(super) primary: Option<(usize, usize)>,
}

/// One surface block.
#[derive(Debug, Default)]
pub(super) struct ZemaxSurface {
    /// The line of its `SURF`.
    pub(super) line: usize,
    pub(super) stop: Option<usize>,
    /// The surface type, empty for none, and its line.
    pub(super) kind: (String, usize),
    pub(super) comment: String,
    pub(super) curvature: Option<(f64, usize)>,
    pub(super) curvature_solve: CurvatureSolve,
    pub(super) conic: f64,
    /// Decentre, tilts and order of a break in front of the surface that belongs to it.
    pub(super) own_break: Option<[f64; 6]>,
    /// The displacement of the aperture, and its line.
    pub(super) aperture_offset: Option<(f64, f64, usize)>,
    /// The lines of the surface as they are.
    pub(super) lines: Vec<String>,
    /// Parameter and extra-data numbers with their index and line.
    pub(super) parameters: Vec<(usize, f64, usize)>,
    pub(super) extra: Vec<(usize, f64, usize)>,
    /// Infinite for the word `INFINITY`, and the line.
    pub(super) thickness: Option<(f64, usize)>,
    pub(super) glass: Option<GlassLine>,
    pub(super) semi_diameter: Option<SemiDiameterLine>,
    /// The outer radius of a circular aperture, and its line.
    pub(super) clip: Option<(f64, usize)>,
    /// The inner radius of an aperture or the outer one of an obscuration, and its line.
    pub(super) obstruction: Option<(f64, usize)>,
    /// An aperture that is no circle.
    pub(super) outline: Option<OutlineLine>,
    /// An obscuration that is no circle.
    pub(super) block: Option<OutlineLine>,
    /// The number and the width of the arms of a spider, and its line.
    pub(super) spider: Option<(usize, f64, usize)>,
    /// The lines of apertures of other forms.
    pub(super) other_apertures: Vec<usize>,
    pub(super) variable_thickness: Option<(f64, f64, usize)>,
    pub(super) thickness_pickup: Option<PickupLine>,
    /// Height, zone and line of a marginal ray height solve.
    pub(super) marginal_height: Option<(f64, f64, usize)>,
    pub(super) variable_conic: Option<usize>,
    /// Parameter numbers that are variable, with their line.
    pub(super) variable_parameters: Vec<(usize, usize)>,
}

/// A rectangular or elliptical aperture or obscuration.
#[derive(Debug, Clone, Copy)]
pub(super) struct OutlineLine {
    pub(super) form: OutlineForm,
    /// The half widths along x and y.
    pub(super) half: [f64; 2],
    pub(super) line: usize,
}

/// The solve of a curvature.
#[derive(Debug, Default, Clone, Copy)]
pub(super) enum CurvatureSolve {
    #[default]
    Fixed,
    Variable,
    Pickup(PickupLine),
}

/// A pickup of the same number of another surface.
#[derive(Debug, Clone, Copy)]
pub(super) struct PickupLine {
    pub(super) surface: usize,
    pub(super) scale: f64,
    pub(super) offset: f64,
    pub(super) line: usize,
}

/// A semi-diameter and its origin.
#[derive(Debug, Clone, Copy)]
pub(super) struct SemiDiameterLine {
    pub(super) value: f64,
    /// True if it was typed; else the program computed it.
    pub(super) fixed: bool,
    pub(super) line: usize,
}

/// The medium behind a surface.
#[derive(Debug, Clone, Default, PartialEq)]
pub(super) struct GlassLine {
    pub(super) name: String,
    /// 0 catalogue, 1 model, 2 pickup, 3 substitute, 4 offset.
    pub(super) code: usize,
    /// The surface whose glass is picked up.
    pub(super) source: Option<usize>,
    pub(super) nd: f64,
    pub(super) vd: f64,
    pub(super) partial: f64,
    pub(super) variable_index: bool,
    /// The offsets of nd and vd for code 4.
    pub(super) offsets: (f64, f64),
    pub(super) line: usize,
}

/// The operands of the vignetting factors of a field, in the order of [`ZemaxFile::vignetting`].
pub(super) const FACTORS: [&str; 5] = ["FVDX", "FVDY", "FVCX", "FVCY", "FVAN"];

/// One value of the multi-configuration table.
#[derive(Debug, Clone)]
pub(super) struct ConfigurationOperand {
    pub(super) name: String,
    /// Surface or field.
    pub(super) target: usize,
    /// From 1.
    pub(super) configuration: usize,
    pub(super) value: f64,
    pub(super) variable: bool,
    pub(super) line: usize,
}
