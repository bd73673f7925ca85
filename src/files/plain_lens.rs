//! A lens for formats that know neither pickups nor solves.

use crate::lens::{Lens, LensError, at_zoom};

/// The lens with its pickups, a single zoom position and the focus written into its rows.
pub(super) fn plain_lens(lens: &Lens) -> Result<Lens, LensError> {
    lens.check()?;
    let mut lens = lens.with_pickups()?;
    if lens.zoom.len() == 1 {
        lens = at_zoom(&lens, 0);
    }
    if lens.image_solve.is_some() {
        let system = lens.resolve(0, lens.wavelengths[lens.primary()].um)?;
        let solved = system.surfaces.iter().rev().nth(1).map(|surface| surface.thickness);
        if let (Some(row), Some(solved)) = (lens.surfaces.last_mut(), solved) {
            row.thickness = solved;
        }
    }
    Ok(lens)
}
