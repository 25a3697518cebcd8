//! Scenarios by the rules of sampling: what the server states, and what a recording repeats.

use super::scenario_sampling;
use super::tests::{scenario, simulation};
use super::*;

/// Ticks of a run.
const TICKS: usize = 30;

fn run(scenario: Scenario) -> (Scenario, u64) {
    let mut sim = simulation(scenario);
    for _ in 0..TICKS {
        sim.step(&ControlInput::default());
    }
    (sim.scenario().clone(), sim.world.hash())
}

#[test]
fn scenario_states_the_rules_that_were_used() {
    let drawn = simulation(scenario("pick_mustard")).scenario().clone();
    assert_eq!(drawn.draws, Some(SamplingRules::Ranges));
    // A new scene chooses again, unless the rules were requested.
    let mut again = drawn;
    again.clear_sampled();
    assert_eq!(again.draws, None);
    again.draws = Some(SamplingRules::Maps);
    let mut drawn = simulation(again).scenario().clone();
    drawn.clear_sampled();
    assert_eq!(drawn.draws, Some(SamplingRules::Maps));
    let mut open = Scenario::default();
    let assets = Path::new(env!("CARGO_MANIFEST_DIR")).join("../assets");
    let scene = Scene::load(&assets, "home").expect("the home");
    let rules = scenario_sampling::sampling_rules(&mut open, &scene);
    assert_eq!((rules, open.draws), (SamplingRules::Ranges, Some(rules)));
}

#[test]
fn scenario_sampled_by_the_maps_repeats_bit_by_bit() {
    let by_maps = Scenario {
        starts: Starts::Anywhere,
        draws: Some(SamplingRules::Maps),
        ..scenario("place_knife")
    };
    let (drawn, hash) = run(by_maps.clone());
    assert_eq!(run(by_maps).1, hash, "the seed gives the same bits");
    // As a recording has it: nothing is sampled again, by whichever rules.
    let (again, repeated) = run(drawn.clone());
    assert_eq!((&again, repeated), (&drawn, hash));
    let ranges = Scenario {
        draws: Some(SamplingRules::Ranges),
        ..drawn.clone()
    };
    assert_eq!(run(ranges).1, hash);
    // The rules matter for what is sampled.
    let others = Scenario {
        starts: Starts::Anywhere,
        ..scenario("place_knife")
    };
    assert_ne!(run(others).0.start, drawn.start);
}
