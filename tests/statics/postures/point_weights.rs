//! Masses on points weigh a leaf whose mass per length is left out: as forces of the same size do.

use super::*;
use leafdyn::posture::points::PosturePoints;
use leafdyn::study::{UnbendRequest, unbend};
use leafdyn_testing::{ROD, parse};

fn points() -> PosturePoints {
    let twin = Twin::draw(&mut Draw(71), false, 1.0);
    let positions = (0..20).map(|k| twin.position(f64::from(k) / 19.0));
    PosturePoints::in_plane(positions.collect(), DVec3::Y)
}

#[test]
fn masses_on_points_are_as_forces() {
    let masses = format!(
        "{ROD}load = {{ g = [0.0, 0.0, -4.0], point = [{{ vein = 1, at = 0.5, mass = 0.25 }}, {{ vein = 1, at = 1.0, mass = 0.125 }}] }}"
    );
    let forces = format!(
        "{ROD}load = {{ point = [{{ vein = 1, at = 0.5, force = [0.0, 0.0, -1.0] }}, {{ vein = 1, at = 1.0, force = [0.0, 0.0, -0.5] }}] }}"
    );
    let [masses, forces] = [masses, forces].map(|text| parse(&text));
    assert_eq!(masses.weight(0).of_mass, None);
    let [weighed, pulled] = [&masses, &forces].map(|scenario| {
        let request = UnbendRequest {
            slow_loading: false,
            ..UnbendRequest::new(scenario.clone(), points())
        };
        unbend(&request).unwrap()
    });
    assert!(pulled.critical_young.value > 0.0);
    assert_eq!(weighed.critical_young, pulled.critical_young);
    let confirmed = weighed.rest_check.unwrap();
    assert!(confirmed.distance.unwrap() < 1e-3 && confirmed.index == Some(0));
    // Relaxed they are one leaf, and what is written is read as it was.
    let [one, other] = [&masses, &forces].map(|leaf| leaf.relax().unwrap().tips[0]);
    assert!(one.distance(other) < 1e-9, "{one} {other}");
    assert_eq!(parse(&masses.to_toml()), masses);
    let rest = weighed.rest.unwrap();
    let read = parse(&rest.to_toml());
    let stiffness = |scenario: &Scenario| scenario.rods[0].couple_stiffness.clone();
    assert_eq!(stiffness(&read), stiffness(&rest));
    // Places that are one within rounding are read as one.
    for (one, other) in read.points.iter().zip(&rest.points) {
        assert!((one.at - other.at).abs() < 1e-12 && one.mass == other.mass);
    }
    assert!(read.weighs_points_only && rest.weighs_points_only);
    // A density of the same leaf has a weight as well.
    let density = ["dynamics.density=1.0".to_string()];
    let heavy = Scenario::from_toml_with(&masses.to_toml(), "heavy", &density).unwrap();
    assert!(heavy.weight(0).of_mass.is_some());
}
