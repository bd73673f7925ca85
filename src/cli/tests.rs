//! The help, the README and the parser agree.

use super::CliArgs;
use super::help::TOPICS;
use crate::files::json;
use clap::error::ErrorKind;
use clap::{Arg, Command, CommandFactory, Parser};
use std::collections::BTreeSet;

const README: &str = include_str!("../../README.md");

/// Every command with its path, the outermost one included.
fn commands() -> Vec<(Vec<String>, Command)> {
    fn collect(path: &[String], command: &Command, all: &mut Vec<(Vec<String>, Command)>) {
        all.push((path.to_vec(), command.clone()));
        for inner in command.get_subcommands().filter(|inner| inner.get_name() != "help") {
            collect(&[path, &[inner.get_name().to_owned()]].concat(), inner, all);
        }
    }
    let mut root = CliArgs::command();
    root.build();
    let mut all = Vec::new();
    collect(&[], &root, &mut all);
    all
}

/// The long options of a command.
fn options(command: &Command) -> BTreeSet<String> {
    let own = command.get_arguments().filter_map(Arg::get_long);
    own.map(|name| format!("--{name}")).collect()
}

/// The words of a text that begin with two dashes.
fn named_options(text: &str) -> BTreeSet<String> {
    let is_inside = |c: char| c.is_ascii_alphanumeric() || c == '-';
    let words = text.split(|c: char| !is_inside(c));
    let options = words.filter(|word| word.starts_with("--") && word.len() > 2);
    options.map(str::to_owned).collect()
}

/// The text that a command adds to its list of options.
fn long_text(command: &Command) -> String {
    command.get_after_long_help().map(ToString::to_string).unwrap_or_default()
}

/// The commands of the program that a text shows: lines of shell blocks, and words in backticks.
fn shown_commands(text: &str) -> Vec<Vec<String>> {
    let mut lines = Vec::new();
    for (number, block) in text.split("```").enumerate() {
        if number % 2 == 1 {
            lines.extend(block.strip_prefix("sh\n").into_iter().flat_map(str::lines));
        } else {
            lines.extend(block.split('`').skip(1).step_by(2));
        }
    }
    let shown = lines.into_iter().filter(|line| line.starts_with("aplanat "));
    shown.map(|line| line.split_whitespace().map(str::to_owned).collect()).collect()
}

#[test]
fn every_option_has_a_description() {
    for (path, command) in commands() {
        for argument in command.get_arguments() {
            assert!(argument.get_help().is_some(), "{path:?}: {}", argument.get_id());
        }
        if !path.is_empty() && command.get_subcommands().all(|inner| inner.get_name() == "help") {
            assert!(long_text(&command).contains("JSON out (--json)"), "{path:?}");
        }
    }
}

#[test]
fn help_names_only_options_that_exist() {
    for (path, command) in commands() {
        let named = named_options(&long_text(&command));
        let known = options(&command);
        let unknown: Vec<&String> = named.difference(&known).collect();
        assert!(unknown.is_empty(), "help of {path:?} names {unknown:?}");
    }
}

#[test]
fn help_names_only_commands_that_exist() {
    let known: BTreeSet<Vec<String>> = commands().into_iter().map(|(path, _)| path).collect();
    let texts = commands().into_iter().map(|(_, command)| long_text(&command));
    for text in texts.chain(TOPICS.map(|(_, text)| text.to_owned())) {
        for shown in shown_commands(&text) {
            assert!(known.contains(&shown[1..2]), "{shown:?}");
        }
    }
}

#[test]
fn the_commands_of_the_readme_parse() {
    let shown = shown_commands(README);
    assert!(shown.len() > 15, "{shown:?}");
    for words in shown {
        let parsed = CliArgs::try_parse_from(&words);
        let is_help = parsed.as_ref().is_err_and(|e| e.kind() == ErrorKind::DisplayHelp);
        assert!(parsed.is_ok() || is_help, "{words:?}: {parsed:?}");
        if let [_, help, topic] = words.as_slice()
            && help == "help"
            && topic != "TOPIC"
        {
            assert!(TOPICS.iter().any(|(name, _)| name == topic), "{topic}");
        }
    }
}

#[test]
fn the_readme_is_short_and_lists_every_command_and_room() {
    assert!(README.len() <= 10_000, "{} bytes", README.len());
    for command in CliArgs::command().get_subcommands().filter(|c| c.get_name() != "help") {
        let row = format!("| `aplanat {}", command.get_name());
        assert!(README.contains(&row), "no row {row}");
    }
    let rooms = include_str!("../lib.rs").lines();
    let rooms = rooms.filter_map(|line| line.strip_prefix("pub mod ")?.strip_suffix(';'));
    let listed = README.lines().filter_map(|line| line.strip_prefix("| `")?.split_once("` | "));
    let listed: Vec<&str> = listed.map(|(name, _)| name).filter(|n| !n.contains(' ')).collect();
    assert_eq!(listed, rooms.collect::<Vec<_>>());
}

#[test]
fn the_lenses_of_the_readme_and_of_the_help_are_read() {
    let (_, help) = TOPICS[0];
    for text in [README, help] {
        let begin = text.find("{ \"aplanat\": 1").unwrap();
        let end = begin + text[begin..].find("\n  ] }").unwrap() + "\n  ] }".len();
        assert_eq!(json::read(&text[begin..end], "lens").unwrap().surfaces.len(), 3);
    }
}
