//! Tests of the rule table with the check of the transport: does a key of a grant
//! include the key of the message?

use zenoh::key_expr::keyexpr;

use super::*;

fn user(name: &str, role: Role) -> User {
    User::new(name, role).unwrap()
}

/// Whether `user` may.
fn may(user: &User, sim: &str, flow: Flow, kind: Kind, key: &str) -> bool {
    let key = keyexpr::new(key).unwrap();
    grants(user, sim)
        .iter()
        .filter(|grant| grant.flow == flow && grant.kinds.contains(&kind))
        .flat_map(|grant| &grant.keys)
        .any(|allowed| keyexpr::new(allowed.as_str()).unwrap().includes(key))
}

/// A row: direction, kind, key below the server's, and the allowed users: viewer,
/// operator, operator with images, recorder, admin.
type Row = (Flow, Kind, &'static str, &'static str);

use Flow::{Egress as Out, Ingress as In};

/// Every user has the name `me`. `v`, `o`, `p`, `r`, `a` are allowed.
const ROWS: &[Row] = &[
    // Sending.
    (In, Kind::Put, "command/me", "opa"),
    (In, Kind::Put, "command/you", "a"),
    (In, Kind::Put, "command/*", "a"),
    (In, Kind::Put, "recorder/me", "ra"),
    (In, Kind::Put, "recorder/you", "a"),
    (In, Kind::Put, "*", ""),
    (In, Kind::Put, "**", ""),
    (In, Kind::Put, "*/me", ""),
    (In, Kind::Put, "stream/imu", ""),
    (In, Kind::Put, "stream/imu/@adv/pub/a/1/uhlc", ""),
    (In, Kind::Put, "camera/gen3", ""),
    (In, Kind::Put, "sensor/depth", ""),
    (In, Kind::Put, "preview/gen3/low", ""),
    (In, Kind::Put, "episode/start", ""),
    (In, Kind::Put, "episode/stop", ""),
    (In, Kind::Put, "refusal", ""),
    (In, Kind::Delete, "stream/imu", ""),
    (In, Kind::Delete, "command/me", ""),
    // Replying in place of the server.
    (In, Kind::DeclareQueryable, "query/status", ""),
    (In, Kind::Reply, "query/status", ""),
    (In, Kind::Reply, "stream/imu", ""),
    (
        In,
        Kind::DeclareQueryable,
        "stream/imu/@adv/pub/a/1/uhlc",
        "",
    ),
    (In, Kind::LivelinessToken, "alive/00ff", ""),
    (
        In,
        Kind::LivelinessToken,
        "stream/imu/@adv/pub/a/1/uhlc",
        "",
    ),
    // Queries.
    (In, Kind::Query, "query/status", "vopra"),
    (Out, Kind::Reply, "query/status", "vopra"),
    (In, Kind::Query, "query/scene", "vopra"),
    (In, Kind::Query, "query/map", "vopra"),
    (In, Kind::Query, "query/tasks", "vopra"),
    (In, Kind::Query, "query/packs", "vopra"),
    (In, Kind::Query, "query/pack_put", "a"),
    (In, Kind::Query, "query/snapshot", "ra"),
    (In, Kind::Query, "query/episode", "ra"),
    (In, Kind::Query, "query/sensors", "pa"),
    (In, Kind::Query, "query/lease/me", "opa"),
    (Out, Kind::Reply, "query/lease/me", "opa"),
    (In, Kind::Query, "query/lease/you", "a"),
    (In, Kind::Query, "query/lease/*", "a"),
    (In, Kind::Query, "query/reach", "opa"),
    (In, Kind::Query, "query/pick", "opa"),
    (In, Kind::Query, "query/reset", "opa"),
    (In, Kind::Query, "query/pause", "opa"),
    (In, Kind::Query, "query/resume", "opa"),
    (In, Kind::Query, "query/episode_start", "opa"),
    (In, Kind::Query, "query/episode_stop", "opa"),
    (In, Kind::Query, "query/playback", "a"),
    (In, Kind::Query, "query/shutdown", "a"),
    (In, Kind::Query, "query/*", "a"),
    (In, Kind::Query, "query/**", "a"),
    // Liveliness tokens.
    (In, Kind::LivelinessToken, "commander/me/1/alive", "opa"),
    (In, Kind::LivelinessToken, "commander/you/1/alive", "a"),
    (In, Kind::LivelinessToken, "recorder/me/alive", "ra"),
    (In, Kind::LivelinessToken, "recorder/you/alive", "a"),
    (In, Kind::LivelinessQuery, "alive/*", "vopra"),
    (In, Kind::DeclareLivelinessSubscriber, "alive/*", "vopra"),
    (Out, Kind::LivelinessToken, "alive/00ff", "vopra"),
    (In, Kind::LivelinessQuery, "recorder/me/alive", "ra"),
    (In, Kind::LivelinessQuery, "commander/*/*/alive", "a"),
    (Out, Kind::LivelinessToken, "commander/you/1/alive", "a"),
    // Subscriptions.
    (In, Kind::DeclareSubscriber, "stream/imu", "vopra"),
    (In, Kind::DeclareSubscriber, "stream/*", "vopra"),
    (Out, Kind::Put, "stream/imu", "vopra"),
    (In, Kind::DeclareSubscriber, "episode/start", "vopra"),
    (In, Kind::DeclareSubscriber, "refusal", "vopra"),
    (In, Kind::DeclareSubscriber, "preview/gen3/low", "vopra"),
    (In, Kind::DeclareSubscriber, "preview/gen3/high", "vopra"),
    (In, Kind::DeclareSubscriber, "preview/gen3/flat", "a"),
    (In, Kind::DeclareSubscriber, "preview/gen3/*", "a"),
    (In, Kind::DeclareSubscriber, "camera/gen3", "pra"),
    (In, Kind::DeclareSubscriber, "camera/*", "pra"),
    (Out, Kind::Put, "camera/gen3", "pra"),
    (In, Kind::DeclareSubscriber, "compressed/*", "pra"),
    (Out, Kind::Put, "compressed/gen3", "pra"),
    (In, Kind::DeclareSubscriber, "sensor/depth", "pra"),
    (In, Kind::DeclareSubscriber, "command/*", "a"),
    (Out, Kind::Put, "command/me", "a"),
    (In, Kind::DeclareSubscriber, "recorder/*", "a"),
    (In, Kind::DeclareSubscriber, "**", "a"),
    // Publishers' caches of late or missed samples.
    (In, Kind::Query, "stream/imu/@adv/pub/a/1/uhlc", "vopra"),
    (In, Kind::Query, "stream/*/@adv/**", "vopra"),
    (Out, Kind::Reply, "stream/imu", "vopra"),
    (Out, Kind::Reply, "stream/imu/@adv/pub/a/1/uhlc", "vopra"),
    (Out, Kind::Put, "stream/imu/@adv/pub/a/1/uhlc", "vopra"),
    (In, Kind::DeclareSubscriber, "stream/*/@adv/**", "vopra"),
    (
        In,
        Kind::DeclareLivelinessSubscriber,
        "stream/*/@adv/pub/**",
        "vopra",
    ),
    (
        Out,
        Kind::LivelinessToken,
        "stream/imu/@adv/pub/a/1/uhlc",
        "vopra",
    ),
    (In, Kind::Query, "camera/gen3/@adv/pub/a/1/uhlc", "pra"),
    (
        In,
        Kind::DeclareLivelinessSubscriber,
        "camera/*/@adv/pub/**",
        "pra",
    ),
    // The transport sends nothing without known subscribers.
    (Out, Kind::DeclareSubscriber, "command/*", "vopra"),
    (Out, Kind::DeclareQueryable, "query/status", "vopra"),
];

