//! The search for the edge of a pupil, from a point inside.
//!
//! Along each radius the edge is the zero of one margin of the ray (see [`RayLimit`]), found to
//! rounding by a bracketed secant; where the margin that ends it changes, the edge has a corner.

use super::boundary::{Boundary, BoundaryArc, EdgePoint, PolarFrame, PupilLimit};
use super::dark_points::ClosedCurve;
use super::limit_secant::{LimitSecant, SECANT_STEPS, SecantStep};
use crate::pupil::launch::Launch;
use crate::trace::{Ray, RayLimit};
use std::f64::consts::PI;

/// The result of testing a ray against the limits.
pub(super) struct LimitProbe {
    /// The first limit that it violates, with the margin.
    pub(super) failed: Option<(PupilLimit, f64)>,
    /// Its margin at the limit that was asked for; NaN if it does not get that far.
    margin_at_limit: f64,
}

/// A ray this close to the rim of the disc, relatively, counts as one at the rim: if the rim of the
/// stop is the rim of the pupil as well, rounding must not decide ray by ray between them.
const AT_DISC: f64 = 1e-10;
/// The accuracy of a corner in azimuth and relative radius; derivatives by a semi-diameter have the
/// same error.
const CORNER: f64 = 1e-11;
/// A step along the radius, relative to it, that is rounding.
const ROUNDING: f64 = 4.0 * f64::EPSILON;
/// Two edges next to a corner differ by less than this, relatively, unless the edge jumps.
const JUMP: f64 = 1e-5;
/// The relative error of the radius interpolated between two samples of the edge.
pub(super) const GUESS_SPREAD: f64 = 0.003;
/// The distance inside the edge, relative to the radius, at which margins are evaluated.
pub(super) const INSIDE: f64 = 1e-9;
/// A margin this small relative to its neighbours is one that ends the pupil.
const ENDING: f64 = 1e-6;
/// A cosine that vanishes at this part of the radius or beyond vanishes at the edge but for
/// rounding.
const AT_GRAZING: f64 = 1.0 - 1e-9;
/// A squared cosine that has fallen to this part of its value at the centre vanishes not far away.
const NEAR_GRAZING: f64 = 0.3;
/// The largest number of arcs, beside one for each side of an aperture: more are noise.
pub(super) const MAX_ARCS: usize = 24;
/// A pupil that reaches this far, in its frame, is unbounded.
const UNBOUNDED: f64 = 1e4;

/// The limits that a search for the edge takes into account.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum LimitFilter {
    /// All limits.
    All,
    /// All limits except obstructions.
    WithoutObstructions,
    /// The obstructions alone, from inside: the edge is where their shadow ends.
    Obstructions,
}

