//! The manual: short pages of Markdown in a window of its own, with a search over their words.

use egui::{Align2, Context, Id, ScrollArea, TextEdit, Ui, Window, vec2};
use egui_commonmark::{CommonMarkCache, CommonMarkViewer};

/// The pages in their order; the title of each is its first line.
const PAGES: [&str; 10] = [
    include_str!("../../assets/manual/begin.md"),
    include_str!("../../assets/manual/system.md"),
    include_str!("../../assets/manual/table.md"),
    include_str!("../../assets/manual/elements.md"),
    include_str!("../../assets/manual/sculpt.md"),
    include_str!("../../assets/manual/quality.md"),
    include_str!("../../assets/manual/improve.md"),
    include_str!("../../assets/manual/search.md"),
    include_str!("../../assets/manual/history.md"),
    include_str!("../../assets/manual/files.md"),
];

/// The window of the manual.
#[derive(Default)]
pub(super) struct ManualWindow {
    is_open: bool,
    /// True if the search gets the cursor, since the window has just been opened.
    enters: bool,
    page: usize,
    words: String,
    cache: CommonMarkCache,
}

impl std::fmt::Debug for ManualWindow {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("ManualWindow").field("page", &self.page).finish_non_exhaustive()
    }
}

impl ManualWindow {
    pub(super) const fn open(&mut self) {
        (self.is_open, self.enters) = (true, true);
    }

    pub(super) const fn close(&mut self) {
        self.is_open = false;
    }

    /// Shows the window if it is open.
    pub(super) fn ui(&mut self, context: &Context) {
        let mut open = self.is_open;
        let window = Window::new("Manual")
            .id(Id::unique("manual"))
            .open(&mut open)
            .collapsible(false)
            .pivot(Align2::CENTER_CENTER)
            .default_pos(context.content_rect().center())
            .default_size(vec2(760.0, 500.0));
        window.show(context, |ui| {
            ui.horizontal_top(|ui| {
                ui.vertical(|ui| {
                    ui.set_width(190.0);
                    self.contents(ui);
                });
                ui.separator();
                ui.vertical(|ui| self.text(ui));
            });
        });
        self.is_open = open;
    }

    /// The titles of the pages that have the words of the search.
    fn contents(&mut self, ui: &mut Ui) {
        let line = TextEdit::singleline(&mut self.words)
            .hint_text("Search the manual")
            .desired_width(f32::INFINITY);
        let field = ui.add(line).accessible_name("Search the manual");
        if std::mem::take(&mut self.enters) {
            field.request_focus();
        }
        let found: Vec<usize> = pages_with(&self.words).collect();
        if field.changed() && !found.contains(&self.page) {
            self.page = found.first().copied().unwrap_or(self.page);
        }
        ui.add_space(4.0);
        for &page in &found {
            ui.selectable_value(&mut self.page, page, title(PAGES[page]));
        }
        if found.is_empty() {
            ui.weak("No page has these words.");
        }
    }

    fn text(&mut self, ui: &mut Ui) {
        ScrollArea::vertical().id_salt(self.page).auto_shrink([false, false]).show(ui, |ui| {
            CommonMarkViewer::new().show(ui, &mut self.cache, PAGES[self.page]);
        });
    }
}

fn title(page: &str) -> &str {
    page.lines().next().unwrap_or_default().trim_start_matches("# ")
}

/// The indices of the pages that have every word of a text.
fn pages_with(words: &str) -> impl Iterator<Item = usize> {
    let words: Vec<String> = words.split_whitespace().map(str::to_lowercase).collect();
    let fits = move |page: &usize| {
        let text = PAGES[*page].to_lowercase();
        words.iter().all(|word| text.contains(word))
    };
    (0..PAGES.len()).filter(fits)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_page_is_found_by_its_words() {
        let titles =
            |words: &str| pages_with(words).map(|page| title(PAGES[page])).collect::<Vec<_>>();
        assert_eq!(titles("").len(), PAGES.len());
        assert_eq!(titles("cemented Split"), ["Whole elements"]);
        assert!(titles("zmx").contains(&"Files"));
        assert_eq!(titles("temperature chain"), ["Search over structure"]);
        assert_eq!(titles("rewind"), ["History"]);
        assert!(titles("no such word").is_empty());
    }
}
