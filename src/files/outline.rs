//! Outlines of apertures and obscurations of foreign files, and the circles that stand for them here.
//!
//! A surface here has a circular rim about its vertex. A circle beside the vertex is exact on a plane, whose
//! vertex moves with it. Of any other aperture the circle about the vertex that contains it is used, so that
//! no light is lost that the file lets through; of an obscuration the largest circle inside.

use super::report::ConversionOutcome;
use crate::lens::Row;

/// The form of an outline.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum OutlineForm {
    Circle,
    Rectangle,
    Ellipse,
}

/// The outline of an aperture or an obscuration.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct ForeignOutline {
    pub(super) form: OutlineForm,
    /// The half widths along x and y.
    pub(super) half: [f64; 2],
    /// The place of its centre beside the vertex.
    pub(super) offset: [f64; 2],
    /// True if it is turned about its centre by an angle.
    pub(super) turned: bool,
}

/// The circle that stands for an outline, and what the report says of it.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct StandIn {
    /// The radius; `None` if nothing stands for it.
    pub(super) radius: Option<f64>,
    /// True if the plane moves to the centre of the outline.
    pub(super) moves: bool,
    pub(super) outcome: ConversionOutcome,
    pub(super) note: String,
}

impl ForeignOutline {
    fn distance(&self) -> f64 {
        self.offset[0].hypot(self.offset[1])
    }

    fn is_circle(&self) -> bool {
        let round = self.form != OutlineForm::Rectangle && self.half[0] == self.half[1];
        round || self.form == OutlineForm::Circle
    }

    /// The circle of an aperture. `plane` is true for a plane that can move.
    pub(super) fn aperture(&self, plane: bool) -> StandIn {
        self.exact(plane).unwrap_or_else(|| {
            let radius = self.circumscribed();
            let note = format!(
                "{}: the circle of {radius} about the vertex stands for it, which contains it",
                self.text()
            );
            let outcome = ConversionOutcome::Approximated;
            StandIn { radius: Some(radius), moves: false, outcome, note }
        })
    }

    /// The circle of an obscuration.
    pub(super) fn obscuration(&self, plane: bool) -> StandIn {
        self.exact(plane).unwrap_or_else(|| {
            let radius = self.inscribed();
            if !(radius > 0.0) {
                let note = format!("{}: the vertex is outside of it", self.text());
                let outcome = ConversionOutcome::Dropped;
                return StandIn { radius: None, moves: false, outcome, note };
            }
            let note = format!(
                "{}: the circle of {radius} about the vertex stands for it, which it contains",
                self.text()
            );
            let outcome = ConversionOutcome::Approximated;
            StandIn { radius: Some(radius), moves: false, outcome, note }
        })
    }

    /// The outline itself, if a surface here can have it.
    fn exact(&self, plane: bool) -> Option<StandIn> {
        let moves = self.offset != [0.0; 2];
        if !self.is_circle() || moves && !plane {
            return None;
        }
        let note = if moves { "the plane is displaced with it" } else { "" };
        let (radius, outcome) = (Some(self.half[0]), ConversionOutcome::Used);
        Some(StandIn { radius, moves, outcome, note: note.to_owned() })
    }

    /// The radius of a circle about the vertex that contains the outline: the smallest one, except for an
    /// ellipse beside the vertex.
    fn circumscribed(&self) -> f64 {
        let [x, y] = self.half;
        match self.form {
            OutlineForm::Rectangle if self.turned => self.distance() + x.hypot(y),
            OutlineForm::Rectangle => (self.offset[0].abs() + x).hypot(self.offset[1].abs() + y),
            OutlineForm::Circle | OutlineForm::Ellipse => self.distance() + x.max(y),
        }
    }

    /// The radius of a circle about the vertex inside the outline; not positive if there is none.
    fn inscribed(&self) -> f64 {
        let [x, y] = self.half;
        match self.form {
            OutlineForm::Rectangle if self.turned => x.min(y) - self.distance(),
            OutlineForm::Rectangle => (x - self.offset[0].abs()).min(y - self.offset[1].abs()),
            OutlineForm::Circle | OutlineForm::Ellipse => x.min(y) - self.distance(),
        }
    }

