//! Errors of an import: what was found and how to fix it.

/// A home that cannot be imported.
#[derive(Debug, thiserror::Error)]
pub enum ImportError {
    /// A file that cannot be read.
    #[error("cannot read {path}: {reason}")]
    Unreadable {
        /// The file.
        path: String,
        /// Message of the system.
        reason: String,
    },
    /// A file that is not a zip archive.
    #[error(
        "{file} is not a Sweet Home 3D file: {reason}; save the home with Sweet Home 3D as .sh3d"
    )]
    NotZip {
        /// The file.
        file: String,
        /// Message of the reader.
        reason: String,
    },
    /// An archive above a limit, or with unsafe entries.
    #[error("{file} is rejected: {reason}")]
    Unsafe {
        /// The file.
        file: String,
        /// The entry and the limit.
        reason: String,
    },
    /// A home of an old version, without `Home.xml`.
    #[error(
        "{file} holds a serialized home only; open and save it with Sweet Home 3D 5.3 or newer"
    )]
    Serialized {
        /// The file.
        file: String,
    },
    /// No home in the archive.
    #[error("{file} has no Home.xml: it is not a home; save the home with Sweet Home 3D as .sh3d")]
    NoHome {
        /// The file.
        file: String,
    },
    /// Invalid XML.
    #[error("{file}: Home.xml is damaged: {reason}; open and save it with Sweet Home 3D")]
    Xml {
        /// The file.
        file: String,
        /// Where and why.
        reason: String,
    },
    /// An attribute with an invalid value.
    #[error(
        "{file}: {element}: {attribute} = {value:?}, expected {expected}; correct it in Sweet Home 3D and save the home again"
    )]
    Value {
        /// The file.
        file: String,
        /// Kind and name of the element.
        element: String,
        /// The attribute.
        attribute: String,
        /// Its value.
        value: String,
        /// The valid values.
        expected: String,
    },
    /// A level that does not exist.
    #[error("{file} has no level {level:?}; levels: {levels}")]
    NoLevel {
        /// The file.
        file: String,
        /// The requested level.
        level: String,
        /// The levels, with their numbers of walls.
        levels: String,
    },
    /// A level without walls.
    #[error("level {level:?} has no walls; levels with walls: {levels}")]
    NoWalls {
        /// The level.
        level: String,
        /// The others, with their numbers of walls.
        levels: String,
    },
    /// No room is drawn, and the walls enclose none.
    #[error("{name}: no room is closed; draw rooms or close the wall near ({x:.2}, {y:.2}) m")]
    NoRoom {
        /// The home.
        name: String,
        /// An open end of a wall, metres of the pack.
        x: f64,
        /// The same.
        y: f64,
    },
    /// No free floor for the chair.
    #[error(
        "{name}: no room has free floor for a wheelchair (a circle of {radius:.2} m); move or leave out furniture, for example with --without chairs,rugs"
    )]
    NoStart {
        /// The home.
        name: String,
        /// The radius that is needed.
        radius: f64,
    },
    /// An invalid option.
    #[error("invalid {option} {value:?}: {expected}")]
    Option {
        /// The option.
        option: &'static str,
        /// Its value.
        value: String,
        /// What is expected.
        expected: String,
    },
    /// A pack that cannot be written.
    #[error("cannot write {path}: {reason}")]
    Unwritable {
        /// The file or folder.
        path: String,
        /// Why.
        reason: String,
    },
}

/// A fault of one model or image: it costs its piece only.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum ModelError {
    /// No model in the file.
    #[error("its model {0} is missing in the file; open and save the home with Sweet Home 3D")]
    Missing(String),
    /// Another format.
    #[error("model {model} is {format}; export it as OBJ")]
    Format {
        /// Path in the archive.
        model: String,
        /// Name of the format.
        format: &'static str,
    },
    /// A damaged or unsuitable model.
    #[error("model {model}: {reason}; export it as OBJ again")]
    Malformed {
        /// Path in the archive.
        model: String,
        /// What is wrong.
        reason: String,
    },
}
