//! Conversion of the scenario to a message, and of a message applied over the scenario
//! in force.

use nalgebra::Isometry3;
use wheelarm_homes::own_home::{DEFAULT_STYLE, OwnHomeId};
use wheelarm_proto::check::{self, Invalid};
use wheelarm_proto::geometry::{isometry, pose};
use wheelarm_proto::settings::MAX_SENSOR_STRENGTH;
use wheelarm_proto::settings::{Named, ObjectSplit, Style};
use wheelarm_proto::{defaults, v1};
use wheelarm_sensor_models::model::MAX_STRENGTH;

use crate::appearance::Appearance;
use crate::people::PersonSetting;
use crate::scene::{Placement, Resistance};
use crate::service::{disturbance, language, packs, person};
use crate::sim::{
    ALL_CAMERAS, CameraPlace, CameraSetting, Lens, MAX_SIZE, Quality, Scenario, SensorSetting,
    Starts,
};
use crate::tasks::SamplingRules;

/// A scenario as a message.
pub fn scenario(s: &Scenario) -> v1::Scenario {
    v1::Scenario {
        scene: s.scene.clone(),
        task: Some(s.task.clone()),
        seed: Some(s.seed),
        robot: s.robot.clone(),
        cameras: s
            .cameras
            .iter()
            .map(|c| v1::CameraSetting {
                name: c.name.clone(),
                width: c.size[0],
                height: c.size[1],
                rate_hz: Some(c.rate_hz),
                lens: c.lens.map(|lens| v1::Intrinsics {
                    width: lens.size[0],
                    height: lens.size[1],
                    fx: lens.focal[0],
                    fy: lens.focal[1],
                    cx: lens.principal[0],
                    cy: lens.principal[1],
                }),
                place: c.place.as_ref().map(|place| v1::CameraPlace {
                    frame: place.frame.clone(),
                    pose: Some(pose(&place.pose)),
                }),
            })
            .collect(),
        state_rate_hz: Some(s.state_rate_hz),
        deformable_rate_hz: Some(s.deformable_rate_hz),
        imu_rate_hz: Some(s.imu_rate_hz),
        scan_rate_hz: Some(s.scan_rate_hz),
        pacing: s.pacing.code().into(),
        quality: s.quality.code().into(),
        imu_noise: Some(s.imu_noise),
        objects: s
            .objects
            .iter()
            .map(|(name, p)| v1::ObjectPlacement {
                name: name.clone(),
                pose: Some(pose(&p.pose)),
                mass: Some(p.mass),
                friction: Some(p.friction),
            })
            .collect(),
        slides: s
            .slides
            .iter()
            .map(|(joint, r, position)| v1::SlideResistance {
                joint: joint.clone(),
                friction: Some(r.friction),
                damping: Some(r.damping),
                position: Some(*position),
            })
            .collect(),
        start: s.start.as_ref().map(pose),
        rejected_starts: s.rejected_starts,
        start_in_view: Some(s.start_in_view),
        look_around: Some(s.look_around),
        instruction: Some(s.instruction.clone()),
        language: s.language.as_ref().map(language::to_proto),
        target: Some(s.target.clone()),
        calibration_seed: s.calibration_seed,
        appearance: s.appearance.map(look_to_proto),
        starts: s.starts.code().into(),
        arm_positions: s.arm.map(Vec::from).unwrap_or_default(),
        knuckle: s.knuckle,
        variant: s.variant.clone(),
        variant_share: s.variant_share,
        sensors: s
            .sensors
            .iter()
            .map(|sensor| v1::SensorSetting {
                model: sensor.model.clone(),
                camera: sensor.camera.clone(),
                seed: sensor.seed,
                strength: Some(sensor.strength),
            })
            .collect(),
        disturbances: s.disturbances.as_ref().map(disturbance::to_proto),
        person: s.person.as_ref().map(person::to_proto),
        style: Some(s.style.name().to_owned()),
        time_limit_seconds: s.time_limit,
        packs: packs::refs(&s.pack, &s.object_packs),
        draws: s.draws.map(SamplingRules::number),
        layout_seed: s.layout_seed,
        home_style: s.home_style.clone(),
        object_split: s.object_split.name().to_owned(),
    }
}

