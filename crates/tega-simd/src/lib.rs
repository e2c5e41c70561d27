//! The one place that decides which instruction set the kernels of the other crates use.
//!
//! A kernel that [`dispatched!`] is given is written once, in plain Rust that the compiler vectorises, and compiled for
//! AVX2 and for the target's baseline (SSE2 on x86-64, NEON on arm64). A crate with kernels written for one set by hand
//! asks [`isa`]. AVX-512 has no path of its own: where it was measured it won a few percent.
//!
//! ```
//! #[inline(always)]
//! fn generic_add(sums: &mut [i32], row: &[i32]) {
//!     sums.iter_mut().zip(row).for_each(|(sum, x)| *sum += x);
//! }
//!
//! tega_simd::dispatched! {
//!     /// Adds a row to the sums.
//!     add = generic_add, (sums: &mut [i32], row: &[i32]) -> ()
//! }
//!
//! let mut sums = [1, 2, 3];
//! add(&mut sums, &[10, 10, 10]);
//! assert_eq!(sums, [11, 12, 13]);
//! ```
#![deny(unsafe_code)] // allowed in what `dispatched!` writes, and nowhere else

use std::sync::OnceLock;

/// Instruction sets that kernels are compiled for, weakest first.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum Isa {
    /// What every processor of the target has.
    Baseline,
    /// Every arm64 processor has it; named so that kernels written for it by hand can be ruled out.
    #[cfg(target_arch = "aarch64")]
    Neon,
    /// AVX2.
    #[cfg(target_arch = "x86_64")]
    Avx2,
}

/// The best set of this processor, lowered by `TEGA_SIMD=baseline` (to compare paths, or to rule one out).
#[inline]
pub fn isa() -> Isa {
    static FOUND: OnceLock<Isa> = OnceLock::new();
    *FOUND.get_or_init(|| match std::env::var("TEGA_SIMD").as_deref() {
        Ok("baseline") => Isa::Baseline,
        _ => detect(),
    })
}

#[cfg(target_arch = "x86_64")]
fn detect() -> Isa {
    if is_x86_feature_detected!("avx2") { Isa::Avx2 } else { Isa::Baseline }
}

#[cfg(target_arch = "aarch64")]
fn detect() -> Isa {
    Isa::Neon
}

#[cfg(not(any(target_arch = "x86_64", target_arch = "aarch64")))]
fn detect() -> Isa {
    Isa::Baseline
}

/// The instruction set in use: "baseline", "neon" or "avx2".
pub fn instruction_set() -> &'static str {
    match isa() {
        Isa::Baseline => "baseline",
        #[cfg(target_arch = "aarch64")]
        Isa::Neon => "neon",
        #[cfg(target_arch = "x86_64")]
        Isa::Avx2 => "avx2",
    }
}

/// Writes a function that compiles `$generic` for each instruction set and calls the best one this processor has.
///
/// `$generic` has to be a safe function that is inlined always, or it is compiled for the baseline alone. The macro stands
/// beside that function; the caller's crate may deny `unsafe` code, but not forbid it.
#[macro_export]
macro_rules! dispatched {
    ($(#[$doc:meta])* $name:ident = $generic:path, ($($arg:ident: $type:ty),*) -> $result:ty) => {
        $(#[$doc])*
        #[allow(unsafe_code)]
        pub(crate) fn $name($($arg: $type),*) -> $result {
            #[cfg(target_arch = "x86_64")]
            {
                #[target_feature(enable = "avx2")]
                fn avx2($($arg: $type),*) -> $result {
                    $generic($($arg),*)
                }
                if $crate::isa() == $crate::Isa::Avx2 {
                    // SAFETY: `isa` reports a set only after the processor itself said that it has it.
                    return unsafe { avx2($($arg),*) };
                }
            }
            $generic($($arg),*)
        }
    };
}
