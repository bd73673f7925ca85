//! Measures of the similarity between the image of a view and its target.

use super::seen::ViewImage;

impl ViewImage {
    /// The fraction of the light that falls on the screen.
    pub fn light_share(&self) -> f64 {
        mean(&self.formed)
    }

    /// The correlation coefficient of image and target, pixel by pixel: 1 for images that differ by
    /// contrast alone, 0 for a uniform image.
    pub fn correlation(&self) -> f64 {
        let (a, b) = (mean(&self.formed), mean(&self.target));
        let product = |v: &[f64], v0: f64, w: &[f64], w0: f64| {
            v.iter().zip(w).map(|(v, w)| (v - v0) * (w - w0)).sum::<f64>()
        };
        let both = product(&self.formed, a, &self.target, b);
        let square =
            product(&self.formed, a, &self.formed, a) * product(&self.target, b, &self.target, b);
        if square > 0.0 { both / square.sqrt() } else { 0.0 }
    }
}

fn mean(values: &[f64]) -> f64 {
    values.iter().sum::<f64>() / values.len() as f64
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_image_is_like_itself_and_unlike_an_even_one() {
        let wanted = vec![0.5, 1.5, 0.25, 1.75];
        let of = |made: Vec<f64>| ViewImage {
            pixels: 2,
            half: 1.0,
            target: wanted.clone(),
            formed: made,
        };
        assert!((of(wanted.clone()).correlation() - 1.0).abs() < 1e-12);
        assert!((of(wanted.iter().map(|w| 2.0 - w).collect()).correlation() + 1.0).abs() < 1e-12);
        assert_eq!(of(vec![0.5; 4]).correlation(), 0.0);
        assert_eq!(of(vec![0.5; 4]).light_share(), 0.5);
    }
}
