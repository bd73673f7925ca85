//! Tests of the window: every shader is valid, the GPU draws the same as the software renderer, and
//! panels show a view and push commands.
#![expect(clippy::unwrap_used, reason = "a test that cannot prepare its case should fail")]
#![expect(clippy::print_stdout, reason = "`--nocapture` shows how near the two drawings are")]

mod begin;
mod drawing;
mod figures;
mod file_dialog;
mod glass;
mod grin;
mod handles;
mod harness;
mod history;
mod import_report;
mod legibility;
mod panels;
mod picture;
mod picture_options;
mod picture_pass;
mod prescription;
mod search;
mod shaders;
mod shapes;
mod specification;
mod tolerances;
mod unsaved;
mod window;
