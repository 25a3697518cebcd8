//! `metadata.yaml`, version 9, which describes a bag to `ros2 bag`.

use std::fmt::Write;

/// The version that Jazzy and later read and write.
const VERSION: u32 = 9;
/// The oldest ROS 2 whose messages and metadata are these.
const DISTRIBUTION: &str = "jazzy";
/// Late subscribers get the last message, as those of `/tf_static` expect.
const LATCHED: &str = "\
- history: keep_last
  depth: 1
  reliability: reliable
  durability: transient_local
  deadline:
    sec: 9223372036
    nsec: 854775807
  lifespan:
    sec: 9223372036
    nsec: 854775807
  liveliness: automatic
  liveliness_lease_duration:
    sec: 9223372036
    nsec: 854775807
  avoid_ros_namespace_conventions: false
";

/// A topic of a bag.
#[derive(Clone, Debug)]
pub(super) struct Topic {
    pub name: String,
    /// Full name of its messages' type.
    pub kind: &'static str,
    /// Hash of that type.
    pub hash: String,
    /// Whether late subscribers get the last message.
    pub latched: bool,
    pub messages: usize,
}

impl Topic {
    /// Offered quality of service in the form of the message file, with numbers instead of words,
    /// which older and newer versions of ROS 2 read. Empty for the default.
    pub fn quality(&self) -> String {
        if !self.latched {
            return String::new();
        }
        let words = ["keep_last", "reliable", "transient_local", "automatic"];
        words
            .iter()
            .fold(LATCHED.to_owned(), |text, word| text.replace(word, "1"))
    }
}

/// Metadata of a bag.
#[derive(Clone, Debug)]
pub(super) struct Bag {
    /// Name of its only file.
    pub file: String,
    /// Stamp of the first message, nanoseconds.
    pub start: u64,
    /// Stamp of the last message, nanoseconds.
    pub end: u64,
    /// Its topics in the order of their names.
    pub topics: Vec<Topic>,
    /// Words about the episode.
    pub words: Vec<(String, String)>,
}

impl Bag {
    /// Messages of all topics.
    pub fn messages(&self) -> usize {
        self.topics.iter().map(|topic| topic.messages).sum()
    }

    /// The file `metadata.yaml`.
    pub fn text(&self) -> String {
        format!(
            "rosbag2_bagfile_information:\n{}",
            indented(&self.entries(), 2)
        )
    }

    /// The entries of that file.
    pub fn entries(&self) -> String {
        let (start, duration) = (self.start, self.end - self.start);
        let (file, messages) = (quoted(&self.file), self.messages());
        let mut text = format!(
            "version: {VERSION}
storage_identifier: mcap
duration:
  nanoseconds: {duration}
starting_time:
  nanoseconds_since_epoch: {start}
message_count: {messages}
topics_with_message_count:
"
        );
        for topic in &self.topics {
            let (name, kind) = (quoted(&topic.name), topic.kind);
            let _ = write!(
                text,
                "  - topic_metadata:
      name: {name}
      type: {kind}
      serialization_format: cdr
      offered_qos_profiles:"
            );
            if topic.latched {
                let _ = write!(text, "\n{}", indented(LATCHED, 8));
            } else {
                text.push_str(" []\n");
            }
            let (hash, messages) = (&topic.hash, topic.messages);
            let _ = writeln!(
                text,
                "      type_description_hash: {hash}\n    message_count: {messages}"
            );
        }
        let _ = write!(
            text,
            "compression_format: \"\"
compression_mode: \"\"
relative_file_paths:
  - {file}
files:
  - path: {file}
    starting_time:
      nanoseconds_since_epoch: {start}
    duration:
      nanoseconds: {duration}
    message_count: {messages}
custom_data:
"
        );
        for (name, words) in &self.words {
            let _ = writeln!(text, "  {name}: {}", quoted(words));
        }
        let _ = writeln!(text, "ros_distro: {DISTRIBUTION}");
        text
    }
}

/// A text of YAML: that of JSON is one.
fn quoted(text: &str) -> String {
    serde_json::Value::from(text).to_string()
}

fn indented(text: &str, by: usize) -> String {
    let mut out = String::new();
    for line in text.lines() {
        let _ = writeln!(out, "{:by$}{line}", "");
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_metadata_lists_topics_with_counts_times_and_quoted_text() {
        let topic = |name: &str, latched, messages| Topic {
            name: name.to_owned(),
            kind: "std_msgs/msg/String",
            hash: "RIHS01_00".to_owned(),
            latched,
            messages,
        };
        let bag = Bag {
            file: "a_0.mcap".to_owned(),
            start: 5,
            end: 12,
            topics: vec![topic("/a", true, 1), topic("/b", false, 41)],
            words: vec![("instruction".to_owned(), "say \"no: #1\"\n".to_owned())],
        };
        let text = bag.text();
        let lines: Vec<&str> = text.lines().collect();
        assert_eq!(lines[0], "rosbag2_bagfile_information:");
        assert!(lines[1..].iter().all(|line| line.starts_with("  ")));
        for wanted in [
            "  version: 9",
            "  message_count: 42",
            "    nanoseconds: 7",
            "    nanoseconds_since_epoch: 5",
            "        name: \"/b\"",
            "        offered_qos_profiles: []",
            "        offered_qos_profiles:",
            "          - history: keep_last",
            "            durability: transient_local",
            "        type_description_hash: RIHS01_00",
            "      message_count: 41",
            "    instruction: \"say \\\"no: #1\\\"\\n\"",
            "    - \"a_0.mcap\"",
        ] {
            assert!(lines.contains(&wanted), "{wanted:?} is not in\n{text}");
        }
        let [latched, usual] = [0, 1].map(|k| bag.topics[k].quality());
        assert!(latched.contains("  durability: 1\n") && usual.is_empty());
    }
}
