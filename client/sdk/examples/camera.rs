//! Reads pictures of a camera, tells what lies in their middle and saves the
//! last one as a portable pixmap.

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
    let link = Client::open(&Connect::to(endpoint, sim))?;
    // Ids stand for what the scene query lists.
    let scene = link.request(&v1::SceneRequest {})?;
    let pictures = link.camera(camera, 1)?;
    for _ in 0..5 {
        let frame = pictures
            .next(Duration::from_secs(20))?
            .ok_or("no picture came: is the camera in use, and does time go on?")?;
        let (x, y) = (frame.width() / 2, frame.height() / 2);
        let id = frame.id(x, y).ok_or("an empty picture")?;
        let legend = scene.instances.iter().find(|one| one.id == u32::from(id));
        println!(
            "{:.3} s: {} of {:?}, {:.3} m away",
            frame.header.stamp_nanos as f64 * 1e-9,
            legend.map_or("nothing", |one| one.name.as_str()),
            frame.colour(x, y).unwrap_or_default(),
            frame.point(x, y).map_or(f64::INFINITY, |p| p[2]),
        );
        let mut picture = format!("P6 {} {} 255\n", frame.width(), frame.height()).into_bytes();
        picture.extend_from_slice(&frame.rgb);
        std::fs::write(file, picture)?;
    }
    Ok(())
}
