//! Executes action chunks: one command per image, the time of the next request, and the
//! command while a chunk is pending.

use std::collections::VecDeque;

use wheelarm_proto::v1;

use crate::player::{Player, RowError};

/// Settings of the execution of chunks.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ExecutorOptions {
    /// Rows of a chunk that are executed before the next request, at least 1.
    pub execute: usize,
    /// Rows between a request and the use of its chunk, during which the previous chunk
    /// continues. With 0, time waits during inference.
    pub latency: usize,
    /// Temporal ensemble (Zhao et al. 2023, "ACT"): requests a chunk at every image and
    /// averages the rows of all chunks for it, with weights exp(-k·i), where i = 0 is the
    /// oldest chunk.
    pub ensemble: Option<f64>,
}

/// A chunk that cannot be executed.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum ChunkError {
    /// The number of values differs from rows times row size.
    #[error("the chunk of the policy has {values} values for {rows} rows of {size}")]
    Shape {
        /// Stated number of rows.
        rows: usize,
        /// Numbers of a row.
        size: usize,
        /// Received number of values.
        values: usize,
    },
    /// More rows than the policy's description allows.
    #[error(
        "the chunk of the policy has {rows} rows, and its description allows {most}; set `chunk` of the description"
    )]
    Long {
        /// Received number of rows.
        rows: usize,
        /// Most rows of the description.
        most: usize,
    },
    /// Fewer rows than are executed.
    #[error("the chunk of the policy has {rows} rows; {needed} are executed before its next chunk")]
    Short {
        /// Received number of rows.
        rows: usize,
        /// Rows that are needed.
        needed: usize,
    },
    /// A row without a valid command.
    #[error("row {row} of the policy's chunk: {problem}")]
    Row {
        /// Index, from 0.
        row: usize,
        /// Problem of the row.
        problem: RowError,
    },
}

/// A chunk and the image of its request.
#[derive(Clone, Debug, PartialEq)]
struct Chunk {
    begin: usize,
    rows: Vec<Vec<f64>>,
}

/// Executes the chunks of a policy in one episode.
#[derive(Clone, Debug)]
pub struct ChunkExecutor {
    player: Player,
    options: ExecutorOptions,
    /// Most rows of a chunk.
    most: usize,
    /// Number of images with a command.
    now: usize,
    /// The newest last; more than two only with an ensemble.
    chunks: VecDeque<Chunk>,
}

impl ChunkExecutor {
    /// At the beginning of an episode.
    #[must_use]
    pub fn new(player: Player, options: ExecutorOptions) -> Self {
        let options = ExecutorOptions {
            execute: options.execute.max(1),
            ..options
        };
        Self {
            player,
            options,
            most: usize::MAX,
            now: 0,
            chunks: VecDeque::new(),
        }
    }

    /// Rejects chunks with more than `most` rows, the `chunk` of a policy's description.
    #[must_use]
    pub fn at_most(mut self, most: usize) -> Self {
        self.most = most;
        self
    }

    /// Whether a chunk must be requested at this image.
    #[must_use]
    pub fn needs_chunk(&self) -> bool {
        match self.chunks.back() {
            None => true,
            Some(_) if self.options.ensemble.is_some() => true,
            Some(newest) => {
                self.now >= newest.begin + self.options.latency + self.options.execute
                    || (self.chunks.len() == 1 && self.now >= newest.begin + newest.rows.len())
            }
        }
    }

    /// Adds the chunk that was requested at this image, row-major.
    ///
    /// # Errors
    /// [`ChunkError`]; the chunk is not executed then.
    pub fn add(&mut self, rows: usize, values: &[f32]) -> Result<(), ChunkError> {
        let size = self.player.kind.size();
        if rows.checked_mul(size) != Some(values.len()) {
            let values = values.len();
            return Err(ChunkError::Shape { rows, size, values });
        }
        if rows > self.most {
            let most = self.most;
            return Err(ChunkError::Long { rows, most });
        }
        let needed = match self.options.ensemble {
            Some(_) => 1,
            None => self.options.execute + 2 * self.options.latency,
        };
        if rows < needed {
            return Err(ChunkError::Short { rows, needed });
        }
        let read = |row: &[f32]| -> Vec<f64> { row.iter().copied().map(f64::from).collect() };
        let rows: Vec<Vec<f64>> = values.chunks_exact(size).map(read).collect();
        for (row, values) in rows.iter().enumerate() {
            let checked = self.player.command(values);
            checked.map_err(|problem| ChunkError::Row { row, problem })?;
        }
        let begin = self.now;
        self.chunks.push_back(Chunk { begin, rows });
        Ok(())
    }

    /// The command until the next image; `None` while the first chunk is pending, during which
    /// the robot holds its set points.
    ///
    /// # Errors
    /// [`RowError`] when the mean of chunks is not a rotation.
    pub fn command(&mut self) -> Result<Option<v1::Command>, RowError> {
        let now = self.now;
        self.now += 1;
        let late = self.options.latency;
        // Drop chunks without rows for this or later images.
        self.chunks
            .retain(|chunk| now < chunk.begin + chunk.rows.len());
        let ready = |chunk: &&Chunk| now >= chunk.begin + late;
        let row = match self.options.ensemble {
            Some(k) => mean(self.chunks.iter().filter(ready), now, k),
            None => {
                while self.chunks.get(1).as_ref().is_some_and(ready) {
                    self.chunks.pop_front();
                }
                let due = self.chunks.front().filter(ready);
                due.map(|chunk| chunk.rows[now - chunk.begin].clone())
            }
        };
        row.map(|row| self.player.command(&row)).transpose()
    }
}

