//! The lens at several temperatures: where its image goes, and how sharp it is with and without refocusing.

use super::{AnalysisRun, AtField, SelectedField, TextLines, estimate_text};
use crate::analysis::{self, AnalysisError, Estimate};
use crate::cli::error::CliError;
use crate::cli::output::ShortNumber;
use crate::effects::build_ray_model_at;
use crate::lens::{FieldPoint, LensError, paraxial_image_distance};
use crate::measure::time_ms;
use crate::plot::{ChartCurve, CurveChart};
use serde::Serialize;

/// A field of the lens at several temperatures.
#[derive(Serialize)]
pub(super) struct ThermalJson {
    /// The linear expansion of the mount, in 1e-6/K.
    mount_expansion: f64,
    temperatures: Vec<TemperatureJson>,
}

/// A field at one temperature.
#[derive(Serialize, Clone)]
struct TemperatureJson {
    celsius: f64,
    focal_length: Option<f64>,
    /// The paraxial image from the image plane that the mount holds, in mm along z.
    defocus: f64,
    /// The RMS radius in the image plane that the mount holds, in mm.
    rms: Option<Estimate>,
    /// The RMS radius in the best plane for this field, in mm.
    rms_refocused: Option<f64>,
    /// That plane from the image plane that the mount holds, in mm along the light.
    refocus: Option<f64>,
}

/// The lens at one temperature: what all fields share, and the spot of each.
struct WarmLens {
    shared: TemperatureJson,
    spots: Vec<Result<SpotAt, AnalysisError>>,
}

struct SpotAt {
    rms: Estimate,
    refocused: Option<[f64; 2]>,
}

pub(super) fn temperatures(
    run: &AnalysisRun,
    temperatures: &[f64],
    mount: Option<f64>,
) -> Result<Vec<AtField<ThermalJson>>, CliError> {
    let mut opened = run.opened.clone();
    if let Some(expansion) = mount {
        opened.lens.environment.mount_expansion = expansion;
    }
    let refuse = |option: &str, source: LensError| CliError::Input(format!("{option}: {source}"));
    opened.lens.check().map_err(|source| refuse("--mount", source))?;
    let mut warmed = Vec::new();
    for celsius in temperatures {
        let lens = opened.lens.at_temperature(run.zoom, *celsius);
        let lens = lens.map_err(|source| refuse("--temperatures", source))?;
        warmed.push(warm_lens(run, &lens, *celsius)?);
    }
    let mount_expansion = opened.lens.environment.mount_expansion;
    let at = |(i, field): (usize, &SelectedField)| {
        let of_field = |warm: &WarmLens| {
            let spot = warm.spots[i].as_ref().ok();
            TemperatureJson {
                rms: spot.map(|spot| spot.rms),
                refocus: spot.and_then(|spot| spot.refocused).map(|[shift, _]| shift),
                rms_refocused: spot.and_then(|spot| spot.refocused).map(|[_, rms]| rms),
                ..warm.shared.clone()
            }
        };
        let lost = warmed.iter().find_map(|warm| warm.spots[i].as_ref().err().copied());
        let lit = warmed.iter().any(|warm| warm.spots[i].is_ok());
        let temperatures = warmed.iter().map(of_field).collect();
        let found = ThermalJson { mount_expansion, temperatures };
        AtField::new(
            field,
            if lit { Ok(found) } else { Err(lost.unwrap_or(AnalysisError::NoLight)) },
        )
    };
    Ok(run.fields.iter().enumerate().map(at).collect())
}

fn warm_lens(
    run: &AnalysisRun,
    lens: &crate::lens::Lens,
    celsius: f64,
) -> Result<WarmLens, CliError> {
    let fields: Vec<FieldPoint> = run.fields.iter().map(|field| field.given).collect();
    // The plan was measured at the temperature of the lens; nothing that it leaves out depends on another.
    let model = build_ray_model_at(lens, 0, &fields, &run.plan)
        .map_err(|source| CliError::RayModel { file: run.opened.file.clone(), source })?;
    let spot = |field: &FieldPoint| {
        let (found, ms) = time_ms(|| analysis::spot(&model, *field, run.accuracy));
        found.map(|spot| SpotAt {
            rms: Estimate { milliseconds: Some(ms), ..spot.rms },
            refocused: spot.best_focus().map(|shift| [shift, spot.rms_at(shift)]),
        })
    };
    let spots = model.fields.iter().map(spot).collect();
    let system = &model.channels[model.primary].system;
    let gap = system.surfaces[system.surfaces.len() - 2].thickness;
    let shared = TemperatureJson {
        celsius,
        focal_length: model.first_order.efl,
        defocus: paraxial_image_distance(system, lens.object) - gap,
        rms: None,
        rms_refocused: None,
        refocus: None,
    };
    Ok(WarmLens { shared, spots })
}

impl TextLines for ThermalJson {
    const TITLE: &'static str = "temperatures in degrees C: focal length, the paraxial image from the image plane \
                                 that the mount holds, rms radius there and refocused; mm";

    fn lines(&self) -> Vec<String> {
        let mut lines =
            vec![format!("mount expands by {}e-6/K", ShortNumber(self.mount_expansion))];
        lines.extend(self.temperatures.iter().map(TemperatureJson::line));
        lines
    }

    fn charts(&self) -> Vec<CurveChart> {
        let fixed = |at: &TemperatureJson| (at.celsius, at.rms.map(|rms| rms.value));
        let refocused = |at: &TemperatureJson| (at.celsius, at.rms_refocused);
        let curves = vec![
            ChartCurve::new(
                "image plane held by the mount",
                0,
                self.temperatures.iter().map(fixed),
            ),
            ChartCurve::new("refocused", 1, self.temperatures.iter().map(refocused)),
        ];
        let axes = ["temperature, C", "rms radius, mm"];
        vec![CurveChart::new("temperature", axes, curves)]
    }
}

impl TemperatureJson {
    fn line(&self) -> String {
        let focal =
            self.focal_length.map_or_else(|| "-".to_owned(), |f| ShortNumber(f).to_string());
        let name =
            format!("{} C: f {focal}, image {:+.5}", ShortNumber(self.celsius), self.defocus);
        let Some(rms) = &self.rms else { return format!("{name:<22} no light") };
        let refocused = match (self.rms_refocused, self.refocus) {
            (Some(rms), Some(shift)) => format!("; refocused by {shift:+.5}: {}", ShortNumber(rms)),
            _ => String::new(),
        };
        estimate_text(&format!("{name}, rms"), rms) + &refocused
    }
}
