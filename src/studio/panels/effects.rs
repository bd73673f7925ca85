//! Effects.

use eframe::egui::Ui;

use super::Panel;
use crate::session::{Command, View};
use crate::studio::draw::Backing;

/// The panel.
#[derive(Debug, Default)]
pub struct Effects;

impl Effects {
    /// x
    pub const fn new(_backing: Backing) -> Self { Self }
}

impl Panel for Effects {
    fn title(&self) -> &'static str {
        "Effects"
    }

    fn ui(&mut self, ui: &mut Ui, view: &View, _wishes: &mut Vec<Command>) {
        ui.weak(&view.lens.name);
    }
}
