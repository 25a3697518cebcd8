//! Keys of plans and splits as they were up to contract 2, translated to the spelling of the
//! contract. Read for one version; each gives a warning that names the new key.

use toml::{Table, Value};
use wheelarm_proto::v1;

/// Former key and its place now; `.` separates tables. The same for plans and splits.
const RENAMED: [(&str, &str); 20] = [
    ("scene", "scenario.scene"),
    ("robot", "scenario.robot"),
    ("camera", "scenario.cameras"),
    ("state_rate", "scenario.state_rate_hz"),
    ("imu_rate", "scenario.imu_rate_hz"),
    ("quality", "scenario.quality"),
    ("starts", "scenario.starts"),
    ("bear_share", "scenario.variant_share"),
    ("style", "scenario.style"),
    ("person", "scenario.person"),
    ("sensors", "scenario.sensors"),
    ("randomise.imu_noise", "scenario.imu_noise"),
    ("randomise.operator", "variation.operator"),
    ("randomise.robots", "variation.specimens"),
    ("robots", "variation.specimens"),
    ("look", "variation.appearance"),
    ("disturb", "variation.disturbances"),
    ("language", "variation.language"),
    ("time_limits", "variation.time_limits"),
    ("sample_rate", "sample_rate_hz"),
];
/// Value of the key `pack_license`: every part of the world packs permits commercial use.
pub const COMMERCIAL: &str = "commercial";
/// Shares that kept their name and moved.
const MOVED: [&str; 2] = ["start_in_view", "look_around"];

/// The text of a plan or split in the keys of today, with a warning per former key.
///
/// A text that is not TOML is returned as it is: its reader names the line.
///
/// # Errors
/// When a key is given in both spellings, or a value cannot be translated.
pub fn translated(text: &str) -> Result<(String, Vec<String>), String> {
    let Ok(mut table) = text.parse::<Table>() else {
        return Ok((text.to_owned(), Vec::new()));
    };
    let warnings = translate(&mut table)?;
    let text = toml::to_string(&table).map_err(|e| e.to_string())?;
    Ok((text, warnings))
}

/// Translates the former keys of `table` in place; returns a warning per key.
///
/// # Errors
/// When a key is given in both spellings, or a value cannot be translated.
fn translate(table: &mut Table) -> Result<Vec<String>, String> {
    let moved = MOVED.map(|name| (name, format!("variation.{name}")));
    let moved = moved.iter().map(|(old, new)| (*old, new.as_str()));
    let mut warnings = Vec::new();
    // The former spelling of both keys: that of the packs has one value.
    let is_of_packs = table.get("licence").and_then(Value::as_str) == Some(COMMERCIAL);
    let licence = ["license", "pack_license"][usize::from(is_of_packs)];
    let renamed = RENAMED.into_iter().chain([("licence", licence)]);
    for (old, new) in renamed.chain(moved) {
        let Some(value) = take(table, old) else {
            continue;
        };
        let value = converted(old, value)?;
        if !insert(table, new, value) {
            return Err(format!("{old} and {new} are the same key; keep {new}"));
        }
        warnings.push(format!(
            "the key `{old}` is `{new}` now; the former spelling is read by this version for the last time"
        ));
    }
    if table
        .get("randomise")
        .and_then(Value::as_table)
        .is_some_and(Table::is_empty)
    {
        table.remove("randomise");
    }
    Ok(warnings)
}

/// Removes the value of a path, if it exists.
fn take(table: &mut Table, path: &str) -> Option<Value> {
    match path.split_once('.') {
        None => table.remove(path),
        Some((outer, inner)) => table.get_mut(outer)?.as_table_mut()?.remove(inner),
    }
}

/// Inserts a value; false when the path has one.
fn insert(table: &mut Table, path: &str, value: Value) -> bool {
    let Some((outer, inner)) = path.split_once('.') else {
        return table.insert(path.to_owned(), value).is_none();
    };
    let inside = table.entry(outer).or_insert_with(|| Table::new().into());
    let inside = inside.as_table_mut();
    inside.is_some_and(|inside| inside.insert(inner.to_owned(), value).is_none())
}

