//! Connecting, and listening.

use std::collections::VecDeque;
use std::net::SocketAddr;
use std::sync::Arc;
use std::time::Duration;

use async_trait::async_trait;
use tokio::net::{TcpListener, TcpStream};
use tokio::task::JoinHandle;
use tokio_rustls::rustls::pki_types::ServerName;
use tokio_rustls::rustls::{ClientConfig, ServerConfig};
use tokio_rustls::{TlsAcceptor, TlsConnector, TlsStream};
use tokio_util::sync::CancellationToken;
use zenoh_link_commons::tcp::get_tcp_addrs;
use zenoh_link_commons::{
    LinkManagerUnicastTrait, LinkUnicast, LinkUnicastTrait, ListenersUnicastIP,
    NewLinkChannelSender,
};
use zenoh_protocol::core::{EndPoint, Locator};
use zenoh_result::{ZResult, zerror};

use super::admission::Admissions;
use super::config::{self, Settings};
use super::link::LinkUnicastTls;
use super::peer::Peer;

/// Most concurrent handshakes of a listener. A further one ends the oldest, so that silent peers
/// do not keep others out.
const HANDSHAKES: usize = 256;
/// Pause after a failed accept, mostly because the process has too many open files.
const PAUSE: Duration = Duration::from_millis(100);

/// Opens links over TLS, to others and for others.
#[derive(Debug)]
pub struct LinkManagerUnicastTls {
    links: NewLinkChannelSender,
    listeners: ListenersUnicastIP,
}

impl LinkManagerUnicastTls {
    /// One that hands the links of those who connect to `links`.
    #[must_use]
    pub fn new(links: NewLinkChannelSender) -> Self {
        let listeners = ListenersUnicastIP::new();
        Self { links, listeners }
    }
}

#[async_trait]
impl LinkManagerUnicastTrait for LinkManagerUnicastTls {
    async fn new_link(&self, endpoint: EndPoint) -> ZResult<LinkUnicast> {
        let (address, settings) = (endpoint.address(), endpoint.config());
        let host = host_of(address.as_str())?;
        let name = ServerName::try_from(host.trim_matches(['[', ']']))
            .map_err(|e| zerror!("{host}: {e}"))?
            .to_owned();
        let addresses = get_tcp_addrs(endpoint.address()).await?;
        let (tls, with) = config::client(&settings).map_err(|e| zerror!("{address}: {e}"))?;
        let socket = config::socket(&settings).await?;
        let (socket, ..) = socket
            .new_link_first_reachable(addresses)
            .await
            .map_err(|e| zerror!("connecting to {address}: {e}"))?;
        let link = greet(tls, name, socket, &with)
            .await
            .map_err(|e| zerror!("connecting to {address}: {e}"))?;
        Ok(LinkUnicast::from(link))
    }

    async fn new_listener(&self, endpoint: EndPoint) -> ZResult<Locator> {
        let (address, settings) = (endpoint.address(), endpoint.config());
        let wanted = config::resolve(address.as_str()).await?;
        let (tls, with, admissions) =
            config::server(&settings).map_err(|e| zerror!("{address}: {e}"))?;
        let socket = config::socket(&settings).await?;
        let (socket, local) = socket
            .new_listener(&wanted)
            .map_err(|e| zerror!("listening on {address}: {e}"))?;
        let place = format!("{}:{}", host_of(address.as_str())?, local.port());
        let locator = Locator::new(endpoint.protocol(), place, endpoint.metadata())?;
        let bound = EndPoint::new(
            locator.protocol(),
            locator.address(),
            locator.metadata(),
            endpoint.config(),
        )?;
        let ended = self.listeners.token.child_token();
        let accept = accept(
            socket,
            tls,
            (with, admissions),
            self.links.clone(),
            ended.clone(),
        );
        self.listeners
            .add_listener(bound, local, accept, ended)
            .await?;
        Ok(locator)
    }

