//! The scenario: as a message, and a message over the one in force.

use nalgebra::Isometry3;
use wheelarm_proto::check::{self, Invalid};
use wheelarm_proto::geometry::{isometry, pose};
use wheelarm_proto::settings::MAX_SENSOR_STRENGTH;
use wheelarm_proto::settings::{Named, Style};
use wheelarm_proto::v1;
use wheelarm_sensors::model::MAX_STRENGTH;

use crate::look::Look;
use crate::people::PersonSetting;
use crate::scene::{Placement, Resistance};
use crate::service::{disturbance, language, person};
use crate::sim::{
    ALL_CAMERAS, CameraPlace, CameraSetting, Lens, MAX_SIZE, Quality, Scenario, SensorSetting,
    Starts,
};

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
        language: s.language.as_ref().map(language::told),
        target: Some(s.target.clone()),
        calibration_seed: s.calibration_seed,
        look: s.look.map(told_look),
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
        disturbances: s.disturbances.as_ref().map(disturbance::told),
        person: s.person.as_ref().map(person::told),
        style: Some(s.style.name().to_owned()),
        time_limit_seconds: s.time_limit,
    }
}

/// A checked place in or about a home; bits are kept as in `isometry`.
fn place(what: &'static str, p: Option<&v1::Pose>) -> Result<Isometry3<f64>, Invalid> {
    check::place(what, p)?;
    isometry(what, p)
}

/// Model of a setting that switches all sensor models off.
const NO_SENSORS: &str = "none";

/// A sensor model that is asked for.
fn sensor(asked: &v1::SensorSetting) -> Result<SensorSetting, Invalid> {
    let strength = asked.strength.unwrap_or(1.0);
    Ok(SensorSetting {
        model: asked.model.clone(),
        camera: asked.camera.clone(),
        seed: asked.seed,
        strength: check::within("strength", strength, 0.0, MAX_SENSOR_STRENGTH)
            .map_err(of("sensor", &asked.model))?,
    })
}

/// A camera that is asked for.
fn camera(asked: &v1::CameraSetting) -> Result<CameraSetting, Invalid> {
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
        name: asked.name.clone(),
        size: [asked.width, asked.height],
        rate_hz: asked.rate_hz.unwrap_or(CAMERA_HZ),
        lens: asked.lens.as_ref().map(lens).transpose()?,
        place: asked.place.as_ref().map(placed).transpose()?,
    })
}

/// A look that is told; one that is off is none.
fn look(asked: &v1::Look) -> Result<Option<Look>, Invalid> {
    asked.check()?;
    let look = Look {
        seed: asked.seed,
        light: asked.light as u8,
        background: asked.background as u8,
        materials: asked.materials as u8,
        exposure: asked.exposure as u8,
        decoration: asked.decoration as u8,
        camera: asked.camera as u8,
        lens: asked.lens as u8,
    };
    Ok((!asked.is_off()).then_some(look))
}

fn told_look(look: Look) -> v1::Look {
    v1::Look {
        seed: look.seed,
        light: look.light.into(),
        background: look.background.into(),
        materials: look.materials.into(),
        exposure: look.exposure.into(),
        decoration: look.decoration.into(),
        camera: look.camera.into(),
        lens: look.lens.into(),
    }
}

/// What of a look moves the cameras.
fn moves(look: Option<Look>) -> Option<(u64, u8, u8)> {
    let look = look.filter(|look| look.camera > 0 || look.lens > 0)?;
    Some((look.seed, look.camera, look.lens))
}

/// Rate of a camera whose rate is not told, Hz.
const CAMERA_HZ: f64 = 10.0;

/// Says of which entry of a list an error is.
fn of(what: &'static str, name: &str) -> impl Fn(Invalid) -> Invalid {
    let place = format!("{what} {name:?}");
    move |source| Invalid::In {
        place: place.clone(),
        source: Box::new(source),
    }
}

/// A number that must be told, within bounds.
fn number(what: &'static str, told: Option<f64>, low: f64, high: f64) -> Result<f64, Invalid> {
    check::within(what, told.ok_or(Invalid::Missing(what))?, low, high)
}

/// Keeps what is new, if anything is.
fn keep<T>(old: &mut T, new: Option<T>) {
    if let Some(new) = new {
        *old = new;
    }
}

/// Most cameras or sensors, objects and slides that a scenario may name.
const MOST: [usize; 3] = [16, 256, 256];

