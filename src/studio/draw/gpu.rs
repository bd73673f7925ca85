//! The scene drawn on the graphics card, through `scene.wgsl`: one instanced quad a segment, the
//! ramp at its rim in the shader.

use bytemuck::{Pod, Zeroable};
use glam::Vec2;
use thiserror::Error;
use wgpu::util::{BufferInitDescriptor, DeviceExt};
use wgpu::vertex_attr_array as attributes;
use wgpu::{
    Backends, BindGroup, BindGroupDescriptor, BindGroupEntry, BindGroupLayout,
    BindGroupLayoutDescriptor, BindGroupLayoutEntry, BindingType, BlendState, Buffer,
    BufferAsyncError, BufferBindingType, BufferDescriptor, BufferUsages,
    COPY_BYTES_PER_ROW_ALIGNMENT, Color, ColorTargetState, ColorWrites, CommandEncoder,
    CommandEncoderDescriptor, Device, DeviceDescriptor, Extent3d, FragmentState, Instance,
    InstanceDescriptor, LoadOp, MapMode, MapRangeError, MultisampleState, Operations,
    PipelineCompilationOptions, PipelineLayoutDescriptor, PollError, PollType, PrimitiveState,
    PrimitiveTopology, Queue, RenderPass, RenderPassColorAttachment, RenderPassDescriptor,
    RenderPipeline, RenderPipelineDescriptor, RequestAdapterError, RequestAdapterOptions,
    RequestDeviceError, ShaderModule, ShaderStages, StoreOp, TexelCopyBufferInfo,
    TexelCopyBufferLayout, Texture, TextureDescriptor, TextureDimension, TextureFormat,
    TextureUsages, TextureView, TextureViewDescriptor, VertexBufferLayout, VertexState,
    VertexStepMode, include_wgsl,
};

use super::{Camera, Rgba, RgbaImage, Scene, Segment, TriangleVertex};

/// Drawings keep colours as sRGB values: blending uses the stored values.
pub const FORMAT: TextureFormat = TextureFormat::Rgba8Unorm;

