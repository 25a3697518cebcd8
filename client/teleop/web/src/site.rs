//! The web site: the page's files, login, tickets, and the upgrade to sockets. Requests
//! of another origin, or for another name of this host, are rejected before any other
//! check.

use std::convert::Infallible;
use std::net::{IpAddr, SocketAddr};
use std::sync::Arc;
use std::time::{Duration, Instant};

use bytes::Bytes;
use http_body_util::{BodyExt, Full, Limited};
use hyper::body::Incoming;
use hyper::header::{self, HeaderMap, HeaderName, HeaderValue};
use hyper::server::conn::http1;
use hyper::service::service_fn;
use hyper::{Method, Request, Response, StatusCode};
use hyper_util::rt::{TokioIo, TokioTimer};
use parking_lot::Mutex;
use serde_json::{Value, json};
use tokio::io::{AsyncRead, AsyncWrite};
use tokio::net::{TcpListener, TcpStream};
use tokio::sync::Semaphore;
use tokio_rustls::TlsAcceptor;
use tokio_tungstenite::tungstenite::handshake::derive_accept_key;
use wheelarm_access::{User, Users};
use wheelarm_proto::keys;

use crate::files::Files;
use crate::hub::Event;
use crate::password_attempts::PasswordAttempts;
use crate::pipe::Shared;
use crate::places::{Place, Places};
use crate::protocol::{MOST_BYTES, PROTOCOL};
use crate::session::{TICKET, same};
use crate::socket::{self, Kind};
use crate::visitor::{Role, Visitor};

/// Longest time that a browser may take to send the head, or the body, of a request.
const QUESTION: Duration = Duration::from_secs(10);
/// Time between two checks for expired sessions.
const SWEEP: Duration = Duration::from_secs(5);
/// Most tickets of one request.
const TICKETS: u64 = 8;

/// Content from elsewhere is not loaded, and other sites may not frame the page.
const POLICY: &str = "default-src 'none'; script-src 'self'; style-src 'self'; \
    img-src 'self' blob: data:; connect-src 'self'; form-action 'none'; base-uri 'none'; \
    frame-ancestors 'none'";

/// Functions of the browser that the page uses.
const PERMISSIONS: &str = "gamepad=(self), microphone=(self), xr-spatial-tracking=(self)";

type Answer = Response<Full<Bytes>>;

/// A login link without a password, on this host only.
#[derive(Clone, Debug)]
pub struct Token {
    /// Token in the URL.
    pub secret: String,
    /// Visitor who logs in with it.
    pub visitor: Visitor,
}

/// Users who sign in with a password.
pub trait LogIn: Send + Sync {
    /// The role and the entry of the user with this password.
    fn verify(&self, name: &str, password: &str) -> Option<(Role, User)>;

    /// All users as they are now.
    fn users(&self) -> Arc<Users>;
}

/// The site.
pub struct Site {
    /// What the sockets share.
    pub shared: Arc<Shared>,
    /// The page's files.
    pub files: Files,
    /// Where it listens.
    pub address: SocketAddr,
    /// Login links.
    pub tokens: Vec<Token>,
    /// Visitor as whom every user is admitted without login, if set.
    pub everybody: Option<Visitor>,
    /// Users with passwords, if there are any.
    pub users: Option<Arc<dyn LogIn>>,
    /// TLS, if enabled.
    pub tls: Option<TlsAcceptor>,
    /// Names of this host, beside those of the loopback interface.
    pub names: Vec<String>,
    /// Wrong passwords.
    pub attempts: Mutex<PasswordAttempts>,
    /// One password is verified at a time: the hash is expensive by design.
    pub gate: Semaphore,
    /// Zero of the clock of `tries`.
    pub began: Instant,
}

/// Serves until the runtime ends.
pub async fn serve(listener: TcpListener, site: Arc<Site>) {
    let places = Arc::new(Places::default());
    tokio::join!(accept(&listener, &site, &places), sweep(&site));
}

