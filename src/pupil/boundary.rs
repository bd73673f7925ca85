//! Where the pupil ends: the rims that clip, found to rounding, split where one takes over from
//! another.
//!
//! From a point inside, the pupil's edge is a function `R(ψ)` of azimuth, both in a frame that is
//! stretched with the pupil so that a narrow sliver looks round. It is the zero of one
//! margin of the ray (see [`Hurdle`]) along the radius, found by a bracketed secant; where the
//! margin that ends it changes, `R` has a corner, and there the azimuths are split into arcs.

use super::launch::Launch;
use crate::trace::Hurdle;
use std::f64::consts::PI;

/// What ends the pupil somewhere.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Limit {
    /// The disc of the entrance pupil, or of the stop that rays are aimed at.
    Disc,
    /// A surface that clips, misses or totally reflects.
    Surface(usize, Hurdle),
    /// No ray is found that crosses the stop there.
    Unaimed,
}

impl Limit {
    /// Whether a cosine vanishes there, so that rays turn ever faster towards it.
    pub fn is_grazing(self) -> bool {
        matches!(self, Self::Surface(_, Hurdle::Miss | Hurdle::Reflection))
    }
}

/// Polar coordinates about a point of the pupil, stretched with it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Frame {
    /// The point, in pupil coordinates.
    pub center: [f64; 2],
    /// Where the frame's unit vectors along x and y lie.
    pub axes: [[f64; 2]; 2],
}

impl Frame {
    /// Along which pupil coordinates change with the radius at an azimuth from +y towards +x.
    pub fn direction(&self, azimuth: f64) -> [f64; 2] {
        let (sin, cos) = azimuth.sin_cos();
        [0, 1].map(|i| sin * self.axes[0][i] + cos * self.axes[1][i])
    }

    /// The pupil point at an azimuth and a radius.
    pub fn point(&self, azimuth: f64, radius: f64) -> [f64; 2] {
        let direction = self.direction(azimuth);
        [0, 1].map(|i| self.center[i] + radius * direction[i])
    }

    /// By how much an area is larger in pupil coordinates.
    pub fn area(&self) -> f64 {
        let [[a, b], [c, d]] = self.axes;
        (a * d - b * c).abs()
    }

    /// Azimuth from 0 to 2π and radius of a pupil point.
    pub(super) fn polar(&self, p: [f64; 2]) -> (f64, f64) {
        let [[a, b], [c, d]] = self.axes;
        let (x, y) = (p[0] - self.center[0], p[1] - self.center[1]);
        let determinant = a * d - b * c;
        let (u, v) = ((d * x - c * y) / determinant, (a * y - b * x) / determinant);
        (u.atan2(v).rem_euclid(2.0 * PI), u.hypot(v))
    }
}

/// The edge of the pupil along one radius.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Edge {
    /// Its distance from the centre, in the frame.
    pub radius: f64,
    /// What ends the pupil there.
    pub limit: Limit,
}

/// A stretch of the edge that one limit makes.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Arc {
    /// Azimuth where it begins, in radians from the frame's +y towards its +x.
    pub from: f64,
    /// Azimuth where it ends.
    pub to: f64,
    /// What ends the pupil along it.
    pub limit: Limit,
}

/// The edge of a pupil that is star-shaped about a point.
#[derive(Debug, Clone, PartialEq)]
pub struct Boundary {
    /// In what it is measured.
    pub frame: Frame,
    /// The arcs in order of azimuth: over a half turn where the pupil is its own mirror image.
    pub arcs: Vec<Arc>,
    /// The edge at the azimuths that were looked at.
    pub(super) samples: Vec<(f64, Edge)>,
    /// Limits at which a cosine vanishes on the edge or not far behind it.
    pub(super) grazing: Vec<Limit>,
    /// Rays traced to find it.
    pub rays: usize,
}

/// How a ray fares against the limits.
pub(super) struct Probe {
    /// The first limit that it fails, with the margin.
    pub(super) failed: Option<(Limit, f64)>,
    /// Its margin at the limit that was asked for; not a number where it does not get that far.
    wanted: f64,
}

