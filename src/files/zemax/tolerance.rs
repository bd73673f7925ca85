//! Tolerances as the operands of the tolerance editor: `TOL NAME i j min max`, with angles in degrees.
//!
//! No description of these records is published. That they hold the name of the operand, its two whole
//! numbers and its two bounds follows from the columns of the editor and from the records that other
//! programs write; the meaning of the operands is that of the manual. Every operand that has a
//! counterpart is symmetric here: half of its range is the larger one of its bounds.

use super::file::{ToleranceLine, ZemaxFile};
use super::row_plan::RowPlan;
use super::write::FileNumbers;
use crate::files::report::{ConversionOutcome, ConversionReport};
use crate::files::text::number;
use crate::lens::{
    AdjustedPart, Compensator, ErrorDistribution, Lens, Medium, Perturbation, PerturbationKind,
    Tolerance, ToleranceSheet, glass,
};

/// The wavelength of the test plates in mm where a file names none.
const TEST_WAVELENGTH: f64 = 632.8e-6;
/// The parameter of an even asphere that multiplies r⁴.
const FOURTH_POWER: usize = 2;

/// The operands that name a surface or an element and take the number of the error as it is.
const PLAIN: [(&str, PerturbationKind); 12] = [
    ("TCUR", PerturbationKind::Curvature),
    ("TCON", PerturbationKind::Conic),
    ("TIND", PerturbationKind::Index),
    ("TSDX", PerturbationKind::SurfaceDecenterX),
    ("TSDY", PerturbationKind::SurfaceDecenterY),
    ("TSTX", PerturbationKind::SurfaceTiltX),
    ("TSTY", PerturbationKind::SurfaceTiltY),
    ("TEDX", PerturbationKind::ElementDecenterX),
    ("TEDY", PerturbationKind::ElementDecenterY),
    ("TETX", PerturbationKind::ElementTiltX),
    ("TETY", PerturbationKind::ElementTiltY),
    ("TABB", PerturbationKind::Abbe),
];

/// The distributions of the operand `STAT`.
const DISTRIBUTIONS: [(ErrorDistribution, usize); 3] = [
    (ErrorDistribution::NormalCut, 0),
    (ErrorDistribution::Uniform, 1),
    (ErrorDistribution::Parabolic, 2),
];

/// A row of the report of an export.
pub(super) type Remark = (ConversionOutcome, String, &'static str);

/// The Abbe number of the gap behind a surface; `None` where the lens has none.
fn abbe_number(lens: &Lens, surface: usize) -> Option<f64> {
    let index = |um| Some(lens.resolve(0, um).ok()?.surfaces.get(surface)?.index);
    let [blue, yellow, red] = [glass::line::F, glass::line::D, glass::line::C].map(index);
    let abbe = (yellow? - 1.0) / (blue? - red?);
    abbe.is_finite().then_some(abbe)
}

/// The lines of the tolerances of a lens, and what is not the same there.
pub(super) fn operand_lines(lens: &Lens, numbers: &[FileNumbers]) -> (Vec<String>, Vec<Remark>) {
    let mut writer = ToleranceWriter { lens, numbers, lines: Vec::new(), remarks: Vec::new() };
    if let Some(sheet) = &lens.tolerances {
        writer.sheet(sheet);
    }
    (writer.lines, writer.remarks)
}

struct ToleranceWriter<'a> {
    lens: &'a Lens,
    numbers: &'a [FileNumbers],
    lines: Vec<String>,
    remarks: Vec<Remark>,
}

