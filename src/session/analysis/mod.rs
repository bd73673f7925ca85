//! The analyses of all panels, computed in the background for the latest lens only.
//!
//! A newer request replaces one that has not begun, and interrupts one that has between two analyses,
//! the contrast also between two frequencies.
//! Results carry the version of the design that they belong to and the time of each analysis.

mod accuracy;
mod as_built;
mod contrast;
mod contrast_pages;
mod ghosts;
mod pages;
mod picture_options;
mod pupils;
mod ray_images;
mod scene;
mod scene_picture;
mod slow;
mod slow_analyses;
mod wavefronts;

pub(super) use accuracy::field_name;
pub use accuracy::{AccuracyCurves, AccuracyPoint};
pub use as_built::{AsBuiltLens, confirm_as_built, predict_as_built};
pub use contrast::{FieldContrast, FieldContrasts};
pub use contrast_pages::{FieldContrastCurves, FocusContrasts};
pub use ghosts::FieldGhosts;
pub use pages::{ContrastPage, FieldPage};
pub use picture_options::{PictureEffect, PictureFocus, PictureOptions};
pub use pupils::FieldPupils;
pub use ray_images::{FieldRayImage, RayImages};
pub use scene::{PictureScene, SceneFile};
use scene_picture::PictureExtras;
pub use scene_picture::ScenePicture;
pub use wavefronts::{ENERGY_SHARES, FieldWavefront, FieldWavefronts, PointImage, PointImages};

use super::clock::{Timed, now, time};
use super::run::{LatestRequestWorker, WorkerOutput, catch_panic};
use crate::analysis::{
    self, AnalysisError, Coating, Fan, FieldCurves, Footprint, GhostError, GridPoint, ImageLight,
    LongitudinalAberration, PathFan, RayLayout, Spot, SpotMap, SpotPoints,
};
use crate::effects::{self, Effect, EffectOverride, EffectOverrides, EffectPlan, TracePurpose};
use crate::lens::{FieldPoint, Lens};
use crate::math::Vec3;
use crate::measure::EffectTask;
use crate::paraxial::{FirstOrder, Seidel};
use crate::picture::BuiltInScene;
use crate::pupil::{Accuracy, RayModel, RayModelError};
use crate::tolerance::{LoosestGoal, ToleranceGrade};
use pupils::{field_pupils, for_each_field};
use serde::{Deserialize, Serialize};
use slow_analyses::SlowAnalyses;
use std::io;
use std::sync::Arc;
use std::time::{Duration, Instant};

/// The ray fans of each field, or the reason why it has none.
pub type FieldFans = Vec<Result<Vec<Fan>, AnalysisError>>;

/// The fans of path differences of each field, or the reason why it has none.
pub type FieldPathFans = Vec<Result<Vec<PathFan>, AnalysisError>>;

/// The footprints of each field, or the reason why it has none.
pub type FieldFootprints = Vec<Result<Vec<Footprint>, AnalysisError>>;

/// The analyses of one version of the design.
#[derive(Debug, Clone)]
pub struct AnalysisResults {
    /// The version of the design.
    pub version: u64,
    /// The lens.
    pub lens: Arc<Lens>,
    /// The settings of the analyses.
    pub settings: AnalysisSettings,
    /// The analyses, or the reason why there are none.
    pub analyses: Result<Analyses, String>,
    /// The time of all analyses together, in milliseconds.
    pub ms: f64,
}

