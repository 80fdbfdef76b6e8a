//! The size of a loop: small enough to be moved on the stack of any thread.

use tautscope_core::{Best, HysteresisReduction, Paper};

/// With the default storage of 256 control ticks, which takes 32 kB of each.
#[test]
fn a_loop_fits_on_a_stack() {
    let [paper, best] = [
        size_of::<HysteresisReduction<Paper>>(),
        size_of::<HysteresisReduction<Best>>(),
    ];
    println!("paper {paper}, best {best}");
    assert!(paper <= 40_000 && best <= 100_000, "{paper} {best}");
}
