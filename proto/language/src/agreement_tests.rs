//! Agreement tests: over all combinations of verb, object, place and posture no
//! generated sentence breaks the rules below. The rules are written independently of
//! the grammar's agreement data.

use std::collections::BTreeSet;

use crate::grammar::{Means, Names, Noun, Phrase, Slot, Template};
use crate::meaning::{Named, is_called};
use crate::parse::{Answer, Parser};
use crate::space::{Order, Side};
use crate::wording::{At, ObjectWords, RequestWords, spoken};
use crate::{Grammar, Meaning, Role, Scene, Verb, made_up};

/// A generated request and its meaning.
struct GeneratedRequest<'a> {
    text: &'a str,
    verb: Verb,
    kind: &'a str,
    /// Name of the object in the sentence, without its color word.
    noun: &'a str,
    colour: Option<&'a str>,
    /// Words for the object only.
    object: &'a str,
    area: &'a str,
    place: Option<&'a str>,
    /// The goal and its name.
    goal: Option<(&'a str, &'a str)>,
}

const PLURAL: [&str; 3] = ["crackers", "salty crackers", "savoury crackers"];
/// Names of contents, and of drinks: the color belongs to the container.
const CONTENTS: [&str; 15] = [
    "mustard",
    "tomato soup",
    "soup",
    "tinned soup",
    "crackers",
    "salty crackers",
    "savoury crackers",
    "sugar",
    "potted meat",
    "tinned meat",
    "luncheon meat",
    "canned meat",
    "Coke",
    "cola",
    "soda",
];
const STANDING: [&str; 3] = ["standing", "stands", "stand"];
const LYING: [&str; 3] = ["lying", "lies", "lie"];
const SITTING: [&str; 3] = ["sitting", "sits", "sit"];
const HANDING_OVER: [&str; 12] = [
    "hand me",
    "pass me",
    "bring me",
    "get me",
    "give me",
    "fetch",
    "retrieve",
    "bring back",
    "to me",
    "deliver",
    "hand the",
    "serve me",
];
/// Adjectives of objects and of places.
const ADJECTIVES: [&str; 6] = [
    "kitchen",
    "coffee",
    "breakfast",
    "dining",
    "table",
    "cabinet",
];
/// What makes a clause out of the words behind a noun.
const IN_CLAUSE: [&str; 17] = [
    "standing", "stands", "stand", "lying", "lies", "sitting", "sits", "that is", "that are",
    "which", "where", "counting", "count", "until", "so that", "ends up", "end up",
];
/// Verbs that remove an object from its place.
const REMOVING: [&str; 13] = [
    "pick", "grab", "take", "get", "lift", "collect", "pluck", "fetch", "bring me", "hand", "pass",
    "give", "throw",
];

