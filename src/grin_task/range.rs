//! The range of the index, and a spline put where it keeps one.
//!
//! The value of a spline is a mean of its coefficients, weighted by numbers that are not below zero
//! (de Boor, *A Practical Guide to Splines*, chapter IX): coefficients within a range keep the value
//! there. Those that stand outside the space need more room, for a field that is steep at its edge.
//! Where that breaks the range within the space, what they have beyond the range is taken back:
//! as much as the place needs, and of the coefficients that count there, no others.

use super::climb::{AXES, Hill, SPOKE, Spot, climb, higher, peaks};
use super::medium::Medium;
use super::task::Space;
use crate::grin::Field as _;
use crate::grin::field::Grid;
use crate::math::Vec3;
use rayon::prelude::*;

/// Points along a side of the box around the space at which a trilinear field is looked at between
/// its nodes.
const LATTICE: usize = 40;
/// Rounds of taking back, before all of it is taken back.
const ROUNDS: usize = 40;
/// How far within the range a broken place is put, in parts of it: what a climb may miss along a
/// radius, and in a cube.
const MARGINS: [f64; 2] = [1e-9, 1e-5];

/// One of the two ends of the index.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Bound {
    Low,
    High,
}

impl Bound {
    /// A value that grows towards this end.
    fn towards(self, value: f64) -> f64 {
        match self {
            Self::Low => -value,
            Self::High => value,
        }
    }
}

impl Medium {
    /// Its lowest or highest index in some spaces, and where that is: of a trilinear field at its
    /// nodes and many places between them, of a smooth one by a climb. A spline in one coordinate is
    /// looked at up to its end.
    pub(super) fn extreme(&self, spaces: &[Space], bound: Bound) -> Spot {
        let value = |p: Vec3<f64>| bound.towards(self.field().sample(p).index);
        let of_space = |space: &Space| {
            if let Self::Trilinear(field) = self {
                return highest_of(field.grid(), *space, &value);
            }
            let region = space.region();
            let is_inside = |p: Vec3<f64>| region.height(p) <= 0.0;
            let inside =
                |p: Vec3<f64>| if self.is_radial() { self.covers(p) } else { is_inside(p) };
            let hill = Hill { inside: &inside, value: &value };
            climb(&self.lookouts(*space), self.gap(*space), &hill)
        };
        let none = (f64::NEG_INFINITY, Vec3::default());
        let (most, at) = spaces.iter().map(of_space).fold(none, higher);
        (bound.towards(most), at)
    }

    /// The same field with the index within a range everywhere in some spaces.
    #[must_use]
    pub(super) fn bounded(&self, spaces: &[Space], range: [f64; 2]) -> Self {
        let mut kept = self.clone();
        for _ in 0..ROUNDS {
            if !kept.is_loose(range) {
                return kept;
            }
            let broken = kept.broken(spaces, range);
            if broken.is_empty() {
                return kept;
            }
            kept.take_back(&broken, range);
        }
        let clamp = |value: &mut f64| *value = value.clamp(range[0], range[1]);
        kept.parameters_mut().iter_mut().for_each(clamp);
        kept
    }

    /// Whether it is a spline with a coefficient beyond a range.
    fn is_loose(&self, [low, high]: [f64; 2]) -> bool {
        let within = |value: &f64| (low..=high).contains(value);
        !matches!(self, Self::Trilinear(_)) && !self.field().parameters().iter().all(within)
    }

    fn is_radial(&self) -> bool {
        matches!(self, Self::Radial(..))
    }

    /// Whether a place along x is one of a spline in one coordinate, which ends.
    fn covers(&self, p: Vec3<f64>) -> bool {
        let Self::Radial(_, radius) = self else { return true };
        (0.0..=*radius).contains(&p.x) && p.y == 0.0 && p.z == 0.0
    }

    /// Where the index is looked at: all over the space, or along x up to where a spline ends.
    fn lookouts(&self, space: Space) -> Vec<Vec3<f64>> {
        let Self::Radial(_, radius) = self else { return self.looks(space) };
        let at = |i: usize| Vec3::new(radius * i as f64 / SPOKE as f64, 0.0, 0.0);
        (0..=SPOKE).map(at).collect()
    }

    /// Places in some spaces where the index is beyond a range, and at which end.
    fn broken(&self, spaces: &[Space], [low, high]: [f64; 2]) -> Vec<(Vec3<f64>, Bound)> {
        let index = |p: Vec3<f64>| self.field().sample(p).index;
        let is_broken = |p: Vec3<f64>| match index(p) {
            found if found > high => Some((p, Bound::High)),
            found if found < low => Some((p, Bound::Low)),
            _ => None,
        };
        let of_space = |space: &Space| {
            let (looks, gap) = (self.lookouts(*space), self.gap(*space));
            let near = near(*space, gap);
            let inside = |p: Vec3<f64>| if self.is_radial() { self.covers(p) } else { near(p) };
            let looked = looks.par_iter().filter(|p| inside(**p));
            let mut broken: Vec<_> = looked.filter_map(|p| is_broken(*p)).collect();
            for bound in [Bound::Low, Bound::High] {
                let value = |p: Vec3<f64>| bound.towards(index(p));
                let hill = Hill { inside: &inside, value: &value };
                let tops = peaks(&looks, gap, &hill).into_iter();
                broken.extend(tops.filter_map(|(_, p)| is_broken(p)));
            }
            broken
        };
        spaces.iter().flat_map(of_space).collect()
    }

