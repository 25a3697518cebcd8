//! Compiles the `.proto` files without an installed `protoc`, and makes from
//! their descriptors what Rust needs beside the messages: the queries of the
//! service, the table of topics, and the descriptors themselves.

use std::collections::HashSet;
use std::error::Error;
use std::fmt::Write as _;
use std::path::PathBuf;

use prost_build::Config;
use protox::Compiler;
use protox::prost_reflect::{
    DescriptorPool, DynamicMessage, ExtensionDescriptor, MessageDescriptor, ReflectMessage,
};

/// The messages, by idea. The table of topics follows this order.
const FILES: [&str; 17] = [
    "wheelarm/v1/common.proto",
    "wheelarm/v1/appearance.proto",
    "wheelarm/v1/pack.proto",
    "wheelarm/v1/scenario.proto",
    "wheelarm/v1/scene.proto",
    "wheelarm/v1/robot.proto",
    "wheelarm/v1/command.proto",
    "wheelarm/v1/stream.proto",
    "wheelarm/v1/task.proto",
    "wheelarm/v1/camera.proto",
    "wheelarm/v1/episode.proto",
    "wheelarm/v1/disturbance.proto",
    "wheelarm/v1/person.proto",
    "wheelarm/v1/language.proto",
    "wheelarm/v1/recorder.proto",
    "wheelarm/v1/control.proto",
    "wheelarm/v1/policy.proto",
];

const PACKAGE: &str = "wheelarm.v1";

/// Messages whose bytes (images and saved states) are shared instead of copied.
const SHARED_BYTES: [&str; 9] = [
    ".wheelarm.v1.CameraFrame",
    ".wheelarm.v1.CompressedCameraFrame",
    ".wheelarm.v1.SensorFrame",
    ".wheelarm.v1.PreviewFrame",
    ".wheelarm.v1.PolicyImage",
    ".wheelarm.v1.SnapshotReply.snapshot",
    ".wheelarm.v1.ResetRequest.snapshot",
    ".wheelarm.v1.PackFile.zip",
    ".wheelarm.v1.PackPutRequest.piece",
];

/// What makes up a scenario: people write it as TOML.
const WRITTEN: [&str; 16] = [
    ".wheelarm.v1.Scenario",
    ".wheelarm.v1.PackRef",
    ".wheelarm.v1.CameraSetting",
    ".wheelarm.v1.SensorSetting",
    ".wheelarm.v1.CameraPlace",
    ".wheelarm.v1.Intrinsics",
    ".wheelarm.v1.Appearance",
    ".wheelarm.v1.ObjectPlacement",
    ".wheelarm.v1.SlideResistance",
    ".wheelarm.v1.Pose",
    ".wheelarm.v1.Disturbances",
    ".wheelarm.v1.Language",
    ".wheelarm.v1.Person",
    ".wheelarm.v1.SampledPerson",
    ".wheelarm.v1.Vector3",
    ".wheelarm.v1.Quaternion",
];

/// As TOML a field that is absent has its default, and one that is unknown is
/// refused.
const WRITE: &str = "#[derive(serde::Serialize, serde::Deserialize)] \
    #[serde(default, deny_unknown_fields)]";

/// Fields of a scenario that are written by name, and how.
const CHOICES: [(&str, &str); 4] = [
    (".wheelarm.v1.Language.split", "language_split"),
    (".wheelarm.v1.Scenario.pacing", "pacing"),
    (".wheelarm.v1.Scenario.quality", "quality"),
    (".wheelarm.v1.Scenario.starts", "starts"),
];

/// Strengths of an appearance: 0 to 3.
const STRENGTHS: [&str; 7] = [
    "light",
    "background",
    "materials",
    "exposure",
    "decoration",
    "camera",
    "lens",
];