/// A checked pose in or around a home; the bits are kept as in `isometry`.
fn place(what: &'static str, p: Option<&v1::Pose>) -> Result<Isometry3<f64>, Invalid> {
    check::place(what, p)?;
    isometry(what, p)
}

/// Model of a setting that switches all sensor models off.
const NO_SENSORS: &str = "none";

/// Converts a requested sensor model.
fn sensor(request: &v1::SensorSetting) -> Result<SensorSetting, Invalid> {
    let strength = request.strength.unwrap_or(1.0);
    Ok(SensorSetting {
        model: request.model.clone(),
        camera: request.camera.clone(),
        seed: request.seed,
        strength: check::within("strength", strength, 0.0, MAX_SENSOR_STRENGTH)
            .map_err(in_entry("sensor", &request.model))?,
    })
}

/// Converts a requested camera.
fn camera(request: &v1::CameraSetting) -> Result<CameraSetting, Invalid> {
    let lens = |lens: &v1::Intrinsics| {
        let size = [lens.width, lens.height];
        let side = f64::from(MAX_SIZE);
        for pixels in size {
            check::within("lens size", f64::from(pixels), 1.0, side)?;
        }
        Ok(Lens {
            size,
            focal: [
                check::within("lens fx", lens.fx, 1.0, 100.0 * side)?,
                check::within("lens fy", lens.fy, 1.0, 100.0 * side)?,
            ],
            principal: [
                check::within("lens cx", lens.cx, -side, 2.0 * side)?,
                check::within("lens cy", lens.cy, -side, 2.0 * side)?,
            ],
        })
    };
    let placed = |place_of: &v1::CameraPlace| {
        check::name("camera place frame", &place_of.frame)?;
        Ok(CameraPlace {
            frame: place_of.frame.clone(),
            pose: place("camera place", place_of.pose.as_ref())?,
        })
    };
    Ok(CameraSetting {
        name: request.name.clone(),
        size: [request.width, request.height],
        rate_hz: request.rate_hz.unwrap_or(defaults::CAMERA_RATE_HZ),
        lens: request.lens.as_ref().map(lens).transpose()?,
        place: request.place.as_ref().map(placed).transpose()?,
    })
}

/// Converts a requested look; `None` when it is off.
fn appearance_from_proto(request: &v1::Appearance) -> Result<Option<Appearance>, Invalid> {
    request.check()?;
    let appearance = Appearance {
        seed: request.seed,
        light: request.light as u8,
        background: request.background as u8,
        materials: request.materials as u8,
        exposure: request.exposure as u8,
        decoration: request.decoration as u8,
        camera: request.camera as u8,
        lens: request.lens as u8,
    };
    Ok((!request.is_off()).then_some(appearance))
}

fn look_to_proto(appearance: Appearance) -> v1::Appearance {
    v1::Appearance {
        seed: appearance.seed,
        light: appearance.light.into(),
        background: appearance.background.into(),
        materials: appearance.materials.into(),
        exposure: appearance.exposure.into(),
        decoration: appearance.decoration.into(),
        camera: appearance.camera.into(),
        lens: appearance.lens.into(),
    }
}

/// The part of an appearance that moves the cameras.
fn moves(appearance: Option<Appearance>) -> Option<(u64, u8, u8)> {
    let appearance =
        appearance.filter(|appearance| appearance.camera > 0 || appearance.lens > 0)?;
    Some((appearance.seed, appearance.camera, appearance.lens))
}

/// Names the list entry of an error.
fn in_entry(what: &'static str, name: &str) -> impl Fn(Invalid) -> Invalid {
    let place = format!("{what} {name:?}");
    move |source| Invalid::In {
        place: place.clone(),
        source: Box::new(source),
    }
}

/// The rules of sampling with a number.
fn sampling_rules(number: u32) -> Result<SamplingRules, Invalid> {
    SamplingRules::from_number(number).ok_or_else(|| Invalid::Word {
        what: "draws",
        value: number.to_string(),
        expected: "1 (ranges of the area) or 2 (floor map and reach map)",
    })
}

/// A required number within bounds.
fn number(what: &'static str, value: Option<f64>, low: f64, high: f64) -> Result<f64, Invalid> {
    check::within(what, value.ok_or(Invalid::Missing(what))?, low, high)
}

