//! Triplets as starts, by equations: powers and gaps of three thin lenses, then their bendings.
//!
//! The three powers and two gaps follow from five conditions (Kingslake, *Lens Design Fundamentals*, 14.5;
//! Conrady): the power of the whole, no axial colour `Σ y² φ/V`, no lateral colour `Σ y ȳ φ/V` for a
//! stop at the middle lens, a Petzval sum `Σ φ/n`, and a ratio of the gaps. The bendings then leave no
//! third-order spherical aberration, coma and astigmatism of the thick lens. Both are found by Newton's
//! method.

use super::LensRequirements;
use super::draft::LensDraft;
use super::judge::asked_object;
use super::starts::{NamedDraft, cleared};
use crate::lens::{Aperture, Lens, Medium, Row, blank, paraxial_image_distance};
use crate::paraxial::{Beam, first_order, seidel};
use nalgebra::{DMatrix, DVector, SVector};

/// The glasses of triplets: the outer lenses and the middle one, each with index and Abbe number.
const GLASSES: [[(f64, f64); 2]; 2] =
    [[(1.6204, 60.3), (1.62, 36.4)], [(1.6968, 55.5), (1.6727, 32.2)]];
/// The Petzval sums relative to the power, and the ratio of the gaps.
const PETZVAL: f64 = 0.35;
const GAP_RATIO: f64 = 1.0;
/// The thickness of each lens relative to the focal length.
const THICKNESS: f64 = 0.04;
/// Newton steps, and the largest remainder of the equations.
const STEPS: usize = 40;
const SOLVED: f64 = 1e-9;
/// The first bendings of the three lenses: the curvature in front relative to the power over `n − 1`.
const BENDINGS: [[f64; 3]; 3] = [[0.9, 0.5, 0.2], [1.1, 0.4, 0.0], [0.7, 0.6, 0.4]];
/// The step of curvatures for differences, and the longest step of one, times the focal length.
const DIFFERENCE: f64 = 1e-6;
const LONGEST_STEP: f64 = 0.5;
/// The Newton steps of the bendings.
const BENDING_STEPS: usize = 30;

/// Three thin lenses of a power of 1.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct ThinTriplet {
    /// Their powers.
    pub(super) powers: [f64; 3],
    /// The gaps between them.
    pub(super) gaps: [f64; 2],
}

impl ThinTriplet {
    /// The powers and gaps for lenses of these glasses; `None` if the equations have no such solution near the
    /// usual one.
    pub(super) fn solve(glasses: [(f64, f64); 2]) -> Option<Self> {
        let mut at = SVector::<f64, 5>::from([2.0, -3.5, 2.0, 0.15, 0.15]);
        for _ in 0..STEPS {
            let errors = Self::of(&at).errors(glasses);
            if errors.amax() < SOLVED {
                let found = Self::of(&at);
                let is_usual = found.gaps.iter().all(|gap| (0.01..0.6).contains(gap))
                    && found.powers[0] > 0.0
                    && found.powers[1] < 0.0;
                return is_usual.then_some(found);
            }
            let mut jacobian = nalgebra::SMatrix::<f64, 5, 5>::zeros();
            for i in 0..5 {
                let mut there = at;
                there[i] += DIFFERENCE;
                let column = (Self::of(&there).errors(glasses) - errors) / DIFFERENCE;
                jacobian.set_column(i, &column);
            }
            let step = jacobian.lu().solve(&errors)?;
            // Powers change by at most a half, so that the gaps stay what they are.
            at -= step * (0.5 / step.amax().max(0.5));
        }
        None
    }

    fn of(at: &SVector<f64, 5>) -> Self {
        Self { powers: [at[0], at[1], at[2]], gaps: [at[3], at[4]] }
    }

