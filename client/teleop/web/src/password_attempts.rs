//! Limits on wrong passwords: per address, and per address and user together. User names
//! alone have no limit, so that an attacker cannot lock a user out.

use std::collections::BTreeMap;
use std::net::IpAddr;

/// Wrong passwords in [`WINDOW`]: of one user from one address, and from one address.
const MOST: [usize; 2] = [5, 20];
/// s.
const WINDOW: f64 = 60.0;
/// Most accounts that are stored; the one that was quiet longest is dropped first.
const ACCOUNTS: usize = 4096;
/// Most pairs of address and user that are stored after a right password.
const RIGHT: usize = 1024;

/// An address, and optionally a user.
type Account = (IpAddr, String);

/// Wrong passwords of the last minute.
#[derive(Debug, Default)]
pub struct PasswordAttempts {
    wrong: BTreeMap<Account, Vec<f64>>,
    /// Users that logged in from an address, and when, s. Strangers behind the same
    /// address (a tunnel, a router) do not use up their attempts.
    right: BTreeMap<Account, f64>,
}

impl PasswordAttempts {
    /// Whether `user` may try a password from an address at `now`, s.
    ///
    /// # Errors
    /// The time to wait, s.
    pub fn may(&mut self, from: IpAddr, user: &str, now: f64) -> Result<(), f64> {
        self.wrong.retain(|_, times| {
            times.retain(|at| now - at < WINDOW);
            !times.is_empty()
        });
        let [pair, address] = accounts(from, user);
        let is_known = self.right.contains_key(&pair);
        let wait = |account: &Account, most: usize| {
            let times = self.wrong.get(account)?;
            let first = times.len().checked_sub(most)?;
            Some(WINDOW - (now - times[first]))
        };
        let waits = [
            wait(&pair, MOST[0]),
            wait(&address, MOST[1]).filter(|_| !is_known),
        ];
        match waits.into_iter().flatten().max_by(f64::total_cmp) {
            Some(wait) => Err(wait.max(1.0)),
            None => Ok(()),
        }
    }

    /// A password was wrong at `now`, s.
    pub fn wrong(&mut self, from: IpAddr, user: &str, now: f64) {
        for account in accounts(from, user) {
            if self.wrong.len() >= ACCOUNTS && !self.wrong.contains_key(&account) {
                forget_first(&mut self.wrong, |times| {
                    times.last().copied().unwrap_or_default()
                });
            }
            self.wrong.entry(account).or_default().push(now);
        }
    }

    /// The password counted by [`PasswordAttempts::wrong`] at `now` was right after all.
    pub fn right(&mut self, from: IpAddr, user: &str, now: f64) {
        let accounts = accounts(from, user);
        for account in &accounts {
            if let Some(times) = self.wrong.get_mut(account)
                && let Some(at) = times.iter().position(|at| *at == now)
            {
                times.remove(at);
            }
        }
        let [pair, _] = accounts;
        if self.right.len() >= RIGHT && !self.right.contains_key(&pair) {
            forget_first(&mut self.right, |at| *at);
        }
        self.right.insert(pair, now);
    }
}

fn forget_first<T>(all: &mut BTreeMap<Account, T>, at: impl Fn(&T) -> f64) {
    let first = all.iter().min_by(|a, b| at(a.1).total_cmp(&at(b.1)));
    if let Some(account) = first.map(|(account, _)| account.clone()) {
        all.remove(&account);
    }
}

/// The accounts of the pair and of the address alone.
fn accounts(from: IpAddr, user: &str) -> [Account; 2] {
    let from = network(from);
    [(from, user.to_owned()), (from, String::new())]
}

/// The address, or the /64 of an IPv6 address: one host has a whole /64.
pub fn network(address: IpAddr) -> IpAddr {
    match address.to_canonical() {
        IpAddr::V6(ip) => IpAddr::V6((ip.to_bits() & (u128::MAX << 64)).into()),
        ip @ IpAddr::V4(_) => ip,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn ip(n: u32) -> IpAddr {
        IpAddr::V4((0x0a00_0000 + n).into())
    }

    #[test]
    fn five_wrong_passwords_a_minute_of_one_user_from_one_address() {
        let mut attempts = PasswordAttempts::default();
        for i in 0..5 {
            assert_eq!(attempts.may(ip(1), "anna", f64::from(i)), Ok(()));
            attempts.wrong(ip(1), "anna", f64::from(i));
        }
        assert_eq!(attempts.may(ip(1), "anna", 5.0), Err(55.0));
        assert_eq!(attempts.may(ip(1), "anna", 61.0), Ok(()));
        attempts.wrong(ip(9), "zoe", 4.0);
        attempts.right(ip(9), "zoe", 4.0);
        assert_eq!(attempts.may(ip(9), "zoe", 5.0), Ok(()));
    }

    #[test]
    fn wrong_passwords_from_elsewhere_lock_no_user_out() {
        let mut attempts = PasswordAttempts::default();
        for i in 0..400 {
            attempts.wrong(ip(i % 40), "anna", f64::from(i) * 0.1);
        }
        assert!(attempts.may(ip(3), "anna", 40.0).is_err());
        assert_eq!(attempts.may(ip(77), "anna", 40.0), Ok(()));
    }

    #[test]
    fn strangers_behind_the_same_address_do_not_lock_out_a_user_who_logged_in_before() {
        let mut attempts = PasswordAttempts::default();
        attempts.wrong(ip(1), "anna", 0.0);
        attempts.right(ip(1), "anna", 0.0);
        for i in 0..30 {
            attempts.wrong(ip(1), &format!("guess{i}"), 1.0);
        }
        assert!(attempts.may(ip(1), "ben", 2.0).is_err(), "unknown there");
        assert_eq!(attempts.may(ip(1), "anna", 2.0), Ok(()));
    }

    #[test]
    fn a_full_table_rejects_no_user_and_does_not_grow() {
        let mut attempts = PasswordAttempts::default();
        for i in 0..10_000 {
            attempts.wrong(ip(i), &format!("user{i}"), 100.0);
        }
        assert!(attempts.wrong.len() <= ACCOUNTS);
        assert_eq!(attempts.may(ip(99_999), "anna", 101.0), Ok(()));
        for i in 0..5000 {
            attempts.right(ip(i), "anna", 101.0);
        }
        assert!(attempts.right.len() <= RIGHT);
    }

    #[test]
    fn addresses_of_one_ipv6_network_count_as_one() {
        let mut attempts = PasswordAttempts::default();
        let ip = |text: &str| -> IpAddr { text.parse().unwrap() };
        for i in 0..5 {
            attempts.wrong(ip(&format!("2001:db8::{i}")), "anna", 0.0);
        }
        assert!(attempts.may(ip("2001:db8::ffff"), "anna", 1.0).is_err());
        assert!(attempts.may(ip("2001:db8:0:1::1"), "anna", 1.0).is_ok());
    }
}
