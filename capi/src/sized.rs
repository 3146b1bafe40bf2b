//! Structs that begin with their size, so that programs that were compiled with an older header go on working, and
//! pointers to write to.

use std::mem::MaybeUninit;

use engine::{Error, Result};

/// A struct of C that begins with its size in bytes. Fields are only ever added at its end.
///
/// # Safety
/// The type is `repr(C)`, begins with a `usize`, and is valid with all bytes zero.
pub unsafe trait Versioned: Copy {
    /// Its name in the header.
    const NAME: &'static str;
    /// The size that it had at first.
    const FIRST: usize;
}

/// A copy of the struct at `from`. What an older program does not know of is zero.
///
/// # Safety
/// `from` is NULL or points to as many bytes as its first field says.
pub unsafe fn read<T: Versioned>(from: *const T) -> Result<T> {
    // SAFETY: as the caller states.
    let (size, own) = (unsafe { size_of_target(from)? }, size_of::<T>());
    let mut copy = MaybeUninit::<T>::zeroed();
    // SAFETY: so many bytes are there, and fit; all zero is valid for the rest.
    unsafe {
        std::ptr::copy_nonoverlapping(from.cast::<u8>(), copy.as_mut_ptr().cast::<u8>(), size.min(own));
        Ok(copy.assume_init())
    }
}

/// Writes `value` to the struct at `to`, as much of it as the program knows of. Its size stays.
///
/// # Safety
/// `to` is NULL or points to as many bytes as its first field says, which may be written.
pub unsafe fn write<T: Versioned>(to: *mut T, value: &T) -> Result<()> {
    // SAFETY: as the caller states.
    let size = unsafe { size_of_target(to)? };
    let first = size_of::<usize>();
    let from = std::ptr::from_ref(value).cast::<u8>();
    // SAFETY: so many bytes are there on both sides.
    unsafe {
        let bytes = size.min(size_of::<T>()) - first;
        std::ptr::copy_nonoverlapping(from.add(first), to.cast::<u8>().add(first), bytes);
    }
    Ok(())
}

/// The size of the struct at `to`, as the program knows it.
///
/// # Safety
/// As [`write`].
pub unsafe fn size_of_target<T: Versioned>(to: *const T) -> Result<usize> {
    if to.is_null() {
        return Err(Error::options(format!("{} is NULL", T::NAME), "give a pointer to a struct"));
    }
    // SAFETY: it begins with its size, as the trait states.
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

/// Writes `value` to `to`, unless that is NULL.
///
/// # Safety
/// `to` is NULL or may be written.
pub unsafe fn give<T>(to: *mut T, value: T) {
    if !to.is_null() {
        // SAFETY: as the caller states.
        unsafe { to.write(value) };
    }
}

/// Makes a handle of `value` and writes it to `to`.
///
/// # Safety
/// `to` is NULL or may be written.
pub unsafe fn give_handle<T>(to: *mut *mut T, value: T, what: &str) -> Result<()> {
    if to.is_null() {
        return Err(Error::options(format!("`{what}` is NULL"), "give a pointer to write to"));
    }
    // SAFETY: as the caller states.
    unsafe { to.write(Box::into_raw(Box::new(value))) };
    Ok(())
}
