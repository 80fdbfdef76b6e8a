//! The size of a loop: small enough to be moved on the stack of any thread.

use tautscope_core::{Best, HysteresisReduction, Paper};

/// With the default storage of 256 control ticks, which takes 32 kB of each; the smallest default stack of a thread is musl's,
/// 128 KiB.
#[test]
fn a_loop_fits_on_a_stack() {
    let [paper, best] = [
        size_of::<HysteresisReduction<Paper>>(),
        size_of::<HysteresisReduction<Best>>(),
    ];
    println!("paper {paper}, best {best}");
    assert!(paper <= 41_000 && best <= 120_000, "{paper} {best}");
}
