//! Settings of TLS: from a session's configuration to an endpoint, and from an endpoint to the
//! configuration of rustls.

use std::sync::Arc;
use std::time::Duration;

use tokio_rustls::rustls::crypto::{CryptoProvider, ring};
use tokio_rustls::rustls::pki_types::pem::PemObject;
use tokio_rustls::rustls::pki_types::{CertificateDer, PrivateKeyDer};
use tokio_rustls::rustls::server::{NoServerSessionStorage, WebPkiClientVerifier};
use tokio_rustls::rustls::version::TLS13;
use tokio_rustls::rustls::{ClientConfig, RootCertStore, ServerConfig};
use zenoh_config::Config as SessionConfig;
use zenoh_link_commons::tcp::TcpSocketConfig;
use zenoh_link_commons::tls::config::{
    TLS_CLOSE_LINK_ON_EXPIRATION, TLS_CONNECT_CERTIFICATE_BASE64, TLS_CONNECT_CERTIFICATE_FILE,
    TLS_CONNECT_CERTIFICATE_RAW, TLS_CONNECT_PRIVATE_KEY_BASE64, TLS_CONNECT_PRIVATE_KEY_FILE,
    TLS_CONNECT_PRIVATE_KEY_RAW, TLS_ENABLE_MTLS, TLS_HANDSHAKE_TIMEOUT_MS,
    TLS_HANDSHAKE_TIMEOUT_MS_DEFAULT, TLS_LISTEN_CERTIFICATE_BASE64, TLS_LISTEN_CERTIFICATE_FILE,
    TLS_LISTEN_CERTIFICATE_RAW, TLS_LISTEN_PRIVATE_KEY_BASE64, TLS_LISTEN_PRIVATE_KEY_FILE,
    TLS_LISTEN_PRIVATE_KEY_RAW, TLS_ROOT_CA_CERTIFICATE_BASE64, TLS_ROOT_CA_CERTIFICATE_FILE,
    TLS_ROOT_CA_CERTIFICATE_RAW, TLS_VERIFY_NAME_ON_CONNECT,
};
use zenoh_link_commons::{
    BIND_INTERFACE, BIND_SOCKET, ConfigurationInspector, TCP_SO_RCV_BUF, TCP_SO_SND_BUF, parse_dscp,
};
use zenoh_protocol::core::endpoint::Config;
use zenoh_protocol::core::parameters;
use zenoh_result::{ZResult, bail, zerror};

use super::admission::Admissions;

/// Copies the settings under `transport/link/tls` of a session into its endpoints.
#[derive(Default, Clone, Copy, Debug)]
pub struct TlsConfigurator;

impl ConfigurationInspector<SessionConfig> for TlsConfigurator {
    /// # Errors
    /// An unsupported setting, with its name.
    fn inspect_config(&self, config: &SessionConfig) -> ZResult<String> {
        let tls = config.transport().link().tls();
        let in_text = [
            ("root_ca_certificate", tls.root_ca_certificate_base64()),
            ("listen_private_key", tls.listen_private_key_base64()),
            ("listen_certificate", tls.listen_certificate_base64()),
            ("connect_private_key", tls.connect_private_key_base64()),
            ("connect_certificate", tls.connect_certificate_base64()),
        ];
        if let Some((name, _)) = in_text.iter().find(|(_, text)| text.is_some()) {
            bail!("transport/link/tls/{name}_base64 is not supported: name a file with {name}");
        }
        let yes_or_no = |set: Option<bool>, default| set.unwrap_or(default).to_string();
        let settings = [
            (
                TLS_ROOT_CA_CERTIFICATE_FILE,
                tls.root_ca_certificate().clone(),
            ),
            (
                TLS_LISTEN_PRIVATE_KEY_FILE,
                tls.listen_private_key().clone(),
            ),
            (
                TLS_LISTEN_CERTIFICATE_FILE,
                tls.listen_certificate().clone(),
            ),
            (
                TLS_CONNECT_PRIVATE_KEY_FILE,
                tls.connect_private_key().clone(),
            ),
            (
                TLS_CONNECT_CERTIFICATE_FILE,
                tls.connect_certificate().clone(),
            ),
            (TLS_ENABLE_MTLS, Some(yes_or_no(*tls.enable_mtls(), false))),
            (
                TLS_VERIFY_NAME_ON_CONNECT,
                Some(yes_or_no(*tls.verify_name_on_connect(), true)),
            ),
            (
                TLS_CLOSE_LINK_ON_EXPIRATION,
                Some(yes_or_no(*tls.close_link_on_expiration(), false)),
            ),
            (
                TCP_SO_RCV_BUF,
                tls.so_rcvbuf().map(|bytes| bytes.to_string()),
            ),
            (
                TCP_SO_SND_BUF,
                tls.so_sndbuf().map(|bytes| bytes.to_string()),
            ),
        ];
        let present = settings
            .iter()
            .filter_map(|(name, value)| Some((*name, value.as_deref()?)));
        Ok(parameters::from_iter(present))
    }
}