/// The analyses of a lens at one zoom position, each with its time.
#[derive(Debug, Clone)]
pub struct Analyses {
    /// The lens with its beam, ready for tracing.
    pub ray_model: Timed<Arc<RayModel>>,
    /// The Seidel sums; `None` without a chief ray.
    pub seidel: Timed<Option<Seidel<f64>>>,
    /// The effects that are computed, each with the reason.
    pub plan: Timed<EffectPlan>,
    /// The rays of the layout.
    pub layout: Timed<RayLayout>,
    /// The clear semi-diameters: the largest distance from the axis at which light of any field,
    /// wavelength and zoom position meets each surface, the image plane last, in mm.
    pub semi_diameters: Timed<Vec<f64>>,
    /// The points of the spot diagrams, in the order of fields and then wavelengths.
    pub spot_points: Timed<Vec<SpotPoints>>,
    /// The spot of each field.
    pub spots: Timed<Vec<Result<Spot, AnalysisError>>>,
    /// The radius of the first dark ring of a perfect lens, in mm; `None` if it is not defined.
    pub airy: Option<f64>,
    /// The pupils of the fields; `None` while no panel shows them.
    pub pupils: Option<Timed<FieldPupils>>,
    /// The contrast of the fields; `None` while no panel shows it, and at first: it may take longer than
    /// all else.
    pub contrasts: Option<Arc<Timed<FieldContrasts>>>,
    /// The contrast over the field; `None` while no panel shows it, and at first.
    pub field_contrast: Option<Arc<Timed<FieldContrastCurves>>>,
    /// The contrast through focus; `None` while no panel shows it, and at first.
    pub focus_contrasts: Option<Arc<Timed<FocusContrasts>>>,
    /// The wavefronts of the fields; `None` while no panel shows them, and at first.
    pub wavefronts: Option<Arc<Timed<FieldWavefronts>>>,
    /// The images of a point by diffraction; `None` while no panel shows them, and at first.
    pub point_images: Option<Arc<Timed<PointImages>>>,
    /// The images of a point by rays alone; `None` while no panel shows them, and at first.
    pub ray_images: Option<Arc<Timed<RayImages>>>,
    /// Error against time of contrast, or the reason why it is not known; `None` while no panel shows it, and
    /// at first.
    pub contrast_accuracy: Option<Arc<Timed<Result<AccuracyCurves, String>>>>,
    /// The same of the point spread.
    pub point_spread_accuracy: Option<Arc<Timed<Result<AccuracyCurves, String>>>>,
    /// The same of pictures.
    pub picture_accuracy: Option<Arc<Timed<Result<AccuracyCurves, String>>>>,
    /// A scene through the lens, or the reason why there is none; `None` while no panel shows it.
    pub picture: Option<Arc<Timed<Result<ScenePicture, String>>>>,
    /// The lens as it is made, or the reason why nothing is known of it; `None` while no panel shows it,
    /// and at first: it takes longer than all else.
    pub as_built: Option<Arc<Timed<Result<AsBuiltLens, String>>>>,
    /// The ray fans of each field; `None` while no panel shows them.
    pub fans: Option<Timed<FieldFans>>,
    /// The fans of path differences of each field; `None` while no panel shows them.
    pub path_fans: Option<Timed<FieldPathFans>>,
    /// Distortion, field curvature and illumination over the field; `None` while no panel shows them.
    pub field_curves: Option<Timed<FieldCurves>>,
    /// The crossings of rays with the axis over the pupil; `None` while no panel shows them.
    pub longitudinal: Option<Timed<Result<Vec<LongitudinalAberration>, AnalysisError>>>,
    /// The image of a square grid; `None` while no panel shows it.
    pub grid: Option<Timed<Result<Vec<GridPoint>, AnalysisError>>>,
    /// The footprints of each field on all surfaces, the image plane last; `None` while no panel shows
    /// them.
    pub footprints: Option<Timed<FieldFootprints>>,
    /// The spot radius over the whole field; `None` while no panel shows it, and at first.
    pub spot_map: Option<Arc<Timed<Result<SpotMap, AnalysisError>>>>,
    /// The ghosts of the fields; `None` while no panel shows them, and at first.
    pub ghosts: Option<Arc<Timed<Result<FieldGhosts, GhostError>>>>,
    /// The rays of the ghost that is looked at, from in front of the lens.
    pub ghost_rays: Vec<Vec<Vec3<f64>>>,
}

impl Analyses {
    /// First-order data at the primary wavelength.
    pub fn first_order(&self) -> &FirstOrder<f64> {
        &self.ray_model.value.first_order
    }
}

