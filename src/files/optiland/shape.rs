//! The geometries of Optiland and the shapes of rows: both ways.

use super::{curvature, number};
use crate::lens::{ASPHERE_TERMS, FREEFORM_NUMBERS, Freeform, FreeformKind, Row};
use serde_json::{Value, json};

/// Writes the shape of a geometry into a row; the error is the name of one that cannot be traced.
pub(super) fn read(geometry: &Value, row: &mut Row) -> Result<(), String> {
    let kind = geometry["type"].as_str().unwrap_or_default();
    row.curvature = curvature(&geometry["radius"]);
    row.conic = number(&geometry["conic"]);
    let lost = || kind.to_owned();
    match kind {
        "Plane" => (row.curvature, row.conic) = (0.0, 0.0),
        "StandardGeometry" => {}
        "EvenAsphere" => powers(geometry, 2, row).ok_or_else(lost)?,
        "OddAsphere" => powers(geometry, 1, row).ok_or_else(lost)?,
        "BiconicGeometry" => cylinder(geometry, row).ok_or_else(lost)?,
        "ToroidalGeometry" => {
            row.curvature = curvature(&geometry["radius_y"]);
            row.conic = number(&geometry["conic_yz"]);
            let terms = list(&geometry["coeffs_poly_y"]);
            let numbers = [curvature(&geometry["radius_x"])].into_iter().chain(terms).collect();
            row.freeform = Some(checked(FreeformKind::Toroid, numbers).ok_or_else(lost)?);
        }
        "PolynomialGeometry" => {
            let kind = FreeformKind::XyPolynomial { radius: 1.0 };
            product(kind, &geometry["coefficients"], row).ok_or_else(lost)?;
        }
        "ChebyshevPolynomialGeometry" => {
            let half_widths = ["norm_x", "norm_y"].map(|key| number(&geometry[key]));
            let kind = FreeformKind::Chebyshev { half_widths };
            product(kind, &geometry["coefficients"], row).ok_or_else(lost)?;
        }
        _ => return Err(lost()),
    }
    Ok(())
}

fn list(values: &Value) -> Vec<f64> {
    values.as_array().into_iter().flatten().filter_map(Value::as_f64).collect()
}

/// A form, if its numbers can be traced.
fn checked(kind: FreeformKind, mut numbers: Vec<f64>) -> Option<Freeform<f64>> {
    let least = kind.counts()[0];
    while numbers.len() > least && numbers.last() == Some(&0.0) {
        numbers.pop();
    }
    let form = Freeform { kind, numbers };
    form.fault().is_none().then_some(form)
}

/// A polynomial in r with every `step`-th power: an even asphere if it is one, else an odd one.
fn powers(geometry: &Value, step: usize, row: &mut Row) -> Option<()> {
    let terms = list(&geometry["coefficients"]);
    let powers = || (step..).step_by(step).zip(terms.iter().copied()).filter(|(_, a)| *a != 0.0);
    let is_even =
        |power: usize| power.is_multiple_of(2) && (4..2 * ASPHERE_TERMS + 4).contains(&power);
    let last = powers().last().map_or(0, |(power, _)| power);
    if powers().all(|(power, _)| is_even(power)) {
        row.asphere = vec![0.0; (last / 2).saturating_sub(1)];
        powers().for_each(|(power, a)| row.asphere[power / 2 - 2] = a);
        return Some(());
    }
    let mut numbers = vec![0.0; last];
    powers().for_each(|(power, a)| numbers[power - 1] = a);
    row.freeform = Some(checked(FreeformKind::OddAsphere, numbers)?);
    Some(())
}

/// A biconic of which one curvature is 0: another one is the sum of two profiles there and none of the kind
/// that is traced here.
fn cylinder(geometry: &Value, row: &mut Row) -> Option<()> {
    let across = curvature(&geometry["radius_x"]);
    row.curvature = curvature(&geometry["radius_y"]);
    row.conic = number(&geometry["conic_y"]);
    if across != 0.0 && row.curvature != 0.0 {
        return None;
    }
    let numbers = vec![across, number(&geometry["conic_x"])];
    row.freeform = Some(checked(FreeformKind::Biconic, numbers)?);
    Some(())
}

