//! Functions that are compiled twice: for any processor of the target, and for one with AVX2.

use pulp::bytemuck::cast;
use pulp::{Arch, Simd, WithSimd};

/// Calls a function on the vector instructions that the processor has. Both versions add and multiply
/// in the same order and never fuse the two, so that their results agree to the bit.
///
/// The function must be a closure with `#[inline(always)]` that captures nothing, and what it calls in
/// its loops must be inlined too; otherwise that part is compiled for any processor alone.
// `FnOnce::call_once` of a closure is a function of its own, which the compiler may leave apart;
// `Fn::call` is the closure
#[inline(always)]
pub(crate) fn vectorised<A, R>(arguments: A, function: impl Fn(A) -> R) -> R {
    Arch::new().dispatch(Call { arguments, function })
}

struct Call<A, F> {
    arguments: A,
    function: F,
}

impl<A, R, F: Fn(A) -> R> WithSimd for Call<A, F> {
    type Output = R;

    #[inline(always)]
    fn with_simd<S: Simd>(self, _: S) -> R {
        (self.function)(self.arguments)
    }
}

/// The lanes of `yes` where the mask is set, and of `no` elsewhere.
///
/// As [`Simd::select_f64s`], which is a call where the compiler does not inline it.
#[inline(always)]
pub(crate) fn select<S: Simd>(simd: S, mask: S::m64s, yes: S::f64s, no: S::f64s) -> S::f64s {
    cast(simd.select_u64s(mask, cast(yes), cast(no)))
}

/// The magnitude of each lane, as [`Simd::abs_f64s`]: see [`select`].
#[inline(always)]
pub(crate) fn magnitude<S: Simd>(simd: S, x: S::f64s) -> S::f64s {
    simd.and_f64s(x, simd.splat_f64s(f64::from_bits(u64::MAX >> 1)))
}
