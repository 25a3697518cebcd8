//! A service whose graphics adapter compresses images, recorded within one process, as in a
//! worker of a campaign.

use std::path::{Path, PathBuf};
use std::sync::mpsc;
use std::time::Duration;

use tokio::runtime::Runtime;
use tokio::sync::oneshot;
use wheelarm_dataset::compress::Deflate;
use wheelarm_dataset::compress::depth::to_millimetres;
use wheelarm_dataset::read::{Camera, Episode};
use wheelarm_dataset::validate::validate;
use wheelarm_pack::Store;
use wheelarm_proto::keys::Keys;
use wheelarm_proto::settings::{Depth, Named, Pacing, Quality};
use wheelarm_proto::v1;
use wheelarm_recorder::RecordOptions;
use wheelarm_sdk::Client;
use wheelarm_server::sensors::camera::{Graphics, Packing};
use wheelarm_server::service::{self, Options};
use wheelarm_server::sim::{CameraSetting, Scenario, Simulation};
use wheelarm_tests::{IdleCommander, PATIENCE, root, wait_until};

const CAMERA: &str = "gen3";
/// Large enough that the adapter compresses it.
const SIZE: [u32; 2] = [320, 240];
/// Ticks of an episode: ten images.
const TICKS: u64 = 240;

/// Records an episode with depth in the form `depth`; its file.
fn record(depth: Depth, out: &Path) -> PathBuf {
    let camera = CameraSetting {
        name: CAMERA.to_owned(),
        size: SIZE,
        rate_hz: 10.0,
        lens: None,
        place: None,
    };
    let scenario = Scenario {
        seed: 7,
        cameras: vec![camera],
        pacing: Pacing::LockStep,
        quality: Quality::Fast,
        ..Scenario::default()
    };
    let sim = Simulation::new(&root().join("assets"), scenario).expect("a simulation");
    let name = format!("compressed-{}", depth.name());
    let options = Options {
        keys: Keys::new(&name).expect("a name"),
        graphics: Graphics::for_adapter(None).packing(Packing::Adapter),
        no_cameras: false,
        depth,
        access: v1::Access::Local,
        packs: Store::search(&[], &root().join("assets")),
    };
    let runtime = Runtime::new().expect("a runtime");
    let session = service::session::within().expect("a session");
    let (end, ended) = oneshot::channel::<()>();
    let (ready, serves) = mpsc::sync_channel(1);
    let service = runtime.spawn(service::run(
        session.clone(),
        sim,
        options,
        move || ready.send(()).expect("the waiting test"),
        async {
            let _ = ended.await;
        },
    ));
    serves.recv_timeout(PATIENCE).expect("a service");
    let client = Client::within(session, &name).expect("a client");
    let recorder = std::thread::spawn({
        let (client, runtime, out) = (client.clone(), runtime.handle().clone(), out.to_owned());
        move || {
            let options = RecordOptions {
                out,
                scratch: None,
                name: "recorder".to_owned(),
                depth,
                end_with_stdin: false,
                episodes: Some(1),
            };
            let never = std::future::pending();
            runtime.block_on(wheelarm_recorder::run(&client, options, never, |_| {}))
        }
    });
    let idle = IdleCommander::start(&client);
    let request = v1::EpisodeStartRequest {
        label: depth.name().to_owned(),
        require_recorders: 1,
        ..v1::EpisodeStartRequest::default()
    };
    let mut started = None;
    wait_until("the episode starts", || {
        started = client.request(&request).ok();
        started.is_some()
    });
    let started = started.expect("an episode");
    let first = started.header.as_ref().map_or(0, |header| header.tick);
    wait_until("the episode is over", || {
        let status = client.request(&v1::StatusRequest {}).expect("a status");
        status.header.is_some_and(|now| now.tick >= first + TICKS)
    });
    client.stop_episode_of(&started, false).expect("an end");
    let summary = recorder.join().expect("a recorder").expect("recordings");
    drop(idle);
    assert_eq!(summary.exit_code(), 0, "{:?}", summary.failed);
    drop(end);
    let served = runtime.block_on(service).expect("a service");
    served.expect("a service that ends without an error");
    runtime.shutdown_timeout(Duration::from_secs(1));
    out.join(format!("{}.h5", depth.name()))
}

