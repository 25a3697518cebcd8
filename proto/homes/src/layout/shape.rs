//! Builds the shapes of a kind of furniture: its front along x, its base at z = 0, metres.

use wheelarm_pack::{
    FrustumEntry, KindFile, PartEntry, PrismEntry, RoundEntry, RoundedBoxEntry, SphereEntry,
    SurfaceEntry,
};

use super::files::{Front, Handle, Legs};

/// Least and greatest coordinate of a box along x, y and z.
pub type Extent = [[f64; 2]; 3];

/// Design of a style.
#[derive(Clone, Copy, Debug)]
pub struct Design {
    /// Fronts of cabinets.
    pub front: Front,
    /// Handles of cabinets.
    pub handle: Handle,
    /// Legs.
    pub legs: Legs,
}

/// A kind that is being built.
#[derive(Clone, Debug, Default)]
pub struct Model {
    /// The kind so far; its collision is a list.
    pub kind: KindFile,
}

/// Rounds to a tenth of a millimetre; negative zero becomes zero.
#[must_use]
pub fn rounded(value: f64) -> f64 {
    (value * 1.0e4).round() / 1.0e4 + 0.0
}

/// Rounds all coordinates.
#[must_use]
pub fn rounded3(point: [f64; 3]) -> [f64; 3] {
    point.map(rounded)
}

/// A range about a middle.
#[must_use]
pub fn about(middle: f64, length: f64) -> [f64; 2] {
    [middle - length / 2.0, middle + length / 2.0]
}

fn cuboid(extent: Extent) -> PartEntry {
    PartEntry {
        cuboid: Some(rounded3(extent.map(|[low, high]| high - low))),
        at: Some(rounded3(extent.map(|[low, high]| f64::midpoint(low, high)))),
        ..PartEntry::default()
    }
}

impl Model {
    /// A kind of a category without shapes.
    #[must_use]
    pub fn new(category: &str) -> Self {
        Self {
            kind: KindFile {
                category: category.to_owned(),
                friction: Some(0.6),
                collision: Some(Vec::new()),
                ..KindFile::default()
            },
        }
    }

    /// Adds a rendered part of a material.
    pub fn part(&mut self, material: &str, part: PartEntry) -> &mut Self {
        self.kind.parts.push(PartEntry {
            material: Some(material.to_owned()),
            collide: Some(false),
            ..part
        });
        self
    }

    /// Adds a box that is rendered only.
    pub fn shown(&mut self, material: &str, extent: Extent) -> &mut Self {
        self.part(material, cuboid(extent))
    }

    /// Adds a box that collides only.
    pub fn solid(&mut self, extent: Extent) -> &mut Self {
        if let Some(collision) = &mut self.kind.collision {
            collision.push(cuboid(extent));
        }
        self
    }

    /// Adds a box that is rendered and collides.
    pub fn block(&mut self, material: &str, extent: Extent) -> &mut Self {
        self.solid(extent).shown(material, extent)
    }

    /// Adds a rendered box with round edges, turned about y by `pitch_deg`.
    pub fn cushion(
        &mut self,
        material: &str,
        extent: Extent,
        radius: f64,
        pitch_deg: f64,
    ) -> &mut Self {
        let size = extent.map(|[low, high]| high - low);
        let most = size.iter().copied().fold(f64::INFINITY, f64::min) * 0.45;
        let part = PartEntry {
            rounded_box: Some(RoundedBoxEntry {
                size: rounded3(size),
                radius: rounded(radius.min(most)),
            }),
            at: Some(rounded3(extent.map(|[low, high]| f64::midpoint(low, high)))),
            rpy_deg: (pitch_deg != 0.0).then_some([0.0, pitch_deg, 0.0]),
            ..PartEntry::default()
        };
        self.part(material, part)
    }

    /// Adds a rendered upright cylinder on a point.
    pub fn rod(
        &mut self,
        material: &str,
        [x, y, z]: [f64; 3],
        radius: f64,
        height: f64,
    ) -> &mut Self {
        let part = PartEntry {
            cylinder: Some(RoundEntry {
                radius: rounded(radius),
                height: rounded(height),
            }),
            at: Some(rounded3([x, y, z + height / 2.0])),
            ..PartEntry::default()
        };
        self.part(material, part)
    }

