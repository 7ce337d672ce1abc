//! What is wrong, too large, damaged or interrupted ends with a message.

mod dynamics;
mod ends;
mod interrupts;
mod mutations;
mod overrides;
mod random_requests;
mod requests;
mod scenarios;
mod sizes;
