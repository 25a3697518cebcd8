//! A video socket: the newest image of every camera that the page shows, with at most
//! three unacknowledged images, so that images never queue.

use std::collections::{BTreeMap, VecDeque};
use std::sync::Arc;
use std::time::Instant;

use bytes::{BufMut, Bytes, BytesMut};
use tokio_tungstenite::tungstenite::Message;
use wheelarm_proto::preview::PreviewLevel;

use crate::encode::{Codec, Encoded, Encoder};
use crate::feed::{Feed, Feeds, Image};
use crate::hub::Event;
use crate::ladder::Ladder;
use crate::pipe::{Close, Entered, Pipe, Shared};
use crate::protocol::{self, Viewing, WantedCamera};
use crate::report::Sent;

/// Most unacknowledged images of a camera.
const FLIGHT: usize = 3;
/// Most cameras of one page.
const CAMERAS: usize = 8;
/// Size of the header before the image, bytes.
const HEADER: usize = 40;

/// A camera that this page shows.
struct Shown {
    index: usize,
    name: String,
    /// Width that the page can show, pixels.
    width: u32,
    ladder: Ladder,
    feed: Arc<Feed>,
    /// The next level, which replaces the current one with its first image.
    next: Option<Arc<Feed>>,
    /// Sequence number of the last image sent; 0 before the first.
    newest: u64,
    seq: u32,
    /// Unacknowledged sequence numbers, and when they were sent, s.
    flight: VecDeque<(u32, f64)>,
    /// Images skipped since the last acknowledgement.
    skipped: u64,
    sent_width: u32,
    codec: Codec,
    encoder: Encoder,
}

impl Shown {
    fn new(
        wanted: WantedCamera,
        name: &str,
        codec: Codec,
        seq: u32,
        feeds: &Feeds,
        now: f64,
    ) -> Self {
        let ladder = Ladder::new(now);
        let (level, _) = rung(codec, ladder.level(), wanted.width);
        Self {
            index: wanted.camera,
            name: name.to_owned(),
            width: wanted.width,
            ladder,
            feed: feeds.get(name, level),
            next: None,
            newest: 0,
            seq,
            flight: VecDeque::new(),
            skipped: 0,
            sent_width: 0,
            codec,
            encoder: Encoder::default(),
        }
    }

    /// Switches to the level that network and page can carry now.
    fn choose(&mut self, feeds: &Feeds, now: f64) {
        self.ladder.decide(now);
        let (level, _) = rung(self.codec, self.ladder.level(), self.width);
        let coming = self.next.as_ref().unwrap_or(&self.feed);
        if coming.level() != level {
            self.next = Some(feeds.get(&self.name, level));
        }
        if let Some(next) = self.next.take_if(|next| next.newest().is_some()) {
            self.feed = next;
            self.newest = 0;
        }
    }

    /// The image to send now, if there is one.
    fn due(&mut self) -> Option<Arc<Image>> {
        let newest = self.feed.newest()?;
        if newest.number == self.newest || self.flight.len() >= FLIGHT {
            return None;
        }
        // Images that arrived meanwhile are skipped before they are encoded.
        if self.newest > 0 {
            self.skipped += newest.number.saturating_sub(self.newest + 1);
        }
        self.newest = newest.number;
        Some(newest)
    }

    fn acknowledged(&mut self, seq: u32, now: f64) {
        while let Some((first, at)) = self.flight.front().copied() {
            if first > seq {
                break;
            }
            self.flight.pop_front();
            self.ladder.arrived(u64::from(first), now - at, now);
        }
        self.ladder.shown(std::mem::take(&mut self.skipped));
    }
}

/// The subscription for a rung of the ladder and a width in pixels, and
/// the bits per second of an encoder.
fn rung(codec: Codec, level: PreviewLevel, width: u32) -> (PreviewLevel, u32) {
    let most = match width {
        0..=320 => PreviewLevel::Low,
        321..=640 => PreviewLevel::Medium,
        _ => PreviewLevel::High,
    };
    match codec {
        Codec::Jpeg => (level.min(most), 0),
        #[cfg(feature = "h264")]
        Codec::H264 => match (level, most) {
            (PreviewLevel::Low, _) => (PreviewLevel::Flat, 200_000),
            (PreviewLevel::High, PreviewLevel::High) => (PreviewLevel::FlatLarge, 1_500_000),
            (PreviewLevel::High, _) => (PreviewLevel::Flat, 700_000),
            _ => (PreviewLevel::Flat, 400_000),
        },
    }
}

