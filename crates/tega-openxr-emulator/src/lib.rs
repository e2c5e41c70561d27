//! An emulated `OpenXR` runtime: what `OpenXR`'s own loader loads where `XR_RUNTIME_JSON` names it.
//!
//! It is a peer for the tests of `tega_openxr.tracker` and in no wheel; nothing else depends on it. As with a real
//! runtime the poses come from another process, here `tega_emulators.openxr`, which is asked over the
//! connection that the environment variable `TEGA_OPENXR_EMULATOR` names. It keeps to `OpenXR` 1.0 as far as a tracker
//! needs it: one instance with one headless session, actions with poses, joints of hands, time conversion.
//!
//! | module | what |
//! |---|---|
//! | `boundary` | the functions of the C interface: pointers in, `runtime` asked, pointers out |
//! | `runtime` | what an instance and its session know: states, events, bindings, spaces |
//! | `service` | the connection to the process that has the poses |
//!
//! The C interface is made of raw pointers, so this crate cannot forbid `unsafe` as the others do; all of it is in
//! `boundary`. What panics in there comes out as `XR_ERROR_RUNTIME_FAILURE`.
#![deny(unsafe_code)]

#[allow(unsafe_code)]
mod boundary;
mod runtime;
mod service;
