//! Answers the queries of the control plane.

use std::sync::Arc;
use std::time::{Duration, Instant};

use bytes::Bytes;
use wheelarm_planning::footprint_check::wrap;
use wheelarm_proto::Query;
use wheelarm_proto::topic::StreamId;
use wheelarm_proto::v1::FailureCode;
use wheelarm_proto::{Message, v1};

use super::Engine;
use crate::scene::Body;
use crate::service::denied::Denied;
use crate::service::pending_operation::{PendingOperation, Permission};
use crate::service::render::RenderThread;
use crate::service::request_queue::Request;
use crate::service::sensor_images::SensorKind;
use crate::service::{assets, convert, describe, leases, packs, person, wall_clock};
use crate::sim::{Pacing, Scenario};

/// Largest change per joint for a local inverse-kinematics solution, rad.
const NEAR_CHANGE: f64 = 1.2;
/// Longest wait of a sensor query for the images of the tick.
const DRAWN_WITHIN: Duration = Duration::from_secs(5);
/// Largest number of path poses in one query.
const MOST_POSES: usize = 256;

impl Engine {
    /// Answers one query or starts its operation; a rejected one gets a `Failure` with
    /// the fix.
    pub(super) fn answer(&mut self, request: Request) {
        let Request { kind, query } = request;
        let payload = query.payload().map(|p| p.to_bytes().into_owned());
        let payload = payload.unwrap_or_default();
        match kind {
            Query::Scene => self.answer_scene(query),
            Query::Tasks => self.answer_tasks(query),
            Query::Map => self.answer_map(query, &payload),
            Query::Pick => self.answer_pick(query, &payload),
            Query::Packs => self.answer_packs(query),
            Query::PackPut => self.answer_pack_put(query, &payload),
            Query::Reset => {
                let wanted = self.wanted(&payload);
                let begun = wanted.and_then(|(scenario, request)| {
                    let loading = self.load(scenario, request.snapshot, request.playback)?;
                    let right = Permission {
                        force: request.force,
                        secret: request.secret,
                    };
                    Ok((loading, right))
                });
                match begun {
                    Ok((loading, right)) => {
                        self.pending_operation = Some(PendingOperation::Load {
                            query,
                            right,
                            loading,
                        });
                    }
                    Err(why) => self.refuse(query, why),
                }
            }
            Query::Playback => match self.to_show(&payload) {
                Ok(request) => {
                    let request = Box::new(request);
                    self.pending_operation = Some(PendingOperation::Show { query, request });
                }
                Err(why) => self.refuse(query, why),
            },
            Query::EpisodeStart => match decode(&payload) {
                Ok(request) => {
                    self.pending_operation = Some(PendingOperation::Start { query, request })
                }
                Err(why) => self.refuse(query, why),
            },
            Query::EpisodeStop => match self.end(&payload) {
                Ok(discard) => {
                    let query = Some(query);
                    self.pending_operation = Some(PendingOperation::Stop {
                        query,
                        discard,
                        cause: v1::EndCause::Requested,
                    });
                }
                Err(why) => self.refuse(query, why),
            },
            _ => {
                let answer = self.made_at_once(kind, &payload);
                self.reply(query, answer);
            }
        }
    }

    /// Queues a reply; the transport never blocks this thread.
    pub(super) fn reply(
        &self,
        query: zenoh::query::Query,
        answer: Result<impl Into<Bytes>, Denied>,
    ) {
        match answer {
            Ok(bytes) => self
                .shared
                .replies
                .answer(query, self.stamp(), bytes.into()),
            Err(why) => self.refuse(query, why),
        }
    }

    pub(super) fn refuse(&self, query: zenoh::query::Query, why: Denied) {
        self.shared.replies.refuse(query, self.stamp(), why);
    }

    /// The requested scenario of a reset, with every field checked.
    fn wanted(&self, payload: &[u8]) -> Result<(Scenario, v1::ResetRequest), Denied> {
        let mut request: v1::ResetRequest = decode(payload)?;
        self.may_reset(&Permission {
            force: request.force,
            secret: request.secret.clone(),
        })?;
        let message = request.scenario.take().unwrap_or_default();
        let scenario = convert::scenario_over(self.sim.scenario(), &message);
        Ok((scenario?, request))
    }

