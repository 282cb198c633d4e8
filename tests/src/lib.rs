//! The command as a user runs it: helpers shared by the tests of this crate.
