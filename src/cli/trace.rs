//! `trace`: rays given as JSON.

use super::analyze::parse_coating;
use super::effects::{AllowedSetting, EffectArgs, EffectChoices, EffectReport, EffectRule};
use super::error::CliError;
use super::input::{self, LensFile, LoadedLens};
use super::output::{Output, ShortNumber, TextTable};
use crate::analysis::{Coating, GhostPath, GhostRay};
use crate::effects::{self, Effect, TracePurpose};
use crate::files::MAX_DATA_BYTES;
use crate::lens::{SurfaceNumber, System};
use crate::math::Vec3;
use crate::trace::{Fate, Fates, Ray, TracedRay, Tracer};
use serde::{Deserialize, Serialize};
use std::fmt::{self, Display};
use std::path::PathBuf;

/// Traces rays given as JSON: fate, end point and optical path of each
#[derive(Debug, clap::Args)]
#[command(after_long_help = include_str!("help/trace.txt"))]
pub(super) struct TraceArgs {
    #[command(flatten)]
    lens: LensFile,

    /// The rays as JSON, `-` for standard input
    #[arg(long, value_name = "FILE")]
    rays: PathBuf,

    /// Follows the ghost that surface J reflects first and surface I, in front of it, then; counted from 1
    #[arg(long, value_name = "J,I", value_parser = parse_pair)]
    ghost: Option<[usize; 2]>,

    /// The coating between air and glass of the surfaces of --ghost: none, single-layer, v, or a share as
    /// `0.3%`
    #[arg(long, value_name = "COATING", default_value = "none", value_parser = parse_coating)]
    coating: Coating,

    /// Rims clip no ray
    #[arg(long)]
    unclipped: bool,

    #[command(flatten)]
    effects: EffectArgs,
}

/// The two surfaces of a ghost, counted from 1.
fn parse_pair(text: &str) -> Result<[usize; 2], String> {
    let number = |part: &str| part.trim().parse::<usize>().ok().filter(|surface| *surface > 0);
    let pair = text.split_once(',').and_then(|(j, i)| Some([number(j)?, number(i)?]));
    pair.ok_or_else(|| "expected two surfaces counted from 1, as in `10,2`".to_owned())
}

/// The rules for given rays, which need not be those of the beam that a plan is measured on.
const GIVEN_RAYS: [EffectRule; 8] = [
    EffectRule {
        effect: Effect::Dispersion,
        allowed: AllowedSetting::NotApplicable,
        reason: "the rays have one wavelength",
    },
    EffectRule {
        effect: Effect::Asphere,
        allowed: AllowedSetting::OnUnlessOff,
        reason: "given rays need not be those of the beam",
    },
    EffectRule {
        effect: Effect::Clipping,
        allowed: AllowedSetting::OnUnlessOff,
        reason: "given rays need not be those of the beam",
    },
    EffectRule {
        effect: Effect::Aiming,
        allowed: AllowedSetting::NotApplicable,
        reason: "the rays are given, and none is aimed",
    },
    EffectRule {
        effect: Effect::FiniteObject,
        allowed: AllowedSetting::NotApplicable,
        reason: "the rays begin where they are given",
    },
    EffectRule {
        effect: Effect::GradientIndex,
        allowed: AllowedSetting::OnUnlessOff,
        reason: "given rays need not be those of the beam",
    },
    EffectRule {
        effect: Effect::Poses,
        allowed: AllowedSetting::OnUnlessOff,
        reason: "given rays need not be those of the beam",
    },
    EffectRule {
        effect: Effect::Temperature,
        allowed: AllowedSetting::AlwaysOn,
        reason: "the lens is traced at its temperature",
    },
];

impl TraceArgs {
    pub(super) fn run(&self, output: &Output) -> Result<(), CliError> {
        let choices = self.effects.choices(&GIVEN_RAYS)?;
        let opened = self.lens.open()?;
        let request: RayRequest = input::read_long_json(&self.rays, MAX_DATA_BYTES)?;
        let wavelength_um = request.wavelength_um.unwrap_or_else(|| opened.primary_um());
        let zoom = request.zoom.unwrap_or(0);
        self.check_zoom(zoom, &opened)?;
        let mut system = opened.system(zoom, Some(wavelength_um))?;
        let effects = simplify_as_asked(&mut system, &opened, zoom, &choices)?;
        let refuse = |source| CliError::Rays { file: input::display_name(&self.rays), source };
        let tracer = Tracer::new(&system).map_err(refuse)?;
        let tracer = if self.unclipped { tracer.without_rims() } else { tracer };
        let rays: Vec<Ray<f64>> = request.rays.into_iter().map(Ray::from).collect();
        rays.iter().enumerate().try_for_each(|(i, ray)| ray.check(i)).map_err(refuse)?;
        let last = tracer.surfaces() - 1;
        let ghost = self.ghost_path(&system, &opened)?;
        let follow = |ray: &Ray<f64>| match &ghost {
            None => TracedRayJson::new(&tracer.trace(*ray), last),
            Some(path) => self.along_ghost(path, *ray, 1e-3 * wavelength_um),
        };
        let mut fates = Fates::default();
        let landings = rays.iter().map(follow).inspect(|ray| fates.count(ray.end));
        let rays = landings.collect();
        output.print(&TraceReport { wavelength_um, zoom, fates, rays, effects })
    }

    /// The path of the ghost that rays are to follow.
    fn ghost_path(
        &self,
        system: &System<f64>,
        opened: &LoadedLens,
    ) -> Result<Option<GhostPath>, CliError> {
        let Some(pair) = self.ghost else { return Ok(None) };
        let refuse = |why| CliError::Input(format!("--ghost: {}: {why}", opened.file));
        let path = GhostPath::new(system, pair.map(|surface| surface - 1)).map_err(refuse)?;
        Ok(Some(if self.unclipped { path.without_rims() } else { path }))
    }