/// A ray so close to the rim of the disc, relatively, counts as one at the rim: where the rim of
/// the stop is the rim of the pupil as well, rounding must not decide ray by ray between them.
const AT_DISC: f64 = 1e-10;
/// A corner is located to this in azimuth and radius; the derivative by a rim is as wrong as this.
const CORNER: f64 = 1e-11;
/// A step along the radius that is rounding, relatively.
const ROUNDING: f64 = 4.0 * f64::EPSILON;
/// Two edges as close as that differ by less than this, relatively, unless the edge jumps.
const JUMP: f64 = 1e-5;
/// How far, relatively, the edge between two known azimuths may be from their interpolation.
pub(super) const NEAR: f64 = 0.003;
/// How far inside the edge, relatively, margins are looked at.
const INSIDE: f64 = 1e-9;
/// A margin this small against its neighbours is one that ends the pupil.
const ENDING: f64 = 1e-6;
/// A cosine that vanishes this much inside the edge, relatively, vanishes there but for rounding.
const GRAZED: f64 = 1.0 - 1e-9;
/// A squared cosine that has fallen to this part of what it is at the centre is one that vanishes
/// not far away.
const NEARLY: f64 = 0.3;
/// What is added to the largest radius seen so that none is larger.
const COVER: f64 = 1.02;
/// More arcs than this are no pupil but noise.
pub(super) const MOST_ARCS: usize = 24;
/// A pupil that reaches this far, in its frame, is limited by nothing.
const ENDLESS: f64 = 1e4;

/// Which limits a search for the edge looks at.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Seen {
    /// All.
    All,
    /// All but the obstructions.
    Rims,
    /// The obstructions alone, from inside: the edge is where their shadow ends.
    Shadow,
}

impl Launch<'_> {
    /// Whether the ray at `p` gets through, and its margin at one limit.
    pub(super) fn probe(&self, p: [f64; 2], wanted: Limit) -> Probe {
        self.probe_seeing(p, wanted, |_| true)
    }

    /// Whether the ray at `p` is in no shadow, with margins that are negative there.
    fn probe_shadow(&self, p: [f64; 2], wanted: Limit) -> Probe {
        let mut probe = Probe { failed: None, wanted: f64::NAN };
        let Some(ray) = self.ray(p) else { return probe };
        let mut deepest: Option<(Limit, f64)> = None;
        self.color().tracer.margins(ray, |surface, hurdle, margin| {
            if hurdle != Hurdle::Obstruction {
                return;
            }
            let limit = Limit::Surface(surface, hurdle);
            if limit == wanted {
                probe.wanted = -margin;
            }
            if deepest.is_none_or(|(_, least)| margin < least) {
                deepest = Some((limit, margin));
            }
        });
        probe.failed = deepest.filter(|(_, m)| *m >= 0.0).map(|(limit, margin)| (limit, -margin));
        probe
    }

    fn probe_seeing(&self, p: [f64; 2], wanted: Limit, sees: impl Fn(Hurdle) -> bool) -> Probe {
        let Some(ray) = self.ray(p) else {
            return Probe { failed: Some((Limit::Unaimed, -1.0)), wanted: f64::NAN };
        };
        let mut probe = Probe { failed: None, wanted: f64::NAN };
        self.color().tracer.margins(ray, |surface, hurdle, margin| {
            let limit = Limit::Surface(surface, hurdle);
            if limit == wanted {
                probe.wanted = margin;
            }
            if probe.failed.is_none() && !(margin >= 0.0) && sees(hurdle) {
                probe.failed = Some((limit, if margin < 0.0 { margin } else { -1.0 }));
            }
        });
        probe
    }

    /// The margins of a ray at every hurdle; `None` where it does not get through.
    pub(super) fn margins_of_passing(&self, p: [f64; 2]) -> Option<Vec<f64>> {
        let ray = self.ray(p)?;
        let mut margins = Vec::with_capacity(3 * self.color().tracer.surfaces());
        self.color().tracer.margins(ray, |_, _, margin| margins.push(margin));
        margins.iter().all(|margin| *margin >= 0.0).then_some(margins)
    }

    /// Whether the ray at `p` gets through the surfaces.
    pub(super) fn is_lit(&self, p: [f64; 2]) -> bool {
        self.probe(p, Limit::Disc).failed.is_none()
    }
}

