//! Rights of every role to send and receive, and what no role may send.

use std::sync::Arc;
use std::time::Duration;

use parking_lot::Mutex;
use wheelarm_access::Role;
use wheelarm_proto::{Message, Query, TopicId, v1};
use wheelarm_sdk::ClientError;
use wheelarm_tests::{PATIENCE, wait_until};
use zenoh::Wait;
use zenoh_ext::{AdvancedSubscriberBuilderExt, HistoryConfig};

use super::lab::{
    FIRST_MARK, Listener, REFUSAL_TIMEOUT, SIM, USERS, drive_until_moving, flush_session,
    gets_through, put, refused_command, shared, status,
};

#[test]
fn every_user_watches_and_sends_only_the_queries_of_the_role() {
    let lab = shared();
    let lab = lab.lock();
    let all = "veit anna bert rex ada";
    for (user, role) in USERS {
        let client = lab.open(user);
        assert_eq!(status(&client).access(), v1::Access::Keys);
        let clock = client.samples::<v1::Clock>().expect("the clock");
        assert!(clock.next(PATIENCE).expect("a sample").is_some(), "{user}");
        for query in Query::ALL {
            let who = match query {
                Query::Status | Query::Scene | Query::Map | Query::Tasks | Query::Packs => all,
                Query::Snapshot | Query::Episode => "rex ada",
                Query::Sensors | Query::Playback | Query::PackPut | Query::Shutdown => "ada",
                _ => "anna bert ada",
            };
            let key = client.keys().query(query).replace('*', user);
            let wanted = who.split(' ').any(|name| name == user);
            assert_eq!(
                gets_through(&client, &key, wanted),
                wanted,
                "{user}, {role}: {key}"
            );
        }
        let lease_of_another = client.keys().query(Query::Lease).replace('*', "carl");
        let wanted = role == Role::Admin;
        assert_eq!(
            gets_through(&client, &lease_of_another, wanted),
            wanted,
            "{user}"
        );
    }
}

#[test]
fn only_recorders_receive_full_images_and_every_user_receives_previews() {
    let lab = shared();
    let lab = lab.lock();
    for (user, role) in USERS {
        let client = lab.open(user);
        let keys = ["preview/room/low", "camera/room"];
        let keys = keys.map(|rest| format!("wheelarm/{SIM}/{rest}"));
        let listener = Listener::new(&client, &keys);
        // Both streams have a rate of 10 Hz.
        let full = matches!(role, Role::Recorder | Role::Admin);
        wait_until("images arrive", || {
            listener.has("/preview/") && (!full || listener.has("/camera/"))
        });
        let previews = || {
            let received = listener.received.lock();
            received
                .iter()
                .filter(|(key, _)| key.contains("/preview/"))
                .count()
        };
        let some = previews();
        wait_until("more images arrive", || previews() > some + 3);
        assert_eq!(listener.has("/camera/"), full, "{user}");
    }
}

