//! STL files, binary and text. Neither states units; z is usually up.

use super::mesh::Mesh;
use super::source::{Source, Up, face, too_many};
use crate::model::MOST_TRIANGLES;

/// Bytes before the triangles of a binary file: a title, and their number.
const HEADER: usize = 84;
/// Bytes of a triangle: normal, three corners, two bytes.
const RECORD: usize = 50;

/// Parses a file.
pub(super) fn parse(bytes: &[u8]) -> Result<Source, String> {
    let count = bytes
        .get(80..HEADER)
        .and_then(|field| field.try_into().ok());
    let count = count.map(|field| u32::from_le_bytes(field) as usize);
    let fits = |count: usize| HEADER + count.saturating_mul(RECORD) <= bytes.len();
    // A binary title may begin with the word of text files.
    let is_text = bytes.trim_ascii_start().starts_with(b"solid")
        && count.is_none_or(|count| HEADER + count.saturating_mul(RECORD) != bytes.len());
    let mesh = match count {
        _ if is_text => text(&String::from_utf8_lossy(bytes))?,
        Some(count) if fits(count) => binary(&bytes[HEADER..], count)?,
        Some(count) => {
            return Err(format!(
                "it states {count} triangles and has {} bytes; export it again",
                bytes.len()
            ));
        }
        None => return Err("neither binary nor text STL; export it again".into()),
    };
    Ok(Source {
        mesh,
        metres: None,
        up: Up::Z,
        up_is_defined: false,
        notes: Vec::new(),
    })
}

fn binary(records: &[u8], count: usize) -> Result<Mesh, String> {
    if count > MOST_TRIANGLES {
        return Err(too_many());
    }
    let mut mesh = Mesh::default();
    for record in records.chunks_exact(RECORD).take(count) {
        let number = |at: usize| {
            let bytes = [0, 1, 2, 3].map(|k| record[at + k]);
            f64::from(f32::from_le_bytes(bytes))
        };
        let corners = [12, 24, 36].map(|at| [at, at + 4, at + 8].map(number));
        mesh.faces.push(face(corners, None, 0));
    }
    Ok(mesh)
}

fn text(text: &str) -> Result<Mesh, String> {
    let mut mesh = Mesh::default();
    let mut corners: Vec<[f64; 3]> = Vec::new();
    for (line, words) in text.lines().enumerate() {
        let mut words = words.split_whitespace();
        match words.next() {
            Some("vertex") => {
                let mut point = [f64::NAN; 3];
                for number in &mut point {
                    let word = words.next().unwrap_or_default();
                    *number = word.parse().map_err(|_| {
                        format!(
                            "line {}: {word:?} is not a number; export it again",
                            line + 1
                        )
                    })?;
                }
                corners.push(point);
            }
            Some("endloop") => {
                if let [a, b, c] = corners[..] {
                    mesh.faces.push(face([a, b, c], None, 0));
                }
                if mesh.faces.len() > MOST_TRIANGLES {
                    return Err(too_many());
                }
                corners.clear();
            }
            _ => {}
        }
        if corners.len() > 3 {
            return Err(format!(
                "line {}: a facet with more than three vertices; export it again",
                line + 1
            ));
        }
    }
    Ok(mesh)
}
