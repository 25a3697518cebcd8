//! A small home: two rooms, a door, a window, a table, a chair, a cabinet with a hinged door.

use std::fmt::Write as _;
use std::io::{Cursor, Write as _};

use zip::write::SimpleFileOptions;
use zip::{CompressionMethod, ZipWriter};

/// Files of a zip archive, in order.
#[derive(Clone)]
pub struct Flat {
    /// Paths and contents.
    pub files: Vec<(String, Vec<u8>)>,
}

/// Corners and faces of boxes as OBJ, one group each: name, material, lower and upper corner.
pub fn boxes(parts: &[(&str, &str, [f64; 3], [f64; 3])]) -> String {
    let mut text = String::new();
    let mut first = 1;
    for (group, material, low, high) in parts {
        for k in 0..8 {
            let pick = |axis: usize| {
                if k >> axis & 1 == 1 {
                    high[axis]
                } else {
                    low[axis]
                }
            };
            writeln!(text, "v {} {} {}", pick(0), pick(1), pick(2)).unwrap();
        }
        writeln!(text, "g {group}\nusemtl {material}").unwrap();
        // Outwards, with y up.
        for [a, b, c, d] in [
            [0, 2, 3, 1],
            [4, 5, 7, 6],
            [0, 1, 5, 4],
            [2, 6, 7, 3],
            [0, 4, 6, 2],
            [1, 3, 7, 5],
        ] {
            let [a, b, c, d] = [a, b, c, d].map(|k| k + first);
            writeln!(text, "f {a} {b} {c} {d}").unwrap();
        }
        first += 8;
    }
    text
}

fn table() -> String {
    boxes(&[
        ("top", "flblonde", [-0.6, 0.70, -0.4], [0.6, 0.74, 0.4]),
        (
            "leg1",
            "flblonde",
            [-0.58, 0.0, -0.38],
            [-0.53, 0.70, -0.33],
        ),
        ("leg2", "flblonde", [0.53, 0.0, -0.38], [0.58, 0.70, -0.33]),
        ("leg3", "flblonde", [-0.58, 0.0, 0.33], [-0.53, 0.70, 0.38]),
        ("leg4", "flblonde", [0.53, 0.0, 0.33], [0.58, 0.70, 0.38]),
    ])
}

/// A cabinet: five boards, and a door whose pin is at the left of its front.
fn cabinet() -> String {
    boxes(&[
        ("bottom", "white", [-0.3, 0.0, -0.3], [0.3, 0.02, 0.28]),
        ("board", "white", [-0.3, 0.83, -0.3], [0.3, 0.85, 0.28]),
        ("left", "white", [-0.3, 0.02, -0.3], [-0.28, 0.83, 0.28]),
        ("right", "white", [0.28, 0.02, -0.3], [0.3, 0.83, 0.28]),
        ("back", "white", [-0.28, 0.02, -0.3], [0.28, 0.83, -0.28]),
        (
            "sweethome3d_opening_on_hinge_1_door",
            "white",
            [-0.3, 0.0, 0.28],
            [0.3, 0.83, 0.30],
        ),
        (
            "sweethome3d_opening_on_hinge_1_handle",
            "silver",
            [0.22, 0.5, 0.30],
            [0.24, 0.65, 0.33],
        ),
        (
            "sweethome3d_hinge_1",
            "silver",
            [-0.3, 0.0, 0.28],
            [-0.29, 0.83, 0.29],
        ),
    ])
}

/// A frame around an opening, with a leaf on a hinge.
fn door() -> String {
    boxes(&[
        ("frame1", "white", [-0.45, 0.0, -0.06], [-0.40, 2.05, 0.06]),
        ("frame2", "white", [0.40, 0.0, -0.06], [0.45, 2.05, 0.06]),
        ("frame3", "white", [-0.45, 2.05, -0.06], [0.45, 2.10, 0.06]),
        (
            "sweethome3d_opening_on_hinge_1_door",
            "white",
            [-0.40, 0.0, 0.0],
            [0.40, 2.05, 0.04],
        ),
        (
            "sweethome3d_hinge_1",
            "silver",
            [-0.40, 0.0, 0.0],
            [-0.39, 2.05, 0.01],
        ),
    ])
}

fn window() -> String {
    boxes(&[
        ("frame", "white", [-0.5, 0.0, -0.05], [0.5, 0.08, 0.05]),
        (
            "sweethome3d_window_pane",
            "glass",
            [-0.5, 0.08, -0.01],
            [0.5, 1.2, 0.01],
        ),
    ])
}

fn chair() -> String {
    boxes(&[
        ("seat", "bois", [-0.2, 0.0, -0.2], [0.2, 0.45, 0.2]),
        ("back", "bois", [-0.2, 0.45, -0.2], [0.2, 0.9, -0.15]),
    ])
}

