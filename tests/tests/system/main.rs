//! System tests: a real server process and real client processes over
//! loopback, and the rules that the compiler cannot see.

mod dataset;
mod episode;
mod gate;
mod preview;
mod recorder;
mod settle;
mod tasks;
mod teleop;
mod tidy;
mod watch;
