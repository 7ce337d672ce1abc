//! Leaves with mirror symmetry in the plane y = 0.
//!
//! Such a leaf is determined by half of its rods: rod j and rod N - 1 - j are each other's
//! image. The midrib, if N is odd, lies in the plane: it counts half (stiffness, mass, loads),
//! and its nodes stay in the plane and rotate about its normal only. A joint tip stays in the
//! plane, too. Of the gap across the plane, if N is even, only the coupling along y is ever
//! stretched.

use crate::leaf::Leaf;
use crate::leaf::rod_ode::{FieldChange, RodFields};
use crate::leaf::state::State;
use crate::scenario::{Profile, Rod, Scenario};
use crate::shape::{NodeState, RodShape};
use glam::{DQuat, DVec3};

impl Leaf {
    /// Half of the leaf, if it is its own mirror image and its tip is not held.
    pub fn mirror_half(&self) -> Option<Leaf> {
        let mut half = self.clone();
        let several = self.rods() > 1;
        half.mirrored = several && self.tip_support.is_none() && is_mirrored(self.scenario());
        half.mirrored.then_some(half)
    }
}

/// Whether every rod, coupling and load is its own mirror image or that of another one.
pub fn is_mirrored(scenario: &Scenario) -> bool {
    let Scenario {
        rods,
        coupling,
        tissue,
        tip_force,
        distributed,
        follower,
        couple,
        points,
        grips,
        foundation,
        wind,
        natural,
        dynamics,
        ..
    } = scenario;
    // Images of loads and supports of single veins are not looked for; a leaf on hinges may swing out
    // of its mirror plane.
    let unmatched = [distributed, follower, couple]
        .into_iter()
        .any(Option::is_some)
        || !(points.is_empty() && grips.is_empty())
        || wind.is_some()
        || natural.is_some()
        || !scenario.all_bases_clamped();
    let weights = |(a, b): (usize, usize)| {
        let [own, image] = [a, b].map(|vein| scenario.weight(vein).even);
        own == [image[0], -image[1], image[2]]
    };
    let masses = |(a, b): (usize, usize)| dynamics.density[a] == dynamics.density[b];
    let pairs = |count: usize| (0..count.div_ceil(2)).map(move |j| (j, count - 1 - j));
    !unmatched
        && pairs(rods.len()).all(weights)
        && (scenario.g == [0.0; 3] || scenario.g[1] == 0.0 && pairs(rods.len()).all(masses))
        && tip_force[1] == 0.0
        && pairs(rods.len()).all(|(a, b)| are_images(&rods[a], &rods[b]))
        && pairs(coupling.len()).all(|(a, b)| coupling[a] == coupling[b])
        && (foundation.iter()).all(|of| pairs(rods.len()).all(|(a, b)| of[a] == of[b]))
        && tissue.as_ref().is_none_or(|tissue| {
            // Tissue that the plane cuts would be turned by half of the leaf alone.
            rods.len() % 2 == 1 && pairs(tissue.len()).all(|(a, b)| tissue[a] == tissue[b])
        })
}

/// Whether two rods are each other's image: twist and sideways bend at rest
/// change sign in the mirror.
fn are_images(a: &Rod, b: &Rod) -> bool {
    let mirrored = |[x, y, z]: [f64; 3]| [x, -y, z];
    let opposite = |a: &Profile, b: &Profile| *a == b.scaled(-1.0);
    a.length == b.length
        && a.base == mirrored(b.base)
        && a.angle == -b.angle
        && a.elevation == b.elevation
        && a.roll == -b.roll
        && a.couple_stiffness == b.couple_stiffness
        && a.force_stiffness == b.force_stiffness
        && a.rest_stretch == b.rest_stretch
        && opposite(&a.rest_curvature[0], &b.rest_curvature[0])
        && a.rest_curvature[1] == b.rest_curvature[1]
        && opposite(&a.rest_curvature[2], &b.rest_curvature[2])
}

/// Whether these rods at rest are each other's mirror images, within a distance of their nodes and
/// an angle, in radians, of their sections.
pub fn are_mirror_symmetric(rods: &[RodShape], distance: f64, angle: f64) -> bool {
    let images = |(a, b): (&NodeState, &NodeState)| {
        a.position.distance(reflect_vector(b.position, true)) <= distance
            && a.rotation
                .angle_between(mirrored_rotation(b.rotation, true))
                <= angle
    };
    let pairs = rods.iter().zip(rods.iter().rev());
    pairs
        .flat_map(|(a, b)| a.nodes.iter().zip(&b.nodes))
        .all(images)
}

