//! How often somebody may try a password: so many wrong ones a minute from one
//! address, and for one user.

use std::collections::BTreeMap;

/// Wrong passwords in [`WINDOW`].
const MOST: usize = 5;
/// s.
const WINDOW: f64 = 60.0;
/// Addresses and users that are told apart; more share one account.
const TOLD_APART: usize = 4096;

/// Wrong passwords, by who tried and for whom.
#[derive(Debug, Default)]
pub struct Tries {
    wrong: BTreeMap<String, Vec<f64>>,
}

impl Tries {
    /// Whether somebody may try at `now`, s; else for how long not, s.
    ///
    /// # Errors
    /// The time to wait, s.
    pub fn may(&mut self, keys: &[String], now: f64) -> Result<(), f64> {
        self.wrong.retain(|_, times| {
            times.retain(|at| now - at < WINDOW);
            !times.is_empty()
        });
        let waits = keys.iter().filter_map(|key| {
            let times = self.wrong.get(self.account(key))?;
            let first = times.len().checked_sub(MOST)?;
            Some(WINDOW - (now - times[first]))
        });
        match waits.max_by(f64::total_cmp) {
            Some(wait) => Err(wait.max(1.0)),
            None => Ok(()),
        }
    }

    /// A password was wrong at `now`, s.
    pub fn wrong(&mut self, keys: &[String], now: f64) {
        for key in keys {
            let account = self.account(key).to_owned();
            self.wrong.entry(account).or_default().push(now);
        }
    }

    /// The password of [`Tries::wrong`] at `now` was right after all.
    pub fn right(&mut self, keys: &[String], now: f64) {
        for key in keys {
            let account = self.account(key).to_owned();
            if let Some(times) = self.wrong.get_mut(&account)
                && let Some(at) = times.iter().position(|at| *at == now)
            {
                times.remove(at);
            }
        }
    }

    fn account<'a>(&self, key: &'a str) -> &'a str {
        let is_full = self.wrong.len() >= TOLD_APART || self.wrong.contains_key("");
        match is_full && !self.wrong.contains_key(key) {
            true => "",
            false => key,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn five_wrong_passwords_a_minute_and_no_more() {
        let mut tries = Tries::default();
        let from =
            |address: &str, user: &str| vec![format!("from {address}"), format!("for {user}")];
        for i in 0..5 {
            assert_eq!(tries.may(&from("1.2.3.4", "anna"), f64::from(i)), Ok(()));
            tries.wrong(&from("1.2.3.4", "anna"), f64::from(i));
        }
        tries.wrong(&from("9.9.9.9", "zoe"), 4.0);
        tries.right(&from("9.9.9.9", "zoe"), 4.0);
        assert_eq!(tries.may(&from("9.9.9.9", "zoe"), 5.0), Ok(()));
        // From this address for anybody, and for this user from anywhere.
        assert_eq!(tries.may(&from("1.2.3.4", "ben"), 5.0), Err(55.0));
        assert_eq!(tries.may(&from("5.6.7.8", "anna"), 5.0), Err(55.0));
        assert_eq!(tries.may(&from("5.6.7.8", "ben"), 5.0), Ok(()));
        assert_eq!(tries.may(&from("1.2.3.4", "anna"), 61.0), Ok(()));
        // However many addresses there are, little is remembered.
        for i in 0..10_000 {
            tries.wrong(&[format!("from {i}")], 100.0);
        }
        assert!(tries.wrong.len() <= TOLD_APART + 1);
        assert!(tries.may(&["from 99999".to_owned()], 101.0).is_err());
    }
}
