//! What the window shows: every shader is valid, and the graphics card draws what the processor
//! draws.
#![expect(clippy::unwrap_used, reason = "a test that cannot prepare its case should fail")]
#![expect(clippy::print_stdout, reason = "`--nocapture` shows how near the two drawings are")]

mod bench;
mod chooser;
mod drawing;
mod panels;
mod search;
mod shaders;
mod slice;
mod unsaved;
mod window;
