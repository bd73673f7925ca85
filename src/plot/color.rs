//! Colours: a palette for curves, and colour maps for rasters.

/// Red, green, blue.
pub type Color = [u8; 3];

/// Text and axes.
pub const BLACK: Color = [0; 3];
/// Elements in the background.
pub const GREY: Color = [0x7f; 3];
/// Grid lines.
pub const GRID: Color = [0xdd; 3];

/// Colours that are easy to distinguish, the most distinct ones first.
pub const PALETTE: [Color; 8] = [
    [0xd6, 0x27, 0x28],
    [0x1f, 0x77, 0xb4],
    [0x2c, 0xa0, 0x2c],
    [0xff, 0x7f, 0x0e],
    [0x94, 0x67, 0xbd],
    [0x8c, 0x56, 0x4b],
    [0xe3, 0x77, 0xc2],
    [0x17, 0xbe, 0xcf],
];

/// A grey from black at 0 to white at 1.
pub fn gray_level(value: f64) -> Color {
    [byte(value); 3]
}

/// A diverging colour map: blue at −1, white at 0, red at 1.
pub fn diverging(value: f64) -> Color {
    let faded = byte(1.0 - value.abs());
    if value < 0.0 { [faded, faded, 0xff] } else { [0xff, faded, faded] }
}

/// A colour map of growing brightness: black at 0, then red, orange and yellow, white at 1.
pub fn glow(value: f64) -> Color {
    [0.0, 1.0, 2.0].map(|step| byte(3.0 * value - step))
}

fn byte(share: f64) -> u8 {
    (255.0 * share.clamp(0.0, 1.0)).round() as u8
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn scales_reach_their_ends_and_stay_there() {
        assert_eq!(
            [gray_level(0.0), gray_level(1.0), gray_level(9.0)],
            [BLACK, [0xff; 3], [0xff; 3]]
        );
        assert_eq!(diverging(0.0), [0xff; 3]);
        assert_eq!([diverging(-2.0), diverging(1.0)], [[0, 0, 0xff], [0xff, 0, 0]]);
        assert_eq!([glow(-1.0), glow(0.0), glow(2.0)], [BLACK, BLACK, [0xff; 3]]);
        assert_eq!([glow(1.0 / 3.0), glow(2.0 / 3.0)], [[0xff, 0, 0], [0xff, 0xff, 0]]);
    }
}
