//! Tests with a scripted server.

use std::net::TcpListener;
use std::sync::mpsc::{Receiver, channel};

use super::array::{at, bytes, floats, read};
use super::*;

const MAP: &str = r#"
rate_hz = 10.0
chunk = 4
execute = 2
action = "next-joints"
prompt = "prompt"
[[pictures]]
key = "observation/image"
camera = "wheelchair"
width = 32
height = 16
pad = [32, 32]
[[numbers]]
key = "observation/joint_position"
places = [0, 1, 2, 3, 4, 5]
[[numbers]]
key = "observation/state"
"#;

fn map() -> NameMap {
    NameMap::read(MAP).unwrap()
}

fn packed(value: &Value) -> Vec<u8> {
    let mut out = Vec::new();
    rmpv::encode::write_value(&mut out, value).unwrap();
    out
}

/// A server that sends the messages of `answers` in turn, with a new connection for each
/// `None`; and the messages that it receives.
fn server(answers: Vec<Option<Message>>) -> (String, Receiver<Value>) {
    let listener = TcpListener::bind("127.0.0.1:0").unwrap();
    let address = format!("ws://{}", listener.local_addr().unwrap());
    let (sender, received) = channel();
    std::thread::spawn(move || {
        let mut answers = answers.into_iter();
        let mut over = false;
        while !over {
            let (stream, _) = listener.accept().unwrap();
            let mut socket = tungstenite::accept(stream).unwrap();
            let metadata = Value::Map(vec![("name".into(), "test".into())]);
            socket.send(Message::binary(packed(&metadata))).unwrap();
            loop {
                let Ok(Message::Binary(request)) = socket.read() else {
                    break;
                };
                sender.send(read(&request).unwrap()).unwrap();
                match answers.next() {
                    Some(Some(answer)) => socket.send(answer).unwrap(),
                    Some(None) => break,
                    None => {
                        over = true;
                        break;
                    }
                }
            }
        }
    });
    (address, received)
}

fn actions(rows: usize, size: usize) -> Message {
    let values: Vec<f32> = (0..rows * size).map(|i| i as f32 / 10.0).collect();
    let mut array = floats(&values);
    if let Value::Map(entries) = &mut array {
        entries[3].1 = Value::Array(vec![(rows as u64).into(), (size as u64).into()]);
    }
    Message::binary(packed(&Value::Map(vec![("actions".into(), array)])))
}

fn observation() -> v1::PolicyObservation {
    v1::PolicyObservation {
        episode_key: "run-7".to_owned(),
        tick: 24,
        instruction: "Take the mug".to_owned(),
        steps: vec![v1::PolicyStep {
            state_values: (0..STATE).map(|i| i as f64).collect(),
            images: vec![v1::PolicyImage {
                camera: "wheelchair".to_owned(),
                width: 32,
                height: 16,
                color: vec![7; 3 * 32 * 16].into(),
                depth: Default::default(),
            }],
        }],
        ..Default::default()
    }
}

const PATIENCE: Duration = Duration::from_secs(5);

#[test]
fn an_observation_goes_out_under_its_names_and_rows_come_back() {
    let (address, received) = server(vec![Some(actions(4, 9))]);
    let policy = OpenPi::connect(&address, map(), PATIENCE, false).unwrap();
    let chunk = policy.infer(observation()).unwrap();
    assert_eq!((chunk.rows, chunk.values.len(), chunk.tick), (4, 36, 24));
    assert_eq!(chunk.values[10], 1.0);
    let request = received.recv().unwrap();
    assert_eq!(
        at(&request, "prompt").unwrap().as_str(),
        Some("Take the mug")
    );
    let joints = at(&request, "observation/joint_position").unwrap();
    let wanted = floats(&[0.0, 1.0, 2.0, 3.0, 4.0, 5.0]);
    assert_eq!(joints, &wanted);
    let image = at(&request, "observation/image").unwrap();
    let mut pixels = vec![0; 3 * 32 * 32];
    pixels[3 * 32 * 8..3 * 32 * 24].fill(7);
    assert_eq!(image, &bytes(&[32, 32, 3], pixels));
    assert_eq!(at(&request, "endpoint"), None);
}

#[test]
fn columns_are_chosen_and_what_is_not_there_is_zero() {
    let text = "columns = [7, 6, 5, 4, 3, 2, 1, -1, -1]\n\
        scale = [1.0, 1.0, 1.0, 1.0, 1.0, 1.0, 2.0, 1.0, 1.0]\nprompt =";
    let text = MAP.replacen("prompt =", text, 1);
    let map = NameMap::read(&text).unwrap();
    let (address, _received) = server(vec![Some(actions(2, 8)), Some(actions(2, 3))]);
    let policy = OpenPi::connect(&address, map, PATIENCE, true).unwrap();
    let chunk = policy.infer(observation()).unwrap();
    assert_eq!(
        chunk.values[..9],
        [0.7, 0.6, 0.5, 0.4, 0.3, 0.2, 0.2, 0.0, 0.0]
    );
    let wrong = policy.infer(observation()).unwrap_err().to_string();
    assert!(wrong.contains("names column 7"), "{wrong}");
}

