//! The article's control law.
