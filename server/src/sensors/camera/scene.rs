//! The render scene on the CPU: triangles, materials and bindings.

use std::collections::BTreeMap;
use std::path::Path;
use std::sync::Arc;

use nalgebra::{Isometry3, Point3, Translation3, UnitQuaternion, Vector3};

use super::RenderError;
use super::decoration::parts;
use super::mesh_cache::{MeshCache, SceneMeshes};
use crate::appearance::{Irradiance, Kind, Lamp, Reflection, SampledAppearance};
use crate::geometry::mesh::{Detail, build_detail};
use crate::geometry::plush::Skin;
use crate::geometry::texture::{self, Source};
use crate::geometry::{Family, Material, Shape, Texture, TriMesh, Visual};
use crate::people::{BodyPart, Person};
use crate::robot::{RobotModel, SeatSettings};
use crate::scene::{Body, Lighting, Scene, Soft};
use wheelarm_proto::parallel;

/// The body that a mesh or a camera is fixed to.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Binding {
    /// Nothing: `house`.
    World,
    /// Index into `RobotModel::links` and `Snapshot::links`.
    Link(usize),
    /// Index into `Scene::objects` and `Snapshot::objects`.
    Object(usize),
    /// Index into `Scene::joints` and `Snapshot::sliding`.
    Sliding(usize),
}

/// A mesh to render.
#[derive(Clone, Debug)]
pub struct RenderItem {
    /// Triangles; texture coordinates count repetitions of the texture.
    pub mesh: Arc<TriMesh>,
    /// Fewer triangles of the same shape, for shadows and distant views.
    pub coarse: Arc<TriMesh>,
    /// Material.
    pub material: Material,
    /// What it moves with.
    pub binding: Binding,
    /// Pose on its body; world_from_mesh for [`Binding::World`].
    pub body_from_mesh: Isometry3<f64>,
    /// Instance ID; 0 is the background.
    pub instance: u16,
    /// Casts a shadow. Walls and floors do not: the sun reaches every room.
    pub casts_shadow: bool,
}

/// Everything visible to the cameras.
#[derive(Clone, Debug)]
pub struct RenderScene {
    /// Meshes, grouped by instance.
    pub items: Vec<RenderItem>,
    /// Light.
    pub lighting: Lighting,
    /// Legend of the IDs: objects, then links, then furniture; bodies without visuals
    /// have none. 0 means that nothing is hit.
    pub instances: Vec<(u16, String)>,
    /// Links that a snapshot must have.
    pub links: usize,
    /// Objects that a snapshot must have.
    pub objects: usize,
    /// Deformables with their skins at rest.
    pub skins: Vec<(usize, Skin)>,
    /// Pieces of furniture on joints that a snapshot must have.
    pub sliding: usize,
    /// Images of the materials, by the names of their files.
    pub textures: BTreeMap<String, Source>,
    /// The person in the chair, with the IDs of the parts and the vertices that the
    /// head moves.
    pub person: Option<RenderedPerson>,
    /// Ambient light; `None`: a sky above and a ground below.
    pub surrounding: Option<Surrounding>,
}

/// A person as the cameras see them.
#[derive(Clone, Debug)]
pub struct RenderedPerson {
    /// The person.
    pub person: Arc<Person>,
    /// IDs of the parts.
    pub parts: Vec<(u16, BodyPart)>,
}

impl RenderedPerson {
    /// How far head and jaw move vertices, metres: culling allows for it.
    pub(super) const REACH: f64 = 0.12;
}

/// Ambient light of an appearance. Only with an appearance glass is transparent and metal mirrors the
/// room.
#[derive(Clone, Debug)]
pub struct Surrounding {
    /// Light on a matte surface.
    pub irradiance: Irradiance,
    /// Reflections on smooth surfaces.
    pub reflection: Reflection,
    /// Active lamps; those beyond [`crate::appearance::MOST_LAMPS`] are not rendered.
    pub lamps: Vec<Lamp>,
}

/// Largest number of bodies that a vertex can reference.
pub const MOST_BODIES: usize = 4095;

/// Furniture that reaches this high is part of the building, metres.
const BUILDING_HEIGHT: f64 = 2.3;

impl RenderScene {
    /// Meshes of a robot in a home; mesh files are searched below `assets`.
    ///
    /// # Errors
    /// When a mesh or a texture cannot be created, or for more than [`MOST_BODIES`]
    /// bodies.
    pub fn new(robot: &RobotModel, scene: &Scene, assets: &Path) -> Result<Self, RenderError> {
        Self::with_appearance(robot, scene, assets, None)
    }

