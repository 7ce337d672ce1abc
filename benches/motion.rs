//! What both methods of motion cost for leaves as people measure them.
#[path = "../tests/common/real.rs"]
#[allow(dead_code)]
mod real;

use leafdyn::scenario::Scenario;
use leafdyn::simulate::{Options, Scheme, Simulation};

fn cpu() -> f64 {
    let text = std::fs::read_to_string("/proc/thread-self/schedstat").unwrap();
    text.split(' ').next().unwrap().parse::<f64>().unwrap() * 1e-9
}

fn scenario(seed: u64, kind: usize) -> Scenario {
    let text = real::leaf(seed);
    let text = match kind {
        0 => text,
        1 => text.replace("young =", "mass_density = 1e-5\nyoung ="),
        2 => text.replace("young =", "mass_density = 1e-5\nyoung =")
            + "\n[dynamics]\ninternal_damping = 1e-3\nexternal_damping = 0.0\n",
        3 => text.replace("young =", "mass_density = 1e-5\nyoung =")
            + "\n[dynamics]\nexternal_damping = 0.0\n",
        _ => text.replace("young =", "mass_density = 1e-5\nyoung =") + "\n[dynamics]\nstart = \"at-rest\"\n",
    };
    Scenario::from_toml(&text).unwrap()
}

fn main() {
    let arguments: Vec<usize> = std::env::args()
        .skip(1)
        .filter_map(|a| a.parse().ok())
        .collect();
    let [first, count, kind] = arguments[..] else { panic!() };
    rayon::ThreadPoolBuilder::new().num_threads(1).build_global().unwrap();
    println!("seed kind N LD segs e_steps e_ns e_total s_steps s_total s_reached e0 e_outcome");
    for seed in first..first + count {
        let leaf = scenario(seed as u64, kind);
        let longest = leaf.rods[0].length;
        let h = leaf.rods[0].force_stiffness[0].at(0.5) * longest * longest / leaf.rods[0].couple_stiffness[1].at(0.5);
        let of = |scheme| Simulation::new(&leaf, &Options { scheme: Some(scheme), ..Options::default() });
        let (mut e_steps, mut e_ns, mut e_out) = (0.0, 0.0, String::from("ok"));
        match of(Scheme::Explicit) {
            Err(why) => e_out = why.to_string(),
            Ok(mut e) => {
                let (steps, _) = e.expected().unwrap();
                let begin = cpu();
                while !e.done() && cpu() - begin < 0.2 {
                    if let Err(why) = e.next_frame() { e_out = why.to_string(); break; }
                }
                let nodes = (e.leaf().rods() * e.segments() * e.steps()) as f64;
                e_ns = 1e9 * (cpu() - begin) / nodes;
                e_steps = steps;
            }
        }
        match of(Scheme::SemiImplicit) {
            Err(why) => println!("{seed} {kind} {} {h:.0} {:.3e} {:.1} {why} | {e_out}", leaf.rods.len(), e_steps, e_ns),
            Ok(mut s) => {
                let mut out = String::from("ok");
                let begin = cpu();
                let e0 = s.frame().energy;
                while !s.done() {
                    if let Err(why) = s.next_frame() { out = why.to_string(); break; }
                }
                let seconds = cpu() - begin;
                let nodes = (s.leaf().rods() * s.segments()) as f64;
                let mut one = leaf.clone();
                one.dynamics.output_interval = one.dynamics.duration;
                let mut pilots = String::new();
                for (segments, tolerance) in [(4, 1e-3), (4, 1e-4), (4, 1e-5), (8, 1e-3), (8, 1e-4), (16, 1e-3), (16, 1e-4)] {
                    let pilot = Simulation::new(&one, &Options { scheme: Some(Scheme::SemiImplicit), segments: Some(segments), tolerance: Some(tolerance), ..Options::default() });
                    match pilot {
                        Err(_) => pilots += " R",
                        Ok(mut pilot) => {
                            let begin = cpu();
                            let ended = pilot.next_frame();
                            pilots += &format!(" {}{}({:.3})", pilot.steps(), if ended.is_err() { "X" } else { "" }, (cpu() - begin) / seconds);
                        }
                    }
                }
                println!("{seed} {kind} {} {:.0} {} {:.3e} {:.1} {:.4} {} {:.4} {:.4} {:.3} | {out} | {e_out} |{pilots}", leaf.rods.len(), h.sqrt() / 4.0, s.segments(), e_steps, e_ns, e_steps * nodes * e_ns * 1e-9, s.steps(), seconds, s.time() / leaf.dynamics.duration, e0.elastic / (leaf.rods[0].couple_stiffness[1].at(0.5) / longest));
            }
        }
    }
}
