//! The glasses of the table: those that a search finds, in an order.

use std::cmp::Ordering;

use crate::files::GlassQuery;
use crate::lens::Medium;
use crate::lens::glass::{self, Glass, GlassPrice, GlassProperties, PriceSource};

/// A glass of the table.
#[derive(Debug, Clone, Copy)]
pub(super) struct ListedGlass {
    pub(super) glass: &'static Glass,
    /// The partial dispersion `PgF`.
    pub(super) partial: Option<f64>,
    properties: Option<&'static GlassProperties>,
    price: GlassPrice,
}

/// False for a glass that is not known at the lines of the Abbe number, as those for the infrared.
fn has_abbe_number(glass: &Glass) -> bool {
    glass.vd > 0.0
}

impl ListedGlass {
    pub(super) fn new(glass: &'static Glass) -> Self {
        let (partial, properties) = (glass.partial_dispersion(), glass.properties());
        Self { glass, partial, properties, price: glass.price() }
    }

    pub(super) fn numbers(self) -> GlassNumbers {
        GlassNumbers { nd: self.glass.nd, vd: self.glass.vd, partial: self.partial }
    }

    /// The number or the word of a column; `None` where the catalogue says nothing.
    fn value(self, column: GlassColumn, near: Option<GlassNumbers>) -> Option<CellValue> {
        let glass = self.glass;
        match column {
            GlassColumn::Name => Some(CellValue::Word(&glass.name)),
            GlassColumn::Maker => Some(CellValue::Word(&glass.manufacturer)),
            GlassColumn::Index => Some(CellValue::Number(glass.nd)),
            GlassColumn::Abbe => has_abbe_number(glass).then_some(CellValue::Number(glass.vd)),
            GlassColumn::Partial => self.partial.map(CellValue::Number),
            GlassColumn::Density => glass.density.map(CellValue::Number),
            GlassColumn::Price => Some(CellValue::Number(self.price.relative)),
            GlassColumn::Status => {
                self.properties?.status.map(|status| CellValue::Word(status.name()))
            }
            GlassColumn::Distance => {
                near.map(|near| CellValue::Number(glass::distance(glass, near.nd, near.vd)))
            }
        }
    }

    /// The text of a column; a dash where the catalogue says nothing.
    pub(super) fn text(self, column: GlassColumn) -> String {
        match self.value(column, None) {
            None => "–".to_owned(),
            Some(CellValue::Word(word)) => word.to_owned(),
            Some(CellValue::Number(number))
                if column == GlassColumn::Price && self.price.source == PriceSource::Estimated =>
            {
                format!("~{number}")
            }
            Some(CellValue::Number(number)) => format!("{number:.*}", column.decimals()),
        }
    }

    /// The glass and what its catalogue says of it, for a tooltip.
    pub(super) fn describe(self) -> String {
        let further = [GlassColumn::Density, GlassColumn::Price, GlassColumn::Status];
        let known = further.into_iter().filter(|column| self.value(*column, None).is_some());
        let words: Vec<String> =
            known.map(|column| format!("{} {}", column.title(), self.text(column))).collect();
        let [nd, vd, partial] = [GlassColumn::Index, GlassColumn::Abbe, GlassColumn::Partial]
            .map(|column| format!("{} {}", column.title(), self.text(column)));
        let numbers = format!("{nd}, {vd}, {partial}");
        let known = self.properties;
        let expansion = known
            .and_then(|known| known.expansion)
            .map(|expansion| format!("expansion {expansion:.1}e-6/K"));
        let slope = known.and_then(|known| known.thermal).map(|thermal| {
            let slope = 1e6 * thermal.slope_at_d(self.glass.nd);
            format!("dn/dT {slope:.1}e-6/K (d, 20 °C)")
        });
        let passed = known
            .and_then(|known| known.internal_transmission(0.42, 10.0))
            .map(|share| format!("passes {:.1} % at 420 nm through 10 mm", 100.0 * share));
        let twins: Vec<String> = self.glass.twins().iter().map(|twin| twin.full_name()).collect();
        let twins = (!twins.is_empty()).then(|| format!("the same glass: {}", twins.join(", ")));
        let lines = [self.glass.full_name(), numbers, words.join(", ")];
        let more = [expansion, slope, passed, twins].into_iter().flatten();
        lines.into_iter().chain(more).collect::<Vec<_>>().join("\n")
    }
}