/// Checks the lengths of all that a scenario message names.
fn bounded(asked: &v1::Scenario) -> Result<(), Invalid> {
    check::few("cameras", &asked.cameras, MOST[0])?;
    check::few("sensors", &asked.sensors, MOST[0])?;
    check::few("objects", &asked.objects, MOST[1])?;
    check::few("slides", &asked.slides, MOST[2])?;
    check::instruction(asked.instruction())?;
    let given = [
        ("scene name", asked.scene.as_str()),
        ("task name", asked.task()),
        ("robot name", asked.robot.as_str()),
        ("target", asked.target()),
    ];
    let given = given.into_iter().chain([("variant", asked.variant())]);
    for (what, name) in given.filter(|(_, name)| !name.is_empty()) {
        check::name(what, name)?;
    }
    let cameras = asked.cameras.iter().map(|c| ("camera name", &c.name));
    let cameras = cameras.filter(|(_, name)| *name != ALL_CAMERAS);
    let objects = asked.objects.iter().map(|o| ("object name", &o.name));
    let slides = asked.slides.iter().map(|s| ("slide name", &s.joint));
    let sensors = asked.sensors.iter().map(|s| ("sensor model", &s.model));
    let on = asked.sensors.iter().map(|s| ("sensor camera", &s.camera));
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

/// Applies a scenario message over the scenario in force: what is absent keeps
/// its value. A scene, task, robot or seed that is given, be it the same, draws
/// anew what is not given.
///
/// # Errors
/// [`Invalid`] that names the field.
pub fn scenario_over(now: &Scenario, asked: &v1::Scenario) -> Result<Scenario, Invalid> {
    bounded(asked)?;
    let mut s = now.clone();
    let pacing = scenario(now).pacing;
    if asked.pacing != 0 && asked.pacing != pacing {
        return Err(Invalid::Word {
            what: "pacing",
            value: asked.pacing.to_string(),
            expected: "the pacing that the server was started with; start another server for another",
        });
    }
    let named = !asked.scene.is_empty() || !asked.robot.is_empty();
    let elsewhere = Starts::told(asked.starts()).is_some_and(|starts| starts != now.starts);
    let other = asked.variant.is_some() && asked.variant != now.variant;
    let anew = asked.task.is_some() || asked.seed.is_some() || elsewhere || other;
    if named || anew {
        s.objects.clear();
        s.slides.clear();
        s.start = None;
        s.rejected_starts = 0;
        s.instruction.clear();
        if let Some(language) = &mut s.language {
            language.template.clear();
            language.question.clear();
        }
        s.person.clone_from(&s.asked.person);
        if s.asked.open_limit {
            s.time_limit = Some(0.0);
        }
        s.target.clear();
        s.variant = None;
        s.arm = None;
        s.knuckle = None;
    }
    if !asked.robot.is_empty() && asked.robot != now.robot {
        s.cameras = Scenario::all_cameras();
        s.sensors.clear();
    }
    let given = |new: &str| (!new.is_empty()).then(|| new.to_owned());
    keep(&mut s.scene, given(&asked.scene));
    keep(&mut s.robot, given(&asked.robot));
    keep(&mut s.task, asked.task.clone());
    keep(&mut s.seed, asked.seed);
    keep(&mut s.instruction, asked.instruction.clone());
    if let Some(asked) = &asked.language {
        s.language = Some(language::asked(asked)?);
    }
    // Another way to say it: the sentence is drawn anew.
    if asked.language.is_some() && asked.instruction.is_none() {
        s.instruction.clear();
    }
    keep(&mut s.target, asked.target.clone());
    keep(&mut s.variant, asked.variant.clone().map(Some));
    if let Some(share) = asked.variant_share {
        s.variant_share = Some(check::within("variant_share", share, 0.0, 1.0)?);
    }
    if let Some(asked) = &asked.disturbances {
        s.disturbances = disturbance::asked(asked)?;
    }
    if let Some(asked) = &asked.person {
        s.person = person::asked(asked)?;
        s.asked.person = s.person.clone().map(|person| PersonSetting {
            drawn: None,
            ..person
        });
    }
    s.start_in_view = asked.start_in_view.unwrap_or(s.start_in_view);
    s.look_around = asked.look_around.unwrap_or(s.look_around);
    if let Some(style) = &asked.style {
        s.style = Style::from_name(style).map_err(|_| Invalid::Word {
            what: "style",
            value: check::beginning(style),
            expected: "quick or human",
        })?;
    }
    if let Some(limit) = asked.time_limit_seconds {
        s.time_limit = Some(check::within(
            "time_limit_seconds",
            limit,
            0.0,
            check::MAX_TIME_LIMIT,
        )?);
        s.asked.open_limit = false;
    }
    keep(&mut s.imu_noise, asked.imu_noise);
    keep(&mut s.state_rate_hz, asked.state_rate_hz);
    keep(&mut s.deformable_rate_hz, asked.deformable_rate_hz);
    keep(&mut s.imu_rate_hz, asked.imu_rate_hz);
    let rates = [
        ("state_rate_hz", s.state_rate_hz),
        ("deformable_rate_hz", s.deformable_rate_hz),
        ("imu_rate_hz", s.imu_rate_hz),
    ];
    for (what, rate) in rates {
        check::finite(what, rate)?;
    }
    let seen = match &asked.look {
        Some(asked) => look(asked)?,
        None => now.look,
    };
    s.look = seen;
    if !asked.cameras.is_empty() {
        s.cameras = asked
            .cameras
            .iter()
            .map(camera)
            .collect::<Result<_, Invalid>>()?;
    } else if asked.calibration_seed.is_some() || moves(seen) != moves(now.look) {
        // Another specimen or look: what was drawn for the one before goes.
        for camera in &mut s.cameras {
            (camera.lens, camera.place) = (None, None);
        }
    }
    s.calibration_seed = asked.calibration_seed.or(s.calibration_seed);
    if !asked.sensors.is_empty() {
        let on = asked.sensors.iter().filter(|s| s.model != NO_SENSORS);
        s.sensors = on.map(sensor).collect::<Result<_, Invalid>>()?;
    }
    match v1::RenderQuality::try_from(asked.quality) {
        Ok(code) => keep(&mut s.quality, Quality::told(code)),
        Err(_) => {
            return Err(Invalid::Word {
                what: "quality",
                value: asked.quality.to_string(),
                expected: "a value of wheelarm.v1.RenderQuality",
            });
        }
    }
    match v1::Starts::try_from(asked.starts) {
        Ok(code) => keep(&mut s.starts, Starts::told(code)),
        Err(_) => {
            return Err(Invalid::Word {
                what: "starts",
                value: asked.starts.to_string(),
                expected: "a value of wheelarm.v1.Starts",
            });
        }
    }
    if !asked.arm_positions.is_empty() {
        s.arm = Some(check::list("arm_positions", &asked.arm_positions)?);
    }
    if let Some(knuckle) = asked.knuckle {
        s.knuckle = Some(check::within("knuckle", knuckle, 0.0, 3.2)?);
    }
    if let Some(start) = &asked.start {
        s.start = Some(place("start", Some(start))?);
        s.rejected_starts = asked.rejected_starts;
    }
    let objects = asked
        .objects
        .iter()
        .map(|o| {
            let placed = || {
                Ok(Placement {
                    pose: place("pose", o.pose.as_ref())?,
                    mass: number("mass", o.mass, 1e-4, 1e3)?,
                    friction: number("friction", o.friction, 0.0, 10.0)?,
                })
            };
            Ok((o.name.clone(), placed().map_err(of("object", &o.name))?))
        })
        .collect::<Result<Vec<_>, Invalid>>()?;
    let slides = asked
        .slides
        .iter()
        .map(|slide| {
            let resistance = || {
                Ok(Resistance {
                    friction: number("friction", slide.friction, 0.0, 1e3)?,
                    damping: number("damping", slide.damping, 0.0, 1e4)?,
                })
            };
            let place = of("slide", &slide.joint);
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

// What clients check is what the models take.
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
    fn what_a_reset_does_not_say_stays_as_it_is() {
        let now = in_force();
        assert_eq!(
            scenario_over(&now, &v1::Scenario::default()),
            Ok(now.clone())
        );
        assert_eq!(scenario_over(&now, &scenario(&now)), Ok(now.clone()));
        let asked = v1::Scenario {
            imu_rate_hz: Some(0.0),
            imu_noise: Some(false),
            ..v1::Scenario::default()
        };
        let got = scenario_over(&now, &asked).unwrap();
        assert_eq!((got.imu_rate_hz, got.imu_noise, got.seed), (0.0, false, 7));
        assert_eq!(got.objects, now.objects);
        assert_eq!(got.state_rate_hz, now.state_rate_hz);
    }

    #[test]
    fn a_seed_that_is_given_draws_anew_what_is_not() {
        let now = in_force();
        let asked = v1::Scenario {
            seed: Some(7),
            target: Some("can".to_owned()),
            ..v1::Scenario::default()
        };
        let got = scenario_over(&now, &asked).unwrap();
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
