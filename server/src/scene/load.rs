//! Loads a scene from the assets folder.

use std::collections::BTreeMap;
use std::path::Path;
use std::sync::Arc;

use nalgebra::{Isometry3, Matrix3, Point3, Rotation3, Unit, UnitQuaternion, Vector3};
use wheelarm_pack::Pack;
use wheelarm_proto::furniture::JointMotion;
use wheelarm_proto::settings::ObjectSplit;

use super::error::{Place, SceneError};
use super::file::{
    FurnitureEntry, HingeEntry, LightEntry, ObjectEntry, RoomCameraEntry, SceneFile, SlideEntry,
};
use super::folder::{names, parse, provenance};
use super::part::Reader;
use super::{
    Body, FurnitureJoint, Lighting, Resistance, RoomCamera, Scene, Surface, material, object,
};
use crate::geometry::Shape;

impl Scene {
    /// Reads `assets/scenes/NAME.toml` with its materials, objects and meshes.
    ///
    /// # Errors
    /// When a file is missing or a value is invalid.
    pub fn load(assets: &Path, name: &str) -> Result<Self, SceneError> {
        let path = format!("scenes/{name}.toml");
        let file: SceneFile = parse(assets, &path)?;
        Self::from_file(assets, None, name, &path, &file)
    }

    /// The scene of a file at `path`, of the assets or of a pack.
    pub(super) fn from_file(
        assets: &Path,
        pack: Option<&Arc<Pack>>,
        name: &str,
        path: &str,
        file: &SceneFile,
    ) -> Result<Self, SceneError> {
        let place = Place::file(path);
        provenance(&place, &file.origin, &file.license)?;
        let materials = material::library(assets, pack)?;
        let reader = Reader {
            assets,
            pack,
            materials: &materials,
        };
        let mut scene = Self {
            name: name.to_owned(),
            furniture: Vec::new(),
            objects: Vec::new(),
            surfaces: Vec::new(),
            places: Vec::new(),
            handles: Vec::new(),
            joints: Vec::new(),
            lighting: lighting(&place.key("light"), &file.light)?,
            start: {
                let place = place.key("start");
                let [x, y] = file.start.at;
                let at = place.key("at").position([x, y, 0.0])?;
                Isometry3::new(at.into(), yaw(&place, file.start.yaw_deg)?)
            },
            room_camera: room_camera(&place.key("room_camera"), &file.room_camera)?,
            files: Vec::new(),
            pack: pack.cloned(),
            object_packs: Vec::new(),
            object_split: ObjectSplit::default(),
        };
        let mut entries: BTreeMap<&str, &FurnitureEntry> = BTreeMap::new();
        for entry in &file.furniture {
            let place = place.entry("furniture", &entry.name);
            unused_name(&place, &scene, &entry.name)?;
            scene.add_furniture(&reader, &place, &entries, entry)?;
            entries.insert(&entry.name, entry);
        }
        if scene
            .furniture
            .first()
            .is_none_or(|body| body.name != "floor")
        {
            let first = scene.furniture.first().map_or("nothing", |b| &b.name);
            return Err(place.key("furniture").wrong(
                format!("a list that begins with {first:?}"),
                "\"floor\" as the first entry",
                "move the floor to the top",
            ));
        }
        for entry in &file.object {
            let place = place.entry("object", &entry.name);
            unused_name(&place, &scene, &entry.name)?;
            scene.add_object(&reader, &place, entry)?;
        }
        scene.add_places(&place, &file.place)?;
        scene.add_handles(&place, &file.handle)?;
        scene.files = scene.texts_behind(file, path, names(assets, "materials")?);
        Ok(scene)
    }

    /// The text files of this scene, sorted: itself, every material file, every kind of
    /// object, every mesh in text form. Without those of a pack, which is stored whole.
    fn texts_behind(&self, file: &SceneFile, own: &str, materials: Vec<String>) -> Vec<String> {
        let materials = materials
            .iter()
            .map(|name| format!("materials/{name}.toml"));
        let objects = file.object.iter().map(|entry| {
            let kind = entry.kind.as_deref().unwrap_or(&entry.name);
            format!("objects/{kind}.toml")
        });
        let bodies = self.furniture.iter().chain(&self.objects);
        let meshes = bodies.flat_map(mesh_paths).filter(|path| {
            let path = path.to_ascii_lowercase();
            path.ends_with(".obj") || path.ends_with(".gltf")
        });
        let mut paths = vec![own.to_owned()];
        paths.extend(materials.chain(objects).chain(meshes));
        if let Some(pack) = &self.pack {
            let is_own = |path: &String| path == own || pack.file(path).is_some();
            paths.retain(|path| !is_own(path));
        }
        paths.sort();
        paths.dedup();
        paths
    }

