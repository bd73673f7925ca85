//! The tables of a prescription report: surfaces, forms, places, zoom positions, first-order data.

use super::first_order_table::first_order_numbers;
use super::materials::{index_and_abbe, material_name};
use super::surface_tolerances::surface_tolerances;
use crate::lens::{AxisBreak, Lens, Parameter, Quantity, Row, SurfaceAperture, SurfaceNumber};
use crate::math::ShortNumber;
use crate::paraxial::FirstOrder;
use crate::plot::{DocumentTable, ReportDocument};

/// Adds the surfaces of a lens.
pub(super) fn add_prescription(document: &mut ReportDocument, lens: &Lens) {
    document.heading("Prescription");
    let heads =
        ["surface", "radius", "thickness", "material", "nd", "vd", "semi-diameter", "remarks"];
    let mut table = DocumentTable::new(&heads, &[0, 3, 7]);
    for (i, row) in lens.surfaces.iter().enumerate() {
        table.row(surface_row(i, row));
    }
    document.table(table);
    [form_table(lens), gradient_table(lens), place_table(lens), zoom_table(lens)]
        .into_iter()
        .for_each(|table| document.table(table));
    if lens.tolerances.is_some() {
        document.table(tolerance_table(lens));
    }
    document.text(
        "Numbers are rounded to seven digits; the lens file has all of them. The thickness of the last \
         surface leads to the image plane. A semi-diameter clips rays.",
    );
}

fn surface_row(i: usize, row: &Row) -> [String; 8] {
    let (nd, vd) = index_and_abbe(&row.medium).map_or_else(Default::default, |(nd, vd)| {
        (format!("{nd:.5}"), vd.map(|v| format!("{v:.2}")))
    });
    [
        SurfaceNumber::new(i).to_string(),
        radius_text(row.curvature),
        ShortNumber(row.thickness).to_string(),
        material_name(&row.medium),
        nd,
        vd.unwrap_or_default(),
        row.semi_diameter.map_or_else(|| "-".to_owned(), |r| ShortNumber(r).to_string()),
        remarks(row).join(", "),
    ]
}

fn radius_text(curvature: f64) -> String {
    match curvature {
        0.0 => "plane".to_owned(),
        _ => ShortNumber(curvature.recip()).to_string(),
    }
}

fn remarks(row: &Row) -> Vec<String> {
    let mut words = Vec::new();
    if row.stop {
        words.push("stop".to_owned());
    }
    if row.asphere.iter().any(|a| *a != 0.0) {
        words.push("asphere".to_owned());
    } else if row.conic != 0.0 {
        words.push("conic".to_owned());
    }
    if let Some(ideal) = row.ideal {
        words.push(ideal.name().to_owned());
    }
    if let Some(form) = &row.freeform {
        words.push(form.kind.name().to_owned());
    }
    if let Some(radius) = row.obstruction {
        words.push(format!("obstructed to {}", ShortNumber(radius)));
    }
    words.extend(row.apertures.iter().map(SurfaceAperture::short_text));
    if row.hyperhemisphere {
        words.push("more than half a sphere".to_owned());
    }
    if let Some(locked) = &row.locked {
        words.push(format!("{}: not traced", locked.kind));
    }
    if !row.comment.is_empty() {
        words.push(row.comment.clone());
    }
    words
}

/// Conic constants and coefficients of aspheres.
fn form_table(lens: &Lens) -> DocumentTable {
    let rows = || lens.surfaces.iter().enumerate();
    let terms = rows().map(|(_, row)| row.asphere.len()).max().unwrap_or(0);
    let power = |k: usize| format!("r^{}", 4 + 2 * k);
    let head = ["surface".to_owned(), "conic".to_owned()].into_iter().chain((0..terms).map(power));
    let mut table = DocumentTable { head: head.collect(), rows: Vec::new(), left: vec![0] };
    for (i, row) in rows() {
        if row.conic != 0.0 || row.asphere.iter().any(|a| *a != 0.0) {
            let number = |a: f64| if a == 0.0 { "0".to_owned() } else { format!("{a:.6e}") };
            let place = [SurfaceNumber::new(i).to_string(), ShortNumber(row.conic).to_string()];
            let term = |k: usize| number(row.asphere.get(k).copied().unwrap_or(0.0));
            table.row(place.into_iter().chain((0..terms).map(term)));
        }
    }
    table
}

/// Gradient-index profiles.
fn gradient_table(lens: &Lens) -> DocumentTable {
    let heads = ["gap behind surface", "base", "law", "r\u{b2}, r\u{2074}, ...", "z, z\u{b2}, ..."];
    let mut table = DocumentTable::new(&heads, &[0, 1, 2, 3, 4]);
    for (i, row) in lens.surfaces.iter().enumerate() {
        if let crate::lens::Medium::Grin(grin) = &row.medium {
            let list = |terms: &[f64]| {
                terms.iter().map(|a| format!("{a:.6e}")).collect::<Vec<_>>().join(", ")
            };
            table.row([
                SurfaceNumber::new(i).to_string(),
                material_name(&grin.base),
                format!("{:?}", grin.law).to_lowercase(),
                list(&grin.radial),
                list(&grin.axial),
            ]);
        }
    }
    table
}