/// The value in the form of the contract: cameras by width, height and rate, persons and
/// sensors as tables.
fn converted(key: &str, value: Value) -> Result<Value, String> {
    let written = |error: toml::ser::Error| error.to_string();
    match (key, value) {
        ("person", Value::String(text)) => {
            Value::try_from(v1::Person::from_text(&text)?).map_err(written)
        }
        ("sensors", Value::Array(entries)) => {
            let sensor = |entry| match entry {
                Value::String(text) => {
                    Value::try_from(v1::SensorSetting::from_text(&text)?).map_err(written)
                }
                table => Ok(table),
            };
            let read: Result<Vec<Value>, String> = entries.into_iter().map(sensor).collect();
            read.map(Value::Array)
        }
        ("camera", Value::Array(entries)) => {
            Ok(Value::Array(entries.into_iter().map(camera).collect()))
        }
        (_, value) => Ok(value),
    }
}

/// `size = [64, 48]` and `rate` as `width`, `height` and `rate_hz`.
fn camera(mut entry: Value) -> Value {
    let Some(table) = entry.as_table_mut() else {
        return entry;
    };
    if let Some(Value::Array(size)) = table.remove("size") {
        for (key, side) in ["width", "height"].into_iter().zip(size) {
            table.insert(key.to_owned(), side);
        }
    }
    if let Some(rate) = table.remove("rate") {
        let rate = rate
            .as_integer()
            .map_or(rate, |whole| Value::Float(whole as f64));
        table.insert("rate_hz".to_owned(), rate);
    }
    entry
}

#[cfg(test)]
mod tests {
    use super::*;

    const OLD: &str = r#"
        name = "x"
        starts = "anywhere"
        bear_share = 0.2
        person = "woman_p50,motion=0.5"
        sensors = ["imu=2"]
        look = "*"
        start_in_view = 0.3
        [randomise]
        operator = false
        robots = 3
        [[camera]]
        name = "gen3"
        size = [64, 48]
        rate = 20
    "#;
    const NEW: &str = r#"
        name = "x"
        [scenario]
        starts = "anywhere"
        variant_share = 0.2
        person = { body = "woman_p50", motion = 0.5 }
        sensors = [{ model = "imu", strength = 2.0 }]
        cameras = [{ name = "gen3", width = 64, height = 48, rate_hz = 20.0 }]
        [variation]
        appearance = "*"
        start_in_view = 0.3
        operator = false
        specimens = 3
    "#;

    fn scenario(table: &Table) -> v1::Scenario {
        table["scenario"].clone().try_into().unwrap()
    }

    #[test]
    fn former_keys_say_the_same_as_the_keys_of_the_contract() {
        let (mut old, mut new): (Table, Table) = (OLD.parse().unwrap(), NEW.parse().unwrap());
        let warnings = translate(&mut old).unwrap();
        assert_eq!(warnings.len(), 9, "{warnings:#?}");
        assert!(
            warnings
                .iter()
                .any(|w| w.contains("`bear_share` is `scenario.variant_share`"))
        );
        assert_eq!(translate(&mut new), Ok(Vec::new()));
        assert_eq!(scenario(&old), scenario(&new));
        assert_eq!(old["variation"], new["variation"]);
        assert_eq!(old.len(), new.len(), "{old:?}");
    }

    #[test]
    fn licence_is_the_key_of_the_packs_or_of_the_data_by_its_value() {
        for (value, key) in [("commercial", "pack_license"), ("cc-by-4.0", "license")] {
            let mut table: Table = format!("licence = \"{value}\"").parse().unwrap();
            let warnings = translate(&mut table).unwrap();
            assert_eq!(table[key].as_str(), Some(value));
            assert_eq!(table.len(), 1, "{table:?}");
            let words = format!("the key `licence` is `{key}` now");
            assert!(warnings[0].starts_with(&words), "{warnings:?}");
        }
    }

    #[test]
    fn key_in_both_spellings_is_rejected() {
        let mut both: Table = "starts = \"near\"\n[scenario]\nstarts = \"near\""
            .parse()
            .unwrap();
        let problem = translate(&mut both).unwrap_err();
        assert!(problem.contains("keep scenario.starts"), "{problem}");
    }
}
