//! The header: title, unit, aperture, fields, wavelengths, glass catalogues.

use super::{LineOutcome, dropped, preserved, used};
use crate::files::error::ParseError;
use crate::files::zemax::file::{ApertureLine, ToleranceLine, ZemaxFile};
use crate::files::zemax::line::ZemaxLine;

/// Reads a line of the header; `None` for other lines.
pub(super) fn read(
    file: &mut ZemaxFile,
    line: &ZemaxLine<'_>,
) -> Result<Option<LineOutcome>, ParseError> {
    let verdict = match line.keyword {
        "MODE" => mode(line)?,
        "UNIT" => unit(file, line)?,
        "NAME" => text(&mut file.name, line.rest),
        "NOTE" => note(file, line),
        "ENPD" | "FNUM" | "OBNA" | "FLOA" => aperture(file, line)?,
        "GCAT" => {
            file.catalogues = line.fields.iter().map(|&name| name.to_owned()).collect();
            used()
        }
        "ENVD" => environment(line)?,
        "FTYP" => field_type(file, line)?,
        "XFLN" | "YFLN" | "FWGN" | "XFLD" | "YFLD" | "FWGT" => field_values(file, line)?,
        "WAVM" | "WAVL" | "WAVN" | "WWGT" | "WWGN" => waves(file, line)?,
        "PWAV" => {
            file.waves.primary = Some((line.count(0)?, line.number));
            used()
        }
        "VDXN" | "VDYN" | "VCXN" | "VCYN" | "VANN" | "VDXF" | "VDYF" | "VCXF" | "VCYF" => {
            vignetting(file, line)
        }
        "VERS" | "GFAC" | "RAIM" | "PUSH" | "SDMA" | "ROPD" | "PICB" | "POLS" | "GLRS" | "GSTD"
        | "NSCD" | "COFN" | "PFIL" | "LANG" => preserved(),
        "TOL" => tolerance(file, line),
        _ => return Ok(None),
    };
    Ok(Some(verdict))
}

/// Keeps an operand of the tolerance editor; a line that is none does no harm.
fn tolerance(file: &mut ZemaxFile, line: &ZemaxLine<'_>) -> LineOutcome {
    let operand = || -> Result<ToleranceLine, ParseError> {
        Ok(ToleranceLine {
            name: line.word(0)?.to_owned(),
            places: [line.count(1)?, line.count(2)?],
            min: line.number(3)?,
            max: line.number(4)?,
            line: line.number,
        })
    };
    file.tolerances.extend(operand().ok());
    preserved()
}

fn text(to: &mut String, rest: &str) -> LineOutcome {
    rest.clone_into(to);
    used()
}

/// `NOTE 0 text`; the number is the kind of note.
fn note(file: &mut ZemaxFile, line: &ZemaxLine<'_>) -> LineOutcome {
    let (kind, text) = line.rest.split_once(char::is_whitespace).unwrap_or((line.rest, ""));
    let numbered = kind.parse::<u32>().is_ok();
    file.notes.push(if numbered { text.trim().to_owned() } else { line.rest.to_owned() });
    used()
}

fn mode(line: &ZemaxLine<'_>) -> Result<LineOutcome, ParseError> {
    if line.word(0)?.eq_ignore_ascii_case("SEQ") {
        return Ok(used());
    }
    let expected = "MODE SEQ: only sequential lenses can be traced here, in which light meets the \
                    surfaces in their order";
    Err(line.malformed(format!("`{}`", line.source_text()), expected))
}

fn unit(file: &mut ZemaxFile, line: &ZemaxLine<'_>) -> Result<LineOutcome, ParseError> {
    file.unit = match line.word(0)?.to_ascii_uppercase().as_str() {
        "MM" => 1.0,
        "CM" => 10.0,
        "IN" | "INCH" => 25.4,
        "FT" => 304.8,
        "M" | "METER" | "METERS" => 1000.0,
        other => return Err(line.malformed(format!("unit `{other}`"), "MM, CM, IN, FT or M")),
    };
    Ok(used())
}

