//! Everything about a field in words and numbers, each with its rays, its error and its time.

use egui::{Label, RichText, Ui};

use crate::grin_design::{
    GrinField, LightGoal, RayCounts, RayPath, RayPaths, SpatialAxis, ViewReport,
};
use crate::math::Vec3;
use crate::picture::ProjectedView;
use crate::session::{GrinAnalysis, GrinDocument, GrinRun, RunStatus, SessionView, Slice};
use crate::studio::number::format_digits;
use crate::studio::text::{self, counted};

/// The status of the optimization, in one line.
pub(super) fn status_text(run: &GrinRun, status: RunStatus) -> String {
    let Some(task) = &run.document.task else { return volume_text(run) };
    let Some(progress) = &run.progress else {
        let levels: Vec<String> = task.levels.iter().map(|level| level.nodes.to_string()).collect();
        let steps: usize = task.levels.iter().map(|level| level.steps).sum();
        return format!("Ready: at most {steps} steps, {} nodes", levels.join(", "));
    };
    format!(
        "{}: step {} of {}, level {} of {} ({} nodes), loss {}{}",
        text::status_text(status),
        progress.step,
        progress.max_steps,
        progress.level + 1,
        task.levels.len(),
        progress.nodes,
        format_small(progress.best),
        loss_unit(run),
    )
}

fn volume_text(run: &GrinRun) -> String {
    let GrinField::Trilinear(field) = &*run.field else { return "A volume".to_owned() };
    let [x, y, z] = field.grid().counts();
    let h = field.grid().spacing();
    let spacing = [h.x, h.y, h.z].map(|h| format_digits(h, 4)).join(" × ");
    format!("A volume of {x} × {y} × {z} nodes, {spacing} mm apart; there is nothing to optimize")
}

/// The unit of the loss: a mean square of lengths, unless an image counts.
fn loss_unit(run: &GrinRun) -> &'static str {
    let task = run.document.task.as_ref();
    let counted = task.into_iter().flat_map(|task| &task.views).filter(|view| view.weight > 0.0);
    let is_length = |goal: &LightGoal| !goal.is_image();
    if counted.into_iter().all(|view| is_length(&view.goal)) { " mm²" } else { "" }
}

/// The numbers of all light.
pub(super) fn light_page(ui: &mut Ui, view: &SessionView, run: &GrinRun) {
    let analysis = view.grin.analysis.as_deref();
    match analysis {
        Some(Ok(analysis)) => view_rows(ui, run, analysis),
        Some(Err(why)) => {
            ui.colored_label(ui.visuals().error_fg_color, why);
        }
        None => {
            ui.weak("Tracing all views…");
        }
    }
    ui.add_space(4.0);
    let slice = view.grin.slice.as_deref().and_then(|slice| slice.as_ref().ok());
    if let Some(difference) = slice.and_then(|slice| slice.difference) {
        row(
            ui,
            "Exact field",
            &format!(
                "relative error {:.2e}; {:.2e} without an offset of {:.1e} in the squared index",
                difference.relative, difference.without_offset, difference.offset
            ),
            "RMS difference over the domain. Rays determine the squared index up to an additive \
             constant, which only the boundary fixes",
        );
    }
    cost_rows(ui, run);
    if let Some(Slice { ms: [raster, rays, exact], .. }) = slice {
        let exact = if run.document.has_reference() {
            format!(", exact field {}", format_digits(*exact, 2))
        } else {
            String::new()
        };
        row(
            ui,
            "Time",
            &format!("slice {raster:.1} ms, its rays {rays:.1}{exact}"),
            "In the background, after every change of the field or of the slice",
        );
    }
}

/// The cost of the optimization.
fn cost_rows(ui: &mut Ui, run: &GrinRun) {
    let Some(progress) = &run.progress else { return };
    if run.rays > 0 {
        let each = 1e6 * run.seconds / run.rays as f64;
        row(
            ui,
            "Optimization",
            &format!(
                "{} rays forward and back in {:.1} s, {} µs per ray in total",
                count_text(run.rays),
                run.seconds,
                format_digits(each, 3)
            ),
            "Rays traced for the loss and its gradient; the time of all steps without pauses",
        );
    }
    let total = progress.counts.fates.total();
    if total > 0 {
        row(
            ui,
            "Last step",
            &format!("{total} rays, {}", exclusions_text(progress.counts)),
            "Outcome of the rays of the last step",
        );
    }
}