/// Replaces `old` if there is a new value.
fn keep<T>(old: &mut T, new: Option<T>) {
    if let Some(new) = new {
        *old = new;
    }
}

/// The own home of a request for `scene` over the scenario in force; `None` for another scene.
fn own_home(
    now: &Scenario,
    scene: &str,
    layout_seed: Option<u64>,
    style: &str,
) -> Result<Option<OwnHomeId>, Invalid> {
    let in_force = now
        .layout_seed
        .map(|seed| OwnHomeId::of_scene(&now.scene, &now.home_style, seed));
    let is_same = in_force
        .as_ref()
        .is_some_and(|home| scene == now.scene || scene == home.plan);
    let kept = in_force.filter(|_| is_same);
    let seed = layout_seed.or(kept.as_ref().map(|home| home.layout_seed));
    let Some(seed) = seed else {
        return match style {
            "" => Ok(None),
            _ => Err(Invalid::Missing("layout_seed, which home_style needs")),
        };
    };
    let (plan, own_style) = match &kept {
        Some(home) => (home.plan.as_str(), home.style.as_str()),
        None => (scene, DEFAULT_STYLE),
    };
    let style = if style.is_empty() { own_style } else { style };
    Ok(Some(OwnHomeId::of_scene(plan, style, seed)))
}

/// Largest number of cameras or sensors, objects and slides in a scenario.
const MOST: [usize; 3] = [16, 256, 256];

/// Checks the lengths of all lists and names of a scenario message.
fn bounded(request: &v1::Scenario) -> Result<(), Invalid> {
    check::few("cameras", &request.cameras, MOST[0])?;
    check::few("sensors", &request.sensors, MOST[0])?;
    check::few("objects", &request.objects, MOST[1])?;
    check::few("slides", &request.slides, MOST[2])?;
    check::instruction(request.instruction())?;
    let given = [
        ("scene name", request.scene.as_str()),
        ("task name", request.task()),
        ("robot name", request.robot.as_str()),
        ("target", request.target()),
    ];
    let given = given.into_iter().chain([("variant", request.variant())]);
    let given = given.chain([("home style", request.home_style.as_str())]);
    for (what, name) in given.filter(|(_, name)| !name.is_empty()) {
        check::name(what, name)?;
    }
    let cameras = request.cameras.iter().map(|c| ("camera name", &c.name));
    let cameras = cameras.filter(|(_, name)| *name != ALL_CAMERAS);
    let objects = request.objects.iter().map(|o| ("object name", &o.name));
    let slides = request.slides.iter().map(|s| ("slide name", &s.joint));
    let sensors = request.sensors.iter().map(|s| ("sensor model", &s.model));
    let on = request.sensors.iter().map(|s| ("sensor camera", &s.camera));
    let on = on.filter(|(_, camera)| !camera.is_empty());
    for (what, name) in cameras
        .chain(objects)
        .chain(slides)
        .chain(sensors)
        .chain(on)
    {
        check::name(what, name)?;
    }
    Ok(())
}