/// The rule that a sentence breaks; `None` when it keeps all.
fn broken_rule(worded: &GeneratedRequest<'_>) -> Option<&'static str> {
    let text = worded.text;
    // "The right place for the crackers is": the place is the subject.
    let spoken = match text.strip_prefix("the right place for ") {
        Some(rest) => rest.replacen(" is the ", " the ", 1),
        None => text.to_owned(),
    };
    let words: Vec<&str> = spoken
        .split(|c: char| !c.is_alphanumeric())
        .filter(|word| !word.is_empty())
        .collect();
    let has = |list: &[&str]| words.iter().any(|word| list.contains(word));
    let begins =
        |part: &str| text == part || text.contains(&format!(" {part}")) || text.starts_with(part);
    if text.contains(['{', '}']) {
        return Some("every slot is filled");
    }
    if let Some((goal, name)) = worded.goal {
        let wrong = match goal {
            "table_bin" => ["on", "onto", "upon", "at"],
            _ => ["in", "into", "inside", "at"],
        };
        if wrong.iter().any(|p| begins(&format!("{p} the {name}"))) {
            return Some("a container holds what is in it, a surface what is on it");
        }
    }
    let is_plural = PLURAL.contains(&worded.noun);
    let wrong: &[&str] = match is_plural {
        true => &[
            "it", "is", "belongs", "stands", "sits", "lies", "needs", "goes", "this",
        ],
        false => &["them", "they", "are", "those", "belong", "these"],
    };
    let that = begins(&format!("that {}", worded.noun));
    if has(wrong) || (is_plural && that) {
        return Some("verbs and pronouns agree with the noun");
    }
    if worded.colour.is_some() && CONTENTS.contains(&worded.noun) {
        return Some("no color word on contents");
    }
    if worded
        .colour
        .is_some_and(|colour| ["scarlet", "golden", "greenish"].contains(&colour))
    {
        return Some("common color words");
    }
    let postures: &[&str] = match worded.kind {
        "knife" | "banana" | "remote_control" => &LYING,
        // A bowl is flat: it has no upright posture.
        "teddy_bear" | "bowl" => &SITTING,
        "feeding_spoon" | "drawer" => &[],
        _ => &STANDING,
    };
    let is_posture = |word: &&str| {
        let all = STANDING.iter().chain(&LYING).chain(&SITTING);
        all.into_iter().any(|posture| posture == word)
    };
    let mut own = worded.object.split(' ').filter(|word| is_posture(word));
    if own.any(|word| !postures.contains(&word)) {
        return Some("a posture that the object has");
    }
    if let Some(at) = words.iter().position(|word| *word == "first") {
        let is_upright = has(&["top", "bottom", "above", "below"]);
        if is_upright || at == 0 || words[at - 1] != "the" {
            return Some("the top or the bottom one; from a side, the first before its noun");
        }
    }
    if worded.kind == "coke" && has(&["tin"]) {
        return Some("a Coke is a can");
    }
    if has(&["workstation"]) {
        return Some("a word for the place that people use");
    }
    let repeats = |adjective: &str| {
        let place = worded.place.filter(|place| begins(place));
        let is_own = worded.noun.starts_with(&format!("{adjective} "));
        is_own && place.is_some_and(|place| place.contains(adjective))
    };
    if ADJECTIVES.iter().any(|adjective| repeats(adjective)) {
        return Some("no adjective twice");
    }
    if matches!(worded.verb, Verb::Lift | Verb::Open | Verb::Close)
        && HANDING_OVER.iter().any(|words| begins(words))
    {
        return Some("no handover verb without a handover");
    }
    if let Some(place) = worded.place {
        let before = |p: &str| begins(&format!("{p} {place}"));
        let wrong: &[&str] = match worded.area {
            "workstation" => &["on", "from", "off", "at"],
            _ => &["in", "of", "off", "at"],
        };
        // "position the chair at the shelf" is a place of the chair.
        let is_chair = text.contains("chair at the");
        if wrong.iter().any(|p| before(p)) && !is_chair {
            return Some("a preposition of the place");
        }
        let removes = REMOVING.iter().any(|verb| begins(verb));
        let looks = [
            "look for",
            "locate",
            "find",
            "hold up",
            "reach for",
            "should",
            "needs",
            "want",
            "like",
        ];
        if before("from") && (!removes || looks.iter().any(|verb| begins(verb))) {
            return Some("from goes with a verb that removes the object");
        }
    }
    None
}

/// Whether an adverb behind a request would belong to a clause of its last part.
fn ends_in_clause(text: &str) -> bool {
    let last = text.rsplit([',']).next().unwrap_or(text);
    let last = last.rsplit(" and ").next().unwrap_or(last);
    let is_in = |clause: &str| last.contains(&format!(" {clause} "));
    IN_CLAUSE.iter().any(|clause| is_in(clause))
}

/// Every object and drawer, each on each area, and every goal.
fn world() -> (Grammar, Scene) {
    let (grammar, home) = (made_up::grammar(), made_up::home());
    let mut scene = home.scene(&|_| true);
    for kind in home.kinds.keys() {
        let at = [0.0; 3];
        scene.add(kind, home.words_of(kind), Role::Object, at, Some("shelf"));
    }
    if scene.areas.iter().all(|area| area.name != "floor") {
        let mut floor = scene.areas[0].clone();
        floor.name = "floor".to_owned();
        scene.areas.push(floor);
    }
    (grammar, scene)
}

/// Verbs with their possible goals.
fn verbs(scene: &Scene) -> Vec<(Verb, Option<usize>)> {
    let goals = ["placemat", "bear_cushion", "table_bin"];
    let put = goals.map(|name| (Verb::Put, Some(scene.named(name).expect("a goal"))));
    let others = [Verb::Lift, Verb::Open, Verb::Close, Verb::Bring, Verb::Give];
    put.into_iter()
        .chain(others.map(|verb| (verb, None)))
        .collect()
}

fn colours(grammar: &Grammar, colour: &str) -> Vec<Option<usize>> {
    let all = grammar.colours.iter().enumerate();
    let own = all.filter(|(_, c)| c.name == colour && c.is_spoken);
    std::iter::once(None)
        .chain(own.map(|(i, _)| Some(i)))
        .collect()
}

/// Places of an area with all spoken or understood prepositions.
fn places<'a>(grammar: &'a Grammar, area: &str) -> Vec<At<'a>> {
    let all = grammar.places.iter().enumerate();
    let own = all.filter(|(_, place)| place.area == area && place.of.is_generated);
    own.flat_map(|(i, place)| {
        let lists = place.on.iter().chain(&place.from).chain(&place.understood);
        lists.map(move |preposition| (i, preposition.as_str()))
    })
    .collect()
}

