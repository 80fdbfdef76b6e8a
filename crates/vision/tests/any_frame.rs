//! Property tests of the detector with any frame.

mod support;

use proptest::prelude::*;
use support::{Discs, SETTINGS, memory};
use tautscope_vision::{
    ColorDiscriminant, Detector, Frame, Image, Labeller, MAX_REGIONS, Segmenter, Settings,
};

fn settings() -> impl Strategy<Value = Settings> {
    let weights = prop::array::uniform3(-2.0..2.0_f64);
    (weights, -300.0..300.0_f64, 0..9_usize, 1..50_u64).prop_filter_map(
        "weights all but zero",
        |(weights, threshold, smoothing, minimum_area)| {
            ColorDiscriminant::new(weights, threshold).ok()?;
            Some(Settings {
                weights,
                threshold,
                smoothing,
                minimum_area,
                ..SETTINGS
            })
        },
    )
}

fn prediction() -> impl Strategy<Value = [f64; 4]> {
    let inside = prop::array::uniform4(0.0..70.0_f64);
    prop_oneof![inside, prop::array::uniform4(any::<f64>())]
}

/// `first <= value <= end - 1`
fn within(first: usize, value: f64, end: usize) -> bool {
    let [first, last] = [first, end - 1].map(|pixel| f64::from(u32::try_from(pixel).unwrap()));
    (first..=last).contains(&value)
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(100))]

    #[test]
    fn the_areas_of_all_regions_sum_to_the_marker_pixels(
        image in memory([70, 40]),
        settings in settings(),
    ) {
        let discriminant = ColorDiscriminant::new(settings.weights, settings.threshold).unwrap();
        let mut segmenter = Segmenter::new(discriminant, settings.smoothing);
        let mut labeller = Labeller::default();
        labeller.start(image.width);
        let (mut pixels, mut next_row, mut regions) = (0, 0, Vec::new());
        segmenter.each_row(&image.frame(), |v, runs| {
            assert!(next_row <= v && v < image.height);
            next_row = v + 1;
            let mut last_end = None;
            runs.each(|start, end| {
                assert!(start < end && end <= image.width && last_end.is_none_or(|last| last < start));
                last_end = Some(end);
                pixels += end - start;
                labeller.add(v, start, end);
            });
            labeller.end_row(|region| regions.push(region));
        });
        labeller.end_row(|region| regions.push(region));
        let area: u64 = regions.iter().map(|region| region.area).sum();
        prop_assert_eq!(area, pixels as u64);
        for region in regions {
            prop_assert!(region.left < region.right && region.right <= image.width);
            prop_assert!(region.top < region.bottom && region.bottom <= image.height);
            let sides = (region.right - region.left) * (region.bottom - region.top);
            prop_assert!(region.area <= sides as u64);
            let [u, v] = region.centroid();
            prop_assert!(within(region.left, u, region.right) && within(region.top, v, region.bottom));
        }
    }

    #[test]
    fn a_used_detector_gives_the_result_of_a_new_one(
        images in prop::collection::vec((memory([70, 40]), prediction()), 1..5),
        settings in settings(),
    ) {
        let mut used = Detector::new(settings.clone()).unwrap();
        for (image, predicted) in &images {
            let discs = Discs::at(*predicted);
            let mut fresh = Detector::new(settings.clone()).unwrap();
            let (found, regions) = used.recognise(&image.frame(), &discs);
            let (again, same) = fresh.recognise(&image.frame(), &discs);
            prop_assert_eq!(format!("{found:?}"), format!("{again:?}"));
            prop_assert_eq!(regions, same);
            prop_assert!(regions.len() <= MAX_REGIONS);
            prop_assert!(regions.is_sorted_by(|one, next| one.area >= next.area));
            for band in 0..2 {
                let is_known = found.features[2 * band].is_finite();
                prop_assert_eq!(is_known, found.rejections[band].is_none());
            }
        }
    }

    #[test]
    fn an_image_is_rejected_if_its_data_are_too_short(
        format in support::format(),
        length in 0..300_usize, width in 0..9_usize, height in 0..9_usize, stride in 0..40_usize,
    ) {
        let data = vec![7; length];
        let (line, lines) = (format.line_bytes(width), format.lines(height));
        if let Ok(frame) = Image::new(&data, format, [width, height], stride) {
            for index in 0..lines {
                prop_assert_eq!(frame.line(index).len(), line);
            }
        } else {
            let odd = format.shares_columns() && width % 2 == 1 || format.shares_rows() && height % 2 == 1;
            let fits = width > 0 && height > 0 && !odd && stride >= line
                && length >= stride * (lines - 1) + line;
            prop_assert!(!fits);
        }
    }
}

#[test]
fn invalid_discriminants_are_rejected_by_name() {
    let rejected = |weights, threshold| {
        let error = ColorDiscriminant::new(weights, threshold).unwrap_err();
        error.field
    };
    assert_eq!(rejected([0.0; 3], 0.0), "weights");
    assert_eq!(rejected([f64::NAN, 1.0, 1.0], 0.0), "weights");
    assert_eq!(rejected([f64::INFINITY, 1.0, 1.0], 0.0), "weights");
    assert_eq!(rejected([1e300, 1.0, 1.0], 0.0), "weights");
    assert_eq!(rejected([1.0; 3], f64::NAN), "threshold");
    assert_eq!(rejected([-0.5, 1.0, -0.5], 256.0), "threshold");
    assert!(ColorDiscriminant::new([-0.5, 1.0, -0.5], -255.0).is_ok());
}

#[test]
fn invalid_settings_are_rejected_by_name() {
    assert!(Detector::new(SETTINGS).is_ok());
    let rejected = |settings| Detector::new(settings).unwrap_err().field;
    assert_eq!(
        rejected(Settings {
            smoothing: 9,
            ..SETTINGS
        }),
        "smoothing"
    );
    assert_eq!(
        rejected(Settings {
            minimum_area: 0,
            ..SETTINGS
        }),
        "minimum_area"
    );
    let black = vec![([0.0; 3], 0.0)];
    let mut settings = SETTINGS;
    settings.unlocated.alternatives.clone_from(&black);
    assert_eq!(rejected(settings), "unlocated.alternatives");
    assert_eq!(
        rejected(Settings {
            alternatives: black,
            ..SETTINGS
        }),
        "alternatives"
    );
}
