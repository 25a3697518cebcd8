//! Who is in control: one commander process at a time.
//!
//! A commander is a name and a run id, the life of one process. Its liveliness
//! token stands while it is in control; who asks here has been seen to have one.

use wheelarm_proto::v1::FailureCode;

use crate::service::denied::Denied;
use std::time::Instant;

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
    /// What only it knows of the lease.
    pub secret: String,
    /// Its commands carry a seal.
    pub sealed: bool,
}

/// How control is asked for.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Asked {
    /// Takes it from whoever has it.
    pub take: bool,
    /// The asker will seal its commands.
    pub sealed: bool,
    /// The secret of the lease that the asker believes to have.
    pub secret: String,
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
}

/// The lease on control.
#[derive(Debug, Default)]
pub struct Lease {
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

    /// Whether `life` is in control.
    #[must_use]
    pub fn is_held_by(&self, life: &Life) -> bool {
        self.holder.as_ref().is_some_and(|h| h.life == *life)
    }

    /// Whether `secret` is that of whoever is in control.
    #[must_use]
    pub fn knows(&self, secret: &str) -> bool {
        // An empty secret is none.
        let holder = self.holder.as_ref().filter(|_| !secret.is_empty());
        holder.is_some_and(|h| h.secret == secret)
    }

    /// Gives control to `life`. Asking again starts its sequence numbers anew:
    /// whoever was locked out by a number that somebody else sent in its name
    /// goes on. In a sealed lease only the secret does that, and nobody else
    /// can have sent one.
    ///
    /// # Errors
    /// Who has it, and how to get it.
    pub fn ask(&mut self, life: Life, asked: &Asked, now: Instant) -> Result<Granted, Denied> {
        let known = self.knows(&asked.secret);
        let granted = match &mut self.holder {
            None => Granted::Free,
            Some(holder) if holder.life == life => {
                if known || !holder.sealed {
                    holder.last_sequence = None;
                }
                return Ok(Granted::Already);
            }
            Some(holder) if asked.take => Granted::From(holder.life.name.clone()),
            Some(holder) => {
                let seconds = now.saturating_duration_since(holder.since).as_secs();
                let who = match holder.life.name == life.name {
                    true => format!("another process that is named {:?} too", life.name),
                    false => format!("{:?}", holder.life.name),
                };
                let words = format!(
                    "control is held by {who}, for {seconds} s now; to take it over ask with \
                     `take` (on the command line: --take)"
                );
                return Err(Denied::new(FailureCode::ControlHeld, words));
            }
        };
        self.holder = Some(Holder {
            life,
            since: now,
            last_sequence: None,
            secret: secret(),
            sealed: asked.sealed,
        });
        Ok(granted)
    }

    /// Control of `life` ends; true when it had it.
    pub fn end(&mut self, life: &Life) -> bool {
        let held = self.is_held_by(life);
        if held {
            self.holder = None;
        }
        held
    }

    /// Gives control back; true when `life` had it.
    ///
    /// # Errors
    /// When `secret` is not the lease's: somebody else asks in its name.
    pub fn release(&mut self, life: &Life, secret: &str) -> Result<bool, Denied> {
        if self.is_held_by(life) && !self.knows(secret) {
            let words = format!(
                "control of {:?} is given back only with the secret of its lease, which came with \
                 the answer that gave it; it also ends with its token",
                life.name
            );
            return Err(Denied::new(FailureCode::Secret, words));
        }
        Ok(self.end(life))
    }
}

/// 32 hexadecimal digits that nobody can guess.
fn secret() -> String {
    use std::io::Read;
    let mut bytes = [0; 16];
    let read = std::fs::File::open("/dev/urandom").and_then(|mut file| file.read_exact(&mut bytes));
    match read {
        Ok(()) => bytes.iter().map(|byte| format!("{byte:02x}")).collect(),
        // The standard library's hasher is keyed by the same source.
        Err(_) => wheelarm_proto::keys::run_id() + &wheelarm_proto::keys::run_id(),
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

    fn asked(take: bool, sealed: bool, secret: &str) -> Asked {
        Asked {
            take,
            sealed,
            secret: secret.into(),
        }
    }

    #[test]
    fn control_has_one_holder_and_is_taken_only_explicitly() {
        let (anna, ben) = (life("anna", "1"), life("ben", "2"));
        let again = life("anna", "3");
        let (ask, take) = (asked(false, false, ""), asked(true, false, ""));
        let now = Instant::now();
        let mut lease = Lease::default();
        assert_eq!(lease.ask(anna.clone(), &ask, now), Ok(Granted::Free));
        assert_eq!(lease.ask(anna.clone(), &take, now), Ok(Granted::Already));
        let told = lease.ask(ben.clone(), &ask, now).unwrap_err().words;
        assert!(told.contains("anna") && told.contains("--take"), "{told}");
        let told = lease.ask(again, &ask, now).unwrap_err().words;
        assert!(told.contains("another process"), "{told}");
        assert_eq!(lease.release(&ben, ""), Ok(false), "it had nothing");
        let taken = lease.ask(ben.clone(), &take, now);
        assert_eq!(taken, Ok(Granted::From("anna".into())));
        assert!(!lease.end(&anna), "it had lost control before");
        assert!(lease.end(&ben));
        assert_eq!(lease.holder(), None);
    }

    #[test]
    fn control_is_given_back_only_by_who_knows_the_secret() {
        let anna = life("anna", "1");
        let mut lease = Lease::default();
        assert!(!lease.knows(""), "nobody is in control");
        lease
            .ask(anna.clone(), &Asked::default(), Instant::now())
            .unwrap();
        let secret = lease.holder().unwrap().secret.clone();
        assert_eq!(secret.len(), 32);
        for wrong in ["", "0", &"0".repeat(32)] {
            let told = lease.release(&anna, wrong).unwrap_err().words;
            assert!(told.contains("secret"), "{told}");
        }
        assert_eq!(lease.release(&anna, &secret), Ok(true));
        lease.ask(anna, &Asked::default(), Instant::now()).unwrap();
        assert_ne!(lease.holder().unwrap().secret, secret, "a new lease");
    }

    #[test]
    fn asking_again_starts_the_sequence_numbers_anew() {
        let anna = life("anna", "1");
        let now = Instant::now();
        let mut lease = Lease::default();
        for sealed in [false, true] {
            let ask = asked(false, sealed, "");
            lease.ask(anna.clone(), &ask, now).unwrap();
            let secret = lease.holder().unwrap().secret.clone();
            lease.holder_mut().unwrap().last_sequence = Some(7);
            lease.ask(anna.clone(), &ask, now).unwrap();
            // In a sealed lease a stranger who asks in its name changes nothing.
            let left = lease.holder().unwrap().last_sequence;
            assert_eq!(left, sealed.then_some(7));
            lease
                .ask(anna.clone(), &asked(false, sealed, &secret), now)
                .unwrap();
            assert_eq!(lease.holder().unwrap().last_sequence, None);
            lease.end(&anna);
        }
    }
}
