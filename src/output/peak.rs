//! How much memory the process has used, and may use.

use std::path::Path;

/// The most memory that this process has held resident, bytes; 0 where the system does not say (it is read from
/// Linux's `/proc/self/status`).
pub fn peak_bytes() -> u64 {
    std::fs::read_to_string("/proc/self/status").ok().and_then(|status| high_water_mark(&status)).unwrap_or(0)
}

/// The most memory that this process could hold, bytes: the least of the machine's with its swap space, of the limit on a process's
/// addresses (`ulimit -v`), and of those of the control groups that it is in, as containers and farms set them. None where the
/// system does not say (it is read from Linux's `/proc` and `/sys`).
pub fn most_bytes() -> Option<u64> {
    let read = |path: &str| std::fs::read_to_string(path).ok();
    let machine = read("/proc/meminfo").and_then(|text| memory_and_swap(&text));
    let limit = read("/proc/self/limits").and_then(|text| address_space(&text));
    let groups = read("/proc/self/cgroup").map(|text| group_limits(&text)).unwrap_or_default();
    let group = groups.iter().filter_map(|path| read(path)?.trim().parse().ok()).min();
    machine.into_iter().chain(limit).chain(group).min()
}

/// Where the limits of a process's control groups are, and those of the groups that these are in. A container may not see its group
/// by its name, but has it at the top.
fn group_limits(groups: &str) -> Vec<String> {
    let limits = |line: &str| {
        let mut parts = line.splitn(3, ':').skip(1);
        let (root, file) = match parts.next()? {
            "" => ("/sys/fs/cgroup", "memory.max"),
            controllers if controllers.split(',').any(|c| c == "memory") => {
                ("/sys/fs/cgroup/memory", "memory.limit_in_bytes")
            }
            _ => return None,
        };
        let above = Path::new(parts.next()?.trim_start_matches('/')).ancestors();
        let path = |group: &Path| Path::new(root).join(group).join(file).to_string_lossy().into_owned();
        Some(above.map(path).collect::<Vec<_>>())
    };
    groups.lines().filter_map(limits).flatten().collect()
}

fn memory_and_swap(meminfo: &str) -> Option<u64> {
    let of = |name: &str| {
        let line = meminfo.lines().find_map(|line| line.strip_prefix(name))?;
        line.trim().strip_suffix("kB")?.trim().parse::<u64>().ok()
    };
    Some((of("MemTotal:")? + of("SwapTotal:").unwrap_or(0)) * 1024)
}

/// The soft limit on addresses; none if it is unlimited.
fn address_space(limits: &str) -> Option<u64> {
    let line = limits.lines().find_map(|line| line.strip_prefix("Max address space"))?;
    line.split_whitespace().next()?.parse().ok()
}

fn high_water_mark(status: &str) -> Option<u64> {
    let line = status.lines().find_map(|line| line.strip_prefix("VmHWM:"))?;
    let kibibytes: u64 = line.trim().strip_suffix("kB")?.trim().parse().ok()?;
    Some(kibibytes * 1024)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_high_water_mark_is_found_or_nothing_is() {
        assert_eq!(high_water_mark("Name:\tbuzz\nVmHWM:\t   12 kB\nVmRSS:\t 8 kB\n"), Some(12 * 1024));
        assert_eq!(high_water_mark("Name:\tbuzz\n"), None);
        assert_eq!(high_water_mark("VmHWM:\tlots\n"), None);
        #[cfg(target_os = "linux")]
        assert!(peak_bytes() > 1 << 16);
    }

    #[test]
    fn what_there_is_is_the_least_that_the_system_says() {
        assert_eq!(memory_and_swap("MemTotal:       10 kB\nSwapTotal:       2 kB\n"), Some(12 * 1024));
        assert_eq!(memory_and_swap("SwapTotal:       2 kB\n"), None);
        let limits =
            |soft: &str| format!("Limit  Soft  Hard  Units\nMax address space  {soft}  unlimited  bytes\n");
        assert_eq!(address_space(&limits("4096")), Some(4096));
        assert_eq!(address_space(&limits("unlimited")), None);
        #[cfg(target_os = "linux")]
        assert!(most_bytes().is_some_and(|most| most > peak_bytes()));
    }

    #[test]
    fn limits_of_groups_are_looked_for_up_to_the_top() {
        assert_eq!(
            group_limits("0::/farm.slice/task 7\n"),
            ["farm.slice/task 7/", "farm.slice/", ""]
                .map(|group| format!("/sys/fs/cgroup/{group}memory.max"))
        );
        assert_eq!(
            group_limits("12:cpu,cpuacct:/a\n4:memory:/docker/f00\n1:name=systemd:/b\n"),
            ["docker/f00/", "docker/", ""].map(|g| format!("/sys/fs/cgroup/memory/{g}memory.limit_in_bytes"))
        );
        assert!(group_limits("nonsense\n").is_empty());
    }
}
