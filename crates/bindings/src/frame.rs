//! numpy arrays seen as frames, without a copy.

use numpy::PyReadonlyArrayDyn;
use numpy::ndarray::{ArrayView2, ArrayView3, Axis, Ix2, Ix3};
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use tautscope_vision::{Frame, PixelFormat};

/// An array seen as a frame: the pixels of a line are contiguous, the lines at an even distance.
pub struct ArrayFrame<'a> {
    /// All of the bytes, if no line is padded: the shorter way to one of them.
    whole: Option<&'a [u8]>,
    lines: Lines<'a>,
    format: PixelFormat,
    width: usize,
    height: usize,
}

/// By line and byte, or by line, pixel and channel.
enum Lines<'a> {
    Bytes(ArrayView2<'a, u8>),
    Pixels(ArrayView3<'a, u8>),
}

impl<'a> ArrayFrame<'a> {
    /// Sees `image` as a frame of this format: (h, w, channels), or (3 h / 2, w) with Y, U, V apart.
    ///
    /// `tautscope.loop.frame_layout` refuses what this refuses, with a message for users.
    pub fn new(image: &'a PyReadonlyArrayDyn<'_, u8>, format: PixelFormat) -> PyResult<Self> {
        let refused = || {
            let allowed = format!("image: expected an array of a {} image", format.name());
            PyValueError::new_err(allowed)
        };
        let view = image.as_array();
        let whole = view.to_slice();
        let upwards = view.strides().first().is_some_and(|stride| *stride < 0);
        let lines = if format.shares_rows() {
            view.into_dimensionality::<Ix2>().map(Lines::Bytes)
        } else {
            view.into_dimensionality::<Ix3>().map(Lines::Pixels)
        };
        let lines = lines.map_err(|_| refused())?;
        let (count, width, channels) = match &lines {
            Lines::Bytes(view) => (view.dim().0, view.dim().1, 1),
            Lines::Pixels(view) => view.dim(),
        };
        let height = if format.shares_rows() {
            count / 3 * 2
        } else {
            count
        };
        let frame = Self {
            whole,
            lines,
            format,
            width,
            height,
        };
        if format.check_sides([width, height]).is_err()
            || format.lines(height) != count
            || format.depth() != channels
            || frame.line(0).len() != format.line_bytes(width)
            || upwards
        {
            return Err(refused());
        }
        Ok(frame)
    }

    #[inline(never)]
    fn padded_line(&self, index: usize) -> &[u8] {
        let line = match &self.lines {
            Lines::Bytes(view) => view.index_axis_move(Axis(0), index).to_slice(),
            Lines::Pixels(view) => view.index_axis_move(Axis(0), index).to_slice(),
        };
        line.unwrap_or_default()
    }
}

impl Frame for ArrayFrame<'_> {
    fn format(&self) -> PixelFormat {
        self.format
    }

    fn width(&self) -> usize {
        self.width
    }

    fn height(&self) -> usize {
        self.height
    }

    #[expect(
        clippy::inline_always,
        reason = "a call between rows empties the registers that the scan keeps vectors in"
    )]
    #[inline(always)]
    fn line(&self, index: usize) -> &[u8] {
        let Some(bytes) = self.whole else {
            return self.padded_line(index);
        };
        let length = self.format.line_bytes(self.width);
        bytes
            .get(index * length..(index + 1) * length)
            .unwrap_or_default()
    }
}
