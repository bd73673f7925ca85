//! What figures 3.6 to 3.10 share: lenses optimised for sharpness and light at once (3.26), and how
//! sharp and how bright each of their fields is.

use super::{Cell, Ended, Table, Watch, report};
use crate::lens::{Aperture, Field, FieldKind, Fields, Lens};
use crate::optimize::pareto::{Design, Settings, Sweep};
use crate::pupil::{Bench, Region};

/// Orders of quadrature of the numbers that are shown: the difference is the error.
const ORDERS: [usize; 2] = [6, 8];

/// The lens in one colour at some angles of field, in degrees.
pub(super) fn at_angles(mut lens: Lens, angles: &[f64]) -> Lens {
    lens = in_one_color(lens);
    let values = angles.iter().map(|y| Field { x: 0.0, y: *y, weight: 1.0 }).collect();
    lens.fields = Fields { kind: FieldKind::Angle, values };
    lens
}

/// The lens at its primary wavelength alone, as the figures have it.
pub(super) fn in_one_color(mut lens: Lens) -> Lens {
    lens.wavelengths = vec![lens.wavelengths[lens.primary()]];
    lens
}

/// The same lens with its stop and its rims scaled: how an aperture is chosen for a search that
/// cannot ask for light.
pub(super) fn opened(lens: &Lens, factor: f64) -> Lens {
    let mut lens = lens.clone();
    for row in &mut lens.surfaces {
        row.semi_diameter = row.semi_diameter.map(|size| factor * size);
    }
    if let Aperture::StopSemiDiameter(radius) = &mut lens.aperture {
        *radius *= factor;
    }
    lens
}

/// The part of an experiment that a search is, from one share to another.
#[derive(Debug, Clone, Copy)]
pub(super) struct Part<'a> {
    pub(super) from: f64,
    pub(super) to: f64,
    pub(super) name: &'a str,
}

/// Sweeps the front of a lens to its end.
pub(super) fn swept(
    lens: &Lens,
    settings: &Settings,
    part: Part<'_>,
    watch: &mut Watch<'_>,
) -> Result<Sweep, Ended> {
    let mut sweep = Sweep::new(lens, settings).map_err(Ended::from_error)?;
    let mut done = 0.0;
    loop {
        report(watch, part.from + (part.to - part.from) * done, part.name)?;
        let slice = sweep.step();
        done = (slice.done as f64 / slice.total as f64).clamp(done, 1.0);
        if slice.finished {
            return Ok(sweep);
        }
    }
}

/// A field of a lens.
#[derive(Debug, Clone, Copy)]
pub(super) struct View {
    /// In degrees.
    pub(super) angle: f64,
    /// The area of the pupil in mm², and the root mean square radius of the spot in mm, each with
    /// its error.
    pub(super) area: [f64; 2],
    pub(super) rms: [f64; 2],
}

/// Every field of a lens; the rays traced are counted.
pub(super) fn views(lens: &Lens, rays: &mut usize) -> Result<Vec<View>, Ended> {
    let bench = Bench::of(lens, 0).map_err(Ended::from_error)?;
    bench.fields.iter().map(|field| view_at(&bench, *field, rays)).collect()
}

/// The spot and the pupil of a field.
pub(super) fn view_at(bench: &Bench, field: Field, rays: &mut usize) -> Result<View, Ended> {
    let launch = bench.launch(field, bench.primary).map_err(Ended::from_error)?;
    let region = Region::new(launch);
    *rays += region.rays;
    let [low, high] = ORDERS.map(|order| {
        let lit = region.lit(order);
        *rays += lit.traced;
        let moments = lit.moments;
        let rms = if moments.area > 0.0 { (moments.spread / moments.area).sqrt() } else { 0.0 };
        [moments.area, rms]
    });
    let number = |i: usize| [high[i], (high[i] - low[i]).abs()];
    Ok(View { angle: field.y, area: number(0), rms: number(1) })
}

/// The root of the mean square radius of some spots, in mm, and the mean area of their pupils in
/// mm².
pub(super) fn means(views: &[View]) -> [f64; 2] {
    let count = views.len() as f64;
    let square: f64 = views.iter().map(|view| view.rms[0].powi(2)).sum();
    let area: f64 = views.iter().map(|view| view.area[0]).sum();
    [(square / count).sqrt(), area / count]
}

/// The focal length of a lens, in mm.
pub(super) fn focal_length(lens: &Lens) -> Result<f64, Ended> {
    let bench = Bench::of(lens, 0).map_err(Ended::from_error)?;
    bench.first.efl.ok_or_else(|| Ended::Failed(format!("{} is afocal", lens.name)))
}

/// A row for each field of each design.
pub(super) fn table(
    name: &'static str,
    designs: &[(&str, &Design)],
    rays: &mut usize,
) -> Result<Table, Ended> {
    let columns = [
        "design",
        "beta_mm2",
        "focal_length_mm",
        "field_deg",
        "area_mm2",
        "area_error_mm2",
        "rms_mm",
        "rms_error_mm",
    ];
    let mut table = Table::new(name, &columns);
    for (name, design) in designs {
        let beta = design.weight.unwrap_or(f64::NAN);
        let focal = focal_length(&design.lens)?;
        for view in views(&design.lens, rays)? {
            let numbers = [beta, focal, view.angle].into_iter();
            let numbers = numbers.chain(view.area).chain(view.rms).map(Cell::from);
            table.row(std::iter::once((*name).into()).chain(numbers));
        }
    }
    Ok(table)
}
