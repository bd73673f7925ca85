//! The faces of a solid of revolution and the circles in which they meet.

use super::entities::{EntityNumber, StepEntities, real};
use super::profile::profile_spline;
use crate::lens::Shape;
use crate::math::Vec3;
use crate::report::body::LensBody;

/// The sense of an edge or a surface, as the standard writes it.
const fn sense(forwards: bool) -> &'static str {
    if forwards { ".T." } else { ".F." }
}

/// A circle about the axis as an edge that begins and ends at one vertex.
#[derive(Debug, Clone, Copy)]
struct RimCircle {
    edge: EntityNumber,
    vertex: EntityNumber,
    start: Vec3<f64>,
}

/// The entities of a body, whose own frame has its axis along z.
struct SolidBuilder<'a> {
    entities: &'a mut StepEntities,
    body: &'a LensBody,
}

/// The closed shell of a body, and the largest distance of a spline from its surface in mm.
pub(super) fn closed_shell(entities: &mut StepEntities, body: &LensBody) -> (EntityNumber, f64) {
    let mut builder = SolidBuilder { entities, body };
    let (mut faces, mut deviation, mut rims) = (Vec::new(), 0.0_f64, Vec::new());
    for side in [0, 1] {
        let (height, rim) = (body.heights[side], body.rim());
        let z = body.z(side, height);
        let inner = builder.circle(z, height);
        let (face, error) = builder.optical_face(side, inner);
        faces.push(face);
        deviation = deviation.max(error);
        let outer = if height < rim { builder.circle(z, rim) } else { inner };
        if height < rim {
            faces.push(builder.ring(side, z, outer, inner));
        }
        rims.push(outer);
    }
    if let [left, right] = rims[..] {
        faces.push(builder.cylinder(left, right));
    }
    let list: Vec<String> = faces.iter().map(ToString::to_string).collect();
    (entities.add(&format!("CLOSED_SHELL('',({}))", list.join(","))), deviation)
}

