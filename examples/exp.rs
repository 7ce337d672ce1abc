fn main() {
    let a: Vec<String> = std::env::args().collect();
    let s = leafdyn::scenario::Scenario::read(std::path::Path::new(&a[1]), &a[4..]).unwrap();
    leafdyn::relax::experiment(&s, a[2].parse().unwrap(), a[3].parse().unwrap());
}
