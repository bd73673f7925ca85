//! The system of a lens for given rays, whose derivatives become derivatives by variables.

use super::MeritError;
use super::binding::{Configuration, ResolvedSystems, resolve_for_variables};
use crate::lens::{Lens, Parameter, System, Variable, Wavelength};
use crate::trace::SystemGradient;

/// The system of a lens at one zoom position and wavelength, as a function of some of the numbers of
/// the lens: pickups follow them, as do the solved image distance and the indices of model glasses.
#[derive(Debug)]
pub struct VariableSystem {
    system: System<f64>,
    configuration: Configuration,
    resolved: ResolvedSystems,
    wavelength: usize,
}

impl VariableSystem {
    /// The system at a wavelength in µm, as a function of these numbers of the lens.
    ///
    /// # Errors
    /// [`MeritError::NoVariables`] for a number that the lens does not have, and the errors of a lens
    /// that cannot be resolved.
    pub fn new(
        lens: &Lens,
        zoom: usize,
        um: f64,
        parameters: &[Parameter],
    ) -> Result<Self, MeritError> {
        if parameters.iter().any(|parameter| lens.get(*parameter).is_none()) {
            return Err(MeritError::NoVariables);
        }
        let variable =
            |parameter: &Parameter| Variable { parameter: *parameter, min: None, max: None };
        let variables = parameters.iter().map(variable).collect();
        let mut lens = Lens { variables, ..lens.clone() };
        let known = lens.wavelengths.iter().position(|w| w.um == um);
        let wavelength = known.unwrap_or(lens.wavelengths.len());
        if known.is_none() {
            lens.wavelengths.push(Wavelength { um, weight: 1.0, primary: false });
        }
        let system = resolve_for_variables(&lens, zoom, um)?;
        let configuration = Configuration::new(&lens, zoom)?;
        let values: Vec<f64> = parameters.iter().filter_map(|p| lens.get(*p)).collect();
        let resolved = configuration.at(&values)?;
        Ok(Self { system, configuration, resolved, wavelength })
    }

    /// The system, with the semi-diameters of the lens as they are written.
    pub fn system(&self) -> &System<f64> {
        &self.system
    }

    /// The derivatives by the numbers of the lens of a result with these derivatives by the numbers
    /// of the system.
    pub fn by_parameters(&self, gradient: &SystemGradient<f64>) -> Vec<f64> {
        let by = self.configuration.by_variables(&self.resolved, self.wavelength, gradient);
        by.iter().copied().collect()
    }
}
