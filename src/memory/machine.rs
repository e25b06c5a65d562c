//! How much memory this process may use: the machine's, or its control group's limit.

use std::fs;
use std::path::Path;

/// Bytes of the machine's memory, or of the limit of the control group that this process is in where
/// that is less (cgroup v2 `memory.max` and v1 `memory.limit_in_bytes`, each with those above it).
/// `None` where the system tells neither.
#[must_use]
pub fn available_bytes() -> Option<u64> {
    let read = |path: &Path| fs::read_to_string(path).ok();
    let machine = read(Path::new("/proc/meminfo")).and_then(|text| total_of_meminfo(&text));
    let groups = read(Path::new("/proc/self/cgroup")).unwrap_or_default();
    let limits = limit_files(&groups).into_iter();
    let limits = limits.filter_map(|file| read(Path::new(&file))?.trim().parse().ok());
    machine.into_iter().chain(limits).min()
}

/// `MemTotal:  16384256 kB` → bytes (proc(5)).
fn total_of_meminfo(text: &str) -> Option<u64> {
    let line = text.lines().find_map(|line| line.strip_prefix("MemTotal:"))?;
    line.trim().strip_suffix("kB")?.trim().parse::<u64>().ok()?.checked_mul(1024)
}

/// The files in which a limit may stand, from the lines of `/proc/self/cgroup` (cgroups(7)):
/// `0::/a/b` for version 2, `5:memory:/a/b` for version 1. In a container the path may be that of
/// the host, and its own group lies at the root of the mount.
fn limit_files(groups: &str) -> Vec<String> {
    let mut files = Vec::new();
    for line in groups.lines() {
        let mut fields = line.splitn(3, ':');
        let (Some(_), Some(controllers), Some(path)) = (fields.next(), fields.next(), fields.next()) else {
            continue;
        };
        let (mount, file) = match controllers {
            "" => ("/sys/fs/cgroup", "memory.max"),
            names if names.split(',').any(|name| name == "memory") => {
                ("/sys/fs/cgroup/memory", "memory.limit_in_bytes")
            }
            _ => continue,
        };
        let groups =
            Path::new(path).ancestors().filter_map(Path::to_str).map(|group| group.trim_matches('/'));
        files.extend(groups.map(|group| match group {
            "" => format!("{mount}/{file}"),
            group => format!("{mount}/{group}/{file}"),
        }));
    }
    files
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_total_stands_in_meminfo() {
        let text = "MemTotal:       16384256 kB\nMemFree:          120000 kB\n";
        assert_eq!(total_of_meminfo(text), Some(16_384_256 * 1024));
        assert_eq!(total_of_meminfo("MemFree: 1 kB\n"), None);
    }

    #[test]
    fn limits_are_looked_for_in_the_group_and_those_above_it() {
        let v2 = limit_files("0::/system.slice/triplanar.service\n");
        let expected = ["/system.slice/triplanar.service", "/system.slice", ""];
        assert_eq!(v2, expected.map(|group| format!("/sys/fs/cgroup{group}/memory.max")));
        let v1 = limit_files("12:cpu,cpuacct:/a\n5:memory:/docker/0f\n");
        let expected = ["/docker/0f", "/docker", ""];
        assert_eq!(v1, expected.map(|group| format!("/sys/fs/cgroup/memory{group}/memory.limit_in_bytes")));
        assert!(limit_files("no such line").is_empty());
    }
}
