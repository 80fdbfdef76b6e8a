//! No frame allocates after the first one of the same size.

mod support;

use std::sync::Arc;

use assert_no_alloc::{AllocDisabler, assert_no_alloc};
use support::{Anywhere, Discs, SETTINGS};
use tautscope_vision::{BandPredictor, Detector, Image, PixelFormat, PostureTable, Settings};

#[global_allocator]
static ALLOCATOR: AllocDisabler = AllocDisabler;

const WIDTH: usize = 65;
const HEIGHT: usize = 49;

/// An image that is marker where `inside(u, v)`.
fn image(inside: impl Fn(usize, usize) -> bool) -> Vec<u8> {
    let pixels = (0..HEIGHT).flat_map(|v| (0..WIDTH).map(move |u| (u, v)));
    pixels
        .flat_map(|(u, v)| {
            if inside(u, v) {
                [70, 190, 60]
            } else {
                [60, 70, 140]
            }
        })
        .collect()
}

#[test]
fn after_the_first_frame_nothing_is_allocated() {
    let frames = [
        image(|_, _| false),
        image(|_, _| true),
        image(|u, v| u % 2 == 0 && v % 2 == 0),
        image(|u, v| (u + v) % 2 == 0),
        image(|u, _| u % 2 == 0),
        image(|u, v| (u * 7919 + v * 104_729) % 5 < 2),
        image(|u, v| (5..15).contains(&v) && ((10..20).contains(&u) || (30..40).contains(&u))),
    ];
    for smoothing in [0, 1, 8] {
        let mut detector = Detector::new(Settings {
            alternatives: vec![([-0.4, 1.0, -0.7], 5.0)],
            smoothing,
            ..SETTINGS
        })
        .unwrap();
        let mut found = 0;
        for (index, data) in frames.iter().enumerate() {
            let frame = Image::new(data, PixelFormat::Bgr, [WIDTH, HEIGHT], 3 * WIDTH).unwrap();
            let mut detect = |discs| detector.recognise(&frame, &discs).0.rejections;
            let near = Discs::at([14.5, 9.5, 34.5, 9.5]);
            if index == 0 {
                detect(near);
            } else {
                let rejections = assert_no_alloc(|| detect(near));
                found += rejections.iter().filter(|one| one.is_none()).count();
            }
        }
        assert!(
            found >= 2,
            "only {found} bands were recognised with smoothing {smoothing}"
        );
    }
}

#[test]
fn nothing_is_allocated_where_the_posture_is_not_known_or_not_as_predicted() {
    // Discs on grey plastic in tissue, discs on tissue alone, and noise.
    let is_disc = |u: usize, v: usize| {
        [(30, 34), (30, 18)].iter().any(|(cu, cv)| {
            let (du, dv) = (u.abs_diff(*cu), v.abs_diff(*cv));
            du * du + dv * dv <= 25
        })
    };
    let paint = |is_plastic: bool| -> Vec<u8> {
        let pixels = (0..HEIGHT).flat_map(|v| (0..WIDTH).map(move |u| (u, v)));
        let colour = |(u, v): (usize, usize)| match (is_disc(u, v), (24..37).contains(&u)) {
            (true, _) => [70, 190, 60],
            (false, true) if is_plastic && v > 12 => [120, 120, 120],
            _ => [60, 70, 140],
        };
        pixels.flat_map(colour).collect()
    };
    let frames = [
        paint(true),
        paint(false),
        image(|u, v| (u * 7919 + v * 104_729) % 5 < 2),
    ];
    let places = (0..8).flat_map(|v| (0..8).map(move |u| [8 * u, 6 * v].map(f64::from)));
    let postures = places.filter_map(|[u, v]| {
        let features = [u, v + 16.0, u, v];
        let drawn = Discs::at(features).predict(features, [1.0; 4])?;
        Some(drawn.outlines)
    });
    let postures = Arc::new(PostureTable::new(postures));
    let mut detector = Detector::new(SETTINGS).unwrap().with_workspace(postures);
    // Expected nowhere, and where they are not.
    let elsewhere = Anywhere::expected_at([10.0, 40.0, 10.0, 24.0]);
    for predictor in [Anywhere::new(), elsewhere] {
        let mut found = [0; 3];
        for repeat in 0..2 {
            for (data, found) in frames.iter().zip(&mut found) {
                let frame = Image::new(data, PixelFormat::Bgr, [WIDTH, HEIGHT], 3 * WIDTH).unwrap();
                let mut detect = || detector.recognise(&frame, &predictor).0.rejections;
                let rejections = if repeat == 0 {
                    detect()
                } else {
                    assert_no_alloc(detect)
                };
                *found += rejections.iter().filter(|one| one.is_none()).count();
            }
        }
        assert_eq!(found, [4, 0, 0]);
    }
}
