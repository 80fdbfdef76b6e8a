//! Pixel formats.

use crate::error::Error;

/// The longest side of a frame (px), so that counts and sums over it are exact.
pub const MAX_SIDE: usize = 1 << 16;

/// Memory layout of a camera's 8-bit pixels. All lines of memory are equally long and equally far apart.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum PixelFormat {
    /// B, G, R per pixel.
    Bgr,
    /// R, G, B per pixel.
    Rgb,
    /// B, G, R and an unused byte per pixel.
    Bgra,
    /// Y, U, Y, V per two pixels.
    Yuyv,
    /// U, Y, V, Y per two pixels.
    Uyvy,
    /// The rows of Y, then a line of U, V, U, V, ... for every two rows.
    Nv12,
    /// The rows of Y, then those of U, then of V, each at half the resolution; a line of memory holds two
    /// rows of U or V.
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

    const NAMES: [&str; 7] = ["bgr", "rgb", "bgra", "yuyv", "uyvy", "nv12", "i420"];

    /// Name in the configuration: that of the variant in lower case.
    pub fn name(self) -> &'static str {
        Self::NAMES[self as usize]
    }

    /// The format with this [`name`](Self::name).
    ///
    /// # Errors
    /// No format has this name.
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

    /// Bytes of a frame of this width in a line of memory.
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

    /// Whether two columns share U and V, so that the width must be even.
    pub fn shares_columns(self) -> bool {
        matches!(self, Self::Yuyv | Self::Uyvy | Self::Nv12 | Self::I420)
    }

    /// Whether two rows share U and V, so that the height must be even.
    pub fn shares_rows(self) -> bool {
        matches!(self, Self::Nv12 | Self::I420)
    }

    /// Checks the sides `[width, height]` (px) of a frame.
    ///
    /// # Errors
    /// A side is not 1 to [`MAX_SIDE`], or odd where the format requires an even one.
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
}
