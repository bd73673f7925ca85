//! The lines of a surface.

use super::{LineOutcome, approximated, dropped, preserved, used};
use crate::files::error::ParseError;
use crate::files::outline::OutlineForm;
use crate::files::zemax::file::{
    CurvatureSolve, GlassLine, OutlineLine, PickupLine, SemiDiameterLine, ZemaxFile, ZemaxSurface,
};
use crate::files::zemax::line::ZemaxLine;
use crate::lens::MAX_ARMS;

/// The keywords that are valid only in a surface.
pub(super) const KEYWORDS: &[&str] = &[
    "STOP", "TYPE", "CURV", "DISZ", "CONI", "PARM", "XDAT", "GLAS", "DIAM", "CLAP", "FLAP", "OBSC",
];

/// `SURF k`: surfaces come in order, from 0.
pub(super) fn begin(file: &mut ZemaxFile, line: &ZemaxLine<'_>) -> Result<LineOutcome, ParseError> {
    let expected = file.surfaces.len();
    if line.count(0)? != expected {
        return Err(
            line.malformed(format!("`{}`", line.source_text()), &format!("SURF {expected}"))
        );
    }
    file.surfaces.push(ZemaxSurface { line: line.number, ..ZemaxSurface::default() });
    Ok(used())
}

/// Reads one line of a surface.
pub(super) fn read(
    surface: &mut ZemaxSurface,
    line: &ZemaxLine<'_>,
) -> Result<LineOutcome, ParseError> {
    match line.keyword {
        "STOP" => surface.stop = Some(line.number),
        "TYPE" => surface.kind = (line.word(0)?.to_ascii_uppercase(), line.number),
        "COMM" => line.rest.clone_into(&mut surface.comment),
        "CURV" => return curvature(surface, line),
        "CONI" => surface.conic = line.number(0)?,
        "PARM" => surface.parameters.push((line.count(0)?, line.number(1)?, line.number)),
        "XDAT" => surface.extra.push((line.count(0)?, line.number(1)?, line.number)),
        "DISZ" => surface.thickness = Some((thickness(line)?, line.number)),
        "GLAS" => surface.glass = Some(glass(line)?),
        "DIAM" => surface.semi_diameter = Some(semi_diameter(line)?),
        "CLAP" | "FLAP" => clip(surface, line)?,
        "OBSC" => return obscuration(surface, line),
        "SQAP" | "ELAP" | "SQOB" | "ELOB" => return Ok(outline(surface, line)),
        "VCON" => surface.variable_conic = Some(line.number),
        "VPAR" => surface.variable_parameters.push((line.count(0)?, line.number)),
        "VDSZ" => {
            let (low, high) = (line.number_or(0, 0.0)?, line.number_or(1, 0.0)?);
            surface.variable_thickness = Some((low, high, line.number));
        }
        "MAZH" => {
            let (height, zone) = (line.number_or(0, 0.0)?, line.number_or(1, 0.0)?);
            surface.marginal_height = Some((height, zone, line.number));
        }
        "PZUP" => return thickness_pickup(surface, line),
        "OBDC" => {
            let (x, y) = (line.number(0)?, line.number(1)?);
            surface.aperture_offset = (x != 0.0 || y != 0.0).then_some((x, y, line.number));
        }
        "SPID" => return Ok(spider(surface, line)),
        "UDAD" | "UDOB" => surface.other_apertures.push(line.number),
        "SCBD" => return own_break(surface, line),
        _ => return Ok(read_other(line)),
    }
    Ok(used())
}

/// The outcome of the other lines of a surface: those that affect rays are dropped or approximated.
fn read_other(line: &ZemaxLine<'_>) -> LineOutcome {
    match line.keyword {
        "PPAR" | "CHZH" | "TOLE" | "TCOM" | "EDGE" | "PMVA" | "PUPZ" | "CENT" => {
            approximated("the present value of the solve is used")
        }
        _ => preserved(),
    }
}

/// `SCBD side order 0 dx dy tilts`: the break that belongs to a surface, on the side 1 in front of it.
fn own_break(surface: &mut ZemaxSurface, line: &ZemaxLine<'_>) -> Result<LineOutcome, ParseError> {
    let number = |field| line.number_or(field, 0.0);
    let moves = [number(3)?, number(4)?, number(5)?, number(6)?, number(7)?];
    if moves == [0.0; 5] {
        return Ok(preserved());
    }
    if number(0)? != 1.0 {
        return Ok(dropped("a tilt or decentre behind the surface"));
    }
    let [dx, dy, x, y, z] = moves;
    surface.own_break = Some([dx, dy, x, y, z, number(1)?]);
    Ok(used())
}

/// The names of the solve codes, from 2 on.
const SOLVES: [&str; 11] = [
    "marginal ray angle",
    "chief ray angle",
    "pickup",
    "marginal ray normal",
    "chief ray normal",
    "aplanatic",
    "element power",
    "concentric with a surface",
    "concentric with a radius",
    "f-number",
    "macro",
];