#[test]
fn operator_drives_only_under_the_own_name() {
    let lab = shared();
    let lab = lab.lock();
    let (anna, bert, veit) = (lab.open("anna"), lab.open("bert"), lab.open("veit"));
    let listener = Listener::new(&veit, &[veit.keys().topic(TopicId::Refusal)]);
    flush_session(&anna, "anna", &listener);
    let mut commander = anna.commander("anna", false).expect("control");
    assert_eq!(status(&veit).holder, "anna");
    drive_until_moving(&mut commander, &anna, &veit);

    // Bert cannot send commands as Anna: neither under her key nor with her name under his.
    let forged = refused_command("anna", 7);
    put(
        bert.session(),
        &bert.keys().command("anna"),
        "wheelarm.v1.Command",
        forged.clone(),
    );
    put(
        bert.session(),
        &bert.keys().command("*"),
        "wheelarm.v1.Command",
        forged.clone(),
    );
    flush_session(&bert, "bert", &listener);
    assert!(
        !listener.refused_of("anna").contains(&7),
        "it reached the gate"
    );
    // Her own commands were accepted, except late ones on a busy machine.
    for refusal in listener.refusals_of("anna") {
        let late = refusal.code() == v1::RefusalCode::TooOld;
        assert!(refusal.sequence >= FIRST_MARK || late, "{refusal:?}");
    }
    let strange = status(&veit).strange;
    put(
        bert.session(),
        &bert.keys().command("bert"),
        "wheelarm.v1.Command",
        forged,
    );
    wait_until("it is counted", || status(&veit).strange > strange);
    assert_eq!(status(&veit).holder, "anna");

    // Bert can neither release control in her name nor end the server.
    let lease = v1::LeaseRequest {
        commander: "anna".to_owned(),
        release: true,
        ..v1::LeaseRequest::default()
    };
    let reply = bert.request_within(&lease, Duration::from_secs_f64(REFUSAL_TIMEOUT));
    assert!(reply.is_err(), "{reply:?}");
    let reply = bert.request_within(
        &v1::ShutdownRequest::default(),
        Duration::from_secs_f64(REFUSAL_TIMEOUT),
    );
    assert!(
        matches!(reply, Err(ClientError::Unanswered { .. })),
        "{reply:?}"
    );
    // A viewer cannot take control under any name.
    for name in ["veit", "anna", "zoe"] {
        let commander = veit.commander(name, true);
        assert!(commander.is_err(), "{name}");
    }
    assert_eq!(status(&veit).holder, "anna");
    drop(commander);
    wait_until("control is given back", || status(&veit).holder.is_empty());
}

#[test]
fn no_user_can_impersonate_the_server() {
    let lab = shared();
    let lab = lab.lock();
    let veit = lab.open("veit");
    let keys = ["stream/*", "episode/*", "refusal", "preview/*/low"];
    let keys = keys.map(|rest| format!("wheelarm/{SIM}/{rest}"));
    let listener = Listener::new(&veit, &keys);
    for user in ["anna", "ada"] {
        let forger = lab.open(user);
        // The session works: a missing forged sample was dropped.
        flush_session(&forger, user, &listener);
        let forged = format!("forged by {user}").into_bytes();
        for rest in [
            "stream/clock",
            "stream/joints",
            "episode/start",
            "episode/stop",
            "refusal",
            "preview/room/low",
            "stream/*",
            "episode/*",
            "*/clock",
            "**",
        ] {
            let key = format!("wheelarm/{SIM}/{rest}");
            put(forger.session(), &key, "wheelarm.v1.Clock", forged.clone());
            forger.session().delete(key).wait().expect("a delete");
        }
        put(
            forger.session(),
            "wheelarm/**",
            "wheelarm.v1.Clock",
            forged.clone(),
        );
        // No user can reply to its queries or declare its token.
        let queries = Arc::new(Mutex::new(0));
        let counts = Arc::clone(&queries);
        let _answers = forger
            .session()
            .declare_queryable(format!("wheelarm/{SIM}/query/status"))
            .callback(move |_| *counts.lock() += 1)
            .wait()
            .expect("a queryable of its own");
        let _claims = forger
            .session()
            .liveliness()
            .declare_token(forger.keys().alive(&forger.session().zid().to_string()))
            .wait()
            .expect("a token of its own");
        flush_session(&forger, user, &listener);
        assert!(
            !listener.has_bytes(&forged),
            "a forged sample of {user} arrived"
        );
        assert_eq!(status(&veit).access(), v1::Access::Keys);
        assert_eq!(*queries.lock(), 0, "{user} received a query");
        assert_eq!(
            veit.server().tokens().len(),
            1,
            "{user} appears as a server"
        );
    }
}