    async fn del_listener(&self, endpoint: &EndPoint) -> ZResult<()> {
        let address = config::resolve(endpoint.address().as_str()).await?;
        self.listeners.del_listener(address).await
    }

    async fn get_listeners(&self) -> Vec<EndPoint> {
        self.listeners.get_endpoints()
    }

    async fn get_locators(&self) -> Vec<Locator> {
        self.listeners.get_locators()
    }

    async fn get_locators_noloopback(&self) -> Vec<Locator> {
        self.listeners.get_locators_noloopback()
    }
}

/// The host of `HOST:PORT`, an address of IPv6 with its brackets.
fn host_of(address: &str) -> ZResult<&str> {
    let parts = address.rsplit_once(':');
    let (host, _) = parts.ok_or_else(|| zerror!("{address} is not HOST:PORT"))?;
    Ok(host)
}

/// A client's part of the handshake.
async fn greet(
    tls: Arc<ClientConfig>,
    name: ServerName<'static>,
    socket: TcpStream,
    with: &Settings,
) -> ZResult<Arc<dyn LinkUnicastTrait>> {
    let greeted = TlsConnector::from(tls).connect(name, socket);
    let stream = tokio::time::timeout(with.handshake, greeted).await??;
    let peer = Peer::of(stream.get_ref().1.peer_certificates())?;
    let stream = TlsStream::Client(stream);
    Ok(LinkUnicastTls::of(
        stream,
        peer,
        with.ends_with_certificate,
        None,
    )?)
}

/// Accepts connections until `ended`. Their handshakes run concurrently, so that a peer that does
/// not answer delays no other.
async fn accept(
    listener: TcpListener,
    tls: Arc<ServerConfig>,
    with: (Settings, Admissions),
    links: NewLinkChannelSender,
    ended: CancellationToken,
) -> ZResult<()> {
    let (acceptor, with) = (TlsAcceptor::from(tls), Arc::new(with));
    let mut under_way: VecDeque<JoinHandle<()>> = VecDeque::new();
    while let Some(taken) = ended.run_until_cancelled(listener.accept()).await {
        let (socket, there) = match taken {
            Ok(taken) => taken,
            Err(error) => {
                tracing::warn!("taking a connection: {error}");
                let _ = ended.run_until_cancelled(tokio::time::sleep(PAUSE)).await;
                continue;
            }
        };
        under_way.retain(|handshake| !handshake.is_finished());
        if under_way.len() >= HANDSHAKES
            && let Some(oldest) = under_way.pop_front()
        {
            tracing::warn!("the oldest of {HANDSHAKES} that are connecting is let go");
            oldest.abort();
        }
        let (acceptor, with) = (acceptor.clone(), with.clone());
        let (links, ended) = (links.clone(), ended.clone());
        under_way.push_back(zenoh_runtime::ZRuntime::Acceptor.spawn(async move {
            let greeted = ended.run_until_cancelled(welcome(acceptor, socket, &with));
            match greeted.await {
                Some(Ok(link)) => {
                    let _ = links.send_async(LinkUnicast::from(link)).await;
                }
                Some(Err(error)) => refused(there, &*error),
                None => {}
            }
        }));
    }
    Ok(())
}

/// A server's part of the handshake.
async fn welcome(
    acceptor: TlsAcceptor,
    socket: TcpStream,
    (with, admissions): &(Settings, Admissions),
) -> ZResult<Arc<dyn LinkUnicastTrait>> {
    let stream = tokio::time::timeout(with.handshake, acceptor.accept(socket)).await??;
    let peer = Peer::of(stream.get_ref().1.peer_certificates())?;
    tracing::debug!("{peer:?} connected");
    let admitted = admissions.admitted(&peer);
    let stream = TlsStream::Server(stream);
    Ok(LinkUnicastTls::of(
        stream,
        peer,
        with.ends_with_certificate,
        Some(admitted),
    )?)
}

fn refused(there: SocketAddr, why: &dyn std::error::Error) {
    tracing::warn!("{there} is let go: {why}");
}
