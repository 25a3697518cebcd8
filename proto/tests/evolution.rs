//! The rule of evolution (`proto/README.md`), held against the stored list of
//! the contract.

use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::path::PathBuf;

use prost_types::field_descriptor_proto::{Label, Type};
use prost_types::{DescriptorProto, EnumDescriptorProto, FieldDescriptorProto, FileDescriptorSet};
use wheelarm_proto::topic::TOPICS;
use wheelarm_proto::{CONTRACT_VERSION, MESSAGES_DESCRIPTOR, Message};

/// Messages in recordings; those in their fields are in recordings too.
const RECORDED: [&str; 6] = [
    "Scenario",
    "Applied",
    "CommandLog",
    "EpisodeStarted",
    "EpisodeStopped",
    "RobotDescription",
];

/// Numbers that are set aside (`proto/README.md`), and what alone may take them.
const ROOM: [(&str, std::ops::RangeInclusive<i32>, &[&str]); 4] = [
    (
        "Scenario",
        20..=29,
        &[
            "appearance",
            "person",
            "sensors",
            "disturbances",
            "style",
            "calibration_seed",
            "language",
        ],
    ),
    ("CameraSetting", 10..=19, &["lens", "place", "sensor"]),
    ("Command", 14..=19, &["policy", "assistance_reason"]),
    ("SceneReply", 21..=29, &["persons"]),
];

fn stored() -> PathBuf {
    PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("contract.txt")
}

/// One line of the list: what it is of, its number, and what it says.
type Lines = BTreeMap<(String, i32), String>;

/// The contract as a list: `Message 3 name type`.
#[derive(Debug, Default, PartialEq)]
struct Contract {
    version: u32,
    /// Fields, values of enums, queries and topics.
    lines: Lines,
    /// Numbers that are never used again.
    reserved: BTreeSet<(String, i32)>,
}

fn kind(field: &FieldDescriptorProto) -> String {
    let base = match field.r#type() {
        Type::Message | Type::Enum => field.type_name().rsplit('.').next().unwrap_or_default(),
        Type::Double => "double",
        Type::Float => "float",
        Type::Uint64 => "uint64",
        Type::Uint32 => "uint32",
        Type::Fixed64 => "fixed64",
        Type::Bool => "bool",
        Type::String => "string",
        Type::Bytes => "bytes",
        other => return format!("{other:?}"),
    };
    let choice = field.oneof_index.is_some() && !field.proto3_optional();
    let label = match field.label() {
        Label::Repeated => "repeated ",
        _ if field.proto3_optional() => "optional ",
        _ if choice => "oneof ",
        _ => "",
    };
    format!("{label}{base}")
}

impl Contract {
    fn present() -> Self {
        let set = FileDescriptorSet::decode(MESSAGES_DESCRIPTOR).expect("our own descriptors");
        let mut contract = Self {
            version: CONTRACT_VERSION,
            ..Self::default()
        };
        for file in &set.file {
            for message in &file.message_type {
                contract.message(message);
            }
            for values in &file.enum_type {
                contract.values(values);
            }
            for service in &file.service {
                for method in &service.method {
                    let last = |name: &str| name.rsplit('.').next().unwrap_or_default().to_owned();
                    let line = format!(
                        "{} -> {}",
                        last(method.input_type()),
                        last(method.output_type())
                    );
                    let name = format!("rpc.{}.{}", service.name(), method.name());
                    contract.lines.insert((name, 0), line);
                }
            }
        }
        for topic in &TOPICS {
            let line = format!(
                "{} {} {:?} {:?} {:?} unit={} frame={}",
                topic.key,
                topic.message,
                topic.rate,
                topic.from,
                topic.record,
                topic.unit,
                topic.frame
            );
            let name = format!("topic.{}", topic.name);
            contract.lines.insert((name, 0), line);
        }
        contract
    }

    fn message(&mut self, message: &DescriptorProto) {
        assert!(
            message.nested_type.is_empty() && message.enum_type.is_empty(),
            "{}: messages are not nested",
            message.name()
        );
        for field in &message.field {
            let line = format!("{} {}", field.name(), kind(field));
            let at = (message.name().to_owned(), field.number());
            self.lines.insert(at, line);
        }
        for range in &message.reserved_range {
            for number in range.start()..range.end() {
                self.reserved.insert((message.name().to_owned(), number));
            }
        }
    }

    fn values(&mut self, values: &EnumDescriptorProto) {
        for value in &values.value {
            let at = (values.name().to_owned(), value.number());
            self.lines.insert(at, format!("{} value", value.name()));
        }
        for range in &values.reserved_range {
            for number in range.start()..=range.end() {
                self.reserved.insert((values.name().to_owned(), number));
            }
        }
    }

