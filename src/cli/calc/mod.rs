//! `calc`: numbers of pupils, coatings, light and sensors without a lens.

mod coating;
mod light;
mod pupil;

use super::error::CliError;
use super::output::Output;
use clap::Subcommand;

/// Pupils, coatings, light and sensors without a lens: the numbers that books give formulas for
#[derive(Debug, clap::Args)]
#[command(after_long_help = include_str!("../help/calc.txt"))]
pub(super) struct CalcArgs {
    #[command(subcommand)]
    what: CalcCommand,
}

/// The numbers that are computed.
#[derive(Debug, Subcommand)]
enum CalcCommand {
    Pupil(pupil::PupilArgs),
    Coating(coating::CoatingArgs),
    Photons(light::PhotonArgs),
    BlackBody(light::BlackBodyArgs),
    Noise(light::NoiseArgs),
    Smear(light::SmearArgs),
    Blur(light::BlurArgs),
}

impl CalcArgs {
    pub(super) fn run(&self, output: &Output) -> Result<(), CliError> {
        match &self.what {
            CalcCommand::Pupil(pupil) => pupil.run(output),
            CalcCommand::Coating(coating) => coating.run(output),
            CalcCommand::Photons(photons) => photons.run(output),
            CalcCommand::BlackBody(body) => body.run(output),
            CalcCommand::Noise(noise) => noise.run(output),
            CalcCommand::Smear(smear) => smear.run(output),
            CalcCommand::Blur(blur) => blur.run(output),
        }
    }
}

/// A number with its name, whether it holds, and what is expected.
type NumberCheck = (&'static str, f64, bool, &'static str);

/// Refuses the first number that does not hold.
fn check(numbers: &[NumberCheck]) -> Result<(), CliError> {
    match numbers.iter().find(|(_, _, holds, _)| !holds) {
        Some((name, found, _, expected)) => {
            Err(CliError::Input(format!("{name}: found {found}; expected {expected}")))
        }
        None => Ok(()),
    }
}
