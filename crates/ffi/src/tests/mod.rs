//! Tests in Rust; `examples/cpp/tests` has those in C and C++.

mod axes;
mod calls;
mod configured;
mod header;