    fn text(&self) -> String {
        let mut out = format!(
            "# The contract, a line per field, value, query and topic: `make contract`.\n\
             version {}\n",
            self.version
        );
        for ((name, number), line) in &self.lines {
            out += &format!("{name} {number} {line}\n");
        }
        for (name, number) in &self.reserved {
            out += &format!("{name} {number} reserved\n");
        }
        out
    }

    fn read(text: &str) -> Self {
        let mut contract = Self::default();
        for line in text.lines().filter(|line| !line.starts_with('#')) {
            if let Some(version) = line.strip_prefix("version ") {
                contract.version = version.parse().expect("a version");
                continue;
            }
            let mut words = line.splitn(3, ' ');
            let mut word = || words.next().expect("three words").to_owned();
            let (name, number, rest) = (word(), word(), word());
            let at = (name, number.parse().expect("a number"));
            if rest == "reserved" {
                contract.reserved.insert(at);
            } else {
                contract.lines.insert(at, rest);
            }
        }
        contract.renamed()
    }

    /// The contract with the names of messages that contract 3 has; numbers and types stay.
    fn renamed(self) -> Self {
        if self.version >= 3 {
            return self;
        }
        let table = include_str!("../../tests/data/renames.toml");
        let messages = table.split("[messages]").nth(1).unwrap_or_default();
        let messages = messages.split("\n[").next().unwrap_or_default();
        let names: BTreeMap<&str, &str> = messages
            .lines()
            .filter_map(|line| line.split_once(" = "))
            .map(|(old, new)| (old, new.trim_matches('"')))
            .collect();
        let rename = |word: &str| names.get(word).copied().unwrap_or(word).to_owned();
        let lines = self.lines.iter().map(|((name, number), line)| {
            let words: Vec<String> = line.split(' ').map(rename).collect();
            ((rename(name), *number), words.join(" "))
        });
        let reserved = self.reserved.iter();
        let reserved = reserved.map(|(name, number)| (rename(name), *number));
        Self {
            version: self.version,
            lines: lines.collect(),
            reserved: reserved.collect(),
        }
    }

    /// Messages in recordings, with those in their fields.
    fn recorded(&self) -> BTreeSet<String> {
        let mut found: BTreeSet<String> = RECORDED.map(str::to_owned).into();
        loop {
            let holds = |line: &String| line.rsplit(' ').next().unwrap_or_default().to_owned();
            let inside = self.lines.iter();
            let inside = inside.filter(|((name, _), _)| found.contains(name));
            let more: BTreeSet<_> = inside.map(|(_, line)| holds(line)).collect();
            let known = |name: &String| self.lines.keys().any(|(own, _)| own == name);
            let before = found.len();
            found.extend(more.into_iter().filter(known));
            if found.len() == before {
                return found;
            }
        }
    }

    /// What of `self` a reader of the later contract would misread.
    fn broken_by(&self, later: &Self) -> Vec<String> {
        let in_files = self.recorded();
        let same_version = self.version == later.version;
        let mut broken = Vec::new();
        for (at, line) in &self.lines {
            let (name, number) = at;
            if !same_version && !in_files.contains(name) {
                continue;
            }
            match later.lines.get(at) {
                Some(now) if travels(now) == travels(line) => {}
                Some(now) => broken.push(format!("{name} {number}: was {line:?}, is {now:?}")),
                None if later.reserved.contains(at) => {}
                None => broken.push(format!("{name} {number}: {line:?} is gone, not reserved")),
            }
        }
        let used_again = self
            .reserved
            .iter()
            .filter(|at| later.lines.contains_key(at));
        broken.extend(used_again.map(|(name, number)| format!("{name} {number} was reserved")));
        let forgotten = self
            .reserved
            .iter()
            .filter(|at| !later.reserved.contains(at) && !later.lines.contains_key(at));
        broken.extend(
            forgotten
                .map(|(name, number)| format!("{name} {number} was reserved and is free again")),
        );
        broken
    }
}

/// What of a line travels: a field's name does not, its type does. That a field
/// became `optional` changes no byte of it.
fn travels(line: &str) -> String {
    match line.split_once(' ') {
        Some((_, kind)) if !line.contains("->") && !line.contains('/') => {
            kind.trim_start_matches("optional ").to_owned()
        }
        _ => line.to_owned(),
    }
}

