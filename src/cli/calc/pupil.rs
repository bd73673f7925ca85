//! `calc pupil`: diffraction at a pupil that is given by its shape and its aberrations.

use super::check;
use crate::analysis::{AnalysisError, PupilCurve, PupilFunction, PupilSamples, RoundPupil};
use crate::cli::analyze::parse_point;
use crate::cli::error::CliError;
use crate::cli::output::{Output, ShortNumber};
use serde::Serialize;
use std::fmt::{self, Display};

/// Point spread, encircled energy and contrast of a pupil of a given shape and aberrations
#[derive(Debug, clap::Args)]
#[command(after_long_help = include_str!("../help/calc.txt"))]
pub(super) struct PupilArgs {
    /// The wavelength in um
    #[arg(long, value_name = "UM", default_value_t = 0.55)]
    um: f64,

    /// The f-number of a round pupil; its direction cosines reach 1/(2F)
    #[arg(long, value_name = "F", default_value_t = 2.0)]
    f_number: f64,

    /// A round shadow in its middle, as a share of its diameter
    #[arg(long, value_name = "SHARE", default_value_t = 0.0)]
    obscuration: f64,

    /// A disc instead, as direction cosines of its centre and radius `a,b,r`; repeated: amplitudes add
    #[arg(long = "disc", value_name = "A,B,R", value_parser = parse_disc, allow_hyphen_values = true)]
    discs: Vec<[f64; 3]>,

    /// The common part of two discs instead of their sum
    #[arg(long, requires = "discs")]
    common: bool,

    /// A regular polygon instead: sides, radius of its corners, azimuth of one from +a in degrees
    #[arg(long, value_name = "N,R,DEG", value_parser = parse_disc, conflicts_with = "discs")]
    polygon: Option<[f64; 3]>,

    /// An aberration of a round pupil in wavelengths, `W040=0.5`: W020, W040, W111, W131, W222
    #[arg(long, value_name = "NAME=W", value_parser = parse_term, allow_hyphen_values = true)]
    seidel: Vec<(String, f64)>,

    /// A Zernike coefficient of a round pupil in wavelengths by Noll's number, `11=0.07`, up to 45
    #[arg(long, value_name = "J=W", value_parser = parse_term, allow_hyphen_values = true)]
    noll: Vec<(String, f64)>,

    /// A point of the image, x and y in mm from its centre; may be repeated
    #[arg(long = "at", value_name = "X,Y", value_parser = parse_point, allow_hyphen_values = true)]
    points: Vec<[f64; 2]>,

    /// The radius of a circle of energy about the centre in mm; may be repeated
    #[arg(long = "radius", value_name = "MM")]
    radii: Vec<f64>,

    /// A spatial frequency along x and y in cycles/mm; may be repeated
    #[arg(long = "frequency", value_name = "NX,NY", value_parser = parse_point, allow_hyphen_values = true)]
    frequencies: Vec<[f64; 2]>,
}

fn parse_disc(text: &str) -> Result<[f64; 3], String> {
    let numbers: Option<Vec<f64>> = text.split(',').map(|part| part.trim().parse().ok()).collect();
    let numbers = numbers.and_then(|list| <[f64; 3]>::try_from(list).ok());
    let finite = numbers.filter(|list| list.iter().all(|v| v.is_finite()));
    finite.ok_or_else(|| "expected three numbers, as in `0.1,0,0.05`".to_owned())
}

fn parse_term(text: &str) -> Result<(String, f64), String> {
    let pair =
        text.split_once('=').and_then(|(name, w)| Some((name.trim(), w.trim().parse().ok()?)));
    let pair = pair.filter(|(_, w): &(&str, f64)| w.is_finite());
    let pair = pair.map(|(name, w)| (name.to_owned(), w));
    pair.ok_or_else(|| "expected a name and wavelengths, as in `W040=0.5`".to_owned())
}

/// The printed result.
#[derive(Serialize)]
struct PupilReport {
    /// The intensity at the centre.
    strehl: f64,
    points: Vec<PupilPoint>,
    circles: Vec<PupilCircle>,
    transfer: Vec<PupilTransfer>,
}

