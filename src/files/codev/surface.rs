//! The commands of a surface: its form, aperture, place and label.

use super::command::{Command, parse_number};
use super::file::{
    CodeVDiffraction, CodeVGrating, CodeVProfile, CodeVSpecial, CodeVSurface, Placement,
    SpecialForm,
};
use super::parse::{CommandOutcome, dropped, preserved, used};
use crate::files::error::ParseError;
use crate::files::report::ConversionOutcome;
use crate::lens::FreeformKind;
use std::collections::BTreeMap;

/// The glass of `S bend thickness glass`; older files give an index and an Abbe number.
pub(super) fn glass_word(words: &[String]) -> Option<String> {
    let (name, behind) = (words.get(2)?, words.get(3));
    let both = behind.and_then(|vd| Some((parse_number(name)?, parse_number(vd)?)));
    Some(both.map_or_else(|| name.clone(), |(nd, vd)| format!("{nd}:{vd}")))
}

/// Reads one command of a surface.
pub(super) fn read(
    surface: &mut CodeVSurface,
    command: &Command,
) -> Result<CommandOutcome, ParseError> {
    match command.name.as_str() {
        "RDY" | "CUY" => return bend(surface, command),
        "THI" => {
            if let Some(thickness) = command.words.first().and_then(|word| parse_number(word)) {
                surface.thickness = thickness;
            } else {
                return Ok(frozen());
            }
        }
        "GLA" => surface.glass = command.words.first().cloned(),
        "RMD" | "REFL" => surface.glass = Some("REFL".to_owned()),
        "K" | "KY" => surface.conic = command.last_number()?,
        "KX" => surface.conic_across = command.last_number()?,
        "CUX" => surface.across = command.last_number()?,
        "RDX" => {
            let radius = command.last_number()?;
            surface.across = if radius == 0.0 { 0.0 } else { radius.recip() };
        }
        "CYL" | "YTO" => surface.profile = Some(CodeVProfile::Toroid),
        "AAS" => surface.profile = Some(CodeVProfile::Biconic),
        "A" | "B" | "C" | "D" | "E" | "F" | "G" | "H" | "J" => term(surface, command)?,
        "SLB" => surface.label = command.words.first().cloned().unwrap_or_default(),
        "CIR" => return circle(surface, command),
        "REX" | "REY" | "ELX" | "ELY" => return outline(surface, command),
        "ADX" | "ADY" => {
            surface.offset[usize::from(command.name == "ADY")] = command.last_number()?;
            surface.aperture_lines.push(command.line);
        }
        "ARO" if command.last_number()? != 0.0 => {
            surface.turn = command.last_number()? % 360.0;
            surface.aperture_lines.push(command.line);
        }
        "ARO" => return Ok(preserved()),
        "CCY" => surface.is_curvature_free = command.last_number()? == 0.0,
        "THC" => surface.is_thickness_free = command.last_number()? == 0.0,
        "SPH" | "CON" | "ASP" => {}
        "DIF" | "HOR" | "HWL" | "HCT" | "HCO" => return diffraction(surface, command),
        "GRO" | "GRS" | "GRX" | "GRY" | "GRZ" => return grating(surface, command),
        "SPS" | "SCO" => return special(surface, command),
        _ => return place(surface, command),
    }
    Ok(used())
}

fn frozen() -> CommandOutcome {
    (ConversionOutcome::Approximated, "the present value of the solve is used".to_owned())
}

/// `RDY` and `CUY` set the number that `S` sets; the mode of the file decides its meaning.
fn bend(surface: &mut CodeVSurface, command: &Command) -> Result<CommandOutcome, ParseError> {
    let Some(value) = command.words.first().and_then(|word| parse_number(word)) else {
        return Ok(frozen());
    };
    if surface.bend != 0.0 && (value - surface.bend).abs() > 1e-12 * value.abs() {
        return Err(command.malformed(format!("`{}`", command.text), "the number that S gives"));
    }
    surface.bend = value;
    Ok(used())
}

