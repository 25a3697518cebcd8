//! Answers the queries of the control plane.

use std::time::Instant;

use wheelarm_proto::keys::{self, Query};
use wheelarm_proto::{Message, v1};
use zenoh::Wait;

use super::engine::{Engine, Request};
use super::inbox::{Granted, Life};
use super::render::RenderThread;
use super::{convert, lock};
use crate::geometry::bounds;
use crate::scene::Body;
use crate::sim::Simulation;
use crate::{scene, tasks};

/// Where the arm stands among the recorded joints.
const ARM_JOINTS: std::ops::Range<usize> = 4..10;

/// How far a joint may turn from where a solution is looked for nearby, radians.
const NEAR_CHANGE: f64 = 1.2;

impl Engine {
    /// Answers one query; a refused one gets a `Failure` with the cure.
    pub(super) fn answer(&mut self, request: Request) {
        let payload = request.asked.payload().map(|p| p.to_bytes().into_owned());
        let answer = self.reply(request.query, payload.as_deref().unwrap_or_default());
        let outcome = match answer {
            Ok(bytes) => request
                .asked
                .reply(request.asked.key_expr().clone(), bytes)
                .wait(),
            Err(message) => {
                let failure = v1::Failure {
                    header: Some(self.stamp()),
                    message,
                };
                request.asked.reply_err(failure.encode_to_vec()).wait()
            }
        };
        if let Err(e) = outcome {
            tracing::warn!("cannot answer {:?}: {e}", request.query);
        }
    }

    fn stamp(&self) -> v1::Header {
        self.shared
            .outbox
            .header(self.episode_number(), self.sim.snapshot().tick)
    }

    fn reply(&mut self, query: Query, payload: &[u8]) -> Result<Vec<u8>, String> {
        Ok(match query {
            Query::Status => self.status().encode_to_vec(),
            Query::Scene => self.scene().encode_to_vec(),
            Query::Tasks => self.tasks()?.encode_to_vec(),
            Query::Lease => self.lease(decode(payload)?)?.encode_to_vec(),
            Query::Reach => self.reach(decode(payload)?)?.encode_to_vec(),
            Query::Reset => {
                let request: v1::ResetRequest = decode(payload)?;
                let asked = request.scenario.unwrap_or_default();
                let now = self.sim.scenario();
                let scenario = convert::scenario_over(now, &asked).map_err(|e| e.to_string())?;
                self.reset(scenario, &request.snapshot)?;
                let scenario = Some(convert::scenario(self.sim.scenario()));
                v1::ResetReply {
                    header: Some(self.stamp()),
                    scenario,
                }
                .encode_to_vec()
            }
            Query::Pause | Query::Resume => {
                self.paused = query == Query::Pause;
                self.pace.restart();
                self.event(
                    if self.paused { "paused" } else { "resumed" },
                    "by a client",
                );
                self.ack()
            }
            Query::EpisodeStart => self.start_episode(decode(payload)?)?.encode_to_vec(),
            Query::EpisodeStop => {
                let request: v1::EpisodeStopRequest = decode(payload)?;
                let stopped = self.stop_episode(request.discard);
                stopped.ok_or("no episode is running")?.encode_to_vec()
            }
            Query::Episode => self.episode_state().encode_to_vec(),
            Query::Snapshot => self.snapshot()?.encode_to_vec(),
            Query::Shutdown => {
                self.shared
                    .stop
                    .store(true, std::sync::atomic::Ordering::Release);
                self.ack()
            }
        })
    }

