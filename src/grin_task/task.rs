//! What a person asks of a field of refractive index: the task as it is written in a file.

use super::drawing::TargetImage;
use crate::grin::{Integrator, LaunchMode};
use serde::{Deserialize, Serialize};
use std::path::PathBuf;

/// The version of the format.
pub const TASK_VERSION: u32 = 1;

/// A task: which field is to be found, what it shall do to light, and what a maker can make.
///
/// Lengths are in mm and angles in degrees, as in every file. `η` is the refractive index.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct GrinTask {
    /// The version of this format: 1.
    pub aplanat_grin: u32,
    /// What it is called.
    pub name: String,
    /// What a reader should know.
    #[serde(default, skip_serializing_if = "String::is_empty")]
    pub notes: String,
    /// How the field is made up.
    pub field: FieldRepresentation,
    /// Where light bends.
    pub space: Domain,
    /// How the speed of a ray is made to fit the index where it starts.
    #[serde(default)]
    pub launch: LaunchMode,
    /// Light and where it shall go.
    pub views: Vec<LightView>,
    /// The field to begin with.
    #[serde(default)]
    pub start: InitialField,
    /// Exit positions are good to this length, where the field allows it.
    pub tolerance: f64,
    /// The step of rays in a grid, where it is not to be chosen by the tolerance.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub tracing: Option<TracingSettings>,
    /// What a maker can make.
    #[serde(default)]
    pub limits: ManufacturingLimits,
    /// What holds at the boundary of the space; nothing where it is absent.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub edge: Option<BoundaryCondition>,
    /// How the field is found.
    pub method: GrinMethod,
    /// Resolutions from coarse to fine.
    pub levels: Vec<RefinementLevel>,
    /// The field that is known to be the answer, for comparison; the search does not see it.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub exact: Option<ReferenceField>,
}

/// How a field is made up of numbers.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
pub enum FieldRepresentation {
    /// Nodes on a cube, trilinear between them.
    Trilinear {
        /// Half the side of the cube.
        half: f64,
    },
    /// Tricubic B-splines on a cube.
    Tricubic {
        /// Half the side of the cube.
        half: f64,
    },
    /// A cubic B-spline in the square of the distance from the centre.
    Sphere {
        /// Where the spline ends.
        radius: f64,
    },
    /// A cubic B-spline in the square of the distance from the z axis.
    Cylinder {
        /// Where the spline ends.
        radius: f64,
    },
}

/// Where light bends; outside there is air.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
pub enum Domain {
    /// A ball about the origin.
    Ball {
        /// Its radius.
        radius: f64,
    },
    /// A rod about the z axis.
    Rod {
        /// Its radius.
        radius: f64,
        /// The z at which it begins.
        from: f64,
        /// The z at which it ends.
        to: f64,
    },
    /// A cube about the origin.
    Cube {
        /// Half its side.
        half: f64,
    },
}

/// Light from one source and what shall become of it.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct LightView {
    /// What it is called.
    pub name: String,
    /// Where the rays come from.
    pub source: LightSource,
    /// Where they shall go.
    pub goal: LightGoal,
    /// How much it counts; a view of weight 0 is only looked at.
    #[serde(default = "one")]
    pub weight: f64,
    /// The space of this view, where it is another one: a rod cut elsewhere.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub space: Option<Domain>,
}

fn one() -> f64 {
    1.0
}

/// Where rays come from.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
pub enum LightSource {
    /// Parallel light: even discs of rays about the lines through the origin.
    Parallel {
        /// The directions in which light goes.
        directions: SourceDirections,
        /// The radius of each disc.
        radius: f64,
        /// Rays a direction.
        rays: usize,
    },
    /// Points on a sphere about the origin that send even cones of rays towards it.
    Points {
        /// From the points to the centre.
        directions: SourceDirections,
        /// The radius of the sphere.
        radius: f64,
        /// The angle between the outermost rays and the axis of the cone.
        cone: f64,
        /// Rays a point.
        rays: usize,
    },
    /// Parallel rays along +z in the plane of z and x, at even heights on one side of the axis.
    Fan {
        /// The height of the outermost ray.
        height: f64,
        /// The z at which they start.
        z: f64,
        /// How many.
        rays: usize,
    },
    /// A square beam from outside the space: a ray somewhere in each square of a grid.
    Beam {
        /// The direction in which light goes.
        direction: [f64; 3],
        /// Half the side of the square.
        half: f64,
        /// Rays along a side.
        rays: usize,
        /// Whether they stand elsewhere in their squares in every step; for Adam.
        #[serde(default)]
        fresh: bool,
    },
}

/// Directions in space.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum SourceDirections {
    /// These, of any length.
    Given(Vec<[f64; 3]>),
    /// So many, evenly all around, the same in every step.
    Even(usize),
    /// So many across the z axis, evenly over half a turn.
    Around(usize),
    /// So many new ones in every step; for Adam.
    Fresh(usize),
}

