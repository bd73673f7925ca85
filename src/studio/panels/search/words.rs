//! A search in words: how it stands, how fast it is, what a lens is worth beside the design.

use eframe::egui::{Label, Ui};

use crate::optimize::pareto::Design;
use crate::search::element::pieces;
use crate::search::{Ended, Node, Offer, Over};
use crate::session::{Checkpoint, Ending, Exploration, Found, Judged, Standing, View};
use crate::studio::number;
use crate::studio::panels::optimizer::changes;
use crate::studio::wording::{self, counted_from_one};

fn short(value: f64) -> String {
    number::show_digits(value, 4)
}

/// A merit as it is read.
pub(super) fn merit(value: f64) -> String {
    if value.is_finite() { short(value) } else { "worthless".to_owned() }
}

/// So many of something.
fn counted(count: u64, what: &str) -> String {
    format!("{count} {what}{}", if count == 1 { "" } else { "s" })
}

/// How the search stands, and what it has come to.
pub(super) fn standing(run: &Exploration, pending: Option<Standing>) -> String {
    let why = match run.over {
        Some(Ending::Time) => ": its time is up",
        Some(Ending::Over(Over::Moves | Over::Gradients)) => ": its limit is reached",
        Some(Ending::Over(Over::Done)) => ": everything is tried",
        Some(Ending::Over(Over::Stuck)) => ": no mutation applies any more",
        Some(Ending::Over(Over::Stopped)) | None => "",
    };
    let standing = wording::standing(run.standing, pending);
    let (from, to) = (merit(run.start.merit), merit(run.best.merit));
    format!("{standing}{why}, merit {from} to {to}")
}

/// How much it has done, and how fast.
pub(super) fn speed(run: &Exploration) -> String {
    let done = &run.statistics;
    let rate = run.gradients as f64 / run.seconds;
    let rate = if rate.is_finite() && rate > 0.0 {
        format!(
            ", {} gradients/s ({} ms each)",
            number::show_digits(rate, 3),
            number::show_digits(1e3 / rate, 3)
        )
    } else {
        String::new()
    };
    format!(
        "{} moves, {} gradients of {} rays{rate}, {}",
        done.moves,
        done.gradients,
        run.rays,
        time(run.seconds)
    )
}

fn time(seconds: f64) -> String {
    if seconds < 120.0 {
        format!("{seconds:.1} s")
    } else if seconds < 7200.0 {
        format!("{:.1} min", seconds / 60.0)
    } else {
        format!("{:.1} h", seconds / 3600.0)
    }
}

/// That a lens breaks so many limits.
pub(super) fn broken(lens: &str, count: usize) -> String {
    let limits = if count == 1 { "limit" } else { "limits" };
    format!("The {lens} breaks {count} {limits}: what is exported has to keep them")
}

/// Where the search is saved; whether that failed.
pub(super) fn saved(checkpoint: &Checkpoint) -> (String, bool) {
    if let Some(why) = &checkpoint.failed {
        return (format!("Not saved: {why}"), true);
    }
    let name = checkpoint.path.as_ref().and_then(|path| path.file_name());
    match (name, checkpoint.moves) {
        (None, _) => ("Not saved: no file was chosen".to_owned(), false),
        (Some(name), None) => (format!("Will be saved to {}", name.to_string_lossy()), false),
        (Some(name), Some(moves)) => {
            (format!("Saved up to move {moves} to {}", name.to_string_lossy()), false)
        }
    }
}

/// What a lens is worth: a line a number.
pub(super) fn worth(found: &Found) -> String {
    let merit = merit(found.merit);
    let elements = found.elements;
    let design = found.judged.as_ref().map(|judged| &judged.found);
    match design {
        Some(Ok(Design { spot, light, .. })) => {
            let [spot, light] = [1e3 * spot, *light].map(|v| number::show_digits(v, 3));
            format!("{spot} µm, {light} mm²\n{elements} elements, {merit}")
        }
        Some(Err(why)) => format!("{elements} elements, {merit}\n{}", counted_from_one(why)),
        None => format!("{elements} elements, {merit}\nstill descends"),
    }
}

/// A lens beside the design: sharpness, light, elements.
pub(super) fn compared(ui: &mut Ui, view: &View, run: &Exploration, number: u64) {
    let Some(lens) = run.lens_of(number) else { return };
    let mut parts = Vec::new();
    let found = run.reservoir.iter().chain([&run.best, &run.start]);
    let found =
        found.filter(|found| found.number == number).find_map(|found| found.judged.as_ref());
    let pair = found.and_then(design).zip(view.explorations.here.as_deref().and_then(design));
    match pair {
        Some((new, own)) => {
            parts.push(change("RMS", 1e3 * own.spot, 1e3 * new.spot, "µm"));
            parts.push(change("light", own.light, new.light, "mm²"));
        }
        None => parts.extend(changes(view)),
    }
    let (new, own) = (pieces(lens), pieces(&view.lens));
    parts.push(format!("elements {own} to {new}"));
    let text = format!("Lens {number}: {}", parts.join(", "));
    ui.add(Label::new(text).wrap()).on_hover_text(
        "The design and this lens: root of the mean square radius of the spots, mean area of the \
         pupils, pieces of glass. The beam of both is limited by the stop",
    );
}

fn design(judged: &Judged) -> Option<&Design> {
    judged.found.as_ref().ok()
}

fn change(name: &str, old: f64, new: f64, unit: &str) -> String {
    let percent = number::show_digits(100.0 * (new / old - 1.0), 3);
    let sign = if new > old { "+" } else { "" };
    format!("{name} {} to {} {unit} ({sign}{percent} %)", short(old), short(new))
}

/// What a generation is: the mutation in words.
pub(super) fn what<P>(node: &Node<P>) -> String {
    let what = counted_from_one(&node.what);
    match node.kind {
        Some(kind) => format!("{}: {what}", kind.name()),
        None => what,
    }
}

/// What became of a generation: merits, moves, what ended it, whether it was kept.
pub(super) fn fate<P>(node: &Node<P>) -> String {
    let before = node.before.map(|before| format!("{} before, ", merit(before)));
    let merits = format!(
        "merit {}{} after the mutation, {} after the descent",
        before.unwrap_or_default(),
        merit(node.mutated),
        merit(node.descended)
    );
    let end = match node.ended {
        None => "it goes on",
        Some(Ended::Clock) => "the clock ended it",
        Some(Ended::Longest) => "it had its longest time",
        Some(Ended::Lost) => "it lost all light",
        Some(Ended::Mutated) => "a mutation was accepted",
        Some(Ended::Budget) => "its gradients were used up",
    };
    let kept = match node.offer {
        None => String::new(),
        Some(Offer::Entered) => "; kept".to_owned(),
        Some(Offer::Replaced(other)) => format!("; kept in place of lens {other}"),
        Some(Offer::Same(other)) => format!("; the same as lens {other}"),
        Some(Offer::BehindTwin(other)) => {
            format!("; not kept: lens {other} of the same pattern is no worse")
        }
        Some(Offer::BehindAll) => "; not kept: all that are kept are no worse".to_owned(),
        Some(Offer::Worthless) => "; not kept: it is worth nothing".to_owned(),
    };
    let (moves, gradients) = (counted(node.moves, "move"), counted(node.gradients, "gradient"));
    let chain = node.chain + 1;
    format!("{merits}\n{moves}, {gradients} in chain {chain}: {end}{kept}")
}