    fn ack(&self) -> Vec<u8> {
        v1::Ack {
            header: Some(self.stamp()),
        }
        .encode_to_vec()
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
        let held = self.held();
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
            waiting_for: self.waiting_for.clone(),
            recorders: lock(&self.shared.recorders).all(&self.shared.run_id),
            refused: lock(&self.shared.inbox).refused(),
            evaluation: Some(evaluation),
            holder: held.holder,
            held_seconds: held.held_seconds,
            unix_nanos: super::preview::unix_nanos(),
        }
    }

    /// Who holds control.
    fn held(&self) -> v1::LeaseReply {
        let inbox = lock(&self.shared.inbox);
        let holder = inbox.lease().holder();
        v1::LeaseReply {
            header: Some(self.stamp()),
            holder: holder.map(|h| h.life.name.clone()).unwrap_or_default(),
            held_seconds: holder.map_or(0.0, |h| h.since.elapsed().as_secs_f64()),
        }
    }

    fn lease(&mut self, request: v1::LeaseRequest) -> Result<v1::LeaseReply, String> {
        let name = request.commander;
        let run_id = request.header.unwrap_or_default().run_id;
        for word in [&name, &run_id] {
            keys::check_name(word).map_err(|_| {
                format!(
                    "commander and run id must be 1 to 64 letters, digits, `-` or `_`, not {:?}",
                    word.chars().take(80).collect::<String>()
                )
            })?;
        }
        let life = Life {
            name: name.clone(),
            run_id,
        };
        if request.release {
            if lock(&self.shared.inbox).release(&life) {
                self.event("control", &format!("{name:?} gave control back"));
            }
            return Ok(self.held());
        }
        let granted = lock(&self.shared.inbox).ask(life, request.take, Instant::now())?;
        match granted {
            Granted::Already => {}
            Granted::Free => self.event("control", &format!("{name:?} is in control")),
            Granted::From(former) => {
                self.event("control", &format!("{name:?} took control from {former:?}"));
            }
            Granted::Unseen => {
                return Ok(v1::LeaseReply {
                    header: Some(self.stamp()),
                    ..Default::default()
                });
            }
        }
        Ok(self.held())
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
                force: g.force,
            })
        });
        v1::SceneReply {
            header: Some(self.stamp()),
            bodies: furniture.chain(objects).collect(),
            grasps: grasps.collect(),
            target: self.sim.scenario().target.clone(),
            instances: self.instances(),
            objects: scene.objects.iter().map(|o| o.name.clone()).collect(),
            arm_mount: self.arm_mount().map(|p| convert::pose(&p)),
            tool_length: model.settings.tool_length,
            footprint: model.settings.footprint.to_vec(),
            joints: scene
                .joints
                .iter()
                .map(|joint| convert::furniture_joint(joint, scene))
                .collect(),
            goal: self.sim.task().map(|task| {
                let target = &self.sim.scenario().target;
                convert::goal(&task.goal(), target, scene)
            }),
        }
    }

    fn arm_mount(&self) -> Option<nalgebra::Isometry3<f64>> {
        let (model, snapshot) = (self.sim.model(), self.sim.snapshot());
        let base = model
            .links
            .iter()
            .position(|l| l.name == model.settings.arm_base_link)?;
        Some(snapshot.links[0].pose.inverse() * snapshot.links[base].pose)
    }

    fn instances(&self) -> Vec<v1::Instance> {
        self.render
            .as_ref()
            .map(|r: &RenderThread| r.instances.clone())
            .unwrap_or_default()
    }

    fn tasks(&self) -> Result<v1::TaskList, String> {
        let tasks = tasks::list(self.sim.assets()).map_err(|e| e.to_string())?;
        let tasks = tasks
            .into_iter()
            .map(|t| v1::TaskInfo {
                predicates: t.conditions.iter().map(|c| c.predicate.label()).collect(),
                name: t.name,
                activity: t.activity,
                area: t.area,
                instructions: t.instructions,
            })
            .collect();
        Ok(v1::TaskList {
            header: Some(self.stamp()),
            tasks,
        })
    }

    fn reach(&self, request: v1::ReachRequest) -> Result<v1::ReachReply, String> {
        let pose = convert::isometry("pose", request.pose.as_ref()).map_err(|e| e.to_string())?;
        let joints = self.sim.recorded_joints();
        let kinematics = self.sim.control().kinematics();
        let solved = match request.near.as_slice() {
            [] => {
                let now = std::array::from_fn(|i| joints[ARM_JOINTS.start + i].position);
                kinematics.solve(&pose, &now)
            }
            near => {
                let near = wheelarm_proto::check::list::<6>("near", near);
                let near = near.map_err(|e| e.to_string())?;
                kinematics.solve_local(&pose, &near, NEAR_CHANGE)
            }
        };
        let header = Some(self.stamp());
        Ok(match solved {
            Ok(solution) => v1::ReachReply {
                header,
                reachable: true,
                joints: solution.joints.to_vec(),
                reason: String::new(),
            },
            Err(e) => v1::ReachReply {
                header,
                reachable: false,
                joints: Vec::new(),
                reason: e.to_string(),
            },
        })
    }

    fn snapshot(&self) -> Result<v1::SnapshotReply, String> {
        let episode = self.episode.as_ref().ok_or("no episode is running")?;
        Ok(v1::SnapshotReply {
            header: episode.started.header.clone(),
            snapshot: episode.snapshot.clone(),
            assets: self.asset_texts.clone(),
            instances: self.instances(),
        })
    }
}

/// The texts of all asset files of a simulation, read when it is set up.
///
/// # Errors
/// When a file cannot be read.
pub(super) fn asset_texts(sim: &Simulation) -> Result<Vec<v1::AssetText>, String> {
    let scenario = sim.scenario();
    let read = |path: String| {
        let text = std::fs::read_to_string(sim.assets().join(&path))
            .map_err(|e| format!("assets/{path}: {e}"))?;
        Ok(v1::AssetText { path, text })
    };
    let robot = format!("robots/{}", scenario.robot);
    let mut texts = robot_files(&sim.assets().join(&robot))
        .into_iter()
        .map(|file| read(format!("{robot}/{file}")))
        .collect::<Result<Vec<_>, String>>()?;
    if !scenario.task.is_empty() {
        texts.push(read(format!("tasks/{}.toml", scenario.task))?);
    }
    let scene = scene::asset_texts(sim.assets(), &scenario.scene).map_err(|e| e.to_string())?;
    texts.extend(scene.into_iter().map(|a| v1::AssetText {
        path: a.path,
        text: a.text,
    }));
    Ok(texts)
}

/// The URDF and TOML files of a robot folder, by name.
fn robot_files(folder: &std::path::Path) -> Vec<String> {
    let entries = std::fs::read_dir(folder).into_iter().flatten().flatten();
    let names = entries.filter_map(|e| e.file_name().into_string().ok());
    let mut names: Vec<_> = names
        .filter(|n| n.ends_with(".urdf") || n.ends_with(".toml"))
        .collect();
    names.sort();
    names
}

fn decode<M: Message + Default>(payload: &[u8]) -> Result<M, String> {
    M::decode(payload).map_err(|e| format!("the request cannot be read: {e}"))
}

/// A body with the boxes of its collision shapes: in `house` for what stays, in
/// the body's own frame for what moves.
fn body(body: &Body, fixed: bool) -> v1::SceneBody {
    let world_from_body = if fixed {
        body.pose
    } else {
        nalgebra::Isometry3::identity()
    };
    let boxes = body
        .collision
        .iter()
        .filter_map(|part| {
            let (centre, half) = bounds(&part.shape)?;
            let pose = world_from_body * part.pose * nalgebra::Translation3::from(centre);
            Some(v1::BoxGeometry {
                pose: Some(convert::pose(&pose)),
                half: Some(convert::vector(&half)),
            })
        })
        .collect();
    v1::SceneBody {
        name: body.name.clone(),
        fixed,
        boxes,
        area: body.area.clone(),
    }
}
