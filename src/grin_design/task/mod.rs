//! The task file: the sources and goals of light, the field and its limits, and the method.

mod builtin;
pub(super) mod checks;
mod domain;
pub(super) mod geometry;
pub(super) mod source;
pub(super) mod target_image;
mod task_file;
mod validate;

pub use builtin::{BUILTIN_TASKS, BuiltinTask, find_builtin, read_task};
pub use source::SquareBeam;
pub use target_image::TargetImage;
pub use task_file::TaskFile;

use crate::grin::field::Trilinear;
use crate::grin::{Integrator, LaunchMode};
use serde::{Deserialize, Serialize};

/// The version of the format.
pub const TASK_VERSION: u32 = 1;

/// A design task: the representation of the field, the light and its goals, and the manufacturing
/// limits.
///
/// Lengths are in mm and angles in degrees, as in every file. `η` is the refractive index.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct GrinTask {
    /// The version of this format: 1.
    pub aplanat_grin: u32,
    /// The name of the task.
    pub name: String,
    /// Notes for the reader.
    #[serde(default, skip_serializing_if = "String::is_empty")]
    pub notes: String,
    /// The representation of the field.
    pub field: FieldRepresentation,
    /// The domain in which light is refracted.
    pub space: Domain,
    /// The relation of a ray's initial speed to the index at its start.
    #[serde(default)]
    pub launch: LaunchMode,
    /// Sources of light and their goals.
    pub views: Vec<LightView>,
    /// The initial field.
    #[serde(default)]
    pub start: InitialField,
    /// The accuracy of exit positions in mm, where the field allows it.
    pub tolerance: f64,
    /// The step of rays in a grid, unless it is chosen by the tolerance.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub tracing: Option<TracingSettings>,
    /// The manufacturing limits.
    #[serde(default)]
    pub limits: ManufacturingLimits,
    /// The condition at the boundary of the domain; none if absent.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub edge: Option<BoundaryCondition>,
    /// The optimization method.
    pub method: GrinMethod,
    /// Resolutions from coarse to fine.
    pub levels: Vec<RefinementLevel>,
    /// The known solution, for comparison; the optimization does not use it.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub exact: Option<ReferenceField>,
}

/// The representation of a field by parameters.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
pub enum FieldRepresentation {
    /// Nodes on a cube with trilinear interpolation.
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
        /// The radius at which the spline ends.
        radius: f64,
    },
    /// A cubic B-spline in the square of the distance from the z axis.
    Cylinder {
        /// The radius at which the spline ends.
        radius: f64,
    },
}

/// The domain in which light is refracted; outside there is air.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
pub enum Domain {
    /// A ball about the origin.
    Ball {
        /// Its radius.
        radius: f64,
    },
    /// A cylindrical rod about the z axis.
    Rod {
        /// Its radius.
        radius: f64,
        /// The z of its front face.
        from: f64,
        /// The z of its rear face.
        to: f64,
    },
    /// A cube about the origin.
    Cube {
        /// Half its side.
        half: f64,
    },
}

/// A light source and the goal for its rays.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct LightView {
    /// The name of the view.
    pub name: String,
    /// The source of the rays.
    pub source: LightSource,
    /// The goal for the rays.
    pub goal: LightGoal,
    /// The weight in the loss; a view of weight 0 is only evaluated.
    #[serde(default = "one")]
    pub weight: f64,
    /// The domain of this view, if it differs from that of the task: a rod of another length.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub space: Option<Domain>,
}

fn one() -> f64 {
    1.0
}

/// A source of rays.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
pub enum LightSource {
    /// Parallel light: uniform discs of rays about the lines through the origin.
    Parallel {
        /// The directions of the light.
        directions: SourceDirections,
        /// The radius of each disc.
        radius: f64,
        /// Rays per direction.
        rays: usize,
    },
    /// Points on a sphere about the origin that emit uniform cones of rays towards it.
    Points {
        /// The directions from the points to the centre.
        directions: SourceDirections,
        /// The radius of the sphere.
        radius: f64,
        /// The angle between the outermost rays and the axis of the cone.
        cone: f64,
        /// Rays per point.
        rays: usize,
    },
    /// Parallel rays along +z in the z-x plane, at uniform heights on one side of the axis.
    Fan {
        /// The height of the outermost ray.
        height: f64,
        /// The z at which the rays start.
        z: f64,
        /// The number of rays.
        rays: usize,
    },
    /// A square beam from outside the domain: one ray in each cell of a square grid.
    Beam {
        /// The direction of the light.
        direction: [f64; 3],
        /// Half the side of the square.
        half: f64,
        /// Rays along a side.
        rays: usize,
        /// True if the positions of the rays in their cells change with every step; for Adam.
        #[serde(default)]
        fresh: bool,
    },
}

