//! Aspheric surfaces in a search: where one promises most, and what it costs.
//!
//! The conic constant or the next coefficient of a surface joins the variables at its present value, and the
//! derivatives of one evaluation predict what each of them takes from the merit.

use super::LensLandscape;
use crate::lens::{Lens, Parameter};
use crate::merit::{DerivativeLevel, MeritError};
use crate::search::predicted_gain::{QuadraticModel, drawn_by_weight};
use crate::search::{
    MutatedPoint, MutationError, MutationKind, Random, Refusal, SearchRules, StructureChange,
    mutation,
};
use rand::RngExt as _;
use std::sync::Arc;

/// The loss relative to the merit that an aspheric surface costs: one is kept only if it gains more.
const PRICE: f64 = 0.01;
/// The gain relative to the merit from which an aspheric number is tried.
const LEAST_GAIN: f64 = 0.02;

/// The gain that an aspheric number promises.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct AsphereGain {
    /// The number.
    pub parameter: Parameter,
    /// The predicted decrease of the merit, relative to it.
    pub gain: f64,
}

impl LensLandscape {
    /// The number of aspheric surfaces that are priced: all of them where the rules permit any.
    pub(super) fn priced_aspheres(&self, lens: &Lens) -> usize {
        if self.rules.aspheres == 0 { 0 } else { mutation::aspheric_rows(lens).len() }
    }

    /// The loss of a lens with this merit: each aspheric surface adds a hundredth of it where the rules permit
    /// any.
    pub(super) fn priced(&self, lens: &Lens, merit: f64) -> f64 {
        merit + PRICE * self.priced_aspheres(lens) as f64 * merit.abs()
    }

    /// The gain of each aspheric number that may vary in addition.
    ///
    /// # Errors
    /// The lens has no merit.
    pub fn asphere_gains(&self, lens: &Lens) -> Result<Vec<AsphereGain>, MeritError> {
        let sites = mutation::asphere_sites(lens, &self.rules).unwrap_or_default();
        self.gains_of(lens, &sites)
    }

    fn gains_of(&self, lens: &Lens, sites: &[Parameter]) -> Result<Vec<AsphereGain>, MeritError> {
        if sites.is_empty() {
            return Ok(Vec::new());
        }
        let add = |lens: Lens, site: &Parameter| mutation::with_aspheric_number(&lens, *site);
        let marked = sites.iter().fold(lens.clone(), add);
        let merit = self.merit(&marked, self.local.tolerance)?;
        let sum = merit.evaluate(&merit.values(&marked), DerivativeLevel::Normal)?;
        let parameters: Vec<Parameter> = merit.variables().iter().map(|v| v.parameter).collect();
        let is_new = |i: usize| sites.contains(&parameters[i]);
        let half_gradient = &sum.gradient * 0.5;
        let Some(model) = QuadraticModel::new(&half_gradient, &sum.normal, is_new) else {
            return Ok(Vec::new());
        };
        let gain = |site: &Parameter| {
            let number = parameters.iter().position(|parameter| parameter == site)?;
            let gain = model.gain(number)? / sum.value.abs().max(f64::MIN_POSITIVE);
            Some(AsphereGain { parameter: *site, gain })
        };
        Ok(sites.iter().filter_map(gain).collect())
    }

    /// Lets an aspheric number vary, drawn in proportion to what each promises.
    pub(super) fn add_asphere(
        &self,
        lens: &Arc<Lens>,
        rules: &SearchRules,
        random: &mut Random,
    ) -> Result<MutatedPoint<Arc<Lens>>, MutationError> {
        let kind = MutationKind::AddAsphere;
        let refuse = |refusal| MutationError::new(kind, refusal);
        let sites = mutation::asphere_sites(lens, rules).map_err(refuse)?;
        let gains = self.gains_of(lens, &sites).ok().ok_or_else(|| refuse(Refusal::NoLoss))?;
        let promising = gains.iter().filter(|found| found.gain > LEAST_GAIN);
        let promising: Vec<_> = promising.map(|found| (found.parameter, found.gain)).collect();
        let drawn = drawn_by_weight(&promising, random.random());
        let parameter = drawn.ok_or_else(|| refuse(Refusal::NoAsphereGain))?;
        let Parameter { surface, quantity, .. } = parameter;
        let change = StructureChange::AddAsphere { surface: surface.into(), quantity };
        let point = Arc::new(mutation::with_aspheric_number(lens, parameter));
        Ok(MutatedPoint { point, kind, record: change.into(), log_ratio: None, gradients: 1 })
    }
}