    fn add_furniture(
        &mut self,
        reader: &Reader<'_>,
        place: &Place,
        earlier: &BTreeMap<&str, &FurnitureEntry>,
        entry: &FurnitureEntry,
    ) -> Result<(), SceneError> {
        let model = model(place, earlier, entry)?;
        let material = entry.material.as_deref().or(model.material.as_deref());
        let parts = reader.body(place, material, &model.parts, model.collision.as_deref())?;
        let friction = entry.friction.or(model.friction).unwrap_or(0.6);
        let pose = Isometry3::new(
            place.key("at").position(entry.at)?.into(),
            yaw(place, entry.yaw_deg)?,
        );
        self.add_surfaces(place, &pose, entry, model)?;
        let body = Body {
            name: entry.name.clone(),
            area: if entry.area.is_empty() {
                model.area.clone()
            } else {
                entry.area.clone()
            },
            category: match entry.category.as_str() {
                "" => model.category.clone(),
                own => own.to_owned(),
            },
            colour: String::new(),
            noun: String::new(),
            pose,
            mass: None,
            friction: place.key("friction").within(
                friction,
                0.0,
                2.0,
                "",
                "it is a Coulomb coefficient",
            )?,
            collision: parts.collision,
            hulls: parts.hulls,
            soft: None,
            visual: parts.visual,
            grasps: entry
                .grasps
                .iter()
                .chain(if entry.like.is_some() {
                    model.grasps.as_slice()
                } else {
                    &[]
                })
                .enumerate()
                .map(|(i, grasp)| object::grasp(&place.entry("grasps", i), grasp))
                .collect::<Result<_, _>>()?,
            tip: None,
            optional: entry.optional,
        };
        let slide = entry.slide.as_ref().or(model.slide.as_ref());
        let hinge = entry.hinge.as_ref().or(model.hinge.as_ref());
        match (slide, hinge) {
            (None, None) => {}
            (Some(slide), None) => {
                let joint = self.slide(&place.key("slide"), &body, slide)?;
                self.joints.push(joint);
            }
            (None, Some(hinge)) => {
                let joint = self.hinge(&place.key("hinge"), &body, hinge)?;
                self.joints.push(joint);
            }
            (Some(_), Some(_)) => {
                return Err(place.key("hinge").wrong(
                    "given beside slide",
                    "one joint per furniture",
                    "remove one of the two, or split the furniture",
                ));
            }
        }
        self.furniture.push(body);
        Ok(())
    }

    /// Adds the surfaces of the next furniture, at `pose`.
    fn add_surfaces(
        &mut self,
        place: &Place,
        pose: &Isometry3<f64>,
        entry: &FurnitureEntry,
        model: &FurnitureEntry,
    ) -> Result<(), SceneError> {
        for (i, surface) in entry
            .surfaces
            .iter()
            .chain(
                (entry.like.is_some())
                    .then_some(&model.surfaces)
                    .into_iter()
                    .flatten(),
            )
            .enumerate()
        {
            let place = place.entry("surfaces", i);
            let edge = place.key("edge").position(surface.edge)?;
            let turn = place.key("inwards_deg").within(
                surface.inwards_deg,
                -360.0,
                360.0,
                "degrees",
                "angles are degrees",
            )?;
            self.surfaces.push(Surface {
                furniture: self.furniture.len(),
                name: surface.name.clone(),
                edge: pose * Isometry3::new(edge.into(), Vector3::z() * turn.to_radians()),
                depth: place.key("depth").length(surface.depth)?,
                width: place.key("width").length(surface.width)?,
            });
        }
        Ok(())
    }

    /// The joint of the next furniture, which slides.
    fn slide(
        &self,
        place: &Place,
        body: &Body,
        entry: &SlideEntry,
    ) -> Result<FurnitureJoint, SceneError> {
        Ok(FurnitureJoint {
            name: format!("{}_joint", body.name),
            furniture: self.furniture.len(),
            carrier: self.carrier(place, &entry.on)?,
            motion: JointMotion::Slides,
            axis: axis(place, body, entry.axis, "[1, 0, 0]: forward")?,
            travel: place.key("travel").length(entry.travel)?,
            mass: object::mass(place, entry.mass, entry.com, entry.inertia, body)?,
            resistance: Resistance {
                friction: place.key("friction").within(
                    entry.friction,
                    0.0,
                    1000.0,
                    "N",
                    "it is a force: a drawer resists with 3 to 8 N",
                )?,
                damping: place.key("damping").within(
                    entry.damping,
                    0.0,
                    10_000.0,
                    "N·s/m",
                    "it is a force per speed",
                )?,
            },
            start: 0.0,
        })
    }

