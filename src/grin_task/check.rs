//! What is wrong with a task, told before any ray is traced.

use super::drawing::Drawing;
use super::given::NoField;
use super::refuse::{LONG, direction, extent, number, positive, reached, weight, within, wrong};
use super::task::{
    Directions, Exact, FieldKind, Goal, Method, Source, Space, Start, Task, VERSION, View,
};
use crate::files::FileError;
use crate::grin::SetupError;
use crate::grin::field::GridError;

/// Most numbers that least squares are worth while for.
const FEW: usize = 400;
/// By how much an index may be below 1 that is the difference of two numbers.
pub(super) const ROUNDING: f64 = 1e-9;
/// Most rays in a step, and most nodes along a side.
const MANY_RAYS: usize = 10_000_000;
const MANY_NODES: usize = 513;

/// Why a task cannot be worked on.
#[derive(Debug, thiserror::Error)]
pub enum TaskError {
    /// A number that makes no sense.
    #[error("{place}: found {found}; expected {expected}")]
    Value {
        /// Where it stands in the task.
        place: String,
        /// What stands there.
        found: String,
        /// What should.
        expected: String,
    },
    /// The field to begin with, or one that is given, cannot be had.
    #[error("{place}: {source}")]
    Field {
        /// Where it stands in the task.
        place: String,
        /// Why not.
        source: NoField,
    },
    /// A picture cannot be had.
    #[error("{place}: {source}")]
    Picture {
        /// Where it stands in the task.
        place: String,
        /// Why not.
        source: FileError,
    },
    /// A field cannot be made of so many numbers.
    #[error("levels: {0}")]
    Level(#[from] GridError),
    /// Nothing can be traced.
    #[error("space: {0}")]
    Setup(#[from] SetupError),
    /// Every number of the field is fixed.
    #[error(
        "levels: a field of {nodes} nodes has none that may change; expected more nodes, or an edge \
         that is not fixed"
    )]
    NothingFree {
        /// Nodes along a side.
        nodes: usize,
    },
}

impl Task {
    /// Refuses what cannot be worked on.
    ///
    /// # Errors
    /// The first thing that is wrong, with its place.
    pub fn check(&self) -> Result<(), TaskError> {
        if self.aplanat_grin != VERSION {
            return Err(wrong("aplanat_grin", self.aplanat_grin, VERSION.to_string()));
        }
        extent("field", self.field.size())?;
        self.space.check("space")?;
        self.check_reach()?;
        positive("tolerance", self.tolerance, "a length in mm")?;
        if let Some(tracing) = self.tracing {
            let steps = [0.25, 1000.0];
            within("tracing, per_voxel", tracing.per_voxel, steps, "steps a voxel")?;
        }
        self.check_limits()?;
        self.check_levels()?;
        if self.views.is_empty() {
            return Err(wrong("views", "none", "at least one"));
        }
        for (i, view) in self.views.iter().enumerate() {
            view.check(&format!("views, number {i}"))?;
        }
        if !self.views.iter().any(|view| view.weight > 0.0) {
            return Err(wrong("views", "no weight above 0", "something to search for"));
        }
        self.check_method()?;
        self.exact.iter().try_for_each(|exact| exact.check("exact"))
    }

    /// Refuses a space in which the field has no nodes.
    fn check_reach(&self) -> Result<(), TaskError> {
        let ends =
            self.space.corners().into_iter().flat_map(|corner| [corner.x, corner.y, corner.z]);
        let (reach, half) = (ends.fold(0.0, |most, end| end.abs().max(most)), self.field.size());
        if self.field.is_radial() || reach <= half * (1.0 + ROUNDING) {
            return Ok(());
        }
        let expected = format!("all of it within the {half} mm to each side that the field covers");
        Err(wrong("space", format!("a reach of {} mm", number(reach)), expected))
    }

