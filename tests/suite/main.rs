//! Behaviour and reference tests, a module for each floor.
#![expect(clippy::unwrap_used, reason = "a test that cannot read its data should fail")]
#![expect(clippy::print_stdout, reason = "the worst errors are the result of a reference test")]

mod analysis;
mod aperture;
mod candidate;
mod cli;
mod cli_arguments;
mod cli_effects;
mod cli_failures;
mod cli_files;
mod closed_forms;
mod diffraction;
mod drag;
mod effects;
mod elements;
mod experiments;
mod files;
mod grin;
mod grin_design;
mod grin_limits;
mod grin_views;
mod grin_wrong;
mod hard_cases;
mod images;
mod lens_library;
mod library;
mod merit;
mod optimize;
mod paraxial;
mod pareto;
mod plume;
mod pupil;
mod real_beam;
mod reference;
mod report;
mod search;
mod search_cli;
mod semi_diameters;
mod session;
mod session_drag;
mod session_grin;
mod session_history;
mod session_journal;
mod session_pareto;
mod session_search;
mod trace;
