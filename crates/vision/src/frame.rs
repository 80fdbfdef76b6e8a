//! Where pixels come from.

use crate::{Error, PixelFormat};

/// The longest side of a frame (px); counts and sums over it are exact.
pub const MAX_SIDE: usize = 1 << 16;

/// An image as a camera gives it, line by line of memory.
///
/// A trait, so that a line may lie wherever its owner keeps it: padded or cropped. [`PixelFormat`] says
/// which lines there are and what is in them.
pub trait Frame {
    /// What the bytes mean.
    fn format(&self) -> PixelFormat;

    /// Pixels in a row, 1 to [`MAX_SIDE`], even where the format shares colour between columns.
    fn width(&self) -> usize;

    /// Rows, 1 to [`MAX_SIDE`], even where the format shares colour between rows.
    fn height(&self) -> usize;

    /// Line `index` of memory, 0 to [`PixelFormat::lines`]: [`PixelFormat::line_bytes`] bytes.
    fn line(&self, index: usize) -> &[u8];
}

/// A rectangle of pixels: columns `left..right`, rows `top..bottom` (px).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Window {
    /// First column.
    pub left: usize,
    /// First row.
    pub top: usize,
    /// First column after it.
    pub right: usize,
    /// First row after it.
    pub bottom: usize,
}

impl Window {
    /// All of a frame.
    pub fn whole(frame: &impl Frame) -> Self {
        Self {
            left: 0,
            top: 0,
            right: frame.width(),
            bottom: frame.height(),
        }
    }

    /// What of it lies in a frame; may be empty.
    #[must_use]
    pub fn within(self, frame: &impl Frame) -> Self {
        let (right, bottom) = (
            self.right.min(frame.width()),
            self.bottom.min(frame.height()),
        );
        Self {
            left: self.left.min(right),
            top: self.top.min(bottom),
            right,
            bottom,
        }
    }

    /// The same and `margin` more on each side, but no more than the frame has.
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

/// A frame in one slice of memory, its lines `stride` bytes apart.
#[derive(Clone, Copy, Debug)]
pub struct Image<'a> {
    data: &'a [u8],
    format: PixelFormat,
    width: usize,
    height: usize,
    stride: usize,
}

impl<'a> Image<'a> {
    /// Sees `data` as an image.
    ///
    /// # Errors
    /// A side is not 1 to [`MAX_SIDE`] or is odd where the format wants it even, the stride is shorter
    /// than a line, or `data` ends before the last line does.
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
            let allowed = "at least stride * (lines - 1) bytes and one line more";
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