impl Launch<'_> {
    /// Tests the ray at `p` against all limits; `wanted` is the limit whose margin is recorded.
    pub(super) fn probe(&self, p: [f64; 2], wanted: PupilLimit) -> LimitProbe {
        self.probe_filtered(p, wanted, |_| true)
    }

    /// Tests whether the ray at `p` is outside of all shadows, with the signs of margins reversed.
    fn probe_obstructions(&self, p: [f64; 2], wanted: PupilLimit) -> LimitProbe {
        let mut probe = LimitProbe { failed: None, margin_at_limit: f64::NAN };
        let Some(ray) = self.ray(p) else { return probe };
        let mut deepest: Option<(PupilLimit, f64)> = None;
        self.channel().tracer.margins(ray, |surface, ray_limit, margin| {
            if !ray_limit.is_shadow() {
                return;
            }
            let limit = PupilLimit::Surface(surface, ray_limit);
            if limit == wanted {
                probe.margin_at_limit = -margin;
            }
            // A margin that is no number blocks, as it does at every other limit.
            let depth = if margin.is_nan() { -1.0 } else { margin };
            if deepest.is_none_or(|(_, least)| depth < least) {
                deepest = Some((limit, depth));
            }
        });
        probe.failed = deepest.filter(|(_, d)| *d >= 0.0).map(|(limit, depth)| (limit, -depth));
        if probe.margin_at_limit.is_nan() {
            probe.margin_at_limit = -self.side_margin(ray, wanted);
        }
        probe
    }

    fn probe_filtered(
        &self,
        p: [f64; 2],
        wanted: PupilLimit,
        sees: impl Fn(RayLimit) -> bool,
    ) -> LimitProbe {
        let Some(ray) = self.ray(p) else {
            return LimitProbe {
                failed: Some((PupilLimit::Unaimed, -1.0)),
                margin_at_limit: f64::NAN,
            };
        };
        let mut probe = LimitProbe { failed: None, margin_at_limit: f64::NAN };
        self.channel().tracer.margins(ray, |surface, ray_limit, margin| {
            let limit = PupilLimit::Surface(surface, ray_limit);
            if limit == wanted {
                probe.margin_at_limit = margin;
            }
            if probe.failed.is_none() && !(margin >= 0.0) && sees(ray_limit) {
                probe.failed = Some((limit, if margin < 0.0 { margin } else { -1.0 }));
            }
        });
        if probe.margin_at_limit.is_nan() {
            probe.margin_at_limit = self.side_margin(ray, wanted);
        }
        probe
    }

    /// The margin of a ray at a side of an aperture, whether it decides or not; NaN at any other limit.
    fn side_margin(&self, ray: Ray<f64>, limit: PupilLimit) -> f64 {
        match limit {
            PupilLimit::Surface(
                surface,
                side @ (RayLimit::Aperture(_) | RayLimit::Obscuration(_)),
            ) => self.channel().tracer.margin(ray, surface, side).unwrap_or(f64::NAN),
            _ => f64::NAN,
        }
    }

    /// The margins of a ray at every limit; `None` if it does not get through.
    pub(super) fn margins_if_passing(&self, p: [f64; 2]) -> Option<Vec<f64>> {
        let ray = self.ray(p)?;
        let mut margins = Vec::with_capacity(3 * self.channel().tracer.surfaces());
        self.channel().tracer.margins(ray, |_, _, margin| margins.push(margin));
        margins.iter().all(|margin| *margin >= 0.0).then_some(margins)
    }

    /// True if the ray at `p` gets through the surfaces.
    pub(super) fn transmits(&self, p: [f64; 2]) -> bool {
        self.probe(p, PupilLimit::Disc).failed.is_none()
    }
}

/// A search for the edge along radii from one point.
pub(super) struct EdgeSearch<'a> {
    pub(super) launch: &'a Launch<'a>,
    pub(super) frame: PolarFrame,
    pub(super) rays: usize,
    limits: LimitFilter,
}

impl<'a> EdgeSearch<'a> {
    pub(super) fn new(launch: &'a Launch<'a>, frame: PolarFrame) -> Self {
        Self { launch, frame, rays: 0, limits: LimitFilter::All }
    }

    /// The same search with other limits.
    pub(super) fn with_limits(self, limits: LimitFilter) -> Self {
        Self { limits, ..self }
    }

    fn probe(&mut self, azimuth: f64, r: f64, wanted: PupilLimit) -> LimitProbe {
        self.rays += 1;
        let p = self.frame.point(azimuth, r);
        match self.limits {
            LimitFilter::All => self.launch.probe(p, wanted),
            LimitFilter::WithoutObstructions => {
                self.launch.probe_filtered(p, wanted, |h| !h.is_shadow())
            }
            LimitFilter::Obstructions => self.launch.probe_obstructions(p, wanted),
        }
    }

    /// The radius at which the azimuth leaves the unit disc; infinite if the disc is no limit.
    fn disc(&self, azimuth: f64) -> f64 {
        if !self.launch.model.ends_at_disc() {
            return f64::INFINITY;
        }
        let [x, y] = self.frame.center;
        let [dx, dy] = self.frame.direction(azimuth);
        let along = x * dx + y * dy;
        let square = dx * dx + dy * dy;
        let inside = 1.0 - x * x - y * y;
        ((along * along + square * inside).max(0.0).sqrt() - along) / square
    }

