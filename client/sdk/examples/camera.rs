//! Reads images of a camera, prints the instance at their center and saves the last
//! image as a portable pixmap.

use std::error::Error;
use std::time::Duration;

use wheelarm_proto::v1;
use wheelarm_sdk::{Client, Connect};

fn main() -> Result<(), Box<dyn Error>> {
    let words: Vec<String> = std::env::args().skip(1).collect();
    let [endpoint, sim, camera, file] = words.as_slice() else {
        return Err(
            "give ENDPOINT SIM CAMERA FILE, for example tcp/127.0.0.1:7447 sim gen3 a.ppm".into(),
        );
    };
    let client = Client::open(&Connect::to(endpoint, sim))?;
    // The scene query lists the instance IDs.
    let scene = client.request(&v1::SceneRequest {})?;
    let images = client.camera(camera, 1)?;
    for _ in 0..5 {
        let frame = images
            .next(Duration::from_secs(20))?
            .ok_or("no image arrived: is the camera in use, and does simulation time advance?")?;
        let (x, y) = (frame.width() / 2, frame.height() / 2);
        let id = frame.instance_at(x, y).ok_or("an empty image")?;
        let legend = scene.instances.iter().find(|one| one.id == u32::from(id));
        println!(
            "{:.3} s: {} of {:?}, {:.3} m away",
            frame.header.stamp_nanos as f64 * 1e-9,
            legend.map_or("nothing", |one| one.name.as_str()),
            frame.color_at(x, y).unwrap_or_default(),
            frame.point_at(x, y).map_or(f64::INFINITY, |p| p[2]),
        );
        let mut image = format!("P6 {} {} 255\n", frame.width(), frame.height()).into_bytes();
        image.extend_from_slice(&frame.color);
        std::fs::write(file, image)?;
    }
    Ok(())
}
