//! The multi-configuration table: all positions of one operand, then the next.

use super::{ZemaxWriter, number};
use crate::files::report::ConversionOutcome;
use crate::lens::{Aperture, Fields, Parameter, Quantity, ZoomNumber};
use std::mem::discriminant;

/// The operands of the numbers that can differ.
const OPERANDS: [(&str, Quantity); 4] = [
    ("THIC", Quantity::Thickness),
    ("CRVT", Quantity::Curvature),
    ("CONN", Quantity::Conic),
    ("SDIA", Quantity::SemiDiameter),
];

impl ZemaxWriter {
    pub(super) fn table(&mut self) {
        let positions = self.lens.zoom.len();
        if positions == 0 {
            return;
        }
        self.line(format!("MNUM {positions} 1"));
        self.zoom_numbers();
        self.apertures();
        self.zoom_fields();
    }

    /// One operand at all positions.
    fn operand(&mut self, name: &str, target: usize, values: &[(f64, bool)]) {
        for (i, (value, variable)) in values.iter().enumerate() {
            let (configuration, status) = (i + 1, i32::from(*variable));
            let value = number(*value);
            self.line(format!(
                "{name} {target} {configuration} {value} {status} 0 0 1 1 1 0 0 \"\" 0"
            ));
        }
    }

    /// The numbers that differ, as far as they have operands.
    fn zoom_numbers(&mut self) {
        for surface in 0..self.lens.surfaces.len() {
            for (name, quantity) in OPERANDS {
                if !self.lens.is_zoomed(surface, quantity) {
                    continue;
                }
                let value = |zoom| {
                    let parameter = Parameter::at_zoom(surface, quantity, zoom);
                    let value = self.lens.get(parameter).unwrap_or(0.0);
                    (value, self.lens.variable(parameter).is_some())
                };
                let values: Vec<(f64, bool)> = (0..self.lens.zoom.len()).map(value).collect();
                let numbers = self.numbers[surface];
                let is_gap = quantity == Quantity::Thickness;
                self.operand(name, if is_gap { numbers.gap } else { numbers.surface }, &values);
            }
        }
        let is_lost = |own: &&ZoomNumber| OPERANDS.iter().all(|(_, known)| *known != own.quantity);
        let lost: Vec<Parameter> = (0..self.lens.zoom.len())
            .flat_map(|zoom| {
                let lost = self.lens.zoom[zoom].numbers.iter().filter(is_lost);
                lost.map(move |own| Parameter::at_zoom(own.surface, own.quantity, zoom))
            })
            .collect();
        for parameter in lost {
            let note = "the number of the lens is used at every position";
            self.record(ConversionOutcome::Dropped, parameter.to_string(), note);
        }
    }

    fn apertures(&mut self) {
        let base = self.lens.aperture;
        let all: Vec<Aperture> =
            (0..self.lens.zoom.len()).map(|zoom| self.lens.aperture_at(zoom)).collect();
        if self.lens.zoom.iter().all(|position| position.aperture.is_none()) {
            return;
        }
        if all.iter().any(|aperture| discriminant(aperture) != discriminant(&base)) {
            let note = "apertures of different kinds: that of the lens is used at every position";
            self.record(ConversionOutcome::Dropped, "apertures of the zoom positions", note);
            return;
        }
        let values: Vec<(f64, bool)> = all.into_iter().map(|a| (size(a), false)).collect();
        match (base, self.lens.stop()) {
            (Aperture::StopSemiDiameter(_), Some(stop)) => {
                let surface = self.numbers[stop].surface;
                self.operand("SDIA", surface, &values);
            }
            _ => self.operand("APER", 0, &values),
        }
    }

    fn zoom_fields(&mut self) {
        if self.lens.zoom.iter().all(|position| position.fields.is_none()) {
            return;
        }
        let base = self.lens.fields.clone();
        let all: Vec<Fields> =
            (0..self.lens.zoom.len()).map(|zoom| self.lens.fields_at(zoom).clone()).collect();
        if !all.iter().all(|fields| fields.are_like(&base)) {
            let note = "fields of another kind, number or weight: those of the lens are used at every position";
            self.record(ConversionOutcome::Dropped, "fields of the zoom positions", note);
            return;
        }
        let points: Vec<Vec<[f64; 2]>> = all.iter().map(Fields::projected_points).collect();
        let any_x = points.iter().flatten().any(|point| point[0] != 0.0);
        for i in 0..base.values.len() {
            let column = |axis: usize| -> Vec<(f64, bool)> {
                points.iter().map(|points| (points[i][axis], false)).collect()
            };
            if any_x {
                self.operand("XFIE", i + 1, &column(0));
            }
            self.operand("YFIE", i + 1, &column(1));
        }
    }
}

fn size(aperture: Aperture) -> f64 {
    match aperture {
        Aperture::EntrancePupilDiameter(v)
        | Aperture::FNumber(v)
        | Aperture::ObjectNa(v)
        | Aperture::StopSemiDiameter(v) => v,
    }
}
