//! A number that stands on two pages, or on a page and in the code, is the same in both,
//! to the digits of the one with fewer.

use leafdyn_testing::root;
use std::fs;

/// Pairs of places of one number: a file, and the words around the number, which is {}.
const PLACES: &str = r#"
docs/methods.md: take {} factorisations in the median
docs/speed.md: | 100 real ones | 1.90 | 5.03 | 33.8 | 87.7 | {} |

Cargo.toml: rust-version = "{}"
README.md: [Rust](https://rustup.rs) {} or newer

Cargo.toml: rust-version = "{}"
docs/python.md: [Rust](https://rustup.rs) {} or newer

README.md: N = 5 | 5.5e-6 | {} ms |
docs/speed.md: `tol=1e-3` | 5.5e-6 | {} ms |

README.md: N = 5 | 1.9e-12 | {} s |
docs/speed.md: `tol=1e-8` | 1.9e-12 | {} s |

README.md: N = 35 | 1.3e-6 | {} s |
docs/speed.md: `tol=1e-3` | 1.3e-6 | {} s |

README.md: 40 elements a rod | 3.7e-5 | {} ms |
docs/speed.md: `n=40` | 3.7e-5 | {} ms |

README.md: 50 elements a rod | 3.1e-5 | {} ms |
docs/speed.md: `n=50` | 3.1e-5 | {} ms |

README.md: 40 elements a rod | 6.7e-3 | {} ms |
docs/speed.md: `n=40` | 6.7e-3 | {} ms |

README.md: N = 5 | 5.5e-6 | 198 ms | 0.09 ms | {} |
docs/speed.md: 5.5e-6 | 198 ms | `tolerance=1e-4` | 5.0e-6 | 0.09 ms | {} |

README.md: N = 35 | 1.3e-6 | 13.3 s | 0.60 ms | {} |
docs/speed.md: 1.3e-6 | 13.3 s | `tolerance=1e-5` | 2.9e-7 | 0.60 ms | {} |

README.md: a leaf of 10,000 veins {} s
docs/speed.md: | 10,000 | {} |

src/motion/explicit/mod.rs: parallel_segments: {},
docs/command-line.md: in leaves of {} segments and more

src/motion/explicit/mod.rs: parallel_segments: {},
docs/speed.md: From {} segments on, rods are shared

src/leaf/system.rs: LEAST_PARALLEL_NODES: usize = {};
docs/command-line.md: in leaves of {} nodes

src/study/trace/mod.rs: MOST_POINTS: usize = {};
docs/command-line.md: number of points of a branch; default {} - `--show

src/study/trace/mod.rs: MOST_BRANCHES: usize = {};
docs/command-line.md: that cross these, at most {} in all

src/study/equilibria.rs: MOST_FRUITLESS_STARTS: usize = {};
docs/command-line.md: ends when {} consecutive starts

docs/command-line.md: equilibria from {} starts
docs/tried.md: [{} starts](command-line.md

README.md: saddle with {} unstable directions
docs/undulation.md: | Fig. 10, N = 5 | {} |

docs/methods.md: with 5 veins is a saddle with {} negative
docs/undulation.md: | Fig. 10, N = 5 | {} |

docs/methods.md: instead of rising to [{}]
docs/undulation.md: folded up: z = {}, 1 wave

docs/methods.md: Fig. 8, 21 veins | stable throughout; {}, 0.302
docs/undulation.md: 1 wave 0.046 high | z = {}, no waves

docs/methods.md: Fig. 9, 21 veins | stable throughout; {}, 0.358
docs/undulation.md: 1 wave 0.044 high | z = {}, no waves

docs/methods.md: stable throughout; {}, 5.778
docs/undulation.md: droops: z = -0.231, 1 wave 0.007 high | z = {}, 1 wave

docs/how-to-read.md: [one of {}](tried.md
docs/tried.md: softest vein | {} | 1:

docs/methods.md: (a plate of nine strips takes {})
docs/tried.md: where the mixed form takes {}.
"#;

/// A text with single spaces, as lines may break anywhere.
fn spaced(file: &str) -> String {
    let text = fs::read_to_string(root().join(file)).unwrap();
    text.split_whitespace().collect::<Vec<_>>().join(" ")
}

/// The number at a place; its words stand once in the file.
fn numeral(place: &str) -> String {
    let (file, words) = place.split_once(": ").unwrap();
    let (before, after) = words.split_once("{}").unwrap();
    let text = spaced(file);
    let rests = text
        .match_indices(before)
        .map(|(at, _)| &text[at + before.len()..]);
    let between = rests.filter_map(|rest| Some(rest.split_once(after)?.0));
    let numbers = between.map(|number| number.replace([',', '_'], ""));
    let numbers: Vec<String> = numbers
        .filter(|number| number.parse::<f64>().is_ok())
        .collect();
    assert_eq!(numbers.len(), 1, "{place} stands {} times", numbers.len());
    numbers[0].clone()
}

/// A unit of the last digit.
fn unit(numeral: &str) -> f64 {
    let decimals = numeral.split_once('.').map_or("", |(_, decimals)| decimals);
    0.1_f64.powi(decimals.len() as i32)
}

fn agree(a: &str, b: &str) -> bool {
    let value = |numeral: &str| numeral.parse::<f64>().unwrap();
    (value(a) - value(b)).abs() <= 0.5 * unit(a).max(unit(b)) * (1.0 + 1e-9)
}

#[test]
fn it_is_the_same() {
    for pair in PLACES.trim().split("\n\n") {
        let (one, other) = pair.split_once('\n').unwrap();
        let (a, b) = (numeral(one), numeral(other));
        assert!(agree(&a, &b), "{a} and {b}:\n{pair}");
    }
}

#[test]
fn to_the_digits_of_the_one_with_fewer() {
    assert!(agree("0.57", "0.5700") && agree("2.3", "2.33") && agree("-0.833", "-0.833"));
    assert!(!agree("0.64", "0.5700") && !agree("2.4", "2.33") && !agree("1000", "3000"));
}
