//! The prescription report of a lens: what it is, and how good it is, every number with its error.

use super::error::ReportError;
use super::image_charts::{FIGURE, SpotCell, contrast_figure, spot_figure};
use super::layout_drawing::LayoutScene;
use super::materials::bill_of_material;
use super::prescription_tables::{add_first_order, add_prescription};
use crate::analysis::{
    AnalysisError, Estimate, MtfCurve, Spot, airy_radius, check_some_light, perfect_contrast,
    polychromatic_geometric_mtf, spot_points, spots,
};
use crate::effects::{self, EffectOverrides, EffectPlan, TracePurpose};
use crate::lens::{Aperture, FieldKind, FieldPoint, Lens, Object, System, Wavelength};
use crate::math::ShortNumber;
use crate::paraxial::{Beam, FirstOrder, first_order};
use crate::plot::{DocumentTable, ReportDocument};
use crate::pupil::{Accuracy, RayModel};

/// The number of frequencies of a contrast curve, and of those in its table.
const FREQUENCIES: usize = 26;
const TABLED: usize = 5;
/// The height of the layout in the report, in mm.
const LAYOUT: f64 = 118.0;

/// The settings of a prescription report.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ReportSettings {
    /// The tolerance of spots, relative to their radius, and of contrasts.
    pub tolerance: f64,
}

/// The prescription report of a lens at all its zoom positions.
///
/// # Errors
/// A lens or an aperture through which no ray can be traced, or no light gets through.
pub fn prescription_report(
    lens: &Lens,
    settings: ReportSettings,
) -> Result<ReportDocument, ReportError> {
    let title = if lens.name.is_empty() { "Lens without a name" } else { &lens.name };
    let mut document = ReportDocument {
        title: title.to_owned(),
        footer: format!("Aplanat {}: {title}", env!("CARGO_PKG_VERSION")),
        blocks: Vec::new(),
    };
    let positions: Vec<ReportPosition<'_>> = (0..lens.zoom_positions())
        .map(|zoom| ReportPosition::new(lens, zoom, settings))
        .collect::<Result<_, _>>()?;
    let fields =
        positions.iter().flat_map(|at| at.exact.fields.iter().map(|field| (&at.exact, *field)));
    check_some_light(fields).map_err(ReportError::Dark)?;
    introduce(&mut document, lens);
    positions.iter().for_each(|position| position.add_layout(&mut document));
    add_prescription(&mut document, lens);
    let systems: Vec<_> =
        positions.iter().map(|at| (&at.data, at.system.image_position())).collect();
    add_first_order(&mut document, lens, &systems);
    positions.iter().for_each(|position| position.add_spots(&mut document));
    positions.iter().for_each(|position| position.add_contrast(&mut document));
    positions.iter().for_each(|position| position.add_effects(&mut document));
    document.text(
        "Always off: coatings, polarization, stray light, surface scatter, and changes by temperature \
         and pressure: indices are those of the glass catalogues at about 20 \u{b0}C in air.",
    );
    if let Some(first) = positions.first() {
        document.heading("Bill of material");
        let (table, weight) = bill_of_material(&first.scene.bodies());
        if table.rows.is_empty() {
            document.text("The lens has no glass.");
        } else {
            document.table(table);
            document.text(weight);
        }
    }
    Ok(document)
}

/// A lens at one zoom position with all that the report computes.
struct ReportPosition<'a> {
    lens: &'a Lens,
    zoom: usize,
    scene: LayoutScene<'a>,
    system: System<f64>,
    data: FirstOrder<f64>,
    plan: EffectPlan,
    model: RayModel,
    exact: RayModel,
    accuracy: Accuracy,
}

impl<'a> ReportPosition<'a> {
    fn new(lens: &'a Lens, zoom: usize, settings: ReportSettings) -> Result<Self, ReportError> {
        let exact = RayModel::from_lens(lens, zoom)?;
        let system = exact.channels[exact.primary].system.clone();
        let data = first_order(&system, &Beam::for_lens(lens, zoom))?;
        let measured = effects::measure_effects(lens, zoom)?;
        let purpose = TracePurpose::Spot(settings.tolerance);
        let plan = effects::plan(&measured, purpose, &EffectOverrides::default());
        let model = effects::build_ray_model(lens, zoom, &plan)?;
        let accuracy = Accuracy { tolerance: settings.tolerance, ..Accuracy::default() };
        let scene = LayoutScene::new(lens, zoom)?;
        Ok(Self { lens, zoom, scene, system, data, plan, model, exact, accuracy })
    }

