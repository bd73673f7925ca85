//! Apertures that are no circles about the vertex, as smooth limits of rays.
//!
//! The edge of an aperture is split into sides, each the zero of a smooth margin: a straight line, whose
//! margin is the distance from it in mm, or an oval. A convex frame is an intersection of sides and every one
//! of them is a limit of its own. An obscuration is a union: a ray passes if it is outside of one side, and
//! the limit is the side that it is farthest outside of, or least far inside. Of a polygon that is not convex
//! the limit is the nearest side. Near an edge, and away from its corners, all of these are the margin of one
//! side, which is what root finders and derivatives use.

use super::Tracer;
use super::adjoint::SurfaceGradient;
use super::margin::RayLimit;
use crate::lens::{APERTURE_NUMBERS, ApertureShape, Surface, SurfaceAperture, turn};
use crate::math::{Real, Vec3};

/// The apertures of the surfaces of a lens.
#[derive(Debug, Clone, Default)]
pub(super) struct LensApertures<R> {
    /// Those of each surface; empty for a lens without any.
    sets: Vec<Option<ApertureSet<R>>>,
    /// True if they clip nothing, but have margins.
    open: bool,
}

impl<R: Real> LensApertures<R> {
    pub(super) fn new(surfaces: &[Surface<R>]) -> Self {
        let set = |surface: &Surface<R>| {
            (!surface.apertures.is_empty()).then(|| ApertureSet::new(&surface.apertures))
        };
        let has_some = surfaces.iter().any(|surface| !surface.apertures.is_empty());
        let sets = if has_some { surfaces.iter().map(set).collect() } else { Vec::new() };
        Self { sets, open: false }
    }

    /// True if no surface has any.
    #[inline(always)]
    pub(super) fn is_empty(&self) -> bool {
        self.sets.is_empty()
    }

    /// Those of a surface, whether they clip or not.
    #[inline(always)]
    pub(super) fn of(&self, surface: usize) -> Option<&ApertureSet<R>> {
        self.sets.get(surface)?.as_ref()
    }

    /// Those of a surface that clip.
    #[inline(always)]
    pub(super) fn clipping(&self, surface: usize) -> Option<&ApertureSet<R>> {
        if self.open { None } else { self.of(surface) }
    }

    /// The same, so that they clip nothing.
    pub(super) fn opened(self) -> Self {
        Self { open: true, ..self }
    }

    /// Those of the first surfaces.
    pub(super) fn first(&self, count: usize) -> Self {
        Self { sets: self.sets.iter().take(count).cloned().collect(), open: self.open }
    }
}

/// The apertures of one surface.
#[derive(Debug, Clone)]
pub(super) struct ApertureSet<R> {
    /// All sides, those of each aperture together.
    sides: Vec<Side<R>>,
    groups: Vec<SideGroup>,
}

/// The sides of an aperture, or of one arm of a spider.
#[derive(Debug, Clone)]
struct SideGroup {
    first: usize,
    count: usize,
    rule: GroupRule,
}

/// The rule by which sides make a aperture.
#[derive(Debug, Clone)]
enum GroupRule {
    /// A ray passes if it is inside of every side.
    Frame,
    /// A ray passes if it is outside of one side.
    Obscuration,
    /// A polygon that is not convex, by its corners on the surface.
    Polygon { corners: Vec<[f64; 2]>, obscures: bool },
}

/// A side of an aperture.
#[derive(Debug, Clone, Copy)]
struct Side<R> {
    form: SideForm<R>,
    /// The index of the aperture on the surface.
    aperture: usize,
    center: [R; 2],
    /// True if light passes outside.
    obscures: bool,
}

#[derive(Debug, Clone, Copy)]
enum SideForm<R> {
    /// The margin inside is `offset − normal·p`, in mm.
    Line {
        normal: [R; 2],
        offset: R,
        /// The derivatives of the margin by the two sizes of the aperture.
        by_size: [R; 2],
    },
    /// The margin inside is `(1 − (u/a)² − (v/b)²)` times half of the shorter semi-axis, in mm: near the edge
    /// the distance from it.
    Oval {
        /// Cosine and sine of the angle of the first semi-axis.
        axis: [R; 2],
        semi_axes: [R; 2],
        /// True for a circle, whose radius is one number.
        is_circle: bool,
    },
    /// A circle, an ellipse or a rectangle without an area, inside of which is nothing.
    Point,
}

