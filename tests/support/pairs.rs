//! Tables of cases.

/// The lines `given => said` of a table.
pub fn pairs(table: &str) -> impl Iterator<Item = (&str, &str)> {
    let lines = table.lines().filter(|line| !line.trim().is_empty());
    lines.map(|line| {
        let (given, said) = line.split_once("=>").expect("given => said");
        (given.trim(), said.trim())
    })
}
