//! The colours of drawings: legible on dark and on light, and distinguishable for the colour-blind.

use egui::Color32;

use super::draw::Rgba;

/// Colours of fields in their order: blue, green, red, then the rest of the set of Okabe and Ito
/// (2008), which people with every kind of colour blindness can distinguish.
const FIELDS_DARK: [[u8; 3]; 7] = [
    [86, 180, 233],
    [0, 190, 130],
    [240, 110, 60],
    [240, 200, 60],
    [225, 140, 190],
    [150, 150, 240],
    [170, 170, 170],
];
const FIELDS_LIGHT: [[u8; 3]; 7] = [
    [0, 90, 180],
    [0, 130, 90],
    [200, 70, 0],
    [180, 130, 0],
    [180, 80, 140],
    [90, 70, 190],
    [90, 90, 90],
];

/// Colours of the limits of a pupil, in the order in which limits appear: after the bright set of
/// Paul Tol (2021), distinguishable for people with every kind of colour blindness. None is the
/// colour of a field.
const LIMITS_DARK: [[u8; 3]; 8] = [
    [238, 119, 51],
    [51, 187, 238],
    [238, 90, 150],
    [190, 200, 60],
    [0, 175, 155],
    [190, 140, 250],
    [220, 190, 150],
    [120, 150, 190],
];
const LIMITS_LIGHT: [[u8; 3]; 8] = [
    [205, 85, 10],
    [0, 120, 190],
    [200, 30, 100],
    [120, 125, 0],
    [0, 125, 110],
    [125, 70, 200],
    [130, 90, 50],
    [60, 85, 125],
];

/// The colours of the drawings.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Palette {
    dark: bool,
    /// Behind everything.
    pub background: Rgba,
    /// Inside a lens; a denser glass is drawn less transparent.
    pub glass: Rgba,
    /// The same for glass that the design does not have.
    pub added_glass: Rgba,
    /// The rim of a lens.
    pub outline: Rgba,
    /// A mirror.
    pub mirror: Rgba,
    /// The stop and the image plane.
    pub strong: Rgba,
    /// The axis, and surfaces between equal media.
    pub faint: Rgba,
    /// The end of a lost ray.
    pub lost_ray: Rgba,
    /// A change for the better.
    pub better: Rgba,
    /// A change for the worse.
    pub worse: Rgba,
}

impl Palette {
    /// The colours that go with the window's theme.
    pub fn for_visuals(visuals: &egui::Visuals) -> Self {
        if visuals.dark_mode { Self::DARK } else { Self::LIGHT }
    }

    /// Light on dark.
    pub const DARK: Self = Self {
        dark: true,
        background: [22, 24, 28, 255],
        glass: [110, 165, 225, 70],
        added_glass: [250, 190, 80, 95],
        outline: [160, 190, 220, 255],
        mirror: [120, 210, 140, 255],
        strong: [235, 235, 235, 255],
        faint: [120, 125, 135, 130],
        lost_ray: [255, 90, 90, 255],
        better: [51, 187, 238, 255],
        worse: [238, 119, 51, 255],
    };

    /// Dark on light.
    pub const LIGHT: Self = Self {
        dark: false,
        background: [252, 252, 252, 255],
        glass: [90, 150, 215, 60],
        added_glass: [235, 140, 0, 80],
        outline: [60, 95, 135, 255],
        mirror: [30, 130, 60, 255],
        strong: [25, 25, 25, 255],
        faint: [110, 115, 125, 130],
        lost_ray: [205, 20, 20, 255],
        better: [0, 105, 180, 255],
        worse: [200, 75, 0, 255],
    };

    /// The colour of a field by its place in the list.
    pub fn field(&self, index: usize) -> Rgba {
        let set = if self.dark { FIELDS_DARK } else { FIELDS_LIGHT };
        let [r, g, b] = set[index % set.len()];
        [r, g, b, 255]
    }

    /// The colour of a limit of a pupil, by the order in which limits appear.
    pub fn limit(&self, index: usize) -> Rgba {
        let set = if self.dark { LIMITS_DARK } else { LIMITS_LIGHT };
        let [r, g, b] = set[index % set.len()];
        [r, g, b, 255]
    }

    /// The colour of a kind of mutation, by its place among them; those beyond the set start again
    /// in the colours of fields.
    pub fn mutation(&self, index: usize) -> Rgba {
        let count = LIMITS_DARK.len();
        if index < count { self.limit(index) } else { self.field(index - count) }
    }

    /// About the hue that a wavelength has to the eye, violet below 0.4 µm and red above 0.7 µm.
    pub fn wavelength(&self, um: f64) -> Rgba {
        const HUES: [(f64, [f64; 3]); 7] = [
            (0.40, [150.0, 60.0, 255.0]),
            (0.45, [70.0, 90.0, 255.0]),
            (0.49, [0.0, 190.0, 230.0]),
            (0.53, [0.0, 200.0, 60.0]),
            (0.58, [220.0, 200.0, 0.0]),
            (0.62, [255.0, 120.0, 0.0]),
            (0.70, [235.0, 40.0, 40.0]),
        ];
        let um = um.clamp(HUES[0].0, HUES[6].0);
        let above = HUES.iter().position(|(at, _)| um <= *at).unwrap_or(6).max(1);
        let ((low, a), (high, b)) = (HUES[above - 1], HUES[above]);
        let t = (um - low) / (high - low);
        let shade = if self.dark { 1.0 } else { 0.75 };
        let mix = |i: usize| to_byte(shade * (a[i] + t * (b[i] - a[i])));
        [mix(0), mix(1), mix(2), 255]
    }
}

/// The nearest of the 256 steps of a colour.
pub fn to_byte(value: f64) -> u8 {
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "saturates")]
    let byte = value.round() as u8;
    byte
}

/// A colour as the widgets want it.
pub fn color32([r, g, b, a]: Rgba) -> Color32 {
    Color32::from_rgba_unmultiplied(r, g, b, a)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn short_waves_are_blue_and_long_ones_red() {
        for palette in [Palette::DARK, Palette::LIGHT] {
            let [violet, red] = [0.35, 1.1].map(|um| palette.wavelength(um));
            assert!(violet[2] > violet[0] && red[0] > red[2]);
            let green = palette.wavelength(0.53);
            assert!(green[1] > green[0] && green[1] > green[2]);
        }
    }

    #[test]
    fn fields_beyond_the_set_start_again() {
        assert_eq!(Palette::DARK.field(0), Palette::DARK.field(7));
        assert_ne!(Palette::DARK.field(0), Palette::DARK.field(1));
    }
}