    /// Whether a client may replace the simulation.
    pub(super) fn may_reset(&self, right: &Permission) -> Result<(), Denied> {
        self.may("a reset takes its world away", right.force, &right.secret)
    }

    fn end(&self, payload: &[u8]) -> Result<bool, Denied> {
        let request: v1::EpisodeStopRequest = decode(payload)?;
        let runs = self.episode_number();
        if let Some(meant) = request.episode.filter(|meant| *meant != runs) {
            let words = match runs {
                0 => format!("episode {meant} is over, and no episode is running"),
                _ => format!("episode {meant} is over, and episode {runs} is running"),
            };
            return Err(Denied::new(FailureCode::NoEpisode, words));
        }
        if request.discard {
            let what = "a discarded episode is lost";
            self.may(what, request.force, &request.secret)?;
        }
        Ok(request.discard)
    }

    /// Rejects an irreversible operation while another client holds control, unless it
    /// is forced. This prevents accidents, not attacks.
    pub(super) fn may(&self, what: &str, force: bool, secret: &str) -> Result<(), Denied> {
        let command_gate = self.shared.command_gate.lock();
        let lease = command_gate.lease();
        match lease.holder() {
            Some(holder) if !force && !lease.knows(secret) => {
                let words = format!(
                    "{:?} is in control, for {} s now, and {what}; wait until it gives control \
                     back, or insist with `force` (on the command line: --force)",
                    holder.life.name,
                    holder.since.elapsed().as_secs()
                );
                Err(Denied::new(FailureCode::ControlHeld, words))
            }
            _ => Ok(()),
        }
    }

    pub(super) fn stamp(&self) -> v1::Header {
        self.shared
            .outbox
            .header(self.episode_number(), self.sim.snapshot().tick)
    }

    fn made_at_once(&mut self, kind: Query, payload: &[u8]) -> Result<Bytes, Denied> {
        Ok(match kind {
            Query::Status => self.status().encode_to_vec().into(),
            Query::Reach => self.reach(decode(payload)?)?.encode_to_vec().into(),
            Query::Pause | Query::Resume => {
                self.paused = kind == Query::Pause;
                self.pace.restart();
                let kind = match self.paused {
                    true => v1::EventKind::Paused,
                    false => v1::EventKind::Resumed,
                };
                self.event(kind, "by a client");
                self.ack()
            }
            Query::Episode => {
                let request: v1::EpisodeRequest = decode(payload)?;
                if !request.recorder.is_empty() {
                    let mut recorders = self.shared.recorders.lock();
                    recorders
                        .claim(&request.recorder, &request.session, Instant::now())
                        .map_err(|words| Denied::new(FailureCode::Invalid, words))?;
                }
                self.episode_state().encode_to_vec().into()
            }
            Query::Snapshot => self.snapshot()?,
            Query::Sensors => self.sensors_given().encode_to_vec().into(),
            Query::Shutdown => {
                let request: v1::ShutdownRequest = decode(payload)?;
                self.may("the server would end", request.force, &request.secret)?;
                self.shared
                    .stop
                    .store(true, std::sync::atomic::Ordering::Release);
                self.ack()
            }
            // Answered elsewhere. Every query is named: a new one does not compile until its
            // handler is decided.
            Query::Scene
            | Query::Tasks
            | Query::Lease
            | Query::Map
            | Query::Pick
            | Query::Packs
            | Query::PackPut
            | Query::Reset
            | Query::Playback
            | Query::EpisodeStart
            | Query::EpisodeStop => {
                return Err(Denied::internal(format!(
                    "{} has no reply here",
                    kind.name()
                )));
            }
        })
    }

