//! The page over HTTP: a few fixed texts, the newest picture of a camera, and
//! the state as server-sent events.
//!
//! It answers only questions that were asked by the name of this host, so that
//! a strange page in the same browser cannot read it.

use std::collections::BTreeMap;
use std::convert::Infallible;
use std::net::{IpAddr, SocketAddr};
use std::pin::Pin;
use std::sync::Arc;
use std::task::{Context, Poll};
use std::time::Duration;

use bytes::Bytes;
use http_body_util::{Either, Full};
use hyper::body::{Body, Frame, Incoming};
use hyper::header::{self, HeaderValue};
use hyper::server::conn::http1;
use hyper::service::service_fn;
use hyper::{Method, Request, Response, StatusCode};
use hyper_util::rt::{TokioIo, TokioTimer};
use parking_lot::Mutex;
use tokio::net::TcpListener;
use tokio::sync::{mpsc, watch as latest};
use wheelarm_proto::keys::check_name;

use super::feed::Feed;
use wheelarm_link::Link;

const PAGE: &str = include_str!("page.html");
const STYLE: &str = include_str!("page.css");
const SCRIPT: &str = include_str!("page.js");
const ICON: &str = r##"<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 16 16"><circle cx="7" cy="10" r="5" fill="none" stroke="#46c37b" stroke-width="2"/><path d="M7 10V2h6" fill="none" stroke="#dfe6ea" stroke-width="2"/></svg>"##;
/// Cameras that can be watched at once.
const FEEDS: usize = 8;
/// Time between two states although nothing changed: keeps proxies awake.
const BEAT: Duration = Duration::from_secs(5);
/// Longest time that a browser may take to send its question.
const QUESTION: Duration = Duration::from_secs(20);

/// Nothing from elsewhere is loaded, and nobody may frame it.
const POLICY: &str = "default-src 'none'; script-src 'self'; style-src 'self'; \
    img-src 'self' blob:; connect-src 'self'; frame-ancestors 'none'; base-uri 'none'";

type Answer = Response<Either<Full<Bytes>, Events>>;

struct Site {
    source: Source,
    address: SocketAddr,
    feeds: Mutex<BTreeMap<String, Arc<Feed>>>,
}

/// Where the page takes its pictures and its words from.
#[derive(Clone)]
pub struct Source {
    /// The connection, while there is one.
    pub link: latest::Receiver<Option<Link>>,
    /// Newest state as JSON, from [`super::state_text`].
    pub state: latest::Receiver<String>,
}

/// States on their way to one browser.
struct Events {
    states: mpsc::Receiver<Bytes>,
}

impl Body for Events {
    type Data = Bytes;
    type Error = Infallible;

    fn poll_frame(
        mut self: Pin<&mut Self>,
        context: &mut Context<'_>,
    ) -> Poll<Option<Result<Frame<Bytes>, Infallible>>> {
        self.states
            .poll_recv(context)
            .map(|state| state.map(|bytes| Ok(Frame::data(bytes))))
    }
}

/// Serves until the runtime ends.
pub async fn serve(listener: TcpListener, source: Source) {
    let Ok(address) = listener.local_addr() else {
        return;
    };
    let site = Arc::new(Site {
        source,
        address,
        feeds: Mutex::default(),
    });
    loop {
        let stream = match listener.accept().await {
            Ok((stream, _)) => stream,
            Err(error) => {
                // Too many open files, for example: it may pass.
                tracing::warn!("the preview page took no connection: {error}");
                tokio::time::sleep(Duration::from_millis(200)).await;
                continue;
            }
        };
        // Small answers must not wait for each other.
        let _ = stream.set_nodelay(true);
        let site = Arc::clone(&site);
        tokio::spawn(async move {
            let answer = service_fn(move |request| {
                let site = Arc::clone(&site);
                async move { Ok::<_, Infallible>(site.answer(request).await) }
            });
            let connection = http1::Builder::new()
                .timer(TokioTimer::new())
                .header_read_timeout(QUESTION)
                .serve_connection(TokioIo::new(stream), answer);
            // A browser that goes away is no error.
            let _ = connection.await;
        });
    }
}

fn text(kind: &'static str, text: &'static str) -> Answer {
    whole(StatusCode::OK, kind, Bytes::from_static(text.as_bytes()))
}

fn whole(status: StatusCode, kind: &'static str, body: Bytes) -> Answer {
    let mut answer = Response::new(Either::Left(Full::new(body)));
    *answer.status_mut() = status;
    let headers = answer.headers_mut();
    headers.insert(header::CONTENT_TYPE, HeaderValue::from_static(kind));
    headers.insert(header::CACHE_CONTROL, HeaderValue::from_static("no-store"));
    headers.insert(
        header::CONTENT_SECURITY_POLICY,
        HeaderValue::from_static(POLICY),
    );
    headers.insert(
        header::X_CONTENT_TYPE_OPTIONS,
        HeaderValue::from_static("nosniff"),
    );
    answer
}

