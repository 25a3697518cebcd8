//! Settings of TLS: out of a session's configuration into an endpoint, and out of that
//! into what rustls takes.

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

/// Takes the settings under `transport/link/tls` of a session into its endpoints.
#[derive(Default, Clone, Copy, Debug)]
pub struct TlsConfigurator;

impl ConfigurationInspector<SessionConfig> for TlsConfigurator {
    /// # Errors
    /// A setting that this crate does not offer, by its name.
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
            bail!(
                "transport/link/tls/{name}_base64: keys come out of files here, name one with {name}"
            );
        }
        let yes_or_no = |said: Option<bool>, otherwise| said.unwrap_or(otherwise).to_string();
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
        let said = settings
            .iter()
            .filter_map(|(name, value)| Some((*name, value.as_deref()?)));
        Ok(parameters::from_iter(said))
    }
}

/// Keys and certificates that are no files, which are not offered.
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

/// What both ends of a link have of an endpoint, besides certificates.
pub(crate) struct Settings {
    /// Longest wait for the other side's part of a handshake.
    pub handshake: Duration,
    /// Whether a link ends when the other side's certificate is over.
    pub ends_with_certificate: bool,
}

impl Settings {
    /// # Errors
    /// A value that cannot be read, and the absence of certificates on both sides.
    fn of(endpoint: &Config<'_>) -> ZResult<Self> {
        if !flag(endpoint, TLS_ENABLE_MTLS, false)? {
            bail!("both sides show certificates here: set transport/link/tls/enable_mtls");
        }
        if let Some(name) = IN_TEXT.iter().find(|name| endpoint.get(name).is_some()) {
            bail!("{name}: keys come out of files here");
        }
        let handshake = number(endpoint, TLS_HANDSHAKE_TIMEOUT_MS)?;
        Ok(Self {
            handshake: Duration::from_millis(handshake.unwrap_or(TLS_HANDSHAKE_TIMEOUT_MS_DEFAULT)),
            ends_with_certificate: flag(endpoint, TLS_CLOSE_LINK_ON_EXPIRATION, false)?,
        })
    }
}

/// What a server takes of the endpoint at which it listens.
pub(crate) fn server(endpoint: &Config<'_>) -> ZResult<(Arc<ServerConfig>, Settings, Admissions)> {
    let settings = Settings::of(endpoint)?;
    let provider = provider();
    let verifier =
        WebPkiClientVerifier::builder_with_provider(authority(endpoint)?.into(), provider.clone())
            .build()?;
    let (certificates, key) = shown(
        endpoint,
        TLS_LISTEN_CERTIFICATE_FILE,
        TLS_LISTEN_PRIVATE_KEY_FILE,
    )?;
    let mut config = ServerConfig::builder_with_provider(provider)
        .with_protocol_versions(&[&TLS13])?
        .with_client_cert_verifier(verifier)
        .with_single_cert(certificates, key)?;
    // A session that is resumed has its certificates looked at no more.
    config.send_tls13_tickets = 0;
    config.session_storage = Arc::new(NoServerSessionStorage {});
    let admissions = Admissions::of_listener(file(endpoint, TLS_LISTEN_CERTIFICATE_FILE)?);
    Ok((Arc::new(config), settings, admissions))
}

/// What a client takes of the endpoint to which it connects.
pub(crate) fn client(endpoint: &Config<'_>) -> ZResult<(Arc<ClientConfig>, Settings)> {
    let settings = Settings::of(endpoint)?;
    if !flag(endpoint, TLS_VERIFY_NAME_ON_CONNECT, true)? {
        bail!("a server's certificate must name its host: leave out verify_name_on_connect");
    }
    let (certificates, key) = shown(
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

/// How the socket below is set up.
///
/// # Errors
/// Values that cannot be read, and an interface and an address to bind to at once.
pub(crate) async fn socket<'a>(endpoint: &'a Config<'_>) -> ZResult<TcpSocketConfig<'a>> {
    let interface = endpoint.get(BIND_INTERFACE);
    let bind = match endpoint.get(BIND_SOCKET) {
        Some(_) if interface.is_some() => {
            bail!("{BIND_SOCKET} and {BIND_INTERFACE} exclude each other: leave out one")
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

/// The one authority whose certificates count. Those that browsers trust do not.
fn authority(endpoint: &Config<'_>) -> ZResult<RootCertStore> {
    let mut roots = RootCertStore::empty();
    for certificate in certificates(file(endpoint, TLS_ROOT_CA_CERTIFICATE_FILE)?)? {
        roots.add(certificate)?;
    }
    Ok(roots)
}

/// The certificates that this side shows, its own first, and their key.
fn shown(
    endpoint: &Config<'_>,
    chain: &str,
    key: &str,
) -> ZResult<(Vec<CertificateDer<'static>>, PrivateKeyDer<'static>)> {
    let key = file(endpoint, key)?;
    let private = PrivateKeyDer::from_pem_file(key).map_err(|e| zerror!("{key}: {e}"))?;
    Ok((certificates(file(endpoint, chain)?)?, private))
}

/// Certificates of a file in PEM, one at least.
fn certificates(path: &str) -> ZResult<Vec<CertificateDer<'static>>> {
    let read = CertificateDer::pem_file_iter(path).and_then(Iterator::collect::<Result<Vec<_>, _>>);
    let read = read.map_err(|e| zerror!("{path}: {e}"))?;
    if read.is_empty() {
        bail!("{path}: no certificate in it");
    }
    Ok(read)
}

fn file<'a>(endpoint: &'a Config<'_>, name: &str) -> ZResult<&'a str> {
    let path = endpoint.get(name);
    Ok(path.ok_or_else(|| zerror!("TLS takes a file: {name}"))?)
}

fn flag(endpoint: &Config<'_>, name: &str, otherwise: bool) -> ZResult<bool> {
    match endpoint.get(name) {
        Some(said) => Ok(said
            .parse()
            .map_err(|_| zerror!("{name} is true or false, not {said}"))?),
        None => Ok(otherwise),
    }
}

fn number<T: std::str::FromStr>(endpoint: &Config<'_>, name: &str) -> ZResult<Option<T>> {
    let said = endpoint.get(name);
    Ok(said
        .map(|said| {
            said.parse()
                .map_err(|_| zerror!("{name} is a number, not {said}"))
        })
        .transpose()?)
}
