//! Ghosts: the pairs of reflecting surfaces, ranked, with the light of real rays.

use super::{AnalysisRun, AtField, SelectedField, TextLines};
use crate::analysis::{Coating, Ghost, GhostRanking, ParaxialGhost, check_light, ghosts};
use crate::cli::error::CliError;
use crate::cli::output::{ShortNumber, TextTable, counted};
use crate::lens::SurfaceNumber;
use crate::measure::time_ms;
use crate::plot::{ChartCurve, CurveChart};
use crate::trace::Fates;
use serde::Serialize;

/// The ghosts of a field.
#[derive(Serialize)]
pub(super) struct GhostsJson {
    coating: String,
    /// The share of the light that is not reflected, at normal incidence.
    transmission: f64,
    /// The share of the light in all ghosts, by first-order optics.
    ghost_flux: f64,
    pairs: usize,
    rays: usize,
    milliseconds: f64,
    ghosts: Vec<GhostJson>,
}

/// A ghost; lengths in mm.
#[derive(Serialize)]
struct GhostJson {
    first_reflection: usize,
    second_reflection: usize,
    matrix: [[f64; 2]; 2],
    focal_length: Option<f64>,
    focus: Option<f64>,
    paraxial_radius: f64,
    clip_factor: f64,
    clipped_at: Option<usize>,
    height_per_tangent: f64,
    reflected: f64,
    transmitted: f64,
    paraxial_irradiance: f64,
    /// By real rays: the share of the light in both polarisations.
    flux: [f64; 2],
    center: Option<[f64; 2]>,
    radius: f64,
    irradiance: f64,
    fates: Fates,
    lost_at: Option<usize>,
}

impl GhostJson {
    fn new(Ghost { paraxial, patch }: &Ghost) -> Self {
        let ParaxialGhost { first, second, matrix, focal_length, focus, .. } = *paraxial;
        Self {
            first_reflection: first,
            second_reflection: second,
            matrix,
            focal_length,
            focus,
            paraxial_radius: paraxial.radius,
            clip_factor: paraxial.clip_factor,
            clipped_at: paraxial.clipped_at,
            height_per_tangent: paraxial.height_per_tangent,
            reflected: paraxial.reflected,
            transmitted: paraxial.transmitted,
            paraxial_irradiance: paraxial.irradiance,
            flux: patch.flux,
            center: patch.center,
            radius: patch.radius,
            irradiance: patch.irradiance,
            fates: patch.fates,
            lost_at: patch.lost_at,
        }
    }
}

/// The rays of a ghost.
const RAYS: usize = 1024;

pub(super) fn ghost_lists(
    run: &AnalysisRun,
    coating: Coating,
    count: usize,
) -> Result<Vec<AtField<GhostsJson>>, CliError> {
    let at = |field: &SelectedField| {
        let (primary, beam) = (run.model.primary, (count, RAYS));
        let (found, milliseconds) =
            time_ms(|| ghosts(&run.model, (field.traced, primary), coating, beam));
        let (ranking, found) =
            found.map_err(|why| CliError::Input(format!("{}: {why}", run.opened.file)))?;
        let keys = keys(&ranking, &found, coating, milliseconds);
        // Light that the image does not get may still arrive there by reflections.
        let arrives = found.iter().any(|ghost| ghost.patch.fates.imaged > 0);
        let lit = if arrives { Ok(()) } else { check_light(&run.model, field.traced) };
        Ok(AtField::new(field, lit.map(|()| keys)))
    };
    run.at_each_field(at).into_iter().collect()
}

fn keys(
    ranking: &GhostRanking,
    found: &[Ghost],
    coating: Coating,
    milliseconds: f64,
) -> GhostsJson {
    GhostsJson {
        coating: coating.to_string(),
        transmission: ranking.direct,
        ghost_flux: ranking.flux,
        pairs: ranking.ghosts.len(),
        rays: found.iter().map(|ghost| ghost.patch.fates.total()).sum(),
        milliseconds,
        ghosts: found.iter().map(GhostJson::new).collect(),
    }
}

