//! Scanning, vectorisation and windows give the marker pixels of the definitions, in every format.

mod support;

use proptest::prelude::*;
use support::{Memory, memory, weights};
use tautscope_vision::{ColorDiscriminant, Segmenter, Window};

/// The marker pixels by row of the window; checks that the row after one with some is visited.
fn segmented(
    segmenter: &mut Segmenter,
    memory: &Memory,
    window: Window,
) -> Vec<(usize, Vec<usize>)> {
    let window = window.within(&memory.frame());
    let mut rows: Vec<(usize, Vec<usize>)> = (window.top..window.bottom)
        .filter(|_| window.left < window.right)
        .map(|v| (v, Vec::new()))
        .collect();
    let mut unended = None;
    segmenter.each_row_in(&memory.frame(), window, |v, runs| {
        let row = unended.take().unwrap_or(v);
        assert!(row == v, "row {row} was left out");
        let inside = &mut rows[v - window.top].1;
        runs.each(|start, end| inside.extend(start..end));
        if !inside.is_empty() {
            unended = Some(v + 1);
        }
    });
    assert!(unended.is_none_or(|row| row == window.bottom));
    rows
}

fn expected(mask: &[Vec<bool>], window: Window) -> Vec<(usize, Vec<usize>)> {
    let rows = window.top..window.bottom.min(mask.len());
    if window.left >= window.right.min(mask[0].len()) {
        return Vec::new();
    }
    rows.map(|v| {
        let columns = window.left..window.right.min(mask[v].len());
        (v, columns.filter(|u| mask[v][*u]).collect())
    })
    .collect()
}

fn window() -> impl Strategy<Value = Window> {
    let side = || (0..420_usize, 0..420_usize);
    (side(), prop_oneof![(0..60_usize, 0..60_usize), side()]).prop_map(
        |((left, right), (top, bottom))| Window {
            left: left.min(right),
            top: top.min(bottom),
            right: left.max(right),
            bottom: top.max(bottom),
        },
    )
}

/// A threshold at or near the value of a pixel.
fn threshold(memory: &Memory, weights: [f64; 3], pick: usize, shift: f64) -> f64 {
    let (weights, constant) = memory.weights(weights);
    let (u, v) = (pick % memory.width, pick / memory.width % memory.height);
    let terms = weights.iter().zip(memory.pixel(u, v));
    terms.map(|(w, x)| w * f64::from(x)).sum::<f64>() + constant + shift
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(400))]

    #[test]
    fn marker_pixels_are_those_of_the_definitions(
        memories in prop::collection::vec(memory([400, 50]), 1..3),
        weights in weights(),
        pick in any::<usize>(),
        shift in prop_oneof![Just(0.0), -3.0..3.0_f64, -300.0..300.0_f64],
        passes in prop_oneof![0..3_usize, 0..9_usize],
        window in window(),
    ) {
        let threshold = threshold(&memories[0], weights, pick, shift);
        let Ok(discriminant) = ColorDiscriminant::new(weights, threshold) else {
            return Ok(());
        };
        let mut segmenter = Segmenter::new(discriminant, passes);
        for memory in &memories {
            let mask = memory.mask(weights, threshold, passes);
            let whole = Window::whole(&memory.frame());
            for window in [whole, window] {
                let found = segmented(&mut segmenter, memory, window);
                prop_assert_eq!(found, expected(&mask, window), "{:?}", window);
            }
        }
    }
}
