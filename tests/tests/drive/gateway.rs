//! A gateway process, its HTTP and its sockets.

use std::io::{BufRead, BufReader, Read, Write};
use std::net::TcpStream;
use std::process::{Child, Command, Stdio};
use std::time::Duration;

use serde_json::Value;
use tungstenite::client::IntoClientRequest;
use tungstenite::{Error, Message, WebSocket};
use wheelarm_tests::{Server, program};

/// Longest wait of one read.
const PATIENCE: Duration = Duration::from_secs(20);

/// `wheelarm drive`; killed when dropped.
pub struct Gateway {
    child: Child,
    /// Host and port.
    pub address: String,
    cookies: [String; 2],
}

/// A WebSocket of a page.
pub type Socket = WebSocket<TcpStream>;

/// The cookie of an answer.
fn set_cookie(head: &str) -> String {
    let cookie = head.lines().find_map(|l| l.strip_prefix("set-cookie: "));
    let cookie = cookie.and_then(|c| c.split(';').next());
    cookie.expect("a cookie").to_owned()
}

impl Gateway {
    /// Starts it beside a server, and logs in as operator and as viewer.
    pub fn open(server: &Server) -> Self {
        let mut child = Command::new(program("wheelarm").expect("the client"))
            .args(["--connect", &server.endpoint, "--sim", &server.sim])
            .args(["drive", "--page", "127.0.0.1:0", "--commander", "anna"])
            .stdout(Stdio::piped())
            .spawn()
            .expect("the gateway");
        let pipe = child.stdout.take().expect("a pipe");
        let mut lines = BufReader::new(pipe).lines().map_while(Result::ok);
        let mut url = |word: &str| {
            let line = lines.next().expect("a line");
            let url = line.strip_prefix(&format!("{word} http://"));
            url.expect("an address").to_owned()
        };
        let urls = [url("drive"), url("watch")];
        let address = urls[0].split('/').next().expect("an address").to_owned();
        let mut gateway = Self {
            child,
            address,
            cookies: Default::default(),
        };
        gateway.cookies = urls.map(|url| gateway.signed_in(&url));
        gateway
    }

    /// `wheelarm preview`, where both cookies are a viewer's.
    pub fn preview(server: &Server) -> Self {
        let mut child = Command::new(program("wheelarm").expect("the client"))
            .args(["--connect", &server.endpoint, "--sim", &server.sim])
            .args(["preview", "--page", "127.0.0.1:0"])
            .stdout(Stdio::piped())
            .spawn()
            .expect("the page");
        let mut line = String::new();
        let mut pipe = BufReader::new(child.stdout.take().expect("a pipe"));
        pipe.read_line(&mut line).expect("a line");
        let url = line.trim().strip_prefix("page http://");
        let url = url.expect("an address");
        let mut gateway = Self {
            child,
            address: url.split('/').next().expect("an address").to_owned(),
            cookies: Default::default(),
        };
        // A browser that opens the page may watch, without a login link.
        let (code, head) = gateway.get("/", &gateway.address, "");
        assert_eq!(code, 200, "{head}");
        let cookie = set_cookie(&head);
        gateway.cookies = [cookie.clone(), cookie];
        gateway
    }

    /// The cookie that a login link sets.
    fn signed_in(&self, url: &str) -> String {
        let path = url.strip_prefix(&self.address).expect("a path");
        let (code, head) = self.get(path, &self.address, "");
        assert_eq!(code, 303, "{head}");
        set_cookie(&head)
    }

    /// The cookie of an operator, or of a viewer.
    pub fn cookie(&self, operator: bool) -> String {
        self.cookies[usize::from(!operator)].clone()
    }

    fn request(&self, question: &str) -> (u16, String) {
        let mut stream = self.connect();
        stream.write_all(question.as_bytes()).expect("a question");
        let mut answer = Vec::new();
        // A client that is rejected early is disconnected while it still sends.
        let _ = stream.read_to_end(&mut answer);
        let text = String::from_utf8_lossy(&answer).into_owned();
        let code = text.split(' ').nth(1).and_then(|code| code.parse().ok());
        (code.unwrap_or(0), text)
    }

