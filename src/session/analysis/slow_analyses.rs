//! The analyses that take longer than all else, one after another.

use super::contrast::{self, FieldContrasts};
use super::contrast_pages::{self, FieldContrastCurves, FocusContrasts};
use super::ghosts::{self, FieldGhosts};
use super::ray_images::{self as by_rays, RayImages};
use super::slow::SlowAnalysis;
use super::wavefronts::{self as waves, FieldWavefronts, PointImages};
use super::{
    AccuracyCurves, AnalysisOutput, AnalysisResults, ContrastPage, LOOKED_AT, MAP_COLUMNS,
    accuracy, model_with_all_rims,
};
use crate::analysis::{self, AnalysisError, GhostError, SpotMap};

/// The analyses that take longer than all else, in the order in which they follow.
pub(super) struct SlowAnalyses {
    ghosts: SlowAnalysis<Result<FieldGhosts, GhostError>>,
    spot_map: SlowAnalysis<Result<SpotMap, AnalysisError>>,
    contrasts: SlowAnalysis<FieldContrasts>,
    field_contrast: SlowAnalysis<FieldContrastCurves>,
    focus_contrasts: SlowAnalysis<FocusContrasts>,
    wavefronts: SlowAnalysis<FieldWavefronts>,
    point_images: SlowAnalysis<PointImages>,
    ray_images: SlowAnalysis<RayImages>,
    contrast_accuracy: SlowAnalysis<Result<AccuracyCurves, String>>,
    point_spread_accuracy: SlowAnalysis<Result<AccuracyCurves, String>>,
    picture_accuracy: SlowAnalysis<Result<AccuracyCurves, String>>,
}

impl SlowAnalyses {
    pub(super) fn new() -> Self {
        Self {
            ghosts: SlowAnalysis {
                is_asked: |settings| settings.ghosts,
                compute: |results, analyses, interrupted| {
                    let model = &analyses.ray_model.value;
                    ghosts::field_ghosts(model, &results.settings, interrupted)
                },
                slot: |analyses| &mut analyses.ghosts,
                known: None,
            },
            spot_map: SlowAnalysis {
                is_asked: |settings| settings.spot_map,
                compute: |AnalysisResults { lens, settings, .. }, analyses, interrupted| {
                    let (model, plan) = (&analyses.ray_model.value, &analyses.plan.value);
                    let model = model_with_all_rims(lens, settings.zoom, model, plan);
                    let map = analysis::spot_map(&model, MAP_COLUMNS, LOOKED_AT, interrupted);
                    (map != Err(AnalysisError::Interrupted)).then_some(map)
                },
                slot: |analyses| &mut analyses.spot_map,
                known: None,
            },
            contrasts: contrasts(),
            field_contrast: field_contrast(),
            focus_contrasts: focus_contrasts(),
            wavefronts: wavefronts(),
            point_images: point_images(),
            ray_images: ray_images(),
            contrast_accuracy: contrast_accuracy(),
            point_spread_accuracy: point_spread_accuracy(),
            picture_accuracy: picture_accuracy(),
        }
    }

    pub(super) fn publish(
        &mut self,
        results: AnalysisResults,
        output: &AnalysisOutput,
    ) -> AnalysisResults {
        let results = self.ghosts.publish(results, output);
        let results = self.spot_map.publish(results, output);
        let results = self.contrasts.publish(results, output);
        let results = self.field_contrast.publish(results, output);
        let results = self.focus_contrasts.publish(results, output);
        let results = self.wavefronts.publish(results, output);
        let results = self.ray_images.publish(results, output);
        let results = self.point_images.publish(results, output);
        let results = self.contrast_accuracy.publish(results, output);
        let results = self.point_spread_accuracy.publish(results, output);
        self.picture_accuracy.publish(results, output)
    }
}

fn contrast_accuracy() -> SlowAnalysis<Result<AccuracyCurves, String>> {
    SlowAnalysis {
        is_asked: |settings| settings.contrasts && settings.contrast_accuracy,
        compute: |_, analyses, interrupted| {
            let (model, spots) = (&analyses.ray_model.value, &analyses.spots.value);
            accuracy::contrast_accuracy(model, spots, interrupted)
        },
        slot: |analyses| &mut analyses.contrast_accuracy,
        known: None,
    }
}

