//! The colours of a picture: bands of wavelengths, each integrated by a few of them.

use super::PictureError;
use crate::lens::{Lens, Wavelength};
use crate::math::quadrature::gauss_legendre;
use crate::pupil::RayModel;

/// A colour of a picture: wavelengths of a model with their shares.
#[derive(Debug, Clone, PartialEq)]
pub struct ColorBand {
    /// The indices of its wavelengths in the model, each with its share; the shares add up to 1.
    pub wavelengths: Vec<(usize, f64)>,
}

/// The way in which a picture sees colours.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Coloring {
    /// Red, green and blue: 0.6 to 0.7, 0.5 to 0.6 and 0.4 to 0.5 micrometres, each evenly, by this many
    /// wavelengths (Gauss).
    Rgb(usize),
    /// The same colours, all at the primary wavelength of the lens: without its colour errors.
    Primary,
    /// Grey: the wavelengths of the lens with their weights.
    Gray,
}

/// The edges of the red, the green and the blue band, in micrometres.
const EDGES: [[f64; 2]; 3] = [[0.6, 0.7], [0.5, 0.6], [0.4, 0.5]];

/// The model of a lens at a zoom position at the wavelengths of a picture, and its bands. Beam and focus
/// are those of the primary wavelength of the lens, as elsewhere.
///
/// # Errors
/// A lens without beam, or without index at one of the wavelengths.
pub fn picture_model(
    lens: &Lens,
    zoom: usize,
    coloring: Coloring,
) -> Result<(RayModel, Vec<ColorBand>), PictureError> {
    let count = match coloring {
        Coloring::Rgb(count) => count.max(1),
        Coloring::Gray => {
            let model = RayModel::from_lens(lens, zoom)?;
            let all: f64 = model.channels.iter().map(|channel| channel.weight).sum();
            let shares = model.channels.iter().map(|channel| channel.weight / all).enumerate();
            let wavelengths = shares.filter(|(_, share)| *share > 0.0).collect();
            return Ok((model, vec![ColorBand { wavelengths }]));
        }
        Coloring::Primary => {
            let model = RayModel::from_lens(lens, zoom)?;
            let band = ColorBand { wavelengths: vec![(model.primary, 1.0)] };
            return Ok((model, vec![band; EDGES.len()]));
        }
    };
    let primary = Wavelength { primary: true, ..lens.wavelengths[lens.primary()] };
    let nodes = EDGES.iter().flat_map(|[from, to]| gauss_legendre(count, *from, *to));
    let nodes = nodes.map(|(um, _)| Wavelength { um, weight: 1.0, primary: false });
    let wavelengths = std::iter::once(primary).chain(nodes).collect();
    let model = RayModel::from_lens(&Lens { wavelengths, ..lens.clone() }, zoom)?;
    let shares: Vec<f64> =
        gauss_legendre(count, 0.0, 1.0).iter().map(|(_, share)| *share).collect();
    let band = |band: usize| {
        let first = 1 + band * count;
        let wavelengths = shares.iter().enumerate().map(|(i, share)| (first + i, *share)).collect();
        ColorBand { wavelengths }
    };
    Ok((model, (0..EDGES.len()).map(band).collect()))
}