/// A cell by which glasses are sorted.
#[derive(Debug, Clone, Copy, PartialEq, PartialOrd)]
enum CellValue {
    Number(f64),
    Word(&'static str),
}

/// The numbers of a glass or of a model glass, as a map shows them.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct GlassNumbers {
    pub(super) nd: f64,
    pub(super) vd: f64,
    pub(super) partial: Option<f64>,
}

impl GlassNumbers {
    /// The numbers of what fills a gap; `None` where it has no Abbe number.
    pub(super) fn of(medium: &Medium) -> Option<Self> {
        match medium {
            Medium::Glass(name) => {
                let glass = glass::find(name).filter(|glass| has_abbe_number(glass))?;
                Some(ListedGlass::new(glass).numbers())
            }
            Medium::Model { nd, vd } if *vd > 0.0 => {
                let partial = Some(glass::normal_partial_dispersion(*vd));
                Some(Self { nd: *nd, vd: *vd, partial })
            }
            Medium::Grin(gradient) => Self::of(&gradient.base),
            Medium::Air | Medium::Mirror | Medium::Index(_) | Medium::Model { .. } => None,
        }
    }
}

/// A column of the table, or the distance from a glass, by which it is sorted too.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub(super) enum GlassColumn {
    #[default]
    Name,
    Maker,
    Index,
    Abbe,
    Partial,
    Density,
    Price,
    Status,
    Distance,
}

impl GlassColumn {
    /// The columns that are shown.
    pub(super) const SHOWN: [Self; 8] = [
        Self::Name,
        Self::Maker,
        Self::Index,
        Self::Abbe,
        Self::Partial,
        Self::Density,
        Self::Price,
        Self::Status,
    ];

    pub(super) const fn title(self) -> &'static str {
        match self {
            Self::Name => "Glass",
            Self::Maker => "Catalogue",
            Self::Index => "nd",
            Self::Abbe => "vd",
            Self::Partial => "PgF",
            Self::Density => "g/cm³",
            Self::Price => "Price",
            Self::Status => "Status",
            Self::Distance => "Distance",
        }
    }

    pub(super) const fn hint(self) -> &'static str {
        match self {
            Self::Name => "The name that the maker gives it",
            Self::Maker => "The catalogue: the name of the maker, or a collection",
            Self::Index => "Index at 587.6 nm",
            Self::Abbe => "Abbe number at 587.6 nm",
            Self::Partial => {
                "Partial dispersion (ng − nF)/(nF − nC); glasses far from the normal line correct the \
                 secondary spectrum"
            }
            Self::Density => "Density",
            Self::Price => {
                "Price relative to that of N-BK7, of a catalogue that was added or of the list prices.csv \
                 beside it; ~ marks a class, estimated from the family of the glass"
            }
            Self::Status => "Whether it is still made, where a catalogue that was added states it",
            Self::Distance => "0.001 in nd counts as much as 0.5 in vd",
        }
    }

    pub(super) const fn is_text(self) -> bool {
        matches!(self, Self::Name | Self::Maker | Self::Status)
    }

    const fn decimals(self) -> usize {
        match self {
            Self::Index => 5,
            Self::Partial => 4,
            Self::Price => 1,
            _ => 2,
        }
    }
}

/// The order of the table.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub(super) struct GlassOrder {
    pub(super) column: GlassColumn,
    pub(super) descending: bool,
}

impl GlassOrder {
    /// The order after a click on a title: by it, or the other way round.
    #[must_use]
    pub(super) fn clicked(self, column: GlassColumn) -> Self {
        Self { column, descending: self.column == column && !self.descending }
    }
}

