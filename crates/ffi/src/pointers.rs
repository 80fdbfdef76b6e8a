//! Pointers of a C caller as references, with null checked.
#![allow(unsafe_code)]

use crate::result::{TautscopeResult, failed, guarded, null};

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

/// Numbers at a pointer.
///
/// # Errors
/// It is null.
///
/// # Safety
/// If not null, it is aligned, `count` numbers from it are readable and nobody changes them during the call.
pub unsafe fn numbers<'a>(
    name: &str,
    pointer: *const f64,
    count: usize,
) -> Result<&'a [f64], TautscopeResult> {
    if pointer.is_null() {
        return Err(null(name));
    }
    // SAFETY: not null; the rest is the caller's contract.
    Ok(unsafe { std::slice::from_raw_parts(pointer, count) })
}

/// Place for numbers at a pointer.
///
/// # Errors
/// It is null.
///
/// # Safety
/// If not null, it is aligned, and nobody else uses the `count` numbers from it during the call.
pub unsafe fn numbers_mut<'a>(
    name: &str,
    pointer: *mut f64,
    count: usize,
) -> Result<&'a mut [f64], TautscopeResult> {
    if pointer.is_null() {
        return Err(null(name));
    }
    // SAFETY: not null; the rest is the caller's contract.
    Ok(unsafe { std::slice::from_raw_parts_mut(pointer, count) })
}

/// A structure without padding whose first member is its size in bytes, as the caller knows it (u32).
///
/// # Safety
/// It is.
pub unsafe trait Sized32 {}

/// Checks the size of the caller's report.
///
/// # Safety
/// It is null, or `size` is readable.
pub unsafe fn check_report<T: Sized32>(report: *const T) -> Result<(), TautscopeResult> {
    if report.is_null() {
        return Ok(());
    }
    // SAFETY: the caller's contract.
    let size = unsafe { report.cast::<u32>().read() } as usize;
    let needed = size_of::<T>();
    if size < needed {
        return Err(failed(
            TautscopeResult::Size,
            format_args!("report.size: got {size}, expected at least {needed}"),
        ));
    }
    Ok(())
}

/// Writes a report, all but its size.
///
/// # Safety
/// [`check_report`] accepted it.
pub unsafe fn write_report<T: Sized32>(report: *mut T, done: &T) {
    if report.is_null() {
        return;
    }
    let start = size_of::<u32>();
    // SAFETY: both have this size, of which none is padding, and do not overlap.
    unsafe {
        let from = std::ptr::from_ref(done).cast::<u8>().add(start);
        from.copy_to_nonoverlapping(report.cast::<u8>().add(start), size_of::<T>() - start);
    }
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
        // Dropping plain numbers does not panic; should it, the memory is lost and no more.
        let _ = guarded(|| {
            // SAFETY: `give` made it from a box.
            drop(unsafe { Box::from_raw(pointer) });
            Ok(())
        });
    }
}