    /// The words behind a heading where there are several positions.
    fn suffix(&self) -> String {
        let Some(position) = self.lens.zoom.get(self.zoom) else { return String::new() };
        format!(", zoom position {} {}", self.zoom, position.name).trim_end().to_owned()
    }

    fn fields(&self) -> &[FieldPoint] {
        &self.lens.fields_at(self.zoom).values
    }

    fn field_name(&self, i: usize) -> String {
        field_name(self.lens.fields_at(self.zoom).kind, &self.fields()[i])
    }

    fn add_layout(&self, document: &mut ReportDocument) {
        document.heading(format!("Layout{}", self.suffix()));
        let figure = self.scene.figure([FIGURE, LAYOUT]);
        let scale = figure.scale.map(|scale| super::sheet::scale_text(scale.factor));
        let caption = format!(
            "Scale {} on paper. Elements are numbered; rays of the fields at the primary wavelength.",
            scale.unwrap_or_default()
        );
        document.figure(figure, caption);
        for (field, reason) in self.scene.lost_fields() {
            document.text(format!("Field {}: {reason}.", self.field_name(*field)));
        }
    }

    fn add_spots(&self, document: &mut ReportDocument) {
        document.heading(format!("Spots{}", self.suffix()));
        let found = spots(&self.model, self.accuracy);
        let airy = airy_radius(&self.model);
        let (figure, side) = spot_figure(&self.spot_cells(&found), airy);
        let circle = airy.map_or_else(String::new, |radius| {
            format!(" The circle is the Airy disc, {} mm in radius.", ShortNumber(radius))
        });
        let side = ShortNumber(side);
        document.figure(figure, format!("The side of a square is {side} mm.{circle}"));
        document.table(self.spot_table(&found));
        document.text(
            "All wavelengths by their weights, about their common centroid, in mm. Each error is that \
             of the quadrature over the pupil and of the effects that are left out.",
        );
    }

    fn spot_cells(&self, found: &[Result<Spot, AnalysisError>]) -> Vec<SpotCell> {
        let points = spot_points(&self.model);
        let cell = |(i, spot): (usize, &Result<Spot, AnalysisError>)| SpotCell {
            name: self.field_name(i),
            centroid: spot.as_ref().ok().map(|spot| spot.centroid.map(|c| c.value)),
            points: points.iter().filter(|dots| dots.field == i).cloned().collect(),
        };
        found.iter().enumerate().map(cell).collect()
    }

    fn spot_table(&self, found: &[Result<Spot, AnalysisError>]) -> DocumentTable {
        let heads = ["field", "RMS radius", "largest radius", "centroid x", "centroid y"];
        let mut table = DocumentTable::new(&heads, &[0]);
        for (i, spot) in found.iter().enumerate() {
            let name = self.field_name(i);
            match spot {
                Ok(spot) => {
                    let [x, y] = spot.centroid;
                    let numbers = [spot.rms, spot.radius, x, y];
                    table.row([name].into_iter().chain(numbers.iter().map(estimate_text)));
                }
                Err(reason) => table.row([name, reason.to_string()]),
            }
        }
        table
    }

    fn add_contrast(&self, document: &mut ReportDocument) {
        document.heading(format!("Geometric MTF{}", self.suffix()));
        let frequencies = self.frequencies();
        let mut curves: Vec<(String, MtfCurve)> = Vec::new();
        for i in 0..self.exact.fields.len() {
            let field = self.exact.fields[i];
            let name = self.field_name(i);
            match polychromatic_geometric_mtf(&self.exact, field, &frequencies, self.accuracy) {
                Ok(curve) => curves.push((name, curve)),
                Err(reason) => document.text(format!("Field {name}: {reason}.")),
            }
        }
        let drawn: Vec<_> = curves.iter().map(|(name, curve)| (name.clone(), curve)).collect();
        if drawn.is_empty() {
            return;
        }
        document
            .figure(contrast_figure(&drawn), "Contrast by rays alone, all wavelengths by weight.");
        document.table(contrast_table(&curves));
        let highest = frequencies.last().copied().unwrap_or(0.0);
        document.text(self.diffraction_text(highest));
    }