    fn check_limits(&self) -> Result<(), TaskError> {
        let limits = self.limits;
        if !(limits.low >= 1.0 && limits.low.is_finite()) {
            let expected = "1 or more: light is nowhere faster than in vacuum";
            return Err(wrong("limits, low", number(limits.low), expected));
        }
        if !(limits.high >= limits.low && limits.high.is_finite()) {
            let expected = format!("no less than {}, the smallest index", number(limits.low));
            return Err(wrong("limits, high", number(limits.high), expected));
        }
        positive("limits, change", limits.change, "a change of the index")?;
        let steep = |slope| positive("limits, slope", slope, "a slope of the index, in 1/mm,");
        limits.slope.map_or(Ok(()), steep)?;
        let range = [limits.low, limits.high];
        if let Some(edge) = self.edge {
            within("edge, index", edge.index, range, "an index within the limits,")?;
            weight("edge, weight", edge.weight)?;
            if edge.fixed && !matches!(self.field, FieldKind::Trilinear { .. }) {
                let expected = "a weight: only nodes of a trilinear grid are values of the index";
                return Err(wrong("edge", "fixed", expected));
            }
        }
        match &self.start {
            Start::Uniform(index) => {
                within("start, uniform", *index, range, "an index within the limits,")
            }
            Start::Volume(_) if self.field.is_radial() => {
                Err(wrong("start", "a volume", "a uniform index for a spline in the radius"))
            }
            Start::Volume(_) => Ok(()),
        }
    }

    fn check_levels(&self) -> Result<(), TaskError> {
        let fewest = self.field.fewest();
        if self.levels.is_empty() {
            return Err(wrong("levels", "none", "at least one"));
        }
        for (i, level) in self.levels.iter().enumerate() {
            let place = format!("levels, number {i}");
            if level.nodes < fewest || level.nodes > MANY_NODES {
                let expected = format!("{fewest} to {MANY_NODES} nodes along a side");
                return Err(wrong(format!("{place}, nodes"), level.nodes, expected));
            }
        }
        Ok(())
    }

    fn check_method(&self) -> Result<(), TaskError> {
        let fresh = self.views.iter().any(|view| view.source.is_fresh());
        let most = self.levels.iter().map(|level| self.field.parameters(level.nodes)).max();
        match self.method {
            Method::Adam { rate, fall } => {
                positive("method, adam, rate", rate, "a rate, the index of a step,")?;
                positive("method, adam, fall", fall, "a factor")
            }
            Method::Lbfgs | Method::LeastSquares if fresh => {
                let expected = "rays that stay the same: only adam may see new ones in every step";
                let i = self.views.iter().position(|view| view.source.is_fresh()).unwrap_or(0);
                let part = if self.views[i].source.axis().is_some() { "" } else { ", directions" };
                let place = format!("views, number {i}, source{part}, fresh");
                Err(wrong(place, "new rays in every step", expected))
            }
            Method::LeastSquares if self.views.iter().any(|view| view.goal.is_image()) => {
                Err(wrong("method", "least_squares", "adam or lbfgs for an image"))
            }
            Method::LeastSquares if most > Some(FEW) => {
                let found = format!("{} numbers", most.unwrap_or(0));
                Err(wrong("method", found, format!("at most {FEW} for least_squares; or lbfgs")))
            }
            Method::Lbfgs | Method::LeastSquares => Ok(()),
        }
    }
}

impl Space {
    fn check(self, place: &str) -> Result<(), TaskError> {
        match self {
            Self::Ball { radius: size } | Self::Cube { half: size } => extent(place, size),
            Self::Rod { radius, from, to } => {
                extent(format!("{place}, radius"), radius)?;
                reached(format!("{place}, from"), from, -LONG)?;
                reached(format!("{place}, to"), to, -LONG)?;
                if from < to {
                    return Ok(());
                }
                let expected = "an end beyond the beginning";
                Err(wrong(place, format!("from {from} to {to} mm"), expected))
            }
        }
    }
}

impl View {
    fn check(&self, place: &str) -> Result<(), TaskError> {
        weight(format!("{place}, weight"), self.weight)?;
        self.space.map_or(Ok(()), |space| space.check(&format!("{place}, space")))?;
        self.source.check(&format!("{place}, source"))?;
        let goal = format!("{place}, goal");
        match &self.goal {
            Goal::Point(p) => {
                p.iter().try_for_each(|v| reached(format!("{goal}, point"), *v, -LONG))
            }
            Goal::Antipode if self.source.directions().is_none() => {
                let found = "`antipode` for a source that has no directions";
                Err(wrong(goal, found, "a source of `parallel` light or `points`"))
            }
            Goal::Like { field, direction } => {
                weight(format!("{goal}, direction"), *direction)?;
                field.check(&goal)
            }
            image if image.is_across_a_beam() && self.source.axis().is_none() => {
                let found = format!("`{}` for a source that is no beam", image.name());
                Err(wrong(goal, found, "a source that is a `beam`; or another goal"))
            }
            image if image.is_across_a_beam() => image.check_across(&goal),
            _ => Ok(()),
        }
    }
}

