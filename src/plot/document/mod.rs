//! A document of headings, paragraphs, tables and drawings, written once and given as an HTML page or
//! laid out on paper.

mod html;
mod pages;

pub use html::html_text;
pub use pages::paper_pages;

use super::VectorDrawing;

/// A document.
#[derive(Debug, Clone, PartialEq)]
pub struct ReportDocument {
    /// The title.
    pub title: String,
    /// The line at the foot of every page.
    pub footer: String,
    /// The parts, in order.
    pub blocks: Vec<DocumentBlock>,
}

/// A part of a document.
#[derive(Debug, Clone, PartialEq)]
pub enum DocumentBlock {
    /// The heading of what follows.
    Heading(String),
    /// A paragraph.
    Text(String),
    /// A table.
    Table(DocumentTable),
    /// A drawing with a line below it.
    Figure {
        /// The drawing.
        drawing: VectorDrawing,
        /// The line below it; may be empty.
        caption: String,
    },
}

/// A table of text with a row of heads; columns are aligned to the right unless they are named.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct DocumentTable {
    /// The heads of the columns.
    pub head: Vec<String>,
    /// The rows, each with a cell a column.
    pub rows: Vec<Vec<String>>,
    /// The columns that are aligned to the left, counted from 0.
    pub left: Vec<usize>,
}

impl DocumentTable {
    /// An empty table with these heads and the columns that are aligned to the left.
    pub fn new(head: &[&str], left: &[usize]) -> Self {
        let head = head.iter().map(|cell| (*cell).to_owned()).collect();
        Self { head, rows: Vec::new(), left: left.to_vec() }
    }

    /// Adds a row.
    pub fn row(&mut self, cells: impl IntoIterator<Item = String>) {
        self.rows.push(cells.into_iter().collect());
    }

    /// The number of columns.
    fn columns(&self) -> usize {
        self.rows.iter().map(Vec::len).chain([self.head.len()]).max().unwrap_or(0)
    }
}

impl ReportDocument {
    /// Adds a heading.
    pub fn heading(&mut self, text: impl Into<String>) {
        self.blocks.push(DocumentBlock::Heading(text.into()));
    }

    /// Adds a paragraph.
    pub fn text(&mut self, text: impl Into<String>) {
        self.blocks.push(DocumentBlock::Text(text.into()));
    }

    /// Adds a table, unless it has no rows.
    pub fn table(&mut self, table: DocumentTable) {
        if !table.rows.is_empty() {
            self.blocks.push(DocumentBlock::Table(table));
        }
    }

    /// Adds a drawing.
    pub fn figure(&mut self, drawing: VectorDrawing, caption: impl Into<String>) {
        self.blocks.push(DocumentBlock::Figure { drawing, caption: caption.into() });
    }
}
