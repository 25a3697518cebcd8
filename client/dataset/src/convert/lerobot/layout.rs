//! The features of a set: which columns there are, of which type and shape.

use std::collections::BTreeMap;

use serde_json::{Value, json};

use super::table::{Element, Field};
use crate::convert::Size;
use crate::convert::learning;

/// Rate and cameras of the set.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Layout {
    pub rate: u32,
    pub cameras: BTreeMap<String, Size>,
}

/// Feature of a camera's pictures.
pub(super) fn image_key(camera: &str) -> String {
    format!("observation.images.{camera}")
}

/// Flat features beside state, action and pictures: name, type.
const FLAT: [(&str, Element); 11] = [
    ("next.reward", Element::F32),
    ("next.done", Element::Bool),
    ("next.success", Element::Bool),
    ("phase", Element::I64),
    ("subtask_index", Element::I64),
    ("simulation_time", Element::F64),
    ("timestamp", Element::F32),
    ("frame_index", Element::I64),
    ("episode_index", Element::I64),
    ("index", Element::I64),
    ("task_index", Element::I64),
];

fn dtype(element: Element) -> &'static str {
    match element {
        Element::F32 => "float32",
        Element::F64 => "float64",
        Element::I64 => "int64",
        Element::Bool => "bool",
        Element::Text => "string",
        Element::Image => "image",
    }
}

impl Layout {
    /// Columns of the data files.
    pub fn fields(&self) -> Vec<Field> {
        let field = |name: String, element, depth| Field {
            name,
            element,
            depth,
        };
        let mut out: Vec<Field> = self
            .cameras
            .keys()
            .map(|c| field(image_key(c), Element::Image, 0))
            .collect();
        out.push(field("observation.state".into(), Element::F32, 1));
        out.push(field("action".into(), Element::F32, 1));
        out.extend(FLAT.map(|(name, element)| field(name.into(), element, 0)));
        out
    }

    /// The features as `meta/info.json` lists them.
    pub fn features(&self) -> Value {
        let mut out = serde_json::Map::new();
        for (camera, size) in &self.cameras {
            let feature = json!({"dtype": "image", "shape": [size.height, size.width, 3],
                "names": ["height", "width", "channels"]});
            out.insert(image_key(camera), feature);
        }
        for (name, names) in [
            ("observation.state", learning::state_names()),
            ("action", learning::action_names()),
        ] {
            let feature = json!({"dtype": "float32", "shape": [names.len()], "names": names});
            out.insert(name.into(), feature);
        }
        for (name, element) in FLAT {
            let feature = json!({"dtype": dtype(element), "shape": [1], "names": null});
            out.insert(name.into(), feature);
        }
        Value::Object(out)
    }

    /// The features as Hugging Face's `datasets` writes them into the footer.
    pub fn footer(&self) -> String {
        let mut out = serde_json::Map::new();
        for camera in self.cameras.keys() {
            out.insert(image_key(camera), json!({"_type": "Image"}));
        }
        let list = |n: usize| json!({"feature": {"dtype": "float32", "_type": "Value"}, "length": n, "_type": "Sequence"});
        out.insert(
            "observation.state".into(),
            list(learning::state_names().len()),
        );
        out.insert("action".into(), list(learning::action_names().len()));
        for (name, element) in FLAT {
            out.insert(
                name.into(),
                json!({"dtype": dtype(element), "_type": "Value"}),
            );
        }
        json!({"info": {"features": out}}).to_string()
    }
}
