//! One connection.

use std::fmt;
use std::future::poll_fn;
use std::net::{Shutdown, SocketAddr};
use std::pin::Pin;
use std::sync::Arc;
use std::task::{Context, Poll, ready};
use std::time::Duration;

use async_trait::async_trait;
use parking_lot::Mutex;
use socket2::SockRef;
use time::OffsetDateTime;
use tokio::io::{AsyncRead, AsyncWrite, ReadBuf};
use tokio::net::TcpStream;
use tokio::sync::Mutex as Turn;
use tokio_rustls::TlsStream;
use zenoh_link_commons::{LinkAuthId, LinkUnicastTrait, get_ip_interface_names};
use zenoh_protocol::core::{Locator, Priority};
use zenoh_protocol::transport::BatchSize;
use zenoh_result::{ZResult, zerror};

use super::TLS_LOCATOR_PREFIX;
use super::admission::Admitted;
use super::peer::Peer;

/// Longest wait for a peer to take the last words of a connection.
const ANNOUNCE_END: Duration = Duration::from_secs(1);
/// Longest wait for it to hang up as well. Zenoh closes one connection after another.
const HANGING_UP: Duration = Duration::from_millis(200);
/// How often the day of a certificate is looked at: a host's clock may be set.
const LOOK: Duration = Duration::from_secs(600);

/// A connection over TLS.
///
/// Reading and writing are polled from different threads. Each poll has the stream to
/// itself by a lock that is never held while a task waits, so that one direction does
/// not wait for the other's network. The socket keeps who waits for either apart.
pub struct LinkUnicastTls {
    stream: Mutex<TlsStream<TcpStream>>,
    /// Held for a whole message.
    writing: Turn<Written>,
    /// Held for a whole message; what a peer that connected to this side is to the rules.
    reading: Turn<Option<Admitted>>,
    here: SocketAddr,
    there: SocketAddr,
    source: Locator,
    destination: Locator,
    peer: LinkAuthId,
    /// When nothing is read any more, for a certificate of the peer is over.
    until: Option<OffsetDateTime>,
}

/// What was written so far.
#[derive(Debug, Default)]
struct Written {
    any: bool,
    /// A message was cut off: who wrote it was cancelled.
    is_cut: bool,
}

