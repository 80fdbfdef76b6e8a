//! What the bytes of a frame mean, and how to walk over them.

use std::ops::Range;

use crate::Error;
use crate::frame::{Frame, MAX_SIDE};

/// How a camera lays out its 8-bit pixels. All lines of memory are equally long and equally far apart.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum PixelFormat {
    /// B, G, R per pixel.
    Bgr,
    /// R, G, B per pixel.
    Rgb,
    /// B, G, R and a byte that is not looked at per pixel.
    Bgra,
    /// Y, U, Y, V per two pixels.
    Yuyv,
    /// U, Y, V, Y per two pixels.
    Uyvy,
    /// The rows of Y, below them a line of U, V, U, V, ... for every two rows.
    Nv12,
    /// The rows of Y, below them those of U, then of V, each at half the resolution; a line of memory
    /// holds two of them.
    I420,
}

impl PixelFormat {
    /// Every format.
    pub const ALL: [Self; 7] = [
        Self::Bgr,
        Self::Rgb,
        Self::Bgra,
        Self::Yuyv,
        Self::Uyvy,
        Self::Nv12,
        Self::I420,
    ];

    /// `bgr`, `rgb`, `bgra`, `yuyv`, `uyvy`, `nv12` or `i420`.
    pub fn name(self) -> &'static str {
        match self {
            Self::Bgr => "bgr",
            Self::Rgb => "rgb",
            Self::Bgra => "bgra",
            Self::Yuyv => "yuyv",
            Self::Uyvy => "uyvy",
            Self::Nv12 => "nv12",
            Self::I420 => "i420",
        }
    }

    /// The format of this [`name`](Self::name).
    ///
    /// # Errors
    /// There is none.
    pub fn named(name: &str) -> Result<Self, Error> {
        let found = Self::ALL.into_iter().find(|format| format.name() == name);
        let allowed = "bgr, rgb, bgra, yuyv, uyvy, nv12 or i420";
        found.ok_or_else(|| Error::new("pixel_format", &name, allowed))
    }

    /// Bytes per pixel in a line.
    pub fn depth(self) -> usize {
        match self {
            Self::Bgr | Self::Rgb => 3,
            Self::Bgra => 4,
            Self::Yuyv | Self::Uyvy => 2,
            Self::Nv12 | Self::I420 => 1,
        }
    }

    /// Bytes in a line of memory that belong to a frame of this width.
    pub fn line_bytes(self, width: usize) -> usize {
        self.depth() * width
    }

    /// Lines of memory of a frame of this height.
    pub fn lines(self, height: usize) -> usize {
        if self.shares_rows() {
            height + height / 2
        } else {
            height
        }
    }

    /// Whether two columns share a colour, so that the width must be even.
    pub fn shares_columns(self) -> bool {
        matches!(self, Self::Yuyv | Self::Uyvy | Self::Nv12 | Self::I420)
    }

    /// Whether two rows share a colour, so that the height must be even.
    pub fn shares_rows(self) -> bool {
        matches!(self, Self::Nv12 | Self::I420)
    }

    /// Whether frames of these sides `[width, height]` (px) exist.
    ///
    /// # Errors
    /// A side is not 1 to [`MAX_SIDE`], or odd where the format wants it even.
    pub fn check_sides(self, sides: [usize; 2]) -> Result<(), Error> {
        let shares = [self.shares_columns(), self.shares_rows()];
        for ((field, side), shares) in ["width", "height"].into_iter().zip(sides).zip(shares) {
            if !(1..=MAX_SIDE).contains(&side) {
                return Err(Error::new(field, &side, "1 to 65536 px"));
            }
            if shares && side % 2 != 0 {
                return Err(Error::new(field, &side, "an even number of px"));
            }
        }
        Ok(())
    }

    /// Columns that can be read: those given and, where two share a colour, their neighbours.
    pub(crate) fn whole_groups(self, columns: Range<usize>) -> Range<usize> {
        if self.shares_columns() {
            columns.start / 2 * 2..columns.end.next_multiple_of(2)
        } else {
            columns
        }
    }
}

