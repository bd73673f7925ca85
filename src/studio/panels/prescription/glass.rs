//! A medium as text: a catalogue name, `nd vd`, an index, `mirror`, or nothing for air.

use crate::lens::glass::{self, Glass};
use crate::lens::{GradientIndex, Medium, ProfileLaw};
use crate::studio::number;

/// The number of glasses that are suggested while the user types.
const PROPOSALS: usize = 12;

/// The text of a cell.
pub(super) fn format_medium(medium: &Medium) -> String {
    match medium {
        Medium::Air => String::new(),
        Medium::Glass(name) => name.clone(),
        Medium::Model { nd, vd } => {
            format!("{} {}", number::format_number(*nd), number::format_number(*vd))
        }
        Medium::Index(n) => number::format_number(*n),
        Medium::Mirror => "MIRROR".to_owned(),
        Medium::Grin(gradient) => show_gradient(gradient),
    }
}

/// `gradient 1.6 r -0.01 0.0002 z 0.01`, with `square` or `sech` in front of the glass.
fn show_gradient(gradient: &GradientIndex) -> String {
    let law = match gradient.law {
        ProfileLaw::Index => "",
        ProfileLaw::Square => "square ",
        ProfileLaw::Sech => "sech ",
    };
    let list = |name: &str, terms: &[f64]| {
        let words = terms.iter().map(ToString::to_string).collect::<Vec<_>>().join(" ");
        if terms.is_empty() { String::new() } else { format!(" {name} {words}") }
    };
    let base = format_medium(&gradient.base);
    format!("gradient {law}{base}{}{}", list("r", &gradient.radial), list("z", &gradient.axial))
}

/// Parses the text of a gradient-index medium; `None` if it is none.
fn parse_gradient(text: &str) -> Option<Medium> {
    let mut words = text.strip_prefix("gradient ")?.split_whitespace().peekable();
    let law = match words.peek() {
        Some(&"square") => ProfileLaw::Square,
        Some(&"sech") => ProfileLaw::Sech,
        _ => ProfileLaw::Index,
    };
    if law != ProfileLaw::Index {
        words.next();
    }
    let mut parts: [Vec<&str>; 3] = Default::default();
    let mut part = 0;
    for word in words {
        match word {
            "r" => part = 1,
            "z" => part = 2,
            _ => parts[part].push(word),
        }
    }
    let numbers = |words: &[&str]| words.iter().map(|word| word.parse().ok()).collect();
    let (radial, axial): (Option<Vec<f64>>, _) = (numbers(&parts[1]), numbers(&parts[2]));
    let base = parse_medium(&parts[0].join(" "));
    Some(Medium::Grin(Box::new(GradientIndex { base, law, radial: radial?, axial: axial? })))
}

/// The indices that a number in a cell can mean: no material has another one in light or infrared.
const INDICES: std::ops::RangeInclusive<f64> = 0.1..=6.0;

/// The medium that a text stands for, or the reason why a number is no index.
pub(super) fn typed_medium(text: &str) -> Result<Medium, String> {
    let medium = parse_medium(text);
    let index = match medium {
        Medium::Index(index) => index,
        Medium::Model { nd, .. } => nd,
        _ => return Ok(medium),
    };
    if INDICES.contains(&index) {
        return Ok(medium);
    }
    let why = "no material has this index; type an index such as 1.5, nd and vd, or a glass";
    Err(format!("{index}: {why}"))
}

/// Parses the text of a cell. An unknown name is kept, so that the error of the lens names it.
pub(super) fn parse_medium(text: &str) -> Medium {
    let text = text.trim();
    if text.is_empty() || text.eq_ignore_ascii_case("air") {
        return Medium::Air;
    }
    if text.eq_ignore_ascii_case("mirror") {
        return Medium::Mirror;
    }
    if let Some(gradient) = parse_gradient(text) {
        return gradient;
    }
    let numbers: Vec<Option<f64>> = text
        .split([' ', '/', ':', ';'])
        .filter(|part| !part.is_empty())
        .map(|part| part.parse().ok())
        .collect();
    // `/2` would be arithmetic in a column of numbers: it is no index.
    let is_whole = text.starts_with(|c: char| c.is_ascii_digit() || "+-.".contains(c));
    match numbers.as_slice() {
        [Some(index)] if is_whole => Medium::Index(*index),
        [Some(nd), Some(vd)] => Medium::Model { nd: *nd, vd: *vd },
        _ => Medium::Glass(glass::find(text).map_or_else(|| text.to_owned(), Glass::full_name)),
    }
}