/// Little-endian bytes of depths, m.
fn bytes(metres: &[f32]) -> Vec<u8> {
    metres.iter().flat_map(|m| m.to_le_bytes()).collect()
}

/// Sizes of color and depth of all images, bytes: as stored in the file, and as the CPU
/// compresses them.
fn sizes(file: &Path, depth: Depth, episode: &Episode, camera: &Camera) -> [[usize; 2]; 2] {
    let open = hdf5::File::open(file).expect("a file");
    let stored = |plane: &str| {
        let set = open.dataset(&format!("streams/camera/{CAMERA}/{plane}"));
        set.map_or(0, |set| set.storage_size() as usize)
    };
    let mut out = [Vec::new(), Vec::new()];
    let mut deflate = Deflate::default();
    for i in 0..camera.len() {
        let image = camera.frame(episode, i).expect("an image");
        deflate.append(&image.rgb, 1, &mut out[0]);
        let metres = bytes(&image.depth);
        match depth {
            Depth::Metres => _ = deflate.append(&metres, 4, &mut out[1]),
            Depth::Millimetres => {
                let mut millimetres = Vec::new();
                to_millimetres(&metres, &mut millimetres);
                deflate.append(&millimetres, 2, &mut out[1]);
            }
            Depth::Nothing => {}
        }
    }
    let by_cpu = out.map(|plane| plane.len());
    [["rgb", "depth"].map(stored), by_cpu]
}

#[test]
fn adapter_compression_is_recorded_losslessly_for_every_form_of_depth() {
    let folder = tempfile::tempdir().expect("a folder");
    let files = Depth::ALL.iter().map(|&depth| record(depth, folder.path()));
    let [metres, millimetres, nothing] = &files.collect::<Vec<_>>()[..] else {
        panic!("three forms of depth")
    };
    for file in [metres, millimetres, nothing] {
        let found = validate(file, 1).expect("a readable file");
        assert!(found.problems.is_empty(), "{found:?}");
    }
    let [exact, kept, without] = [metres, millimetres, nothing].map(|file| {
        let episode = Episode::open(file).expect("a recording");
        let camera = episode.camera(CAMERA).expect("a camera");
        (episode, camera)
    });
    for ((file, &depth), (episode, camera)) in [metres, millimetres, nothing]
        .into_iter()
        .zip(Depth::ALL)
        .zip([&exact, &kept, &without])
    {
        let [stored, by_cpu] = sizes(file, depth, episode, camera);
        assert_ne!(stored[0], by_cpu[0], "the adapter compressed no color");
        let made = depth != Depth::Nothing;
        assert_eq!(stored[1] != by_cpu[1], made, "{depth:?} by the adapter");
    }
    let counts = [&exact, &kept, &without].map(|(_, camera)| camera.len());
    assert!(counts.iter().all(|&count| count >= 10), "{counts:?}");
    for i in 0..10 {
        let [exact, kept, without] =
            [&exact, &kept, &without].map(|(e, camera)| camera.frame(e, i).expect("an image"));
        assert_eq!(exact.rgb, kept.rgb);
        assert_eq!(exact.ids, kept.ids);
        assert_eq!((&exact.rgb, &exact.ids), (&without.rgb, &without.ids));
        let mut expected = Vec::new();
        to_millimetres(&bytes(&exact.depth), &mut expected);
        let millimetres = kept.depth.iter().map(|m| (m * 1000.0).round());
        let rounded = expected
            .chunks(2)
            .map(|b| f32::from(u16::from_le_bytes([b[0], b[1]])));
        assert!(
            millimetres
                .zip(rounded)
                .all(|(a, b)| a == b || (a.is_infinite() && b == 0.0))
        );
        assert!(without.depth.is_empty());
    }
}
