//! The kernels, each for the instruction set in use.
//!
//! The solver and the painter are written once, in plain Rust that the compiler vectorises, and compiled for AVX-512,
//! for AVX2 and for the target's baseline. They compute on integers, or on floats in one fixed order without fused
//! operations, so that every path gives the same bits.
#![allow(unsafe_code)]

use tega_simd::dispatched;

use crate::grid::Level;
use crate::lay;
use crate::light::Light;
use crate::membrane::{self, Measured, Membrane, Relief};
use crate::memory;
use crate::noise::{Noise, Part};
use crate::paint::Canvas;
use crate::plane::Plane;
use crate::shape::Indenter;
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
    (canvas: &mut Canvas, relief: Option<Relief<'_>>, light: &Light, still: &[i8], noise: (&Noise, Part), out: &mut [u8]) -> ()
}

dispatched! {
    /// See [`Noise::drifted`].
    drifted = Noise::drifted, (noise: &Noise, still: &[f32], epoch: u64, out: &mut [i8]) -> ()
}

dispatched! {
    /// See [`memory::follow`].
    follow = memory::follow,
    (slow: &mut [f32], quick: Relief<'_>, window: Window, rule: (f32, [f32; 2], f32)) -> f32
}

dispatched! {
    /// See [`memory::add`].
    add = memory::add, (out: &mut [f32], quick: Option<Relief<'_>>, lag: &[f32], window: Window) -> ()
}

dispatched! {
    /// See [`membrane::weigh`].
    weigh = membrane::weigh, (out: &mut [f32], slow: [&Plane; 2], shares: [f32; 2], part: Window) -> ()
}
