//! Estimates the memory that a request needs, and limits it.
//!
//! Requests are checked before they start: one that is refused with a message would
//! otherwise crash the process. The estimates are the largest amounts measured in whole
//! runs of the program, files and figures included.

use std::fs;
use std::path::Path;
use std::sync::atomic::{AtomicU64, Ordering};

/// Allowed bytes; 0: not yet determined.
static ALLOWED: AtomicU64 = AtomicU64::new(0);

/// Sets the bytes that each request of this process may take, in place of half of the
/// memory of the machine.
pub fn allow(bytes: u64) {
    ALLOWED.store(bytes.max(1), Ordering::Relaxed);
}

/// Bytes that one request may take: those set by [`allow`], or half of the memory of the
/// machine, or of the control group of this process if that is less. If neither is known
/// there is no limit.
pub fn allowed() -> u64 {
    match ALLOWED.load(Ordering::Relaxed) {
        0 => {
            let group = fs::read_to_string("/proc/self/cgroup").unwrap_or_default();
            let bytes = [
                machine_memory(),
                control_group_limit(Path::new("/sys/fs/cgroup"), &group),
            ];
            let bytes = bytes.into_iter().flatten().min();
            allow(bytes.map_or(u64::MAX, |bytes| bytes / 2));
            ALLOWED.load(Ordering::Relaxed)
        }
        bytes => bytes,
    }
}

/// The memory of the machine.
fn machine_memory() -> Option<u64> {
    let text = fs::read_to_string("/proc/meminfo").ok()?;
    let line = text
        .lines()
        .find_map(|line| line.strip_prefix("MemTotal:"))?;
    let kilobytes: u64 = line.trim().strip_suffix("kB")?.trim().parse().ok()?;
    kilobytes.checked_mul(1024)
}

/// The smallest memory limit of the control groups in `groups`, the content of
/// `/proc/self/cgroup`, and of their parents.
fn control_group_limit(root: &Path, groups: &str) -> Option<u64> {
    let bytes = |file: &Path| fs::read_to_string(file).ok()?.trim().parse::<u64>().ok();
    let limits = groups.lines().flat_map(|line| {
        let mut parts = line.splitn(3, ':').skip(1);
        let controllers = parts.next().unwrap_or_default();
        let path = parts.next().unwrap_or_default().trim_start_matches('/');
        let (root, file) = match controllers {
            "" => (root.to_path_buf(), "memory.max"),
            _ => (root.join("memory"), "memory.limit_in_bytes"),
        };
        let of_memory = controllers.is_empty() || controllers.split(',').any(|c| c == "memory");
        let folder = root.join(path);
        let folders: Vec<_> = folder.ancestors().map(|folder| folder.join(file)).collect();
        let inside = move |file: &std::path::PathBuf| of_memory && file.starts_with(&root);
        folders.into_iter().filter(inside)
    });
    limits.filter_map(|file| bytes(&file)).min()
}

/// A request that would take more memory than it may: what it is, and what to request in its place.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("{0}")]
pub struct TooMuch(String);

/// Refuses what takes this product of numbers, in bytes, if that is more than is [`allowed`].
fn check(factors: &[usize], instead: &str, what: impl FnOnce() -> String) -> Result<(), TooMuch> {
    let factors = factors.iter().map(|&factor| factor as u64);
    let (needed, allowed) = (factors.fold(1, u64::saturating_mul), allowed());
    match needed > allowed {
        true => Err(TooMuch(format!(
            "{} would take about {} of memory, and {} are allowed: {instead}",
            what(),
            format_bytes(needed),
            format_bytes(allowed)
        ))),
        false => Ok(()),
    }
}

const SMALLER_GRID_ADVICE: &str = "use fewer rods or segments";

/// A leaf on a grid.
pub(crate) fn check_grid_memory(rods: usize, segments: usize) -> Result<(), TooMuch> {
    // Measured: 1750 for one rod of many segments and 2700 for many rods of few; 5600 for
    // one rod with eigenvalues, which take up to 52 fields.
    let nodes = segments.saturating_add(1);
    check(&[rods, nodes, 6_000], SMALLER_GRID_ADVICE, || {
        format!("{rods} rods of {segments} segments")
    })
}

/// Branches of equilibria on a grid, which is refined twice.
pub(crate) fn check_branch_memory(rods: usize, segments: usize) -> Result<(), TooMuch> {
    check(&[rods, segments, 27_000], SMALLER_GRID_ADVICE, || {
        format!("branches of {rods} rods of {segments} segments")
    })
}

/// The factorized sparse matrix of a leaf, of so many numbers.
pub(crate) fn check_factor_memory(numbers: usize) -> Result<(), TooMuch> {
    check(&[numbers, 8], SMALLER_GRID_ADVICE, || {
        format!("a factorised matrix of {numbers} numbers")
    })
}

