//! Exports the geometry that the cameras render, as meshes on mocap bodies.

use std::collections::{BTreeMap, BTreeSet};
use std::fmt::Write as _;
use std::path::Path;
use std::sync::Arc;

use anyhow::{Context as _, Result};
use nalgebra::UnitQuaternion;
use wheelarm_server::geometry::{TriMesh, texture};
use wheelarm_server::robot::RobotModel;
use wheelarm_server::scene::Scene;
use wheelarm_server::sensors::camera::{Binding, CameraSpec, RenderItem, RenderScene};

use super::{motion, numbers, place, write_numbers};

/// Side of the shadow map, texels; the same as ours in standard quality.
const SHADOW_SIZE: u32 = 2048;

pub fn export(out: &Path, assets: &Path, pairs: usize) -> Result<()> {
    let robot = RobotModel::load(assets, "wheelarm")?;
    let scene = Scene::load(assets, "home")?;
    let drawn = RenderScene::new(&robot, &scene, assets)?;
    let cameras = CameraSpec::all(&robot, &scene, [1280, 720])?;
    let cameras = &cameras[..2];

    let mut meshes: Vec<Arc<TriMesh>> = Vec::new();
    let mut materials: BTreeMap<String, String> = BTreeMap::new();
    let mut textures = BTreeSet::new();
    let mut bodies: BTreeMap<Binding, String> = BTreeMap::new();
    for item in &drawn.items {
        let mesh = mesh_number(&mut meshes, item);
        if let Some(texture) = &item.material.texture {
            textures.insert(texture.pattern.clone());
        }
        materials
            .entry(item.material.name.clone())
            .or_insert_with(|| material(item));
        writeln!(
            bodies.entry(item.binding).or_default(),
            "<geom type=\"mesh\" mesh=\"m{mesh}\" material=\"{}\" {} contype=\"0\" conaffinity=\"0\"/>",
            item.material.name,
            place(&item.body_from_mesh)
        )?;
    }
    for camera in cameras {
        // MuJoCo's cameras look along -z with y up.
        let turn = UnitQuaternion::from_euler_angles(std::f64::consts::PI, 0.0, 0.0);
        let lens = &camera.intrinsics;
        let fov = 2.0 * (0.5 * f64::from(lens.height) / lens.fy).atan();
        writeln!(
            bodies.entry(camera.binding).or_default(),
            "<camera name=\"{}\" {} fovy=\"{}\"/>",
            camera.name,
            place(&(camera.mount * turn)),
            fov.to_degrees()
        )?;
    }

    let mut xml = head(&drawn);
    for (i, mesh) in meshes.iter().enumerate() {
        std::fs::write(out.join(format!("m{i}.obj")), obj(mesh)?)?;
        writeln!(
            xml,
            "<mesh name=\"m{i}\" file=\"m{i}.obj\" inertia=\"shell\"/>"
        )?;
    }
    for pattern in &textures {
        write_texture(out, assets, pattern)?;
        writeln!(
            xml,
            "<texture name=\"{pattern}\" type=\"2d\" file=\"{pattern}.png\"/>"
        )?;
    }
    for material in materials.values() {
        writeln!(xml, "{material}")?;
    }
    let sun = drawn.lighting.sun_direction;
    writeln!(
        xml,
        "</asset>\n<worldbody>\n<light directional=\"true\" pos=\"{}\" dir=\"{}\" diffuse=\"{}\" specular=\"0.2 0.2 0.2\"/>",
        numbers([-7.5 + 2.0 * sun[0], 2.5 + 2.0 * sun[1], 2.0 * sun[2]]),
        numbers(sun.map(|c| -c)),
        numbers(drawn.lighting.sun.map(|c| (0.3 * c).min(1.0)))
    )?;
    let mut moving = Vec::new();
    for (binding, content) in &bodies {
        if *binding == Binding::World {
            xml.push_str(content);
        } else {
            moving.push(*binding);
            writeln!(xml, "<body mocap=\"true\">\n{content}</body>")?;
        }
    }
    xml.push_str("</worldbody>\n</mujoco>\n");
    std::fs::write(out.join("render.xml"), xml)?;

    let mut poses = Vec::new();
    for pair in 0..pairs {
        let snapshot = motion::moving(&robot, &scene, pair as f64 * 0.1);
        for binding in &moving {
            let pose = match *binding {
                Binding::World => continue,
                Binding::Link(i) => snapshot.links[i].pose,
                Binding::Object(i) => snapshot.objects[i].pose,
                Binding::Sliding(i) => snapshot.sliding[i].pose,
            };
            let q = pose.rotation;
            poses.extend_from_slice(pose.translation.vector.as_slice());
            poses.extend([q.w, q.i, q.j, q.k]);
        }
    }
    write_numbers(&out.join("poses.f64"), &poses)
}

