//! No frame allocates after the first one of the same size.

mod support;

use assert_no_alloc::{AllocDisabler, assert_no_alloc};
use support::{Discs, SETTINGS};
use tautscope_vision::{Detector, Image, PixelFormat, Settings};

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