    /// The remainders of the five conditions.
    fn errors(&self, [outer, middle]: [(f64, f64); 2]) -> SVector<f64, 5> {
        let Self { powers: [a, b, c], gaps: [front, rear] } = *self;
        let (indices, abbe) = ([outer.0, middle.0, outer.0], [outer.1, middle.1, outer.1]);
        // A marginal ray from infinity at a height of 1.
        let second = 1.0 - front * a;
        let slope = -a - second * b;
        let third = second + rear * slope;
        let power = third * c - slope;
        let heights = [1.0, second, third];
        let chief = [-front, 0.0, rear];
        let sum = |of: &dyn Fn(usize) -> f64| (0..3).map(of).sum::<f64>();
        let powers = [a, b, c];
        SVector::from([
            power - 1.0,
            10.0 * sum(&|i| heights[i] * heights[i] * powers[i] / abbe[i]),
            10.0 * sum(&|i| heights[i] * chief[i] * powers[i] / abbe[i]),
            sum(&|i| powers[i] / indices[i]) - PETZVAL,
            front - GAP_RATIO * rear,
        ])
    }
}

/// Triplets for what is asked for; none where fewer than three elements are permitted.
pub(super) fn triplets(asked: &LensRequirements) -> Vec<NamedDraft> {
    let mut found = Vec::new();
    if asked.elements < 3 {
        return found;
    }
    for glasses in GLASSES {
        let Some(thin) = ThinTriplet::solve(glasses) else { continue };
        let drafts =
            BENDINGS.into_iter().filter_map(|bending| bent(&thin, glasses, bending, asked));
        let best = drafts.min_by(|a, b| a.0.total_cmp(&b.0));
        found.extend(best.map(|(_, draft)| NamedDraft { name: "thin triplet".to_owned(), draft }));
    }
    found
}

/// The triplet of thick lenses with the bendings that leave least of the third-order aberrations, starting
/// from some; with what is left of them. `None` if it forms no image.
fn bent(
    thin: &ThinTriplet,
    glasses: [(f64, f64); 2],
    bending: [f64; 3],
    asked: &LensRequirements,
) -> Option<(f64, LensDraft)> {
    let f = asked.thin_focal_length();
    let lens = |fronts: &DVector<f64>| thick(thin, glasses, fronts.as_slice(), asked);
    let index = |i: usize| glasses[i % 2].0;
    let mut fronts = DVector::from_fn(3, |i, _| bending[i] * thin.powers[i] / (index(i) - 1.0) / f);
    let mut left = third_order(&lens(&fronts))?;
    for _ in 0..BENDING_STEPS {
        let step = DIFFERENCE / f;
        let mut jacobian = DMatrix::zeros(3, 3);
        for i in 0..3 {
            let mut there = fronts.clone();
            there[i] += step;
            jacobian.set_column(i, &((third_order(&lens(&there))? - &left) / step));
        }
        let Some(change) = jacobian.lu().solve(&left) else { break };
        let length = change.amax() * f;
        let mut part = (LONGEST_STEP / length.max(LONGEST_STEP)).min(1.0);
        let mut next = None;
        while next.is_none() && part > 1e-3 {
            let there = &fronts - &change * part;
            let sums = third_order(&lens(&there)).filter(|sums| sums.norm() < left.norm());
            next = sums.map(|sums| (there, sums));
            part *= 0.5;
        }
        let Some(better) = next else { break };
        (fronts, left) = better;
    }
    let mut lens = lens(&fronts);
    let system = lens.resolve(0, lens.wavelengths[lens.primary()].um).ok()?;
    let image = paraxial_image_distance(&system, asked_object(asked));
    let pupil = first_order(&system, &Beam::for_lens(&lens, 0)).ok()?.entrance_pupil.position?;
    if !(image > 0.0 && image < asked.track) {
        return None;
    }
    lens.surfaces.last_mut()?.thickness = image;
    Some((left.norm(), LensDraft { lens: cleared(lens, asked), pupil }))
}

/// Spherical aberration, coma and astigmatism of the third order, in mm.
fn third_order(lens: &Lens) -> Option<DVector<f64>> {
    let system = lens.resolve(0, lens.wavelengths[lens.primary()].um).ok()?;
    let data = first_order(&system, &Beam::for_lens(lens, 0)).ok()?;
    let total = seidel(&system, &data, None)?.total;
    Some(DVector::from_vec(vec![total.s1, total.s2, total.s3]))
}

