//! Supports that move in time: bases, grips and tips. Their nodes are where they are held at each time, by both methods;
//! those that a grip lets slide along some axes, along the others. The springs of grips that give move with these.
//!
//! Their holders put energy in: the force of the leaf on a holder, which a node with its mass needs besides, does the work
//!
//! ```text
//! W = change of the kinetic energy of the node - integral of (F . dx + M . dphi),
//! ```
//!
//! with the force F and the moment M of segments and loads on the node; of a spring F is its own force on the grip.
//! External damping of what is held of these nodes is left to the holders, and is neither in this work nor in the
//! dissipated energy.

use crate::leaf::{DiscreteLeaf, State};
use crate::motion::physics::{Inertia, Physics};
use crate::motion::{NodeMotionComponents, Velocity};
use crate::rod::Wrench;
use crate::rotation::{self, Pose};
use crate::scenario::SupportMotion;
use glam::{BVec3, DQuat, DVec3};

/// What holds a node.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Support {
    Base,
    Tip,
    /// Number of the grip.
    Grip(usize),
}

/// A node whose support moves.
#[derive(Clone, Copy, Debug)]
pub struct MovingNode {
    pub rod: usize,
    pub node: usize,
    /// Number of the node among all.
    pub index: usize,
    support: Support,
    /// Whether the rotation is held, too.
    pub holds_rotation: bool,
    /// The lab axes along which the node is where its support is.
    pub held_axes: BVec3,
    /// The lab axes along which the support acts on the node: those, and the axes of its springs.
    driven_axes: BVec3,
    /// Where the support is at time 0.
    start: Pose,
    /// Where the support was when [`MovingSupports::accept`] was called last, and is now.
    before: Pose,
    pub now: Pose,
    /// The velocity of what is held of the node.
    pub velocity: Velocity,
    /// The mean velocity of what is held of the node in the last step.
    pub step_velocity: DVec3,
    /// What the leaf exerts on the support, by the explicit method without segments and springs.
    pub load: Wrench,
    /// What the springs of the support exert on it.
    pub spring_force: DVec3,
    /// Number of the node among those that are watched where it is.
    pub watched: usize,
    /// The displacement and the rotation of the support in the last step.
    pub last_step: NodeMotionComponents,
}

impl MovingNode {
    /// The displacement and the rotation of the support since [`MovingSupports::accept`].
    pub fn step(&self) -> NodeMotionComponents {
        NodeMotionComponents {
            rotation: rotation::log(self.now.rotation * self.before.rotation.conjugate()),
            displacement: DVec3::select(
                self.driven_axes,
                self.now.position - self.before.position,
                DVec3::ZERO,
            ),
        }
    }

    /// Whether the node slides along some axis.
    pub fn slides(&self) -> bool {
        !self.held_axes.all()
    }

    /// A position of the node with what is held of it where its support is.
    pub fn held_position(&self, x: DVec3) -> DVec3 {
        DVec3::select(self.held_axes, self.now.position, x)
    }

    /// What the springs of the support exert on it with the node at `x`.
    pub fn force_of_springs(&self, leaf: &DiscreteLeaf, x: DVec3) -> DVec3 {
        match self.support {
            Support::Grip(grip) => leaf.grip_spring_force(self.index, grip, x),
            Support::Base | Support::Tip => DVec3::ZERO,
        }
    }

    /// The force on the support: along held axes this force on the node, along others that of the springs.
    pub fn force_on_support(&self, on_node: DVec3) -> DVec3 {
        DVec3::select(self.held_axes, on_node, self.spring_force)
    }

    /// The mean velocity of what is held of the node in the time `drift` since [`MovingSupports::accept`], or the
    /// present one.
    pub fn mean_step_velocity(&self, drift: f64) -> DVec3 {
        let velocity = match drift > 0.0 {
            true => self.step().displacement / drift,
            false => self.velocity.linear,
        };
        DVec3::select(self.held_axes, velocity, DVec3::ZERO)
    }
}

