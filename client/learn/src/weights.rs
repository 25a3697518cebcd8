//! Weights by name: from a safetensors file into a network and back. Half and single precision,
//! and integers with a scale for each output, as `python/export.py --bits 8` writes them.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use burn::module::{Module, ModuleMapper, ModuleVisitor, Param};
use burn::prelude::*;
use burn::store::pytorch_reader::{DType as PytorchType, PytorchReader};
use burn::tensor::TensorData;
use safetensors::SafeTensors;
use safetensors::tensor::{Dtype, TensorView};
use sha2::{Digest, Sha256};

use crate::card::KEY;

/// Suffix of the name of the scales of an integer tensor.
const SCALE: &str = ".scale";
/// Prefix of tensors that only training needs; a stored policy may lack them.
const ONLY_IN_TRAINING: &str = "model.vae_encoder";
/// An unused count that batch norms of PyTorch store.
const COUNTER: &str = "num_batches_tracked";
/// A constant that PyTorch stores and this program computes.
const COMPUTED: &str = "model.vae_encoder_pos_enc";

/// Tensors of single precision by name, with their shapes.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Weights {
    tensors: BTreeMap<String, (Vec<usize>, Vec<f32>)>,
}

/// A file of weights.
#[derive(Clone, Debug)]
pub struct WeightsFile {
    /// The tensors.
    pub weights: Weights,
    /// The model card as text, where there is one.
    pub card: Option<String>,
    /// SHA-256 of the file, hexadecimal.
    pub sha256: String,
}

/// Reason why weights are rejected.
#[derive(Debug, thiserror::Error)]
pub enum WeightsError {
    /// The file cannot be read or written.
    #[error("{}: {source}", path.display())]
    File {
        /// Which.
        path: PathBuf,
        /// Why.
        source: std::io::Error,
    },
    /// Another format.
    #[error("{} is not a safetensors file: {source}", path.display())]
    Format {
        /// Which.
        path: PathBuf,
        /// Why.
        source: safetensors::SafeTensorError,
    },
    /// An unsupported type of numbers.
    #[error(
        "{name} has numbers of the type {dtype}, expected F32, F16, BF16, or I8 with {name}{SCALE}"
    )]
    Type {
        /// Name of the tensor.
        name: String,
        /// Its type.
        dtype: String,
    },
    /// The scales of integers do not fit.
    #[error("{name} has no {name}{SCALE} with one number for each of its {outputs} outputs")]
    Scale {
        /// Name of the tensor.
        name: String,
        /// Its first dimension.
        outputs: usize,
    },
    /// An unreadable checkpoint of PyTorch.
    #[error("cannot read {}: {why}; save it with torch.save(model.state_dict(), FILE), or as safetensors", path.display())]
    Checkpoint {
        /// Which.
        path: PathBuf,
        /// Why.
        why: String,
    },
    /// A missing tensor, or one of another shape.
    #[error("the network needs {name} of shape {expected:?}, and the file has {found}")]
    Unfit {
        /// Name of the tensor.
        name: String,
        /// Shape of the network's.
        expected: Vec<usize>,
        /// Shape of the file's, or `none`.
        found: String,
    },
    /// A tensor that the network does not have.
    #[error("the network has no {0}: the weights are those of another network")]
    Unknown(String),
    /// Numbers that are not finite.
    #[error("{0} has numbers that are not finite")]
    NotFinite(String),
}

impl WeightsFile {
    /// Reads a file.
    ///
    /// # Errors
    /// [`WeightsError`].
    pub fn read(path: &Path) -> Result<Self, WeightsError> {
        let bytes = std::fs::read(path).map_err(|source| WeightsError::File {
            path: path.to_owned(),
            source,
        })?;
        let format = |source| WeightsError::Format {
            path: path.to_owned(),
            source,
        };
        let (_, header) = SafeTensors::read_metadata(&bytes).map_err(format)?;
        let card = header.metadata().as_ref().and_then(|m| m.get(KEY).cloned());
        let tensors = SafeTensors::deserialize(&bytes).map_err(format)?;
        Ok(Self {
            weights: Weights::of(&tensors)?,
            card,
            sha256: hexadecimal(&Sha256::digest(&bytes)),
        })
    }
}

fn hexadecimal(bytes: &[u8]) -> String {
    bytes.iter().map(|byte| format!("{byte:02x}")).collect()
}

