//! Goals: a click selects an object, and the scripted operator's skills act on it under
//! the same control. Any manual input ends the goal at once.

use serde_json::json;
use wheelarm_proto::v1;

use super::{Answered, Effect, Model, note};
use crate::motion::GONE;
use crate::speed::Allow;

/// A candidate can be chosen for this long, s.
const CHOICE: f64 = 30.0;
/// Most candidates that are stored.
const CHOICES: usize = 64;
/// Graspable objects are searched within this share of the image's width: 48 of 640
/// pixels.
const SNAP: f64 = 0.075;
/// Candidate that names the object of the task, wherever it is; its one action is `turn`.
const TASK_OBJECT: &str = "task";
/// An object counts as held when both pads press more than this, N.
const HELD: f64 = 1.0;

/// A pick request: the object at a pixel.
#[derive(Clone, Debug, PartialEq)]
pub struct PendingPick {
    /// The page that sent it.
    pub page: String,
    /// Number of the page's request.
    pub id: u64,
    /// Request for the server.
    pub request: v1::PickRequest,
}

/// An object that was picked.
#[derive(Clone, Debug, PartialEq)]
pub struct Candidate {
    /// Body.
    pub body: String,
    /// Point on its surface, in `house`, m.
    pub point: [f64; 3],
    /// Possible actions.
    pub actions: Vec<&'static str>,
    /// Expiry, s.
    pub until: f64,
}

/// A requested skill.
#[derive(Clone, Debug, PartialEq)]
pub struct GoalRequest {
    /// Its number.
    pub number: u64,
    /// Body.
    pub body: String,
    /// `near`, `take`, `put` or `turn`.
    pub action: &'static str,
    /// Target point, in `house`, m.
    pub point: [f64; 3],
}

/// A running skill.
#[derive(Clone, Debug, PartialEq)]
pub struct Goal {
    /// Its number.
    pub number: u64,
    /// The page that requested it.
    pub page: String,
    /// Body.
    pub body: String,
    /// `near`, `take`, `put` or `turn`.
    pub action: &'static str,
    /// Current stage.
    pub stage: String,
    /// Stages so far, in order.
    pub stages: Vec<String>,
    /// Newest message of the skill.
    pub text: String,
}

impl Model {
    pub(super) fn pick(
        &mut self,
        page: &str,
        id: u64,
        camera: usize,
        tick: u64,
        [u, v]: [f64; 2],
    ) -> Vec<Effect> {
        let scenario = self.situation.scenario().cloned().unwrap_or_default();
        let Some(camera) = scenario.cameras.get(camera) else {
            return self.answer(page, id, Err("unknown camera: reload the page".to_owned()));
        };
        let request = v1::PickRequest {
            camera: camera.name.clone(),
            tick,
            u,
            v,
            snap: SNAP,
        };
        let page = page.to_owned();
        vec![Effect::Pick(PendingPick { page, id, request })]
    }

    /// Handles the reply to a pick.
    pub fn picked(
        &mut self,
        page: &str,
        id: u64,
        reply: Result<v1::PickReply, String>,
        time: f64,
    ) -> Vec<Effect> {
        let answered = reply.map(|reply| self.candidate(&reply, time));
        self.answer(page, id, answered)
    }

    fn candidate(&mut self, reply: &v1::PickReply, time: f64) -> serde_json::Value {
        let nothing = |note: String| json!({"candidates": [], "note": note});
        let Some(point) = reply.point else {
            return nothing("nothing is there".to_owned());
        };
        let holds = self.situation.pad_force.iter().all(|force| *force > HELD);
        let actions = match (reply.graspable, holds) {
            (true, false) => vec!["near", "take"],
            (true, true) => vec!["put"],
            (false, true) if reply.kind() == v1::InstanceKind::Furniture => vec!["put"],
            (false, _) => vec![],
        };
        let name = reply.body.replace('_', " ");
        if actions.is_empty() {
            return nothing(format!("{name}: it cannot be taken"));
        }
        while self.candidates.len() >= CHOICES {
            self.candidates.pop_first();
        }
        self.picks += 1;
        let key = format!("c{:06}", self.picks);
        let away = self.situation.chair().map(|[x, y, _]| {
            let (dx, dy) = (point.x - x, point.y - y);
            format!("{:.2} m away", dx.hypot(dy))
        });
        let outline = match reply.bounds[..] {
            [left, top, right, bottom] => {
                json!([[left, top], [right, top], [right, bottom], [left, bottom]])
            }
            _ => json!([]),
        };
        let found = json!({"candidates": [{
            "candidate": key,
            "name": name,
            "actions": actions,
            "outline": outline,
            "point": [point.x, point.y, point.z],
            "note": away.unwrap_or_default(),
        }]});
        self.candidates.insert(
            key,
            Candidate {
                body: reply.body.clone(),
                point: [point.x, point.y, point.z],
                actions,
                until: time + CHOICE,
            },
        );
        found
    }

    pub(super) fn start_goal(
        &mut self,
        page: &str,
        id: u64,
        candidate: &str,
        action: &str,
        time: f64,
    ) -> Vec<Effect> {
        let answered = self.new_goal(page, candidate, action, time);
        let (mut effects, answered): (Vec<Effect>, Answered) = match answered {
            Ok((effects, number)) => (effects, Ok(json!({"goal": number}))),
            Err(why) => (Vec::new(), Err(why)),
        };
        effects.extend(self.answer(page, id, answered));
        effects
    }

