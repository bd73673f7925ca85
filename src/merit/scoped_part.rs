//! The fields and wavelengths that a term of rays is about, with their weights.

use super::{EvaluationContext, MeritError};
use crate::lens::{TermScope, TermSelection};

/// The part of the spots that a term is about.
#[derive(Debug, Clone, Copy)]
pub(super) struct ScopedPart {
    pub(super) scope: TermScope,
    /// The share of its rays in the weight of all.
    share: f64,
}

impl ScopedPart {
    /// The part in a scope; an error if no light gets through there.
    pub(super) fn new(
        context: &EvaluationContext<'_>,
        scope: TermScope,
    ) -> Result<Self, MeritError> {
        if scope.is_all() {
            return Ok(Self { scope, share: 1.0 });
        }
        let part = Self { scope, share: 1.0 };
        let (mut share, mut first) = (0.0, None);
        for (wavelength, channel) in context.sampling.channels.iter().enumerate() {
            for field in 0..context.sampling.fields.len() {
                if part.factor(field, wavelength) > 0.0 {
                    first = first.or(Some((field, channel.um)));
                    share += channel.weights[channel.range(field)].iter().sum::<f64>();
                }
            }
        }
        let (field, um) = first.unwrap_or((0, 0.0));
        let dark = MeritError::NoLight { field, zoom: context.zoom.zoom, um };
        if share > 0.0 { Ok(Self { scope, share }) } else { Err(dark) }
    }

    /// The factor of the weight of a field and wavelength, so that the weights of the part add up to
    /// one; zero outside.
    pub(super) fn factor(self, field: usize, wavelength: usize) -> f64 {
        let inside = self.scope.has(TermSelection::Fields, field)
            && self.scope.has(TermSelection::Wavelengths, wavelength);
        if inside { 1.0 / self.share } else { 0.0 }
    }
}