    /// The joint of the next furniture, which turns.
    fn hinge(
        &self,
        place: &Place,
        body: &Body,
        entry: &HingeEntry,
    ) -> Result<FurnitureJoint, SceneError> {
        Ok(FurnitureJoint {
            name: format!("{}_joint", body.name),
            furniture: self.furniture.len(),
            carrier: self.carrier(place, &entry.on)?,
            motion: JointMotion::Turns,
            axis: axis(place, body, entry.axis, "[0, 0, 1]: upwards")?,
            travel: place
                .key("travel_deg")
                .within(
                    entry.travel_deg,
                    1.0,
                    MOST_TURN_DEG,
                    "degrees",
                    "a cabinet door opens by 90 to 110",
                )?
                .to_radians(),
            mass: object::mass(place, entry.mass, entry.com, entry.inertia, body)?,
            resistance: Resistance {
                friction: place.key("friction").within(
                    entry.friction,
                    0.0,
                    100.0,
                    "N·m",
                    "it is a torque: a cabinet door resists with 0.3 to 1 N·m",
                )?,
                damping: place.key("damping").within(
                    entry.damping,
                    0.0,
                    1000.0,
                    "N·m·s",
                    "it is a torque per turn rate",
                )?,
            },
            start: 0.0,
        })
    }

    /// Index of the furniture that carries a joint.
    fn carrier(&self, place: &Place, on: &str) -> Result<usize, SceneError> {
        self.furniture_named(on).ok_or_else(|| {
            place.key("on").wrong(
                format!("{on:?}"),
                "the name of furniture further up",
                "correct the name or move the entry down",
            )
        })
    }

    fn add_object(
        &mut self,
        reader: &Reader<'_>,
        place: &Place,
        entry: &ObjectEntry,
    ) -> Result<(), SceneError> {
        let kind = entry.kind.as_deref().unwrap_or(&entry.name);
        let mut known = names(reader.assets, "objects")?;
        let packed = reader.pack.iter();
        known.extend(packed.flat_map(|p| p.names("objects", "toml").map(str::to_owned)));
        if !known.iter().any(|name| name == kind) {
            return Err(place.key("kind").wrong(
                format!("{kind:?}"),
                format!("one of {}", known.join(", ")),
                "correct the name or add the object in assets/objects",
            ));
        }
        let surface = self.surface(place, &entry.on, entry.surface.as_deref())?;
        let [inwards, along] = entry.at;
        let on = place.key("at");
        let cure = "objects stand on the surface: inwards from its edge, along from its middle";
        on.within(inwards, 0.0, surface.depth, "m inwards", cure)?;
        let half = surface.width / 2.0;
        on.within(along, -half, half, "m along the edge", cure)?;
        let body = object::read(reader, kind)?;
        let area = self.furniture[surface.furniture].area.clone();
        let lift = Isometry3::translation(0.0, 0.0, body.standing_height());
        let pose = surface.standing(inwards, along, yaw(place, entry.yaw_deg)?.z) * lift;
        self.objects.push(Body {
            name: entry.name.clone(),
            area,
            pose,
            optional: entry.optional,
            ..body
        });
        Ok(())
    }

    /// The surface that a file names; the error lists the available ones.
    pub(crate) fn surface(
        &self,
        place: &Place,
        furniture: &str,
        surface: Option<&str>,
    ) -> Result<&Surface, SceneError> {
        self.surface_named(furniture, surface).ok_or_else(|| {
            let known: Vec<_> = self
                .surfaces
                .iter()
                .map(|s| format!("{} {}", self.furniture[s.furniture].name, s.name))
                .collect();
            place.key("on").wrong(
                format!("{:?}", format!("{furniture} {}", surface.unwrap_or(""))),
                format!("one of {}", known.join(", ")),
                "correct the names or give the furniture a surface",
            )
        })
    }
}