    /// The end of a ray along the path of a ghost, with its light.
    fn along_ghost(&self, path: &GhostPath, ray: Ray<f64>, wavelength: f64) -> TracedRayJson {
        let GhostRay { traced, intensity } = path.trace(ray, wavelength, self.coating);
        let last = path.steps.len() - 1;
        let step = traced.fate.surface().unwrap_or(last);
        TracedRayJson {
            surface: path.steps[step],
            step: Some(step),
            intensity: traced.fate.is_imaged().then_some(intensity),
            backwards: None,
            ..TracedRayJson::new(&traced, last)
        }
    }

    /// Refuses a zoom position of the file of the rays that the lens does not have.
    fn check_zoom(&self, zoom: usize, opened: &LoadedLens) -> Result<(), CliError> {
        let last = opened.lens.zoom_positions() - 1;
        if zoom <= last {
            return Ok(());
        }
        let (rays, lens) = (input::display_name(&self.rays), &opened.file);
        let text =
            format!("{rays}: `zoom`: no zoom position {zoom} in {lens}; expected 0 to {last}");
        Err(CliError::Input(text))
    }
}

/// Removes the effects that are switched off from a system. Without such a switch nothing is left
/// out, and there is no plan to report.
fn simplify_as_asked(
    system: &mut System<f64>,
    opened: &LoadedLens,
    zoom: usize,
    choices: &EffectChoices,
) -> Result<Option<EffectReport>, CliError> {
    if !choices.leave_out_any() {
        return Ok(None);
    }
    let refuse = |source| CliError::RayModel { file: opened.file.clone(), source };
    let measured = effects::measure_effects(&opened.lens, zoom).map_err(refuse)?;
    let plan = choices.plan(&measured, TracePurpose::Trace);
    effects::simplify(system, &plan);
    Ok(Some(EffectReport::uncounted(plan.decisions)))
}

/// The rays of the input, with their conditions.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct RayRequest {
    wavelength_um: Option<f64>,
    zoom: Option<usize>,
    rays: Vec<RayJson>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct RayJson {
    x: f64,
    y: f64,
    z: f64,
    #[serde(rename = "L")]
    l: f64,
    #[serde(rename = "M")]
    m: f64,
    #[serde(rename = "N")]
    n: f64,
}

impl From<RayJson> for Ray<f64> {
    fn from(RayJson { x, y, z, l, m, n }: RayJson) -> Self {
        Self { point: Vec3::new(x, y, z), direction: Vec3::new(l, m, n) }
    }
}

/// The end of every ray.
#[derive(Serialize)]
struct TraceReport {
    wavelength_um: f64,
    zoom: usize,
    fates: Fates,
    rays: Vec<TracedRayJson>,
    #[serde(flatten)]
    effects: Option<EffectReport>,
}

#[derive(Serialize)]
struct TracedRayJson {
    fate: &'static str,
    surface: usize,
    x: f64,
    y: f64,
    z: f64,
    #[serde(rename = "L")]
    l: f64,
    #[serde(rename = "M")]
    m: f64,
    #[serde(rename = "N")]
    n: f64,
    opl: f64,
    #[serde(skip_serializing_if = "Option::is_none")]
    backwards: Option<usize>,
    /// The step of the path of a ghost.
    #[serde(skip_serializing_if = "Option::is_none")]
    step: Option<usize>,
    /// The light that arrives along that path, s and p polarised.
    #[serde(skip_serializing_if = "Option::is_none")]
    intensity: Option<[f64; 2]>,
    #[serde(skip)]
    end: Fate,
}

impl TracedRayJson {
    fn new(landing: &TracedRay<f64>, last: usize) -> Self {
        let (p, d) = (landing.ray.point, landing.ray.direction);
        Self {
            fate: landing.fate.name(),
            surface: landing.fate.surface().unwrap_or(last),
            x: p.x,
            y: p.y,
            z: p.z,
            l: d.x,
            m: d.y,
            n: d.z,
            opl: landing.opl,
            backwards: landing.first_backward_surface,
            step: None,
            intensity: None,
            end: landing.fate,
        }
    }
}

impl Display for TraceReport {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let head = ["ray", "fate", "surface", "x", "y", "z", "L", "M", "N", "opl", ""];
        let mut table = TextTable::new(&head);
        for (i, ray) in self.rays.iter().enumerate() {
            let numbers = [ray.x, ray.y, ray.z, ray.l, ray.m, ray.n, ray.opl];
            let remark =
                ray.backwards.map(|i| format!("backwards to surface {}", SurfaceNumber::new(i)));
            let start =
                [i.to_string(), ray.fate.to_owned(), SurfaceNumber::new(ray.surface).to_string()];
            let numbers = numbers.iter().map(|value| ShortNumber(*value).to_string());
            table.row(start.into_iter().chain(numbers).chain([remark.unwrap_or_default()]));
        }
        let Fates { imaged, missed, clipped, total_reflection, turned, trapped } = self.fates;
        let lost_in_grin = match turned + trapped {
            0 => String::new(),
            _ => format!(", {turned} turned back and {trapped} trapped by a gradient"),
        };
        write!(f, "{table}")?;
        writeln!(
            f,
            "{} um, zoom position {}: {imaged} imaged, {clipped} clipped, {missed} missed, \
             {total_reflection} totally reflected{lost_in_grin}",
            self.wavelength_um, self.zoom
        )?;
        match &self.effects {
            Some(effects) => write!(f, "\n{effects}"),
            None => writeln!(f, "effects: all of the lens that concern given rays are computed"),
        }
    }
}