const HOME: &str = r#"<?xml version='1.0'?>
<home version='7000' name='flat.sh3d' camera='topCamera' wallHeight='250.0'>
  <property name='Author' value='WheelArm'/>
  <property name='License' value='CC0 1.0'/>
  <environment groundColor='FF000000'/>
  <doorOrWindow catalogId='test#door' name='Door' model='1/door.obj' x='400' y='150' angle='1.5707964' width='90' depth='12' height='210' movable='false'>
    <sash xAxis='0.05' yAxis='0.5' width='0.9' startAngle='0.0' endAngle='-1.57'/>
  </doorOrWindow>
  <doorOrWindow catalogId='test#door' name='Front door' model='1/door.obj' x='0' y='250' angle='1.5707964' width='90' depth='12' height='210'/>
  <doorOrWindow catalogId='test#window' name='Window' model='2/window.obj' x='200' y='0' elevation='90' width='100' depth='10' height='120'/>
  <furnitureGroup name='Dining' x='150' y='200' width='200' depth='200' height='90'>
    <pieceOfFurniture catalogId='test#table' name='Esstisch' creator='WheelArm' model='3/table.obj' x='150' y='150' angle='0.0' width='120' depth='80' height='74'>
      <material name='flblonde' color='FF336699'/>
    </pieceOfFurniture>
    <pieceOfFurniture catalogId='test#chair' name='Stuhl' model='4/chair.obj' x='150' y='230' angle='3.1415927' width='40' depth='40' height='90'/>
  </furnitureGroup>
  <pieceOfFurniture catalogId='test#kitchenCabinet' name='Cabinet' model='5/cabinet.obj' x='700' y='35' width='60' depth='60' height='85'/>
  <wall id='wall0' wallAtStart='wall3' wallAtEnd='wall1' xStart='0' yStart='0' xEnd='800' yEnd='0' thickness='10' leftSideColor='FFEEEEEE' rightSideColor='FFCFB1A5'>
    <baseboard attribute='rightSideBaseboard' thickness='1.0' height='7.0'/>
  </wall>
  <wall id='wall1' wallAtStart='wall0' wallAtEnd='wall2' xStart='800' yStart='0' xEnd='800' yEnd='400' thickness='10'/>
  <wall id='wall2' wallAtStart='wall1' wallAtEnd='wall3' xStart='800' yStart='400' xEnd='0' yEnd='400' thickness='10'/>
  <wall id='wall3' wallAtStart='wall2' wallAtEnd='wall0' xStart='0' yStart='400' xEnd='0' yEnd='0' thickness='10'/>
  <wall id='wall4' xStart='400' yStart='0' xEnd='400' yEnd='400' thickness='10' height='250' heightAtEnd='200'/>
  <room name='Wohnzimmer' floorColor='FF90633B'><point x='5' y='5'/><point x='395' y='5'/><point x='395' y='395'/><point x='5' y='395'/></room>
  <room name='Küche'><point x='405' y='5'/><point x='795' y='5'/><point x='795' y='395'/><point x='405' y='395'/></room>
</home>
"#;

impl Flat {
    /// The home as it is drawn.
    pub fn new() -> Self {
        let file = |path: &str, text: String| (path.to_owned(), text.into_bytes());
        Self {
            files: vec![
                file("Home.xml", HOME.to_owned()),
                file("1/door.obj", door()),
                file("2/window.obj", window()),
                file("3/table.obj", table()),
                file("4/chair.obj", chair()),
                file("5/cabinet.obj", cabinet()),
            ],
        }
    }

    /// With another text in `Home.xml`.
    pub fn with(mut self, from: &str, to: &str) -> Self {
        let text = String::from_utf8(self.files[0].1.clone()).unwrap();
        assert!(text.contains(from), "{from:?} is in the home");
        self.files[0].1 = text.replace(from, to).into_bytes();
        self
    }

    /// With another content of a file, or with another file.
    pub fn file(mut self, path: &str, content: &[u8]) -> Self {
        self.files.retain(|(known, _)| known != path);
        self.files.push((path.to_owned(), content.to_vec()));
        self
    }

    /// Without a file.
    pub fn without(mut self, path: &str) -> Self {
        self.files.retain(|(known, _)| known != path);
        self
    }

    /// The bytes of the `.sh3d` file.
    pub fn bytes(&self) -> Vec<u8> {
        let mut writer = ZipWriter::new(Cursor::new(Vec::new()));
        let options = SimpleFileOptions::default().compression_method(CompressionMethod::Deflated);
        for (path, content) in &self.files {
            writer.start_file(path.as_str(), options).unwrap();
            writer.write_all(content).unwrap();
        }
        writer.finish().unwrap().into_inner()
    }
}
