//! The printed result of `picture`.

use super::GroupMotion;
use crate::cli::output::ShortNumber;
use crate::picture::{
    DiffractionReport, ErrorShare, GhostReport, LossReport, OmittedEffect, PictureGate, SensorModel,
};
use crate::trace::Fates;
use serde::Serialize;
use std::fmt::{self, Display};

/// The printed result.
#[derive(Serialize)]
pub(super) struct PictureReport {
    pub(super) scene: String,
    pub(super) pixels: [usize; 2],
    pub(super) size: [f64; 2],
    pub(super) focus: Option<f64>,
    pub(super) focus_group: Option<GroupMotion>,
    pub(super) distance: Option<f64>,
    pub(super) way: &'static str,
    pub(super) device: Option<String>,
    pub(super) error: f64,
    pub(super) error_of_error: f64,
    pub(super) errors: Vec<ErrorShare>,
    pub(super) tolerance: f64,
    pub(super) reached: bool,
    /// The reason why the tolerance was not reached.
    pub(super) not_reached: Option<String>,
    pub(super) complete: bool,
    pub(super) white: f64,
    pub(super) mean: f64,
    pub(super) rays: usize,
    pub(super) rays_per_pixel: f64,
    pub(super) fates: Fates,
    pub(super) left_out: Vec<OmittedEffect>,
    pub(super) diffraction: Option<DiffractionReport>,
    pub(super) losses: Option<LossReport>,
    pub(super) ghosts: Option<GhostReport>,
    pub(super) ghosts_milliseconds: Option<f64>,
    pub(super) error_map: Option<ErrorMapReport>,
    pub(super) gates: Option<Vec<PictureGate>>,
    pub(super) sensor: Option<SensorReport>,
    pub(super) quick_milliseconds: Option<f64>,
    pub(super) milliseconds: f64,
    pub(super) out: Option<String>,
}

/// The map of the error.
#[derive(Serialize)]
pub(super) struct ErrorMapReport {
    pub(super) tiles: usize,
    pub(super) error: f64,
    pub(super) error_of_error: f64,
    pub(super) largest: f64,
}

/// The exposure of a sensor.
#[derive(Serialize)]
pub(super) struct SensorReport {
    pub(super) name: String,
    pub(super) source: String,
    #[serde(flatten)]
    pub(super) model: SensorModel,
    pub(super) bayer: bool,
    pub(super) luminance: f64,
    pub(super) seconds: f64,
    /// The side of a pixel of the picture in um, which the sensor's own may differ from.
    pub(super) pixel_um: f64,
    pub(super) white_photons: f64,
    /// At white, at mid grey and at a hundredth of white; `None` where pixels are saturated.
    pub(super) signal_to_noise: [Option<f64>; 3],
    pub(super) saturated: f64,
}

impl Display for SensorReport {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let ratio = |ratio: Option<f64>| {
            ratio.map_or_else(|| "none (saturated)".to_owned(), |ratio| format!("{ratio:.1}"))
        };
        let [white, grey, dark] = self.signal_to_noise.map(ratio);
        let seconds = ShortNumber(self.seconds);
        writeln!(f, "sensor {}: {seconds} s at {} cd/m2", self.name, self.luminance)?;
        let [photons, pixel] = [self.white_photons, self.pixel_um].map(ShortNumber);
        writeln!(f, "  {photons} photons at white on a pixel of {pixel} um")?;
        writeln!(f, "  signal to noise {white} at white, {grey} at mid grey, {dark} at 1 %")?;
        writeln!(f, "  {:.2} % saturated; {}", 100.0 * self.saturated, self.source)
    }
}

