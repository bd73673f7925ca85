//! `calc coating`: the share of light that a surface reflects.

use crate::analysis::{Coating, ThinFilm, film_reflectance};
use crate::cli::analyze::parse_coating;
use crate::cli::error::CliError;
use crate::cli::output::Output;
use serde::Serialize;
use std::fmt::{self, Display};

/// Share of light that a surface between two media reflects, bare or coated
#[derive(Debug, clap::Args)]
#[command(after_long_help = include_str!("../help/calc.txt"))]
pub(super) struct CoatingArgs {
    /// The index in front
    #[arg(long, value_name = "INDEX", default_value_t = 1.0)]
    from: f64,

    /// The index behind
    #[arg(long, value_name = "INDEX")]
    to: f64,

    /// A film as index and thickness in nm, `1.38:99.64`; repeated from the incident side
    #[arg(long = "film", value_name = "INDEX:NM", value_parser = parse_film)]
    films: Vec<ThinFilm>,

    /// A coating by name instead: none, single-layer, v, or a share as `0.3%`
    #[arg(long, value_name = "COATING", value_parser = parse_coating, conflicts_with = "films")]
    coating: Option<Coating>,

    /// The wavelength in um
    #[arg(long, value_name = "UM", default_value_t = 0.55)]
    um: f64,

    /// The angle of incidence in degrees
    #[arg(long, value_name = "DEG", default_value_t = 0.0)]
    angle: f64,
}

fn parse_film(text: &str) -> Result<ThinFilm, String> {
    let number = |part: &str| part.trim().parse::<f64>().ok().filter(|v| v.is_finite());
    let pair = text.split_once(':').and_then(|(n, nm)| Some((number(n)?, number(nm)?)));
    let film = pair.filter(|(index, nm)| *index > 0.0 && *nm >= 0.0);
    let film = film.map(|(index, nm)| ThinFilm { index, thickness: 1e-6 * nm });
    film.ok_or_else(|| "expected an index and nanometres, as in `1.38:99.64`".to_owned())
}

/// The printed result: shares for both polarisations and their mean.
#[derive(Serialize)]
struct ReflectanceReport {
    s: f64,
    p: f64,
    mean: f64,
    films: Vec<FilmJson>,
}

#[derive(Serialize)]
struct FilmJson {
    index: f64,
    nm: f64,
}

impl CoatingArgs {
    pub(super) fn run(&self, output: &Output) -> Result<(), CliError> {
        let checks = [
            ("--from", self.from, self.from > 0.0 && self.from.is_finite(), "a positive index"),
            ("--to", self.to, self.to > 0.0 && self.to.is_finite(), "a positive index"),
            ("--um", self.um, self.um > 0.0 && self.um.is_finite(), "a positive wavelength"),
            ("--angle", self.angle, (0.0..90.0).contains(&self.angle), "0 to less than 90 degrees"),
        ];
        super::check(&checks)?;
        let indices = [self.from, self.to];
        let (mm, cosine) = (1e-3 * self.um, self.angle.to_radians().cos());
        let (films, [s, p]) = match self.coating {
            Some(coating) => {
                let films = coating.films(self.from.max(self.to));
                (films, coating.reflectance(indices, mm, cosine))
            }
            None => (self.films.clone(), film_reflectance(&self.films, indices, mm, cosine)),
        };
        let film = |film: &ThinFilm| FilmJson { index: film.index, nm: 1e6 * film.thickness };
        let films = films.iter().map(film).collect();
        output.print(&ReflectanceReport { s, p, mean: 0.5 * (s + p), films })
    }
}

impl Display for ReflectanceReport {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        for FilmJson { index, nm } in &self.films {
            writeln!(f, "film of index {index}, {nm:.3} nm")?;
        }
        let [s, p, mean] = [self.s, self.p, self.mean].map(|share| 100.0 * share);
        writeln!(f, "reflected: {mean:.6} % (s {s:.6} %, p {p:.6} %)")
    }
}
