//! Naming kinds of numbers on the command line.

use crate::lens::NumberKind;
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
    pub(super) fn kinds(names: &[Self]) -> Vec<NumberKind> {
        names.iter().map(|name| name.kind()).collect()
    }

    fn kind(self) -> NumberKind {
        match self {
            Self::Curvatures => NumberKind::Curvatures,
            Self::Thicknesses => NumberKind::Thicknesses,
            Self::Conics => NumberKind::Conics,
            Self::Aspheres => NumberKind::Aspheres,
            Self::Indices => NumberKind::Indices,
            Self::SemiDiameters => NumberKind::SemiDiameters,
            Self::Gradients => NumberKind::Gradients,
        }
    }
}

#[cfg(test)]
mod tests {
    use crate::files::{library, native};
    use crate::lens::{NumberKind, at_zoom, vary};
    use crate::measure::double_gauss;

    #[test]
    fn a_plane_stop_in_air_is_not_varied() {
        let mut lens = double_gauss();
        vary(&mut lens, &[NumberKind::Curvatures, NumberKind::Thicknesses]);
        assert_eq!(lens.variables.len(), 10 + 11);
        assert!(lens.check().is_ok());
    }

    #[test]
    fn a_zoom_lens_at_a_position_is_that_lens() {
        let zoom = library().iter().find(|b| b.name == "zoom_nikkor_28_80").unwrap();
        let mut lens = native::read(zoom.text, zoom.name).unwrap();
        let um = lens.wavelengths[lens.primary()].um;
        for position in 0..lens.zoom.len() {
            let single = at_zoom(&lens, position);
            assert_eq!(single.system(0, um).unwrap(), lens.system(position, um).unwrap());
        }
        vary(&mut lens, &[NumberKind::Thicknesses]);
        assert!(lens.check().is_ok());
        let moving = lens.zoom[0].thicknesses.len() * lens.zoom.len();
        let fixed = lens.surfaces.len() - lens.zoom[0].thicknesses.len();
        assert_eq!(lens.variables.len(), moving + fixed);
    }
}
