//! A drawing as an SVG file, to scale: its user unit is the millimetre.

use super::{Mark, Pen, SheetArc, VectorDrawing, dashes};
use crate::plot::{Color, TextAlign};

/// The typefaces of texts, the first one being that of PDF files.
const FAMILY: &str = "Ubuntu, 'DejaVu Sans', Helvetica, Arial, sans-serif";

/// The drawing as SVG, which is also what an HTML page contains.
pub fn svg_text(drawing: &VectorDrawing) -> String {
    svg_file(drawing, "")
}

/// The same with a title and a description, which viewers show and search engines read.
pub fn described_svg(drawing: &VectorDrawing, title: &str, description: &str) -> String {
    let element = |name: &str, text: &str| match text {
        "" => String::new(),
        text => format!("<{name}>{}</{name}>\n", escaped(text)),
    };
    svg_file(drawing, &(element("title", title) + &element("desc", description)))
}

/// The file with elements before its marks.
fn svg_file(drawing: &VectorDrawing, first: &str) -> String {
    let [w, h] = drawing.size.map(number);
    let mut svg = format!(
        "<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"{w}mm\" height=\"{h}mm\" \
         viewBox=\"0 0 {w} {h}\" font-family=\"{FAMILY}\">\n{first}\
         <rect width=\"{w}\" height=\"{h}\" fill=\"#ffffff\"/>\n"
    );
    for mark in &drawing.marks {
        svg.push_str(&element(mark));
        svg.push('\n');
    }
    svg + "</svg>\n"
}

fn element(mark: &Mark) -> String {
    match mark {
        Mark::Line { points, pen } => {
            format!("<polyline points=\"{}\" fill=\"none\"{}/>", list(points), stroke(pen))
        }
        Mark::Arc { arc, pen } => {
            format!("<path d=\"{}\" fill=\"none\"{}/>", arc_path(arc), stroke(pen))
        }
        Mark::Area { points, color } => {
            format!("<polygon points=\"{}\" fill=\"{}\"/>", list(points), hex(*color))
        }
        Mark::Text { at, text, size, color, align, upwards, .. } => {
            let [x, y] = at.map(number);
            let turn = if *upwards {
                format!(" transform=\"rotate(-90 {x} {y})\"")
            } else {
                String::new()
            };
            let anchor = match align {
                TextAlign::Left => "start",
                TextAlign::Middle => "middle",
                TextAlign::Right => "end",
            };
            let (size, fill, text) = (number(*size), hex(*color), escaped(text));
            format!(
                "<text x=\"{x}\" y=\"{y}\" font-size=\"{size}\" text-anchor=\"{anchor}\" \
                 fill=\"{fill}\"{turn}>{text}</text>"
            )
        }
    }
}

fn stroke(pen: &Pen) -> String {
    let (color, width) = (hex(pen.color), number(pen.width));
    let lengths: Vec<String> = dashes(pen.pattern).iter().map(ToString::to_string).collect();
    let dashes = if lengths.is_empty() {
        String::new()
    } else {
        format!(" stroke-dasharray=\"{}\"", lengths.join(" "))
    };
    format!(" stroke=\"{color}\" stroke-width=\"{width}\"{dashes} stroke-linejoin=\"round\"")
}

fn arc_path(arc: &SheetArc) -> String {
    let [from, to] = arc.angles.map(|angle| arc.point(angle).map(number));
    let large = i32::from(arc.angles[1] - arc.angles[0] > std::f64::consts::PI);
    let r = number(arc.radius);
    format!("M {} {} A {r} {r} 0 {large} 1 {} {}", from[0], from[1], to[0], to[1])
}

fn list(points: &[[f64; 2]]) -> String {
    let pairs: Vec<String> =
        points.iter().map(|[x, y]| format!("{},{}", number(*x), number(*y))).collect();
    pairs.join(" ")
}

/// A length in mm to a tenth of a micrometre.
fn number(value: f64) -> String {
    let text = format!("{value:.4}");
    let short = text.trim_end_matches('0').trim_end_matches('.');
    if short == "-0" { "0".to_owned() } else { short.to_owned() }
}

fn hex([r, g, b]: Color) -> String {
    format!("#{r:02x}{g:02x}{b:02x}")
}

/// A text as it is written between tags; control characters, which no XML may contain, are left out.
pub(in crate::plot) fn escaped(text: &str) -> String {
    let mut safe = String::with_capacity(text.len());
    for letter in text.chars() {
        match letter {
            '&' => safe.push_str("&amp;"),
            '<' => safe.push_str("&lt;"),
            '>' => safe.push_str("&gt;"),
            '"' => safe.push_str("&quot;"),
            c if c.is_control() || matches!(c, '\u{fffe}' | '\u{ffff}') => {}
            c => safe.push(c),
        }
    }
    safe
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_cannot_break_out_of_the_text() {
        let mut drawing = VectorDrawing::new([10.0, 10.0]);
        drawing.text([0.0, 0.0], "</text><script>\u{0}\"&", 3.0, TextAlign::Left);
        let svg = svg_text(&drawing);
        assert!(svg.contains("&lt;/text&gt;&lt;script&gt;&quot;&amp;</text>"), "{svg}");
        assert_eq!([number(-1e-9), number(1.25), number(3.0)], ["0", "1.25", "3"]);
    }

    #[test]
    fn lines_and_areas_have_their_points_in_order() {
        let mut drawing = VectorDrawing::new([10.0, 10.0]);
        drawing.line(&[[1.0, 2.0], [3.5, 4.0], [0.0, 9.25]], Pen::THIN);
        drawing.area(&[[5.0, 6.0], [7.0, 6.0], [7.0, 8.0]], [0; 3]);
        let svg = svg_text(&drawing);
        for points in ["\"1,2 3.5,4 0,9.25\"", "\"5,6 7,6 7,8\""] {
            assert!(svg.contains(points), "{svg}");
        }
    }
}