impl LinkUnicastTls {
    /// A link of a stream whose handshake is done. `ends_with_certificate`: reading
    /// fails when a certificate of `peer` is over, or when `admitted` is over, which
    /// ends the link.
    pub(crate) fn of(
        stream: TlsStream<TcpStream>,
        peer: Peer,
        ends_with_certificate: bool,
        admitted: Option<Admitted>,
    ) -> ZResult<Arc<Self>> {
        let (socket, _) = stream.get_ref();
        socket.set_nodelay(true)?;
        let (here, there) = (socket.local_addr()?, socket.peer_addr()?);
        let locator =
            |address: SocketAddr| Locator::new(TLS_LOCATOR_PREFIX, address.to_string(), "");
        let name = match &admitted {
            Some(admitted) => admitted.subject(),
            None => peer.name,
        };
        Ok(Arc::new(Self {
            writing: Turn::default(),
            reading: Turn::new(admitted),
            here,
            there,
            source: locator(here)?,
            destination: locator(there)?,
            peer: LinkAuthId::Tls(name),
            until: ends_with_certificate.then_some(peer.until),
            stream: Mutex::new(stream),
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

    /// Writes the connection's buffer to the socket; otherwise it would wait for the next message.
    async fn flush(&self) -> ZResult<()> {
        poll_fn(|cx| Pin::new(&mut *self.stream.lock()).poll_flush(cx))
            .await
            .map_err(|e| zerror!("writing {self}: {e}").into())
    }

    /// Writes all of a message, or as much as possible at once; the number of written bytes.
    async fn send(&self, message: &[u8], all: bool) -> ZResult<usize> {
        let mut so_far = self.writing.lock().await;
        if so_far.is_cut {
            return Err(zerror!("writing {self}: an earlier message is incomplete").into());
        }
        let mut written = 0;
        while written < message.len() {
            match poll_fn(|cx| self.poll_write(cx, &message[written..])).await? {
                0 => {
                    return Err(
                        zerror!("writing {self}: the connection accepts no more bytes").into(),
                    );
                }
                more => written += more,
            }
            so_far.any = true;
            so_far.is_cut = all && written < message.len();
            if !so_far.is_cut {
                break;
            }
        }
        self.flush().await?;
        Ok(written)
    }

    /// Reads until the peer's certificate expires, or its user is removed or changed.
    async fn while_known<T>(
        &self,
        admitted: &mut Option<Admitted>,
        read: impl Future<Output = ZResult<T>>,
    ) -> ZResult<T> {
        let over = async {
            let Some(until) = self.until else {
                return std::future::pending().await;
            };
            while let Ok(left) = Duration::try_from(until - OffsetDateTime::now_utc()) {
                tokio::time::sleep(left.min(LOOK)).await;
            }
        };
        let changed = async {
            match admitted {
                Some(admitted) => admitted.over().await,
                None => std::future::pending().await,
            }
        };
        tokio::select! {
            biased;
            () = over => Err(zerror!("reading {self}: the peer's certificate has expired").into()),
            () = changed => Err(zerror!("reading {self}: the peer's user was changed or removed").into()),
            read = read => read,
        }
    }

    /// Announces the end to the peer. If bytes were written and no task reads here, waits a moment
    /// until the peer closes too: bytes that it still sends would make the system discard bytes that
    /// it has not received yet.
    async fn announce_end(&self) {
        let so_far = self.writing.lock().await;
        let announced = poll_fn(|cx| Pin::new(&mut *self.stream.lock()).poll_shutdown(cx)).await;
        let (true, Ok(()), Ok(_turn)) = (so_far.any, announced, self.reading.try_lock()) else {
            return;
        };
        let mut rest = [0; 4096];
        let hung_up =
            async { while let Ok(1..) = poll_fn(|cx| self.poll_read(cx, &mut rest)).await {} };
        let _ = tokio::time::timeout(HANGING_UP, hung_up).await;
    }
}

#[async_trait]
impl LinkUnicastTrait for LinkUnicastTls {
    /// Ends both directions: waiting reads and writes fail.
    async fn close(&self) -> ZResult<()> {
        let announced = tokio::time::timeout(ANNOUNCE_END, self.announce_end()).await;
        tracing::trace!("{self} is closed: {announced:?}");
        let _ = SockRef::from(self.stream.lock().get_ref().0).shutdown(Shutdown::Both);
        Ok(())
    }

    async fn write(&self, buffer: &[u8], _priority: Option<Priority>) -> ZResult<usize> {
        self.send(buffer, false).await
    }

    async fn write_all(&self, buffer: &[u8], _priority: Option<Priority>) -> ZResult<()> {
        self.send(buffer, true).await.map(drop)
    }

    async fn read(&self, buffer: &mut [u8], _priority: Option<Priority>) -> ZResult<usize> {
        let mut turn = self.reading.lock().await;
        self.while_known(&mut turn, poll_fn(|cx| self.poll_read(cx, buffer)))
            .await
    }

    async fn read_exact(&self, buffer: &mut [u8], _priority: Option<Priority>) -> ZResult<()> {
        let mut turn = self.reading.lock().await;
        let all = async {
            let mut rest = buffer;
            while !rest.is_empty() {
                match poll_fn(|cx| self.poll_read(cx, rest)).await? {
                    0 => return Err(zerror!("reading {self}: the peer has closed it").into()),
                    read => rest = &mut rest[read..],
                }
            }
            Ok(())
        };
        self.while_known(&mut turn, all).await
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