    /// Takes back what the coefficients that count at some places have beyond a range, until the
    /// places are within it.
    fn take_back(&mut self, broken: &[(Vec3<f64>, Bound)], [low, high]: [f64; 2]) {
        let margin = MARGINS[usize::from(!matches!(self, Self::Radial(..)))] * (high - low);
        let beyond = |value: f64| value - value.clamp(low, high);
        let mut shares = vec![1.0_f64; self.field().parameters().len()];
        for (p, bound) in broken {
            let (parameters, support) = (self.field().parameters(), self.support(*p));
            let excess = |i: usize| bound.towards(beyond(parameters[i])).max(0.0);
            let over: f64 = support.iter().map(|(i, weight)| weight * excess(*i)).sum();
            let end = match bound {
                Bound::Low => low + margin,
                Bound::High => high - margin,
            };
            let too_far = bound.towards(self.field().sample(*p).index - end);
            let share = if over > 0.0 { (1.0 - too_far / over).clamp(0.0, 1.0) } else { 0.0 };
            for (i, _) in support.into_iter().filter(|(i, _)| excess(*i) > 0.0) {
                shares[i] = shares[i].min(share);
            }
        }
        for (value, share) in self.parameters_mut().iter_mut().zip(shares) {
            *value = value.clamp(low, high) + share * beyond(*value);
        }
    }

    /// The coefficients that count at a point, each with its weight.
    fn support(&self, p: Vec3<f64>) -> Vec<(usize, f64)> {
        match self {
            Self::Trilinear(_) => Vec::new(),
            Self::Tricubic(field) => field.support(p).collect(),
            Self::Radial(field, _) => {
                let mut weights = vec![0.0; field.parameters().len()];
                field.deposit(p, 1.0, Vec3::default(), &mut weights);
                weights.into_iter().enumerate().filter(|(_, weight)| *weight != 0.0).collect()
            }
        }
    }
}

/// The highest value at the nodes of a grid in a space, and between them.
fn highest_of(grid: &Grid<f64>, space: Space, value: &dyn Fn(Vec3<f64>) -> f64) -> Spot {
    let region = space.region();
    let nodes = (0..grid.nodes()).map(|n| grid.node(n)).filter(|p| region.height(*p) <= 0.0);
    let places = nodes.chain(space.lattice(LATTICE));
    places.map(|p| (value(p), p)).fold((f64::NEG_INFINITY, grid.low()), higher)
}

/// Whether a point of the box around a space is in it or nearly so: a climb that may leave a curved
/// boundary a little goes along it.
fn near(space: Space, gap: f64) -> impl Fn(Vec3<f64>) -> bool {
    let (region, [low, high]) = (space.region(), space.corners());
    move |p| {
        let in_box = (low.x..=high.x).contains(&p.x)
            && (low.y..=high.y).contains(&p.y)
            && (low.z..=high.z).contains(&p.z);
        let is_inside = |p: Vec3<f64>| region.height(p) <= 0.0;
        in_box && (is_inside(p) || AXES.iter().any(|to| is_inside(p + *to * gap)))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::grin_task::task::FieldKind;

    /// A field that waves so strongly that it is beyond its range inside and outside the space.
    fn wild(kind: FieldKind) -> Medium {
        let mut medium = Medium::of(kind, 9, |_| 1.3).unwrap();
        let wave = |i: usize| 1.3 + 3.0 * (0.7 * i as f64).sin();
        let numbers = medium.parameters_mut().iter_mut().enumerate();
        numbers.for_each(|(i, value)| *value = wave(i));
        medium
    }

    #[test]
    fn a_spline_is_put_within_its_range_and_not_changed_where_it_is_there() {
        let (space, range) = (Space::Ball { radius: 1.0 }, [1.0, 1.6]);
        for kind in [
            FieldKind::Tricubic { half: 1.0 },
            FieldKind::Sphere { radius: 1.0 },
            FieldKind::Cylinder { radius: 1.0 },
        ] {
            let wild = wild(kind);
            let before = [Bound::Low, Bound::High].map(|bound| wild.extreme(&[space], bound).0);
            assert!(before[0] < 0.95 && before[1] > 1.65, "{kind:?}: {before:?}");
            let kept = wild.bounded(&[space], range);
            for i in 0..40_000 {
                let t = f64::from(i);
                let side = |golden: f64| 2.0 * (t * golden).fract() - 1.0;
                let p = Vec3::new(side(0.8191725), side(0.6710436), side(0.5497005));
                let index = kept.field().sample(p).index;
                let inside = p.dot(p) <= 1.0;
                assert!(!inside || (1.0 - 1e-9..=1.6 + 1e-9).contains(&index), "{kind:?} {index}");
            }
            assert_eq!(kept.bounded(&[space], range), kept, "once is enough");
            assert_eq!(wild.bounded(&[space], [0.0, 3.0]), wild, "{kind:?}");
        }
    }

    #[test]
    fn only_what_counts_at_a_broken_place_is_taken_back() {
        let mut medium = Medium::of(FieldKind::Tricubic { half: 1.0 }, 9, |_| 1.5).unwrap();
        let last = medium.parameters_mut().len() - 1;
        medium.parameters_mut()[0] = 100.0;
        medium.parameters_mut()[last] = 1.7;
        let kept = medium.bounded(&[Space::Cube { half: 1.0 }], [1.0, 1.6]);
        let parameters = kept.field().parameters();
        assert!(parameters[0] < 100.0 && parameters[0] > 1.6, "{}", parameters[0]);
        assert_eq!(parameters[1..], medium.field().parameters()[1..], "far away nothing changes");
        let (most, _) = kept.extreme(&[Space::Cube { half: 1.0 }], Bound::High);
        assert!(most <= 1.6 && most > 1.59, "{most}");
    }
}