/// A request for the analyses of a lens.
#[derive(Debug, Clone)]
pub(super) struct AnalysisRequest {
    pub(super) version: u64,
    pub(super) lens: Arc<Lens>,
    pub(super) settings: AnalysisSettings,
}

/// The treatment of the costs of effects while no request waits.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum EffectTiming {
    /// The costs are measured.
    Measured,
    /// The costs stay unknown.
    Skipped,
}

/// The age at which an analysis yields to a newer request, unless nothing was published for longer than
/// `MAX_GAP`: while a value is dragged, the numbers follow it.
const YIELD_AGE: Duration = Duration::from_millis(50);
/// The longest time without results while requests arrive.
const MAX_GAP: Duration = Duration::from_millis(200);
/// The time without a request after which the costs of effects are measured.
const IDLE_TIME: Duration = Duration::from_millis(300);

/// Computes the analyses of all panels in the background, for the latest lens only.
pub(super) type AnalysisWorker = LatestRequestWorker<AnalysisRequest, AnalysisResults>;

type AnalysisOutput = WorkerOutput<AnalysisRequest, AnalysisResults>;

/// Starts the thread. `wake` is called from it when there are new results.
pub(super) fn spawn_analysis(
    timing: EffectTiming,
    wake: impl Fn() + Send + 'static,
) -> io::Result<AnalysisWorker> {
    let mut published = None;
    let mut slow = SlowAnalyses::new();
    AnalysisWorker::spawn("analysis", wake, move |request, output| {
        let results = answer(request, output, &mut published);
        let mut slower = |results| publish_prediction(slow.publish(results, output), output);
        let refined = results.map(|results| refine(slower(results), output));
        if let (Some(results), EffectTiming::Measured) = (refined, timing) {
            measure(results, output);
        }
    })
}

/// The number of columns of a map of the field.
const MAP_COLUMNS: usize = 21;
/// The number of points on the edge of a footprint.
const FOOTPRINT_POINTS: usize = 72;
/// The tolerance of what is looked at in a map, and the rays that each number may take.
const LOOKED_AT: Accuracy = Accuracy { tolerance: 1e-2, max_rays: 10_000 };

/// Publishes the results of a request. `None` if it was interrupted.
fn answer(
    request: AnalysisRequest,
    output: &AnalysisOutput,
    published: &mut Option<Instant>,
) -> Option<AnalysisResults> {
    let start = now();
    let recent = published.is_some_and(|last| start.duration_since(last) < MAX_GAP);
    let is_superseded = || recent && start.elapsed() > YIELD_AGE && output.is_interrupted();
    let interrupted = || output.is_closed() || is_superseded();
    let AnalysisRequest { version, lens, settings } = request;
    let computed = catch_panic(|| Ok(analyze_unless(&lens, &settings, interrupted)));
    let analyses = computed.unwrap_or_else(|why| Some(Err(why)))?;
    let ms = start.elapsed().as_secs_f64() * 1e3;
    let results = AnalysisResults { version, lens, settings, analyses, ms };
    *published = Some(now());
    output.publish(results.clone());
    Some(results)
}

/// As [`catch_panic`], for work that may have no result.
fn caught<T>(work: impl FnOnce() -> Option<Result<T, String>>) -> Option<Result<T, String>> {
    catch_panic(|| Ok(work())).unwrap_or_else(|why| Some(Err(why)))
}

/// A prediction of lenses as they are made gives way to a newer request after this time only: else it
/// would not follow a lens that is dragged.
const LONGEST_PREDICTION: Duration = Duration::from_secs(1);

/// Publishes the results once more with the lens as it is made if a panel shows it and no request
/// waits.
fn publish_prediction(mut results: AnalysisResults, output: &AnalysisOutput) -> AnalysisResults {
    let Ok(analyses) = &mut results.analyses else { return results };
    if results.settings.tolerances && !output.is_interrupted() {
        let (is_interrupted, start) = (output.interruption(), now());
        let stop = || start.elapsed() > LONGEST_PREDICTION && is_interrupted();
        let (lens, settings) = (&results.lens, &results.settings);
        let predict = || as_built::predict_unless(lens, settings, &stop);
        let Timed { value, ms } = time(|| caught(predict));
        let Some(value) = value else { return results };
        analyses.as_built = Some(Arc::new(Timed { value, ms }));
        output.publish(results.clone());
    }
    results
}

