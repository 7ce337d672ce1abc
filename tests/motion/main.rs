//! Motion in time: orders, energies, momenta, stiff leaves.

mod damping;
mod driven;
mod energy;
mod error_bars;
mod followers;
mod grips;
mod half_turn;
mod hinges;
mod moments;
mod momentum;
mod order;
mod pulses;
mod released_rigid;
mod released_stiff;
mod stability;
mod stiff;
mod wind;
