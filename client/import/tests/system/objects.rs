//! The objects of the assets: what `make assets` made of `assets/kinds.toml`.

use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};

use wheelarm_import::object::{Categories, object_of};
use wheelarm_pack::Pack;

#[derive(serde::Deserialize)]
struct Table {
    license: String,
    author: String,
    kind: Vec<Kind>,
}

#[derive(serde::Deserialize)]
struct Kind {
    name: String,
    noun: String,
    category: String,
    pack: String,
    #[serde(default)]
    held_out: bool,
    instance: Vec<Instance>,
}

#[derive(serde::Deserialize)]
struct Instance {
    name: String,
}

fn assets() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../../assets")
}

#[test]
fn packs_of_the_assets_have_the_objects_of_the_table() {
    let text = std::fs::read_to_string(assets().join("kinds.toml")).unwrap();
    let table: Table = toml::from_str(&text).unwrap();
    let categories = Categories::read(&assets()).unwrap();
    let mut packs: BTreeMap<&str, Pack> = BTreeMap::new();
    let mut named: BTreeSet<(String, String)> = BTreeSet::new();
    let (mut graspable, mut repeated, mut held_out) = (0, 0, 0);
    let mut held: BTreeMap<&str, bool> = BTreeMap::new();
    for kind in &table.kind {
        categories.named(&kind.category).unwrap();
        let pack = packs.entry(&kind.pack).or_insert_with(|| {
            let path = assets().join("packs").join(&kind.pack);
            Pack::open(&path).unwrap_or_else(|error| panic!("{error}; run `make assets`"))
        });
        let mut own = 0;
        for instance in &kind.instance {
            let name = format!("{}-{}", kind.name, instance.name);
            let object = object_of(pack, &name)
                .unwrap_or_else(|| panic!("no object {name} in {}; run `make assets`", kind.pack));
            assert_eq!(object.category, kind.category, "{name}");
            assert_eq!(object.license, table.license, "{name}");
            let stock = object.stock.unwrap();
            assert!(stock.words.ends_with(&kind.noun), "{name}: {}", stock.words);
            let credits = pack.credits();
            let credit = credits.iter().find(|credit| credit.of == name).unwrap();
            assert_eq!(credit.author, table.author, "{name}");
            own += usize::from(!stock.scenery && !object.grasps.is_empty());
            named.insert((kind.pack.clone(), name));
        }
        graspable += usize::from(own > 0);
        repeated += usize::from(own > 1);
        held_out += usize::from(kind.held_out);
        let all = held.entry(&kind.category).or_insert(true);
        *all &= kind.held_out;
    }
    for (pack, opened) in &packs {
        for name in opened.names("objects", "toml") {
            let key = ((*pack).to_owned(), name.to_owned());
            assert!(named.contains(&key), "assets/kinds.toml has no {name}");
        }
    }
    let held_categories = held.values().filter(|all| **all).count();
    assert!(graspable >= 60 && repeated >= 30, "{graspable} {repeated}");
    assert!(held.len() >= 25 && held_out >= 15 && held_categories >= 5);
}
