//! Furniture kinds: shapes from sizes and the design of a style.

mod bath;
mod bedroom;
mod kitchen;
mod living;
mod opening;
mod small;
mod storage;
mod tables;
mod wall;

use super::random::Random;
use super::shape::{Design, Model};

pub use opening::{door_frame, front_door, window};
pub use small::{SmallObject, on, small_objects};
pub use wall::{WallPiece, wall_pieces};

/// The shapes of a kind of the plans; `None` for an unknown one.
#[must_use]
pub fn model(
    kind: &str,
    category: &str,
    size: [f64; 3],
    design: Design,
    random: &mut Random,
) -> Option<Model> {
    let mut model = Model::new(category);
    let m = &mut model;
    match kind {
        "cabinet" => kitchen::cabinet(m, size, design),
        "drawers" => kitchen::drawers(m, size, design),
        "sink" => kitchen::sink(m, size, design),
        "cooker" => kitchen::cooker(m, size),
        "dishwasher" => kitchen::dishwasher(m, size),
        "fridge" => kitchen::fridge(m, size),
        "tall_cabinet" => kitchen::tall_cabinet(m, size, design),
        "table" => tables::table(m, size, design),
        "round_table" => tables::round_table(m, size, design),
        "desk" => tables::work_table(m, size, design),
        "coffee_table" => tables::coffee_table(m, size, design),
        "side_table" => tables::side_table(m, size, design),
        "console" => tables::console(m, size, design),
        "nightstand" => tables::nightstand(m, size, design),
        "chair" => living::chair(m, size, design),
        "sofa" => living::sofa(m, size, design, random),
        "armchair" => living::armchair(m, size, design),
        "stool" => living::stool(m, size, design),
        "rug" => living::rug(m, size),
        "floor_lamp" => living::floor_lamp(m, size, design),
        "plant" => living::plant(m, size, random),
        "bed" | "single_bed" => bedroom::bed(m, size, design, kind == "bed"),
        "wardrobe" => storage::wardrobe(m, size, design),
        "dresser" => storage::dresser(m, size, design),
        "tv_board" => storage::tv_board(m, size, design),
        "bookcase" => storage::bookcase(m, size, random),
        "shelf" => storage::shelf(m, size, random),
        "shoe_cabinet" => storage::shoe_cabinet(m, size, design),
        "toy_box" => storage::toy_box(m, size),
        "basin" => bath::basin(m, size, design),
        "toilet" => bath::toilet(m, size),
        "shower" => bath::shower(m, size),
        "tub" => bath::tub(m, size),
        "washing_machine" => bath::washing_machine(m, size),
        "laundry_basket" => bath::laundry_basket(m, size),
        "bin" => bath::bin(m, size),
        _ => return None,
    }
    Some(model)
}
