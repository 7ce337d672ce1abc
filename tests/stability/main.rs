//! What is stable: modes, Morse indices, branches and their critical points, boundaries.

mod beside_bifurcations;
mod bifurcations;
mod boundary;
mod boundary_random;
mod branch_ends;
mod eigenvalue_bars;
mod flutter;
mod follower;
mod growing_motions;
mod hinges;
mod lateral_buckling;
mod load_order;
mod map_jumps;
mod margin_of_grips;
mod margin_random;
mod mode_shapes;
mod modes;
mod off_axis;
mod point_masses;
mod rollers;
mod small_motions;
mod taut_rods;
mod trace_consistent;
mod trace_of_grips;
mod trace_verified;
mod vertices;
