//! The files of the page: the built-in ones, or those of a folder while a developer
//! edits them.

use std::borrow::Cow;
use std::path::{Path, PathBuf};

mod built_in {
    include!(concat!(env!("OUT_DIR"), "/files.rs"));
}

/// Source of the page's files.
#[derive(Clone, Debug, Default)]
pub struct Files {
    /// A folder, read again for every request.
    pub folder: Option<PathBuf>,
}

/// A file and its content type.
pub struct File {
    /// Content-Type.
    pub kind: &'static str,
    /// Its bytes.
    pub bytes: Cow<'static, [u8]>,
}

impl Files {
    /// The file at a path of the site, which begins with `/`.
    #[must_use]
    pub fn find(&self, path: &str) -> Option<File> {
        let name = match path.strip_prefix('/')? {
            "" => "index.html",
            "favicon.ico" => "icon.svg",
            name => name,
        };
        let kind = kind(name)?;
        let bytes = match &self.folder {
            Some(folder) => Cow::Owned(read(folder, name)?),
            None => {
                let file = built_in::FILES.iter().find(|(known, _)| *known == name);
                Cow::Borrowed(file?.1)
            }
        };
        Some(File { kind, bytes })
    }
}

fn read(folder: &Path, name: &str) -> Option<Vec<u8>> {
    let plain = |part: &str| !part.is_empty() && !part.starts_with('.') && !part.contains('\\');
    if !name.split('/').all(plain) {
        return None;
    }
    std::fs::read(folder.join(name)).ok()
}

fn kind(name: &str) -> Option<&'static str> {
    Some(match name.rsplit('.').next()? {
        "html" => "text/html; charset=utf-8",
        "css" => "text/css; charset=utf-8",
        "js" => "text/javascript; charset=utf-8",
        "svg" => "image/svg+xml",
        "json" => "application/json",
        _ => return None,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_files_of_the_page_are_found() {
        let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("page");
        for files in [
            Files::default(),
            Files {
                folder: Some(folder),
            },
        ] {
            assert!(
                files
                    .find("/")
                    .is_some_and(|f| f.kind.starts_with("text/html"))
            );
            assert!(files.find("/index.html").is_some());
            for bad in [
                "",
                "/..",
                "/../Cargo.toml",
                "/../src/lib.rs",
                "//etc/passwd",
                "/nothing.js",
            ] {
                assert!(files.find(bad).is_none(), "{bad}");
            }
        }
    }
}
