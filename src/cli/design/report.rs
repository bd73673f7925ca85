//! The report of `design`: the complete specification, and lenses beside it.

use crate::cli::output::{ShortNumber, TextTable, write_saved};
use crate::lens::{SurfaceNumber, ToleranceGrade};
use crate::search::design::{
    DesignedAsBuilt, DesignedLens, FilledValue, LensJudgement, LensRequirements, LimitCost,
};
use serde::Serialize;
use std::fmt::{self, Display};

/// A complete specification, with the judgement of a lens.
#[derive(Serialize)]
pub(super) struct JudgementReport {
    pub(super) requirements: LensRequirements,
    /// The values that the specification does not state.
    pub(super) filled: Vec<FilledValue>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(super) judgement: Option<LensJudgement>,
}

impl Display for JudgementReport {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write_filled(f, &self.requirements, &self.filled)?;
        self.judgement.as_ref().map_or(Ok(()), |judgement| write_judgement(f, judgement))
    }
}

/// Writes what is asked for in one line, and what was filled.
pub(super) fn write_filled(
    f: &mut fmt::Formatter<'_>,
    asked: &LensRequirements,
    filled: &[FilledValue],
) -> fmt::Result {
    let LensRequirements { focal_length, f_number, elements, .. } = asked;
    let (f_number, half) = (ShortNumber(*f_number), ShortNumber(asked.half_field()));
    writeln!(f, "{focal_length} mm, f/{f_number}, {half} deg, at most {elements} elements")?;
    for FilledValue { key, value, reason } in filled {
        writeln!(f, "not stated: {key}, taken as {value} ({reason})")?;
    }
    Ok(())
}

/// Writes a judgement: fields, limits that are broken or nearest to it.
pub(super) fn write_judgement(f: &mut fmt::Formatter<'_>, found: &LensJudgement) -> fmt::Result {
    let LensJudgement { focal_length, elements, aspheric_surfaces, refocus, .. } = found;
    writeln!(
        f,
        "\nRMS spot radius {:.3} um over the fields; {} mm, {elements} elements, \
         {aspheric_surfaces} aspheric surfaces; image plane moved by {} mm",
        1e3 * found.rms,
        ShortNumber(*focal_length),
        ShortNumber(*refocus)
    )?;
    if let Some(magnification) = found.magnification {
        writeln!(f, "magnification {magnification:.5}")?;
    }
    if let Some(contrast) = found.contrast {
        writeln!(f, "mean contrast {contrast:.4} at the frequency that is wished")?;
    }
    let mut heads = vec!["field deg", "rms um", "clear area mm^2", "illumination", "distortion"];
    heads.extend(found.contrast.map(|_| "contrast"));
    let mut table = TextTable::new(&heads);
    for field in &found.fields {
        let cells = [
            ShortNumber(field.degrees).to_string(),
            format!("{:.3}", 1e3 * field.rms),
            format!("{:.2}", field.clear_area),
            format!("{:.4}", field.relative_illumination),
            format!("{:.5}", field.distortion),
        ];
        let contrast = field.contrast.map(|contrast| format!("{contrast:.4}"));
        table.row(cells.into_iter().chain(contrast));
    }
    write!(f, "{table}")?;
    match found.failures()[..] {
        [] => writeln!(f, "all {} limits are kept", found.limits.len()),
        ref failures => failures.iter().try_for_each(|text| writeln!(f, "broken: {text}")),
    }
}

/// The result of a design.
#[derive(Serialize)]
pub(super) struct DesignReport {
    pub(super) requirements: LensRequirements,
    pub(super) filled: Vec<FilledValue>,
    pub(super) gradients: u64,
    pub(super) lenses: Vec<DesignedLens>,
    /// The file of each lens; `None` for one that could not be saved.
    pub(super) out: Vec<Option<String>>,
}

impl Display for DesignReport {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write_filled(f, &self.requirements, &self.filled)?;
        writeln!(f, "{} gradients", self.gradients)?;
        for (lens, out) in self.lenses.iter().zip(&self.out) {
            let file = out.as_deref().unwrap_or("not saved");
            writeln!(f, "\n{}: {file} (from {})", lens.merit.name(), lens.origin)?;
            write_judgement(f, &lens.judgement)?;
            write_as_built(f, lens.as_built)?;
            write_costs(f, &lens.costs)?;
            write_saved(f, None, out.is_none().then_some(&lens.lens))?;
        }
        Ok(())
    }
}

/// Writes what the limits cost.
fn write_costs(f: &mut fmt::Formatter<'_>, costs: &[LimitCost]) -> fmt::Result {
    for LimitCost { term, surface, um_per_mm, um_per_percent, um_per_element } in costs {
        let place =
            surface.map_or(String::new(), |row| format!(" of surface {}", SurfaceNumber::new(row)));
        let of = |um: Option<f64>, unit| um.map(|um| format!("{} um per {unit}", ShortNumber(um)));
        let price = of(*um_per_mm, "mm").or_else(|| of(*um_per_percent, "percent of it"));
        let price = price.or_else(|| of(*um_per_element, "element fewer"));
        writeln!(f, "{term}{place} costs {}", price.unwrap_or_default())?;
    }
    Ok(())
}

/// Writes the spots of lenses that are made.
fn write_as_built(f: &mut fmt::Formatter<'_>, made: Option<DesignedAsBuilt>) -> fmt::Result {
    let Some(DesignedAsBuilt { grade, nominal, mean, within_90_percent }) = made else {
        return Ok(());
    };
    let [nominal, mean, most] = [nominal, mean, within_90_percent].map(|rms| 1e3 * rms);
    let named = ToleranceGrade::ALL.iter().find(|(other, _)| *other == grade);
    let grade = named.map_or(String::new(), |(_, name)| name.to_lowercase());
    writeln!(
        f,
        "as built with {grade} tolerances, refocused: mean {mean:.3} um, 90 % of the lenses at most \
         {most:.3} um; as designed {nominal:.3} um"
    )
}
