//! Runs one kernel for callgrind, which counts what happens inside `counted` only.
//!
//! `count` prints the ids and whether the instruction set matters; `count ID` runs that kernel: once to size its
//! buffers, once counted; it then prints the instruction set that was in use.

use std::process::ExitCode;

use tega_benches::kernels;

/// What callgrind is told to switch on and off at. It has to stay a function of its own, and keep its name.
#[inline(never)]
fn counted(run: &mut dyn FnMut()) {
    run();
}

fn main() -> ExitCode {
    let Some(id) = std::env::args().nth(1) else {
        for kernel in kernels() {
            println!("{}\t{}", kernel.id, kernel.dispatched);
        }
        return ExitCode::SUCCESS;
    };
    let Some(kernel) = kernels().into_iter().find(|kernel| kernel.id == id) else {
        eprintln!("no kernel {id}");
        return ExitCode::FAILURE;
    };
    let mut run = (kernel.make)();
    run();
    counted(&mut run);
    println!("{}", tega_simd::instruction_set());
    ExitCode::SUCCESS
}