/// Unsupported settings of keys and certificates that are not files.
const IN_TEXT: [&str; 10] = [
    TLS_ROOT_CA_CERTIFICATE_RAW,
    TLS_ROOT_CA_CERTIFICATE_BASE64,
    TLS_LISTEN_PRIVATE_KEY_RAW,
    TLS_LISTEN_PRIVATE_KEY_BASE64,
    TLS_LISTEN_CERTIFICATE_RAW,
    TLS_LISTEN_CERTIFICATE_BASE64,
    TLS_CONNECT_PRIVATE_KEY_RAW,
    TLS_CONNECT_PRIVATE_KEY_BASE64,
    TLS_CONNECT_CERTIFICATE_RAW,
    TLS_CONNECT_CERTIFICATE_BASE64,
];

/// Settings of an endpoint for both ends of a link, besides certificates.
pub(crate) struct Settings {
    /// Longest wait for the peer's part of a handshake.
    pub handshake: Duration,
    /// Whether a link ends when the peer's certificate expires.
    pub ends_with_certificate: bool,
}

impl Settings {
    /// # Errors
    /// An unreadable value, and a link without certificates on both sides.
    fn of(endpoint: &Config<'_>) -> ZResult<Self> {
        if !flag(endpoint, TLS_ENABLE_MTLS, false)? {
            bail!("both sides need certificates: set transport/link/tls/enable_mtls");
        }
        if let Some(name) = IN_TEXT.iter().find(|name| endpoint.get(name).is_some()) {
            bail!("{name} is not supported: name a file");
        }
        let handshake = number(endpoint, TLS_HANDSHAKE_TIMEOUT_MS)?;
        Ok(Self {
            handshake: Duration::from_millis(handshake.unwrap_or(TLS_HANDSHAKE_TIMEOUT_MS_DEFAULT)),
            ends_with_certificate: flag(endpoint, TLS_CLOSE_LINK_ON_EXPIRATION, false)?,
        })
    }
}

/// The configuration of a server from the endpoint at which it listens.
pub(crate) fn server(endpoint: &Config<'_>) -> ZResult<(Arc<ServerConfig>, Settings, Admissions)> {
    let settings = Settings::of(endpoint)?;
    let provider = provider();
    let verifier =
        WebPkiClientVerifier::builder_with_provider(authority(endpoint)?.into(), provider.clone())
            .build()?;
    let (certificates, key) = certificates_and_key(
        endpoint,
        TLS_LISTEN_CERTIFICATE_FILE,
        TLS_LISTEN_PRIVATE_KEY_FILE,
    )?;
    let mut config = ServerConfig::builder_with_provider(provider)
        .with_protocol_versions(&[&TLS13])?
        .with_client_cert_verifier(verifier)
        .with_single_cert(certificates, key)?;
    // A resumed session would not check its certificates again.
    config.send_tls13_tickets = 0;
    config.session_storage = Arc::new(NoServerSessionStorage {});
    let admissions = Admissions::of_listener(file(endpoint, TLS_LISTEN_CERTIFICATE_FILE)?);
    Ok((Arc::new(config), settings, admissions))
}