/// Serves the socket until it ends; returns the close reason, if there is one.
pub(super) async fn serve(
    shared: &Arc<Shared>,
    pipe: &mut Pipe,
    entered: Entered,
) -> Option<Close> {
    // Viewers share the server's encoding.
    let may_encode = entered.visitor.role.may_drive();
    let mut ends = entered.ends;
    let page = entered.page;
    let joined = Event::Joined(page.clone(), entered.visitor, entered.socket, None);
    shared.hub.send(joined);
    let mut pulse = shared.feeds.pulse();
    let mut cameras = shared.hub.cameras.clone();
    let mut codec = Codec::default();
    let mut wanted: Vec<WantedCamera> = Vec::new();
    let mut shown: Vec<Shown> = Vec::new();
    // Sequence numbers continue when a camera is shown again.
    let mut numbers = BTreeMap::new();
    let began = Instant::now();
    let mut reported = Vec::new();
    loop {
        let now = began.elapsed().as_secs_f64();
        for one in &mut shown {
            one.choose(&shared.feeds, now);
            let Some(image) = one.due() else { continue };
            let (_, bits) = rung(one.codec, one.ladder.level(), one.width);
            let (codec, encoder) = (one.codec, &mut one.encoder);
            // Encoding takes some milliseconds, in which other tasks must run.
            let made = match codec {
                Codec::Jpeg => encoder.encode(codec, &image, bits),
                #[cfg(feature = "h264")]
                Codec::H264 => tokio::task::block_in_place(|| encoder.encode(codec, &image, bits)),
            };
            let Some(made) = made else { continue };
            one.seq += 1;
            numbers.insert(one.index, one.seq);
            one.flight.push_back((one.seq, now));
            one.sent_width = image.width;
            let message = message(&image, one, &made, began);
            if !pipe.send(Message::Binary(message)).await {
                return None;
            }
        }
        let sent = sent(&shown);
        if sent != reported {
            shared.hub.send(Event::Sent(page.clone(), sent.clone()));
            reported = sent;
        }
        let next = tokio::select! {
            biased;
            close = ends.close() => return Some(close),
            next = pipe.next() => next,
            changed = cameras.changed() => {
                if changed.is_err() {
                    return Some(Close::new(1001, "the gateway ends"));
                }
                let names = cameras.borrow_and_update().clone();
                show(&mut shown, &wanted, &names, codec, &numbers, &shared.feeds, now);
                continue;
            }
            changed = pulse.changed() => {
                if changed.is_err() {
                    return Some(Close::new(1001, "the gateway ends"));
                }
                continue;
            }
        };
        let text = match next {
            Ok(Some(text)) => text,
            Ok(None) => return None,
            Err(close) => return Some(close),
        };
        let now = began.elapsed().as_secs_f64();
        match protocol::read::<Viewing>(&text) {
            Ok(Viewing::Want {
                cameras: requested,
                codecs,
            }) => {
                if may_encode {
                    codec = Codec::of(&codecs);
                }
                wanted = requested;
                wanted.truncate(CAMERAS);
                let names = cameras.borrow().clone();
                show(
                    &mut shown,
                    &wanted,
                    &names,
                    codec,
                    &numbers,
                    &shared.feeds,
                    now,
                );
            }
            Ok(Viewing::Ack { camera, seq, .. }) => {
                if let Some(one) = shown.iter_mut().find(|one| one.index == camera) {
                    one.acknowledged(seq, now);
                }
            }
            Ok(Viewing::Key { camera }) => {
                if let Some(one) = shown.iter_mut().find(|one| one.index == camera) {
                    one.encoder.restart();
                }
            }
            Ok(Viewing::Unknown) => {}
            Err(why) => return Some(Close::new(4400, why.to_string())),
        }
    }
}

/// Shows the wanted cameras, and continues those that were shown before.
fn show(
    shown: &mut Vec<Shown>,
    wanted: &[WantedCamera],
    names: &[String],
    codec: Codec,
    numbers: &BTreeMap<usize, u32>,
    feeds: &Feeds,
    now: f64,
) {
    let kept: Vec<Shown> = std::mem::take(shown);
    let mut kept: Vec<Option<Shown>> = kept.into_iter().map(Some).collect();
    for one in wanted {
        let Some(name) = names.get(one.camera) else {
            continue;
        };
        if shown.iter().any(|s: &Shown| s.index == one.camera) {
            continue;
        }
        let before = kept.iter_mut().find_map(|slot| {
            slot.take_if(|known| {
                known.index == one.camera && known.name == *name && known.codec == codec
            })
        });
        let seq = numbers.get(&one.camera).copied().unwrap_or(0);
        let mut next = before.unwrap_or_else(|| Shown::new(*one, name, codec, seq, feeds, now));
        next.width = one.width;
        shown.push(next);
    }
}

/// Codec and width of each camera, by its index.
fn sent(shown: &[Shown]) -> Vec<Sent> {
    let most = shown.iter().map(|one| one.index + 1).max().unwrap_or(0);
    let mut sent = vec![Sent::default(); most];
    for one in shown.iter().filter(|one| one.sent_width > 0) {
        sent[one.index] = Sent {
            codec: one.codec.name(),
            width: one.sent_width,
        };
    }
    sent
}

/// Assembles the message of an image.
fn message(image: &Image, shown: &Shown, made: &Encoded, began: Instant) -> Bytes {
    let mut message = BytesMut::with_capacity(HEADER + made.bytes.len());
    message.put_u8(1);
    message.put_u8(shown.codec.number());
    message.put_u8(u8::from(made.key));
    message.put_u8(u8::try_from(shown.index).unwrap_or(u8::MAX));
    message.put_u16_le(u16::try_from(image.width).unwrap_or(u16::MAX));
    message.put_u16_le(u16::try_from(image.height).unwrap_or(u16::MAX));
    message.put_u32_le(shown.seq);
    message.put_u32_le(0);
    message.put_u64_le(image.tick);
    message.put_u64_le(image.stamp_nanos);
    message.put_u64_le(u64::try_from(began.elapsed().as_micros()).unwrap_or(u64::MAX));
    message.extend_from_slice(&made.bytes);
    message.freeze()
}