/// Glasses whose names begin with the text, then those that contain it, each in the order of their
/// names.
pub(super) fn suggestions(text: &str) -> Vec<&'static Glass> {
    let wanted = text.trim().to_uppercase();
    if wanted.is_empty() || wanted.starts_with(['.', '1']) {
        return Vec::new();
    }
    let rank = |glass: &Glass| {
        let (name, full) = (glass.name.to_uppercase(), glass.full_name().to_uppercase());
        let begins = name.starts_with(&wanted) || full.starts_with(&wanted);
        (begins || full.contains(&wanted)).then_some((!begins, name, full))
    };
    let proposed = glass::catalogue().iter().chain(glass::added_glasses());
    let mut found: Vec<_> = proposed.filter_map(|glass| Some((rank(glass)?, glass))).collect();
    found.sort_by(|a, b| a.0.cmp(&b.0));
    found.into_iter().take(PROPOSALS).map(|(_, glass)| glass).collect()
}

/// A glass in a list: name, nd, vd and catalogue in columns.
pub(super) fn proposal_line(glass: &Glass) -> String {
    format!("{:<12} {:.5} {:>6.2}  {}", glass.name, glass.nd, glass.vd, glass.manufacturer)
}

/// The index and Abbe number of a glass, for a tooltip.
pub(super) fn describe_medium(medium: &Medium) -> String {
    match medium {
        Medium::Air => "Air, index 1. Type a catalogue name such as N-BK7, index and Abbe number \
                        such as 1.62 36.4, an index, or mirror."
            .to_owned(),
        Medium::Glass(name) => glass::find(name).map_or_else(
            || format!("{name} is in no catalogue"),
            |g| format!("{}: nd {:.5}, vd {:.2}", g.full_name(), g.nd, g.vd),
        ),
        Medium::Model { nd, vd } => format!("Model glass: nd {nd}, vd {vd}"),
        Medium::Index(n) => format!("Index {n} at every wavelength"),
        Medium::Mirror => "A mirror: the gap behind it is filled like the one before it".to_owned(),
        Medium::Grin(gradient) => format!(
            "A gradient of the {} on this glass: coefficients of r^2, r^4, ... after `r`, of z, \
             z^2, \
             ... after `z`, which counts from this surface. {}",
            match gradient.law {
                ProfileLaw::Index => "index",
                ProfileLaw::Square => "square of the index",
                ProfileLaw::Sech => "index as a hyperbolic secant, its constant after `r`,",
            },
            describe_medium(&gradient.base)
        ),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn gradient(law: ProfileLaw, base: Medium, radial: &[f64], axial: &[f64]) -> Medium {
        let (radial, axial) = (radial.to_vec(), axial.to_vec());
        Medium::Grin(Box::new(GradientIndex { base, law, radial, axial }))
    }

    #[test]
    fn a_medium_is_read_as_it_is_shown() {
        let media = [
            Medium::Air,
            Medium::Mirror,
            Medium::Index(1.5),
            Medium::Model { nd: 1.62, vd: 36.4 },
            Medium::Glass("SCHOTT N-BK7".into()),
            gradient(ProfileLaw::Index, Medium::Index(1.6), &[-0.01, 2e-7], &[0.1 + 0.2]),
            gradient(ProfileLaw::Sech, Medium::Glass("SCHOTT N-BK7".into()), &[0.3], &[]),
            gradient(ProfileLaw::Square, Medium::Model { nd: 1.62, vd: 36.4 }, &[], &[-0.5]),
        ];
        for medium in media {
            assert_eq!(parse_medium(&format_medium(&medium)), medium);
        }
    }

    /// Arithmetic belongs to the columns of numbers.
    #[test]
    fn arithmetic_is_no_index() {
        assert_eq!(parse_medium("/2"), Medium::Glass("/2".into()));
        assert_eq!(parse_medium("1.62/36.4"), Medium::Model { nd: 1.62, vd: 36.4 });
    }

    #[test]
    fn a_glass_is_found_without_its_maker_and_proposed_while_typing() {
        assert_eq!(parse_medium("n-bk7"), Medium::Glass("SCHOTT N-BK7".into()));
        assert_eq!(parse_medium("n-bk99"), Medium::Glass("n-bk99".into()));
        let names = |text| suggestions(text).iter().map(|g| g.full_name()).collect::<Vec<_>>();
        assert!(names("n-bk").contains(&"SCHOTT N-BK7".to_owned()));
        let found = suggestions("n-la");
        assert!(found.iter().is_sorted_by_key(|glass| &glass.name) && found.len() > 4);
        assert!(proposal_line(found[0]).contains(&format!("{:.5}", found[0].nd)));
        assert!(suggestions("").is_empty() && suggestions("1.5").is_empty());
    }
}
