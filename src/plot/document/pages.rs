//! A document on sheets of A4: what does not fit on a sheet goes to the next one, tables with their
//! heads again.

use super::{DocumentBlock, DocumentTable, ReportDocument};
use crate::plot::vector::{text_width, wrapped};
use crate::plot::{Pen, TextAlign, VectorDrawing};

/// The sheet and its margins, in mm.
const SHEET: [f64; 2] = [210.0, 297.0];
const LEFT: f64 = 18.0;
const TOP: f64 = 18.0;
const WIDTH: f64 = SHEET[0] - 2.0 * LEFT;
const BOTTOM: f64 = SHEET[1] - 20.0;
/// The sizes of texts, in mm.
const TITLE: f64 = 6.0;
const HEADING: f64 = 4.2;
const BODY: f64 = 3.1;
const SMALL: f64 = 2.5;
/// The distance between the base lines of two lines, as a share of their size.
const LEADING: f64 = 1.45;
/// The least gap between two columns of a table, as a share of the size of its text.
const COLUMN_GAP: f64 = 1.2;
/// A heading needs this much room behind it on its sheet, in mm, where no figure follows.
const WITH_HEADING: f64 = 25.0;

/// The pages of a document.
pub fn paper_pages(document: &ReportDocument) -> Vec<VectorDrawing> {
    let mut layout = PageLayout { pages: vec![VectorDrawing::new(SHEET)], y: TOP };
    layout.lines(&document.title, TITLE);
    for (i, block) in document.blocks.iter().enumerate() {
        match block {
            DocumentBlock::Heading(text) => {
                layout.heading(text, room_behind(document.blocks.get(i + 1)));
            }
            DocumentBlock::Text(text) => layout.lines(text, BODY),
            DocumentBlock::Table(table) => layout.table(table),
            DocumentBlock::Figure { drawing, caption } => layout.figure(drawing, caption),
        }
    }
    layout.finished(&document.footer)
}

/// The room in mm that the part behind a heading needs on its page.
fn room_behind(block: Option<&DocumentBlock>) -> f64 {
    match block {
        Some(DocumentBlock::Figure { drawing, .. }) => drawing.size[1] + 2.0 * SMALL * LEADING,
        _ => WITH_HEADING,
    }
}

struct PageLayout {
    pages: Vec<VectorDrawing>,
    /// The lower end of what is on the last page, in mm from its top.
    y: f64,
}

impl PageLayout {
    fn page(&mut self) -> &mut VectorDrawing {
        if self.pages.is_empty() {
            self.pages.push(VectorDrawing::new(SHEET));
        }
        let last = self.pages.len() - 1;
        &mut self.pages[last]
    }

    /// Begins a page unless there is this much room on the last one.
    fn reserve(&mut self, height: f64) -> bool {
        let full = self.y + height > BOTTOM && self.y > TOP;
        if full {
            self.pages.push(VectorDrawing::new(SHEET));
            self.y = TOP;
        }
        full
    }

    /// A heading with what needs this much room behind it on the same page.
    fn heading(&mut self, text: &str, behind: f64) {
        self.reserve(2.0 * HEADING + 8.0 + behind);
        self.y += 5.0;
        self.lines(text, HEADING);
        let y = self.y - 1.6;
        self.page().line(&[[LEFT, y], [LEFT + WIDTH, y]], Pen::GRID);
        self.y += 1.0;
    }

    fn lines(&mut self, text: &str, size: f64) {
        for line in wrapped(text, WIDTH, |line| text_width(line, size)) {
            self.reserve(LEADING * size);
            self.y += size;
            let at = [LEFT, self.y];
            self.page().text(at, line, size, TextAlign::Left);
            self.y += (LEADING - 1.0) * size;
        }
        self.y += 0.5 * size;
    }

    fn figure(&mut self, drawing: &VectorDrawing, caption: &str) {
        let factor =
            (WIDTH / drawing.size[0]).min((BOTTOM - TOP - 15.0) / drawing.size[1]).min(1.0);
        let [width, height] = drawing.size.map(|length| factor * length);
        self.reserve(height + 2.0 * SMALL * LEADING);
        let corner = [LEFT + 0.5 * (WIDTH - width), self.y];
        self.page().place(drawing, corner, factor);
        self.y += height + 1.0;
        self.lines(caption, SMALL);
        self.y += 2.0;
    }

    fn table(&mut self, table: &DocumentTable) {
        let columns = ColumnPlan::new(table);
        let line = LEADING * columns.size;
        self.reserve(4.0 * line);
        self.head(table, &columns);
        for row in &table.rows {
            if self.reserve(line) {
                self.head(table, &columns);
            }
            self.row(row, &columns);
        }
        self.y += 3.0;
    }