/// An error of drawing on the graphics card.
#[derive(Debug, Error)]
pub enum GpuError {
    /// No graphics card and no software in its place.
    #[error("no graphics adapter: {0}")]
    Adapter(#[from] RequestAdapterError),
    /// The card refused to work.
    #[error("the graphics adapter gives no device: {0}")]
    Device(#[from] RequestDeviceError),
    /// The card was lost while it worked.
    #[error("waiting for the graphics card failed: {0}")]
    Poll(#[from] PollError),
    /// Its memory could not be read.
    #[error("memory of the graphics card cannot be read: {0}")]
    Map(#[from] BufferAsyncError),
    /// Its memory could not be read.
    #[error("memory of the graphics card cannot be read: {0}")]
    Range(#[from] MapRangeError),
    /// The card never answered.
    #[error("the graphics card never reported that a drawing is done")]
    NoAnswer,
}

/// The camera as the shader reads it.
#[derive(Clone, Copy, Pod, Zeroable)]
#[repr(C)]
struct ViewUniform {
    center: Vec2,
    size: Vec2,
    scale: f32,
    // The size of a uniform is a multiple of eight bytes.
    padding: f32,
}

impl ViewUniform {
    fn new(camera: Camera, size: [u32; 2]) -> Self {
        let (center, scale) = camera.to_f32();
        let [width, height] = size.map(|n| n as f32);
        Self { center, size: Vec2::new(width, height), scale, padding: 0.0 }
    }
}

/// The two programs that draw a scene.
#[derive(Debug)]
pub struct SceneRenderer {
    triangles: RenderPipeline,
    segments: RenderPipeline,
    view_layout: BindGroupLayout,
}

impl SceneRenderer {
    /// Compiles the programs.
    pub fn new(device: &Device) -> Self {
        let module = device.create_shader_module(include_wgsl!("scene.wgsl"));
        let views = device.create_bind_group_layout(&BindGroupLayoutDescriptor {
            label: Some("scene view"),
            entries: &[BindGroupLayoutEntry {
                binding: 0,
                visibility: ShaderStages::VERTEX,
                ty: BindingType::Buffer {
                    ty: BufferBindingType::Uniform,
                    has_dynamic_offset: false,
                    min_binding_size: None,
                },
                count: None,
            }],
        });
        let pipeline = |shape: &PrimitivePipeline<'_>| pipeline(device, &module, &views, shape);
        Self { triangles: pipeline(&TRIANGLES), segments: pipeline(&SEGMENTS), view_layout: views }
    }

    /// Draws a scene into a new texture of `size` pixels.
    pub fn draw(
        &self,
        device: &Device,
        encoder: &mut CommandEncoder,
        scene: &Scene,
        camera: Camera,
        size: [u32; 2],
    ) -> Texture {
        let texture = render_target(device, size);
        let view = texture.create_view(&TextureViewDescriptor::default());
        let group = self.bind_view(device, ViewUniform::new(camera, size));
        let corners = vertex_buffer(device, &scene.vertices);
        let segments = vertex_buffer(device, &scene.segments);
        let mut pass = begin_pass(encoder, &view, scene.background);
        pass.set_bind_group(0, &group, &[]);
        if let Some((buffer, count)) = corners {
            pass.set_pipeline(&self.triangles);
            pass.set_vertex_buffer(0, buffer.slice(..));
            pass.draw(0..count, 0..1);
        }
        if let Some((buffer, count)) = segments {
            pass.set_pipeline(&self.segments);
            pass.set_vertex_buffer(0, buffer.slice(..));
            pass.draw(0..4, 0..count);
        }
        drop(pass);
        texture
    }

    fn bind_view(&self, device: &Device, view: ViewUniform) -> BindGroup {
        let buffer = device.create_buffer_init(&BufferInitDescriptor {
            label: Some("scene view"),
            contents: bytemuck::bytes_of(&view),
            usage: BufferUsages::UNIFORM,
        });
        device.create_bind_group(&BindGroupDescriptor {
            label: Some("scene view"),
            layout: &self.view_layout,
            entries: &[BindGroupEntry { binding: 0, resource: buffer.as_entire_binding() }],
        })
    }
}

/// The shader and the vertex layout of one kind of primitive.
struct PrimitivePipeline<'a> {
    vertex: &'a str,
    fragment: &'a str,
    topology: PrimitiveTopology,
    buffer: VertexBufferLayout<'a>,
}

const TRIANGLES: PrimitivePipeline<'_> = PrimitivePipeline {
    vertex: "corner",
    fragment: "triangle",
    topology: PrimitiveTopology::TriangleList,
    buffer: VertexBufferLayout {
        array_stride: size_of::<TriangleVertex>() as u64,
        step_mode: VertexStepMode::Vertex,
        attributes: &attributes![0 => Float32x2, 1 => Unorm8x4],
    },
};

const SEGMENTS: PrimitivePipeline<'_> = PrimitivePipeline {
    vertex: "quad",
    fragment: "segment",
    topology: PrimitiveTopology::TriangleStrip,
    buffer: VertexBufferLayout {
        array_stride: size_of::<Segment>() as u64,
        step_mode: VertexStepMode::Instance,
        attributes: &attributes![0 => Float32x2, 1 => Float32x2, 2 => Float32, 3 => Unorm8x4],
    },
};

fn pipeline(
    device: &Device,
    module: &ShaderModule,
    views: &BindGroupLayout,
    shape: &PrimitivePipeline<'_>,
) -> RenderPipeline {
    let layout = device.create_pipeline_layout(&PipelineLayoutDescriptor {
        label: Some(shape.fragment),
        bind_group_layouts: &[Some(views)],
        immediate_size: 0,
    });
    device.create_render_pipeline(&RenderPipelineDescriptor {
        label: Some(shape.fragment),
        layout: Some(&layout),
        vertex: VertexState {
            module,
            entry_point: Some(shape.vertex),
            buffers: &[Some(shape.buffer.clone())],
            compilation_options: PipelineCompilationOptions::default(),
        },
        primitive: PrimitiveState { topology: shape.topology, ..PrimitiveState::default() },
        depth_stencil: None,
        multisample: MultisampleState::default(),
        fragment: Some(FragmentState {
            module,
            entry_point: Some(shape.fragment),
            targets: &[Some(ColorTargetState {
                format: FORMAT,
                blend: Some(BlendState::PREMULTIPLIED_ALPHA_BLENDING),
                write_mask: ColorWrites::ALL,
            })],
            compilation_options: PipelineCompilationOptions::default(),
        }),
        multiview_mask: None,
        cache: None,
    })
}

fn render_target(device: &Device, [width, height]: [u32; 2]) -> Texture {
    device.create_texture(&TextureDescriptor {
        label: Some("scene"),
        size: Extent3d { width, height, depth_or_array_layers: 1 },
        mip_level_count: 1,
        sample_count: 1,
        dimension: TextureDimension::D2,
        format: FORMAT,
        usage: TextureUsages::RENDER_ATTACHMENT
            | TextureUsages::TEXTURE_BINDING
            | TextureUsages::COPY_SRC,
        view_formats: &[],
    })
}

/// A vertex buffer with the number of its elements; `None` without elements.
fn vertex_buffer<T: Pod>(device: &Device, shapes: &[T]) -> Option<(Buffer, u32)> {
    let count = u32::try_from(shapes.len()).ok().filter(|&count| count > 0)?;
    let buffer = device.create_buffer_init(&BufferInitDescriptor {
        label: Some("scene shapes"),
        contents: bytemuck::cast_slice(shapes),
        usage: BufferUsages::VERTEX,
    });
    Some((buffer, count))
}

fn begin_pass<'a>(
    encoder: &'a mut CommandEncoder,
    view: &TextureView,
    background: Rgba,
) -> RenderPass<'a> {
    let [r, g, b, a] = background.map(|byte| f64::from(byte) / 255.0);
    encoder.begin_render_pass(&RenderPassDescriptor {
        label: Some("scene"),
        color_attachments: &[Some(RenderPassColorAttachment {
            view,
            depth_slice: None,
            resolve_target: None,
            ops: Operations {
                load: LoadOp::Clear(Color { r: r * a, g: g * a, b: b * a, a }),
                store: StoreOp::Store,
            },
        })],
        ..RenderPassDescriptor::default()
    })
}

