//! A front is written as a table, a plot and lenses that read back unchanged.

use super::merit::bundled;
use aplanat::files;
use aplanat::optimize::pareto::{Front, ParetoPoint, ParetoSettings, ParetoSweep};
use aplanat::report::ParetoReport;

/// The lens at the start and the front of a short sweep.
fn swept() -> ParetoSweep {
    let settings = ParetoSettings { points: 2, steps: 5, ..ParetoSettings::default() };
    let mut sweep = ParetoSweep::new(&bundled("double_gauss_rudolph_50"), &settings).unwrap();
    while !sweep.step().finished {}
    sweep
}

#[test]
fn a_front_is_written_with_every_lens() {
    let sweep = swept();
    let folder = std::env::temp_dir().join(format!("aplanat-front-{}", std::process::id()));
    let biased = Some(sweep.front());
    let (start, front, tried) = (&sweep.start, sweep.front(), sweep.evaluated());
    let wavelengths = &start.lens.wavelengths;
    let survey = ParetoReport { name: "test", wavelengths, start, front, tried, biased };
    let written = survey.write(&folder.join("new")).unwrap();
    let designs = front.points();
    assert!(designs.len() > 1);
    assert_eq!(written.len(), 3 + 2 * designs.len());

    let table = std::fs::read_to_string(&written[0]).unwrap();
    let lines: Vec<Vec<&str>> = table.lines().map(|line| line.split(',').collect()).collect();
    assert_eq!(lines[0][0], "spot_mm");
    let file = lines[0].iter().position(|name| *name == "file").unwrap();
    assert_eq!(lines.len(), 2 + 2 * designs.len());
    for (line, design) in lines[2..].iter().zip(designs.iter().chain(designs)) {
        let numbers = [design.spot, design.spot_error, design.light, design.light_error];
        let read: Vec<f64> = line[..4].iter().map(|word| word.parse().unwrap()).collect();
        assert_eq!(read, numbers, "digits that bring back the same number");
        let lens = files::open(folder.join("new").join(line[file])).unwrap().lens;
        assert_eq!(lens, design.lens);
        let again = ParetoPoint::evaluate(&lens, design.weight, 1e-4).unwrap();
        assert!((again.spot - design.spot).abs() < 1e-3 * design.spot);
    }
    let picture = std::fs::read(&written[1]).unwrap();
    assert!(picture.starts_with(b"\x89PNG"));
    std::fs::remove_dir_all(&folder).unwrap();
}

#[test]
fn an_output_folder_that_is_a_file_is_named() {
    let start = ParetoPoint::evaluate(&bundled("double_gauss_rudolph_50"), None, 1e-3).unwrap();
    let front = Front::default();
    let (name, wavelengths, tried) = ("", &start.lens.wavelengths[..], &[][..]);
    let (start, front, biased) = (&start, &front, None);
    let survey = ParetoReport { name, wavelengths, start, front, tried, biased };
    let why = survey.write("Cargo.toml".as_ref()).unwrap_err().to_string();
    assert!(why.starts_with("Cargo.toml: cannot be written"), "{why}");
    assert_eq!(front.relative_hypervolume(start), 0.0);
}

/// The name of a lens may be long: neither side of the plot is cut, and a biased front is seen.
#[test]
fn a_plot_contains_its_title_and_all_fronts() {
    let mut start = ParetoPoint::evaluate(&bundled("double_gauss_rudolph_50"), None, 1e-2).unwrap();
    (start.spot, start.light) = (0.02, 100.0);
    let name =
        "a name as long as those of lenses from patents, with year, number and example".repeat(3);
    let (front, wavelengths) = (Front::default(), start.lens.wavelengths.clone());
    let (start, tried, biased) = (&start, &[][..], Some(&front));
    let report = ParetoReport {
        name: &name,
        wavelengths: &wavelengths,
        start,
        front: &front,
        tried,
        biased,
    };
    let canvas = report.plot();
    let width = canvas.size()[0] as usize;
    for row in canvas.pixels().chunks(3 * width) {
        let ends = row[..12].iter().chain(&row[3 * width - 12..]);
        assert!(ends.into_iter().all(|value| *value == 0xff));
    }
    let orange = [0xff, 0x7f, 0x0e];
    assert!(canvas.pixels().chunks(3).any(|pixel| pixel == orange), "the sample of the legend");
}