/// Gives a row a series of products of a function of x and one of y, from its table `[i][j]`; `None` for one
/// that cannot be traced.
fn product(kind: FreeformKind, table: &Value, row: &mut Row) -> Option<()> {
    let mut left: usize = table
        .as_array()
        .into_iter()
        .flatten()
        .map(|row| list(row).into_iter().filter(|a| *a != 0.0).count())
        .sum();
    if left == 0 {
        return Some(());
    }
    let mut numbers = Vec::new();
    for number in 0..FREEFORM_NUMBERS {
        let [i, j] = kind.degrees(number)?;
        let a = table[i][j].as_f64().unwrap_or(0.0);
        left -= usize::from(a != 0.0);
        numbers.push(a);
        if left == 0 {
            row.freeform = Some(checked(kind, numbers)?);
            return Some(());
        }
    }
    None
}

/// The geometry of a row at a place; `None` for a shape that the format does not have.
pub(super) fn write(row: &Row, cs: &Value) -> Option<Value> {
    let radius = super::write::radius(row.curvature);
    let terms = row.asphere.iter().any(|a| *a != 0.0);
    let plain = |kind: &str| {
        json!({
            "type": kind, "cs": cs, "radius": radius, "conic": row.conic,
            "tol": 1e-14, "max_iter": 200,
        })
    };
    let with = |kind: &str, entries: Value| {
        let mut geometry = plain(kind);
        if let (Some(to), Some(from)) = (geometry.as_object_mut(), entries.as_object()) {
            to.extend(from.clone());
        }
        geometry
    };
    let Some(form) = &row.freeform else {
        return Some(if terms {
            let all: Vec<f64> = std::iter::once(0.0).chain(row.asphere.iter().copied()).collect();
            with("EvenAsphere", json!({"coefficients": all}))
        } else if row.curvature == 0.0 {
            json!({"type": "Plane", "cs": cs, "radius": radius})
        } else {
            plain("StandardGeometry")
        });
    };
    let numbers = &form.numbers;
    match form.kind {
        FreeformKind::OddAsphere => {
            let all = crate::files::zemax::merged_powers(row, form);
            Some(with("OddAsphere", json!({"coefficients": all})))
        }
        FreeformKind::Biconic if !terms && (numbers[0] == 0.0 || row.curvature == 0.0) => {
            let across = super::write::radius(numbers[0]);
            Some(json!({
                "type": "BiconicGeometry", "cs": cs, "radius_x": across, "radius_y": radius,
                "conic_x": numbers[1], "conic_y": row.conic, "tol": 1e-14, "max_iter": 200,
            }))
        }
        FreeformKind::Toroid if !terms => {
            let across = super::write::radius(numbers[0]);
            let entries = json!({
                "radius_x": across, "radius_y": radius, "conic_yz": row.conic,
                "coeffs_poly_y": numbers[1..],
            });
            Some(with("ToroidalGeometry", entries))
        }
        FreeformKind::XyPolynomial { radius } if !terms => {
            let table = table(form, |[i, j]| radius.powi(-((i + j) as i32)))?;
            Some(with("PolynomialGeometry", json!({"coefficients": table})))
        }
        FreeformKind::Chebyshev { half_widths: [x, y] } if !terms => {
            let entries = json!({"coefficients": table(form, |_| 1.0)?, "norm_x": x, "norm_y": y});
            Some(with("ChebyshevPolynomialGeometry", entries))
        }
        _ => None,
    }
}

/// The coefficients of a series of products as a square table, each times a factor of its degrees.
fn table(form: &Freeform<f64>, factor: impl Fn([usize; 2]) -> f64) -> Option<Vec<Vec<f64>>> {
    let degrees: Vec<[usize; 2]> =
        (0..form.numbers.len()).map(|k| form.kind.degrees(k)).collect::<Option<_>>()?;
    let size = degrees.iter().flatten().max().map_or(1, |largest| largest + 1);
    let mut table = vec![vec![0.0; size]; size];
    for (a, own) in form.numbers.iter().zip(degrees) {
        table[own[0]][own[1]] = a * factor(own);
    }
    Some(table)
}