fn head(drawn: &RenderScene) -> String {
    let light = &drawn.lighting;
    format!(
        "<mujoco>\n<statistic extent=\"10\" center=\"-7 3 1\"/>\n<visual>\n\
         <global offwidth=\"1280\" offheight=\"720\"/>\n\
         <quality shadowsize=\"{SHADOW_SIZE}\" offsamples=\"0\"/>\n\
         <map znear=\"0.005\" zfar=\"4\"/>\n\
         <headlight ambient=\"{}\" diffuse=\"0 0 0\" specular=\"0 0 0\"/>\n</visual>\n<asset>\n",
        numbers(light.sky.map(|c| (0.6 * c).min(1.0)))
    )
}

fn mesh_number(meshes: &mut Vec<Arc<TriMesh>>, item: &RenderItem) -> usize {
    let known = meshes.iter().position(|mesh| Arc::ptr_eq(mesh, &item.mesh));
    known.unwrap_or_else(|| {
        meshes.push(item.mesh.clone());
        meshes.len() - 1
    })
}

fn material(item: &RenderItem) -> String {
    let material = &item.material;
    let pattern = material.texture.as_ref().map(|t| t.pattern.as_str());
    let color = if pattern.is_some_and(texture::is_label) {
        [1.0; 3]
    } else {
        material.color
    };
    let texture = pattern
        .map(|name| format!("texture=\"{name}\""))
        .unwrap_or_default();
    format!(
        "<material name=\"{}\" {texture} rgba=\"{} 1\" specular=\"0.2\" shininess=\"{}\" emission=\"{}\"/>",
        material.name,
        numbers(color),
        1.0 - material.roughness,
        material.emission
    )
}

fn obj(mesh: &TriMesh) -> Result<String> {
    let mut text = String::new();
    for p in &mesh.positions {
        writeln!(text, "v {}", numbers(p))?;
    }
    for uv in &mesh.uvs {
        writeln!(text, "vt {}", numbers(uv))?;
    }
    for n in &mesh.normals {
        writeln!(text, "vn {}", numbers(n))?;
    }
    for t in mesh.indices.chunks_exact(3) {
        let [a, b, c] = [t[0] + 1, t[1] + 1, t[2] + 1];
        writeln!(text, "f {a}/{a}/{a} {b}/{b}/{b} {c}/{c}/{c}")?;
    }
    Ok(text)
}

/// PNG rows run from the top, texture rows from the bottom.
fn write_texture(out: &Path, assets: &Path, pattern: &str) -> Result<()> {
    let image = texture::load(assets, pattern)?;
    let largest = image.levels().next().context("the image has no level")?;
    let rgb: Vec<u8> = largest
        .chunks_exact(4 * texture::SIZE)
        .rev()
        .flat_map(|row| row.chunks_exact(4))
        .flat_map(|pixel| [pixel[0], pixel[1], pixel[2]])
        .collect();
    let file = std::fs::File::create(out.join(format!("{pattern}.png")))?;
    let side = texture::SIZE as u32;
    let mut encoder = png::Encoder::new(file, side, side);
    encoder.set_color(png::ColorType::Rgb);
    encoder.write_header()?.write_image_data(&rgb)?;
    Ok(())
}
