//! The grid of all combinations of the values of some numbers, the last of which varies fastest: the cells
//! of a map, and the leaves of a sweep.

use crate::study::vary::{ParameterKeys, ParameterSweep};

/// Refuses axes of which two vary the same number, and grids of more cells than `most`.
///
/// # Errors
/// A sentence that says what to change.
pub fn check_axes(axes: &[ParameterSweep], most: usize, cells: &str) -> Result<(), String> {
    let targets: Vec<_> = axes.iter().flat_map(|axis| axis.keys.targets()).collect();
    for (i, target) in targets.iter().enumerate() {
        if targets[..i].contains(target) {
            return Err(format!("{target}: varies twice"));
        }
    }
    let found = axes
        .iter()
        .try_fold(1_usize, |product, axis| {
            product.checked_mul(axis.values.len())
        })
        .unwrap_or(usize::MAX);
    if found > most {
        let allowed = format!("at most {most} are allowed; lower the counts of the axes");
        return Err(format!("{found} {cells}: {allowed}"));
    }
    Ok(())
}

/// Number of cells.
pub fn cell_count(axes: &[ParameterSweep]) -> usize {
    axes.iter().map(|axis| axis.values.len()).product()
}

/// Index of a cell along each axis.
pub fn cell_position(axes: &[ParameterSweep], cell: usize) -> Vec<usize> {
    let mut rest = cell;
    let mut place: Vec<usize> = (axes.iter().rev())
        .map(|axis| {
            let at = rest % axis.values.len();
            rest /= axis.values.len();
            at
        })
        .collect();
    place.reverse();
    place
}

/// The varied values of a cell.
pub fn cell_values(axes: &[ParameterSweep], cell: usize) -> Vec<(&ParameterKeys, f64)> {
    let places = axes.iter().zip(cell_position(axes, cell));
    places
        .map(|(axis, at)| (&axis.keys, axis.values[at]))
        .collect()
}

/// The varied values of a cell as texts, as in tables.
pub fn cell_texts(axes: &[ParameterSweep], cell: usize) -> Vec<String> {
    let values = cell_values(axes, cell).into_iter();
    values.map(|(keys, value)| keys.text(value)).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn axes(texts: &[&str]) -> Vec<ParameterSweep> {
        texts.iter().map(|text| text.parse().unwrap()).collect()
    }

    #[test]
    fn the_last_number_varies_fastest() {
        let axes = axes(&["load.gravity[2]=-1..-3:3", "leaf.rods=3..5:2"]);
        let cells: Vec<Vec<String>> = (0..cell_count(&axes))
            .map(|cell| cell_texts(&axes, cell))
            .collect();
        let wanted = [
            ["-1.0", "3"],
            ["-1.0", "5"],
            ["-2.0", "3"],
            ["-2.0", "5"],
            ["-3.0", "3"],
            ["-3.0", "5"],
        ];
        assert_eq!(cells, wanted);
    }

    #[test]
    fn a_number_varies_once_and_grids_are_bounded() {
        let twice = axes(&["coupling.y+coupling.z=1..2:2", "coupling.z=1..2:2"]);
        let why = check_axes(&twice, 10, "leaves").unwrap_err();
        assert_eq!(why, "coupling.z: varies twice");
        let many = axes(&["coupling.y=1..2:4", "coupling.z=1..2:3"]);
        assert!(check_axes(&many, 12, "leaves").is_ok());
        let why = check_axes(&many, 11, "leaves").unwrap_err();
        assert!(why.starts_with("12 leaves: at most 11"), "{why}");
        // The product of their counts is larger than any number of the machine.
        let key = |k: usize| format!("stiffness.bending_2[{k}]=1..2:10000");
        let huge: Vec<ParameterSweep> = (0..6).map(|k| key(k).parse().unwrap()).collect();
        assert!(check_axes(&huge, 1_000_000, "leaves").is_err());
    }
}
