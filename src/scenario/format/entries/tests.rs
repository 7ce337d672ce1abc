use crate::scenario::Scenario;
use crate::scenario::format::entries::*;
use leafdyn_testing::pairs;

const TEXT: &str = r#"
    name = "three"
    leaf = { rods = 3, length = 1, fan = "paper" }
    coupling = { y = 1, z = [0.5, 2] }
    load = { gravity = [0, 0.5, -1] }
    dynamics = { gravity = { at = [0, 1], value = [[0, 0, -1], [0, 0, -2]] }, rest = { at = [0], factor = [2] } }

    [stiffness]
    torsion = 1.0
    bending_2 = { at = [0.0, 0.5, 1.0], value = [1, 0.5, 0.25] }
    bending_3 = { at = [0.0, 1.0], value = [[1, 2], [3, 4], [5, 6]] }
    axial = inf
    shear_2 = [inf, 100, 1e3]
    shear_3 = 100
"#;

fn scenario_with_overrides(overrides: &[&str]) -> ScenarioResult<Scenario> {
    let overrides: Vec<String> = overrides.iter().map(|given| given.to_string()).collect();
    Scenario::from_toml_with(TEXT, "three.toml", &overrides)
}

/// Compares overrides of parts, between `;`, with those of whole values.
#[test]
fn parts_and_scales_are_whole_values() {
    let table = "
        stiffness.torsion[1]=2.5 => stiffness.torsion=[1.0, 2.5, 1.0]
        coupling.y[0]=3 => coupling.y=[3, 1]
        coupling.z[1] = 0.25; coupling.z[0]=1 => coupling.z=[1, 0.25]
        load.gravity[2]=-7 => load.gravity=[0, 0.5, -7]
        stiffness.bending_2.value[1]=2.0 => stiffness.bending_2={at=[0,0.5,1],value=[1,2.0,0.25]}
        stiffness.bending_2.at[1]=0.25 => stiffness.bending_2={at=[0,0.25,1],value=[1,0.5,0.25]}
        stiffness.bending_3.value[2][0]=9 => stiffness.bending_3={at=[0,1],value=[[1,2],[3,4],[9,6]]}
        stiffness.bending_3.value[2]=[7, 8] => stiffness.bending_3={at=[0,1],value=[[1,2],[3,4],[7,8]]}
        dynamics.gravity.value[1][2]=-3 => dynamics.gravity={at=[0,1],value=[[0,0,-1],[0,0,-3]]}
        scale:stiffness.bending_2=0.5 => stiffness.bending_2={at=[0,0.5,1],value=[0.5,0.25,0.125]}
        scale:stiffness.bending_3.value[0]=2 => stiffness.bending_3={at=[0,1],value=[[2,4],[3,4],[5,6]]}
        scale:stiffness.shear_2=2 => stiffness.shear_2=[inf, 200, 2e3]
        scale:stiffness.axial=2 => stiffness.axial=inf
        scale:leaf.length=1.5 => leaf.length=1.5
        scale:load.gravity=2 => load.gravity=[0, 1, -2]
        scale:load.gravity[2]=3 => load.gravity=[0, 0.5, -3]
        scale:dynamics.rest=0.5 => dynamics.rest={ at = [0], factor = [1] }
        scale:rest.twist=3 => rest.twist=0.0
    ";
    for (parts, whole) in pairs(table) {
        let parts: Vec<&str> = parts.split("; ").collect();
        assert_eq!(
            scenario_with_overrides(&parts).unwrap(),
            scenario_with_overrides(&[whole]).unwrap(),
            "{parts:?}"
        );
    }
    let fewer = "leaf.rods=2; coupling.z=1; stiffness.bending_3=1; stiffness.shear_2[1]=7";
    let refused = scenario_with_overrides(&fewer.split("; ").collect::<Vec<_>>()).unwrap_err();
    assert!(refused.to_string().contains("has 3 entries"), "{refused}");
}

#[test]
fn slips_are_explained() {
    let table = r#"
        stiffness.torsion[3]=1 => set stiffness.torsion[3]=1: stiffness.torsion[3]: there are 3 entries
        stiffness.bending_2[0]=1 => is no list in the scenario
        stiffness.torsion.value[0]=1 => has no value there
        load.gravity[3]=1 => x, y, z have the indices 0, 1, 2
        load.gravity[z]=1 => an index is a whole number from 0
        load.gravity[1=1 => an index is a whole number from 0
        load.gravity[1]x=1 => an index is a whole number from 0
        coupling.y[1][1]=1 => is no list in the scenario
        load.gravity[1][3]=1 => x, y, z have the indices 0, 1, 2
        load.gravity[3][1]=1 => there are 3 entries
        load.gravity[1][1][1]=1 => an index is a whole number from 0
        leaf.rods[0]=1 => leave the index out
        scale:leaf.rods=2 => no numbers that could be scaled
        scale:leaf.fan=2 => "paper" is no number to be scaled
        scale:stiffness.torsion=x => the factor must be a finite number
        scale:stiffness.torsion=inf => the factor must be a finite number
        scale:dynamics.density=2 => is not in the scenario: write it first
        scale:stiffness.torsion=-1 => stiffness.torsion = -1.0: must be greater than 0
        stiffness.torsion[1]=-1 => set stiffness.torsion[1]=-1: stiffness.torsion, entry 2 = -1: must be greater than 0
        stiffness.bending2[1]=1 => unknown key stiffness.bending2 (did you mean stiffness.bending_2?)
        scale:torsion=1 => did you mean stiffness.torsion?
        section.nu=0.3 => unknown key section.nu (did you mean section.poisson?)
        section.E=1e9 => did you mean section.young?
        section.density=900 => did you mean section.mass_density?
        blade.E=1e9 => did you mean blade.young?
        stiffness.EI=1 => did you mean stiffness.bending_2?
        dynamics.mass=1 => did you mean dynamics.density?
        stiffness.gold=1 => unknown key stiffness.gold: [stiffness] has torsion, bending_2
        monsoon=1 => unknown key monsoon: keys are name and those of units, leaf,
        load.gravity[2] => must be KEY=VALUE
    "#;
    for (given, part) in pairs(table) {
        let message = scenario_with_overrides(&[given]).unwrap_err().to_string();
        assert!(message.contains(part), "{given}: {message}");
        assert!(message.len() < 300, "{message}");
    }
}

/// Numbers of single veins are no places; knots of single veins are.
#[test]
fn numbers_without_knots_name_no_place() {
    let leaf = |bending: &str| {
        let text = format!(
            "name = 'leaf'\nleaf = {{ rods = 2, length = 1.0, fan = 'symmetric' }}\n\
             stiffness = {{ torsion = 1e-6, bending_2 = {bending}, bending_3 = [0.5, 0.5000001] }}"
        );
        let entries = Entries::from_text(&text, "leaf").unwrap();
        CommonPlaces::of_places(entries.written_places())
            .map(|it| [0.0, 0.5, 0.5000002, 1.0].map(|at| it.common_place(at)))
    };
    assert_eq!(leaf("[1e-7, 0.5]"), None);
    let knots = "[0.5, { at = [0.0, 0.5, 0.5000002, 1.0], value = [1.0, 2.0, 3.0, 2.0] }]";
    assert_eq!(leaf(knots), Some([0.0, 0.5, 0.5, 1.0]));
}
