//! Files of a task: its area and itself, as TOML.

use std::collections::BTreeSet;

use serde::Serialize;

use super::NoTasks;
use super::choose::Stock;
use super::spot::Spot;

/// Longest name of the contract, characters.
const LONGEST: usize = 64;
const ORIGIN: &str = "written at the import of the home, from the report on it";
const LICENSE: &str = "CC0-1.0";

/// Simulated time of a task, seconds. The template allows 100 s, and turns in a narrow room
/// alone took up to 196 s.
const TIME_LIMIT: f64 = 240.0;

/// Name and files of a task; its area has the same name.
pub(super) struct Texts {
    pub name: String,
    pub area: String,
    pub task: String,
}

/// Names of tasks, each once.
#[derive(Debug, Default)]
pub(super) struct TaskNames {
    used: BTreeSet<String>,
}

#[derive(Serialize)]
struct AreaTable<'a> {
    origin: &'a str,
    license: &'a str,
    scene: &'a str,
    start: StartTable,
    place: [PlaceTable<'a>; 1],
}

#[derive(Serialize)]
struct StartTable {
    x: [f64; 2],
    y: [f64; 2],
    yaw_deg: [f64; 2],
}

#[derive(Serialize)]
struct PlaceTable<'a> {
    object: &'a str,
    on: &'a str,
    surface: &'a str,
    inwards: [f64; 2],
    along: [f64; 2],
    yaw_deg: [f64; 2],
}

#[derive(Serialize)]
struct TaskTable<'a> {
    origin: &'a str,
    license: &'a str,
    activity: &'a str,
    area: &'a str,
    template: &'a str,
    instructions: [String; 3],
    time_limit: f64,
    object: QueryTable<'a>,
}

#[derive(Serialize)]
struct QueryTable<'a> {
    name: &'a str,
}

impl TaskNames {
    /// `HOME_PIECE_N` within 64 characters; the name of the home is shortened first.
    fn give(&mut self, home: &str, spot: &Spot) -> String {
        let own = format!("_{}_{}", spot.piece, spot.number);
        let mut count = 1;
        loop {
            let own = match count {
                1 => own.clone(),
                count => format!("{own}_{count}"),
            };
            let room = LONGEST.saturating_sub(own.len());
            let home: String = home.chars().take(room).collect();
            let name: String = format!("{home}{own}").chars().rev().take(LONGEST).collect();
            let name: String = name.chars().rev().collect();
            if self.used.insert(name.clone()) {
                return name;
            }
            count += 1;
        }
    }
}

/// The files of the task to lift `object` from `spot`.
///
/// # Errors
/// When a number is not finite.
pub(super) fn task_texts(
    home: &str,
    spot: &Spot,
    object: &Stock,
    names: &mut TaskNames,
) -> Result<Texts, NoTasks> {
    let name = names.give(home, spot);
    let area = AreaTable {
        origin: ORIGIN,
        license: LICENSE,
        scene: home,
        start: StartTable {
            x: spot.start.x,
            y: spot.start.y,
            yaw_deg: spot.start.yaw_deg,
        },
        place: [PlaceTable {
            object: object.name,
            on: &spot.piece,
            surface: &spot.surface,
            inwards: spot.inwards,
            along: spot.along,
            yaw_deg: [-object.yaw_deg, object.yaw_deg],
        }],
    };
    let task = TaskTable {
        origin: ORIGIN,
        license: LICENSE,
        activity: "serve",
        area: &name,
        template: "lift",
        instructions: sentences(spot, object),
        time_limit: TIME_LIMIT,
        object: QueryTable { name: object.name },
    };
    let failed = |folder: &str| {
        let path = format!("{folder}/{name}.toml");
        move |source| NoTasks::Table { path, source }
    };
    Ok(Texts {
        area: toml::to_string(&area).map_err(failed("areas"))?,
        task: toml::to_string(&task).map_err(failed("tasks"))?,
        name,
    })
}

fn sentences(spot: &Spot, object: &Stock) -> [String; 3] {
    let object = object.words;
    let place = match spot.room_words.is_empty() {
        true => format!("the {}", spot.piece_words),
        false => format!("the {} in the {}", spot.piece_words, spot.room_words),
    };
    [
        format!("Pick up the {object} from {place}"),
        format!("Go to {place} and pick up the {object}"),
        format!("Please take the {object} from {place}"),
    ]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_are_unique_and_short() {
        let mut names = TaskNames::default();
        let mut spot = Spot::test("kitchen_cabinet_12", "level_1");
        let first = names.give("anna-flat", &spot);
        assert_eq!(first, "anna-flat_kitchen_cabinet_12_1");
        assert_eq!(
            names.give("anna-flat", &spot),
            "anna-flat_kitchen_cabinet_12_1_2"
        );
        spot.piece = "x".repeat(64);
        for home in ["a", &"h".repeat(64)] {
            let name = names.give(home, &spot);
            assert!(wheelarm_proto::keys::check_name(&name).is_ok(), "{name}");
        }
    }
}
