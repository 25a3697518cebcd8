//! Parallel map over items.

use std::sync::{Mutex, PoisonError};

/// Largest number of threads; the jobs are short.
const MOST: usize = 8;

/// Number of threads that run at the same time.
#[must_use]
pub fn threads() -> usize {
    let cores = std::thread::available_parallelism();
    cores.map_or(1, usize::from).min(MOST)
}

/// Results of `work` for each item, in order. Propagates panics.
pub fn map<T: Send, R: Send>(items: Vec<T>, work: impl Fn(T) -> R + Sync) -> Vec<R> {
    let count = items.len();
    let waiting = Mutex::new(items.into_iter().enumerate());
    let some = || {
        let mut done = Vec::new();
        loop {
            // The lock is released before the work.
            let next = waiting
                .lock()
                .unwrap_or_else(PoisonError::into_inner)
                .next();
            let Some((index, item)) = next else {
                return done;
            };
            done.push((index, work(item)));
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

/// Result of a thread; propagates panics.
pub fn joined<T>(job: std::thread::ScopedJoinHandle<'_, T>) -> T {
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