impl<R: Real> ApertureSet<R> {
    fn new(apertures: &[SurfaceAperture]) -> Self {
        let mut set = Self { sides: Vec::new(), groups: Vec::new() };
        for (index, aperture) in apertures.iter().enumerate() {
            set.add(index, aperture);
        }
        set
    }

    fn add(&mut self, index: usize, aperture: &SurfaceAperture) {
        let oval = |semi_axes: [f64; 2], is_circle: bool| {
            let (sin, cos) = turn(aperture.angle);
            if semi_axes[0] * semi_axes[1] > 0.0 {
                let (axis, semi_axes) = ([cos, sin].map(R::from_f64), semi_axes.map(R::from_f64));
                SideForm::Oval { axis, semi_axes, is_circle }
            } else {
                SideForm::Point
            }
        };
        match &aperture.shape {
            ApertureShape::Circle { radius } => {
                self.push(index, aperture, vec![oval([*radius; 2], true)], None);
            }
            ApertureShape::Ellipse { half_width, half_height } => {
                self.push(index, aperture, vec![oval([*half_width, *half_height], false)], None);
            }
            ApertureShape::Rectangle { half_width: a, half_height: b } if *a * *b == 0.0 => {
                self.push(index, aperture, vec![SideForm::Point], None);
            }
            ApertureShape::Rectangle { half_width: a, half_height: b } => {
                let right = line(aperture, [1.0, 0.0], [*a, 0.0], [1.0, 0.0]);
                let upper = line(aperture, [0.0, 1.0], [0.0, *b], [0.0, 1.0]);
                let left = line(aperture, [-1.0, 0.0], [-*a, 0.0], [1.0, 0.0]);
                let lower = line(aperture, [0.0, -1.0], [0.0, -*b], [0.0, 1.0]);
                self.push(index, aperture, vec![right, upper, left, lower], None);
            }
            ApertureShape::Polygon { points } => self.add_polygon(index, aperture, points),
            ApertureShape::Spider { arms, width } => {
                for arm in 0..*arms {
                    let angle = aperture.angle + 360.0 * arm as f64 / *arms as f64;
                    let turned = SurfaceAperture { angle, ..aperture.clone() };
                    let half = 0.5 * width;
                    let left = line(&turned, [0.0, 1.0], [0.0, half], [0.5, 0.0]);
                    let right = line(&turned, [0.0, -1.0], [0.0, -half], [0.5, 0.0]);
                    let root = line(&turned, [-1.0, 0.0], [0.0, 0.0], [0.0, 0.0]);
                    self.push(index, aperture, vec![left, right, root], None);
                }
            }
        }
    }

    fn add_polygon(&mut self, index: usize, aperture: &SurfaceAperture, points: &[[f64; 2]]) {
        let count = points.len();
        let edge = |i: usize| {
            let (p, q) = (points[i], points[(i + 1) % count]);
            [q[0] - p[0], q[1] - p[1]]
        };
        let cross = |a: [f64; 2], b: [f64; 2]| a[0] * b[1] - a[1] * b[0];
        let area: f64 = (0..count).map(|i| cross(points[i], points[(i + 1) % count])).sum();
        let sense = if area < 0.0 { -1.0 } else { 1.0 };
        let outward = |i: usize| {
            let [x, y] = edge(i);
            let length = x.hypot(y);
            line(aperture, [sense * y / length, -sense * x / length], points[i], [0.0; 2])
        };
        let is_convex = (0..count).all(|i| sense * cross(edge(i), edge((i + 1) % count)) >= 0.0);
        let sides = (0..count).map(outward).collect();
        let corners = (!is_convex).then(|| points.iter().map(|p| aperture.place(*p)).collect());
        self.push(index, aperture, sides, corners);
    }

    fn push(
        &mut self,
        index: usize,
        aperture: &SurfaceAperture,
        forms: Vec<SideForm<R>>,
        corners: Option<Vec<[f64; 2]>>,
    ) {
        let obscures = aperture.obscures();
        let rule = match corners {
            Some(corners) => GroupRule::Polygon { corners, obscures },
            None if obscures => GroupRule::Obscuration,
            None => GroupRule::Frame,
        };
        self.groups.push(SideGroup { first: self.sides.len(), count: forms.len(), rule });
        let center = aperture.center.map(R::from_f64);
        let side = |form| Side { form, aperture: index, center, obscures };
        self.sides.extend(forms.into_iter().map(side));
    }

