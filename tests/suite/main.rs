//! Behaviour and reference tests, one module a floor.
#![expect(clippy::unwrap_used, reason = "a test that cannot read its data should fail")]
#![expect(clippy::print_stdout, reason = "reference tests print their worst errors")]

mod paraxial;
mod reference;