async fn accept(listener: &TcpListener, site: &Arc<Site>, places: &Arc<Places>) {
    loop {
        let (stream, from) = match listener.accept().await {
            Ok(accepted) => accepted,
            Err(error) => {
                // For example too many open files: this may pass.
                tracing::warn!("the page took no connection: {error}");
                tokio::time::sleep(Duration::from_millis(200)).await;
                continue;
            }
        };
        tune(&stream);
        let site = Arc::clone(site);
        let place = Arc::new(places.take(from.ip()));
        tokio::spawn(async move {
            let talked = async {
                match site.tls.clone() {
                    None => talk(&site, stream, from, &place).await,
                    Some(tls) => {
                        // A client without TLS, or with an old version, is disconnected.
                        let met = tokio::time::timeout(QUESTION, tls.accept(stream)).await;
                        if let Ok(Ok(stream)) = met {
                            talk(&site, stream, from, &place).await;
                        }
                    }
                }
            };
            tokio::select! {
                () = talked => {}
                // The connection is closed in favor of a newer one.
                () = place.over() => {}
            }
        });
    }
}

/// Removes expired sessions, and with them their sockets.
async fn sweep(site: &Site) {
    loop {
        tokio::time::sleep(SWEEP).await;
        site.shared.sessions.sweep(Instant::now());
    }
}

/// Serves the requests of one connection.
async fn talk<S>(site: &Arc<Site>, stream: S, from: SocketAddr, place: &Arc<Place>)
where
    S: AsyncRead + AsyncWrite + Unpin + Send + 'static,
{
    let (site, place) = (Arc::clone(site), Arc::clone(place));
    let answer = service_fn(move |request| {
        let (site, place) = (Arc::clone(&site), Arc::clone(&place));
        async move { Ok::<_, Infallible>(site.answer(request, from, &place).await) }
    });
    let connection = http1::Builder::new()
        .timer(TokioTimer::new())
        .header_read_timeout(QUESTION)
        .max_buf_size(16 << 10)
        .serve_connection(TokioIo::new(stream), answer)
        .with_upgrades();
    // A browser that disconnects is not an error.
    let _ = connection.await;
}

/// Socket options: no delay for small messages, few unsent bytes in the kernel, and a
/// congestion control that tolerates loss, where the host allows.
fn tune(stream: &TcpStream) {
    let _ = stream.set_nodelay(true);
    let socket = socket2::SockRef::from(stream);
    let _ = socket.set_tcp_notsent_lowat(16 << 10);
    let _ = socket.set_tcp_congestion(b"bbr");
}

impl Site {
    async fn answer(
        &self,
        request: Request<Incoming>,
        from: SocketAddr,
        place: &Arc<Place>,
    ) -> Answer {
        let host = text(request.headers(), &header::HOST);
        if !self.is_known(host) {
            let words = "this page is served for the name of this host only: open the address that `wheelarm drive` printed";
            return problem(StatusCode::FORBIDDEN, words);
        }
        if let Some((_, visitor)) = self.visitor(request.headers()) {
            place.belongs_to(&visitor);
        }
        let path = request.uri().path().to_owned();
        match (request.method().clone(), path.as_str()) {
            (Method::GET, "/ws/state") => self.upgrade(request, Kind::State, place),
            (Method::GET, "/ws/video") => self.upgrade(request, Kind::Video, place),
            (Method::GET, "/ws/control") => self.upgrade(request, Kind::Control, place),
            (Method::GET, "/session") => self.session(request.headers()),
            (Method::GET, "/situation") => self.situation(request.headers()).await,
            (Method::GET, "/") if request.uri().query().is_some_and(|q| q.contains("token=")) => {
                self.token(request.headers(), request.uri().query().unwrap_or_default())
            }
            (Method::GET, "/") if self.visitor(request.headers()).is_none() => {
                match &self.everybody {
                    Some(visitor) => self.let_in(self.file("/"), visitor, None),
                    None => self.file("/"),
                }
            }
            (Method::GET, path) => self.file(path),
            (Method::POST, path) => {
                let path = path.to_owned();
                self.post(&path, request, from).await
            }
            _ => problem(StatusCode::METHOD_NOT_ALLOWED, "only GET and POST"),
        }
    }

