//! What every role may do and hear, and what nobody may.

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
    Ear, FIRST_MARK, REFUSED, SIM, USERS, gets_through, put, refused_command, shared, status,
    until_heard, until_moving,
};

#[test]
fn everybody_watches_and_asks_what_the_role_allows() {
    let lab = shared();
    let lab = lab.lock();
    let all = "veit anna bert rex ada";
    for (user, role) in USERS {
        let link = lab.link(user);
        assert_eq!(status(&link).access(), v1::Access::Keys);
        let clock = link.samples::<v1::Clock>().expect("the clock");
        assert!(clock.next(PATIENCE).expect("a sample").is_some(), "{user}");
        for query in Query::ALL {
            let who = match query {
                Query::Status | Query::Scene | Query::Tasks => all,
                Query::Snapshot | Query::Episode => "rex ada",
                Query::Sensors | Query::Playback | Query::Shutdown => "ada",
                _ => "anna bert ada",
            };
            let key = link.keys().query(query).replace('*', user);
            let wanted = who.split(' ').any(|name| name == user);
            assert_eq!(
                gets_through(&link, &key, wanted),
                wanted,
                "{user}, {role}: {key}"
            );
        }
        let lease_of_another = link.keys().query(Query::Lease).replace('*', "carl");
        let wanted = role == Role::Admin;
        assert_eq!(
            gets_through(&link, &lease_of_another, wanted),
            wanted,
            "{user}"
        );
    }
}

#[test]
fn full_pictures_are_for_recorders_and_previews_for_everybody() {
    let lab = shared();
    let lab = lab.lock();
    for (user, role) in USERS {
        let link = lab.link(user);
        let keys = ["preview/room/low", "camera/room"];
        let keys = keys.map(|rest| format!("wheelarm/{SIM}/{rest}"));
        let ear = Ear::new(&link, &keys);
        // Whoever may hears both; each comes ten times a second.
        let full = matches!(role, Role::Recorder | Role::Admin);
        wait_until("pictures come", || {
            ear.has("/preview/") && (!full || ear.has("/camera/"))
        });
        let previews = || {
            let heard = ear.heard.lock();
            heard
                .iter()
                .filter(|(key, _)| key.contains("/preview/"))
                .count()
        };
        let some = previews();
        wait_until("more pictures come", || previews() > some + 3);
        assert_eq!(ear.has("/camera/"), full, "{user}");
    }
}

#[test]
fn an_operator_drives_under_its_own_name_and_no_other() {
    let lab = shared();
    let lab = lab.lock();
    let (anna, bert, veit) = (lab.link("anna"), lab.link("bert"), lab.link("veit"));
    let ear = Ear::new(&veit, &[veit.keys().topic(TopicId::Refusal)]);
    until_heard(&anna, "anna", &ear);
    let mut commander = anna.commander("anna", false).expect("control");
    assert_eq!(status(&veit).holder, "anna");
    until_moving(&mut commander, &anna, &veit);

    // Bert cannot speak as Anna: neither under her key nor with her name under his.
    let speaks = refused_command("anna", 7);
    put(
        bert.session(),
        &bert.keys().command("anna"),
        "wheelarm.v1.Command",
        speaks.clone(),
    );
    put(
        bert.session(),
        &bert.keys().command("*"),
        "wheelarm.v1.Command",
        speaks.clone(),
    );
    until_heard(&bert, "bert", &ear);
    assert!(!ear.refused_of("anna").contains(&7), "it reached the gate");
    // Of hers nothing was refused, but what was late on a busy machine.
    for refusal in ear.refusals_of("anna") {
        let late = refusal.code() == v1::RefusalCode::TooOld;
        assert!(refusal.sequence >= FIRST_MARK || late, "{refusal:?}");
    }
    let strange = status(&veit).strange;
    put(
        bert.session(),
        &bert.keys().command("bert"),
        "wheelarm.v1.Command",
        speaks,
    );
    wait_until("it is counted", || status(&veit).strange > strange);
    assert_eq!(status(&veit).holder, "anna");

    // Nor take control in her name, or end the server.
    let asked = v1::LeaseRequest {
        commander: "anna".to_owned(),
        release: true,
        ..v1::LeaseRequest::default()
    };
    let told = bert.request_within(&asked, Duration::from_secs_f64(REFUSED));
    assert!(told.is_err(), "{told:?}");
    let told = bert.request_within(
        &v1::ShutdownRequest::default(),
        Duration::from_secs_f64(REFUSED),
    );
    assert!(
        matches!(told, Err(ClientError::Unanswered { .. })),
        "{told:?}"
    );
    // A viewer takes no control, under any name.
    for name in ["veit", "anna", "zoe"] {
        let told = veit.commander(name, true);
        assert!(told.is_err(), "{name}");
    }
    assert_eq!(status(&veit).holder, "anna");
    drop(commander);
    wait_until("control is given back", || status(&veit).holder.is_empty());
}

