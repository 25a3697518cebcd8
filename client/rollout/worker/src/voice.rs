//! What a worker says: lines on its standard output, each written whole.

use std::io::Write;
use std::sync::Arc;

use parking_lot::Mutex;
use wheelarm_rollout::protocol::{Said, Told};

/// The worker's voice.
#[derive(Clone, Default)]
pub struct Voice(Arc<Mutex<()>>);

/// The voice of one order.
#[derive(Clone)]
pub struct OrderVoice {
    voice: Voice,
    order: u64,
}

impl Voice {
    /// Says a line.
    pub fn say(&self, said: &Said) {
        let Ok(mut line) = serde_json::to_vec(said) else {
            return;
        };
        line.push(b'\n');
        let _turn = self.0.lock();
        let mut out = std::io::stdout().lock();
        // Whoever does not listen any more has closed the input as well.
        let _ = out.write_all(&line).and_then(|()| out.flush());
    }

    /// The voice of an order.
    #[must_use]
    pub fn of(&self, order: u64) -> OrderVoice {
        OrderVoice {
            voice: self.clone(),
            order,
        }
    }
}

impl OrderVoice {
    /// Tells something of the order.
    pub fn tell(&self, told: Told) {
        let order = self.order;
        self.voice.say(&Said::Of { order, told });
    }
}