impl Weights {
    /// Every tensor of a file in single precision.
    ///
    /// # Errors
    /// [`WeightsError`].
    pub fn of(file: &SafeTensors<'_>) -> Result<Self, WeightsError> {
        let mut tensors = BTreeMap::new();
        for (name, view) in file.tensors() {
            if name.ends_with(SCALE) || name.ends_with(COUNTER) {
                continue;
            }
            let mut values = numbers(&name, &view)?;
            if view.dtype() == Dtype::I8 {
                let outputs = view.shape().first().copied().unwrap_or(0);
                let scale_name = format!("{name}{SCALE}");
                let scales = file.tensor(&scale_name).ok();
                let scales = scales.map(|scales| numbers(&scale_name, &scales));
                let scales = scales.transpose()?.unwrap_or_default();
                if scales.len() != outputs || outputs == 0 {
                    return Err(WeightsError::Scale { name, outputs });
                }
                let of_one = (values.len() / outputs).max(1);
                let rows = values.chunks_mut(of_one).zip(scales);
                rows.for_each(|(row, scale)| row.iter_mut().for_each(|v| *v *= scale));
            }
            if !values.iter().all(|v| v.is_finite()) {
                return Err(WeightsError::NotFinite(name));
            }
            tensors.insert(name, (view.shape().to_vec(), values));
        }
        Ok(Self { tensors })
    }

    /// The weights of a network.
    #[must_use]
    pub fn of_network(network: &impl Module) -> Self {
        let mut reader = Reader::default();
        network.visit(&mut reader);
        Self {
            tensors: reader.tensors,
        }
    }

    /// Shape and numbers of a tensor.
    #[must_use]
    pub fn get(&self, name: &str) -> Option<(&[usize], &[f32])> {
        let (shape, values) = self.tensors.get(name)?;
        Some((shape, values))
    }

    /// The weights of torchvision's ResNet18, `.pth` or `.safetensors`, without its last layer.
    ///
    /// # Errors
    /// [`WeightsError::File`], [`WeightsError::Format`], [`WeightsError::Checkpoint`].
    pub fn of_backbone(path: &Path) -> Result<Self, WeightsError> {
        let is_used = |name: &str| !(name.starts_with("fc.") || name.ends_with(COUNTER));
        if path.extension().is_some_and(|e| e == "safetensors") {
            let mut weights = WeightsFile::read(path)?.weights;
            weights.tensors.retain(|name, _| is_used(name));
            return Ok(weights);
        }
        let wrong = |why: String| WeightsError::Checkpoint {
            path: path.to_owned(),
            why,
        };
        let file = PytorchReader::new(path).map_err(|e| wrong(e.to_string()))?;
        let mut tensors = BTreeMap::new();
        for (name, tensor) in file.into_tensors() {
            if !is_used(&name) {
                continue;
            }
            if !matches!(tensor.dtype(), PytorchType::F32) {
                return Err(wrong(format!("{name} is not of single precision")));
            }
            let bytes = tensor.read().map_err(|e| wrong(e.to_string()))?;
            let values = bytes.chunks_exact(4);
            let values = values.map(|b| f32::from_le_bytes([b[0], b[1], b[2], b[3]]));
            tensors.insert(name, (tensor.shape().to_vec(), values.collect()));
        }
        Ok(Self { tensors })
    }

    /// Names of all tensors.
    pub fn names(&self) -> impl Iterator<Item = &str> {
        self.tensors.keys().map(String::as_str)
    }

    /// Loads them into a network of the same shape.
    ///
    /// # Errors
    /// [`WeightsError::Unfit`] and [`WeightsError::Unknown`].
    pub fn into_network<M: Module>(mut self, network: M) -> Result<M, WeightsError> {
        self.tensors.remove(COMPUTED);
        let mut writer = Writer {
            path: Vec::new(),
            weights: self.tensors,
            problem: None,
        };
        let network = network.map(&mut writer);
        if let Some(problem) = writer.problem {
            return Err(problem);
        }
        let left = writer.weights.into_keys();
        let mut left = left.filter(|name| !name.starts_with(ONLY_IN_TRAINING));
        match left.next() {
            Some(name) => Err(WeightsError::Unknown(name)),
            None => Ok(network),
        }
    }

    /// Writes them in single precision, with a card.
    ///
    /// # Errors
    /// [`WeightsError::File`].
    pub fn write(&self, path: &Path, card: Option<&str>) -> Result<(), WeightsError> {
        let file = |source| WeightsError::File {
            path: path.to_owned(),
            source,
        };
        let bytes = self.tensors.iter().map(|(name, (shape, values))| {
            let bytes: Vec<u8> = values.iter().flat_map(|v| v.to_le_bytes()).collect();
            (name, shape, bytes)
        });
        let bytes: Vec<_> = bytes.collect();
        let views = bytes.iter().map(|(name, shape, bytes)| {
            let view = TensorView::new(Dtype::F32, (*shape).clone(), bytes);
            view.map(|view| (name.as_str(), view))
        });
        let format = |source| WeightsError::Format {
            path: path.to_owned(),
            source,
        };
        let views = views.collect::<Result<Vec<_>, _>>().map_err(format)?;
        let card = card.map(|card| [(KEY.to_owned(), card.to_owned())].into());
        let bytes = safetensors::serialize(views, card).map_err(format)?;
        let part = path.with_extension("part");
        std::fs::write(&part, bytes).map_err(file)?;
        std::fs::rename(&part, path).map_err(file)
    }
}

