//! `calc pupil`: diffraction at a pupil that is given by its shape and its aberrations.

use super::check;
use crate::analysis::{
    AnalysisError, PupilCurve, PupilFunction, PupilSamples, ZernikeIndex, ZernikeOrder,
};
use crate::cli::analyze::parse_point;
use crate::cli::error::CliError;
use crate::cli::output::{Output, ShortNumber};
use serde::Serialize;
use std::f64::consts::TAU;
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

/// The aberrations of a round pupil.
struct Aberrations {
    seidel: [f64; 5],
    noll: Vec<(ZernikeIndex, f64)>,
}

const SEIDEL: [&str; 5] = ["W020", "W040", "W111", "W131", "W222"];
/// The number of Zernike polynomials.
const NOLL: usize = 45;

impl Aberrations {
    fn new(args: &PupilArgs) -> Result<Self, CliError> {
        let mut seidel = [0.0; 5];
        for (name, waves) in &args.seidel {
            let Some(i) = SEIDEL.iter().position(|known| known == name) else {
                let text = format!("--seidel: no `{name}`; expected one of {}", SEIDEL.join(", "));
                return Err(CliError::Input(text));
            };
            seidel[i] += waves;
        }
        let indices = ZernikeOrder::Noll.indices(NOLL);
        let term = |(name, waves): &(String, f64)| {
            let number = name.parse::<usize>().ok().filter(|j| (1..=NOLL).contains(j));
            let text = || format!("--noll: found `{name}`; expected a number from 1 to {NOLL}");
            number.map(|j| (indices[j - 1], *waves)).ok_or_else(|| CliError::Input(text()))
        };
        let noll: Result<Vec<_>, CliError> = args.noll.iter().map(term).collect();
        Ok(Self { seidel, noll: noll? })
    }

    /// The path difference at a point of the unit disc, in wavelengths.
    fn waves(&self, [x, y]: [f64; 2]) -> f64 {
        let square = x * x + y * y;
        let forms = [square, square * square, y, square * y, y * y];
        let seidel: f64 = self.seidel.iter().zip(forms).map(|(w, form)| w * form).sum();
        seidel + self.noll.iter().map(|(z, w)| w * z.value([x, y])).sum::<f64>()
    }

    fn is_round(&self) -> bool {
        let seidel = self.seidel[2..].iter().all(|w| *w == 0.0);
        seidel && self.noll.iter().all(|(z, _)| z.frequency == 0)
    }
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
        let (pupil, is_round) = self.pupil()?;
        output.print(&self.report(&pupil, is_round))
    }

    /// The pupil, and whether it is round with what it does to light.
    fn pupil(&self) -> Result<(PupilFunction, bool), CliError> {
        let aberrations = Aberrations::new(self)?;
        let clear = self.seidel.is_empty() && self.noll.is_empty() && self.obscuration == 0.0;
        let pieces = self.pieces()?;
        if let Some(pieces) = pieces {
            if !clear {
                let text = "--seidel, --noll and --obscuration belong to a round pupil; expected them \
                            without --disc and --polygon";
                return Err(CliError::Input(text.to_owned()));
            }
            let pupil = PupilFunction::uniform(pieces, self.um, |_| 0.0).map_err(refuse)?;
            return Ok((pupil, false));
        }
        let radius = 0.5 / self.f_number;
        // The image is real: a ray through +y goes down.
        let waves = |c: [f64; 2]| aberrations.waves(c.map(|v| -v / radius));
        let circle = |share: f64| PupilCurve::circle([0.0; 2], share * radius);
        let pupil = if self.obscuration > 0.0 {
            PupilFunction::ring(&[circle(1.0), circle(self.obscuration)], self.um, waves)
        } else {
            PupilFunction::uniform(vec![circle(1.0)], self.um, waves)
        };
        Ok((pupil.map_err(refuse)?, aberrations.is_round()))
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
            let corner = |i: usize| {
                let (sin, cos) = (degrees.to_radians() + TAU * i as f64 / sides).sin_cos();
                [radius * cos, radius * sin]
            };
            let corners: Vec<_> = (0..sides as usize).map(corner).collect();
            return Ok(Some(vec![PupilCurve::polygon(&corners)]));
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

    fn report(&self, pupil: &PupilFunction, is_round: bool) -> PupilReport {
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
        let circles = if is_round { self.round_circles(pupil) } else { self.circles(pupil) };
        PupilReport {
            strehl: many.intensity([0.0; 2]),
            points: self.points.iter().map(point).collect(),
            circles,
            transfer: self.frequencies.iter().map(transfer).collect(),
        }
    }

    /// The energy within circles about the centre of the image of a round pupil, by its contrast.
    fn round_circles(&self, pupil: &PupilFunction) -> Vec<PupilCircle> {
        let cutoff = 1e3 / (self.um * self.f_number);
        let [few, many] = [false, true]
            .map(|fine| pupil.round_encircled(&self.radii, cutoff, self.obscuration, fine));
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