impl ToleranceWriter<'_> {
    fn line(&mut self, name: &str, [i, j]: [usize; 2], [min, max]: [f64; 2]) {
        let [min, max] = [min, max].map(number);
        self.lines.push(format!("TOL {name} {i:>3} {j:>3} {min} {max} 0 0 0 0 0"));
    }

    fn remark(&mut self, outcome: ConversionOutcome, what: impl Into<String>, note: &'static str) {
        self.remarks.push((outcome, what.into(), note));
    }

    fn sheet(&mut self, sheet: &ToleranceSheet) {
        if sheet.errors.iter().any(|own| own.error.kind == PerturbationKind::Irregularity) {
            self.line("TWAV", [0, 0], [1e3 * TEST_WAVELENGTH, 0.0]);
        }
        self.focus(sheet.focus_travel);
        sheet.compensators.iter().for_each(|own| self.compensator(own));
        let mut distribution = ErrorDistribution::NormalCut;
        for tolerance in &sheet.errors {
            let written = self.distribution(tolerance);
            if written != distribution {
                let code = DISTRIBUTIONS.iter().find(|(own, _)| *own == written);
                self.line("STAT", [code.map_or(0, |(_, code)| *code), 2], [0.0; 2]);
                distribution = written;
            }
            self.tolerance(tolerance);
        }
        if !sheet.correlations.is_empty() {
            let note = "errors are independent there";
            self.remark(ConversionOutcome::Dropped, "correlations of tolerances", note);
        }
        let what = format!("{} tolerances", sheet.errors.len());
        let note =
            "as operands of the tolerance editor, whose records have no published description";
        self.remark(ConversionOutcome::Used, what, note);
    }

    /// The distribution that is written for a tolerance, with a remark if it is another one.
    fn distribution(&mut self, tolerance: &Tolerance) -> ErrorDistribution {
        let (nearest, note) = match tolerance.distribution {
            ErrorDistribution::Normal => {
                (ErrorDistribution::NormalCut, "a normal distribution is cut at its bounds there")
            }
            ErrorDistribution::Ends => {
                (ErrorDistribution::Parabolic, "errors at their bounds are parabolic there")
            }
            own => return own,
        };
        let known = |(_, _, own): &Remark| *own == note;
        if !self.remarks.iter().any(known) {
            self.remark(ConversionOutcome::Approximated, "distribution of tolerances", note);
        }
        nearest
    }

    fn focus(&mut self, travel: Option<f64>) {
        let Some(last) = self.numbers.last() else { return };
        // Without a limit of its own the image plane may move as far as the lens is long.
        let reach = self.lens.surfaces.iter().map(|row| row.thickness.abs()).sum();
        let travel = travel.unwrap_or(reach);
        self.line("COMP", [last.gap, 0], [-travel, travel]);
    }

    fn compensator(&mut self, compensator: &Compensator) {
        match compensator.part {
            AdjustedPart::Lens(Perturbation {
                kind: PerturbationKind::Thickness, first, ..
            }) => {
                let travel = compensator.travel;
                self.line("COMP", [self.numbers[first].gap, 0], [-travel, travel]);
            }
            part => {
                let what = format!("compensator: {}", part.name());
                self.remark(ConversionOutcome::Dropped, what, "no operand adjusts this part");
            }
        }
    }

    fn tolerance(&mut self, tolerance: &Tolerance) {
        let Perturbation { kind, first, last } = tolerance.error;
        match self.operand(tolerance) {
            Ok((name, places, half)) => self.line(name, places, [-half, half]),
            Err(note) => {
                let [first, last] = [first + 1, last + 1];
                let what = format!("tolerance: {}, surfaces {first} to {last}", kind.name());
                self.remark(ConversionOutcome::Dropped, what, note);
            }
        }
    }

    /// The name of the operand of a tolerance, its whole numbers, and half of its range.
    fn operand(
        &self,
        tolerance: &Tolerance,
    ) -> Result<(&'static str, [usize; 2], f64), &'static str> {
        let Perturbation { kind, first, last } = tolerance.error;
        let [here, there] = [first, last].map(|surface| self.numbers[surface]);
        let half = tolerance.half_range;
        let half = if kind.is_angle() { half.to_degrees() } else { half };
        Ok(match kind {
            PerturbationKind::Thickness => ("TTHI", [here.gap, here.gap], half),
            PerturbationKind::ThicknessAdjusted => {
                let next = self.numbers.get(first + 1).ok_or("there is no gap behind")?;
                ("TTHI", [here.gap, next.gap], half)
            }
            PerturbationKind::Irregularity => {
                ("TIRR", [here.surface, 0], 2.0 * half / TEST_WAVELENGTH)
            }
            PerturbationKind::Asphere if self.lens.surfaces[first].asphere.is_empty() => {
                return Err("the surface has no aspheric terms there");
            }
            PerturbationKind::Asphere => ("TPAR", [here.surface, FOURTH_POWER], half),
            PerturbationKind::AsphereSlope => {
                return Err("no operand has the slope of a zone between centre and rim");
            }
            PerturbationKind::Abbe => {
                let abbe = abbe_number(self.lens, first).ok_or("the gap has no Abbe number")?;
                ("TABB", [here.surface, 0], half * abbe)
            }
            kind => {
                let plain = PLAIN.iter().find(|(_, own)| *own == kind);
                let (name, _) = plain.ok_or("no operand turns an element on its seat")?;
                let second = if kind.moves_a_body() { there.surface } else { 0 };
                (*name, [here.surface, second], half)
            }
        })
    }
}

/// The tolerances of a file; `None` for a file without any. Lines without a counterpart stay in the
/// report.
pub(super) fn sheet(
    file: &ZemaxFile,
    plan: &RowPlan,
    lens: &Lens,
    report: &mut ConversionReport,
) -> Option<ToleranceSheet> {
    let mut reader = ToleranceReader {
        file,
        plan,
        lens,
        sheet: ToleranceSheet::default(),
        distribution: ErrorDistribution::NormalCut,
        test_wavelength: TEST_WAVELENGTH,
    };
    for line in &file.tolerances {
        if let Some((outcome, note)) = reader.read(line) {
            report.amend(line.line, outcome, note);
        }
    }
    (!reader.sheet.errors.is_empty()).then_some(reader.sheet)
}

struct ToleranceReader<'a> {
    file: &'a ZemaxFile,
    plan: &'a RowPlan,
    lens: &'a Lens,
    sheet: ToleranceSheet,
    distribution: ErrorDistribution,
    test_wavelength: f64,
}