/// The configuration of a client from the endpoint to which it connects.
pub(crate) fn client(endpoint: &Config<'_>) -> ZResult<(Arc<ClientConfig>, Settings)> {
    let settings = Settings::of(endpoint)?;
    if !flag(endpoint, TLS_VERIFY_NAME_ON_CONNECT, true)? {
        bail!("a server's certificate must name its host: remove verify_name_on_connect");
    }
    let (certificates, key) = certificates_and_key(
        endpoint,
        TLS_CONNECT_CERTIFICATE_FILE,
        TLS_CONNECT_PRIVATE_KEY_FILE,
    )?;
    let config = ClientConfig::builder_with_provider(provider())
        .with_protocol_versions(&[&TLS13])?
        .with_root_certificates(authority(endpoint)?)
        .with_client_auth_cert(certificates, key)?;
    Ok((Arc::new(config), settings))
}

/// The settings of the TCP socket.
///
/// # Errors
/// Unreadable values, and both an interface and an address to bind to.
pub(crate) async fn socket<'a>(endpoint: &'a Config<'_>) -> ZResult<TcpSocketConfig<'a>> {
    let interface = endpoint.get(BIND_INTERFACE);
    let bind = match endpoint.get(BIND_SOCKET) {
        Some(_) if interface.is_some() => {
            bail!("{BIND_SOCKET} and {BIND_INTERFACE} exclude each other: remove one")
        }
        Some(address) => Some(resolve(address).await?),
        None => None,
    };
    Ok(TcpSocketConfig::new(
        number(endpoint, TCP_SO_SND_BUF)?,
        number(endpoint, TCP_SO_RCV_BUF)?,
        interface,
        bind,
        parse_dscp(endpoint)?,
    ))
}

/// First address of `HOST:PORT`.
pub(crate) async fn resolve(address: &str) -> ZResult<std::net::SocketAddr> {
    let mut found = tokio::net::lookup_host(address).await?;
    let first = found.next();
    Ok(first.ok_or_else(|| zerror!("{address} has no address"))?)
}

fn provider() -> Arc<CryptoProvider> {
    Arc::new(ring::default_provider())
}

/// The only trusted authority. The authorities of browsers are not trusted.
fn authority(endpoint: &Config<'_>) -> ZResult<RootCertStore> {
    let mut roots = RootCertStore::empty();
    for certificate in certificates(file(endpoint, TLS_ROOT_CA_CERTIFICATE_FILE)?)? {
        roots.add(certificate)?;
    }
    Ok(roots)
}

/// The certificates of this side, its own first, and their key.
fn certificates_and_key(
    endpoint: &Config<'_>,
    chain: &str,
    key: &str,
) -> ZResult<(Vec<CertificateDer<'static>>, PrivateKeyDer<'static>)> {
    let key = file(endpoint, key)?;
    let private = PrivateKeyDer::from_pem_file(key).map_err(|e| zerror!("{key}: {e}"))?;
    Ok((certificates(file(endpoint, chain)?)?, private))
}

/// Certificates of a PEM file, one at least.
fn certificates(path: &str) -> ZResult<Vec<CertificateDer<'static>>> {
    let read = CertificateDer::pem_file_iter(path).and_then(Iterator::collect::<Result<Vec<_>, _>>);
    let read = read.map_err(|e| zerror!("{path}: {e}"))?;
    if read.is_empty() {
        bail!("{path} contains no certificate");
    }
    Ok(read)
}

fn file<'a>(endpoint: &'a Config<'_>, name: &str) -> ZResult<&'a str> {
    let path = endpoint.get(name);
    Ok(path.ok_or_else(|| zerror!("TLS needs the file {name}"))?)
}

fn flag(endpoint: &Config<'_>, name: &str, default: bool) -> ZResult<bool> {
    match endpoint.get(name) {
        Some(text) => Ok(text
            .parse()
            .map_err(|_| zerror!("{name} is {text:?}, expected true or false"))?),
        None => Ok(default),
    }
}

fn number<T: std::str::FromStr>(endpoint: &Config<'_>, name: &str) -> ZResult<Option<T>> {
    let text = endpoint.get(name);
    Ok(text
        .map(|text| {
            text.parse()
                .map_err(|_| zerror!("{name} is {text:?}, expected a number"))
        })
        .transpose()?)
}
