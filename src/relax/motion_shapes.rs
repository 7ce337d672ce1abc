//! The shapes of small motions of a leaf at rest: complex where damping, wind or flutter let nodes move out of phase.
//!
//! A motion exp(lambda t) x, lambda = gamma + i omega, is told by two real shapes, a when its farthest node is farthest
//! out, and b a quarter of a period later but for the growth:
//!
//! displacement(t) = exp(gamma t) (a cos(omega t) + b sin(omega t)), a = Re x, b = -Im x
//!
//! Without damping and flutter b is zero.

use crate::leaf::DiscreteLeaf;
use crate::modes::linearized::{ComplexIncrement, MotionRoot};
use crate::modes::motion_pairs::NodalMotion;
use crate::relax::accuracy::transfer::Stencil;
use faer::c64;
use glam::DVec3;

/// The shape of a small motion, at the nodes of [`Shape::curves`](crate::relax::Shape::curves), one list per rod. At a
/// time t the displacement is exp(growth t) (`displacement` cos(frequency t) + `later_displacement` sin(frequency t)).
#[derive(Clone, Debug, Default, PartialEq)]
pub struct MotionShape {
    /// Displacement when the node that moves farthest is farthest out: there as long as the longest rod. Of a motion
    /// that rotates the rods without displacing them the largest rotation is 1.
    pub displacement: Vec<Vec<DVec3>>,
    /// Rotation vector then, along the lab axes, radians.
    pub rotation: Vec<Vec<DVec3>>,
    /// Displacement a quarter of a period later, without growth: zero where all nodes move in phase, and of a motion
    /// that does not oscillate.
    pub later_displacement: Vec<Vec<DVec3>>,
    /// Rotation vector then.
    pub later_rotation: Vec<Vec<DVec3>>,
}

/// A motion with smaller displacements than this, in lengths per radian of its rotation, is one of rotation alone.
const PURE_ROTATION_DISPLACEMENT: f64 = 1e-6;

/// Distance of two roots, as a part of them, up to which they are one.
const SAME_ROOT: f64 = 1e-6;

/// The shapes of these roots, as motions on a grid have them, at the nodes of another grid; each motion is taken once
/// if there are as many with a root. None if a root is not among those of the motions.
pub fn shapes_of_roots(
    roots: &[MotionRoot],
    motions: &[NodalMotion],
    on: &DiscreteLeaf,
    nodes_of: &DiscreteLeaf,
) -> Option<Vec<MotionShape>> {
    let mut taken = vec![false; motions.len()];
    let shape = |root: &MotionRoot| {
        let distance = |k: usize| root.distance(motions[k].root);
        let alike = || (0..motions.len()).filter(|k| distance(*k) <= SAME_ROOT * root.size());
        let first = alike().find(|k| !taken[*k]).or(alike().next())?;
        taken[first] = true;
        let shape = at_nodes(&motions[first].shape, on, nodes_of);
        Some(MotionShape::new(&shape, nodes_of.leaf.scale.length))
    };
    roots.iter().map(shape).collect()
}

/// A shape on a grid at the nodes of another one, rod by rod.
fn at_nodes(
    shape: &[ComplexIncrement],
    on: &DiscreteLeaf,
    nodes_of: &DiscreteLeaf,
) -> Vec<Vec<ComplexIncrement>> {
    let places: Vec<Place> = (nodes_of.grid.sigma().iter())
        .map(|sigma| Place::new(on, *sigma))
        .collect();
    let node = |rod: &[ComplexIncrement], place: &Place| -> ComplexIncrement {
        let stencil = match place {
            Place::Node(i) => return rod[*i],
            Place::Between(stencil) => stencil,
        };
        let [re, im] = [|it: c64| it.re, |it: c64| it.im].map(|part| {
            [0, 3].map(|c| {
                stencil.value(|i| DVec3::from_array([0, 1, 2].map(|k| part(rod[i][c + k]))))
            })
        });
        std::array::from_fn(|c| c64::new(re[c / 3][c % 3], im[c / 3][c % 3]))
    };
    let rods = shape.chunks(on.segments() + 1);
    rods.map(|rod| places.iter().map(|place| node(rod, place)).collect())
        .collect()
}

