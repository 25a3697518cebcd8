//! Links between two ends of this process.

use std::net::SocketAddr;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::Duration;

use rcgen::{
    BasicConstraints, CertificateParams, DnType, ExtendedKeyUsagePurpose, IsCa, Issuer, KeyPair,
};
use tokio::io::AsyncReadExt;
use tokio::net::TcpStream;
use zenoh_config::Config as SessionConfig;
use zenoh_link_commons::{
    ConfigurationInspector, LinkManagerUnicastTrait, LinkUnicast, NewLinkChannelSender,
};
use zenoh_protocol::core::EndPoint;

use super::{LinkManagerUnicastTls, TlsConfigurator};

/// Longest wait for anything here.
const PATIENCE: Duration = Duration::from_secs(60);

/// An authority with a folder for its certificates.
struct Authority {
    folder: tempfile::TempDir,
    issuer: Issuer<'static, KeyPair>,
}

impl Authority {
    fn new() -> Self {
        let folder = tempfile::tempdir().unwrap();
        let key = KeyPair::generate().unwrap();
        let mut params = CertificateParams::new(Vec::new()).unwrap();
        params.is_ca = IsCa::Ca(BasicConstraints::Unconstrained);
        let certificate = params.self_signed(&key).unwrap();
        std::fs::write(folder.path().join("ca.pem"), certificate.pem()).unwrap();
        let issuer = Issuer::new(params, key);
        Self { folder, issuer }
    }

    fn path(&self, file: &str) -> PathBuf {
        self.folder.path().join(file)
    }

    /// Writes `NAME.pem` and `NAME.key`, valid for `seconds`.
    fn issue(&self, name: &str, hosts: &[&str], seconds: i64) {
        let hosts: Vec<_> = hosts.iter().map(|&host| host.to_owned()).collect();
        let mut params = CertificateParams::new(hosts).unwrap();
        params.distinguished_name.push(DnType::CommonName, name);
        params.extended_key_usages = vec![
            ExtendedKeyUsagePurpose::ServerAuth,
            ExtendedKeyUsagePurpose::ClientAuth,
        ];
        let now = time::OffsetDateTime::now_utc();
        params.not_before = now - time::Duration::hours(1);
        params.not_after = now + time::Duration::seconds(seconds);
        let key = KeyPair::generate().unwrap();
        let certificate = params.signed_by(&key, &self.issuer).unwrap();
        std::fs::write(self.path(&format!("{name}.pem")), certificate.pem()).unwrap();
        std::fs::write(self.path(&format!("{name}.key")), key.serialize_pem()).unwrap();
    }

    /// Settings with the certificate of `name` that trust `authority`.
    fn settings(&self, name: &str, authority: &Path) -> SessionConfig {
        let mut config = SessionConfig::default();
        let mut set = |key: &str, value: String| {
            let key = format!("transport/link/tls/{key}");
            config.insert_json5(&key, &value).unwrap();
        };
        for role in ["listen", "connect"] {
            let file = |end: &str| format!("{:?}", self.path(&format!("{name}.{end}")));
            set(&format!("{role}_certificate"), file("pem"));
            set(&format!("{role}_private_key"), file("key"));
        }
        set("root_ca_certificate", format!("{authority:?}"));
        set("enable_mtls", "true".to_owned());
        set("close_link_on_expiration", "true".to_owned());
        config
    }

    fn endpoint(&self, name: &str, authority: &Authority, address: &str) -> EndPoint {
        let settings = self.settings(name, &authority.path("ca.pem"));
        let settings = TlsConfigurator.inspect_config(&settings).unwrap();
        EndPoint::new("tls", address, "", settings).unwrap()
    }
}

/// A listener at a free port, and its accepted links.
struct Listener {
    manager: LinkManagerUnicastTls,
    port: u16,
    links: flume::Receiver<LinkUnicast>,
}

impl Listener {
    async fn start(authority: &Authority) -> Self {
        authority.issue("server", &["127.0.0.1"], 3600);
        let (sender, links) = flume::unbounded();
        let manager = LinkManagerUnicastTls::new(sender);
        let endpoint = authority.endpoint("server", authority, "127.0.0.1:0");
        let locator = manager.new_listener(endpoint).await.unwrap();
        let port = locator.address().as_str().rsplit_once(':').unwrap().1;
        let port = port.parse().unwrap();
        Self {
            manager,
            port,
            links,
        }
    }

    fn address(&self) -> SocketAddr {
        ([127, 0, 0, 1], self.port).into()
    }

    async fn next(&self) -> LinkUnicast {
        let next = tokio::time::timeout(PATIENCE, self.links.recv_async());
        next.await.expect("a link in time").unwrap()
    }
}

fn connector() -> LinkManagerUnicastTls {
    let (unused, _): (NewLinkChannelSender, _) = flume::unbounded();
    LinkManagerUnicastTls::new(unused)
}

