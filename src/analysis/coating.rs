//! Reflection at the boundary of two media, bare or under thin films.
//!
//! With the admittances `n cos θ` for light polarised across the plane of incidence (s) and `n / cos θ`
//! in it (p), a film of thickness d has the characteristic matrix
//!
//! ```text
//! | cos δ      i sin δ / η |
//! | i η sin δ  cos δ       |,   δ = 2π n d cos θ / λ
//! ```
//!
//! and the films with the medium behind them act as one admittance C/B (Macleod, *Thin-Film Optical
//! Filters*, 2010, section 2.6). Cosines are complex beyond the critical angle, on the branch that decays.
//! Nothing is absorbed: what is not reflected passes.

use super::film_stack::FilmStack;
use crate::math::format_short;
use nalgebra::Complex;
use serde::{Deserialize, Serialize};
use std::f64::consts::{PI, TAU};
use std::fmt;

/// A homogeneous film.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct ThinFilm {
    /// The refractive index.
    pub index: f64,
    /// The thickness in mm, along the normal.
    pub thickness: f64,
}

/// The coating of every surface between air and glass; surfaces between two glasses are bare.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Coating {
    /// No coating: Fresnel's equations.
    #[default]
    Bare,
    /// A quarter wave of magnesium fluoride, of index 1.38, at 550 nm.
    SingleLayer,
    /// Two films without reflection at 550 nm and normal incidence: magnesium fluoride on an index of
    /// 2.05. Glasses above 1.9, for which they do not exist, have the single layer.
    VCoat,
    /// The same share of the light at any angle and wavelength.
    Flat(f64),
    /// The same films on every surface.
    Layers(FilmStack),
}

/// The index of the outer film.
const OUTER: f64 = 1.38;
/// The index of the inner film of a V coat.
const INNER: f64 = 2.05;
/// The wavelength in mm that coatings are made for.
const DESIGNED_FOR: f64 = 550e-6;
/// The largest index of a medium that counts as air.
const AIR: f64 = 1.1;

/// The reflected shares of light polarised across the plane of incidence (s) and in it (p) at films from
/// the incident side between two media of indices `from` and `to`; the wavelength in mm, and the cosine of
/// the angle of incidence.
pub fn film_reflectance(
    films: &[ThinFilm],
    [from, to]: [f64; 2],
    wavelength: f64,
    cosine: f64,
) -> [f64; 2] {
    let cosine = cosine.min(1.0);
    // The sine of a small angle is not the root of what a rounded cosine leaves.
    let sine2 = (1.0 - cosine) * (1.0 + cosine) * from * from;
    let cosine_in = |index: f64| {
        let square = 1.0 - sine2 / (index * index);
        if square >= 0.0 {
            Complex::new(square.sqrt(), 0.0)
        } else {
            Complex::new(0.0, -(-square).sqrt())
        }
    };
    [false, true].map(|in_plane| {
        let admittance = |index: f64, cosine: Complex<f64>| {
            if in_plane { Complex::from(index) / cosine } else { cosine * index }
        };
        let mut field = [Complex::from(1.0), admittance(to, cosine_in(to))];
        for film in films.iter().rev().filter(|film| film.thickness != 0.0) {
            let along = cosine_in(film.index);
            let phase = along * (TAU * film.index * film.thickness / wavelength);
            let eta = admittance(film.index, along);
            let (sin, cos): (Complex<f64>, _) = (phase.sin() * Complex::<f64>::i(), phase.cos());
            field = [field[0] * cos + field[1] * sin / eta, field[0] * sin * eta + field[1] * cos];
        }
        let before = admittance(from, Complex::from(cosine)) * field[0];
        ((before - field[1]) / (before + field[1])).norm_sqr()
    })
}

impl Coating {
    /// The films of a surface between air and a glass of this index, from the side of the air.
    pub fn films(self, glass: f64) -> Vec<ThinFilm> {
        let single = || vec![ThinFilm { index: OUTER, thickness: 0.25 * DESIGNED_FOR / OUTER }];
        match self {
            Self::Bare | Self::Flat(_) => Vec::new(),
            Self::SingleLayer => single(),
            Self::VCoat => v_films(glass).unwrap_or_else(single),
            Self::Layers(stack) => stack.films().to_vec(),
        }
    }

    /// The reflected shares of both polarisations of light from a medium of index `from` at one of index
    /// `to`, and nothing at equal indices; the wavelength in mm.
    pub fn reflectance(self, [from, to]: [f64; 2], wavelength: f64, cosine: f64) -> [f64; 2] {
        if from == to {
            return [0.0; 2];
        }
        let totally = from * from * (1.0 - cosine * cosine) >= to * to;
        let has_air = from.min(to) < AIR;
        match self {
            Self::Flat(share) if has_air && !totally => [share; 2],
            _ if has_air => {
                let mut films = self.films(from.max(to));
                if from > to {
                    films.reverse();
                }
                film_reflectance(&films, [from, to], wavelength, cosine)
            }
            _ => film_reflectance(&[], [from, to], wavelength, cosine),
        }
    }

    /// The coating of a name, of a share or of layers: `none`, `single-layer`, `v`, `0.3%`, `1.38:125.9+2.05:19.4`.
    pub fn parse(text: &str) -> Option<Self> {
        match text {
            "none" => Some(Self::Bare),
            "single-layer" => Some(Self::SingleLayer),
            "v" => Some(Self::VCoat),
            _ if text.contains(':') => FilmStack::parse(text).map(Self::Layers),
            _ => {
                let share = match text.strip_suffix('%') {
                    Some(percent) => percent.trim().parse::<f64>().ok()? / 100.0,
                    None => text.parse().ok()?,
                };
                (0.0..=1.0).contains(&share).then_some(Self::Flat(share))
            }
        }
    }
}

