//! Levels of the preview streams: what a viewer may subscribe to, by link.

/// Size, rate and quality of a preview stream.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum PreviewLevel {
    /// For links of about 0.5 Mbit/s.
    Low,
    /// For links of about 3 Mbit/s.
    Medium,
    /// For local networks.
    High,
}

impl PreviewLevel {
    /// Every level, least first.
    pub const ALL: [Self; 3] = [Self::Low, Self::Medium, Self::High];

    /// Last chunk of the key, and the field `level`.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Low => "low",
            Self::Medium => "medium",
            Self::High => "high",
        }
    }

    /// The level of that name.
    #[must_use]
    pub fn from_name(name: &str) -> Option<Self> {
        Self::ALL.into_iter().find(|level| level.name() == name)
    }

    /// Greatest picture width, pixels; smaller pictures are not enlarged.
    #[must_use]
    pub fn width(self) -> u32 {
        match self {
            Self::Low => 320,
            Self::Medium => 640,
            Self::High => 1280,
        }
    }

    /// Most pictures per second of wall time, Hz; `None` is the camera's rate.
    #[must_use]
    pub fn rate_hz(self) -> Option<f64> {
        match self {
            Self::Low => Some(5.0),
            Self::Medium => Some(10.0),
            Self::High => None,
        }
    }

    /// JPEG quality, 1 to 100.
    #[must_use]
    pub fn quality(self) -> u8 {
        match self {
            Self::Low => 50,
            Self::Medium => 65,
            Self::High => 80,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_level_is_found_by_its_name() {
        for level in PreviewLevel::ALL {
            assert_eq!(PreviewLevel::from_name(level.name()), Some(level));
        }
        assert_eq!(PreviewLevel::from_name("huge"), None);
    }
}
