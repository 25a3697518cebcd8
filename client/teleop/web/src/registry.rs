//! Open sockets: one of each kind per page, and a bounded number of pages. Pages that may
//! drive and pages that only watch are counted separately.

use std::collections::BTreeMap;

use parking_lot::Mutex;
use tokio::sync::oneshot;

use crate::model::Socket;
use crate::visitor::Visitor;

/// Most pages of viewers at a time.
const VIEWERS: usize = 32;
/// Most pages at a time of those who may drive, and of one of them.
const DRIVERS: [usize; 2] = [16, 6];

/// Another page replaced the page of this socket. Without this reason a newer socket
/// of the same page replaced it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Evicted;

struct Open {
    number: u64,
    /// Ends the socket; dropped when a newer one replaces it.
    ended: oneshot::Sender<Evicted>,
}

struct Page {
    visitor: Visitor,
    /// Number of the socket that opened the page.
    since: u64,
    sockets: BTreeMap<Socket, Open>,
}

#[derive(Default)]
struct Pages {
    pages: BTreeMap<String, Page>,
    count: u64,
}

impl Pages {
    /// Makes room for another page of `visitor`; the page that drives keeps its place.
    fn make_room(&mut self, visitor: &Visitor, driving: Option<&str>) -> Result<(), Full> {
        let drives = visitor.role.may_drive();
        let most = if drives { DRIVERS[0] } else { VIEWERS };
        let same_kind = |page: &Page| page.visitor.role.may_drive() == drives;
        let mut shares: BTreeMap<&Visitor, usize> = BTreeMap::new();
        for page in self.pages.values().filter(|page| same_kind(page)) {
            *shares.entry(&page.visitor).or_default() += 1;
        }
        let own = shares.get(visitor).copied().unwrap_or_default();
        let all: usize = shares.values().sum();
        let loser = if drives && own >= DRIVERS[1] {
            visitor.clone()
        } else if all < most {
            return Ok(());
        } else {
            let largest = shares.iter().max_by_key(|(_, share)| **share);
            match largest {
                Some((other, share)) if *share > own + 1 => (*other).clone(),
                // A page that vanished without a close must not lock a driver out.
                _ if drives && own > 0 => visitor.clone(),
                _ => return Err(Full::Pages),
            }
        };
        let mut theirs: Vec<_> = self.pages.iter().collect();
        theirs.retain(|(name, p)| p.visitor == loser && Some(name.as_str()) != driving);
        let theirs = theirs.into_iter();
        let oldest = theirs.min_by_key(|(_, page)| page.since);
        if let Some(name) = oldest.map(|(name, _)| name.clone())
            && let Some(page) = self.pages.remove(&name)
        {
            for open in page.sockets.into_values() {
                // A socket that is already closed needs no reason.
                let _ = open.ended.send(Evicted);
            }
        }
        Ok(())
    }
}

/// The open sockets.
#[derive(Default)]
pub struct Registry {
    pages: Mutex<Pages>,
}

/// Reason for rejecting a socket.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Full {
    /// The limit of pages is reached.
    Pages,
    /// The page belongs to another visitor.
    Foreign,
}

impl Registry {
    /// Opens a socket: its number, and the signal that ends it. A visitor with too many
    /// pages loses its oldest, but never the one that is `driving`.
    ///
    /// # Errors
    /// [`Full`].
    pub fn open(
        &self,
        page: &str,
        visitor: &Visitor,
        socket: Socket,
        driving: Option<&str>,
    ) -> Result<(u64, oneshot::Receiver<Evicted>), Full> {
        let mut all = self.pages.lock();
        all.count += 1;
        let number = all.count;
        match all.pages.get(page) {
            Some(known) if known.visitor != *visitor => return Err(Full::Foreign),
            Some(_) => {}
            None => all.make_room(visitor, driving)?,
        }
        let known = all.pages.entry(page.to_owned()).or_insert_with(|| Page {
            visitor: visitor.clone(),
            since: number,
            sockets: BTreeMap::new(),
        });
        let (ended, ends) = oneshot::channel();
        known.sockets.insert(socket, Open { number, ended });
        Ok((number, ends))
    }

