//! Validation of a task before any ray is traced.

use super::checks::{
    INDEX_ROUNDING, MAX_LENGTH, check_direction, check_length, check_position, check_positive,
    check_range, check_weight, invalid,
};
use super::target_image::TargetImage;
use super::{
    Domain, FieldRepresentation, GrinMethod, GrinTask, InitialField, LightGoal, LightSource,
    LightView, ReferenceField, SourceDirections, TASK_VERSION,
};
use crate::grin_design::GrinTaskError;
use crate::math::format_short;

/// The largest number of parameters for which least squares are allowed.
const MAX_LEAST_SQUARES_PARAMETERS: usize = 400;
/// The largest numbers of rays in a step, and of nodes along a side.
const MAX_RAYS: usize = 10_000_000;
const MAX_NODES: usize = 513;

impl GrinTask {
    /// Checks every value of the task, but not the files that it names: see [`Self::read_files`].
    ///
    /// # Errors
    /// The first invalid value, with its position.
    pub fn check(&self) -> Result<(), GrinTaskError> {
        if self.aplanat_grin != TASK_VERSION {
            return Err(invalid("aplanat_grin", self.aplanat_grin, TASK_VERSION.to_string()));
        }
        check_length("field", self.field.size())?;
        self.space.check("space")?;
        self.check_extent()?;
        check_positive("tolerance", self.tolerance, "a length in mm")?;
        if let Some(tracing) = self.tracing {
            let steps = [0.25, 1000.0];
            check_range("tracing, per_voxel", tracing.per_voxel, steps, "steps a voxel")?;
        }
        self.check_limits()?;
        self.check_levels()?;
        if self.views.is_empty() {
            return Err(invalid("views", "none", "at least one"));
        }
        for (i, view) in self.views.iter().enumerate() {
            view.check(&format!("views, number {i}"))?;
        }
        if !self.views.iter().any(|view| view.weight > 0.0) {
            return Err(invalid("views", "no weight above 0", "something to search for"));
        }
        self.check_method()?;
        self.exact.iter().try_for_each(|exact| exact.check("exact"))
    }

    /// Refuses a domain that reaches beyond the nodes of the field.
    fn check_extent(&self) -> Result<(), GrinTaskError> {
        let ends =
            self.space.corners().into_iter().flat_map(|corner| [corner.x, corner.y, corner.z]);
        let (reach, half) = (ends.fold(0.0, |most, end| end.abs().max(most)), self.field.size());
        if self.field.is_radial() || reach <= half * (1.0 + INDEX_ROUNDING) {
            return Ok(());
        }
        let expected = format!("all of it within the {half} mm to each side that the field covers");
        Err(invalid("space", format!("a reach of {} mm", format_short(reach)), expected))
    }

    fn check_limits(&self) -> Result<(), GrinTaskError> {
        let limits = self.limits;
        if !(limits.low >= 1.0 && limits.low.is_finite()) {
            let expected = "1 or more: light is nowhere faster than in vacuum";
            return Err(invalid("limits, low", format_short(limits.low), expected));
        }
        if !(limits.high >= limits.low && limits.high.is_finite()) {
            let expected = format!("no less than {}, the smallest index", format_short(limits.low));
            return Err(invalid("limits, high", format_short(limits.high), expected));
        }
        check_positive("limits, change", limits.change, "a change of the index")?;
        let steep =
            |slope| check_positive("limits, slope", slope, "a slope of the index, in 1/mm,");
        limits.slope.map_or(Ok(()), steep)?;
        let range = [limits.low, limits.high];
        if let Some(edge) = self.edge {
            check_range("edge, index", edge.index, range, "an index within the limits,")?;
            check_weight("edge, weight", edge.weight)?;
            if edge.fixed && !matches!(self.field, FieldRepresentation::Trilinear { .. }) {
                let expected = "a weight: only nodes of a trilinear grid are values of the index";
                return Err(invalid("edge", "fixed", expected));
            }
        }
        match &self.start {
            InitialField::Uniform(index) => {
                check_range("start, uniform", *index, range, "an index within the limits,")
            }
            InitialField::Volume(_) if self.field.is_radial() => {
                Err(invalid("start", "a volume", "a uniform index for a spline in the radius"))
            }
            InitialField::Volume(_) => Ok(()),
        }
    }