    /// Images that the camera sensors have delivered by this tick. In lock-step every
    /// image of the tick is rendered first; in real time it does not wait.
    fn sensors_given(&self) -> v1::SensorsReply {
        let header = Some(self.stamp());
        let Some(render) = self.render.as_ref() else {
            return v1::SensorsReply {
                header,
                ..Default::default()
            };
        };
        let (episode, sensor_images) = (self.episode_number(), render.sensor_images());
        let deadline = Instant::now() + DRAWN_WITHIN;
        let waits =
            self.sim.scenario().pacing == Pacing::LockStep && !sensor_images.kinds().is_empty();
        while waits && !render.is_drawn() && Instant::now() < deadline {
            std::thread::sleep(Duration::from_micros(100));
        }
        sensor_images.set_tick(episode, self.sim.snapshot().tick);
        sensor_images.publish();
        let manifest = self
            .shared
            .outbox
            .manifest(episode, &[], &sensor_images.names());
        let given = |kind: &SensorKind| {
            let stream = StreamId::sensor(&kind.name).to_string();
            let count = manifest.iter().find(|count| count.stream == stream);
            let of = |value: fn(&v1::StreamCount) -> u64| {
                let own = count.filter(|count| count.count > 0);
                own.map_or(0, value)
            };
            v1::SensorProgress {
                sensor: kind.name.clone(),
                camera: kind.camera.clone(),
                depth: kind.is_depth,
                images: of(|count| count.count),
                newest: of(|count| count.last),
            }
        };
        v1::SensorsReply {
            header,
            sensors: sensor_images.kinds().iter().map(given).collect(),
        }
    }

    fn ack(&self) -> Bytes {
        let header = Some(self.stamp());
        v1::Ack { header }.encode_to_vec().into()
    }

    fn episode_state(&self) -> v1::EpisodeState {
        v1::EpisodeState {
            header: Some(self.stamp()),
            running: self.episode.as_ref().map(|e| e.started.clone()),
            ended: self.ended.iter().cloned().collect(),
        }
    }

    fn status(&self) -> v1::Status {
        let mut evaluation = convert::evaluation(self.sim.evaluation());
        evaluation.header = Some(self.stamp());
        let held = leases::lease_reply(self.shared.command_gate.lock().lease());
        v1::Status {
            header: Some(self.stamp()),
            version: env!("CARGO_PKG_VERSION").to_owned(),
            scenario: Some(convert::scenario(self.sim.scenario())),
            adapter: self
                .render
                .as_ref()
                .map(|r| r.adapter.clone())
                .unwrap_or_default(),
            paused: self.paused,
            real_time_factor: self.pace.factor(),
            episode: self.episode.as_ref().map(|e| e.started.clone()),
            waiting_for: self.waiting_for.words.clone(),
            waiting_for_code: self.waiting_for.code.into(),
            recorders: self
                .shared
                .recorders
                .lock()
                .all(self.shared.outbox.run_id(), Instant::now()),
            refused: self.shared.command_gate.lock().refused(),
            evaluation: Some(evaluation),
            holder: held.holder,
            held_seconds: held.held_seconds,
            unix_nanos: wall_clock::unix_nanos(),
            broken: self.sim.broken().unwrap_or_default().to_owned(),
            access: self.options.access.into(),
            strange: self.shared.strange(),
        }
    }

    /// Describes the scene once; its message is encoded on another thread.
    fn answer_scene(&mut self, query: zenoh::query::Query) {
        let scene = match &self.made.scene {
            Some(scene) => Arc::clone(scene),
            None => {
                let scene = Arc::new(self.scene());
                self.made.scene = Some(Arc::clone(&scene));
                scene
            }
        };
        let stamp = self.stamp();
        let header = Some(stamp.clone());
        self.shared.replies.answer_later(query, stamp, move || {
            let reply = v1::SceneReply {
                header,
                ..scene.as_ref().clone()
            };
            Ok(reply.encode_to_vec().into())
        });
    }

    /// Makes a map on another thread.
    fn answer_map(&mut self, query: zenoh::query::Query, payload: &[u8]) {
        let request: v1::MapRequest = match decode(payload) {
            Ok(request) => request,
            Err(why) => return self.refuse(query, why),
        };
        let source = self.sim.map_source(!request.without_objects);
        let stamp = self.stamp();
        let header = Some(stamp.clone());
        self.shared.replies.answer_later(query, stamp, move || {
            let reply = convert::home_map(&source.map());
            Ok(v1::MapReply { header, ..reply }.encode_to_vec().into())
        });
    }

