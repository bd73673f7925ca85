//! The apertures and obscurations of a surface beside its circular rim: form, sizes, place and side.

use egui::{Button, Grid, Ui};

use super::choose;
use crate::lens::{ApertureShape, BlockedSide, Edit, SurfaceAperture};
use crate::studio::number;
use crate::studio::panels::edit_form::{EditForm, heading};

/// The width of a number, in points.
const FIELD: f32 = 56.0;
/// The width of a line of text, in points.
const LINE: f32 = 244.0;
/// The size of a new aperture where no ray tells that of the beam, in mm.
const SIZE: f64 = 10.0;

/// The form of an aperture, as it is chosen.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum ShapeChoice {
    Rectangle,
    Ellipse,
    Circle,
    Polygon,
    Spider,
}

impl ShapeChoice {
    const ALL: [Self; 5] =
        [Self::Rectangle, Self::Ellipse, Self::Circle, Self::Polygon, Self::Spider];

    pub(super) const fn of(shape: &ApertureShape) -> Self {
        match shape {
            ApertureShape::Rectangle { .. } => Self::Rectangle,
            ApertureShape::Ellipse { .. } => Self::Ellipse,
            ApertureShape::Circle { .. } => Self::Circle,
            ApertureShape::Polygon { .. } => Self::Polygon,
            ApertureShape::Spider { .. } => Self::Spider,
        }
    }

    const fn text(self) -> (&'static str, &'static str) {
        match self {
            Self::Rectangle => ("Rectangle", "Half of its width along x and of its height along y"),
            Self::Ellipse => ("Ellipse", "Its semi-axes along x and y"),
            Self::Circle => ("Circle", "A circle that may lie beside the vertex"),
            Self::Polygon => ("Polygon", "Its corners in order, either way round"),
            Self::Spider => ("Spider", "Straight arms from the centre outwards, the first along x"),
        }
    }

    /// The form with about these half widths.
    fn shape(self, [half_width, half_height]: [f64; 2]) -> ApertureShape {
        match self {
            Self::Rectangle => ApertureShape::Rectangle { half_width, half_height },
            Self::Ellipse => ApertureShape::Ellipse { half_width, half_height },
            Self::Circle => ApertureShape::Circle { radius: half_height },
            Self::Polygon => {
                let (a, b) = (half_width, half_height);
                ApertureShape::Polygon { points: vec![[a, b], [-a, b], [-a, -b], [a, -b]] }
            }
            Self::Spider => ApertureShape::Spider { arms: 3, width: 0.1 * half_height },
        }
    }
}

/// The names of the sizes of a form, in the order of [`SurfaceAperture::numbers`].
const fn size_names(shape: &ApertureShape) -> &'static [&'static str] {
    match shape {
        ApertureShape::Circle { .. } => &["Radius"],
        ApertureShape::Ellipse { .. } | ApertureShape::Rectangle { .. } => {
            &["Half width", "Half height"]
        }
        ApertureShape::Polygon { .. } => &[],
        ApertureShape::Spider { .. } => &["Width of arms"],
    }
}

/// The side on which an aperture blocks light, with its explanation.
const fn side_text(side: BlockedSide) -> (&'static str, &'static str) {
    match side {
        BlockedSide::Outside => ("Clear inside", "Light passes inside alone: a frame, a mask"),
        BlockedSide::Inside => ("Obscures", "Blocks the light that it covers: a baffle, an arm"),
    }
}

/// Shows the apertures of a surface whose beam has this semi-diameter in mm; the edit that a choice or a
/// button asks for.
pub(super) fn show(
    ui: &mut Ui,
    fields: &mut EditForm<'_>,
    (surface, semi_diameter): (usize, Option<f64>),
) -> Option<Edit> {
    heading(ui, "Further apertures, in mm");
    let apertures = fields.view.lens.surfaces[surface].apertures.clone();
    let mut editor = ApertureEditor { fields, surface, apertures: &apertures, asked: None };
    for index in 0..apertures.len() {
        editor.aperture(ui, index);
        ui.add_space(4.0);
    }
    let hint = "A frame, a mask or an obscuration of another form than a circle about the vertex";
    let add = ui.add(Button::new("Add an aperture").small()).on_hover_text(hint);
    if add.clicked() {
        let height = number::format_digits(semi_diameter.unwrap_or(SIZE), 3);
        let height = height.parse().unwrap_or(SIZE);
        let shape = ShapeChoice::Rectangle.shape([height, 0.75 * height]);
        editor.ask([&apertures[..], &[SurfaceAperture::inside(shape)]].concat());
    }
    editor.asked
}

/// The fields of the apertures of a surface.
struct ApertureEditor<'a, 'b> {
    fields: &'a mut EditForm<'b>,
    surface: usize,
    apertures: &'a [SurfaceAperture],
    /// The edit that a choice or a button asked for.
    asked: Option<Edit>,
}

impl ApertureEditor<'_, '_> {
    fn ask(&mut self, apertures: Vec<SurfaceAperture>) {
        self.asked = Some(Edit::SetApertures { surface: self.surface, apertures });
    }

    /// The apertures with this one in the place of another.
    fn with(&self, index: usize, aperture: SurfaceAperture) -> Vec<SurfaceAperture> {
        let mut apertures = self.apertures.to_vec();
        apertures[index] = aperture;
        apertures
    }

