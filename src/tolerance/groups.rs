//! The shares of errors of making, summed over the parts of a lens and over their kinds.

use crate::lens::{Lens, Perturbation, PerturbationKind, ToleranceSheet};
use serde::Serialize;
use std::collections::BTreeMap;

/// The part of a lens to which an error of making belongs.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum LensPart {
    /// An element, cemented ones together; a surface that is part of none by itself.
    Element,
    /// The gap behind a surface that lies in no element.
    Gap,
    /// Several elements that move together.
    Group,
}

impl LensPart {
    /// Its name in tables.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Element => "element",
            Self::Gap => "gap",
            Self::Group => "group",
        }
    }
}

/// The sum of the shares of the errors of a part of a lens.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct PartShare {
    /// The part.
    pub part: LensPart,
    /// Its first surface, counted from 0.
    pub first: usize,
    /// Its last surface, counted from 0.
    pub last: usize,
    /// The number of errors.
    pub errors: usize,
    /// Their share in the growth of the mean square at the fixed image plane.
    pub fixed: f64,
    /// The same with each lens refocused.
    pub refocused: f64,
}

/// The sum of the shares of the errors of a kind.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct KindShare {
    /// The kind.
    pub kind: PerturbationKind,
    /// The number of errors.
    pub errors: usize,
    /// Their share in the growth of the mean square at the fixed image plane.
    pub fixed: f64,
    /// The same with each lens refocused.
    pub refocused: f64,
}

/// The part of a lens that an error belongs to, with its surfaces.
fn part_of(lens: &Lens, error: Perturbation) -> (LensPart, usize, usize) {
    let Perturbation { kind, first, last } = error;
    let around = lens.element_around(first);
    let is_gap = matches!(kind, PerturbationKind::Thickness | PerturbationKind::ThicknessAdjusted);
    match around {
        Some((from, to)) if is_gap && first < to => (LensPart::Element, from, to),
        _ if is_gap => (LensPart::Gap, first, first),
        Some((from, to)) if last <= to => (LensPart::Element, from, to),
        None if first == last => (LensPart::Element, first, first),
        _ => (LensPart::Group, first, last),
    }
}

/// Errors with their number and the sums of both shares.
type Sums = (usize, [f64; 2]);

fn summed<K: Ord>(
    sheet: &ToleranceSheet,
    shares: &[[f64; 2]],
    key: impl Fn(Perturbation) -> K,
) -> Vec<(K, Sums)> {
    let mut sums: BTreeMap<K, Sums> = BTreeMap::new();
    for (tolerance, share) in sheet.errors.iter().zip(shares) {
        let (errors, sum) = sums.entry(key(tolerance.error)).or_default();
        *errors += 1;
        sum.iter_mut().zip(share).for_each(|(sum, share)| *sum += share);
    }
    let mut sums: Vec<_> = sums.into_iter().collect();
    sums.sort_by(|(_, (_, a)), (_, (_, b))| b[1].total_cmp(&a[1]));
    sums
}

/// The shares of all errors at the fixed image plane and refocused, summed over the parts of a lens,
/// the largest refocused one first.
pub fn shares_by_part(lens: &Lens, sheet: &ToleranceSheet, shares: &[[f64; 2]]) -> Vec<PartShare> {
    let of = |((part, first, last), (errors, [fixed, refocused])): (_, Sums)| PartShare {
        part,
        first,
        last,
        errors,
        fixed,
        refocused,
    };
    summed(sheet, shares, |error| part_of(lens, error)).into_iter().map(of).collect()
}

/// The same summed over the kinds of errors.
pub fn shares_by_kind(sheet: &ToleranceSheet, shares: &[[f64; 2]]) -> Vec<KindShare> {
    let of = |(kind, (errors, [fixed, refocused])): (_, Sums)| KindShare {
        kind,
        errors,
        fixed,
        refocused,
    };
    summed(sheet, shares, |error| error.kind).into_iter().map(of).collect()
}
