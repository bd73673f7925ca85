//! A drawing as a DXF file for CAD programs: what is drawn, in its own size, on layers.

use super::{LinePattern, Mark, Pen, SheetArc, SheetScale, VectorDrawing};
use crate::plot::TextAlign;
use dxf::entities::{Arc, Entity, EntityType, LwPolyline, Text};
use dxf::enums::{AcadVersion, HorizontalTextJustification, Units};
use dxf::tables::{Layer, LineType};
use dxf::{Color as DxfColor, Drawing, LwPolylineVertex, Point};
use std::collections::BTreeSet;

/// The layer of texts.
const TEXT_LAYER: &str = "TEXT";
/// The smallest share of the size of a text that is its capitals, which DXF counts.
const CAPITALS: f64 = 0.7;

/// The reason why there is no DXF file.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum DxfError {
    /// A sheet on which nothing is to scale.
    #[error("a drawing without a scale has no size of its own")]
    NoScale,
    /// The file could not be made.
    #[error("the DXF file could not be made: {0}")]
    Writer(String),
}

/// The drawn thing as a DXF file (the version of 2004, in mm), the sheet left out.
///
/// # Errors
/// A drawing without a scale.
pub fn dxf_bytes(drawing: &VectorDrawing) -> Result<Vec<u8>, DxfError> {
    let scale = drawing.scale.ok_or(DxfError::NoScale)?;
    let mut file = Drawing::new();
    file.header.version = AcadVersion::R2004;
    file.header.default_drawing_units = Units::Millimeters;
    add_tables(&mut file, drawing);
    for entity in drawing.marks.iter().filter_map(|mark| entity(mark, &scale)) {
        file.add_entity(entity);
    }
    let mut bytes = Vec::new();
    file.save(&mut bytes).map_err(|error| DxfError::Writer(error.to_string()))?;
    Ok(bytes)
}

fn add_tables(file: &mut Drawing, drawing: &VectorDrawing) {
    for (pattern, name) in [(LinePattern::Dashes, "DASHED"), (LinePattern::DashDot, "CENTER")] {
        let lengths: Vec<f64> = super::dashes(pattern).iter().copied().map(f64::from).collect();
        let signed = lengths.iter().enumerate().map(|(i, l)| if i % 2 == 0 { *l } else { -l });
        file.add_line_type(LineType {
            name: name.to_owned(),
            element_count: lengths.len() as i32,
            total_pattern_length: lengths.iter().sum(),
            dash_dot_space_lengths: signed.collect(),
            ..LineType::default()
        });
    }
    let layers: BTreeSet<&str> = drawing
        .marks
        .iter()
        .filter_map(|mark| match mark {
            Mark::Line { pen, .. } | Mark::Arc { pen, .. } => pen.layer,
            Mark::Area { .. } => None,
            Mark::Text { of_sheet, .. } => (!of_sheet).then_some(TEXT_LAYER),
        })
        .collect();
    for name in layers {
        file.add_layer(Layer { name: name.to_owned(), ..Layer::default() });
    }
}

/// A mark in the coordinates of what is drawn; `None` for one of the sheet.
fn entity(mark: &Mark, scale: &SheetScale) -> Option<Entity> {
    match mark {
        Mark::Line { points, pen } => styled(line(points, scale), pen),
        Mark::Arc { arc, pen } => styled(EntityType::Arc(turned(arc, scale)), pen),
        Mark::Text { of_sheet: false, .. } => text(mark, scale),
        Mark::Text { .. } | Mark::Area { .. } => None,
    }
}

fn styled(specific: EntityType, pen: &Pen) -> Option<Entity> {
    let mut entity = Entity::new(specific);
    pen.layer?.clone_into(&mut entity.common.layer);
    let [r, g, b] = pen.color.map(i32::from);
    entity.common.color = DxfColor::by_layer();
    if pen.color != [0; 3] {
        entity.common.color_24_bit = (r << 16) | (g << 8) | b;
    }
    let pattern = match pen.pattern {
        LinePattern::Full => "CONTINUOUS",
        LinePattern::Dashes => "DASHED",
        LinePattern::DashDot => "CENTER",
    };
    pattern.clone_into(&mut entity.common.line_type_name);
    Some(entity)
}

fn line(points: &[[f64; 2]], scale: &SheetScale) -> EntityType {
    let vertex = |p: &[f64; 2]| {
        let [x, y] = scale.to_model(*p);
        LwPolylineVertex { x, y, ..LwPolylineVertex::default() }
    };
    EntityType::LwPolyline(LwPolyline {
        vertices: points.iter().map(vertex).collect(),
        ..LwPolyline::default()
    })
}

/// An arc seen with y upwards: its angles, in degrees, change their sign and their order.
fn turned(arc: &SheetArc, scale: &SheetScale) -> Arc {
    let [x, y] = scale.to_model(arc.center);
    let [end, start] = arc.angles.map(|angle| (-angle.to_degrees()).rem_euclid(360.0));
    Arc::new(Point::new(x, y, 0.0), arc.radius / scale.factor, start, end)
}

fn text(mark: &Mark, scale: &SheetScale) -> Option<Entity> {
    let Mark::Text { at, text, size, align, upwards, .. } = mark else { return None };
    let [x, y] = scale.to_model(*at);
    let place = Point::new(x, y, 0.0);
    let justification = match align {
        TextAlign::Left => HorizontalTextJustification::Left,
        TextAlign::Middle => HorizontalTextJustification::Center,
        TextAlign::Right => HorizontalTextJustification::Right,
    };
    let mut entity = Entity::new(EntityType::Text(Text {
        location: place.clone(),
        second_alignment_point: place,
        text_height: CAPITALS * size / scale.factor,
        value: text.clone(),
        rotation: if *upwards { 90.0 } else { 0.0 },
        horizontal_text_justification: justification,
        ..Text::default()
    }));
    TEXT_LAYER.clone_into(&mut entity.common.layer);
    Some(entity)
}
