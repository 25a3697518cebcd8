//! The person in the chair as a short text, for command lines and plans.

use crate::v1;

/// Largest contact force on a part of the seated person's body, N: limit of the task
/// templates, the guard and the expert.
pub const FORCE_LIMIT: f64 = 5.0;
/// Largest contact force on face and mouth, N; the guard applies it to the whole head.
pub const FACE_FORCE_LIMIT: f64 = 2.0;

/// Sampled by the seed.
const ANY: &str = "any";
/// An empty chair.
pub const NO_PERSON: &str = "none";

impl v1::Person {
    /// Reads `any`, `none`, `BODY` or `BODY/POSTURE`, followed by any of `,guard`,
    /// `,unguarded`, `,mouth_open` and `,motion=0.5`. `any` may take the place of a body.
    ///
    /// The text and the allowed form.
    /// The text and its form.
    pub fn from_text(text: &str) -> Result<Self, String> {
        let wrong = || {
            format!(
                "{text:?} is not any, none or BODY[/POSTURE] with ,guard or ,unguarded ,mouth_open \
                 ,motion=0..1, for example woman_p50/hands_in_lap,motion=0.5"
            )
        };
        let mut words = text.split(',');
        let who = words.next().unwrap_or_default();
        let (body, posture) = who.split_once('/').unwrap_or((who, ""));
        let named = |name: &str| crate::keys::check_name(name).is_ok();
        if !named(body) || who.contains('/') && !named(posture) {
            return Err(wrong());
        }
        let mut person = Self {
            body: match body {
                ANY => String::new(),
                body => body.to_owned(),
            },
            posture: posture.to_owned(),
            ..Self::default()
        };
        for word in words {
            match word.split_once('=') {
                None if word == "guard" => person.guard = true,
                None if word == "unguarded" => person.unguarded = true,
                None if word == "mouth_open" => person.mouth_open = true,
                Some(("motion", number)) => {
                    let motion = number.parse().ok().filter(|m| (0.0..=1.0).contains(m));
                    person.motion = Some(motion.ok_or_else(wrong)?);
                }
                _ => return Err(wrong()),
            }
        }
        if person.guard && person.unguarded {
            return Err(wrong());
        }
        Ok(person)
    }

    /// Written as [`v1::Person::from_text`] reads it; seed, colours and clothes are
    /// left out.
    #[must_use]
    pub fn text(&self) -> String {
        let mut text = match self.body.as_str() {
            "" => ANY.to_owned(),
            body => body.to_owned(),
        };
        if !self.posture.is_empty() {
            text.push('/');
            text.push_str(&self.posture);
        }
        if let Some(motion) = self.motion {
            text.push_str(&format!(",motion={motion}"));
        }
        if self.mouth_open {
            text.push_str(",mouth_open");
        }
        if self.guard {
            text.push_str(",guard");
        }
        if self.unguarded {
            text.push_str(",unguarded");
        }
        text
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn written_text_is_parsed() {
        for text in [
            "any",
            "none",
            "man_p95",
            "any/leaning_left",
            "woman_80/hands_in_lap,motion=0.5,mouth_open,guard",
            "any,unguarded",
        ] {
            assert_eq!(v1::Person::from_text(text).unwrap().text(), text);
        }
        for wrong in [
            "",
            "../x",
            "a/",
            "any,motion=2",
            "any,guarded",
            "any,guard,unguarded",
            "a/b/c",
        ] {
            let message = v1::Person::from_text(wrong).unwrap_err();
            assert!(message.contains("BODY[/POSTURE]"), "{message}");
        }
    }
}
