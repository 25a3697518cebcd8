//! Networks that learn from recordings: trained, served and measured on the CPU.
//! The only package that names burn.
