//! The transport's configuration, as JSON values for its keys.

use serde_json::{Value, json};
use wheelarm_proto::keys::PREFIX;

use super::rules::{Flow, Grant, grants, grants_of_servers};
use super::{AccessError, Folder, Role, SERVER, User, Users};

/// Configuration of network listeners: mutual TLS with certificates of this folder;
/// connections close when a certificate expires. For `transport/link`.
#[must_use]
pub fn tls(folder: &Folder) -> Value {
    let path = |path: std::path::PathBuf| path.display().to_string();
    json!({
        "protocols": ["tls", "unixsock-stream"],
        "tls": {
            "root_ca_certificate": path(folder.authority()),
            "listen_certificate": path(folder.certificate()),
            "listen_private_key": path(folder.key()),
            // Towards a router a server presents the same certificate.
            "connect_certificate": path(folder.certificate()),
            "connect_private_key": path(folder.key()),
            "enable_mtls": true,
            "verify_name_on_connect": true,
            "close_link_on_expiration": true,
        },
    })
}

/// Largest reassembled message, bytes: an image of 4096 x 4096 pixels with colour (3),
/// depth (4) and IDs (2), and room for the rest.
const MAX_MESSAGE: usize = 4096 * 4096 * (3 + 4 + 2) + (1 << 20);

/// Limits that keep clients of the server `sim` (`*` for a router of several) from
/// blocking others: configuration keys of a session and their values.
#[must_use]
pub fn guards(sim: &str) -> [(&'static str, Value); 4] {
    [
        // Connections that never complete the handshake must not block others.
        ("transport/unicast/accept_pending", json!(500)),
        ("transport/unicast/accept_timeout", json!(5000)),
        // Every callback checks the length before copying; this limits the reassembly
        // in the transport itself. No message larger than the largest image passes
        // through, including those of servers behind this router.
        ("transport/link/rx/max_message_size", json!(MAX_MESSAGE)),
        ("qos/network", ranks_of_answers(sim)),
    ]
}

/// Priorities of replies. By default a reply has the priority of its query, which the
/// client chooses. A connection sends each priority in order, and a reply may wait
/// until a slow peer has read earlier ones; published samples have other priorities and
/// never wait behind a reply. Retransmitted images come last, and are dropped when
/// their queue is full of new ones: a message that must not be dropped would close the
/// connection.
fn ranks_of_answers(sim: &str) -> Value {
    let images = ["camera", "compressed", "sensor"];
    let caches = images.map(|kind| format!("{PREFIX}/{sim}/{kind}/*/@adv/**"));
    json!([
        {
            "messages": ["query"],
            "flows": ["ingress"],
            "overwrite": { "priority": "data_high", "congestion_control": "block" },
        },
        {
            "messages": ["query"],
            "flows": ["ingress"],
            "key_exprs": caches,
            "overwrite": { "priority": "background", "congestion_control": "drop" },
        },
    ])
}

/// Identification of a connection's user in the rules.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Subjects {
    /// By the name in the certificate: for a third-party router, which uses the roles
    /// at its start.
    Names,
    /// By present name and role, for every role that the user may get: for processes
    /// that follow the users file, see [`crate::Watch`].
    Roles,
}

impl Subjects {
    /// The users with rules, and their names in the rules.
    fn subjects_of(self, user: &User) -> Vec<(String, User)> {
        if self == Self::Names {
            return vec![(user.name.clone(), user.clone())];
        }
        let roles = Role::ALL.into_iter().map(|role| (role, false));
        let all = roles.chain([(Role::Operator, true)]);
        let users = all.map(|(role, images)| {
            let mut user = user.clone();
            (user.role, user.images) = (role, images);
            (user.subject(), user)
        });
        users.collect()
    }
}

/// The rules of the server `sim` (`*` for a router of several): everything without a
/// rule is rejected. For `access_control`.
///
/// A user is identified by the name in the certificate. A connection through a local
/// socket, a file of mode 0600, is the user of this process, and has the rights of an
/// admin.
#[must_use]
pub fn access_control(users: &Users, sim: &str, subjects: Subjects) -> Value {
    let mut lists = Lists::default();
    for (subject, user) in users.iter().flat_map(|user| subjects.subjects_of(user)) {
        let name = format!("user-{subject}");
        let who = json!({
            "id": name,
            "cert_common_names": [subject],
            "link_protocols": ["tls"],
        });
        lists.add(&name, who, &grants(&user, sim));
    }
    let local = super::User::local();
    let who = json!({ "id": "local", "link_protocols": ["unixsock-stream"] });
    lists.add("local", who, &grants(&local, sim));
    let who = json!({
        "id": "servers",
        "cert_common_names": [SERVER],
        "link_protocols": ["tls"],
    });
    lists.add("servers", who, &grants_of_servers());
    json!({
        "enabled": true,
        "default_permission": "deny",
        "rules": lists.rules,
        "subjects": lists.subjects,
        "policies": lists.policies,
    })
}

#[derive(Default)]
struct Lists {
    rules: Vec<Value>,
    subjects: Vec<Value>,
    policies: Vec<Value>,
}

impl Lists {
    fn add(&mut self, name: &str, who: Value, grants: &[Grant]) {
        let mut ids = Vec::new();
        for (i, grant) in grants.iter().enumerate() {
            let id = format!("{name}-{i}");
            let Grant { flow, kinds, keys } = grant;
            let flow: &Flow = flow;
            self.rules.push(json!({
                "id": id,
                "permission": "allow",
                "flows": [flow],
                "messages": kinds,
                "key_exprs": keys,
            }));
            ids.push(id);
        }
        self.subjects.push(who);
        self.policies
            .push(json!({ "rules": ids, "subjects": [name] }));
    }
}