fn curvature(surface: &mut ZemaxSurface, line: &ZemaxLine<'_>) -> Result<LineOutcome, ParseError> {
    surface.curvature = Some((line.number(0)?, line.number));
    surface.curvature_solve = CurvatureSolve::Fixed;
    match line.count_if_any(1).unwrap_or(0) {
        0 => {}
        1 => surface.curvature_solve = CurvatureSolve::Variable,
        4 => {
            surface.curvature_solve = CurvatureSolve::Pickup(PickupLine {
                surface: line.count(2)?,
                scale: line.number_or(3, 1.0)?,
                offset: line.number_or(4, 0.0)?,
                line: line.number,
            });
        }
        code => {
            let solve = SOLVES.get(code - 2).copied().unwrap_or("unknown");
            return Ok(approximated(format!("the {solve} solve is replaced by its present value")));
        }
    }
    Ok(used())
}

fn thickness(line: &ZemaxLine<'_>) -> Result<f64, ParseError> {
    let word = line.word(0)?;
    let infinite = ["INFINITY", "INF"].iter().any(|name| word.eq_ignore_ascii_case(name));
    if infinite { Ok(f64::INFINITY) } else { line.number(0) }
}

/// `GLAS name code pickup nd vd dPgF v_nd v_vd v_dPgF p1 p2`.
fn glass(line: &ZemaxLine<'_>) -> Result<GlassLine, ParseError> {
    let number = |field| line.number_or(field, 0.0);
    Ok(GlassLine {
        name: line.word(0)?.to_owned(),
        code: line.count_if_any(1).unwrap_or(0),
        source: line.count_if_any(2),
        nd: number(3)?,
        vd: number(4)?,
        partial: number(5)?,
        variable_index: number(6)? == 1.0,
        offsets: (number(9)?, number(10)?),
        line: line.number,
    })
}

fn semi_diameter(line: &ZemaxLine<'_>) -> Result<SemiDiameterLine, ParseError> {
    let value = line.number(0)?;
    if value < 0.0 {
        return Err(line.malformed(format!("a semi-diameter of {value}"), "zero or more"));
    }
    Ok(SemiDiameterLine { value, fixed: line.number_or(1, 0.0)? == 1.0, line: line.number })
}

/// `CLAP rmin rmax`, `FLAP rmin rmax`: clips inside the first and outside the second radius.
fn clip(surface: &mut ZemaxSurface, line: &ZemaxLine<'_>) -> Result<(), ParseError> {
    let (inner, outer) = radii(line)?;
    if surface.clip.is_none_or(|(other, _)| outer < other) {
        surface.clip = Some((outer, line.number));
    }
    obstruct(surface, inner, line);
    Ok(())
}

/// `OBSC rmin rmax`: clips between the radii.
fn obscuration(
    surface: &mut ZemaxSurface,
    line: &ZemaxLine<'_>,
) -> Result<LineOutcome, ParseError> {
    let (inner, outer) = radii(line)?;
    if inner > 0.0 {
        // A ring that transmits light inside.
        surface.other_apertures.push(line.number);
        return Ok(used());
    }
    obstruct(surface, outer, line);
    Ok(used())
}

/// `SQAP`, `ELAP`, `SQOB`, `ELOB`: the half widths along x and y of an aperture or an obscuration.
fn outline(surface: &mut ZemaxSurface, line: &ZemaxLine<'_>) -> LineOutcome {
    let half = [line.number(0), line.number(1)].map(|half| half.unwrap_or(0.0));
    if !half.iter().all(|half| *half > 0.0) {
        return dropped("its half widths are not above 0");
    }
    let is_ellipse = line.keyword.starts_with("EL");
    let form = if is_ellipse { OutlineForm::Ellipse } else { OutlineForm::Rectangle };
    let found = Some(OutlineLine { form, half, line: line.number });
    if line.keyword.ends_with("AP") {
        surface.outline = found;
    } else {
        surface.block = found;
    }
    used()
}

/// `SPID width arms`: straight arms from the centre, the first along x.
fn spider(surface: &mut ZemaxSurface, line: &ZemaxLine<'_>) -> LineOutcome {
    let (width, arms) = (line.number(0).unwrap_or(0.0), line.count(1).unwrap_or(0));
    if !(width > 0.0 && (1..=MAX_ARMS).contains(&arms)) {
        return dropped("its arms have no width, or their number is not 1 to 32");
    }
    surface.spider = Some((arms, width, line.number));
    used()
}

/// The two radii of a circular aperture.
fn radii(line: &ZemaxLine<'_>) -> Result<(f64, f64), ParseError> {
    let (inner, outer) = (line.number(0)?, line.number(1)?);
    if inner >= 0.0 && (outer > inner || (inner, outer) == (0.0, 0.0)) {
        return Ok((inner, outer));
    }
    let found = format!("an aperture from {inner} to {outer}");
    Err(line.malformed(found, "radii of zero or more, the inner one smaller"))
}

/// Widens the central obstruction to this radius.
fn obstruct(surface: &mut ZemaxSurface, radius: f64, line: &ZemaxLine<'_>) {
    if radius > surface.obstruction.map_or(0.0, |(other, _)| other) {
        surface.obstruction = Some((radius, line.number));
    }
}

/// `PZUP surface scale offset column`.
fn thickness_pickup(
    surface: &mut ZemaxSurface,
    line: &ZemaxLine<'_>,
) -> Result<LineOutcome, ParseError> {
    if line.number_or(3, 0.0)? != 0.0 {
        return Ok(approximated("a pickup from another column is replaced by its present value"));
    }
    surface.thickness_pickup = Some(PickupLine {
        surface: line.count(0)?,
        scale: line.number_or(1, 1.0)?,
        offset: line.number_or(2, 0.0)?,
        line: line.number,
    });
    Ok(used())
}
