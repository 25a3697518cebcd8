//! The same work for many things, on several cores.

use parking_lot::Mutex;

/// Most threads; what is worked on here is done in a moment.
const MOST: usize = 8;

/// How many threads work at one time.
pub(super) fn threads() -> usize {
    let cores = std::thread::available_parallelism();
    cores.map_or(1, usize::from).min(MOST)
}

/// What `work` makes of each thing, in the order of the things. Panics as it does.
pub(super) fn map<T: Send, R: Send>(things: Vec<T>, work: impl Fn(T) -> R + Sync) -> Vec<R> {
    let count = things.len();
    let waiting = Mutex::new(things.into_iter().enumerate());
    let some = || {
        let mut done = Vec::new();
        loop {
            // The lock is let go before the work.
            let next = waiting.lock().next();
            let Some((index, thing)) = next else {
                return done;
            };
            done.push((index, work(thing)));
        }
    };
    let mut done = std::thread::scope(|scope| {
        let others = 1..threads().min(count);
        let others: Vec<_> = others.map(|_| scope.spawn(some)).collect();
        let mut done = some();
        for other in others {
            done.extend(joined(other));
        }
        done
    });
    done.sort_by_key(|(index, _)| *index);
    done.into_iter().map(|(_, made)| made).collect()
}

/// What a thread made; panics as it did.
pub(super) fn joined<T>(job: std::thread::ScopedJoinHandle<'_, T>) -> T {
    job.join()
        .unwrap_or_else(|panic| std::panic::resume_unwind(panic))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn everything_is_done_once_and_in_order() {
        let twice: Vec<usize> = (0..1000).map(|x| 2 * x).collect();
        assert_eq!(map((0..1000).collect(), |x: usize| 2 * x), twice);
        assert!(map(Vec::<usize>::new(), |x| 2 * x).is_empty());
    }
}