/// A search for the edge from one point.
pub(super) struct Search<'a> {
    pub(super) launch: &'a Launch<'a>,
    pub(super) frame: Frame,
    pub(super) rays: usize,
    seen: Seen,
}

impl<'a> Search<'a> {
    pub(super) fn new(launch: &'a Launch<'a>, frame: Frame) -> Self {
        Self { launch, frame, rays: 0, seen: Seen::All }
    }

    /// The same search for another edge.
    pub(super) fn seeing(self, seen: Seen) -> Self {
        Self { seen, ..self }
    }

    fn probe(&mut self, azimuth: f64, r: f64, wanted: Limit) -> Probe {
        self.rays += 1;
        let p = self.frame.point(azimuth, r);
        match self.seen {
            Seen::All => self.launch.probe(p, wanted),
            Seen::Rims => self.launch.probe_seeing(p, wanted, |h| h != Hurdle::Obstruction),
            Seen::Shadow => self.launch.probe_shadow(p, wanted),
        }
    }

    /// Where the radius leaves the unit disc; infinite where the disc is no limit.
    fn disc(&self, azimuth: f64) -> f64 {
        if !self.launch.bench.ends_at_disc() {
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
    /// `spread`, relatively; `None` where nothing limits the pupil.
    pub(super) fn edge(&mut self, azimuth: f64, guess: f64, spread: f64) -> Option<Edge> {
        let disc = self.disc(azimuth);
        let last = disc * (1.0 - AT_DISC);
        let mut spread = spread;
        let mut low = 0.0;
        let mut high = (guess * (1.0 + spread)).min(last);
        loop {
            if let Some(failed) = self.probe(azimuth, high, Limit::Disc).failed {
                let from = if low > 0.0 { low } else { guess.min(high) * (1.0 - spread) };
                return Some(self.between(azimuth, from, high, failed));
            }
            if high >= last {
                return Some(Edge { radius: disc, limit: Limit::Disc });
            }
            if high > ENDLESS {
                return None;
            }
            spread *= 3.0;
            low = high;
            high = (high * (1.0 + spread)).min(last);
        }
    }

    /// The edge in front of a ray that fails, looked for behind ever smaller radii.
    fn between(
        &mut self,
        azimuth: f64,
        mut low: f64,
        mut high: f64,
        mut failed: (Limit, f64),
    ) -> Edge {
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
                    return self.bracketed(azimuth, (low, probe.wanted), high, failed);
                }
            }
        }
    }

    /// The zero of the margin that ends the pupil between a ray that passes and one that fails:
    /// the method of Anderson and Björck (BIT 13, 1973), halving where it is slow.
    fn bracketed(
        &mut self,
        azimuth: f64,
        (mut low, mut at_low): (f64, f64),
        mut high: f64,
        (mut limit, mut at_high): (Limit, f64),
    ) -> Edge {
        let (mut last, mut slow) = (f64::INFINITY, 0);
        for _ in 0..100 {
            let width = high - low;
            let secant = high - at_high * width / (at_high - at_low);
            let inside = secant > low && secant < high && slow < 3;
            let r = if inside { secant } else { low + 0.5 * width };
            if (r - last).abs() <= ROUNDING * high || r <= low || r >= high {
                return Edge { radius: r, limit };
            }
            last = r;
            let probe = self.probe(azimuth, r, limit);
            match probe.failed {
                None => {
                    at_high *= damping(probe.wanted, at_low);
                    (low, at_low) = (r, probe.wanted);
                }
                Some((same, margin)) if same == limit => {
                    at_low *= damping(margin, at_high);
                    (high, at_high) = (r, margin);
                }
                Some((other, margin)) if width > 1e-10 * high => {
                    (high, at_high, limit) = (r, margin, other);
                    at_low = self.probe(azimuth, low, limit).wanted;
                }
                Some(_) => return Edge { radius: r, limit },
            }
            slow = if high - low > 0.5 * width { slow + 1 } else { 0 };
        }
        Edge { radius: low, limit }
    }

    /// The edge at an azimuth where it is expected of one limit: the zero of its margin alone, if
    /// a ray just inside of it passes everything.
    pub(super) fn expected(&mut self, limit: Limit, azimuth: f64, guess: f64) -> Option<Edge> {
        let radius = self.zero(limit, azimuth, guess).filter(|r| *r > 0.0)?;
        self.rays += 1;
        let inside = self.frame.point(azimuth, radius * (1.0 - INSIDE));
        self.launch.is_lit(inside).then_some(Edge { radius, limit })
    }

    /// The margin of a ray at one limit; not a number where it does not get there.
    fn margin(&mut self, azimuth: f64, r: f64, limit: Limit) -> f64 {
        self.rays += 1;
        let Limit::Surface(surface, hurdle) = limit else { return f64::NAN };
        let ray = self.launch.ray(self.frame.point(azimuth, r));
        let tracer = &self.launch.color().tracer;
        ray.and_then(|ray| tracer.margin(ray, surface, hurdle)).unwrap_or(f64::NAN)
    }

    /// Where one limit alone would end the pupil along a radius, by secants from a guess.
    fn zero(&mut self, limit: Limit, azimuth: f64, guess: f64) -> Option<f64> {
        if limit == Limit::Disc {
            return Some(self.disc(azimuth));
        }
        let (mut r, mut step) = (guess, 1e-4 * guess);
        let mut before = self.margin(azimuth, r - step, limit);
        for _ in 0..20 {
            let margin = self.margin(azimuth, r, limit);
            let next = -margin * step / (margin - before);
            if margin == 0.0 || next.abs() <= 1e-13 * guess {
                return Some(r + if margin == 0.0 { 0.0 } else { next });
            }
            if !(next.abs() < guess) {
                return None;
            }
            (before, step, r) = (margin, next, r + next);
        }
        None
    }

    /// Where along a radius the nearest of some cosines vanishes, in parts of the distance to the
    /// edge; the one that is the edge does not count.
    pub(super) fn grazing(&mut self, limits: &[Limit], azimuth: f64, edge: Edge) -> f64 {
        let others = limits.iter().filter(|limit| **limit != edge.limit);
        let zeros = others.filter_map(|limit| self.zero(*limit, azimuth, edge.radius));
        let parts = zeros.map(|radius| radius / edge.radius).filter(|part| *part > GRAZED);
        parts.fold(f64::INFINITY, f64::min).max(1.0)
    }

    /// The corner between two edges where the limit of one takes over from that of the other, by
    /// a bracketed secant on the distance between the two; `None` where a third one is in the way.
    fn corner(&mut self, a: (f64, Edge), b: (f64, Edge)) -> Option<f64> {
        let (mut low, mut high) = (a.0, b.0);
        let gap = |search: &mut Self, azimuth: f64| {
            let share = (azimuth - a.0) / (b.0 - a.0);
            let guess = a.1.radius + share * (b.1.radius - a.1.radius);
            let ends = [a.1.limit, b.1.limit].map(|limit| search.zero(limit, azimuth, guess));
            Some((ends[1]? - ends[0]?, ends[0]?))
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

    /// The edge all around, from the azimuths 0 to `end`; `None` where nothing limits the pupil
    /// or where its edge is too ragged to be split.
    pub(super) fn boundary(mut self, end: f64, azimuths: usize) -> Option<Boundary> {
        let samples = self.samples(end, azimuths)?;
        let mut arcs = vec![Arc { from: 0.0, to: end, limit: samples[0].1.limit }];
        for pair in samples.windows(2) {
            self.corners(pair[0], pair[1], &mut arcs)?;
        }
        arcs.retain(|arc| arc.to > arc.from);
        if end > 1.5 * PI {
            joined(&mut arcs, end);
        }
        let grazing = self.grazed(&samples);
        Some(Boundary { frame: self.frame, arcs, samples, grazing, rays: self.rays })
    }

    /// The limits whose squared cosine falls from the centre to the edge by so much that it will
    /// vanish not far behind.
    fn grazed(&mut self, samples: &[(f64, Edge)]) -> Vec<Limit> {
        let inside = 1.0 - INSIDE;
        let mut margins = |p: [f64; 2]| {
            self.rays += 1;
            let mut found = Vec::new();
            if let Some(ray) = self.launch.ray(p) {
                self.launch.color().tracer.margins(ray, |surface, hurdle, margin| {
                    found.push((Limit::Surface(surface, hurdle), margin));
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
                if limit.is_grazing() && to < NEARLY * from && !grazed.contains(limit) {
                    grazed.push(*limit);
                }
            }
        }
        grazed
    }

    /// Edges at equal steps of azimuth, and where another limit comes close in between.
    fn samples(&mut self, end: f64, azimuths: usize) -> Option<Vec<(f64, Edge)>> {
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
            margins.push(self.launch.margins_of_passing(inside).unwrap_or_default());
        }
        let half = end < 1.5 * PI;
        margins.truncate(if half { azimuths + 1 } else { azimuths });
        for dip in dips(&margins, half) {
            let azimuth =
                if half { (step * dip).clamp(0.0, end) } else { (step * dip).rem_euclid(end) };
            let distance = |sample: &&(f64, Edge)| (sample.0 - azimuth).abs();
            let near = samples.iter().min_by(|a, b| distance(a).total_cmp(&distance(b)))?;
            samples.push((azimuth, self.edge(azimuth, near.1.radius, 0.02)?));
        }
        samples.sort_by(|a, b| a.0.total_cmp(&b.0));
        samples.dedup_by(|a, b| a.0 == b.0);
        Some(samples)
    }

    /// The corners between two edges: one, or what halving the azimuths brings to light where
    /// another limit makes an arc in between.
    fn corners(&mut self, a: (f64, Edge), b: (f64, Edge), arcs: &mut Vec<Arc>) -> Option<()> {
        if a.1.limit == b.1.limit {
            return Some(());
        }
        let middle = 0.5 * (a.0 + b.0);
        let next = b.0 - a.0 <= CORNER;
        if next && hides_light(a.1, b.1) {
            return None;
        }
        let found = if next { Some(middle) } else { self.corner(a, b) };
        if let Some(corner) = found {
            let end = arcs.last_mut().map(|arc| std::mem::replace(&mut arc.to, corner))?;
            arcs.push(Arc { from: corner, to: end, limit: b.1.limit });
            return (arcs.len() <= MOST_ARCS).then_some(());
        }
        let guess = 0.5 * (a.1.radius + b.1.radius);
        let between = (middle, self.edge(middle, guess, 0.05 * (b.0 - a.0).min(0.2))?);
        self.corners(a, between, arcs)?;
        self.corners(between, b, arcs)
    }
}

/// Whether the edge jumps from the near side of a shadow to what ends the pupil behind it: there
/// is light behind the shadow that the centre does not see. The two edges are next to a corner.
fn hides_light(a: Edge, b: Edge) -> bool {
    let shadow = |edge: Edge| matches!(edge.limit, Limit::Surface(_, Hurdle::Obstruction));
    let jump = (a.radius - b.radius).abs() > JUMP * a.radius.max(b.radius);
    jump && (shadow(a) || shadow(b))
}

/// Where margins dip between rays at equal steps of azimuth, in steps from the first of them: the
/// bottoms of the parabolas through a least margin and its neighbours, if they are much lower than
/// that. Over half a turn the rays beyond its ends are mirror images.
pub(super) fn dips(margins: &[Vec<f64>], half: bool) -> Vec<f64> {
    let count = margins.len();
    let mut dips = Vec::new();
    for i in 0..count {
        let (before, after) = match (half, i) {
            (true, 0) => (1, 1),
            (true, _) if i == count - 1 => (i - 1, i - 1),
            _ => ((i + count - 1) % count, (i + 1) % count),
        };
        let neighbours = margins[before].iter().zip(&margins[i]).zip(&margins[after]);
        for ((left, here), right) in neighbours {
            let (left, here, right) = (*left, *here, *right);
            let bend = left - 2.0 * here + right;
            // A margin that ends the pupil here is zero but for rounding, and no dip.
            let open = here > ENDING * left.max(right);
            if open && here <= left && here <= right && bend > 0.0 {
                let place = 0.5 * (left - right) / bend;
                let bottom = here - 0.25 * (left - right) * place;
                if bottom < 0.5 * here {
                    dips.push(i as f64 + place);
                }
            }
        }
    }
    dips
}

/// What the value at the kept end of a bracket is multiplied with.
fn damping(new: f64, replaced: f64) -> f64 {
    let factor = 1.0 - new / replaced;
    if factor > 0.0 { factor } else { 0.5 }
}

/// The first and the last arc of a full turn are one where the same limit makes them.
fn joined(arcs: &mut Vec<Arc>, turn: f64) {
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

impl Boundary {
    /// Points of the edge, or, for an `inside` below 1, just inside it, at some azimuths.
    pub fn points(&self, launch: &Launch<'_>, count: usize, inside: f64) -> Vec<[f64; 2]> {
        let mut search = Search::new(launch, self.frame);
        let mut points = Vec::with_capacity(count + self.arcs.len());
        let end = self.samples.last().map_or(0.0, |s| s.0);
        let steps = (0..=count).map(|i| end * i as f64 / count as f64);
        let corners = self.arcs.iter().map(|arc| arc.to);
        let mut azimuths: Vec<f64> = steps.chain(corners).collect();
        azimuths.sort_by(f64::total_cmp);
        for azimuth in azimuths {
            if let Some(edge) = search.edge(azimuth, self.near(azimuth), NEAR) {
                points.push(self.frame.point(azimuth, inside * edge.radius));
            }
        }
        points
    }

    /// The frame grown until its unit disc holds all of the pupil.
    pub(super) fn cover(&self) -> Frame {
        let reach = self.samples.iter().map(|(_, edge)| edge.radius).fold(0.0, f64::max);
        let grown = COVER * reach;
        Frame { axes: self.frame.axes.map(|axis| axis.map(|v| v * grown)), ..self.frame }
    }

    /// A frame whose square from −1 to 1 holds all of the pupil, with the same turn.
    pub(super) fn boxed(&self, mirrored: bool) -> Frame {
        let (mut low, mut high) = ([f64::INFINITY; 2], [f64::NEG_INFINITY; 2]);
        for (azimuth, edge) in &self.samples {
            let (sin, cos) = azimuth.sin_cos();
            let p = [sin * edge.radius, cos * edge.radius];
            low = [0, 1].map(|i| low[i].min(p[i]));
            high = [0, 1].map(|i| high[i].max(p[i]));
        }
        if mirrored {
            low[0] = -high[0];
        }
        let middle = [0, 1].map(|i| 0.5 * (low[i] + high[i]));
        let half = [0, 1].map(|i| 0.5 * COVER * (high[i] - low[i]));
        let [a, b] = self.frame.axes;
        let center = [0, 1].map(|k| self.frame.center[k] + middle[0] * a[k] + middle[1] * b[k]);
        Frame { center, axes: [a.map(|v| half[0] * v), b.map(|v| half[1] * v)] }
    }

    /// A guess of the radius at an azimuth, from the nearest ones known.
    pub(super) fn near(&self, azimuth: f64) -> f64 {
        let end = self.samples.last().map_or(1.0, |s| s.0);
        let azimuth = if azimuth > end { azimuth - end } else { azimuth };
        let after = self.samples.partition_point(|(a, _)| *a < azimuth);
        let known = |i: usize| self.samples[i.min(self.samples.len() - 1)];
        let ((a, low), (b, high)) = (known(after.saturating_sub(1)), known(after));
        let share = if b > a { (azimuth - a) / (b - a) } else { 0.0 };
        low.radius + share * (high.radius - low.radius)
    }
}