/// Surfaces that are decentred or tilted, and breaks of the axis.
fn place_table(lens: &Lens) -> DocumentTable {
    let heads = ["surface", "what", "decentre x", "y", "z", "tilt x, \u{b0}", "y", "z"];
    let mut table = DocumentTable::new(&heads, &[0, 1]);
    for (i, row) in lens.surfaces.iter().enumerate() {
        let name = SurfaceNumber::new(i).to_string();
        let broken = |what: &str, axis: &AxisBreak| {
            let numbers =
                axis.decenter.into_iter().chain(axis.tilt).map(|v| ShortNumber(v).to_string());
            [name.clone(), what.to_owned()].into_iter().chain(numbers).collect::<Vec<_>>()
        };
        if let Some(axis) = &row.break_before {
            table.row(broken("axis in front", axis));
        }
        if row.decenter != [0.0; 2] || row.tilt != [0.0; 2] {
            let ([x, y], [a, b]) = (row.decenter, row.tilt);
            let numbers = [x, y, 0.0, a, b, 0.0].map(|v| ShortNumber(v).to_string());
            table.row([name.clone(), "surface".to_owned()].into_iter().chain(numbers));
        }
        if let Some(axis) = &row.break_after {
            table.row(broken("axis behind", axis));
        }
    }
    table
}

/// The half ranges of each surface that has some.
fn tolerance_table(lens: &Lens) -> DocumentTable {
    let heads = ["surface", "tolerances: half ranges in mm, angles in minutes of arc"];
    let mut table = DocumentTable::new(&heads, &[0, 1]);
    for i in 0..lens.surfaces.len() {
        let text = surface_tolerances(lens, i);
        if !text.is_empty() {
            table.row([SurfaceNumber::new(i).to_string(), text]);
        }
    }
    table
}

/// The numbers that differ between zoom positions.
fn zoom_table(lens: &Lens) -> DocumentTable {
    let numbers = lens.zoom.iter().flat_map(|position| &position.numbers);
    let mut differing: Vec<(usize, Quantity)> =
        numbers.map(|own| (own.surface, own.quantity)).collect();
    differing.sort_unstable();
    differing.dedup();
    let head = ["zoom position".to_owned()].into_iter();
    let name = |(surface, quantity): &(usize, Quantity)| match quantity {
        Quantity::Thickness => format!("behind {}", SurfaceNumber::new(*surface)),
        Quantity::Curvature => format!("radius of {}", SurfaceNumber::new(*surface)),
        _ => format!("{quantity} {}", SurfaceNumber::new(*surface)),
    };
    let head = head.chain(differing.iter().map(name)).collect();
    let mut table = DocumentTable { head, rows: Vec::new(), left: vec![0] };
    for (i, position) in lens.zoom.iter().enumerate().filter(|_| !differing.is_empty()) {
        let value = |(surface, quantity): &(usize, Quantity)| {
            let value = lens.get(Parameter::at_zoom(*surface, *quantity, i)).unwrap_or(f64::NAN);
            match quantity {
                Quantity::Curvature => radius_text(value),
                _ => ShortNumber(value).to_string(),
            }
        };
        let name = format!("{i} {}", position.name).trim_end().to_owned();
        table.row([name].into_iter().chain(differing.iter().map(value)));
    }
    table
}

/// Adds the first-order data at every zoom position, each with the distance from the first vertex to
/// the image plane.
pub(super) fn add_first_order(
    document: &mut ReportDocument,
    lens: &Lens,
    positions: &[(&FirstOrder<f64>, f64)],
) {
    document.heading("First-order data");
    let zoom = |i: usize| match lens.zoom.get(i) {
        Some(position) => format!("{i} {}", position.name).trim_end().to_owned(),
        None => "mm".to_owned(),
    };
    let head = ["quantity".to_owned()].into_iter().chain((0..positions.len()).map(zoom));
    let mut table = DocumentTable { head: head.collect(), rows: Vec::new(), left: vec![0] };
    let columns: Vec<_> =
        positions.iter().map(|(data, track)| first_order_numbers(data, *track)).collect();
    let names = columns.first().into_iter().flatten().map(|(name, _)| *name);
    for (i, name) in names.enumerate() {
        let value =
            |v: Option<f64>| v.map_or_else(|| "-".to_owned(), |v| ShortNumber(v).to_string());
        let cells = columns.iter().map(|column| value(column[i].1));
        table.row([name.to_owned()].into_iter().chain(cells));
    }
    document.table(table);
    let um = lens.wavelengths[lens.primary()].um;
    let tilted = lens.surfaces.iter().any(|row| row.pose().is_some() || row.axis().is_some());
    let axis = if tilted { " of the straightened axis" } else { "" };
    document.text(format!(
        "Paraxial optics{axis} at {} \u{b5}m, a closed form: the numbers are exact for this prescription \
         but for the rounding to seven digits.",
        ShortNumber(um)
    ));
}