/// The entry with the parts of furniture: its own, or the one that it copies.
fn model<'a>(
    place: &Place,
    earlier: &BTreeMap<&str, &'a FurnitureEntry>,
    entry: &'a FurnitureEntry,
) -> Result<&'a FurnitureEntry, SceneError> {
    let model = match &entry.like {
        None => entry,
        Some(like) => {
            if !entry.parts.is_empty() || entry.collision.is_some() {
                return Err(place.key("like").wrong(
                    format!("{like:?} beside parts of its own"),
                    "one of them",
                    "remove `parts` and `collision`, or `like`",
                ));
            }
            earlier.get(like.as_str()).copied().ok_or_else(|| {
                place.key("like").wrong(
                    format!("{like:?}"),
                    "the name of furniture further up that has parts",
                    "correct the name or move the entry down",
                )
            })?
        }
    };
    if model.parts.is_empty() {
        return Err(place.key("parts").wrong(
            "empty",
            "at least one shape",
            "add parts, or `like` with the name of furniture that has parts",
        ));
    }
    Ok(model)
}

fn mesh_paths(body: &Body) -> impl Iterator<Item = String> {
    let drawn = body.visual.iter().map(|visual| &visual.part);
    body.collision
        .iter()
        .chain(drawn)
        .filter_map(|part| match &part.shape {
            Shape::Mesh { path, .. } => Some(path.clone()),
            _ => None,
        })
}

fn unused_name(place: &Place, scene: &Scene, name: &str) -> Result<(), SceneError> {
    let taken = scene.furniture_named(name).is_some() || scene.object_named(name).is_some();
    if taken || name.trim().is_empty() {
        return Err(place.key("name").wrong(
            format!("{name:?}"),
            "a unique name",
            "every body of the scene has a unique name",
        ));
    }
    Ok(())
}

/// A rotation about z as a rotation vector.
fn yaw(place: &Place, degrees: f64) -> Result<Vector3<f64>, SceneError> {
    let degrees =
        place
            .key("yaw_deg")
            .within(degrees, -360.0, 360.0, "degrees", "angles are degrees")?;
    Ok(Vector3::z() * degrees.to_radians())
}

/// Largest angle of a hinge: short of a whole turn, positions are unique.
const MOST_TURN_DEG: f64 = 175.0;

/// The axis of a joint in `house`.
fn axis(
    place: &Place,
    body: &Body,
    axis: [f64; 3],
    example: &str,
) -> Result<Unit<Vector3<f64>>, SceneError> {
    let found = Unit::try_new(body.pose.rotation * Vector3::from(axis), 1e-3);
    found.ok_or_else(|| {
        place.key("axis").wrong(
            format!("{axis:?}"),
            "a direction",
            format!("for example {example} in the furniture's frame"),
        )
    })
}

fn lighting(place: &Place, entry: &LightEntry) -> Result<Lighting, SceneError> {
    let direction = Vector3::from(entry.sun_direction);
    let towards = place.key("sun_direction");
    if direction.norm() < 1e-6 || direction.z <= 0.0 {
        return Err(towards.wrong(
            format!("{:?}", entry.sun_direction),
            "a direction towards the sun, z above 0",
            "the light comes from above",
        ));
    }
    let color = |key: &str, rgb: [f64; 3]| {
        for value in rgb {
            place
                .key(key)
                .within(value, 0.0, 50.0, "", "linear RGB times intensity")?;
        }
        Ok::<_, SceneError>(rgb.map(|v| v as f32))
    };
    Ok(Lighting {
        sun_direction: direction.normalize().cast::<f32>().into(),
        sun: color("sun", entry.sun)?,
        sky: color("sky", entry.sky)?,
        ground: color("ground", entry.ground)?,
    })
}

fn room_camera(place: &Place, entry: &RoomCameraEntry) -> Result<RoomCamera, SceneError> {
    let at = Point3::from(place.key("at").position(entry.at)?);
    let target = Point3::from(place.key("look_at").position(entry.look_at)?);
    let z = target - at;
    let x = z.cross(&Vector3::z());
    if x.norm() < 1e-6 {
        return Err(place.key("look_at").wrong(
            format!("{:?}", entry.look_at),
            format!("a point that is not straight above or below {:?}", entry.at),
            "move one of them sideways",
        ));
    }
    let (x, z) = (x.normalize(), z.normalize());
    let axes = Matrix3::from_columns(&[x, z.cross(&x), z]);
    let fov = place.key("horizontal_fov_deg").within(
        entry.horizontal_fov_deg,
        5.0,
        150.0,
        "degrees",
        "angles are degrees",
    )?;
    Ok(RoomCamera {
        pose: Isometry3::from_parts(
            at.into(),
            UnitQuaternion::from_rotation_matrix(&Rotation3::from_matrix_unchecked(axes)),
        ),
        horizontal_fov: fov.to_radians(),
    })
}