/// The numbers of a tensor; integers without their scale.
fn numbers(name: &str, view: &TensorView<'_>) -> Result<Vec<f32>, WeightsError> {
    let bytes = view.data();
    let pairs = || {
        bytes
            .chunks_exact(2)
            .map(|b| u16::from_le_bytes([b[0], b[1]]))
    };
    Ok(match view.dtype() {
        Dtype::F32 => bytes
            .chunks_exact(4)
            .map(|b| f32::from_le_bytes([b[0], b[1], b[2], b[3]]))
            .collect(),
        Dtype::F16 => pairs().map(half).collect(),
        Dtype::BF16 => pairs()
            .map(|b| f32::from_bits(u32::from(b) << 16))
            .collect(),
        Dtype::I8 => bytes.iter().map(|&b| f32::from(b as i8)).collect(),
        other => {
            return Err(WeightsError::Type {
                name: name.to_owned(),
                dtype: format!("{other:?}"),
            });
        }
    })
}

/// Half precision to single, exactly.
fn half(bits: u16) -> f32 {
    let sign = if bits >> 15 == 1 { -1.0 } else { 1.0 };
    let (exponent, fraction) = (i32::from(bits >> 10 & 31), f32::from(bits & 1023));
    sign * match exponent {
        0 => fraction * 2.0_f32.powi(-24),
        31 if fraction == 0.0 => f32::INFINITY,
        31 => f32::NAN,
        _ => (1024.0 + fraction) * 2.0_f32.powi(exponent - 25),
    }
}

/// The name of a parameter in PyTorch.
fn name_of(path: &[String]) -> String {
    let name = path.join(".");
    name.replace(".downsample.conv.", ".downsample.0.")
        .replace(".downsample.norm.", ".downsample.1.")
        .replace("flow.modulation.", "flow.told.")
}

#[derive(Default)]
struct Reader {
    path: Vec<String>,
    tensors: BTreeMap<String, (Vec<usize>, Vec<f32>)>,
}

impl ModuleVisitor for Reader {
    fn enter_module(&mut self, name: &str, _: &str) {
        self.path.push(name.to_owned());
    }

    fn exit_module(&mut self, _: &str, _: &str) {
        self.path.pop();
    }

    fn visit_float<const D: usize>(&mut self, parameter: &Param<Tensor<D>>) {
        let data = parameter.val().into_data().convert::<f32>();
        let shape = parameter.val().dims().to_vec();
        let values = data.try_into_vec().expect("single precision");
        self.tensors.insert(name_of(&self.path), (shape, values));
    }
}

struct Writer {
    path: Vec<String>,
    weights: BTreeMap<String, (Vec<usize>, Vec<f32>)>,
    problem: Option<WeightsError>,
}

impl ModuleMapper for Writer {
    fn enter_module(&mut self, name: &str, _: &str) {
        self.path.push(name.to_owned());
    }

    fn exit_module(&mut self, _: &str, _: &str) {
        self.path.pop();
    }

    fn map_float<const D: usize>(&mut self, parameter: Param<Tensor<D>>) -> Param<Tensor<D>> {
        let name = name_of(&self.path);
        let expected = parameter.val().dims();
        match self.weights.remove(&name) {
            Some((shape, values)) if shape == expected => {
                let is_required = parameter.val().is_require_grad();
                parameter.map(|tensor| {
                    let data = TensorData::new(values, expected);
                    let tensor = Tensor::from_data(data, &tensor.device());
                    match is_required {
                        true => tensor.require_grad(),
                        false => tensor,
                    }
                })
            }
            found => {
                let found = found.map_or("none".to_owned(), |(shape, _)| format!("{shape:?}"));
                self.problem.get_or_insert(WeightsError::Unfit {
                    name,
                    expected: expected.to_vec(),
                    found,
                });
                parameter
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn half_precision_is_read_exactly() {
        for (bits, value) in [
            (0x3c00, 1.0),
            (0xc000, -2.0),
            (0x7bff, 65504.0),
            (0x0001, 5.960_464_5e-8),
            (0x0400, 6.103_515_6e-5),
            (0x3555, 0.333_251_95),
        ] {
            assert_eq!(half(bits), value);
        }
        assert!(half(0x7c00).is_infinite() && half(0x7e00).is_nan());
    }
}