    fn connect(&self) -> TcpStream {
        let stream = TcpStream::connect(&self.address).expect("a connection");
        stream.set_read_timeout(Some(PATIENCE)).expect("a patience");
        stream.set_nodelay(true).expect("no delay");
        stream
    }

    /// Status and text of the answer to a GET.
    pub fn get(&self, path: &str, host: &str, cookie: &str) -> (u16, String) {
        self.request(&format!(
            "GET {path} HTTP/1.1\r\nHost: {host}\r\nCookie: {cookie}\r\nConnection: close\r\n\r\n"
        ))
    }

    /// Status and text of the answer to a POST.
    pub fn post(
        &self,
        path: &str,
        cookie: &str,
        more: &[(&str, &str)],
        body: &str,
    ) -> (u16, String) {
        let more: String = more.iter().map(|(k, v)| format!("{k}: {v}\r\n")).collect();
        self.request(&format!(
            "POST {path} HTTP/1.1\r\nHost: {}\r\nCookie: {cookie}\r\n{more}Content-Type: \
             application/json\r\nContent-Length: {}\r\nConnection: close\r\n\r\n{body}",
            self.address,
            body.len()
        ))
    }

    /// A ticket of an operator, or of a viewer.
    pub fn ticket(&self, operator: bool) -> String {
        let (code, text) = self.post("/ticket", &self.cookie(operator), &[], "{\"count\":1}");
        assert_eq!(code, 200, "{text}");
        let body = text.split("\r\n\r\n").nth(1).expect("a body");
        let body: Value = serde_json::from_str(body).expect("JSON");
        body["tickets"][0].as_str().expect("a ticket").to_owned()
    }

    /// Opens a WebSocket; the HTTP status where it is rejected.
    pub fn upgrade(
        &self,
        path: &str,
        host: &str,
        origin: &str,
        cookie: &str,
    ) -> Result<Socket, u16> {
        let url = format!("ws://{}{path}", self.address);
        let mut request = url.into_client_request().expect("a request");
        let headers = request.headers_mut();
        headers.insert("host", host.parse().expect("a host"));
        if !origin.is_empty() {
            headers.insert("origin", origin.parse().expect("an origin"));
        }
        if !cookie.is_empty() {
            headers.insert("cookie", cookie.parse().expect("a cookie"));
        }
        match tungstenite::client(request, self.connect()) {
            Ok((socket, _)) => Ok(socket),
            Err(tungstenite::HandshakeError::Failure(Error::Http(answer))) => {
                Err(answer.status().as_u16())
            }
            Err(other) => panic!("{other}"),
        }
    }

    /// Opens a WebSocket of the page itself and sends a hello; the code with which it
    /// is closed.
    pub fn enter(&self, path: &str, operator: bool, hello: &Value) -> Result<Socket, u16> {
        let origin = format!("http://{}", self.address);
        let cookie = self.cookie(operator);
        let mut socket = self
            .upgrade(path, &self.address, &origin, &cookie)
            .expect("a socket");
        let message = Message::Text(hello.to_string().into());
        socket.send(message).expect("a hello");
        match socket.read().expect("an answer") {
            Message::Text(text) => {
                assert!(text.contains("welcome"), "{text}");
                Ok(socket)
            }
            Message::Close(Some(frame)) => Err(frame.code.into()),
            other => panic!("{other:?}"),
        }
    }
}

impl Drop for Gateway {
    fn drop(&mut self) {
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

/// Sends a text many times; the code with which the socket is closed.
pub fn flood(mut socket: Socket, text: &str, count: usize) -> Option<u16> {
    for _ in 0..count {
        if socket.send(Message::Text(text.into())).is_err() {
            break;
        }
    }
    loop {
        match socket.read() {
            Ok(Message::Close(Some(frame))) => return Some(frame.code.into()),
            Ok(_) => {}
            Err(_) => return None,
        }
    }
}