    /// The number of sides of all apertures.
    pub(super) fn sides(&self) -> usize {
        self.sides.len()
    }

    /// A length in mm of the order of the distances of sides from the vertex.
    pub(super) fn extent(&self) -> f64 {
        let of_side = |side: &Side<R>| match side.form {
            SideForm::Line { offset, .. } => offset.value().abs(),
            SideForm::Oval { semi_axes: [a, b], .. } => a.value().max(b.value()),
            SideForm::Point => 0.0,
        };
        let largest = self.sides.iter().map(of_side).fold(0.0, f64::max);
        if largest > 0.0 { largest } else { 1.0 }
    }

    /// The name of the limit at a side.
    fn limit(&self, side: usize) -> RayLimit {
        let number = u16::try_from(side).unwrap_or(u16::MAX);
        if self.sides[side].obscures {
            RayLimit::Obscuration(number)
        } else {
            RayLimit::Aperture(number)
        }
    }

    /// Visits the limits with their margins at a point of the surface: positive for a ray that passes.
    #[inline(always)]
    pub(super) fn visit(&self, p: Vec3<R>, mut visit: impl FnMut(RayLimit, R)) {
        for group in &self.groups {
            let all = group.first..group.first + group.count;
            match &group.rule {
                GroupRule::Frame => {
                    all.for_each(|side| visit(self.limit(side), self.sides[side].margin(p)));
                }
                GroupRule::Obscuration => {
                    let (side, margin) = self.farthest_outside(group, p);
                    visit(self.limit(side), margin);
                }
                GroupRule::Polygon { corners, obscures } => {
                    let (side, distance, inside) = nearest_side(corners, p);
                    let margin = if inside == *obscures { -distance } else { distance };
                    visit(self.limit(group.first + side), margin);
                }
            }
        }
    }

    /// True if a ray passes all apertures at a point of the surface.
    #[inline(always)]
    pub(super) fn passes(&self, p: Vec3<R>) -> bool {
        let mut passes = true;
        self.visit(p, |_, margin| passes &= margin >= R::ZERO);
        passes
    }

    /// The side of an obscuration with the largest margin.
    #[inline(always)]
    fn farthest_outside(&self, group: &SideGroup, p: Vec3<R>) -> (usize, R) {
        let mut best = (group.first, self.sides[group.first].margin(p));
        for side in group.first + 1..group.first + group.count {
            let margin = self.sides[side].margin(p);
            if margin > best.1 {
                best = (side, margin);
            }
        }
        best
    }

    /// The margin of one side.
    #[inline(always)]
    pub(super) fn margin(&self, side: u16, p: Vec3<R>) -> R {
        self.sides.get(usize::from(side)).map_or(R::ONE, |side| side.margin(p))
    }

    /// The derivatives of the margin of a side by x and y of the point.
    pub(super) fn by_point(&self, side: u16, p: Vec3<R>) -> [R; 2] {
        self.sides.get(usize::from(side)).map_or([R::ZERO; 2], |side| side.by_point(p))
    }

    /// The same apertures over another number type.
    pub(super) fn map<S: Real>(&self, f: impl Fn(R) -> S) -> ApertureSet<S> {
        let sides = self.sides.iter().map(|side| side.map(&f)).collect();
        ApertureSet { sides, groups: self.groups.clone() }
    }

    /// The derivatives of the margin of a side by the numbers of its aperture
    /// ([`SurfaceAperture::numbers`]), with the number of the first of these on the surface.
    pub(super) fn by_numbers(&self, side: u16, p: Vec3<R>) -> (usize, [R; APERTURE_NUMBERS]) {
        let Some(side) = self.sides.get(usize::from(side)) else { return (0, [R::ZERO; 5]) };
        (APERTURE_NUMBERS * side.aperture, side.by_numbers(p))
    }
}

