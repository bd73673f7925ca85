//! What the window shows: every shader is valid, and the graphics card draws what the processor
//! draws.
#![expect(clippy::unwrap_used, reason = "a test that cannot prepare its case should fail")]
#![expect(clippy::print_stdout, reason = "`--nocapture` shows how near the two drawings are")]

mod drawing;
mod file_dialog;
mod grin;
mod harness;
mod panels;
mod search;
mod shaders;
mod unsaved;
mod window;