fn term(surface: &mut CodeVSurface, command: &Command) -> Result<(), ParseError> {
    const LETTERS: &str = "ABCDEFGHJ";
    if let Some(term) = LETTERS.find(command.name.as_str()) {
        surface.terms[term] = command.last_number()?;
    }
    Ok(())
}

/// `CIR [CLR|EDG|OBS|HOL] [label] radius`.
fn circle(surface: &mut CodeVSurface, command: &Command) -> Result<CommandOutcome, ParseError> {
    let radius = command.last_number()?;
    if radius < 0.0 {
        return Err(command.malformed(format!("`{}`", command.text), "a radius of zero or more"));
    }
    if command.has_word("EDG") {
        return Ok(preserved());
    }
    let inner = command.has_word("OBS") || command.has_word("HOL");
    let target = if inner { &mut surface.obstruction } else { &mut surface.clip };
    *target = Some(radius);
    Ok(used())
}

/// `REX`, `REY`, `ELX` and `ELY` with `[CLR|EDG|OBS|HOL] [label] half width`.
fn outline(surface: &mut CodeVSurface, command: &Command) -> Result<CommandOutcome, ParseError> {
    let half = command.last_number()?;
    if half <= 0.0 {
        return Ok(dropped("a half width that is not above 0"));
    }
    if command.has_word("EDG") {
        return Ok(preserved());
    }
    let inner = command.has_word("OBS") || command.has_word("HOL");
    let outline = if inner { &mut surface.block } else { &mut surface.outline };
    outline.is_ellipse = command.name.starts_with('E');
    outline.half[usize::from(command.name.ends_with('Y'))] = Some(half);
    surface.aperture_lines.push(command.line);
    Ok(used())
}

/// The commands of a diffractive phase: `DIF DOE`, `HOR order`, `HWL nm`, `HCT R`, `HCO Ck value`.
fn diffraction(
    surface: &mut CodeVSurface,
    command: &Command,
) -> Result<CommandOutcome, ParseError> {
    if command.name == "DIF" && command.has_word("DOE") {
        let (line, terms) = (command.line, Vec::new());
        let new = || CodeVDiffraction { line, order: 1.0, nm: 0.0, is_radial: false, terms };
        surface.diffraction.get_or_insert_with(new);
        return Ok(used());
    }
    if command.name == "DIF" && command.has_word("GRT") {
        let (line, normal) = (command.line, [0.0, 1.0, 0.0]);
        surface.grating = Some(CodeVGrating { line, order: 1.0, spacing: 0.0, normal });
        return Ok(used());
    }
    let Some(phase) = &mut surface.diffraction else { return Ok(other(surface, command)) };
    match command.name.as_str() {
        "HOR" => phase.order = command.last_number()?,
        "HWL" => phase.nm = command.last_number()?,
        "HCT" => phase.is_radial = command.has_word("R"),
        _ => {
            let digits = command.words.first().and_then(|word| word.strip_prefix(['C', 'c']));
            let most = FreeformKind::RadialPhase { radius: 1.0, order: 1.0 }.counts()[1];
            let number = digits.and_then(|digits| digits.parse::<usize>().ok());
            let Some(number) = number.filter(|number| (1..=most).contains(number)) else {
                let expected = format!("a coefficient C1 to C{most}");
                return Err(command.malformed(format!("`{}`", command.text), &expected));
            };
            phase.terms.resize(phase.terms.len().max(number), 0.0);
            phase.terms[number - 1] = command.last_number()?;
        }
    }
    Ok(used())
}

/// The commands of a grating: `GRO order`, `GRS spacing`, `GRX`, `GRY` and `GRZ`.
fn grating(surface: &mut CodeVSurface, command: &Command) -> Result<CommandOutcome, ParseError> {
    let Some(grating) = &mut surface.grating else { return Ok(other(surface, command)) };
    let value = command.last_number()?;
    match command.name.as_str() {
        "GRO" => grating.order = value,
        "GRS" => grating.spacing = value,
        name => {
            let axis = ["GRX", "GRY", "GRZ"].iter().position(|own| *own == name);
            grating.normal[axis.unwrap_or_default()] = value;
        }
    }
    Ok(used())
}

