//! The expected mean square spot of lenses that are made, and its gradient by the design.
//!
//! `E = S₀ + ½ Σ σᵢ² ∂²S/∂pᵢ²`. Its derivative by a number of the design is a third derivative of `S`,
//! which rays over nested dual numbers carry: the design numbers are errors too, whose first derivative
//! is asked for.

use super::{Beam, Jet2, MeritOptions, Merits, NominalLens, ToleranceError, merits, perturb};
use crate::lens::{Perturbation, Tolerance};
use crate::math::Dual;
use rayon::prelude::*;

/// Design numbers that are differentiated by at once.
const LANES: usize = 4;

/// A second-order jet by an error, with its derivatives by design numbers.
type DesignJet = Dual<Jet2, LANES>;

/// Twice a number: at the image plane of the lens as designed, and at the best focus of each lens.
pub type FixedAndRefocused = [f64; 2];

/// The expected mean square spot radius and its derivatives.
#[derive(Debug, Clone, PartialEq)]
pub struct AsBuiltGradient {
    /// The mean square of the lens as designed, in mm².
    pub nominal: FixedAndRefocused,
    /// The expected mean square of the lenses that are made, in mm².
    pub expected: FixedAndRefocused,
    /// The derivative of the expectation by each design number, in the order in which they were asked
    /// for, with rays and tolerances held.
    pub gradient: Vec<FixedAndRefocused>,
}

/// The expected mean square spot to second order and its gradient. A design number is named as the
/// error of making that changes it: curvature, thickness, index, conic constant, asphere.
///
/// # Errors
/// An error that is not possible, or a lens whose rays do not arrive.
pub fn as_built_gradient(
    lens: &NominalLens,
    beam: &Beam,
    options: MeritOptions,
    tolerances: &[Tolerance],
    design: &[Perturbation],
) -> Result<AsBuiltGradient, ToleranceError> {
    let options = MeritOptions { wavefront: None, ..options };
    let nominal = merits(&lens.systems, beam, options)?;
    let nominal = [nominal.mean_square(), nominal.mean_square_focused()];
    let (mut expected, mut gradient) = (nominal, Vec::with_capacity(design.len()));
    for (number, some) in design.chunks(LANES).enumerate() {
        let terms: Result<Vec<_>, _> = tolerances
            .par_iter()
            .map(|tolerance| term(lens, beam, options, (tolerance, some)))
            .collect();
        let terms = terms?;
        let mut sums = [[0.0; 2]; LANES];
        for (i, (excess, slopes)) in terms.iter().enumerate() {
            if number == 0 {
                (0..2).for_each(|focus| expected[focus] += excess[focus]);
            }
            for (sum, slope) in sums.iter_mut().zip(slopes) {
                add_slope(sum, slope, i == 0);
            }
        }
        gradient.extend_from_slice(&sums[..some.len()]);
    }
    Ok(AsBuiltGradient { nominal, expected, gradient })
}

/// Adds the derivative of the excess by one error, and with the first one that of the nominal value.
fn add_slope(sum: &mut [f64; 2], slope: &[DesignSlope; 2], is_first: bool) {
    for (sum, slope) in sum.iter_mut().zip(slope) {
        *sum += slope.second + if is_first { slope.value } else { 0.0 };
    }
}

/// The derivative of the nominal value by a design number, and that of the excess by one error.
#[derive(Clone, Copy, Default)]
struct DesignSlope {
    value: f64,
    second: f64,
}

/// The contribution of one error to the expectation, and the derivatives by some design numbers.
type ExcessTerm = (FixedAndRefocused, [[DesignSlope; 2]; LANES]);

fn term(
    lens: &NominalLens,
    beam: &Beam,
    options: MeritOptions,
    (tolerance, design): (&Tolerance, &[Perturbation]),
) -> Result<ExcessTerm, ToleranceError> {
    let by_error = Jet2::variable(Dual::variable(0.0, 0), 0);
    let zero = Jet2::default();
    let mut errors: Vec<(Perturbation, DesignJet)> =
        design.iter().enumerate().map(|(i, d)| (*d, DesignJet::variable(zero, i))).collect();
    errors.push((tolerance.error, DesignJet::constant(by_error)));
    let found: Merits<DesignJet> = merits(&perturb(lens, &errors)?, beam, options)?;
    let half = 0.5 * tolerance.deviation().powi(2);
    let both = [found.mean_square(), found.mean_square_focused()];
    let excess = both.map(|s| half * s.value.slope[0].slope[0]);
    let slope = |i: usize| {
        both.map(|s| DesignSlope {
            value: s.slope[i].value.value,
            second: half * s.slope[i].slope[0].slope[0],
        })
    };
    Ok((excess, std::array::from_fn(slope)))
}