/// The reason why a picture with these errors does not keep its tolerance.
pub(super) fn not_reached(errors: &[ErrorShare], tolerance: f64, is_complete: bool) -> String {
    if !is_complete {
        return "the work was ended early".to_owned();
    }
    let whole = errors.iter().map(|share| share.used.powi(2)).sum::<f64>().sqrt();
    let largest = errors.iter().max_by(|a, b| a.used.total_cmp(&b.used));
    let Some(ErrorShare { effect, used, .. }) = largest.filter(|_| whole > tolerance) else {
        return "some parts met --max-samples before".to_owned();
    };
    let others = if *used > tolerance { " alone" } else { ", the largest part," };
    let remedy = if *effect == "sampling" { "; a larger --max-samples makes it less" } else { "" };
    format!("{effect}{others} takes {:.3} %{remedy}", 100.0 * used)
}

impl PictureReport {
    /// The part of the tolerance that each effect uses.
    fn write_errors(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        for ErrorShare { effect, allowed, used } in &self.errors {
            let (used, allowed) = (100.0 * used, 100.0 * allowed);
            write!(f, "  {effect} {used:.3} % (its share {allowed:.3} %)")?;
            match (*effect, self.quick_milliseconds) {
                ("sampling", Some(ms)) => {
                    let error = 100.0 * self.error_of_error;
                    let device = self.device.as_deref().unwrap_or("the processor");
                    write!(f, ": ± {error:.3} %, against the exact way on some tiles; ")?;
                    writeln!(f, "made in {ms:.0} ms on {device}")?;
                }
                _ => writeln!(f)?,
            }
        }
        let Some(found) = self.diffraction.as_ref().filter(|found| found.on) else { return Ok(()) };
        let DiffractionReport { change, left, cut, points, reason, .. } = found;
        let [change, left, cut] = [change, left, cut].map(|share| 100.0 * share);
        writeln!(
            f,
            "diffraction on: contrast changes by up to {change:.2} %, {left:.2} % are left, {cut:.2} % of \
             the light is cut off, at {points} points: {reason}"
        )?;
        self.write_without_aberrations(f)
    }

    /// The reason why the spread by diffraction is not that of the aberrated pupil, if it was tried.
    fn write_without_aberrations(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let refused = self.diffraction.as_ref().and_then(|found| found.without_aberrations);
        refused.map_or(Ok(()), |why| writeln!(f, "  aberrations are not in that spread: {why}"))
    }

    /// The losses, the ghosts and the map of the error.
    fn write_reflections(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let percent = |share: f64| 100.0 * share;
        if let Some(map) = &self.error_map {
            let (error, largest) = (percent(map.error), percent(map.largest));
            let spread = percent(map.error_of_error);
            let tiles = map.tiles;
            writeln!(
                f,
                "error of all {tiles} tiles {error:.3} ± {spread:.3} %, at most {largest:.2} %"
            )?;
        }
        if let Some(losses) = &self.losses {
            writeln!(f, "{}", losses_text(losses))?;
        }
        if let Some(GhostReport { on: true, change, error, pairs, rays, .. }) = &self.ghosts {
            let (change, error) = (percent(*change), percent(*error));
            let [followed, all] = pairs;
            writeln!(
                f,
                "ghosts on: up to {change:.2} ± {error:.2} % of mid grey, {followed} of {all} pairs, {rays} \
                 rays, {:.0} ms",
                self.ghosts_milliseconds.unwrap_or(0.0)
            )?;
        }
        Ok(())
    }
}