/// Publishes the results once more with a fine picture, and with real lenses as they are made, if panels
/// show these and no request interrupts that.
fn refine(mut results: AnalysisResults, output: &AnalysisOutput) -> AnalysisResults {
    let settings = results.settings.clone();
    let asked = settings.picture || settings.tolerances;
    let Ok(analyses) = &mut results.analyses else { return results };
    if !asked || !output.idle_for(IDLE_TIME) {
        return results;
    }
    let (zoom, scene) = (settings.zoom, settings.picture_scene());
    if settings.tolerances {
        let is_interrupted = output.interruption();
        let confirm = || as_built::confirm_unless(&results.lens, &settings, &is_interrupted);
        let Timed { value, ms } = time(|| caught(confirm));
        if let Some(value) = value {
            analyses.as_built = Some(Arc::new(Timed { value, ms }));
        }
    }
    if settings.picture && !output.is_interrupted() {
        let lens = &results.lens;
        let extras =
            PictureExtras { all_tiles: settings.picture_errors, points: settings.picture_points };
        let is_interrupted = output.interruption();
        let subject = (&scene, &settings.picture_options);
        let draw = || scene_picture::fine_picture(lens, zoom, subject, extras, &is_interrupted);
        let fine = time(|| catch_panic(draw));
        // A part of a picture is worth less than a coarse one.
        if fine.value.as_ref().map_or(true, |fine| fine.picture.complete) {
            analyses.picture = Some(Arc::new(fine));
        }
    }
    output.publish(results.clone());
    results
}

/// Publishes the results once more with the cost of each effect, if no request interrupts that.
fn measure(mut results: AnalysisResults, output: &AnalysisOutput) {
    let Ok(analyses) = &mut results.analyses else { return };
    if !output.idle_for(IDLE_TIME) {
        return;
    }
    let (lens, settings) = (&results.lens, &results.settings);
    let plan = catch_panic(|| {
        let AnalysisSettings { zoom, tolerance, ref overrides, .. } = *settings;
        let task = EffectTask { lens, zoom, tolerance, overrides };
        let facts = task.measure_effects().map_err(|why| why.to_string())?;
        Ok(task.measure_costs(&facts, || output.is_interrupted()))
    });
    if let Ok(Some(plan)) = plan {
        analyses.plan.value = plan;
        output.publish(results);
    }
}

/// Computes all analyses of a lens.
///
/// # Errors
/// A lens or aperture through which nothing can be traced.
pub fn analyze(lens: &Lens, settings: &AnalysisSettings) -> Result<Analyses, String> {
    let never = || false;
    analyze_unless(lens, settings, never).unwrap_or_else(|| Err("interrupted".to_owned()))
}

fn analyze_unless(
    lens: &Lens,
    settings: &AnalysisSettings,
    interrupted: impl Fn() -> bool,
) -> Option<Result<Analyses, String>> {
    let plan = time(|| plan_effects(lens, settings));
    let plan = match plan.value {
        Ok(value) => Timed { value, ms: plan.ms },
        Err(error) => return Some(Err(error.to_string())),
    };
    let ray_model = time(|| effects::build_ray_model(lens, settings.zoom, &plan.value));
    match ray_model.value {
        Ok(value) => {
            let ray_model = Timed { value: Arc::new(value), ms: ray_model.ms };
            Analyses::of(lens, ray_model, plan, settings, interrupted).map(Ok)
        }
        Err(error) => Some(Err(error.to_string())),
    }
}

fn plan_effects(lens: &Lens, settings: &AnalysisSettings) -> Result<EffectPlan, RayModelError> {
    let facts = effects::measure_effects(lens, settings.zoom)?;
    Ok(effects::plan(&facts, TracePurpose::Spot(settings.tolerance), &settings.overrides))
}

