//! Users who are removed or get another role while server and router run.

use std::time::Duration;

use wheelarm_access::Role;
use wheelarm_proto::{Query, v1};
use wheelarm_sdk::{Client, ClientError, Connect};
use wheelarm_tests::{PATIENCE, Router, Server, printed, wait_until};

use super::lab::{Keys, SIM, drive_until_moving, gets_through, status};

/// Timeout of a connection that must be refused, s.
const REFUSAL_TIMEOUT: f64 = 0.5;

/// Waits until the chair is at rest in the odometry of `client`.
fn wait_until_at_rest(client: &Client) {
    let poses = client.samples::<v1::Odometry>().expect("odometry");
    wait_until("the chair rests", || {
        let odometry = poses.next(PATIENCE).expect("odometry").expect("in time");
        let twist = odometry.twist.unwrap_or_default();
        twist.linear.unwrap_or_default().x.abs() < 0.01
    });
}

#[test]
fn removed_or_demoted_user_loses_connection_and_control_while_servers_run() {
    let keys = Keys::new();
    let router = Router::start_with_keys(keys.path());
    let args = [
        "--keys",
        keys.path(),
        "--connect",
        &router.endpoint,
        "--no-cameras",
    ];
    let server = Server::start_at("tls/127.0.0.1:0", SIM, &args).expect("a server");
    let connect = |endpoint: &str, user: &str, timeout_secs| Connect {
        endpoint: endpoint.to_owned(),
        sim: SIM.to_owned(),
        timeout_secs,
        identity: Some(keys.of(user)),
    };
    let open = |endpoint: &str, user: &str| {
        let connect = connect(endpoint, user, PATIENCE.as_secs_f64());
        Client::open(&connect).unwrap_or_else(|e| panic!("{user}: {e}"))
    };
    let veit = open(&server.endpoint, "veit");
    let holder = || status(&veit).holder;

    // Another role, with a direct connection to the server.
    let bert = open(&server.endpoint, "bert");
    let mut commander = bert.commander("bert", false).expect("control");
    drive_until_moving(&mut commander, &bert, &veit);
    keys.set_role("bert", Role::Viewer);
    wait_until("bert has no control", || holder().is_empty());
    wait_until_at_rest(&veit);
    // The client reconnects by itself, with the rights of a viewer.
    assert!(gets_through(&bert, &bert.keys().query(Query::Status), true));
    let lease = bert.keys().query(Query::Lease).replace('*', "bert");
    assert!(!gets_through(&bert, &lease, false));
    drop(commander);

    // Removal, with a connection through the router.
    let anna = open(&router.endpoint, "anna");
    let mut commander = anna.commander("anna", false).expect("control");
    drive_until_moving(&mut commander, &anna, &veit);
    let bundle = connect(&router.endpoint, "anna", REFUSAL_TIMEOUT);
    let kept = keys.place.join("kept");
    copy_keys(&bundle, &kept);
    let output = std::process::Command::new(wheelarm_tests::program("wheelarm").expect("a client"))
        .args(["--keys", keys.path(), "users", "remove", "anna"])
        .output()
        .expect("a client");
    assert!(output.status.success(), "{}", printed(&output));
    wait_until("anna has no control", || holder().is_empty());
    wait_until_at_rest(&veit);
    // A copy of her keys opens no connection.
    let identity = wheelarm_proto::bundle::Identity::find(&kept, None).expect("files");
    let error = Client::open(&Connect {
        identity: Some(identity),
        ..bundle
    });
    let error = error.err().expect("an error");
    assert!(matches!(error, ClientError::NoRights { .. }), "{error}");
    // Other clients are not disturbed.
    let clock = veit.samples::<v1::Clock>().expect("the clock");
    assert!(
        clock
            .next(Duration::from_secs(5))
            .expect("a clock")
            .is_some()
    );
    drop(commander);
}

/// Copies the key files of a connection into a folder.
fn copy_keys(connect: &Connect, folder: &std::path::Path) {
    let identity = connect.identity.as_ref().expect("keys");
    std::fs::create_dir_all(folder).expect("a folder");
    for (from, name) in [
        (&identity.authority, "ca.pem"),
        (&identity.certificate, "user.pem"),
        (&identity.key, "user.key"),
    ] {
        std::fs::copy(from, folder.join(name)).expect("a copy");
    }
}
