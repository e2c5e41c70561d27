//! The one place that picks an instruction set.
//!
//! The solver and the painter are written once, in plain Rust that the compiler vectorises, and compiled for AVX-512,
//! for AVX2 and for the target's baseline. They compute on integers, or on floats in one fixed order without fused
//! operations, so that every path gives the same bits.
#![allow(unsafe_code)]

use std::sync::OnceLock;

use crate::grid::{self, Window};
use crate::membrane::{self, Measured, Membrane};
use crate::noise::{Noise, Part};
use crate::paint::Canvas;
use crate::shape::Indenter;
use crate::unit::Unit;

/// Compiles `$generic` for each instruction set and calls the best one this processor has.
macro_rules! dispatched {
    ($(#[$doc:meta])* $name:ident = $generic:path, ($($arg:ident: $type:ty),*) -> $result:ty) => {
        $(#[$doc])*
        pub(crate) fn $name($($arg: $type),*) -> $result {
            #[cfg(target_arch = "x86_64")]
            {
                #[target_feature(enable = "avx512f,avx512bw,avx512vl,avx512dq")]
                fn avx512($($arg: $type),*) -> $result {
                    $generic($($arg),*)
                }
                #[target_feature(enable = "avx2")]
                fn avx2($($arg: $type),*) -> $result {
                    $generic($($arg),*)
                }
                match level() {
                    // SAFETY: `level` reports a set only after the processor itself said that it has it.
                    Level::Avx512 => return unsafe { avx512($($arg),*) },
                    // SAFETY: as above.
                    Level::Avx2 => return unsafe { avx2($($arg),*) },
                    Level::Baseline => {}
                }
            }
            $generic($($arg),*)
        }
    };
}

/// Instruction sets that the two are compiled for, weakest first.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
enum Level {
    Baseline,
    Avx2,
    Avx512,
}

/// The best set of this processor, lowered by `TEGA_SIMD=baseline|avx2`.
fn level() -> Level {
    static LEVEL: OnceLock<Level> = OnceLock::new();
    *LEVEL.get_or_init(|| {
        let allowed = match std::env::var("TEGA_SIMD").as_deref() {
            Ok("baseline") => Level::Baseline,
            Ok("avx2") => Level::Avx2,
            _ => Level::Avx512,
        };
        detect().min(allowed)
    })
}

#[cfg(target_arch = "x86_64")]
fn detect() -> Level {
    let avx512 = is_x86_feature_detected!("avx512f")
        && is_x86_feature_detected!("avx512bw")
        && is_x86_feature_detected!("avx512vl")
        && is_x86_feature_detected!("avx512dq");
    match (avx512, is_x86_feature_detected!("avx2")) {
        (true, true) => Level::Avx512,
        (false, true) => Level::Avx2,
        _ => Level::Baseline,
    }
}

#[cfg(not(target_arch = "x86_64"))]
fn detect() -> Level {
    Level::Baseline
}

/// The instruction set in use: "baseline", "avx2" or "avx512".
pub fn instruction_set() -> &'static str {
    match level() {
        Level::Baseline => "baseline",
        Level::Avx2 => "avx2",
        Level::Avx512 => "avx512",
    }
}

dispatched! {
    /// See [`Membrane::solve`].
    solve = Membrane::solve, (membrane: &mut Membrane, indenters: &[Indenter]) -> bool
}

dispatched! {
    /// See [`membrane::lay`].
    lay = membrane::lay, (grid: &mut grid::Level, part: Window, i: usize, indenter: &Indenter) -> ()
}

dispatched! {
    /// See [`Membrane::measure`].
    measure = Membrane::measure, (membrane: &Membrane) -> Measured
}

dispatched! {
    /// See [`Canvas::paint`].
    paint = Canvas::paint,
    (canvas: &mut Canvas, membrane: Option<&Membrane>, unit: &Unit, still: &[u8], noise: (&Noise, Part), out: &mut [u8]) -> ()
}
