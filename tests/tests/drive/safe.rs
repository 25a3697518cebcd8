//! A gateway with TLS and users.

use std::io::{BufRead, BufReader, Read, Write};
use std::net::TcpStream;
use std::path::Path;
use std::process::{Child, Command, Stdio};
use std::sync::Arc;
use std::time::Duration;

use serde_json::{Value, json};
use tokio_rustls::rustls::crypto::ring;
use tokio_rustls::rustls::pki_types::pem::PemObject;
use tokio_rustls::rustls::pki_types::{CertificateDer, ServerName};
use tokio_rustls::rustls::{ClientConfig, ClientConnection, RootCertStore, StreamOwned};
use tungstenite::client::IntoClientRequest;
use tungstenite::{Message, WebSocket};
use wheelarm_access::{Folder, Role, User};
use wheelarm_tests::{Server, program};

/// Longest wait of one read.
const PATIENCE: Duration = Duration::from_secs(20);

/// A gateway with keys and one user, anna; killed when dropped.
pub struct Safe {
    child: Child,
    server: Server,
    /// Host and port.
    address: String,
    config: Arc<ClientConfig>,
}

impl Safe {
    /// Creates keys in a folder, and starts the gateway with them.
    pub fn open(server: Server, keys: &Path) -> Self {
        let folder = Folder::init(keys, &["localhost".to_owned()]).expect("keys");
        let mut users = folder.users().expect("users");
        let anna = User::new("anna", Role::Operator).expect("a user");
        users.add(anna).expect("room for her");
        let password = Some("right and long");
        users.set_password("anna", password).expect("a password");
        users.save(&folder.users_file()).expect("a file");
        let mut roots = RootCertStore::empty();
        let authority = CertificateDer::from_pem_file(folder.authority()).expect("an authority");
        roots.add(authority).expect("a root");
        let config = ClientConfig::builder_with_provider(Arc::new(ring::default_provider()))
            .with_safe_default_protocol_versions()
            .expect("versions")
            .with_root_certificates(roots)
            .with_no_client_auth();
        let mut child = Command::new(program("wheelarm").expect("the client"))
            .args(["--connect", &server.endpoint, "--sim", &server.sim])
            .args(["drive", "--page", "127.0.0.1:0", "--keys"])
            .arg(keys)
            .stdout(Stdio::piped())
            .spawn()
            .expect("the gateway");
        let pipe = child.stdout.take().expect("a pipe");
        let mut line = String::new();
        BufReader::new(pipe).read_line(&mut line).expect("a line");
        let url = line.trim().strip_prefix("drive https://127.0.0.1:");
        let port = url.and_then(|url| url.strip_suffix('/')).expect("a port");
        Self {
            child,
            server,
            address: format!("localhost:{port}"),
            config: Arc::new(config),
        }
    }

    fn tcp(&self) -> TcpStream {
        let port = self.address.split(':').next_back().expect("a port");
        let stream = TcpStream::connect(format!("127.0.0.1:{port}")).expect("a connection");
        stream.set_read_timeout(Some(PATIENCE)).expect("a patience");
        stream
    }

    fn connect(&self) -> StreamOwned<ClientConnection, TcpStream> {
        let name = ServerName::try_from("localhost").expect("a name");
        let config = Arc::clone(&self.config);
        let connection = ClientConnection::new(config, name).expect("a connection");
        StreamOwned::new(connection, self.tcp())
    }

    /// Status of the answer to a request without encryption.
    pub fn plain(&self) -> Option<u16> {
        let mut stream = self.tcp();
        let question = format!("GET / HTTP/1.1\r\nHost: {}\r\n\r\n", self.address);
        stream.write_all(question.as_bytes()).expect("a question");
        let mut answer = Vec::new();
        let _ = stream.read_to_end(&mut answer);
        let text = String::from_utf8_lossy(&answer).into_owned();
        text.strip_prefix("HTTP/1.1 ")?.get(..3)?.parse().ok()
    }

    /// Status and text of the answer to a request, `GET /` or `POST /`.
    pub fn request(&self, what: &str, cookie: &str, body: &str) -> (u16, String) {
        let mut stream = self.connect();
        let question = format!(
            "{what} HTTP/1.1\r\nHost: {0}\r\nOrigin: https://{0}\r\nCookie: {cookie}\r\n\
             Content-Type: application/json\r\nContent-Length: {1}\r\nConnection: close\r\n\r\n{body}",
            self.address,
            body.len()
        );
        stream.write_all(question.as_bytes()).expect("a question");
        let mut answer = Vec::new();
        let _ = stream.read_to_end(&mut answer);
        let text = String::from_utf8_lossy(&answer).into_owned();
        let code = text.split(' ').nth(1).and_then(|code| code.parse().ok());
        (code.unwrap_or(0), text)
    }

    /// The cookie of `anna`, logged in.
    pub fn sign_in(&self, password: &str) -> Option<String> {
        let body = json!({"user": "anna", "password": password}).to_string();
        let (code, head) = self.request("POST /login", "", &body);
        let cookie = head.lines().find_map(|l| l.strip_prefix("set-cookie: "));
        let value = cookie.and_then(|cookie| cookie.split(';').next());
        value.filter(|_| code == 200).map(str::to_owned)
    }

    /// The connection to the server behind it.
    pub fn client(&self) -> wheelarm_sdk::Client {
        self.server.client()
    }

    /// A socket of the page `s1`, opened with a new ticket of the session.
    pub fn enter(&self, path: &str, cookie: &str) -> Secure {
        let (code, answer) = self.request("POST /ticket", cookie, "{\"count\":1}");
        assert_eq!(code, 200, "{answer}");
        let body = answer.split("\r\n\r\n").nth(1).expect("a body");
        let body: Value = serde_json::from_str(body).expect("JSON");
        let url = format!("wss://{}{path}", self.address);
        let mut request = url.into_client_request().expect("a request");
        let headers = request.headers_mut();
        let origin = format!("https://{}", self.address);
        headers.insert("origin", origin.parse().expect("an origin"));
        headers.insert("cookie", cookie.parse().expect("a cookie"));
        let (mut socket, _) = tungstenite::client(request, self.connect()).expect("a socket");
        let hello =
            json!({"t":"hello","protocol":1,"ticket":body["tickets"][0],"page":"s1","lane":0});
        let hello = Message::Text(hello.to_string().into());
        socket.send(hello).expect("a hello");
        let first = socket.read().expect("an answer");
        assert!(
            first.to_text().is_ok_and(|text| text.contains("welcome")),
            "{first:?}"
        );
        socket
    }
}

/// A WebSocket over TLS.
pub type Secure = WebSocket<StreamOwned<ClientConnection, TcpStream>>;

/// The code with which a socket is closed.
pub fn close_code(mut socket: Secure) -> Option<u16> {
    loop {
        match socket.read() {
            Ok(Message::Close(Some(frame))) => return Some(frame.code.into()),
            Ok(_) => {}
            Err(_) => return None,
        }
    }
}

impl Drop for Safe {
    fn drop(&mut self) {
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}
