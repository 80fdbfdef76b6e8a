//! Places to pixels and back.

/// The whole part of a place; 0 of what is below or not a number.
#[expect(
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    reason = "a cast from a float saturates; NaN becomes 0"
)]
pub fn whole(place: f64) -> usize {
    place as usize
}

/// A count of pixels: a frame's side is at most [`crate::frame::MAX_SIDE`], so that nothing is lost.
pub fn real(count: usize) -> f64 {
    u32::try_from(count).map_or(f64::INFINITY, f64::from)
}

/// In the precision of light.
#[expect(clippy::cast_possible_truncation, reason = "light has a few digits")]
pub fn single(value: f64) -> f32 {
    value as f32
}