/// The lens of three thick elements with these curvatures in front, and its stop at the middle one.
fn thick(
    thin: &ThinTriplet,
    glasses: [(f64, f64); 2],
    fronts: &[f64],
    asked: &LensRequirements,
) -> Lens {
    let f = asked.thin_focal_length();
    let thickness = (THICKNESS * f).max(asked.glass_center);
    let mut rows = Vec::new();
    for (i, front) in fronts.iter().enumerate() {
        let (nd, vd) = glasses[i % 2];
        let rear = front - thin.powers[i] / (nd - 1.0) / f;
        let gap = thin.gaps.get(i).map_or(f, |gap| (gap * f - thickness).max(asked.air_center));
        let medium = Medium::Model { nd, vd };
        rows.push(Row { curvature: *front, thickness, medium, ..Row::default() });
        rows.push(Row { curvature: rear, thickness: gap, ..Row::default() });
    }
    let mut lens = cleared(Lens { surfaces: rows, ..blank() }, asked);
    lens.surfaces.iter_mut().for_each(|row| row.stop = false);
    lens.surfaces[2].stop = true;
    lens.aperture = Aperture::EntrancePupilDiameter(2.0 * asked.beam_radius());
    lens
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::search::design::LensSpecification;

    #[test]
    fn three_thin_lenses_satisfy_their_five_conditions() {
        for glasses in GLASSES {
            let thin = ThinTriplet::solve(glasses).unwrap();
            let ThinTriplet { powers: [a, b, c], gaps: [front, rear] } = thin;
            assert!(a > 0.0 && b < 0.0 && c > 0.0 && front > 0.0 && rear > 0.0, "{thin:?}");
            // The matrix of the three lenses, independently of the ray of the equations.
            let lens = |power: f64| nalgebra::Matrix2::new(1.0, 0.0, -power, 1.0);
            let gap = |length: f64| nalgebra::Matrix2::new(1.0, length, 0.0, 1.0);
            let whole = lens(c) * gap(rear) * lens(b) * gap(front) * lens(a);
            assert!((whole[(1, 0)] + 1.0).abs() < 1e-8, "{whole}");
            let petzval = (a + c) / glasses[0].0 + b / glasses[1].0;
            assert!((petzval - PETZVAL).abs() < 1e-8, "{petzval}");
            // Red and blue foci agree: powers change by a share of 1/V.
            let power = |share: f64| {
                let [x, y, z] = [a, b, c]
                    .into_iter()
                    .zip([0, 1, 0])
                    .map(|(p, i)| p * (1.0 + share / glasses[i].1))
                    .collect::<Vec<_>>()[..]
                else {
                    unreachable!()
                };
                let whole = lens(z) * gap(rear) * lens(y) * gap(front) * lens(x);
                -whole[(0, 0)] / whole[(1, 0)]
            };
            let back = [-0.5, 0.5].map(power);
            assert!((back[0] - back[1]).abs() < 1e-3, "{back:?}");
        }
    }

    #[test]
    fn a_triplet_is_bent_until_its_third_order_aberrations_vanish() {
        let spec: LensSpecification = serde_json::from_str(
            r#"{"focal_length_mm": 50.0, "f_number": 3.5, "half_field_deg": 20.0, "max_elements": 3}"#,
        )
        .unwrap();
        let asked = LensRequirements::complete(&spec).unwrap().0;
        let found = triplets(&asked);
        assert!(!found.is_empty());
        let flat = |glasses| {
            let thin = ThinTriplet::solve(glasses).unwrap();
            third_order(&thick(&thin, glasses, &[0.01, -0.02, 0.005], &asked)).unwrap().norm()
        };
        let left = |glasses| {
            let thin = ThinTriplet::solve(glasses).unwrap();
            let all = BENDINGS.into_iter().filter_map(|b| bent(&thin, glasses, b, &asked));
            all.map(|(left, _)| left).fold(f64::INFINITY, f64::min)
        };
        let best = GLASSES.map(left).into_iter().fold(f64::INFINITY, f64::min);
        assert!(best < 1e-2 * flat(GLASSES[0]), "{best} {}", flat(GLASSES[0]));
        for start in found {
            let rows = &start.draft.lens.surfaces;
            assert!(rows.len() == 6 && rows.iter().all(|row| row.thickness > 0.0));
            assert!(start.draft.pupil > 0.0, "{}", start.draft.pupil);
        }
    }
}
