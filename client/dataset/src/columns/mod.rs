//! The columns of every stream in a file: one declarative table, [`streams`].
//!
//! A column names one dataset: its unit, its frame, its trailing axes and how
//! its numbers are read from a message and written back into one. Numbers are
//! stored unchanged: f64 bit for bit, stamps and sequences as u64, text as
//! UTF-8. Values that a message does not carry are NaN. This module does not use HDF5.

mod codec;
mod table;
mod values;

pub use table::{EVENT_COLUMNS, event_cells, for_stream, streams};

use prost::Message;
pub use wheelarm_proto::MAX_CONTACTS;
use wheelarm_proto::{StreamId, Topic, v1};

/// A trailing axis of a dataset; the first axis is always the sample.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Axis {
    /// The recorded joints of the robot.
    Joints,
    /// Its arm's joints, from base to hand.
    ArmJoints,
    /// The recorded frames of the robot.
    Frames,
    /// The objects of the scene, as the episode's start names them.
    Objects,
    /// The joints of the furniture, as the episode's start names them.
    FurnitureJoints,
    /// The rays of the laser scanner.
    Rays,
    /// The vertices of the soft object's skin.
    Vertices,
    /// The conditions of the task.
    Conditions,
    /// The strongest contacts, at most [`MAX_CONTACTS`].
    Contacts,
    /// Entries with fixed names.
    Names(&'static [&'static str]),
    /// Components of a vector.
    Components(&'static [&'static str]),
}

/// Names that only the episode itself knows.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Context {
    /// Names of the robot's joints in the order of `JointState`.
    pub joints: Vec<String>,
    /// Names of its arm's joints, from base to hand.
    pub arm_joints: Vec<String>,
    /// Names of its frames in the order of `PoseSet`.
    pub frames: Vec<String>,
    /// Object names in the order of `ObjectPoses`.
    pub objects: Vec<String>,
    /// Names of the furniture's joints in the order of `FurnitureJoints`.
    pub furniture_joints: Vec<String>,
    /// Whether each of these turns; empty when the file does not say.
    pub furniture_turns: Vec<bool>,
    /// Rays of the laser scanner.
    pub rays: usize,
    /// Vertices of the soft object's skin.
    pub vertices: usize,
    /// Condition names in the order in which they first appeared.
    pub conditions: Vec<String>,
}

impl Context {
    /// With only the names of a robot's joints and frames.
    #[must_use]
    pub fn from_description(robot: &v1::RobotDescription) -> Self {
        let owned = |name: &str| name.to_owned();
        Self {
            joints: robot.joint_names().map(owned).collect(),
            arm_joints: robot.arm_joint_names().into_iter().map(owned).collect(),
            frames: robot.frame_names().map(owned).collect(),
            rays: robot.scanner.as_ref().map_or(0, |s| s.rays as usize),
            ..Self::default()
        }
    }
}

impl Axis {
    /// Number of entries.
    #[must_use]
    pub fn len(self, context: &Context) -> usize {
        match self {
            Self::Joints => context.joints.len(),
            Self::ArmJoints => context.arm_joints.len(),
            Self::Frames => context.frames.len(),
            Self::Objects => context.objects.len(),
            Self::FurnitureJoints => context.furniture_joints.len(),
            Self::Rays => context.rays,
            Self::Vertices => context.vertices,
            Self::Conditions => context.conditions.len(),
            Self::Contacts => MAX_CONTACTS,
            Self::Names(n) | Self::Components(n) => n.len(),
        }
    }

    /// Reads the entries of an axis from a file that lists them, the inverse of
    /// [`Axis::labels`]; axes whose entries the table itself names stay.
    pub fn learn(self, names: &[String], context: &mut Context) {
        let entries = match self {
            Self::Joints => &mut context.joints,
            Self::ArmJoints => &mut context.arm_joints,
            Self::Frames => &mut context.frames,
            Self::Objects => &mut context.objects,
            Self::FurnitureJoints => &mut context.furniture_joints,
            Self::Conditions => &mut context.conditions,
            Self::Rays | Self::Vertices | Self::Contacts | Self::Names(_) | Self::Components(_) => {
                return;
            }
        };
        names.clone_into(entries);
    }

    /// Unit of each entry, where entries of a column have several: those of a `unit` like
    /// `m or rad` that the episode's joints have.
    #[must_use]
    pub fn units(self, unit: &str, context: &Context) -> Option<Vec<String>> {
        let known = context.furniture_turns.len() == context.furniture_joints.len();
        let (Self::FurnitureJoints, true, Some((slides, turns))) =
            (self, known, unit.split_once(" or "))
        else {
            return None;
        };
        let of = |is_turning: &bool| if *is_turning { turns } else { slides }.to_owned();
        Some(context.furniture_turns.iter().map(of).collect())
    }