/// What shall become of light.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
pub enum LightGoal {
    /// It leaves through this point. The loss is the mean square distance, in mm².
    Point([f64; 3]),
    /// It leaves through the point of the space's surface opposite to its source. Likewise.
    Antipode,
    /// It makes a picture on a square screen across a beam. The loss is the mean square difference
    /// from the picture of mean 1, without a unit.
    Image {
        /// The picture.
        drawing: TargetImage,
        /// Half the side of the screen.
        half: f64,
        /// How far it stands behind the space.
        distance: f64,
        /// Pixels along its side.
        pixels: usize,
    },
    /// It makes a picture at infinity: where a ray shows is told by its direction alone, as in the
    /// focal plane of a lens. Likewise.
    Far {
        /// The picture.
        drawing: TargetImage,
        /// The angle between the middle of the picture, in the direction of the beam, and the
        /// middle of a side.
        angle: f64,
        /// Pixels along its side.
        pixels: usize,
    },
    /// It goes through a ring about the axis of a beam, and towards a ring at infinity (5.36 and
    /// 5.37). The loss is the mean square distance from the former, in mm², and that of the
    /// direction from the latter.
    Ring {
        /// The radius of the near ring.
        radius: f64,
        /// How far it stands behind the space.
        distance: f64,
        /// The angle between the axis and the far ring.
        angle: f64,
        /// What the square of a difference in direction counts against that of one in mm.
        far: f64,
    },
    /// It leaves as it does from another field, which a measurement of rays would give.
    Like {
        /// That field.
        field: ReferenceField,
        /// What the square of a difference in direction counts against that of one in mm.
        #[serde(default)]
        direction: f64,
    },
}

/// The field to begin with.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
pub enum InitialField {
    /// The same index everywhere.
    Uniform(f64),
    /// A volume from a file, `NumPy`'s .npz or raw numbers with a header.
    Volume(PathBuf),
}

impl Default for InitialField {
    fn default() -> Self {
        Self::Uniform(1.0)
    }
}

/// Steps that are tied to the voxels of a grid.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct TracingSettings {
    /// The kind of step.
    pub integrator: Integrator,
    /// About how many steps a voxel has.
    pub per_voxel: f64,
}

/// What a maker can make.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ManufacturingLimits {
    /// Smallest index: 1 or more.
    #[serde(default = "one")]
    pub low: f64,
    /// Largest index.
    #[serde(default = "two")]
    pub high: f64,
    /// Steepest index, in 1/mm; any where it is absent. A penalty leads the search, and what is
    /// found keeps it everywhere: a field that is too steep is drawn towards the index of the edge.
    /// The range of the index is likewise held by a penalty where coefficients alone do not hold it,
    /// and kept by what is found.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub slope: Option<f64>,
    /// Largest change of the index in one step of the search.
    #[serde(default = "small")]
    pub change: f64,
}

impl Default for ManufacturingLimits {
    fn default() -> Self {
        Self { low: one(), high: two(), slope: None, change: small() }
    }
}

fn two() -> f64 {
    2.0
}

fn small() -> f64 {
    0.05
}

/// What holds at the boundary of the space.
///
/// Rays depend on the gradient of `η²` alone: what they leave open, the level of the index, must be
/// fixed here, or by refraction (`"launch": "refracted"`).
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct BoundaryCondition {
    /// The index there.
    pub index: f64,
    /// Whether all nodes of a trilinear grid outside the space have it.
    #[serde(default)]
    pub fixed: bool,
    /// The weight, in mm², of its mean square deviation on the surface of the space; for a spline,
    /// at its end.
    #[serde(default)]
    pub weight: f64,
}

/// How a field is found.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
pub enum GrinMethod {
    /// First order, with moments: for rays that are new in every step.
    Adam {
        /// The size of a step of the index at the first level.
        rate: f64,
        /// What it is multiplied by at each further level.
        #[serde(default = "one")]
        fall: f64,
    },
    /// Limited-memory BFGS: for many numbers and the same rays in every step.
    Lbfgs,
    /// Levenberg and Marquardt: for few numbers and the same rays in every step.
    LeastSquares,
}

/// A resolution and how long it is worked at.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct RefinementLevel {
    /// Nodes along a side of the cube, or coefficients of the spline.
    pub nodes: usize,
    /// No more steps than this.
    pub steps: usize,
}

/// A field that is given.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
pub enum ReferenceField {
    /// Luneburg's lens, `η = √(2 - r²/R²)` (5.38).
    Luneburg {
        /// `R`.
        radius: f64,
    },
    /// Maxwell's fish-eye, `η = n₀/(1 + r²/R²)` (5.39).
    Maxwell {
        /// `n₀`.
        centre: f64,
        /// `R`.
        radius: f64,
    },
    /// The fibre `η = n₀/cosh(a r)` about the z axis.
    Secant {
        /// `n₀`.
        axis: f64,
        /// `a`.
        a: f64,
    },
    /// The fibre `η² = n₀² (1 - g² r²)` about the z axis (5.42).
    Parabolic {
        /// `n₀`.
        axis: f64,
        /// `g`.
        g: f64,
    },
    /// A synthetic plume of gas: `η = ambient + contrast q`, `q` from 0 to nearly 1, after
    /// [`Plume`](crate::grin::field::Plume).
    Plume {
        /// The index around it.
        ambient: f64,
        /// What the index changes by where the plume is densest; below 0 for a thin one.
        contrast: f64,
        /// Half the side of the cube that it stands in.
        half: f64,
    },
    /// A volume from a file, trilinear between its nodes.
    Volume(PathBuf),
}
