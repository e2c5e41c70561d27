//! The kernels, each for the instruction set in use.
//!
//! The solver and the painter are written once, in plain Rust that the compiler vectorises, and compiled for AVX-512,
//! for AVX2 and for the target's baseline. They compute on integers, or on floats in one fixed order without fused
//! operations, so that every path gives the same bits.
#![allow(unsafe_code)]

use tega_simd::dispatched;

use crate::grid::Level;
use crate::lay;
use crate::membrane::{Measured, Membrane};
use crate::noise::{Noise, Part};
use crate::paint::Canvas;
use crate::shape::Indenter;
use crate::unit::Unit;
use crate::window::Window;

dispatched! {
    /// See [`Membrane::solve`].
    solve = Membrane::solve, (membrane: &mut Membrane, indenters: &[Indenter]) -> bool
}

dispatched! {
    /// See [`lay::lay`].
    lay = lay::lay, (grid: &mut Level, part: Window, i: usize, indenter: &Indenter) -> ()
}

dispatched! {
    /// See [`Membrane::measure`].
    measure = Membrane::measure, (membrane: &Membrane) -> Measured
}

dispatched! {
    /// See [`Canvas::paint`].
    paint = Canvas::paint,
    (canvas: &mut Canvas, membrane: Option<&Membrane>, unit: &Unit, still: &[i8], noise: (&Noise, Part), out: &mut [u8]) -> ()
}

dispatched! {
    /// See [`Noise::drifted`].
    drifted = Noise::drifted, (noise: &Noise, still: &[f32], epoch: u64, out: &mut [i8]) -> ()
}