/// The side of an aperture along a line, given by its outward normal, a point of it and the derivatives of
/// its margin by the sizes, all before the aperture is turned.
fn line<R: Real>(
    aperture: &SurfaceAperture,
    normal: [f64; 2],
    point: [f64; 2],
    by_size: [f64; 2],
) -> SideForm<R> {
    let (sin, cos) = turn(aperture.angle);
    let normal = [normal[0] * cos - normal[1] * sin, normal[0] * sin + normal[1] * cos];
    let [x, y] = aperture.place(point);
    let offset = R::from_f64(normal[0] * x + normal[1] * y);
    SideForm::Line { normal: normal.map(R::from_f64), offset, by_size: by_size.map(R::from_f64) }
}

impl ApertureSet<f64> {
    /// Adds the derivatives of the margin of a side by the numbers of its aperture, times a weight, to
    /// those by the numbers of the surface.
    pub(super) fn add_slopes(
        &self,
        side: u16,
        p: Vec3<f64>,
        weight: f64,
        total: &mut SurfaceGradient<f64>,
    ) {
        if weight == 0.0 {
            return;
        }
        let (first, by) = self.by_numbers(side, p);
        for (number, by) in by.into_iter().enumerate() {
            *total.aperture_mut(first + number) += weight * by;
        }
    }
}

impl<R: Real> Side<R> {
    fn map<S: Real>(&self, f: impl Fn(R) -> S) -> Side<S> {
        let form = match self.form {
            SideForm::Line { normal, offset, by_size } => SideForm::Line {
                normal: normal.map(&f),
                offset: f(offset),
                by_size: by_size.map(&f),
            },
            SideForm::Oval { axis, semi_axes, is_circle } => {
                SideForm::Oval { axis: axis.map(&f), semi_axes: semi_axes.map(&f), is_circle }
            }
            SideForm::Point => SideForm::Point,
        };
        let Self { aperture, obscures, .. } = *self;
        Side { form, aperture, center: self.center.map(f), obscures }
    }

    /// The margin, positive on the side on which light passes.
    #[inline(always)]
    fn margin(&self, p: Vec3<R>) -> R {
        let inside = match self.form {
            SideForm::Line { normal, offset, .. } => offset - (normal[0] * p.x + normal[1] * p.y),
            SideForm::Oval { axis, semi_axes: [a, b], .. } => {
                let [u, v] = self.along([p.x, p.y], axis);
                let (u, v) = (u / a, v / b);
                half_shorter(a, b) * (R::ONE - u * u - v * v)
            }
            SideForm::Point => {
                let (x, y) = (p.x - self.center[0], p.y - self.center[1]);
                -(x * x + y * y)
            }
        };
        if self.obscures { -inside } else { inside }
    }

    /// The coordinates of a point along the axes of an oval.
    #[inline(always)]
    fn along(&self, p: [R; 2], [cos, sin]: [R; 2]) -> [R; 2] {
        let (x, y) = (p[0] - self.center[0], p[1] - self.center[1]);
        [cos * x + sin * y, cos * y - sin * x]
    }

    fn by_point(&self, p: Vec3<R>) -> [R; 2] {
        let inside = match self.form {
            SideForm::Line { normal: [x, y], .. } => [-x, -y],
            SideForm::Oval { axis: [cos, sin], semi_axes: [a, b], .. } => {
                let [u, v] = self.along([p.x, p.y], [cos, sin]);
                let scale = -(half_shorter(a, b) * R::TWO);
                let (u, v) = (scale * u / (a * a), scale * v / (b * b));
                [cos * u - sin * v, sin * u + cos * v]
            }
            SideForm::Point => {
                let (x, y) = (p.x - self.center[0], p.y - self.center[1]);
                [-(x + x), -(y + y)]
            }
        };
        if self.obscures { inside.map(|by| -by) } else { inside }
    }

    /// The derivatives by two sizes, the centre and the angle in degrees. A shift of the aperture is the
    /// opposite shift of the point, a turn of it the opposite turn.
    fn by_numbers(&self, p: Vec3<R>) -> [R; APERTURE_NUMBERS] {
        let sizes = match self.form {
            SideForm::Line { by_size, .. } => by_size,
            SideForm::Oval { axis, semi_axes: [a, b], is_circle } => {
                let [u, v] = self.along([p.x, p.y], axis);
                // The factor in front is held: it does not move the edge.
                let scale = half_shorter(a, b) * R::TWO;
                let by = [scale * u * u / (a * a * a), scale * v * v / (b * b * b)];
                if is_circle { [by[0] + by[1], R::ZERO] } else { by }
            }
            SideForm::Point => [R::ZERO; 2],
        };
        let sizes = if self.obscures { sizes.map(|by| -by) } else { sizes };
        let [x, y] = self.by_point(p);
        let (u, v) = (p.x - self.center[0], p.y - self.center[1]);
        let degree = R::from_f64(1f64.to_radians());
        [sizes[0], sizes[1], -x, -y, (x * v - y * u) * degree]
    }
}

