//! Optimizer.

use eframe::egui::Ui;

use super::Panel;
use crate::session::{Command, View};
use crate::studio::draw::Backing;

/// The panel.
#[derive(Debug, Default)]
pub struct Optimizer;

impl Optimizer {
    /// x
    pub const fn new(_backing: Backing) -> Self { Self }
}

impl Panel for Optimizer {
    fn title(&self) -> &'static str {
        "Optimizer"
    }

    fn ui(&mut self, ui: &mut Ui, view: &View, _wishes: &mut Vec<Command>) {
        ui.weak(&view.lens.name);
    }
}