    fn check_levels(&self) -> Result<(), GrinTaskError> {
        let fewest = self.field.min_nodes();
        if self.levels.is_empty() {
            return Err(invalid("levels", "none", "at least one"));
        }
        for (i, level) in self.levels.iter().enumerate() {
            let place = format!("levels, number {i}");
            if level.nodes < fewest || level.nodes > MAX_NODES {
                let expected = format!("{fewest} to {MAX_NODES} nodes along a side");
                return Err(invalid(format!("{place}, nodes"), level.nodes, expected));
            }
        }
        Ok(())
    }

    fn check_method(&self) -> Result<(), GrinTaskError> {
        let resampled = self.views.iter().any(|view| view.source.is_resampled());
        let most = self.levels.iter().map(|level| self.field.parameter_count(level.nodes)).max();
        match self.method {
            GrinMethod::Adam { rate, fall } => {
                check_positive("method, adam, rate", rate, "a rate, the index of a step,")?;
                check_positive("method, adam, fall", fall, "a factor")
            }
            GrinMethod::Lbfgs | GrinMethod::LeastSquares if resampled => {
                let expected = "rays that stay the same: only adam may see new ones in every step";
                let i = self.views.iter().position(|view| view.source.is_resampled()).unwrap_or(0);
                let part = if self.views[i].source.axis().is_some() { "" } else { ", directions" };
                let place = format!("views, number {i}, source{part}, fresh");
                Err(invalid(place, "new rays in every step", expected))
            }
            GrinMethod::LeastSquares if self.views.iter().any(|view| view.goal.is_image()) => {
                Err(invalid("method", "least_squares", "adam or lbfgs for an image"))
            }
            GrinMethod::LeastSquares if most > Some(MAX_LEAST_SQUARES_PARAMETERS) => {
                let found = format!("{} numbers", most.unwrap_or(0));
                Err(invalid(
                    "method",
                    found,
                    format!("at most {MAX_LEAST_SQUARES_PARAMETERS} for least_squares; or lbfgs"),
                ))
            }
            GrinMethod::Lbfgs | GrinMethod::LeastSquares => Ok(()),
        }
    }
}

impl Domain {
    fn check(self, place: &str) -> Result<(), GrinTaskError> {
        match self {
            Self::Ball { radius: size } | Self::Cube { half: size } => check_length(place, size),
            Self::Rod { radius, from, to } => {
                check_length(format!("{place}, radius"), radius)?;
                check_position(format!("{place}, from"), from, -MAX_LENGTH)?;
                check_position(format!("{place}, to"), to, -MAX_LENGTH)?;
                if from < to {
                    return Ok(());
                }
                let expected = "an end beyond the beginning";
                Err(invalid(place, format!("from {from} to {to} mm"), expected))
            }
        }
    }
}

impl LightView {
    fn check(&self, place: &str) -> Result<(), GrinTaskError> {
        check_weight(format!("{place}, weight"), self.weight)?;
        self.space.map_or(Ok(()), |space| space.check(&format!("{place}, space")))?;
        self.source.check(&format!("{place}, source"))?;
        let goal = format!("{place}, goal");
        match &self.goal {
            LightGoal::Point(p) => {
                p.iter().try_for_each(|v| check_position(format!("{goal}, point"), *v, -MAX_LENGTH))
            }
            LightGoal::Antipode if self.source.directions().is_none() => {
                let found = "`antipode` for a source that has no directions";
                Err(invalid(goal, found, "a source of `parallel` light or `points`"))
            }
            LightGoal::Like { field, direction } => {
                check_weight(format!("{goal}, direction"), *direction)?;
                field.check(&goal)
            }
            image if image.is_across_a_beam() && self.source.axis().is_none() => {
                let found = format!("`{}` for a source that is no beam", image.name());
                Err(invalid(goal, found, "a source that is a `beam`; or another goal"))
            }
            image if image.is_across_a_beam() => image.check_across(&goal),
            _ => Ok(()),
        }
    }
}

