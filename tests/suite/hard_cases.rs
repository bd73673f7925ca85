//! `hard_cases.json`: exact answers of an independent tracer in 240-bit arithmetic, and inputs that
//! must be refused.
//!
//! A result passes within `16 unit + 4·2⁻⁵³ S`, where `unit` is the error that a backward-stable
//! tracer in f64 cannot avoid; a derivative within 1e-9 of the largest of the same output, or 1e4
//! units where a decision is close.

use super::reference::{number, read};
use aplanat::lens::{ASPHERE_TERMS, Shape, Surface, System, SystemError};
use aplanat::math::{DoubleDouble, Dual, Real, Vec3};
use aplanat::trace::{
    AdjointSeed, Fate, Landings, Ray, Rays, SimdWidth, SystemGradient, TraceSink, TracedRay, Tracer,
};
use serde_json::Value;
use std::collections::BTreeMap;

/// Half the distance from one to the next larger number.
const HALF_ULP: f64 = 1.1102230246251565e-16;
const OUTPUTS: [&str; 7] = ["x", "y", "z", "L", "M", "N", "opl"];

/// A list of numbers; none where there is no list.
fn numbers(value: &Value) -> Vec<f64> {
    value.as_array().map(|list| list.iter().map(number).collect()).unwrap_or_default()
}

fn get(value: &Value, key: &str, default: f64) -> f64 {
    value.get(key).filter(|v| !v.is_null()).map_or(default, number)
}

/// A number of a case, as the variable if it is the one that is named.
struct Lift<'a, R> {
    named: &'a str,
    variable: fn(f64) -> R,
}

impl<R: Real> Lift<'_, R> {
    fn number(&self, name: &str, value: f64) -> R {
        if name == self.named { (self.variable)(value) } else { R::from_f64(value) }
    }

    /// The simplest form that still depends on the named number, which may be zero.
    fn shape(&self, s: &Value, i: usize) -> Result<Shape<R>, SystemError> {
        let own = |key: &str| self.number(&format!("s{i}.{key}"), get(s, key, 0.0));
        let (curvature, conic) = (own("c"), own("k"));
        let mut terms = numbers(&s["a"]);
        let term = self.named.strip_prefix(&format!("s{i}.a")).map(|t| t.parse::<usize>().unwrap());
        if let Some(term) = term {
            terms.resize(terms.len().max(term / 2 - 1), 0.0);
        }
        let terms: Vec<R> = (0..terms.len())
            .map(|j| self.number(&format!("s{i}.a{}", 2 * j + 4), terms[j]))
            .collect();
        let shape = Shape::new(curvature, conic, &terms, i)?;
        let own_name = self.named == format!("s{i}.c") || self.named == format!("s{i}.k");
        Ok(match shape {
            _ if term.is_some() => {
                let mut all = [R::ZERO; ASPHERE_TERMS];
                all[..terms.len()].copy_from_slice(&terms);
                Shape::Asphere { curvature, conic, terms: all }
            }
            Shape::Plane | Shape::Sphere { .. } if own_name => Shape::Conic { curvature, conic },
            simplest => simplest,
        })
    }

    fn system(&self, input: &Value) -> Result<System<R>, SystemError> {
        let mut surfaces = Vec::new();
        for (i, s) in input["surfaces"].as_array().unwrap().iter().enumerate() {
            let own =
                |key: &str, default| self.number(&format!("s{i}.{key}"), get(s, key, default));
            surfaces.push(Surface {
                shape: self.shape(s, i)?,
                semi_diameter: R::from_f64(get(s, "sd", f64::INFINITY)),
                mirror: s["mirror"] == true,
                hyperhemisphere: s["hyper"] == true,
                ..Surface::plane(own("t", 0.0), own("n", 1.0))
            });
        }
        let index_before = self.number("n0", get(input, "n0", 1.0));
        Ok(System { index_before, surfaces, stop: None })
    }

    fn ray(&self, ray: &Value) -> Ray<R> {
        let own = |key: &str| self.number(&format!("ray.{key}"), number(&ray[key]));
        Ray {
            point: Vec3::new(own("x"), own("y"), own("z")),
            direction: Vec3::new(own("L"), own("M"), own("N")),
        }
    }
}

const PLAIN: Lift<'static, f64> = Lift { named: "", variable: |v| v };

fn status(fate: Fate) -> &'static str {
    match fate {
        Fate::Imaged => "ok",
        Fate::Missed(_) => "miss",
        Fate::Clipped(_) => "clipped",
        Fate::TotalReflection(_) => "tir",
        Fate::Turned(_) | Fate::Trapped(_) => "kept",
    }
}

fn outputs<R: Real>(landing: &TracedRay<R>) -> [R; 7] {
    let (p, d) = (landing.ray.point, landing.ray.direction);
    [p.x, p.y, p.z, d.x, d.y, d.z, landing.opl]
}

