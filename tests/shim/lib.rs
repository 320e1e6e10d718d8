//! A library for `LD_PRELOAD` that counts the system calls a program makes on files of one folder, and its calls of MPI, and does something
//! at one of them: end the program, tear a write, fail, flip a bit, wait. The program itself knows nothing of it.
//! `tests::shim` says what is asked for, in environment variables; `plan.rs` reads them.
//!
//! Here are the calls: each asks [`judge`] what is to be done, and hands on to the function it stands for.

mod plan;
mod raw;

use libc::{c_char, c_int, c_uint, c_void, iovec, mode_t, off_t, size_t, ssize_t};
use plan::{Kind, Verdict, judge};
use raw::Place;
use std::sync::OnceLock;

/// Functions that stand for those of the same names in the libraries behind this one, which the body has as `$next`.
macro_rules! stand_for {
    ($($name:ident)+, $arguments:tt -> $result:ty, |$next:ident| $body:expr) => {
        $(stand_for!(@one $name, $arguments -> $result, |$next| $body);)+
    };
    (@one $name:ident, ($($argument:ident: $type:ty),*) -> $result:ty, |$next:ident| $body:expr) => {
        #[unsafe(no_mangle)]
        #[allow(non_snake_case, reason = "as the library has it")]
        unsafe extern "C" fn $name($($argument: $type),*) -> $result {
            static NEXT: OnceLock<usize> = OnceLock::new();
            let found = *NEXT.get_or_init(|| raw::behind(concat!(stringify!($name), "\0")));
            // SAFETY: the C library has a function of this name and signature. Arguments that C leaves out where there
            // is nothing to say (the mode of an open) have a register all the same.
            let next = unsafe { std::mem::transmute::<usize, unsafe extern "C" fn($($type),*) -> $result>(found) };
            // SAFETY, here and in the bodies: the program vouches for what it hands to a system call.
            let $next = |$($argument: $type),*| unsafe { next($($argument),*) };
            $body
        }
    };
}

stand_for!(open open64, (path: *const c_char, flags: c_int, mode: mode_t) -> c_int, |next| {
    plain(kind_of_open(flags), here(path), minus_one, || next(path, flags, mode))
});
stand_for!(openat openat64, (folder: c_int, path: *const c_char, flags: c_int, mode: mode_t) -> c_int, |next| {
    plain(kind_of_open(flags), Place::Named(folder, path), minus_one, || next(folder, path, flags, mode))
});

stand_for!(write, (fd: c_int, buffer: *const c_void, count: size_t) -> ssize_t, |next| {
    written(fd, &[part(buffer, count)], |bytes| next(fd, bytes.as_ptr().cast(), bytes.len()), || next(fd, buffer, count))
});
stand_for!(pwrite pwrite64, (fd: c_int, buffer: *const c_void, count: size_t, at: off_t) -> ssize_t, |next| {
    let put = |bytes: &[u8]| next(fd, bytes.as_ptr().cast(), bytes.len(), at);
    written(fd, &[part(buffer, count)], put, || next(fd, buffer, count, at))
});
stand_for!(writev, (fd: c_int, parts: *const iovec, count: c_int) -> ssize_t, |next| {
    let put = |bytes: &[u8]| next(fd, &part(bytes.as_ptr().cast(), bytes.len()), 1);
    written(fd, unsafe { list(parts, count) }, put, || next(fd, parts, count))
});
stand_for!(pwritev pwritev64, (fd: c_int, parts: *const iovec, count: c_int, at: off_t) -> ssize_t, |next| {
    let put = |bytes: &[u8]| next(fd, &part(bytes.as_ptr().cast(), bytes.len()), 1, at);
    written(fd, unsafe { list(parts, count) }, put, || next(fd, parts, count, at))
});

stand_for!(read, (fd: c_int, buffer: *mut c_void, count: size_t) -> ssize_t, |next| {
    taken(fd, &[part(buffer, count)], |count| next(fd, buffer, count), || next(fd, buffer, count))
});
stand_for!(pread pread64, (fd: c_int, buffer: *mut c_void, count: size_t, at: off_t) -> ssize_t, |next| {
    taken(fd, &[part(buffer, count)], |count| next(fd, buffer, count, at), || next(fd, buffer, count, at))
});
stand_for!(preadv preadv64, (fd: c_int, parts: *const iovec, count: c_int, at: off_t) -> ssize_t, |next| {
    let all = unsafe { list(parts, count) };
    let first = |length| next(fd, &part(all[0].iov_base, length), 1, at);
    taken(fd, all, first, || next(fd, parts, count, at))
});