/// A place on the rods of a grid.
enum Place {
    Node(usize),
    Between(Stencil),
}

/// Distance of a place from a node, in lengths, that is rounding.
const SAME_PLACE: f64 = 1e-12;

impl Place {
    fn new(on: &DiscreteLeaf, sigma: f64) -> Self {
        let mut nodes = on.grid.sigma().iter();
        match nodes.position(|node| (node - sigma).abs() < SAME_PLACE) {
            Some(node) => Place::Node(node),
            None => {
                let [value, _] = <Stencil>::value_and_derivative_stencils(on, sigma);
                Place::Between(value)
            }
        }
    }
}

/// A complex vector: that of a node whose path is an ellipse.
#[derive(Clone, Copy)]
struct Ellipse {
    re: DVec3,
    im: DVec3,
}

impl Ellipse {
    fn new(parts: &[c64]) -> Self {
        let vector = |of: fn(&c64) -> f64| DVec3::new(of(&parts[0]), of(&parts[1]), of(&parts[2]));
        Ellipse {
            re: vector(|it| it.re),
            im: vector(|it| it.im),
        }
    }

    /// The product with itself, not conjugated.
    fn square(self) -> c64 {
        let Ellipse { re, im } = self;
        c64::new(re.length_squared() - im.length_squared(), 2.0 * re.dot(im))
    }

    /// Half of the length of the longer axis.
    fn radius(self) -> f64 {
        let all = self.re.length_squared() + self.im.length_squared();
        (0.5 * (all + self.square().norm())).sqrt()
    }

    /// The vector times a complex factor.
    fn times(self, factor: c64) -> Self {
        Ellipse {
            re: self.re * factor.re - self.im * factor.im,
            im: self.re * factor.im + self.im * factor.re,
        }
    }
}

/// The rotation of a node in a small motion.
fn rotation(node: &ComplexIncrement) -> Ellipse {
    Ellipse::new(&node[..3])
}

/// The displacement of a node in a small motion.
fn displacement(node: &ComplexIncrement) -> Ellipse {
    Ellipse::new(&node[3..])
}

impl MotionShape {
    /// The shape of a motion on a leaf of this length, scaled and turned in phase.
    fn new(shape: &[Vec<ComplexIncrement>], length: f64) -> Self {
        let farthest = |part: fn(&ComplexIncrement) -> Ellipse| {
            let all = shape.iter().flatten().map(part);
            // The last of those that are equal up to rounding: a tip.
            all.reduce(
                |most, it| match it.radius() >= (1.0 - 1e-9) * most.radius() {
                    true => it,
                    false => most,
                },
            )
            .unwrap_or(Ellipse::new(&[c64::new(0.0, 0.0); 3]))
        };
        let (moved, turned) = (farthest(displacement), farthest(rotation));
        let rotates = moved.radius() <= PURE_ROTATION_DISPLACEMENT * turned.radius();
        let largest = if rotates { turned } else { moved };
        let phase = c64::from_polar(1.0 / largest.radius(), -0.5 * largest.square().arg());
        let axis = largest.times(phase).re;
        // The largest component is positive.
        let most = axis.abs().max_element();
        let leading = axis
            .to_array()
            .into_iter()
            .rev()
            .find(|it| it.abs() > 0.99 * most);
        let factor = phase * leading.map_or(1.0, f64::signum);
        let rods = |part: fn(&ComplexIncrement) -> Ellipse, of: fn(Ellipse) -> DVec3, unit: f64| {
            let rod = |rod: &Vec<ComplexIncrement>| {
                let node = |node| of(part(node).times(factor)) * unit;
                rod.iter().map(node).collect()
            };
            shape.iter().map(rod).collect()
        };
        MotionShape {
            displacement: rods(displacement, |it| it.re, length),
            rotation: rods(rotation, |it| it.re, 1.0),
            later_displacement: rods(displacement, |it| -it.im, length),
            later_rotation: rods(rotation, |it| -it.im, 1.0),
        }
    }
}
