//! Converts a press into a command: held input becomes velocities, or one step. The
//! parent module has already decided whether it may move the robot.

use wheelarm_proto::geometry;
use wheelarm_proto::v1;
use wheelarm_proto::v1::arm_command::Target;

use super::chair_step::ChairStep;
use super::clutch::Engaged;
use super::{Driving, Going, LATCH, Motion, Now, Out, hand};
use crate::phase::Work;
use crate::protocol::{Clutch, Held, Intent, Part};
use crate::speed::Speeds;

impl Motion {
    /// Held input, as velocities.
    pub(super) fn drive(&mut self, intent: &Intent, held: &Held, now: Now<'_>) -> Vec<Out> {
        let latch = intent.mode == v1::InputMode::Latch;
        let before = match self.going {
            Going::Driving(driving) => Some(driving),
            Going::Rest | Going::Stepping(_) => None,
        };
        let since = match before {
            Some(driving) if driving.epoch == intent.epoch => driving.since,
            _ => now.time,
        };
        if latch && now.time - since >= LATCH {
            return self.end(now, true);
        }
        let speeds = Speeds::of(intent.speed);
        let age = self.age(now.newest());
        let base = self.chair.drive(held, &speeds, age);
        let was = before.unwrap_or(Driving {
            epoch: intent.epoch,
            since,
            latch,
            base: matches!(self.going, Going::Stepping(_)),
            arm: false,
        });
        let arm = match held.clutch {
            Some(clutch) => match self.follow(intent.epoch, &clutch, now) {
                Ok(target) => Some(target),
                Err(why) => return self.refuse(intent, "NO_POSE", why, now),
            },
            None => {
                self.clutch = None;
                hand::twist(held, &speeds, age, now.situation)
            }
        };
        let gripper = self.fingers.drive(held, &speeds, now.time, now.situation);
        self.held = *held;
        self.stopped = false;
        self.stops = 0;
        self.going = Going::Driving(Driving {
            epoch: intent.epoch,
            since,
            latch,
            base: base.is_some(),
            arm: arm.is_some(),
        });
        let work = match (&base, &arm) {
            (Some(_), _) => Work::Chair,
            (None, Some(_)) => Work::Arm,
            (None, None) => Work::Gripper,
        };
        let hold = Target::Hold(true);
        let command = v1::Command {
            base: base.or(was.base.then(v1::BaseCommand::default)),
            arm: arm
                .or(was.arm.then_some(hold))
                .map(|target| v1::ArmCommand {
                    target: Some(target),
                }),
            gripper,
            ..v1::Command::default()
        };
        let (shown, seq) = (intent.shown, Some(intent.seq));
        vec![self.command(command, Some(work), shown, seq, now)]
    }

    /// The hand's target while a controller leads it.
    fn follow(
        &mut self,
        epoch: u32,
        clutch: &Clutch,
        now: Now<'_>,
    ) -> Result<Target, &'static str> {
        let unknown = "the hand's pose has not come yet";
        let present = now.situation.base_from_tool.ok_or(unknown)?;
        let mount = now.situation.mount().ok_or(unknown)?;
        let mut engaged = match self.clutch.take() {
            Some(engaged) if engaged.epoch() == epoch => engaged,
            _ => Engaged::new(epoch, present),
        };
        let target = engaged.follow(clutch, &mount, &present);
        self.clutch = Some(engaged);
        Ok(Target::Pose(v1::CartesianTarget {
            frame: v1::CommandFrame::BaseLink.into(),
            pose: Some(geometry::pose(&target)),
        }))
    }

    /// One step of the part, along its axis by the sign.
    pub(super) fn step(
        &mut self,
        intent: &Intent,
        part: Part,
        axis: usize,
        sign: f64,
        now: Now<'_>,
    ) -> Vec<Out> {
        let speeds = Speeds::of(intent.speed);
        let unknown = "the robot's pose has not come yet";
        let mut command = v1::Command::default();
        match part {
            Part::Chair => {
                let [metres, radians] = speeds.step;
                let way = if axis == 0 { metres } else { radians };
                let Some(step) = ChairStep::new(axis == 1, sign * way, now.time, now.situation)
                else {
                    return self.refuse(intent, "NO_POSE", unknown, now);
                };
                self.dead = intent.epoch;
                self.stopped = false;
                self.stops = 0;
                self.going = Going::Stepping(step);
                return self.tick(now);
            }
            Part::Hand | Part::Turn => {
                if let Some(why) = hand::behind(now.situation) {
                    return self.refuse(intent, "AHEAD", why, now);
                }
                let mut along = [0.0; 3];
                along[axis] = sign;
                self.held = Held::default();
                match part {
                    Part::Hand => self.held.hand = along,
                    _ => self.held.turn = along,
                }
                command.arm = Some(v1::ArmCommand {
                    target: Some(hand::step(&self.held, &speeds)),
                });
            }
            Part::Grip => {
                let Some(gripper) = self.fingers.step(sign, &speeds, now.situation) else {
                    return self.refuse(intent, "NO_POSE", unknown, now);
                };
                command.gripper = Some(gripper);
            }
        }
        // One press is one step, however often it is repeated.
        self.dead = intent.epoch;
        self.stopped = false;
        let work = match part {
            Part::Grip => Work::Gripper,
            _ => Work::Arm,
        };
        // The command gate rejects answers to states that are a second old; a step ends by
        // itself, so the gateway answers the newest state instead.
        let fresh = self.age(now.newest()).is_some_and(|age| age < 0.9);
        let shown = intent.shown.filter(|_| fresh);
        vec![self.command(command, Some(work), shown, Some(intent.seq), now)]
    }
}
