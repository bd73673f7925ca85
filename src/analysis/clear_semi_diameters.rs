//! Clear semi-diameters: how far from the axis the light of all fields, wavelengths and zoom
//! positions meets each surface. They are the size of a surface whose semi-diameter nobody fixed.

use crate::lens::FieldPoint;
use crate::pupil::{Launch, RayModel};
use crate::trace::Ray;
use rayon::prelude::*;
use std::f64::consts::PI;

/// The azimuths at which the edge of a pupil is traced, over half of it.
const AZIMUTHS: u32 = 6;
/// The halvings of the distance between a ray that is lost and one that is not.
const HALVINGS: usize = 12;

/// The largest distance from the axis at which the light meets each surface, the image plane last,
/// in mm. `models` are those of all zoom positions. Rays that some fixed semi-diameter clips do not
/// count. The edge of the light is found to 1e-9 of its radius.
pub fn clear_semi_diameters<'a>(models: impl IntoIterator<Item = &'a RayModel>) -> Vec<f64> {
    let beams = models.into_iter().flat_map(|model| {
        let fields = model.fields.iter();
        fields.flat_map(move |field| (0..model.channels.len()).map(move |w| (model, *field, w)))
    });
    let beams: Vec<(&RayModel, FieldPoint, usize)> = beams.collect();
    let of_beam = |(model, field, wavelength): &(&RayModel, FieldPoint, usize)| {
        let mut heights = vec![0.0; model.channels[model.primary].tracer.surfaces()];
        if let Ok(launch) = model.launch(*field, *wavelength) {
            raise_to_edge(&mut heights, &launch);
        }
        heights
    };
    beams.par_iter().map(of_beam).reduce(Vec::new, higher)
}

/// The larger of the heights at each surface.
fn higher(mut a: Vec<f64>, b: Vec<f64>) -> Vec<f64> {
    a.resize(a.len().max(b.len()), 0.0);
    a.iter_mut().zip(b).for_each(|(height, own)| *height = height.max(own));
    a
}

/// Raises heights to those of the edge of a pupil.
fn raise_to_edge(heights: &mut [f64], launch: &Launch<'_>) {
    let halves: &[f64] = if launch.is_symmetric() { &[1.0] } else { &[1.0, -1.0] };
    for side in halves {
        for i in 0..=AZIMUTHS {
            let angle = PI * (f64::from(i) / f64::from(AZIMUTHS) - 0.5);
            let outward = [side * angle.cos(), angle.sin()];
            let Some(edge) = outermost(launch, outward) else { continue };
            launch.channel().tracer.visit(edge, |surface, p| {
                heights[surface] = heights[surface].max(p.x.hypot(p.y));
            });
        }
    }
}

/// The outermost ray in a direction of the pupil that reaches the image; `None` if not even the ray
/// through the centre of the pupil does.
fn outermost(launch: &Launch<'_>, outward: [f64; 2]) -> Option<Ray<f64>> {
    let at = |share: f64| {
        let ray = launch.ray_through_stop(outward.map(|c| share * c))?;
        launch.channel().tracer.trace(ray).fate.is_imaged().then_some(ray)
    };
    if let Some(ray) = at(1.0) {
        return Some(ray);
    }
    let (mut inside, mut outside) = (0.0, 1.0);
    let mut found = at(inside);
    found.as_ref()?;
    for _ in 0..HALVINGS {
        let middle = 0.5 * (inside + outside);
        match at(middle) {
            None => outside = middle,
            ray => (inside, found) = (middle, ray),
        }
    }
    found
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::lens::{Aperture, Lens, blank};

    /// Rays at the rim are launched by 1e-9 of its radius inside it, so that rounding does not decide
    /// whether they pass.
    const ROUNDED_RIM: f64 = 1.001e-9;

    fn heights(lens: &Lens) -> Vec<f64> {
        clear_semi_diameters([&RayModel::from_lens(lens, 0).unwrap()])
    }

    /// A plate of 5 mm in a beam of 10 mm, without fixed semi-diameters.
    fn plate() -> Lens {
        let mut lens = blank();
        lens.surfaces.iter_mut().for_each(|row| row.semi_diameter = None);
        lens.aperture = Aperture::EntrancePupilDiameter(10.0);
        lens
    }

    #[test]
    fn surfaces_are_as_large_as_the_beam_and_grow_with_the_field() {
        let mut lens = plate();
        let found = heights(&lens);
        assert!(found.iter().all(|height| (height / 5.0 - 1.0).abs() < ROUNDED_RIM), "{found:?}");
        lens.fields.values = vec![FieldPoint { x: 0.0, y: 10.0, weight: 1.0 }];
        let found = heights(&lens);
        let index = lens.resolve(0, lens.wavelengths[0].um).unwrap().surfaces[0].index;
        let inside = (10f64.to_radians().sin() / index).asin().tan();
        assert!((found[0] / 5.0 - 1.0).abs() < ROUNDED_RIM);
        assert!((found[1] / (5.0 + 5.0 * inside) - 1.0).abs() < ROUNDED_RIM, "{found:?}");
    }

    #[test]
    fn only_light_that_gets_through_counts() {
        let mut lens = plate();
        lens.surfaces[1].semi_diameter = Some(3.0);
        let found = heights(&lens);
        assert!((found[0] - 3.0).abs() < 2e-3 && found[0] <= 3.0, "{found:?}");
    }
}