    /// The edge at an azimuth, searched around a guess of its radius that is right within a
    /// relative `spread`; `None` if nothing limits the pupil.
    pub(super) fn edge(&mut self, azimuth: f64, guess: f64, spread: f64) -> Option<EdgePoint> {
        let disc = self.disc(azimuth);
        let last = disc * (1.0 - AT_DISC);
        let mut spread = spread;
        let mut low = 0.0;
        let mut high = (guess * (1.0 + spread)).min(last);
        loop {
            if let Some(failed) = self.probe(azimuth, high, PupilLimit::Disc).failed {
                let from = if low > 0.0 { low } else { guess.min(high) * (1.0 - spread) };
                return Some(self.search_inward(azimuth, from, high, failed));
            }
            if high >= last {
                return Some(EdgePoint { radius: disc, limit: PupilLimit::Disc });
            }
            if high > UNBOUNDED {
                return None;
            }
            spread *= 3.0;
            low = high;
            high = (high * (1.0 + spread)).min(last);
        }
    }

    /// The edge inside of a ray that fails, bracketed by ever smaller radii.
    fn search_inward(
        &mut self,
        azimuth: f64,
        mut low: f64,
        mut high: f64,
        mut failed: (PupilLimit, f64),
    ) -> EdgePoint {
        loop {
            low = low.max(0.0);
            let probe = self.probe(azimuth, low, failed.0);
            match probe.failed {
                Some(closer) if low > 0.0 => {
                    let step = 6.0 * (high - low);
                    (high, failed) = (low, closer);
                    low -= step;
                }
                Some(_) | None => {
                    return self.refine_bracket(
                        azimuth,
                        (low, probe.margin_at_limit),
                        high,
                        failed,
                    );
                }
            }
        }
    }

    /// The zero of the margin that ends the pupil between a ray that passes and one that fails, by
    /// the method of Anderson and Björck (BIT 13, 1973), with bisection where that is slow.
    fn refine_bracket(
        &mut self,
        azimuth: f64,
        (mut low, mut at_low): (f64, f64),
        mut high: f64,
        (mut limit, mut at_high): (PupilLimit, f64),
    ) -> EdgePoint {
        let (mut last, mut slow) = (f64::INFINITY, 0);
        for _ in 0..100 {
            let width = high - low;
            let secant = high - at_high * width / (at_high - at_low);
            let inside = secant > low && secant < high && slow < 3;
            let r = if inside { secant } else { low + 0.5 * width };
            if (r - last).abs() <= ROUNDING * high || r <= low || r >= high {
                let Some(closer) = self.closer_limit(azimuth, low, EdgePoint { radius: r, limit })
                else {
                    return EdgePoint { radius: r, limit };
                };
                (high, limit, at_high) = closer;
                at_low = self.probe(azimuth, low, limit).margin_at_limit;
                (last, slow) = (f64::INFINITY, 0);
                continue;
            }
            last = r;
            let probe = self.probe(azimuth, r, limit);
            match probe.failed {
                None => {
                    at_high *= damping(probe.margin_at_limit, at_low);
                    (low, at_low) = (r, probe.margin_at_limit);
                }
                Some((same, margin)) if same == limit => {
                    at_low *= damping(margin, at_high);
                    (high, at_high) = (r, margin);
                }
                Some((other, margin)) if width > 1e-10 * high => {
                    (high, at_high, limit) = (r, margin, other);
                    at_low = self.probe(azimuth, low, limit).margin_at_limit;
                }
                Some(_) => return EdgePoint { radius: r, limit },
            }
            slow = if high - low > 0.5 * width { slow + 1 } else { 0 };
        }
        EdgePoint { radius: low, limit }
    }

    /// A limit that ends the pupil before an edge that was approached from outside, with a radius at which
    /// it does and the margin there; `low` is a radius that passes.
    fn closer_limit(
        &mut self,
        azimuth: f64,
        low: f64,
        edge: EdgePoint,
    ) -> Option<(f64, PupilLimit, f64)> {
        let inside = edge.radius * (1.0 - INSIDE);
        if inside <= low {
            return None;
        }
        let (limit, margin) = self.probe(azimuth, inside, edge.limit).failed?;
        (limit != edge.limit).then_some((inside, limit, margin))
    }

    /// The margin of a ray at one limit; NaN if it does not get there.
    fn margin(&mut self, azimuth: f64, r: f64, limit: PupilLimit) -> f64 {
        self.rays += 1;
        let PupilLimit::Surface(surface, ray_limit) = limit else { return f64::NAN };
        let ray = self.launch.ray(self.frame.point(azimuth, r));
        let tracer = &self.launch.channel().tracer;
        ray.and_then(|ray| tracer.margin(ray, surface, ray_limit)).unwrap_or(f64::NAN)
    }