/// What supports that move hold of a node.
#[derive(Clone, Copy, Debug)]
struct HeldMotion {
    rotation: bool,
    axes: BVec3,
}

/// The supports of a leaf that move. Dimensionless.
#[derive(Clone, Debug)]
pub struct MovingSupports {
    motion: SupportMotion,
    length: f64,
    time_unit: f64,
    /// Mean of the bases at time 0.
    center: DVec3,
    pub nodes: Vec<MovingNode>,
    /// What of all nodes of the leaf moves with a support.
    held: Vec<HeldMotion>,
    /// Kinetic energy of the nodes when it was last accounted for.
    pub kinetic_energy: f64,
    /// Times at which velocities of supports jump, the next one last.
    pub jumps: Vec<f64>,
}

impl MovingSupports {
    /// The supports at time 0; `None` if none moves.
    pub fn new(leaf: &DiscreteLeaf, physics: &Physics) -> Option<Self> {
        let motion = physics.support_motion.as_deref()?;
        let (rods, n) = (leaf.rods(), leaf.segments());
        let place = |rod: usize, node: usize, support, start, holds_rotation| MovingNode {
            rod,
            node,
            index: rod * (n + 1) + node,
            support,
            holds_rotation,
            held_axes: BVec3::TRUE,
            driven_axes: BVec3::TRUE,
            start,
            before: start,
            now: start,
            velocity: Velocity::default(),
            step_velocity: DVec3::ZERO,
            load: Wrench::default(),
            spring_force: DVec3::ZERO,
            watched: 0,
            last_step: NodeMotionComponents::default(),
        };
        let mut nodes = Vec::new();
        let poses: Vec<Pose> = (0..rods).map(|j| leaf.leaf.base_pose(j)).collect();
        if motion.base.is_some() {
            let bases = poses.iter().enumerate();
            nodes.extend(bases.map(|(j, pose)| {
                let clamped = !leaf.leaf.base_turns(j);
                place(j, 0, Support::Base, *pose, clamped)
            }));
        }
        for j in 0..rods {
            let moving = leaf.rod_grips(j).filter(|it| {
                let moves = motion.grips.get(it.grip);
                moves.is_some_and(|moves| !moves.is_constant())
            });
            nodes.extend(moving.map(|it| {
                let start = Pose {
                    position: it.position,
                    rotation: it.rotation.unwrap_or(DQuat::IDENTITY),
                };
                let grip = &leaf.leaf.scenario().grips[it.grip];
                let acts = BVec3::from_array(grip.stiffness.map(|stiffness| stiffness > 0.0));
                MovingNode {
                    held_axes: it.held_axes,
                    driven_axes: acts,
                    ..place(
                        j,
                        it.node,
                        Support::Grip(it.grip),
                        start,
                        it.rotation.is_some(),
                    )
                }
            }));
            if let (Some(_), Some(held)) = (&motion.tip, &leaf.leaf.tip_support) {
                let rotation = held.rotation(j);
                let start = Pose {
                    position: held.position,
                    rotation: rotation.unwrap_or(DQuat::IDENTITY),
                };
                nodes.push(place(j, n, Support::Tip, start, rotation.is_some()));
            }
        }
        let free = HeldMotion {
            rotation: false,
            axes: BVec3::FALSE,
        };
        let mut held = vec![free; rods * (n + 1)];
        for it in &nodes {
            held[it.index] = HeldMotion {
                rotation: it.holds_rotation,
                axes: it.held_axes,
            };
        }
        let time_unit = physics.time_unit;
        let kinks = motion.schedules().filter(|it| it.has_kinks());
        let mut jumps: Vec<f64> = { kinks }
            .flat_map(|it| it.knot_times(f64::INFINITY))
            .map(|time| time / time_unit)
            .chain([0.0])
            .filter(|time| *time >= 0.0)
            .collect();
        jumps.sort_by(|a, b| b.total_cmp(a));
        Some(MovingSupports {
            motion: motion.clone(),
            length: leaf.leaf.scale.length,
            time_unit,
            center: poses.iter().map(|pose| pose.position).sum::<DVec3>() / rods as f64,
            nodes,
            held,
            kinetic_energy: 0.0,
            jumps,
        })
    }