/// The complete configuration of a router (`zenohd -c FILE`) that listens at
/// `endpoints` and admits servers and users of this folder, each with their rights.
///
/// # Errors
/// As [`Folder::users`].
pub fn router(
    folder: &Folder,
    endpoints: &[String],
    subjects: Subjects,
) -> Result<String, AccessError> {
    let users = folder.users()?;
    let mut link = tls(folder);
    // Samples wait for buffer space; by default they are dropped after a millisecond.
    link["tx"] = json!({ "queue": { "congestion_control": { "drop": {
        "wait_before_drop": 5_000_000,
        "max_wait_before_drop_fragments": 5_000_000,
    } } } });
    let mut config = json!({
        "mode": "router",
        "listen": { "endpoints": endpoints },
        "scouting": { "multicast": { "enabled": false }, "gossip": { "enabled": false } },
        "timestamping": { "enabled": true },
        "adminspace": { "enabled": false },
        "transport": { "link": link, "shared_memory": { "enabled": false } },
        "access_control": access_control(&users, "*", subjects),
    });
    for (key, value) in guards("*") {
        let (at, last) = key.rsplit_once('/').unwrap_or(("", key));
        let place = at.split('/').filter(|part| !part.is_empty());
        place.fold(&mut config, |at, part| &mut at[part])[last] = value;
    }
    serde_json::to_string_pretty(&config)
        .map_err(AccessError::crypto("cannot write a router's configuration"))
}

#[cfg(test)]
mod tests {
    use wheelarm_proto::keys::Keys;
    use wheelarm_proto::{Message, TopicId, v1};

    use super::*;
    use crate::{Role, User};

    #[test]
    fn the_transport_accepts_the_configuration_of_many_users() {
        let temporary = tempfile::tempdir().unwrap();
        let hosts = ["localhost".to_owned()];
        let folder = Folder::init(&temporary.path().join("keys"), &hosts).unwrap();
        let mut users = folder.users().unwrap();
        // Names that would clash with reserved IDs.
        for name in ["local", "servers", "anna", "anna-0"] {
            for role in Role::ALL {
                let name = format!("{name}{role}");
                users.add(User::new(&name, role).unwrap()).unwrap();
            }
            users.add(User::new(name, Role::Viewer).unwrap()).unwrap();
        }
        users.save(&folder.users_file()).unwrap();
        let endpoints = ["tls/127.0.0.1:7447".to_owned()];
        let read = |subjects| {
            let text = router(&folder, &endpoints, subjects).unwrap();
            let config = zenoh::Config::from_json5(&text).unwrap();
            let rules = config.get_json("access_control/rules").unwrap();
            assert!(rules.contains("wheelarm/*/command/annaoperator"), "{rules}");
            assert!(!rules.contains("deny"));
            config
        };
        let named = read(Subjects::Names);
        let named = named.get_json("access_control/subjects").unwrap();
        assert!(named.contains(r#"["annaoperator"]"#), "{named}");
        let config = read(Subjects::Roles);
        let subjects = config.get_json("access_control/subjects").unwrap();
        for subject in ["annaviewer viewer", "annaviewer operator images"] {
            assert!(subjects.contains(&format!("[\"{subject}\"]")), "{subjects}");
        }
        // Every limit is present under its own key.
        for (key, value) in guards("*") {
            let set = config.get_json(key).unwrap();
            let set: Value = serde_json::from_str(&set).unwrap();
            assert!(holds(&set, &value), "{key}: {set}");
        }
    }

    /// Whether `set` includes everything of `wanted`.
    fn holds(set: &Value, wanted: &Value) -> bool {
        match (set, wanted) {
            (Value::Object(set), Value::Object(wanted)) => wanted
                .iter()
                .all(|(key, value)| set.get(key).is_some_and(|set| holds(set, value))),
            (Value::Array(set), Value::Array(wanted)) => {
                set.len() == wanted.len() && set.iter().zip(wanted).all(|(s, w)| holds(s, w))
            }
            _ => set == wanted,
        }
    }

    #[test]
    fn the_largest_image_fits_into_a_reassembled_message() {
        let pixels = 4096 * 4096;
        let image = v1::CameraFrame {
            camera: "a".repeat(64),
            color: vec![0; 3 * pixels].into(),
            depth: vec![0; 4 * pixels].into(),
            segmentation: vec![0; 2 * pixels].into(),
            intrinsics: Some(v1::Intrinsics::default()),
            pose: Some(v1::Pose::default()),
            header: Some(v1::Header::default()),
            ..v1::CameraFrame::default()
        };
        let length = image.encoded_len();
        assert!(length < MAX_MESSAGE && length > MAX_MESSAGE / 2, "{length}");
    }

    #[test]
    fn cache_keys_of_images_match_the_contract() {
        let keys = Keys::new("lab").unwrap();
        let ranks = ranks_of_answers("lab").to_string();
        for topic in [TopicId::Camera, TopicId::CompressedCamera, TopicId::Sensor] {
            let cache = format!("{}/@adv/**", keys.topic(topic));
            assert!(ranks.contains(&cache), "{cache}");
        }
    }

    #[test]
    fn without_users_only_the_local_one_is_admitted() {
        let rules = access_control(&Users::default(), "lab", Subjects::Roles);
        assert_eq!(rules["default_permission"], "deny");
        let subjects = rules["subjects"].as_array().unwrap();
        assert_eq!(subjects.len(), 2, "local and servers: {subjects:?}");
    }
}