    /// Whether the page may be requested by this host name.
    fn is_known(&self, host: &str) -> bool {
        known_host(host, self.address, &self.names)
    }

    /// The origin that a browser names for a page that it got by this `Host`.
    fn is_own_origin(&self, headers: &HeaderMap) -> bool {
        let (origin, host) = (text(headers, &header::ORIGIN), text(headers, &header::HOST));
        let scheme = match self.tls {
            Some(_) => "https://",
            None => "http://",
        };
        origin.strip_prefix(scheme) == Some(host)
    }

    fn cookie_name(&self) -> String {
        // Cookies are shared between ports, but several gateways may run on this host.
        match self.tls {
            Some(_) => format!("__Host-wheelarm-{}", self.address.port()),
            None => format!("wheelarm-{}", self.address.port()),
        }
    }

    fn cookie<'a>(&self, headers: &'a HeaderMap) -> Option<&'a str> {
        let name = self.cookie_name();
        let cookies = headers.get_all(header::COOKIE).iter();
        let pairs = cookies
            .filter_map(|c| c.to_str().ok())
            .flat_map(|c| c.split(';'));
        let mut pairs = pairs.filter_map(|pair| pair.trim().split_once('='));
        pairs.find(|(known, _)| *known == name).map(|(_, v)| v)
    }

    fn visitor(&self, headers: &HeaderMap) -> Option<(String, Visitor)> {
        let key = self.cookie(headers)?;
        let visitor = self.shared.sessions.visitor(key, Instant::now())?;
        Some((key.to_owned(), visitor))
    }

    fn session(&self, headers: &HeaderMap) -> Answer {
        match self.visitor(headers) {
            Some((_, visitor)) => session_info(&visitor),
            None => not_signed_in(),
        }
    }

    async fn situation(&self, headers: &HeaderMap) -> Answer {
        if self.visitor(headers).is_none() {
            return not_signed_in();
        }
        let (answer, report) = tokio::sync::oneshot::channel();
        self.shared.hub.send(Event::Report(answer));
        match report.await {
            Ok(report) => whole(StatusCode::OK, "application/json", report.into()),
            Err(_) => problem(StatusCode::SERVICE_UNAVAILABLE, "the gateway ends"),
        }
    }

    /// Logs in a browser that opened the link that was printed at the start.
    fn token(&self, headers: &HeaderMap, query: &str) -> Answer {
        let given = query
            .split('&')
            .find_map(|pair| pair.strip_prefix("token="));
        let given = given.unwrap_or_default();
        let known = self.tokens.iter().find(|token| same(&token.secret, given));
        let Some(token) = known else {
            let words = "this link is not the one that `wheelarm drive` printed: open that one";
            return problem(StatusCode::UNAUTHORIZED, words);
        };
        let mut answer = whole(StatusCode::SEE_OTHER, "text/plain", Bytes::new());
        answer
            .headers_mut()
            .insert(header::LOCATION, HeaderValue::from_static("/"));
        match self.visitor(headers) {
            // The link was opened again, in another tab: the session continues.
            Some((_, visitor)) if visitor == token.visitor => answer,
            _ => self.let_in(answer, &token.visitor, None),
        }
    }

    /// Begins a session, by the entry of a user or by a link. Its key is always new: a
    /// cookie that arrived with the request is ignored.
    fn let_in(&self, mut answer: Answer, visitor: &Visitor, user: Option<User>) -> Answer {
        let sessions = &self.shared.sessions;
        let key = match sessions.begin(visitor.clone(), user, Instant::now()) {
            Ok(key) => key,
            Err(e) => return problem(StatusCode::INTERNAL_SERVER_ERROR, &e.to_string()),
        };
        // The user may have been changed while the password was verified.
        if let Some(users) = &self.users {
            sessions.keep(&users.users());
            if sessions.visitor(&key, Instant::now()).is_none() {
                return not_together();
            }
        }
        let line = json!({"what": "signed in", "who": visitor.name, "role": visitor.role.name()});
        self.shared.hub.send(Event::Audit(line));
        let cookie = format!(
            "{}={key}; Path=/; HttpOnly; SameSite=Strict; Max-Age=43200{}",
            self.cookie_name(),
            if self.tls.is_some() { "; Secure" } else { "" }
        );
        if let Ok(value) = HeaderValue::from_str(&cookie) {
            answer.headers_mut().insert(header::SET_COOKIE, value);
        }
        answer
    }

    async fn post(&self, path: &str, request: Request<Incoming>, from: SocketAddr) -> Answer {
        let headers = request.headers().clone();
        let site = HeaderName::from_static("sec-fetch-site");
        let foreign = headers.contains_key(&site) && text(&headers, &site) != "same-origin"
            || headers.contains_key(header::ORIGIN) && !self.is_own_origin(&headers);
        if foreign {
            return problem(StatusCode::FORBIDDEN, "another page may not ask this");
        }
        if !text(&headers, &header::CONTENT_TYPE).starts_with("application/json") {
            let words = "Content-Type must be application/json";
            return problem(StatusCode::UNSUPPORTED_MEDIA_TYPE, words);
        }
        let body = Limited::new(request.into_body(), MOST_BYTES).collect();
        let body = match tokio::time::timeout(QUESTION, body).await {
            Ok(Ok(body)) => body.to_bytes(),
            Ok(Err(_)) => {
                let words = format!("a question has at most {MOST_BYTES} bytes");
                return problem(StatusCode::PAYLOAD_TOO_LARGE, &words);
            }
            Err(_) => return problem(StatusCode::REQUEST_TIMEOUT, "the question did not come"),
        };
        let body: Value = match serde_json::from_slice(&body) {
            Ok(body) => body,
            Err(_) if body.is_empty() => json!({}),
            Err(e) => return problem(StatusCode::BAD_REQUEST, &format!("no JSON: {e}")),
        };
        match path {
            "/ticket" => self.tickets(&headers, &body),
            "/login" => self.log_in(&headers, &body, from).await,
            "/logout" => {
                if let Some(key) = self.cookie(&headers) {
                    self.shared.sessions.end(key, "signed out");
                }
                let mut answer = whole(StatusCode::NO_CONTENT, "text/plain", Bytes::new());
                let secure = if self.tls.is_some() { "; Secure" } else { "" };
                let cookie = format!("{}=; Path=/; Max-Age=0{secure}", self.cookie_name());
                if let Ok(value) = HeaderValue::from_str(&cookie) {
                    answer.headers_mut().insert(header::SET_COOKIE, value);
                }
                answer
            }
            _ => problem(StatusCode::NOT_FOUND, "no such page"),
        }
    }

    async fn log_in(&self, headers: &HeaderMap, body: &Value, from: SocketAddr) -> Answer {
        let Some(users) = self.users.clone() else {
            let words = "this gateway has no users: open the link that `wheelarm drive` printed";
            return problem(StatusCode::UNAUTHORIZED, words);
        };
        let word = |name: &str| body[name].as_str().unwrap_or_default().to_owned();
        let (name, password) = (word("user"), word("password"));
        if keys::check_name(&name).is_err() {
            return not_together();
        }
        let from = from.ip();
        let now = self.began.elapsed().as_secs_f64();
        if let Err(wait) = self.attempts.lock().may(from, &name, now) {
            let wait = wait.ceil();
            let words = json!({
                "error": format!("too many wrong passwords; try again in {wait:.0} s"),
                "retry_s": wait,
            });
            return json_answer(StatusCode::TOO_MANY_REQUESTS, &words);
        }
        // Counted before the check, so that parallel requests cannot exceed the limit.
        self.attempts.lock().wrong(from, &name, now);
        let Ok(_one) = self.gate.acquire().await else {
            return problem(StatusCode::SERVICE_UNAVAILABLE, "the gateway ends");
        };
        let user = name.clone();
        let verified = tokio::task::spawn_blocking(move || users.verify(&user, &password)).await;
        let Ok(Some((role, user))) = verified else {
            let line = json!({"what": "wrong password", "who": name, "text": from.to_string()});
            self.shared.hub.send(Event::Audit(line));
            return not_together();
        };
        self.attempts.lock().right(from, &name, now);
        // The former login of this browser ends.
        if let Some(key) = self.cookie(headers) {
            self.shared.sessions.end(key, "signed in again");
        }
        let visitor = Visitor { name, role };
        self.let_in(session_info(&visitor), &visitor, Some(user))
    }

    fn tickets(&self, headers: &HeaderMap, body: &Value) -> Answer {
        let Some((key, _)) = self.visitor(headers) else {
            return not_signed_in();
        };
        let count = body["count"].as_u64().unwrap_or(1);
        if !(1..=TICKETS).contains(&count) {
            return problem(StatusCode::BAD_REQUEST, "count is 1 to 8");
        }
        let sessions = &self.shared.sessions;
        let tickets = (0..count).map(|_| sessions.ticket(&key, Instant::now()));
        match tickets.collect::<Result<Option<Vec<_>>, _>>() {
            Ok(None) => not_signed_in(),
            Ok(Some(tickets)) => json_answer(
                StatusCode::OK,
                &json!({"tickets": tickets, "expires_s": TICKET.as_secs()}),
            ),
            Err(e) => problem(StatusCode::INTERNAL_SERVER_ERROR, &e.to_string()),
        }
    }

    fn file(&self, path: &str) -> Answer {
        match self.files.find(path) {
            Some(file) => whole(StatusCode::OK, file.kind, file.bytes.into_owned().into()),
            None => problem(StatusCode::NOT_FOUND, "no such page"),
        }
    }

    fn upgrade(&self, mut request: Request<Incoming>, kind: Kind, place: &Arc<Place>) -> Answer {
        let headers = request.headers();
        if !self.is_own_origin(headers) {
            let line = json!({"what": "foreign origin", "text": text(headers, &header::ORIGIN)});
            self.shared.hub.send(Event::Audit(line));
            return problem(
                StatusCode::FORBIDDEN,
                "only this site's own page may connect",
            );
        }
        let has = |name: &HeaderName, word: &str| {
            let value = text(headers, name).to_ascii_lowercase();
            value.split(',').any(|part| part.trim() == word)
        };
        let version = text(headers, &header::SEC_WEBSOCKET_VERSION) == "13";
        let key = text(headers, &header::SEC_WEBSOCKET_KEY).to_owned();
        let asks = has(&header::CONNECTION, "upgrade") && has(&header::UPGRADE, "websocket");
        if !asks || !version || key.is_empty() {
            return problem(StatusCode::UPGRADE_REQUIRED, "this is a WebSocket");
        }
        if self.visitor(headers).is_none() {
            return not_signed_in();
        }
        let cookie = self.cookie(headers).map(str::to_owned);
        let shared = Arc::clone(&self.shared);
        let coming = hyper::upgrade::on(&mut request);
        let place = Arc::clone(place);
        tokio::spawn(async move {
            if let Ok(upgraded) = coming.await {
                socket::serve(shared, kind, upgraded, cookie, place).await;
            }
        });
        let mut answer = Response::new(Full::default());
        *answer.status_mut() = StatusCode::SWITCHING_PROTOCOLS;
        let headers = answer.headers_mut();
        headers.insert(header::CONNECTION, HeaderValue::from_static("upgrade"));
        headers.insert(header::UPGRADE, HeaderValue::from_static("websocket"));
        if let Ok(accept) = HeaderValue::from_str(&derive_accept_key(key.as_bytes())) {
            headers.insert(header::SEC_WEBSOCKET_ACCEPT, accept);
        }
        answer
    }
}