impl LightGoal {
    /// True if the goal is an image, on a screen or at infinity: its loss has no unit.
    pub fn is_image(&self) -> bool {
        matches!(self, Self::Image { .. } | Self::Far { .. })
    }

    /// The name in a task file.
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

    /// True if the goal is defined with respect to the direction of a beam.
    fn is_across_a_beam(&self) -> bool {
        self.is_image() || matches!(self, Self::Ring { .. })
    }

    fn check_across(&self, goal: &str) -> Result<(), GrinTaskError> {
        let at = |name: &str| format!("{goal}, {name}");
        match self {
            Self::Image { half, distance, pixels, drawing } => {
                check_position(at("distance"), *distance, 0.0)?;
                check_length(at("half"), *half)?;
                drawing.check(goal, *pixels)
            }
            Self::Far { angle, pixels, drawing } => {
                check_range(at("angle"), *angle, [0.1, 80.0], "degrees")?;
                drawing.check(goal, *pixels)
            }
            Self::Ring { radius, distance, angle, far } => {
                check_length(at("radius"), *radius)?;
                check_position(at("distance"), *distance, 0.0)?;
                check_range(at("angle"), *angle, [0.0, 80.0], "degrees")?;
                check_weight(at("far"), *far)
            }
            _ => Ok(()),
        }
    }
}

impl TargetImage {
    fn check(&self, goal: &str, pixels: usize) -> Result<(), GrinTaskError> {
        check_range(
            format!("{goal}, pixels"),
            pixels as f64,
            [4.0, 2048.0],
            "pixels along a side,",
        )?;
        if let Self::Scene(depth) = self {
            check_range(format!("{goal}, drawing, scene"), *depth, [0.0, 1.0], "a depth")?;
        }
        Ok(())
    }
}

impl LightSource {
    fn check(&self, place: &str) -> Result<(), GrinTaskError> {
        let count = self.count();
        if count == 0 || count > MAX_RAYS {
            let expected = format!("1 to {MAX_RAYS} in all");
            return Err(invalid(place, format!("{count} rays"), expected));
        }
        let directions = format!("{place}, directions");
        if let Some(SourceDirections::Given(list)) = self.directions() {
            list.iter().try_for_each(|d| check_direction(&directions, *d))?;
        }
        match self {
            Self::Parallel { radius, .. } => check_length(format!("{place}, radius"), *radius),
            Self::Points { radius, cone, .. } => {
                check_length(format!("{place}, radius"), *radius)?;
                check_range(format!("{place}, cone"), *cone, [0.0, 89.0], "degrees")
            }
            Self::Fan { height, z, .. } => {
                check_position(format!("{place}, z"), *z, -MAX_LENGTH)?;
                check_length(format!("{place}, height"), *height)
            }
            Self::Beam { direction: d, half, .. } => {
                check_direction(&format!("{place}, direction"), *d)?;
                check_length(format!("{place}, half"), *half)
            }
        }
    }
}

impl ReferenceField {
    fn check(&self, place: &str) -> Result<(), GrinTaskError> {
        let at = |name: &str| format!("{place}, {name}");
        let index = |place, value| check_positive(place, value, "an index");
        match self {
            Self::Luneburg { radius } => check_length(at("luneburg, radius"), *radius),
            Self::Maxwell { centre, radius } => {
                index(at("maxwell, centre"), *centre)?;
                check_length(at("maxwell, radius"), *radius)
            }
            Self::Secant { axis, a } => {
                index(at("secant, axis"), *axis)?;
                check_positive(at("secant, a"), *a, "a number of 1/mm")
            }
            Self::Parabolic { axis, g } => {
                index(at("parabolic, axis"), *axis)?;
                check_positive(at("parabolic, g"), *g, "a number of 1/mm")
            }
            Self::Plume { ambient, contrast, half } => {
                check_length(at("plume, half"), *half)?;
                let least = ambient.min(ambient + contrast);
                if least >= 1.0 - INDEX_ROUNDING && (ambient + contrast).is_finite() {
                    return Ok(());
                }
                let found = format!("an index of {}", format_short(least));
                Err(invalid(
                    at("plume"),
                    found,
                    "1 or more: light is nowhere faster than in vacuum",
                ))
            }
            Self::Volume(_) => Ok(()),
        }
    }
}