/// `SPS name radius` and `SCO name value`: a special form and its coefficients.
fn special(surface: &mut CodeVSurface, command: &Command) -> Result<CommandOutcome, ParseError> {
    let word = command.words.first().map(|word| word.to_ascii_uppercase()).unwrap_or_default();
    if command.name == "SPS" {
        let Some((_, form)) = SpecialForm::ALL.into_iter().find(|(name, _)| *name == word) else {
            return Ok(other(surface, command));
        };
        let radius = command.words.get(1).map_or(Ok(0.0), |_| command.number(1))?;
        let (line, terms) = (command.line, BTreeMap::new());
        surface.special = Some(CodeVSpecial { line, form, radius, terms });
        return Ok(used());
    }
    let Some(special) = &mut surface.special else { return Ok(other(surface, command)) };
    let value = command.number(1)?;
    if word == "NRADIUS" {
        special.radius = value;
        return Ok(used());
    }
    let digits = |prefix: &str| word.strip_prefix(prefix)?.parse::<usize>().ok();
    let odd = special.form == SpecialForm::OddAsphere;
    let power = digits("AR").filter(|_| odd).map(|power| power.saturating_add(1));
    match (word.as_str(), digits("C").or(power)) {
        ("K", _) => surface.conic = value,
        (_, Some(number)) if number == special.form.conic() => surface.conic = value,
        (_, Some(3)) if special.form == SpecialForm::FringeZernike => special.radius = value,
        (_, Some(number)) => {
            special.terms.insert(number, value);
        }
        (_, None) if value == 0.0 => {}
        (_, None) => {
            surface.locked.get_or_insert_with(|| command.text.clone());
            let note =
                "a coefficient of unknown meaning: the row is locked and rays meet its conic";
            return Ok((ConversionOutcome::Locked, note.to_owned()));
        }
    }
    Ok(used())
}

/// Decentres, tilts, and the rest.
fn place(surface: &mut CodeVSurface, command: &Command) -> Result<CommandOutcome, ParseError> {
    let numbers = ["XDE", "YDE", "ZDE", "ADE", "BDE", "CDE"];
    if let Some(i) = numbers.iter().position(|name| *name == command.name) {
        let all = if i < 3 { &mut surface.decenter } else { &mut surface.tilt };
        all[i % 3] = command.last_number()?;
        return Ok(used());
    }
    surface.placement = match command.name.as_str() {
        "DAR" => Placement::Return,
        "BEN" => Placement::Bend,
        "REV" => Placement::Reverse,
        "XOD" | "YOD" | "ZOD" if command.last_number()? == 0.0 => return Ok(preserved()),
        "RET" | "GLB" | "XOD" | "YOD" | "ZOD" => {
            return Ok(dropped("this place of the surface is not supported"));
        }
        _ => return Ok(other(surface, command)),
    };
    Ok(used())
}

/// The surface types that cannot be traced, and the commands that affect no ray.
fn other(surface: &mut CodeVSurface, command: &Command) -> CommandOutcome {
    const TYPES: [&str; 11] =
        ["DIF", "XTO", "SPS", "XYP", "ZRN", "GRT", "HOE", "DOE", "MOD", "SPL", "UDS"];
    const TERMS: [&str; 9] = ["CUF", "AR", "BR", "CR", "DR", "AP", "BP", "CP", "DP"];
    let nonzero = || command.last_number().is_ok_and(|value| value != 0.0);
    let term = TERMS.contains(&command.name.as_str()) && nonzero();
    if !(TYPES.contains(&command.name.as_str()) || term) {
        return preserved();
    }
    surface.locked.get_or_insert_with(|| command.text.clone());
    let note = format!(
        "{} cannot be traced: the row is locked and rays meet its asphere alone",
        command.text
    );
    (ConversionOutcome::Locked, note)
}