    /// The same with an appearance. Furniture with a named colour keeps it, as do objects and
    /// robot.
    ///
    /// # Errors
    /// As [`RenderScene::new`].
    pub fn with_appearance(
        robot: &RobotModel,
        scene: &Scene,
        assets: &Path,
        appearance: Option<&SampledAppearance>,
    ) -> Result<Self, RenderError> {
        Self::with_person(robot, scene, assets, appearance, None)
    }

    /// The same with a person in the chair, whose clothes and skin do not change with
    /// the appearance.
    ///
    /// # Errors
    /// As [`RenderScene::new`].
    pub fn with_person(
        robot: &RobotModel,
        scene: &Scene,
        assets: &Path,
        appearance: Option<&SampledAppearance>,
        person: Option<&Arc<Person>>,
    ) -> Result<Self, RenderError> {
        let own = (appearance, person);
        Self::with_meshes(robot, scene, assets, own, &MeshCache::default())
    }

    /// The same with the meshes of earlier scenes.
    ///
    /// # Errors
    /// As [`RenderScene::new`].
    pub fn with_meshes(
        robot: &RobotModel,
        scene: &Scene,
        assets: &Path,
        (appearance, person): (Option<&SampledAppearance>, Option<&Arc<Person>>),
        meshes: &MeshCache,
    ) -> Result<Self, RenderError> {
        let drawn = |visuals: &[Visual]| !visuals.is_empty();
        let is_visible = |object: &&Body| drawn(&object.visual) || object.soft.is_some();
        let counts = [
            scene.objects.iter().filter(is_visible).count(),
            robot.links.iter().filter(|l| drawn(&l.visual)).count(),
            scene.furniture.iter().filter(|f| drawn(&f.visual)).count(),
        ];
        if counts.iter().sum::<usize>() >= MOST_BODIES {
            return Err(RenderError::TooManyInstances {
                objects: counts[0],
                links: counts[1],
                furniture: counts[2],
            });
        }
        let mut built = Self {
            items: Vec::new(),
            lighting: appearance.map_or(scene.lighting, |appearance| appearance.lighting),
            instances: Vec::new(),
            links: robot.links.len(),
            objects: scene.objects.len(),
            skins: Vec::new(),
            sliding: scene.joints.len(),
            textures: BTreeMap::new(),
            person: None,
            surrounding: appearance.map(|appearance| Surrounding {
                irradiance: appearance.irradiance.clone(),
                reflection: appearance.reflection.clone(),
                lamps: Vec::new(),
            }),
        };
        let mut meshes = meshes.for_scene(assets);
        let kept = |m: &Material| {
            appearance.map_or_else(|| m.clone(), |appearance| appearance.unchanged(m))
        };
        let furniture = |m: &Material| {
            appearance.map_or_else(|| m.clone(), |appearance| appearance.furniture(m))
        };
        for (i, object) in scene.objects.iter().enumerate() {
            let at = (Binding::Object(i), Isometry3::identity());
            built.add_body(&object.name, &object.visual, at, &kept, &mut meshes)?;
            if let Some(soft) = &object.soft {
                built.add_soft(i, &object.name, soft);
            }
        }
        for (i, link) in robot.links.iter().enumerate() {
            let at = (Binding::Link(i), Isometry3::identity());
            built.add_body(&link.name, &link.visual, at, &kept, &mut meshes)?;
        }
        for (i, body) in scene.furniture.iter().enumerate() {
            let joint = scene.joints.iter().position(|j| j.furniture == i);
            let at = match joint {
                Some(joint) => (Binding::Sliding(joint), Isometry3::identity()),
                None => (Binding::World, body.pose),
            };
            let paint: &dyn Fn(&Material) -> Material = match body.colour.as_str() {
                "" => &furniture,
                _ => &kept,
            };
            built.add_body(&body.name, &body.visual, at, paint, &mut meshes)?;
        }
        if let Some(person) = person {
            built.add_person(person, robot, assets, &kept)?;
        }
        if let Some(appearance) = appearance {
            let lamps = built.light_lamps(appearance);
            built.decorate(appearance, lamps, &mut meshes)?;
        }
        built.load_textures(assets)?;
        Ok(built)
    }