/// The number of points of a ray fan.
const FAN_POINTS: usize = 65;
/// The number of zones of the longitudinal aberration.
const ZONES: usize = 40;
/// The number of squares along a side of the grid of distortion.
const SQUARES: usize = 10;

impl Analyses {
    /// Computes all analyses, those that are looked at first in front. `None` if interrupted.
    fn of(
        lens: &Lens,
        ray_model: Timed<Arc<RayModel>>,
        plan: Timed<EffectPlan>,
        settings: &AnalysisSettings,
        interrupted: impl Fn() -> bool,
    ) -> Option<Self> {
        let unless_interrupted = || (!interrupted()).then_some(());
        let b = Arc::clone(&ray_model.value);
        let ghost_rays = ghosts::ghost_rays(&b, settings);
        let accuracy = Accuracy { tolerance: settings.tolerance, ..Accuracy::default() };
        let layout = time(|| analysis::ray_layout(&b, settings.rays));
        unless_interrupted()?;
        let semi_diameters = time(|| all_semi_diameters(lens, &b, settings.zoom));
        unless_interrupted()?;
        let scatter = time(|| analysis::spot_points(&b));
        unless_interrupted()?;
        let spots = time(|| for_each_field(&b, |field| spot_with_time(&b, field, accuracy)));
        unless_interrupted()?;
        let pupils = settings.pupils.then(|| time(|| field_pupils(&b, settings, accuracy)));
        unless_interrupted()?;
        let picture = settings.picture.then(|| {
            let scene = settings.picture_scene();
            let options = &settings.picture_options;
            Arc::new(time(|| scene_picture::coarse_picture(lens, settings.zoom, &scene, options)))
        });
        unless_interrupted()?;
        let numbers = Self {
            seidel: time(|| b.seidel()),
            airy: analysis::airy_radius(&b),
            ray_model,
            plan,
            layout,
            semi_diameters,
            spot_points: scatter,
            spots,
            pupils,
            contrasts: None,
            field_contrast: None,
            focus_contrasts: None,
            wavefronts: None,
            point_images: None,
            ray_images: None,
            contrast_accuracy: None,
            point_spread_accuracy: None,
            picture_accuracy: None,
            picture,
            as_built: None,
            fans: None,
            path_fans: None,
            field_curves: None,
            longitudinal: None,
            grid: None,
            footprints: None,
            spot_map: None,
            ghosts: None,
            ghost_rays,
        };
        numbers.with_charts(lens, settings, interrupted)
    }

    /// The same with the charts that panels show. `None` if interrupted.
    fn with_charts(
        self,
        lens: &Lens,
        settings: &AnalysisSettings,
        interrupted: impl Fn() -> bool,
    ) -> Option<Self> {
        let unless_interrupted = || (!interrupted()).then_some(());
        let b = Arc::clone(&self.ray_model.value);
        let accuracy = Accuracy { tolerance: settings.tolerance, ..Accuracy::default() };
        let fans = settings.fans.then(|| time(|| field_fans(&b)));
        let path_fans = settings.path_fans.then(|| time(|| field_path_fans(&b)));
        unless_interrupted()?;
        let shows = |page| settings.field_curves && settings.field_page == page;
        let field_curves = shows(FieldPage::Curves).then(|| {
            time(|| {
                let model = model_with_all_rims(lens, settings.zoom, &b, &self.plan.value);
                analysis::field_curves(&model, accuracy)
            })
        });
        let longitudinal = shows(FieldPage::Longitudinal)
            .then(|| time(|| analysis::longitudinal_aberration(&b, ZONES)));
        let grid = shows(FieldPage::Grid)
            .then(|| time(|| analysis::distortion_grid(&b, b.primary, SQUARES)));
        unless_interrupted()?;
        let footprints = settings.footprints.then(|| time(|| field_footprints(&b)));
        unless_interrupted()?;
        Some(Self { fans, path_fans, field_curves, longitudinal, grid, footprints, ..self })
    }
}

fn field_fans(model: &RayModel) -> FieldFans {
    for_each_field(model, |field| analysis::fan(model, field, FAN_POINTS))
}

