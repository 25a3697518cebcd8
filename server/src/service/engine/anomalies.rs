//! Reports anomalies of the simulation, each once. A note does not interrupt; a broken
//! state ends the episode and requires a reset.

use wheelarm_proto::v1;

use super::Engine;
use crate::service::convert;
use crate::sim::anomaly_words;
use crate::snapshot::Contact;

/// Largest number of notes per episode.
const MOST: usize = 100;

impl Engine {
    /// Forgets reported anomalies, for a new episode or simulation.
    pub(super) fn forget_anomalies(&mut self) {
        self.reported_anomalies.clear();
        self.anomalies.clear();
        self.reported_collisions.clear();
    }

    /// Handles a state that has just broken: a running episode ends as failed, and
    /// nothing moves until a `reset`.
    pub(super) fn break_off(&mut self) {
        let words = self.sim.broken().unwrap_or_default().to_owned();
        tracing::error!("the state is broken: {words}; waiting for a `reset`");
        self.event(
            v1::EventKind::Anomaly,
            &format!("the state is broken: {words}; request a `reset`"),
        );
        let kind = self
            .sim
            .fault()
            .map_or_else(Default::default, convert::fault_kind);
        self.anomalies.push((kind, words.clone()));
        self.end_episode(false, v1::EndCause::Physics);
        self.shared.command_gate.lock().close(&format!(
            "the state is broken, commands are rejected until a `reset`: {words}"
        ));
    }

    pub(super) fn publish_anomalies(&mut self) {
        for anomaly in self.sim.snapshot().anomalies.clone() {
            if !self.reported_anomalies.contains(&anomaly) && self.anomalies.len() < MOST {
                let words = anomaly_words(&anomaly, self.sim.model(), self.sim.scene());
                self.event(v1::EventKind::Anomaly, &words);
                self.anomalies
                    .push((convert::anomaly_kind(&anomaly), words));
                self.reported_anomalies.push(anomaly);
            }
        }
        self.publish_touches();
        let hard: Vec<Contact> = self.sim.hard_collisions().copied().collect();
        for contact in hard {
            let pair = (contact.first, contact.second);
            if !self.reported_collisions.contains(&pair) {
                let name = |body| convert::body_name(body, self.sim.model(), self.sim.scene());
                let (first, second) = (name(pair.0), name(pair.1));
                let force = contact.force.norm();
                self.publish_event(v1::Event {
                    kind: v1::EventKind::Collision.into(),
                    text: format!("{first} hits {second} with {force:.0} N"),
                    body: first,
                    other_body: second,
                    force: Some(force),
                    ..v1::Event::default()
                });
                self.reported_collisions.push(pair);
            }
        }
    }

    /// Reports each pair of the person and the robot, or an object that it holds, once.
    fn publish_touches(&mut self) {
        let touches: Vec<Contact> = self.sim.touches().copied().collect();
        for contact in touches {
            let pair = (contact.first, contact.second);
            if self.reported_collisions.contains(&pair) {
                continue;
            }
            let name = |body| convert::body_name(body, self.sim.model(), self.sim.scene());
            let (first, second) = (name(pair.0), name(pair.1));
            let force = contact.force.norm();
            self.publish_event(v1::Event {
                kind: v1::EventKind::PersonContact.into(),
                text: format!("{first} touches {second} with {force:.1} N"),
                body: first,
                other_body: second,
                force: Some(force),
                ..v1::Event::default()
            });
            self.reported_collisions.push(pair);
        }
    }
}
