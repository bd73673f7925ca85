//! The beam of a lens fills its real stop, and its chief rays cross the centre of the stop.

use aplanat::analysis::{Estimate, distortion, field_curvature, spot};
use aplanat::files;
use aplanat::lens::{Aperture, Lens};
use aplanat::pupil::{Accuracy, Aiming, RayModel, Region};
use aplanat::trace::Tracer;
use std::f64::consts::PI;

fn library() -> impl Iterator<Item = (&'static str, Lens)> {
    files::bundled_lenses()
        .iter()
        .map(|lens| (lens.name, files::json::read(lens.text, lens.name).unwrap()))
}

fn bundled(name: &str) -> Lens {
    library().find(|(other, _)| *other == name).unwrap().1
}

/// The lens with its aperture, and the rim of its stop, smaller by a factor.
fn stopped_down(mut lens: Lens, factor: f64) -> Lens {
    let smaller = |aperture: &mut Aperture| match aperture {
        Aperture::EntrancePupilDiameter(v)
        | Aperture::ObjectNa(v)
        | Aperture::StopSemiDiameter(v) => *v *= factor,
        Aperture::FNumber(v) => *v /= factor,
    };
    smaller(&mut lens.aperture);
    lens.zoom.iter_mut().filter_map(|position| position.aperture.as_mut()).for_each(smaller);
    let stop = lens.stop().unwrap();
    lens.surfaces[stop].semi_diameter.iter_mut().for_each(|rim| *rim *= factor);
    lens
}

fn assert_alike(what: &str, a: Estimate, b: Estimate) {
    let error = a.error + b.error;
    assert!((a.value - b.value).abs() <= error, "{what}: {} {} ± {error:e}", a.value, b.value);
}

#[test]
fn a_beam_does_not_depend_on_the_coordinates_of_its_rays() {
    let accuracy = Accuracy { tolerance: 1e-4, ..Accuracy::default() };
    let mut compared = 0;
    for (name, lens) in library() {
        for zoom in 0..lens.zoom_positions() {
            let real = RayModel::from_lens(&lens, zoom).unwrap();
            let paraxial = RayModel::with_aiming(&lens, zoom, Aiming::Paraxial).unwrap();
            let paraxial = paraxial.limited_by_stop().unwrap();
            for field in &real.fields {
                let what = format!("{name} zoom {zoom} at {}", field.y);
                let both = [&real, &paraxial].map(|model| spot(model, *field, accuracy));
                let (a, b) = match both {
                    [Ok(a), Ok(b)] => (a, b),
                    [Err(a), Err(b)] if a == b => continue,
                    // The paraxial coordinates of a fisheye may not reach its beam.
                    both => {
                        assert!(field.y > 60.0, "{what}: {both:?}");
                        continue;
                    }
                };
                assert_alike(&format!("{what}, radius"), a.rms, b.rms);
                assert_alike(&format!("{what}, light"), a.light, b.light);
                compared += 1;
            }
        }
    }
    assert!(compared > 80, "{compared}");
}

#[test]
fn chief_rays_stay_where_they_are_when_the_stop_closes() {
    for (name, lens) in library() {
        let wide = RayModel::from_lens(&lens, 0).unwrap();
        let factors = if name == "wide_nikkor_28_f35" { vec![0.88, 0.84, 0.3] } else { vec![0.86] };
        for factor in factors {
            let closed = RayModel::from_lens(&stopped_down(lens.clone(), factor), 0).unwrap();
            for field in &wide.fields {
                let height = |model| distortion(model, *field, wide.primary).unwrap().height;
                let moved = height(&closed) - height(&wide);
                assert!(moved.abs() < 1e-8, "{name} {factor} at {}: {moved:e} mm", field.y);
                let foci = |model| {
                    let foci = field_curvature(model, *field, wide.primary).unwrap();
                    [foci.tangential, foci.sagittal].map(Option::unwrap_or_default)
                };
                for (a, b) in foci(&closed).into_iter().zip(foci(&wide)) {
                    let same = (a - b).abs() < 1e-6 * (1.0 + b.abs());
                    assert!(same, "{name} {factor} at {}: {a} {b}", field.y);
                }
                let launch = closed.launch(*field, closed.primary).unwrap();
                let [x, y] = launch.stop_point([0.0, 0.0]).unwrap();
                assert!(x.hypot(y) < 1e-9 * closed.stop_radius(), "{name} at {}", field.y);
            }
        }
    }
}

/// The last surface of a traced lens that is cut off behind its stop is the stop: a ray that is asked
/// for by a point of it lands there, whatever lies in front.
#[test]
fn rays_cross_the_stop_where_they_are_asked_to() {
    let mut aimed = 0;
    for (name, lens) in library() {
        for zoom in 0..lens.zoom_positions() {
            let model = RayModel::from_lens(&lens, zoom).unwrap();
            if !model.ends_at_disc() {
                aimed += check_aim(name, &model);
            }
        }
    }
    println!("{aimed} rays");
    assert!(aimed > 500, "{aimed}");
}

