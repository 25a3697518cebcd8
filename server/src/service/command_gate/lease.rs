//! The lease on control: one commander process holds it at a time.
//!
//! A commander is identified by its name and the run ID of its process. Its liveliness
//! token exists while it holds control; the caller has checked that before.

use wheelarm_proto::v1::FailureCode;

use crate::service::denied::Denied;
use std::time::Instant;

/// One process of a commander.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub struct Life {
    /// Name of the commander.
    pub name: String,
    /// ID of its process run.
    pub run_id: String,
}

/// The commander that holds control.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Holder {
    /// Name and run.
    pub life: Life,
    /// When it received control.
    pub since: Instant,
    /// Sequence number of its newest command.
    pub last_sequence: Option<u64>,
    /// Secret of the lease, known only to the holder.
    pub secret: String,
    /// Whether its commands carry a seal.
    pub sealed: bool,
}

/// A request for control.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct ControlRequest {
    /// Take control over from the current holder.
    pub take: bool,
    /// The client will seal its commands.
    pub sealed: bool,
    /// Secret of the lease that the client believes it holds.
    pub secret: String,
}

/// Result of a request for control.
#[derive(Debug, PartialEq, Eq)]
pub enum Granted {
    /// The client already held control.
    Already,
    /// No client held control.
    Free,
    /// Taken over from this commander.
    From(String),
}

/// The lease on control.
#[derive(Debug, Default)]
pub struct Lease {
    holder: Option<Holder>,
}

impl Lease {
    /// The holder of control.
    #[must_use]
    pub fn holder(&self) -> Option<&Holder> {
        self.holder.as_ref()
    }

    /// The holder of control, to record what it sends.
    pub fn holder_mut(&mut self) -> Option<&mut Holder> {
        self.holder.as_mut()
    }

    /// Whether `life` holds control.
    #[must_use]
    pub fn is_held_by(&self, life: &Life) -> bool {
        self.holder.as_ref().is_some_and(|h| h.life == *life)
    }

    /// Whether `secret` is the holder's.
    #[must_use]
    pub fn knows(&self, secret: &str) -> bool {
        // An empty secret never matches.
        let holder = self.holder.as_ref().filter(|_| !secret.is_empty());
        holder.is_some_and(|h| h.secret == secret)
    }

    /// Gives control to `life`. A repeated request restarts its sequence numbers, so
    /// that a forged number cannot block the holder. In a sealed lease only a request
    /// with the secret does that; there numbers cannot be forged.
    ///
    /// # Errors
    /// The current holder, and how to take control over.
    pub fn request(
        &mut self,
        life: Life,
        request: &ControlRequest,
        now: Instant,
    ) -> Result<Granted, Denied> {
        let known = self.knows(&request.secret);
        let granted = match &mut self.holder {
            None => Granted::Free,
            Some(holder) if holder.life == life => {
                if known || !holder.sealed {
                    holder.last_sequence = None;
                }
                return Ok(Granted::Already);
            }
            Some(holder) if request.take => Granted::From(holder.life.name.clone()),
            Some(holder) => {
                let seconds = now.saturating_duration_since(holder.since).as_secs();
                let who = match holder.life.name == life.name {
                    true => format!("another process with the name {:?}", life.name),
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
            sealed: request.sealed,
        });
        Ok(granted)
    }

    /// Ends control of `life`; true when it held it.
    pub fn end(&mut self, life: &Life) -> bool {
        let held = self.is_held_by(life);
        if held {
            self.holder = None;
        }
        held
    }

    /// Releases control; true when `life` held it.
    ///
    /// # Errors
    /// When `secret` is not the lease's: another process asks in its name.
    pub fn release(&mut self, life: &Life, secret: &str) -> Result<bool, Denied> {
        if self.is_held_by(life) && !self.knows(secret) {
            let words = format!(
                "control of {:?} is released only with the secret of its lease, which is in \
                 the answer that gave it; it also ends with its token",
                life.name
            );
            return Err(Denied::new(FailureCode::Secret, words));
        }
        Ok(self.end(life))
    }
}

/// 32 random hexadecimal digits.
fn secret() -> String {
    use std::io::Read;
    let mut bytes = [0; 16];
    let read = std::fs::File::open("/dev/urandom").and_then(|mut file| file.read_exact(&mut bytes));
    match read {
        Ok(()) => bytes.iter().map(|byte| format!("{byte:02x}")).collect(),
        // The standard library's hasher is keyed from the same source.
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

    fn request(take: bool, sealed: bool, secret: &str) -> ControlRequest {
        ControlRequest {
            take,
            sealed,
            secret: secret.into(),
        }
    }

    #[test]
    fn control_has_one_holder_and_takeover_is_explicit() {
        let (anna, ben) = (life("anna", "1"), life("ben", "2"));
        let again = life("anna", "3");
        let (ask, take) = (request(false, false, ""), request(true, false, ""));
        let now = Instant::now();
        let mut lease = Lease::default();
        assert_eq!(lease.request(anna.clone(), &ask, now), Ok(Granted::Free));
        assert_eq!(
            lease.request(anna.clone(), &take, now),
            Ok(Granted::Already)
        );
        let reason = lease.request(ben.clone(), &ask, now).unwrap_err().words;
        assert!(
            reason.contains("anna") && reason.contains("--take"),
            "{reason}"
        );
        let reason = lease.request(again, &ask, now).unwrap_err().words;
        assert!(reason.contains("another process"), "{reason}");
        assert_eq!(lease.release(&ben, ""), Ok(false), "it held nothing");
        let taken = lease.request(ben.clone(), &take, now);
        assert_eq!(taken, Ok(Granted::From("anna".into())));
        assert!(!lease.end(&anna), "it had already lost control");
        assert!(lease.end(&ben));
        assert_eq!(lease.holder(), None);
    }

    #[test]
    fn control_is_released_only_with_the_secret() {
        let anna = life("anna", "1");
        let mut lease = Lease::default();
        assert!(!lease.knows(""), "no holder");
        lease
            .request(anna.clone(), &ControlRequest::default(), Instant::now())
            .unwrap();
        let secret = lease.holder().unwrap().secret.clone();
        assert_eq!(secret.len(), 32);
        for wrong in ["", "0", &"0".repeat(32)] {
            let reason = lease.release(&anna, wrong).unwrap_err().words;
            assert!(reason.contains("secret"), "{reason}");
        }
        assert_eq!(lease.release(&anna, &secret), Ok(true));
        lease
            .request(anna, &ControlRequest::default(), Instant::now())
            .unwrap();
        assert_ne!(lease.holder().unwrap().secret, secret, "a new lease");
    }

    #[test]
    fn a_repeated_request_restarts_the_sequence_numbers() {
        let anna = life("anna", "1");
        let now = Instant::now();
        let mut lease = Lease::default();
        for sealed in [false, true] {
            let ask = request(false, sealed, "");
            lease.request(anna.clone(), &ask, now).unwrap();
            let secret = lease.holder().unwrap().secret.clone();
            lease.holder_mut().unwrap().last_sequence = Some(7);
            lease.request(anna.clone(), &ask, now).unwrap();
            // In a sealed lease a request without the secret changes nothing.
            let left = lease.holder().unwrap().last_sequence;
            assert_eq!(left, sealed.then_some(7));
            lease
                .request(anna.clone(), &request(false, sealed, &secret), now)
                .unwrap();
            assert_eq!(lease.holder().unwrap().last_sequence, None);
            lease.end(&anna);
        }
    }
}
