//! The newest samples and status, for a person at the controls.
//!
//! Pure: input is samples and their arrival times; it sends no requests.
//! Times are seconds of a clock that the caller chooses.

use std::collections::VecDeque;

use nalgebra::{Isometry3, Point3, UnitQuaternion, Vector3};
use wheelarm_proto::robot::Roles;
use wheelarm_proto::topic::Sample;
use wheelarm_proto::v1;

use super::files::{Files, Verdict};
use super::hand;
use wheelarm_proto::geometry::normalized;

/// Most events that are stored.
const KEPT: usize = 50;

/// State of the connection.
#[derive(Clone, Debug, Default, PartialEq)]
pub enum Connection {
    /// Not connected; the reason.
    #[default]
    Opening,
    /// The server answers.
    Open,
    /// Connected, but no message arrived since this time, s.
    Silent(f64),
    /// Lost at this time, s, with the reason. It reconnects by itself.
    Lost(f64, String),
}

/// An event of the log.
#[derive(Clone, Debug, PartialEq)]
pub struct Happening {
    /// Time, s.
    pub at: f64,
    /// Whether it needs attention.
    pub bad: bool,
    /// Text.
    pub text: String,
}

/// Where to grasp the object of the task, relative to the hand.
#[derive(Clone, Debug, PartialEq)]
pub struct Target {
    /// Its name.
    pub name: String,
    /// Middle of its grasps from the point between the pads: ahead, left and up
    /// along the chair's axes, m.
    pub from_hand: [f64; 3],
    /// The same place in `house`: x, y, z, m.
    pub place: [f64; 3],
}

/// Used fields of the scene query.
#[derive(Clone, Debug, PartialEq)]
struct Scene {
    target: String,
    index: Option<usize>,
    /// Middle of the grasps in the object's frame, m.
    grasp: Point3<f64>,
}

/// Used fields of the robot's description.
#[derive(Clone, Debug, PartialEq)]
struct Robot {
    roles: Roles,
    chair_from_base: Isometry3<f64>,
    tool_length: f64,
}

/// The newest samples and status.
#[derive(Clone, Debug, Default)]
pub struct Situation {
    /// State of the connection.
    pub connection: Connection,
    /// The server's status.
    pub status: Option<v1::Status>,
    /// Round trip of the newest reply, s.
    pub round_trip: Option<f64>,
    /// Stamp of the newest tick.
    pub header: v1::Header,
    /// Simulated seconds per wall second.
    pub factor: f64,
    /// State of the task.
    pub evaluation: Option<v1::Evaluation>,
    /// Forward speed of the chair, m/s, and turn rate, rad/s.
    pub chair_speed: [f64; 2],
    /// `wheelchair_root` in `house`.
    pub house_from_chair: Option<Isometry3<f64>>,
    /// End effector in `base_link`.
    pub base_from_tool: Option<Isometry3<f64>>,
    /// Applied command of the newest control tick.
    pub applied: Option<v1::Applied>,
    /// Normal force at the left and the right pad, N.
    pub pad_force: [f64; 2],
    /// Contacts between the robot and other bodies, strongest first.
    pub contacts: Vec<v1::Contact>,
    /// Phase name of the command in force.
    pub phase: String,
    /// Events, oldest first.
    pub happenings: VecDeque<Happening>,
    /// State of the recordings of episodes.
    pub files: Files,
    /// An episode that did not start, or that was not kept completely, in
    /// words. The next episode clears it.
    pub alarm: Option<String>,
    scene: Option<Scene>,
    robot: Option<Robot>,
    joints: Option<v1::JointState>,
    poses: Option<v1::PoseSet>,
    objects: Vec<Isometry3<f64>>,
}

