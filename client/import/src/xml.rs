//! A bounded tree of XML elements. Document types and entities of their own are rejected, so
//! that no file can expand beyond its size.

use quick_xml::XmlVersion;
use quick_xml::events::{BytesStart, Event};

/// Largest nesting of elements.
pub const MAX_DEPTH: usize = 64;
/// Largest number of elements.
pub const MAX_ELEMENTS: usize = 500_000;

/// An element with its attributes, in file order.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Element {
    /// Name of the tag.
    pub name: String,
    /// Names and values of the attributes.
    pub attributes: Vec<(String, String)>,
    /// Elements inside it.
    pub children: Vec<Element>,
    /// Its text, without references.
    pub text: String,
}

impl Element {
    /// The value of an attribute.
    #[must_use]
    pub fn attribute(&self, name: &str) -> Option<&str> {
        let mut found = self.attributes.iter().filter(|(key, _)| key == name);
        found.next().map(|(_, value)| value.as_str())
    }

    /// The children of this name.
    pub fn all<'a>(&'a self, name: &'a str) -> impl Iterator<Item = &'a Element> {
        self.children.iter().filter(move |child| child.name == name)
    }

    /// The first child of this name.
    #[must_use]
    pub fn child(&self, name: &str) -> Option<&Element> {
        self.children.iter().find(|child| child.name == name)
    }
}

/// Reads a document.
///
/// # Errors
/// When it is not UTF-8 or not well formed, has a document type, or is above a limit.
pub fn parse(bytes: &[u8]) -> Result<Element, String> {
    let text = std::str::from_utf8(bytes).map_err(|error| format!("not UTF-8 ({error})"))?;
    let mut reader = quick_xml::Reader::from_str(text.trim_start_matches('\u{feff}'));
    let mut open: Vec<Element> = Vec::new();
    let mut root = None;
    let mut count = 0;
    loop {
        let place = reader.buffer_position();
        let event = reader
            .read_event()
            .map_err(|error| format!("at byte {place}: {error}"))?;
        let closed = match event {
            Event::Start(start) => {
                open.push(element(&start).map_err(|why| format!("at byte {place}: {why}"))?);
                count += 1;
                None
            }
            Event::Empty(start) => {
                count += 1;
                Some(element(&start).map_err(|why| format!("at byte {place}: {why}"))?)
            }
            Event::End(_) => open.pop(),
            Event::Text(text) => {
                if let Some(last) = open.last_mut() {
                    last.text.push_str(text.as_ref());
                }
                None
            }
            Event::DocType(_) => return Err("it has a document type, which is not read".into()),
            Event::Eof => break,
            _ => None,
        };
        if open.len() > MAX_DEPTH || count > MAX_ELEMENTS {
            return Err(format!(
                "more than {MAX_DEPTH} nested or {MAX_ELEMENTS} elements"
            ));
        }
        if let Some(closed) = closed {
            match open.last_mut() {
                Some(parent) => parent.children.push(closed),
                None if root.is_none() => root = Some(closed),
                None => return Err("more than one root element".into()),
            }
        }
    }
    if let Some(last) = open.last() {
        return Err(format!("the element {:?} is not closed", last.name));
    }
    root.ok_or_else(|| "no element".into())
}

fn element(start: &BytesStart<'_>) -> Result<Element, String> {
    let name = start.name();
    let mut element = Element {
        name: name.as_ref().to_owned(),
        ..Element::default()
    };
    for attribute in start.attributes() {
        let attribute = attribute.map_err(|error| error.to_string())?;
        let key = attribute.key.as_ref().to_owned();
        let value = attribute
            .normalized_value(XmlVersion::Implicit1_0)
            .map_err(|error| format!("attribute {key:?}: {error}"))?;
        element.attributes.push((key, value.into_owned()));
    }
    Ok(element)
}
