//! Displacements of all variables at once, after which a descent may end in another minimum: the
//! perturbation of basin hopping (Wales, Doye, J. Phys. Chem. A 101, 5111, 1997), which changes no
//! structure.

use super::LensLandscape;
use super::langevin_units::langevin_unit;
use crate::lens::Lens;
use crate::search::mutation::StructureChange;
use crate::search::{MutatedPoint, MutationError, MutationKind, Random};
use rand::RngExt as _;
use rand_distr::StandardNormal;
use std::sync::Arc;

/// The range of the standard deviation of displacements, in units that deflect rays by similar amounts. It is
/// drawn evenly by its logarithm, since the best size differs between lenses by more than a factor of two.
const SIZES: [f64; 2] = [0.05, 0.5];

impl LensLandscape {
    /// The lens with every variable displaced by a normal deviate, within its bounds.
    pub(super) fn displaced(
        &self,
        lens: &Arc<Lens>,
        random: &mut Random,
    ) -> Result<MutatedPoint<Arc<Lens>>, MutationError> {
        let kind = MutationKind::Displacement;
        let refuse = |refusal| MutationError::new(kind, refusal);
        let size = SIZES[0] * (SIZES[1] / SIZES[0]).powf(random.random());
        let mut there = Lens::clone(lens);
        for variable in &self.with_variables(lens).variables {
            let unit = langevin_unit(lens, variable.parameter, self.variable_rules.size);
            let Some(value) = lens.get(variable.parameter) else { continue };
            let low = variable.min.unwrap_or(f64::NEG_INFINITY);
            let high = variable.max.unwrap_or(f64::INFINITY);
            let deviate: f64 = random.sample(StandardNormal);
            there.set(variable.parameter, (value + size * unit * deviate).max(low).min(high));
        }
        let point = Arc::new(there.with_pickups().map_err(|error| refuse(error.into()))?);
        let record = StructureChange::Displacement { size }.into();
        Ok(MutatedPoint { point, kind, record, log_ratio: None, gradients: 0 })
    }
}