/// Both ends of a connection of `anna` to `listener`.
async fn pair(authority: &Authority, listener: &Listener) -> (LinkUnicast, LinkUnicast) {
    let endpoint = authority.endpoint("anna", authority, &listener.address().to_string());
    let client = connector().new_link(endpoint).await.unwrap();
    (client, listener.next().await)
}

/// Message `n` of both ends, with its own length and bytes.
fn message(n: usize) -> Vec<u8> {
    let length = 1 + (n * 7919) % 60_000;
    (0..length).map(|at| (n * 31 + at * 7) as u8).collect()
}

async fn send(link: LinkUnicast, count: usize) {
    for n in 0..count {
        link.write_all(&message(n), None).await.unwrap();
    }
}

async fn receive(link: LinkUnicast, count: usize) {
    for n in 0..count {
        let wanted = message(n);
        let mut got = vec![0; wanted.len()];
        link.read_exact(&mut got, None).await.unwrap();
        assert!(got == wanted, "message {n} differs");
    }
}

async fn in_time<T>(what: impl Future<Output = T>) -> T {
    tokio::time::timeout(PATIENCE, what).await.expect("in time")
}

#[tokio::test(flavor = "multi_thread", worker_threads = 4)]
async fn both_ends_send_and_receive_at_once() {
    let authority = Authority::new();
    authority.issue("anna", &[], 3600);
    let listener = Listener::start(&authority).await;
    let mut under_way = tokio::task::JoinSet::new();
    for _ in 0..4 {
        let (client, server) = pair(&authority, &listener).await;
        under_way.spawn(send(client.clone(), 2000));
        under_way.spawn(send(server.clone(), 2000));
        under_way.spawn(receive(client, 2000));
        under_way.spawn(receive(server, 2000));
    }
    while let Some(done) = in_time(under_way.join_next()).await {
        done.unwrap();
    }
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn long_message_arrives_without_a_following_one() {
    let authority = Authority::new();
    authority.issue("anna", &[], 3600);
    let listener = Listener::start(&authority).await;
    let (client, server) = pair(&authority, &listener).await;
    // More than the sockets hold, so that the writer waits for the reader.
    let bytes = vec![7; 40 << 20];
    let length = bytes.len();
    let written = tokio::spawn(async move {
        client.write_all(&bytes, None).await.unwrap();
        client
    });
    let mut got = vec![0; length];
    in_time(server.read_exact(&mut got, None)).await.unwrap();
    assert!(got.iter().all(|&byte| byte == 7));
    in_time(written).await.unwrap();
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn silent_peers_delay_no_other() {
    let authority = Authority::new();
    authority.issue("anna", &[], 3600);
    let listener = Listener::start(&authority).await;
    let mut silent = Vec::new();
    for _ in 0..400 {
        silent.push(TcpStream::connect(listener.address()).await.unwrap());
    }
    let (client, server) = in_time(pair(&authority, &listener)).await;
    let receiving = tokio::spawn(receive(server, 3));
    in_time(send(client, 3)).await;
    in_time(receiving).await.unwrap();
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn close_ends_waiting_reads_and_writes_on_both_sides() {
    let authority = Authority::new();
    authority.issue("anna", &[], 3600);
    let listener = Listener::start(&authority).await;
    let (client, server) = pair(&authority, &listener).await;
    let reading = {
        let server = server.clone();
        tokio::spawn(async move { server.read_exact(&mut [0], None).await })
    };
    // No task reads these bytes.
    let writing = {
        let server = server.clone();
        tokio::spawn(async move { server.write_all(&vec![0; 40 << 20], None).await })
    };
    tokio::time::sleep(Duration::from_millis(200)).await;
    assert!(!writing.is_finished());
    in_time(server.close()).await.unwrap();
    assert!(in_time(reading).await.unwrap().is_err());
    assert!(in_time(writing).await.unwrap().is_err());
    let mut rest = vec![0; 1 << 20];
    let ended = async {
        while client
            .read(&mut rest, None)
            .await
            .is_ok_and(|read| read > 0)
        {}
    };
    in_time(ended).await;
}

#[tokio::test(flavor = "multi_thread")]
async fn link_ends_when_the_role_of_its_peer_changes() {
    let authority = Authority::new();
    let listener = Listener::start(&authority).await;
    let certificate = authority.path("server.pem");
    let set = |role: &'static str| {
        super::admit(
            &certificate,
            std::sync::Arc::new(move |name: &str, _: i64| format!("{name} {role}")),
        );
    };
    set("operator");
    authority.issue("anna", &[], 3600);
    let (client, server) = pair(&authority, &listener).await;
    let subject = |link: &LinkUnicast| format!("{:?}", link.get_auth_id());
    assert!(
        subject(&server).contains("anna operator"),
        "{}",
        subject(&server)
    );
    // The same role again: the link stays open.
    set("operator");
    in_time(async { tokio::join!(send(client.clone(), 3), receive(server.clone(), 3)) }).await;
    set("viewer");
    let mut buffer = [0; 16];
    let read = in_time(server.read(&mut buffer, None)).await;
    let error = read.expect_err("the link has ended").to_string();
    assert!(error.contains("changed or removed"), "{error}");
    let read = in_time(server.read(&mut buffer, None)).await;
    assert!(read.is_err(), "the link stays closed");
    let (_client, server) = pair(&authority, &listener).await;
    assert!(
        subject(&server).contains("anna viewer"),
        "{}",
        subject(&server)
    );
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn link_ends_with_the_certificate_of_its_peer() {
    let authority = Authority::new();
    authority.issue("anna", &[], 10);
    let listener = Listener::start(&authority).await;
    let (_client, server) = pair(&authority, &listener).await;
    assert!(in_time(server.read_exact(&mut [0], None)).await.is_err());
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn link_needs_certificates_of_one_authority_and_provides_the_name() {
    let (authority, stranger) = (Authority::new(), Authority::new());
    for of in [&authority, &stranger] {
        of.issue("anna", &[], 3600);
        of.issue("late", &[], -60);
    }
    let listener = Listener::start(&authority).await;
    let there = listener.address().to_string();
    let (_client, server) = pair(&authority, &listener).await;
    assert_eq!(server.get_auth_id().get_cert_common_name(), Some("anna"));

    // A rejected client gets the error when it reads: with TLS 1.3 its handshake ends before.
    let refused = [
        stranger.endpoint("anna", &authority, &there),
        authority.endpoint("late", &authority, &there),
    ];
    for endpoint in refused {
        if let Ok(link) = connector().new_link(endpoint).await {
            assert!(in_time(link.read_exact(&mut [0], None)).await.is_err());
        }
    }
    // A server of another authority, and one at another name.
    let other = authority.endpoint("anna", &stranger, &there);
    let error = connector().new_link(other).await.err().unwrap();
    assert!(
        error.to_string().contains("invalid peer certificate"),
        "{error}"
    );
    let localhost = format!("localhost:{}", listener.port);
    let named = authority.endpoint("anna", &authority, &localhost);
    let error = connector().new_link(named).await.err().unwrap();
    assert!(error.to_string().contains("not valid for name"), "{error}");
    assert!(listener.links.is_empty());
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn removed_listener_accepts_no_connection() {
    let authority = Authority::new();
    let listener = Listener::start(&authority).await;
    let mut half = TcpStream::connect(listener.address()).await.unwrap();
    let endpoint = &listener.manager.get_listeners().await[0];
    in_time(listener.manager.del_listener(endpoint))
        .await
        .unwrap();
    // Its handshakes end with it.
    assert!(matches!(in_time(half.read(&mut [0])).await, Ok(0) | Err(_)));
    authority.issue("anna", &[], 3600);
    // Another process may listen there by now, with another authority.
    let endpoint = authority.endpoint("anna", &authority, &listener.address().to_string());
    assert!(in_time(connector().new_link(endpoint)).await.is_err());
}

#[test]
fn unsupported_settings_are_rejected() {
    let authority = Authority::new();
    let runtime = tokio::runtime::Runtime::new().unwrap();
    let listen = |settings: &SessionConfig| {
        let settings = TlsConfigurator.inspect_config(settings)?;
        let endpoint = EndPoint::new("tls", "127.0.0.1:0", "", settings)?;
        runtime.block_on(connector().new_listener(endpoint))
    };
    authority.issue("server", &["127.0.0.1"], 3600);
    let good = authority.settings("server", &authority.path("ca.pem"));
    assert!(listen(&good).is_ok());
    std::fs::write(authority.path("empty.pem"), "").unwrap();
    let (empty, none) = (authority.path("empty.pem"), authority.path("none.pem"));
    let cases = [
        ("enable_mtls", "false".to_owned(), "enable_mtls"),
        (
            "listen_certificate_base64",
            "\"AA==\"".to_owned(),
            "name a file",
        ),
        (
            "listen_certificate",
            format!("{empty:?}"),
            "contains no certificate",
        ),
        ("listen_private_key", format!("{none:?}"), "none.pem"),
    ];
    for (key, value, words) in cases {
        let mut settings = good.clone();
        let key = format!("transport/link/tls/{key}");
        settings.insert_json5(&key, &value).unwrap();
        let error = listen(&settings).expect_err(words).to_string();
        assert!(error.contains(words), "{error}");
    }
}

#[test]
fn links_can_move_between_threads() {
    fn sent<T: Send + Sync>() {}
    sent::<Arc<super::LinkUnicastTls>>();
}
