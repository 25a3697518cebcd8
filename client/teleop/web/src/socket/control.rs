//! A control socket: intents, which arrive on two lanes.

use crate::hub::Event;
use crate::pipe::{Close, Entered, Pipe, Shared};
use crate::protocol::Intent;

/// Serves the socket until it ends; returns the close reason, if there is one.
pub(super) async fn serve(shared: &Shared, pipe: &mut Pipe, entered: Entered) -> Option<Close> {
    let mut ends = entered.ends;
    let joined = Event::Joined(entered.page.clone(), entered.visitor, entered.socket, None);
    shared.hub.send(joined);
    loop {
        let next = tokio::select! {
            biased;
            close = ends.close() => return Some(close),
            next = pipe.next() => next,
        };
        let text = match next {
            Ok(Some(text)) => text,
            Ok(None) => return None,
            Err(close) => return Some(close),
        };
        match Intent::read(&text) {
            Ok(Some(intent)) => shared.hub.send(Event::Intent(entered.page.clone(), intent)),
            Ok(None) => {}
            Err(why) => return Some(Close::new(4400, why.to_string())),
        }
    }
}
