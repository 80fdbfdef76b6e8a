//! Text of an object for `__repr__`: name and values in Python's notation.

use std::fmt::Debug;

/// `Name(field=value, ...)` of a value with derived `Debug`, structs in it likewise.
pub fn described(value: &impl Debug) -> String {
    format!("{value:?}")
        .replace(" { ", "(")
        .replace(" }", ")")
        .replace(": ", "=")
        .replace("NaN", "nan")
}

/// `described` of a configuration, followed by the fields of its state.
pub fn described_with(settings: &impl Debug, state: &impl Debug) -> String {
    let (mut text, state) = (described(settings), described(state));
    let fields = state.split_once('(').map_or("", |(_, fields)| fields);
    text.truncate(text.len() - 1);
    format!("{text}, {fields}")
}