impl Situation {
    /// Handles a sample; malformed parts are skipped.
    pub fn take(&mut self, sample: Sample, now: f64) {
        if matches!(self.connection, Connection::Silent(_)) {
            self.connection = Connection::Open;
        }
        match sample {
            Sample::Clock(clock) => {
                self.factor = clock.real_time_factor;
                self.tick(clock.header);
            }
            Sample::Pose(set) => {
                self.poses = Some(set);
                self.place();
            }
            Sample::JointState(state) => self.joints = Some(state),
            Sample::Odometry(odometry) => {
                let twist = odometry.twist.unwrap_or_default();
                self.chair_speed = [
                    twist.linear.unwrap_or_default().x,
                    twist.angular.unwrap_or_default().z,
                ];
            }
            Sample::Evaluation(evaluation) => self.evaluation = Some(evaluation),
            Sample::Applied(applied) => self.applied = Some(applied),
            Sample::Contact(contacts) => {
                // Without negative zeros.
                let force = |i: usize| contacts.pad_forces.get(i).map_or(0.0, |f| f + 0.0);
                self.pad_force = [force(0), force(1)];
                self.contacts = contacts.contacts;
            }
            Sample::ObjectPose(objects) => {
                let poses = objects.poses.iter();
                self.objects = poses
                    .filter_map(|pose| normalized("object pose", Some(pose)).ok())
                    .collect();
            }
            Sample::Phase(phase) => self.phase = phase.name,
            Sample::Event(event) => {
                let kind = event.kind();
                let words = format!("{}: {}", kind.word(), event.text);
                self.note(now, kind.is_serious(), words);
            }
            Sample::EpisodeStop(stopped) => {
                let word = if stopped.discard {
                    "discarded"
                } else {
                    "ended"
                };
                let number = stopped.header.as_ref().map_or(0, |h| h.episode);
                self.note(now, false, format!("episode {number} {word}"));
                self.files.ended(&stopped, now);
            }
            _ => {}
        }
    }

    /// Alarms, in words; the newest last.
    #[must_use]
    pub fn alarms(&self) -> Vec<String> {
        let evaluation = self.evaluation.as_ref();
        let lost = evaluation
            .filter(|e| self.episode().is_some() && !e.failure.is_empty())
            .map(|e| {
                format!(
                    "THE TASK IS LOST ({}). Finish, discard or redo this episode",
                    e.failure.replace('_', " ")
                )
            });
        let problem = self.files.problem();
        [self.alarm.clone(), lost, problem]
            .into_iter()
            .flatten()
            .collect()
    }

    /// Handles the server's status, the round trip it took, s, and the time, s.
    /// Returns results of the files of episodes.
    pub fn take_status(&mut self, status: v1::Status, round_trip: f64, now: f64) -> Vec<Verdict> {
        let verdicts = self.files.status(&status, now);
        for verdict in &verdicts {
            self.note(now, verdict.bad, verdict.text.clone());
            if verdict.bad {
                self.alarm = Some(verdict.text.clone());
            }
        }
        self.connection = Connection::Open;
        self.round_trip = Some(round_trip);
        self.factor = status.real_time_factor;
        self.tick(status.header.clone());
        if self.evaluation.is_none() {
            self.evaluation.clone_from(&status.evaluation);
        }
        self.status = Some(status);
        verdicts
    }

    /// An episode of this client did not start, or did not end.
    pub fn refused(&mut self, why: &str, now: f64) {
        self.note(now, true, why.to_owned());
        self.alarm = Some(why.to_owned());
    }

    /// An episode of this client started.
    pub fn began(&mut self, started: v1::EpisodeStarted) {
        if let Some(header) = &started.header {
            self.header = header.clone();
        }
        self.alarm = None;
        self.evaluation = None;
        self.files.began(&started, true);
        if let Some(status) = &mut self.status {
            // Commands must carry the number before the next status.
            status.evaluation = None;
            status.episode = Some(started);
        }
    }

    /// An episode of this client ended at `now`, s. Returns its result, in words.
    pub fn ended(&mut self, stopped: &v1::EpisodeStopped, now: f64) -> String {
        let evaluation = stopped.evaluation.clone().unwrap_or_default();
        let result = match (evaluation.success, evaluation.failure.as_str()) {
            (true, _) => "success".to_owned(),
            (false, "") => "not reached".to_owned(),
            (false, why) => format!("failed: {why}"),
        };
        let practice = self.episode().is_some_and(|e| e.practice);
        let rest = match (practice, stopped.discard) {
            (true, _) => "practice, nothing is kept",
            (false, true) => "discarded",
            (false, false) if self.files.is_recorded() => "the recorder writes the file",
            (false, false) => "NO RECORDER ANSWERS: the file may be missing",
        };
        let text = format!(
            "episode over: {result} after {:.1} s; {rest}",
            evaluation.elapsed_seconds
        );
        self.files.ended(stopped, now);
        self.note(now, false, text.clone());
        if let Some(status) = &mut self.status {
            status.episode = None;
        }
        self.header.episode = 0;
        text
    }

