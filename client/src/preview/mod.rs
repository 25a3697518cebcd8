//! What the robot sees, as one local web page: `wheelarm preview`, and inside
//! of `wheelarm teleop`.
//!
//! The page is served from this program alone, without any other resource. It
//! shows and never commands. Pictures come as the server's preview streams, at
//! a level that [`wheelarm_drive::ladder`] chooses by what the link and the browser manage.

mod feed;
mod serve;
mod state;

use std::io::Write;
use std::net::SocketAddr;
use std::process::ExitCode;
use std::time::{Duration, Instant};
use wheelarm_proto::TopicId;

use anyhow::Context;
use clap::Args;
use crossbeam_channel::unbounded;
use tokio::net::TcpListener;
use tokio::sync::watch as latest;

use crate::interrupt::Signals;
pub use serve::Source;
pub use state::state_text;
use wheelarm_drive::watch::{Heard, Line, Situation};
use wheelarm_link::Connect;

/// Where the page is served when nothing else is said.
pub const DEFAULT_ADDRESS: &str = "127.0.0.1:7450";

/// Streams that the page tells of.
const STREAMS: [TopicId; 10] = [
    TopicId::Pose,
    TopicId::JointState,
    TopicId::Odometry,
    TopicId::Evaluation,
    TopicId::Applied,
    TopicId::Contact,
    TopicId::Event,
    TopicId::Clock,
    TopicId::Phase,
    TopicId::EpisodeStop,
];
/// Time between two states of the page.
const STATE: Duration = Duration::from_millis(200);

/// Options of `wheelarm preview`.
#[derive(Args, Clone, Debug)]
pub struct PreviewArgs {
    /// Address of the page. Only 127.0.0.1 unless you say otherwise: everybody
    /// who can reach it can watch.
    #[arg(long, default_value = DEFAULT_ADDRESS, value_name = "ADDRESS:PORT")]
    pub page: SocketAddr,
}

/// A page that is being served.
pub struct Page {
    address: SocketAddr,
}

impl Page {
    /// Serves the page until the runtime ends; takes a free port when the
    /// wanted one is in use.
    ///
    /// # Errors
    /// When the address is not one of this host.
    pub async fn open(wanted: SocketAddr, source: Source) -> anyhow::Result<Self> {
        let listener = match TcpListener::bind(wanted).await {
            Ok(listener) => listener,
            Err(error) if error.kind() == std::io::ErrorKind::AddrInUse => {
                TcpListener::bind(SocketAddr::new(wanted.ip(), 0))
                    .await
                    .with_context(|| format!("listening on {}", wanted.ip()))?
            }
            Err(error) => {
                return Err(error).with_context(|| {
                    format!(
                        "listening on {wanted} for the preview page; choose another with --page ADDRESS:PORT"
                    )
                });
            }
        };
        let address = listener
            .local_addr()
            .context("reading the page's address")?;
        tokio::spawn(serve::serve(listener, source));
        Ok(Self { address })
    }

    /// What to type into a browser.
    #[must_use]
    pub fn address(&self) -> String {
        format!("http://{}", self.address)
    }
}

/// Runs `wheelarm preview` until it is interrupted.
///
/// # Errors
/// When the page's address cannot be used.
pub fn run(connect: &Connect, args: &PreviewArgs) -> anyhow::Result<ExitCode> {
    let runtime = tokio::runtime::Builder::new_multi_thread()
        .worker_threads(2)
        .enable_all()
        .build()
        .context("starting the runtime")?;
    let (link_in, link) = latest::channel(None);
    let (state_in, state) = latest::channel("{}".to_owned());
    let page = runtime.block_on(Page::open(args.page, Source { link, state }))?;
    announce(&page).context("writing the page's address")?;
    let (stop, stopped) = unbounded::<()>();
    let mut signals = {
        let _inside = runtime.enter();
        Signals::listen()?.and_hangup()?
    };
    runtime.spawn(async move {
        signals.next().await;
        drop(stop);
    });
    let (events, heard) = unbounded();
    let _line = Line::open(connect.clone(), STREAMS.to_vec(), events, |heard| heard);
    let began = Instant::now();
    let mut situation = Situation::default();
    let mut due = STATE;
    loop {
        let wait = due.saturating_sub(began.elapsed());
        crossbeam_channel::select! {
            recv(stopped) -> _ => break,
            recv(heard) -> heard => {
                let now = began.elapsed().as_secs_f64();
                match heard {
                    Ok(Heard::Connected(link)) => {
                        situation.connection = wheelarm_drive::watch::Connection::Open;
                        link_in.send_replace(Some(*link));
                    }
                    Ok(Heard::Sample(sample)) => situation.take(*sample, now),
                    Ok(Heard::Robot(robot)) => situation.take_robot(&robot),
                    Ok(Heard::Status(status, round_trip)) => {
                        situation.take_status(*status, round_trip);
                    }
                    Ok(Heard::Silent) => situation.fall_silent(now),
                    Ok(Heard::Lost(reason)) => {
                        if !matches!(situation.connection, wheelarm_drive::watch::Connection::Lost(..)) {
                            eprintln!("not connected: {reason}; trying again");
                        }
                        situation.lose(now, &reason);
                        link_in.send_replace(None);
                    }
                    Err(_) => break,
                }
            }
            default(wait) => {
                due = began.elapsed() + STATE;
                let now = began.elapsed().as_secs_f64();
                state_in.send_replace(state_text(&situation, now));
            }
        }
        if began.elapsed() > due {
            due = began.elapsed() + STATE;
            let now = began.elapsed().as_secs_f64();
            state_in.send_replace(state_text(&situation, now));
        }
    }
    runtime.shutdown_timeout(Duration::from_millis(200));
    Ok(ExitCode::SUCCESS)
}

/// Says where the page is, also from another machine.
fn announce(page: &Page) -> std::io::Result<()> {
    let port = page.address.port();
    let text = format!(
        "page {}\non another machine: ssh -N -L {port}:127.0.0.1:{port} HOST, then http://127.0.0.1:{port}\n",
        page.address()
    );
    let mut out = std::io::stdout().lock();
    out.write_all(text.as_bytes())?;
    out.flush()
}
