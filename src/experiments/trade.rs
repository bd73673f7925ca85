//! What figures 3.6 to 3.10 share: lenses optimised for sharpness and light at once,
//! `L = L_spot − β × area` (3.26), by derivatives that follow the edges of the pupils or by those
//! that do not, and how sharp and how bright they are.

use super::{Cell, Ended, Table, Watch, report};
use crate::lens::{Aperture, Field, FieldKind, Fields, Lens, Parameter, Quantity, Variable};
use crate::merit::{Goal, PupilEdge, Term, Weighted};
use crate::optimize::annealed;
use crate::pupil::{Bench, Region};

/// How exact the spots of a search are, relatively.
const TOLERANCE: f64 = 1e-3;
/// Orders of quadrature of the numbers that are shown: the difference is the error.
const ORDERS: [usize; 2] = [6, 8];
/// How far a semi-diameter may grow and shrink.
const SIZES: [f64; 2] = [0.2, 1.25];
/// A rim may not cut more of its sphere than this: `|curvature| × semi-diameter`.
const STEEPEST: f64 = 0.9;

/// A lens for a study of sharpness against light: one wavelength, these fields in degrees, and
/// every curvature, thickness and semi-diameter free.
pub(super) fn prepared(mut lens: Lens, angles: &[f64]) -> Lens {
    let primary = lens.wavelengths[lens.primary()];
    lens.wavelengths = vec![primary];
    lens.fields = fields(angles);
    let bounds = std::mem::take(&mut lens.variables);
    let mut free = |parameter: Parameter, [min, max]: [Option<f64>; 2]| {
        let known = bounds.iter().find(|variable| variable.parameter == parameter);
        lens.variables.push(known.copied().unwrap_or(Variable { parameter, min, max }));
    };
    for (i, row) in lens.surfaces.iter().enumerate() {
        if !row.stop {
            free(Parameter::new(i, Quantity::Curvature), [None; 2]);
        }
        free(Parameter::new(i, Quantity::Thickness), [Some(0.05), None]);
        if let Some(size) = row.semi_diameter {
            let bounds = SIZES.map(|factor| Some(factor * size));
            free(Parameter::new(i, Quantity::SemiDiameter), bounds);
        }
    }
    lens
}

/// Field points along y, in degrees.
pub(super) fn fields(angles: &[f64]) -> Fields {
    let values = angles.iter().map(|y| Field { x: 0.0, y: *y, weight: 1.0 }).collect();
    Fields { kind: FieldKind::Angle, values }
}

/// The composite objective (3.26) with what keeps a lens a lens: its focal length, glass and air
/// that can be made, no hemispheres.
pub(super) fn composite(lens: &Lens, beta: f64, pupil: PupilEdge) -> Result<Goal, Ended> {
    let mut goal = Goal::sensible(lens).map_err(Ended::from_error)?;
    goal.terms.retain(|weighted| !matches!(weighted.term, Term::Spot | Term::Light(_)));
    for weighted in &mut goal.terms {
        weighted.weight = 1.0;
    }
    for (term, weight) in
        [(Term::SpotIntegral, 1.0), (Term::Throughput, beta), (Term::Steepness(STEEPEST), 1.0)]
    {
        goal.terms.push(Weighted { term, weight });
    }
    goal.pupil = pupil;
    Ok(goal)
}

/// A lens and how it came about.
#[derive(Debug, Clone)]
pub(super) struct Design {
    /// What it is called in tables and pictures.
    pub(super) name: String,
    /// β in mm².
    pub(super) beta: f64,
    pub(super) lens: Lens,
    pub(super) views: Vec<View>,
    pub(super) rays: usize,
}

/// A field of a design.
#[derive(Debug, Clone, Copy)]
pub(super) struct View {
    /// In degrees.
    pub(super) angle: f64,
    /// The area of the pupil in mm², and the root mean square radius of the spot in mm, each with
    /// its error.
    pub(super) area: [f64; 2],
    pub(super) rms: [f64; 2],
}

/// How a search is reported: the part of the experiment that it is, from one share to another.
pub(super) struct Part<'a> {
    pub(super) from: f64,
    pub(super) to: f64,
    pub(super) name: &'a str,
}

/// The lens after so many steps of Adam while its rate falls to zero.
pub(super) fn optimised(
    start: &Lens,
    goal: &Goal,
    steps: usize,
    part: &Part<'_>,
    watch: &mut Watch<'_>,
) -> Result<Lens, Ended> {
    let mut search = annealed(start, goal, TOLERANCE, steps).map_err(Ended::from_error)?;
    for step in 0..steps {
        report(watch, part.from + (part.to - part.from) * step as f64 / steps as f64, part.name)?;
        if search.step().finished {
            break;
        }
    }
    search.settle();
    Ok(search.best().clone())
}

impl Design {
    pub(super) fn new(name: String, beta: f64, lens: Lens) -> Result<Self, Ended> {
        let bench = Bench::of(&lens, 0).map_err(Ended::from_error)?;
        let mut rays = 0;
        let views = bench.fields.iter().map(|field| view(&bench, *field, &mut rays));
        let views = views.collect::<Result<_, Ended>>()?;
        Ok(Self { name, beta, lens, views, rays })
    }