    /// Moves the supports to where they are at a time, and turns the springs of elastic bases.
    pub fn move_to(&mut self, time: f64, leaf: &mut DiscreteLeaf) {
        let at = time * self.time_unit;
        let (length, rate) = (self.length, self.time_unit / self.length);
        let vector = |of: [f64; 3], unit: f64| DVec3::from_array(of) * unit;
        let (mut turn, mut spin) = (DQuat::IDENTITY, DVec3::ZERO);
        let (mut moved, mut speed) = (DVec3::ZERO, DVec3::ZERO);
        if let Some(base) = &self.motion.base {
            turn = base.turn.rotation(at);
            spin = base.turn.angular_velocity(at) * self.time_unit;
            moved = vector(base.displacement.at(at), 1.0 / length);
            speed = vector(base.displacement.rate(at), rate);
            leaf.turn_base_springs(turn);
        }
        for it in &mut self.nodes {
            match it.support {
                Support::Base => {
                    let arm = turn * (it.start.position - self.center);
                    it.now = Pose {
                        position: self.center + moved + arm,
                        rotation: (turn * it.start.rotation).normalize(),
                    };
                    it.velocity = Velocity {
                        angular: spin,
                        linear: speed + spin.cross(arm),
                    };
                }
                Support::Grip(grip) => {
                    let moves = &self.motion.grips[grip];
                    let [start, now] = [moves.at(0.0), moves.at(at)];
                    it.now.position =
                        it.start.position + vector(now, 1.0 / length) - vector(start, 1.0 / length);
                    let velocity = vector(moves.rate(at), rate);
                    it.velocity.linear = DVec3::select(it.held_axes, velocity, DVec3::ZERO);
                    leaf.move_grip_springs(it.index, grip, it.now.position);
                }
                Support::Tip => {
                    if let Some(position) = &self.motion.tip {
                        it.now.position = vector(position.at(at), 1.0 / length);
                        it.velocity.linear = vector(position.rate(at), rate);
                    }
                }
            }
        }
    }

    /// Puts what is held of the nodes where their supports are.
    pub fn place(&self, state: &mut State) {
        for it in &self.nodes {
            state.x[it.index] = it.held_position(state.x[it.index]);
            if it.holds_rotation {
                state.q[it.index] = it.now.rotation;
            }
        }
    }

    /// Ends a step: steps are counted from here on.
    pub fn accept(&mut self) {
        for it in &mut self.nodes {
            it.last_step = it.step();
            it.before = it.now;
        }
    }

    /// The kinetic energy of the held motion of the nodes, with these inertias.
    pub fn kinetic_energy(&self, inertia: impl Fn(&MovingNode) -> Inertia) -> f64 {
        let energy = |it: &MovingNode| {
            let (of_node, v) = (inertia(it), it.velocity);
            let spin = if it.holds_rotation {
                v.angular
            } else {
                DVec3::ZERO
            };
            of_node.kinetic_energy(it.now.rotation, [spin, v.linear])
        };
        self.nodes.iter().map(energy).sum()
    }

    /// Adds the kinetic energy of a mass that has landed on a node to what is accounted for, if the support of the node
    /// moves.
    pub fn add_mass(&mut self, index: usize, mass: f64) {
        for it in self.nodes.iter().filter(|it| it.index == index) {
            self.kinetic_energy += 0.5 * mass * it.velocity.linear.length_squared();
        }
    }

    /// Whether the rotation of a node is that of a support that moves.
    pub fn holds_rotation(of: &Option<Self>, index: usize) -> bool {
        of.as_ref().is_some_and(|it| it.held[index].rotation)
    }

    /// The part of a vector on a node that is not along axes in which a support that moves holds it.
    pub fn free_part(of: &Option<Self>, index: usize, vector: DVec3) -> DVec3 {
        match of {
            Some(it) => DVec3::select(it.held[index].axes, DVec3::ZERO, vector),
            None => vector,
        }
    }
}
