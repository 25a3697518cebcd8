//! Who sits in the chair, in one word or a few, for command lines and plans.

use crate::v1;

/// Drawn by the seed.
const ANY: &str = "any";
/// Nobody.
pub const NOBODY: &str = "none";

impl v1::Person {
    /// Reads `any`, `none`, `BODY` or `BODY/POSTURE`, followed by any of `,guard`,
    /// `,mouth_open` and `,motion=0.5`. `any` may take the place of a body.
    ///
    /// # Errors
    /// The text and its form.
    pub fn from_text(text: &str) -> Result<Self, String> {
        let wrong = || {
            format!(
                "{text:?} is not any, none or BODY[/POSTURE] with ,guard ,mouth_open \
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
                None if word == "mouth_open" => person.mouth_open = true,
                Some(("motion", number)) => {
                    let motion = number.parse().ok().filter(|m| (0.0..=1.0).contains(m));
                    person.motion = Some(motion.ok_or_else(wrong)?);
                }
                _ => return Err(wrong()),
            }
        }
        Ok(person)
    }

    /// As [`v1::Person::from_text`] reads it; seed, colours and clothes are left out.
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
        text
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_written_is_read() {
        for text in [
            "any",
            "none",
            "man_p95",
            "any/leaning_left",
            "woman_80/hands_in_lap,motion=0.5,mouth_open,guard",
        ] {
            assert_eq!(v1::Person::from_text(text).unwrap().text(), text);
        }
        for wrong in ["", "../x", "a/", "any,motion=2", "any,guarded", "a/b/c"] {
            let told = v1::Person::from_text(wrong).unwrap_err();
            assert!(told.contains("BODY[/POSTURE]"), "{told}");
        }
    }
}