    /// Looks up a pixel on another thread.
    fn answer_pick(&mut self, query: zenoh::query::Query, payload: &[u8]) {
        let request: v1::PickRequest = match decode(payload) {
            Ok(request) => request,
            Err(why) => return self.refuse(query, why),
        };
        let Some(render) = &self.render else {
            let why = "this server has no cameras, so no image can be pointed at";
            return self.refuse(query, Denied::new(FailureCode::Invalid, why.to_owned()));
        };
        let picked = Arc::clone(render.picked());
        let instances = render.instances.clone();
        let scene = self.sim.scene();
        let bodies = scene.furniture.iter().chain(&scene.objects);
        let graspable: Vec<String> = bodies
            .filter(|body| !body.grasps.is_empty())
            .map(|body| body.name.clone())
            .collect();
        let stamp = self.stamp();
        let header = Some(stamp.clone());
        self.shared.replies.answer_later(query, stamp, move || {
            let reply = picked.body_at(&request, &instances, &graspable)?;
            Ok(v1::PickReply { header, ..reply }.encode_to_vec().into())
        });
    }

    /// Reads the tasks on first request, on another thread.
    fn answer_tasks(&self, query: zenoh::query::Query) {
        let (shared, folder) = (Arc::clone(&self.shared), self.sim.assets().to_owned());
        let hand = self.sim.model().settings.gripper.corridor;
        let packed = self.sim.scene().clone();
        let stamp = self.stamp();
        let header = Some(stamp.clone());
        self.shared.replies.answer_later(query, stamp, move || {
            let mut known = shared.tasks.lock();
            let pack: Vec<_> = packed
                .stocked_packs()
                .map(|pack| pack.id().clone())
                .collect();
            let tasks = match &*known {
                Some((of, tasks)) if *of == pack => tasks.clone(),
                _ => {
                    let tasks = assets::tasks(&folder, Some(&packed), &hand);
                    let tasks = tasks.map_err(Denied::internal)?;
                    known.insert((pack, tasks)).1.clone()
                }
            };
            drop(known);
            Ok(v1::TaskList { header, tasks }.encode_to_vec().into())
        });
    }

    fn scene(&self) -> v1::SceneReply {
        let (scene, model) = (self.sim.scene(), self.sim.model());
        let furniture = scene.furniture.iter().enumerate();
        let furniture = furniture.map(|(i, b)| body(b, scene.joint_of(i).is_none()));
        let objects = scene.objects.iter().map(|b| body(b, false));
        let grasps = scene.furniture.iter().chain(&scene.objects);
        let grasps = grasps.flat_map(|body| {
            body.grasps.iter().map(|g| v1::GraspFrame {
                object: body.name.clone(),
                name: g.name.clone(),
                pose: Some(convert::pose(&g.pose)),
                width: g.width,
                symmetric: g.symmetric,
                force: (g.force > 0.0).then_some(g.force),
                from_above: g.from_above,
            })
        });
        let room = &scene.room_camera;
        v1::SceneReply {
            header: Some(self.stamp()),
            bodies: furniture.chain(objects).collect(),
            grasps: grasps.collect(),
            target: self.sim.scenario().target.clone(),
            instances: self.instances(),
            objects: scene.objects.iter().map(|o| o.name.clone()).collect(),
            joints: scene
                .joints
                .iter()
                .map(|joint| convert::furniture_joint(joint, scene))
                .collect(),
            goal: self.sim.task().map(|task| {
                let target = &self.sim.scenario().target;
                let lap = self.sim.person().map(|person| person::lap(person));
                convert::goal(&task.goal, target, scene, lap.as_ref())
            }),
            cameras: vec![describe::room_camera(room)],
            furniture_urdf: scene.furniture_urdf(),
            robot: Some(describe::robot(model, &self.arm_mount())),
            persons: self
                .sim
                .person()
                .map(|p| person::seated(p))
                .into_iter()
                .collect(),
        }
    }

    /// chair_from_base.
    pub(super) fn arm_mount(&self) -> nalgebra::Isometry3<f64> {
        let (roles, snapshot) = (&self.sim.model().roles, self.sim.snapshot());
        snapshot.links[0].pose.inverse() * snapshot.links[roles.arm_base].pose
    }

    fn instances(&self) -> Vec<v1::Instance> {
        self.render
            .as_ref()
            .map(|r: &RenderThread| r.instances.clone())
            .unwrap_or_default()
    }

