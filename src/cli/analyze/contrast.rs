//! The modulation transfer function: against frequency, and through focus.

use super::{AnalysisRun, AtField, SelectedField, TextLines, not_reached_text};
use crate::analysis::{AnalysisError, diffraction_mtf, perfect_contrast};
use crate::analysis::{
    DiffractionGate, MtfCurve, MtfPoint, diffraction_gate, geometric_mtf,
    polychromatic_diffraction_mtf, polychromatic_geometric_mtf, through_focus_mtf,
};
use crate::cli::output::{ShortNumber, counted};
use crate::measure::time_ms;
use crate::plot::{ChartCurve, CurveChart};
use serde::Serialize;

/// The contrast of a field.
#[derive(Serialize)]
pub(super) struct MtfJson {
    gate: GateJson,
    diffraction: CurveJson,
    geometric: CurveJson,
    polychromatic_diffraction: CurveJson,
    polychromatic_geometric: CurveJson,
    /// The contrast without aberrations, if it is drawn.
    #[serde(skip)]
    limit: Option<DiffractionLimit>,
}

/// The contrast of a lens without aberrations with a round pupil on the axis, at all wavelengths.
struct DiffractionLimit {
    f_number: f64,
    /// Frequencies in cycles/mm and contrasts.
    points: Vec<[f64; 2]>,
}

/// The points of the drawn contrast without aberrations.
const LIMIT_POINTS: u32 = 60;

impl DiffractionLimit {
    /// That of a lens up to a frequency in cycles/mm; `None` of an afocal one.
    fn new(run: &AnalysisRun, highest: f64) -> Option<Self> {
        let f_number = run.model.first_order.working_f_number?.abs();
        let colors = &run.model.channels;
        let weights: f64 = colors.iter().map(|color| color.weight).sum();
        let at = |i: u32| {
            let frequency = highest * f64::from(i) / f64::from(LIMIT_POINTS);
            let contrast = colors.iter().map(|color| {
                color.weight * perfect_contrast(frequency * 1e-3 * color.um * f_number)
            });
            [frequency, contrast.sum::<f64>() / weights]
        };
        Some(Self { f_number, points: (0..=LIMIT_POINTS).map(at).collect() })
    }

    fn curve(&self) -> ChartCurve {
        let name = format!("diffraction limit, f/{:.2}", self.f_number);
        ChartCurve::new(name, 0, self.points.iter().map(|[x, y]| (*x, Some(*y)))).neutral()
    }
}

/// The decision about diffraction, or the reason why there is none.
#[derive(Serialize)]
#[serde(untagged)]
enum GateJson {
    Decided(DiffractionGate),
    Refused { refused: String },
}

/// A curve with its time, or the reason why there is none.
#[derive(Serialize)]
#[serde(untagged)]
enum CurveJson {
    Curve {
        milliseconds: f64,
        #[serde(flatten)]
        curve: MtfCurve,
    },
    Refused {
        refused: String,
    },
}

impl CurveJson {
    fn of(work: impl FnOnce() -> Result<MtfCurve, AnalysisError>) -> Self {
        match time_ms(work) {
            (Ok(curve), milliseconds) => Self::Curve { milliseconds, curve },
            (Err(why), _) => Self::Refused { refused: why.to_string() },
        }
    }
}

pub(super) fn contrasts(run: &AnalysisRun) -> Vec<AtField<MtfJson>> {
    let (model, accuracy, nu) = (&run.model, run.accuracy, &run.frequencies[..]);
    let highest = nu.iter().copied().fold(0.0, f64::max);
    let at = |chosen: &SelectedField| {
        let (field, w) = (chosen.traced, model.primary);
        // A field without light has neither.
        let keys = geometric_mtf(model, field, w, &nu[..1], accuracy).map(|_| MtfJson {
            gate: match diffraction_gate(model, field, w, highest, accuracy.tolerance) {
                Ok(gate) => GateJson::Decided(gate),
                Err(why) => GateJson::Refused { refused: why.to_string() },
            },
            diffraction: CurveJson::of(|| diffraction_mtf(model, field, w, nu, accuracy)),
            geometric: CurveJson::of(|| geometric_mtf(model, field, w, nu, accuracy)),
            polychromatic_diffraction: CurveJson::of(|| {
                polychromatic_diffraction_mtf(model, field, nu, accuracy)
            }),
            polychromatic_geometric: CurveJson::of(|| {
                polychromatic_geometric_mtf(model, field, nu, accuracy)
            }),
            limit: run.is_drawn.then(|| DiffractionLimit::new(run, highest)).flatten(),
        });
        AtField::new(chosen, keys)
    };
    run.at_each_field(at)
}

impl TextLines for MtfJson {
    const TITLE: &'static str =
        "MTF: tangential (lines across y) and sagittal, frequencies in cycles/mm";