impl ToleranceReader<'_> {
    /// Enters a line into the sheet; `None` for one without a counterpart.
    fn read(&mut self, line: &ToleranceLine) -> Option<(ConversionOutcome, &'static str)> {
        match line.name.as_str() {
            "TWAV" if line.min > 0.0 => self.test_wavelength = 1e-3 * line.min,
            "STAT" => {
                let known = DISTRIBUTIONS.iter().find(|(_, code)| *code == line.places[0]);
                self.distribution = known?.0;
            }
            "COMP" => self.compensator(line)?,
            _ => return self.tolerance(line),
        }
        Some((ConversionOutcome::Used, ""))
    }

    fn compensator(&mut self, line: &ToleranceLine) -> Option<()> {
        let gap = self.plan.gap(line.places[0]).filter(|_| line.places[1] == 0)?;
        let travel = half_range(line) * self.file.unit;
        if gap + 1 == self.lens.surfaces.len() {
            self.sheet.focus_travel = (travel > 0.0).then_some(travel);
            return Some(());
        }
        let part = Perturbation::of_surface(PerturbationKind::Thickness, gap);
        let compensator = Compensator { part: AdjustedPart::Lens(part), travel };
        (travel > 0.0).then(|| self.sheet.set_compensator(compensator))
    }

    fn tolerance(&mut self, line: &ToleranceLine) -> Option<(ConversionOutcome, &'static str)> {
        let (error, half_range) = self.error(line)?;
        let distribution = self.distribution;
        let is_valid = half_range.is_finite() && half_range >= 0.0 && error.first <= error.last;
        let repeated = self.sheet.errors.iter().any(|own| own.error == error);
        if !is_valid || repeated {
            return None;
        }
        self.sheet.errors.push(Tolerance { error, half_range, distribution });
        Some(if line.min == -line.max {
            (ConversionOutcome::Used, "")
        } else {
            (ConversionOutcome::Approximated, "its bounds become those of the larger one")
        })
    }

    /// The error of a line and half of its range.
    fn error(&self, line: &ToleranceLine) -> Option<(Perturbation, f64)> {
        let [i, j] = line.places;
        let half = half_range(line);
        let unit = self.file.unit;
        let surface = || self.plan.row(i);
        let of_surface = |kind| Some(Perturbation::of_surface(kind, surface()?));
        let rim = || self.lens.surfaces[surface()?].semi_diameter.filter(|rim| *rim > 0.0);
        match line.name.as_str() {
            "TTHI" => {
                let gap = self.plan.gap(i)?;
                let adjusts = j != i && self.plan.gap(j)? == gap + 1;
                let kind = match (j == i, adjusts) {
                    (true, _) => PerturbationKind::Thickness,
                    (false, true) => PerturbationKind::ThicknessAdjusted,
                    (false, false) => return None,
                };
                Some((Perturbation::of_surface(kind, gap), half * unit))
            }
            "TRAD" => {
                let curvature = self.lens.surfaces[surface()?].curvature;
                Some((of_surface(PerturbationKind::Curvature)?, curvature.powi(2) * half * unit))
            }
            // A fringe is half a wavelength of sag at the rim.
            "TFRN" => {
                let change = half * self.test_wavelength / rim()?.powi(2);
                Some((of_surface(PerturbationKind::Curvature)?, change))
            }
            "TIRR" => {
                let amplitude = 0.5 * half * self.test_wavelength;
                Some((of_surface(PerturbationKind::Irregularity)?, amplitude))
            }
            "TPAR" if j == FOURTH_POWER => {
                let is_asphere = !self.lens.surfaces[surface()?].asphere.is_empty();
                let error = of_surface(PerturbationKind::Asphere).filter(|_| is_asphere)?;
                Some((error, half / unit.powi(3)))
            }
            name => self.plain_error(PLAIN.iter().find(|(own, _)| *own == name)?.1, line),
        }
    }

    fn plain_error(
        &self,
        kind: PerturbationKind,
        line: &ToleranceLine,
    ) -> Option<(Perturbation, f64)> {
        let (half, unit) = (half_range(line), self.file.unit);
        let first = self.plan.row(line.places[0])?;
        let last = if kind.moves_a_body() { self.plan.row(line.places[1])? } else { first };
        let has_medium = self.lens.surfaces[first].medium != Medium::Air;
        let half = match kind {
            PerturbationKind::Curvature => half / unit,
            PerturbationKind::Conic => half,
            PerturbationKind::Index if has_medium => half,
            PerturbationKind::Abbe if has_medium => half / abbe_number(self.lens, first)?,
            PerturbationKind::Index | PerturbationKind::Abbe => return None,
            kind if kind.is_angle() => half.to_radians(),
            _ => half * unit,
        };
        Some((Perturbation { kind, first, last }, half))
    }
}

/// Half of the range of an operand: the larger one of its bounds.
fn half_range(line: &ToleranceLine) -> f64 {
    line.min.abs().max(line.max.abs())
}