    /// Name of the attribute that lists the entries, and the entries.
    #[must_use]
    pub fn labels(self, context: &Context) -> Option<(&'static str, Vec<String>)> {
        let owned = |list: &[&str]| list.iter().map(|&s| s.to_owned()).collect();
        match self {
            Self::Joints => Some(("names", context.joints.clone())),
            Self::ArmJoints => Some(("names", context.arm_joints.clone())),
            Self::Frames => Some(("names", context.frames.clone())),
            Self::Objects => Some(("names", context.objects.clone())),
            Self::FurnitureJoints => Some(("names", context.furniture_joints.clone())),
            Self::Conditions => Some(("names", context.conditions.clone())),
            Self::Contacts | Self::Rays | Self::Vertices => None,
            Self::Names(n) => Some(("names", owned(n))),
            Self::Components(n) => Some(("components", owned(n))),
        }
    }
}

/// How a column's numbers are read from a message and written back into one: the
/// only place that knows it, for files, replays and exports.
pub struct Codec<M, T> {
    /// Appends the numbers of a message.
    take: fn(&M, &Context, &mut Vec<T>),
    /// Writes the numbers of one sample into a message, as many as the file has.
    put: fn(&mut M, &Context, &[T]),
}

/// The same for texts; putting one back fails when it cannot be read.
pub struct TextCodec<M> {
    take: fn(&M) -> String,
    put: fn(&mut M, String) -> Result<(), String>,
}

/// How a column's values are read from a message and written back.
pub enum Values<M> {
    /// 64-bit floating point numbers.
    F64(Codec<M, f64>),
    /// 64-bit unsigned integers.
    U64(Codec<M, u64>),
    /// Truth values, stored as 0 and 1.
    Flag(Codec<M, u8>),
    /// One text per sample.
    Text(TextCodec<M>),
    /// The encoded message itself: replay reads it, and the
    /// other columns of its stream need not restore it.
    Message,
}

/// Type of a column's elements.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Kind {
    /// 64-bit floating point.
    F64,
    /// 64-bit unsigned integer.
    U64,
    /// 8-bit unsigned integer, 0 or 1.
    Flag,
    /// UTF-8 of variable length.
    Text,
    /// Bytes of variable length.
    Bytes,
}

/// One dataset of a stream.
pub struct Column<M> {
    name: &'static str,
    unit: &'static str,
    frame: &'static str,
    axes: &'static [Axis],
    values: Values<M>,
}

/// Description of a column, without the message type.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ColumnInfo {
    /// Dataset name.
    pub name: &'static str,
    /// Unit; `1` for none.
    pub unit: &'static str,
    /// Frame of the numbers; empty without one.
    pub frame: &'static str,
    /// Trailing axes.
    pub axes: &'static [Axis],
    /// Element type.
    pub kind: Kind,
}

impl ColumnInfo {
    /// Lengths of the trailing axes.
    #[must_use]
    pub fn shape(&self, context: &Context) -> Vec<usize> {
        self.axes.iter().map(|a| a.len(context)).collect()
    }

    /// Elements per sample.
    #[must_use]
    pub fn width(&self, context: &Context) -> usize {
        self.shape(context).iter().product()
    }
}

/// One sample's values of one column.
#[derive(Clone, Debug, PartialEq)]
pub enum Cell {
    /// Numbers.
    F64(Vec<f64>),
    /// Integers.
    U64(Vec<u64>),
    /// Truth values.
    Flag(Vec<u8>),
    /// Text.
    Text(String),
    /// Bytes.
    Bytes(Vec<u8>),
}

/// Why stored values do not make a message.
#[derive(Debug, thiserror::Error)]
#[error("{column}: {reason}")]
pub struct RestoreError {
    /// The column.
    pub column: &'static str,
    /// The reason.
    pub reason: String,
}

/// One stream's table with its message type erased.
pub trait Stream: Send + Sync {
    /// Name of the stream.
    fn name(&self) -> &'static str;
    /// Its columns in order.
    fn columns(&self) -> Vec<ColumnInfo>;
    /// Whether the payload is this stream's message.
    ///
    /// # Errors
    /// When it is not.
    fn check(&self, payload: &[u8]) -> Result<(), prost::DecodeError>;
    /// Reads the columns of one sample. The flag is false when a list had another
    /// length than its column; it is then cut or filled with NaN or 0.
    ///
    /// # Errors
    /// When the payload is not the stream's message.
    fn extract(
        &self,
        payload: &[u8],
        context: &Context,
    ) -> Result<(Vec<Cell>, bool), prost::DecodeError>;
    /// Puts one sample together again, the inverse of [`Stream::extract`]: the
    /// encoded message of `header` and one cell per column, `None` for a column
    /// that the file does not have.
    ///
    /// # Errors
    /// When a text is not valid for the column.
    fn restore(
        &self,
        header: v1::Header,
        cells: Vec<Option<Cell>>,
        context: &Context,
    ) -> Result<Vec<u8>, RestoreError>;
}