    /// The radius at which one limit alone would end the pupil, by the secant method from a guess.
    pub(super) fn limit_zero(
        &mut self,
        limit: PupilLimit,
        azimuth: f64,
        guess: f64,
    ) -> Option<f64> {
        if limit == PupilLimit::Disc {
            return Some(self.disc(azimuth));
        }
        let mut search = LimitSecant::new(guess);
        search.before = self.margin(azimuth, search.first(), limit);
        for _ in 0..SECANT_STEPS {
            match search.advance(self.margin(azimuth, search.r, limit)) {
                SecantStep::Further => {}
                SecantStep::Found(radius) => return Some(radius),
                SecantStep::Lost => return None,
            }
        }
        None
    }

    /// The nearest radius at which one of some cosines vanishes, relative to the edge; the limit of
    /// the edge itself is omitted.
    pub(super) fn grazing_distance(
        &mut self,
        limits: &[PupilLimit],
        azimuth: f64,
        edge: EdgePoint,
    ) -> f64 {
        let others = limits.iter().filter(|limit| **limit != edge.limit);
        let zeros = others.filter_map(|limit| self.limit_zero(*limit, azimuth, edge.radius));
        let parts = zeros.map(|radius| radius / edge.radius).filter(|part| *part > AT_GRAZING);
        parts.fold(f64::INFINITY, f64::min).max(1.0)
    }

    /// The corner between two edges where the limit of one takes over from that of the other, by a
    /// bracketed secant on the distance between the two; `None` if a third one intervenes.
    fn find_corner(&mut self, a: (f64, EdgePoint), b: (f64, EdgePoint)) -> Option<f64> {
        let (mut low, mut high) = (a.0, b.0);
        // At the corner of an obscuration the far one of two sides makes the edge, not the near one.
        let sense = if self.is_corner_of_shadow(a.1, b.1) { -1.0 } else { 1.0 };
        let gap = |search: &mut Self, azimuth: f64| {
            let share = (azimuth - a.0) / (b.0 - a.0);
            let guess = a.1.radius + share * (b.1.radius - a.1.radius);
            let ends = [a.1.limit, b.1.limit].map(|limit| search.limit_zero(limit, azimuth, guess));
            Some((sense * (ends[1]? - ends[0]?), ends[0]?))
        };
        let (mut at_low, mut at_high) = (gap(self, low)?.0, gap(self, high)?.0);
        for _ in 0..30 {
            let azimuth = high - at_high * (high - low) / (at_high - at_low);
            if !(azimuth > low && azimuth < high && at_low > 0.0 && at_high < 0.0) {
                return None;
            }
            let (here, radius) = gap(self, azimuth)?;
            if here.abs() <= CORNER * radius {
                let edge = self.edge(azimuth, radius, CORNER)?;
                let alone = (edge.radius - radius).abs() <= 10.0 * CORNER * radius;
                return alone.then_some(azimuth);
            }
            if here > 0.0 {
                at_high *= damping(here, at_low);
                (low, at_low) = (azimuth, here);
            } else {
                at_low *= damping(here, at_high);
                (high, at_high) = (azimuth, here);
            }
        }
        None
    }

    /// True if two edges next to a corner are sides of an obscuration, seen from the light.
    fn is_corner_of_shadow(&self, a: EdgePoint, b: EdgePoint) -> bool {
        let is_side = |edge: EdgePoint| {
            matches!(edge.limit, PupilLimit::Surface(_, RayLimit::Obscuration(_)))
        };
        self.limits != LimitFilter::Obstructions && is_side(a) && is_side(b)
    }

