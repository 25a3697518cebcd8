//! Which sockets are open: one of each kind of a page, and no more pages than there
//! is room for.

use std::collections::BTreeMap;

use parking_lot::Mutex;
use tokio::sync::oneshot;

use crate::model::Socket;
use crate::visitor::Visitor;

/// Most pages at a time: 32 that look and one that drives.
pub const PAGES: usize = 33;

struct Open {
    number: u64,
    /// Ends the socket, because a newer one took its place.
    _replaced: oneshot::Sender<()>,
}

struct Page {
    visitor: Visitor,
    sockets: BTreeMap<Socket, Open>,
}

#[derive(Default)]
struct Pages {
    pages: BTreeMap<String, Page>,
    count: u64,
}

/// The open sockets.
#[derive(Default)]
pub struct Registry {
    pages: Mutex<Pages>,
}

/// Why a socket is not opened.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Full {
    /// There is no room for another page.
    Pages,
    /// The page is somebody else's.
    Foreign,
}

impl Registry {
    /// Opens a socket: its number, and what ends when a newer one takes its place.
    ///
    /// # Errors
    /// [`Full`].
    pub fn open(
        &self,
        page: &str,
        visitor: &Visitor,
        socket: Socket,
    ) -> Result<(u64, oneshot::Receiver<()>), Full> {
        let mut all = self.pages.lock();
        all.count += 1;
        let number = all.count;
        let many = all.pages.len() >= PAGES;
        if many && !all.pages.contains_key(page) {
            return Err(Full::Pages);
        }
        let known = all.pages.entry(page.to_owned()).or_insert_with(|| Page {
            visitor: visitor.clone(),
            sockets: BTreeMap::new(),
        });
        if known.visitor != *visitor {
            return Err(Full::Foreign);
        }
        let (replaced, ended) = oneshot::channel();
        let open = Open {
            number,
            _replaced: replaced,
        };
        known.sockets.insert(socket, open);
        Ok((number, ended))
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
    use super::*;
    use crate::visitor::Role;

    fn visitor(name: &str) -> Visitor {
        Visitor {
            name: name.to_owned(),
            role: Role::Viewer,
        }
    }

    #[test]
    fn a_newer_socket_ends_the_older_and_there_is_room_for_so_many_pages() {
        let registry = Registry::default();
        let anna = visitor("anna");
        let (first, mut ended) = registry.open("p", &anna, Socket::State).unwrap();
        assert!(ended.try_recv() == Err(oneshot::error::TryRecvError::Empty));
        let (second, _kept) = registry.open("p", &anna, Socket::State).unwrap();
        assert!(ended.try_recv() == Err(oneshot::error::TryRecvError::Closed));
        // The older one's end does not end the newer one.
        registry.close("p", Socket::State, first);
        let foreign = registry.open("p", &visitor("ben"), Socket::Video);
        assert_eq!(foreign.err(), Some(Full::Foreign));
        let mut kept = Vec::new();
        for i in 1..PAGES {
            kept.push(
                registry
                    .open(&format!("q{i}"), &anna, Socket::State)
                    .unwrap(),
            );
        }
        let more = registry.open("more", &anna, Socket::State);
        assert_eq!(more.err(), Some(Full::Pages));
        assert!(registry.open("p", &anna, Socket::Video).is_ok());
        registry.close("q1", Socket::State, kept[0].0);
        assert!(registry.open("more", &anna, Socket::State).is_ok());
        registry.close("p", Socket::State, second);
    }
}
