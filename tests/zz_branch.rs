use leafdyn::branch::*;
use leafdyn::leaf::{Grid, Leaf, DiscreteLeaf};
use leafdyn::relax::start;
use leafdyn::scenario::Scenario;
fn column(other: f64, h: f64, load: f64, gravity: f64) -> Result<Scenario, String> {
    let text = r#"
        name = "column"
        leaf = { rods = 1, length = 1.0, fan = [0.0] }
        stiffness = { torsion = 1.0, bending_2 = 1.0, bending_3 = 1.0, axial = 1.0, shear_2 = 1.0, shear_3 = 1.0 }
    "#;
    let o: Vec<String> = vec![format!("stiffness.bending_2={other:?}"), format!("stiffness.axial={h:?}"), format!("stiffness.shear_2={h:?}"), format!("stiffness.shear_3={h:?}"),
        format!("load.tip_force=[{:?},0.0,0.0]", -load), format!("load.gravity=[{:?},0.0,0.0]", -gravity)];
    Scenario::from_toml_with(text, "column", &o).map_err(|e| e.to_string())
}
fn run(make: &(dyn Fn(f64) -> Result<Scenario, String> + Sync), to: f64, exact: &[f64]) {
    let family = Family::new(make, (0.1, to), false).unwrap();
    let sc = family.scenario(0.0).unwrap();
    let leaf = Leaf::new(&sc);
    let grid = Grid::new(16, leaf.kinks());
    let state = start(&DiscreteLeaf::new(&leaf, grid.clone()));
    let mut eq = Equations::new(&family, grid.clone()).unwrap();
    let (mut first, it) = eq.correct(&state, 0.0, None).unwrap();
    first.tangent = first.tangent.towards(true);
    println!("first {it} index {}", first.index);
    let clock = std::time::Instant::now();
    let branch = walk(&mut eq, first, &Walk { longest: 0.05, most: 300 }, &mut |_| {});
    println!("{} points, end {:?}, {} factorizations, {:?}, missed {:?}", branch.points.len(), branch.end, eq.factorizations, clock.elapsed(), branch.missed);
    for (k, (_, c)) in branch.critical.iter().enumerate() {
        let r = match refine_critical(&family, &grid, c) { Ok(r) => r, Err(e) => { println!("{e}"); continue } };
        let v = family.value(r.fraction);
        println!("{:?} {:?} {:.12} -> {v:.12} (error {:?}, off {:.1e})", c.kind, c.indices, family.value(c.fraction), r.fraction_error, v - exact.get(k).copied().unwrap_or(f64::NAN));
    }
    if let Some((_, c)) = branch.critical.first() {
        for p in switch(&mut eq, c, 0) {
            let b = walk(&mut eq, p.clone(), &Walk { longest: 0.05, most: 300 }, &mut |_| {});
            let l = b.points.last().unwrap();
            println!("switched from {}: {} points, end {:?} at {} tip {:?} index {} .. {}, {} critical", family.value(p.fraction), b.points.len(), b.end, family.value(l.fraction), l.state.tip(0), p.index, l.index, b.critical.len());
        }
    }
}
#[test]
fn branch() {
    let e = |k: f64| (2.0 * k - 1.0f64).powi(2) * std::f64::consts::PI.powi(2) / 4.0;
    println!("strip");
    run(&|l| column(1000.0, 1000.0, l, 0.0), 70.0, &[e(1.), e(2.), e(3.)]);
    println!("round");
    run(&|l| column(1.0, 1000.0, l, 0.0), 30.0, &[e(1.), e(2.)]);
    println!("rigid");
    run(&|l| column(1000.0, f64::INFINITY, l, 0.0), 30.0, &[e(1.), e(2.)]);
    println!("stiff");
    run(&|l| column(1000.0, 1e6, l, 0.0), 30.0, &[e(1.), e(2.)]);
    println!("greenhill");
    run(&|l| column(1000.0, f64::INFINITY, 0.0, l), 10.0, &[7.837347438943484]);
}