/// The graphics interfaces that need no display.
pub(super) fn headless_instance() -> Instance {
    // OpenGL would look for a display, and complain where there is none.
    Instance::new(InstanceDescriptor {
        backends: Backends::PRIMARY,
        ..InstanceDescriptor::new_without_display_handle()
    })
}

/// A device without a window, with all that its adapter can do.
///
/// A software adapter serves as well as a graphics card.
pub async fn headless_device() -> Result<(Device, Queue), GpuError> {
    let instance = headless_instance();
    let adapter = instance.request_adapter(&RequestAdapterOptions::default()).await?;
    let descriptor =
        DeviceDescriptor { required_limits: adapter.limits(), ..DeviceDescriptor::default() };
    Ok(adapter.request_device(&descriptor).await?)
}

/// Draws a scene without a window and fetches the picture.
pub fn render_image(
    (device, queue): &(Device, Queue),
    scene: &Scene,
    camera: Camera,
    size: [u32; 2],
) -> Result<RgbaImage, GpuError> {
    let mut encoder = device.create_command_encoder(&CommandEncoderDescriptor::default());
    let texture = SceneRenderer::new(device).draw(device, &mut encoder, scene, camera, size);
    let stride = (4 * size[0]).next_multiple_of(COPY_BYTES_PER_ROW_ALIGNMENT);
    let buffer = device.create_buffer(&BufferDescriptor {
        label: Some("picture"),
        size: u64::from(stride) * u64::from(size[1]),
        usage: BufferUsages::COPY_DST | BufferUsages::MAP_READ,
        mapped_at_creation: false,
    });
    let layout =
        TexelCopyBufferLayout { offset: 0, bytes_per_row: Some(stride), rows_per_image: None };
    encoder.copy_texture_to_buffer(
        texture.as_image_copy(),
        TexelCopyBufferInfo { buffer: &buffer, layout },
        texture.size(),
    );
    queue.submit([encoder.finish()]);
    let bytes = read_buffer(device, &buffer)?;
    let rows = bytes.chunks_exact(stride as usize);
    let rgba = rows.flat_map(|row| &row[..4 * size[0] as usize]).copied().collect();
    Ok(RgbaImage { size, rgba })
}

pub(super) fn read_buffer(device: &Device, buffer: &Buffer) -> Result<Vec<u8>, GpuError> {
    let (done, mapped) = std::sync::mpsc::channel();
    buffer.map_async(MapMode::Read, .., move |result| {
        // Nobody listens only if waiting failed, which is then the error.
        drop(done.send(result));
    });
    device.poll(PollType::wait_indefinitely())?;
    mapped.try_recv().map_err(|_unanswered| GpuError::NoAnswer)??;
    let bytes = buffer.get_mapped_range(..)?.to_vec();
    buffer.unmap();
    Ok(bytes)
}
