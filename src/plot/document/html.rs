//! A document as one HTML page with its drawings inside: no scripts, no other files.

use super::{DocumentBlock, DocumentTable, ReportDocument};
use crate::plot::vector::{escaped, svg_text};

const STYLE: &str = "body{font:15px/1.45 system-ui,sans-serif;color:#111;background:#fff;\
    max-width:1000px;margin:2em auto;padding:0 1em}\
    h1{font-size:1.6em}h2{font-size:1.15em;margin-top:2em;border-bottom:1px solid #ccc}\
    table{border-collapse:collapse;font-size:.87em;font-variant-numeric:tabular-nums}\
    th,td{padding:.18em .7em;text-align:right;border-bottom:1px solid #e4e4e4;white-space:nowrap}\
    th{border-bottom:1px solid #888}td.l,th.l{text-align:left}\
    .wide{overflow-x:auto}figure{margin:1em 0}figure svg{max-width:100%;height:auto}\
    figcaption{color:#555;font-size:.87em}footer{color:#777;font-size:.8em;margin-top:3em}";

/// The document as HTML.
pub fn html_text(document: &ReportDocument) -> String {
    let title = escaped(&document.title);
    let body: String = document.blocks.iter().map(block).collect();
    let footer = escaped(&document.footer);
    format!(
        "<!DOCTYPE html>\n<html lang=\"en\">\n<head>\n<meta charset=\"utf-8\">\n\
         <meta name=\"viewport\" content=\"width=device-width\">\n<title>{title}</title>\n\
         <style>{STYLE}</style>\n</head>\n<body>\n<h1>{title}</h1>\n{body}\
         <footer>{footer}</footer>\n</body>\n</html>\n"
    )
}

fn block(block: &DocumentBlock) -> String {
    match block {
        DocumentBlock::Heading(text) => format!("<h2>{}</h2>\n", escaped(text)),
        DocumentBlock::Text(text) => format!("<p>{}</p>\n", escaped(text)),
        DocumentBlock::Table(table) => table_text(table),
        DocumentBlock::Figure { drawing, caption } => {
            let caption = escaped(caption);
            format!(
                "<figure>\n{}<figcaption>{caption}</figcaption>\n</figure>\n",
                svg_text(drawing)
            )
        }
    }
}

fn table_text(table: &DocumentTable) -> String {
    let row = |cells: &[String], tag: &str| {
        let cell = |(i, text): (usize, &String)| {
            let class = if table.left.contains(&i) { " class=\"l\"" } else { "" };
            format!("<{tag}{class}>{}</{tag}>", escaped(text))
        };
        format!("<tr>{}</tr>\n", cells.iter().enumerate().map(cell).collect::<String>())
    };
    let rows: String = table.rows.iter().map(|cells| row(cells, "td")).collect();
    format!("<div class=\"wide\"><table>\n{}{rows}</table></div>\n", row(&table.head, "th"))
}
