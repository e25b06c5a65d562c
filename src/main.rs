//! `triplanar`: arguments and dispatch.

fn main() {}