/// Applies a scenario message over the scenario in force: absent fields keep their
/// value. A scene, task, robot or seed in the message, even an unchanged one, resamples
/// every field that is absent.
///
/// # Errors
/// [`Invalid`] that names the field.
pub fn scenario_over(now: &Scenario, request: &v1::Scenario) -> Result<Scenario, Invalid> {
    // Names every field: a new one does not compile until it is applied here.
    let v1::Scenario {
        scene,
        task,
        seed,
        robot,
        cameras,
        state_rate_hz,
        imu_rate_hz,
        scan_rate_hz,
        pacing,
        quality,
        imu_noise,
        objects,
        start,
        instruction,
        target,
        slides,
        deformable_rate_hz,
        calibration_seed,
        language,
        appearance,
        disturbances,
        style,
        person,
        starts,
        arm_positions,
        knuckle,
        variant,
        variant_share,
        sensors,
        time_limit_seconds,
        rejected_starts,
        start_in_view,
        look_around,
        packs: requested_packs,
        draws,
        layout_seed,
        home_style,
        object_split,
    } = request;
    bounded(request)?;
    let mut s = now.clone();
    if *pacing != 0 && *pacing != scenario(now).pacing {
        return Err(Invalid::Word {
            what: "pacing",
            value: pacing.to_string(),
            expected: "the pacing that the server was started with; start another server for another",
        });
    }
    let named = !scene.is_empty() || !robot.is_empty();
    let moves_start =
        Starts::from_proto(request.starts()).is_some_and(|starts| starts != now.starts);
    let changes_variant = variant.is_some() && *variant != now.variant;
    let rules = draws.map(sampling_rules).transpose()?;
    let changes_rules = rules.is_some() && rules != now.draws;
    let split = match object_split.as_str() {
        "" => now.object_split,
        split => ObjectSplit::from_name(split).map_err(|_| Invalid::Word {
            what: "object_split",
            value: check::beginning(split),
            expected: "any, train or held_out",
        })?,
    };
    let resamples = task.is_some()
        || seed.is_some()
        || moves_start
        || changes_variant
        || changes_rules
        || split != now.object_split;
    let of_scene = if scene.is_empty() { &now.scene } else { scene };
    let own_home = own_home(now, of_scene, *layout_seed, home_style)?;
    let of_scene = &match &own_home {
        Some(home) => home.to_string(),
        None => of_scene.clone(),
    };
    let named = named || *of_scene != now.scene;
    let (scene_pack, object_packs) = packs::from_proto(of_scene, requested_packs)?;
    let object_packs = match requested_packs.is_empty() {
        true if *of_scene == now.scene => now.object_packs.clone(),
        _ => object_packs,
    };
    if named || resamples || object_packs != now.object_packs {
        s.clear_sampled();
    }
    if !robot.is_empty() && *robot != now.robot {
        s.cameras = Scenario::all_cameras();
        s.sensors.clear();
    }
    let given = |new: &str| (!new.is_empty()).then(|| new.to_owned());
    s.scene.clone_from(of_scene);
    if !scene.is_empty() || !requested_packs.is_empty() || s.scene != now.scene {
        s.pack = scene_pack;
    }
    (s.layout_seed, s.home_style) = match own_home {
        Some(home) => (Some(home.layout_seed), home.style),
        None => (None, String::new()),
    };
    s.object_packs = object_packs;
    s.object_split = split;
    if s.scene != now.scene && task.is_none() {
        // The task in force belongs to the former scene.
        s.task.clear();
    }
    keep(&mut s.robot, given(robot));
    keep(&mut s.task, task.clone());
    keep(&mut s.seed, *seed);
    keep(&mut s.instruction, instruction.clone());
    if let Some(request) = language {
        s.language = Some(language::from_proto(request)?);
    }
    // Other language settings: the sentence is generated again.
    if language.is_some() && instruction.is_none() {
        s.instruction.clear();
    }
    keep(&mut s.target, target.clone());
    keep(&mut s.variant, variant.clone().map(Some));
    if let Some(share) = *variant_share {
        s.variant_share = Some(check::within("variant_share", share, 0.0, 1.0)?);
    }
    if let Some(request) = disturbances {
        s.disturbances = disturbance::from_proto(request)?;
    }
    if let Some(request) = person {
        s.person = person::from_proto(request)?;
        s.requested.person = s.person.clone().map(|person| PersonSetting {
            drawn: None,
            ..person
        });
    }
    if rules.is_some() {
        s.draws = rules;
        s.requested.open_draws = false;
    }
    s.start_in_view = start_in_view.unwrap_or(s.start_in_view);
    s.look_around = look_around.unwrap_or(s.look_around);
    if let Some(style) = style {
        s.style = Style::from_name(style).map_err(|_| Invalid::Word {
            what: "style",
            value: check::beginning(style),
            expected: "quick or human",
        })?;
    }
    if let Some(limit) = *time_limit_seconds {
        s.time_limit = Some(check::within(
            "time_limit_seconds",
            limit,
            0.0,
            check::MAX_TIME_LIMIT,
        )?);
        s.requested.open_limit = false;
    }
    keep(&mut s.imu_noise, *imu_noise);
    keep(&mut s.state_rate_hz, *state_rate_hz);
    keep(&mut s.deformable_rate_hz, *deformable_rate_hz);
    keep(&mut s.imu_rate_hz, *imu_rate_hz);
    keep(&mut s.scan_rate_hz, *scan_rate_hz);
    let rates = [
        ("state_rate_hz", s.state_rate_hz),
        ("deformable_rate_hz", s.deformable_rate_hz),
        ("imu_rate_hz", s.imu_rate_hz),
        ("scan_rate_hz", s.scan_rate_hz),
    ];
    for (what, rate) in rates {
        check::finite(what, rate)?;
    }
    let requested = match appearance {
        Some(request) => appearance_from_proto(request)?,
        None => now.appearance,
    };
    s.appearance = requested;
    if !cameras.is_empty() {
        s.cameras = cameras.iter().map(camera).collect::<Result<_, Invalid>>()?;
    } else if calibration_seed.is_some() || moves(requested) != moves(now.appearance) {
        // Another specimen or appearance: drop the sampled camera poses of the former one.
        for camera in &mut s.cameras {
            (camera.lens, camera.place) = (None, None);
        }
    }
    s.calibration_seed = calibration_seed.or(s.calibration_seed);
    if !sensors.is_empty() {
        let on = sensors.iter().filter(|s| s.model != NO_SENSORS);
        s.sensors = on.map(sensor).collect::<Result<_, Invalid>>()?;
    }
    match v1::RenderQuality::try_from(*quality) {
        Ok(code) => keep(&mut s.quality, Quality::from_proto(code)),
        Err(_) => {
            return Err(Invalid::Word {
                what: "quality",
                value: quality.to_string(),
                expected: "a value of wheelarm.v1.RenderQuality",
            });
        }
    }
    match v1::Starts::try_from(*starts) {
        Ok(code) => keep(&mut s.starts, Starts::from_proto(code)),
        Err(_) => {
            return Err(Invalid::Word {
                what: "starts",
                value: starts.to_string(),
                expected: "a value of wheelarm.v1.Starts",
            });
        }
    }
    if !arm_positions.is_empty() {
        s.arm = Some(check::list("arm_positions", arm_positions)?);
    }
    if let Some(knuckle) = *knuckle {
        s.knuckle = Some(check::within("knuckle", knuckle, 0.0, 3.2)?);
    }
    if let Some(start) = start {
        s.start = Some(place("start", Some(start))?);
        s.rejected_starts = *rejected_starts;
    }
    let objects = objects
        .iter()
        .map(|o| {
            let placed = || {
                Ok(Placement {
                    pose: place("pose", o.pose.as_ref())?,
                    mass: number("mass", o.mass, 1e-4, 1e3)?,
                    friction: number("friction", o.friction, 0.0, 10.0)?,
                })
            };
            Ok((
                o.name.clone(),
                placed().map_err(in_entry("object", &o.name))?,
            ))
        })
        .collect::<Result<Vec<_>, Invalid>>()?;
    let slides = slides
        .iter()
        .map(|slide| {
            let resistance = || {
                Ok(Resistance {
                    friction: number("friction", slide.friction, 0.0, 1e3)?,
                    damping: number("damping", slide.damping, 0.0, 1e4)?,
                })
            };
            let place = in_entry("slide", &slide.joint);
            let position = || number("position", slide.position.or(Some(0.0)), 0.0, 10.0);
            Ok((
                slide.joint.clone(),
                resistance().map_err(&place)?,
                position().map_err(&place)?,
            ))
        })
        .collect::<Result<Vec<_>, Invalid>>()?;
    keep(&mut s.objects, (!objects.is_empty()).then_some(objects));
    keep(&mut s.slides, (!slides.is_empty()).then_some(slides));
    Ok(s)
}

