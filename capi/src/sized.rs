//! Structs that begin with their size, for compatibility with programs compiled with an older header, and output
//! pointers.

use std::mem::MaybeUninit;

use engine::{Error, Result};

/// A C struct that begins with its size in bytes and grows only at its end.
///
/// # Safety
/// The type is `repr(C)`, begins with a `usize`, and is valid with all bytes zero.
pub unsafe trait Versioned: Copy {
    /// Name in the header.
    const NAME: &'static str;
    /// Size in the first version.
    const FIRST: usize;
}

/// A copy of the struct at `from`, with fields unknown to an older program zeroed.
///
/// # Safety
/// `from` is NULL or points to as many bytes as its first field states.
pub unsafe fn read<T: Versioned>(from: *const T) -> Result<T> {
    // SAFETY: guaranteed by the caller.
    let (size, own) = (unsafe { size_of_target(from)? }, size_of::<T>());
    let mut copy = MaybeUninit::<T>::zeroed();
    // SAFETY: this many bytes exist and fit; zero is valid for the rest.
    unsafe {
        std::ptr::copy_nonoverlapping(from.cast::<u8>(), copy.as_mut_ptr().cast::<u8>(), size.min(own));
        Ok(copy.assume_init())
    }
}

/// Writes `value` to the struct at `to`, up to the size known to the program, which is kept.
///
/// # Safety
/// `to` is NULL or points to as many writable bytes as its first field states.
pub unsafe fn write<T: Versioned>(to: *mut T, value: &T) -> Result<()> {
    // SAFETY: guaranteed by the caller.
    let size = unsafe { size_of_target(to)? };
    let first = size_of::<usize>();
    let from = std::ptr::from_ref(value).cast::<u8>();
    // SAFETY: both sides have this many bytes.
    unsafe {
        let bytes = size.min(size_of::<T>()) - first;
        std::ptr::copy_nonoverlapping(from.add(first), to.cast::<u8>().add(first), bytes);
    }
    Ok(())
}

/// Size of the struct at `to`, as known to the program.
///
/// # Safety
/// As [`write`].
pub unsafe fn size_of_target<T: Versioned>(to: *const T) -> Result<usize> {
    if to.is_null() {
        return Err(Error::options(format!("{} is NULL", T::NAME), "give a pointer to a struct"));
    }
    // SAFETY: it begins with its size, by the trait's contract.
    let size = unsafe { to.cast::<usize>().read_unaligned() };
    check(size, T::NAME, T::FIRST)?;
    Ok(size)
}

fn check(size: usize, name: &str, least: usize) -> Result<()> {
    if size >= least {
        return Ok(());
    }
    Err(Error::options(
        format!("the size of {name} is {size}, at least {least} are needed"),
        "set `size` to sizeof the struct",
    ))
}

/// Writes `value` to `to`, unless NULL.
///
/// # Safety
/// `to` is NULL or writable.
pub unsafe fn give<T>(to: *mut T, value: T) {
    if !to.is_null() {
        // SAFETY: guaranteed by the caller.
        unsafe { to.write(value) };
    }
}

/// Writes a new handle of `value` to `to`.
///
/// # Safety
/// `to` is NULL or writable.
pub unsafe fn give_handle<T>(to: *mut *mut T, value: T, what: &str) -> Result<()> {
    if to.is_null() {
        return Err(Error::options(format!("`{what}` is NULL"), "give a pointer to write to"));
    }
    // SAFETY: guaranteed by the caller.
    unsafe { to.write(Box::into_raw(Box::new(value))) };
    Ok(())
}
