//! The row of units below a header.

/// Units that stand without brackets, in small letters: programs write them in either case.
const UNITS: [&str; 44] = [
    "n", "mn", "un", "µn", "μn", "kn", "m", "dm", "cm", "mm", "um", "µm", "μm", "nm", "in", "inch",
    "ft", "px", "pixel", "s", "sec", "ms", "min", "h", "hz", "khz", "rad", "deg", "°", "%", "g",
    "mg", "kg", "gf", "kgf", "lbf", "pa", "kpa", "mpa", "gpa", "psi", "v", "mv", "j",
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

/// Whether a row has units, and nothing else but dashes for what has none.
pub fn are_units<'c>(cells: impl Iterator<Item = &'c str>) -> bool {
    let cells = cells.filter(|cell| !matches!(*cell, "" | "-"));
    let cells: Vec<&str> = cells.collect();
    !cells.is_empty() && cells.into_iter().all(is_unit)
}
