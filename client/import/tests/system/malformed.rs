//! Foreign files that are wrong: each gives an error with its fix, or costs one piece.

use proptest::prelude::*;
use wheelarm_import::{ImportError, Options, import};

use crate::flat::Flat;

fn error_of(bytes: Vec<u8>) -> ImportError {
    let options = Options {
        name: "flat".into(),
        ..Options::default()
    };
    import("flat.sh3d", bytes, &options).unwrap_err()
}

fn message(flat: &Flat) -> String {
    error_of(flat.bytes()).to_string()
}

/// Reason for which a piece is left out.
fn reason(flat: &Flat, piece: &str) -> String {
    let options = Options {
        name: "flat".into(),
        ..Options::default()
    };
    let summary = import("flat.sh3d", flat.bytes(), &options).unwrap().summary;
    let mut left = summary.left_out.iter().filter(|left| left.name == piece);
    left.next().expect("it is left out").reason.clone()
}

#[test]
fn serialized_home_names_the_version_that_helps() {
    let old = Flat::new().without("Home.xml").file("Home", b"\xac\xed");
    assert_eq!(
        message(&old),
        "flat.sh3d holds a serialized home only; open and save it with Sweet Home 3D 5.3 or newer"
    );
    let none = Flat::new().without("Home.xml");
    assert!(message(&none).contains("has no Home.xml"));
}

#[test]
fn file_that_is_no_archive_is_rejected() {
    for bytes in [&b""[..], b"PK", b"<?xml version='1.0'?><home/>"] {
        let error = error_of(bytes.to_vec());
        assert!(matches!(error, ImportError::NotZip { .. }), "{error}");
    }
}

#[test]
fn damaged_xml_and_values_are_named() {
    for (from, to, part) in [
        ("</home>", "", "not closed"),
        ("<home version", "<house version", "damaged"),
        (
            "<?xml version='1.0'?>",
            "<!DOCTYPE home [<!ENTITY a 'b'>]>",
            "document type",
        ),
        ("name='Esstisch'", "name='&lol;'", "damaged"),
        (
            "width='120'",
            "width='NaN'",
            "pieceOfFurniture \"Esstisch\": width = \"NaN\"",
        ),
        ("width='120'", "width='-1'", "a number from 0"),
        ("width='120'", "width='1e300'", "width"),
        ("xStart='0'", "xStart='inf'", "xStart"),
        ("thickness='10'", "", "thickness"),
        ("color='FF336699'", "color='blue'", "hexadecimal"),
        (
            "height='74'",
            "height='74' modelRotation='1 0 0'",
            "nine numbers",
        ),
    ] {
        let message = message(&Flat::new().with(from, to));
        assert!(message.contains(part), "{to:?}: {message}");
        assert!(message.contains("flat.sh3d"), "{message}");
    }
}

#[test]
fn deep_xml_is_rejected() {
    let deep = "<furnitureGroup>".repeat(100) + &"</furnitureGroup>".repeat(100) + "</home>";
    assert!(message(&Flat::new().with("</home>", &deep)).contains("nested"));
}

#[test]
fn paths_cannot_leave_the_archive() {
    for path in [
        "../evil.obj",
        "/etc/passwd",
        "a/../../b",
        "c:/x",
        "a\\b",
        "a/b\u{7}",
    ] {
        let message = message(&Flat::new().file(path, b"v 0 0 0"));
        assert!(message.contains("is rejected"), "{path:?}: {message}");
    }
    let deep = vec!["a"; 40].join("/");
    assert!(message(&Flat::new().file(&deep, b"")).contains("folders deep"));
}

#[test]
fn zip_bomb_is_rejected() {
    let bomb = Flat::new().file("9/bomb.obj", &vec![b' '; 8 << 20]);
    let text = message(&bomb);
    assert!(text.contains("zip bomb"), "{text}");
}

#[test]
fn too_many_entries_are_rejected() {
    let mut flat = Flat::new();
    for number in 0..20_001 {
        flat.files.push((format!("9/{number}"), Vec::new()));
    }
    assert!(message(&flat).contains("entries"));
}

#[test]
fn model_of_another_format_costs_its_piece() {
    let flat = Flat::new().with("model='3/table.obj'", "model='3/lamp.dae'");
    let flat = flat.file("3/lamp.dae", b"<COLLADA/>");
    assert_eq!(
        reason(&flat, "Esstisch"),
        "model 3/lamp.dae is COLLADA; export it as OBJ"
    );
}

#[test]
fn missing_or_damaged_model_costs_its_piece() {
    assert!(reason(&Flat::new().without("3/table.obj"), "Esstisch").contains("is missing"));
    assert!(reason(&Flat::new().with("model='3/table.obj'", ""), "Esstisch").contains("missing"));
    for text in [
        "",
        "v 0 0 0\n",
        "v 0 0 nan\nv 1 0 0\nv 0 1 0\nf 1 2 3\n",
        "v 0 0 0\nf 1 2 3\n",
    ] {
        let flat = Flat::new().file("3/table.obj", text.as_bytes());
        assert!(
            reason(&flat, "Esstisch").contains("model 3/table.obj"),
            "{text:?}"
        );
    }
}

#[test]
fn names_of_packs_are_checked() {
    let options = Options {
        name: "my flat".into(),
        ..Options::default()
    };
    let error = import("flat.sh3d", Flat::new().bytes(), &options).unwrap_err();
    assert!(error.to_string().contains("--name"), "{error}");
}

#[test]
fn flat_and_tiny_models_are_imported() {
    for (width, depth, height) in [(0.0, 80.0, 74.0), (120.0, 0.0, 0.0), (0.01, 0.01, 0.01)] {
        let size = format!("width='{width}' depth='{depth}' height='{height}'");
        let flat = Flat::new().with("width='120' depth='80' height='74'", &size);
        let options = Options {
            name: "flat".into(),
            ..Options::default()
        };
        import("flat.sh3d", flat.bytes(), &options).unwrap();
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(48))]

    /// A changed byte of the text of the home gives a pack or an error, never a panic.
    #[test]
    fn changed_homes_never_panic(at in 0usize..4_000, byte in any::<u8>()) {
        let mut flat = Flat::new();
        let length = flat.files[0].1.len();
        flat.files[0].1[at % length] = byte;
        let options = Options { name: "flat".into(), ..Options::default() };
        let _ = import("flat.sh3d", flat.bytes(), &options);
    }

    /// The same for the archive itself.
    #[test]
    fn changed_archives_never_panic(at in 0usize..8_000, byte in any::<u8>()) {
        let mut bytes = Flat::new().bytes();
        let length = bytes.len();
        bytes[at % length] = byte;
        let options = Options { name: "flat".into(), ..Options::default() };
        let _ = import("flat.sh3d", bytes, &options);
    }

    /// The same for a model.
    #[test]
    fn changed_models_never_panic(at in 0usize..3_000, byte in any::<u8>()) {
        let mut flat = Flat::new();
        let length = flat.files[5].1.len();
        flat.files[5].1[at % length] = byte;
        let options = Options { name: "flat".into(), ..Options::default() };
        let _ = import("flat.sh3d", flat.bytes(), &options);
    }
}

#[test]
fn far_pieces_and_odd_walls_cost_themselves() {
    let flat = Flat::new().with("x='700' y='35'", "x='90000' y='35'").with(
        "thickness='10' height='250' heightAtEnd='200'",
        "thickness='0.2' height='99999'",
    );
    assert!(reason(&flat, "Cabinet").contains("farther than 49 m"));
}
