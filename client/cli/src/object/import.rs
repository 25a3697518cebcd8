//! `wheelarm object import`.

use std::fmt::Write;
use std::path::PathBuf;

use anyhow::{Context, anyhow, bail};
use clap::Args;
use wheelarm_import::object::{
    Categories, Hand, ObjectOptions, ObjectSummary, SizeOptions, Up, import, length, with_object,
};
use wheelarm_import::{slug, write};
use wheelarm_options::choice::did_you_mean;
use wheelarm_options::packs::PackArgs;
use wheelarm_pack::Pack;
use wheelarm_proto::installed::ASSETS_VARIABLE;

use super::find::{assets_of, parent_and_name};
use crate::home_report::store;

/// Arguments of `wheelarm object import`.
#[derive(Args, Debug)]
pub struct ImportArgs {
    /// Mesh: .glb, .gltf, .obj, .stl, .msh, .dae, or a body in .urdf or MJCF (.xml).
    #[arg(value_name = "FILE")]
    file: PathBuf,
    /// Category, one of assets/categories.toml: mug, bottle, can, box, …
    #[arg(long)]
    category: String,
    /// Noun of the object in sentences, after its color; by default that of the category.
    #[arg(long, value_name = "TEXT")]
    noun: Option<String>,
    /// The object is held out for tests: training takes the others.
    #[arg(long)]
    held_out: bool,
    /// Color of the object in one word; by default that of its largest part.
    #[arg(long, alias = "colour", value_name = "WORD")]
    color: Option<String>,
    /// Name of the object; by default from the name of the file.
    #[arg(long)]
    name: Option<String>,
    /// Size in metres along x, y and z, with z up.
    #[arg(long, value_name = "X,Y,Z", value_parser = size)]
    size: Option<[f64; 3]>,
    /// Metres per unit of the file, for example 0.001 for millimetres.
    #[arg(long, conflicts_with = "size")]
    scale: Option<f64>,
    /// Axis of the file that points up: y or z.
    #[arg(long)]
    up: Option<Up>,
    /// Mass in kg; by default from category, size and surface.
    #[arg(long, value_name = "KG")]
    mass: Option<f64>,
    /// License as an SPDX expression, for example CC0-1.0.
    #[arg(long, alias = "licence", value_name = "TEXT")]
    license: Option<String>,
    /// Author.
    #[arg(long)]
    author: Option<String>,
    /// OBJ file whose groups are the convex parts of the object, for example of CoACD.
    #[arg(long, value_name = "FILE.obj")]
    parts: Option<PathBuf>,
    /// Robot whose gripper grasps it, a folder in assets/robots.
    #[arg(long, default_value = "wheelarm")]
    robot: String,
    /// Folder of the pack, which is made or extended [default: a pack with the name of the
    /// object in the first of the folders below].
    #[arg(long, value_name = "PACK")]
    out: Option<PathBuf>,
    /// Folders of packs.
    #[command(flatten)]
    packs: PackArgs,
    /// Assets folder; by default the installed one.
    #[arg(long, env = ASSETS_VARIABLE, value_name = "DIR")]
    assets: Option<PathBuf>,
}

/// Three lengths.
fn size(text: &str) -> Result<[f64; 3], String> {
    let numbers: Result<Vec<f64>, _> = text.split(',').map(|n| n.trim().parse()).collect();
    let numbers = numbers.ok().and_then(|numbers| numbers.try_into().ok());
    numbers.ok_or_else(|| {
        format!("{text:?} is not X,Y,Z: three lengths in metres, for example 0.08,0.12,0.11")
    })
}

/// Imports a mesh and returns the output.
pub fn run(args: &ImportArgs) -> anyhow::Result<String> {
    let assets = assets_of(args.assets.as_ref())?;
    let stem = args.file.file_stem().unwrap_or_default().to_string_lossy();
    let name = args.name.clone().unwrap_or_else(|| slug(&stem, 64));
    if assets.join(format!("objects/{name}.toml")).is_file() {
        bail!("the assets have an object named {name:?}; choose another --name");
    }
    let options = ObjectOptions {
        name: name.clone(),
        category: args.category.clone(),
        noun: args.noun.clone(),
        held_out: args.held_out,
        colour: args.color.clone(),
        size: SizeOptions {
            size: args.size,
            scale: args.scale,
            up: args.up,
        },
        mass: args.mass,
        license: args.license.clone(),
        author: args.author.clone(),
        parts: args.parts.clone(),
    };
    let hand = Hand::read(&assets, &args.robot)?;
    let categories = Categories::read(&assets)?;
    categories.named(&args.category).map_err(|error| {
        let known = categories.all().iter().map(|one| one.name.as_str());
        anyhow!("{error}{}", did_you_mean(&args.category, known))
    })?;
    let imported = import(&args.file, &options, &categories, &hand)?;
    let out = match &args.out {
        Some(out) => out.clone(),
        None => {
            let folders = store(&args.packs);
            let first = folders.folders().first();
            let first = first.context("no folder of packs is known; name a pack with --out")?;
            first.join(&name)
        }
    };
    let (folder, pack_name) = parent_and_name(&out)?;
    let existing = match out.join("pack.toml").is_file() {
        true => Some(Pack::open(&out)?),
        false => None,
    };
    let pack = with_object(existing.as_ref(), &pack_name, &imported.object)?;
    let path = write(&pack, &folder)?;
    let mut text = describe(&name, &imported.summary)?;
    writeln!(text, "written: {}", path.display())?;
    let packs = match &args.out {
        Some(_) => format!(" --packs {}", folder.display()),
        None => String::new(),
    };
    match imported.summary.kept.is_empty() {
        true => writeln!(text, "next: wheelarm pack check {}", path.display())?,
        false => writeln!(text, "next: wheelarm object check {name}{packs}")?,
    }
    Ok(text)
}

/// What an import did, as text.
fn describe(name: &str, about: &ObjectSummary) -> anyhow::Result<String> {
    let mut text = format!("{name}: {} triangles, {}\n", about.triangles, about.units);
    let [x, y, z] = about.size.map(length);
    let [low, high] = about.usual_mass;
    writeln!(
        text,
        "size {x} x {y} x {z}, mass {:.3} kg (usual: {low} to {high})",
        about.mass
    )?;
    writeln!(text, "collision: {}, {} shapes", about.form, about.shapes)?;
    let kept: usize = about.kept.values().sum();
    let by_name = about.kept.iter().map(|(name, n)| format!("{n} {name}"));
    let by_name: Vec<String> = by_name.collect();
    writeln!(
        text,
        "grasps: {kept} kept{} of {} free ones of {} sampled",
        match by_name.is_empty() {
            true => String::new(),
            false => format!(" ({})", by_name.join(", ")),
        },
        about.free,
        about.sampled
    )?;
    for note in &about.notes {
        writeln!(text, "note: {note}")?;
    }
    Ok(text)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn size_has_three_lengths() {
        assert_eq!(size("0.1, 0.2,0.3"), Ok([0.1, 0.2, 0.3]));
        for wrong in ["", "0.1", "0.1,0.2", "a,b,c", "1,2,3,4"] {
            assert!(size(wrong).unwrap_err().contains("X,Y,Z"), "{wrong}");
        }
    }
}
