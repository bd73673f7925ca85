//! Apertures of surfaces in Optiland's files: radial, rectangular, elliptical, polygons and what is common to
//! two of them or in one alone.

use super::number;
use crate::files::outline::{ForeignOutline, OutlineForm};
use crate::files::report::{ConversionOutcome, ConversionReport};
use crate::lens::{ApertureShape, BlockedSide, MAX_APERTURES, Row, SurfaceAperture};
use serde_json::{Value, json};

/// A radius from which on nothing is clipped, in mm.
const WIDE: f64 = 1e10;
/// The length of the arms of a spider that are written as rectangles, in mm.
const ARM: f64 = 1e4;
/// The largest depth of combinations that is read.
const DEPTH: usize = 32;

/// Writes the aperture of a surface into its row.
pub(super) fn read(row: &mut Row, aperture: &Value, report: &mut ConversionReport) {
    let mut found = row.clone();
    match add(&mut found, aperture, BlockedSide::Outside, DEPTH) {
        Ok(()) => {
            for own in &found.apertures {
                let text = format!("{own}: traced");
                report.add(ConversionOutcome::Used, "aperture", text);
            }
            *row = found;
        }
        Err(kind) => {
            let note = "an aperture of this form is not traced: it clips nothing here";
            report.add(ConversionOutcome::Dropped, &kind, note);
        }
    }
}

/// Adds an aperture to a row; the error is the kind of one that a row cannot have.
fn add(row: &mut Row, aperture: &Value, blocks: BlockedSide, depth: usize) -> Result<(), String> {
    let kind = aperture["type"].as_str().unwrap_or_default();
    let inside = blocks == BlockedSide::Inside;
    let refused = || Err(kind.to_owned());
    let offset = ["offset_x", "offset_y"].map(|key| number(&aperture[key]));
    let outline = |form, half: [f64; 2], offset| ForeignOutline { form, half, offset, angle: 0.0 };
    match kind {
        "" => Ok(()),
        "RadialAperture" | "OffsetRadialAperture" => {
            let radii = [aperture["r_max"].as_f64().unwrap_or(WIDE), number(&aperture["r_min"])];
            if inside && radii[1] > 0.0 {
                return refused();
            }
            add_ring(row, radii, offset, blocks);
            Ok(())
        }
        "RectangularAperture" => {
            // An infinite number is null.
            let sides = ["x_min", "x_max", "y_min", "y_max"].map(|key| aperture[key].as_f64());
            let [Some(x_min), Some(x_max), Some(y_min), Some(y_max)] = sides else {
                let is_open = sides.iter().all(Option::is_none);
                return if is_open { Ok(()) } else { refused() };
            };
            let half = [0.5 * (x_max - x_min), 0.5 * (y_max - y_min)];
            let middle = [0.5 * (x_min + x_max), 0.5 * (y_min + y_max)];
            outline(OutlineForm::Rectangle, half, middle).add_to(row, blocks, 1.0);
            Ok(())
        }
        "EllipticalAperture" => {
            let half = ["a", "b"].map(|key| number(&aperture[key]));
            outline(OutlineForm::Ellipse, half, offset).add_to(row, blocks, 1.0);
            Ok(())
        }
        "PolygonAperture" => {
            let own = SurfaceAperture { blocks, ..polygon(aperture) };
            if own.fault().is_some() {
                return refused();
            }
            row.apertures.push(own);
            Ok(())
        }
        "IntersectionAperture" if !inside && depth > 0 => {
            add(row, &aperture["a"], blocks, depth - 1)?;
            add(row, &aperture["b"], blocks, depth - 1)
        }
        "DifferenceAperture" if !inside && depth > 0 => {
            add(row, &aperture["a"], blocks, depth - 1)?;
            add(row, &aperture["b"], BlockedSide::Inside, depth - 1)
        }
        // Blocked by either.
        "UnionAperture" if inside && depth > 0 => {
            add(row, &aperture["a"], blocks, depth - 1)?;
            add(row, &aperture["b"], blocks, depth - 1)
        }
        _ => refused(),
    }
}