#[test]
fn roboarena_receives_endpoint_and_session() {
    let map = NameMap::read(&format!("protocol = \"roboarena\"\n{MAP}")).unwrap();
    let array = match actions(2, 9) {
        Message::Binary(bytes) => at(&read(&bytes).unwrap(), "actions").unwrap().clone(),
        _ => unreachable!(),
    };
    // Its servers answer with the array alone.
    let answers = vec![
        Some(Message::text("reset successful")),
        Some(Message::binary(packed(&array))),
    ];
    let (address, received) = server(answers);
    let policy = OpenPi::connect(&address, map, PATIENCE, false).unwrap();
    let reset = v1::PolicyResetRequest {
        episode_key: "run-7".to_owned(),
        ..Default::default()
    };
    policy.reset(reset).unwrap();
    assert_eq!(policy.infer(observation()).unwrap().rows, 2);
    for endpoint in ["reset", "infer"] {
        let request = received.recv().unwrap();
        assert_eq!(at(&request, "endpoint").unwrap().as_str(), Some(endpoint));
        assert_eq!(at(&request, "session_id").unwrap().as_str(), Some("run-7"));
    }
}

#[test]
fn server_errors_are_reported_and_the_next_request_reconnects() {
    let answers = vec![
        Some(Message::text(
            "Traceback\n  line 3\nValueError: it is dark here",
        )),
        Some(actions(4, 9)),
        None,
        Some(actions(4, 9)),
        Some(Message::binary(vec![0x81])),
        Some(Message::binary(packed(&Value::Map(vec![(
            "state".into(),
            1.into(),
        )])))),
    ];
    let (address, _received) = server(answers);
    let policy = OpenPi::connect(&address, map(), PATIENCE, false).unwrap();
    let request = || policy.infer(observation()).map(|chunk| chunk.rows);
    assert_eq!(
        request(),
        Err(PolicyError::Rejected(
            "ValueError: it is dark here".to_owned()
        ))
    );
    assert_eq!(request(), Ok(4));
    // The connection breaks during the request, which is repeated.
    assert_eq!(request(), Ok(4));
    assert!(request().unwrap_err().to_string().contains("not msgpack"));
    let keys = request().unwrap_err().to_string();
    assert!(
        keys.contains("no key \"actions\"; its keys are \"state\""),
        "{keys}"
    );
}

#[test]
fn silent_or_missing_server_is_an_error_with_its_fix() {
    let listener = TcpListener::bind("127.0.0.1:0").unwrap();
    let at = listener.local_addr().unwrap();
    let connect = |address: &str| {
        let policy = OpenPi::connect(address, map(), Duration::from_millis(300), false);
        policy.err().unwrap().to_string()
    };
    // It accepts connections and sends nothing.
    let silent = connect(&format!("ws://{at}"));
    assert!(
        silent.contains("does not reply") || silent.contains("not a WebSocket server"),
        "{silent}"
    );
    drop(listener);
    let gone = connect(&format!("ws://{at}"));
    assert!(gone.contains("is the policy's server running?"), "{gone}");
    assert!(connect("wss://localhost:1").contains("ssh -L"));
    assert!(connect("non sense").contains("ws://HOST:PORT"));
}

#[test]
fn invalid_map_is_rejected_with_its_problem() {
    for (from, to, words) in [
        ("next-joints", "joint", "use next-pose or next-joints"),
        ("[0, 1, 2, 3, 4, 5]", "[27]", "place 27"),
        ("pad = [32, 32]", "pad = [8, 8]", "does not fit"),
        ("prompt", "promt", "promt"),
        ("execute = 2", "execute = 2\ncolumns = [0]", "9 numbers"),
    ] {
        let error = NameMap::read(&MAP.replacen(from, to, 1)).unwrap_err();
        assert!(error.contains(words), "{error}");
    }
    let unfit = NameMap::read(&MAP.replace("rate_hz = 10.0", "rate_hz = 7.0")).unwrap();
    let error = OpenPi::connect("ws://127.0.0.1:9", unfit, PATIENCE, false)
        .err()
        .unwrap();
    assert!(matches!(error, PolicyError::Unfit(_)), "{error}");
}

#[test]
fn arrays_with_a_wrong_size_are_rejected() {
    let lie = |dtype: &str, shape: &[u64], data: usize| {
        let mut array = floats(&vec![0.0; data]);
        if let Value::Map(entries) = &mut array {
            entries[2].1 = dtype.into();
            entries[3].1 = Value::Array(shape.iter().map(|side| (*side).into()).collect());
        }
        rows(&packed(&array), "actions").map(|rows| (rows.count, rows.size))
    };
    assert_eq!(lie("<f4", &[2, 3], 6), Ok((2, 3)));
    assert_eq!(lie("<f8", &[1, 3], 6), Ok((1, 3)));
    for wrong in [
        lie("<f4", &[u64::MAX, u64::MAX], 6),
        lie("<f4", &[1 << 40, 1], 6),
        lie("<f4", &[3, 3], 6),
        lie("|O", &[2, 3], 6),
        lie("<f4", &[1, 2, 3], 6),
    ] {
        assert!(wrong.is_err(), "{wrong:?}");
    }
}