    /// Stores the newest stamp; another run of the server resets the state.
    fn tick(&mut self, header: Option<v1::Header>) {
        let Some(header) = header else { return };
        let is_new = header.run_id != self.header.run_id || header.tick >= self.header.tick;
        // A reset turns the tick back within one run, with the status ahead.
        if is_new || header.episode != self.header.episode || header.tick + 240 < self.header.tick {
            self.header = header;
        }
    }

    /// Stores the robot's description, which is needed to locate chair and
    /// hand in samples. A malformed one is ignored.
    pub fn take_robot(&mut self, robot: &v1::RobotDescription) {
        let roles = Roles::find(robot);
        let mount = normalized("arm mount", robot.arm_mount.as_ref());
        if let (Ok(roles), Ok(chair_from_base)) = (roles, mount) {
            self.robot = Some(Robot {
                roles,
                chair_from_base,
                tool_length: robot.tool_length,
            });
            self.place();
        }
    }

    /// Computes chair and hand from the newest poses.
    fn place(&mut self) {
        let (Some(robot), Some(set)) = (&self.robot, &self.poses) else {
            return;
        };
        let pose = |index: usize| {
            let frame = set.frames.get(index)?;
            normalized("pose", frame.pose.as_ref()).ok()
        };
        let (chair, tool) = (pose(robot.roles.chair), pose(robot.roles.end_effector));
        self.house_from_chair = chair.or(self.house_from_chair);
        self.base_from_tool = tool.or(self.base_from_tool);
    }

    /// Stores the scene's layout, for the target hint.
    pub fn take_scene(&mut self, reply: &v1::SceneReply) {
        if let Some(robot) = &reply.robot {
            self.take_robot(robot);
        }
        let ours = reply.grasps.iter().filter(|g| g.object == reply.target);
        let points: Vec<Vector3<f64>> = ours
            .filter_map(|g| normalized("grasp", g.pose.as_ref()).ok())
            .map(|pose| pose.translation.vector)
            .collect();
        let middle = points.iter().sum::<Vector3<f64>>() / points.len().max(1) as f64;
        self.scene = Some(Scene {
            index: reply.objects.iter().position(|name| *name == reply.target),
            target: reply.target.clone(),
            grasp: Point3::from(middle),
        });
    }

    /// No reply arrived in time.
    pub fn fall_silent(&mut self, now: f64) {
        if self.connection == Connection::Open {
            self.connection = Connection::Silent(now);
        }
    }

    /// The connection was lost.
    pub fn lose(&mut self, now: f64, reason: &str) {
        if !matches!(self.connection, Connection::Lost(..)) {
            self.connection = Connection::Lost(now, reason.to_owned());
            self.note(now, true, format!("connection lost: {reason}"));
        }
        self.round_trip = None;
    }

    /// Appends an event; a repeated one is stored once.
    pub fn note(&mut self, at: f64, bad: bool, text: String) {
        if self.happenings.back().is_some_and(|last| last.text == text) {
            self.happenings.pop_back();
        }
        if self.happenings.len() == KEPT {
            self.happenings.pop_front();
        }
        self.happenings.push_back(Happening { at, bad, text });
    }

    /// The running episode.
    #[must_use]
    pub fn episode(&self) -> Option<&v1::EpisodeStarted> {
        self.status.as_ref()?.episode.as_ref()
    }

    /// The scenario in force.
    #[must_use]
    pub fn scenario(&self) -> Option<&v1::Scenario> {
        self.status.as_ref()?.scenario.as_ref()
    }

    /// Simulated seconds since the running episode began.
    #[must_use]
    pub fn episode_clock(&self) -> Option<f64> {
        let first = self.episode()?.header.as_ref()?.stamp_nanos;
        Some(self.header.stamp_nanos.saturating_sub(first) as f64 * 1e-9)
    }

