//! The words of the panel.

use crate::lens::SurfaceNumber;
use crate::search::design::{
    DesignMerit, DesignStage, DesignedAsBuilt, FilledValue, LensJudgement, LensRequirements,
    LimitCost,
};
use crate::session::SpecifiedDesign;
use crate::studio::number::format_digits;
use crate::studio::panels::RMS_OVER_FIELDS;

/// The value taken for one that is not stated, in the unit of the form.
pub(super) fn filled_text(taken: Option<&FilledValue>, scale: f64, unit: &str) -> String {
    let Some(FilledValue { value, reason, .. }) = taken else { return "not stated".to_owned() };
    format!("{}{unit} ({reason})", scaled(value, scale))
}

/// A value in another unit: a number, or a list of them in brackets; anything else as it is.
fn scaled(value: &str, scale: f64) -> String {
    let numbers = value.trim_matches(['[', ']']).split(", ");
    let numbers: Result<Vec<f64>, _> = numbers.map(str::parse).collect();
    let Ok(numbers) = numbers else { return value.trim_matches('"').to_owned() };
    let texts: Vec<String> = numbers.iter().map(|v| format_digits(v * scale, 4)).collect();
    texts.join(", ")
}

/// The values taken for those that have no row of their own.
pub(super) fn other_filled(filled: &[FilledValue], rows: [&str; 7], counts: [&str; 2]) -> String {
    let has_row = |key: &str| rows.contains(&key) || counts.contains(&key);
    let others = filled.iter().filter(|value| !has_row(value.key));
    let texts: Vec<String> = others
        .map(|FilledValue { key, value, .. }| format!("{} {}", key_text(key), scaled(value, 1.0)))
        .collect();
    if texts.is_empty() { String::new() } else { format!("Also taken: {}", texts.join("; ")) }
}

/// A key of the specification in words, with its unit.
fn key_text(key: &str) -> String {
    let units = [("_deg", " in °"), ("_um", " in µm"), ("_mm2", " in mm²"), ("_mm", " in mm")];
    let unit = units.into_iter().find(|(ending, _)| key.ends_with(ending));
    let (ending, unit) = unit.unwrap_or_default();
    let name =
        key.strip_suffix(ending).unwrap_or(key).replace("min_", "least ").replace("max_", "most ");
    format!("{}{unit}:", name.replace('_', " "))
}

/// The specification in one line.
pub(super) fn summary_text(asked: &LensRequirements) -> String {
    let LensRequirements { focal_length, f_number, elements, .. } = asked;
    let [focal_length, f_number, half] =
        [*focal_length, *f_number, asked.half_field()].map(|value| format_digits(value, 4));
    let elements = if *elements == 1 { "1 element" } else { &format!("{elements} elements") };
    format!("{focal_length} mm, f/{f_number}, {half}° from the axis, at most {elements}")
}

/// The stage of a design.
pub(super) fn stage_text(design: &SpecifiedDesign) -> &'static str {
    if design.is_finishing {
        return "Rims, limits, focus, errors of making";
    }
    match design.stage {
        DesignStage::Starts => "Leading starts to the full aperture and field",
        DesignStage::Halving => "Improving the better half",
        DesignStage::Mutations => "Changing structures",
        DesignStage::Glasses => "Exchanging glasses",
    }
}

/// The progress and the findings of a design.
pub(super) fn progress_text(design: &SpecifiedDesign) -> String {
    let count = design.candidates;
    let lenses = if count == 1 { "lens" } else { "lenses" };
    format!(
        "{count} {lenses}, {} gradients, {} s",
        design.gradients,
        format_digits(design.seconds, 3)
    )
}

/// The best merit so far.
pub(super) fn best_text(design: &SpecifiedDesign) -> String {
    if design.best.is_finite() {
        format!("Best so far: {} µm", format_digits(1e3 * design.best, 3))
    } else {
        "No lens yet".to_owned()
    }
}

/// The quality in which a lens is best, as a heading.
pub(super) const fn merit_title(merit: DesignMerit) -> &'static str {
    match merit {
        DesignMerit::Best => "Best",
        DesignMerit::Simplest => "Simplest",
        DesignMerit::Brightest => "Brightest",
        DesignMerit::Robust => "Most robust",
    }
}

/// The numbers of a judged lens, each with its name.
pub(super) fn facts(judgement: &LensJudgement, length: f64) -> Vec<(&'static str, String)> {
    let areas: Vec<f64> = judgement.fields.iter().map(|field| field.clear_area).collect();
    let ends = [areas.first(), areas.last()].map(|a| a.map_or(f64::NAN, |a| *a));
    let light = ends.map(|area| format_digits(area, 4));
    let aspheres = match judgement.aspheric_surfaces {
        0 => String::new(),
        1 => ", 1 asphere".to_owned(),
        count => format!(", {count} aspheres"),
    };
    vec![
        (RMS_OVER_FIELDS, format!("{} µm", format_digits(1e3 * judgement.rms, 4))),
        ("Light", format!("{} to {} mm²", light[0], light[1])),
        ("Elements", format!("{}{aspheres}", judgement.elements)),
        ("Length", format!("{} mm", format_digits(length, 4))),
    ]
}

/// The spots of a lens as it is made, each with its name.
pub(super) fn as_built_facts(made: &DesignedAsBuilt) -> [(&'static str, String); 2] {
    let micrometres = |rms: f64| format!("{} µm", format_digits(1e3 * rms, 4));
    [
        ("As built, mean", micrometres(made.mean)),
        ("As built, 90 % within", micrometres(made.within_90_percent)),
    ]
}

/// The cost of a limit.
pub(super) fn cost_text(cost: &LimitCost) -> String {
    let name = cost.term.replace('_', " ");
    let place = cost
        .surface
        .map_or(String::new(), |row| format!(" of surface {}", SurfaceNumber::new(row)));
    let of = |um: Option<f64>, unit| um.map(|um| format!("{} µm per {unit}", format_digits(um, 3)));
    let price = of(cost.um_per_mm, "mm").or_else(|| of(cost.um_per_percent, "percent"));
    let price = price.or_else(|| of(cost.um_per_element, "element fewer"));
    format!("{name}{place}: {}", price.unwrap_or_default())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn keys_are_words_with_their_units() {
        for (key, words) in [
            ("fields_deg", "fields in °:"),
            ("min_clear_area_mm2", "least clear area in mm²:"),
            ("min_edge_mm", "least edge in mm:"),
            ("wavelength_weights", "wavelength weights:"),
        ] {
            assert_eq!(key_text(key), words);
        }
    }

    #[test]
    fn a_value_that_is_taken_is_shown_in_the_unit_of_its_row() {
        let key = "max_abs_distortion";
        let taken = FilledValue { key, value: "0.02".to_owned(), reason: "hardly visible" };
        assert_eq!(filled_text(Some(&taken), 100.0, " %"), "2 % (hardly visible)");
        let list = FilledValue { value: "[1.0, 0.5]".to_owned(), ..taken.clone() };
        assert_eq!(filled_text(Some(&list), 100.0, " %"), "100, 50 % (hardly visible)");
        let words = FilledValue { value: "\"infinity\"".to_owned(), ..taken };
        assert_eq!(filled_text(Some(&words), 1.0, ""), "infinity (hardly visible)");
    }
}
