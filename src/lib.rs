//! Aplanat designs lenses by computation: exact rays, exact derivatives, and a studio around them.
//!
//! This file is the map. The modules below are the floors of the house, from the ground up, and
//! **a module uses only modules declared above it**; `tests/architecture.rs` keeps that true.
//!
//! Rules:
//! - *tracing looks nothing up*: a [`lens::Lens`] is what a person wrote, a [`lens::System`] holds
//!   only numbers;
//! - *no ray is dropped silently*: every ray ends with a [`trace::Fate`];
//! - *the engine reads no clock*: only `measure` and `session` do;
//! - *no result depends on the number of threads*: sums run over fixed chunks, in order;
//! - *a panel changes nothing*: it reads a view and pushes commands.
//!
//! Units and signs: lengths in millimetres, angles in radians inside and in degrees in files and
//! windows, wavelengths in micrometres. Light travels towards +z, and a positive curvature has
//! its centre to the right of the surface. Thickness and glass of a row belong to the gap after it.

// Numbers without optics: the number types, vectors, roots, quadrature, samplers.
pub mod math;

// Optimizers as pure numerics: Adam, L-BFGS, Levenberg-Marquardt, conjugate gradients.
pub mod solve;

// Light in one gradient-index field: fields, ray integrators, their discrete adjoint; knows no lens.
pub mod grin;

// The prescription that a designer writes, and the system of plain numbers it resolves to.
pub mod lens;

// First-order optics: cardinal points, pupils, Seidel sums, the focus solve.
pub mod paraxial;

// Real rays through a system: every ray ends with a fate; derivatives forwards and backwards.
pub mod trace;

// Reading and writing lenses: the native JSON, Zemax, CODE V; an export proves itself.
pub mod files;

// Design tasks in one gradient-index field: the light and its goals, and the optimization of the field.
pub mod grin_design;

// The set of rays that get through: where they start, their boundary, quadrature over them, and
// derivatives of integrals over it that include the motion of the pupil edge.
pub mod pupil;

// What a designer reads, each number with its error estimate.
pub mod analysis;

// Manufacturing errors: what they do to a lens, and how good the lens is that is made.
pub mod tolerance;

// The merit function: weighted terms with gradients, constraints, default goals.
pub mod merit;

// Which physical effects a scene calls for, each decision with the number it rests on.
pub mod effects;

// Local optimization of a lens, one step at a time; the Pareto front of sharpness against light.
pub mod optimize;

// Search over structure: races of mutants; a chain that descends, mutates, regenerates; reservoir, family
// tree; a lens from a specification.
pub mod search;

// Charts and images as PNG, drawings and documents on paper; knows nothing of what it draws.
pub mod plot;

// Results as files and drawings: the front of sharpness against light, GRIN fields and images; the
// prescription report of a lens, its drawings and its solids.
pub mod report;

// Pictures through a lens: scenes, pixels by rays backwards, the sensor; images of beams through
// one gradient-index field, by rays forwards.
pub mod picture;

// Benchmarks: accuracy against time, throughput, memory.
pub mod measure;

// The figures and tables of the thesis as studies that check their own claims.
pub mod experiments;

// One open design: commands, undo, background worker, events. Knows no widgets.
pub mod session;

// The window: panels read a view and push commands. The only module that knows egui.
#[cfg(feature = "studio")]
pub mod studio;

// The headless command line.
pub mod cli;

// The same library for Python.
#[cfg(feature = "python")]
pub mod python;