#[test]
fn nobody_speaks_as_the_server() {
    let lab = shared();
    let lab = lab.lock();
    let veit = lab.link("veit");
    let keys = ["stream/*", "episode/*", "refusal", "preview/*/low"];
    let keys = keys.map(|rest| format!("wheelarm/{SIM}/{rest}"));
    let ear = Ear::new(&veit, &keys);
    for user in ["anna", "ada"] {
        let forger = lab.link(user);
        // What is let through is heard, so what is not was held back.
        until_heard(&forger, user, &ear);
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
        // Nor does anybody answer in its place, or claim to be it.
        let asked = Arc::new(Mutex::new(0));
        let counts = Arc::clone(&asked);
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
        until_heard(&forger, user, &ear);
        assert!(!ear.has_bytes(&forged), "{user} was heard");
        assert_eq!(status(&veit).access(), v1::Access::Keys);
        assert_eq!(*asked.lock(), 0, "{user} was asked");
        assert_eq!(
            veit.server().tokens().len(),
            1,
            "{user} passes for a server"
        );
    }
}

#[test]
fn a_recorder_speaks_for_itself_alone() {
    let lab = shared();
    let lab = lab.lock();
    let (rex, veit) = (lab.link("rex"), lab.link("veit"));
    let tokens = ["rex", "other"].map(|name| {
        let token = rex.keys().recorder_alive(name);
        rex.session()
            .liveliness()
            .declare_token(token)
            .wait()
            .expect("a token")
    });
    let says = |key: &str, name: &str| {
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
    says("other", "other");
    wait_until("it is there", || {
        says("rex", "rex");
        named("rex")
    });
    let strange = status(&veit).strange;
    says("rex", "other");
    wait_until("it is counted", || status(&veit).strange > strange);
    assert!(!named("other"));
    drop(tokens);
}

/// Who comes late gets what the publishers kept, and hears their signs of life:
/// questions, answers and tokens below `@adv`.
#[test]
fn what_was_published_before_is_had_by_everybody_who_may_listen() {
    let lab = shared();
    let lab = lab.lock();
    let ada = lab.link("ada");
    let clock = ada.samples::<v1::Clock>().expect("the clock");
    assert!(clock.next(PATIENCE).expect("a sample").is_some());
    let rex = lab.link("rex");
    let (seen, sees) = std::sync::mpsc::channel();
    let pictures = rex
        .session()
        .declare_subscriber(rex.keys().camera("room"))
        .callback(move |_| {
            let _ = seen.send(());
        })
        .wait()
        .expect("a subscriber");
    sees.recv_timeout(PATIENCE).expect("a picture");
    let _: v1::Ack = ada.request(&v1::PauseRequest {}).expect("a pause");
    pictures.undeclare().wait().expect("no more pictures");
    for user in ["veit", "anna", "rex"] {
        let link = lab.link(user);
        let (seen, sees) = std::sync::mpsc::channel();
        let _late = link
            .session()
            .declare_subscriber(link.keys().topic(TopicId::Clock))
            .callback(move |sample| {
                let _ = seen.send(sample.key_expr().to_string());
            })
            .history(HistoryConfig::default().detect_late_publishers())
            .wait()
            .expect("a subscriber");
        // Time stands still: nothing new is published.
        let got = sees
            .recv_timeout(PATIENCE)
            .expect("what was published before");
        assert_eq!(got, link.keys().topic(TopicId::Clock), "{user}");
        let kept = format!("wheelarm/{SIM}/stream/clock/@adv/**");
        let signs = Ear::new(&link, std::slice::from_ref(&kept));
        wait_until("a publisher tells its newest number", || signs.has("@adv"));
        // What a client asks of tokens and caches is answered by what its connection
        // has been told of them by then.
        wait_until("the publisher is seen", || {
            let tokens = link.session().liveliness().get(kept.as_str()).wait();
            let tokens = tokens.expect("a question");
            tokens.iter().any(|reply| reply.result().is_ok())
        });
        let has_pictures = || {
            let pictures = link
                .session()
                .get(format!("wheelarm/{SIM}/camera/room/@adv/**"))
                .accept_replies(zenoh::query::ReplyKeyExpr::Any)
                .timeout(PATIENCE)
                .wait()
                .expect("a question");
            pictures.iter().any(|reply| reply.result().is_ok())
        };
        if user == "rex" {
            wait_until("kept pictures are there", has_pictures);
        } else {
            assert!(!has_pictures(), "{user}: kept pictures");
        }
    }
    let _: v1::Ack = ada.request(&v1::ResumeRequest {}).expect("time");
}
