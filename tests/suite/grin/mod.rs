//! Light in gradient-index fields.

mod descent;
mod entries;
mod examples;
mod fields;
mod gradient;
mod hard;
mod lens;
mod lens_hard;
mod lenses;
mod plan;
mod reference;
mod speed;

use aplanat::grin::field::{
    BSpline, HessianDiagonal, Luneburg, Maxwell, Parabolic, Plume, Polynomial, ProfileCoordinate,
    ProfileField, RegularGrid, Sech, Tricubic, Trilinear,
};
use aplanat::grin::{
    EndCondition, GrinRay, GrinRegion, GrinSetup, IndexField, Integrator, LastStep, LaunchMode,
    RayAdjoint, RayExit,
};
use aplanat::math::{Real, Vec3};

/// A vector of plain numbers.
pub(crate) fn vec3([x, y, z]: [f64; 3]) -> Vec3<f64> {
    Vec3::new(x, y, z)
}

pub(crate) fn length(v: Vec3<f64>) -> f64 {
    v.dot(v).sqrt()
}

/// Rays that end after so many steps.
pub(crate) fn steps<R: Real>(integrator: Integrator, step: f64, count: u32) -> GrinSetup<R> {
    let (step, launch, end) = (R::from_f64(step), LaunchMode::AsGiven, EndCondition::Steps(count));
    GrinSetup { integrator, step, launch, end, screen: None }
}

/// Rays that end at a boundary.
pub(crate) fn until<R: Real>(
    integrator: Integrator,
    step: f64,
    region: GrinRegion<R>,
    last: LastStep,
) -> GrinSetup<R> {
    let end = EndCondition::Boundary { region, last, limit: 100_000 };
    GrinSetup {
        integrator,
        step: R::from_f64(step),
        launch: LaunchMode::AsGiven,
        end,
        screen: None,
    }
}

/// A smooth loss with every kind of derivative.
pub(crate) fn bowl<R: Real>(exit: &RayExit<R>) -> (R, RayAdjoint<R>) {
    let c = R::from_f64;
    let (dx, dv) = (
        exit.x - Vec3::from_f64(vec3([0.9375, 0.1875, -0.125])),
        exit.v - Vec3::from_f64(vec3([1.125, -0.0625, 0.25])),
    );
    let dp = exit.path - c(1.3);
    let loss = dx.dot(dx) + c(0.5) * dv.dot(dv) + c(0.3) * dp * dp;
    (loss, RayAdjoint { x: dx * c(2.0), v: dv, path: c(0.6) * dp })
}

/// Rays from a square of side `2 half` at `z`, towards +z, a little off the grid.
pub(crate) fn beam(count: usize, half: f64, z: f64) -> Vec<GrinRay<f64>> {
    let at = |i: usize| half * (2.0 * (i as f64 + 0.5137) / count as f64 - 1.0);
    let ray =
        |n: usize| GrinRay { x: vec3([at(n % count), at(n / count), z]), v: vec3([0.0, 0.0, 1.0]) };
    (0..count * count).map(ray).collect()
}

/// A kind of field with parameters that suit it, over any number type.
#[derive(Clone, Copy)]
pub(crate) struct Kind {
    pub(crate) name: &'static str,
    pub(crate) coordinate: ProfileCoordinate,
    pub(crate) diagonal: HessianDiagonal,
}

/// Every kind of field, the grids with the exact diagonal.
pub(crate) fn kinds() -> Vec<Kind> {
    let kind = |name, coordinate| Kind { name, coordinate, diagonal: HessianDiagonal::Exact };
    let mut kinds = vec![
        kind("polynomial", ProfileCoordinate::Sphere),
        kind("polynomial", ProfileCoordinate::Cylinder),
        kind("polynomial", ProfileCoordinate::Axial),
    ];
    let spheres =
        ["b-spline", "luneburg", "maxwell", "parabolic", "plume", "sech", "trilinear", "tricubic"];
    kinds.extend(spheres.map(|name| kind(name, ProfileCoordinate::Sphere)));
    kinds.push(kind("b-spline", ProfileCoordinate::Cylinder));
    kinds
}

impl Kind {
    /// The field, each parameter from its number and its value.
    pub(crate) fn field<R: Real>(
        &self,
        parameter: impl Fn(usize, f64) -> R,
    ) -> Box<dyn IndexField<R>> {
        let coordinate = self.coordinate;
        let mut field: Box<dyn IndexField<R>> = match self.name {
            "polynomial" => Box::new(ProfileField { coordinate, profile: polynomial() }),
            "b-spline" => Box::new(ProfileField { coordinate, profile: bspline() }),
            "luneburg" => {
                Box::new(ProfileField { coordinate, profile: Luneburg::new(R::from_f64(1.5)) })
            }
            "maxwell" => {
                let profile = Maxwell::new(R::from_f64(1.7), R::from_f64(1.9));
                Box::new(ProfileField { coordinate, profile })
            }
            "parabolic" => {
                let profile = Parabolic::new(R::from_f64(1.5), R::from_f64(0.4));
                Box::new(ProfileField { coordinate, profile })
            }
            "plume" => {
                let c = R::from_f64;
                Box::new(Plume::new(c(1.2), c(0.3), c(2.0)))
            }
            "sech" => {
                let profile = Sech::new(R::from_f64(1.6), R::from_f64(0.5));
                Box::new(ProfileField { coordinate, profile })
            }
            "trilinear" => Box::new(self.trilinear()),
            "tricubic" => {
                let two = R::from_f64(2.0 / 3.0);
                let low = -R::ONE;
                let low = Vec3::new(low, low, low);
                let grid = RegularGrid::new([6, 7, 6], low, Vec3::new(two, two, two)).unwrap();
                Box::new(Tricubic::new(grid, wavy(6 * 7 * 6)).unwrap())
            }
            other => panic!("{other}"),
        };
        for (i, value) in field.parameters_mut().iter_mut().enumerate() {
            *value = parameter(i, value.value());
        }
        field
    }

    fn trilinear<R: Real>(&self) -> Trilinear<R> {
        let low = Vec3::from_f64(vec3([-1.0, -1.1, -1.2]));
        let spacing = Vec3::from_f64(vec3([0.5, 0.44, 0.4]));
        let mut field =
            Trilinear::new(RegularGrid::new([5, 6, 7], low, spacing).unwrap(), wavy(210));
        if let Ok(field) = &mut field {
            field.diagonal = self.diagonal;
        }
        field.unwrap()
    }
}

fn polynomial<R: Real>() -> Polynomial<R> {
    let coefficients = [1.40625, -0.34375, -0.046875, 0.015625];
    Polynomial { coefficients: coefficients.map(R::from_f64).to_vec() }
}

fn bspline<R: Real>() -> BSpline<R> {
    let coefficients = [1.4375, 1.40625, 1.34375, 1.296875, 1.21875, 1.171875, 1.09375, 1.03125];
    BSpline::new(R::ZERO, R::from_f64(4.0), coefficients.map(R::from_f64).to_vec()).unwrap()
}

/// Values between 1 and 1.25 without a pattern.
fn wavy<R: Real>(count: usize) -> Vec<R> {
    (0..count).map(|i| R::from_f64(1.0 + 0.25 * (i as f64 * 0.754878).fract())).collect()
}