fn aperture(file: &mut ZemaxFile, line: &ZemaxLine<'_>) -> Result<LineOutcome, ParseError> {
    if file.aperture.is_some() {
        return Ok(dropped("a second aperture; the first one is used"));
    }
    let kind = line.number_or(1, 0.0)?;
    let aperture = match line.keyword {
        "ENPD" => ApertureLine::Diameter(line.number(0)?),
        "FNUM" => ApertureLine::FNumber { value: line.number(0)?, working: kind == 1.0 },
        "OBNA" if kind == 1.0 => ApertureLine::ObjectConeDegrees(line.number(0)?),
        "OBNA" => ApertureLine::ObjectNa(line.number(0)?),
        _ => ApertureLine::FloatByStop,
    };
    file.aperture = Some((aperture, line.number));
    Ok(used())
}

/// Temperature in °C, pressure in atmospheres, and a flag for indices that are adjusted to them.
fn environment(line: &ZemaxLine<'_>) -> Result<LineOutcome, ParseError> {
    let standard = line.number_or(0, 20.0)? == 20.0 && line.number_or(1, 1.0)? == 1.0;
    let adjusted = line.number_or(2, 0.0)? != 0.0;
    Ok(if adjusted && !standard {
        super::approximated("indices are those at 20 °C and 1 atm")
    } else {
        preserved()
    })
}

fn field_type(file: &mut ZemaxFile, line: &ZemaxLine<'_>) -> Result<LineOutcome, ParseError> {
    let kind = line.count(0)?;
    if kind > 4 {
        return Err(line.malformed(format!("field type {kind}"), "0 to 4"));
    }
    file.fields.kind = Some((kind, line.number));
    // Older files have one or two words; a count of 0 means that it is not stated.
    file.fields.count = line.count_if_any(2).filter(|count| *count > 0);
    file.waves.count = line.count_if_any(3).filter(|count| *count > 0);
    Ok(match (kind, line.number_or(1, 0.0)? != 0.0) {
        (_, true) => dropped(
            "telecentric object space: chief rays pass through the centre of the stop in this program",
        ),
        (3, _) => super::approximated("real image heights are read as paraxial ones"),
        _ => used(),
    })
}

fn field_values(file: &mut ZemaxFile, line: &ZemaxLine<'_>) -> Result<LineOutcome, ParseError> {
    let fields = &mut file.fields;
    let values = line.numbers()?;
    match line.keyword {
        "XFLN" => fields.x = values,
        "YFLN" => fields.y = values,
        "FWGN" => fields.weights = values,
        "XFLD" => fields.x.extend(values),
        "YFLD" => fields.y.extend(values),
        _ => fields.weights.extend(values),
    }
    Ok(used())
}

fn waves(file: &mut ZemaxFile, line: &ZemaxLine<'_>) -> Result<LineOutcome, ParseError> {
    let waves = &mut file.waves;
    match line.keyword {
        "WAVM" => {
            let (um, weight) = (line.number(1)?, line.number_or(2, 1.0)?);
            waves.numbered.push((line.count(0)?, um, weight, line.number));
        }
        "WAVL" | "WAVN" => waves.list.extend(line.numbers()?),
        _ => waves.weights.extend(line.numbers()?),
    }
    Ok(used())
}

/// The lines of vignetting factors, one number for each field.
const VIGNETTING: [&str; 5] = ["VDXN", "VDYN", "VCXN", "VCYN", "VANN"];

fn vignetting(file: &mut ZemaxFile, line: &ZemaxLine<'_>) -> LineOutcome {
    let values = line.numbers().ok();
    if values.as_ref().is_some_and(|values| values.iter().all(|value| *value == 0.0)) {
        return preserved();
    }
    let known = VIGNETTING.iter().position(|keyword| *keyword == line.keyword);
    if let (Some(values), Some(kind)) = (values, known) {
        file.vignetting[kind] = values;
    }
    dropped(crate::files::vignetting::LEFT_OUT)
}
