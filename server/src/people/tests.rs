//! Tests of sampling, and of every body in every posture.

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};

use super::*;

pub(crate) fn assets() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../assets")
}

#[test]
fn the_seed_samples_every_body_and_given_names_are_used() {
    let any = PersonSetting::default();
    let drawn = (0..300).map(|seed| any.sample(&assets(), seed).expect("a person"));
    let drawn: Vec<SampledPerson> = drawn.collect();
    assert_eq!(drawn[7], any.sample(&assets(), 7).unwrap());
    let all =
        |of: fn(&SampledPerson) -> &String| drawn.iter().map(of).collect::<BTreeSet<_>>().len();
    assert_eq!((all(|d| &d.body), all(|d| &d.posture)), (14, 13));
    assert_eq!((all(|d| &d.skin), all(|d| &d.clothes)), (8, 10));
    let lap = drawn.iter().filter(|d| d.posture == "hands_in_lap").count();
    let right = drawn
        .iter()
        .filter(|d| d.posture == "leaning_right")
        .count();
    assert!(lap > 3 * right, "{lap} {right}");
    let named = PersonSetting {
        body: "man_p95".into(),
        seed: Some(3),
        ..any.clone()
    };
    let first = named.sample(&assets(), 5).unwrap();
    assert_eq!(first.body, "man_p95");
    assert_eq!(first, named.sample(&assets(), 6).unwrap());
    // Given values are used instead of sampled ones.
    let given = PersonSetting {
        drawn: Some(drawn[0].clone()),
        ..any
    };
    assert_eq!(given.sample(&assets(), 99).unwrap(), drawn[0]);
    let wrong = PersonSetting {
        posture: "handstand".into(),
        ..PersonSetting::default()
    };
    let words = wrong.sample(&assets(), 0).unwrap_err().to_string();
    assert!(
        words.contains("handstand") && words.contains("hands_in_lap"),
        "{words}"
    );
}

#[test]
fn the_mesh_is_inside_the_capsules_and_the_head_turns_about_the_neck() {
    let drawn = PersonSetting::default().sample(&assets(), 4).unwrap();
    let person = Person::load(&assets(), drawn).expect("a person");
    let straight = HeadPose::default();
    let turned = HeadPose {
        yaw: 0.6,
        pitch: 0.2,
        roll: -0.1,
        jaw: person.limits.jaw,
    };
    let place = |head: &HeadPose| -> Vec<Point3<f32>> {
        let posed = person
            .mesh
            .posed(0..person.mesh.len(), &person.skeleton, head);
        posed.map(|(at, _)| at).collect()
    };
    let before = place(&straight);
    for head in [straight, turned] {
        for at in place(&head) {
            let at: Point3<f64> = at.cast();
            let gap = person.capsules.iter().map(|capsule| {
                let [a, b] = person.ends(capsule, &head);
                let along = b - a;
                let part = ((at - a).dot(&along) / along.norm_squared()).clamp(0.0, 1.0);
                (at - (a + along * part)).norm() - capsule.radius
            });
            let gap = gap.fold(f64::INFINITY, f64::min);
            let room = if head == straight { 0.001 } else { 0.02 };
            assert!(gap < person.margin + room, "{gap} m outside at {at}");
        }
    }
    let (mut moved, mut still) = (0, 0);
    for (vertex, (a, b)) in before.iter().zip(place(&turned)).enumerate() {
        match person.mesh.moves(vertex, &person.skeleton) {
            true => moved += usize::from((a - b).norm() > 1e-3),
            false => {
                assert_eq!(*a, b);
                still += 1;
            }
        }
    }
    assert!(moved > 300 && still > 1000, "{moved} {still}");
    let mouth = person.mouth(&straight).rotation.inverse() * person.mouth(&turned).rotation;
    assert!((mouth.angle() - 0.63).abs() < 0.05, "{}", mouth.angle());
    let parts: BTreeSet<_> = person.mesh.surfaces.iter().map(|s| s.part).collect();
    assert_eq!(parts.len(), PARTS.len());
}

#[test]
fn the_head_starts_straight_moves_smoothly_in_range_and_the_mouth_opens() {
    let limits = HeadLimits {
        yaw: 0.9,
        up: 0.4,
        down: 0.6,
        roll: 0.4,
        jaw: 0.35,
    };
    let motion = Motion {
        seed: 5,
        strength: 1.0,
        mouth_open: false,
        limits,
    };
    assert_eq!(motion.head_pose(0), HeadPose::default());
    let all: Vec<HeadPose> = (0..240 * 60).map(|tick| motion.head_pose(tick)).collect();
    let most = |of: fn(&HeadPose) -> f64| all.iter().map(of).map(f64::abs).fold(0.0, f64::max);
    assert!(most(|h| h.yaw) > 0.2 && most(|h| h.yaw) < 0.9);
    assert!(most(|h| h.pitch) > 0.05 && most(|h| h.pitch) < 0.4);
    assert!(most(|h| h.jaw) > 0.05 && most(|h| h.jaw) < 0.35);
    for pair in all.windows(2) {
        let step = (pair[1].yaw - pair[0].yaw)
            .abs()
            .max((pair[1].jaw - pair[0].jaw).abs());
        assert!(step * 240.0 < 3.0, "{step}");
    }
    let waits = Motion {
        strength: 0.0,
        mouth_open: true,
        ..motion
    };
    let open = waits.head_pose(1000);
    assert!((open.jaw - 0.28).abs() < 1e-9 && open.yaw == 0.0);
    assert_eq!(waits.head_pose(3000), open);
    assert_eq!(motion.head_pose(777), motion.head_pose(777));
    let other = Motion { seed: 6, ..motion };
    assert_ne!(motion.head_pose(777), other.head_pose(777));
}

/// Lighter skin is overexposed in the sun.
#[test]
fn no_skin_is_lighter_than_measured() {
    let path = format!("{}/looks.toml", folder::FOLDER);
    let appearances: file::AppearancesFile = folder::read(&assets(), &path).unwrap();
    assert!(appearances.skin.len() >= 8);
    for skin in &appearances.skin {
        let channel = |k: usize| {
            let digits = &skin.color[1 + 2 * k..3 + 2 * k];
            let value = f32::from(u8::from_str_radix(digits, 16).unwrap()) / 255.0;
            wheelarm_proto::exact::powf((value + 0.055) / 1.055, 2.4)
        };
        let luminance = 0.2126 * channel(0) + 0.7152 * channel(1) + 0.0722 * channel(2);
        // L* of 68.
        assert!(luminance < 0.38, "{}: {luminance:.2}", skin.name);
    }
}
