//! Which reached surfaces get a task, and which object.

use std::collections::{BTreeMap, BTreeSet};

use super::spot::Spot;

/// An upright object of the assets.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Stock {
    /// Name of its file in `assets/objects`.
    pub name: &'static str,
    /// Its words.
    pub words: &'static str,
    /// Free height that it needs with the hand above it, metres.
    pub headroom: f64,
    /// Depth of a surface that it needs, metres.
    pub depth: f64,
    /// Largest rotation from the direction inwards, degrees. Round objects turn freely; others
    /// have their grasps at the sides.
    pub yaw_deg: f64,
}

/// The objects of tasks, in the order in which tasks use them.
pub(super) const STOCK: [Stock; 7] = [
    stock("mustard", "mustard", 0.45, 0.26, 20.0),
    stock("blue_mug", "blue mug", 0.3, 0.3, 20.0),
    stock("tomato_soup", "tomato soup", 0.3, 0.2, 180.0),
    stock("silver_bottle", "silver bottle", 0.5, 0.2, 180.0),
    stock("coke", "can of cola", 0.3, 0.2, 180.0),
    stock("meat_can", "meat can", 0.3, 0.26, 20.0),
    stock("grey_cup", "grey cup", 0.3, 0.2, 180.0),
];

const fn stock(
    name: &'static str,
    words: &'static str,
    headroom: f64,
    depth: f64,
    yaw_deg: f64,
) -> Stock {
    Stock {
        name,
        words,
        headroom,
        depth,
        yaw_deg,
    }
}

/// At most `most` spots, and the others: those to which the chair gets from the start of the
/// home, then the others; from every room in turn, kinds of furniture that the room has no
/// task on first, then the longest.
pub(super) fn choose(spots: Vec<Spot>, most: usize) -> (Vec<Spot>, Vec<Spot>) {
    let (within, reached): (Vec<Spot>, Vec<Spot>) = spots.into_iter().partition(|s| s.within);
    let (mut chosen, mut rest) = in_turn(reached, most);
    let (more, others) = in_turn(within, most - chosen.len());
    chosen.extend(more);
    rest.extend(others);
    (chosen, rest)
}

/// At most `most` spots of every room in turn, and the others.
fn in_turn(spots: Vec<Spot>, most: usize) -> (Vec<Spot>, Vec<Spot>) {
    let mut rooms: BTreeMap<String, Vec<Spot>> = BTreeMap::new();
    for spot in spots {
        rooms.entry(spot.room_words.clone()).or_default().push(spot);
    }
    let mut queues: Vec<std::vec::IntoIter<Spot>> = Vec::new();
    for mut spots in rooms.into_values() {
        spots.sort_by(|a, b| {
            let by_length = b.length().total_cmp(&a.length());
            by_length
                .then_with(|| a.piece.cmp(&b.piece))
                .then(a.number.cmp(&b.number))
        });
        let mut chosen_categories = BTreeSet::new();
        let (first, others): (Vec<Spot>, Vec<Spot>) = spots
            .into_iter()
            .partition(|spot| chosen_categories.insert(spot.category.clone()));
        queues.push([first, others].concat().into_iter());
    }
    let mut chosen = Vec::new();
    while chosen.len() < most {
        let before = chosen.len();
        for queue in &mut queues {
            if chosen.len() < most {
                chosen.extend(queue.next());
            }
        }
        if chosen.len() == before {
            break;
        }
    }
    (chosen, queues.into_iter().flatten().collect())
}

/// The object of the task with this index: those that fit take turns.
pub(super) fn object<'a>(stock: &[&'a Stock], spot: &Spot, index: usize) -> Option<&'a Stock> {
    let fits = |object: &Stock| object.headroom <= spot.headroom && object.depth <= spot.depth;
    let order = (0..stock.len()).map(|step| stock[(index + step) % stock.len()]);
    order.into_iter().find(|object| fits(object))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn spot(piece: &str, category: &str, room: &str, length: f64) -> Spot {
        Spot {
            category: category.into(),
            room_words: room.into(),
            along: [0.0, length],
            ..Spot::test(piece, "level_1")
        }
    }

    #[test]
    fn rooms_and_kinds_take_turns() {
        let spots = vec![
            spot("a", "table", "kitchen", 0.9),
            spot("b", "table", "kitchen", 0.8),
            spot("c", "shelf", "kitchen", 0.1),
            spot("d", "desk", "bedroom", 0.2),
        ];
        let (chosen, rest) = choose(spots.clone(), 3);
        let names = |spots: &[Spot]| spots.iter().map(|s| s.piece.clone()).collect::<Vec<_>>();
        assert_eq!(names(&chosen), ["d", "a", "c"]);
        assert_eq!(names(&rest), ["b"]);
        let (all, none) = choose(spots, 24);
        assert_eq!((all.len(), none.len()), (4, 0));
    }

    #[test]
    fn low_and_narrow_spots_get_small_objects() {
        let stock: Vec<&Stock> = STOCK.iter().collect();
        let narrow = spot("a", "shelf", "hall", 0.2);
        for index in 0..STOCK.len() {
            let object = object(&stock, &narrow, index).unwrap();
            assert!(object.headroom < 0.4 && object.depth < 0.26, "{object:?}");
        }
        let low = Spot {
            headroom: 0.2,
            ..narrow
        };
        assert_eq!(object(&stock, &low, 0), None);
        assert_eq!(object(&[], &low, 0), None);
    }
}
