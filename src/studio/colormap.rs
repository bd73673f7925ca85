//! Colour maps: even steps of a number appear as even steps of lightness.

use super::palette::to_byte;

/// Viridis by Smith and van der Walt (2015), from the smallest number to the largest: lightness
/// rises evenly, and people with every kind of colour blindness see it rise.
const VIRIDIS: [[u8; 3]; 10] = [
    [68, 1, 84],
    [72, 40, 120],
    [62, 73, 137],
    [49, 104, 142],
    [38, 130, 142],
    [31, 158, 137],
    [53, 183, 121],
    [110, 206, 88],
    [181, 222, 43],
    [253, 231, 37],
];

/// The colour of a number by its place in a range, 0 to 1.
pub fn sequential(share: f64) -> [u8; 3] {
    let last = VIRIDIS.len() - 1;
    let at = if share.is_finite() { share.clamp(0.0, 1.0) * last as f64 } else { 0.0 };
    let (below, t) = ((at as usize).min(last - 1), at - (at as usize).min(last - 1) as f64);
    let mix = |i: usize| {
        let (a, b) = (f64::from(VIRIDIS[below][i]), f64::from(VIRIDIS[below + 1][i]));
        to_byte(a + t * (b - a))
    };
    [mix(0), mix(1), mix(2)]
}

/// The colour of a difference by its size and sign, -1 to 1: blue below zero, orange above, and zero
/// like the ground, dark or light. Straight lines in Oklab (Ottosson 2020), where they look even.
pub fn diverging(share: f64, dark: bool) -> [u8; 3] {
    let share = if share.is_finite() { share.clamp(-1.0, 1.0) } else { 0.0 };
    let [ground, end, chroma] = if dark { [0.25, 0.84, 0.125] } else { [0.97, 0.50, 0.15] };
    let hue: f64 = if share < 0.0 { 245.0 } else { 60.0 };
    let size = share.abs();
    let (sin, cos) = hue.to_radians().sin_cos();
    oklab(ground + size * (end - ground), size * chroma * cos, size * chroma * sin)
}

/// The nearest colour of a screen to one of Oklab.
fn oklab(lightness: f64, a: f64, b: f64) -> [u8; 3] {
    let l = (lightness + 0.3963377774 * a + 0.2158037573 * b).powi(3);
    let m = (lightness - 0.1055613458 * a - 0.0638541728 * b).powi(3);
    let s = (lightness - 0.0894841775 * a - 1.2914855480 * b).powi(3);
    let linear = [
        4.0767416621 * l - 3.3077115913 * m + 0.2309699292 * s,
        -1.2684380046 * l + 2.6097574011 * m - 0.3413193965 * s,
        -0.0041960863 * l - 0.7034186147 * m + 1.7076147010 * s,
    ];
    linear.map(|light| {
        let light = light.clamp(0.0, 1.0);
        let shown =
            if light <= 0.0031308 { 12.92 * light } else { 1.055 * light.powf(1.0 / 2.4) - 0.055 };
        to_byte(255.0 * shown)
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    /// CIE L*, 0 to 100.
    fn lightness(color: [u8; 3]) -> f64 {
        let light = color.map(|byte| {
            let shown = f64::from(byte) / 255.0;
            if shown <= 0.04045 { shown / 12.92 } else { ((shown + 0.055) / 1.055).powf(2.4) }
        });
        let y = 0.2126 * light[0] + 0.7152 * light[1] + 0.0722 * light[2];
        if y > 0.008856 { 116.0 * y.cbrt() - 16.0 } else { 903.3 * y }
    }

    /// The steps of lightness of twenty even steps, over their mean.
    fn steps(color: impl Fn(f64) -> [u8; 3]) -> Vec<f64> {
        let values: Vec<f64> = (0..=20).map(|i| lightness(color(f64::from(i) / 20.0))).collect();
        let mean = (values[20] - values[0]) / 20.0;
        values.windows(2).map(|pair| (pair[1] - pair[0]) / mean).collect()
    }

    #[test]
    fn lightness_rises_evenly() {
        let maps: [(&str, Vec<f64>); 3] = [
            ("rising", steps(sequential)),
            ("dark", steps(|share| diverging(share, true))),
            ("light", steps(|share| diverging(-share, false))),
        ];
        for (name, steps) in maps {
            assert!(steps.iter().all(|step| (0.6..1.5).contains(step)), "{name}: {steps:?}");
        }
    }

    #[test]
    fn the_ends_and_what_is_no_number_have_colours() {
        assert_eq!((sequential(-1.0), sequential(2.0)), (VIRIDIS[0], VIRIDIS[9]));
        assert_eq!(sequential(f64::NAN), VIRIDIS[0]);
        assert_eq!(diverging(f64::NAN, true), diverging(0.0, true));
        let [below, above] = [-1.0, 1.0].map(|share| diverging(share, true));
        assert!(below[2] > below[0] && above[0] > above[2]);
    }
}