    /// Reads the texture files of the items.
    fn load_textures(&mut self, assets: &Path) -> Result<(), RenderError> {
        let textures = self
            .items
            .iter()
            .filter_map(|i| i.material.texture.as_ref());
        let used: BTreeMap<&str, &Texture> = textures
            .map(|texture| (texture.pattern.as_str(), texture))
            .collect();
        let used = used.into_values().cloned().collect();
        let sources = parallel::map(used, |used: Texture| {
            let source = texture::read_of(assets, &used);
            (used.pattern, source)
        });
        for (name, source) in sources {
            self.textures.insert(name, source?);
        }
        Ok(())
    }

    /// One ID for each part of a person's body, and a cushion under the person.
    fn add_person(
        &mut self,
        person: &Arc<Person>,
        robot: &RobotModel,
        assets: &Path,
        paint: &dyn Fn(&Material) -> Material,
    ) -> Result<(), RenderError> {
        let mut parts: Vec<(u16, BodyPart)> = Vec::new();
        for surface in &person.mesh.surfaces {
            if parts.last().is_none_or(|(_, part)| *part != surface.part) {
                let instance = self.instances.len() as u16 + 1;
                let name = format!("person_{}", surface.part.name());
                self.instances.push((instance, name));
                parts.push((instance, surface.part));
            }
            let (mut mesh, _) = person.mesh.part(surface, &person.skeleton);
            let material = paint(&surface.material);
            if let Some(t) = &material.texture {
                for uv in &mut mesh.uvs {
                    *uv = uv.map(|x| x / t.metres.max(1e-3));
                }
            }
            let mesh = Arc::new(mesh);
            self.items.push(RenderItem {
                coarse: mesh.clone(),
                mesh,
                material,
                binding: Binding::Link(0),
                body_from_mesh: Isometry3::identity(),
                instance: self.instances.len() as u16,
                casts_shadow: true,
            });
        }
        self.person = Some(RenderedPerson {
            person: Arc::clone(person),
            parts,
        });
        let seat = robot
            .settings
            .seat
            .as_ref()
            .filter(|_| person.cushion > 0.0);
        match seat {
            Some(seat) => self.add_cushion(seat, person.cushion, robot, assets, paint),
            None => Ok(()),
        }
    }

    /// The seat, extended by the cushion's thickness.
    fn add_cushion(
        &mut self,
        seat: &SeatSettings,
        thickness: f64,
        robot: &RobotModel,
        assets: &Path,
        paint: &dyn Fn(&Material) -> Material,
    ) -> Result<(), RenderError> {
        let visuals = robot.links.iter().flat_map(|link| &link.visual);
        let mut appearances = visuals.map(|visual| &visual.material);
        let Some(appearance) = appearances.find(|appearance| appearance.name == seat.material)
        else {
            return Ok(());
        };
        let half = [seat.size[0] / 2.0, seat.size[1] / 2.0, thickness / 2.0];
        let [x, y, z] = seat.at;
        let cushion = Shape::Cuboid { half };
        let mut mesh =
            build_detail(&cushion, assets, Detail::Full).map_err(|source| RenderError::Mesh {
                body: "seat_cushion".to_owned(),
                index: 0,
                source,
            })?;
        let material = paint(appearance);
        if let Some(t) = &material.texture {
            for uv in &mut mesh.uvs {
                *uv = uv.map(|x| x / t.metres.max(1e-3));
            }
        }
        let mesh = Arc::new(mesh);
        let instance = self.instances.len() as u16 + 1;
        self.instances.push((instance, "seat_cushion".to_owned()));
        self.items.push(RenderItem {
            coarse: mesh.clone(),
            mesh,
            material,
            binding: Binding::Link(0),
            body_from_mesh: Isometry3::translation(x, y, z + thickness / 2.0),
            instance,
            casts_shadow: true,
        });
        Ok(())
    }

    /// One mesh per material of the skin.
    fn add_soft(&mut self, object: usize, name: &str, soft: &Soft) {
        let skin = soft.skin();
        let instance = self.instances.len() as u16 + 1;
        self.instances.push((instance, name.to_owned()));
        let mut appearances: Vec<&Material> = Vec::new();
        for lobe in &soft.plush.lobes {
            if !appearances.contains(&&lobe.material) {
                appearances.push(&lobe.material);
            }
        }
        for appearance in appearances {
            let mut mesh = skin.part(|lobe| soft.plush.lobes[lobe].material == *appearance);
            if let Some(t) = &appearance.texture {
                for uv in &mut mesh.uvs {
                    *uv = uv.map(|x| x / t.metres.max(1e-3));
                }
            }
            let mesh = Arc::new(mesh);
            self.items.push(RenderItem {
                coarse: mesh.clone(),
                mesh,
                material: appearance.clone(),
                binding: Binding::Object(object),
                body_from_mesh: Isometry3::identity(),
                instance,
                casts_shadow: true,
            });
        }
        self.skins.push((object, skin));
    }

