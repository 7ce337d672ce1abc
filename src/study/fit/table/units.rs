//! The row of units below a header.

/// Units that stand without brackets.
const UNITS: [&str; 31] = [
    "N", "mN", "uN", "µN", "μN", "kN", "m", "dm", "cm", "mm", "um", "µm", "μm", "nm", "s", "ms",
    "min", "h", "Hz", "kHz", "1/s", "rad", "deg", "°", "%", "g", "mg", "kg", "kPa", "MPa", "GPa",
];

fn is_unit(cell: &str) -> bool {
    let pairs = [('(', ')'), ('[', ']')];
    let bracketed = |(open, close)| cell.starts_with(open) && cell.ends_with(close);
    UNITS.contains(&cell) || cell.len() > 1 && pairs.into_iter().any(bracketed)
}

/// Whether a row has units, and nothing else but dashes for what has none.
pub fn are_units<'c>(cells: impl Iterator<Item = &'c str>) -> bool {
    let cells = cells.filter(|cell| !matches!(*cell, "" | "-"));
    let cells: Vec<&str> = cells.collect();
    !cells.is_empty() && cells.into_iter().all(is_unit)
}