/// Half of the shorter one of two semi-axes.
#[inline(always)]
fn half_shorter<R: Real>(a: R, b: R) -> R {
    R::from_f64(0.5 * a.value().min(b.value()))
}

/// The side of a polygon that is nearest to a point, the distance from it, and true if the point is inside.
fn nearest_side<R: Real>(corners: &[[f64; 2]], p: Vec3<R>) -> (usize, R, bool) {
    let (x, y) = (p.x.value(), p.y.value());
    let (mut best, mut nearest, mut inside) = (0, f64::INFINITY, false);
    for (i, a) in corners.iter().enumerate() {
        let b = &corners[(i + 1) % corners.len()];
        let edge = [b[0] - a[0], b[1] - a[1]];
        let share =
            ((x - a[0]) * edge[0] + (y - a[1]) * edge[1]) / (edge[0].powi(2) + edge[1].powi(2));
        let share = share.clamp(0.0, 1.0);
        let distance = (x - a[0] - share * edge[0]).hypot(y - a[1] - share * edge[1]);
        if distance < nearest {
            (best, nearest) = (i, distance);
        }
        let crosses = (a[1] > y) != (b[1] > y);
        if crosses && x < a[0] + (y - a[1]) * edge[0] / edge[1] {
            inside = !inside;
        }
    }
    let (a, b) = (corners[best], corners[(best + 1) % corners.len()]);
    let edge = [b[0] - a[0], b[1] - a[1]].map(R::from_f64);
    let (u, v) = (p.x - R::from_f64(a[0]), p.y - R::from_f64(a[1]));
    let share = (u * edge[0] + v * edge[1]) / (edge[0] * edge[0] + edge[1] * edge[1]);
    let share = R::select(share < R::ZERO, R::ZERO, R::select(share > R::ONE, R::ONE, share));
    let (u, v) = (u - share * edge[0], v - share * edge[1]);
    ((best), (u * u + v * v).sqrt(), inside)
}

impl Tracer<f64> {
    /// True if light passes the apertures of a surface that are no circles about its vertex at a point of it,
    /// in its own frame in mm; its rim and its obstruction are not asked.
    pub fn passes_apertures(&self, surface: usize, [x, y]: [f64; 2]) -> bool {
        !self.is_outside_apertures(surface, Vec3::new(x, y, 0.0))
    }

    /// The number of sides of all apertures that are no circles about a vertex.
    pub fn aperture_sides(&self) -> usize {
        self.apertures.sets.iter().flatten().map(|set| set.sides.len()).sum()
    }
}