stand_for!(ftruncate ftruncate64, (fd: c_int, length: off_t) -> c_int, |next| {
    plain(Kind::Truncate, Place::Open(fd), minus_one, || next(fd, length))
});
stand_for!(fallocate fallocate64, (fd: c_int, mode: c_int, from: off_t, length: off_t) -> c_int, |next| {
    plain(Kind::Allocate, Place::Open(fd), minus_one, || next(fd, mode, from, length))
});
// This one returns the code itself.
stand_for!(posix_fallocate posix_fallocate64, (fd: c_int, from: off_t, length: off_t) -> c_int, |next| {
    plain(Kind::Allocate, Place::Open(fd), |code| code, || next(fd, from, length))
});
stand_for!(fsync fdatasync, (fd: c_int) -> c_int, |next| plain(Kind::Sync, Place::Open(fd), minus_one, || next(fd)));

// Of an old and a new name the new one counts.
stand_for!(rename, (old: *const c_char, new: *const c_char) -> c_int, |next| {
    plain(Kind::Rename, here(new), minus_one, || next(old, new))
});
stand_for!(renameat, (from: c_int, old: *const c_char, to: c_int, new: *const c_char) -> c_int, |next| {
    plain(Kind::Rename, Place::Named(to, new), minus_one, || next(from, old, to, new))
});
stand_for!(renameat2, (from: c_int, old: *const c_char, to: c_int, new: *const c_char, flags: c_uint) -> c_int, |next| {
    plain(Kind::Rename, Place::Named(to, new), minus_one, || next(from, old, to, new, flags))
});
stand_for!(link, (old: *const c_char, new: *const c_char) -> c_int, |next| {
    plain(Kind::Link, here(new), minus_one, || next(old, new))
});
stand_for!(linkat, (from: c_int, old: *const c_char, to: c_int, new: *const c_char, flags: c_int) -> c_int, |next| {
    plain(Kind::Link, Place::Named(to, new), minus_one, || next(from, old, to, new, flags))
});
stand_for!(unlink rmdir, (path: *const c_char) -> c_int, |next| {
    plain(Kind::Remove, here(path), minus_one, || next(path))
});
stand_for!(unlinkat, (folder: c_int, path: *const c_char, flags: c_int) -> c_int, |next| {
    plain(Kind::Remove, Place::Named(folder, path), minus_one, || next(folder, path, flags))
});
stand_for!(mkdir, (path: *const c_char, mode: mode_t) -> c_int, |next| {
    plain(Kind::Folder, here(path), minus_one, || next(path, mode))
});
stand_for!(mkdirat, (folder: c_int, path: *const c_char, mode: mode_t) -> c_int, |next| {
    plain(Kind::Folder, Place::Named(folder, path), minus_one, || next(folder, path, mode))
});

// Handles of MPI are pointers or numbers: what is handed on is the register.
stand_for!(MPI_Isend, (buffer: *const c_void, count: c_int, of: size_t, to: c_int, tag: c_int, comm: size_t, request: *mut c_void) -> c_int, |next| {
    message(Kind::Send, count, || next(buffer, count, of, to, tag, comm, request))
});
stand_for!(MPI_Allreduce, (mine: *const c_void, all: *mut c_void, count: c_int, of: size_t, how: size_t, comm: size_t) -> c_int, |next| {
    message(Kind::Reduce, count, || next(mine, all, count, of, how, comm))
});
stand_for!(MPI_Allgather, (mine: *const c_void, count: c_int, of: size_t, all: *mut c_void, each: c_int, in_all: size_t, comm: size_t) -> c_int, |next| {
    message(Kind::Gather, count, || next(mine, count, of, all, each, in_all, comm))
});