    fn error_unit(_key: &str) -> &'static str {
        ""
    }

    fn lines(&self) -> Vec<String> {
        let mut lines = vec![match &self.gate {
            GateJson::Decided(gate) => gate_text(gate),
            GateJson::Refused { refused } => refused.clone(),
        }];
        for (name, curve) in [
            ("diffraction, primary wavelength", &self.diffraction),
            ("rays, primary wavelength", &self.geometric),
            ("diffraction, all wavelengths", &self.polychromatic_diffraction),
            ("rays, all wavelengths", &self.polychromatic_geometric),
        ] {
            match curve {
                CurveJson::Refused { refused } => lines.push(format!("{name}: {refused}")),
                CurveJson::Curve { milliseconds, curve } => {
                    let reached = not_reached_text(curve.limit);
                    let rays = counted(curve.rays, "ray");
                    lines.push(format!("{name}: {rays}, {milliseconds:.3} ms{reached}"));
                    lines.extend(sphere_text(curve.sphere));
                    lines.push(column_heads("cycles/mm"));
                    lines.extend(curve.points.iter().map(point_text));
                }
            }
        }
        lines
    }

    fn charts(&self) -> Vec<CurveChart> {
        let curves = |(color, name, curve): (usize, &str, &CurveJson)| match curve {
            CurveJson::Curve { curve, .. } => {
                let curves = contrast_curves(name, color, &curve.points);
                curves.into_iter().map(from_zero).collect()
            }
            CurveJson::Refused { .. } => Vec::new(),
        };
        let both = [
            (0, "diffraction", &self.polychromatic_diffraction),
            (1, "rays", &self.polychromatic_geometric),
        ];
        let limit = self.limit.as_ref().map(DiffractionLimit::curve);
        let curves = both.into_iter().flat_map(curves).chain(limit).collect();
        vec![CurveChart::new("all wavelengths", ["cycles/mm", "contrast"], curves)]
    }
}

/// A curve of contrast that begins at frequency 0, where it is 1, unless its first frequency is farther from there
/// than from the second one: a line over a wide gap would look like contrast.
fn from_zero(mut curve: ChartCurve) -> ChartCurve {
    let is_near = |piece: &&mut Vec<[f64; 2]>| match piece[..] {
        [[first, _], [second, _], ..] => first > 0.0 && first <= second - first,
        _ => false,
    };
    if let Some(first) = curve.pieces.first_mut().filter(is_near) {
        first.insert(0, [0.0, 1.0]);
    }
    curve
}

/// The tangential contrast, full, and the sagittal one, dashed.
fn contrast_curves(name: &str, color: usize, points: &[MtfPoint]) -> Vec<ChartCurve> {
    let curve = |section: &str, of: fn(&MtfPoint) -> f64| {
        let points = points.iter().map(|point| (point.frequency, Some(of(point))));
        ChartCurve::new(format!("{name}, {section}"), color, points)
    };
    vec![
        curve("tangential", |point| point.tangential.modulus.value),
        curve("sagittal", |point| point.sagittal.modulus.value).dashed(),
    ]
}

fn gate_text(gate: &DiffractionGate) -> String {
    let DiffractionGate { on, bound, change, tolerance } = gate;
    let state = if *on { "on" } else { "off" };
    let reason = change.map_or_else(
        || format!("at most {bound:.2e} by 1.27 nu lambda F"),
        |change| {
            format!("it changes contrast by up to {:.2e} ± {:.0e}", change.value, change.error)
        },
    );
    format!("diffraction {state}: {reason}; allowed {tolerance:.0e}")
}

/// The line about what the choice of the reference sphere leaves, if that is something.
fn sphere_text(left: f64) -> Option<String> {
    let text = "  of the errors, the choice of the reference sphere leaves up to";
    (left > 0.0).then(|| format!("{text} {left:.1e}, whatever the tolerance"))
}

/// The heads of the columns of a curve.
fn column_heads(first: &str) -> String {
    format!("  {first:>10}  {:>20}  {:>20}", "tangential", "sagittal")
}

fn point_text(point: &MtfPoint) -> String {
    let [t, s] = [point.tangential, point.sagittal].map(|value| {
        let modulus = value.modulus;
        format!("{:.6} ± {:.0e}", modulus.value, modulus.error)
    });
    format!("  {:>10}  {t:>20}  {s:>20}", ShortNumber(point.frequency))
}

/// The contrast of a field through focus.
#[derive(Serialize)]
pub(super) struct FocusContrastJson {
    frequency: f64,
    milliseconds: f64,
    /// The points; their frequency is the displacement of the image plane, in mm.
    positions: Vec<MtfPoint>,
}

/// The positions on each side of the image plane.
const POSITIONS: i32 = 8;

pub(super) fn through_focus(run: &AnalysisRun) -> Vec<AtField<FocusContrastJson>> {
    let frequency = run.frequencies[0];
    let f_number = run.model.first_order.working_f_number.unwrap_or(1.0).abs();
    // The contrast of a perfect lens falls to zero at about F/nu.
    let step = f_number / frequency / f64::from(POSITIONS);
    let shifts: Vec<f64> = (-POSITIONS..=POSITIONS).map(|i| f64::from(i) * step).collect();
    let at = |field: &SelectedField| {
        let (found, milliseconds) = time_ms(|| {
            let (model, primary) = (&run.model, run.model.primary);
            through_focus_mtf(model, field.traced, primary, frequency, &shifts, run.accuracy)
        });
        let keys = found.map(|positions| FocusContrastJson { frequency, milliseconds, positions });
        AtField::new(field, keys)
    };
    run.at_each_field(at)
}

impl TextLines for FocusContrastJson {
    const TITLE: &'static str = "MTF by diffraction at the primary wavelength against the shift of the \
         image plane, tangential and sagittal";

    fn error_unit(_key: &str) -> &'static str {
        ""
    }

    fn lines(&self) -> Vec<String> {
        let frequency = ShortNumber(self.frequency);
        let head = format!("at {frequency} cycles/mm, {:.3} ms", self.milliseconds);
        let heads = [head, column_heads("shift, mm")];
        heads.into_iter().chain(self.positions.iter().map(point_text)).collect()
    }

    fn charts(&self) -> Vec<CurveChart> {
        let title = format!("{} cycles/mm", ShortNumber(self.frequency));
        let curves = contrast_curves("diffraction", 0, &self.positions);
        vec![CurveChart::new(title, ["shift of the image plane, mm", "contrast"], curves)]
    }
}