/// The results of every view, with their accuracy.
fn view_rows(ui: &mut Ui, run: &GrinRun, analysis: &GrinAnalysis) {
    let names = run.document.task.iter().flat_map(|task| &task.views);
    for (view, seen) in names.zip(&analysis.views.value) {
        ui.horizontal_wrapped(|ui| {
            ui.strong(&view.name);
            ui.label(result_text(seen));
            if view.weight == 0.0 {
                ui.weak("weight 0");
            }
        });
        let counts = seen.result.counts;
        let text = format!("{} rays, {}", counts.fates.total(), exclusions_text(counts));
        ui.label(RichText::new(text).small());
        ui.add(Label::new(RichText::new(tracing_text(seen)).small().weak()).wrap());
        ui.add_space(3.0);
    }
    let text = format!("All light in {:.0} ms", analysis.views.ms);
    ui.label(RichText::new(text).small().weak()).on_hover_text(
        "Evaluated with the same rays each time; about once a second during an optimization",
    );
}

/// Spot or quality of a view.
fn result_text(seen: &ViewReport) -> String {
    match seen.result.psnr {
        Some(quality) => format!("image {quality:.1} dB PSNR"),
        None if seen.result.spot.is_finite() => {
            format!("RMS miss {} mm", format_small(seen.result.spot))
        }
        None => "no valid ray".to_owned(),
    }
}

/// The method by which the rays of a view are traced, and its error.
fn tracing_text(seen: &ViewReport) -> String {
    let how = seen.integrator.title();
    let how = format!("{how}, step {} mm", format_small(seen.step));
    match seen.error {
        Some(error) => {
            format!("{how}; halving it moves {} exits by at most {error:.1e} mm", seen.sample)
        }
        None => format!("{how}; error unknown: no ray of the sample arrives"),
    }
}

/// A view's rendered image in one line, each number with its error by sampling.
pub(super) fn picture_text(name: &str, picture: &ProjectedView) -> String {
    let light = &picture.light;
    let lost = count_text((light.rays - light.fates.arrived_count()) as u64);
    let rays = format!("{} rays, {lost} lost", count_text(light.rays as u64));
    let Some(error) = light.rms_error() else {
        return format!("{name}: no light on the screen, {rays}");
    };
    let [quality, share] = [picture.quality(), light.light()];
    format!(
        "{name}: {:.2} ± {:.2} dB PSNR, {:.2} ± {:.2} % of the light, pixels ± {:.1} % of the mean, {rays}",
        quality.value,
        quality.error,
        100.0 * share.value,
        100.0 * share.error,
        100.0 * error
    )
}

/// A view's image in one line.
pub(super) fn image_text(name: &str, seen: &ViewReport) -> String {
    let counts = seen.result.counts;
    let quality = seen.result.psnr.unwrap_or(f64::NAN);
    format!(
        "{name}: {quality:.1} dB PSNR, {} rays, {}",
        counts.fates.total(),
        exclusions_text(counts)
    )
}

/// Rays that do not count, by reason.
fn exclusions_text(counts: RayCounts) -> String {
    let reasons: Vec<String> =
        counts.excluded().map(|(reason, count)| format!("{count} {}", plain(reason))).collect();
    if reasons.is_empty() {
        "none excluded".to_owned()
    } else {
        format!("excluded: {}", reasons.join(", "))
    }
}

/// A reason without underscores.
fn plain(reason: &str) -> String {
    reason.replace('_', " ")
}

/// A large count in groups.
fn count_text(number: u64) -> String {
    if number < 100_000 { number.to_string() } else { format!("{:.2} M", 1e-6 * number as f64) }
}

fn row(ui: &mut Ui, name: &str, text: &str, hint: &str) {
    ui.horizontal_wrapped(|ui| {
        ui.label(RichText::new(name).small().weak());
        ui.label(RichText::new(text).small()).on_hover_text(hint);
    });
}

/// The losses in one line.
pub(super) fn losses_text(run: &GrinRun) -> String {
    let Some(progress) = &run.progress else { return String::new() };
    let digits = |loss: f64| if loss.is_finite() { format_small(loss) } else { "-".to_owned() };
    format!(
        "Loss {}{} at the last step, best {}",
        digits(progress.loss),
        loss_unit(run),
        digits(progress.best)
    )
}

