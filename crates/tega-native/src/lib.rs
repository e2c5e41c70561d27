//! `tega._native` as a library: all of it is in `tega-py`.
//!
//! The library is a crate of its own because the level of the last crate is that at which everything is optimised
//! together: at "s" no kernel's loop would be vectorised. So this one is at 3, and `tega-py` at "s".

use tega_py as _;
