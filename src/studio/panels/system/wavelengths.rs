//! The wavelengths.

use egui::{ComboBox, Grid, Ui};

use super::fields::delete_button;
use crate::lens::{Edit, Wavelength, WavelengthPreset};
use crate::studio::form::named_list;
use crate::studio::palette::{Palette, color32};
use crate::studio::panels::edit_form::{EditForm, heading};
use crate::studio::panels::widgets::swatch;

/// The name of a number of a wavelength, its value, and what sets it.
type WavelengthColumn = (&'static str, f64, fn(&mut Wavelength, f64));

/// Shows the group of wavelengths.
pub(super) fn ui(ui: &mut Ui, form: &mut EditForm<'_>) {
    heading(ui, "Wavelengths");
    presets(ui, form);
    table(ui, form);
    if ui.button("Add wavelength").clicked() {
        let mut more = form.view.lens.wavelengths.clone();
        let um = more.last().map_or(0.5876, |last| last.um);
        more.push(Wavelength { um, weight: 1.0, primary: false });
        form.actions.push(Edit::SetWavelengths(more));
    }
}

fn presets(ui: &mut Ui, form: &mut EditForm<'_>) {
    let present = WavelengthPreset::of(&form.view.lens.wavelengths);
    let title = present.map_or("Own", |preset| preset.title);
    let combo = ComboBox::from_id_salt("wavelength preset").selected_text(title).width(210.0);
    let shown = combo.show_ui(ui, |ui| {
        for preset in &WavelengthPreset::ALL {
            if ui.selectable_label(present == Some(preset), preset.title).clicked() {
                form.actions.push(Edit::SetWavelengths(preset.wavelengths()));
            }
        }
    });
    named_list(ui, shown, "Wavelength preset");
}

fn table(ui: &mut Ui, form: &mut EditForm<'_>) {
    let lens = &form.view.lens;
    let (waves, primary) = (lens.wavelengths.clone(), lens.primary());
    let palette = Palette::for_visuals(ui.visuals());
    Grid::new("wavelengths").num_columns(5).min_col_width(8.0).spacing([6.0, 3.0]).show(ui, |ui| {
        for heading in ["", "µm", "Weight", "Primary", ""] {
            ui.weak(heading);
        }
        ui.end_row();
        for (i, wave) in waves.iter().enumerate() {
            swatch(ui, color32(palette.wavelength(wave.um)));
            let numbers: [WavelengthColumn; 2] = [
                ("", wave.um, |wave, value| wave.um = value),
                (" weight", wave.weight, |wave, value| wave.weight = value),
            ];
            for (what, value, set) in numbers {
                let name = format!("Wavelength {}{what}", i + 1);
                form.number(ui, &name, (value, 70.0), |value| {
                    let mut changed = waves.clone();
                    set(&mut changed[i], value);
                    Edit::SetWavelengths(changed)
                });
            }
            let radio = ui.radio(i == primary, "");
            let radio = radio.accessible_name(format!("Primary wavelength {}", i + 1));
            if radio.clicked() && i != primary {
                form.actions.push(Edit::SetWavelengths(with_primary(&waves, i)));
            }
            if delete_button(ui, &format!("Delete wavelength {}", i + 1), waves.len() > 1) {
                let mut changed = with_primary(&waves, if i == primary { 0 } else { primary });
                changed.remove(i);
                form.actions.push(Edit::SetWavelengths(changed));
            }
            ui.end_row();
        }
    });
}

/// The wavelengths with another primary one.
fn with_primary(waves: &[Wavelength], primary: usize) -> Vec<Wavelength> {
    let mark = |(i, wave): (usize, &Wavelength)| Wavelength { primary: i == primary, ..*wave };
    waves.iter().enumerate().map(mark).collect()
}
