//! One connection.

use std::fmt;
use std::future::poll_fn;
use std::net::{Shutdown, SocketAddr};
use std::pin::Pin;
use std::sync::{Arc, Weak};
use std::task::{Context, Poll, ready};
use std::time::Duration;

use async_trait::async_trait;
use parking_lot::Mutex;
use socket2::SockRef;
use tokio::io::{AsyncRead, AsyncWrite, ReadBuf};
use tokio::net::TcpStream;
use tokio::sync::Mutex as Turn;
use tokio_rustls::TlsStream;
use zenoh_link_commons::tls::expiration::{LinkCertExpirationManager, LinkWithCertExpiration};
use zenoh_link_commons::{LinkAuthId, LinkUnicastTrait, get_ip_interface_names};
use zenoh_protocol::core::{Locator, Priority};
use zenoh_protocol::transport::BatchSize;
use zenoh_result::{ZResult, zerror};

use super::TLS_LOCATOR_PREFIX;
use super::peer::Peer;

/// Longest wait for a peer to take the last words of a connection.
const LAST_WORDS: Duration = Duration::from_secs(1);

/// A connection over TLS.
///
/// Reading and writing are polled from different threads. Each poll has the stream to
/// itself by a lock that is never held while a task waits, so that one direction does
/// not wait for the other's network. The socket keeps who waits for either apart.
pub struct LinkUnicastTls {
    stream: Mutex<TlsStream<TcpStream>>,
    // A whole message at a time.
    writing: Turn<()>,
    reading: Turn<()>,
    here: SocketAddr,
    there: SocketAddr,
    source: Locator,
    destination: Locator,
    peer: LinkAuthId,
    expiration: Option<LinkCertExpirationManager>,
}

impl LinkUnicastTls {
    /// A link of a stream whose handshake is done. `ends_with_certificate`: it is closed
    /// when a certificate of `peer` is over.
    pub(crate) fn of(
        stream: TlsStream<TcpStream>,
        peer: Peer,
        ends_with_certificate: bool,
    ) -> ZResult<Arc<Self>> {
        let (socket, _) = stream.get_ref();
        socket.set_nodelay(true)?;
        let (here, there) = (socket.local_addr()?, socket.peer_addr()?);
        let locator =
            |address: SocketAddr| Locator::new(TLS_LOCATOR_PREFIX, address.to_string(), "");
        let (source, destination) = (locator(here)?, locator(there)?);
        Ok(Arc::new_cyclic(|link: &Weak<Self>| Self {
            stream: Mutex::new(stream),
            writing: Turn::new(()),
            reading: Turn::new(()),
            here,
            there,
            source,
            destination,
            expiration: ends_with_certificate.then(|| {
                let link = link.clone();
                LinkCertExpirationManager::new(link, here, there, TLS_LOCATOR_PREFIX, peer.until)
            }),
            peer: LinkAuthId::Tls(peer.name),
        }))
    }

    fn poll_read(&self, cx: &mut Context<'_>, buffer: &mut [u8]) -> Poll<ZResult<usize>> {
        let mut into = ReadBuf::new(buffer);
        let read = Pin::new(&mut *self.stream.lock()).poll_read(cx, &mut into);
        ready!(read).map_err(|e| zerror!("reading {self}: {e}"))?;
        Poll::Ready(Ok(into.filled().len()))
    }

    fn poll_write(&self, cx: &mut Context<'_>, buffer: &[u8]) -> Poll<ZResult<usize>> {
        let written = Pin::new(&mut *self.stream.lock()).poll_write(cx, buffer);
        written.map_err(|e| zerror!("writing {self}: {e}").into())
    }

    /// What was written may lie in the connection's own buffer: nothing but this takes
    /// it to the socket before the next message.
    async fn flush(&self) -> ZResult<()> {
        poll_fn(|cx| Pin::new(&mut *self.stream.lock()).poll_flush(cx))
            .await
            .map_err(|e| zerror!("writing {self}: {e}").into())
    }

    /// Tells the peer that this was all, for as long as it listens, then ends both
    /// directions: who waits to read or to write here hears it.
    async fn end(&self) {
        let told = async {
            let _turn = self.writing.lock().await;
            poll_fn(|cx| Pin::new(&mut *self.stream.lock()).poll_shutdown(cx)).await
        };
        let told = tokio::time::timeout(LAST_WORDS, told).await;
        tracing::trace!("{self} is closed: {told:?}");
        let _ = SockRef::from(self.stream.lock().get_ref().0).shutdown(Shutdown::Both);
    }
}

#[async_trait]
impl LinkUnicastTrait for LinkUnicastTls {
    async fn close(&self) -> ZResult<()> {
        let Some(expiration) = &self.expiration else {
            self.end().await;
            return Ok(());
        };
        if !expiration.set_closing() {
            // Its certificate was over in the same moment.
            return expiration.wait_for_expiration_task().await;
        }
        expiration.cancel_expiration_task();
        self.end().await;
        expiration.wait_for_expiration_task().await
    }

    async fn write(&self, buffer: &[u8], _priority: Option<Priority>) -> ZResult<usize> {
        let _turn = self.writing.lock().await;
        let written = poll_fn(|cx| self.poll_write(cx, buffer)).await?;
        self.flush().await?;
        Ok(written)
    }

    async fn write_all(&self, buffer: &[u8], _priority: Option<Priority>) -> ZResult<()> {
        let _turn = self.writing.lock().await;
        let mut rest = buffer;
        while !rest.is_empty() {
            match poll_fn(|cx| self.poll_write(cx, rest)).await? {
                0 => return Err(zerror!("writing {self}: it takes nothing any more").into()),
                written => rest = &rest[written..],
            }
        }
        self.flush().await
    }

    async fn read(&self, buffer: &mut [u8], _priority: Option<Priority>) -> ZResult<usize> {
        let _turn = self.reading.lock().await;
        poll_fn(|cx| self.poll_read(cx, buffer)).await
    }

    async fn read_exact(&self, buffer: &mut [u8], _priority: Option<Priority>) -> ZResult<()> {
        let _turn = self.reading.lock().await;
        let mut rest = buffer;
        while !rest.is_empty() {
            match poll_fn(|cx| self.poll_read(cx, rest)).await? {
                0 => return Err(zerror!("reading {self}: the peer has closed it").into()),
                read => rest = &mut rest[read..],
            }
        }
        Ok(())
    }

    fn get_src(&self) -> &Locator {
        &self.source
    }

    fn get_dst(&self) -> &Locator {
        &self.destination
    }

    /// As much as Zenoh can put into a message.
    fn get_mtu(&self) -> BatchSize {
        BatchSize::MAX
    }

    fn get_interface_names(&self) -> Vec<String> {
        get_ip_interface_names(&self.here)
    }

    fn is_reliable(&self) -> bool {
        true
    }

    fn is_streamed(&self) -> bool {
        true
    }

    fn get_auth_id(&self) -> &LinkAuthId {
        &self.peer
    }
}

#[async_trait]
impl LinkWithCertExpiration for LinkUnicastTls {
    async fn expire(&self) -> ZResult<()> {
        let closing = self.expiration.as_ref();
        if closing.is_none_or(LinkCertExpirationManager::set_closing) {
            self.end().await;
        }
        Ok(())
    }
}

impl fmt::Display for LinkUnicastTls {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{} => {}", self.here, self.there)
    }
}

impl fmt::Debug for LinkUnicastTls {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("LinkUnicastTls")
            .field("here", &self.here)
            .field("there", &self.there)
            .field("peer", &self.peer)
            .finish_non_exhaustive()
    }
}