fn main() -> Result<(), Box<dyn Error>> {
    println!("cargo:rerun-if-changed=wheelarm");
    let out = PathBuf::from(std::env::var("OUT_DIR")?);
    let mut compiler = Compiler::new(["."])?;
    compiler.include_source_info(true).include_imports(true);
    compiler.open_files(FILES)?;

    // The messages alone: readers of files need no options.
    let mut plain = compiler.file_descriptor_set();
    let own = |name: &str| FILES.contains(&name);
    plain.file.retain(|file| own(file.name()));
    for file in &mut plain.file {
        file.dependency.retain(|name| own(name));
    }
    let mut config = Config::new();
    config.bytes(SHARED_BYTES);
    for message in WRITTEN {
        config.type_attribute(message, WRITE);
    }
    for (field, module) in CHOICES {
        config.field_attribute(field, format!("#[serde(with = \"crate::settings::text::{module}\", skip_serializing_if = \"crate::settings::text::is_unspecified\")]"));
    }
    // Spelled `look` up to contract 2.
    config.field_attribute(
        ".wheelarm.v1.Scenario.appearance",
        "#[serde(alias = \"look\")]",
    );
    config.field_attribute(".wheelarm.v1.Person.sampled", "#[serde(alias = \"drawn\")]");
    for axis in STRENGTHS {
        let read = "#[serde(deserialize_with = \"crate::appearance::strength\")]";
        config.field_attribute(format!(".wheelarm.v1.Appearance.{axis}"), read);
    }
    config.compile_fds(plain.clone())?;
    for file in &mut plain.file {
        file.source_code_info = None;
    }
    std::fs::write(
        out.join("messages.bin"),
        protox::prost::Message::encode_to_vec(&plain),
    )?;

    compiler.include_source_info(false);
    std::fs::write(
        out.join("contract.bin"),
        compiler.encode_file_descriptor_set(),
    )?;

    let pool = compiler.descriptor_pool();
    let topics = topics(&pool)?;
    std::fs::write(out.join("rpc.rs"), rpcs(&pool)?)?;
    std::fs::write(out.join("topic.rs"), topic_table(&topics)?)?;
    std::fs::write(out.join("stamped.rs"), stamped(&pool)?)?;
    Ok(())
}

/// `EpisodeStart` as `episode_start`.
fn snake(name: &str) -> String {
    let mut out = String::new();
    for c in name.chars() {
        if c.is_ascii_uppercase() && !out.is_empty() {
            out.push('_');
        }
        out.push(c.to_ascii_lowercase());
    }
    out
}

/// `episode_start` as `EpisodeStart`.
fn pascal(name: &str) -> String {
    let chunk = |word: &str| {
        let (first, rest) = word.split_at(1.min(word.len()));
        first.to_ascii_uppercase() + rest
    };
    name.split('_').map(chunk).collect()
}

/// The queries: an enum, and `Rpc` for every request.
fn rpcs(pool: &DescriptorPool) -> Result<String, Box<dyn Error>> {
    let service = pool
        .get_service_by_name("wheelarm.v1.Simulation")
        .ok_or("the service wheelarm.v1.Simulation is missing")?;
    let key_field = pool
        .get_extension_by_name("wheelarm.options.key_field")
        .ok_or("the option wheelarm.options.key_field is missing")?;
    let (mut variants, mut names, mut queries, mut impls, mut identities, mut messages) = (
        String::new(),
        String::new(),
        String::new(),
        String::new(),
        String::new(),
        String::new(),
    );
    let mut requests = HashSet::new();
    for method in service.methods() {
        let (name, input, output) = (method.name().to_owned(), method.input(), method.output());
        if !requests.insert(input.full_name().to_owned()) {
            return Err(format!(
                "{name}: {} is the request of two queries",
                input.full_name()
            )
            .into());
        }
        let query = snake(&name);
        writeln!(
            variants,
            "    /// `{}` → `{}`.\n    {name},",
            input.name(),
            output.name()
        )?;
        writeln!(names, "            Self::{name} => \"{query}\",")?;
        let options = method.options();
        let level = options.get_field_by_name("idempotency_level");
        let is_query = level.and_then(|v| v.as_enum_number()) == Some(1);
        writeln!(queries, "            Self::{name} => {is_query},")?;
        let field = options.get_extension(&key_field);
        let field = field.as_str().unwrap_or_default();
        let identity = match field {
            "" => String::new(),
            field => format!(
                "\n    fn identity(&self) -> Option<&str> {{\n        Some(&self.{field})\n    }}"
            ),
        };
        writeln!(
            identities,
            "            Self::{name} => {},",
            !field.is_empty()
        )?;
        writeln!(
            messages,
            "            Self::{name} => [\"{}\", \"{}\"],",
            input.full_name(),
            output.full_name()
        )?;
        writeln!(
            impls,
            "impl Rpc for crate::v1::{} {{\n    const QUERY: Query = Query::{name};\n    type Reply = crate::v1::{};{identity}\n}}",
            input.name(),
            output.name()
        )?;
    }
    let all: String = service
        .methods()
        .map(|m| format!("        Self::{},\n", m.name()))
        .collect();
    let count = service.methods().len();
    Ok(format!(
        "/// Queries that a server answers, as `service Simulation` declares them.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum Query {{
{variants}}}

impl Query {{
    /// Every query.
    pub const ALL: [Self; {count}] = [
{all}    ];

    /// Last chunk of the key.
    #[must_use]
    pub const fn name(self) -> &'static str {{
        match self {{
{names}        }}
    }}

    /// Whether it only looks and changes nothing.
    #[must_use]
    pub const fn only_looks(self) -> bool {{
        match self {{
{queries}        }}
    }}

    /// Whether a name of the request stands in the key.
    #[must_use]
    pub const fn has_identity(self) -> bool {{
        match self {{
{identities}        }}
    }}

    /// Full names of its request and of its reply.
    #[must_use]
    pub const fn messages(self) -> [&'static str; 2] {{
        match self {{
{messages}        }}
    }}
}}

