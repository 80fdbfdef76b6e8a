//! Image to markers.
