//! The numbers of lenses that are made: their spots, their yield, their worst one.

use egui::{Grid, RichText, Ui};

use crate::lens::Lens;
use crate::session::{AsBuiltLens, Command};
use crate::studio::actions::Actions;
use crate::studio::number;
use crate::studio::panels::{RMS_OVER_FIELDS, RMS_OVER_FIELDS_HINT};
use crate::tolerance::{AsBuiltSpot, ContrastSummary};

/// Errors, rays, real lenses, time.
pub(super) fn facts(ui: &mut Ui, made: &AsBuiltLens, ms: f64) {
    let (errors, rays, samples) = (made.shares.len(), made.rays, made.analysis.samples);
    let by = if samples == 0 {
        "by derivatives alone".to_owned()
    } else {
        format!("corrected by {samples} real lenses")
    };
    let text = format!("{errors} errors, {rays} rays, {by}, {ms:.0} ms");
    let hover = format!(
        "Each spot is sampled to {:.1e} of its radius. The mean square spot is a quadratic form in \
         the errors; real lenses with random errors tell how far it is to be trusted. Moving pupils: \
         {}, {}",
        made.sampling_error,
        if made.analysis.pupils.moves { "on" } else { "off" },
        made.analysis.pupils.reason
    );
    ui.label(RichText::new(text).small().weak()).on_hover_text(hover);
    let lost = made.analysis.lost;
    if lost > 0 {
        let text = format!("{lost} of {samples} real lenses lose rays and count as bad");
        ui.label(RichText::new(text).small().color(ui.visuals().warn_fg_color));
    }
    for text in &made.warnings {
        ui.label(RichText::new(text).small().color(ui.visuals().warn_fg_color));
    }
    let apart = made.analysis.spots.iter().any(|spot| samples > 0 && !spot.form_agrees);
    if apart {
        let text = "the quadratic form differs from real lenses; the corrected numbers count";
        ui.label(RichText::new(text).small().color(ui.visuals().warn_fg_color));
    }
}

/// The spots of lenses that are made, at the fixed focus and refocused.
pub(super) fn summary(ui: &mut Ui, made: &AsBuiltLens) {
    let spots = &made.analysis.spots;
    let um = |mm: f64| format!("{} µm", number::format_digits(1e3 * mm, 3));
    let mut rows: Vec<(String, [String; 2])> = vec![
        ("As designed".into(), spots.each_ref().map(|s| um(s.nominal_rms))),
        ("Mean of the lenses".into(), spots.each_ref().map(|s| with_error(s.mean_rms))),
    ];
    for (i, quantile) in spots[0].quantiles.iter().enumerate() {
        let name = format!("{:.0} % of the lenses, at most", 100.0 * quantile.share);
        let of = |s: &AsBuiltSpot| with_error([s.quantiles[i].corrected, s.quantiles[i].error]);
        rows.push((name, spots.each_ref().map(of)));
    }
    if spots.iter().all(|spot| spot.good.is_some()) {
        rows.push(("Good lenses".into(), spots.each_ref().map(good_share)));
    }
    if let Some([designed, expected]) = made.wavefront {
        let waves = |rms: f64| format!("{} λ", number::format_digits(rms, 3));
        rows.push(("Wavefront as designed".into(), designed.map(waves)));
        rows.push(("Wavefront of the lenses".into(), expected.map(waves)));
        if let Some(real) = made.real_wavefront {
            let by_rays =
                [0, 1].map(|i| format!("{} λ", number::with_error(real.mean[i], real.error[i])));
            rows.push((format!("The same of {} lenses by rays", real.lenses), by_rays));
        }
    }
    if let Some(Ok(contrast)) = &made.contrast {
        rows.extend(contrast_rows(contrast));
    }
    Grid::new("spots as made").num_columns(3).striped(true).show(ui, |ui| {
        ui.weak(RMS_OVER_FIELDS).on_hover_text(RMS_OVER_FIELDS_HINT);
        ui.weak("fixed focus");
        ui.weak("refocused");
        ui.end_row();
        for (name, values) in rows {
            ui.label(name);
            for value in values {
                ui.label(value);
            }
            ui.end_row();
        }
    });
    if let Some(Err(why)) = &made.contrast {
        ui.label(RichText::new(format!("No MTF: {why}")).weak());
    }
}

/// The contrast of the lens as designed and as made.
fn contrast_rows(contrast: &ContrastSummary) -> Vec<(String, [String; 2])> {
    let nu = number::format_digits(contrast.frequency, 3);
    let of = |value: f64| number::with_error(value, contrast.sampling_error);
    let expected = contrast.expected.map(|expected| {
        ("MTF expected as made".to_owned(), expected.map(|value| number::format_digits(value, 3)))
    });
    let real = contrast.real;
    let by_rays = [0, 1].map(|i| number::with_error(real.mean[i], real.error[i]));
    let designed = (format!("MTF at {nu} cycles/mm as designed"), contrast.nominal.map(of));
    let real = (format!("The same of {} lenses by rays", real.lenses), by_rays);
    std::iter::once(designed).chain(expected).chain([real]).collect()
}

fn with_error([value, error]: [f64; 2]) -> String {
    format!("{} µm", number::with_error(1e3 * value, 1e3 * error))
}

/// The share of good lenses with the interval of the real ones.
fn good_share(spot: &AsBuiltSpot) -> String {
    let Some(good) = spot.good else { return String::new() };
    let [low, high] = good.interval.map(|share| 100.0 * share);
    let share = 100.0 * good.corrected;
    if high > low && high - low < 100.0 {
        format!("{share:.1} % ({low:.0} to {high:.0} %)")
    } else {
        format!("{share:.1} %")
    }
}

/// The lens with the largest spot, which a click opens beside the design.
pub(super) fn worst_lens(ui: &mut Ui, made: &AsBuiltLens, actions: &mut Actions) {
    let Some(worst) = &made.worst else { return };
    ui.horizontal_wrapped(|ui| match worst {
        Ok(worst) => {
            let rms = number::format_digits(1e3 * worst.opened_rms.unwrap_or(worst.stated_rms), 3);
            let (number, samples) = (worst.number + 1, made.analysis.samples);
            ui.label(format!("Worst lens: {rms} µm refocused, number {number} of {samples}"));
            let hint = "Shows it as a candidate: its errors as numbers and places of its surfaces, its \
                        compensators adjusted, its fields those on both sides of the axis. Other panels \
                        show this number for it";
            if ui.button("Open the worst lens").on_hover_text(hint).clicked() {
                let lens: Box<Lens> = Box::new(worst.lens.clone());
                actions.push(Command::Preview(Some(lens)));
            }
        }
        Err(why) => {
            ui.label(RichText::new(format!("The worst lens cannot be opened: {why}")).weak());
        }
    });
}
