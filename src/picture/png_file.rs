//! A picture as a PNG file of 8 or 16 bits, with its data as text inside.

use super::Picture;
use crate::plot::Color;
use png::{BitDepth as PngDepth, ColorType, Encoder, EncodingError, ScaledFloat};

/// The bits of a colour of a pixel.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum BitDepth {
    /// 256 levels.
    Eight,
    /// 65536 levels.
    Sixteen,
}

impl BitDepth {
    /// Appends the level of a value from 0 to 1, big end first.
    fn push(self, value: f64, bytes: &mut Vec<u8>) {
        let value = value.clamp(0.0, 1.0);
        match self {
            Self::Eight => bytes.push((255.0 * value).round() as u8),
            Self::Sixteen => bytes.extend(((65535.0 * value).round() as u16).to_be_bytes()),
        }
    }
}

/// The numbers of a file against light, both 0 to 1.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum ToneCurve {
    /// That of sRGB.
    Srgb,
    /// Light to the power of one over this number.
    Power(f64),
}

impl ToneCurve {
    /// Light to the power of one over a number from 0.1 to 10.
    pub fn power(gamma: f64) -> Option<Self> {
        (0.1..=10.0).contains(&gamma).then_some(Self::Power(gamma))
    }

    /// The number of a light.
    fn number(self, light: f64) -> f64 {
        match self {
            Self::Srgb => srgb_value(light),
            Self::Power(gamma) => light.clamp(0.0, 1.0).powf(gamma.recip()),
        }
    }
}

/// The file of a picture whose white is the picture's, with texts by their keywords. A viewer is told of a
/// tone curve that is not that of sRGB.
///
/// # Errors
/// A text that PNG does not hold.
pub fn encode_png(
    picture: &Picture,
    depth: BitDepth,
    curve: ToneCurve,
    texts: &[(&str, String)],
) -> Result<Vec<u8>, EncodingError> {
    let mut bytes = Vec::new();
    let mut encoder = rgb_encoder(&mut bytes, picture.frame.pixels, depth, texts)?;
    if let ToneCurve::Power(gamma) = curve {
        encoder.set_source_gamma(ScaledFloat::new(gamma.recip() as f32));
    }
    let mut writer = encoder.write_header()?;
    writer.write_image_data(&picture.bytes(depth, curve))?;
    writer.finish()?;
    Ok(bytes)
}

/// The file of an image of colours, row by row from the upper left corner, with texts by their keywords.
///
/// # Errors
/// A text that PNG does not hold, or colours that do not fill the image.
pub fn encode_colors(
    pixels: [usize; 2],
    colors: &[Color],
    texts: &[(&str, String)],
) -> Result<Vec<u8>, EncodingError> {
    let mut bytes = Vec::new();
    let encoder = rgb_encoder(&mut bytes, pixels, BitDepth::Eight, texts)?;
    let mut writer = encoder.write_header()?;
    writer.write_image_data(colors.as_flattened())?;
    writer.finish()?;
    Ok(bytes)
}

/// The encoder of an image in red, green and blue with texts by their keywords.
fn rgb_encoder<'a>(
    bytes: &'a mut Vec<u8>,
    pixels: [usize; 2],
    depth: BitDepth,
    texts: &[(&str, String)],
) -> Result<Encoder<'a, &'a mut Vec<u8>>, EncodingError> {
    let [width, height] = pixels.map(|count| count as u32);
    let mut encoder = Encoder::new(bytes, width, height);
    encoder.set_color(ColorType::Rgb);
    encoder.set_depth(match depth {
        BitDepth::Eight => PngDepth::Eight,
        BitDepth::Sixteen => PngDepth::Sixteen,
    });
    for (keyword, text) in texts {
        encoder.add_itxt_chunk((*keyword).to_owned(), text.clone())?;
    }
    Ok(encoder)
}

impl Picture {
    /// The pixels in sRGB whose white is the picture's, row by row from the upper left corner: red, green
    /// and blue, those of 16 bits with the big end first.
    pub fn srgb_bytes(&self, depth: BitDepth) -> Vec<u8> {
        self.bytes(depth, ToneCurve::Srgb)
    }

    /// The same by another tone curve.
    fn bytes(&self, depth: BitDepth, curve: ToneCurve) -> Vec<u8> {
        let mut bytes = Vec::new();
        for value in self.values.iter().flatten() {
            depth.push(curve.number(value / self.white), &mut bytes);
        }
        bytes
    }
}

/// The sRGB value of linear light, both 0 to 1 (IEC 61966-2-1).
fn srgb_value(light: f64) -> f64 {
    let light = light.clamp(0.0, 1.0);
    if light <= 0.0031308 { 12.92 * light } else { 1.055 * light.powf(1.0 / 2.4) - 0.055 }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::picture::ImageFrame;
    use crate::trace::Fates;

    fn picture() -> Picture {
        let frame = ImageFrame { pixels: [2, 1], pitch: 1.0, center: [0.0; 2], inverted: true };
        Picture {
            frame,
            values: vec![[0.0, 0.5, 9.0], [0.1, 0.25, 0.5]],
            errors: vec![[0.0; 3]; 2],
            white: 0.5,
            rays: 0,
            fates: Fates::default(),
            reached: true,
            complete: true,
            overshoot: 0.0,
        }
    }

    #[test]
    fn files_hold_both_depths_and_their_texts() {
        let text = [("Left out", "diffraction, 1 %".to_owned())];
        for (depth, white) in [(BitDepth::Eight, 255), (BitDepth::Sixteen, 65535)] {
            let bytes = encode_png(&picture(), depth, ToneCurve::Srgb, &text).unwrap();
            let image = image::load_from_memory(&bytes).unwrap();
            let level = image.clone().into_rgb16().get_pixel(0, 0).0;
            assert_eq!(level, [0, 65535, 65535]);
            let half = image.into_rgb16().get_pixel(1, 0).0[1];
            // Half of the light is 0.735 of the scale.
            assert!((f64::from(half) / 65535.0 - 0.735_357).abs() < 1.0 / f64::from(white));
            let decoder = png::Decoder::new(std::io::Cursor::new(&bytes));
            let reader = decoder.read_info().unwrap();
            let stored = &reader.info().utf8_text[0];
            assert_eq!(
                (stored.keyword.as_str(), stored.get_text().unwrap()),
                ("Left out", text[0].1.clone())
            );
        }
    }

    /// A quarter of white by the power 1 is a quarter of the scale, by 1/2 a half; the file says so.
    #[test]
    fn a_file_says_which_power_of_light_its_numbers_are() {
        for (gamma, share) in [(1.0, 0.5), (2.0, 0.5_f64.sqrt())] {
            let curve = ToneCurve::power(gamma).unwrap();
            let bytes = encode_png(&picture(), BitDepth::Sixteen, curve, &[]).unwrap();
            let level = image::load_from_memory(&bytes).unwrap().into_rgb16().get_pixel(1, 0).0[1];
            assert!((f64::from(level) / 65535.0 - share).abs() < 1e-4, "{gamma}: {level}");
            let reader = png::Decoder::new(std::io::Cursor::new(&bytes)).read_info().unwrap();
            let stored = reader.info().gama_chunk.unwrap().into_value();
            assert!((f64::from(stored) - 1.0 / gamma).abs() < 1e-4, "{stored}");
        }
        assert!([0.0, -1.0, f64::NAN, 11.0].iter().all(|wrong| ToneCurve::power(*wrong).is_none()));
    }
}
