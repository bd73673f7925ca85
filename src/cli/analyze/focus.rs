//! Through focus: the spot at displaced image planes.

use super::{AnalysisRun, AtField, FieldOutcome, SelectedField, TextLines, estimate_text, spot};
use crate::analysis::{AnalysisError, Estimate};
use crate::cli::error::CliError;
use crate::cli::output::ShortNumber;
use crate::effects::build_ray_model_at;
use crate::lens::{FieldPoint, Lens, Quantity};
use crate::measure::time_ms;
use crate::plot::{ChartCurve, CurveChart};
use serde::Serialize;

/// The number of image planes on each side of that of the lens.
const STEPS: i32 = 5;

/// The spots of a field through focus.
#[derive(Serialize)]
pub(super) struct ThroughFocusJson {
    positions: Vec<FocusPosition>,
}

#[derive(Serialize)]
struct FocusPosition {
    /// The displacement of the image plane along z, in mm.
    defocus: f64,
    rms: Option<Estimate>,
}

pub(super) fn through_focus(run: &AnalysisRun) -> Result<Vec<AtField<ThroughFocusJson>>, CliError> {
    let step = focus_step(run);
    let mut columns = Vec::new();
    for i in -STEPS..=STEPS {
        let defocus = f64::from(i) * step;
        columns.push((defocus, spots(run, defocus)?));
    }
    let at = |(i, field): (usize, &SelectedField)| {
        let position = |(defocus, spots): &(f64, Vec<Result<Estimate, AnalysisError>>)| {
            FocusPosition { defocus: *defocus, rms: spots[i].ok() }
        };
        let dark = columns.iter().find_map(|(_, spots)| spots[i].err());
        let lit = columns.iter().any(|(_, spots)| spots[i].is_ok());
        let keys = ThroughFocusJson { positions: columns.iter().map(position).collect() };
        AtField::new(
            field,
            if lit { Ok(keys) } else { Err(dark.unwrap_or(AnalysisError::NoLight)) },
        )
    };
    Ok(run.fields.iter().enumerate().map(at).collect())
}

/// The RMS radii of all fields at a displaced image plane.
fn spots(
    run: &AnalysisRun,
    defocus: f64,
) -> Result<Vec<Result<Estimate, AnalysisError>>, CliError> {
    let mut moved = run.opened.clone();
    shift_image(&mut moved.lens, run.zoom, defocus);
    let fields: Vec<FieldPoint> = run.fields.iter().map(|field| field.given).collect();
    let model = build_ray_model_at(&moved.lens, run.zoom, &fields, &run.plan)
        .map_err(|source| CliError::RayModel { file: moved.file.clone(), source })?;
    let spot = |field: &FieldPoint| {
        let (result, ms) = time_ms(|| crate::analysis::spot(&model, *field, run.accuracy));
        result.map(|spot| Estimate { milliseconds: Some(ms), ..spot.rms })
    };
    Ok(model.fields.iter().map(spot).collect())
}

/// Displaces the image plane along z by the number that determines its position.
fn shift_image(lens: &mut Lens, zoom: usize, defocus: f64) {
    if let Some(offset) = &mut lens.image_solve {
        *offset += defocus;
        return;
    }
    let last = lens.surfaces.len() - 1;
    let parameter = lens.parameter_at(zoom, last, Quantity::Thickness);
    lens.pickups.retain(|pickup| pickup.parameter != parameter);
    let gap = lens.get(parameter).unwrap_or(0.0);
    lens.set(parameter, gap + defocus);
}

/// The step of the displacement, a round number over which the spot of the sharpest field changes by
/// about its own size.
fn focus_step(run: &AnalysisRun) -> f64 {
    let rms = |field: &AtField<spot::SpotJson>| match &field.outcome {
        FieldOutcome::Transmitted(lit) => Some(lit.rms()),
        FieldOutcome::Dark { .. } => None,
    };
    let smallest = spot::spots(run).iter().filter_map(rms).fold(f64::INFINITY, f64::min);
    let first = &run.model.first_order;
    let f_number = first.working_f_number.unwrap_or(1.0).abs();
    let airy = 1.22 * run.primary_um() * 1e-3 * f_number;
    let step = f_number * if smallest.is_finite() { smallest.max(airy) } else { airy };
    let power = 10f64.powf(step.log10().floor());
    power * (step / power).round().max(1.0)
}

impl TextLines for ThroughFocusJson {
    const TITLE: &'static str =
        "through focus: rms radius in mm over all colours, against the shift of the image plane";

    fn lines(&self) -> Vec<String> {
        let line = |position: &FocusPosition| {
            let sign = if position.defocus > 0.0 { "+" } else { "" };
            let name = format!("{sign}{}", ShortNumber(position.defocus));
            position
                .rms
                .as_ref()
                .map_or(format!("{name:<22} no light"), |rms| estimate_text(&name, rms))
        };
        self.positions.iter().map(line).collect()
    }

    fn charts(&self) -> Vec<CurveChart> {
        let radius = |at: &FocusPosition| (at.defocus, at.rms.map(|rms| rms.value));
        let curve = ChartCurve::new("all colours", 0, self.positions.iter().map(radius));
        let axes = ["shift of the image plane, mm", "rms radius, mm"];
        vec![CurveChart::new("through focus", axes, vec![curve])]
    }
}
