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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::lens::Parameter;
    use crate::search::Refusal;
    use crate::search::lens_landscape::SearchPlan;
    use crate::search::{Landscape as _, MutationWeights};
    use rand::SeedableRng as _;

    /// The landscape of the Tessar in which lenses are displaced and nothing else.
    fn landscape() -> LensLandscape {
        let found =
            crate::files::bundled_lenses().iter().find(|b| b.name == "tessar_50_f28").unwrap();
        let lens = crate::files::json::read(found.text, found.name).unwrap();
        let mut plan = SearchPlan::default();
        let weight = |kind| f64::from(u8::from(kind == MutationKind::Displacement));
        plan.rules.weights = MutationKind::PERTURBATIONS.map(|kind| (kind, weight(kind))).to_vec();
        plan.landscape(&lens).unwrap()
    }

    #[test]
    fn a_displacement_changes_every_variable_within_its_bounds_and_nothing_else() {
        let landscape = landscape();
        let start = landscape.with_variables(landscape.start());
        for seed in 0..20 {
            let mut random = Random::seed_from_u64(seed);
            let weights = MutationWeights::default();
            let found = landscape.perturb(landscape.start(), &weights, &mut random).unwrap();
            assert_eq!(found.kind, MutationKind::Displacement);
            assert_eq!(landscape.topology(&found.point), landscape.topology(landscape.start()));
            let value = |lens: &Lens, parameter: Parameter| lens.get(parameter).unwrap();
            for variable in &start.variables {
                let [before, after] =
                    [&start, &*found.point].map(|lens| value(lens, variable.parameter));
                let inside = variable.min.is_none_or(|min| after >= min)
                    && variable.max.is_none_or(|max| after <= max);
                let held = variable.min.is_some() && variable.min == variable.max;
                let at_bound = Some(after) == variable.min || Some(after) == variable.max;
                assert!(inside && (held || at_bound || after != before), "{variable:?} {after}");
            }
            let fixed = start.surfaces.iter().zip(&found.point.surfaces);
            assert!(fixed.into_iter().all(|(a, b)| a.medium == b.medium && a.stop == b.stop));
        }
    }

    #[test]
    fn a_displacement_is_no_mutation_of_restore() {
        let listed = landscape();
        let weights = MutationWeights::default();
        let drawn = listed.mutate(listed.start(), &weights, &mut Random::seed_from_u64(1));
        assert_eq!(drawn.unwrap_err().refusal, Refusal::AllExcluded);
    }
}
