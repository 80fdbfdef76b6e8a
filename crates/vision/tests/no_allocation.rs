//! After the first frame of a size, no frame of that size allocates.

mod support;

use assert_no_alloc::{AllocDisabler, assert_no_alloc};
use support::{DEMANDS, Discs};
use tautscope_vision::{ColorDiscriminant, Detector, Image, PixelFormat, Settings};

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
            discriminant: ColorDiscriminant::new([-0.5, 1.0, -0.6], 10.0).unwrap(),
            smoothing,
            minimum_area: 1,
        })
        .unwrap()
        .with_alternatives(&[ColorDiscriminant::new([-0.4, 1.0, -0.7], 5.0).unwrap()]);
        let mut found = 0;
        for (index, data) in frames.iter().enumerate() {
            let frame = Image::new(data, PixelFormat::Bgr, [WIDTH, HEIGHT], 3 * WIDTH).unwrap();
            let mut detect = |discs| detector.recognise(&frame, &discs, &DEMANDS).0.reasons;
            let near = Discs::at([14.5, 9.5, 34.5, 9.5]);
            if index == 0 {
                detect(near);
            } else {
                let reasons = assert_no_alloc(|| detect(near));
                found += reasons.iter().filter(|reason| reason.is_none()).count();
            }
        }
        assert!(
            found >= 2,
            "the frames exercise nothing: {found} with smoothing {smoothing}"
        );
    }
}