/// The failures, and the worst error in units of each family.
#[derive(Default)]
struct Report {
    wrong: Vec<String>,
    worst: BTreeMap<String, f64>,
    /// In twice the precision, and in `f64`.
    worst_derivative: BTreeMap<String, (f64, f64)>,
    /// How many outputs and how many derivatives were compared.
    compared: [usize; 2],
}

impl Report {
    fn fail(&mut self, id: &str, what: impl std::fmt::Display) {
        self.wrong.push(format!("{id}: {what}"));
    }

    fn print(&self, title: &str) {
        println!("{title}, worst of each family: error in units, and of the derivatives relative");
        println!("to the largest of the same output, in twice the precision and in f64");
        for (family, units) in &self.worst {
            let (twice, plain) = self.worst_derivative.get(family).copied().unwrap_or_default();
            println!("  {family:<20} {units:8.3} {twice:12.1e} {plain:12.1e}");
        }
    }
}

/// Compares a traced ray with what is expected of it.
fn compare(report: &mut Report, id: &str, family: &str, landing: &TracedRay<f64>, expect: &Value) {
    if let Some(any) = expect.get("status_any_of").and_then(Value::as_array) {
        let got = status(landing.fate);
        if !any.iter().any(|s| s == got) {
            report.fail(id, format!("{got}, expected one of {any:?}"));
        }
        if !outputs(landing).iter().all(|v| v.is_finite()) {
            report.fail(id, format!("{landing:?} is not finite"));
        }
        if expect.get("point").is_none() {
            return;
        }
    } else if expect["status"] != status(landing.fate) {
        return report.fail(id, format!("{:?}, expected {}", landing.fate, expect["status"]));
    }
    if let Some(surface) = expect.get("surface").and_then(Value::as_u64) {
        let got = landing.fate.surface().map(|i| i as u64);
        if got != Some(surface) {
            report.fail(id, format!("lost at {got:?}, expected {surface}"));
        }
    }
    if expect["status"] == "ok" && landing.fate.is_imaged() && expect.get("point").is_some() {
        compare_numbers(report, id, family, landing, expect);
    }
}

fn compare_numbers(
    report: &mut Report,
    id: &str,
    family: &str,
    landing: &TracedRay<f64>,
    expect: &Value,
) {
    let exact = expected(expect);
    let last_t = numbers(&expect["t"]).last().copied().unwrap_or(0.0).abs();
    let size = exact[..3].iter().fold(last_t, |s, v| s.max(v.abs()));
    let sizes = [size, size, size, 1.0, 1.0, 1.0, exact[6].abs()];
    let unit = units(expect);
    for (i, got) in outputs(landing).into_iter().enumerate() {
        report.compared[0] += 1;
        let floor = 4.0 * HALF_ULP * sizes[i];
        let error = (got - exact[i]).abs();
        if family != "extreme" {
            // The floor counts as the 16 units that it stands beside.
            let in_units = error / (unit[i] + floor / 16.0).max(f64::MIN_POSITIVE);
            let worst = report.worst.entry(family.to_owned()).or_default();
            *worst = worst.max(in_units);
        }
        if !(error <= 16.0 * unit[i] + floor) {
            let text = format!("{} = {got:e}, expected {:e}", OUTPUTS[i], exact[i]);
            report.fail(id, format!("{text}: {:.1} units", error / unit[i]));
        }
    }
    if let Some(list) = expect.get("negative_t") {
        let first = list.as_array().unwrap().first().and_then(Value::as_u64);
        let got = landing.first_backward_surface.map(|i| i as u64);
        // A way of no length but rounding has no direction.
        let ways = numbers(&expect["t"]);
        let long =
            |i: Option<u64>| i.is_none_or(|i| ways[i as usize].abs() > 1e-12 * size.max(1.0));
        if first != got && long(first) && long(got) {
            report.fail(
                id,
                format!("negative t at {:?}, expected {first:?}", landing.first_backward_surface),
            );
        }
    }
}

fn expected(expect: &Value) -> [f64; 7] {
    let (p, d) = (numbers(&expect["point"]), numbers(&expect["dir"]));
    [p[0], p[1], p[2], d[0], d[1], d[2], number(&expect["opl"])]
}

fn units(expect: &Value) -> [f64; 7] {
    let (p, d) = (numbers(&expect["unit"]["point"]), numbers(&expect["unit"]["dir"]));
    [p[0], p[1], p[2], d[0], d[1], d[2], number(&expect["unit"]["opl"])]
}

