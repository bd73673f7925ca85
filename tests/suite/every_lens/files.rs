//! Lenses that are written and read again: the same in the native format, and in a Zemax file the
//! same rays.

use super::{ensure, text};
use aplanat::files::{json, library_lenses, zemax};
use aplanat::lens::Lens;
use aplanat::pupil::RayModel;
use rayon::prelude::*;

/// The lens of every file, at all of its zoom positions.
fn whole_lenses() -> Vec<(&'static str, Lens)> {
    let open = |entry: &'static aplanat::files::LibraryLens| (&*entry.name, entry.open().unwrap());
    library_lenses().par_iter().map(open).collect()
}

#[test]
fn native_files_round_trip_to_the_bit() {
    let lenses = whole_lenses();
    assert_eq!(lenses.len(), 188);
    for (name, lens) in lenses {
        let written = json::write(&lens);
        let back = json::read(&written, name).unwrap();
        assert!(back == lens, "{name}: another lens");
        assert_eq!(json::write(&back), written, "{name}");
    }
}

/// Pupil points whose rays are compared.
const POINTS: [[f64; 2]; 4] = [[0.0, 0.0], [0.0, 0.7], [0.5, -0.4], [-0.9, 0.3]];

/// The rays of a Zemax file that was written and read: those of the same field and pupil point end in
/// the same place, at every zoom position and wavelength.
#[test]
fn zemax_files_have_the_same_rays() {
    let check = |(name, lens): &(&str, Lens)| {
        let (written, _) = zemax::write(lens).map_err(text)?;
        let (back, _) = zemax::read(&written, name).map_err(text)?;
        same_rays(lens, &back)
    };
    let lenses = whole_lenses();
    let named =
        |lens: &(&str, Lens)| check(lens).map_err(|why: String| format!("{}: {why}", lens.0));
    let found: Vec<Result<usize, String>> = lenses.par_iter().map(named).collect();
    let wrong: Vec<&str> =
        found.iter().filter_map(|r| r.as_ref().err()).map(String::as_str).collect();
    assert!(wrong.is_empty(), "{} lenses:\n{}", wrong.len(), wrong.join("\n"));
    assert_eq!(found.into_iter().flatten().filter(|imaged| *imaged > 0).count(), 188);
}

/// Compares the ends of rays of two lenses; the number of those that reach the image.
fn same_rays(lens: &Lens, back: &Lens) -> Result<usize, String> {
    let mut imaged = 0;
    for zoom in 0..lens.zoom_positions() {
        let [a, b] = [lens, back].map(|lens| RayModel::from_lens(lens, zoom).map_err(text));
        let (a, b) = (a?, b?);
        let counts = [&a, &b].map(|model| [model.fields.len(), model.channels.len()]);
        ensure(counts[0] == counts[1], || format!("fields and wavelengths {counts:?}"))?;
        for (k, w) in (0..counts[0][0]).flat_map(|k| (0..counts[0][1]).map(move |w| (k, w))) {
            let [a, b] = [&a, &b].map(|model| ends(model, k, w));
            for ((a, b), p) in a.iter().zip(&b).zip(POINTS) {
                let what =
                    || format!("zoom {zoom}, field {k}, wavelength {w}, ray {p:?}: {a:?}, {b:?}");
                let same = match (a, b) {
                    (Some(a), Some(b)) => (a[0] - b[0]).hypot(a[1] - b[1]) <= 1e-9,
                    (a, b) => a == b,
                };
                ensure(same, what)?;
                imaged += usize::from(a.is_some());
            }
        }
    }
    Ok(imaged)
}

/// The image points of rays of a field at a wavelength; `None` for those that are lost.
fn ends(model: &RayModel, field: usize, wavelength: usize) -> [Option<[f64; 2]>; 4] {
    let launch = model.launch(model.fields[field], wavelength).ok();
    POINTS.map(|p| {
        let ray = launch.as_ref()?.ray(p)?;
        let landing = model.channels[wavelength].tracer.trace(ray);
        let end = landing.ray.point;
        landing.fate.is_imaged().then_some([end.x, end.y])
    })
}