fn field_path_fans(model: &RayModel) -> FieldPathFans {
    for_each_field(model, |field| analysis::path_fans(model, field, FAN_POINTS))
}

fn field_footprints(model: &RayModel) -> FieldFootprints {
    let edge = |field| analysis::footprints(model, field, model.primary, FOOTPRINT_POINTS);
    for_each_field(model, edge)
}

/// The rays of a plan with all its rims: light at a point of the image comes from other fields than those
/// of the plan.
fn model_with_all_rims(
    lens: &Lens,
    zoom: usize,
    planned: &Arc<RayModel>,
    plan: &EffectPlan,
) -> Arc<RayModel> {
    let clipping = plan.decision(Effect::Clipping);
    let is_off = clipping.is_some_and(|decision| decision.choice == EffectOverride::Off);
    if is_off || plan.unclipped.is_empty() {
        return Arc::clone(planned);
    }
    let plan = EffectPlan { unclipped: Vec::new(), ..plan.clone() };
    let model = effects::build_ray_model(lens, zoom, &plan);
    model.map_or_else(|_| Arc::clone(planned), Arc::new)
}

/// The clear semi-diameters over all zoom positions; one at which nothing can be traced counts for
/// nothing.
fn all_semi_diameters(lens: &Lens, shown: &RayModel, zoom: usize) -> Vec<f64> {
    let others = (0..lens.zoom_positions()).filter(|position| *position != zoom);
    let others: Vec<RayModel> =
        others.filter_map(|position| RayModel::from_lens(lens, position).ok()).collect();
    analysis::clear_semi_diameters(others.iter().chain([shown]))
}

/// The spot of a field, with the time of its estimates.
fn spot_with_time(
    ray_model: &RayModel,
    field: FieldPoint,
    accuracy: Accuracy,
) -> Result<Spot, AnalysisError> {
    let Timed { value, ms } = time(|| analysis::spot(ray_model, field, accuracy));
    let mut spot = value?;
    for number in [&mut spot.rms, &mut spot.radius] {
        number.milliseconds = Some(ms);
    }
    Ok(spot)
}