    fn add_body(
        &mut self,
        name: &str,
        visuals: &[Visual],
        (binding, body): (Binding, Isometry3<f64>),
        paint: &dyn Fn(&Material) -> Material,
        meshes: &mut SceneMeshes<'_>,
    ) -> Result<(), RenderError> {
        if visuals.is_empty() {
            return Ok(());
        }
        let instance = self.instances.len() as u16 + 1;
        self.instances.push((instance, name.to_owned()));
        for (index, visual) in visuals.iter().enumerate() {
            let material = paint(&visual.material);
            let mut get = |detail| {
                meshes
                    .get(&visual.part.shape, &material, detail)
                    .map_err(|source| RenderError::Mesh {
                        body: name.to_owned(),
                        index,
                        source,
                    })
            };
            let (mesh, coarse) = (get(Detail::Full)?, get(Detail::Coarse)?);
            let body_from_mesh = body * visual.part.pose;
            self.items.push(RenderItem {
                casts_shadow: visual.material.emission < 0.5,
                mesh,
                coarse,
                material,
                binding,
                body_from_mesh,
                instance,
            });
        }
        let first = self.items.len() - visuals.len();
        if binding == Binding::World && is_building(&self.items[first..]) {
            for item in &mut self.items[first..] {
                item.casts_shadow = false;
            }
        }
        Ok(())
    }
}

impl RenderScene {
    /// Adds the decoration of an appearance, with the background's ID 0. Its lamps follow
    /// those of the furniture, of which there are `number`.
    fn decorate(
        &mut self,
        appearance: &SampledAppearance,
        mut number: usize,
        meshes: &mut SceneMeshes<'_>,
    ) -> Result<(), RenderError> {
        for decoration in &appearance.decoration {
            let turn = UnitQuaternion::from_axis_angle(&Vector3::z_axis(), decoration.along);
            let place = Isometry3::from_parts(Translation3::from(decoration.at), turn);
            for (shape, at, mut material) in parts(decoration) {
                let pose = place * Translation3::from(at);
                if decoration.kind == Kind::Lamp && matches!(shape, Shape::Frustum { .. }) {
                    let at = pose.translation.vector.cast::<f32>();
                    if let Some(lamp) = appearance.lamp(number, at.into()) {
                        material.emission = appearance.lamp_glow();
                        self.surrounding.iter_mut().for_each(|s| s.lamps.push(lamp));
                    }
                    number += 1;
                }
                let mut get = |detail| {
                    meshes
                        .get(&shape, &material, detail)
                        .map_err(|source| RenderError::Mesh {
                            body: "decoration".to_owned(),
                            index: 0,
                            source,
                        })
                };
                let (mesh, coarse) = (get(Detail::Full)?, get(Detail::Coarse)?);
                self.items.push(RenderItem {
                    mesh,
                    coarse,
                    material,
                    binding: Binding::World,
                    body_from_mesh: pose,
                    instance: 0,
                    casts_shadow: decoration.kind == Kind::Plant,
                });
            }
        }
        Ok(())
    }

    /// Switches on the active lamps of the furniture, in order, and returns their
    /// number.
    fn light_lamps(&mut self, appearance: &SampledAppearance) -> usize {
        let is_lamp = |item: &&mut RenderItem| {
            item.material.family == Some(Family::Lamp) && item.binding == Binding::World
        };
        let lamps: Vec<_> = self.items.iter_mut().filter(is_lamp).collect();
        let count = lamps.len();
        for (number, item) in lamps.into_iter().enumerate() {
            let at = item.body_from_mesh.translation.vector.cast::<f32>();
            if let Some(lamp) = appearance.lamp(number, at.into()) {
                item.material.emission = appearance.lamp_glow();
                self.surrounding.iter_mut().for_each(|s| s.lamps.push(lamp));
            }
        }
        count
    }
}

/// Walls, floors and ceilings: bodies a storey high or flat on the ground. The sun
/// shines through them.
fn is_building(items: &[RenderItem]) -> bool {
    let highest = items
        .iter()
        .flat_map(|item| {
            let up = |p: &[f32; 3]| (item.body_from_mesh * Point3::from(p.map(f64::from))).z;
            item.mesh.positions.iter().map(up)
        })
        .fold(f64::NEG_INFINITY, f64::max);
    !(0.05..BUILDING_HEIGHT).contains(&highest)
}
