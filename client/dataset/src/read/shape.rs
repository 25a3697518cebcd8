//! Whether a dataset has the rows and the width that it must have. Readers of a
//! column rely on both and do not check again.

use hdf5::Dataset;
use wheelarm_proto::StreamId;

use super::error::ReadError;
use super::{Episode, place};
use crate::columns::{self, Axis, Context};

/// Numbers of an image's calibration: width, height, fx, fy, cx, cy.
const INTRINSICS: usize = 6;
/// Numbers of an image's pose: x y z, qx qy qz qw.
const POSE: usize = 7;

impl Episode {
    /// Refuses a column that has not one row for each stamp of its stream, or another
    /// width than the recorded robot, the layout or its own names say.
    ///
    /// # Errors
    /// [`ReadError::Shape`] with both sizes; when the stream has no stamps.
    pub(super) fn check_shape(
        &self,
        stream: &str,
        column: &str,
        data: &Dataset,
    ) -> Result<(), ReadError> {
        // The stamps are what the others are measured by.
        if column == "stamp_nanos" {
            return Ok(());
        }
        let shape = data.shape();
        let stamps = self.column(stream, "stamp_nanos")?.shape();
        let rows = |shape: &[usize]| shape.first().copied().unwrap_or_default();
        if shape.is_empty() || rows(&shape) != rows(&stamps) {
            let expected = format!("{}, one for each stamp", rows(&stamps));
            return Err(self.shape(
                &place(stream, column),
                format!("{} rows", rows(&shape)),
                expected,
            ));
        }
        let width = &shape[1..];
        let wanted = self.width(stream, column, data)?;
        let fits = |wanted: &[Option<usize>]| {
            let mut pairs = width.iter().zip(wanted);
            width.len() == wanted.len() && pairs.all(|(&is, wanted)| wanted.is_none_or(|t| t == is))
        };
        if let Some(wanted) = wanted.filter(|wanted| !fits(wanted)) {
            let word = |n: &Option<usize>| n.map_or("any".to_owned(), |n| n.to_string());
            let words: Vec<String> = wanted.iter().map(word).collect();
            let expected = format!("[{}]", words.join(", "));
            let found = format!("rows of {width:?} numbers");
            return Err(self.shape(&place(stream, column), found, expected));
        }
        Ok(())
    }

    /// Lengths of the trailing axes of a column, `None` for one that may have any;
    /// `None` for a column that this version does not know.
    fn width(
        &self,
        stream: &str,
        column: &str,
        data: &Dataset,
    ) -> Result<Option<Vec<Option<usize>>>, ReadError> {
        let id = StreamId::parse(stream);
        if id.camera_name().is_some() || id.sensor_name().is_some() {
            return Ok(match column {
                "intrinsics" => Some(vec![Some(INTRINSICS)]),
                "pose" => Some(vec![Some(POSE)]),
                "sequence" | "tick" | "exposure_nanos" | "exposure_tick" => Some(Vec::new()),
                _ => None,
            });
        }
        let known = columns::for_stream(&id).map(|table| table.columns());
        let known = known.and_then(|all| all.into_iter().find(|info| info.name == column));
        let Some(info) = known else {
            return Ok(None);
        };
        let names = super::texts(data, "names").ok().map(|names| names.len());
        let mut lengths = Vec::new();
        for axis in info.axes {
            lengths.push(match axis {
                Axis::Joints | Axis::ArmJoints | Axis::Frames | Axis::Rays => {
                    Some(axis.len(self.robot_context()?))
                }
                Axis::Components(_) | Axis::Contacts => Some(axis.len(&Context::default())),
                // Metadata of the episode is stored beside the numbers, and lists of
                // names may grow from version to version.
                Axis::Objects | Axis::FurnitureJoints | Axis::Conditions | Axis::Names(_) => names,
                Axis::Vertices => None,
            });
        }
        Ok(Some(lengths))
    }

    /// Names of the recorded robot's joints and frames.
    fn robot_context(&self) -> Result<&Context, ReadError> {
        if let Some(context) = self.context.get() {
            return Ok(context);
        }
        let context = Context::from_description(&self.robot()?);
        Ok(self.context.get_or_init(|| context))
    }

    /// The error of a dataset that has another size than it must have.
    pub(super) fn shape(&self, dataset: &str, found: String, expected: String) -> ReadError {
        ReadError::Shape {
            path: self.path().to_owned(),
            dataset: dataset.to_owned(),
            found,
            expected,
        }
    }
}