fn everybody() -> Vec<(char, User)> {
    let mut with_images = user("me", Role::Operator);
    with_images.images = true;
    vec![
        ('v', user("me", Role::Viewer)),
        ('o', user("me", Role::Operator)),
        ('p', with_images),
        ('r', user("me", Role::Recorder)),
        ('a', user("me", Role::Admin)),
    ]
}

#[test]
fn each_role_has_exactly_the_rights_of_the_table() {
    for (flow, kind, rest, who) in ROWS {
        for (letter, user) in everybody() {
            // The rules of a server, and those of a router for several.
            for (sim, key) in [("lab", "lab"), ("*", "lab")] {
                let key = format!("wheelarm/{key}/{rest}");
                let found = may(&user, sim, *flow, *kind, &key);
                let wanted = who.contains(letter);
                assert_eq!(
                    found, wanted,
                    "{letter}: {flow:?} {kind:?} {key} (rules of {sim})"
                );
            }
        }
    }
}

#[test]
fn no_user_has_rights_on_another_server_or_outside() {
    for (flow, kind, rest, _) in ROWS.iter().filter(|row| !row.2.starts_with("alive")) {
        for (letter, user) in everybody() {
            for key in [
                format!("wheelarm/other/{rest}"),
                format!("other/lab/{rest}"),
            ] {
                assert!(
                    !may(&user, "lab", *flow, *kind, &key),
                    "{letter}: {kind:?} {key}"
                );
            }
        }
    }
    for (letter, user) in everybody() {
        for key in [
            "**",
            "*",
            "wheelarm/**",
            "wheelarm/*",
            "wheelarm/*/command/me",
            "@/**",
        ] {
            for kind in Kind::ALL {
                assert!(
                    !may(&user, "lab", In, kind, key),
                    "{letter}: {kind:?} {key}"
                );
            }
        }
    }
}

#[test]
fn every_kind_of_key_of_the_contract_is_in_the_table() {
    use wheelarm_proto::Query;
    use wheelarm_proto::topic::TOPICS;
    let admin = user("me", Role::Admin);
    let rows = |wanted: &str| ROWS.iter().any(|row| row.2 == wanted);
    for query in Query::ALL {
        let name = match query.has_identity() {
            true => format!("query/{}/me", query.name()),
            false => format!("query/{}", query.name()),
        };
        assert!(rows(&name), "no row for {name}");
    }
    // Each topic is available to some role, and to the admin always.
    for topic in TOPICS {
        let key: Vec<&str> = topic
            .key
            .split('/')
            .map(|chunk| if chunk.starts_with('{') { "me" } else { chunk })
            .collect();
        let key = format!("wheelarm/lab/{}", key.join("/"));
        assert!(
            may(&admin, "lab", In, Kind::DeclareSubscriber, &key),
            "{key}"
        );
    }
}

#[test]
fn servers_have_all_rights_of_this_system_through_a_router() {
    let grants = grants_of_servers();
    for key in [
        "wheelarm/lab/stream/imu",
        "wheelarm/lab/stream/imu/@adv/pub/a/1/uhlc",
    ] {
        for flow in [In, Out] {
            let key = keyexpr::new(key).unwrap();
            let any = grants
                .iter()
                .filter(|grant| grant.flow == flow)
                .any(|grant| {
                    grant
                        .keys
                        .iter()
                        .any(|k| keyexpr::new(k.as_str()).unwrap().includes(key))
                });
            assert!(any, "{key}");
        }
    }
}