#[derive(Serialize)]
struct PupilPoint {
    x: f64,
    y: f64,
    intensity: f64,
    error: f64,
}

#[derive(Serialize)]
struct PupilCircle {
    radius: f64,
    energy: f64,
    error: f64,
}

#[derive(Serialize)]
struct PupilTransfer {
    nx: f64,
    ny: f64,
    re: f64,
    im: f64,
    error: f64,
}

/// The absolute error of contrast.
const TOLERANCE: f64 = 1e-11;
/// The orders of quadrature of intensities, whose difference is their error, and of circles.
const ORDERS: [usize; 2] = [7, 8];
const CIRCLE_ORDERS: [usize; 2] = [4, 5];
/// The widest circle about a pupil that is not round, in λF: the cost grows with its fourth power.
const WIDEST: f64 = 20.0;

impl PupilArgs {
    pub(super) fn run(&self, output: &Output) -> Result<(), CliError> {
        let is_positive = |v: f64| v > 0.0 && v.is_finite();
        let obscuration = (0.0..1.0).contains(&self.obscuration);
        check(&[
            ("--um", self.um, is_positive(self.um), "a positive wavelength"),
            ("--f-number", self.f_number, self.f_number >= 0.5, "0.5 or more"),
            ("--obscuration", self.obscuration, obscuration, "0 to less than 1"),
        ])?;
        if let Some(wrong) = self.radii.iter().find(|r| !is_positive(**r)) {
            return Err(CliError::Input(format!("--radius: found {wrong}; expected more than 0")));
        }
        let (pupil, round) = self.pupil()?;
        output.print(&self.report(&pupil, round.as_ref()))
    }

    /// The round pupil that the options describe.
    fn round(&self) -> Result<RoundPupil, CliError> {
        let mut round = RoundPupil::new(self.um, self.f_number, self.obscuration);
        for (name, waves) in &self.seidel {
            let known = RoundPupil::SEIDEL.join(", ");
            let text = || format!("--seidel: no `{name}`; expected one of {known}");
            round.add_seidel(name, *waves).ok_or_else(|| CliError::Input(text()))?;
        }
        for (name, waves) in &self.noll {
            let most = RoundPupil::NOLL;
            let text = || format!("--noll: found `{name}`; expected a number from 1 to {most}");
            let added = name.parse().ok().and_then(|number| round.add_noll(number, *waves));
            added.ok_or_else(|| CliError::Input(text()))?;
        }
        Ok(round)
    }

    /// The pupil, and the round one that it is with what it does to light, if it is.
    fn pupil(&self) -> Result<(PupilFunction, Option<RoundPupil>), CliError> {
        let round = self.round()?;
        let clear = self.seidel.is_empty() && self.noll.is_empty() && self.obscuration == 0.0;
        let pieces = self.pieces()?;
        if let Some(pieces) = pieces {
            if !clear {
                let text = "--seidel, --noll and --obscuration belong to a round pupil; expected them \
                            without --disc and --polygon";
                return Err(CliError::Input(text.to_owned()));
            }
            let pupil = PupilFunction::uniform(pieces, self.um, |_| 0.0).map_err(refuse)?;
            return Ok((pupil, None));
        }
        let pupil = round.function().map_err(refuse)?;
        Ok((pupil, round.has_round_aberrations().then_some(round)))
    }

    /// The curves of a pupil that is not round.
    fn pieces(&self) -> Result<Option<Vec<PupilCurve>>, CliError> {
        let positive = |radius: f64| radius > 0.0;
        if !self
            .discs
            .iter()
            .chain(&self.polygon)
            .all(|[_, _, r]| self.polygon.is_some() || positive(*r))
        {
            return Err(CliError::Input("--disc: expected a positive radius".to_owned()));
        }
        if let Some([sides, radius, degrees]) = self.polygon {
            if !((3.0..=100.0).contains(&sides) && sides.fract() == 0.0 && positive(radius)) {
                let text = "--polygon: expected 3 to 100 sides and a positive radius";
                return Err(CliError::Input(text.to_owned()));
            }
            let first = degrees.to_radians();
            return Ok(Some(vec![PupilCurve::regular_polygon(sides as usize, radius, first)]));
        }
        if self.common {
            let found = match self.discs[..] {
                [a, b] => PupilCurve::common_part_of_discs([a, b]),
                _ => None,
            };
            let text = "--common: expected two discs that overlap, none inside the other";
            let lens = found.ok_or_else(|| CliError::Input(text.to_owned()))?;
            return Ok(Some(vec![lens]));
        }
        let disc = |[a, b, r]: &[f64; 3]| PupilCurve::circle([*a, *b], *r);
        Ok((!self.discs.is_empty()).then(|| self.discs.iter().map(disc).collect()))
    }

