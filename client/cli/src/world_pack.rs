//! `wheelarm pack`: checks, lists, sends and extracts world packs.

use std::fmt::Write as _;
use std::hash::{BuildHasher, Hasher, RandomState};
use std::path::{Path, PathBuf};

use anyhow::{Context, bail};
use clap::{Args, Subcommand, ValueEnum};
use wheelarm_options::packs::PackArgs;
use wheelarm_pack::{Pack, Store, credit_lines, to_hex};
use wheelarm_proto::{digest, installed, v1};
use wheelarm_sdk::{Client, ClientError};

/// Size of the pieces in which a pack is sent, bytes.
const PIECE: usize = 256 << 10;

/// Commands of world packs.
#[derive(Subcommand, Debug)]
pub enum PackCommand {
    /// Checks a pack and prints its content, digests and licenses.
    Check {
        /// Folder or zip file.
        path: PathBuf,
        /// Writes the pack as a zip file; equal packs give equal files.
        #[arg(long, value_name = "FILE")]
        zip: Option<PathBuf>,
        /// Fails unless every part permits this use, by its license.
        #[arg(long, alias = "licence", value_name = "USE")]
        license: Option<LicensedUse>,
    },
    /// Lists the packs of the folders, or those that a server finds.
    List(ListArgs),
    /// Sends a pack to a server, which stores it; needs the role admin.
    Put {
        /// Folder or zip file.
        path: PathBuf,
    },
    /// Writes the packs of a recording as zip files.
    #[cfg(feature = "hdf5")]
    Extract {
        /// Episode file.
        file: PathBuf,
        /// Folder for the files NAME.zip; it must not contain them yet.
        #[arg(long, value_name = "DIR", default_value = ".")]
        out: PathBuf,
    },
}

/// Use that licenses have to permit.
#[derive(ValueEnum, Clone, Copy, Debug, PartialEq, Eq)]
pub enum LicensedUse {
    /// Commercial use: parts with a non-commercial or unknown license are refused.
    Commercial,
}

/// Arguments of `wheelarm pack list`.
#[derive(Args, Debug)]
pub struct ListArgs {
    /// Folders of packs.
    #[command(flatten)]
    pub packs: PackArgs,
    /// Lists those that the server finds.
    #[arg(long, conflicts_with = "packs")]
    pub server: bool,
}

impl PackCommand {
    /// Whether the command needs only files.
    #[must_use]
    pub fn needs_only_files(&self) -> bool {
        match self {
            Self::Put { .. } => false,
            Self::List(args) => !args.server,
            Self::Check { .. } => true,
            #[cfg(feature = "hdf5")]
            Self::Extract { .. } => true,
        }
    }
}

/// Runs the command; `open` connects to the server.
///
/// # Errors
/// When a pack is not valid, a file cannot be written, or the server rejects the pack.
pub fn run(
    command: &PackCommand,
    open: impl FnOnce() -> Result<Client, ClientError>,
) -> anyhow::Result<String> {
    match command {
        PackCommand::Check { path, zip, license } => check(path, zip.as_deref(), *license),
        PackCommand::List(args) if args.server => list_of_server(&open()?),
        PackCommand::List(args) => list(&args.packs.packs),
        PackCommand::Put { path } => put(&open()?, path),
        #[cfg(feature = "hdf5")]
        PackCommand::Extract { file, out } => {
            let written = wheelarm_campaign::replay::extract_packs(file, out)?;
            Ok(written
                .iter()
                .map(|path| format!("{}\n", path.display()))
                .collect())
        }
    }
}

fn open_pack(path: &Path) -> anyhow::Result<Pack> {
    Pack::open(path).with_context(|| format!("{} cannot be used", path.display()))
}

fn check(path: &Path, zip: Option<&Path>, license: Option<LicensedUse>) -> anyhow::Result<String> {
    let pack = open_pack(path)?;
    let mut text = describe(&pack)?;
    match (license, pack.check_commercial()) {
        (_, Ok(())) => text += "every part permits commercial use\n",
        (None, Err(problem)) => writeln!(text, "note: {problem}")?,
        (Some(LicensedUse::Commercial), Err(problem)) => return Err(problem.into()),
    }
    if let Some(zip) = zip {
        pack.write_zip(zip)?;
        writeln!(text, "wrote {}", zip.display())?;
    }
    Ok(text)
}