{impls}"
    ))
}

/// One message that is published.
struct Topic {
    message: String,
    name: String,
    key: String,
    rate: String,
    unit: String,
    frame: String,
    from: String,
    record: String,
}

fn topics(pool: &DescriptorPool) -> Result<Vec<Topic>, Box<dyn Error>> {
    let option = pool
        .get_extension_by_name("wheelarm.options.topic")
        .ok_or("the option wheelarm.options.topic is missing")?;
    let mut topics = Vec::new();
    for file in FILES {
        let file = pool.get_file_by_name(file).ok_or("a file is missing")?;
        for message in file.messages() {
            topics.extend(topic(&message, &option)?);
        }
    }
    let names: HashSet<_> = topics.iter().map(|t| &t.name).collect();
    if names.len() != topics.len() {
        return Err("two topics have one name".into());
    }
    Ok(topics)
}

fn topic(
    message: &MessageDescriptor,
    option: &ExtensionDescriptor,
) -> Result<Option<Topic>, Box<dyn Error>> {
    let options = message.options();
    if !options.has_extension(option) {
        return Ok(None);
    }
    let value = options.get_extension(option);
    let option = value.as_message().ok_or("the option is not a message")?;
    let key = text(option, "key");
    let key_words = key.strip_prefix("stream/").unwrap_or(&key);
    let name: Vec<_> = key_words
        .split('/')
        .filter(|chunk| !chunk.starts_with('{'))
        .collect();
    let name = match text(option, "name") {
        stated if stated.is_empty() => name.join("_"),
        stated => stated,
    };
    let topic = Topic {
        message: message.name().to_owned(),
        name,
        rate: choice(option, "rate")?,
        unit: text(option, "unit"),
        frame: text(option, "frame"),
        from: choice(option, "from")?,
        record: choice(option, "record")?,
        key,
    };
    for (what, value) in [("rate", &topic.rate), ("from", &topic.from)] {
        if value == "Unspecified" {
            return Err(format!("{}: its topic lacks the {what}", topic.message).into());
        }
    }
    Ok(Some(topic))
}

fn text(message: &DynamicMessage, field: &str) -> String {
    let value = message.get_field_by_name(field);
    let text = value.as_ref().and_then(|v| v.as_str());
    text.unwrap_or_default().to_owned()
}

/// The value of an enum without its prefix: `RATE_STATE` as `State`.
fn choice(message: &DynamicMessage, field: &str) -> Result<String, Box<dyn Error>> {
    let descriptor = message
        .descriptor()
        .get_field_by_name(field)
        .ok_or("a field is missing")?;
    let kind = descriptor.kind();
    let kind = kind.as_enum().ok_or("a field is not an enum")?.clone();
    let number = message.get_field(&descriptor).as_enum_number();
    let value = kind.get_value(number.unwrap_or_default());
    let value = value.ok_or("a value has no name")?;
    let prefix = format!("{}_", kind.name().to_ascii_uppercase());
    let name = value.name().strip_prefix(&prefix).unwrap_or(value.name());
    Ok(pascal(&name.to_ascii_lowercase()))
}