/// One name for each agreement class of the object.
fn classes(grammar: &Grammar, scene: &Scene, target: usize) -> Vec<usize> {
    let mut classes = BTreeSet::new();
    let all = grammar.nouns.iter().enumerate();
    let own =
        all.filter(|(_, noun)| is_called(noun, &scene.entities[target]) && noun.of.is_generated);
    let class = |noun: &Noun| {
        (
            noun.number,
            noun.is_contents,
            noun.takes_colour,
            noun.has_tail,
        )
    };
    own.filter(|(_, noun)| classes.insert(class(noun)))
        .map(|(i, _)| i)
        .collect()
}

fn name_of<'a>(grammar: &'a Grammar, target: &str) -> (usize, &'a str) {
    let all = grammar.nouns.iter().enumerate();
    let mut own = all
        .filter(|(_, noun)| noun.names == Names::Goal(target.to_owned()) && noun.of.is_generated);
    let (i, noun) = own.next().expect("a name");
    (i, &noun.text)
}

/// Phrases of one verb, object and place: all of them, with every name and color.
#[test]
fn every_phrase_of_every_object_at_every_place_keeps_the_rules() {
    let (grammar, mut scene) = world();
    let mut count = 0;
    let other = grammar
        .nouns
        .iter()
        .position(|n| n.text == "bowl")
        .expect("a bowl");
    let other = Some(Named {
        colour: None,
        noun: other,
    });
    for target in 0..scene.entities.len() {
        for area in 0..scene.areas.len() {
            scene.entities[target].area = Some(area);
            let (entity, area) = (&scene.entities[target], &scene.areas[area].name);
            if entity.role == Role::Goal {
                continue;
            }
            let own = |noun: &&Noun| is_called(noun, entity) && noun.of.is_generated;
            let places = places(&grammar, area);
            for (phrase, (noun, colour)) in grammar
                .phrases
                .iter()
                .filter(|p| p.of.is_generated)
                .flat_map(|phrase| {
                    let nouns = grammar
                        .nouns
                        .iter()
                        .enumerate()
                        .filter(|(_, noun)| own(noun));
                    nouns
                        .flat_map(|(i, _)| {
                            colours(&grammar, &entity.colour)
                                .into_iter()
                                .map(move |c| (i, c))
                        })
                        .map(move |named| (phrase, named))
                })
            {
                let has_place = phrase.pattern.has_any(&Slot::PLACES);
                let places = if has_place { &places[..] } else { &[(0, "on")] };
                let is_counted = phrase.pattern.has(Slot::Nth);
                let numbers: &[usize] = if is_counted { &[0, 1] } else { &[1] };
                for (at, nth) in places
                    .iter()
                    .flat_map(|at| numbers.iter().map(move |nth| (at, *nth)))
                {
                    let words = ObjectWords {
                        phrase,
                        name: Named { colour, noun },
                        at: Some(*at),
                        other,
                        nth: Some(nth),
                    };
                    let Some(text) = words.text(&grammar, &entity.kind) else {
                        continue;
                    };
                    count += 1;
                    let worded = GeneratedRequest {
                        text: &text,
                        verb: Verb::Give,
                        kind: &entity.kind,
                        noun: &grammar.nouns[noun].text,
                        colour: colour.map(|i| grammar.colours[i].text.as_str()),
                        object: &text,
                        area,
                        // Whether "from" is possible depends on the template.
                        place: (has_place && at.1 != "from")
                            .then(|| grammar.places[at.0].text.as_str()),
                        goal: None,
                    };
                    assert_eq!(broken_rule(&worded), None, "{text}");
                }
            }
        }
    }
    assert!(count > 50_000, "{count}");
}

