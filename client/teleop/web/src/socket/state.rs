//! A state socket: reports ten times a second, answers and notes at once, requests.

use tokio::sync::{mpsc, watch as latest};

use crate::hub::{Event, Outlet};
use crate::pipe::{Close, Entered, Pipe, Shared};
use crate::protocol::{self, Request};

/// Messages that may wait for a page that reads slowly.
const WAITING: usize = 64;

/// Serves the socket until it ends; returns the close reason, if there is one.
pub(super) async fn serve(shared: &Shared, pipe: &mut Pipe, entered: Entered) -> Option<Close> {
    let mut ends = entered.ends;
    let (messages, mut waiting) = mpsc::channel(WAITING);
    let (report, mut reports) = latest::channel(String::new());
    reports.mark_unchanged();
    let outlet = Outlet { messages, report };
    let page = entered.page;
    let joined = Event::Joined(page.clone(), entered.visitor, entered.socket, Some(outlet));
    shared.hub.send(joined);
    loop {
        let text = tokio::select! {
            biased;
            close = ends.close() => return Some(close),
            message = waiting.recv() => match message {
                Some(message) => message,
                None => return Some(Close::new(4429, "this page does not read")),
            },
            next = pipe.next() => {
                let text = match next {
                    Ok(Some(text)) => text,
                    Ok(None) => return None,
                    Err(close) => return Some(close),
                };
                match protocol::read::<Request>(&text) {
                    Ok(request) => shared.hub.send(Event::Request(page.clone(), request)),
                    Err(why) => return Some(Close::new(4400, why.to_string())),
                }
                continue;
            }
            changed = reports.changed() => match changed {
                Ok(()) => reports.borrow_and_update().clone(),
                Err(_) => return Some(Close::new(1001, "the gateway ends")),
            },
        };
        if !pipe.say(text).await {
            return None;
        }
    }
}
