//! From a policy's answers to one command at every picture: which row is due,
//! when to ask again, and what to do while an answer is on its way.

use std::collections::VecDeque;

use wheelarm_proto::v1;

use crate::player::{Player, RowError};

/// How answers are carried out.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PilotOptions {
    /// Rows of an answer that are carried out before the next is asked for, 1 at
    /// least.
    pub execute: usize,
    /// Rows between a question and the use of its answer; meanwhile the answer
    /// before goes on. 0: time waits while the policy thinks.
    pub latency: usize,
    /// Asks at every picture and takes the mean of all answers that speak of it,
    /// the one of i questions ago weighted by exp(-k·age) with this k, the oldest
    /// counting most (Zhao et al. 2023, "ACT", temporal ensemble).
    pub ensemble: Option<f64>,
}

/// An answer that cannot be carried out.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum ChunkError {
    /// Another number of values than rows say.
    #[error("the policy answered {values} values for {rows} rows of {size}")]
    Shape {
        /// Rows that it told.
        rows: usize,
        /// Numbers of a row.
        size: usize,
        /// Values that came.
        values: usize,
    },
    /// More rows than the policy said.
    #[error(
        "the policy answered {rows} rows, and its description says {most} at most; describe as many (`chunk`) as it answers"
    )]
    Long {
        /// Rows that came.
        rows: usize,
        /// Most rows that were described.
        most: usize,
    },
    /// Fewer rows than are carried out.
    #[error("the policy answered {rows} rows; {needed} are carried out before its next answer")]
    Short {
        /// Rows that came.
        rows: usize,
        /// Rows that are needed.
        needed: usize,
    },
    /// A row of which no command can be made.
    #[error("row {row} of the policy's answer: {problem}")]
    Row {
        /// Which, from 0.
        row: usize,
        /// What is wrong with it.
        problem: RowError,
    },
}

/// An answer and the picture that it was asked at.
#[derive(Clone, Debug, PartialEq)]
struct Chunk {
    begin: usize,
    rows: Vec<Vec<f64>>,
}

/// Carries out the answers of a policy in one episode.
#[derive(Clone, Debug)]
pub struct Pilot {
    player: Player,
    options: PilotOptions,
    /// Most rows of an answer.
    most: usize,
    /// Pictures that were answered by a command.
    now: usize,
    /// The newest last; more than two only with an ensemble.
    chunks: VecDeque<Chunk>,
}

impl Pilot {
    /// At the beginning of an episode.
    #[must_use]
    pub fn new(player: Player, options: PilotOptions) -> Self {
        let options = PilotOptions {
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

    /// Takes no answer of more than `most` rows: what a policy describes (its `chunk`).
    #[must_use]
    pub fn at_most(mut self, most: usize) -> Self {
        self.most = most;
        self
    }

    /// Whether the policy is to be asked at this picture.
    #[must_use]
    pub fn asks(&self) -> bool {
        match self.chunks.back() {
            None => true,
            Some(_) if self.options.ensemble.is_some() => true,
            Some(newest) => {
                self.now >= newest.begin + self.options.latency + self.options.execute
                    || (self.chunks.len() == 1 && self.now >= newest.begin + newest.rows.len())
            }
        }
    }

    /// Takes the answer to the question asked at this picture: rows one after
    /// the other.
    ///
    /// # Errors
    /// [`ChunkError`]; nothing of it is carried out then.
    pub fn take(&mut self, rows: usize, values: &[f32]) -> Result<(), ChunkError> {
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

    /// The command until the next picture; nothing while the first answer is on
    /// its way, and the robot holds what is in force.
    ///
    /// # Errors
    /// [`RowError`] where the mean of answers is no rotation.
    pub fn command(&mut self) -> Result<Option<v1::Command>, RowError> {
        let now = self.now;
        self.now += 1;
        let late = self.options.latency;
        // What speaks of no picture to come is let go.
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

/// Weighted mean of what the chunks, oldest first, say of a picture.
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

    fn pilot(execute: usize, latency: usize, ensemble: Option<f64>) -> Pilot {
        let robot = v1::RobotDescription::default();
        let player = Player::new(ActionKind::NextJoints, &robot, 10.0);
        let options = PilotOptions {
            execute,
            latency,
            ensemble,
        };
        Pilot::new(player, options)
    }

    /// Speeds are told in these, so that none is absurd.
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

    /// Forward speeds of the commands of `pictures` pictures, and at which it asked.
    fn flown(mut pilot: Pilot, pictures: usize, rows: usize) -> (Vec<Option<f64>>, Vec<usize>) {
        let (mut speeds, mut asked) = (Vec::new(), Vec::new());
        for picture in 0..pictures {
            if pilot.asks() {
                asked.push(picture);
                pilot.take(rows, &chunk(100 * picture, rows)).unwrap();
            }
            let command = pilot.command().unwrap();
            speeds.push(command.map(|command| command.base.unwrap().linear / UNIT));
        }
        (speeds, asked)
    }

    #[test]
    fn rows_are_carried_out_in_their_order_and_then_it_asks_again() {
        let (speeds, asked) = flown(pilot(3, 0, None), 7, 5);
        assert_eq!(asked, [0, 3, 6]);
        let wanted = [0.0, 1.0, 2.0, 300.0, 301.0, 302.0, 600.0];
        assert_eq!(speeds, wanted.map(Some));
    }

    #[test]
    fn a_late_answer_begins_with_the_row_of_its_picture() {
        let (speeds, asked) = flown(pilot(3, 2, None), 12, 7);
        assert_eq!(asked, [0, 5, 10]);
        // Nothing for two pictures; then the answer of picture 0 until that of 5 is there.
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
    fn an_ensemble_is_the_mean_of_what_was_answered_for_a_picture() {
        let (speeds, asked) = flown(pilot(1, 0, Some(0.0)), 3, 2);
        assert_eq!(asked, [0, 1, 2]);
        // Row 1 of the first answer and row 0 of the second, and so on.
        assert_eq!(speeds, [0.0, 50.5, 150.5].map(Some));
        let (speeds, _) = flown(pilot(1, 0, Some(2.0)), 2, 2);
        let young = wheelarm_proto::exact::powf(std::f64::consts::E, -2.0);
        let wanted = (1.0 + 100.0 * young) / (1.0 + young);
        assert!((speeds[1].unwrap() - wanted).abs() < 1e-12, "{speeds:?}");
    }

    #[test]
    fn an_answer_of_another_shape_or_with_no_number_is_an_error() {
        let mut pilot = pilot(3, 0, None);
        let shape = pilot.take(2, &chunk(0, 3)).unwrap_err();
        assert!(matches!(shape, ChunkError::Shape { values: 27, .. }));
        assert!(pilot.take(usize::MAX, &[]).is_err());
        let short = pilot.take(2, &chunk(0, 2)).unwrap_err();
        assert_eq!(short, ChunkError::Short { rows: 2, needed: 3 });
        let mut described = pilot.clone().at_most(3);
        assert_eq!(described.take(3, &chunk(0, 3)), Ok(()));
        let long = described.take(4, &chunk(0, 4)).unwrap_err();
        assert_eq!(long, ChunkError::Long { rows: 4, most: 3 });
        let mut values = chunk(0, 3);
        values[12] = f32::NAN;
        let problem = pilot.take(3, &values).unwrap_err();
        assert!(
            matches!(problem, ChunkError::Row { row: 1, .. }),
            "{problem}"
        );
        assert_eq!(pilot.command(), Ok(None));
    }
}
