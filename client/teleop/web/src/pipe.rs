//! Shared code of the sockets of a page: common state, reading, writing and close
//! codes.

use std::sync::Arc;
use std::time::{Duration, Instant};

use futures_util::{SinkExt, StreamExt};
use hyper::upgrade::Upgraded;
use hyper_util::rt::TokioIo;
use tokio_tungstenite::WebSocketStream;
use tokio_tungstenite::tungstenite::protocol::frame::coding::CloseCode;
use tokio_tungstenite::tungstenite::protocol::{CloseFrame, Role, WebSocketConfig};
use tokio_tungstenite::tungstenite::{Error, Message};

use crate::feed::Feeds;
use crate::hub::Hub;
use crate::model::Socket;
use crate::places::Place;
use crate::protocol::MOST_BYTES;
use crate::rate::Allowance;
use crate::registry::{Evicted, Registry};
use crate::session::{Life, Sessions};
use crate::visitor::Visitor;

/// Longest wait for a page that does not read.
const PATIENCE: Duration = Duration::from_secs(10);

/// State that all sockets share.
pub struct Shared {
    /// The hub.
    pub hub: Hub,
    /// Images.
    pub feeds: Feeds,
    /// Signed-in users.
    pub sessions: Sessions,
    /// Open sockets.
    pub registry: Registry,
}

/// Reason for closing a socket, with its code.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct Close {
    pub(crate) code: u16,
    pub(crate) why: String,
}

impl Close {
    pub(crate) fn new(code: u16, why: impl Into<String>) -> Self {
        let why = why.into();
        Self { code, why }
    }
}

/// An open socket of a page.
pub(crate) struct Pipe {
    stream: WebSocketStream<TokioIo<Upgraded>>,
    allowance: Allowance,
    began: Instant,
}

impl Pipe {
    pub(crate) async fn new(upgraded: Upgraded) -> Self {
        let config = WebSocketConfig::default()
            .read_buffer_size(8 << 10)
            .write_buffer_size(0)
            .max_write_buffer_size(4 << 20)
            .max_message_size(Some(MOST_BYTES))
            .max_frame_size(Some(MOST_BYTES));
        let io = TokioIo::new(upgraded);
        Self {
            stream: WebSocketStream::from_raw_socket(io, Role::Server, Some(config)).await,
            allowance: Allowance::new(0.0),
            began: Instant::now(),
        }
    }

    /// The next text; `None` at the end of the socket.
    ///
    /// # Errors
    /// [`Close`] when the page breaks a limit.
    pub(crate) async fn next(&mut self) -> Result<Option<String>, Close> {
        loop {
            let message = match self.stream.next().await {
                Some(Ok(message)) => message,
                Some(Err(Error::Capacity(_))) => {
                    let words = format!("a message has at most {MOST_BYTES} bytes");
                    return Err(Close::new(4400, words));
                }
                Some(Err(_)) | None => return Ok(None),
            };
            if !self.allowance.take(self.began.elapsed().as_secs_f64()) {
                return Err(Close::new(
                    4429,
                    "too many messages; 100 a second are taken",
                ));
            }
            match message {
                Message::Text(text) => return Ok(Some(text.as_str().to_owned())),
                Message::Close(_) => return Ok(None),
                Message::Binary(_) => return Err(Close::new(4400, "messages are text")),
                Message::Ping(_) | Message::Pong(_) | Message::Frame(_) => {}
            }
        }
    }

    /// Sends; false when the page is gone or does not read.
    pub(crate) async fn send(&mut self, message: Message) -> bool {
        let sent = tokio::time::timeout(PATIENCE, self.stream.send(message)).await;
        matches!(sent, Ok(Ok(())))
    }

    /// Sends text.
    pub(crate) async fn say(&mut self, text: String) -> bool {
        self.send(Message::Text(text.into())).await
    }

    pub(crate) async fn close(mut self, close: Close) {
        let mut why = close.why;
        // A close reason has at most 123 bytes.
        while why.len() > 120 {
            why.pop();
        }
        let frame = CloseFrame {
            code: CloseCode::from(close.code),
            reason: why.into(),
        };
        let closing = async {
            let _ = self.stream.close(Some(frame)).await;
            // The page answers with its own close frame.
            while let Some(Ok(_)) = self.stream.next().await {}
        };
        let _ = tokio::time::timeout(Duration::from_secs(1), closing).await;
    }
}

/// An admitted socket.
pub(crate) struct Entered {
    pub(crate) page: String,
    pub(crate) visitor: Visitor,
    pub(crate) socket: Socket,
    pub(crate) number: u64,
    pub(crate) ends: Ends,
}

/// Close code of a socket whose session ended: its page loses control at once.
pub(crate) const SIGNED_OUT: u16 = 4401;

/// Reasons for the gateway to close a socket.
pub(crate) struct Ends {
    pub(crate) registered: tokio::sync::oneshot::Receiver<Evicted>,
    pub(crate) life: Life,
    pub(crate) place: Arc<Place>,
}

impl Ends {
    /// Waits until the socket must close.
    pub(crate) async fn close(&mut self) -> Close {
        tokio::select! {
            biased;
            why = self.life.over() => Close::new(SIGNED_OUT, why),
            ended = &mut self.registered => match ended {
                Ok(Evicted) => Close::new(4429, "a newer page of yours took the place of this one"),
                Err(_) => Close::new(4409, "this page opened the same socket anew"),
            },
            () = self.place.over() => crowded(),
        }
    }
}

/// The socket is closed in favor of others.
pub(crate) fn crowded() -> Close {
    Close::new(4429, "too many connections are open")
}
