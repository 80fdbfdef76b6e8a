//! C interface of the loop and of the marker detection: `include/tautscope.h`, generated from these files.
//!
//! `include/tautscope.hpp` wraps it for C++17. Each function checks what it can (null, sizes, numbers that are not finite) and
//! returns a `TautscopeResult`; `tautscope_error_message` has the words. What it cannot
//! check is the contract of the function, under "Safety".
//!
//! - A handle is used by one thread at a time; different handles are independent.
//! - After `create`, no function allocates but detection in an image larger than those before.
//! - No panic leaves a function: the handle is then unusable, and every further call says so.
//!
//! This is the only crate with `unsafe`, in `pointers` and the files of exported functions.
#![deny(unsafe_op_in_unsafe_fn)]

#[cfg(test)]
mod tests;

mod article;
mod conversions;
mod detector;
mod document;
mod image_update;
mod measurement;
mod names;
mod pointers;
mod reduction;
mod result;
mod supervision;
pub mod types;
