//! Bounds of the parameters of an optimization, and of their steps.

/// The range of each parameter, and the largest change in a step.
///
/// A Newton-like method that starts far from a minimum may jump into another one: a limited step
/// keeps it near.
#[derive(Debug, Clone, PartialEq)]
pub struct ParameterBounds {
    /// The smallest and largest value of each parameter; equal for a fixed one.
    pub ranges: Vec<[f64; 2]>,
    /// The largest change of a parameter in one step.
    pub max_change: f64,
}

impl ParameterBounds {
    /// The same range for `count` parameters.
    pub fn uniform(count: usize, range: [f64; 2], max_change: f64) -> Self {
        Self { ranges: vec![range; count], max_change }
    }

    /// Clamps parameters to their ranges, and returns the number of those that were outside.
    pub fn project(&self, parameters: &mut [f64]) -> usize {
        let mut outside = 0;
        for (value, [low, high]) in parameters.iter_mut().zip(&self.ranges) {
            if !(*value >= *low && *value <= *high) {
                *value = if *value > *high { *high } else { *low };
                outside += 1;
            }
        }
        outside
    }

    /// Scales a step down to the largest change.
    pub fn limit_step(&self, step: &mut [f64]) {
        let largest = step.iter().fold(0.0, |max: f64, s| max.max(s.abs()));
        if largest > self.max_change {
            step.iter_mut().for_each(|s| *s *= self.max_change / largest);
        }
    }

    /// True for each parameter at a bound that descent along the gradient would violate.
    pub fn active_bounds(&self, parameters: &[f64], gradient: &[f64]) -> Vec<bool> {
        let is_active = |((value, g), [low, high]): ((&f64, &f64), &[f64; 2])| {
            (*value <= *low && *g > 0.0) || (*value >= *high && *g < 0.0)
        };
        parameters.iter().zip(gradient).zip(&self.ranges).map(is_active).collect()
    }
}