/// The enum of topics, the table, `Topic` for every message, and a decoded
/// sample of any of them.
fn topic_table(topics: &[Topic]) -> Result<String, Box<dyn Error>> {
    let (mut variants, mut all, mut rows, mut impls, mut samples, mut reads) = (
        String::new(),
        String::new(),
        String::new(),
        String::new(),
        String::new(),
        String::new(),
    );
    let mut columns = Vec::new();
    let (mut whose, mut headers, mut writes) = (String::new(), String::new(), String::new());
    for topic in topics {
        let Topic {
            message,
            name,
            key,
            rate,
            unit,
            frame,
            from,
            record,
        } = topic;
        let variant = pascal(name);
        writeln!(variants, "    /// `{key}`: `{message}`.\n    {variant},")?;
        writeln!(all, "        Self::{variant},")?;
        writeln!(
            rows,
            "    TopicInfo {{
        name: {name:?},
        key: {key:?},
        message: \"{PACKAGE}.{message}\",
        rate: Rate::{rate},
        unit: {unit:?},
        frame: {frame:?},
        from: Role::{from},
        record: Record::{record},
    }},"
        )?;
        writeln!(
            impls,
            "impl Topic for crate::v1::{message} {{\n    const TOPIC: TopicId = TopicId::{variant};\n}}"
        )?;
        writeln!(
            samples,
            "    /// `{name}`.\n    {variant}(crate::v1::{message}),"
        )?;
        writeln!(
            reads,
            "            TopicId::{variant} => Self::{variant}(prost::Message::decode(payload)?),"
        )?;
        writeln!(
            whose,
            "            Self::{variant}(_) => TopicId::{variant},"
        )?;
        writeln!(
            headers,
            "            Self::{variant}(m) => m.header.as_ref(),"
        )?;
        writeln!(
            writes,
            "            Self::{variant}(m) => prost::Message::encode_to_vec(m),"
        )?;
        if record == "Columns" {
            columns.push(variant);
        }
    }
    let columns: String = columns
        .iter()
        .map(|variant| format!("        Self::{variant},\n"))
        .collect();
    let (count, states) = (topics.len(), columns.lines().count());
    Ok(format!(
        "/// A topic, as an option of its message declares it.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum TopicId {{
{variants}}}

impl TopicId {{
    /// Every topic, in the order of [`TOPICS`].
    pub const ALL: [Self; {count}] = [
{all}    ];

    /// The state streams: those whose messages become columns of a recording.
    pub const STATES: [Self; {states}] = [
{columns}    ];
}}

/// The one table of topics.
pub static TOPICS: [TopicInfo; {count}] = [
{rows}];

{impls}
/// A decoded message of any topic.
#[derive(Clone, Debug, PartialEq)]
#[expect(clippy::large_enum_variant, reason = \"a sample is looked at and dropped\")]
pub enum Sample {{
{samples}}}

impl Sample {{
    /// Reads a message of `topic`.
    ///
    /// # Errors
    /// When the bytes cannot be decoded.
    pub fn decode(topic: TopicId, payload: &[u8]) -> Result<Self, prost::DecodeError> {{
        Ok(match topic {{
{reads}        }})
    }}

    /// The message as bytes, which [`Sample::decode`] reads.
    #[must_use]
    pub fn encode(&self) -> Vec<u8> {{
        match self {{
{writes}        }}
    }}

    /// Its topic.
    #[must_use]
    pub fn topic(&self) -> TopicId {{
        match self {{
{whose}        }}
    }}

    /// Its stamp.
    #[must_use]
    pub fn header(&self) -> Option<&crate::v1::Header> {{
        match self {{
{headers}        }}
    }}
}}
"
    ))
}

/// `Stamped` for every message whose first field is its header.
fn stamped(pool: &DescriptorPool) -> Result<String, Box<dyn Error>> {
    let mut out = String::new();
    let header = "wheelarm.v1.Header";
    for message in pool.all_messages() {
        let first = message.get_field(1);
        let kind = first.map(|field| field.kind());
        let is_header = kind
            .as_ref()
            .and_then(|kind| kind.as_message())
            .is_some_and(|kind| kind.full_name() == header);
        if is_header && message.package_name() == PACKAGE {
            writeln!(
                out,
                "impl Stamped for crate::v1::{} {{
    fn header(&self) -> Option<&crate::v1::Header> {{
        self.header.as_ref()
    }}
    fn set_header(&mut self, header: crate::v1::Header) {{
        self.header = Some(header);
    }}
}}",
                message.name()
            )?;
        }
    }
    Ok(out)
}
