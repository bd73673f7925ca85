//! The quick way to a picture on the graphics card, through `picture.wgsl`.
//!
//! The tables are made on the processor by [`crate::picture`], which knows no graphics; here they are
//! copied to the card, on which one pass sums the light of beams and a second one that of lattices.

use super::gpu::{GpuError, headless_instance, read_buffer};
use crate::picture::{PackedPicture, PictureDevice};
use std::sync::Mutex;
use wgpu::util::{BufferInitDescriptor, DeviceExt};
use wgpu::{
    Adapter, BindGroupDescriptor, BindGroupEntry, Buffer, BufferDescriptor, BufferUsages,
    CommandEncoder, CommandEncoderDescriptor, ComputePassDescriptor, ComputePipeline,
    ComputePipelineDescriptor, Device, DeviceDescriptor, DeviceType, ErrorFilter,
    PipelineCompilationOptions, PowerPreference, Queue, RequestAdapterOptions, ShaderModule,
    include_wgsl,
};

/// The number of points that a group of the shader works on.
const GROUP: u32 = 64;
/// The words of the largest element of a buffer.
const LARGEST_ELEMENT: usize = 24;
/// The largest number of groups along one axis.
const MOST_GROUPS: usize = 65_535;

/// The two passes of a picture on a device.
#[derive(Debug)]
pub struct PicturePass {
    device: Device,
    queue: Queue,
    name: String,
    software: bool,
    sum_beams: ComputePipeline,
    sum_lattices: ComputePipeline,
    /// Held while a picture is made: error scopes belong to a thread.
    turn: Mutex<()>,
}

impl PicturePass {
    /// The passes on the device of a window.
    pub fn new(adapter: &Adapter, device: &Device, queue: &Queue) -> Self {
        let module = device.create_shader_module(include_wgsl!("picture.wgsl"));
        let info = adapter.get_info();
        Self {
            device: device.clone(),
            queue: queue.clone(),
            name: info.name,
            software: info.device_type == DeviceType::Cpu,
            sum_beams: pipeline(device, &module, "sum_beams"),
            sum_lattices: pipeline(device, &module, "sum_lattices"),
            turn: Mutex::new(()),
        }
    }

    /// The passes on the fastest adapter, without a window; one in software serves as well.
    ///
    /// # Errors
    /// No adapter, or one that gives no device.
    pub async fn headless() -> Result<Self, GpuError> {
        let instance = headless_instance();
        let options = RequestAdapterOptions {
            power_preference: PowerPreference::HighPerformance,
            ..RequestAdapterOptions::default()
        };
        let adapter = instance.request_adapter(&options).await?;
        let descriptor =
            DeviceDescriptor { required_limits: adapter.limits(), ..DeviceDescriptor::default() };
        let (device, queue) = adapter.request_device(&descriptor).await?;
        Ok(Self::new(&adapter, &device, &queue))
    }

    /// True if the processor stands in for a graphics card: then the quick way of the processor is faster.
    pub const fn is_software(&self) -> bool {
        self.software
    }

    fn storage(&self, label: &'static str, words: &[u32]) -> Buffer {
        // A buffer holds one element at least: the largest is a look.
        let words = if words.is_empty() { &[0; LARGEST_ELEMENT] } else { words };
        self.device.create_buffer_init(&BufferInitDescriptor {
            label: Some(label),
            contents: bytemuck::cast_slice(words),
            usage: BufferUsages::STORAGE,
        })
    }

    fn empty(&self, label: &'static str, bytes: u64, usage: BufferUsages) -> Buffer {
        self.device.create_buffer(&BufferDescriptor {
            label: Some(label),
            size: bytes.max(16),
            usage,
            mapped_at_creation: false,
        })
    }

    fn texels(&self, parts: &[&[[f32; 2]]]) -> Buffer {
        let bytes = |part: &[[f32; 2]]| size_of_val(part) as u64;
        let all = parts.iter().map(|part| bytes(part)).sum();
        let buffer = self.empty("texels", all, BufferUsages::STORAGE | BufferUsages::COPY_DST);
        let mut from = 0;
        for part in parts {
            self.queue.write_buffer(&buffer, from, bytemuck::cast_slice(part));
            from += bytes(part);
        }
        buffer
    }

