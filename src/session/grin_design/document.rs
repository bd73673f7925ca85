//! The open document: a design task of a gradient-index field, or a volume.

use super::slice::{MAX_RAYS, SliceQuantity, SliceSettings};
use crate::files;
use crate::grin::field::Trilinear;
use crate::grin::{GrinRegion, IndexField};
use crate::grin_design::{
    self, Domain, FieldRepresentation, GrinField, GrinOptimizer, GrinTask, ReferenceField,
    SlicePlane, SpatialAxis,
};
use crate::math::Vec3;
use serde_json::Value;
use std::path::{Path, PathBuf};

/// The sines of angles to two planes are taken as equal if they differ by less than this.
const ROUGH: f64 = 0.1;

/// The source of a document.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum DocumentSource {
    /// A built-in task of this name.
    Builtin(String),
    /// A file.
    File(PathBuf),
}

/// A design task or a volume.
#[derive(Debug)]
pub struct GrinDocument {
    /// The name of the document.
    pub name: String,
    /// The source of the document.
    pub source: DocumentSource,
    /// The task; `None` for a volume.
    pub task: Option<GrinTask>,
    /// The initial field of the task, or the field of the volume.
    pub start: GrinField,
    /// The opposite corners of the smallest box around all domains of light, or around the volume, in mm.
    pub corners: [Vec3<f64>; 2],
    /// The domains in which light bends; empty if it bends everywhere.
    pub(super) regions: Vec<GrinRegion<f64>>,
    /// The reference field: the known solution of the task.
    pub(super) reference: Option<Box<dyn IndexField<f64>>>,
}

impl GrinDocument {
    /// Reads a task or a volume, with the optimizer of a task.
    pub(super) fn open(source: &DocumentSource) -> Result<(Self, Option<GrinOptimizer>), String> {
        match source {
            DocumentSource::Builtin(name) => {
                let builtin = grin_design::find_builtin(name);
                let builtin = builtin.ok_or_else(|| format!("there is no task `{name}`"))?;
                let task = builtin.task().map_err(|why| why.to_string())?;
                Self::of_task(task, source, name)
            }
            DocumentSource::File(path) => Self::from_file(path, source),
        }
    }

    /// The content decides what a file is: a volume of `NumPy` is an archive, everything else is JSON.
    fn from_file(
        path: &Path,
        source: &DocumentSource,
    ) -> Result<(Self, Option<GrinOptimizer>), String> {
        let file = path.display().to_string();
        let bytes =
            files::read_file(path, files::MAX_VOLUME_BYTES).map_err(|why| why.to_string())?;
        let text = std::str::from_utf8(&bytes).ok().filter(|_| !bytes.starts_with(b"PK"));
        let json: Option<Value> = text.and_then(|text| serde_json::from_str(text).ok());
        let has = |key: &str| json.as_ref().is_some_and(|json| json.get(key).is_some());
        if let Some(text) = text.filter(|_| has("aplanat_grin")) {
            let task = grin_design::read_task(text, &file).map_err(|why| why.to_string())?;
            return Self::of_task(task, source, &file);
        }
        if bytes.starts_with(b"PK") || has("aplanat_volume") {
            return Ok((Self::of_volume(path, source)?, None));
        }
        let found = if has("aplanat") { "a lens" } else { "neither" };
        Err(format!(
            "{file}: found {found}; expected a task (JSON with \"aplanat_grin\"), NumPy's .npz, or \
             the header of raw numbers (JSON with \"aplanat_volume\")"
        ))
    }

    fn of_task(
        task: GrinTask,
        source: &DocumentSource,
        file: &str,
    ) -> Result<(Self, Option<GrinOptimizer>), String> {
        let runner = task.read_files().and_then(|()| GrinOptimizer::new(&task));
        let runner = runner.map_err(|why| format!("{file}: {why}"))?;
        let exact = task.exact.as_ref().map(ReferenceField::field::<f64>).transpose();
        let exact = exact.map_err(|why| format!("{file}, exact: {why}"))?;
        let spaces = || task.views.iter().map(|view| view.space.unwrap_or(task.space));
        let all = spaces().map(Domain::corners).fold(task.space.corners(), union_box);
        let end = field_domain(task.field);
        let regions = spaces().chain([task.space]).map(|space| intersection(space, end)).collect();
        let document = Self {
            name: task.name.clone(),
            source: source.clone(),
            start: runner.current().clone(),
            corners: common_box(all, end.corners()),
            regions,
            reference: exact,
            task: Some(task),
        };
        Ok((document, Some(runner)))
    }

    fn of_volume(path: &Path, source: &DocumentSource) -> Result<Self, String> {
        let files::Volume { grid, values } =
            files::read_volume(path).map_err(|why| why.to_string())?;
        let field = Trilinear::new(grid, values);
        let field = field.map_err(|why| format!("{}: {why}", path.display()))?;
        let (low, h) = (grid.low(), grid.spacing());
        let [x, y, z] = grid.counts().map(|count| (count - 1) as f64);
        let high = low + Vec3::new(x * h.x, y * h.y, z * h.z);
        let name = path.file_name().map(|name| name.to_string_lossy().into_owned());
        Ok(Self {
            name: name.unwrap_or_default(),
            source: source.clone(),
            task: None,
            start: GrinField::Trilinear(field),
            corners: [low, high],
            regions: Vec::new(),
            reference: None,
        })
    }