/// The title of a profile.
pub(super) fn profile_text(slice: &Slice) -> String {
    let plane = slice.settings.plane;
    if slice.profile.along == "r" {
        return "Index along the radius".to_owned();
    }
    let [across, above] = plane.axis.across();
    let middle = slice.document.middle(above);
    format!(
        "Index along {}, at {} = {} mm and {} = {} mm",
        across.name(),
        plane.axis.name(),
        format_digits(plane.depth, 4),
        above.name(),
        format_digits(middle, 4)
    )
}

/// The accessible name of a slice.
pub(super) fn slice_name(slice: &Slice) -> String {
    let plane = slice.settings.plane;
    let (name, depth) = (plane.axis.name(), format_digits(plane.depth, 4));
    format!(
        "Slice of {} at {name} = {depth} mm: {}",
        slice.document.name,
        slice.settings.quantity.name()
    )
}

/// The range of the colours.
pub(super) fn color_scale_text(slice: &Slice) -> String {
    let [low, high] = slice.range.map(|value| format_digits(value, 5));
    let name = slice.settings.quantity.name();
    if slice.range[0] < slice.range[1] {
        format!("Colours: {name}, {low} to {high} in the whole field")
    } else {
        format!("Colours: {name}, {low} everywhere")
    }
}

/// The quantity of the slice, and the spacing of its contours.
pub(super) fn slice_text(slice: &Slice) -> String {
    let quantity = slice.settings.quantity.name();
    let [right, up] = slice.axes().map(SpatialAxis::name);
    let contours = if slice.contours.is_empty() {
        "no contours".to_owned()
    } else {
        format!("contours {} apart", format_digits(slice.spacing, 2))
    };
    format!("{quantity}; {contours}; {right} right, {up} up")
}

/// The rays of a view that are drawn.
pub(super) fn rays_text(name: &str, bundle: &RayPaths) -> String {
    format!("{name}: {}", counted(bundle.paths.len() as u64, "ray"))
}

/// The largest distance of the rays from the slice.
pub(super) fn distance_text(bundle: &RayPaths) -> String {
    format!(
        "Projected onto the slice; straight rays would stay within {} mm of it",
        format_digits(bundle.distance, 2)
    )
}

/// Those of them that do not count, by reason.
pub(super) fn excluded_text(bundle: &RayPaths) -> Option<String> {
    let mut reasons: Vec<(&str, usize)> = Vec::new();
    for reason in bundle.paths.iter().filter_map(RayPath::excluded) {
        match reasons.iter_mut().find(|(known, _)| *known == reason) {
            Some((_, count)) => *count += 1,
            None => reasons.push((reason, 1)),
        }
    }
    let reasons: Vec<String> =
        reasons.into_iter().map(|(reason, count)| format!("{count} {}", plain(reason))).collect();
    (!reasons.is_empty()).then(|| format!("excluded: {}", reasons.join(", ")))
}

/// Place and field at a point.
pub(super) fn probe_text(subject: &GrinDocument, medium: &GrinField, point: Vec3<f64>) -> String {
    let place = [point.x, point.y, point.z].map(|v| format_digits(v, 4));
    let place = format!("x {}  y {}  z {} mm", place[0], place[1], place[2]);
    if !subject.contains(point) {
        return format!("{place}\noutside the field");
    }
    let sample = medium.index_field().sample(point);
    let g = sample.gradient;
    let slope = format_digits(g.dot(g).sqrt(), 4);
    let parts = [g.x, g.y, g.z].map(|part| format_digits(part, 3)).join(", ");
    format!("{place}\nindex {:.6}\nslope {slope} /mm ({parts})", sample.index)
}

/// The place that was clicked, live while the field forms.
pub(super) fn pinned_line(ui: &mut Ui, run: &GrinRun, pinned: &mut Option<Vec3<f64>>) {
    ui.horizontal(|ui| {
        let Some(point) = *pinned else {
            let hint = "Hover to read the field; click to pin a point";
            ui.label(RichText::new(hint).small().weak());
            return;
        };
        let text = probe_text(&run.document, &run.field, point).replace('\n', "   ");
        if ui.small_button("Unpin").clicked() {
            *pinned = None;
        }
        ui.add(Label::new(RichText::new(&text).small()).truncate()).on_hover_text(&text);
    });
}

/// A number that may be very small.
fn format_small(value: f64) -> String {
    if value != 0.0 && value.abs() < 1e-3 {
        format!("{value:.2e}")
    } else {
        format_digits(value, 3)
    }
}