    /// Adds a rendered cylinder about a middle: along x (0) or y (1).
    pub fn bar(
        &mut self,
        material: &str,
        middle: [f64; 3],
        axis: usize,
        [radius, length]: [f64; 2],
    ) -> &mut Self {
        let part = PartEntry {
            cylinder: Some(RoundEntry {
                radius: rounded(radius),
                height: rounded(length),
            }),
            at: Some(rounded3(middle)),
            rpy_deg: Some(if axis == 0 {
                [0.0, 90.0, 0.0]
            } else {
                [90.0, 0.0, 0.0]
            }),
            ..PartEntry::default()
        };
        self.part(material, part)
    }

    /// Adds a rendered truncated cone on a point.
    pub fn cone(
        &mut self,
        material: &str,
        [x, y, z]: [f64; 3],
        [bottom, top]: [f64; 2],
        height: f64,
    ) -> &mut Self {
        let part = PartEntry {
            frustum: Some(FrustumEntry {
                bottom_radius: rounded(bottom),
                top_radius: rounded(top),
                height: rounded(height),
            }),
            at: Some(rounded3([x, y, z + height / 2.0])),
            ..PartEntry::default()
        };
        self.part(material, part)
    }

    /// Adds a rendered sphere.
    pub fn ball(&mut self, material: &str, middle: [f64; 3], radius: f64) -> &mut Self {
        let part = PartEntry {
            sphere: Some(SphereEntry {
                radius: rounded(radius),
            }),
            at: Some(rounded3(middle)),
            ..PartEntry::default()
        };
        self.part(material, part)
    }

    /// Adds a rendered turned shape of `[radius, z]` points on a point.
    pub fn turned(&mut self, material: &str, at: [f64; 3], points: &[[f64; 2]]) -> &mut Self {
        let part = PartEntry {
            lathe: Some(points.iter().map(|point| point.map(rounded)).collect()),
            at: Some(rounded3(at)),
            ..PartEntry::default()
        };
        self.part(material, part)
    }

    /// Adds a rendered prism: an outline with a thickness upwards, turned by roll, pitch, yaw.
    pub fn prism(
        &mut self,
        material: &str,
        outline: &[[f64; 2]],
        height: f64,
        at: [f64; 3],
        rpy_deg: [f64; 3],
    ) -> &mut Self {
        let part = PartEntry {
            prism: Some(PrismEntry {
                outline: outline.iter().map(|point| point.map(rounded)).collect(),
                height: rounded(height),
            }),
            at: Some(rounded3(at)),
            rpy_deg: Some(rpy_deg),
            ..PartEntry::default()
        };
        self.part(material, part)
    }

    /// Adds a level surface that is approached from the front.
    pub fn surface(&mut self, name: &str, x: [f64; 2], y: [f64; 2], height: f64) -> &mut Self {
        self.kind.surfaces.push(SurfaceEntry {
            name: name.to_owned(),
            edge: rounded3([x[1], f64::midpoint(y[0], y[1]), height]),
            inwards_deg: 180.0,
            depth: rounded(x[1] - x[0]),
            width: rounded(y[1] - y[0]),
        });
        self
    }

    /// Adds four legs below `height` at the corners of a rectangle. They collide.
    pub fn legs(
        &mut self,
        design: Design,
        material: &str,
        x: [f64; 2],
        y: [f64; 2],
        height: f64,
        thickness: f64,
    ) -> &mut Self {
        let half = thickness / 2.0;
        for at_x in [x[0] + half, x[1] - half] {
            for at_y in [y[0] + half, y[1] - half] {
                let extent = [
                    about(at_x, thickness),
                    about(at_y, thickness),
                    [0.0, height],
                ];
                self.solid(extent);
                match design.legs {
                    Legs::Square => self.shown(material, extent),
                    Legs::Round => self.rod(material, [at_x, at_y, 0.0], half, height),
                    Legs::Tapered => {
                        self.cone(material, [at_x, at_y, 0.0], [half * 0.5, half], height)
                    }
                };
            }
        }
        self
    }