fn point_spread_accuracy() -> SlowAnalysis<Result<AccuracyCurves, String>> {
    SlowAnalysis {
        is_asked: |settings| {
            settings.wavefronts && settings.point_images && settings.point_spread_accuracy
        },
        compute: |AnalysisResults { lens, settings, .. }, analyses, interrupted| {
            let fields = lens.fields_at(settings.zoom);
            accuracy::point_spread_accuracy(&analyses.ray_model.value, fields, interrupted)
        },
        slot: |analyses| &mut analyses.point_spread_accuracy,
        known: None,
    }
}

fn picture_accuracy() -> SlowAnalysis<Result<AccuracyCurves, String>> {
    SlowAnalysis {
        is_asked: |settings| settings.picture && settings.picture_accuracy,
        compute: |AnalysisResults { lens, settings, .. }, _, interrupted| {
            accuracy::picture_accuracy(lens, settings, interrupted)
        },
        slot: |analyses| &mut analyses.picture_accuracy,
        known: None,
    }
}

fn contrasts() -> SlowAnalysis<FieldContrasts> {
    SlowAnalysis {
        is_asked: |settings| settings.shows_contrast(ContrastPage::Frequency),
        compute: |results, analyses, interrupted| {
            let (model, spots) = (&analyses.ray_model.value, &analyses.spots.value);
            contrast::field_contrasts(model, spots, results.settings.tolerance, interrupted)
        },
        slot: |analyses| &mut analyses.contrasts,
        known: None,
    }
}

fn field_contrast() -> SlowAnalysis<FieldContrastCurves> {
    SlowAnalysis {
        is_asked: |settings| settings.shows_contrast(ContrastPage::Field),
        compute: |AnalysisResults { lens, settings, .. }, analyses, interrupted| {
            let (planned, plan) = (&analyses.ray_model.value, &analyses.plan.value);
            let model = model_with_all_rims(lens, settings.zoom, planned, plan);
            let spots = &analyses.spots.value;
            contrast_pages::field_contrast_curves(&model, spots, settings, interrupted)
        },
        slot: |analyses| &mut analyses.field_contrast,
        known: None,
    }
}

fn focus_contrasts() -> SlowAnalysis<FocusContrasts> {
    SlowAnalysis {
        is_asked: |settings| settings.shows_contrast(ContrastPage::Focus),
        compute: |results, analyses, interrupted| {
            let (model, spots) = (&analyses.ray_model.value, &analyses.spots.value);
            contrast_pages::focus_contrasts(model, spots, &results.settings, interrupted)
        },
        slot: |analyses| &mut analyses.focus_contrasts,
        known: None,
    }
}

fn wavefronts() -> SlowAnalysis<FieldWavefronts> {
    SlowAnalysis {
        is_asked: |settings| settings.wavefronts,
        compute: |results, analyses, interrupted| {
            let (model, settings) = (&analyses.ray_model.value, &results.settings);
            let light = settings.wavefront_light;
            waves::field_wavefronts(model, light, settings.tolerance, interrupted)
        },
        slot: |analyses| &mut analyses.wavefronts,
        known: None,
    }
}

fn point_images() -> SlowAnalysis<PointImages> {
    SlowAnalysis {
        is_asked: |settings| settings.wavefronts && settings.point_images,
        compute: |results, analyses, interrupted| {
            let (model, spots) = (&analyses.ray_model.value, &analyses.spots.value);
            let light = results.settings.wavefront_light;
            waves::point_images(model, light, spots, interrupted)
        },
        slot: |analyses| &mut analyses.point_images,
        known: None,
    }
}

fn ray_images() -> SlowAnalysis<RayImages> {
    SlowAnalysis {
        is_asked: |settings| settings.wavefronts && settings.ray_images,
        compute: |_, analyses, interrupted| {
            let (model, spots) = (&analyses.ray_model.value, &analyses.spots.value);
            by_rays::ray_images(model, spots, interrupted)
        },
        slot: |analyses| &mut analyses.ray_images,
        known: None,
    }
}
