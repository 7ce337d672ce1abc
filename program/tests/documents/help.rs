//! The help of every verb names its options and exit statuses.

use leafdyn_testing::workplace::{Workplace, contains, pairs};

const OPTIONS: &str = "
    relax => --method --segments --tolerance --set --out --json --keep-unstable --modes semi-implicit
    check => --tolerance --set --out --json --intervals --keep-unstable
    simulate => --tolerance --set --out --json --method explicit semi-implicit --segments --step
    chart => --seconds --methods --peers --rods --tolerance --set --out --json shooting-from-rest
    map => --vary --methods --cell-seconds --show --tolerance --set --out --json
    trace => --vary --switch --until --keep-unstable --segments --points --tolerance --set --out --json
";

const STATUSES: &str = "
    check => 0 both methods agree; 1 they differ or could not be compared; 2 the request was refused
    simulate => 0 followed to its end; 1 ended early; 2 the request was refused; 130 stopped by Ctrl-C
    chart => 0 charted; do not confirm the reference; 2 the request was refused
    map => 0 the map is made; 2 the request was refused
    trace => 0 all branches; 2 the request
";

#[test]
fn names_every_option_and_exit_status() {
    for (table, between) in [(OPTIONS, " "), (STATUSES, "; ")] {
        for (verb, parts) in pairs(table) {
            let run = Workplace::new().ok(format!("{verb} --help"));
            let help: Vec<&str> = run.out.split_whitespace().collect();
            let parts: Vec<&str> = parts.split(between).collect();
            contains(&help.join(" "), &parts);
        }
    }
}