/// The state of half of a leaf that is in the state `whole`. The midrib and a joint tip are put into the
/// mirror plane: no force of the half leaf would bring them back.
pub fn half_state(half: &Leaf, whole: &State) -> State {
    if !half.mirrored {
        return whole.clone();
    }
    let (rods, n) = (half.rods(), whole.segments());
    let nodes = rods * (n + 1);
    let mut state = State::new(n, whole.x[..nodes].to_vec(), whole.q[..nodes].to_vec());
    for j in 0..rods {
        for k in j * n..(j + 1) * n {
            state.n[k] = half.share(j) * whole.n[k];
        }
        if half.is_halved_midrib(j) {
            for k in state.base(j)..=state.base(j) + n {
                state.x[k].y = 0.0;
                state.q[k] = rotation_about_normal(state.q[k]);
            }
            for force in &mut state.n[j * n..(j + 1) * n] {
                force.y = 0.0;
            }
        }
        if half.joined() {
            let tip = state.base(j) + n;
            state.x[tip].y = 0.0;
        }
    }
    let gaps = half.scenario().rods.len() - 1;
    let kinds = whole.tissue.chunks(gaps * (n + 1));
    let own = kinds.flat_map(|kind| &kind[..(rods - 1) * (n + 1)]);
    state.tissue = own.copied().collect();
    state
}

/// The state of the whole leaf whose half is in the state `state`.
pub fn whole_state(half: &Leaf, state: &State) -> State {
    if !half.mirrored {
        return state.clone();
    }
    let (rods, n) = (half.scenario().rods.len(), state.segments());
    let (mut x, mut q, mut forces) = (Vec::new(), Vec::new(), Vec::new());
    for j in 0..rods {
        let own = j.min(rods - 1 - j);
        let image = own != j;
        let base = state.base(own);
        x.extend(
            state.x[base..=base + n]
                .iter()
                .map(|&x| reflect_vector(x, image)),
        );
        q.extend(
            state.q[base..=base + n]
                .iter()
                .map(|&q| mirrored_rotation(q, image)),
        );
        let own_forces = state.n[own * n..(own + 1) * n].iter();
        forces.extend(own_forces.map(|&f| reflect_vector(f / half.share(own), image)));
    }
    let mut whole = State::new(n, x, q);
    whole.n = forces;
    let (gaps, own_gaps) = (rods - 1, half.rods() - 1);
    for kind in state.tissue.chunks((own_gaps * (n + 1)).max(1)) {
        for g in 0..gaps {
            // The image of a strip goes from the image of its last node to that of its first.
            let own = g.min(gaps - 1 - g);
            let forces = &kind[own * (n + 1)..][..n + 1];
            let image = |force: &DVec3| match own == g {
                true => *force,
                false => -reflect_vector(*force, true),
            };
            whole.tissue.extend(forces.iter().map(image));
        }
    }
    whole
}

/// The rods of the whole leaf whose half has the fields `rods`.
pub fn whole_leaf_fields(half: &Leaf, rods: Vec<Vec<RodFields>>) -> Vec<Vec<RodFields>> {
    whole_rods(half, rods, |node, image, share| RodFields {
        x: reflect_vector(node.x, image),
        q: mirrored_rotation(node.q, image),
        n: reflect_vector(node.n / share, image),
        m: reflect_axial(node.m / share, image),
    })
}

/// Changes of the fields of the rods of the whole leaf, from those of its half.
pub fn whole_leaf_changes(half: &Leaf, rods: Vec<Vec<FieldChange>>) -> Vec<Vec<FieldChange>> {
    whole_rods(half, rods, |node, image, share| FieldChange {
        position: reflect_vector(node.position, image),
        rotation: reflect_axial(node.rotation, image),
        force: reflect_vector(node.force / share, image),
        moment: reflect_axial(node.moment / share, image),
    })
}

/// The rods of the whole leaf from those of its half: every node as `node` makes it from the node
/// of the half, whether it is the image of that, and the share of its rod in the half.
fn whole_rods<T>(half: &Leaf, rods: Vec<Vec<T>>, node: impl Fn(&T, bool, f64) -> T) -> Vec<Vec<T>> {
    if !half.mirrored {
        return rods;
    }
    let count = half.scenario().rods.len();
    let rod = |j: usize| {
        let own = j.min(count - 1 - j);
        let (image, share) = (own != j, half.share(own));
        rods[own].iter().map(|it| node(it, image, share)).collect()
    };
    (0..count).map(rod).collect()
}

/// The image of a rotation: its axis changes sign in the mirror, except the normal component.
fn mirrored_rotation(q: DQuat, image: bool) -> DQuat {
    match image {
        true => DQuat::from_xyzw(-q.x, q.y, -q.z, q.w),
        false => q,
    }
}

/// The part of a rotation about the plane's normal.
fn rotation_about_normal(q: DQuat) -> DQuat {
    DQuat::from_xyzw(0.0, q.y, 0.0, q.w).normalize()
}

fn reflect_vector(v: DVec3, image: bool) -> DVec3 {
    if image { DVec3::new(v.x, -v.y, v.z) } else { v }
}

