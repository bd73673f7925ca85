//! Scaling a lens: every length times a factor.

use super::EditError;
use crate::lens::{Aperture, FieldKind, Fields, Lens, Medium, Object, Parameter, Quantity, Row};

/// The power of mm in the unit of a parameter: −1 for a curvature, −3 for the coefficient of r⁴.
fn power(rows: &[Row], parameter: Parameter) -> i32 {
    match parameter.quantity {
        Quantity::Curvature => -1,
        Quantity::Conic | Quantity::Index => 0,
        Quantity::Asphere(term) => -(2 * term as i32 + 3),
        Quantity::Thickness | Quantity::SemiDiameter => 1,
        Quantity::Grin(k) => match &rows[parameter.surface].medium {
            Medium::Grin(gradient) => gradient.power(k),
            _ => 0,
        },
        Quantity::Freeform(k) => {
            rows[parameter.surface].freeform.as_ref().map_or(0, |form| form.kind.power(k))
        }
    }
}

/// Multiplies every length; angles, f-numbers and numerical apertures stay.
pub(super) fn scale(lens: &mut Lens, factor: f64) -> Result<(), EditError> {
    if !(factor > 0.0 && factor.is_finite()) {
        return Err(EditError::InvalidScale(factor));
    }
    for row in &mut lens.surfaces {
        row.curvature *= factor.powi(-1);
        row.thickness *= factor;
        row.semi_diameter = row.semi_diameter.map(|sd| sd * factor);
        row.obstruction = row.obstruction.map(|inner| inner * factor);
        row.apertures.iter_mut().for_each(|own| *own = own.scaled(factor));
        row.decenter = row.decenter.map(|length| length * factor);
        for axis in [&mut row.break_before, &mut row.break_after].into_iter().flatten() {
            axis.decenter = axis.decenter.map(|length| length * factor);
        }
        for (term, a) in row.asphere.iter_mut().enumerate() {
            *a *= factor.powi(-(2 * term as i32 + 3));
        }
        // Nobody knows which of the numbers in the lines of a file are lengths.
        row.locked.iter_mut().for_each(|locked| locked.lines.clear());
        row.foreign_aperture = None;
        row.ideal = row.ideal.map(|ideal| ideal.scaled(factor));
        row.freeform = row.freeform.as_ref().map(|form| form.scaled(factor));
        if let Medium::Grin(gradient) = &mut row.medium {
            for k in gradient.written_terms().collect::<Vec<_>>() {
                let term = gradient.term(k).unwrap_or(0.0);
                gradient.set_term(k, term * factor.powi(gradient.power(k)));
            }
        }
    }
    if let Object::Finite(distance) = &mut lens.object {
        *distance *= factor;
    }
    lens.image_solve = lens.image_solve.map(|offset| offset * factor);
    scale_aperture(&mut lens.aperture, factor);
    scale_fields(&mut lens.fields, factor);
    for position in &mut lens.zoom {
        for own in &mut position.numbers {
            let parameter = Parameter::new(own.surface, own.quantity);
            own.value *= factor.powi(power(&lens.surfaces, parameter));
        }
        position.aperture.iter_mut().for_each(|aperture| scale_aperture(aperture, factor));
        position.fields.iter_mut().for_each(|fields| scale_fields(fields, factor));
    }
    scale_bounds_and_pickups(lens, factor);
    lens.merit.iter_mut().for_each(|goal| goal.scale(factor));
    Ok(())
}

fn scale_aperture(aperture: &mut Aperture, factor: f64) {
    match aperture {
        Aperture::EntrancePupilDiameter(length) | Aperture::StopSemiDiameter(length) => {
            *length *= factor;
        }
        Aperture::FNumber(_) | Aperture::ObjectNa(_) => {}
    }
}

fn scale_fields(fields: &mut Fields, factor: f64) {
    if fields.kind != FieldKind::Angle {
        for field in &mut fields.values {
            field.x *= factor;
            field.y *= factor;
        }
    }
}

/// Scales the bounds of variables and the coefficients of pickups.
fn scale_bounds_and_pickups(lens: &mut Lens, factor: f64) {
    let rows = &lens.surfaces;
    let powers = |parameter| power(rows, parameter);
    for variable in &mut lens.variables {
        let by = factor.powi(powers(variable.parameter));
        variable.min = variable.min.map(|min| min * by);
        variable.max = variable.max.map(|max| max * by);
    }
    for pickup in &mut lens.pickups {
        let by = factor.powi(powers(pickup.parameter));
        pickup.offset *= by;
        pickup.scale *= by / factor.powi(powers(pickup.source));
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::lens::{AxisBreak, FieldPoint, blank};

    #[test]
    fn heights_of_fields_and_decentres_are_lengths_and_angles_are_not() {
        for (kind, factor) in [(FieldKind::Angle, 1.0), (FieldKind::ImageHeight, 4.0)] {
            let mut lens = blank();
            let values = vec![FieldPoint { x: -1.5, y: 3.0, weight: 0.5 }];
            lens.fields = Fields { kind, values };
            let axis = AxisBreak { decenter: [0.5, 0.0, -1.0], tilt: [45.0, 0.0, 0.0] };
            let (decenter, tilt, break_after) = ([0.25, -0.5], [1.0, 2.0], Some(axis));
            lens.surfaces = vec![Row { decenter, tilt, break_after, ..Row::default() }];
            scale(&mut lens, 4.0).unwrap();
            let field = lens.fields.values[0];
            assert_eq!([field.x, field.y, field.weight], [-1.5 * factor, 3.0 * factor, 0.5]);
            assert_eq!(lens.surfaces[0].decenter, [1.0, -2.0]);
            assert_eq!(lens.surfaces[0].tilt, [1.0, 2.0]);
            let scaled = AxisBreak { decenter: [2.0, 0.0, -4.0], ..axis };
            assert_eq!(lens.surfaces[0].break_after, Some(scaled));
        }
    }
}