    /// The mean area of the pupils, in mm²: minus (3.25).
    pub(super) fn light(&self) -> f64 {
        self.views.iter().map(|view| view.area[0]).sum::<f64>() / self.views.len() as f64
    }

    /// The root mean square radius of the spots over all the light, in mm: the root of (3.24) over
    /// the area.
    pub(super) fn blur(&self) -> f64 {
        let squares = self.views.iter().map(|view| view.area[0] * view.rms[0].powi(2));
        (squares.sum::<f64>() / self.views.len() as f64 / self.light()).sqrt()
    }

    /// Blur and light.
    pub(super) fn point(&self) -> [f64; 2] {
        [self.blur(), self.light()]
    }

    pub(super) fn focal_length(&self) -> Result<f64, Ended> {
        let bench = Bench::of(&self.lens, 0).map_err(Ended::from_error)?;
        bench.first.efl.ok_or_else(|| Ended::Failed(format!("{} is afocal", self.name)))
    }
}

/// The spot and the pupil of a field.
pub(super) fn view(bench: &Bench, field: Field, rays: &mut usize) -> Result<View, Ended> {
    let launch = bench.launch(field, bench.primary).map_err(Ended::from_error)?;
    let region = Region::new(launch);
    *rays += region.rays;
    let [low, high] = ORDERS.map(|order| {
        let lit = region.lit(order);
        *rays += lit.traced;
        let moments = lit.moments;
        let rms = if moments.area > 0.0 { (moments.spread / moments.area).sqrt() } else { 0.0 };
        [moments.area, rms]
    });
    let number = |i: usize| [high[i], (high[i] - low[i]).abs()];
    Ok(View { angle: field.y, area: number(0), rms: number(1) })
}

/// Whether one point is sharper or brighter than another and neither softer nor darker.
pub(super) fn dominates(a: [f64; 2], b: [f64; 2]) -> bool {
    a[0] <= b[0] && a[1] >= b[1] && a != b
}

/// The area between some points and a worst one, blurrier and darker than all of them, that the
/// points dominate: the larger, the better a front. Points beyond the worst one count nothing.
pub(super) fn hypervolume(points: &[[f64; 2]], [blur, light]: [f64; 2]) -> f64 {
    let mut inside: Vec<[f64; 2]> =
        points.iter().copied().filter(|p| p[0] < blur && p[1] > light).collect();
    inside.sort_by(|a, b| b[1].total_cmp(&a[1]));
    let (mut sum, mut right) = (0.0, blur);
    for (i, [x, _]) in inside.iter().enumerate() {
        right = right.min(*x);
        let below = inside.get(i + 1).map_or(light, |next| next[1]);
        sum += (blur - right) * (inside[i][1] - below);
    }
    sum
}

/// A row for each field of each design.
pub(super) fn table(name: &'static str, designs: &[&Design]) -> Result<Table, Ended> {
    let columns = [
        "design",
        "beta_mm2",
        "focal_length_mm",
        "field_deg",
        "area_mm2",
        "area_error_mm2",
        "rms_mm",
        "rms_error_mm",
    ];
    let mut table = Table::new(name, &columns);
    for design in designs {
        let focal = design.focal_length()?;
        for view in &design.views {
            let numbers = [design.beta, focal, view.angle].into_iter();
            let numbers = numbers.chain(view.area).chain(view.rms).map(Cell::from);
            table.row(std::iter::once(design.name.as_str().into()).chain(numbers));
        }
    }
    Ok(table)
}

/// The same lens with its stop and its rims scaled: how a designer who cannot ask for light chooses
/// an aperture.
pub(super) fn opened(lens: &Lens, factor: f64) -> Lens {
    let mut lens = lens.clone();
    for row in &mut lens.surfaces {
        row.semi_diameter = row.semi_diameter.map(|size| factor * size);
    }
    if let Aperture::StopSemiDiameter(radius) = &mut lens.aperture {
        *radius *= factor;
    }
    lens
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_hypervolume_of_a_front_counts_every_point_once() {
        let worst = [10.0, 0.0];
        assert_eq!(hypervolume(&[[4.0, 3.0]], worst), 18.0);
        assert_eq!(hypervolume(&[[4.0, 3.0], [5.0, 2.0]], worst), 18.0);
        assert_eq!(hypervolume(&[[4.0, 3.0], [6.0, 5.0], [11.0, 9.0]], worst), 26.0);
        assert_eq!(hypervolume(&[], worst), 0.0);
    }

    #[test]
    fn a_point_does_not_dominate_itself() {
        assert!(dominates([1.0, 2.0], [1.0, 1.0]) && dominates([0.5, 2.0], [1.0, 2.0]));
        assert!(!dominates([1.0, 2.0], [1.0, 2.0]) && !dominates([0.5, 1.0], [1.0, 2.0]));
    }
}