/// Weighted mean of the rows of the chunks, oldest first, for an image.
fn mean<'a>(chunks: impl Iterator<Item = &'a Chunk>, now: usize, k: f64) -> Option<Vec<f64>> {
    let mut sum: Option<(Vec<f64>, f64)> = None;
    for (age, chunk) in chunks.enumerate() {
        let weight = wheelarm_proto::exact::powf(std::f64::consts::E, -k * age as f64);
        let row = &chunk.rows[now - chunk.begin];
        let (all, total) = sum.get_or_insert_with(|| (vec![0.0; row.len()], 0.0));
        for (all, value) in all.iter_mut().zip(row) {
            *all += weight * value;
        }
        *total += weight;
    }
    sum.map(|(all, total)| all.into_iter().map(|value| value / total).collect())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::ActionKind;

    fn executor(execute: usize, latency: usize, ensemble: Option<f64>) -> ChunkExecutor {
        let robot = v1::RobotDescription::default();
        let player = Player::new(ActionKind::NextJoints, &robot, 10.0);
        let options = ExecutorOptions {
            execute,
            latency,
            ensemble,
        };
        ChunkExecutor::new(player, options)
    }

    /// Unit of the speeds in tests, small enough to pass the limits.
    const UNIT: f64 = 1.0 / 128.0;

    /// Rows whose forward speed is `at`, `at` + 1, … times [`UNIT`].
    fn chunk(at: usize, rows: usize) -> Vec<f32> {
        let row = |i: usize| {
            let mut row = [0.0; 9];
            row[7] = (at + i) as f32 * UNIT as f32;
            row
        };
        (0..rows).flat_map(row).collect()
    }

    /// Forward speeds of the commands of `images` images, and the images with a request.
    fn simulate(
        mut executor: ChunkExecutor,
        images: usize,
        rows: usize,
    ) -> (Vec<Option<f64>>, Vec<usize>) {
        let (mut speeds, mut requested) = (Vec::new(), Vec::new());
        for image in 0..images {
            if executor.needs_chunk() {
                requested.push(image);
                executor.add(rows, &chunk(100 * image, rows)).unwrap();
            }
            let command = executor.command().unwrap();
            speeds.push(command.map(|command| command.base.unwrap().linear / UNIT));
        }
        (speeds, requested)
    }

    #[test]
    fn rows_are_executed_in_order_before_the_next_request() {
        let (speeds, requested) = simulate(executor(3, 0, None), 7, 5);
        assert_eq!(requested, [0, 3, 6]);
        let wanted = [0.0, 1.0, 2.0, 300.0, 301.0, 302.0, 600.0];
        assert_eq!(speeds, wanted.map(Some));
    }

    #[test]
    fn late_chunk_begins_with_the_row_of_its_image() {
        let (speeds, requested) = simulate(executor(3, 2, None), 12, 7);
        assert_eq!(requested, [0, 5, 10]);
        // No command for two images; then the chunk of image 0 until that of 5 arrives.
        let wanted = [
            None,
            None,
            Some(2.0),
            Some(3.0),
            Some(4.0),
            Some(5.0),
            Some(6.0),
            Some(502.0),
            Some(503.0),
            Some(504.0),
            Some(505.0),
            Some(506.0),
        ];
        assert_eq!(speeds, wanted);
    }

    #[test]
    fn ensemble_is_the_mean_of_the_chunks_for_an_image() {
        let (speeds, requested) = simulate(executor(1, 0, Some(0.0)), 3, 2);
        assert_eq!(requested, [0, 1, 2]);
        // Row 1 of the first chunk and row 0 of the second, and so on.
        assert_eq!(speeds, [0.0, 50.5, 150.5].map(Some));
        let (speeds, _) = simulate(executor(1, 0, Some(2.0)), 2, 2);
        let young = wheelarm_proto::exact::powf(std::f64::consts::E, -2.0);
        let wanted = (1.0 + 100.0 * young) / (1.0 + young);
        assert!((speeds[1].unwrap() - wanted).abs() < 1e-12, "{speeds:?}");
    }

    #[test]
    fn chunk_of_another_shape_or_with_nan_is_an_error() {
        let mut executor = executor(3, 0, None);
        let shape = executor.add(2, &chunk(0, 3)).unwrap_err();
        assert!(matches!(shape, ChunkError::Shape { values: 27, .. }));
        assert!(executor.add(usize::MAX, &[]).is_err());
        let short = executor.add(2, &chunk(0, 2)).unwrap_err();
        assert_eq!(short, ChunkError::Short { rows: 2, needed: 3 });
        let mut described = executor.clone().at_most(3);
        assert_eq!(described.add(3, &chunk(0, 3)), Ok(()));
        let long = described.add(4, &chunk(0, 4)).unwrap_err();
        assert_eq!(long, ChunkError::Long { rows: 4, most: 3 });
        let mut values = chunk(0, 3);
        values[12] = f32::NAN;
        let problem = executor.add(3, &values).unwrap_err();
        assert!(
            matches!(problem, ChunkError::Row { row: 1, .. }),
            "{problem}"
        );
        assert_eq!(executor.command(), Ok(None));
    }
}