/// The bytes of some columns of one row.
#[derive(Clone, Copy, Debug)]
pub(crate) enum Row<'a> {
    /// Three bytes per pixel.
    Triples(&'a [u8]),
    /// Four bytes per pixel, the last of no meaning.
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

/// Pixels that share bytes, `P` of them.
///
/// Byte by byte: a pixel that is gathered into an array first is no longer seen by the compiler as
/// the three streams that it can take apart with vectors.
pub(crate) trait Group<const P: usize>: Copy {
    /// One of the three channels that the discriminant weighs, of one of the pixels.
    fn channel(self, pixel: usize, channel: usize) -> u8;
}

/// What is done with pixels; a trait, because a closure cannot be generic over the group.
pub(crate) trait Consumer {
    /// What comes of it.
    type Outcome;

    /// Takes the pixels, left to right.
    fn consume<const P: usize, G: Group<P>>(self, groups: impl Iterator<Item = G>)
    -> Self::Outcome;
}

impl<'a> Row<'a> {
    /// Columns of row `v` of a frame; they start at whole groups, as [`PixelFormat::whole_groups`] has them.
    #[inline(always)]
    pub(crate) fn of(frame: &'a impl Frame, v: usize, columns: Range<usize>) -> Self {
        let (format, width, height) = (frame.format(), frame.width(), frame.height());
        let line = |index, bytes: Range<usize>| frame.line(index).get(bytes).unwrap_or_default();
        let depth = format.depth();
        let bytes = depth * columns.start..depth * columns.end;
        // Rows of U or V of a planar frame, counted through, two to a line.
        let half = |row: usize| {
            let offset = row % 2 * (width / 2);
            let bytes = offset + columns.start / 2..offset + columns.end / 2;
            line(height + row / 2, bytes)
        };
        match format {
            PixelFormat::Bgr | PixelFormat::Rgb => Self::Triples(line(v, bytes)),
            PixelFormat::Bgra => Self::Quadruples(line(v, bytes)),
            PixelFormat::Yuyv => Self::Yuyv(line(v, bytes)),
            PixelFormat::Uyvy => Self::Uyvy(line(v, bytes)),
            PixelFormat::Nv12 => Self::Nv12(line(v, bytes.clone()), line(height + v / 2, bytes)),
            PixelFormat::I420 => Self::I420(line(v, bytes), half(v / 2), half(height / 2 + v / 2)),
        }
    }

    /// Columns of this row, counted from its first; both ends even unless it is the row's.
    #[inline(always)]
    pub(crate) fn columns(self, columns: Range<usize>) -> Self {
        let cut = |bytes: &'a [u8], depth: usize| {
            let bytes_wanted = depth * columns.start..depth * columns.end;
            bytes.get(bytes_wanted).unwrap_or_default()
        };
        let half = |bytes: &'a [u8]| {
            let bytes_wanted = columns.start / 2..columns.end / 2;
            bytes.get(bytes_wanted).unwrap_or_default()
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

    /// Hands over the pixels, left to right.
    #[inline(always)]
    pub(crate) fn feed<C: Consumer>(self, consumer: C) -> C::Outcome {
        match self {
            Self::Triples(bytes) => consumer.consume(groups(bytes).map(Triple)),
            Self::Quadruples(bytes) => consumer.consume(groups(bytes).map(Quadruple)),
            Self::Yuyv(bytes) => consumer.consume(groups(bytes).map(Yuyv)),
            Self::Uyvy(bytes) => consumer.consume(groups(bytes).map(Uyvy)),
            Self::Nv12(y, uv) => {
                let pairs = groups(y).zip(groups(uv));
                consumer.consume(pairs.map(|(y, uv)| Nv12(y, uv)))
            }
            Self::I420(y, u, v) => {
                let pairs = groups(y).zip(u.iter().zip(v));
                consumer.consume(pairs.map(|(y, (u, v))| I420(y, u, v)))
            }
        }
    }
}

#[inline(always)]
fn groups<const N: usize>(bytes: &[u8]) -> impl Iterator<Item = &[u8; N]> {
    bytes.as_chunks().0.iter()
}

#[derive(Clone, Copy)]
struct Triple<'a>(&'a [u8; 3]);

#[derive(Clone, Copy)]
struct Quadruple<'a>(&'a [u8; 4]);

#[derive(Clone, Copy)]
struct Yuyv<'a>(&'a [u8; 4]);

#[derive(Clone, Copy)]
struct Uyvy<'a>(&'a [u8; 4]);

#[derive(Clone, Copy)]
struct Nv12<'a>(&'a [u8; 2], &'a [u8; 2]);

#[derive(Clone, Copy)]
struct I420<'a>(&'a [u8; 2], &'a u8, &'a u8);

impl Group<1> for Triple<'_> {
    #[inline(always)]
    fn channel(self, _: usize, channel: usize) -> u8 {
        self.0[channel]
    }
}

impl Group<1> for Quadruple<'_> {
    #[inline(always)]
    fn channel(self, _: usize, channel: usize) -> u8 {
        self.0[channel]
    }
}

impl Group<2> for Yuyv<'_> {
    #[inline(always)]
    fn channel(self, pixel: usize, channel: usize) -> u8 {
        self.0[[2 * pixel, 1, 3][channel]]
    }
}

impl Group<2> for Uyvy<'_> {
    #[inline(always)]
    fn channel(self, pixel: usize, channel: usize) -> u8 {
        self.0[[2 * pixel + 1, 0, 2][channel]]
    }
}

impl Group<2> for Nv12<'_> {
    #[inline(always)]
    fn channel(self, pixel: usize, channel: usize) -> u8 {
        [self.0[pixel], self.1[0], self.1[1]][channel]
    }
}

impl Group<2> for I420<'_> {
    #[inline(always)]
    fn channel(self, pixel: usize, channel: usize) -> u8 {
        [self.0[pixel], *self.1, *self.2][channel]
    }
}
