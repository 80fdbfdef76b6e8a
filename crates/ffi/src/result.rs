//! Results of calls, and the message of the last error of a thread.

use std::cell::RefCell;
use std::ffi::c_char;
use std::fmt::{self, Write};
use std::panic::{AssertUnwindSafe, catch_unwind};

/// Result of a call; after anything but OK, `tautscope_error_message` describes what was wrong.
#[repr(u32)]
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum TautscopeResult {
    /// Done.
    Ok = 0,
    /// A pointer is null that must not be.
    NullPointer = 1,
    /// The configuration cannot be read, or a setting is out of range; nothing was created or changed.
    Config = 2,
    /// A number is not finite, or not one of those allowed; the loop is unchanged.
    Signal = 3,
    /// The image is not what the configured camera gives; the loop is unchanged.
    Image = 4,
    /// The member `size` of a structure is smaller than the structure of this version, or a count is not that of the loop.
    Size = 5,
    /// An error in this library; the handle cannot be used any more.
    Internal = 6,
}

/// Bytes of the message of an error, with the final zero.
const CAPACITY: usize = 1024;

thread_local! {
    static MESSAGE: RefCell<Message> = const { RefCell::new(Message { bytes: [0; CAPACITY], length: 0 }) };
}

/// Text in a fixed buffer, cut where it is full; at least one zero follows.
struct Message {
    bytes: [u8; CAPACITY],
    length: usize,
}

impl Write for Message {
    fn write_str(&mut self, text: &str) -> fmt::Result {
        let free = CAPACITY - 1 - self.length;
        let mut length = text.len().min(free);
        while !text.is_char_boundary(length) {
            length -= 1;
        }
        self.bytes[self.length..self.length + length].copy_from_slice(&text.as_bytes()[..length]);
        self.length += length;
        Ok(())
    }
}

/// Keeps the message of an error for this thread, and returns the error. Does not allocate.
pub fn failed(result: TautscopeResult, message: fmt::Arguments<'_>) -> TautscopeResult {
    MESSAGE.with_borrow_mut(|kept| {
        kept.bytes.fill(0);
        kept.length = 0;
        // Writing to this buffer cannot fail; an error could only be of the value's own `Display`.
        let _ = kept.write_fmt(message);
    });
    result
}

/// Calls a function; an error is its result, and a panic is `Internal`.
pub fn guarded(call: impl FnOnce() -> Result<(), TautscopeResult>) -> TautscopeResult {
    match catch_unwind(AssertUnwindSafe(call)) {
        Ok(Ok(())) => TautscopeResult::Ok,
        Ok(Err(result)) => result,
        Err(cause) => {
            let text = cause
                .downcast_ref::<String>()
                .map(String::as_str)
                .or_else(|| cause.downcast_ref::<&str>().copied())
                .unwrap_or("unknown cause");
            let result = failed(
                TautscopeResult::Internal,
                format_args!("error in the library: {text}"),
            );
            // The value of a panic may itself panic when it is dropped; the value of that one is leaked.
            if let Err(again) = catch_unwind(AssertUnwindSafe(|| drop(cause))) {
                std::mem::forget(again);
            }
            result
        }
    }
}

/// A handle that a panic makes unusable.
pub trait Handle {
    /// Whether a panic left a call on this handle.
    fn is_broken(&mut self) -> &mut bool;
}

/// Calls a function with a handle, as [`guarded`].
pub fn with_handle<H: Handle>(
    handle: Option<&mut H>,
    call: impl FnOnce(&mut H) -> Result<(), TautscopeResult>,
) -> TautscopeResult {
    let Some(handle) = handle else {
        return null("the handle");
    };
    if *handle.is_broken() {
        return failed(
            TautscopeResult::Internal,
            format_args!("an earlier error in the library has made the handle unusable"),
        );
    }
    let result = guarded(|| call(handle));
    *handle.is_broken() = result == TautscopeResult::Internal;
    result
}

/// The error that a pointer is null.
pub fn null(name: &str) -> TautscopeResult {
    failed(
        TautscopeResult::NullPointer,
        format_args!("{name}: got a null pointer"),
    )
}

/// The message of the last error of the calling thread; empty if there was none. It is UTF-8, and valid until the next call
/// of this thread that fails.
#[allow(unsafe_code, reason = "exported")]
#[unsafe(no_mangle)]
pub extern "C" fn tautscope_error_message() -> *const c_char {
    MESSAGE.with_borrow(|kept| kept.bytes.as_ptr().cast())
}