    /// Adds the front of a door or a drawer on the plane `x`, with its handle.
    pub fn front(
        &mut self,
        design: Design,
        material: &str,
        x: f64,
        y: [f64; 2],
        z: [f64; 2],
        grip: Grip,
    ) -> &mut Self {
        const GAP: f64 = 0.002;
        let (y, z) = ([y[0] + GAP, y[1] - GAP], [z[0] + GAP, z[1] - GAP]);
        let panel = [x, x + 0.016];
        self.shown(material, [panel, y, z]);
        let is_large = y[1] - y[0] > 0.22 && z[1] - z[0] > 0.16;
        match design.front {
            Front::Framed if is_large => {
                let raised = [x + 0.016, x + 0.022];
                let rail = 0.055;
                self.shown(material, [raised, [y[0], y[0] + rail], z]);
                self.shown(material, [raised, [y[1] - rail, y[1]], z]);
                let inner = [y[0] + rail, y[1] - rail];
                self.shown(material, [raised, inner, [z[0], z[0] + rail]]);
                self.shown(material, [raised, inner, [z[1] - rail, z[1]]]);
            }
            Front::Boards if is_large => {
                let count = ((y[1] - y[0]) / 0.09).round().max(2.0);
                let step = (y[1] - y[0]) / count;
                for index in 0..count as usize {
                    let from = y[0] + step * index as f64;
                    let board = [from + 0.003, from + step - 0.003];
                    self.shown(material, [[x + 0.016, x + 0.021], board, z]);
                }
            }
            _ => {}
        }
        self.handle(design, x + 0.020, y, z, grip);
        self
    }

    fn handle(&mut self, design: Design, x: f64, y: [f64; 2], z: [f64; 2], grip: Grip) {
        const METAL: &str = "handle";
        let middle = f64::midpoint(y[0], y[1]);
        let inset = 0.045;
        // Of an upright handle.
        let (at_y, at_z) = match grip {
            Grip::Level => (middle, (z[1] - 0.05).max(f64::midpoint(z[0], z[1]))),
            Grip::Left => (y[1] - inset, f64::midpoint(z[0], z[1])),
            Grip::Right => (y[0] + inset, f64::midpoint(z[0], z[1])),
        };
        let is_tall = z[1] - z[0] > 1.0;
        let at_z = match grip {
            Grip::Left | Grip::Right if is_tall => at_z.min(1.05).max(z[0] + 0.2),
            // Doors of base cabinets are held near their upper edge.
            Grip::Left | Grip::Right if z[0] < 0.5 => z[1] - 0.14,
            Grip::Left | Grip::Right if z[0] > 1.2 => z[0] + 0.14,
            _ => at_z,
        };
        match (design.handle, grip) {
            (Handle::Knob, _) => {
                self.bar(METAL, [x + 0.010, at_y, at_z], 0, [0.006, 0.022]);
                self.bar(METAL, [x + 0.024, at_y, at_z], 0, [0.014, 0.014]);
            }
            (Handle::Strip, Grip::Level) => {
                let length = (y[1] - y[0]).min(0.4);
                let strip = [
                    [x - 0.004, x + 0.016],
                    about(middle, length),
                    [z[1] - 0.016, z[1] - 0.004],
                ];
                self.shown(METAL, strip);
            }
            (Handle::Strip, _) => {
                let length = if is_tall { 0.5 } else { 0.24 };
                self.shown(
                    METAL,
                    [
                        [x - 0.004, x + 0.016],
                        about(at_y, 0.012),
                        about(at_z, length),
                    ],
                );
            }
            (Handle::Bar, Grip::Level) => {
                let length = (0.55 * (y[1] - y[0])).min(0.22);
                self.bar(METAL, [x + 0.026, middle, at_z], 1, [0.006, length]);
                for off in [-0.4, 0.4] {
                    self.bar(
                        METAL,
                        [x + 0.010, middle + off * length, at_z],
                        0,
                        [0.005, 0.030],
                    );
                }
            }
            (Handle::Bar, _) => {
                let length = if is_tall { 0.45 } else { 0.16 };
                self.rod(METAL, [x + 0.026, at_y, at_z - length / 2.0], 0.006, length);
                for off in [-0.4, 0.4] {
                    self.bar(
                        METAL,
                        [x + 0.010, at_y, at_z + off * length],
                        0,
                        [0.005, 0.030],
                    );
                }
            }
        }
    }
}

/// Where the handle of a front is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Grip {
    /// Level, near the upper edge: drawers.
    Level,
    /// Upright, at the end with larger y.
    Left,
    /// Upright, at the end with smaller y.
    Right,
}
