//! Motion in time: orders, energies, momenta, stiff leaves.

mod charts;
mod damping;
mod driven;
mod energy;
mod error_bars;
mod factors;
mod followers;
mod grips;
mod half_turn;
mod hinges;
mod landing;
mod moments;
mod momentum;
mod moved_rollers;
mod off_axis;
mod order;
mod pulses;
mod released_rigid;
mod released_stiff;
mod rest_on_own_grid;
mod rotary_inertia;
mod stability;
mod stiff;
mod supports;
mod wind;
