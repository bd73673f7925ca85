//! Vector instructions, selected at run time.
//!
//! A plain build may use only the instructions that every processor of the target has. The same loop
//! compiled for wider registers is two to four times as fast, so the hot loops run inside
//! [`run_vectorized`]. Nothing in them is contracted or reordered: every width gives the same bits.

/// The width of vector instructions.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum SimdWidth {
    /// The instructions that every processor of the target has.
    Baseline,
    /// AVX2: 256 bits.
    Bits256,
    /// AVX-512: 512 bits.
    Bits512,
}

impl SimdWidth {
    /// The largest width of this processor.
    pub fn detect() -> Self {
        #[cfg(target_arch = "x86_64")]
        {
            let has512 = is_x86_feature_detected!("avx512f")
                && is_x86_feature_detected!("avx512dq")
                && is_x86_feature_detected!("avx512vl")
                && is_x86_feature_detected!("avx512bw");
            if has512 {
                return Self::Bits512;
            }
            if is_x86_feature_detected!("avx2") {
                return Self::Bits256;
            }
        }
        Self::Baseline
    }
}

/// Runs `work`, compiled for the largest width of the processor up to `width`. It must be a closure
/// marked `#[inline(always)]` that calls only such functions, or nothing is gained.
#[expect(
    unsafe_code,
    reason = "measured: 940 against 220 million ray-surfaces a second; see `measure trace`"
)]
#[inline]
pub(crate) fn run_vectorized<T>(width: SimdWidth, work: impl FnOnce() -> T) -> T {
    #[cfg(target_arch = "x86_64")]
    match width.min(SimdWidth::detect()) {
        SimdWidth::Baseline => work(),
        // SAFETY: the processor was just asked whether it has these instructions.
        SimdWidth::Bits256 => unsafe { with_avx2(work) },
        // SAFETY: as above.
        SimdWidth::Bits512 => unsafe { with_avx512(work) },
    }
    #[cfg(not(target_arch = "x86_64"))]
    work()
}

/// The number of partial sums of [`dot`].
const PARTS: usize = 32;

/// The sum of the products of two columns, in an order that vector instructions preserve; meant for
/// [`run_vectorized`].
#[inline(always)]
pub(crate) fn dot(a: &[f64], b: &[f64]) -> f64 {
    sum_of_products([a, b])
}

/// The sum of the products of some columns, in an order that vector instructions preserve; meant for
/// [`run_vectorized`].
#[inline(always)]
pub(crate) fn sum_of_products<const K: usize>(columns: [&[f64]; K]) -> f64 {
    let count = columns.iter().map(|column| column.len()).min().unwrap_or(0);
    let whole = count / PARTS * PARTS;
    let mut parts = [0.0; PARTS];
    for from in (0..whole).step_by(PARTS) {
        let chunks = columns.map(|column| &column[from..from + PARTS]);
        for k in 0..PARTS {
            let mut product = chunks[0][k];
            for chunk in &chunks[1..] {
                product *= chunk[k];
            }
            parts[k] += product;
        }
    }
    let rest = (whole..count).map(|i| {
        let factors = columns[1..].iter().map(|column| column[i]);
        factors.fold(columns[0][i], |product, factor| product * factor)
    });
    let rest: f64 = rest.sum();
    let mut half = PARTS;
    while half > 1 {
        half /= 2;
        for k in 0..half {
            parts[k] += parts[k + half];
        }
    }
    parts[0] + rest
}

#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx2")]
fn with_avx2<T>(work: impl FnOnce() -> T) -> T {
    work()
}

#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx512f,avx512dq,avx512vl,avx512bw")]
fn with_avx512<T>(work: impl FnOnce() -> T) -> T {
    work()
}
