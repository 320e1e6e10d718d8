//! What the library does itself: by system calls that pass its own functions by.

use libc::{c_char, c_int};
use std::ffi::CStr;

/// Where a call goes.
#[derive(Clone, Copy)]
pub enum Place {
    /// To an open file.
    Open(c_int),
    /// To a name, relative to an open folder or, with `AT_FDCWD`, to the current one.
    Named(c_int, *const c_char),
    /// To other ranks.
    Ranks,
}

impl Place {
    /// The path; `None` where it can't be told.
    pub fn path(self) -> Option<String> {
        let (folder, name) = match self {
            Self::Ranks => return None,
            Self::Open(fd) => return link(&format!("/proc/self/fd/{fd}\0")),
            Self::Named(_, name) if name.is_null() => return None,
            Self::Named(folder, name) => (folder, name),
        };
        // SAFETY: the caller of the system call vouches for the name.
        let name = unsafe { CStr::from_ptr(name) }.to_str().ok()?;
        if name.starts_with('/') {
            return Some(name.to_owned());
        }
        let folder = match folder {
            libc::AT_FDCWD => link("/proc/self/cwd\0"),
            fd => link(&format!("/proc/self/fd/{fd}\0")),
        };
        Some(format!("{}/{name}", folder?))
    }
}

/// What a symbolic link says. `path` ends with a zero.
pub fn link(path: &str) -> Option<String> {
    let mut target = [0u8; 4096];
    // SAFETY: the path ends with a zero, the buffer has the length that is said.
    let length = unsafe {
        libc::syscall(libc::SYS_readlinkat, libc::AT_FDCWD, path.as_ptr(), target.as_mut_ptr(), target.len())
    };
    let text = target.get(..usize::try_from(length).ok()?)?;
    String::from_utf8(text.to_vec()).ok()
}

/// Appends a line to a file, in one call. `path` ends with a zero.
pub fn append(path: &str, line: &str) {
    let flags = libc::O_WRONLY | libc::O_CREAT | libc::O_APPEND | libc::O_CLOEXEC;
    // SAFETY: the path ends with a zero, the line has the length that is said.
    unsafe {
        let fd = libc::syscall(libc::SYS_openat, libc::AT_FDCWD, path.as_ptr(), flags, 0o644);
        if fd >= 0 {
            libc::syscall(libc::SYS_write, fd, line.as_ptr(), line.len());
            libc::syscall(libc::SYS_close, fd);
        }
    }
}

/// Is there a file of this name? `path` ends with a zero.
pub fn exists(path: &str) -> bool {
    // SAFETY: the path ends with a zero.
    unsafe { libc::syscall(libc::SYS_faccessat, libc::AT_FDCWD, path.as_ptr(), libc::F_OK) == 0 }
}

/// Ends this process as `kill -9` does.
pub fn kill() -> ! {
    loop {
        // SAFETY: it touches no memory.
        unsafe { libc::syscall(libc::SYS_kill, libc::getpid(), libc::SIGKILL) };
    }
}

/// Suspends this process until it gets SIGCONT.
pub fn suspend() {
    // SAFETY: it touches no memory.
    unsafe { libc::syscall(libc::SYS_kill, libc::getpid(), libc::SIGSTOP) };
}

/// The address of a function in the libraries behind this one. `name` ends with a zero.
pub fn behind(name: &str) -> usize {
    // SAFETY: the name ends with a zero.
    let found = unsafe { libc::dlsym(libc::RTLD_NEXT, name.as_ptr().cast()) };
    if found.is_null() {
        // SAFETY: it does not return. A message would go through the very functions that are missing.
        unsafe { libc::abort() };
    }
    found as usize
}

pub fn set_errno(code: c_int) {
    // SAFETY: this thread's own errno.
    unsafe { *libc::__errno_location() = code };
}

pub fn errno() -> c_int {
    // SAFETY: this thread's own errno.
    unsafe { *libc::__errno_location() }
}
