//! The medium behind a surface: `NBK7_SCHOTT`, `517642`, `1.5168:64.17`, `REFL`, a private glass.

use crate::files::codev::command::parse_number;
use crate::files::codev::file::CodeVFile;
use crate::files::report::ConversionOutcome;
use crate::files::zemax::{ImportedMedium, named_medium};
use crate::lens::Medium;
use crate::lens::glass::line;

/// The medium behind surface `number`.
pub(super) fn medium(file: &CodeVFile, number: usize) -> ImportedMedium {
    let plain = |medium| ImportedMedium {
        medium,
        outcome: ConversionOutcome::Used,
        note: String::new(),
        missing: None,
    };
    let Some(name) = &file.surfaces[number].glass else { return plain(Medium::Air) };
    let upper = name.to_ascii_uppercase();
    if let Some(private) = private_medium(file, &upper) {
        return private;
    }
    if let Some((nd, vd)) = index_and_abbe(&upper) {
        let medium = if vd == 0.0 { Medium::Index(nd) } else { Medium::Model { nd, vd } };
        return plain(medium);
    }
    match upper.as_str() {
        "REFL" => plain(Medium::Mirror),
        "AIR" => plain(Medium::Air),
        _ => {
            let (short, maker) = upper.rsplit_once('_').unwrap_or((&upper, ""));
            let makers = if maker.is_empty() { Vec::new() } else { vec![maker.to_owned()] };
            let listed = named_medium(short, &makers);
            // A name may have an underscore of its own.
            if listed.missing.is_some() { named_medium(&upper, &[]) } else { listed }
        }
    }
}

/// nd and vd of a fictitious glass: 1.517 and 64.2 for `517642`, `517.642` and `517000.642000`, or as
/// written in `1.517:64.2`.
fn index_and_abbe(name: &str) -> Option<(f64, f64)> {
    if let Some((nd, vd)) = name.split_once(':') {
        return Some((parse_number(nd)?, parse_number(vd)?));
    }
    let digits = |text: &str| !text.is_empty() && text.bytes().all(|b| b.is_ascii_digit());
    let (index, abbe) = match name.split_once('.') {
        Some(parts) => parts,
        None if name.len() == 6 && digits(name) => name.split_at(3),
        None => return None,
    };
    if !(digits(index) && digits(abbe) && index.len() >= 3 && abbe.len() >= 3) {
        return None;
    }
    let (whole, part) = abbe.split_at(2);
    // Parsed from decimal text, so that it is the f64 nearest to 1.517.
    Some((parse_number(&format!("1.{index}"))?, parse_number(&format!("{whole}.{part}"))?))
}

/// A glass of the private catalogue, by the index at d and the dispersion between F and C.
fn private_medium(file: &CodeVFile, name: &str) -> Option<ImportedMedium> {
    let indices = file.private.get(name)?;
    let mut table: Vec<(f64, f64)> =
        file.private_nm.iter().map(|nm| nm * 1e-3).zip(indices.iter().copied()).collect();
    table.sort_by(|a, b| a.0.total_cmp(&b.0));
    let [nd, blue, red] = [line::D, line::F, line::C].map(|um| interpolated(&table, um));
    let (nd, spread) = (nd?, blue? - red?);
    let vd = (nd - 1.0) / spread;
    let medium =
        if spread > 0.0 && vd > 1.0 { Medium::Model { nd, vd } } else { Medium::Index(nd) };
    let note = format!("the private glass {name} as the model glass nd {nd:.6}, vd {vd:.3}");
    Some(ImportedMedium { medium, outcome: ConversionOutcome::Approximated, note, missing: None })
}

/// The index at a wavelength in µm, linear in 1/λ² between the entries of a table.
fn interpolated(table: &[(f64, f64)], um: f64) -> Option<f64> {
    let place = |um: f64| 1.0 / (um * um);
    let behind = table.iter().position(|(at, _)| *at >= um).unwrap_or(table.len());
    let behind = behind.clamp(1, table.len().checked_sub(1).filter(|last| *last > 0)?);
    let ((a, low), (b, high)) = (table[behind - 1], table[behind]);
    let share = (place(um) - place(a)) / (place(b) - place(a));
    let index = low + share * (high - low);
    (index.is_finite() && index > 0.0).then_some(index)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn codes_have_an_index_and_an_abbe_number() {
        for name in ["517642", "517.642", "517000.642000", "1.517:64.2"] {
            assert_eq!(index_and_abbe(name), Some((1.517, 64.2)), "{name}");
        }
        assert_eq!(index_and_abbe("500.700"), Some((1.5, 70.0)));
        for name in ["NBK7", "5176", "51.64", "a:b", ".5", "517642."] {
            assert_eq!(index_and_abbe(name), None, "{name}");
        }
    }

    #[test]
    fn tables_are_interpolated() {
        let table = [(0.4, 1.55), (0.5, 1.54), (0.7, 1.53)];
        assert_eq!(interpolated(&table, 0.5), Some(1.54));
        assert!(interpolated(&table, 0.6).is_some_and(|n| n > 1.53 && n < 1.54));
        assert_eq!(interpolated(&table[..1], 0.5), None);
        assert_eq!(interpolated(&[], 0.5), None);
    }
}