    /// Asks for a pass over shares of [`GROUP`] points.
    fn dispatch(
        &self,
        encoder: &mut CommandEncoder,
        pipeline: &ComputePipeline,
        buffers: &[&Buffer],
        groups: usize,
    ) {
        let entries: Vec<BindGroupEntry<'_>> = (0..)
            .zip(buffers)
            .map(|(binding, buffer)| BindGroupEntry {
                binding,
                resource: buffer.as_entire_binding(),
            })
            .collect();
        let bindings = self.device.create_bind_group(&BindGroupDescriptor {
            label: Some("picture"),
            layout: &pipeline.get_bind_group_layout(0),
            entries: &entries,
        });
        let mut pass = encoder.begin_compute_pass(&ComputePassDescriptor::default());
        pass.set_pipeline(pipeline);
        pass.set_bind_group(0, &bindings, &[]);
        let across = groups.clamp(1, MOST_GROUPS);
        pass.dispatch_workgroups(across as u32, groups.div_ceil(across).max(1) as u32, 1);
    }

    fn make(&self, work: &PackedPicture<'_>) -> Result<Vec<f32>, GpuError> {
        let [columns, rows] = work.pixels;
        let bytes = (columns * rows * 3 * size_of::<f32>()) as u64;
        let values = self.empty("values", 4 * work.values as u64, BufferUsages::STORAGE);
        let usage = BufferUsages::STORAGE | BufferUsages::COPY_SRC;
        let pixels = self.empty("pixels", bytes, usage);
        let usage = BufferUsages::COPY_DST | BufferUsages::MAP_READ;
        let fetched = self.empty("picture", bytes, usage);
        let lattices = self.storage("lattices", &work.lattices);
        let size = self.device.create_buffer_init(&BufferInitDescriptor {
            label: Some("size"),
            contents: bytemuck::cast_slice(&[columns as u32, rows as u32, 0, 0]),
            usage: BufferUsages::UNIFORM,
        });
        let (beams, looks) =
            (self.storage("beams", &work.beams), self.storage("looks", &work.looks));
        let texels = self.texels(&work.texels);
        let shares = self.storage("shares of lattices", &work.lattice_shares);
        let mut encoder = self.device.create_command_encoder(&CommandEncoderDescriptor::default());
        let sources = [&beams, &looks, &texels, &lattices, &shares, &values];
        let groups = work.lattice_shares.len() / 2;
        self.dispatch(&mut encoder, &self.sum_beams, &sources, groups);
        let blocks = self.storage("blocks", &work.blocks);
        let shares = self.storage("shares of blocks", &work.block_shares);
        let sources = [&blocks, &lattices, &values, &shares, &pixels, &size];
        let groups = work.block_shares.len() / 2;
        self.dispatch(&mut encoder, &self.sum_lattices, &sources, groups);
        encoder.copy_buffer_to_buffer(&pixels, 0, &fetched, 0, bytes);
        self.queue.submit([encoder.finish()]);
        let found = read_buffer(&self.device, &fetched)?;
        let number = |word: &[u8]| f32::from_le_bytes([word[0], word[1], word[2], word[3]]);
        Ok(found.chunks_exact(4).map(number).collect())
    }

    /// The size of the largest buffer of a picture, in bytes.
    fn largest_buffer(work: &PackedPicture<'_>) -> u64 {
        let texels: usize = work.texels.iter().map(|part| size_of_val(*part)).sum();
        let words = work.looks.len().max(work.values).max(3 * work.pixels[0] * work.pixels[1]);
        texels.max(4 * words) as u64
    }
}

impl PictureDevice for PicturePass {
    fn name(&self) -> &str {
        &self.name
    }

    fn group(&self) -> u32 {
        GROUP
    }

    fn render(&self, work: &PackedPicture<'_>) -> Result<Vec<f32>, String> {
        let limits = self.device.limits();
        let most = limits.max_storage_buffer_binding_size.min(limits.max_buffer_size);
        let largest = Self::largest_buffer(work);
        if largest > most {
            return Err(format!("needs {largest} bytes of the card in one piece; it has {most}"));
        }
        let _turn = self.turn.lock().unwrap_or_else(std::sync::PoisonError::into_inner);
        let invalid = self.device.push_error_scope(ErrorFilter::Validation);
        let memory = self.device.push_error_scope(ErrorFilter::OutOfMemory);
        let made = self.make(work);
        let errors = [pollster::block_on(memory.pop()), pollster::block_on(invalid.pop())];
        match errors.into_iter().flatten().next() {
            Some(error) => Err(error.to_string()),
            None => made.map_err(|error| error.to_string()),
        }
    }
}

fn pipeline(device: &Device, module: &ShaderModule, name: &'static str) -> ComputePipeline {
    device.create_compute_pipeline(&ComputePipelineDescriptor {
        label: Some(name),
        layout: None,
        module,
        entry_point: Some(name),
        compilation_options: PipelineCompilationOptions::default(),
        cache: None,
    })
}