impl fmt::Display for Coating {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Bare => f.write_str("no coating"),
            Self::SingleLayer => f.write_str("a quarter wave of MgF2 at 550 nm"),
            Self::VCoat => f.write_str("a V coat for 550 nm"),
            Self::Layers(stack) => write!(f, "{stack}"),
            Self::Flat(share) => {
                write!(f, "coatings that reflect {} %", format_short(100.0 * share))
            }
        }
    }
}

/// The two films that reflect nothing at the designed wavelength: of the solutions of Schuster's
/// equations (Macleod, section 3.2) the thinner pair.
fn v_films(glass: f64) -> Option<Vec<ThinFilm>> {
    let (a, b) = (OUTER * OUTER, INNER * INNER);
    let common = (glass - 1.0) / (a * glass - b);
    let outer = common * (b - glass) * a / (glass - a);
    let inner = common * (glass - a) * b / (b - glass);
    if !(outer > 0.0 && inner > 0.0) {
        return None;
    }
    let angles = |square: f64| {
        let angle = square.sqrt().atan();
        [angle, PI - angle]
    };
    let film =
        |index: f64, phase: f64| ThinFilm { index, thickness: phase / TAU * DESIGNED_FOR / index };
    let pairs = angles(outer).into_iter().flat_map(|o| angles(inner).map(|i| [o, i]));
    let stacks = pairs.map(|[o, i]| vec![film(OUTER, o), film(INNER, i)]);
    let reflects =
        |films: &Vec<ThinFilm>| film_reflectance(films, [1.0, glass], DESIGNED_FOR, 1.0)[0];
    let height = |films: &Vec<ThinFilm>| films.iter().map(|film| film.thickness).sum::<f64>();
    stacks.filter(|films| reflects(films) < 1e-9).min_by(|a, b| height(a).total_cmp(&height(b)))
}

#[cfg(test)]
mod tests {
    use super::*;

    const GLASS: f64 = 1.5168;

    #[test]
    fn a_v_coat_is_the_one_of_the_books() {
        let films = Coating::VCoat.films(GLASS);
        assert!((films[0].thickness - 125.874034e-6).abs() < 1e-11, "{films:?}");
        assert!((films[1].thickness - 19.400502e-6).abs() < 1e-11, "{films:?}");
        for glass in [1.45, 1.6, 1.75, 1.85] {
            let found = Coating::VCoat.reflectance([1.0, glass], 550e-6, 1.0)[0];
            assert!(found < 1e-12, "{glass}: {found:e}");
        }
        assert_eq!(Coating::VCoat.films(2.0), Coating::SingleLayer.films(2.0));
    }

    #[test]
    fn nothing_is_reflected_where_nothing_changes_and_a_film_without_thickness_is_none() {
        // The square of an amplitude that is rounding.
        let is_none = |found: [f64; 2]| found.iter().all(|share| (0.0..1e-30).contains(share));
        assert!(is_none(Coating::Bare.reflectance([1.6, 1.6], 550e-6, 0.3)));
        assert!(is_none(film_reflectance(&[], [1.6, 1.6], 550e-6, 0.3)));
        let none = [ThinFilm { index: OUTER, thickness: 0.0 }];
        let bare = film_reflectance(&[], [1.0, GLASS], 550e-6, 0.7);
        let found = film_reflectance(&none, [1.0, GLASS], 550e-6, 0.7);
        assert!(found.iter().zip(bare).all(|(a, b)| (a - b).abs() < 1e-15), "{found:?} {bare:?}");
    }

    #[test]
    fn beyond_the_critical_angle_all_is_reflected_whatever_the_coating() {
        let critical = (1.0 / GLASS).asin().to_degrees();
        for coating in [Coating::Bare, Coating::SingleLayer, Coating::VCoat, Coating::Flat(0.01)] {
            let at = |degrees: f64| {
                coating.reflectance([GLASS, 1.0], 600e-6, degrees.to_radians().cos())
            };
            for share in at(critical + 0.01) {
                assert!((share - 1.0).abs() < 1e-12, "{coating}: {share}");
            }
            assert!(at(critical - 0.01).iter().all(|share| *share < 1.0), "{coating}");
        }
    }

    #[test]
    fn light_is_reflected_alike_from_both_sides() {
        let inside: f64 = (0.6_f64.sin() / GLASS).asin();
        for coating in [Coating::Bare, Coating::SingleLayer, Coating::VCoat] {
            let outside = coating.reflectance([1.0, GLASS], 480e-6, 0.6_f64.cos());
            let back = coating.reflectance([GLASS, 1.0], 480e-6, inside.cos());
            for (a, b) in outside.iter().zip(back) {
                assert!((a - b).abs() < 1e-13, "{coating}: {a} {b}");
            }
        }
    }

    #[test]
    fn names_and_shares_are_coatings() {
        assert_eq!(Coating::parse("v"), Some(Coating::VCoat));
        assert_eq!(Coating::parse("0.3%"), Some(Coating::Flat(0.003)));
        for wrong in ["film", "-1%", "101%", "NaN", ""] {
            assert_eq!(Coating::parse(wrong), None, "{wrong}");
        }
    }
}