    /// The chair on the floor: x, y in m and heading in rad, in `house`.
    #[must_use]
    pub fn chair(&self) -> Option<[f64; 3]> {
        let pose = self.house_from_chair?;
        let forward = pose.rotation * Vector3::x();
        Some([
            pose.translation.x,
            pose.translation.y,
            forward.y.atan2(forward.x),
        ])
    }

    /// The end effector relative to the arm's base, in the chair's directions:
    /// forward, left and up, m.
    #[must_use]
    pub fn hand(&self) -> Option<[f64; 3]> {
        let tool = self.base_from_tool?.translation;
        Some(hand::chair_directions(tool.vector, &self.mount()?))
    }

    /// Rotation of the arm's base on the chair.
    #[must_use]
    pub fn mount(&self) -> Option<UnitQuaternion<f64>> {
        Some(self.robot.as_ref()?.chair_from_base.rotation)
    }

    /// Distance between the pads, m.
    #[must_use]
    pub fn opening(&self) -> Option<f64> {
        // The command for a closed gripper may be slightly below zero.
        Some(self.joints.as_ref()?.opening?.max(0.0))
    }

    /// The knuckle's angle, rad.
    #[must_use]
    pub fn knuckle(&self) -> Option<f64> {
        let index = self.robot.as_ref()?.roles.knuckle;
        self.joints.as_ref()?.positions.get(index).copied()
    }

    /// Position of the task's object; `None` until scene and objects are known.
    #[must_use]
    pub fn target(&self) -> Option<Target> {
        let (scene, robot) = (self.scene.as_ref()?, self.robot.as_ref()?);
        let object = self.objects.get(scene.index?)?;
        let base_from_house = (self.house_from_chair? * robot.chair_from_base).inverse();
        let grasp = self.base_from_tool? * Point3::new(0.0, 0.0, robot.tool_length);
        let place = object * scene.grasp;
        let away = base_from_house * place - grasp;
        Some(Target {
            name: scene.target.clone(),
            from_hand: hand::chair_directions(away, &robot.chair_from_base.rotation),
            place: place.coords.into(),
        })
    }
}

#[cfg(test)]
mod tests {
    use super::super::tests::described as robot;
    use super::*;

    #[test]
    fn a_restarted_server_replaces_the_clock() {
        let mut situation = Situation::default();
        let at = |run: &str, tick| {
            Sample::Clock(v1::Clock {
                header: Some(v1::Header {
                    run_id: run.to_owned(),
                    tick,
                    ..Default::default()
                }),
                real_time_factor: 1.0,
            })
        };
        situation.take(at("a", 1000), 0.0);
        situation.take(at("a", 996), 0.1);
        assert_eq!(situation.header.tick, 1000, "an overtaken sample");
        situation.take(at("b", 4), 0.2);
        assert_eq!(situation.header.tick, 4);
    }

    #[test]
    fn the_target_is_given_along_the_axes_of_the_chair() {
        let mut situation = Situation::default();
        let pose = |x: f64, y: f64, z: f64| v1::Pose {
            position: Some(v1::Vector3 { x, y, z }),
            orientation: Some(v1::Quaternion {
                w: 1.0,
                ..Default::default()
            }),
        };
        situation.take_scene(&v1::SceneReply {
            target: "mustard".to_owned(),
            objects: vec!["mustard".to_owned()],
            robot: Some(robot()),
            ..Default::default()
        });
        let mut frames = vec![v1::FramePose::default(); 2];
        // 0.5 m ahead of the arm's base.
        frames[0].pose = Some(pose(-0.5, 0.0, 0.0));
        frames[1].pose = Some(pose(0.0, 0.0, 0.0));
        let header = None;
        situation.take(Sample::Pose(v1::PoseSet { header, frames }), 0.0);
        let objects = v1::ObjectPoses {
            poses: vec![pose(1.2, 0.5, 0.6)],
            ..Default::default()
        };
        situation.take(Sample::ObjectPose(objects), 0.0);
        let target = situation.target().unwrap();
        for (got, expected) in target.from_hand.iter().zip([0.3, 0.2, 0.1]) {
            assert!((got - expected).abs() < 1e-9, "{:?}", target.from_hand);
        }
    }
}