/// Requests: every template of every verb, with each agreement class of names of each
/// object at each place, in each posture, with each goal.
#[test]
fn every_verb_object_place_and_posture_keeps_the_rules() {
    let (grammar, mut scene) = world();
    let (mut count, mut with_adverb) = (0, 0);
    for (verb, goal) in verbs(&scene) {
        for target in 0..scene.entities.len() {
            if scene.entities[target].role != crate::parse::role(verb) {
                continue;
            }
            let nouns = classes(&grammar, &scene, target);
            for area in 0..scene.areas.len() {
                scene.entities[target].area = Some(area);
                let meaning = Meaning { verb, target, goal };
                let [all, able] = requests(&grammar, &scene, meaning, &nouns);
                count += all;
                with_adverb += able;
            }
        }
    }
    assert!(
        count > 100_000 && with_adverb > 10_000,
        "{count} {with_adverb}"
    );
}

/// Checks the requests of one meaning; returns their number, and that of those behind
/// which an adverb may be spoken.
fn requests(grammar: &Grammar, scene: &Scene, meaning: Meaning, nouns: &[usize]) -> [usize; 2] {
    let entity = &scene.entities[meaning.target];
    let area = &scene.areas[entity.area.expect("an area")].name;
    let goal = meaning.goal.map(|goal| {
        let name = &scene.entities[goal].name;
        let (noun, text) = name_of(grammar, name);
        (noun, (name.as_str(), text))
    });
    // One name for each preposition: the phrase test covers all names.
    let mut kinds = BTreeSet::new();
    let mut places = places(grammar, area);
    places.retain(|(place, preposition)| {
        kinds.insert((*preposition, grammar.places[*place].is_drive))
    });
    let of_verb = |t: &&Template| t.verb == meaning.verb && t.of.is_generated && t.wants.is_empty();
    let plain = |p: &&Phrase| {
        let of_few = Means::Order(Order::Left, None);
        let is_plain = matches!(p.means, Means::Plain | Means::Beside(Side::Left));
        p.of.is_generated && (is_plain || p.means == of_few)
    };
    let other = grammar.nouns.iter().position(|n| n.text == "bowl");
    let (mut count, mut with_adverb) = (0, 0);
    for template in grammar.templates.iter().filter(of_verb) {
        for phrase in grammar.phrases.iter().filter(plain) {
            for (&noun, at) in nouns
                .iter()
                .flat_map(|noun| places.iter().map(move |at| (noun, at)))
            {
                let object = ObjectWords {
                    phrase,
                    name: Named { colour: None, noun },
                    at: Some(*at),
                    other: other.map(|noun| Named { colour: None, noun }),
                    nth: Some(1),
                };
                let words = RequestWords {
                    template,
                    object: Some(object),
                    goal: goal.map(|(noun, _)| noun),
                    place: Some(at.0),
                    at: Some(*at),
                };
                let Some(text) = words.text(grammar, scene, &meaning) else {
                    continue;
                };
                count += 1;
                let worded = GeneratedRequest {
                    text: &text,
                    verb: meaning.verb,
                    kind: &entity.kind,
                    noun: &grammar.nouns[noun].text,
                    colour: None,
                    object: &object.text(grammar, &entity.kind).expect("an object"),
                    area,
                    place: Some(&grammar.places[at.0].text),
                    goal: goal.map(|(_, goal)| goal),
                };
                assert_eq!(broken_rule(&worded), None, "{text}");
                if words.takes_adverb(grammar) {
                    with_adverb += 1;
                    assert!(!ends_in_clause(&text), "{text} now");
                }
            }
        }
    }
    [count, with_adverb]
}