/// The columns of one stream.
pub struct Table<M: 'static> {
    columns: &'static [Column<M>],
}

impl<M: Topic + 'static> Stream for Table<M> {
    fn name(&self) -> &'static str {
        M::NAME
    }

    fn columns(&self) -> Vec<ColumnInfo> {
        self.columns
            .iter()
            .map(|c| ColumnInfo {
                name: c.name,
                unit: c.unit,
                frame: c.frame,
                axes: c.axes,
                kind: match &c.values {
                    Values::F64(_) => Kind::F64,
                    Values::U64(_) => Kind::U64,
                    Values::Flag(_) => Kind::Flag,
                    Values::Text(_) => Kind::Text,
                    Values::Message => Kind::Bytes,
                },
            })
            .collect()
    }

    fn check(&self, payload: &[u8]) -> Result<(), prost::DecodeError> {
        M::decode(payload).map(drop)
    }

    fn extract(
        &self,
        payload: &[u8],
        context: &Context,
    ) -> Result<(Vec<Cell>, bool), prost::DecodeError> {
        let message = M::decode(payload)?;
        let mut regular = true;
        let cells = self
            .columns
            .iter()
            .map(|column| {
                let width = column.axes.iter().map(|a| a.len(context)).product();
                match &column.values {
                    Values::F64(codec) => {
                        let mut out = Vec::with_capacity(width);
                        (codec.take)(&message, context, &mut out);
                        regular &= out.len() == width;
                        out.resize(width, f64::NAN);
                        Cell::F64(out)
                    }
                    Values::U64(codec) => {
                        let mut out = Vec::with_capacity(width);
                        (codec.take)(&message, context, &mut out);
                        regular &= out.len() == width;
                        out.resize(width, 0);
                        Cell::U64(out)
                    }
                    Values::Flag(codec) => {
                        let mut out = Vec::with_capacity(width);
                        (codec.take)(&message, context, &mut out);
                        regular &= out.len() == width;
                        out.resize(width, 0);
                        Cell::Flag(out)
                    }
                    Values::Text(codec) => Cell::Text((codec.take)(&message)),
                    Values::Message => Cell::Bytes(payload.to_vec()),
                }
            })
            .collect();
        Ok((cells, regular))
    }

    fn restore(
        &self,
        header: v1::Header,
        cells: Vec<Option<Cell>>,
        context: &Context,
    ) -> Result<Vec<u8>, RestoreError> {
        let mut message = M::default();
        message.set_header(header);
        for (column, cell) in self.columns.iter().zip(cells) {
            match (&column.values, cell) {
                (Values::Message, Some(Cell::Bytes(encoded))) => return Ok(encoded),
                (Values::F64(codec), Some(Cell::F64(v))) => (codec.put)(&mut message, context, &v),
                (Values::U64(codec), Some(Cell::U64(v))) => (codec.put)(&mut message, context, &v),
                (Values::Flag(codec), Some(Cell::Flag(v))) => {
                    (codec.put)(&mut message, context, &v);
                }
                (Values::Text(codec), Some(Cell::Text(text))) => {
                    (codec.put)(&mut message, text).map_err(|reason| RestoreError {
                        column: column.name,
                        reason,
                    })?;
                }
                // The file lacks the column or has another type there.
                _ => {}
            }
        }
        Ok(message.encode_to_vec())
    }
}

/// Header of any message of the package: it is field 1 of every one.
///
/// # Errors
/// When the bytes are not a message.
pub fn header_of(payload: &[u8]) -> Result<v1::Header, prost::DecodeError> {
    #[derive(Clone, PartialEq, Message)]
    struct HeaderOnly {
        #[prost(message, optional, tag = "1")]
        header: Option<v1::Header>,
    }
    Ok(HeaderOnly::decode(payload)?.header.unwrap_or_default())
}

/// Whether a payload is a message of `stream`; streams that this version does
/// not know are taken as they come.
///
/// # Errors
/// When it is not.
pub fn check(stream: &str, payload: &[u8]) -> Result<(), prost::DecodeError> {
    let id = StreamId::parse(stream);
    if id == StreamId::EVENTS {
        return v1::Event::decode(payload).map(drop);
    }
    match for_stream(&id) {
        Some(table) => table.check(payload),
        None => Ok(()),
    }
}