    /// A socket was closed.
    pub fn close(&self, page: &str, socket: Socket, number: u64) {
        let mut all = self.pages.lock();
        let Some(known) = all.pages.get_mut(page) else {
            return;
        };
        if known
            .sockets
            .get(&socket)
            .is_some_and(|open| open.number == number)
        {
            known.sockets.remove(&socket);
        }
        if known.sockets.is_empty() {
            all.pages.remove(page);
        }
    }
}

#[cfg(test)]
mod tests {
    use tokio::sync::oneshot::error::TryRecvError;

    use super::*;
    use crate::visitor::Role;

    fn visitor(name: &str, role: Role) -> Visitor {
        Visitor {
            name: name.to_owned(),
            role,
        }
    }

    #[test]
    fn a_newer_socket_ends_the_older_and_a_page_has_one_visitor() {
        let registry = Registry::default();
        let anna = visitor("anna", Role::Viewer);
        let (first, mut ended) = registry.open("p", &anna, Socket::State, None).unwrap();
        assert_eq!(ended.try_recv(), Err(TryRecvError::Empty));
        let (second, mut kept) = registry.open("p", &anna, Socket::State, None).unwrap();
        assert_eq!(ended.try_recv(), Err(TryRecvError::Closed));
        // The older one's end does not end the newer one.
        registry.close("p", Socket::State, first);
        assert_eq!(kept.try_recv(), Err(TryRecvError::Empty));
        let ben = visitor("ben", Role::Viewer);
        let foreign = registry.open("p", &ben, Socket::Video, None);
        assert_eq!(foreign.err(), Some(Full::Foreign));
        registry.close("p", Socket::State, second);
        assert!(registry.open("p", &ben, Socket::Video, None).is_ok());
    }

    #[test]
    fn pages_of_viewers_do_not_block_a_driver() {
        let registry = Registry::default();
        let (viewer, anna) = (
            visitor("viewer", Role::Viewer),
            visitor("anna", Role::Operator),
        );
        let open =
            |page: String, visitor: &Visitor| registry.open(&page, visitor, Socket::State, None);
        let kept: Vec<_> = (0..VIEWERS)
            .map(|i| open(format!("v{i}"), &viewer))
            .collect();
        assert!(kept.iter().all(Result::is_ok));
        assert_eq!(open("v".to_owned(), &viewer).err(), Some(Full::Pages));
        assert!(open("a".to_owned(), &anna).is_ok());
        // A viewer with many pages makes room for another viewer, by its oldest.
        let mut kept: Vec<_> = kept.into_iter().map(Result::unwrap).collect();
        assert!(open("c".to_owned(), &visitor("carl", Role::Viewer)).is_ok());
        assert_eq!(kept[0].1.try_recv(), Ok(Evicted));
        assert_eq!(kept[1].1.try_recv(), Err(TryRecvError::Empty));
    }

    #[test]
    fn a_driver_with_too_many_pages_loses_the_oldest_and_no_other_driver_does() {
        let registry = Registry::default();
        let (anna, ben) = (
            visitor("anna", Role::Operator),
            visitor("ben", Role::Operator),
        );
        let open =
            |page: &str, visitor| registry.open(page, visitor, Socket::State, None).unwrap().1;
        let mut bens = open("b", &ben);
        let mut first = open("a", &anna);
        for i in 0..100 {
            open(&format!("a{i}"), &anna);
        }
        assert_eq!(first.try_recv(), Ok(Evicted));
        let (_, mut driving) = registry.open("d", &anna, Socket::State, None).unwrap();
        for i in 0..100 {
            let page = format!("d{i}");
            let _ = registry.open(&page, &anna, Socket::State, Some("d"));
        }
        assert_eq!(driving.try_recv(), Err(TryRecvError::Empty));
        assert_eq!(bens.try_recv(), Err(TryRecvError::Empty));
        let pages = registry.pages.lock().pages.len();
        assert_eq!(pages, 1 + DRIVERS[1]);
    }
}