    fn reach(&self, request: v1::ReachRequest) -> Result<v1::ReachReply, Denied> {
        let pose = convert::isometry("pose", request.pose.as_ref())?;
        if request.next_poses.len() > MOST_POSES {
            let words = format!(
                "next_poses has {} poses; allowed is at most {MOST_POSES}: split the path",
                request.next_poses.len()
            );
            return Err(Denied::new(FailureCode::Invalid, words));
        }
        let path = request.next_poses.iter();
        let path = path.map(|pose| convert::isometry("next_poses", Some(pose)));
        let path = path.collect::<Result<Vec<_>, _>>()?;
        let most = request.max_joint_change.unwrap_or(f64::INFINITY);
        if most.is_nan() || most <= 0.0 {
            let words = format!("max_joint_change is {most}; allowed is more than 0 rad");
            return Err(Denied::new(FailureCode::Invalid, words));
        }
        let kinematics = self.sim.control().kinematics();
        let mut solved = match request.near_joints.as_slice() {
            [] => kinematics.solve(&pose, &self.sim.arm_positions()),
            near => {
                let near = wheelarm_proto::check::list::<6>("near_joints", near);
                kinematics.solve_local(&pose, &near?, NEAR_CHANGE)
            }
        };
        let mut reply = v1::ReachReply {
            header: Some(self.stamp()),
            ..v1::ReachReply::default()
        };
        let mut path = path.iter();
        loop {
            let joints = match solved {
                Ok(solution) => solution.joints,
                Err(e) => {
                    reply.reason = e.to_string();
                    reply.set_problem(convert::reach_problem(e.reason));
                    return Ok(reply);
                }
            };
            if let Some(part) = self.sim.arm_meets(&joints) {
                reply.reason = format!("the arm would touch the person ({part})");
                reply.set_problem(v1::ReachProblem::Person);
                return Ok(reply);
            }
            reply.reached_count += 1;
            let Some(pose) = path.next() else {
                reply.reachable = true;
                reply.joints = joints.to_vec();
                return Ok(reply);
            };
            solved = kinematics.solve_local(pose, &joints, NEAR_CHANGE);
            let jump = solved.as_ref().ok().and_then(|next| {
                let changes = joints
                    .iter()
                    .zip(&next.joints)
                    .map(|(a, b)| wrap(a - b).abs());
                changes.enumerate().find(|(_, change)| *change > most)
            });
            if let Some((joint, change)) = jump {
                reply.reason = format!("joint {} would jump by {change:.2} rad", joint + 1);
                reply.set_problem(v1::ReachProblem::Jump);
                return Ok(reply);
            }
        }
    }

    /// Encodes the snapshot once per episode: megabytes that many clients may request.
    fn snapshot(&mut self) -> Result<Bytes, Denied> {
        let none = || Denied::new(FailureCode::NoEpisode, "no episode is running");
        let episode = self.episode.as_ref().ok_or_else(none)?;
        if let Some((number, bytes)) = &self.made.snapshot
            && *number == episode.number
        {
            return Ok(bytes.clone());
        }
        let reply = v1::SnapshotReply {
            header: episode.started.header.clone(),
            snapshot: episode.snapshot.clone(),
            assets: self.asset_texts.clone(),
            instances: self.instances(),
            packs: packs::files(self.sim.scenario()).map_err(Denied::internal)?,
            furniture_urdf: self.sim.scene().furniture_urdf(),
        };
        let bytes = Bytes::from(reply.encode_to_vec());
        self.made.snapshot = Some((episode.number, bytes.clone()));
        Ok(bytes)
    }
}

pub(super) fn decode<M: Message + Default>(payload: &[u8]) -> Result<M, Denied> {
    M::decode(payload).map_err(|e| {
        let words = format!("cannot decode the request: {e}");
        Denied::new(FailureCode::Invalid, words)
    })
}

/// A body with the boxes of its collision shapes: fixed bodies in `house`, moving ones
/// in their own frame.
fn body(body: &Body, fixed: bool) -> v1::SceneBody {
    let world_from_body = if fixed {
        body.pose
    } else {
        nalgebra::Isometry3::identity()
    };
    let boxes = body
        .collision_boxes()
        .map(|(body_from_box, half)| v1::BoxGeometry {
            pose: Some(convert::pose(&(world_from_body * body_from_box))),
            half: Some(convert::vector(&half)),
        })
        .collect();
    v1::SceneBody {
        name: body.name.clone(),
        fixed,
        boxes,
        area: body.area.clone(),
    }
}
