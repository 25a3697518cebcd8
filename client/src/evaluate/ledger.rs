//! The results of `wheelarm evaluate` as they come (`crate::ledger`).

use super::entry::Entry;
use crate::ledger::Line;

/// The file of results.
pub type Ledger = crate::ledger::Ledger<Entry>;

impl Line for Entry {
    const COMMAND: &'static str = "evaluate";

    /// The same episode of the same policy.
    fn is_of_the_same(&self, known: &Self) -> bool {
        fn of(e: &Entry) -> (u64, [&String; 3]) {
            (e.seed, [&e.task, &e.settings, &e.policy])
        }
        of(self) == of(known)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::broken::Broken;

    #[test]
    fn a_cut_line_is_left_out_and_the_rest_is_kept() {
        let folder = tempfile::tempdir().unwrap();
        let entry = |seed| Entry {
            task: "pick_mustard".to_owned(),
            seed,
            settings: String::new(),
            policy: String::new(),
            policy_files: String::new(),
            label: None,
            thinking: None,
            success: true,
            why: String::new(),
            end: String::new(),
            course: None,
            conditions: Vec::new(),
            seconds: 16.5,
            factor: 8.0,
            hash: "00".to_owned(),
            rejected_starts: 0,
            notes: Vec::new(),
            broken: None,
            scenario: None,
        };
        let ledger = Ledger::open(folder.path()).unwrap();
        ledger.add(&entry(0)).unwrap();
        ledger.add(&entry(1)).unwrap();
        drop(ledger);
        let path = folder.path().join("episodes.jsonl");
        let text = std::fs::read_to_string(&path).unwrap();
        // In the middle of a character, too.
        let cut = [text.as_bytes(), "{\"task\": \"90°".as_bytes()].concat();
        std::fs::write(&path, &cut[..cut.len() - 1]).unwrap();
        let ledger = Ledger::open(folder.path()).unwrap();
        assert_eq!(ledger.entries(), [entry(0), entry(1)]);
        drop(ledger);
        std::fs::write(&path, &text[..text.len() - 9]).unwrap();
        let ledger = Ledger::open(folder.path()).unwrap();
        assert_eq!(ledger.entries(), [entry(0)]);
        // Nobody else writes meanwhile.
        let told = Ledger::open(folder.path()).err().unwrap().to_string();
        assert!(told.contains("another `wheelarm evaluate`"), "{told}");
        drop(ledger);
        let with = |entry: &Entry| {
            Ledger::open(folder.path()).unwrap().add(entry).unwrap();
            Ledger::open(folder.path()).unwrap().entries()
        };
        assert_eq!(with(&entry(2)), [entry(0), entry(2)]);
        let broken = Entry {
            success: false,
            broken: Some(Broken::Server),
            ..entry(0)
        };
        let again = with(&broken);
        assert_eq!(again, [entry(2), broken.clone()], "the newest word counts");
        let ledger = Ledger::open(folder.path()).unwrap();
        assert_eq!(ledger.set_aside(|entry| entry.seed == 9).unwrap(), None);
        ledger.add(&entry(9)).unwrap();
        let aside = ledger.set_aside(|entry| entry.seed == 9).unwrap();
        let kept = std::fs::read_to_string(aside.unwrap()).unwrap();
        assert!(kept.contains("\"seed\":9"), "{kept}");
        drop(ledger);
        let left = Ledger::open(folder.path()).unwrap().entries();
        assert_eq!(left, [entry(2), broken.clone()]);
        let elsewhere = Entry {
            settings: "starts=anywhere".to_owned(),
            ..entry(2)
        };
        assert_eq!(
            with(&elsewhere),
            [entry(2), broken.clone(), elsewhere.clone()],
            "other starts are another episode"
        );
        let policy = Entry {
            policy: "act".to_owned(),
            ..entry(2)
        };
        assert_eq!(
            with(&policy),
            [entry(2), broken, elsewhere, policy],
            "another policy's is another episode"
        );
    }
}
