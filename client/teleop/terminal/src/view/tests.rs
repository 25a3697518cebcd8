//! The rendered text at several sizes of the terminal.

use ratatui::Terminal;
use ratatui::backend::TestBackend;
use wheelarm_proto::v1;

use super::*;
use crate::described::robot as described_robot;
use crate::model::{Control, Settings};
use wheelarm_teleop_web::watch::Connection;

fn model() -> Model {
    let mut model = Model::new(Settings {
        commander: "anna".to_owned(),
        target_hint: true,
        ..Settings::default()
    });
    model.page = "http://127.0.0.1:7450".to_owned();
    model.situation.connection = Connection::Open;
    model.control = Control::Ours;
    let condition = |name: &str, holds, required| v1::Condition {
        predicate: String::new(),
        name: name.to_owned(),
        holds,
        required,
        value: 0.25,
    };
    let status = v1::Status {
        scenario: Some(v1::Scenario {
            scene: "home".to_owned(),
            task: Some("pick_mustard".to_owned()),
            seed: Some(3),
            instruction: Some("Pick up the mustard".to_owned()),
            ..Default::default()
        }),
        recorders: vec![v1::RecorderStatus {
            recorder: "first".to_owned(),
            state: v1::RecorderState::Ready.into(),
            missed: 7,
            ..Default::default()
        }],
        evaluation: Some(v1::Evaluation {
            conditions: vec![
                condition("lifted_and_held(mustard)", false, true),
                condition("chair_stopped", true, true),
            ],
            ..Default::default()
        }),
        real_time_factor: 1.0,
        ..Default::default()
    };
    model.situation.take_status(status, 0.0123, 0.0);
    model.robot(&described_robot());
    model
}

fn screen(model: &Model, width: u16, height: u16) -> String {
    let mut terminal = Terminal::new(TestBackend::new(width, height)).unwrap();
    let theme = Theme { colours: true };
    terminal
        .draw(|frame| draw(frame, model, theme, 10.0))
        .unwrap();
    let buffer = terminal.backend().buffer().clone();
    let rows = buffer.content().chunks(usize::from(width));
    rows.map(|row| row.iter().map(|cell| cell.symbol()).collect::<String>() + "\n")
        .collect()
}

#[test]
fn a_wide_terminal_shows_keys_state_and_the_address_of_the_page() {
    let text = screen(&model(), 120, 36);
    for words in [
        "control is yours",
        "http://127.0.0.1:7450",
        "pick_mustard, seed 3",
        "NO  lifted_and_held(mustard)",
        "yes chair_stopped",
        "7 missed",
        "12.3 ms",
        "forward",
        "start episode",
    ] {
        assert!(text.contains(words), "{words:?} is missing:\n{text}");
    }
}

#[test]
fn discarded_episode_is_not_shown_as_a_partial_file() {
    let mut model = model();
    let recorder = |path: &str| v1::RecorderStatus {
        state: v1::RecorderState::Finished.into(),
        path: path.to_owned(),
        ..v1::RecorderStatus::default()
    };
    let mut shown = |path| {
        if let Some(status) = &mut model.situation.status {
            status.recorders = vec![recorder(path)];
        }
        screen(&model, 120, 36)
    };
    let text = shown("");
    assert!(
        text.contains("discarded") && !text.contains("PARTIAL"),
        "{text}"
    );
    assert!(shown("a.h5").contains("PARTIAL"));
}

#[test]
fn a_narrow_terminal_keeps_the_essential_lines() {
    let text = screen(&model(), 60, 24);
    for words in ["control is yours", "lifted_and_held", "7 missed", "chair"] {
        assert!(text.contains(words), "{words:?} is missing:\n{text}");
    }
}

#[test]
fn no_size_of_the_terminal_makes_it_panic() {
    let mut model = model();
    for (width, height) in [(1, 1), (5, 3), (20, 50), (300, 2), (95, 10), (96, 10)] {
        for help in [false, true] {
            model.help = help;
            screen(&model, width, height);
        }
        model.form = Some(crate::form::Form::start("a", "b", 1));
        screen(&model, width, height);
        model.form = None;
    }
}

#[test]
fn a_failed_recorder_a_lost_task_and_a_refused_start_are_prominent() {
    let mut model = model();
    model.situation.refused("nothing can be recorded", 7.0);
    let mut status = model.situation.status.clone().unwrap();
    let header = Some(v1::Header {
        run_id: "run".to_owned(),
        episode: 1,
        ..Default::default()
    });
    status.episode = Some(v1::EpisodeStarted {
        header: header.clone(),
        ..Default::default()
    });
    status.recorders[0].header = header;
    status.recorders[0].state = v1::RecorderState::Failed.into();
    status.recorders[0].message = "no disk".to_owned();
    model.situation.take_status(status, 0.01, 8.0);
    model.situation.evaluation = Some(v1::Evaluation {
        failure: "dropped".to_owned(),
        ..Default::default()
    });
    for (width, height) in [(120, 36), (60, 24)] {
        let text = screen(&model, width, height);
        for words in [
            "nothing can be recorded",
            "THE TASK IS LOST",
            "NOTHING IS RECORDED",
        ] {
            assert!(text.contains(words), "{words:?} is missing:\n{text}");
        }
    }
}

#[test]
fn a_lost_connection_is_prominent() {
    let mut model = model();
    model.lost("the server has gone", 7.0);
    let text = screen(&model, 120, 36);
    assert!(text.contains("LINK LOST 3 s ago"), "{text}");
}
