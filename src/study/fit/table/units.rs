//! The row of units below a header.

use super::decimals::is_number;

/// Units that stand without brackets, in small letters: programs write them in either case.
const UNITS: [&str; 61] = [
    "n", "mn", "un", "µn", "μn", "kn", "m", "dm", "cm", "mm", "um", "µm", "μm", "nm", "in", "inch",
    "ft", "px", "pixel", "s", "sec", "ms", "min", "h", "hz", "khz", "rad", "deg", "°", "%", "g",
    "mg", "kg", "gf", "kgf", "lbf", "pa", "kpa", "mpa", "gpa", "psi", "v", "mv", "j", "us", "µs",
    "μs", "second", "seconds", "minute", "minutes", "lb", "oz", "dyn", "bar", "°c", "°f", "a",
    "ma", "w", "count",
];

fn is_unit(cell: &str) -> bool {
    let pairs = [('(', ')'), ('[', ']')];
    let bracketed = |(open, close)| cell.starts_with(open) && cell.ends_with(close);
    cell.len() > 1 && pairs.into_iter().any(bracketed) || is_product(cell)
}

/// Whether a cell is a product or a quotient of units, which may have exponents, as `N/mm2`.
fn is_product(cell: &str) -> bool {
    let small = cell.to_lowercase();
    let base = |factor: &str| -> String {
        let factor = factor.trim();
        let exponent = |it: char| it.is_ascii_digit() || matches!(it, '^' | '-' | '²' | '³');
        factor.trim_end_matches(exponent).into()
    };
    let mut factors = small.split(['/', '*', '·']).enumerate();
    factors.all(|(at, factor)| match factor.trim() {
        "1" => at == 0 && small.contains('/'),
        factor => UNITS.contains(&base(factor).as_str()),
    })
}

/// Whether a row has units: no number, and a unit in at least half of what else it has besides dashes.
pub fn are_units<'c>(cells: impl Iterator<Item = &'c str>) -> bool {
    let cells = cells.filter(|cell| !matches!(*cell, "" | "-"));
    let cells: Vec<&str> = cells.collect();
    let units = cells.iter().filter(|cell| is_unit(cell)).count();
    units > 0 && 2 * units >= cells.len() && !cells.into_iter().any(is_number)
}