    /// The whole edge, over azimuths from 0 to `end`; `None` if nothing limits the pupil or if its
    /// edge is too irregular to be split into arcs.
    pub(super) fn trace_boundary(mut self, end: f64, azimuths: usize) -> Option<Boundary> {
        let samples = self.sample_edge(end, azimuths)?;
        let mut arcs = vec![BoundaryArc { from: 0.0, to: end, limit: samples[0].1.limit }];
        for pair in samples.windows(2) {
            self.find_corners(pair[0], pair[1], &mut arcs)?;
        }
        arcs.retain(|arc| arc.to > arc.from);
        if end > 1.5 * PI {
            join_ends(&mut arcs, end);
        }
        let grazing = self.find_grazing_limits(&samples);
        Some(Boundary {
            frame: self.frame,
            arcs,
            samples,
            grazing_limits: grazing,
            rays: self.rays,
        })
    }

    /// The limits whose squared cosine falls from the centre to the edge so much that it vanishes
    /// not far behind.
    fn find_grazing_limits(&mut self, samples: &[(f64, EdgePoint)]) -> Vec<PupilLimit> {
        let inside = 1.0 - INSIDE;
        let mut margins = |p: [f64; 2]| {
            self.rays += 1;
            let mut found = Vec::new();
            if let Some(ray) = self.launch.ray(p) {
                self.launch.channel().tracer.margins(ray, |surface, ray_limit, margin| {
                    found.push((PupilLimit::Surface(surface, ray_limit), margin));
                });
            }
            found
        };
        let frame = self.frame;
        let center = margins(frame.center);
        let mut grazed = Vec::new();
        for (azimuth, edge) in samples {
            let there = margins(frame.point(*azimuth, edge.radius * inside));
            for ((limit, from), (_, to)) in center.iter().zip(there) {
                if limit.is_grazing() && to < NEAR_GRAZING * from && !grazed.contains(limit) {
                    grazed.push(*limit);
                }
            }
        }
        grazed
    }

    /// The edge at equal steps of azimuth, and at azimuths in between where another limit comes
    /// close.
    fn sample_edge(&mut self, end: f64, azimuths: usize) -> Option<Vec<(f64, EdgePoint)>> {
        let step = end / azimuths as f64;
        let mut samples = Vec::with_capacity(azimuths + 1);
        let mut margins = Vec::with_capacity(azimuths + 1);
        let mut guess = 1.0;
        for i in 0..=azimuths {
            let azimuth = step * i as f64;
            let edge = self.edge(azimuth, guess, 0.02)?;
            guess = edge.radius;
            samples.push((azimuth, edge));
            self.rays += 1;
            let inside = self.frame.point(azimuth, edge.radius * (1.0 - INSIDE));
            margins.push(self.launch.margins_if_passing(inside).unwrap_or_default());
        }
        let half = end < 1.5 * PI;
        margins.truncate(if half { azimuths + 1 } else { azimuths });
        let azimuth_of = |place: f64| {
            if half { (step * place).clamp(0.0, end) } else { (step * place).rem_euclid(end) }
        };
        for dip in margin_minima(&margins, half) {
            let near = samples[dip.ray].1;
            let place = dip.lowest(|place| {
                let azimuth = azimuth_of(place);
                let edge = self.edge(azimuth, near.radius, 0.02)?;
                self.rays += 1;
                let inside = self.frame.point(azimuth, edge.radius * (1.0 - INSIDE));
                let margins = self.launch.margins_if_passing(inside)?;
                margins.get(dip.margin).copied().filter(|_| edge.limit == near.limit)
            });
            let azimuth = azimuth_of(place);
            samples.push((azimuth, self.edge(azimuth, near.radius, 0.02)?));
        }
        samples.sort_by(|a, b| a.0.total_cmp(&b.0));
        samples.dedup_by(|a, b| a.0 == b.0);
        Some(samples)
    }

    /// Finds the corners between two edges: one, or, by halving the azimuths, several if another
    /// limit makes an arc in between.
    fn find_corners(
        &mut self,
        a: (f64, EdgePoint),
        b: (f64, EdgePoint),
        arcs: &mut Vec<BoundaryArc>,
    ) -> Option<()> {
        if a.1.limit == b.1.limit {
            return Some(());
        }
        let middle = 0.5 * (a.0 + b.0);
        let next = b.0 - a.0 <= CORNER;
        if next && hides_light(a.1, b.1) {
            return None;
        }
        let found = if next { Some(middle) } else { self.find_corner(a, b) };
        if let Some(corner) = found {
            let end = arcs.last_mut().map(|arc| std::mem::replace(&mut arc.to, corner))?;
            arcs.push(BoundaryArc { from: corner, to: end, limit: b.1.limit });
            let most = MAX_ARCS + self.launch.channel().tracer.aperture_sides();
            return (arcs.len() <= most).then_some(());
        }
        let guess = 0.5 * (a.1.radius + b.1.radius);
        let between = (middle, self.edge(middle, guess, 0.05 * (b.0 - a.0).min(0.2))?);
        self.find_corners(a, between, arcs)?;
        self.find_corners(between, b, arcs)
    }
}