fn text<'a>(headers: &'a HeaderMap, name: &HeaderName) -> &'a str {
    let value = headers.get(name).and_then(|value| value.to_str().ok());
    value.unwrap_or_default()
}

fn session_info(visitor: &Visitor) -> Answer {
    json_answer(
        StatusCode::OK,
        &json!({
            "protocol": PROTOCOL,
            "user": visitor.name,
            "role": visitor.role.name(),
            "name": "WheelArm",
        }),
    )
}

fn json_answer(status: StatusCode, value: &Value) -> Answer {
    whole(status, "application/json", value.to_string().into())
}

fn problem(status: StatusCode, words: &str) -> Answer {
    json_answer(status, &json!({"error": words}))
}

fn not_together() -> Answer {
    let words = "this user and this password do not belong together";
    problem(StatusCode::UNAUTHORIZED, words)
}

fn not_signed_in() -> Answer {
    let words = "not signed in: open the link that `wheelarm drive` printed";
    problem(StatusCode::UNAUTHORIZED, words)
}

fn whole(status: StatusCode, kind: &'static str, body: Bytes) -> Answer {
    let mut answer = Response::new(Full::new(body));
    *answer.status_mut() = status;
    let headers = answer.headers_mut();
    for (name, value) in [
        ("content-type", kind),
        ("cache-control", "no-cache"),
        ("content-security-policy", POLICY),
        ("x-content-type-options", "nosniff"),
        ("referrer-policy", "no-referrer"),
        ("cross-origin-opener-policy", "same-origin"),
        ("cross-origin-resource-policy", "same-origin"),
        ("permissions-policy", PERMISSIONS),
    ] {
        let name = HeaderName::from_static(name);
        headers.insert(name, HeaderValue::from_static(value));
    }
    answer
}