impl<R: Real> Tracer<R> {
    /// True if an aperture of a surface clips a ray that meets it at a point.
    #[inline(always)]
    pub(super) fn is_outside_apertures(&self, surface: usize, p: Vec3<R>) -> bool {
        self.apertures.clipping(surface).is_some_and(|set| !set.passes(p))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::lens::BlockedSide;

    fn point(x: f64, y: f64) -> Vec3<f64> {
        Vec3::new(x, y, 0.0)
    }

    fn apertures() -> Vec<SurfaceAperture> {
        let notched = vec![[-2.0, -2.0], [2.0, -2.0], [2.0, 2.0], [0.0, 0.5], [-2.0, 2.0]];
        let shapes = [
            ApertureShape::Circle { radius: 1.5 },
            ApertureShape::Ellipse { half_width: 2.0, half_height: 1.0 },
            ApertureShape::Rectangle { half_width: 2.0, half_height: 1.0 },
            ApertureShape::Polygon { points: vec![[0.0, 2.0], [-2.0, -1.0], [2.0, -1.0]] },
            ApertureShape::Polygon { points: notched },
            ApertureShape::Spider { arms: 3, width: 0.4 },
        ];
        let placed = shapes.into_iter().map(|shape| SurfaceAperture {
            center: [0.3, -0.2],
            angle: 25.0,
            ..SurfaceAperture::obscuration(shape)
        });
        let framed = |own: SurfaceAperture| {
            let is_spider = matches!(own.shape, ApertureShape::Spider { .. });
            let frame = SurfaceAperture { blocks: BlockedSide::Outside, ..own.clone() };
            std::iter::once(own).chain((!is_spider).then_some(frame)).collect::<Vec<_>>()
        };
        placed.flat_map(framed).collect()
    }

    /// Points of a spiral, none on an edge.
    fn spiral() -> impl Iterator<Item = Vec3<f64>> {
        (1..400).map(|i| {
            let (sin, cos) = (2.4 * f64::from(i)).sin_cos();
            let r = 0.17 * f64::from(i).sqrt();
            point(r * cos, r * sin)
        })
    }

    #[test]
    fn an_obscuration_passes_what_its_frame_blocks() {
        for pair in apertures().chunks(2).filter(|pair| pair.len() == 2) {
            let sets = [0, 1].map(|i| ApertureSet::<f64>::new(&pair[i..=i]));
            for p in spiral() {
                assert_ne!(sets[0].passes(p), sets[1].passes(p), "{:?} at {p:?}", pair[0]);
            }
        }
    }

    /// Compares the slopes of a side at a point with differences.
    fn check_slopes(aperture: &SurfaceAperture, set: &ApertureSet<f64>, side: u16, p: Vec3<f64>) {
        let step = 1e-6;
        let across = |x: f64, y: f64| {
            (set.margin(side, p + point(x, y)) - set.margin(side, p - point(x, y))) / (2.0 * step)
        };
        let by = set.by_point(side, p);
        assert!((by[0] - across(step, 0.0)).abs() < 1e-8, "{aperture:?}");
        assert!((by[1] - across(0.0, step)).abs() < 1e-8, "{aperture:?}");
        let (first, by) = set.by_numbers(side, p);
        assert_eq!(first, 0);
        let is_oval = matches!(set.sides[0].form, SideForm::Oval { .. });
        for (number, by) in by.into_iter().enumerate() {
            let moved = |step: f64| {
                let mut moved = aperture.clone();
                moved.number_mut(number).into_iter().for_each(|v| *v += step);
                ApertureSet::<f64>::new(&[moved]).margin(side, p)
            };
            let found = (moved(step) - moved(-step)) / (2.0 * step);
            // Off the edge the factor of an oval moves too.
            let slack = if is_oval && number < 2 { set.margin(side, p).abs() } else { 0.0 };
            assert!((by - found).abs() < 1e-8 + slack, "{aperture:?} {number}");
        }
    }

    #[test]
    fn slopes_of_margins_are_those_of_differences() {
        for aperture in apertures() {
            let set = ApertureSet::<f64>::new(std::slice::from_ref(&aperture));
            for p in spiral() {
                let mut limits = Vec::new();
                set.visit(p, |limit, _| limits.push(limit));
                let sides = limits.into_iter().filter_map(|limit| match limit {
                    RayLimit::Aperture(side) | RayLimit::Obscuration(side) => Some(side),
                    _ => None,
                });
                sides.for_each(|side| check_slopes(&aperture, &set, side, p));
            }
        }
    }

    #[test]
    fn figures_without_an_area_block_all_or_nothing() {
        for shape in [
            ApertureShape::Circle { radius: 0.0 },
            ApertureShape::Ellipse { half_width: 1.0, half_height: 0.0 },
            ApertureShape::Rectangle { half_width: 0.0, half_height: 2.0 },
        ] {
            let frame = ApertureSet::<f64>::new(&[SurfaceAperture::inside(shape.clone())]);
            let block = ApertureSet::<f64>::new(&[SurfaceAperture::obscuration(shape)]);
            for p in spiral() {
                assert!(!frame.passes(p) && block.passes(p));
            }
        }
    }

    #[test]
    fn a_point_that_is_no_number_is_blocked() {
        for aperture in apertures() {
            let set = ApertureSet::<f64>::new(&[aperture]);
            assert!(!set.passes(point(f64::NAN, 0.0)));
        }
    }
}