    fn new_goal(
        &mut self,
        page: &str,
        candidate: &str,
        action: &str,
        time: f64,
    ) -> Result<(Vec<Effect>, u64), String> {
        let known = match candidate {
            TASK_OBJECT => Some(Candidate {
                body: "object of the task".to_owned(),
                point: [0.0; 3],
                actions: vec!["turn"],
                until: f64::INFINITY,
            }),
            candidate => self.candidates.get(candidate).cloned(),
        };
        let chosen = known.ok_or("this choice has expired: point at the object again")?;
        let action = chosen.actions.iter().find(|known| **known == action);
        let action = *action.ok_or("this cannot be done with it")?;
        let motion = self.pages.get(page).map(|page| &page.motion);
        let age = motion.and_then(|motion| motion.age(self.situation.header.tick));
        if Allow::at(age) == Allow::Stop {
            return Err("the image is too old: only a stop is accepted".to_owned());
        }
        if self.lock_step() {
            return Err("this server is in lock-step; goals need real time".to_owned());
        }
        let mut effects = self.end_goal("another goal begins", time);
        effects.extend(self.cut(page, "a goal begins", time));
        self.goals += 1;
        self.goal = Some(Goal {
            number: self.goals,
            page: page.to_owned(),
            body: chosen.body.clone(),
            action,
            stage: String::new(),
            stages: Vec::new(),
            text: "planning".to_owned(),
        });
        effects.push(self.audit(page, "goal", &format!("{action} {}", chosen.body)));
        effects.push(Effect::Goal(GoalRequest {
            number: self.goals,
            body: chosen.body,
            action,
            point: chosen.point,
        }));
        Ok((effects, self.goals))
    }

    /// Whether the simulation waits for this program at every control tick.
    pub(crate) fn lock_step(&self) -> bool {
        let scenario = self.situation.scenario();
        let paced = scenario.is_some_and(|s| s.pacing() == v1::Pacing::LockStep);
        paced && self.situation.episode().is_some()
    }

    /// Sends the command that a skill proposes for a control tick.
    pub fn goal_acts(
        &mut self,
        number: u64,
        header: v1::Header,
        mut command: v1::Command,
        notes: &[String],
    ) -> Vec<Effect> {
        let Some(goal) = self.goal.as_mut().filter(|goal| goal.number == number) else {
            return Vec::new();
        };
        if self.control.page() != Some(&goal.page) {
            return Vec::new();
        }
        if goal.stage != command.phase_name {
            goal.stage.clone_from(&command.phase_name);
            goal.stages.push(command.phase_name.clone());
        }
        if let Some(newest) = notes.last() {
            goal.text.clone_from(newest);
        }
        command.phase_name = format!("assist:{}", command.phase_name);
        command.mode = v1::InputMode::Goal.into();
        command.assistance = v1::Assistance::Skill.into();
        vec![self.send(header, command)]
    }

    /// A skill ended.
    pub fn goal_over(
        &mut self,
        number: u64,
        result: Result<String, String>,
        time: f64,
    ) -> Vec<Effect> {
        if self.goal.as_ref().is_none_or(|goal| goal.number != number) {
            return Vec::new();
        }
        let (bad, text) = match result {
            Ok(text) => (false, text),
            Err(why) => (true, why),
        };
        let page = self.goal.as_ref().map(|goal| goal.page.clone());
        let mut effects = self.end_goal("", time);
        if let Some(page) = page {
            effects.push(note(&page, bad, &text));
        }
        effects
    }

    /// Ends the running skill: the chair brakes, the arm holds.
    pub(crate) fn end_goal(&mut self, why: &str, _time: f64) -> Vec<Effect> {
        let Some(goal) = self.goal.take() else {
            return Vec::new();
        };
        let mut effects = vec![Effect::EndGoal(goal.number)];
        if self.control.is_ours() {
            let command = v1::Command {
                base: Some(v1::BaseCommand::default()),
                arm: Some(v1::ArmCommand {
                    target: Some(v1::arm_command::Target::Hold(true)),
                }),
                ..v1::Command::default()
            };
            let header = self.situation.header.clone();
            effects.push(self.send(header, command));
        }
        if !why.is_empty() {
            effects.push(note(&goal.page, false, &format!("goal ended: {why}")));
        }
        effects
    }

    pub(super) fn end_goal_of(&mut self, page: &str, why: &str, time: f64) -> Vec<Effect> {
        match self.goal.as_ref().is_some_and(|goal| goal.page == page) {
            true => self.end_goal(why, time),
            false => Vec::new(),
        }
    }

    /// Ends a goal when its page is silent or its image is too old.
    pub(super) fn watch_goal(&mut self, time: f64) -> Vec<Effect> {
        let Some(goal) = &self.goal else {
            return Vec::new();
        };
        let motion = self.pages.get(&goal.page).map(|page| &page.motion);
        let silence = motion.map_or(f64::INFINITY, |motion| motion.silence(time));
        let age = motion.and_then(|motion| motion.age(self.situation.header.tick));
        if silence > GONE {
            return self.end_goal("the page was silent", time);
        }
        if Allow::at(age) == Allow::Stop {
            return self.end_goal("the image is too old", time);
        }
        Vec::new()
    }
}
