//! Where pixels come from.

use crate::Error;

/// The longest side of a frame (px); counts and sums over it are exact.
pub const MAX_SIDE: usize = 1 << 16;

/// An image, row by row: 8-bit B, G, R interleaved.
///
/// A trait, so that a row may lie wherever its owner keeps it: padded, cropped, upside down.
pub trait Frame {
    /// Pixels in a row, 1 to [`MAX_SIDE`].
    fn width(&self) -> usize;

    /// Rows, 1 to [`MAX_SIDE`].
    fn height(&self) -> usize;

    /// Row `v` (0 is the top): `3 * width` bytes.
    fn row(&self, v: usize) -> &[u8];
}

/// A frame in one slice of memory, its rows `stride` bytes apart.
#[derive(Clone, Copy, Debug)]
pub struct BgrFrame<'a> {
    data: &'a [u8],
    width: usize,
    height: usize,
    stride: usize,
}

impl<'a> BgrFrame<'a> {
    /// Sees `data` as an image.
    ///
    /// # Errors
    /// A side is not 1 to [`MAX_SIDE`], the stride is shorter than a row, or `data` ends before the
    /// last row does.
    pub fn new(data: &'a [u8], width: usize, height: usize, stride: usize) -> Result<Self, Error> {
        for (field, side) in [("width", width), ("height", height)] {
            if !(1..=MAX_SIDE).contains(&side) {
                return Err(Error::new(field, &side, "1 to 65536 px"));
            }
        }
        if stride < 3 * width {
            return Err(Error::new("stride", &stride, "at least 3 * width bytes"));
        }
        let needed = stride
            .checked_mul(height - 1)
            .and_then(|bytes| bytes.checked_add(3 * width));
        if needed.is_none_or(|needed| data.len() < needed) {
            let allowed = "at least stride * (height - 1) + 3 * width bytes";
            return Err(Error::new("data", &data.len(), allowed));
        }
        Ok(Self {
            data,
            width,
            height,
            stride,
        })
    }
}

impl Frame for BgrFrame<'_> {
    fn width(&self) -> usize {
        self.width
    }

    fn height(&self) -> usize {
        self.height
    }

    fn row(&self, v: usize) -> &[u8] {
        let start = v * self.stride;
        self.data
            .get(start..start + 3 * self.width)
            .unwrap_or_default()
    }
}
