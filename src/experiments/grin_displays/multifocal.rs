//! Figure 5.6: a display whose image depends on the distance of the screen, as that of a scene
//! depends on the focus of a camera.
//!
//! The scene has a ring in front, a cross in the middle and a square behind, evenly spaced in
//! dioptres; it replaces the light field of the thesis. Three planes are more than a beam can
//! satisfy, since the position of a ray on two of them determines that on the third: the images are
//! less exact than those of one plane.

use super::{EvaluatedField, outcome_of, solve_and_evaluate, task};
use crate::experiments::{Claim, Effort, Experiment, ExperimentResult, ProgressFn};
use crate::grin_design::ViewImage;

pub(in crate::experiments) const EXPERIMENT: Experiment = Experiment {
    id: "5.6",
    title: "A multifocal display",
    claim: "One beam makes a focal stack: a scene in focus at another depth on each of three screens",
    omits: "the light field of the thesis, which a scene of three shapes replaces",
    seconds: 30.0,
    run,
};

/// The minimum quality in dB and the minimum correlation, in full and as a test.
const LEAST: [[f64; 2]; 2] = [[23.0, 0.9], [16.0, 0.6]];

fn run(effort: Effort, progress: &mut ProgressFn<'_>) -> ExperimentResult {
    let task = task("multifocal", effort, 2)?;
    let evaluated = solve_and_evaluate(&task, effort, [0.0, 1.0], progress)?;
    let [least, less] = LEAST;
    let names = ["front", "middle", "back"];
    let mut outcome = outcome_of(&evaluated, &names, effort.select(least, less), effort);
    // The coarse field of a test is too smooth for images that differ that much.
    if effort == Effort::Full {
        outcome.claims.extend(own_plane_claims(&evaluated));
    }
    Ok(outcome)
}

/// The claims that every image resembles the target of its own plane more than that of any other.
fn own_plane_claims(evaluated: &EvaluatedField) -> Vec<Claim> {
    let views = &evaluated.views;
    let off = |image: &ViewImage, target: usize| {
        let pairs = image.formed.iter().zip(&views[target].picture.image.target);
        pairs.map(|(made, wanted)| (made - wanted) * (made - wanted)).sum::<f64>()
    };
    let claim = |i: usize| {
        let ratio = |image: &ViewImage| {
            let others = (0..views.len()).filter(|k| *k != i).map(|k| off(image, k));
            others.fold(f64::INFINITY, f64::min) / off(image, i)
        };
        let found = views[i].picture.estimate(ratio);
        let name = &views[i].name;
        let says = format!("{name}: difference from another plane's target, relative to its own");
        Claim::at_least(says, found.value, 1.0).with_error(found.error)
    };
    (0..views.len()).map(claim).collect()
}
