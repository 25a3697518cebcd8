//! Who is in control: one commander process at a time.
//!
//! A commander is a name and a run id, the life of one process. It is known
//! here only while its liveliness token stands.

use std::collections::BTreeSet;
use std::time::Instant;

/// How many commanders are known at once; more are not seen.
const MAX_ALIVE: usize = 256;

/// One life of one commander.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub struct Life {
    /// Name of the commander.
    pub name: String,
    /// Names the life of its process.
    pub run_id: String,
}

/// The commander that is in control.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Holder {
    /// Who.
    pub life: Life,
    /// Since when.
    pub since: Instant,
    /// Sequence number of its newest command.
    pub last_sequence: Option<u64>,
}

/// What became of a request for control.
#[derive(Debug, PartialEq, Eq)]
pub enum Granted {
    /// It was in control already.
    Already,
    /// Nobody was.
    Free,
    /// It was taken from this one.
    From(String),
    /// Its token has not been seen; it may ask again.
    Unseen,
}

/// The lease on control.
#[derive(Debug, Default)]
pub struct Lease {
    alive: BTreeSet<Life>,
    holder: Option<Holder>,
}

impl Lease {
    /// Who is in control.
    #[must_use]
    pub fn holder(&self) -> Option<&Holder> {
        self.holder.as_ref()
    }

    /// Who is in control, to note what it sends.
    pub fn holder_mut(&mut self) -> Option<&mut Holder> {
        self.holder.as_mut()
    }

    /// A commander's token appeared.
    pub fn appeared(&mut self, life: Life) {
        if self.alive.len() < MAX_ALIVE {
            self.alive.insert(life);
        }
    }

    /// A commander's token vanished; true when it was in control.
    pub fn vanished(&mut self, life: &Life) -> bool {
        self.alive.remove(life);
        self.release(life)
    }

    /// Gives control to `life`; `take` takes it from whoever has it.
    ///
    /// # Errors
    /// Who has it, and how to get it.
    pub fn ask(&mut self, life: Life, take: bool, now: Instant) -> Result<Granted, String> {
        if !self.alive.contains(&life) {
            return Ok(Granted::Unseen);
        }
        let granted = match &self.holder {
            None => Granted::Free,
            Some(holder) if holder.life == life => return Ok(Granted::Already),
            Some(holder) if take => Granted::From(holder.life.name.clone()),
            Some(holder) => {
                let seconds = now.saturating_duration_since(holder.since).as_secs();
                let who = match holder.life.name == life.name {
                    true => format!("another process that is named {:?} too", life.name),
                    false => format!("{:?}", holder.life.name),
                };
                return Err(format!(
                    "control is held by {who}, for {seconds} s now; to take it over ask with \
                     `take` (on the command line: --take)"
                ));
            }
        };
        self.holder = Some(Holder {
            life,
            since: now,
            last_sequence: None,
        });
        Ok(granted)
    }

    /// Gives control back; true when `life` had it.
    pub fn release(&mut self, life: &Life) -> bool {
        let held = self.holder.as_ref().is_some_and(|h| h.life == *life);
        if held {
            self.holder = None;
        }
        held
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn life(name: &str, run_id: &str) -> Life {
        Life {
            name: name.into(),
            run_id: run_id.into(),
        }
    }

    #[test]
    fn control_has_one_holder_and_is_taken_only_explicitly() {
        let (anna, ben) = (life("anna", "1"), life("ben", "2"));
        let again = life("anna", "3");
        let now = Instant::now();
        let mut lease = Lease::default();
        assert_eq!(lease.ask(anna.clone(), false, now), Ok(Granted::Unseen));
        for life in [&anna, &ben, &again] {
            lease.appeared(life.clone());
        }
        assert_eq!(lease.ask(anna.clone(), false, now), Ok(Granted::Free));
        assert_eq!(lease.ask(anna.clone(), true, now), Ok(Granted::Already));
        let told = lease.ask(ben.clone(), false, now).unwrap_err();
        assert!(told.contains("anna") && told.contains("--take"), "{told}");
        let told = lease.ask(again, false, now).unwrap_err();
        assert!(told.contains("another process"), "{told}");
        assert!(!lease.release(&ben), "it had nothing to give back");
        let taken = lease.ask(ben.clone(), true, now);
        assert_eq!(taken, Ok(Granted::From("anna".into())));
        assert!(!lease.vanished(&anna), "it had lost control before");
        assert!(lease.vanished(&ben));
        assert_eq!(lease.holder(), None);
        assert_eq!(lease.ask(ben, false, now), Ok(Granted::Unseen));
    }
}