/// What rounding may do to a derivative in `f64`, relative to the largest of the same output. Where a
/// direction goes with the square root of a margin δ, rounding moves it by `u = ε/√δ` and its
/// derivative by `ε/δ = u²/ε` of itself; a point far behind goes with `1/√δ`, and moves by `ε/δ` of
/// itself as its derivative does.
fn derivative_tolerance(expect: &Value) -> f64 {
    let (unit, output) = (units(expect), expected(expect));
    let size = output[..3].iter().fold(0.0, |m: f64, v| m.max(v.abs()));
    let sizes = [size, size, size, 1.0, 1.0, 1.0, output[6].abs()];
    let relative = |i: usize| unit[i] / sizes[i].max(1e-200);
    let largest = |of: std::ops::Range<usize>| of.map(relative).fold(0.0, f64::max);
    let rounding = 4.0 * (largest(3..6).powi(2) / HALF_ULP).max(largest(0..7));
    // A larger one would let anything pass.
    assert!(rounding < 0.3, "{rounding}");
    rounding.max(1e-9)
}

/// Every derivative of a case by forward duals: to 1e-9 in twice the precision of `f64`, whatever
/// the case, which proves the formulas; and in `f64` as far as rounding leaves it.
fn compare_derivatives(report: &mut Report, case: &Value, id: &str, family: &str) {
    let expect = &case["expect"];
    let Some(derivatives) = expect.get("derivatives").and_then(Value::as_object) else { return };
    let exact: BTreeMap<&str, Vec<f64>> =
        derivatives.iter().map(|(name, row)| (name.as_str(), numbers(row))).collect();
    let allowed = derivative_tolerance(expect);
    for i in 0..7 {
        let largest = exact.values().fold(0.0, |m: f64, row| m.max(row[i].abs()));
        for (name, row) in &exact {
            let twice = derivative(case, name, |v| {
                Dual::<DoubleDouble, 1>::variable(DoubleDouble::from_f64(v), 0)
            });
            let plain = derivative(case, name, |v| Dual::<f64, 1>::variable(v, 0));
            report.compared[1] += 1;
            let what = format!("d{}/d{name}", OUTPUTS[i]);
            let relative = |got: f64| (got - row[i]).abs() / largest.max(1e-200);
            let (twice, plain) = (relative(twice[i].value()), relative(plain[i]));
            if !(twice <= 1e-9) {
                report.fail(id, format!("{what} is off by {twice:e} in twice the precision"));
            }
            if !(plain <= allowed || plain * largest <= 1e-12) {
                report.fail(id, format!("{what} is off by {plain:e} in f64"));
            }
            let worst = report.worst_derivative.entry(family.to_owned()).or_default();
            *worst = (worst.0.max(twice), worst.1.max(plain));
        }
    }
}

fn derivative<R: Real>(case: &Value, named: &str, variable: fn(f64) -> Dual<R, 1>) -> [R; 7] {
    let lift = Lift { named, variable };
    let tracer = Tracer::new(&lift.system(&case["input"]).unwrap()).unwrap();
    outputs(&tracer.trace(lift.ray(&case["input"]["ray"]))).map(|output| output.slope[0])
}

fn trace_case(input: &Value, start: &Value) -> Result<TracedRay<f64>, SystemError> {
    let tracer = Tracer::new(&PLAIN.system(input)?)?;
    let start = PLAIN.ray(start);
    start.check(0)?;
    Ok(tracer.trace(start))
}

#[test]
fn reference_hard_cases() {
    let mut report = Report::default();
    let cases = read("hard_cases.json");
    for case in cases["cases"].as_array().unwrap() {
        let (id, family) = (case["id"].as_str().unwrap(), case["family"].as_str().unwrap());
        match case["kind"].as_str().unwrap() {
            "ray" => {
                match trace_case(&case["input"], &case["input"]["ray"]) {
                    Ok(landing) => compare(&mut report, id, family, &landing, &case["expect"]),
                    Err(e) => {
                        let any = case["expect"].get("status_any_of").and_then(Value::as_array);
                        if !any.is_some_and(|list| list.iter().any(|s| s == "invalid")) {
                            report.fail(id, format!("refused: {e}"));
                        }
                        continue;
                    }
                }
                compare_derivatives(&mut report, case, id, family);
            }
            "bundle" => {
                for (i, entry) in case["rays"].as_array().unwrap().iter().enumerate() {
                    let landing = trace_case(&case["input"], &entry["ray"]).unwrap();
                    let id = format!("{id} ray {i}");
                    compare(&mut report, &id, family, &landing, &entry["expect"]);
                }
            }
            "invalid" => {
                if let Ok(landing) = trace_case(&case["input"], &case["input"]["ray"]) {
                    report.fail(id, format!("traced to {landing:?}, expected a refusal"));
                }
            }
            // The gradient-index answers belong to a floor of their own.
            "luneburg" => {}
            other => report.fail(id, format!("unknown kind {other}")),
        }
    }
    report.print("hard cases");
    assert!(report.wrong.is_empty(), "{}", report.wrong.join("\n"));
    // All but the derivatives of two extremes that are refused.
    assert_eq!(report.compared, [763, 10339]);
}

