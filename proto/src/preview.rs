//! Levels of the preview streams, for different connections.

use crate::v1;

/// Size, rate and quality of a preview stream.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum PreviewLevel {
    /// For connections of about 0.5 Mbit/s.
    Low,
    /// For connections of about 3 Mbit/s.
    Medium,
    /// For local networks.
    High,
    /// Raw, for clients that encode on the same host.
    Flat,
    /// The same, larger.
    FlatLarge,
}

impl PreviewLevel {
    /// Every compressed level, lowest first.
    pub const ALL: [Self; 3] = [Self::Low, Self::Medium, Self::High];
    /// Raw levels, for clients that encode on the same host.
    pub const FLAT: [Self; 2] = [Self::Flat, Self::FlatLarge];

    /// Last chunk of the key.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Low => "low",
            Self::Medium => "medium",
            Self::High => "high",
            Self::Flat => "flat",
            Self::FlatLarge => "flat-large",
        }
    }

    /// The level of a message, if set.
    #[must_use]
    pub fn from_proto(level: v1::PreviewLevel) -> Option<Self> {
        match level {
            v1::PreviewLevel::Unspecified => None,
            v1::PreviewLevel::Low => Some(Self::Low),
            v1::PreviewLevel::Medium => Some(Self::Medium),
            v1::PreviewLevel::High => Some(Self::High),
            v1::PreviewLevel::Flat => Some(Self::Flat),
            v1::PreviewLevel::FlatLarge => Some(Self::FlatLarge),
        }
    }

    /// As an enum of the contract.
    #[must_use]
    pub fn code(self) -> v1::PreviewLevel {
        match self {
            Self::Low => v1::PreviewLevel::Low,
            Self::Medium => v1::PreviewLevel::Medium,
            Self::High => v1::PreviewLevel::High,
            Self::Flat => v1::PreviewLevel::Flat,
            Self::FlatLarge => v1::PreviewLevel::FlatLarge,
        }
    }

    /// Largest image width, pixels; smaller images are not enlarged.
    #[must_use]
    pub fn width(self) -> u32 {
        match self {
            Self::Low => 320,
            Self::Medium | Self::Flat => 640,
            Self::High | Self::FlatLarge => 1280,
        }
    }

    /// Largest number of images per second of wall time, Hz; `None` is the camera's
    /// rate.
    #[must_use]
    pub fn rate_hz(self) -> Option<f64> {
        match self {
            Self::Low => Some(5.0),
            Self::Medium => Some(10.0),
            Self::High | Self::Flat | Self::FlatLarge => None,
        }
    }

    /// JPEG quality, 1 to 100; `None` where the image is raw.
    #[must_use]
    pub fn quality(self) -> Option<u8> {
        match self {
            Self::Low => Some(50),
            Self::Medium => Some(65),
            Self::High => Some(80),
            Self::Flat | Self::FlatLarge => None,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_level_survives_a_round_trip() {
        for level in PreviewLevel::ALL.into_iter().chain(PreviewLevel::FLAT) {
            assert_eq!(PreviewLevel::from_proto(level.code()), Some(level));
        }
        assert_eq!(
            PreviewLevel::from_proto(v1::PreviewLevel::Unspecified),
            None
        );
    }
}
