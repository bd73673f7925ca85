//! Ranges of cells to and from spreadsheets: tab-separated values.

use super::cells::CellPlace;
use super::columns::TableColumn;
use super::cursor::CellGrid;
use crate::lens::{Edit, Lens, Medium, Row, apply_edit};

/// The largest number of surfaces to which pasted rows extend a lens.
const MAX_SURFACES: usize = 1000;

/// A range of cells as tab-separated values, numbers with all their digits.
pub(super) fn copied_text(
    lens: &Lens,
    zoom: usize,
    (rows, columns): &(Vec<usize>, Vec<TableColumn>),
) -> String {
    let cell = |row: usize, column: TableColumn| {
        let text = CellPlace::new(row, column).text(lens, zoom, exact);
        text.replace(['\t', '\n', '\r'], " ")
    };
    let line = |row: &usize| columns.iter().map(|c| cell(*row, *c)).collect::<Vec<_>>().join("\t");
    rows.iter().map(line).collect::<Vec<_>>().join("\n")
}

/// A number with all its digits; an infinite one as the table writes it.
fn exact(value: f64) -> String {
    match value {
        f64::INFINITY => "Infinity".to_owned(),
        f64::NEG_INFINITY => "-Infinity".to_owned(),
        _ => value.to_string(),
    }
}

/// The edit that pastes tab-separated values from the upper left cell of a range on. One value fills
/// the whole range; rows below the last surface become new surfaces.
pub(super) fn paste_edit(
    grid: CellGrid<'_>,
    zoom: usize,
    (rows, columns): &(Vec<usize>, Vec<TableColumn>),
    text: &str,
) -> Result<Edit, String> {
    let lines: Vec<&str> = text.trim_end_matches(['\n', '\r']).lines().collect();
    let first = *rows.first().ok_or("no cell is selected")?;
    if let [line] = lines[..]
        && !line.contains('\t')
    {
        let places = cells(rows, columns).filter(|place| place.is_editable(grid.lens));
        return sequence(grid.lens, zoom, "paste", Vec::new(), places.map(|place| (place, line)));
    }
    let added = added_rows(grid.lens, first + lines.len())?;
    let start = columns.first().and_then(|c| grid.columns.iter().position(|other| other == c));
    let right = &grid.columns[start.unwrap_or(0)..];
    let width = lines.iter().map(|line| line.split('\t').count()).max().unwrap_or(0);
    if width > right.len() {
        let room = right.len();
        return Err(format!(
            "the clipboard has {width} columns; from this cell on there are {room}"
        ));
    }
    let values = lines.iter().enumerate().flat_map(|(i, line)| {
        let cells = line.split('\t').zip(right);
        cells.map(move |(text, column)| (CellPlace::new(first + i, *column), text))
    });
    sequence(grid.lens, zoom, "paste", added, values)
}

/// The edit that empties the cells of a range.
pub(super) fn clear_edit(
    grid: CellGrid<'_>,
    zoom: usize,
    (rows, columns): &(Vec<usize>, Vec<TableColumn>),
) -> Result<Edit, String> {
    let places = cells(rows, columns).filter(|place| place.is_editable(grid.lens));
    let values = places.map(|place| (place, place.empty_text()));
    sequence(grid.lens, zoom, "clear cells", Vec::new(), values)
}

pub(super) fn cells<'a>(
    rows: &'a [usize],
    columns: &'a [TableColumn],
) -> impl Iterator<Item = CellPlace> + 'a {
    rows.iter().flat_map(|row| columns.iter().map(|column| CellPlace::new(*row, *column)))
}

/// The edits that append surfaces until there are `end` rows with that of the object.
fn added_rows(lens: &Lens, end: usize) -> Result<Vec<Edit>, String> {
    let count = lens.surfaces.len();
    if end > MAX_SURFACES + 1 {
        let rows = end - 1;
        return Err(format!(
            "the lens would have {rows} surfaces; expected at most {MAX_SURFACES}"
        ));
    }
    let medium = lens.surfaces.last().map_or(Medium::Air, |row| match &row.medium {
        Medium::Mirror => Medium::Air,
        medium => medium.clone(),
    });
    let row = Row { medium, ..Row::default() };
    Ok((count..end.saturating_sub(1)).map(|at| Edit::InsertRow { at, row: row.clone() }).collect())
}

