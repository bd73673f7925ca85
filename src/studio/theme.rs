//! The look of the window: calm greys around the drawings, one blue accent, compact rows, the same
//! in dark and in light.

use egui::{
    Color32, Context, CornerRadius, FontId, Margin, Stroke, Style, TextStyle, Theme, Visuals, vec2,
};

/// The longest click in seconds: a button goes down in one frame and up in another, and on a slow machine
/// each takes a second.
const CLICK_SECONDS: f64 = 4.0;
/// The longest pause in seconds between two clicks that are one double click, as on most desktops.
const DOUBLE_CLICK_SECONDS: f64 = 0.5;

/// Dresses a window in both themes, and lets clicks count on a slow machine too.
///
/// A text cursor that blinks repaints the window twice a second for ever, and animations many
/// times after each click: neither moves.
pub fn apply(context: &Context) {
    context.options_mut(|options| {
        options.input_options.max_click_duration = CLICK_SECONDS;
        options.input_options.max_double_click_delay = DOUBLE_CLICK_SECONDS;
    });
    context.all_styles_mut(|style| {
        style.animation_time = 0.0;
        style.scroll_animation = egui::style::ScrollAnimation::none();
        set_spacing(style);
    });
    context.style_mut_of(Theme::Dark, |style| set_colors(&mut style.visuals, &ThemeColors::DARK));
    context.style_mut_of(Theme::Light, |style| set_colors(&mut style.visuals, &ThemeColors::LIGHT));
}

fn set_spacing(style: &mut Style) {
    style.spacing.item_spacing = vec2(6.0, 4.0);
    style.spacing.button_padding = vec2(7.0, 2.0);
    style.spacing.menu_margin = Margin::same(5);
    style.spacing.tooltip_width = 340.0;
    style.spacing.scroll.floating = true;
    style.text_styles.insert(TextStyle::Small, FontId::proportional(11.0));
    style.text_styles.insert(TextStyle::Heading, FontId::proportional(15.0));
    style.text_styles.insert(TextStyle::Monospace, FontId::monospace(12.0));
}

/// The greys of a theme and its accent; `selected` is the text on `selection`.
struct ThemeColors {
    panel: Color32,
    sunken: Color32,
    raised: Color32,
    hovered: Color32,
    line: Color32,
    text: Color32,
    strong: Color32,
    weak: Color32,
    accent: Color32,
    selection: Color32,
    selected: Color32,
    error: Color32,
    warning: Color32,
}

impl ThemeColors {
    const DARK: Self = Self {
        panel: Color32::from_rgb(30, 32, 37),
        sunken: Color32::from_rgb(20, 22, 26),
        raised: Color32::from_rgb(48, 52, 60),
        hovered: Color32::from_rgb(60, 65, 75),
        line: Color32::from_rgb(56, 60, 69),
        text: Color32::from_rgb(200, 204, 212),
        strong: Color32::from_rgb(240, 242, 246),
        weak: Color32::from_rgb(146, 152, 164),
        accent: Color32::from_rgb(98, 170, 255),
        selection: Color32::from_rgb(36, 76, 128),
        selected: Color32::from_rgb(206, 227, 255),
        error: Color32::from_rgb(255, 112, 104),
        warning: Color32::from_rgb(240, 178, 70),
    };

    const LIGHT: Self = Self {
        panel: Color32::from_rgb(246, 247, 249),
        sunken: Color32::from_rgb(255, 255, 255),
        raised: Color32::from_rgb(228, 231, 236),
        hovered: Color32::from_rgb(214, 219, 227),
        line: Color32::from_rgb(206, 210, 218),
        text: Color32::from_rgb(48, 53, 62),
        strong: Color32::from_rgb(16, 19, 25),
        weak: Color32::from_rgb(102, 109, 122),
        accent: Color32::from_rgb(20, 96, 200),
        selection: Color32::from_rgb(186, 214, 250),
        selected: Color32::from_rgb(10, 52, 120),
        error: Color32::from_rgb(190, 24, 20),
        warning: Color32::from_rgb(150, 88, 0),
    };
}

fn set_colors(visuals: &mut Visuals, greys: &ThemeColors) {
    visuals.panel_fill = greys.panel;
    visuals.window_fill = greys.panel;
    visuals.window_stroke = Stroke::new(1.0, greys.line);
    visuals.extreme_bg_color = greys.sunken;
    visuals.faint_bg_color = greys.raised.gamma_multiply(0.35);
    visuals.weak_text_color = Some(greys.weak);
    visuals.hyperlink_color = greys.accent;
    visuals.error_fg_color = greys.error;
    visuals.warn_fg_color = greys.warning;
    visuals.selection.bg_fill = greys.selection;
    visuals.selection.stroke = Stroke::new(1.0, greys.selected);
    visuals.text_cursor.blink = false;
    visuals.text_cursor.stroke = Stroke::new(1.5, greys.accent);
    set_widget_colors(visuals, greys);
}

fn set_widget_colors(visuals: &mut Visuals, greys: &ThemeColors) {
    let widgets = &mut visuals.widgets;
    let states = [
        (&mut widgets.noninteractive, greys.panel, greys.line, greys.text),
        (&mut widgets.inactive, greys.raised, Color32::TRANSPARENT, greys.text),
        (&mut widgets.hovered, greys.hovered, greys.line, greys.strong),
        (&mut widgets.active, greys.hovered, greys.accent, greys.strong),
        (&mut widgets.open, greys.hovered, greys.line, greys.strong),
    ];
    for (state, fill, line, text) in states {
        state.bg_fill = fill;
        state.weak_bg_fill = fill;
        state.bg_stroke = Stroke::new(1.0, line);
        state.fg_stroke = Stroke::new(1.0, text);
        state.corner_radius = CornerRadius::same(3);
        state.expansion = 0.0;
    }
}