impl TextLines for GhostsJson {
    const TITLE: &'static str = "ghosts of two reflections at the primary wavelength, the brightest first: \
         irradiance in the image relative to that at the entrance of the lens, lengths in mm";

    fn lines(&self) -> Vec<String> {
        let Self { coating, transmission, ghost_flux, pairs, rays, milliseconds, .. } = self;
        let mut lines = vec![
            format!("{coating}: {:.4} passes without reflection", transmission),
            format!("all {}: {ghost_flux:.2e} of the light", counted(*pairs, "ghost")),
            format!("{}, {milliseconds:.3} ms", counted(*rays, "ray")),
        ];
        let head = [
            "surfaces",
            "irradiance",
            "radius",
            "x",
            "y",
            "share",
            "focus",
            "first order",
            "arriving",
            "lost at",
        ];
        let mut table = TextTable::new(&head);
        self.ghosts.iter().for_each(|ghost| table.row(cells(ghost)));
        lines.extend(table.to_string().lines().map(str::to_owned));
        lines
    }

    /// The irradiances by rank; the brightest have names.
    fn charts(&self) -> Vec<CurveChart> {
        let lit = || self.ghosts.iter().filter(|ghost| ghost.irradiance > 0.0);
        let logarithms: Vec<f64> = lit().map(|ghost| ghost.irradiance.log10()).collect();
        let floor = logarithms.iter().fold(0.0, |least: f64, value| least.min(*value)).floor();
        let bar = |(rank, (ghost, value)): (usize, (&GhostJson, &f64))| {
            let number = |surface: usize| SurfaceNumber::new(surface);
            let [first, second] = [ghost.first_reflection, ghost.second_reflection].map(number);
            let place = rank as f64 + 1.0;
            let [left, right] = [place - HALF_BAR, place + HALF_BAR];
            let outline = [[left, floor], [left, *value], [right, *value], [right, floor]];
            let outline = outline.map(|[x, y]| (x, Some(y)));
            if rank < NAMED {
                ChartCurve::new(format!("surfaces {first}, {second}"), rank, outline)
            } else {
                ChartCurve::new(OTHERS, 0, outline).neutral()
            }
        };
        let mut curves: Vec<ChartCurve> = lit().zip(&logarithms).enumerate().map(bar).collect();
        // The axis has room beside the first and the last bar.
        if let Some(name) = curves.first().map(|curve| curve.name.clone()) {
            let ends = [0.0, curves.len() as f64 + 1.0].map(|rank| (rank, Some(floor)));
            curves.push(ChartCurve::new(name, 0, ends).neutral());
        }
        vec![CurveChart::new("ghosts", ["rank", "lg irradiance"], curves)]
    }
}

/// Half the width of a bar, and the name of those without a colour of their own.
const HALF_BAR: f64 = 0.3;
const OTHERS: &str = "others";
/// The number of ghosts with a colour of their own.
const NAMED: usize = 7;

fn cells(ghost: &GhostJson) -> Vec<String> {
    let short = |value: f64| format!("{value:.3}");
    let number = |surface: usize| SurfaceNumber::new(surface).to_string();
    let [x, y] = ghost.center.map_or(["-".to_owned(), "-".to_owned()], |center| center.map(short));
    let arriving = 100.0 * ghost.fates.imaged as f64 / ghost.fates.total().max(1) as f64;
    vec![
        format!("{}, {}", number(ghost.first_reflection), number(ghost.second_reflection)),
        format!("{:.2e}", ghost.irradiance),
        short(ghost.radius),
        x,
        y,
        format!("{:.2e}", 0.5 * (ghost.flux[0] + ghost.flux[1])),
        ghost.focus.map_or("-".to_owned(), |focus| ShortNumber(focus).to_string()),
        format!("{:.2e}", ghost.paraxial_irradiance),
        format!("{arriving:.0} %"),
        ghost.lost_at.map_or("-".to_owned(), number),
    ]
}
