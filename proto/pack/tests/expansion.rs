//! A home becomes the furniture of a scene: floor first, ceilings, walls, pieces.

mod common;

use common::{changed, flat};
use wheelarm_pack::{FurnitureEntry, MeshScale, PartEntry};

fn named<'a>(furniture: &'a [FurnitureEntry], name: &str) -> &'a FurnitureEntry {
    let found = furniture.iter().find(|entry| entry.name == name);
    found.unwrap_or_else(|| panic!("no {name}"))
}

fn near(a: f64, b: f64) -> bool {
    (a - b).abs() < 1e-9
}

/// Extents of a box along x, y, z in its body.
fn extents(part: &PartEntry) -> [[f64; 2]; 3] {
    let (size, at) = (part.cuboid.expect("a box"), part.at.unwrap_or_default());
    [0, 1, 2].map(|i| [at[i] - size[i] / 2.0, at[i] + size[i] / 2.0])
}

#[test]
fn floor_comes_first_and_carries_every_room_and_wall() {
    let furniture = flat().furniture().unwrap();
    let names: Vec<&str> = furniture.iter().map(|entry| entry.name.as_str()).collect();
    assert_eq!(
        names,
        [
            "floor",
            "ceiling",
            "wall_0",
            "wall_1",
            "wall_2",
            "wall_3",
            "wall_4",
            "table_1",
            "drawer_1",
            "cabinet_1",
            "door_1"
        ]
    );
    let floor = &furniture[0];
    let collision = floor.collision.as_ref().unwrap();
    let [x, y, z] = extents(&collision[0]);
    assert!(x[0] < -0.05 && x[1] > 7.05 && y[0] < -0.05 && y[1] > 4.05);
    assert!(near(z[1], 0.0), "{z:?}");
    // A plate, two rooms, and the sill of the door.
    assert_eq!(floor.parts.len(), 4);
    let materials: Vec<_> = floor.parts.iter().map(|p| p.material.as_deref()).collect();
    assert_eq!(materials[1..3], [Some("parquet"), Some("flat_tiles")]);
    // Only the kitchen has a ceiling; it does not collide.
    assert_eq!(furniture[1].parts.len(), 1);
    assert_eq!(furniture[1].collision, Some(Vec::new()));
}

#[test]
fn walls_are_split_at_openings_and_keep_both_materials() {
    let furniture = flat().furniture().unwrap();
    let wall = named(&furniture, "wall_1");
    assert!(near(wall.yaw_deg, 90.0));
    // Beside the door, above it, beside it.
    let collision = wall.collision.as_ref().unwrap();
    let spans: Vec<_> = collision.iter().map(extents).collect();
    assert_eq!(spans.len(), 3);
    assert!(near(spans[0][0][1], 1.05) && near(spans[0][2][1], 2.5));
    assert!(near(spans[1][0][0], 1.05) && near(spans[1][0][1], 1.95) && near(spans[1][2][0], 2.0));
    assert!(near(spans[2][0][0], 1.95));
    // Below and above the window; two halves of every slab.
    let wall = named(&furniture, "wall_0");
    assert_eq!(wall.collision.as_ref().unwrap().len(), 4);
    assert_eq!(wall.parts.len(), 8);
    let [left, right] = [&wall.parts[0], &wall.parts[1]];
    assert_eq!(left.material.as_deref(), Some("wall_white"));
    assert_eq!(right.material.as_deref(), Some("wall_sage"));
    assert!(near(extents(left)[1][0], 0.0) && near(extents(right)[1][1], 0.0));
}

#[test]
fn corners_are_closed_by_one_of_two_walls() {
    let furniture = flat().furniture().unwrap();
    let south = named(&furniture, "wall_0");
    let parts = south.collision.as_ref().unwrap();
    let end = parts
        .iter()
        .map(|part| extents(part)[0][1])
        .fold(0.0, f64::max);
    // The corner with wall 2: lengthened by half of its thickness.
    assert!(near(end, 7.1 + 0.05), "{end}");
    // The other one begins behind it.
    let east = named(&furniture, "wall_2");
    let hull = east.collision.as_ref().unwrap()[0].hull.as_ref().unwrap();
    let start = hull
        .iter()
        .map(|point| point[0])
        .fold(f64::INFINITY, f64::min);
    assert!(near(start, 0.05), "{start}");
    let top = hull.iter().map(|point| point[2]).fold(0.0, f64::max);
    assert!(top < 2.5 && top > 2.4, "{top}");
    assert!(east.parts[0].prism.is_some());
}

