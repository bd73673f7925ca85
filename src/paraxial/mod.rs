//! paraxial
