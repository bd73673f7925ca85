//! Naming kinds of numbers on the command line.

use crate::lens::ParameterKind;
use clap::ValueEnum;

/// A kind of number that an optimizer may change.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub(super) enum KindName {
    /// Every curvature with a medium of its own behind it
    Curvatures,
    /// Every gap, at each zoom position by itself where it moves
    Thicknesses,
    /// Every conic constant that is not 0
    Conics,
    /// Every asphere coefficient that is written
    Aspheres,
    /// Every index of a model glass or constant medium
    Indices,
    /// Every semi-diameter that is written
    SemiDiameters,
    /// Every coefficient of a gradient-index medium that is written
    Gradients,
}

impl KindName {
    /// The kinds that are meant.
    pub(super) fn kinds(names: &[Self]) -> Vec<ParameterKind> {
        names.iter().map(|name| name.kind()).collect()
    }

    fn kind(self) -> ParameterKind {
        match self {
            Self::Curvatures => ParameterKind::Curvatures,
            Self::Thicknesses => ParameterKind::Thicknesses,
            Self::Conics => ParameterKind::Conics,
            Self::Aspheres => ParameterKind::Aspheres,
            Self::Indices => ParameterKind::Indices,
            Self::SemiDiameters => ParameterKind::SemiDiameters,
            Self::Gradients => ParameterKind::GrinCoefficients,
        }
    }
}

#[cfg(test)]
mod tests {
    use crate::files::{bundled_lenses, native};
    use crate::lens::{ParameterKind, add_variables, at_zoom};
    use crate::measure::double_gauss;

    #[test]
    fn a_plane_stop_in_air_is_not_varied() {
        let mut lens = double_gauss();
        add_variables(&mut lens, &[ParameterKind::Curvatures, ParameterKind::Thicknesses]);
        assert_eq!(lens.variables.len(), 10 + 11);
        assert!(lens.check().is_ok());
    }

    #[test]
    fn a_zoom_lens_at_a_position_is_that_lens() {
        let zoom = bundled_lenses().iter().find(|b| b.name == "zoom_nikkor_28_80").unwrap();
        let mut lens = native::read(zoom.text, zoom.name).unwrap();
        let um = lens.wavelengths[lens.primary()].um;
        for position in 0..lens.zoom.len() {
            let single = at_zoom(&lens, position);
            assert_eq!(single.resolve(0, um).unwrap(), lens.resolve(position, um).unwrap());
        }
        add_variables(&mut lens, &[ParameterKind::Thicknesses]);
        assert!(lens.check().is_ok());
        let moving = lens.zoom[0].thicknesses.len() * lens.zoom.len();
        let fixed = lens.surfaces.len() - lens.zoom[0].thicknesses.len();
        assert_eq!(lens.variables.len(), moving + fixed);
    }
}
