//! The options that not every analysis reads: another analysis refuses them, instead of passing over them. The
//! tolerance alone, which most analyses read, is noted.

use super::{AnalysisKind, AnalyzeArgs};
use crate::cli::error::CliError;
use crate::cli::output::print_note;
use clap::ValueEnum as _;

/// An option that some analyses read.
struct SpecificOption {
    name: &'static str,
    is_given: fn(&AnalyzeArgs) -> bool,
    is_read: fn(AnalysisKind) -> bool,
}

use AnalysisKind as Kind;

/// The option of the tolerance, the first of those below.
const TOLERANCE: &str = "--error";

const SPECIFIC: [SpecificOption; 14] = [
    SpecificOption {
        name: TOLERANCE,
        is_given: |args| args.error.is_some(),
        is_read: |what| !is_by_single_rays(what),
    },
    SpecificOption {
        name: "--field",
        is_given: |args| args.field.is_some(),
        is_read: |what| !is_of_whole_lens(what),
    },
    SpecificOption {
        name: "--wavelength",
        is_given: |args| args.wavelength.is_some(),
        is_read: AnalysisKind::has_light,
    },
    SpecificOption {
        name: "--frequencies",
        is_given: |args| args.frequencies.is_some(),
        is_read: |what| matches!(what, Kind::Mtf | Kind::FieldMtf | Kind::ThroughFocusMtf),
    },
    SpecificOption {
        name: "--surface",
        is_given: |args| args.surface.is_some(),
        is_read: |what| what == Kind::Footprint,
    },
    SpecificOption {
        name: "--at",
        is_given: |args| !args.points.is_empty(),
        is_read: |what| matches!(what, Kind::Psf | Kind::Illumination),
    },
    SpecificOption {
        name: "--reach",
        is_given: |args| args.reach.is_some(),
        is_read: |what| what == Kind::Psf,
    },
    SpecificOption {
        name: "--pupil",
        is_given: |args| !args.pupil_points.is_empty(),
        is_read: |what| what == Kind::Wavefront,
    },
    SpecificOption {
        name: "--radii",
        is_given: |args| !args.radii.is_empty(),
        is_read: |what| matches!(what, Kind::EncircledEnergy | Kind::GeometricEnergy),
    },
    SpecificOption {
        name: "--wave",
        is_given: |args| args.wave.is_some(),
        is_read: |what| what == Kind::Illumination,
    },
    SpecificOption {
        name: "--coating",
        is_given: |args| args.coating.is_some(),
        is_read: |what| what == Kind::Ghosts,
    },
    SpecificOption {
        name: "--ghosts",
        is_given: |args| args.ghosts.is_some(),
        is_read: |what| what == Kind::Ghosts,
    },
    SpecificOption {
        name: "--temperatures",
        is_given: |args| args.temperatures.is_some(),
        is_read: |what| what == Kind::Thermal,
    },
    SpecificOption {
        name: "--mount",
        is_given: |args| args.mount.is_some(),
        is_read: |what| what == Kind::Thermal,
    },
];

/// True for an analysis of a number of rays that no tolerance changes.
const fn is_by_single_rays(what: AnalysisKind) -> bool {
    matches!(
        what,
        Kind::Fan
            | Kind::Distortion
            | Kind::DistortionGrid
            | Kind::LateralColor
            | Kind::Longitudinal
            | Kind::Footprint
            | Kind::FieldCurvature
            | Kind::OpdFan
            | Kind::Seidel
            | Kind::Ghosts
    )
}

/// True for an analysis that is not of single fields.
const fn is_of_whole_lens(what: AnalysisKind) -> bool {
    matches!(
        what,
        Kind::SpotMap | Kind::DistortionGrid | Kind::Longitudinal | Kind::FieldMtf | Kind::Seidel
    )
}

/// The name of an analysis on the command line.
fn name(what: AnalysisKind) -> String {
    what.to_possible_value().map_or_else(String::new, |value| value.get_name().to_owned())
}

impl AnalyzeArgs {
    /// Refuses an option that the analysis does not read.
    pub(super) fn check_options(&self) -> Result<(), CliError> {
        let mut idle = SPECIFIC
            .iter()
            .filter(|option| (option.is_given)(self) && !(option.is_read)(self.what))
            .peekable();
        if idle.next_if(|option| option.name == TOLERANCE).is_some() {
            let name = name(self.what);
            let why = "whose rays are a fixed number";
            print_note(format!("note: {TOLERANCE} has no effect on {name}, {why}"));
        }
        let Some(option) = idle.next() else { return Ok(()) };
        let readers =
            AnalysisKind::value_variants().iter().copied().filter(|kind| (option.is_read)(*kind));
        let readers: Vec<String> = readers.map(name).collect();
        Err(CliError::Input(format!(
            "{}: has no effect on {}; expected it with {}",
            option.name,
            name(self.what),
            readers.join(", ")
        )))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The help lists the options of each analysis: those of the table, no others.
    #[test]
    fn the_help_lists_the_options_of_each_analysis() {
        let help = include_str!("../help/analyze.txt");
        for kind in AnalysisKind::value_variants() {
            let name = name(*kind);
            let line = help.lines().find(|line| {
                line.strip_prefix("  ").is_some_and(|rest| rest.starts_with(&format!("{name}: ")))
            });
            let listed: Vec<&str> = line
                .unwrap_or_else(|| panic!("no line of {name}"))
                .split([' ', ','])
                .filter(|word| word.starts_with("--"))
                .collect();
            let read: Vec<&str> = SPECIFIC
                .iter()
                .filter(|option| (option.is_read)(*kind))
                .map(|option| option.name)
                .collect();
            assert_eq!(listed, read, "{name}");
        }
    }
}
