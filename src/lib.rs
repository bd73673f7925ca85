//! Aplanat designs lenses by computation.
pub mod math;

pub mod lens;

pub mod paraxial;

pub mod trace;

pub mod files;

pub mod pupil;

pub mod analysis;

pub mod merit;

pub mod effects;

pub mod optimize;

pub mod measure;

pub mod session;

#[cfg(feature = "studio")]
pub mod studio;

pub mod cli;
