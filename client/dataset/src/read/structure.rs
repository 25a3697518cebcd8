//! Structure of a recording, checked before anything is read: all data are stored in
//! the file itself, and no dataset claims more memory than the schema can need. A
//! recording may come from a stranger, and HDF5 follows links and external storage
//! without a check.

use hdf5::dataset::Layout;
use hdf5::{Dataset, File, Group, LinkType};

use crate::log::{MAX_MESSAGE, MAX_SNAPSHOT};

/// Most bytes of the zip file of a world pack.
const MAX_PACK: u64 = 64 << 20;
use crate::writer::MAX_SIDE;

/// Deepest group of a recording is `/streams/camera/NAME`; a cycle of hard links has
/// no end.
const MAX_DEPTH: usize = 16;
/// Most objects of a file; a recording has some 400.
const MAX_OBJECTS: usize = 1 << 16;
/// Columns that are read whole may claim this much together, bytes, however small
/// the file is: two hours of all streams at their usual rates.
const LEAST_COLUMNS: u64 = 1 << 30;
/// And this many times the length of the file: columns of a robot at rest compress
/// 20 times.
const COLUMNS_RATIO: u64 = 64;
/// Most bytes of one image: float32 depth of the largest size.
const MAX_IMAGE: u64 = 4 * MAX_SIDE as u64 * MAX_SIDE as u64;

/// Checks every link and dataset of a file of `length` bytes.
///
/// # Errors
/// The reason, with the path of the object.
pub(super) fn check(file: &File, length: u64) -> Result<(), String> {
    let root: Group = file.as_group().map_err(|e| format!("/: {e}"))?;
    let mut pending = vec![(root, String::new(), 0)];
    let (mut objects, mut columns) = (0, 0_u64);
    let most = LEAST_COLUMNS.max(length.saturating_mul(COLUMNS_RATIO));
    while let Some((group, path, depth)) = pending.pop() {
        let mut links = Vec::new();
        let visited = group.iter_visit_default(|name, link| {
            objects += 1;
            if objects > MAX_OBJECTS {
                return Err(hdf5::Error::Internal(format!(
                    "more than {MAX_OBJECTS} objects"
                )));
            }
            links.push((name.to_owned(), link.link_type));
            Ok(())
        });
        match visited {
            Err(problem) if objects > MAX_OBJECTS => return Err(problem.to_string()),
            // A group that cannot be listed cannot be read either.
            _ => {}
        }
        for (name, link) in links {
            let path = match path.as_str() {
                "" => name.clone(),
                above => format!("{above}/{name}"),
            };
            match link {
                LinkType::Hard => {}
                LinkType::Soft => return Err(format!("{path} is a soft link")),
                LinkType::External => {
                    return Err(format!("{path} is a link to another file"));
                }
            }
            if let Ok(data) = group.dataset(&name) {
                check_storage(&path, &data)?;
                match ceiling(&path) {
                    Some((size, most)) => {
                        let claimed = size.of(&data);
                        if claimed > most {
                            return Err(format!(
                                "{path} claims {claimed} bytes, at most {most} are possible"
                            ));
                        }
                    }
                    None => {
                        columns = columns.saturating_add(Size::Column.of(&data));
                        if columns > most {
                            return Err(format!(
                                "{path} and the columns before it claim {columns} bytes, at most \
                                 {most} are possible in a file of {length}"
                            ));
                        }
                    }
                }
            } else if let Ok(below) = group.group(&name) {
                if depth + 1 > MAX_DEPTH {
                    return Err(format!(
                        "{path} is nested more than {MAX_DEPTH} groups deep"
                    ));
                }
                pending.push((below, path, depth + 1));
            }
        }
    }
    Ok(())
}

/// Rejects data that are stored in another file.
fn check_storage(path: &str, data: &Dataset) -> Result<(), String> {
    let unknown = |e| format!("{path}: its storage is unknown ({e})");
    if data.layout() == Layout::Virtual {
        return Err(format!("{path} is a virtual dataset of other datasets"));
    }
    let external = data.dcpl().and_then(|plist| plist.get_external());
    match external.map_err(unknown)?.first() {
        Some(other) => Err(format!("{path} is stored in another file, {}", other.name)),
        None => Ok(()),
    }
}

/// Which size of a dataset counts.
#[derive(Clone, Copy)]
enum Size {
    /// All of it, as it is stored.
    Whole,
    /// One sample, as it is stored.
    Sample,
    /// All of it, as numbers of 64 bits: a reader may widen them.
    Column,
}

impl Size {
    /// Bytes in memory, without what lists of variable length refer to.
    fn of(self, data: &Dataset) -> u64 {
        let element = data.dtype().map_or(8, |t| t.size());
        let shape = data.shape();
        let (element, axes) = match self {
            Self::Whole => (element, shape.as_slice()),
            Self::Sample => (element, shape.get(1..).unwrap_or_default()),
            Self::Column => (element.max(8), shape.as_slice()),
        };
        let bytes = axes.iter().try_fold(element, |n, &k| n.checked_mul(k));
        bytes.map_or(u64::MAX, |n| n as u64)
    }
}

/// Most bytes of a dataset that is not a column, and which of its sizes counts.
fn ceiling(path: &str) -> Option<(Size, u64)> {
    let is_image = |name| matches!(name, "rgb" | "depth" | "ids");
    let parts: Vec<&str> = path.split('/').collect();
    match parts.as_slice() {
        ["initial_state", "snapshot" | "furniture_urdf"] => {
            Some((Size::Whole, MAX_SNAPSHOT as u64))
        }
        ["packs", _] => Some((Size::Whole, MAX_PACK)),
        ["robot", "message"] | ["scenario", _] => Some((Size::Whole, MAX_MESSAGE as u64)),
        ["streams", "camera" | "sensor", _, name] if is_image(name) => {
            Some((Size::Sample, MAX_IMAGE))
        }
        _ => None,
    }
}
