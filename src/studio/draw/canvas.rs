//! A drawn scene in the window, drawn anew only when scene, camera or size change.

use std::collections::HashMap;
use std::sync::Arc;

use eframe::egui_wgpu::{
    Callback, CallbackResources, CallbackTrait, RenderState, ScreenDescriptor,
};
use egui::{
    ColorImage, PaintCallbackInfo, Pos2, Rect, TextureHandle, TextureOptions, Ui,
    emath::GuiRounding,
};
use wgpu::{
    BindGroup, BindGroupDescriptor, BindGroupEntry, BindingResource, BlendState, ColorTargetState,
    ColorWrites, CommandBuffer, CommandEncoder, Device, FragmentState, MultisampleState,
    PipelineCompilationOptions, PrimitiveState, Queue, RenderPass, RenderPipeline,
    RenderPipelineDescriptor, TextureFormat, TextureViewDescriptor, VertexState, include_wgsl,
};

use super::{Camera, Scene, gpu, software};
use crate::studio::cached::{ByAddress, Cached};

/// The renderer of the scenes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum RenderBackend {
    /// The graphics card, or a software adapter in its place.
    Gpu,
    /// The processor, where the window has come up without wgpu.
    Software,
}

/// The key of a drawn scene.
#[derive(Clone, Debug, PartialEq)]
struct CanvasKey {
    scene: ByAddress<Scene>,
    camera: Camera,
    size: [u32; 2],
}

/// A place in the window that shows a scene.
pub struct SceneCanvas {
    name: &'static str,
    texture: Cached<CanvasKey, TextureHandle>,
}

impl std::fmt::Debug for SceneCanvas {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Canvas").field("name", &self.name).finish_non_exhaustive()
    }
}

impl SceneCanvas {
    /// A canvas; no two of one window share a name.
    pub const fn new(name: &'static str) -> Self {
        Self { name, texture: Cached::new() }
    }

    /// Shows a scene in a part of the window. The camera counts the window's real pixels.
    pub fn show(
        &mut self,
        ui: &Ui,
        rect: Rect,
        backend: RenderBackend,
        scene: &Arc<Scene>,
        camera: Camera,
    ) {
        let per_point = ui.ctx().pixels_per_point();
        let rect = rect.round_to_pixels(per_point);
        let size = pixels(rect, per_point);
        if size.contains(&0) {
            return;
        }
        let key = CanvasKey { scene: scene.into(), camera, size };
        match backend {
            RenderBackend::Gpu => {
                let callback =
                    Callback::new_paint_callback(rect, SceneCallback { name: self.name, key });
                ui.painter().add(callback);
            }
            RenderBackend::Software => self.show_texture(ui, rect, key),
        }
    }

    fn show_texture(&mut self, ui: &Ui, rect: Rect, key: CanvasKey) {
        let texture = self.texture.get(key, |key| {
            let picture = software::draw(&key.scene, key.camera, key.size);
            let size = key.size.map(|n| n as usize);
            let image = ColorImage::from_rgba_premultiplied(size, &picture.rgba);
            ui.ctx().load_texture(self.name, image, TextureOptions::NEAREST)
        });
        let all = Rect::from_min_max(Pos2::ZERO, egui::pos2(1.0, 1.0));
        ui.painter().image(texture.id(), rect, all, egui::Color32::WHITE);
    }
}

/// The size of a pane in real pixels.
fn pixels(rect: Rect, per_point: f32) -> [u32; 2] {
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "saturates")]
    [rect.width(), rect.height()].map(|length| (length * per_point).round() as u32)
}

/// Asks the window's renderer to show a scene.
struct SceneCallback {
    name: &'static str,
    key: CanvasKey,
}

impl CallbackTrait for SceneCallback {
    fn prepare(
        &self,
        device: &Device,
        _queue: &Queue,
        _screen: &ScreenDescriptor,
        encoder: &mut CommandEncoder,
        resources: &mut CallbackResources,
    ) -> Vec<CommandBuffer> {
        if let Some(cache) = resources.get_mut::<GpuCache>() {
            cache.refresh(device, encoder, self);
        }
        Vec::new()
    }

    fn paint(
        &self,
        _info: PaintCallbackInfo,
        pass: &mut RenderPass<'static>,
        resources: &CallbackResources,
    ) {
        if let Some(cache) = resources.get::<GpuCache>() {
            cache.show(pass, self.name);
        }
    }
}

/// The window's drawings on the graphics card.
struct GpuCache {
    renderer: gpu::SceneRenderer,
    pipeline: RenderPipeline,
    textures: HashMap<&'static str, (CanvasKey, BindGroup)>,
}

/// Lets the canvases of a window use its graphics card.
pub fn install_gpu_cache(state: &RenderState) {
    let cache = GpuCache {
        renderer: gpu::SceneRenderer::new(&state.device),
        pipeline: show_pipeline(&state.device, state.target_format),
        textures: HashMap::new(),
    };
    state.renderer.write().callback_resources.insert(cache);
}

impl GpuCache {
    fn refresh(&mut self, device: &Device, encoder: &mut CommandEncoder, callback: &SceneCallback) {
        if self.textures.get(callback.name).is_some_and(|(key, _)| *key == callback.key) {
            return;
        }
        let CanvasKey { scene, camera, size } = &callback.key;
        let texture = self.renderer.draw(device, encoder, scene, *camera, *size);
        let view = texture.create_view(&TextureViewDescriptor::default());
        let group = device.create_bind_group(&BindGroupDescriptor {
            label: Some(callback.name),
            layout: &self.pipeline.get_bind_group_layout(0),
            entries: &[BindGroupEntry {
                binding: 0,
                resource: BindingResource::TextureView(&view),
            }],
        });
        self.textures.insert(callback.name, (callback.key.clone(), group));
    }

    fn show(&self, pass: &mut RenderPass<'static>, name: &str) {
        if let Some((_, group)) = self.textures.get(name) {
            pass.set_pipeline(&self.pipeline);
            pass.set_bind_group(0, group, &[]);
            pass.draw(0..3, 0..1);
        }
    }
}

fn show_pipeline(device: &Device, format: TextureFormat) -> RenderPipeline {
    let module = device.create_shader_module(include_wgsl!("show.wgsl"));
    let entry_point = if format.is_srgb() { "to_linear_target" } else { "to_gamma_target" };
    device.create_render_pipeline(&RenderPipelineDescriptor {
        label: Some("show"),
        layout: None,
        vertex: VertexState {
            module: &module,
            entry_point: Some("cover"),
            buffers: &[],
            compilation_options: PipelineCompilationOptions::default(),
        },
        primitive: PrimitiveState::default(),
        depth_stencil: None,
        multisample: MultisampleState::default(),
        fragment: Some(FragmentState {
            module: &module,
            entry_point: Some(entry_point),
            targets: &[Some(ColorTargetState {
                format,
                blend: Some(BlendState::PREMULTIPLIED_ALPHA_BLENDING),
                write_mask: ColorWrites::ALL,
            })],
            compilation_options: PipelineCompilationOptions::default(),
        }),
        multiview_mask: None,
        cache: None,
    })
}