    /// Frequencies up to that at which the middle one of the spots has lost most of its contrast.
    fn frequencies(&self) -> Vec<f64> {
        let mut radii: Vec<f64> =
            spots(&self.model, self.accuracy).iter().flatten().map(|spot| spot.rms.value).collect();
        radii.sort_by(f64::total_cmp);
        let rms = radii.get(radii.len() / 2).copied().unwrap_or(0.01).max(1e-6);
        let wanted = (0.5 / rms).min(self.cutoff().unwrap_or(f64::INFINITY));
        let power = 10f64.powf(wanted.log10().floor());
        let steps = [1.0, 2.0, 5.0, 10.0];
        let highest = power * steps.into_iter().find(|s| s * power >= wanted).unwrap_or(10.0);
        (0..FREQUENCIES).map(|i| highest * i as f64 / (FREQUENCIES - 1) as f64).collect()
    }

    /// The spatial frequency in cycles/mm at which the contrast of a perfect lens ends.
    fn cutoff(&self) -> Option<f64> {
        let um = self.model.channels[self.model.primary].um;
        self.data.working_f_number.map(|f| 1.0 / (1e-3 * um * f.abs()))
    }

    fn diffraction_text(&self, frequency: f64) -> String {
        let Some(cutoff) = self.cutoff() else {
            return "Diffraction is off here: this is the contrast of the rays. The lens has no working \
                    f-number by which its effect could be told."
                .to_owned();
        };
        let change = 1.0 - perfect_contrast(frequency / cutoff);
        format!(
            "Diffraction is off here: this is the contrast of the rays. It takes {:.3} from the contrast \
             of a perfect lens at {} cycles/mm, and ends it at {:.1} cycles/mm.",
            change,
            ShortNumber(frequency),
            cutoff
        )
    }

    fn add_effects(&self, document: &mut ReportDocument) {
        document.heading(format!("Effects{}", self.suffix()));
        let decisions = &self.plan.decisions;
        let computed: Vec<&str> =
            decisions.iter().filter(|d| d.computed).map(|d| d.effect.name()).collect();
        document.text(format!("Computed: {}.", computed.join(", ")));
        let mut table = DocumentTable::new(&["off", "why", "change by it", "allowed"], &[0, 1]);
        for decision in decisions.iter().filter(|decision| !decision.computed) {
            let number = |value| format!("{} {}", ShortNumber(value), decision.unit);
            table.row([
                decision.effect.name().to_owned(),
                decision.reason.clone(),
                number(decision.residual),
                number(decision.limit),
            ]);
        }
        document.table(table);
    }
}

fn introduce(document: &mut ReportDocument, lens: &Lens) {
    if !lens.source.is_empty() {
        document.text(format!("Source: {}", lens.source));
    }
    if !lens.notes.is_empty() {
        document.text(lens.notes.clone());
    }
    let object = match lens.object {
        Object::Infinity => "at infinity".to_owned(),
        Object::Finite(distance) => format!("{} mm in front", ShortNumber(distance)),
    };
    let fields: Vec<String> =
        lens.fields.values.iter().map(|field| field_name(lens.fields.kind, field)).collect();
    let primary = lens.primary();
    let wavelength = |(i, w): (usize, &Wavelength)| {
        let mark = if i == primary { ", primary" } else { "" };
        format!("{} \u{b5}m (weight {}{mark})", ShortNumber(w.um), ShortNumber(w.weight))
    };
    let wavelengths: Vec<String> = lens.wavelengths.iter().enumerate().map(wavelength).collect();
    document.text(format!(
        "Object {object}; {}; fields {}; wavelengths {}. Lengths in mm. Light travels towards +z; a \
         positive radius has its centre behind the surface.",
        aperture_text(lens.aperture),
        fields.join(", "),
        wavelengths.join(", ")
    ));
}