/// One edit for texts that are written into cells, refused as a whole with the first cell that does
/// not accept its text.
fn sequence<'a>(
    lens: &Lens,
    zoom: usize,
    title: &str,
    mut edits: Vec<Edit>,
    values: impl Iterator<Item = (CellPlace, &'a str)>,
) -> Result<Edit, String> {
    let title = title.to_owned();
    let grown;
    let lens = if edits.is_empty() {
        lens
    } else {
        let rows = Edit::Sequence { title: title.clone(), edits: edits.clone() };
        grown = apply_edit(lens, &rows).map_err(|why| why.to_string())?;
        &grown
    };
    for (place, text) in values {
        let shown = place.text(lens, zoom, exact);
        if text == shown || (!place.is_editable(lens) && text.trim().is_empty()) {
            continue;
        }
        let name = || place.name(lens, zoom);
        if !place.is_editable(lens) {
            return Err(format!("row {} has no cell for `{text}`", place.row));
        }
        let edit = place.edit(lens, zoom, text.trim());
        edits.push(edit.map_err(|why| format!("{}: {why}", name()))?);
    }
    Ok(Edit::Sequence { title, edits })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::files;

    fn lens() -> Lens {
        let bundled = &files::bundled_lenses()[0];
        files::parse(bundled.text.as_bytes(), bundled.name).unwrap().lens
    }

    const COLUMNS: [TableColumn; 4] = [
        TableColumn::Radius,
        TableColumn::Thickness,
        TableColumn::Glass,
        TableColumn::SemiDiameter,
    ];

    fn all(lens: &Lens) -> (Vec<usize>, Vec<TableColumn>) {
        ((1..=lens.surfaces.len()).collect(), COLUMNS.to_vec())
    }

    #[test]
    fn a_copied_prescription_can_be_pasted_into_another_lens() {
        let lens = lens();
        let text = copied_text(&lens, 0, &all(&lens));
        let mut other = crate::lens::blank();
        other.surfaces[0].stop = true;
        let grid = CellGrid { columns: &COLUMNS, lens: &other };
        let edit = paste_edit(grid, 0, &(vec![1], vec![TableColumn::Radius]), &text).unwrap();
        let pasted = apply_edit(&other, &edit).unwrap();
        assert_eq!(copied_text(&pasted, 0, &all(&pasted)), text);
        for (own, row) in pasted.surfaces.iter().zip(&lens.surfaces) {
            assert!((own.curvature - row.curvature).abs() < 1e-15);
        }
    }

    #[test]
    fn one_value_fills_the_range_and_a_wrong_one_names_its_cell() {
        let lens = lens();
        let grid = CellGrid { columns: &COLUMNS, lens: &lens };
        let range = (vec![1, 2, 3], vec![TableColumn::Thickness]);
        let edit = paste_edit(grid, 0, &range, "2.5\n").unwrap();
        let pasted = apply_edit(&lens, &edit).unwrap();
        assert!(pasted.surfaces[..3].iter().all(|row| row.thickness == 2.5));
        let wrong = paste_edit(grid, 0, &range, "1\n2\nthree").unwrap_err();
        assert!(wrong.starts_with("Thickness of surface 3: `three` is no number"), "{wrong}");
    }

    #[test]
    fn a_huge_paste_is_refused_at_once() {
        let lens = lens();
        let grid = CellGrid { columns: &COLUMNS, lens: &lens };
        let text = "1\t2\n".repeat(50_000);
        let wrong = paste_edit(grid, 0, &(vec![1], vec![TableColumn::Radius]), &text).unwrap_err();
        assert_eq!(wrong, "the lens would have 50000 surfaces; expected at most 1000");
    }
}
