//! Small leaves in which the keys of the format matter.

use leafdyn_testing::workplace::stiffness;

/// A leaf and what is asked of it.
pub struct TestLeaf {
    pub name: &'static str,
    text: &'static str,
    /// A number that `trace` follows and its range, which begins at the value of the leaf, and
    /// another one for the row of that number's own key.
    pub vary: [&'static str; 2],
    /// A number that is fitted, and another one likewise.
    pub free: [&'static str; 2],
    /// Entries and both numbers of a boundary through which the leaf snaps, and what replaces the
    /// second number in the rows of its own key.
    pub boundary: Option<[&'static str; 3]>,
}

const PULLS: [&str; 2] = [
    "load.tip_force[2]=-0.3..-0.33",
    "load.gravity[2]=-0.6..-0.62",
];
const WEIGHS: [&str; 2] = [
    "load.gravity[2]=-0.6..-0.62",
    "stiffness.bending_2=0.8..0.82",
];
const BENDS: [&str; 2] = ["stiffness.bending_2", "stiffness.bending_3"];

pub const LEAVES: &[TestLeaf] = &[
    TestLeaf {
        name: "veins",
        text: "
leaf = { rods = 2, length = 1.0, fan = \"symmetric\" }
rest = { twist = 0.3, bend_2 = 0.4, bend_3 = 0.2, stretch = 1.05 }
coupling = { x = 1.0, y = 2.0, z = 1.5 }
tissue = { along = 2.0, across = 3.0, normal = 2.0, fold = 0.3, contraction = 0.1 }
[load]
gravity = [0.1, 0.2, -0.6]
g = [0.1, 0.1, -0.3]
tip_force = [0.1, 0.2, -0.3]
[[load.point]]
vein = 1
at = 0.5
force = [0.2, 0.2, 0.3]
mass = 0.3
",
        vary: PULLS,
        free: BENDS,
        boundary: None,
    },
    TestLeaf {
        name: "twisted",
        text: "
leaf = { rods = 1, length = 1.0, fan = [0.2] }
[load]
gravity = [0.1, 0.2, -0.6]
tip_moment = [0.2, 0.1, 0.3]
[[load.point]]
vein = 1
at = 0.5
moment = [0.1, 0.2, 0.2]
",
        vary: WEIGHS,
        free: BENDS,
        boundary: None,
    },
    TestLeaf {
        name: "rooted",
        text: "
leaf = { rods = 2, length = 1.0, fan = \"symmetric\", base_held = \"elastic\", base_turn_stiffness = 2.0 }
coupling = { x = 1.0, y = 2.0, z = 1.5 }
[load]
gravity = [0.1, 0.2, -0.6]
tip_force = [0.1, 0.2, -0.3]
",
        vary: PULLS,
        free: BENDS,
        boundary: None,
    },
    TestLeaf {
        name: "mixed",
        text: "
leaf = { rods = 3, length = 1.0, fan = \"symmetric\", base_held = [\"elastic\", \"clamped\", \"pinned\"], base_turn_stiffness = [2.0, 0.0, 2.0] }
coupling = { x = 1.0, y = 2.0, z = 1.5 }
[load]
gravity = [0.1, 0.2, -0.6]
tip_force = [0.1, 0.2, -0.3]
",
        vary: PULLS,
        free: BENDS,
        boundary: None,
    },
    TestLeaf {
        name: "pulled",
        text: "
leaf = { rods = 1, length = 1.0, fan = [0.2] }
load = { tip_force = [2.0, 0.5, -0.3], gravity = [0.0, 0.0, -0.6] }
",
        vary: PULLS,
        free: BENDS,
        boundary: None,
    },
    TestLeaf {
        name: "pinned",
        text: "
leaf = { rods = 1, length = 1.0, fan = [0.2] }
load = { gravity = [0.0, 0.3, -0.6] }
tip = { held = \"pinned\", position = [0.9, 0.1, -0.1] }
",
        vary: WEIGHS,
        free: BENDS,
        boundary: None,
    },
    TestLeaf {
        name: "jaws",
        text: "
leaf = { rods = 1, length = 1.0, fan = [0.2] }
load = { gravity = [0.0, 0.3, -0.6] }
tip = { held = \"clamped\", position = [0.9, 0.1, -0.1], angles = 0.2, twist = 0.3 }
",
        vary: WEIGHS,
        free: BENDS,
        boundary: None,
    },
    TestLeaf {
        name: "gripped",
        text: "
leaf = { rods = 2, length = 1.0, fan = \"symmetric\" }
load = { tip_force = [0.1, 0.2, -0.3], gravity = [0.0, 0.3, -0.6] }
[[grip]]
vein = 1
at = [0.4, 0.6]
move = [0.0, 0.03, 0.05]
",
        vary: PULLS,
        free: BENDS,
        boundary: None,
    },
    TestLeaf {
        name: "rollers",
        text: "
leaf = { rods = 2, length = 1.0, fan = \"symmetric\" }
load = { tip_force = [0.1, 0.2, -0.3], gravity = [0.0, 0.3, -0.6] }
[[grip]]
vein = [1, 2]
at = 0.4
stiffness = [0.0, inf, 4.0]
move = [0.0, 0.03, 0.05]
[[grip]]
vein = 1
at = [0.7, 0.8]
held = \"clamped\"
stiffness = [0.0, 3.0, 0.0]
turn_stiffness = 2.0
",
        vary: PULLS,
        free: BENDS,
        boundary: None,
    },
    TestLeaf {
        name: "founded",
        text: "
leaf = { rods = 2, length = 1.0, fan = \"symmetric\" }
load = { tip_force = [0.1, 0.2, -0.3], gravity = [0.0, 0.3, -0.6] }
foundation = { stiffness = [0.0, 1.0, 2.0] }
",
        vary: PULLS,
        free: BENDS,
        boundary: None,
    },
    TestLeaf {
        name: "oval",
        text: "
leaf = { rods = 2, length = 1.0, fan = \"symmetric\" }
section = { shape = \"ellipse\", width = 0.2, thickness = 0.1, young = 1e5, poisson = 0.3, mass_density = 2.0 }
load = { tip_force = [0.1, 0.6, -0.9], g = [0.0, 5.0, -9.0] }
",
        vary: ["load.tip_force[2]=-0.9..-0.95", "load.g[2]=-9.0..-9.2"],
        free: ["section.young", "section.width"],
        boundary: None,
    },
    TestLeaf {
        name: "tube",
        text: "
leaf = { rods = 1, length = 1.0, fan = [0.2] }
section = { shape = \"circle\", diameter = 0.1, inner_diameter = 0.05, young = 1e5, mass_density = 2.0 }
load = { tip_force = [0.1, 0.2, -0.3], g = [0.0, 5.0, -9.0] }
",
        vary: ["load.tip_force[2]=-0.3..-0.33", "load.g[2]=-9.0..-9.2"],
        free: ["section.young", "section.diameter"],
        boundary: None,
    },
    TestLeaf {
        name: "walled",
        text: "
leaf = { rods = 1, length = 1.0, fan = [0.2] }
section = { shape = \"circle\", diameter = 0.1, wall = 0.02, young = 1e5, mass_density = 2.0 }
load = { tip_force = [0.1, 0.2, -0.3], g = [0.0, 5.0, -9.0] }
",
        vary: ["load.tip_force[2]=-0.3..-0.33", "load.g[2]=-9.0..-9.2"],
        free: ["section.young", "section.diameter"],
        boundary: None,
    },
    TestLeaf {
        name: "fibrous",
        text: "
leaf = { rods = 1, length = 1.0, fan = [0.2] }
section = { shape = \"rectangle\", width = 0.2, thickness = 0.1, young = 1e5, shear_modulus = 5e3, mass_density = 2.0 }
rest = { bend_3 = 0.8 }
load = { tip_force = [0.1, 0.6, -3.0], g = [0.0, 5.0, -9.0] }
",
        vary: ["load.tip_force[2]=-3.0..-3.1", "load.g[2]=-9.0..-9.2"],
        free: ["section.shear_modulus", "section.young"],
        boundary: None,
    },
    TestLeaf {
        name: "prism",
        text: "
leaf = { rods = 1, length = 1.0, fan = [0.2] }
section = { shape = \"triangle\", width = 0.12, thickness = 0.1, young = 1e5, mass_density = 2.0 }
load = { tip_force = [0.1, 0.2, -0.3], g = [0.0, 5.0, -9.0] }
",
        vary: ["load.tip_force[2]=-0.3..-0.33", "load.g[2]=-9.0..-9.2"],
        free: ["section.young", "section.width"],
        boundary: None,
    },
    TestLeaf {
        name: "cane",
        text: "
leaf = { rods = 1, length = 1.0, fan = [0.2] }
section = { shape = \"hexagon\", width = 0.09, young = 1e5, mass_density = 2.0 }
load = { tip_force = [0.1, 0.2, -0.3], g = [0.0, 5.0, -9.0] }
",
        vary: ["load.tip_force[2]=-0.3..-0.33", "load.g[2]=-9.0..-9.2"],
        free: ["section.young", "section.width"],
        boundary: None,
    },
    TestLeaf {
        name: "gutter",
        text: "
leaf = { rods = 1, length = 1.0, fan = [0.2] }
section = { shape = \"u\", width = 0.14, thickness = 0.1, wall = 0.02, young = 1e5, mass_density = 2.0 }
load = { tip_force = [0.1, 0.2, -0.3], g = [0.0, 5.0, -9.0] }
",
        vary: ["load.tip_force[2]=-0.3..-0.33", "load.g[2]=-9.0..-9.2"],
        free: ["section.young", "section.width"],
        boundary: None,
    },
    TestLeaf {
        name: "blade",
        text: "
leaf = { rods = 3, elevation = 0.4 }
load = { g = [0.0, 100.0, -981.0], tip_force = [0.0, 1e-4, -1e-4] }
[blade]
length = 25.0
thickness = 0.03
young = 5e4
young_across = 2e4
mass_density = 8e-6
width = { at = [0.0, 0.3, 1.0], value = [1.2, 2.0, 0.0] }
",
        vary: ["load.tip_force[2]=-1e-4..-1.1e-4", "load.g[2]=-981.0..-985.0"],
        free: ["blade.young", "blade.thickness"],
        boundary: None,
    },
    TestLeaf {
        name: "following",
        text: "
leaf = { rods = 2, length = 1.0, fan = \"symmetric\" }
coupling = { x = 1.0, y = 2.0, z = 1.5 }
[load]
gravity = [0.0, 0.0, -0.6]
follower = [0.1, 0.2, 0.2]
couple = [0.1, 0.1, 0.1]
[[load.point]]
vein = 1
at = 0.5
force = [0.1, 0.2, 0.4]
follows = true
",
        vary: WEIGHS,
        free: BENDS,
        boundary: None,
    },
    TestLeaf {
        name: "beside",
        text: "
leaf = { rods = 2, length = 1.0, fan = \"symmetric\" }
coupling = { x = 1.0, y = 2.0, z = 1.5 }
[load]
gravity = [0.0, 0.0, -0.6]
g = [0.1, 0.1, -0.9]
tip_force = [0.1, 0.2, -0.3]
[[load.point]]
vein = 1
at = 0.5
mass = 0.6
offset = [0.1, 0.05]
[[load.point]]
vein = 2
at = 1.0
force = [0.1, 0.3, 0.4]
offset = [0.0, 0.08]
",
        vary: PULLS,
        free: BENDS,
        boundary: None,
    },
    TestLeaf {
        name: "windy",
        text: "
leaf = { rods = 2, length = 1.0, fan = \"symmetric\" }
load = { gravity = [0.0, 0.0, -0.6] }
wind = { velocity = [0.5, 0.8, 1.0], density = 1.2, drag = 2.0, width = 0.2 }
",
        vary: WEIGHS,
        free: BENDS,
        boundary: None,
    },
    TestLeaf {
        name: "gripped-in-wind",
        text: "
leaf = { rods = 1, length = 1.0, fan = [0.2] }
load = { gravity = [0.0, 0.0, -0.6] }
wind = { velocity = [0.5, 0.8, 1.0], density = 1.2, drag = 2.0, width = 0.2 }
grip = [{ vein = 1, at = 0.5, move = [0.0, 0.02, 0.03] }]
",
        vary: WEIGHS,
        free: BENDS,
        boundary: None,
    },
    TestLeaf {
        name: "moving",
        text: "
leaf = { rods = 1, length = 1.0, fan = [0.2] }
rest = { bend_2 = 0.6 }
[load]
tip_force = [0.1, 0.2, -0.3]
gravity = [0.0, 0.3, -0.6]
[[load.point]]
vein = 1
at = 1.0
mass = 0.2
",
        vary: PULLS,
        free: BENDS,
        boundary: None,
    },
    TestLeaf {
        name: "flat",
        text: "
leaf = { rods = 1, length = 1.0, fan = [0.2] }
rest = { bend_2 = 0.6 }
[load]
tip_force = [0.1, 0.4, -0.3]
gravity = [0.0, 0.3, -0.6]
",
        vary: PULLS,
        free: BENDS,
        boundary: None,
    },
    TestLeaf {
        name: "struck",
        text: "
leaf = { rods = 1, length = 1.0, fan = [0.2] }
[load]
tip_force = [0.1, 0.2, -0.3]
gravity = [0.0, 0.3, -0.6]
[[load.point]]
vein = 1
at = 0.5
mass = 0.2
from = 0.05
velocity = [0.0, 1.0, -4.0]
",
        vary: PULLS,
        free: BENDS,
        boundary: None,
    },
    TestLeaf {
        name: "photographed",
        text: "
leaf = { rods = 1, length = 1.0, fan = [0.2] }
load = { gravity = [0.0, 0.3, -0.6] }
photo = { scale = 0.01, x = 20.0, y = 50.0 }
",
        vary: WEIGHS,
        free: BENDS,
        boundary: None,
    },
    TestLeaf {
        name: "ruled",
        text: "
leaf = { rods = 1, length = 1.0, fan = [0.2] }
load = { gravity = [0.0, 0.3, -0.6] }
photo = { ruler_from = [0.0, 0.0], ruler_to = [100.0, 0.0], ruler_length = 1.0, x = 20.0, y = 50.0 }
",
        vary: WEIGHS,
        free: BENDS,
        boundary: None,
    },
];

impl TestLeaf {
    pub fn named(name: &str) -> &'static TestLeaf {
        let found = LEAVES.iter().find(|leaf| leaf.name == name);
        found.unwrap_or_else(|| panic!("no leaf {name}"))
    }

    /// The scenario.
    pub fn scenario(&self) -> String {
        let follows = self.text.contains("section =") || self.text.contains("[blade]");
        let stiffness = match follows {
            true if self.name == "blade" => {
                "[dynamics]\nduration = 0.2\nexternal_damping = 3e-7\n[solve]\ntolerance = 1e-4\n"
                    .into()
            }
            true => "[dynamics]\nduration = 0.1\ninternal_damping = 1e-3\n".into(),
            false => stiffness("90.0", "0.3"),
        };
        // In the table with which the stiffnesses end.
        let inertia = match self.name {
            "flat" => "rotary_inertia = 0.02\n",
            _ => "",
        };
        format!(
            "name = \"{}\"\n{}{stiffness}{inertia}",
            self.name, self.text
        )
    }
}
