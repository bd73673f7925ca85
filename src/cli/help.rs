//! Help about a subcommand, as its `--help` prints it, or about a topic.

use super::CliArgs;
use super::error::CliError;
use super::output::Output;
use clap::CommandFactory;
use serde::Serialize;
use std::fmt::{self, Display};

/// Prints the help of a command or of a topic: lens-file, conventions, effects, packages, python
#[derive(Debug, clap::Args)]
pub(super) struct HelpArgs {
    /// A command, or one of the topics; all commands where it is absent
    #[arg(value_name = "TOPIC")]
    topic: Vec<String>,
}

/// Texts that belong to no command, by name.
pub(super) const TOPICS: [(&str, &str); 5] = [
    ("lens-file", include_str!("help/lens-file.txt")),
    ("conventions", include_str!("help/conventions.txt")),
    ("effects", include_str!("help/effects.txt")),
    ("packages", include_str!("help/packages.txt")),
    ("python", include_str!("help/python.txt")),
];

/// A text that is printed as it is.
#[derive(Serialize)]
#[serde(transparent)]
struct HelpText(String);

impl Display for HelpText {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.0)
    }
}

impl HelpArgs {
    pub(super) fn run(&self, output: &Output) -> Result<(), CliError> {
        output.print(&HelpText(self.text()?))
    }

    fn text(&self) -> Result<String, CliError> {
        if let [name] = self.topic.as_slice()
            && let Some((_, text)) = TOPICS.iter().find(|(topic, _)| topic == name)
        {
            return Ok((*text).to_owned());
        }
        let mut command = CliArgs::command();
        command.build();
        let mut command = &mut command;
        for name in &self.topic {
            command = command.find_subcommand_mut(name).ok_or_else(|| unknown(name))?;
        }
        Ok(command.render_long_help().to_string())
    }
}

fn unknown(name: &str) -> CliError {
    let topics = TOPICS.map(|(topic, _)| topic).join(", ");
    CliError::Input(format!("no help on `{name}`; expected a command, or one of {topics}"))
}