// Clients check the same limit as the models.
const _: () = assert!(MAX_SENSOR_STRENGTH == MAX_STRENGTH);

#[cfg(test)]
mod tests {
    use super::*;

    fn in_force() -> Scenario {
        let placed = Placement {
            pose: Isometry3::translation(1.0, 2.0, 0.5),
            mass: 0.3,
            friction: 0.6,
        };
        Scenario {
            seed: 7,
            imu_noise: true,
            instruction: "bring it".to_owned(),
            target: "mustard".to_owned(),
            objects: vec![("mustard".to_owned(), placed)],
            start: Some(Isometry3::identity()),
            ..Scenario::default()
        }
    }

    #[test]
    fn fields_absent_in_a_reset_keep_their_value() {
        let now = in_force();
        assert_eq!(
            scenario_over(&now, &v1::Scenario::default()),
            Ok(now.clone())
        );
        assert_eq!(scenario_over(&now, &scenario(&now)), Ok(now.clone()));
        let request = v1::Scenario {
            imu_rate_hz: Some(0.0),
            imu_noise: Some(false),
            ..v1::Scenario::default()
        };
        let got = scenario_over(&now, &request).unwrap();
        assert_eq!((got.imu_rate_hz, got.imu_noise, got.seed), (0.0, false, 7));
        assert_eq!(got.objects, now.objects);
        assert_eq!(got.state_rate_hz, now.state_rate_hz);
    }

