//! The signal of a patch where band, tissue and grey plastic mix.

use super::*;
use crate::recognition::OUTLINE_CORNERS as CORNERS;
use crate::scan::{Image, PixelFormat};

/// B, G, R of tissue, of grey plastic and of a band; tissue is red: green minus red is below 0.
const TISSUE: [u8; 3] = [40, 60, 160];
const GREY: [u8; 3] = [90, 90, 90];
const BAND: [u8; 3] = [50, 180, 60];

#[test]
fn green_is_proportional_to_the_share_of_the_band_in_a_mixture() {
    // 16 columns each of tissue, grey, half tissue and half grey, band, and a quarter of band in tissue.
    let quarter = [0, 1, 2].map(|i| (BAND[i] / 4) + 3 * (TISSUE[i] / 4));
    let half = [0, 1, 2].map(|i| TISSUE[i] / 2 + GREY[i] / 2);
    let fields = [TISSUE, GREY, half, BAND, quarter];
    let (width, height) = (16 * fields.len(), 16);
    let row = fields.iter().flat_map(|field| field.repeat(16));
    let data = row.collect::<Vec<u8>>().repeat(height);
    let frame = Image::new(&data, PixelFormat::Bgr, [width, height], 3 * width).unwrap();
    // Only the tissue on the left is outside the outline.
    let corners = std::array::from_fn(|index| match index / (CORNERS / 2) {
        0 => [15.5 + 70.0 * real(index) / real(CORNERS / 2 - 1), -1.0],
        _ => [
            15.5 + 70.0 * real(CORNERS - 1 - index) / real(CORNERS / 2 - 1),
            17.0,
        ],
    });
    let outline = Outline {
        corners,
        centroid: [50.5, 8.0],
        area: 70.0 * 18.0,
    };
    let mut patch = Patch::default();
    patch.read(&frame, 0..width, 0..height, 1);
    patch.remove_tissue_colour(&[outline; 2]);
    let at = |u: f64| {
        let index = (0..patch.green.len()).find(|index| {
            let [column, _] = patch.coordinates(*index);
            column >= u
        });
        patch.green[index.unwrap()]
    };
    let [tissue, grey, half, band, quarter] = [4.0, 20.0, 36.0, 52.0, 68.0].map(at);
    assert!(tissue.abs() < 0.01 && grey.abs() < 0.01 && half.abs() < 0.5);
    assert!(band > 50.0, "{band}");
    assert!((quarter / band - 0.25).abs() < 0.02, "{quarter} of {band}");
}
