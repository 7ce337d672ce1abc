use leafdyn::relax::*;
fn main() {
    let a: Vec<String> = std::env::args().collect();
    let s = leafdyn::scenario::Scenario::read(std::path::Path::new(&a[1]), &a[2..]).unwrap();
    let seg = std::env::var("SEG").ok().map(|s| s.parse().unwrap());
    let o = Options { segments: seg, keep_unstable: std::env::var("KEEP").is_ok(), ..Default::default() };
    for _ in 0..1 {
    let e = relax(&s, &o, &mut |_| {}).unwrap();
    println!("{} {:?} {:?} res {:.1e} est {:?} E {:.12} idx {:?} saddle {:?} {:?} {:.3}ms {:?}", e.scenario, e.outcome, e.segments, e.residual, e.error_estimate, e.energy, e.negative_eigenvalues, e.saddle, e.work, e.wall_seconds*1e3, e.remark);
    println!("  tip {:?} Fsum {:?}", e.tips[0], e.tip_force_sum);
    }
}
