//! A coating by its layers: a few films of given indices and thicknesses, the same on every surface.
//!
//! Thicknesses are along the normal and constant over a surface, and indices do not change with the wavelength.

use super::coating::ThinFilm;
use crate::math::format_short;
use serde::{Deserialize, Serialize};
use std::fmt;

/// The films of a coating, from the side of the air.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(try_from = "Vec<ThinFilm>", into = "Vec<ThinFilm>")]
pub struct FilmStack {
    films: [ThinFilm; Self::MOST],
    count: usize,
}

impl FilmStack {
    /// The largest number of films.
    pub const MOST: usize = 8;

    /// The stack of some films, the outermost first; `None` without one, with too many, or if one has no positive
    /// index or no thickness from 0 to 0.1 mm.
    pub fn new(films: &[ThinFilm]) -> Option<Self> {
        let is_film = |film: &ThinFilm| {
            film.index > 0.0 && film.index.is_finite() && (0.0..=0.1).contains(&film.thickness)
        };
        if films.is_empty() || films.len() > Self::MOST || !films.iter().all(is_film) {
            return None;
        }
        let none = ThinFilm { index: 1.0, thickness: 0.0 };
        let mut stack = Self { films: [none; Self::MOST], count: films.len() };
        stack.films[..films.len()].copy_from_slice(films);
        Some(stack)
    }

    /// The films.
    pub fn films(&self) -> &[ThinFilm] {
        &self.films[..self.count]
    }

    /// The stack of indices and thicknesses in nm, `1.38:99.64+2.05:20`, the outermost first.
    pub fn parse(text: &str) -> Option<Self> {
        let film = |part: &str| {
            let (index, nm) = part.split_once(':')?;
            let number = |part: &str| part.trim().parse::<f64>().ok();
            Some(ThinFilm { index: number(index)?, thickness: 1e-6 * number(nm)? })
        };
        let films: Option<Vec<ThinFilm>> = text.split('+').map(film).collect();
        Self::new(&films?)
    }
}

impl TryFrom<Vec<ThinFilm>> for FilmStack {
    type Error = &'static str;

    fn try_from(films: Vec<ThinFilm>) -> Result<Self, Self::Error> {
        Self::new(&films)
            .ok_or("expected 1 to 8 films, each with a positive index and a thickness up to 0.1 mm")
    }
}

impl From<FilmStack> for Vec<ThinFilm> {
    fn from(stack: FilmStack) -> Self {
        stack.films().to_vec()
    }
}

impl fmt::Display for FilmStack {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        for (i, film) in self.films().iter().enumerate() {
            // To the picometre: what a conversion from nanometres rounds is none of the thickness.
            let picometres = (1e9 * film.thickness).round();
            let (index, nm) = (format_short(film.index), format_short(picometres / 1e3));
            let before = if i == 0 { "" } else { " on " };
            write!(f, "{before}{nm} nm of index {index}")?;
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::analysis::Coating;

    /// Films that are those of a class reflect as it does, from both sides.
    #[test]
    fn the_layers_of_a_v_coat_are_a_v_coat() {
        let glass = 1.5168;
        let own = FilmStack::new(&Coating::VCoat.films(glass)).map(Coating::Layers).unwrap();
        for (indices, cosine) in [([1.0, glass], 0.8), ([glass, 1.0], 0.9), ([glass, 1.7], 0.9)] {
            for wavelength in [450e-6, 650e-6] {
                let found = own.reflectance(indices, wavelength, cosine);
                assert_eq!(found, Coating::VCoat.reflectance(indices, wavelength, cosine));
            }
        }
    }

    #[test]
    fn stacks_are_written_as_they_are_read_and_wrong_ones_are_refused() {
        let stack = FilmStack::parse("1.38:125.9+2.05:19.4").unwrap();
        assert_eq!(stack.films().len(), 2);
        assert_eq!(stack.to_string(), "125.9 nm of index 1.38 on 19.4 nm of index 2.05");
        let text = serde_json::to_string(&Coating::Layers(stack)).unwrap();
        let back: Coating = serde_json::from_str(&text).unwrap();
        assert_eq!(back, Coating::Layers(stack));
        for wrong in ["", "1.38", "0:100", "1.38:-1", "NaN:1", "1.38:1e9", "1.38:1+"] {
            assert!(FilmStack::parse(wrong).is_none(), "{wrong}");
        }
        let many = ["1.4:10"; FilmStack::MOST + 1].join("+");
        assert!(FilmStack::parse(&many).is_none());
        assert!(serde_json::from_str::<Coating>(r#"{"layers": []}"#).is_err());
    }
}