    fn aperture(&mut self, ui: &mut Ui, index: usize) {
        let aperture = self.apertures[index].clone();
        let name = format!("aperture {} of surface {}", index + 1, self.surface + 1);
        let chosen = (ShapeChoice::of(&aperture.shape), &ShapeChoice::ALL[..]);
        if let Some(choice) =
            choose(ui, ("Form", &format!("Form of {name}")), chosen, ShapeChoice::text)
        {
            self.ask(self.with(index, reshaped(&aperture, choice)));
        }
        let sides = (aperture.blocks, &[BlockedSide::Outside, BlockedSide::Inside][..]);
        let is_spider = matches!(aperture.shape, ApertureShape::Spider { .. });
        if !is_spider
            && let Some(blocks) =
                choose(ui, ("Light", &format!("Light at {name}")), sides, side_text)
        {
            self.ask(self.with(index, SurfaceAperture { blocks, ..aperture.clone() }));
        }
        self.numbers(ui, (index, &aperture), &name);
        let remove = ui.add(Button::new("Remove").small());
        if remove.accessible_name(format!("Remove {name}")).clicked() {
            let mut left = self.apertures.to_vec();
            left.remove(index);
            self.ask(left);
        }
    }

    fn numbers(&mut self, ui: &mut Ui, (index, own): (usize, &SurfaceAperture), name: &str) {
        match &own.shape {
            ApertureShape::Polygon { .. } => self.corners(ui, (index, own), name),
            ApertureShape::Spider { arms, .. } => self.arms(ui, (index, *arms), name),
            _ => {}
        }
        let sizes = size_names(&own.shape).iter().enumerate();
        let sizes: Vec<(usize, &str)> = sizes.map(|(k, name)| (k, *name)).collect();
        let rows = [&sizes[..], &[(2, "Centre x"), (3, "Centre y")], &[(4, "Turned, °")]];
        Grid::new(name).num_columns(4).spacing([6.0, 2.0]).show(ui, |ui| {
            for row in rows.into_iter().filter(|row| !row.is_empty()) {
                for (number, title) in row {
                    ui.label(*title);
                    self.number(ui, (index, own), (*number, &format!("{title} of {name}")));
                }
                ui.end_row();
            }
        });
    }

    /// The number of arms of a spider.
    fn arms(&mut self, ui: &mut Ui, (index, arms): (usize, usize), name: &str) {
        let (surface, all) = (self.surface, self.apertures);
        let edit = |typed: f64| {
            let mut changed = all.to_vec();
            if let ApertureShape::Spider { arms, .. } = &mut changed[index].shape {
                *arms = typed.round().clamp(0.0, 1e6) as usize;
            }
            Edit::SetApertures { surface, apertures: changed }
        };
        ui.horizontal(|ui| {
            ui.label("Number of arms");
            let label = format!("Number of arms of {name}");
            self.fields.number(ui, &label, (arms as f64, FIELD), edit);
        });
    }

    /// One of the numbers of an aperture.
    fn number(
        &mut self,
        ui: &mut Ui,
        (index, own): (usize, &SurfaceAperture),
        (number, label): (usize, &str),
    ) {
        let (surface, all) = (self.surface, self.apertures);
        self.fields.number(ui, label, (own.numbers()[number], FIELD), |value| {
            let mut changed = all.to_vec();
            if let Some(own) = changed[index].number_mut(number) {
                *own = value;
            }
            Edit::SetApertures { surface, apertures: changed }
        });
    }

    /// The corners of a polygon as a text.
    fn corners(&mut self, ui: &mut Ui, (index, own): (usize, &SurfaceAperture), name: &str) {
        let upright = SurfaceAperture::inside(own.shape.clone());
        let shown = upright.text_with(|number| number.to_string());
        let shown = shown.trim_start_matches("polygon ");
        let (surface, all) = (self.surface, self.apertures);
        ui.label("Corners (x, y)");
        self.fields.paragraph(ui, &format!("Corners of {name}"), (shown, LINE), |text| {
            let corners = text.trim_start().trim_start_matches("polygon");
            let typed: SurfaceAperture = format!("polygon {corners}").parse()?;
            if typed.center != [0.0; 2] || typed.angle != 0.0 {
                return Err("expected corners alone: place and angle have fields".to_owned());
            }
            let mut changed = all.to_vec();
            changed[index].shape = typed.shape;
            Ok(Edit::SetApertures { surface, apertures: changed })
        });
    }
}

/// An aperture in another form of about the same size.
fn reshaped(aperture: &SurfaceAperture, choice: ShapeChoice) -> SurfaceAperture {
    let [a, b, ..] = aperture.numbers();
    let sizes = match &aperture.shape {
        ApertureShape::Circle { .. } => [a, a],
        ApertureShape::Ellipse { .. } | ApertureShape::Rectangle { .. } => [a, b],
        ApertureShape::Polygon { points } => {
            [0, 1].map(|axis| points.iter().map(|corner| corner[axis].abs()).fold(0.0, f64::max))
        }
        ApertureShape::Spider { .. } => [10.0 * a; 2],
    };
    let is_spider = choice == ShapeChoice::Spider;
    let blocks = if is_spider { BlockedSide::Inside } else { aperture.blocks };
    SurfaceAperture { shape: choice.shape(sizes), blocks, ..aperture.clone() }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn another_form_keeps_about_the_size() {
        let shape = ShapeChoice::Rectangle.shape([4.0, 3.0]);
        let mut own = SurfaceAperture { center: [1.0, 2.0], ..SurfaceAperture::inside(shape) };
        for choice in [ShapeChoice::Ellipse, ShapeChoice::Polygon, ShapeChoice::Rectangle] {
            own = reshaped(&own, choice);
        }
        assert_eq!(own.numbers(), [4.0, 3.0, 1.0, 2.0, 0.0]);
        let spider = reshaped(&own, ShapeChoice::Spider);
        assert_eq!((spider.fault(), own.fault()), (None, None));
        assert!(spider.obscures());
    }
}
