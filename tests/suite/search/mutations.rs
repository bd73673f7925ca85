//! Every kind of mutation on every lens that comes with the program.

use crate::merit::bundled;
use aplanat::files;
use aplanat::lens::Lens;
use aplanat::search::{Kind, Random, Rules, mutate, propose};
use rand::SeedableRng as _;
use std::collections::BTreeMap;

#[test]
fn explore() {
    let rules = Rules { elements: [1, 24], ..Rules::default() };
    for entry in files::library() {
        let lens = bundled(entry.name);
        let mut random = Random::seed_from_u64(1);
        for kind in Kind::MUTATIONS {
            let (mut ok, mut ratio, mut steps, mut spread) =
                (0, 0, 0, [f64::INFINITY, f64::NEG_INFINITY]);
            let mut why: BTreeMap<String, usize> = BTreeMap::new();
            let start = std::time::Instant::now();
            for _ in 0..50 {
                match mutate(kind, &lens, &rules, &mut random) {
                    Ok(m) => {
                        ok += 1;
                        m.lens.check().unwrap();
                        if let Some(log) = m.log_ratio {
                            ratio += 1;
                            spread = [spread[0].min(log), spread[1].max(log)];
                        }
                        steps = steps.max(m.projection.unwrap().steps);
                    }
                    Err(e) => {
                        let text: String =
                            e.to_string().chars().filter(|c| !c.is_ascii_digit()).collect();
                        *why.entry(text).or_default() += 1;
                    }
                }
            }
            let us = start.elapsed().as_secs_f64() / 50.0 * 1e6;
            println!(
                "{:32} {:15} ok {ok} ratio {ratio} {spread:.1?} steps {steps} {us:.0} us {why:?}",
                entry.name,
                kind.name()
            );
        }
    }
}
