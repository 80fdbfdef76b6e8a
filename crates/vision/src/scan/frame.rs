//! Frames and windows of frames.

use super::format::PixelFormat;
use crate::error::Error;

/// A camera image, read by lines of memory.
///
/// It is a trait, so that lines may be padded or cropped. [`PixelFormat`] defines the lines and their bytes.
pub trait Frame {
    /// The pixel format.
    fn format(&self) -> PixelFormat;

    /// Pixels in a row, 1 to [`MAX_SIDE`](crate::MAX_SIDE), even where columns share U and V.
    fn width(&self) -> usize;

    /// Rows, 1 to [`MAX_SIDE`](crate::MAX_SIDE), even where rows share U and V.
    fn height(&self) -> usize;

    /// Line `index` of memory, below [`PixelFormat::lines`]: [`PixelFormat::line_bytes`] bytes.
    fn line(&self, index: usize) -> &[u8];
}

/// A rectangle of pixels: columns `left..right`, rows `top..bottom` (px).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Window {
    /// First column.
    pub left: usize,
    /// First row.
    pub top: usize,
    /// Column after the last.
    pub right: usize,
    /// Row after the last.
    pub bottom: usize,
}

impl Window {
    /// The whole frame.
    pub fn whole(frame: &impl Frame) -> Self {
        Self {
            left: 0,
            top: 0,
            right: frame.width(),
            bottom: frame.height(),
        }
    }

    /// The part inside a frame; it may be empty.
    #[must_use]
    pub fn within(self, frame: &impl Frame) -> Self {
        let right = self.right.min(frame.width());
        let bottom = self.bottom.min(frame.height());
        Self {
            left: self.left.min(right),
            top: self.top.min(bottom),
            right,
            bottom,
        }
    }

    /// The window with a `margin` (px) on each side, cut at the border of the frame.
    pub(crate) fn grown(self, margin: usize, frame: &impl Frame) -> Self {
        let grown = Self {
            left: self.left.saturating_sub(margin),
            top: self.top.saturating_sub(margin),
            right: self.right.saturating_add(margin),
            bottom: self.bottom.saturating_add(margin),
        };
        grown.within(frame)
    }
}

/// A frame in one slice of memory with lines `stride` bytes apart.
#[derive(Clone, Copy, Debug)]
pub struct Image<'a> {
    data: &'a [u8],
    format: PixelFormat,
    width: usize,
    height: usize,
    stride: usize,
}

impl<'a> Image<'a> {
    /// Borrows `data` as a frame of `[width, height]` (px).
    ///
    /// # Errors
    /// A side is not allowed ([`PixelFormat::check_sides`]), the stride is shorter than a line, or `data` is
    /// shorter than the frame.
    pub fn new(
        data: &'a [u8],
        format: PixelFormat,
        [width, height]: [usize; 2],
        stride: usize,
    ) -> Result<Self, Error> {
        format.check_sides([width, height])?;
        let line = format.line_bytes(width);
        if stride < line {
            return Err(Error::new("stride", &stride, "at least a line of bytes"));
        }
        let needed = stride
            .checked_mul(format.lines(height) - 1)
            .and_then(|bytes| bytes.checked_add(line));
        if needed.is_none_or(|needed| data.len() < needed) {
            let allowed = "at least stride * (lines - 1) + line bytes";
            return Err(Error::new("data", &data.len(), allowed));
        }
        Ok(Self {
            data,
            format,
            width,
            height,
            stride,
        })
    }
}

impl Frame for Image<'_> {
    fn format(&self) -> PixelFormat {
        self.format
    }

    fn width(&self) -> usize {
        self.width
    }

    fn height(&self) -> usize {
        self.height
    }

    fn line(&self, index: usize) -> &[u8] {
        let start = index * self.stride;
        let bytes = self.format.line_bytes(self.width);
        self.data.get(start..start + bytes).unwrap_or_default()
    }
}
