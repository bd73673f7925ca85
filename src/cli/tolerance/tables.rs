//! The tables of `tolerance` as text, and how their numbers are written.

use super::report::{SensitivityRow, ToleranceReport};
use crate::cli::output::{ShortNumber, TextTable};
use crate::lens::SurfaceNumber;
use crate::tolerance::AsBuiltSpot;

/// The number of sensitivities in the text.
const SHOWN: usize = 20;

impl ToleranceReport {
    pub(super) fn spot_table(&self) -> TextTable {
        let mut table = TextTable::new(&["", "fixed focus", "refocused"]);
        let both = |of: &dyn Fn(&AsBuiltSpot) -> String| [of(&self.spots[0]), of(&self.spots[1])];
        let mut row = |name: String, of: &dyn Fn(&AsBuiltSpot) -> String| {
            let [fixed, refocused] = both(of);
            table.row([name, fixed, refocused]);
        };
        let short = |value: f64| ShortNumber(value).to_string();
        row("as designed".into(), &|s| short(s.nominal_rms));
        row("root of the expected mean square".into(), &|s| short(s.form_root_mean_square));
        row("mean, quadratic model".into(), &|s| short(s.form_mean_rms));
        row("mean, corrected by Monte Carlo".into(), &|s| with_error(s.mean_rms));
        row("Monte Carlo minus quadratic model".into(), &|s| with_error(s.difference));
        for (i, quantile) in self.spots[0].quantiles.iter().enumerate() {
            let name = format!("{:.0} % of the lenses, at most", 100.0 * quantile.share);
            row(name, &|s| with_error([s.quantiles[i].corrected, s.quantiles[i].error]));
        }
        if self.spots[0].good.is_some() {
            row("yield".into(), &|s| s.good.map_or(String::new(), |g| percent(g.corrected)));
            row("yield by Monte Carlo, 95 % interval".into(), &|s| {
                let ends = s.good.map_or([0.0; 2], |g| g.interval);
                format!("{} to {}", percent(ends[0]), percent(ends[1]))
            });
        }
        table
    }

    pub(super) fn sensitivity_table(&self) -> TextTable {
        let mut head = vec!["error", "surfaces", "half range", "share fixed", "share refocused"];
        head.extend(self.further.heads());
        let mut table = TextTable::new(&head);
        let shown = if self.shows_all { self.sensitivities.len() } else { SHOWN };
        for row in self.sensitivities.iter().take(shown) {
            let own = [
                row.kind.name().to_owned(),
                surfaces(row.first, row.last),
                row.stated.clone(),
                percent(row.fixed.share),
                percent(row.refocused.share),
            ];
            table.row(own.into_iter().chain(row.further.cells()));
        }
        let more = self.sensitivities.len().saturating_sub(shown);
        if more > 0 {
            let rest = |of: fn(&SensitivityRow) -> f64| {
                self.sensitivities[shown..].iter().map(of).sum::<f64>()
            };
            let shares = [rest(|row| row.fixed.share), rest(|row| row.refocused.share)];
            let [fixed, refocused] = shares.map(percent);
            let own =
                [format!("{more} more (--all)"), String::new(), String::new(), fixed, refocused];
            let none = self.further.heads().into_iter().map(|_| String::new());
            table.row(own.into_iter().chain(none));
        }
        table
    }
}

/// A share in percent, without the sign of a number that rounds to 0.
pub(super) fn percent(share: f64) -> String {
    let rounded = (1e3 * share).round() / 10.0 + 0.0;
    format!("{rounded:.1} %")
}

pub(super) fn with_error([value, error]: [f64; 2]) -> String {
    format!("{} ± {error:.1e}", ShortNumber(value))
}

pub(super) fn surfaces(first: usize, last: usize) -> String {
    let number = SurfaceNumber::new;
    if first == last {
        number(first).to_string()
    } else {
        format!("{}-{}", number(first), number(last))
    }
}