/// Exchange with other ranks.
fn message(kind: Kind, count: c_int, call: impl Fn() -> c_int) -> c_int {
    match judge(kind, Place::Ranks, usize::try_from(count).unwrap_or(0)) {
        Verdict::EndAfter => {
            call();
            raw::kill()
        }
        _ => call(),
    }
}

/// Calls without a buffer. `failed` returns an error code as the call would.
fn plain(kind: Kind, place: Place, failed: impl Fn(c_int) -> c_int, call: impl Fn() -> c_int) -> c_int {
    match judge(kind, place, 0) {
        Verdict::Fail(code) => failed(code),
        Verdict::EndAfter => {
            call();
            raw::kill()
        }
        _ => call(),
    }
}

/// Writes: `put` writes other bytes instead of all.
fn written(fd: c_int, all: &[iovec], put: impl Fn(&[u8]) -> ssize_t, call: impl Fn() -> ssize_t) -> ssize_t {
    let bytes = || {
        let mut bytes = Vec::new();
        for part in all {
            // SAFETY: the program vouches for what it hands to a system call.
            bytes.extend_from_slice(unsafe { std::slice::from_raw_parts(part.iov_base.cast::<u8>(), part.iov_len) });
        }
        bytes
    };
    let half = |bytes: &[u8]| put(&bytes[..bytes.len().div_ceil(2)]);
    match judge(Kind::Write, Place::Open(fd), length(all)) {
        Verdict::Go => call(),
        Verdict::Fail(code) => minus_one(code) as ssize_t,
        Verdict::EndAfter => {
            half(&bytes());
            raw::kill()
        }
        Verdict::Short => half(&bytes()),
        Verdict::Flip => {
            let mut bytes = bytes();
            flip(&mut bytes);
            put(&bytes)
        }
    }
}

/// Reads: `some` reads fewer bytes, no more than the first part holds.
fn taken(fd: c_int, all: &[iovec], some: impl Fn(size_t) -> ssize_t, call: impl Fn() -> ssize_t) -> ssize_t {
    match judge(Kind::Read, Place::Open(fd), length(all)) {
        Verdict::Go => call(),
        Verdict::Fail(code) => minus_one(code) as ssize_t,
        Verdict::EndAfter => raw::kill(),
        Verdict::Short => some(all[0].iov_len.div_ceil(2)),
        Verdict::Flip => {
            let read = call();
            let first = usize::try_from(read).unwrap_or(0).min(all[0].iov_len);
            // SAFETY: the program's own buffer, and no more of it than was just filled.
            flip(unsafe { std::slice::from_raw_parts_mut(all[0].iov_base.cast(), first) });
            read
        }
    }
}

stand_for!(clock_gettime, (clock: libc::clockid_t, time: *mut libc::timespec) -> c_int, |next| {
    let status = next(clock, time);
    if clock == libc::CLOCK_REALTIME && status == 0 {
        // SAFETY: the program's own, just filled.
        unsafe { (*time).tv_sec += plan::jumped() };
    }
    status
});

/// Changes a bit in the middle.
fn flip(bytes: &mut [u8]) {
    let middle = bytes.len() / 2;
    if let Some(byte) = bytes.get_mut(middle) {
        *byte ^= 8;
    }
}

/// As most calls fail: -1, and the code in errno.
fn minus_one(code: c_int) -> c_int {
    raw::set_errno(code);
    -1
}

fn here(path: *const c_char) -> Place {
    Place::Named(libc::AT_FDCWD, path)
}

fn part(base: *const c_void, length: size_t) -> iovec {
    iovec { iov_base: base.cast_mut(), iov_len: length }
}

/// SAFETY: as many parts as are said.
unsafe fn list<'a>(parts: *const iovec, count: c_int) -> &'a [iovec] {
    match usize::try_from(count) {
        Ok(count) if count > 0 => unsafe { std::slice::from_raw_parts(parts, count) },
        _ => &[],
    }
}

fn length(parts: &[iovec]) -> usize {
    parts.iter().map(|part| part.iov_len).sum()
}

fn kind_of_open(flags: c_int) -> Kind {
    match flags & (libc::O_ACCMODE | libc::O_CREAT | libc::O_TRUNC) {
        libc::O_RDONLY => Kind::Open,
        _ => Kind::Create,
    }
}