/// The matrices of a shooting method.
pub(crate) fn check_shooting_memory(rods: usize, intervals: usize) -> Result<(), TooMuch> {
    // Measured: five matrices of (12 N)^2 numbers per interval.
    let matrices = [rods, rods, intervals.saturating_add(1), 5 * 144 * 8];
    let instead =
        "use fewer rods or intervals, or the method semi-implicit, which has no such matrices";
    check(&matrices, instead, || {
        format!("shooting with {rods} rods, intervals: {intervals},")
    })
}

/// A result at `stations` of each rod, besides its base, that are asked for.
///
/// # Errors
/// If it would take more memory than is [`allowed`].
pub fn check_station_memory(rods: usize, stations: usize) -> Result<(), TooMuch> {
    // Measured: 580 for tables, 700 with those of modes, however many; 920 for a page, 1240
    // for that of a motion.
    let nodes = stations.saturating_add(1);
    check(&[rods, nodes, 1_250], "ask for fewer stations", || {
        format!("{rods} rods with {stations} stations")
    })
}

/// The rows of a map.
pub(crate) fn check_map_memory(cells: usize, methods: usize) -> Result<(), TooMuch> {
    let instead = "lower the counts of the axes";
    check(&[cells, methods, 1_000], instead, || {
        format!("{cells} cells by {methods} methods")
    })
}

/// A scenario as text, which is to be parsed. Keys and tables take most: 1,500 bytes each and 60 for
/// every byte of the text are the most that was measured.
pub(crate) fn check_text_memory(text: &[u8]) -> Result<(), TooMuch> {
    let signs = text.iter().filter(|byte| b"=:{[".contains(byte)).count();
    // Every part of a dotted key is a table.
    let dotted = |pair: &&[u8]| pair[0] == b'.' && !pair[1].is_ascii_digit();
    let tables = signs + text.windows(2).filter(dotted).count();
    check(
        &[60 * text.len() + 1_500 * tables],
        "write fewer entries",
        || format!("a scenario of {} bytes", text.len()),
    )
}

const UNITS: [(&str, f64); 4] = [("TB", 1e12), ("GB", 1e9), ("MB", 1e6), ("kB", 1e3)];

/// Formats a number of bytes for people.
pub fn format_bytes(bytes: u64) -> String {
    let bytes = bytes as f64;
    let unit = UNITS.into_iter().find(|(_, unit)| bytes >= *unit);
    unit.map_or(format!("{bytes} bytes"), |(name, unit)| {
        format!("{:.1} {name}", bytes / unit)
    })
}

/// Parses a size as people write it: `2GB`, `500 MB`, `1e9`.
///
/// # Errors
/// If it is not a size of at least one byte.
pub fn parse(text: &str) -> Result<u64, String> {
    let text = text.trim();
    let unit = UNITS.into_iter().find_map(|(name, unit)| {
        let number = text
            .len()
            .checked_sub(name.len())
            .filter(|&at| text.is_char_boundary(at))?;
        let (number, end) = text.split_at(number);
        end.eq_ignore_ascii_case(name).then_some((number, unit))
    });
    let (number, unit) = unit.unwrap_or((text, 1.0));
    let bytes = number.trim().parse::<f64>().map(|number| number * unit);
    match bytes {
        Ok(bytes) if (1.0..1e18).contains(&bytes) => Ok(bytes as u64),
        _ => Err("must be a size, as in 500MB or 2GB".into()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sizes_are_read_and_written() {
        for (text, bytes) in [
            ("2GB", 2_000_000_000),
            ("1.5 mb", 1_500_000),
            ("1e9", 1_000_000_000),
        ] {
            assert_eq!(parse(text), Ok(bytes));
        }
        for text in " GB -1GB 0 many nan inf 1e300 ä äB".split(' ') {
            assert!(parse(text).is_err(), "{text}");
        }
        assert_eq!(format_bytes(5_700_000_000), "5.7 GB");
        assert_eq!(format_bytes(12), "12 bytes");
        let most = check_grid_memory(usize::MAX, usize::MAX).unwrap_err();
        assert!(most.0.contains(&format_bytes(u64::MAX)), "{most}");
    }

    #[test]
    fn the_smallest_limit_of_a_group_and_its_parents_holds() {
        let root = tempfile::tempdir().unwrap();
        let at = |path: &str, limit: &str| {
            let folder = root.path().join(path);
            fs::create_dir_all(&folder).unwrap();
            let name = match path.starts_with("memory") {
                true => "memory.limit_in_bytes",
                false => "memory.max",
            };
            fs::write(folder.join(name), limit).unwrap();
        };
        at("a", "4000\n");
        at("a/b", "max\n");
        at("memory/c", "3000\n");
        let limit = |groups: &str| control_group_limit(root.path(), groups);
        assert_eq!(limit("0::/a/b\n"), Some(4000));
        assert_eq!(limit("0::/\n"), None);
        assert_eq!(limit("5:cpu:/a\n4:memory:/c\n0::/a\n"), Some(3000));
        assert_eq!(limit("nonsense"), None);
    }

    #[test]
    fn half_of_the_machine_is_allowed() {
        if let Some(all) = machine_memory() {
            assert!(all > 1 << 20 && allowed() <= all / 2);
        }
    }
}
