//! A lens from a specification: what is asked for, the design as it runs, and the lenses at the end.
//!
//! What is not stated is filled and shown; what no lens can do is refused before any search. The design
//! that is open does not change: a lens that is found opens as a document of its own.

mod form;
mod results;
mod text;

use egui::{CollapsingHeader, Context, ScrollArea, Ui};

use super::Panel;
use super::widgets::{ActionButton, action_buttons, main_button};
use crate::session::{RunStatus, SessionView, SpecifiedDesignCommand, SpecifiedDesignView};
use crate::studio::actions::Actions;
use crate::studio::text::capitalize;
use crate::studio::thumbnails::Thumbnails;
use form::{Completed, SpecificationForm};

/// The panel.
#[derive(Debug, Default)]
pub struct SpecificationPanel {
    form: SpecificationForm,
    thumbnails: Thumbnails,
}

impl Panel for SpecificationPanel {
    fn title(&self) -> &'static str {
        "New from specification"
    }

    fn ui(&mut self, ui: &mut Ui, view: &SessionView, actions: &mut Actions) {
        let scroll = ScrollArea::vertical().id_salt("specification").auto_shrink([false, false]);
        scroll.show(ui, |ui| self.contents(ui, view, actions));
    }

    fn is_typing(&self, context: &Context) -> bool {
        form::is_typing(context)
    }
}

impl SpecificationPanel {
    fn contents(&mut self, ui: &mut Ui, view: &SessionView, actions: &mut Actions) {
        let design = &view.specified_design;
        let completed = self.form.complete();
        self.buttons(ui, design, &completed, actions);
        summary(ui, &completed);
        unfinished(ui, design, actions);
        if let Some(why) = &design.run.error {
            ui.colored_label(ui.visuals().error_fg_color, capitalize(why));
        }
        self.results(ui, view, actions);
        let is_active = design.run.is_active();
        CollapsingHeader::new("Specification").default_open(true).show(ui, |ui| {
            ui.add_enabled_ui(!is_active, |ui| self.form.ui(ui, &completed));
        });
    }

    fn buttons(
        &self,
        ui: &mut Ui,
        design: &SpecifiedDesignView,
        completed: &Completed,
        actions: &mut Actions,
    ) {
        let run = &design.run;
        let is_active = run.is_active();
        ui.horizontal(|ui| {
            ui.spacing_mut().item_spacing.x = 4.0;
            let reason = if is_active {
                "A design is already running"
            } else {
                "No lens can do what is asked for"
            };
            let ready = !is_active && completed.is_ok();
            let hint = "Design a lens in the background; the open design does not change";
            if main_button(ui, "Design a lens", ready, hint, reason) {
                let request = Box::new(self.form.request());
                actions.push(SpecifiedDesignCommand::Start(request));
            }
            action_buttons(ui, run_buttons(design), actions);
        });
    }

    /// The design as it runs, or the lenses at its end.
    fn results(&mut self, ui: &mut Ui, view: &SessionView, actions: &mut Actions) {
        let run = &view.specified_design.run;
        match run.snapshot.as_deref() {
            None if run.is_active() => drop(ui.weak("Preparing…")),
            None => {}
            Some(design) if !design.lenses.is_empty() => {
                results::show_lenses(ui, view, design, &mut self.thumbnails, actions);
            }
            Some(design) if run.is_active() => {
                results::show_progress(ui, view, design, &mut self.thumbnails);
            }
            Some(_) => drop(ui.weak("Stopped before there was a lens.")),
        }
    }
}

/// The specification in one line, or the reason why no lens is designed to it. There is always one label: a number
/// that is being typed keeps the cursor while it is refused for a moment.
fn summary(ui: &mut Ui, completed: &Completed) {
    let (summary, color) = match completed {
        Ok((asked, _)) => (text::summary_text(asked), ui.visuals().weak_text_color()),
        Err(why) => (capitalize(&why.to_string()), ui.visuals().warn_fg_color),
    };
    ui.colored_label(color, summary);
}

fn run_buttons(design: &SpecifiedDesignView) -> [ActionButton<'static>; 3] {
    let run = &design.run;
    let is_active = run.is_active();
    let pause = if run.status == RunStatus::Paused {
        ActionButton::new("Resume", true, SpecifiedDesignCommand::Resume).hint("Resume the design")
    } else {
        let hint = "Pause the design after its current round";
        ActionButton::new("Pause", is_active, SpecifiedDesignCommand::Pause).hint(hint)
    };
    let shown = run.snapshot.is_some() || run.error.is_some();
    [
        pause,
        ActionButton::new("Stop", is_active, SpecifiedDesignCommand::Stop)
            .hint("End the search and finish the best lens so far; it can be resumed later"),
        ActionButton::new("Clear", shown, SpecifiedDesignCommand::Clear)
            .hint("Dismiss the design and its lenses"),
    ]
}

/// Offers a design that can be resumed.
fn unfinished(ui: &mut Ui, design: &SpecifiedDesignView, actions: &mut Actions) {
    if design.unfinished.is_none() || design.run.is_active() {
        return;
    }
    ui.horizontal_wrapped(|ui| {
        ui.label("There is a design to go on with.");
        let buttons = [
            ActionButton::new("Resume the design", true, SpecifiedDesignCommand::ResumeUnfinished)
                .hint("From its last whole round; if its time was used up, finish its lenses"),
            ActionButton::new("Dismiss it", true, SpecifiedDesignCommand::DismissUnfinished)
                .hint("Remove its file"),
        ];
        action_buttons(ui, buttons, actions);
    });
}
