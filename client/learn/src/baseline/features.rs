//! Features of a frozen ResNet18 for each image, computed once.

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

/// Features of an image.
pub const WIDTH: usize = 512;
/// Images of one forward pass.
const BATCH: usize = 8;
/// Stride of ResNet18, pixels.
const MULTIPLE: usize = 32;
/// Mean and deviation of ImageNet's channels.
const MEAN: [f32; 3] = [0.485, 0.456, 0.406];
const DEVIATION: [f32; 3] = [0.229, 0.224, 0.225];

/// Features by episode: row by row, camera after camera.
#[derive(Clone, Debug, PartialEq)]
pub struct Features {
    /// Features of a row.
    pub width: usize,
    /// Features of each episode, row by row.
    pub rows: Vec<Vec<f32>>,
}

impl Features {
    /// Features of a row of an episode.
    #[must_use]
    pub fn row(&self, episode: usize, row: usize) -> &[f32] {
        &self.rows[episode][row * self.width..(row + 1) * self.width]
    }
}

/// Features of all images of all episodes, cached in the file `cache`. Weights are torchvision's in
/// `backbone`, else random (then the features are a random projection of the image). With `normal`,
/// channels are standardized; otherwise they are 0 to 1.
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
    let bar = ProgressBar::new(missing as u64).with_message("rows");
    let mut rows = Vec::new();
    for episode in episodes {
        let label = &episode.about.label;
        if !known.contains_key(label) {
            let features = extract_features(&network, episode, normal, &bar, &device);
            known.insert(label.clone(), features);
            write(cache, &key, &known)?;
        }
        rows.push(known[label].clone());
    }
    bar.finish_and_clear();
    let width = WIDTH * episodes.first().map_or(0, |e| e.cameras.len());
    Ok(Features { width, rows })
}

/// Features of one episode's images.
fn extract_features(
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
        // All cameras of a set of episodes have one size.
        let images = part.iter().map(|(row, name)| {
            let size = &episode.cameras[*name];
            padded(episode.image(name, *row), [size.height, size.width], normal)
        });
        let (values, sizes): (Vec<_>, Vec<_>) = images.unzip();
        let [height, width] = sizes[0];
        let data = TensorData::new(values.concat(), [part.len(), 3, height, width]);
        let features = network.forward(Tensor::<4>::from_data(data, device));
        // The mean over the image: the network's last pooling.
        let features: Tensor<2> = features
            .mean_dim(3)
            .mean_dim(2)
            .flatten::<3>(2, 3)
            .flatten(1, 2);
        out.extend(features.into_data().iter::<f32>());
        bar.inc((part.len() / names.len().max(1)) as u64);
    }
    out
}

/// An image as numbers, channel by channel, padded with its edge to a multiple of the stride; with
/// the padded height and width.
fn padded(image: &[u8], [height, width]: [usize; 2], normal: bool) -> (Vec<f32>, [usize; 2]) {
    let size = [height, width].map(|side| side.div_ceil(MULTIPLE) * MULTIPLE);
    let mut values = Vec::with_capacity(3 * size[0] * size[1]);
    for channel in 0..3 {
        for y in 0..size[0] {
            for x in 0..size[1] {
                let at = (y.min(height - 1) * width + x.min(width - 1)) * 3 + channel;
                let value = f32::from(image[at]) / 255.0;
                values.push(match normal {
                    true => (value - MEAN[channel]) / DEVIATION[channel],
                    false => value,
                });
            }
        }
    }
    (values, size)
}

/// Identifies weights and normalization of a cache.
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
    let context = || format!("writing {}", cache.display());
    let part = cache.with_extension("part");
    std::fs::write(&part, safetensors::serialize(views, Some(of))?).with_context(context)?;
    std::fs::rename(part, cache).with_context(context)
}
