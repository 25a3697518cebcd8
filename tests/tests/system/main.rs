//! System tests: a real server process and real client processes over
//! loopback, and the rules that the compiler cannot see.

mod adversarial;
mod broken;
mod collect;
mod collect_many;
mod control;
mod dataset;
mod disturb;
mod episode;
mod faults_disk;
mod faults_hostile;
mod faults_link;
mod faults_recorder;
mod faults_server;
mod forgery;
mod gate;
mod installed;
mod looks;
mod multiply;
mod mutation;
mod over_ticks;
mod own_client;
mod person;
mod policies;
mod queries;
mod recorded;
mod recorder;
mod robots;
mod rows;
mod sensors;
mod settle;
mod strangers;
mod tasks;
mod teleop;
mod tidy;
mod watch;