#[test]
fn recorder_sends_status_only_under_the_own_name() {
    let lab = shared();
    let lab = lab.lock();
    let (rex, veit) = (lab.open("rex"), lab.open("veit"));
    let tokens = ["rex", "other"].map(|name| {
        let token = rex.keys().recorder_alive(name);
        rex.session()
            .liveliness()
            .declare_token(token)
            .wait()
            .expect("a token")
    });
    let send_status = |key: &str, name: &str| {
        let status = v1::RecorderStatus {
            header: Some(v1::Header::default()),
            recorder: name.to_owned(),
            state: v1::RecorderState::Idle.into(),
            ..v1::RecorderStatus::default()
        };
        let key = rex.keys().recorder(key);
        let message = "wheelarm.v1.RecorderStatus";
        put(rex.session(), &key, message, status.encode_to_vec());
    };
    let named = |name: &str| status(&veit).recorders.iter().any(|r| r.recorder == name);
    send_status("other", "other");
    wait_until("the recorder is listed", || {
        send_status("rex", "rex");
        named("rex")
    });
    let strange = status(&veit).strange;
    send_status("rex", "other");
    wait_until("it is counted", || status(&veit).strange > strange);
    assert!(!named("other"));
    drop(tokens);
}

/// A late subscriber receives the publisher's cache, and its heartbeats, replies and tokens
/// below `@adv`.
#[test]
fn late_subscriber_receives_the_cache_only_with_the_right_to_the_stream() {
    let lab = shared();
    let lab = lab.lock();
    let ada = lab.open("ada");
    let clock = ada.samples::<v1::Clock>().expect("the clock");
    assert!(clock.next(PATIENCE).expect("a sample").is_some());
    let rex = lab.open("rex");
    let (sender, images) = std::sync::mpsc::channel();
    let subscriber = rex
        .session()
        .declare_subscriber(rex.keys().camera("room"))
        .callback(move |_| {
            let _ = sender.send(());
        })
        .wait()
        .expect("a subscriber");
    images.recv_timeout(PATIENCE).expect("an image");
    let _: v1::Ack = ada.request(&v1::PauseRequest {}).expect("a pause");
    subscriber
        .undeclare()
        .wait()
        .expect("the subscription ends");
    for user in ["veit", "anna", "rex"] {
        let client = lab.open(user);
        let (sender, keys) = std::sync::mpsc::channel();
        let _late = client
            .session()
            .declare_subscriber(client.keys().topic(TopicId::Clock))
            .callback(move |sample| {
                let _ = sender.send(sample.key_expr().to_string());
            })
            .history(HistoryConfig::default().detect_late_publishers())
            .wait()
            .expect("a subscriber");
        // The simulation is paused: the server publishes no new sample.
        let got = keys.recv_timeout(PATIENCE).expect("the cached sample");
        assert_eq!(got, client.keys().topic(TopicId::Clock), "{user}");
        let cache = format!("wheelarm/{SIM}/stream/clock/@adv/**");
        let heartbeats = Listener::new(&client, std::slice::from_ref(&cache));
        wait_until("a heartbeat arrives", || heartbeats.has("@adv"));
        // Queries of tokens and caches reach only those that the connection knows by then.
        wait_until("the publisher's token is known", || {
            let tokens = client.session().liveliness().get(cache.as_str()).wait();
            let tokens = tokens.expect("a query");
            tokens.iter().any(|reply| reply.result().is_ok())
        });
        let has_cached_images = || {
            let replies = client
                .session()
                .get(format!("wheelarm/{SIM}/camera/room/@adv/**"))
                .accept_replies(zenoh::query::ReplyKeyExpr::Any)
                .timeout(PATIENCE)
                .wait()
                .expect("a query");
            replies.iter().any(|reply| reply.result().is_ok())
        };
        if user == "rex" {
            wait_until("cached images arrive", has_cached_images);
        } else {
            assert!(!has_cached_images(), "{user}: cached images");
        }
    }
    let _: v1::Ack = ada.request(&v1::ResumeRequest {}).expect("time");
}
