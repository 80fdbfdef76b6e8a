//! Scanning, vectorisation and windows give the marker pixels of the definitions, in every format.

mod support;

use fearless_simd::Level;
use proptest::prelude::*;
use support::{Memory, format, memory, weights};
use tautscope_vision::{ColorDiscriminant, Image, PixelFormat, Segmenter, Window};

/// Instruction sets to test: the best of this machine, the next that multiplies bytes in pairs, and the least.
fn levels() -> impl Iterator<Item = Level> {
    let best = Level::new();
    #[cfg(any(target_arch = "x86", target_arch = "x86_64"))]
    let narrower = best.as_avx2().map(fearless_simd::Simd::level);
    #[cfg(not(any(target_arch = "x86", target_arch = "x86_64")))]
    let narrower = None;
    [Some(best), narrower, Some(Level::baseline())]
        .into_iter()
        .flatten()
}

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
    #![proptest_config(ProptestConfig::with_cases(200))]

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
        let masks = memories.iter().map(|memory| memory.mask(weights, threshold, passes));
        let masks: Vec<_> = masks.collect();
        for level in levels() {
            let mut segmenter = Segmenter::new(discriminant, passes).with_level(level);
            for (memory, mask) in memories.iter().zip(&masks) {
                let whole = Window::whole(&memory.frame());
                for window in [whole, window] {
                    let found = segmented(&mut segmenter, memory, window);
                    prop_assert_eq!(found, expected(mask, window), "{:?} {:?}", level, window);
                }
            }
        }
    }

    #[test]
    fn rows_far_from_a_marker_pixel_are_not_visited(
        format in format(),
        (half_width, half_height) in (128..300_usize, 30..100_usize),
        (u, v) in any::<(prop::sample::Index, prop::sample::Index)>(),
        passes in 0..9_usize,
    ) {
        let (width, height) = (2 * half_width, 2 * half_height);
        let (u, v) = (u.index(width), v.index(height));
        let (depth, stride) = (format.depth(), format.line_bytes(width));
        // Grey, and one pixel that is brighter.
        let mut data = vec![128; stride * format.lines(height)];
        data[v * stride + depth * u..][..depth].fill(255);
        let frame = Image::new(&data, format, [width, height], stride).unwrap();
        let discriminant = ColorDiscriminant::new([1.0; 3], 700.0).unwrap();
        for level in levels() {
            let mut segmenter = Segmenter::new(discriminant, passes).with_level(level);
            let mut visited = Vec::new();
            segmenter.each_row(&frame, |row, _| visited.push(row));
            prop_assert!(passes > 0 || visited.contains(&v), "{:?}: {}", level, v);
            let is_near = |row: &usize| row.abs_diff(v) <= 3 * passes + 1;
            prop_assert!(visited.iter().all(is_near), "{:?}: {} {:?}", level, v, visited);
        }
    }
}

#[test]
fn a_pixel_whose_coarse_sum_is_the_coarse_level_is_found() {
    // In fixed point the sum of this pixel is 150 in the coarse scan, and so is the level.
    let (width, pixel) = (256, 70);
    let mut data = vec![0; 3 * width];
    data[3 * pixel + 1] = 2;
    let frame = Image::new(&data, PixelFormat::Bgr, [width, 1], 3 * width).unwrap();
    let discriminant = ColorDiscriminant::new([-0.5, 0.3, 0.2], 0.599).unwrap();
    for level in levels() {
        let mut found = Vec::new();
        let mut segmenter = Segmenter::new(discriminant, 0).with_level(level);
        segmenter.each_row(&frame, |_, runs| {
            runs.each(|start, end| found.push((start, end)));
        });
        assert_eq!(found, [(pixel, pixel + 1)], "{level:?}");
    }
}
