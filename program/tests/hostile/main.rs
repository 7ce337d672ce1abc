//! What is wrong, too large, damaged or interrupted ends with a message.

mod dynamics;
mod interrupts;
mod mutations;
mod random_requests;
mod requests;
mod scenarios;
mod sizes;