/// The number of rays that cross the stop; a ray that cannot do so keeps its coordinates.
fn check_aim(name: &str, model: &RayModel) -> usize {
    let (stop, radius) = (model.stop(), model.stop_radius());
    let mut crossing = 0;
    for (wavelength, channel) in model.channels.iter().enumerate() {
        let mut front = channel.system.clone();
        front.surfaces.truncate(stop + 1);
        front.surfaces.iter_mut().for_each(aplanat::lens::Surface::remove_apertures);
        // Nothing follows that a gradient behind the stop could end at.
        front.surfaces[stop].grin = None;
        let tracer = Tracer::new(&front).unwrap();
        let points = [[0.0, 0.0], [0.0, 0.9], [0.5, -0.8], [-0.7, 0.2]];
        for (field, p) in model.fields.iter().flat_map(|f| points.map(|p| (f, p))) {
            let launch = model.launch(*field, wavelength).unwrap();
            let end = tracer.trace(launch.ray_through_stop(p).unwrap());
            let off = [end.ray.point.x / radius - p[0], end.ray.point.y / radius - p[1]];
            let off = off[0].hypot(off[1]);
            let crosses = end.fate.is_imaged();
            assert!(!crosses || off < 2e-9, "{name}, {field:?}, {p:?}: {off:e} of the stop");
            crossing += usize::from(crosses);
        }
    }
    crossing
}

#[test]
fn rays_that_are_aimed_together_are_those_aimed_alone() {
    let points = aplanat::pupil::pattern_points(aplanat::pupil::PupilPattern::Hexapolar(3));
    let mut compared = 0;
    for (name, lens) in library() {
        for aiming in [Aiming::Chief, Aiming::Stop] {
            let model = RayModel::with_aiming(&lens, 0, aiming).unwrap();
            let model =
                if aiming == Aiming::Chief { model.limited_by_stop().unwrap() } else { model };
            let channels = 0..model.channels.len();
            for (field, channel) in
                model.fields.iter().flat_map(|f| channels.clone().map(move |c| (f, c)))
            {
                let Ok(launch) = model.launch(*field, channel) else { continue };
                let alone = points.iter().map(|p| launch.ray_through_stop(*p));
                let through = launch.rays_through_stop(&points);
                assert!(alone.eq(through), "{name}, {field:?}, {aiming:?}");
                let alone = points.iter().map(|p| launch.ray(*p));
                assert!(alone.eq(launch.rays(&points)), "{name}, {field:?}, {aiming:?}");
                compared += points.len();
            }
        }
    }
    assert!(compared > 10_000, "{compared}");
}

#[test]
fn the_beam_on_the_axis_is_as_wide_as_the_aperture_says() {
    let mut checked = 0;
    for (name, mut lens) in library() {
        let Aperture::FNumber(f_number) = lens.aperture_at(0) else { continue };
        lens.surfaces.iter_mut().for_each(|row| row.semi_diameter = None);
        let model = RayModel::from_lens(&lens, 0).unwrap();
        let diameter = model.first_order.efl.unwrap().abs() / f_number;
        let axis = model.fields[0];
        assert_eq!((axis.x, axis.y), (0.0, 0.0), "{name}");
        let region = Region::new(model.launch(axis, model.primary).unwrap());
        let accuracy = Accuracy { tolerance: 1e-9, ..Accuracy::default() };
        let area = region.extent(accuracy).unwrap().values[0];
        let exact = PI * (0.5 * diameter).powi(2);
        assert!((area / exact - 1.0).abs() < 1e-9, "{name}: {area} {exact}");
        checked += 1;
    }
    assert!(checked > 6, "{checked}");
}

#[test]
fn a_wide_angle_lens_has_light_at_every_wavelength_of_its_corner() {
    let lens = bundled("wide_nikkor_28_f35");
    let accuracy = Accuracy { tolerance: 1e-5, ..Accuracy::default() };
    for aiming in [Aiming::Paraxial, Aiming::Chief] {
        let model = RayModel::with_aiming(&lens, 0, aiming).unwrap();
        let corner = *model.fields.last().unwrap();
        let spot = spot(&model, corner, accuracy).unwrap();
        assert!(spot.is_fully_lit, "{aiming:?}: {:?}", spot.channels);
        // A square grid of rays over the front element counts the light.
        let launch = model.launch(corner, model.primary).unwrap();
        let light = grid_area(&model, &launch);
        let found = spot.channels[model.primary].unwrap().light;
        println!("{aiming:?}: {} mm² by quadrature, {light} by counting", found.value);
        assert!((found.value / light - 1.0).abs() < 5e-3, "{aiming:?}: {found:?} {light}");
    }
}

/// The area of a pupil in mm² by counting the rays of a square grid that get through.
fn grid_area(model: &RayModel, launch: &aplanat::pupil::Launch<'_>) -> f64 {
    use aplanat::trace::TraceSink;
    const CELLS: usize = 1600;
    let reach = 4.0;
    let at = |i: usize| reach * (2.0 * (i as f64 + 0.5) / CELLS as f64 - 1.0);
    let points: Vec<_> = (0..CELLS * CELLS).map(|i| [at(i % CELLS), at(i / CELLS)]).collect();
    assert!(!model.ends_at_disc());
    let (launched, landed) = launch.trace_points(&points);
    let lit = (0..launched.len()).filter(|ray| landed.fate(*ray).is_imaged()).count();
    lit as f64 * (2.0 * reach / CELLS as f64).powi(2) * launch.area()
}