#[test]
fn reference_hard_cases_in_batches_give_the_same_bits() {
    let cases = read("hard_cases.json");
    let mut compared = 0;
    for case in cases["cases"].as_array().unwrap() {
        if case["kind"] != "ray" {
            continue;
        }
        let start = PLAIN.ray(&case["input"]["ray"]);
        let Ok(system) = PLAIN.system(&case["input"]) else { continue };
        let Ok(tracer) = Tracer::new(&system) else { continue };
        if start.check(0).is_err() {
            continue;
        }
        let one = tracer.trace(start);
        let rays: Rays<f64> = std::iter::repeat_n(start, 70).collect();
        for width in [SimdWidth::Baseline, SimdWidth::Bits256, SimdWidth::Bits512] {
            let mut hits = Landings::default();
            tracer.trace_batch_with(width, &rays, &mut hits);
            assert_eq!(hits.fate(69), one.fate, "{} at {width:?}", case["id"]);
            compared += 1;
            if one.fate.is_imaged() {
                let columns =
                    [hits.x[69], hits.y[69], hits.z[69], hits.l[69], hits.m[69], hits.n[69]];
                let (p, d) = (one.ray.point, one.ray.direction);
                let single = [p.x, p.y, p.z, d.x, d.y, d.z];
                assert_eq!(columns.map(f64::to_bits), single.map(f64::to_bits), "{}", case["id"]);
                assert_eq!(hits.opl[69].to_bits(), one.opl.to_bits(), "{}", case["id"]);
            }
        }
    }
    assert_eq!(compared, 330);
}

/// One output of a landing as the seed of the backward pass.
fn seed(output: usize) -> AdjointSeed<f64> {
    let mut v = [0.0; 7];
    v[output] = 1.0;
    let [x, y, z, l, m, n, opl] = v;
    AdjointSeed { point: Vec3::new(x, y, z), direction: Vec3::new(l, m, n), opl }
}

pub(crate) fn parameter(gradient: &SystemGradient<f64>, name: &str) -> Option<f64> {
    if name == "n0" {
        return Some(gradient.index_before);
    }
    let (surface, what) = name.strip_prefix('s')?.split_once('.')?;
    let surface = &gradient.surfaces[surface.parse::<usize>().unwrap()];
    Some(match what {
        "c" => surface.curvature,
        "k" => surface.conic,
        "t" => surface.thickness,
        "n" => surface.index,
        term => surface.terms[term.strip_prefix('a')?.parse::<usize>().unwrap() / 2 - 2],
    })
}

/// The backward pass against forward duals of the same case, every output and every number.
#[test]
fn reference_hard_cases_backwards() {
    let cases = read("hard_cases.json");
    let mut worst: BTreeMap<&str, f64> = BTreeMap::new();
    let mut compared = 0;
    for case in cases["cases"].as_array().unwrap() {
        let expect = &case["expect"];
        let Some(derivatives) = expect.get("derivatives").and_then(Value::as_object) else {
            continue;
        };
        let family = case["family"].as_str().unwrap();
        let start = PLAIN.ray(&case["input"]["ray"]);
        // Every number is asked for, so a surface is written in the form that has it.
        let mut system = PLAIN.system(&case["input"]).unwrap();
        for (surface, input) in
            system.surfaces.iter_mut().zip(case["input"]["surfaces"].as_array().unwrap())
        {
            let asphere = input.get("a").is_some();
            surface.shape =
                if asphere { surface.shape.as_asphere() } else { surface.shape.as_conic() };
        }
        let Ok(tracer) = Tracer::new(&system) else { continue };
        let rays: Rays<f64> = std::iter::once(start).collect();
        let allowed = derivative_tolerance(expect);
        for output in 0..7 {
            let gradient = tracer.gradient(&rays, |_| seed(output));
            let exact = |row: &Value| number(&row[output]);
            let largest = derivatives.values().fold(0.0, |m: f64, row| m.max(exact(row).abs()));
            for (name, row) in derivatives {
                let Some(got) = parameter(&gradient, name) else { continue };
                compared += 1;
                let error = (got - exact(row)).abs();
                if error <= 1e-12 || family == "extreme" {
                    continue;
                }
                let relative = error / largest;
                let entry = worst.entry(family).or_default();
                *entry = entry.max(relative);
                let what = format!(
                    "{}: d{}/d{name} = {got:e}, {}",
                    case["id"], OUTPUTS[output], row[output]
                );
                assert!(relative <= allowed, "{what}: off by {relative:e}");
            }
        }
    }
    println!("backward pass, worst relative error by family: {worst:?}");
    assert_eq!(compared, 7070);
}