/// The rules detect the faults found in an audit of an earlier grammar.
#[test]
fn sentences_of_the_audit_break_the_rules() {
    let table = |text, verb, kind, noun| GeneratedRequest {
        text,
        verb,
        kind,
        noun,
        colour: None,
        object: text,
        area: "kitchen_table",
        place: Some("the kitchen table"),
        goal: None,
    };
    let bin = Some(("table_bin", "bin"));
    let cases = [
        GeneratedRequest {
            goal: bin,
            ..table("put the can on the bin", Verb::Put, "meat_can", "can")
        },
        GeneratedRequest {
            goal: bin,
            ..table("place the can onto the bin", Verb::Put, "meat_can", "can")
        },
        table("pick up that crackers", Verb::Lift, "crackers", "crackers"),
        table(
            "pick up the crackers and hold it",
            Verb::Lift,
            "crackers",
            "crackers",
        ),
        GeneratedRequest {
            colour: Some("scarlet"),
            ..table("lift the scarlet soup", Verb::Lift, "tomato_soup", "soup")
        },
        GeneratedRequest {
            colour: Some("red"),
            ..table("lift the red soup", Verb::Lift, "tomato_soup", "soup")
        },
        table(
            "lift the knife standing on the kitchen table",
            Verb::Lift,
            "knife",
            "knife",
        ),
        table(
            "lift the bear standing on the kitchen table",
            Verb::Lift,
            "teddy_bear",
            "bear",
        ),
        table(
            "take the remote that stands on the kitchen table",
            Verb::Lift,
            "remote_control",
            "remote",
        ),
        table(
            "locate the bowl off the kitchen table and lift it",
            Verb::Lift,
            "bowl",
            "bowl",
        ),
        table(
            "hold up the bowl from the kitchen table",
            Verb::Lift,
            "bowl",
            "bowl",
        ),
        table("hand me the bowl", Verb::Lift, "bowl", "bowl"),
        table(
            "find the bowl and bring it to me",
            Verb::Lift,
            "bowl",
            "bowl",
        ),
        table("fetch the bowl", Verb::Lift, "bowl", "bowl"),
        table(
            "pick up the bowl that stands on the kitchen table",
            Verb::Lift,
            "bowl",
            "bowl",
        ),
        table(
            "open the first drawer from the top",
            Verb::Open,
            "drawer",
            "drawer",
        ),
        table(
            "open the first drawer counting from the bottom",
            Verb::Open,
            "drawer",
            "drawer",
        ),
        table(
            "lift the can that stands first from the left",
            Verb::Lift,
            "coke",
            "can",
        ),
        table("lift the red tin", Verb::Lift, "coke", "tin"),
        table(
            "drive to the kitchen workstation and open the drawer",
            Verb::Open,
            "drawer",
            "drawer",
        ),
        table(
            "take the kitchen knife from the kitchen table",
            Verb::Lift,
            "knife",
            "kitchen knife",
        ),
    ];
    for case in cases {
        assert!(broken_rule(&case).is_some(), "{}", case.text);
    }
    let fine = table(
        "take the bowl from the kitchen table",
        Verb::Lift,
        "bowl",
        "bowl",
    );
    assert_eq!(broken_rule(&fine), None);
    for clause in [
        "take the cup from the table where we eat",
        "take the second can counting from the left",
        "go to the shelf and take the can that is third from the left",
        "press against the drawer until it is closed",
    ] {
        assert!(ends_in_clause(clause), "{clause} now");
    }
    assert!(!ends_in_clause(
        "go to the table where we eat and take that cup"
    ));
}

