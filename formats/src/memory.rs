//! What memory this machine has left.

/// Bytes available to programs; none where the system does not tell.
pub fn available() -> Option<u64> {
    parse(&std::fs::read_to_string("/proc/meminfo").ok()?)
}

/// From the text of /proc/meminfo.
fn parse(meminfo: &str) -> Option<u64> {
    let line = meminfo.lines().find_map(|line| line.strip_prefix("MemAvailable:"))?;
    line.trim().strip_suffix("kB")?.trim().parse::<u64>().ok().map(|kilobytes| kilobytes * 1024)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_available_memory_is_read() {
        let text = "MemTotal:       24684092 kB\nMemFree: 1 kB\nMemAvailable:   23936684 kB\n";
        assert_eq!(parse(text), Some(23_936_684 * 1024));
        assert_eq!(parse("MemTotal: 3 kB\n"), None);
    }
}