/// Adds a circle, and the hole in it, that block on a side.
fn add_ring(row: &mut Row, [outer, inner]: [f64; 2], offset: [f64; 2], blocks: BlockedSide) {
    let circle = |radius: f64| ForeignOutline {
        form: OutlineForm::Circle,
        half: [radius; 2],
        offset,
        angle: 0.0,
    };
    if inner > 0.0 {
        circle(inner).add_to(row, BlockedSide::Inside, 1.0);
    }
    if outer > 0.0 && outer < WIDE {
        circle(outer).add_to(row, blocks, 1.0);
    }
}

/// A polygon by the columns of its corners.
fn polygon(aperture: &Value) -> SurfaceAperture {
    let column = |key: &str| -> Vec<f64> {
        aperture[key].as_array().into_iter().flatten().map(number).collect()
    };
    let points = column("x").into_iter().zip(column("y")).map(|(x, y)| [x, y]).collect();
    SurfaceAperture::inside(ApertureShape::Polygon { points })
}

/// The aperture of a row; `null` for a surface that clips nothing. `stop` is the radius of the stop where
/// that is the aperture of the lens, `infinite` stands for an infinite number.
pub(super) fn write(row: &Row, stop: Option<f64>, infinite: &str) -> Value {
    let inner = row.obstruction.filter(|inner| *inner > 0.0);
    let outer = stop.or(row.semi_diameter);
    let mut whole = Value::Null;
    if inner.is_some() || outer.is_some() {
        let outer = outer.map_or(json!(infinite), |outer| json!(outer));
        whole = json!({"type": "RadialAperture", "r_max": outer, "r_min": inner.unwrap_or(0.0)});
    }
    for own in &row.apertures {
        for part in parts(own) {
            whole = match (whole, own.obscures()) {
                (Value::Null, false) => part,
                (before, false) => json!({"type": "IntersectionAperture", "a": before, "b": part}),
                (before, true) => {
                    let all = json!({"type": "RadialAperture", "r_max": infinite, "r_min": 0.0});
                    let before = if before.is_null() { all } else { before };
                    json!({"type": "DifferenceAperture", "a": before, "b": part})
                }
            };
        }
    }
    whole
}

/// True for an aperture that the format has.
pub(super) fn is_writable(own: &SurfaceAperture) -> bool {
    (1..=MAX_APERTURES).contains(&parts(own).len())
}

/// The apertures whose union is an aperture; none for one that the format does not have.
fn parts(own: &SurfaceAperture) -> Vec<Value> {
    let [x, y] = own.center;
    let polygon = |corners: &[[f64; 2]]| {
        let column = |k: usize| corners.iter().map(|p| p[k]).collect::<Vec<f64>>();
        json!({"type": "PolygonAperture", "x": column(0), "y": column(1)})
    };
    match &own.shape {
        ApertureShape::Circle { radius } => vec![json!({
            "type": "OffsetRadialAperture", "r_max": radius, "r_min": 0.0,
            "offset_x": x, "offset_y": y,
        })],
        ApertureShape::Rectangle { half_width: a, half_height: b } if own.angle == 0.0 => {
            vec![json!({
                "type": "RectangularAperture",
                "x_min": x - a, "x_max": x + a, "y_min": y - b, "y_max": y + b,
            })]
        }
        ApertureShape::Ellipse { half_width, half_height } if own.angle == 0.0 => vec![json!({
            "type": "EllipticalAperture", "a": half_width, "b": half_height,
            "offset_x": x, "offset_y": y,
        })],
        ApertureShape::Ellipse { .. } => Vec::new(),
        ApertureShape::Rectangle { .. } | ApertureShape::Polygon { .. } => {
            vec![polygon(&own.corners())]
        }
        ApertureShape::Spider { arms, width } => {
            let arm = |k: usize| {
                let angle = own.angle + 360.0 * k as f64 / *arms as f64;
                let turned = SurfaceAperture { angle, ..own.clone() };
                let half = 0.5 * width;
                let corners = [[0.0, half], [0.0, -half], [ARM, -half], [ARM, half]];
                polygon(&corners.map(|p| turned.place(p)))
            };
            (0..*arms).map(arm).collect()
        }
    }
}