    fn head(&mut self, table: &DocumentTable, columns: &ColumnPlan) {
        self.row(&table.head, columns);
        let y = self.y;
        let width: f64 = columns.total();
        self.page().line(&[[LEFT, y], [LEFT + width, y]], Pen::FRAME.with_width(0.15));
        self.y += 0.4;
    }

    fn row(&mut self, cells: &[String], columns: &ColumnPlan) {
        let size = columns.size;
        self.y += size;
        let y = self.y;
        for (cell, (x, align)) in cells.iter().zip(&columns.places) {
            self.page().text([*x, y], cell.clone(), size, *align);
        }
        self.y += (LEADING - 1.0) * size;
    }

    fn finished(mut self, footer: &str) -> Vec<VectorDrawing> {
        let count = self.pages.len();
        for (i, page) in self.pages.iter_mut().enumerate() {
            let y = SHEET[1] - 10.0;
            page.text([LEFT, y], footer, SMALL, TextAlign::Left);
            let number = format!("{} / {count}", i + 1);
            page.text([LEFT + WIDTH, y], number, SMALL, TextAlign::Right);
        }
        self.pages
    }
}

/// The columns of a table on paper: as small as they need to be to fit.
struct ColumnPlan {
    size: f64,
    /// The position of each column and the side of its cells that is there.
    places: Vec<(f64, TextAlign)>,
    end: f64,
}

impl ColumnPlan {
    fn new(table: &DocumentTable) -> Self {
        let cells = |i: usize| {
            let rows = table.rows.iter().filter_map(move |row| row.get(i));
            table.head.get(i).into_iter().chain(rows)
        };
        let width = |i| cells(i).map(|cell| text_width(cell, 1.0)).fold(0.0, f64::max);
        let widths: Vec<f64> = (0..table.columns()).map(width).collect();
        let natural: f64 = widths.iter().sum::<f64>() + COLUMN_GAP * widths.len() as f64;
        let size = (WIDTH / natural.max(1.0)).min(0.92 * BODY);
        let mut x = LEFT;
        let mut places = Vec::with_capacity(widths.len());
        for (i, width) in widths.iter().enumerate() {
            let end = x + size * width;
            places.push(if table.left.contains(&i) {
                (x, TextAlign::Left)
            } else {
                (end, TextAlign::Right)
            });
            x = end + size * COLUMN_GAP;
        }
        Self { size, places, end: x - size * COLUMN_GAP }
    }

    fn total(&self) -> f64 {
        self.end - LEFT
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::plot::Mark;

    fn document(rows: usize) -> ReportDocument {
        let mut table = DocumentTable::new(&["surface", "radius"], &[0]);
        (0..rows).for_each(|i| table.row([i.to_string(), format!("{}.5", i * 7)]));
        let mut document =
            ReportDocument { title: "T".into(), footer: "F".into(), blocks: Vec::new() };
        document.heading("Table");
        document.table(table);
        document
    }

    fn texts(page: &VectorDrawing) -> impl Iterator<Item = (&str, [f64; 2])> {
        page.marks.iter().filter_map(|mark| match mark {
            Mark::Text { text, at, .. } => Some((text.as_str(), *at)),
            Mark::Line { .. } | Mark::Arc { .. } | Mark::Area { .. } => None,
        })
    }

    #[test]
    fn a_long_table_repeats_its_heads_and_loses_no_row() {
        let pages = paper_pages(&document(200));
        assert!(pages.len() >= 3, "{}", pages.len());
        let all: Vec<_> = pages.iter().flat_map(texts).collect();
        let count = |word: &str| all.iter().filter(|(text, _)| *text == word).count();
        assert_eq!(count("surface"), pages.len());
        assert!((0..200).all(|i| count(&format!("{}.5", i * 7)) == 1));
        let outside = |[x, y]: [f64; 2]| !(LEFT..=LEFT + WIDTH).contains(&x) || y > SHEET[1] - 9.0;
        assert!(!all.iter().any(|(_, at)| outside(*at)));
    }

    #[test]
    fn a_wide_table_becomes_smaller() {
        let words = "a rather long cell ".repeat(4);
        let mut table = DocumentTable::new(&[words.as_str(); 5], &[]);
        table.row((0..5).map(|_| words.clone()));
        let columns = ColumnPlan::new(&table);
        assert!(columns.size < 1.5 && columns.total() < WIDTH + 1e-9, "{}", columns.size);
    }
}