/// Whether `Host` names this host and port.
fn known_host(host: &str, address: SocketAddr, names: &[String]) -> bool {
    let (name, port) = match host.strip_prefix('[') {
        Some(rest) => match rest.split_once(']') {
            Some((name, port)) => (name, port.strip_prefix(':')),
            None => return false,
        },
        None => match host.split_once(':') {
            Some((name, port)) => (name, Some(port)),
            None => (host, None),
        },
    };
    // A tunnel may end at another port of the loopback interface.
    let is_port = port.is_none_or(|port| port.parse::<u16>().is_ok());
    // An address is the host itself: only names can be rebound to another host.
    let any = address.ip().is_unspecified();
    let is_name = name.eq_ignore_ascii_case("localhost")
        || names.iter().any(|known| known.eq_ignore_ascii_case(name))
        || name
            .parse::<IpAddr>()
            .is_ok_and(|ip| any || ip.is_loopback() || ip == address.ip());
    is_port && is_name
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn documented_policies_are_those_that_the_gateway_sends() {
        let protocol = include_str!("../PROTOCOL.md");
        for (name, policy) in [("Permissions", PERMISSIONS), ("Content-Security", POLICY)] {
            assert!(
                protocol.contains(&format!("`{policy}`")),
                "PROTOCOL.md lacks the {name}-Policy `{policy}`"
            );
        }
        // The test gateway runs the page under the same policy.
        let gateway = include_str!("../../../../tests/drive/gateway.js");
        let gateway = gateway.replace("\" +\n  \"", "");
        assert!(
            gateway.contains(&format!("const POLICY = \"{POLICY}\";")),
            "tests/drive/gateway.js has another Content-Security-Policy than {POLICY}"
        );
    }

    #[test]
    fn an_unknown_host_name_is_rejected() {
        let local = SocketAddr::from(([127, 0, 0, 1], 7460));
        for good in [
            "127.0.0.1:7460",
            "localhost:9999",
            "[::1]:7460",
            "LOCALHOST",
        ] {
            assert!(known_host(good, local, &[]), "{good}");
        }
        for bad in [
            "evil.example",
            "127.0.0.1.evil.example:7460",
            "127.0.0.1:7460.evil.example",
            "",
            "10.0.0.9",
            "[::1",
            "localhost:99999",
        ] {
            assert!(!known_host(bad, local, &[]), "{bad}");
        }
        let lab = ["lab.example".to_owned()];
        let everywhere = SocketAddr::from(([0, 0, 0, 0], 7460));
        assert!(known_host("lab.example:7460", everywhere, &lab));
        assert!(known_host("192.0.2.7:7460", everywhere, &lab));
        assert!(!known_host("evil.example:7460", everywhere, &lab));
        assert!(!known_host("lab.example.evil.example", everywhere, &lab));
    }
}