#[test]
fn joints_of_kinds_become_slides_and_hinges_of_pieces() {
    let furniture = flat().furniture().unwrap();
    let slide = named(&furniture, "drawer_1").slide.as_ref().unwrap();
    assert_eq!((slide.on.as_str(), slide.travel), ("table_1", 0.3));
    let door = named(&furniture, "door_1");
    assert!(door.slide.is_none());
    let hinge = door.hinge.as_ref().unwrap();
    assert_eq!((hinge.on.as_str(), hinge.travel_deg), ("cabinet_1", 90.0));
    // Mirrored: the leaf is on the other side and opens the other way round.
    assert_eq!(hinge.axis.map(|c| c + 0.0), [0.0, 0.0, -1.0]);
    assert_eq!(hinge.com.map(|c| c + 0.0), [0.0, -0.4, 0.3]);
    assert_eq!(extents(&door.parts[0])[1], [-0.8, 0.0]);
    // Twice as wide, twice as heavy. Second moments along x, y, z of 0.005, 0.025 and 0.095
    // become 0.01, 0.2 and 0.19.
    assert!(near(hinge.mass, 4.0));
    let [xx, yy, zz] = hinge.inertia;
    assert!(
        near(xx, 0.39) && near(yy, 0.2) && near(zz, 0.21),
        "{:?}",
        hinge.inertia
    );
}

#[test]
fn materials_of_a_piece_replace_those_of_its_kind() {
    let furniture = flat().furniture().unwrap();
    let table = named(&furniture, "table_1");
    assert_eq!(table.material.as_deref(), Some("walnut"));
    assert_eq!(table.parts[1].material.as_deref(), Some("walnut"));
    let mesh = table.parts[1].mesh.as_ref().unwrap();
    assert_eq!(mesh.scale, MeshScale::Uniform(0.5));
    assert_eq!(
        named(&furniture, "drawer_1").material.as_deref(),
        Some("oak")
    );
}

#[test]
fn shapes_that_cannot_be_scaled_unevenly_are_rejected() {
    let round = "parts = [{ cylinder = { radius = 0.1, height = 0.5 } }]\n#";
    let error = changed("kinds/door_leaf.toml", "parts = ", round).unwrap_err();
    assert!(error.to_string().contains("equal factors"), "{error}");
}

#[test]
fn invalid_homes_are_rejected_with_place_and_fix() {
    for (from, to, words) in [
        ("wall = 1\n", "wall = 9\n", "opening[0].wall is 9"),
        ("at = 1.5\n", "at = 4.5\n", "opening[0].at is 4.5 m"),
        (
            "kind = \"table\"",
            "kind = \"tabel\"",
            "one of cabinet, door_leaf, drawer, table",
        ),
        ("name = \"table_1\"", "name = \"wall_1\"", "used twice"),
        ("name = \"hall\"", "name = \"kitchen\"", "used twice"),
        (
            "room = \"kitchen\"",
            "room = \"attic\"",
            "the name of a room",
        ),
        ("on = \"table_1\"", "", "on is absent"),
        ("[5, 4], [0, 4]]", "[0, 4], [5, 4]]", "crossed or touched"),
        (
            "thickness = 0.1",
            "thickness = 0.0",
            "wall[0].thickness is 0 m",
        ),
        (
            "end_height = 1.5",
            "end_height = -1",
            "wall[2].end_height is -1 m",
        ),
        (
            "to = [7.05, -0.05]",
            "to = [-0.05, -0.05]",
            "leave out walls without length",
        ),
        ("height = 2.5", "height = nan", "is NaN"),
        ("scale = [1, 2, 1]", "scale = [1, 0, 1]", "scale is 0"),
        (
            "kind = \"window\"",
            "kind = \"hatch\"",
            "unknown variant `hatch`",
        ),
    ] {
        let error = changed("home.toml", from, to).unwrap_err().to_string();
        assert!(error.contains(words), "{error}");
        assert!(error.starts_with("home.toml: "), "{error}");
    }
}

#[test]
fn meshes_never_collide() {
    let mesh = "{ mesh = { path = \"meshes/leg.obj\" } },\n  { hull";
    let error = changed("kinds/table.toml", "{ hull", mesh).unwrap_err();
    assert!(error.to_string().contains("rendered only"), "{error}");
    // Without colliding shapes of its own, the boxes of a kind collide and its mesh does not.
    let mut files = common::files();
    let text = String::from_utf8(files["kinds/table.toml"].clone()).unwrap();
    let (before, rest) = text.split_once("collision = [").unwrap();
    let (_, after) = rest.split_once("\n]").unwrap();
    files.insert(
        "kinds/table.toml".into(),
        format!("{before}{after}").into_bytes(),
    );
    let pack = wheelarm_pack::Pack::from_files(files).unwrap();
    let furniture = pack.furniture().unwrap();
    let table = named(&furniture, "table_1");
    assert_eq!(table.parts[0].collide, None);
    assert_eq!(table.parts[1].collide, Some(false));
}