impl Display for PictureReport {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let place = |distance: Option<f64>| {
            distance.map_or("infinity".to_owned(), |mm| format!("{} mm", ShortNumber(mm)))
        };
        let ([width, height], [columns, rows]) = (self.size, self.pixels);
        writeln!(f, "{} at {}, focus at {}", self.scene, place(self.distance), place(self.focus))?;
        if let Some(GroupMotion { shift, breathing }) = self.focus_group {
            let (shift, breathing) = (ShortNumber(shift), 100.0 * breathing);
            writeln!(
                f,
                "focused by a group that moves {shift} mm; breathing: {breathing:+.2} % of the field of view"
            )?;
        }
        writeln!(f, "{columns} x {rows} pixels on {width:.3} x {height:.3} mm")?;
        let why = self.not_reached.as_ref();
        let reached = why.map_or_else(String::new, |why| format!(", not reached: {why}"));
        let percent = 100.0 * self.tolerance;
        let tolerance = ShortNumber(percent);
        let error = 100.0 * self.error;
        writeln!(f, "error {error:.3} % of mid grey (rms); asked for {tolerance} %{reached}")?;
        self.write_errors(f)?;
        writeln!(
            f,
            "on-axis image irradiance of a white card: {} of its radiance",
            ShortNumber(self.white)
        )?;
        let lost = 100.0 * (1.0 - self.fates.imaged as f64 / self.rays.max(1) as f64);
        let lost = match self.way {
            "exact" => format!(", {lost:.1} % lost at rims"),
            _ => " to measure the error".to_owned(),
        };
        writeln!(
            f,
            "{} rays ({:.0} a pixel{lost}), {:.0} ms",
            self.rays, self.rays_per_pixel, self.milliseconds
        )?;
        self.write_reflections(f)?;
        for OmittedEffect { effect, change, reason } in &self.left_out {
            let change = change.map(|c| format!("{:.2} %, ", 100.0 * c)).unwrap_or_default();
            writeln!(f, "left out: {effect} ({change}{reason})")?;
            if *effect == "diffraction" {
                self.write_without_aberrations(f)?;
            }
        }
        self.gates.iter().flatten().try_for_each(|gate| write_gate(f, gate))?;
        self.sensor.iter().try_for_each(|sensor| write!(f, "{sensor}"))?;
        self.out.as_ref().map_or(Ok(()), |out| writeln!(f, "saved as {out}"))
    }
}

/// The line of an effect.
fn write_gate(f: &mut fmt::Formatter<'_>, gate: &PictureGate) -> fmt::Result {
    let PictureGate { effect, on, number, unit, limit, reason, saved_milliseconds } = gate;
    let state = if *on { "on " } else { "off" };
    let number = number.map_or("unknown".to_owned(), |v| ShortNumber(v).to_string());
    let saved = saved_milliseconds.map(|ms| {
        let word = if *on { "would save" } else { "saves" };
        format!("; off {word} {ms:.1} ms, measured on some tiles")
    });
    let saved = saved.unwrap_or_default();
    writeln!(f, "{state} {effect}: {number} of {} {unit} ({reason}{saved})", ShortNumber(*limit))
}

/// The line of what surfaces and glasses take away.
fn losses_text(losses: &LossReport) -> String {
    let LossReport { coating, transmission, variation, absorbed, by_ray, .. } = losses;
    let how = if *by_ray { "each ray by itself" } else { "one share for each colour" };
    let [passed, varied, absorbed] = [transmission, variation, absorbed].map(|share| 100.0 * share);
    let unknown: Vec<String> = losses.unknown_absorption.iter().map(ToString::to_string).collect();
    let unknown = if unknown.is_empty() {
        String::new()
    } else {
        format!(" (unknown behind surface {}, taken as none)", unknown.join(", "))
    };
    format!(
        "losses on: {coating}, {passed:.1} % arrives on the axis, glass absorbs {absorbed:.2} \
         %{unknown}; it varies by {varied:.2} %: {how}"
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_missed_tolerance_has_its_reason() {
        let share = |effect, used| ErrorShare { effect, allowed: 0.007, used };
        let reason = |used: [f64; 2], is_complete| {
            not_reached(&[share("sampling", used[0]), share("ghosts", used[1])], 0.01, is_complete)
        };
        assert_eq!(reason([0.002, 0.03], true), "ghosts alone takes 3.000 %");
        assert_eq!(reason([0.002, 0.03], false), "the work was ended early");
        assert_eq!(reason([0.001, 0.002], true), "some parts met --max-samples before");
        let sampling =
            "sampling, the largest part, takes 0.900 %; a larger --max-samples makes it less";
        assert_eq!(reason([0.009, 0.006], true), sampling);
    }
}
