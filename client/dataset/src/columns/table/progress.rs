//! Progress of simulation and task: the clock and the hash of the state, the
//! conditions and the phase of the work.

use wheelarm_proto::v1;

use crate::columns::codec::{derived_text, f64s, flag, flags, number, text, u64s, words};
use crate::columns::values as take;
use crate::columns::{Axis, Codec, Context, Table, TextCodec};

pub(super) static CLOCK: Table<v1::Clock> = Table {
    columns: &[f64s(
        "real_time_factor",
        "1 (simulated seconds per wall second)",
        "",
        &[],
        number!(real_time_factor),
    )],
};

// What a condition lacks in a sample is stored as not held and not a number. Its
// predicate begins its name, as the contract has it.
pub(super) static EVALUATION: Table<v1::Evaluation> = Table {
    columns: &[
        flags("success", &[], flag!(success)),
        flags("done", &[], flag!(done)),
        text("failure", words!(failure)),
        text(
            "failure_code",
            TextCodec {
                take: |m| m.failure_reason().word(),
                put: |m, text| {
                    m.set_failure_reason(v1::FailureReason::from_word(&text));
                    Ok(())
                },
            },
        ),
        f64s("elapsed", "s", "", &[], number!(elapsed_seconds)),
        flags(
            "condition_holds",
            &[Axis::Conditions],
            Codec {
                take: |m, c, o| {
                    let holds = |n: &String| u8::from(condition(m, n).is_some_and(|c| c.holds));
                    o.extend(c.conditions.iter().map(holds));
                },
                put: |m, c, v| to_conditions(m, c, v, |condition, v| condition.holds = v != 0),
            },
        ),
        f64s(
            "condition_value",
            "SI unit of the condition's threshold",
            "",
            &[Axis::Conditions],
            Codec {
                take: |m, c, o| {
                    let value = |n: &String| condition(m, n).map_or(f64::NAN, |c| c.value);
                    o.extend(c.conditions.iter().map(value));
                },
                put: |m, c, v| to_conditions(m, c, v, |condition, v| condition.value = v),
            },
        ),
        flags(
            "condition_required",
            &[Axis::Conditions],
            Codec {
                take: |m, c, o| {
                    let required =
                        |n: &String| u8::from(condition(m, n).is_some_and(|c| c.required));
                    o.extend(c.conditions.iter().map(required));
                },
                put: |m, c, v| to_conditions(m, c, v, |condition, v| condition.required = v != 0),
            },
        ),
    ],
};

fn condition<'a>(m: &'a v1::Evaluation, name: &str) -> Option<&'a v1::Condition> {
    m.conditions.iter().find(|c| c.name == name)
}

/// Gives every condition of the task its value; the first of their columns
/// brings them in.
fn to_conditions<T: Copy>(
    m: &mut v1::Evaluation,
    context: &Context,
    values: &[T],
    put: impl Fn(&mut v1::Condition, T),
) {
    let known = m.conditions.len();
    let new = context.conditions.iter().skip(known);
    m.conditions.extend(new.map(|name| v1::Condition {
        name: name.clone(),
        predicate: name.split('(').next().unwrap_or_default().to_owned(),
        ..v1::Condition::default()
    }));
    let conditions = m.conditions.iter_mut();
    conditions.zip(values).for_each(|(c, &v)| put(c, v));
}

pub(super) static PHASE: Table<v1::PhaseSample> = Table {
    columns: &[
        u64s(
            "label",
            "1 (0 none, 1 navigating, 2 reaching, 3 grasping, 4 retracting)",
            Codec {
                take: |m, _, o| o.push(u64::try_from(m.phase).unwrap_or(0)),
                put: |m, _, v| {
                    let label = v.first().copied().unwrap_or_default();
                    m.phase = i32::try_from(label).unwrap_or_default();
                },
            },
        ),
        text(
            "phase",
            derived_text(|m: &v1::PhaseSample| take::phase(m.phase)),
        ),
        text("name", words!(name)),
    ],
};

pub(super) static STATE_HASH: Table<v1::StateHash> = Table {
    columns: &[u64s(
        "hash",
        "1 (64-bit hash of the whole state)",
        number!(hash),
    )],
};