/// Content, digests and licenses of a pack as text.
fn describe(pack: &Pack) -> anyhow::Result<String> {
    let id = pack.id();
    let mut text = format!("{} {}\n", id.name, id.version);
    writeln!(text, "physics   {}", to_hex(&id.physics))?;
    writeln!(text, "rendering {}", to_hex(&id.rendering))?;
    if let Some(home) = pack.home() {
        writeln!(
            text,
            "home: {} rooms, {} walls, {} openings, {} pieces, {} objects, license {}",
            home.room.len(),
            home.wall.len(),
            home.opening.len(),
            home.piece.len(),
            home.object.len(),
            home.license
        )?;
    }
    let count = |folder, ending| pack.names(folder, ending).count();
    let meshes = count("meshes", "obj") + count("meshes", "glb");
    let bytes: usize = pack.files().values().map(Vec::len).sum();
    writeln!(
        text,
        "{} furniture kinds, {} object kinds, {meshes} meshes, {} textures, {:.1} MB",
        pack.kinds().len(),
        count("objects", "toml"),
        count("textures", "png"),
        bytes as f64 * 1e-6
    )?;
    for line in credit_lines(&pack.credits()) {
        writeln!(text, "{line}")?;
    }
    Ok(text)
}

fn list(packs: &[PathBuf]) -> anyhow::Result<String> {
    let assets = installed::assets().unwrap_or_default();
    let store = Store::search(packs, &assets);
    let mut text = String::new();
    for (name, path) in store.candidates() {
        match Pack::open(&path) {
            Ok(pack) => writeln!(text, "{}  {}", pack.id(), path.display())?,
            Err(error) => writeln!(text, "{name}: not usable: {error}")?,
        }
    }
    if text.is_empty() {
        let folders: Vec<String> = store
            .folders()
            .iter()
            .map(|folder| folder.display().to_string())
            .collect();
        writeln!(text, "no packs in {}", folders.join(", "))?;
    }
    Ok(text)
}

fn list_of_server(client: &Client) -> anyhow::Result<String> {
    let reply = client.request(&v1::PacksRequest {})?;
    let mut text = String::new();
    for pack in &reply.packs {
        let short = |digest: &str| digest.chars().take(16).collect::<String>();
        writeln!(
            text,
            "{} {} (physics {}, rendering {})",
            pack.name,
            pack.version,
            short(&pack.physics_digest),
            short(&pack.rendering_digest)
        )?;
    }
    for words in &reply.problems {
        writeln!(text, "not usable: {words}")?;
    }
    if text.is_empty() {
        text += "the server finds no packs\n";
    }
    Ok(text)
}

fn put(client: &Client, path: &Path) -> anyhow::Result<String> {
    let pack = open_pack(path)?;
    let zip = pack.to_zip()?;
    let zip_digest = to_hex(&digest::of_message([&zip[..]]));
    let transfer = RandomState::new().build_hasher().finish();
    let mut stored = None;
    for (index, piece) in zip.chunks(PIECE).enumerate() {
        let reply = client.request(&v1::PackPutRequest {
            transfer,
            zip_digest: zip_digest.clone(),
            zip_length: zip.len() as u64,
            offset: (index * PIECE) as u64,
            piece: piece.to_vec().into(),
        });
        let reply = reply.context("cannot send the pack; with keys it needs the role admin")?;
        stored = reply.pack;
    }
    let Some(stored) = stored else {
        bail!("the server received the pack but did not store it; look at its log");
    };
    let id = pack.id();
    let expected = [to_hex(&id.physics), to_hex(&id.rendering)];
    if [stored.physics_digest, stored.rendering_digest] != expected {
        bail!("the server stored a pack with other digests; is it of another version?");
    }
    Ok(format!("sent {id}, {} bytes\n", zip.len()))
}