/// True if the edge jumps from the near side of a shadow to a limit behind it: there is light
/// behind the shadow that is not visible from the centre. The two edges are next to a corner.
fn hides_light(a: EdgePoint, b: EdgePoint) -> bool {
    let shadow = |edge: EdgePoint| matches!(edge.limit, PupilLimit::Surface(_, limit) if limit.may_hide_light());
    let jump = (a.radius - b.radius).abs() > JUMP * a.radius.max(b.radius);
    jump && (shadow(a) || shadow(b))
}

/// A minimum of a margin between rays at equal steps of azimuth.
#[derive(Debug, Clone, Copy)]
pub(super) struct MarginMinimum {
    /// The ray at which the margin is least.
    ray: usize,
    /// The number of the margin.
    pub(super) margin: usize,
    /// The margins of that ray and of those beside it.
    values: [f64; 3],
}

/// A minimum below this part of the least margin of a ray may be an arc of another limit, however short.
const NEARLY_ENDING: f64 = 0.05;
/// The largest number of parabolas to a minimum, and the step to the next one, in steps of azimuth, at
/// which it is found.
const PARABOLAS: usize = 8;
const FOUND: f64 = 1e-4;

impl MarginMinimum {
    /// The rays of the first parabola: their places in steps of azimuth, and their margins.
    fn rays(&self) -> [[f64; 2]; 3] {
        let at = self.ray as f64;
        [[at - 1.0, self.values[0]], [at, self.values[1]], [at + 1.0, self.values[2]]]
    }

    /// The place of the minimum in steps of azimuth. One that is low is followed by ever narrower
    /// parabolas, to the first ray that has not this margin: `margin` gives `None`.
    pub(super) fn lowest(&self, mut margin: impl FnMut(f64) -> Option<f64>) -> f64 {
        let mut rays = self.rays();
        let Some([mut place, bottom]) = vertex(rays) else { return rays[1][0] };
        if bottom > NEARLY_ENDING * self.values[1] {
            return place;
        }
        for _ in 0..PARABOLAS {
            let Some(value) = margin(place) else { return place };
            let Some(next) = narrower(rays, [place, value]) else { return place };
            rays = next;
            match vertex(rays) {
                Some([at, _]) if (at - place).abs() > FOUND => place = at,
                _ => return place,
            }
        }
        place
    }
}

/// The place and the value of the minimum of the parabola through three points; `None` without one.
fn vertex([a, b, c]: [[f64; 2]; 3]) -> Option<[f64; 2]> {
    let slopes = [(b[1] - a[1]) / (b[0] - a[0]), (c[1] - b[1]) / (c[0] - b[0])];
    let bend = (slopes[1] - slopes[0]) / (c[0] - a[0]);
    let slope = slopes[0] + bend * (b[0] - a[0]);
    let place = b[0] - 0.5 * slope / bend;
    let is_between = place > a[0] && place < c[0];
    (bend > 0.0 && is_between).then(|| [place, b[1] - 0.25 * slope * slope / bend])
}

/// The three points about the least one of four; `None` if that is at an end.
fn narrower([a, b, c]: [[f64; 2]; 3], new: [f64; 2]) -> Option<[[f64; 2]; 3]> {
    let mut all = [a, b, c, new];
    all.sort_by(|a, b| a[0].total_cmp(&b[0]));
    let middle = if all[1][1] <= all[2][1] { 1 } else { 2 };
    let around = [all[middle - 1], all[middle], all[middle + 1]];
    let apart = around[0][0] < around[1][0] && around[1][0] < around[2][0];
    (apart && around[1][1] <= around[0][1] && around[1][1] <= around[2][1]).then_some(around)
}