    fn report(&self, pupil: &PupilFunction, round: Option<&RoundPupil>) -> PupilReport {
        let [few, many] = ORDERS.map(|order| pupil.samples(order));
        let point = |at: &[f64; 2]| {
            let [before, intensity] = [few.intensity(*at), many.intensity(*at)];
            PupilPoint { x: at[0], y: at[1], intensity, error: (intensity - before).abs() }
        };
        let transfer = |nu: &[f64; 2]| {
            let found = pupil.transfer(*nu, 0.0, TOLERANCE);
            let error = found.modulus.error;
            PupilTransfer { nx: nu[0], ny: nu[1], re: found.re, im: found.im, error }
        };
        let circles = match round {
            Some(round) => self.round_circles(round, pupil),
            None => self.circles(pupil),
        };
        PupilReport {
            strehl: many.intensity([0.0; 2]),
            points: self.points.iter().map(point).collect(),
            circles,
            transfer: self.frequencies.iter().map(transfer).collect(),
        }
    }

    /// The energy within circles about the centre of the image of a round pupil, by its contrast.
    fn round_circles(&self, round: &RoundPupil, pupil: &PupilFunction) -> Vec<PupilCircle> {
        let [few, many] = [false, true].map(|fine| round.encircled(pupil, &self.radii, fine));
        let energies = few.into_iter().zip(many).zip(&self.radii);
        let circle = |(([before, _], [energy, left]), radius): (([f64; 2], [f64; 2]), &f64)| {
            PupilCircle { radius: *radius, energy, error: (energy - before).abs() + left }
        };
        energies.map(circle).collect()
    }

    /// The energy within circles about the centre, over the image.
    fn circles(&self, pupil: &PupilFunction) -> Vec<PupilCircle> {
        self.radii.iter().map(|radius| self.circle(pupil, *radius)).collect()
    }

    fn circle(&self, pupil: &PupilFunction, radius: f64) -> PupilCircle {
        let widest = radius.min(WIDEST * 1e-3 * self.um * self.f_number);
        let share = |light: &PupilSamples| light.encircled([0.0; 2], &[widest])[0];
        let [few, many] = CIRCLE_ORDERS.map(|order| pupil.samples(order));
        let (before, energy) = (share(&few), share(&many));
        // Of a wider circle at least that much is inside, and at most all.
        let outside = if widest < radius { 1.0 - energy } else { 0.0 };
        PupilCircle { radius, energy, error: (energy - before).abs() + outside }
    }
}

fn refuse(error: AnalysisError) -> CliError {
    CliError::Input(format!("the pupil: {error}"))
}

impl Display for PupilReport {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        writeln!(f, "intensity at the centre: {}", ShortNumber(self.strehl))?;
        for PupilPoint { x, y, intensity, error } in &self.points {
            let [x, y] = [x, y].map(|v| ShortNumber(*v));
            writeln!(f, "at {x}, {y} mm: {intensity:.10} ± {error:.0e}")?;
        }
        for PupilCircle { radius, energy, error } in &self.circles {
            writeln!(f, "within {} mm: {energy:.10} ± {error:.0e}", ShortNumber(*radius))?;
        }
        for PupilTransfer { nx, ny, re, im, error } in &self.transfer {
            writeln!(f, "at {nx}, {ny} cycles/mm: {re:.10} {im:+.10} i ± {error:.0e}")?;
        }
        Ok(())
    }
}