fn aperture_text(aperture: Aperture) -> String {
    match aperture {
        Aperture::EntrancePupilDiameter(d) => format!("entrance pupil {} mm wide", ShortNumber(d)),
        Aperture::FNumber(f) => format!("f-number {}", ShortNumber(f)),
        Aperture::ObjectNa(na) => format!("numerical aperture {} in object space", ShortNumber(na)),
        Aperture::StopSemiDiameter(r) => format!("stop with a radius of {} mm", ShortNumber(r)),
    }
}

fn field_name(kind: FieldKind, field: &FieldPoint) -> String {
    let unit = match kind {
        FieldKind::Angle => "\u{b0}",
        FieldKind::ObjectHeight => " mm object",
        FieldKind::ImageHeight => " mm image",
    };
    if field.x == 0.0 {
        return format!("{}{unit}", ShortNumber(field.y));
    }
    format!("({}, {}){unit}", ShortNumber(field.x), ShortNumber(field.y))
}

fn estimate_text(estimate: &Estimate) -> String {
    let value = if estimate.value.abs() <= estimate.error && estimate.error < 1e-9 {
        0.0
    } else {
        estimate.value
    };
    format!("{} \u{b1} {:.0e}", ShortNumber(value), estimate.error)
}

fn contrast_table(curves: &[(String, MtfCurve)]) -> DocumentTable {
    let step = (FREQUENCIES - 1) / TABLED;
    let mut heads = vec!["field, direction".to_owned()];
    let frequencies = curves.first().map(|(_, curve)| &curve.points[..]).unwrap_or_default();
    let listed = || frequencies.iter().enumerate().skip(step).step_by(step).map(|(i, _)| i);
    heads.extend(listed().map(|i| format!("{}/mm", ShortNumber(frequencies[i].frequency))));
    let mut table = DocumentTable { head: heads, rows: Vec::new(), left: vec![0] };
    for (name, curve) in curves {
        let cell = |value: Estimate| format!("{:.4} \u{b1} {:.0e}", value.value, value.error);
        let tangential = listed().map(|i| cell(curve.points[i].tangential.modulus));
        table.row([format!("{name} tangential")].into_iter().chain(tangential));
        let sagittal = listed().map(|i| cell(curve.points[i].sagittal.modulus));
        table.row([format!("{name} sagittal")].into_iter().chain(sagittal));
    }
    table
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The curves end where the middle one of the spots has lost most of its contrast, and not far beyond
    /// what any lens resolves; at a frequency of 1, 2 or 5 with zeros.
    #[test]
    fn frequencies_reach_from_zero_to_what_a_lens_resolves() {
        for name in ["double_gauss_nikkor_s_50", "grin_rod_melles_griot", "singlet_la1131"] {
            let bundled = crate::files::bundled_lenses().iter().find(|b| b.name == name).unwrap();
            let lens = crate::files::json::read(bundled.text, name).unwrap();
            let settings = ReportSettings { tolerance: 0.01 };
            let position = ReportPosition::new(&lens, 0, settings).unwrap();
            let found = position.frequencies();
            let last = found[FREQUENCIES - 1];
            assert!(found.len() == FREQUENCIES && found[0] == 0.0);
            let step = last / (FREQUENCIES - 1) as f64;
            assert!(found.windows(2).all(|pair| (pair[1] - pair[0] - step).abs() < 1e-9 * last));
            let digits = last / 10f64.powf(last.log10().floor() + 1e-12);
            assert!([1.0, 2.0, 5.0, 10.0].iter().any(|d| (digits - d).abs() < 1e-6), "{last}");
            assert!(last <= 2.6 * position.cutoff().unwrap(), "{name}: {last}");
            let mut radii: Vec<f64> = (0..lens.fields.values.len())
                .map(|i| {
                    crate::analysis::spot(
                        &position.exact,
                        position.exact.fields[i],
                        position.accuracy,
                    )
                })
                .filter_map(|found| Some(found.ok()?.rms.value))
                .collect();
            radii.sort_by(f64::total_cmp);
            let middle = radii[radii.len() / 2];
            // A spot of this radius over half of a period blurs it.
            let blurred = 0.5 / middle;
            let wanted = blurred.min(position.cutoff().unwrap());
            assert!(last > 0.9 * wanted && last < 2.8 * wanted, "{name}: {last} {wanted}");
        }
    }
}