    fn text(&self) -> String {
        let [x, y] = self.half;
        let form = match self.form {
            OutlineForm::Circle => format!("a circle of {x}"),
            OutlineForm::Rectangle => format!("a rectangle of half widths {x} and {y}"),
            OutlineForm::Ellipse => format!("an ellipse of semi-axes {x} and {y}"),
        };
        match self.offset {
            _ if self.turned => format!("{form}, turned about its centre"),
            [0.0, 0.0] => form,
            [dx, dy] => format!("{form} at ({dx}, {dy})"),
        }
    }
}

/// True for a plane on which an outline can move: nothing else is displaced with it.
pub(super) fn is_free_plane(row: &Row) -> bool {
    let flat = row.curvature == 0.0
        && row.asphere.iter().all(|a| *a == 0.0)
        && row.freeform.is_none()
        && row.ideal.is_none()
        && row.locked.is_none();
    let centred = row.decenter == [0.0; 2]
        && row.tilt == [0.0; 2]
        && row.break_before.is_none()
        && row.break_after.is_none();
    flat && centred
}

#[cfg(test)]
mod tests {
    use super::*;

    fn outline(form: OutlineForm, half: [f64; 2], offset: [f64; 2]) -> ForeignOutline {
        ForeignOutline { form, half, offset, turned: false }
    }

    /// Points of an outline, or near its edge inside.
    fn edge(outline: &ForeignOutline) -> Vec<[f64; 2]> {
        let [hx, hy] = outline.half;
        let [dx, dy] = outline.offset;
        let point = |i: usize| {
            let (sin, cos) = (i as f64 * 0.01).sin_cos();
            let scale = match outline.form {
                OutlineForm::Rectangle => 1.0 / cos.abs().max(sin.abs()),
                OutlineForm::Circle | OutlineForm::Ellipse => 1.0,
            };
            [dx + hx * cos * scale, dy + hy * sin * scale]
        };
        (0..629).map(point).collect()
    }

    #[test]
    fn circles_contain_apertures_and_are_contained_in_obscurations() {
        for form in [OutlineForm::Rectangle, OutlineForm::Ellipse, OutlineForm::Circle] {
            for offset in [[0.0, 0.0], [0.5, -0.25]] {
                let half = if form == OutlineForm::Circle { [3.0; 2] } else { [3.0, 2.0] };
                let own = outline(form, half, offset);
                let distances: Vec<f64> = edge(&own).iter().map(|[x, y]| x.hypot(*y)).collect();
                let (outer, inner) = (own.circumscribed(), own.inscribed());
                assert!(distances.iter().all(|d| *d <= outer * (1.0 + 1e-12)), "{own:?}");
                assert!(distances.iter().all(|d| *d >= inner * (1.0 - 1e-12)), "{own:?}");
            }
        }
    }

    #[test]
    fn circles_hold_for_outlines_that_are_turned() {
        let half = [3.0, 2.0];
        for offset in [[0.0, 0.0], [0.5, -0.25]] {
            let plain = outline(OutlineForm::Rectangle, half, offset);
            let turned = ForeignOutline { turned: true, ..plain };
            for angle in [0.3_f64, 1.0, 2.5] {
                let (sin, cos) = angle.sin_cos();
                for [x, y] in edge(&plain) {
                    let (u, v) = (x - offset[0], y - offset[1]);
                    let distance =
                        (offset[0] + u * cos - v * sin).hypot(offset[1] + u * sin + v * cos);
                    assert!(distance <= turned.circumscribed() * (1.0 + 1e-12));
                    assert!(distance >= turned.inscribed() * (1.0 - 1e-12));
                }
            }
        }
    }

    #[test]
    fn circles_are_exact_about_the_vertex_and_on_planes() {
        let beside = outline(OutlineForm::Circle, [2.0; 2], [1.0, 0.0]);
        assert_eq!((beside.aperture(true).radius, beside.aperture(true).moves), (Some(2.0), true));
        assert_eq!(beside.aperture(true).outcome, ConversionOutcome::Used);
        assert_eq!(beside.aperture(false).radius, Some(3.0));
        assert_eq!(beside.obscuration(false).radius, Some(1.0));
        let round = outline(OutlineForm::Ellipse, [2.0; 2], [0.0; 2]);
        assert_eq!(round.aperture(false).outcome, ConversionOutcome::Used);
        let far = outline(OutlineForm::Circle, [2.0; 2], [5.0, 0.0]);
        assert_eq!(far.obscuration(false).outcome, ConversionOutcome::Dropped);
    }
}
