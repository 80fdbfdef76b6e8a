//! The twin's pictures.