/// The minima of margins between rays at equal steps of azimuth: where the parabola through a least margin
/// and its neighbours is much lower than that. Over half a turn the rays beyond its ends are mirror
/// images.
pub(super) fn margin_minima(margins: &[Vec<f64>], half: bool) -> Vec<MarginMinimum> {
    let count = margins.len();
    let mut dips = Vec::new();
    for i in 0..count {
        let (before, after) = match (half, i) {
            (true, 0) => (1, 1),
            (true, _) if i == count - 1 => (i - 1, i - 1),
            _ => ((i + count - 1) % count, (i + 1) % count),
        };
        let neighbours = margins[before].iter().zip(&margins[i]).zip(&margins[after]);
        for (margin, ((left, here), right)) in neighbours.enumerate() {
            let values = [*left, *here, *right];
            let [left, here, right] = values;
            // A margin that ends the pupil here is zero but for rounding, and not a minimum.
            let open = here > ENDING * left.max(right);
            let minimum = MarginMinimum { ray: i, margin, values };
            let is_low = |[_, bottom]: [f64; 2]| bottom < 0.5 * here;
            if open && here <= left && here <= right && vertex(minimum.rays()).is_some_and(is_low) {
                dips.push(minimum);
            }
        }
    }
    dips
}

/// The factor on the value at the retained end of a bracket (Anderson and Björck).
fn damping(new: f64, replaced: f64) -> f64 {
    let factor = 1.0 - new / replaced;
    if factor > 0.0 { factor } else { 0.5 }
}

/// Joins the first and the last arc of a full turn if the same limit makes them.
fn join_ends(arcs: &mut Vec<BoundaryArc>, turn: f64) {
    if let (Some(first), Some(last)) = (arcs.first().copied(), arcs.last().copied())
        && arcs.len() > 1
        && first.limit == last.limit
    {
        arcs.remove(0);
        if let Some(last) = arcs.last_mut() {
            last.to = turn + first.to;
        }
    }
}

/// The number of azimuths of a closed curve around a pupil, beside its corners.
const CURVE: usize = 256;

impl Boundary {
    /// A closed polygon of points of the edge, its corners among them; `filter` as the edge was found.
    pub(super) fn curve(&self, launch: &Launch<'_>, filter: LimitFilter) -> ClosedCurve {
        let mut search = EdgeSearch::new(launch, self.frame).with_limits(filter);
        let end = self.samples.last().map_or(0.0, |s| s.0);
        let count = if launch.is_symmetric() { CURVE / 2 } else { CURVE };
        let steps = (0..=count).map(|i| end * i as f64 / count as f64);
        let corners = self.arcs.iter().map(|arc| if arc.to > end { arc.to - end } else { arc.to });
        let mut azimuths: Vec<f64> = steps.chain(corners).collect();
        azimuths.sort_by(f64::total_cmp);
        let mut point = |azimuth: f64| {
            let edge = search.edge(azimuth, self.radius_guess(azimuth), GUESS_SPREAD)?;
            Some(self.frame.point(azimuth, edge.radius))
        };
        let mut points: ClosedCurve = azimuths.into_iter().filter_map(&mut point).collect();
        if launch.is_symmetric() {
            let mirrored: Vec<_> = points.iter().rev().map(|[x, y]| [-x, *y]).collect();
            points.extend(mirrored);
        }
        points
    }

    /// The points of the edge at some azimuths, their radii scaled by `inside`.
    pub fn points(&self, launch: &Launch<'_>, count: usize, inside: f64) -> Vec<[f64; 2]> {
        let mut search = EdgeSearch::new(launch, self.frame);
        let mut points = Vec::with_capacity(count + self.arcs.len());
        let end = self.samples.last().map_or(0.0, |s| s.0);
        let steps = (0..=count).map(|i| end * i as f64 / count as f64);
        let corners = self.arcs.iter().map(|arc| arc.to);
        let mut azimuths: Vec<f64> = steps.chain(corners).collect();
        azimuths.sort_by(f64::total_cmp);
        for azimuth in azimuths {
            if let Some(edge) = search.edge(azimuth, self.radius_guess(azimuth), GUESS_SPREAD) {
                points.push(self.frame.point(azimuth, inside * edge.radius));
            }
        }
        points
    }
}
