//! Connections of browsers: a bounded number. A new connection is always accepted; the
//! oldest of the largest share is closed for it. Connections without a session are closed
//! first, those of drivers last.

use std::collections::BTreeMap;
use std::net::IpAddr;
use std::sync::Arc;

use parking_lot::Mutex;
use tokio::sync::watch;

use crate::password_attempts::network;
use crate::visitor::Visitor;

/// Most connections at a time, sockets included.
pub const PLACES: usize = 512;

/// Owner of a connection. Lower shares are closed first.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord)]
enum Share {
    /// No request with a session arrived yet; only the address is known.
    Address(IpAddr),
    Viewer(String),
    Driver(String),
}

impl Share {
    fn rank(&self) -> u8 {
        match self {
            Self::Address(_) => 0,
            Self::Viewer(_) => 1,
            Self::Driver(_) => 2,
        }
    }
}

struct Open {
    share: Share,
    ended: watch::Sender<bool>,
}

#[derive(Default)]
struct All {
    open: BTreeMap<u64, Open>,
    count: u64,
}

impl All {
    /// Ends the oldest connection of the largest share of the lowest rank.
    fn make_room(&mut self) {
        let mut shares: BTreeMap<&Share, usize> = BTreeMap::new();
        for open in self.open.values() {
            *shares.entry(&open.share).or_default() += 1;
        }
        let largest = shares
            .iter()
            .min_by_key(|(share, count)| (share.rank(), std::cmp::Reverse(**count)));
        let Some(share) = largest.map(|(share, _)| (*share).clone()) else {
            return;
        };
        let oldest = self.open.iter().find(|(_, open)| open.share == share);
        if let Some(number) = oldest.map(|(number, _)| *number)
            && let Some(open) = self.open.remove(&number)
        {
            open.ended.send_replace(true);
        }
    }
}

/// The open connections.
#[derive(Default)]
pub struct Places {
    all: Mutex<All>,
}

impl Places {
    /// Admits a connection; it is removed when the returned value is dropped.
    #[must_use]
    pub fn take(self: &Arc<Self>, from: IpAddr) -> Place {
        let mut all = self.all.lock();
        if all.open.len() >= PLACES {
            all.make_room();
        }
        all.count += 1;
        let number = all.count;
        let (ended, ends) = watch::channel(false);
        let share = Share::Address(network(from));
        all.open.insert(number, Open { share, ended });
        Place {
            places: Arc::clone(self),
            number,
            ends,
        }
    }
}

/// Registration of a connection.
pub struct Place {
    places: Arc<Places>,
    number: u64,
    ends: watch::Receiver<bool>,
}

impl Place {
    /// A request of this visitor arrived on it.
    pub fn belongs_to(&self, visitor: &Visitor) {
        let name = visitor.name.clone();
        let share = match visitor.role.may_drive() {
            true => Share::Driver(name),
            false => Share::Viewer(name),
        };
        if let Some(open) = self.places.all.lock().open.get_mut(&self.number) {
            open.share = share;
        }
    }

    /// Waits until the connection must end.
    pub async fn over(&self) {
        let mut ends = self.ends.clone();
        // Its sender is dropped after it sent the reason.
        let _ = ends.wait_for(|ended| *ended).await;
    }
}

impl Drop for Place {
    fn drop(&mut self) {
        self.places.all.lock().open.remove(&self.number);
    }
}

#[cfg(test)]
mod tests {
    use futures_util::FutureExt;

    use super::*;
    use crate::visitor::Role;

    fn ip(n: u8) -> IpAddr {
        IpAddr::from([10, 0, 0, n])
    }

    fn is_over(place: &Place) -> bool {
        place.over().now_or_never().is_some()
    }

    fn visitor(name: &str, role: Role) -> Visitor {
        Visitor {
            name: name.to_owned(),
            role,
        }
    }

    #[test]
    fn silent_connections_do_not_displace_a_driver() {
        let places = Arc::new(Places::default());
        let driver = places.take(ip(1));
        driver.belongs_to(&visitor("anna", Role::Operator));
        let waiting = places.take(ip(2));
        let silent: Vec<_> = (0..2 * PLACES).map(|_| places.take(ip(1))).collect();
        assert!(places.all.lock().open.len() <= PLACES);
        assert!(!is_over(&driver), "it belongs to a session");
        assert!(!is_over(&waiting), "another address");
        assert!(is_over(&silent[0]), "the oldest");
        let newest = places.take(ip(1));
        assert!(!is_over(&newest), "a new connection is always taken");
        drop(silent);
        assert_eq!(places.all.lock().open.len(), 3);
    }

    #[test]
    fn connections_of_viewers_make_room_for_those_of_drivers() {
        let places = Arc::new(Places::default());
        let (anna, veit) = (
            visitor("anna", Role::Operator),
            visitor("veit", Role::Viewer),
        );
        let take = |visitor: &Visitor| {
            let place = places.take(ip(1));
            place.belongs_to(visitor);
            place
        };
        let driver = take(&anna);
        let quiet = take(&visitor("ida", Role::Viewer));
        let greedy: Vec<_> = (0..2 * PLACES).map(|_| take(&veit)).collect();
        assert!(!is_over(&driver) && !is_over(&quiet));
        assert!(is_over(&greedy[0]));
        assert!(!is_over(&take(&anna)));
    }
}
