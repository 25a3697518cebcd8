//! System tests: a real server process and real client processes over
//! loopback, and the rules that the compiler cannot see.

mod dataset;
mod control;
mod episode;
mod faults_disk;
mod faults_hostile;
mod faults_link;
mod faults_recorder;
mod faults_server;
mod gate;
mod preview;
mod mutation;
mod recorder;
mod settle;
mod tasks;
mod teleop;
mod tidy;
mod watch;