#[test]
fn the_contract_changes_by_its_rule() {
    let (path, present) = (stored(), Contract::present());
    let text = fs::read_to_string(&path).expect("proto/contract.txt");
    let mut old = Contract::read(&text);
    let broken = old.broken_by(&present);
    assert!(
        broken.is_empty(),
        "what others read or have recorded would be misread; take other numbers, reserve what \
         goes, or raise CONTRACT_VERSION (proto/README.md):\n{}",
        broken.join("\n")
    );
    // Written only where nothing breaks.
    if std::env::var_os("WHEELARM_WRITE_CONTRACT").is_some() {
        fs::write(&path, present.text()).expect("a list that can be written");
        old = Contract::read(&present.text());
    }
    assert!(
        old == present,
        "proto/contract.txt is not up to date; if the change is meant, run `make contract`"
    );
}

#[test]
fn room_that_is_set_aside_is_taken_by_nothing_else() {
    let present = Contract::present();
    for (message, numbers, names) in ROOM {
        let own = present
            .lines
            .iter()
            .filter(|((name, _), _)| name == message);
        for ((_, number), line) in own.filter(|((_, number), _)| numbers.contains(number)) {
            let name = line.split(' ').next().unwrap_or_default();
            assert!(
                names.contains(&name),
                "{message} {number} is set aside for {}, not for {name:?}",
                names.join(", ")
            );
        }
    }
}

#[test]
fn recordings_of_the_first_version_are_read() {
    let first = Contract::read(include_str!("recorded-1.txt"));
    let broken = first.broken_by(&Contract::present());
    assert!(
        broken.is_empty(),
        "files could not be read:\n{}",
        broken.join("\n")
    );
}

#[test]
fn a_breaking_change_is_found() {
    let old = Contract::read(
        "version 1\nA 1 name string\nA 2 poses repeated Pose\nScenario 1 scene string\n\
         E 1 E_ON value\nrpc.Status 0 StatusRequest -> Status\nA 7 reserved\n",
    );
    let with = |from: &str, to: &str| Contract::read(&old.text().replacen(from, to, 1));
    assert_eq!(old.broken_by(&with("A 1 name", "A 1 title")), [""; 0]);
    assert_eq!(
        old.broken_by(&with("A 1 name string", "A 1 name optional string")),
        [""; 0]
    );
    assert_eq!(
        old.broken_by(&with("A 1 ", "A 3 ")).len(),
        1,
        "another number"
    );
    assert_eq!(old.broken_by(&with("repeated Pose", "Pose")).len(), 1);
    assert_eq!(old.broken_by(&with("E 1 E_ON value\n", "")).len(), 1);
    assert_eq!(
        old.broken_by(&with("E 1 E_ON value", "E 1 reserved")),
        [""; 0]
    );
    assert_eq!(old.broken_by(&with("-> Status", "-> Ack")).len(), 1);
    assert_eq!(old.broken_by(&with("A 7 reserved", "A 7 x bool")).len(), 1);
    assert_eq!(
        old.broken_by(&with("A 7 reserved\n", "")).len(),
        1,
        "forgotten"
    );
    // Another version may break everything except files.
    let mut other = with("A 1 name string", "A 1 name bytes");
    other.version = 2;
    assert_eq!(old.broken_by(&other), [""; 0]);
    let mut other = with("scene string", "scene bytes");
    other.version = 2;
    assert_eq!(old.broken_by(&other).len(), 1);
}

#[test]
fn names_follow_the_rule() {
    let set = FileDescriptorSet::decode(MESSAGES_DESCRIPTOR).expect("our own descriptors");
    let mut wrong = Vec::new();
    for file in &set.file {
        for message in &file.message_type {
            for field in &message.field {
                let name = field.name();
                let plural = name.ends_with('s') || PLURALS.contains(&name);
                if (field.label() == Label::Repeated) && !plural {
                    wrong.push(format!("{}.{name} is repeated, not plural", message.name()));
                }
                let old = ["_secs", "_ns", "_ms", "_nanoseconds", "_rad", "_m", "_deg"];
                if old.iter().any(|suffix| name.ends_with(suffix)) {
                    wrong.push(format!("{}.{name} ends in another suffix", message.name()));
                }
            }
        }
        for values in &file.enum_type {
            let zero = values.value.first().map(|v| v.name().to_owned());
            if !zero.is_some_and(|name| name.ends_with("_UNSPECIFIED")) {
                wrong.push(format!("{} has no UNSPECIFIED", values.name()));
            }
        }
    }
    assert!(wrong.is_empty(), "proto/README.md:\n{}", wrong.join("\n"));
}

/// Lists that do not end in s.
const PLURALS: [&str; 2] = ["ended", "manifest"];
