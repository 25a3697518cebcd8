//! System tests: a real server process and real client processes over
//! loopback, and the rules that the compiler cannot see.

mod collect;
mod collect_many;
mod episode;
mod gate;
mod recorder;
mod settle;
mod tasks;
mod tidy;
