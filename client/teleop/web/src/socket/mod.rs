//! One WebSocket: its first message, its limits, its end.

mod control;
mod state;
mod video;

use std::sync::Arc;
use std::time::{Duration, Instant};

use hyper::upgrade::Upgraded;

use crate::hub::Event;
use crate::model::Socket;
use crate::pipe::{Close, Ends, Entered, Pipe, SIGNED_OUT, Shared, crowded};
use crate::places::Place;
use crate::protocol::{self, Hello, PROTOCOL};
use crate::registry::Full;

/// Longest wait for the first message.
const HELLO: Duration = Duration::from_secs(5);
/// Longest name of a page, bytes.
const PAGE: usize = 64;

/// Purpose of a socket, from its path.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Kind {
    /// `/ws/state`.
    State,
    /// `/ws/video`.
    Video,
    /// `/ws/control`.
    Control,
}

/// Serves a socket until it ends. `cookie` is that of its request, on the
/// connection at `place`.
pub async fn serve(
    shared: Arc<Shared>,
    kind: Kind,
    upgraded: Upgraded,
    cookie: Option<String>,
    place: Arc<Place>,
) {
    let mut pipe = Pipe::new(upgraded).await;
    let entered = tokio::select! {
        entered = enter(&shared, kind, &mut pipe, cookie.as_deref(), &place) => entered,
        () = place.over() => Err(crowded()),
    };
    let close = match entered {
        Ok(entered) => live(&shared, &mut pipe, entered).await,
        Err(close) => Some(close),
    };
    if let Some(close) = close {
        if close.code != 4409 && close.code != 1000 {
            let line = serde_json::json!({"what": "closed", "code": close.code, "text": close.why});
            shared.hub.send(Event::Audit(line));
        }
        pipe.close(close).await;
    }
}

async fn enter(
    shared: &Shared,
    kind: Kind,
    pipe: &mut Pipe,
    cookie: Option<&str>,
    place: &Arc<Place>,
) -> Result<Entered, Close> {
    let first = tokio::time::timeout(HELLO, pipe.next()).await;
    let first = first.map_err(|_| Close::new(4408, "no hello arrived within 5 s"))??;
    let text = first.ok_or_else(|| Close::new(1000, ""))?;
    let hello: Hello = protocol::read(&text).map_err(|e| Close::new(4400, e.to_string()))?;
    if hello.t != "hello" {
        return Err(Close::new(4400, "the first message is a hello"));
    }
    if hello.protocol != PROTOCOL {
        let words = format!("this gateway speaks protocol {PROTOCOL}; load the page again");
        return Err(Close::new(4426, words));
    }
    let entry = shared.sessions.enter(&hello.ticket, cookie, Instant::now());
    let (visitor, life) = entry.ok_or_else(|| {
        Close::new(
            SIGNED_OUT,
            "the ticket is unknown, used or expired; ask for another",
        )
    })?;
    let named = !hello.page.is_empty()
        && hello.page.len() <= PAGE
        && hello.page.bytes().all(|b| b.is_ascii_alphanumeric());
    if !named || hello.lane > 1 {
        return Err(Close::new(
            4400,
            "page is 1 to 64 letters and digits, lane 0 or 1",
        ));
    }
    let socket = match kind {
        Kind::State => Socket::State,
        Kind::Video => Socket::Video,
        Kind::Control if !visitor.role.may_drive() => {
            return Err(Close::new(4403, "a viewer cannot drive"));
        }
        Kind::Control => Socket::Control(hello.lane),
    };
    let opened = {
        let driving = shared.hub.driving.borrow();
        shared
            .registry
            .open(&hello.page, &visitor, socket, driving.as_deref())
    };
    let (number, registered) = opened.map_err(|full| match full {
        Full::Pages => Close::new(4429, "too many pages are open"),
        Full::Foreign => Close::new(
            SIGNED_OUT,
            "this page belongs to another user: load the page again",
        ),
    })?;
    Ok(Entered {
        page: hello.page,
        visitor,
        socket,
        number,
        ends: Ends {
            registered,
            life,
            place: Arc::clone(place),
        },
    })
}

async fn live(shared: &Arc<Shared>, pipe: &mut Pipe, entered: Entered) -> Option<Close> {
    let welcome = serde_json::json!({"t": "welcome", "protocol": PROTOCOL}).to_string();
    let (page, socket, number) = (entered.page.clone(), entered.socket, entered.number);
    let close = match pipe.say(welcome).await {
        false => None,
        true => match socket {
            Socket::State => state::serve(shared, pipe, entered).await,
            Socket::Video => video::serve(shared, pipe, entered).await,
            Socket::Control(_) => control::serve(shared, pipe, entered).await,
        },
    };
    // A session that ended must not stay in control.
    if let Some(close) = close.as_ref().filter(|close| close.code == SIGNED_OUT) {
        let gone = Event::SignedOut(page.clone(), close.why.clone());
        shared.hub.send(gone);
    }
    shared.registry.close(&page, socket, number);
    shared.hub.send(Event::Left(page, socket));
    close
}