/// The image of an axial vector, such as a moment.
fn reflect_axial(v: DVec3, image: bool) -> DVec3 {
    if image { -reflect_vector(v, true) } else { v }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scenario::Entries;

    const LEAF: &str = r#"
        name = "leaf"
        leaf = { rods = 5, length = [0.9, 1.0, 1.1, 1.0, 0.9], fan = "symmetric" }
        stiffness = { torsion = 1.0, bending_2 = 1.0, bending_3 = 1.0, axial = 100.0, shear_2 = 100.0, shear_3 = 100.0 }
        rest = { twist = [0.1, 0.2, 0.0, -0.2, -0.1], bend_2 = 0.3 }
        coupling = { y = [1.0, 2.0, 2.0, 1.0] }
        load = { gravity = [0.1, 0.0, -1.0] }
    "#;

    /// Whether this leaf has a half, and lies in a plane.
    fn symmetries(entries: &[&str]) -> (bool, bool) {
        let entries: Vec<_> = entries.iter().map(|&entry| entry.into()).collect();
        let entries = Entries::from_text(LEAF, "leaf").unwrap().replaced(&entries);
        let scenario = entries.unwrap().check().unwrap();
        let leaf = Leaf::new(&scenario);
        (leaf.mirror_half().is_some(), leaf.is_planar())
    }

    #[test]
    fn mirrored_leaves_are_known() {
        for entry in [
            "name='same'",
            "rest.stretch=[1.2, 1.1, 1.0, 1.1, 1.2]",
            "rest.bend_3=[1.0, 0.0, 0.0, 0.0, -1.0]",
            "leaf.base=[[0, -2, 0], [0, -1, 1], [1, 0, 0], [0, 1, 1], [0, 2, 0]]",
            "leaf.elevation=[0.1, 0.2, 0.3, 0.2, 0.1]",
            "load.gravity=[[0, 1, -1], [0, 0, -1], [1, 0, -2], [0, 0, -1], [0, -1, -1]]",
        ] {
            assert_eq!(symmetries(&[entry]), (true, false), "{entry}");
        }
        // An even number of veins has a gap across the plane, whose tissue half a leaf lacks.
        assert_eq!(symmetries(&["tissue.across=[1, 2, 2, 1]"]), (true, false));
        let heavy = ["load.g=[1, 0, -1]", "dynamics.density=[1, 2, 3, 2, 1]"];
        assert_eq!(symmetries(&heavy), (true, false));
        assert_eq!(
            symmetries(&[heavy[0], "dynamics.density=[1, 2, 3, 2, 2]"]),
            (false, false)
        );
        assert_eq!(symmetries(&["load.g=[0, 1, -1]", heavy[1]]), (false, false));
        let others = "leaf.base=[0.0, 1e-9, 0.0]; leaf.elevation=[0.1, 0.2, 0.3, 0.2, 0.2]; \
            load.gravity=[[0, 0, 1], [0, 0, 2], [0, 0, 3], [0, 0, 2], [0, 0, 2]]; \
            leaf.base_held=pinned; tissue.across=[1, 2, 2, 3]; load.distributed=[0, 0, 1]; \
            leaf.fan='paper'; leaf.length=[0.9, 1.0, 1.1, 1.0, 0.8]; rest.twist=0.1; \
            stiffness.axial=[1, 2, 3, 2, 2]; rest.stretch=[1.2, 1.1, 1.0, 1.1, 1.0]; \
            rest.bend_3=[1.0, 0.0, 0.0, 0.0, 1.0]; rest.bend_3=[1.0, 0.0, 0.5, 0.0, -1.0]; \
            coupling.z=[1.0, 2.0, 2.0, 3.0]; load.gravity=[0.0, 1e-9, -1.0]; \
            load.tip_force=[0.0, 1.0, 0.0]";
        for entry in others.split("; ") {
            assert_eq!(symmetries(&[entry]), (false, false), "{entry}");
        }
    }

    #[test]
    fn planar_leaves_are_known() {
        for entry in [
            "load.tip_force=[1.0, -2.0, 0.0]",
            "rest.bend_3=[1.0, 2.0, -3.0, 0.0, 1.0]",
            "rest.stretch=[1.0, 1.1, 1.0, 1.0, 1.2]",
            "load.distributed=[[0, 0, 0], [1, 2, 0], [0, 0, 0], [0, 0, 0], [0, 0, 0]]",
            "leaf.base=[[0, 3, 0], [1, 2, 0], [0, 0, 0], [0, 0, 0], [0, 0, 0]]",
        ] {
            let load = "load.gravity=[1.0, -2.0, 0.0]";
            let flat = symmetries(&["rest.twist=0", "rest.bend_2=0", load, entry]);
            assert_eq!(flat, (false, true), "{entry}");
        }
        for entry in [
            "leaf.elevation=0.1",
            "leaf.base=[0, 0, 1]",
            "load.gravity[1][2]=1",
            "load.distributed=[0, 0, 1]",
            "dynamics.density=1",
        ] {
            let g = if entry.starts_with("dynamics") {
                "load.g=[0, 1, 1]"
            } else {
                "load.g=[0, 0, 0]"
            };
            let load = "load.gravity=[1.0, -2.0, 0.0]";
            let found = symmetries(&["rest.twist=0", "rest.bend_2=0", load, entry, g]);
            assert_eq!(found, (false, false), "{entry}");
        }
    }
}
