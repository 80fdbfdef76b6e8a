//! Rows of pixels in any format.

use std::ops::Range;

use super::format::PixelFormat;
use super::frame::Frame;

/// The bytes of some columns of one row.
#[derive(Clone, Copy, Debug)]
pub enum Row<'a> {
    /// Three bytes per pixel.
    Triples(&'a [u8]),
    /// Four bytes per pixel, the last unused.
    Quadruples(&'a [u8]),
    /// Four bytes per two pixels: Y, U, Y, V.
    Yuyv(&'a [u8]),
    /// Four bytes per two pixels: U, Y, V, Y.
    Uyvy(&'a [u8]),
    /// A byte per pixel; two bytes, U and V, per two pixels.
    Nv12(&'a [u8], &'a [u8]),
    /// A byte per pixel; of U and of V one byte each per two pixels.
    I420(&'a [u8], &'a [u8], &'a [u8]),
}

/// `P` pixels that share bytes.
///
/// Channels are read one by one: of a pixel that is gathered into an array first, the compiler does not
/// vectorise the three channels.
pub trait Group<const P: usize>: Copy {
    /// One of the three channels of one of the pixels.
    fn channel(self, pixel: usize, channel: usize) -> u8;
}

/// A function of the pixels of a row; a trait, because a closure cannot be generic over the group.
pub trait Consumer {
    /// Its result.
    type Outcome;

    /// Processes the pixels, left to right.
    fn consume<const P: usize, G: Group<P>>(self, groups: impl Iterator<Item = G>)
    -> Self::Outcome;
}

impl<'a> Row<'a> {
    /// Row `v` of a frame.
    #[inline(always)]
    pub fn of(frame: &'a impl Frame, v: usize) -> Self {
        let (width, height) = (frame.width(), frame.height());
        // Rows of U, then of V, of a planar frame, two to a line.
        let half = |row: usize| {
            let offset = row % 2 * (width / 2);
            let bytes = frame.line(height + row / 2).get(offset..offset + width / 2);
            bytes.unwrap_or_default()
        };
        let line = |index| frame.line(index);
        match frame.format() {
            PixelFormat::Bgr | PixelFormat::Rgb => Self::Triples(line(v)),
            PixelFormat::Bgra => Self::Quadruples(line(v)),
            PixelFormat::Yuyv => Self::Yuyv(line(v)),
            PixelFormat::Uyvy => Self::Uyvy(line(v)),
            PixelFormat::Nv12 => Self::Nv12(line(v), line(height + v / 2)),
            PixelFormat::I420 => Self::I420(line(v), half(v / 2), half(height / 2 + v / 2)),
        }
    }

    /// Columns of this row, counted from its first; both ends are even or the row's.
    #[inline(always)]
    pub fn columns(self, columns: Range<usize>) -> Self {
        let cut = |bytes: &'a [u8], depth: usize| {
            let wanted = depth * columns.start..depth * columns.end;
            bytes.get(wanted).unwrap_or_default()
        };
        let half = |bytes: &'a [u8]| {
            let wanted = columns.start / 2..columns.end / 2;
            bytes.get(wanted).unwrap_or_default()
        };
        match self {
            Self::Triples(bytes) => Self::Triples(cut(bytes, 3)),
            Self::Quadruples(bytes) => Self::Quadruples(cut(bytes, 4)),
            Self::Yuyv(bytes) => Self::Yuyv(cut(bytes, 2)),
            Self::Uyvy(bytes) => Self::Uyvy(cut(bytes, 2)),
            Self::Nv12(y, uv) => Self::Nv12(cut(y, 1), cut(uv, 1)),
            Self::I420(y, u, v) => Self::I420(cut(y, 1), half(u), half(v)),
        }
    }

    /// The three channels of one pixel; 0 beyond the row.
    pub fn pixel(self, column: usize) -> [u8; 3] {
        let byte = |bytes: &[u8], index: usize| bytes.get(index).copied().unwrap_or_default();
        let pair = column / 2;
        match self {
            Self::Triples(bytes) => [0, 1, 2].map(|channel| byte(bytes, 3 * column + channel)),
            Self::Quadruples(bytes) => [0, 1, 2].map(|channel| byte(bytes, 4 * column + channel)),
            Self::Yuyv(bytes) => [2 * column, 4 * pair + 1, 4 * pair + 3].map(|at| byte(bytes, at)),
            Self::Uyvy(bytes) => [2 * column + 1, 4 * pair, 4 * pair + 2].map(|at| byte(bytes, at)),
            Self::Nv12(y, uv) => [byte(y, column), byte(uv, 2 * pair), byte(uv, 2 * pair + 1)],
            Self::I420(y, u, v) => [byte(y, column), byte(u, pair), byte(v, pair)],
        }
    }

    /// Passes the pixels to a consumer, left to right.
    #[inline(always)]
    pub fn feed<C: Consumer>(self, consumer: C) -> C::Outcome {
        match self {
            Self::Triples(bytes) => consumer.consume(groups::<3>(bytes)),
            Self::Quadruples(bytes) => consumer.consume(groups::<4>(bytes)),
            Self::Yuyv(bytes) => consumer.consume(groups(bytes).map(Packed::<0>)),
            Self::Uyvy(bytes) => consumer.consume(groups(bytes).map(Packed::<1>)),
            Self::Nv12(y, uv) => consumer.consume(groups::<2>(y).zip(groups::<2>(uv))),
            Self::I420(y, u, v) => consumer.consume(groups::<2>(y).zip(u.iter().zip(v))),
        }
    }
}

#[inline(always)]
fn groups<const N: usize>(bytes: &[u8]) -> impl Iterator<Item = &[u8; N]> {
    bytes.as_chunks().0.iter()
}

/// Y of two pixels and their U and V; the first Y is byte `LUMA`, the first of U and V the other one of 0 and 1.
#[derive(Clone, Copy)]
struct Packed<'a, const LUMA: usize>(&'a [u8; 4]);

impl<const N: usize> Group<1> for &[u8; N] {
    #[inline(always)]
    fn channel(self, _: usize, channel: usize) -> u8 {
        self[channel]
    }
}

impl<const LUMA: usize> Group<2> for Packed<'_, LUMA> {
    #[inline(always)]
    fn channel(self, pixel: usize, channel: usize) -> u8 {
        self.0[[2 * pixel + LUMA, 1 - LUMA, 3 - LUMA][channel]]
    }
}

impl Group<2> for (&[u8; 2], &[u8; 2]) {
    #[inline(always)]
    fn channel(self, pixel: usize, channel: usize) -> u8 {
        [self.0[pixel], self.1[0], self.1[1]][channel]
    }
}

impl Group<2> for (&[u8; 2], (&u8, &u8)) {
    #[inline(always)]
    fn channel(self, pixel: usize, channel: usize) -> u8 {
        [self.0[pixel], *self.1.0, *self.1.1][channel]
    }
}