impl SolidBuilder<'_> {
    fn point(&self, x: f64, z: f64) -> Vec3<f64> {
        self.body.frame.point_out(Vec3::new(x, 0.0, z))
    }

    /// A direction of the body in the plane of its x and z axes.
    fn direction(&self, x: f64, z: f64) -> Vec3<f64> {
        self.body.frame.direction_out(Vec3::new(x, 0.0, z))
    }

    /// A frame on the axis whose axis is that of the body.
    fn on_axis(&mut self, z: f64) -> EntityNumber {
        let (origin, axis, x) =
            (self.point(0.0, z), self.direction(0.0, 1.0), self.direction(1.0, 0.0));
        self.entities.placement(origin, axis, x)
    }

    fn circle(&mut self, z: f64, radius: f64) -> RimCircle {
        let start = self.point(radius, z);
        let frame = self.on_axis(z);
        let curve = self.entities.add(&format!("CIRCLE('',{frame},{})", real(radius)));
        let point = self.entities.point(start);
        let vertex = self.entities.add(&format!("VERTEX_POINT('',{point})"));
        let edge = self.entities.add(&format!("EDGE_CURVE('',{vertex},{vertex},{curve},.T.)"));
        RimCircle { edge, vertex, start }
    }

    /// A loop of edges, each with its sense.
    fn bound(&mut self, outer: bool, edges: &[(EntityNumber, bool)]) -> EntityNumber {
        let oriented: Vec<String> = edges
            .iter()
            .map(|(edge, forwards)| {
                let sense = sense(*forwards);
                self.entities.add(&format!("ORIENTED_EDGE('',*,*,{edge},{sense})")).to_string()
            })
            .collect();
        let list = self.entities.add(&format!("EDGE_LOOP('',({}))", oriented.join(",")));
        let kind = if outer { "FACE_OUTER_BOUND" } else { "FACE_BOUND" };
        self.entities.add(&format!("{kind}('',{list},.T.)"))
    }

    fn face(&mut self, bounds: &[EntityNumber], surface: EntityNumber, same: bool) -> EntityNumber {
        let bounds: Vec<String> = bounds.iter().map(ToString::to_string).collect();
        let same = sense(same);
        self.entities.add(&format!("ADVANCED_FACE('',({}),{surface},{same})", bounds.join(",")))
    }

    /// The face of a surface within its rim. Seen from outside, its rim runs against the clock: about
    /// −z in front and about +z behind. A curved face is cut along a meridian from its vertex to the rim,
    /// as programs for mechanical design have it; then the rim is a line of their coordinates, and exact.
    fn optical_face(&mut self, side: usize, rim: RimCircle) -> (EntityNumber, f64) {
        let around = (rim.edge, side == 1);
        let (surface, meridian, same, deviation) = match self.body.shapes[side] {
            Shape::Plane => {
                let bound = self.bound(true, &[around]);
                let surface = self.plane(side);
                return (self.face(&[bound], surface, side == 1), 0.0);
            }
            Shape::Sphere { curvature } if curvature != 0.0 => {
                let (surface, meridian) = self.sphere(side, curvature);
                (surface, meridian, (curvature > 0.0) == (side == 0), 0.0)
            }
            shape => {
                let (surface, meridian, deviation) = self.revolved(side, &shape);
                // The normal of the surface of revolution points towards −z.
                (surface, meridian, side == 0, deviation)
            }
        };
        let apex = self.point(0.0, self.body.z(side, 0.0));
        let point = self.entities.point(apex);
        let from = self.entities.add(&format!("VERTEX_POINT('',{point})"));
        let to = rim.vertex;
        let seam = self.entities.add(&format!("EDGE_CURVE('',{from},{to},{meridian},.T.)"));
        let bound = self.bound(true, &[around, (seam, false), (seam, true)]);
        (self.face(&[bound], surface, same), deviation)
    }

    fn plane(&mut self, side: usize) -> EntityNumber {
        let frame = self.on_axis(self.body.z(side, 0.0));
        self.entities.add(&format!("PLANE('',{frame})"))
    }

    /// A sphere with a pole at the vertex of the surface, and its meridian from there towards +x.
    fn sphere(&mut self, side: usize, curvature: f64) -> (EntityNumber, EntityNumber) {
        let center = self.point(0.0, self.body.z(side, 0.0) + 1.0 / curvature);
        let (axis, x) = (self.direction(0.0, 1.0), self.direction(1.0, 0.0));
        let radius = real(1.0 / curvature.abs());
        let frame = self.entities.placement(center, axis, x);
        let surface = self.entities.add(&format!("SPHERICAL_SURFACE('',{frame},{radius})"));
        let side = -curvature.signum();
        let to_apex = self.direction(0.0, side);
        let normal = self.body.frame.direction_out(Vec3::new(0.0, side, 0.0));
        let frame = self.entities.placement(center, normal, to_apex);
        (surface, self.entities.add(&format!("CIRCLE('',{frame},{radius})")))
    }

    /// A surface of revolution of a spline, the spline, and its deviation.
    fn revolved(&mut self, side: usize, shape: &Shape<f64>) -> (EntityNumber, EntityNumber, f64) {
        let spline = profile_spline(shape, self.body.heights[side]);
        let vertex = self.body.z(side, 0.0);
        let controls: Vec<String> = spline
            .controls
            .iter()
            .map(|[r, sag]| {
                let point = self.point(*r, vertex + sag);
                self.entities.point(point).to_string()
            })
            .collect();
        let ends = spline.knots.len() - 1;
        let counts: Vec<&str> =
            (0..=ends).map(|i| if i == 0 || i == ends { "4" } else { "2" }).collect();
        let knots: Vec<String> = spline.knots.iter().map(|knot| real(*knot)).collect();
        let curve = self.entities.add(&format!(
            "B_SPLINE_CURVE_WITH_KNOTS('',3,({}),.UNSPECIFIED.,.F.,.F.,({}),({}),.UNSPECIFIED.)",
            controls.join(","),
            counts.join(","),
            knots.join(",")
        ));
        let (origin, along) = (self.point(0.0, vertex), self.direction(0.0, 1.0));
        let (point, axis) = (self.entities.point(origin), self.entities.direction(along));
        let axis = self.entities.add(&format!("AXIS1_PLACEMENT('',{point},{axis})"));
        let surface = self.entities.add(&format!("SURFACE_OF_REVOLUTION('',{curve},{axis})"));
        (surface, curve, spline.deviation)
    }

    /// The flat ring between a surface and the rim.
    fn ring(&mut self, side: usize, z: f64, outer: RimCircle, inner: RimCircle) -> EntityNumber {
        let bounds = [
            self.bound(true, &[(outer.edge, side == 1)]),
            self.bound(false, &[(inner.edge, side == 0)]),
        ];
        let frame = self.on_axis(z);
        let plane = self.entities.add(&format!("PLANE('',{frame})"));
        self.face(&bounds, plane, side == 1)
    }

    /// The cylinder between two circles, cut along a line between their vertices.
    fn cylinder(&mut self, left: RimCircle, right: RimCircle) -> EntityNumber {
        let along = self.direction(0.0, 1.0);
        let (point, direction) = (self.entities.point(left.start), self.entities.direction(along));
        let length = (right.start - left.start).dot(along);
        let vector = self.entities.add(&format!("VECTOR('',{direction},{})", real(length)));
        let line = self.entities.add(&format!("LINE('',{point},{vector})"));
        let (a, b) = (left.vertex, right.vertex);
        let seam = self.entities.add(&format!("EDGE_CURVE('',{a},{b},{line},.T.)"));
        let edges = [(left.edge, true), (seam, true), (right.edge, false), (seam, false)];
        let bound = self.bound(true, &edges);
        let frame = self.on_axis(self.body.z(0, self.body.rim()));
        let radius = real(self.body.rim());
        let surface = self.entities.add(&format!("CYLINDRICAL_SURFACE('',{frame},{radius})"));
        self.face(&[bound], surface, true)
    }
}
