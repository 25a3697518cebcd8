//! The laser scanner: its rays from the robot's description, and the limits of its range.

use nalgebra::{Isometry3, Translation3};

use crate::geometry::Rays;
use crate::robot::ScannerSettings;

/// A scanner of a robot.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Scanner {
    /// Index of the link that carries it.
    pub link: usize,
    /// link_from_scanner.
    pub mount: Isometry3<f64>,
    /// Its rays.
    pub rays: Rays,
    /// Least distance, metres.
    pub least: f64,
}

impl Scanner {
    /// The scanner of a description on `link`.
    #[must_use]
    pub fn new(settings: &ScannerSettings, link: usize) -> Self {
        let [x, y, z] = settings.at;
        let [least, greatest] = settings.range;
        Self {
            link,
            mount: Translation3::new(x, y, z).into(),
            rays: Rays {
                first: settings.first_deg.to_radians(),
                step: settings.step_deg.to_radians(),
                count: settings.rays as usize,
                greatest,
            },
            least,
        }
    }

    /// What the scanner reports of true distances, metres: -infinity below its least one.
    #[must_use]
    pub fn reported(&self, mut distances: Vec<f32>) -> Vec<f32> {
        for distance in &mut distances {
            if f64::from(*distance) < self.least {
                *distance = f32::NEG_INFINITY;
            }
        }
        distances
    }
}
