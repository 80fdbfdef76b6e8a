//! Pointers of a C caller as references, with null checked.
#![allow(unsafe_code)]

use crate::result::{TautscopeResult, failed, null};

/// What a pointer points to.
///
/// # Errors
/// It is null.
///
/// # Safety
/// If not null, it is aligned and points to a readable `T` that nobody changes during the call.
pub unsafe fn read<'a, T>(name: &str, pointer: *const T) -> Result<&'a T, TautscopeResult> {
    // SAFETY: the caller's contract.
    unsafe { pointer.as_ref() }.ok_or_else(|| null(name))
}

/// The place a pointer points to.
///
/// # Errors
/// It is null.
///
/// # Safety
/// If not null, it is aligned and points to a `T` that nobody else uses during the call.
pub unsafe fn write<'a, T>(name: &str, pointer: *mut T) -> Result<&'a mut T, TautscopeResult> {
    // SAFETY: the caller's contract.
    unsafe { pointer.as_mut() }.ok_or_else(|| null(name))
}

/// Bytes at a pointer.
///
/// # Errors
/// It is null, or there are more bytes than an object can have.
///
/// # Safety
/// If not null, `length` bytes from it are readable and nobody changes them during the call.
pub unsafe fn bytes<'a>(
    name: &str,
    pointer: *const u8,
    length: usize,
) -> Result<&'a [u8], TautscopeResult> {
    if pointer.is_null() {
        return Err(null(name));
    }
    if isize::try_from(length).is_err() {
        return Err(failed(
            TautscopeResult::Size,
            format_args!("{name}: got {length} bytes, expected at most half of the address space"),
        ));
    }
    // SAFETY: not null, not too long; the rest is the caller's contract.
    Ok(unsafe { std::slice::from_raw_parts(pointer, length) })
}

/// Moves a value to the heap and gives it to the caller.
///
/// # Safety
/// If not null, `place` is aligned and writable.
pub unsafe fn give<T>(place: *mut *mut T, value: T) -> Result<(), TautscopeResult> {
    // SAFETY: the caller's contract.
    let place = unsafe { write("the place for the handle", place) }?;
    *place = Box::into_raw(Box::new(value));
    Ok(())
}

/// Takes a value back from the caller, and drops it; null is nothing.
///
/// # Safety
/// If not null, it came from [`give`], and nobody uses it any more.
pub unsafe fn take_back<T>(pointer: *mut T) {
    if !pointer.is_null() {
        // SAFETY: `give` made it from a box.
        drop(unsafe { Box::from_raw(pointer) });
    }
}
