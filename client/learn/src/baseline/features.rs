//! What a frozen ResNet18 sees in each picture, computed once.

use std::collections::BTreeMap;
use std::path::Path;

use anyhow::Context;
use burn::prelude::*;
use burn::tensor::TensorData;
use indicatif::ProgressBar;
use safetensors::SafeTensors;
use safetensors::tensor::{Dtype, TensorView};
use sha2::{Digest, Sha256};

use crate::episodes::Episode;
use crate::network::{NormKind, ResNet18, Shape};
use crate::weights::Weights;

/// Numbers of a picture's features.
pub const WIDTH: usize = 512;
/// Pictures that are looked at together.
const BATCH: usize = 8;
/// What ResNet18 divides sides by.
const MULTIPLE: usize = 32;
/// Mean and deviation of ImageNet's colours.
const MEAN: [f32; 3] = [0.485, 0.456, 0.406];
const DEVIATION: [f32; 3] = [0.229, 0.224, 0.225];

/// Features by episode: row by row, camera after camera.
#[derive(Clone, Debug, PartialEq)]
pub struct Features {
    /// Numbers of a row.
    pub width: usize,
    /// Of each episode, row by row.
    pub rows: Vec<Vec<f32>>,
}

impl Features {
    /// Of a row of an episode.
    #[must_use]
    pub fn row(&self, episode: usize, row: usize) -> &[f32] {
        &self.rows[episode][row * self.width..(row + 1) * self.width]
    }
}

/// Features of all pictures of all episodes, kept in `cache`. Weights are torchvision's
/// in `backbone`, else drawn (and then a random projection of the picture). Colours
/// stay between 0 and 1 unless they are to be `normal`.
///
/// # Errors
/// When the weights are of another network or the cache cannot be written.
pub fn features(
    episodes: &[Episode],
    backbone: Option<&Path>,
    normal: bool,
    cache: &Path,
) -> anyhow::Result<Features> {
    let device = Device::flex();
    device.seed(0);
    let shape = Shape {
        norm: match backbone {
            Some(_) => NormKind::FrozenBatch,
            None => NormKind::Group,
        },
        ..Shape::default()
    };
    let mut network = ResNet18::new(&shape, &device);
    if let Some(path) = backbone {
        network = Weights::of_backbone(path)?.into_network(network)?;
    }
    let key = key(&Weights::of_network(&network), normal);
    let mut known = read(cache, &key).unwrap_or_default();
    let missing: usize = episodes
        .iter()
        .filter(|e| !known.contains_key(&e.about.label))
        .map(Episode::rows)
        .sum();
    let bar = ProgressBar::new(missing as u64).with_message("rows looked at");
    let mut rows = Vec::new();
    for episode in episodes {
        let label = &episode.about.label;
        if !known.contains_key(label) {
            let seen = look(&network, episode, normal, &bar, &device);
            known.insert(label.clone(), seen);
            write(cache, &key, &known)?;
        }
        rows.push(known[label].clone());
    }
    bar.finish_and_clear();
    let width = WIDTH * episodes.first().map_or(0, |e| e.cameras.len());
    Ok(Features { width, rows })
}

/// What one episode's pictures come to.
fn look(
    network: &ResNet18,
    episode: &Episode,
    normal: bool,
    bar: &ProgressBar,
    device: &Device,
) -> Vec<f32> {
    let names: Vec<&String> = episode.cameras.keys().collect();
    let all: Vec<(usize, &String)> = (0..episode.rows())
        .flat_map(|row| names.iter().map(move |name| (row, *name)))
        .collect();
    let mut out = Vec::with_capacity(all.len() * WIDTH);
    for part in all.chunks(BATCH) {
        // Of one size, for the cameras of a set of episodes are.
        let pictures = part.iter().map(|(row, name)| {
            let size = &episode.cameras[*name];
            numbers(
                episode.picture(name, *row),
                [size.height, size.width],
                normal,
            )
        });
        let (values, sizes): (Vec<_>, Vec<_>) = pictures.unzip();
        let [height, width] = sizes[0];
        let data = TensorData::new(values.concat(), [part.len(), 3, height, width]);
        let seen = network.forward(Tensor::<4>::from_data(data, device));
        // The mean over the picture: the network's own last pooling.
        let seen: Tensor<2> = seen
            .mean_dim(3)
            .mean_dim(2)
            .flatten::<3>(2, 3)
            .flatten(1, 2);
        out.extend(seen.into_data().iter::<f32>());
        bar.inc((part.len() / names.len().max(1)) as u64);
    }
    out
}

/// A picture as numbers, colour by colour, its edge repeated up to what the network
/// divides by; with the size that it has then.
fn numbers(picture: &[u8], [height, width]: [usize; 2], normal: bool) -> (Vec<f32>, [usize; 2]) {
    let size = [height, width].map(|side| side.div_ceil(MULTIPLE) * MULTIPLE);
    let mut values = Vec::with_capacity(3 * size[0] * size[1]);
    for colour in 0..3 {
        for y in 0..size[0] {
            for x in 0..size[1] {
                let at = (y.min(height - 1) * width + x.min(width - 1)) * 3 + colour;
                let value = f32::from(picture[at]) / 255.0;
                values.push(match normal {
                    true => (value - MEAN[colour]) / DEVIATION[colour],
                    false => value,
                });
            }
        }
    }
    (values, size)
}

/// What a cache is of.
fn key(weights: &Weights, normal: bool) -> String {
    let mut hash = Sha256::new();
    for name in weights.names() {
        let (_, values) = weights.get(name).unwrap_or_default();
        hash.update(name);
        values.iter().for_each(|v| hash.update(v.to_le_bytes()));
    }
    format!("{normal} {:x?}", &hash.finalize()[..8])
}

fn read(cache: &Path, key: &str) -> Option<BTreeMap<String, Vec<f32>>> {
    let bytes = std::fs::read(cache).ok()?;
    let (_, header) = SafeTensors::read_metadata(&bytes).ok()?;
    if header.metadata().as_ref()?.get("of")? != key {
        return None;
    }
    let tensors = SafeTensors::deserialize(&bytes).ok()?;
    let each = tensors.iter().map(|(name, view)| {
        let values = view.data().chunks_exact(4);
        let values = values.map(|b| f32::from_le_bytes([b[0], b[1], b[2], b[3]]));
        (name.to_owned(), values.collect())
    });
    Some(each.collect())
}

fn write(cache: &Path, key: &str, known: &BTreeMap<String, Vec<f32>>) -> anyhow::Result<()> {
    let bytes: Vec<(&String, Vec<u8>)> = known
        .iter()
        .map(|(name, values)| (name, values.iter().flat_map(|v| v.to_le_bytes()).collect()))
        .collect();
    let views = bytes.iter().map(|(name, bytes)| {
        let view = TensorView::new(Dtype::F32, vec![bytes.len() / 4], bytes);
        view.map(|view| (name.as_str(), view))
    });
    let views = views.collect::<Result<Vec<_>, _>>()?;
    let of = [("of".to_owned(), key.to_owned())].into();
    let told = || format!("writing {}", cache.display());
    let part = cache.with_extension("part");
    std::fs::write(&part, safetensors::serialize(views, Some(of))?).with_context(told)?;
    std::fs::rename(part, cache).with_context(told)
}