/// The settings of the analyses.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[expect(
    clippy::struct_excessive_bools,
    reason = "each panel that is shown has a switch of its own"
)]
pub struct AnalysisSettings {
    /// The relative error allowed of the numbers.
    pub tolerance: f64,
    /// The index of the zoom position.
    pub zoom: usize,
    /// The number of rays of each field in the layout.
    pub rays: usize,
    /// The effects that are not left to the plan.
    pub overrides: EffectOverrides,
    /// True if the pupils are computed, because a panel shows them.
    pub pupils: bool,
    /// True if the contrast is computed, because a panel shows it.
    #[serde(default)]
    pub contrasts: bool,
    /// The page of the contrast that is computed.
    #[serde(default)]
    pub contrast_page: ContrastPage,
    /// The highest spatial frequency of the contrast over the field, and that through focus, in cycles/mm;
    /// `None` for one that the lens resolves well.
    #[serde(default)]
    pub contrast_frequency: Option<f64>,
    /// True if error against time of contrast is measured, because the panel shows it.
    #[serde(default)]
    pub contrast_accuracy: bool,
    /// True if the wavefronts are computed, because a panel shows them.
    #[serde(default)]
    pub wavefronts: bool,
    /// True if the images of a point are computed beside the wavefronts, because the panel shows them.
    #[serde(default)]
    pub point_images: bool,
    /// True if the images of a point by rays are computed, because the panel shows them.
    #[serde(default)]
    pub ray_images: bool,
    /// The light of the images of a point, and of the wavefronts where it is of one wavelength; `None` for the
    /// primary one, in which wavefronts are computed too where images are in all light.
    #[serde(default)]
    pub wavefront_light: Option<ImageLight>,
    /// True if the ray fans are computed, because a panel shows them.
    #[serde(default)]
    pub fans: bool,
    /// True if the fans of path differences are computed, because a panel shows them.
    #[serde(default)]
    pub path_fans: bool,
    /// True if results over the field are computed, because a panel shows them.
    #[serde(default)]
    pub field_curves: bool,
    /// The page of these results that is computed.
    #[serde(default)]
    pub field_page: FieldPage,
    /// True if the footprints are computed, because a panel shows them.
    #[serde(default)]
    pub footprints: bool,
    /// True if the spot is computed over the whole field, because a panel shows it.
    #[serde(default)]
    pub spot_map: bool,
    /// True if the ghosts are computed, because a panel shows them.
    #[serde(default)]
    pub ghosts: bool,
    /// The coating of the surfaces that make ghosts.
    #[serde(default)]
    pub coating: Coating,
    /// The surfaces of the first and of the second reflection of the ghost that the layout shows.
    #[serde(default)]
    pub ghost: Option<[usize; 2]>,
    /// True if the picture of a scene is computed, because a panel shows it.
    #[serde(default)]
    pub picture: bool,
    /// The scene of the picture.
    #[serde(default)]
    pub scene: BuiltInScene,
    /// The picture from a file that takes the place of that scene.
    #[serde(skip)]
    pub scene_file: Option<SceneFile>,
    /// The options of the picture.
    #[serde(default)]
    pub picture_options: PictureOptions,
    /// True if error against time of the point spread is measured, because the panel shows it.
    #[serde(default)]
    pub point_spread_accuracy: bool,
    /// True if error against time of pictures is measured, because the panel shows it.
    #[serde(default)]
    pub picture_accuracy: bool,
    /// True if the error of the picture is measured everywhere, because a panel shows it.
    #[serde(default)]
    pub picture_errors: bool,
    /// True if the images of points over the picture are computed, because a panel shows them.
    #[serde(default)]
    pub picture_points: bool,
    /// True if the lens as it is made is computed, because a panel shows it.
    #[serde(default)]
    pub tolerances: bool,
    /// The class of care in making of a lens without tolerances of its own.
    #[serde(default)]
    pub grade: ToleranceGrade,
    /// The largest rms spot radius of a good lens in mm; `None` for no yield.
    #[serde(default)]
    pub good_rms: Option<f64>,
    /// The frequency in cycles/mm at which lenses as made have a contrast; `None` for none.
    #[serde(default)]
    pub tolerance_frequency: Option<f64>,
    /// The aim of the loosest tolerances; `None` to find none.
    #[serde(default)]
    pub loosest: Option<LoosestGoal>,
    /// The index of the wavelength of the pupils; `None` for the primary one.
    pub pupil_wavelength: Option<usize>,
}

impl AnalysisSettings {
    /// True if a panel shows this page of the contrast.
    pub fn shows_contrast(&self, page: ContrastPage) -> bool {
        self.contrasts && self.contrast_page == page
    }

    /// The scene of the picture.
    pub fn picture_scene(&self) -> PictureScene {
        let built_in = PictureScene::BuiltIn(self.scene);
        self.scene_file.clone().map_or(built_in, PictureScene::File)
    }
}

impl Default for AnalysisSettings {
    fn default() -> Self {
        Self {
            tolerance: 1e-3,
            zoom: 0,
            rays: 15,
            overrides: EffectOverrides::default(),
            pupils: false,
            contrasts: false,
            contrast_page: ContrastPage::default(),
            contrast_frequency: None,
            contrast_accuracy: false,
            wavefronts: false,
            point_images: false,
            ray_images: false,
            wavefront_light: None,
            fans: false,
            path_fans: false,
            field_curves: false,
            field_page: FieldPage::default(),
            footprints: false,
            spot_map: false,
            ghosts: false,
            coating: Coating::default(),
            ghost: None,
            picture: false,
            scene: BuiltInScene::default(),
            scene_file: None,
            picture_options: PictureOptions::default(),
            point_spread_accuracy: false,
            picture_accuracy: false,
            picture_errors: false,
            picture_points: false,
            tolerances: false,
            grade: ToleranceGrade::default(),
            good_rms: None,
            tolerance_frequency: None,
            loosest: None,
            pupil_wavelength: None,
        }
    }
}