fn problem(status: StatusCode, words: &str) -> Answer {
    let body = Bytes::copy_from_slice(words.as_bytes());
    whole(status, "text/plain; charset=utf-8", body)
}

/// A parameter of the question.
fn parameter<'a>(query: &'a str, name: &str) -> Option<&'a str> {
    query
        .split('&')
        .filter_map(|pair| pair.split_once('='))
        .find(|(key, _)| *key == name)
        .map(|(_, value)| value)
}

/// Whether a page may be asked for by this name.
fn known_host(host: &str, address: IpAddr) -> bool {
    // Whoever listens on every address wants to be found by any name.
    if address.is_unspecified() {
        return true;
    }
    let name = match host.strip_prefix('[') {
        Some(rest) => rest.split(']').next().unwrap_or_default(),
        None => host.split(':').next().unwrap_or_default(),
    };
    name.eq_ignore_ascii_case("localhost")
        || name
            .parse::<IpAddr>()
            .is_ok_and(|ip| ip.is_loopback() || ip == address)
}

impl Site {
    async fn answer(&self, request: Request<Incoming>) -> Answer {
        let host = request.headers().get(header::HOST);
        let host = host.and_then(|h| h.to_str().ok()).unwrap_or_default();
        if !known_host(host, self.address.ip()) {
            return problem(
                StatusCode::FORBIDDEN,
                "this page is served for http://127.0.0.1 and http://localhost only",
            );
        }
        if request.method() != Method::GET {
            return problem(StatusCode::METHOD_NOT_ALLOWED, "only GET");
        }
        let query = request.uri().query().unwrap_or_default();
        match request.uri().path() {
            "/" => text("text/html; charset=utf-8", PAGE),
            "/page.css" => text("text/css; charset=utf-8", STYLE),
            "/page.js" => text("text/javascript; charset=utf-8", SCRIPT),
            "/favicon.ico" => text("image/svg+xml", ICON),
            "/state" => self.states(),
            path => match path.strip_prefix("/camera/") {
                Some(camera) => self.picture(camera, query).await,
                None => problem(StatusCode::NOT_FOUND, "no such page"),
            },
        }
    }

    fn states(&self) -> Answer {
        // One state waits at most: a slow browser gets the newest.
        let (sender, states) = mpsc::channel(1);
        let mut state = self.source.state.clone();
        tokio::spawn(async move {
            loop {
                let text = format!("data: {}\n\n", *state.borrow_and_update());
                if sender.send(Bytes::from(text)).await.is_err() {
                    return;
                }
                if let Ok(Err(_)) = tokio::time::timeout(BEAT, state.changed()).await {
                    return;
                }
            }
        });
        let mut answer = whole(StatusCode::OK, "text/event-stream", Bytes::new());
        *answer.body_mut() = Either::Right(Events { states });
        answer
    }

    fn feed(&self, camera: &str) -> Option<Arc<Feed>> {
        check_name(camera).ok()?;
        let mut feeds = self.feeds.lock();
        if let Some(feed) = feeds.get(camera) {
            return Some(Arc::clone(feed));
        }
        if feeds.len() == FEEDS {
            return None;
        }
        let feed = Feed::open(camera, self.source.link.clone());
        feeds.insert(camera.to_owned(), Arc::clone(&feed));
        Some(feed)
    }

    async fn picture(&self, camera: &str, query: &str) -> Answer {
        let Some(feed) = self.feed(camera) else {
            return problem(StatusCode::NOT_FOUND, "no such camera, or too many");
        };
        let after = parameter(query, "after").and_then(|n| n.parse().ok());
        let viewer = parameter(query, "viewer").unwrap_or_default();
        let viewer: String = viewer.chars().take(32).collect();
        let Some(picture) = feed.next(&viewer, after.unwrap_or(0)).await else {
            return whole(StatusCode::NO_CONTENT, "image/jpeg", Bytes::new());
        };
        let mut answer = whole(StatusCode::OK, "image/jpeg", picture.jpeg.clone());
        let headers = answer.headers_mut();
        let numbers = [
            ("x-number", picture.number.to_string()),
            ("x-level", picture.level.name().to_owned()),
            ("x-time", format!("{:.3}", picture.time)),
            ("x-growth-ms", format!("{:.0}", picture.growth * 1e3)),
        ];
        for (name, value) in numbers {
            if let Ok(value) = HeaderValue::from_str(&value) {
                headers.insert(name, value);
            }
        }
        answer
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_strange_name_for_this_host_is_refused() {
        let local: IpAddr = [127, 0, 0, 1].into();
        for good in [
            "127.0.0.1:7450",
            "localhost:9999",
            "[::1]:7450",
            "LOCALHOST",
        ] {
            assert!(known_host(good, local), "{good}");
        }
        for bad in [
            "evil.example",
            "127.0.0.1.evil.example:7450",
            "",
            "10.0.0.9",
        ] {
            assert!(!known_host(bad, local), "{bad}");
        }
        assert!(known_host("lab-host:7450", [0, 0, 0, 0].into()));
    }
}
