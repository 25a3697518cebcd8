//! The program `wheelarm-learn`.

fn main() {}
