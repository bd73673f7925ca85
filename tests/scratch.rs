#![allow(unused, clippy::all)]
#[path = "suite/surface_apertures.rs"]
mod surface_apertures;
