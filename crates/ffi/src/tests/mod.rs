//! Tests that need no configuration; `examples/cpp/tests` has the others, from C and C++.

mod calls;
mod header;