impl Goal {
    /// Whether it is a picture, on a screen or at infinity: its loss has no unit.
    pub fn is_image(&self) -> bool {
        matches!(self, Self::Image { .. } | Self::Far { .. })
    }

    /// What it is called in a task.
    fn name(&self) -> &'static str {
        match self {
            Self::Point(_) => "point",
            Self::Antipode => "antipode",
            Self::Image { .. } => "image",
            Self::Far { .. } => "far",
            Self::Ring { .. } => "ring",
            Self::Like { .. } => "like",
        }
    }

    /// Whether it stands across the direction of a beam.
    fn is_across_a_beam(&self) -> bool {
        self.is_image() || matches!(self, Self::Ring { .. })
    }

    fn check_across(&self, goal: &str) -> Result<(), TaskError> {
        let at = |name: &str| format!("{goal}, {name}");
        match self {
            Self::Image { half, distance, pixels, drawing } => {
                reached(at("distance"), *distance, 0.0)?;
                extent(at("half"), *half)?;
                drawing.check(goal, *pixels)
            }
            Self::Far { angle, pixels, drawing } => {
                within(at("angle"), *angle, [0.1, 80.0], "degrees")?;
                drawing.check(goal, *pixels)
            }
            Self::Ring { radius, distance, angle, far } => {
                extent(at("radius"), *radius)?;
                reached(at("distance"), *distance, 0.0)?;
                within(at("angle"), *angle, [0.0, 80.0], "degrees")?;
                weight(at("far"), *far)
            }
            _ => Ok(()),
        }
    }
}

impl Drawing {
    fn check(&self, goal: &str, pixels: usize) -> Result<(), TaskError> {
        within(format!("{goal}, pixels"), pixels as f64, [4.0, 2048.0], "pixels along a side,")?;
        if let Self::Scene(depth) = self {
            within(format!("{goal}, drawing, scene"), *depth, [0.0, 1.0], "a depth")?;
        }
        let refused = |source| TaskError::Picture { place: format!("{goal}, drawing"), source };
        self.pixels(pixels).map(|_| ()).map_err(refused)
    }
}

impl Source {
    fn check(&self, place: &str) -> Result<(), TaskError> {
        let count = self.count();
        if count == 0 || count > MANY_RAYS {
            let expected = format!("1 to {MANY_RAYS} in all");
            return Err(wrong(place, format!("{count} rays"), expected));
        }
        let directions = format!("{place}, directions");
        if let Some(Directions::Given(list)) = self.directions() {
            list.iter().try_for_each(|d| direction(&directions, *d))?;
        }
        match self {
            Self::Parallel { radius, .. } => extent(format!("{place}, radius"), *radius),
            Self::Points { radius, cone, .. } => {
                extent(format!("{place}, radius"), *radius)?;
                within(format!("{place}, cone"), *cone, [0.0, 89.0], "degrees")
            }
            Self::Fan { height, z, .. } => {
                reached(format!("{place}, z"), *z, -LONG)?;
                extent(format!("{place}, height"), *height)
            }
            Self::Beam { direction: d, half, .. } => {
                direction(&format!("{place}, direction"), *d)?;
                extent(format!("{place}, half"), *half)
            }
        }
    }
}

impl Exact {
    fn check(&self, place: &str) -> Result<(), TaskError> {
        let at = |name: &str| format!("{place}, {name}");
        let index = |place, value| positive(place, value, "an index");
        match self {
            Self::Luneburg { radius } => extent(at("luneburg, radius"), *radius),
            Self::Maxwell { centre, radius } => {
                index(at("maxwell, centre"), *centre)?;
                extent(at("maxwell, radius"), *radius)
            }
            Self::Secant { axis, a } => {
                index(at("secant, axis"), *axis)?;
                positive(at("secant, a"), *a, "a number of 1/mm")
            }
            Self::Parabolic { axis, g } => {
                index(at("parabolic, axis"), *axis)?;
                positive(at("parabolic, g"), *g, "a number of 1/mm")
            }
            Self::Plume { ambient, contrast, half } => {
                extent(at("plume, half"), *half)?;
                let least = ambient.min(ambient + contrast);
                if least >= 1.0 - ROUNDING && (ambient + contrast).is_finite() {
                    return Ok(());
                }
                let found = format!("an index of {}", number(least));
                Err(wrong(at("plume"), found, "1 or more: light is nowhere faster than in vacuum"))
            }
            Self::Volume(_) => Ok(()),
        }
    }
}
