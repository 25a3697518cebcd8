//! Milliseconds per image of the models of a wrist camera and a chair camera, by stage:
//! `cargo run --release -p wheelarm-sensor-models --example image_times [WIDTH HEIGHT]`. The
//! image is synthetic: planes, edges and some texture.

use std::time::Instant;

use wheelarm_sensor_models::color::ColorModel;
use wheelarm_sensor_models::depth::DepthModel;
use wheelarm_sensor_models::model::Model;
use wheelarm_sensor_models::noise::Random;
use wheelarm_sensor_models::{Exact, Lens, Surface};

const ROUNDS: u64 = 15;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let sides: Vec<usize> = std::env::args()
        .skip(1)
        .map(|side| side.parse())
        .collect::<Result<_, _>>()?;
    let sizes = match sides[..] {
        [width, height] => vec![[width, height]],
        _ => vec![[640, 360], [1280, 720]],
    };
    let assets = concat!(env!("CARGO_MANIFEST_DIR"), "/../../assets/");
    for [width, height] in sizes {
        let scene = Scene::new(width, height);
        println!("{width}x{height}, median of {ROUNDS} images, ms");
        for name in ["kinova_vision", "chair_stereo"] {
            let file = format!("sensors/{name}.toml");
            let text = std::fs::read_to_string(format!("{assets}{file}"))?;
            let model = Model::read(&file, &text)?;
            if let Some(parameters) = model.color {
                let mut bare = parameters.clone();
                bare.bit_rate = 0.0;
                let mut color = ColorModel::new(parameters, 1, 1.0);
                let whole = median(|tick| color.image(&scene.exact(tick)));
                let mut color = ColorModel::new(bare, 1, 1.0);
                let noise = median(|tick| color.image(&scene.exact(tick)));
                println!("  {name} colour {whole:.2}, without coder {noise:.2}");
            }
            if let Some(parameters) = model.depth {
                let scene = Scene::new(parameters.lens.width, parameters.lens.height);
                let depth = DepthModel::new(parameters, 1, 1.0);
                let surfaces = [Surface::Matte, Surface::Glass, Surface::Chrome];
                let whole = median(|tick| depth.image(&scene.exact(tick), &surfaces));
                println!("  {name} depth {whole:.2}");
            }
        }
    }
    Ok(())
}

/// Median time of an image, ms; prints the sum of the bytes, to compare versions.
#[expect(clippy::disallowed_methods, reason = "a measurement of wall time")]
fn median(mut image: impl FnMut(u64) -> Vec<u8>) -> f64 {
    let mut hash = 0xcbf2_9ce4_8422_2325_u64;
    let mut times: Vec<f64> = (0..ROUNDS)
        .map(|tick| {
            let begin = Instant::now();
            let made = image(tick);
            let taken = begin.elapsed().as_secs_f64() * 1e3;
            for byte in made {
                hash = (hash ^ u64::from(byte)).wrapping_mul(0x0100_0000_01b3);
            }
            taken
        })
        .collect();
    times.sort_by(f64::total_cmp);
    print!("  {hash:016x}");
    times[times.len() / 2]
}

/// A room of boxes in front of a wall.
struct Scene {
    lens: Lens,
    rgb: Vec<u8>,
    depth: Vec<u8>,
    ids: Vec<u8>,
}

impl Scene {
    fn new(width: usize, height: usize) -> Self {
        let mut scene = Self {
            lens: Lens {
                width,
                height,
                focal: [0.9 * width as f64; 2],
                principal: [0.5 * width as f64, 0.5 * height as f64],
            },
            rgb: Vec::new(),
            depth: Vec::new(),
            ids: Vec::new(),
        };
        let mut random = Random::new(7, [0, 0]);
        for y in 0..height {
            for x in 0..width {
                let (u, v) = (40 * x / width, 24 * y / height);
                let boxed = (u / 5 + v / 4).is_multiple_of(3);
                let z = if boxed { 0.7 } else { 2.0 } + 0.5 * y as f32 / height as f32;
                let shade = if boxed { 150 } else { 90 } + (60 * x / width) as u8;
                let texture = if u.is_multiple_of(4) {
                    (random.bits() & 7) as u8
                } else {
                    0
                };
                scene
                    .rgb
                    .extend([shade + texture, shade, shade / 2 + texture]);
                scene.depth.extend(z.to_le_bytes());
                scene.ids.extend(((u / 5 % 3) as u16).to_le_bytes());
            }
        }
        scene
    }

    fn exact(&self, tick: u64) -> Exact<'_> {
        Exact {
            lens: self.lens,
            tick,
            rgb: &self.rgb,
            depth: &self.depth,
            ids: &self.ids,
        }
    }
}