    /// True if the task has a reference field.
    pub fn has_reference(&self) -> bool {
        self.reference.is_some()
    }

    /// True if a slice can show the quantity.
    pub fn supports(&self, quantity: SliceQuantity) -> bool {
        match quantity {
            SliceQuantity::Index | SliceQuantity::Slope => true,
            SliceQuantity::Change => self.task.is_some(),
            SliceQuantity::Error => self.has_reference(),
        }
    }

    /// The range of depths of slices across an axis, in mm.
    pub fn depth_range(&self, axis: SpatialAxis) -> [f64; 2] {
        self.corners.map(|corner| axis.component(corner))
    }

    /// True if the point is inside the box and the domains of light.
    pub fn contains(&self, point: Vec3<f64>) -> bool {
        let [low, high] = self.corners;
        let within = SpatialAxis::ALL.iter().all(|axis| {
            let at = axis.component(point);
            at >= axis.component(low) && at <= axis.component(high)
        });
        within && self.height(point) < 0.0
    }

    /// A level-set function of the domains: negative inside, positive outside.
    pub(super) fn height(&self, point: Vec3<f64>) -> f64 {
        let heights = self.regions.iter().map(|region| region.level(point));
        heights.reduce(f64::min).unwrap_or(-1.0)
    }

    /// The slice through the middle whose plane is closest to the directions of the light.
    pub(super) fn default_slice(&self) -> SliceSettings {
        let share = |axis: SpatialAxis| -> f64 {
            let Some(task) = &self.task else { return 0.0 };
            let views = task.views.iter().filter(|view| view.weight > 0.0);
            let nearest = views.map(|view| {
                let rays = task.scoring_rays(view).1;
                let share = |v: Vec3<f64>| axis.component(v).abs() / v.dot(v).sqrt();
                rays.iter().map(|ray| share(ray.v)).fold(f64::INFINITY, f64::min)
            });
            nearest.sum()
        };
        // In this order if several are equal: a drawing with the light to the right comes first.
        let order = [SpatialAxis::Y, SpatialAxis::X, SpatialAxis::Z];
        // The mean angles of a beam with evenly spread directions differ slightly between the planes.
        let rough = |axis: &SpatialAxis| (share(*axis) / ROUGH).round();
        let axis = order.into_iter().min_by(|a, b| rough(a).total_cmp(&rough(b)));
        let axis = axis.unwrap_or(SpatialAxis::Y);
        self.clamp_slice(SliceSettings {
            plane: SlicePlane { axis, depth: self.middle(axis) },
            ..SliceSettings::default()
        })
    }

    /// The default depth of a slice: 0 if it is inside the range, else the middle of the range.
    pub fn middle(&self, axis: SpatialAxis) -> f64 {
        let [low, high] = self.depth_range(axis);
        if low < 0.0 && 0.0 < high { 0.0 } else { 0.5 * (low + high) }
    }

    /// The settings with depth, quantity and number of rays limited to those of the document.
    pub(super) fn clamp_slice(&self, settings: SliceSettings) -> SliceSettings {
        let [low, high] = self.depth_range(settings.plane.axis);
        let depth = settings.plane.depth;
        let depth = if depth.is_finite() { depth.clamp(low, high) } else { 0.5 * (low + high) };
        let quantity =
            if self.supports(settings.quantity) { settings.quantity } else { SliceQuantity::Index };
        let plane = SlicePlane { depth, ..settings.plane };
        SliceSettings { plane, quantity, rays: settings.rays.min(MAX_RAYS) }
    }
}

/// The domain of a field. Beyond it the field is only extrapolated for the last step of a ray.
fn field_domain(kind: FieldRepresentation) -> Domain {
    match kind {
        FieldRepresentation::Trilinear { half } | FieldRepresentation::Tricubic { half } => {
            Domain::Cube { half }
        }
        FieldRepresentation::Sphere { radius } => Domain::Ball { radius },
        FieldRepresentation::Cylinder { radius } => {
            Domain::Rod { radius, from: f64::NEG_INFINITY, to: f64::INFINITY }
        }
    }
}

/// The intersection of two domains.
fn intersection(space: Domain, end: Domain) -> GrinRegion<f64> {
    let (mut both, other) = (space.region(), end.region());
    [both.low, both.high] = common_box([both.low, both.high], [other.low, other.high]);
    both.faces.extend(other.faces);
    both
}

fn componentwise(of: fn(f64, f64) -> f64, a: Vec3<f64>, b: Vec3<f64>) -> Vec3<f64> {
    Vec3::new(of(a.x, b.x), of(a.y, b.y), of(a.z, b.z))
}

/// The smallest box around two boxes.
fn union_box(a: [Vec3<f64>; 2], b: [Vec3<f64>; 2]) -> [Vec3<f64>; 2] {
    [componentwise(f64::min, a[0], b[0]), componentwise(f64::max, a[1], b[1])]
}

/// The intersection of two boxes.
fn common_box(a: [Vec3<f64>; 2], b: [Vec3<f64>; 2]) -> [Vec3<f64>; 2] {
    [componentwise(f64::max, a[0], b[0]), componentwise(f64::min, a[1], b[1])]
}
