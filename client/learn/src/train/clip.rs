//! Clips gradients by their norm over all parameters; burn's own clipping treats each tensor
//! separately.

use burn::module::{Module, ModuleVisitor, Param};
use burn::optim::GradientsParams;
use burn::prelude::*;

/// Scales the gradients so that their norm is at most `most`.
pub fn clipped<M: Module>(gradients: GradientsParams, network: &M, most: f64) -> GradientsParams {
    let mut length = Length {
        gradients: &gradients,
        square: 0.0,
    };
    network.visit(&mut length);
    let length = length.square.sqrt();
    if length <= most {
        return gradients;
    }
    let mut scale = Scale {
        gradients,
        factor: most / length,
    };
    network.visit(&mut scale);
    scale.gradients
}

struct Length<'a> {
    gradients: &'a GradientsParams,
    square: f64,
}

impl ModuleVisitor for Length<'_> {
    fn visit_float<const D: usize>(&mut self, parameter: &Param<Tensor<D>>) {
        if let Some(gradient) = self.gradients.get::<D>(parameter.id) {
            self.square += gradient.square().sum().into_scalar::<f64>();
        }
    }
}

struct Scale {
    gradients: GradientsParams,
    factor: f64,
}

impl ModuleVisitor for Scale {
    fn visit_float<const D: usize>(&mut self, parameter: &Param<Tensor<D>>) {
        if let Some(gradient) = self.gradients.remove::<D>(parameter.id) {
            self.gradients
                .register(parameter.id, gradient * self.factor);
        }
    }
}