/// The glasses that a search finds, in an order; `near` is what distances count from.
///
/// # Errors
/// A search that is none.
pub(super) fn list(
    query: &str,
    order: GlassOrder,
    near: Option<GlassNumbers>,
) -> Result<Vec<ListedGlass>, String> {
    let query = GlassQuery::new(query.split_whitespace()).map_err(|why| why.to_string())?;
    let found = glass::known().filter(|glass| query.is_met_by(glass));
    let mut listed: Vec<ListedGlass> = found.map(ListedGlass::new).collect();
    listed.sort_by(|a, b| {
        let values = [a, b].map(|listed| listed.value(order.column, near));
        let names = [a, b].map(|listed| (&listed.glass.name, &listed.glass.manufacturer));
        compare(values, order.descending).then(names[0].cmp(&names[1]))
    });
    Ok(listed)
}

/// The order of two cells: one without a value comes last, whatever the direction.
fn compare([a, b]: [Option<CellValue>; 2], descending: bool) -> Ordering {
    let (Some(a), Some(b)) = (a, b) else { return a.is_none().cmp(&b.is_none()) };
    let order = match (a, b) {
        (CellValue::Number(a), CellValue::Number(b)) => a.total_cmp(&b),
        (CellValue::Word(a), CellValue::Word(b)) => a.cmp(b),
        // A column has one kind.
        (CellValue::Number(_), CellValue::Word(_)) => Ordering::Less,
        (CellValue::Word(_), CellValue::Number(_)) => Ordering::Greater,
    };
    if descending { order.reverse() } else { order }
}

/// The nearest glass of a list to some numbers, other than `but`.
pub(super) fn nearest(
    listed: &[ListedGlass],
    near: GlassNumbers,
    but: Option<&'static Glass>,
) -> Option<ListedGlass> {
    let distance = |listed: &&ListedGlass| glass::distance(listed.glass, near.nd, near.vd);
    let others = listed.iter().filter(|other| !but.is_some_and(|glass| glass == other.glass));
    others.min_by(|a, b| distance(a).total_cmp(&distance(b))).copied()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_list_is_sorted_by_its_column_and_what_is_unknown_comes_last() {
        let order = GlassOrder { column: GlassColumn::Density, descending: true };
        let all = list("", order, None).unwrap();
        let known = all.iter().take_while(|listed| listed.glass.density.is_some()).count();
        assert!(known > 100 && known < all.len(), "{known}");
        assert!(all[known..].iter().all(|listed| listed.glass.density.is_none()));
        assert!(all[..known].is_sorted_by(|a, b| a.glass.density >= b.glass.density));
        assert!(!order.clicked(GlassColumn::Density).descending);
        assert!(!order.clicked(GlassColumn::Name).descending);
    }

    #[test]
    fn the_nearest_other_glass_is_another_one_and_a_search_restricts_it() {
        let bk7 = glass::find("SCHOTT N-BK7").unwrap();
        let near = GlassNumbers { nd: bk7.nd, vd: bk7.vd, partial: None };
        let schott = list("schott vd=50..", GlassOrder::default(), None).unwrap();
        assert_eq!(nearest(&schott, near, None).unwrap().glass.nd, bk7.nd);
        let other = nearest(&schott, near, Some(bk7)).unwrap().glass;
        assert!(other != bk7 && other.manufacturer == "SCHOTT");
        assert!(list("nd=high", GlassOrder::default(), None).unwrap_err().contains("nd"));
    }

    #[test]
    fn a_model_glass_lies_on_the_normal_line() {
        let of = |medium| GlassNumbers::of(&medium);
        let model = of(Medium::Model { nd: 1.62, vd: 36.4 }).unwrap();
        // F2 with vd 36.43 and PgF 0.5828 is one of the two glasses that define the line.
        assert!((model.partial.unwrap() - 0.5828).abs() < 3e-4);
        assert_eq!(of(Medium::Air), None);
        assert_eq!(of(Medium::Index(1.5)), None);
    }
}