/// Every generated template is parsed as its own verb with its own object.
#[test]
fn every_template_is_parsed_to_its_meaning() {
    let (grammar, full) = world();
    let plain = grammar
        .phrases
        .iter()
        .find(|p| p.pattern.text == "the {noun}")
        .expect("a phrase");
    let mut missing: BTreeSet<&str> = BTreeSet::new();
    let mut worded: BTreeSet<&str> = BTreeSet::new();
    for (verb, goal) in verbs(&full) {
        for target in 0..full.entities.len() {
            let entity = &full.entities[target];
            let mut scene = full.clone();
            // Another drawer would also match the name.
            let rest = scene
                .entities
                .iter_mut()
                .enumerate()
                .filter(|(i, t)| *i != target && t.role != Role::Goal);
            rest.for_each(|(_, entity)| {
                entity.kind.clear();
                entity.category.clear();
            });
            if entity.role != crate::parse::role(verb) {
                continue;
            }
            let noun = classes(&grammar, &scene, target)[0];
            let at = match entity.role {
                Role::Slide => "workstation",
                _ => "kitchen_table",
            };
            scene.entities[target].area = scene.areas.iter().position(|area| area.name == at);
            let meaning = Meaning { verb, target, goal };
            let parser = Parser::new(&grammar, &scene);
            for template in grammar
                .templates
                .iter()
                .filter(|t| t.verb == verb && t.of.is_generated && t.wants.is_empty())
            {
                let slot = Slot::PLACES
                    .into_iter()
                    .find(|slot| template.pattern.has(*slot));
                let (place, name) = grammar
                    .places
                    .iter()
                    .enumerate()
                    .find(|(_, p)| p.area == at)
                    .expect("a place");
                let preposition = slot.and_then(|slot| spoken(name, slot).first());
                let words = RequestWords {
                    template,
                    object: Some(ObjectWords {
                        phrase: plain,
                        name: Named { colour: None, noun },
                        at: None,
                        other: None,
                        nth: None,
                    }),
                    goal: goal.map(|goal| name_of(&grammar, &scene.entities[goal].name).0),
                    place: Some(place),
                    at: preposition.map(|p| (place, p.as_str())),
                };
                missing.insert(&template.id);
                let Some(text) = words.text(&grammar, &scene, &meaning) else {
                    continue;
                };
                worded.insert(&template.id);
                assert_eq!(parser.parse(&text), Answer::Clear(meaning), "{text}");
            }
        }
    }
    let missing: Vec<_> = missing.difference(&worded).collect();
    assert!(missing.is_empty(), "never worded: {missing:?}");
}

/// The grammatical number in the files matches the form of the name.
#[test]
fn the_number_of_every_name_matches_its_form() {
    let (grammar, _) = world();
    for noun in &grammar.nouns {
        // "Thermos" looks like a plural but is not one.
        if noun.text == "thermos" {
            continue;
        }
        let is_plural = noun.number == crate::grammar::Number::Plural;
        assert_eq!(crate::is_plural(&noun.text), is_plural, "{}", noun.text);
    }
}