    #[test]
    fn rules_of_sampling_are_kept_checked_and_sample_again() {
        let mut now = in_force();
        now.draws = Some(SamplingRules::Ranges);
        now.requested.open_draws = true;
        let request = |draws, seed| v1::Scenario {
            draws,
            seed,
            ..v1::Scenario::default()
        };
        let over = |draws, seed| scenario_over(&now, &request(draws, seed));
        // The ones in force, until the scene is sampled again.
        assert_eq!(over(None, None), Ok(now.clone()));
        assert_eq!(over(None, Some(7)).unwrap().draws, None);
        let kept = over(Some(1), None).unwrap();
        assert_eq!(kept.objects, now.objects);
        let other = over(Some(2), None).unwrap();
        assert_eq!(other.draws, Some(SamplingRules::Maps));
        assert!(other.objects.is_empty() && other.start.is_none());
        // Requested ones stay.
        let again = scenario_over(&other, &request(None, Some(8))).unwrap();
        assert_eq!(again.draws, Some(SamplingRules::Maps));
        let error = over(Some(3), None).unwrap_err().to_string();
        assert!(
            error.contains("draws") && error.contains("1 (ranges"),
            "{error}"
        );
    }

    #[test]
    fn layout_seed_names_an_own_home_and_style_and_plan_stay_in_force() {
        let over = |now: &Scenario, scene: &str, layout_seed, style: &str| {
            let request = v1::Scenario {
                scene: scene.to_owned(),
                layout_seed,
                home_style: style.to_owned(),
                ..v1::Scenario::default()
            };
            scenario_over(now, &request)
        };
        let home = in_force();
        let studio = over(&home, "studio", Some(3), "country").unwrap();
        assert_eq!(studio.scene, "studio-country-3");
        assert_eq!(
            (studio.layout_seed, &*studio.home_style),
            (Some(3), "country")
        );
        assert!(studio.objects.is_empty());
        // The reply is a request for the same home.
        assert_eq!(
            scenario_over(&studio, &scenario(&studio)),
            Ok(studio.clone())
        );
        assert_eq!(
            scenario_over(&home, &scenario(&studio)).unwrap().scene,
            studio.scene
        );
        let other = over(&studio, "", Some(4), "").unwrap();
        assert_eq!(other.scene, "studio-country-4");
        let other = over(&studio, "loft", Some(4), "").unwrap();
        assert_eq!(other.scene, "loft-nordic-4");
        let left = over(&studio, "home", None, "").unwrap();
        assert_eq!((&*left.scene, left.layout_seed), ("home", None));
        let error = over(&home, "", None, "country").unwrap_err().to_string();
        assert!(error.contains("layout_seed"), "{error}");
    }

    #[test]
    fn a_new_seed_resamples_absent_fields() {
        let now = in_force();
        let request = v1::Scenario {
            seed: Some(7),
            target: Some("can".to_owned()),
            ..v1::Scenario::default()
        };
        let got = scenario_over(&now, &request).unwrap();
        assert!(got.objects.is_empty() && got.start.is_none() && got.instruction.is_empty());
        assert_eq!(
            (got.seed, got.target.as_str(), got.imu_noise),
            (7, "can", true)
        );
        let none = v1::Scenario {
            task: Some(String::new()),
            ..v1::Scenario::default()
        };
        assert_eq!(scenario_over(&now, &none).unwrap().task, "");
    }
}
