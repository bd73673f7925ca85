//! Overlap integrals of two shifted polynomials, column by column, with vector instructions.
//!
//! Along a column a polynomial in two cosines is one in a single cosine. Columns of a strip are computed
//! together, a node of each at a time, so that each step of a recurrence is a vector instruction. If columns
//! lie across the shift, both pupils have the same argument along them, and the difference of their phases is a
//! single polynomial.

use super::overlap::{Columns, Strip, rule};
use super::polynomial::{ColumnPolynomials, Row, WIDTH, WavePolynomial};
use super::pupil_function::TransferShift;
use crate::math::{SimdWidth, run_vectorized, sin_cos_turns};
use std::f64::consts::PI;

/// The polynomials of two shifted pupils along the columns of a strip.
#[derive(Debug)]
pub(super) struct ColumnPair {
    columns: Columns,
    /// The path differences in waves, of both pupils or of the first minus the second.
    waves: Vec<ColumnPolynomials>,
    /// The amplitudes of both; none where the phase alone is looked at.
    amplitudes: Vec<ColumnPolynomials>,
    shift: TransferShift,
    axis: usize,
}

/// The columns from one on, as many as are computed together.
#[derive(Debug, Clone, Copy)]
struct Block {
    from: usize,
    count: usize,
}

/// The places at which the phase is looked at, across and along a strip.
const LOOKED: usize = 8;

impl ColumnPair {
    /// The polynomials along so many columns.
    pub(super) fn new(
        polynomial: &WavePolynomial,
        strip: &Strip<'_>,
        shift: TransferShift,
        count: usize,
    ) -> Self {
        let pair = Self::at(polynomial, strip, shift, &rule(count));
        let [first, second] = pair.parts(polynomial, 1);
        Self { amplitudes: vec![first, second], ..pair }
    }

    /// The path differences (0) or the amplitudes (1) of both pupils.
    fn parts(&self, polynomial: &WavePolynomial, part: usize) -> [ColumnPolynomials; 2] {
        let across = self.shift.cosines[self.axis];
        [across, -across].map(|by| {
            let places: Vec<f64> = self.columns.t.iter().map(|t| t + by).collect();
            polynomial.columns(part, self.axis, &places)
        })
    }

    fn at(
        polynomial: &WavePolynomial,
        strip: &Strip<'_>,
        shift: TransferShift,
        shares: &[(f64, f64)],
    ) -> Self {
        let (waves, amplitudes, axis) = (Vec::new(), Vec::new(), strip.axis);
        let pair = Self { columns: strip.columns(shares), waves, amplitudes, shift, axis };
        let [first, second] = pair.parts(polynomial, 0);
        let is_across = shift.cosines[1 - axis] == 0.0;
        let waves = if is_across { vec![first.minus(&second)] } else { vec![first, second] };
        Self { waves, ..pair }
    }

    /// The Gauss nodes across a strip and along its columns that resolve the phase there: π times its
    /// largest change in turns by the angle of Chebyshev points.
    pub(super) fn resolving_nodes(
        polynomial: &WavePolynomial,
        strip: &Strip<'_>,
        shift: TransferShift,
    ) -> [f64; 2] {
        let step = PI / LOOKED as f64;
        let share = |i: usize| (0.5 * step * (i as f64 + 0.5)).sin().powi(2);
        let shares: [(f64, f64); LOOKED] = std::array::from_fn(|i| (share(i), 1.0));
        let pair = Self::at(polynomial, strip, shift, &shares);
        let block = Block { from: 0, count: LOOKED };
        let mut phases = [[0.0; WIDTH]; LOOKED];
        run_vectorized(
            SimdWidth::detect(),
            #[inline(always)]
            || {
                for (phase, (share, _)) in phases.iter_mut().zip(shares) {
                    *phase = pair.phases(block, &pair.places(block, share));
                }
            },
        );
        let change = |a: f64, b: f64| PI * (b - a).abs() / step;
        let mut nodes = [0.0f64; 2];
        for (i, row) in phases.iter().enumerate() {
            for k in 1..LOOKED {
                nodes[0] = nodes[0].max(change(row[k - 1], row[k]));
                nodes[1] = nodes[1].max(change(phases[k - 1][i], phases[k][i]));
            }
        }
        nodes
    }

    /// The integral with so many nodes a column.
    pub(super) fn sum(&self, nodes: usize) -> [f64; 2] {
        let nodes = rule(nodes);
        let mut sum = [0.0; 2];
        let all = self.columns.t.len();
        for from in (0..all).step_by(WIDTH) {
            let block = Block { from, count: WIDTH.min(all - from) };
            let [re, im] = run_vectorized(
                SimdWidth::detect(),
                #[inline(always)]
                || self.sum_block(block, &nodes),
            );
            for k in 0..block.count {
                let i = from + k;
                let [low, high] = &self.columns.ends;
                let area = self.columns.weight[i] * (high[i] - low[i]);
                sum = [sum[0] + area * re[k], sum[1] + area * im[k]];
            }
        }
        sum
    }

    /// The sums of some columns.
    #[inline(always)]
    fn sum_block(&self, block: Block, nodes: &[(f64, f64)]) -> [Row; 2] {
        let (mut re, mut im) = ([0.0; WIDTH], [0.0; WIDTH]);
        for (share, weight) in nodes {
            let places = self.places(block, *share);
            let phase = self.phases(block, &places);
            let mut amplitude = [*weight; WIDTH];
            for (polynomial, places) in self.amplitudes.iter().zip(&places) {
                let values = polynomial.values(block.from, block.count, places);
                for k in 0..WIDTH.min(block.count) {
                    amplitude[k] *= values[k];
                }
            }
            for k in 0..WIDTH.min(block.count) {
                let (sin, cos) = sin_cos_turns(phase[k]);
                re[k] += amplitude[k] * cos;
                im[k] -= amplitude[k] * sin;
            }
        }
        [re, im]
    }

    /// The places in the first and in the second pupil at a share of the columns.
    #[inline(always)]
    fn places(&self, Block { from, count }: Block, share: f64) -> [Row; 2] {
        let by = self.shift.cosines[1 - self.axis];
        let [low, high] = self.columns.ends.each_ref().map(|ends| &ends[from..from + count]);
        let mut places = [[0.0; WIDTH]; 2];
        for k in 0..WIDTH.min(count) {
            let v = low[k] + share * (high[k] - low[k]);
            (places[0][k], places[1][k]) = (v + by, v - by);
        }
        places
    }

    /// The phases of the first pupil minus those of the second, in turns.
    #[inline(always)]
    fn phases(&self, block: Block, places: &[Row; 2]) -> Row {
        let mut phases = self.waves[0].values(block.from, block.count, &places[0]);
        if let Some(other) = self.waves.get(1) {
            let other = other.values(block.from, block.count, &places[1]);
            for k in 0..WIDTH.min(block.count) {
                phases[k] -= other[k];
            }
        }
        if self.shift.defocus != 0.0 {
            let across = self.shift.cosines[self.axis];
            let third = |t: f64, v: f64| (1.0 - t * t - v * v).max(0.0).sqrt();
            for (k, t) in self.columns.t[block.from..].iter().take(block.count).enumerate() {
                let off = third(t + across, places[0][k]) - third(t - across, places[1][k]);
                phases[k] -= self.shift.defocus * off;
            }
        }
        phases
    }
}