/// Directions in space.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum SourceDirections {
    /// These directions, of any length.
    Given(Vec<[f64; 3]>),
    /// This many directions, uniform over the sphere, the same in every step.
    Even(usize),
    /// This many directions perpendicular to the z axis, uniform over half a turn.
    Around(usize),
    /// This many new directions in every step; for Adam.
    Fresh(usize),
}

/// The goal for the rays of a view.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
pub enum LightGoal {
    /// The rays leave through this point. The loss is the mean square distance, in mm².
    Point([f64; 3]),
    /// The rays leave through the point of the domain's surface opposite to their source. The loss
    /// is the mean square distance, in mm².
    Antipode,
    /// The rays form an image on a square screen perpendicular to a beam. The loss is the mean
    /// square difference from the target image of mean 1, without unit.
    Image {
        /// The target image.
        drawing: TargetImage,
        /// Half the side of the screen.
        half: f64,
        /// The distance of the screen behind the domain.
        distance: f64,
        /// Pixels along a side.
        pixels: usize,
    },
    /// The rays form an image at infinity: the position in the image depends on the direction of a
    /// ray alone, as in the focal plane of a lens. The loss is that of [`Self::Image`].
    Far {
        /// The target image.
        drawing: TargetImage,
        /// The angle between the centre of the image, in the direction of the beam, and the middle
        /// of a side.
        angle: f64,
        /// Pixels along a side.
        pixels: usize,
    },
    /// The rays pass through a ring about the axis of a beam, and towards a ring at infinity (5.36
    /// and 5.37). The loss is the mean square distance from the former, in mm², and that of the
    /// direction from the latter.
    Ring {
        /// The radius of the near ring.
        radius: f64,
        /// The distance of the near ring behind the domain.
        distance: f64,
        /// The angle between the axis and the far ring.
        angle: f64,
        /// The weight of a squared difference in direction relative to one in mm.
        far: f64,
    },
    /// The rays leave as from another field, whose exits would be known from a measurement.
    Like {
        /// That field.
        field: ReferenceField,
        /// The weight of a squared difference in direction relative to one in mm.
        #[serde(default)]
        direction: f64,
    },
}

/// A volume file with trilinear interpolation between its nodes.
pub type VolumeFile = TaskFile<Trilinear<f64>>;

/// The initial field.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
pub enum InitialField {
    /// The same index everywhere.
    Uniform(f64),
    /// A volume file, `NumPy`'s .npz or raw numbers with a header.
    Volume(VolumeFile),
}

impl Default for InitialField {
    fn default() -> Self {
        Self::Uniform(1.0)
    }
}

/// A tracing step tied to the voxels of a grid.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct TracingSettings {
    /// The integrator.
    pub integrator: Integrator,
    /// The approximate number of steps per voxel.
    pub per_voxel: f64,
}

/// The manufacturing limits of a field.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ManufacturingLimits {
    /// The smallest index: 1 or more.
    #[serde(default = "one")]
    pub low: f64,
    /// The largest index.
    #[serde(default = "two")]
    pub high: f64,
    /// The largest gradient of the index, in 1/mm; unlimited if absent. A penalty guides the
    /// optimization, and the resulting field satisfies the limit everywhere: a field whose gradient
    /// is too large is scaled towards the index of the boundary. The range of the index is likewise
    /// enforced by a penalty where coefficients alone do not guarantee it, and satisfied by the
    /// resulting field.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub slope: Option<f64>,
    /// The largest change of the index in one step of the optimization.
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

/// The condition at the boundary of the domain.
///
/// Rays depend on the gradient of `η²` alone: the additive constant of the index that they do not
/// determine must be fixed here, or by refraction (`"launch": "refracted"`).
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct BoundaryCondition {
    /// The index there.
    pub index: f64,
    /// True if all nodes of a trilinear grid outside the domain have this index.
    #[serde(default)]
    pub fixed: bool,
    /// The weight, in mm², of the mean square deviation on the surface of the domain; for a spline,
    /// at its end.
    #[serde(default)]
    pub weight: f64,
}

/// The optimization method.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
pub enum GrinMethod {
    /// Adam, a first-order method with moments: for rays that differ in every step.
    Adam {
        /// The size of a step of the index at the first level.
        rate: f64,
        /// The factor applied to the rate at each further level.
        #[serde(default = "one")]
        fall: f64,
    },
    /// Limited-memory BFGS: for many parameters and the same rays in every step.
    Lbfgs,
    /// Levenberg-Marquardt: for few parameters and the same rays in every step.
    LeastSquares,
}

/// A resolution and its largest number of steps.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct RefinementLevel {
    /// Nodes along a side of the cube, or coefficients of the spline.
    pub nodes: usize,
    /// The largest number of steps.
    pub steps: usize,
}

/// A reference field.
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
        /// The index outside.
        ambient: f64,
        /// The change of the index where the plume is densest; negative for a plume of lower index.
        contrast: f64,
        /// Half the side of the cube that contains it.
        half: f64,
    },
    /// A volume file with trilinear interpolation between its nodes.
    Volume(VolumeFile),
}
