//! Names and categories: words of several languages for rooms and furniture.

/// Longest name of the contract, characters.
const LONGEST: usize = 64;

/// Words of rooms: kind, then parts of names in English, German, French, Spanish, Italian,
/// Dutch, Portuguese. The first match counts.
const ROOMS: [(&str, &[&str]); 20] = [
    ("garage", &["garage", "carport", "garaje", "garagem"]),
    (
        "terrace",
        &[
            "terrace", "terrasse", "terraza", "terrazz", "terras", "terraco", "patio", "deck",
            "porch",
        ],
    ),
    (
        "balcony",
        &["balcon", "balkon", "balcao", "loggia", "varanda"],
    ),
    (
        "garden",
        &[
            "garden", "garten", "jardin", "giardino", "tuin", "jardim", "yard", "lawn", "pool",
        ],
    ),
    ("roof", &["roof", "dach", "toit", "tejado", "tetto"]),
    (
        "bathroom",
        &[
            "bath",
            "bad",
            "salle de bain",
            "salle d'eau",
            "bano",
            "bagno",
            "banheiro",
            "shower",
            "dusche",
            "douche",
        ],
    ),
    ("toilet", &["toilet", "wc", "restroom", "aseo", "klo"]),
    (
        "kitchen",
        &[
            "kitchen", "kuche", "kueche", "cuisine", "cocina", "cucina", "keuken", "cozinha",
            "kochen",
        ],
    ),
    (
        "dining_room",
        &[
            "dining",
            "esszimmer",
            "essen",
            "salle a manger",
            "comedor",
            "pranzo",
            "eetkamer",
            "jantar",
        ],
    ),
    (
        "living_room",
        &[
            "living",
            "wohn",
            "salon",
            "sejour",
            "estar",
            "soggiorno",
            "woonkamer",
            "sala",
            "lounge",
            "family room",
            "stube",
        ],
    ),
    (
        "children_room",
        &[
            "child", "kinder", "enfant", "nino", "bambin", "nursery", "kids", "crianca",
        ],
    ),
    (
        "bedroom",
        &[
            "bedr",
            "bed room",
            "schlaf",
            "chambre",
            "dormitor",
            "habitacion",
            "camera",
            "letto",
            "slaapkamer",
            "quarto",
            "guest",
            "gast",
        ],
    ),
    (
        "office",
        &[
            "office",
            "buro",
            "buero",
            "bureau",
            "study",
            "arbeits",
            "oficina",
            "despacho",
            "studio",
            "kantoor",
            "escritorio",
        ],
    ),
    (
        "laundry",
        &[
            "laundry",
            "wasch",
            "buanderie",
            "lavander",
            "utility",
            "hauswirtschaft",
        ],
    ),
    (
        "dressing_room",
        &[
            "dressing", "wardrobe", "ankleide", "closet", "vestidor", "armario", "cabina",
        ],
    ),
    (
        "storage",
        &[
            "storage",
            "store",
            "abstell",
            "lager",
            "cellier",
            "debarras",
            "pantry",
            "speise",
            "trastero",
            "despensa",
            "ripostiglio",
            "berging",
        ],
    ),
    (
        "attic",
        &[
            "attic",
            "dachboden",
            "grenier",
            "atico",
            "soffitta",
            "zolder",
        ],
    ),
    (
        "cellar",
        &[
            "cellar", "keller", "cave", "basement", "sotano", "cantina", "kelder",
        ],
    ),
    (
        "corridor",
        &[
            "corridor",
            "gang",
            "couloir",
            "pasillo",
            "corridoio",
            "corredor",
            "landing",
            "degagement",
        ],
    ),
    (
        "hall",
        &[
            "hall", "flur", "diele", "entree", "entrance", "entry", "eingang", "entrada",
            "ingresso", "foyer", "vestibul",
        ],
    ),
];

/// Kinds of rooms that are outside, or not lived in: no start of the chair.
const OUTSIDE: [&str; 5] = ["garage", "terrace", "balcony", "garden", "roof"];

/// A category of furniture.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Category {
    /// Its word.
    pub word: &'static str,
    /// Whether it can carry objects.
    pub carries: bool,
    /// Parts of names.
    names: &'static [&'static str],
}

const fn category(word: &'static str, carries: bool, names: &'static [&'static str]) -> Category {
    Category {
        word,
        carries,
        names,
    }
}

/// Categories; the first match counts.
#[rustfmt::skip]
const CATEGORIES: [Category; 51] = [
    category("washbasin", true, &["washbasin", "waschbecken", "waschtisch", "lavabo", "lavandino", "wastafel"]),
    category("washing_machine", true, &["clotheswasher", "washing", "waschmaschine", "lave linge", "lave-linge", "lavadora", "lavatrice", "dryer"]),
    category("dishwasher", true, &["dishwasher", "spulmaschine", "geschirrspul", "lave-vaisselle", "lavavajillas", "lavastoviglie"]),
    category("bedside_table", true, &["bedside", "nachttisch", "night stand", "nightstand", "chevet", "mesita"]),
    category("coffee_table", true, &["coffeetable", "coffee table", "couchtisch", "table basse", "mesa de centro"]),
    category("bed", false, &["bed", "bett", "lit ", "cama", "letto", "crib", "matress", "mattress"]),
    category("sofa", false, &["sofa", "couch", "canape", "divan", "bank"]),
    category("armchair", false, &["armchair", "sessel", "fauteuil", "sillon", "poltrona"]),
    category("stool", false, &["stool", "hocker", "tabouret", "taburete", "sgabello", "pouf", "pouffe"]),
    category("chair", false, &["chair", "stuhl", "chaise", "silla", "sedia", "stoel", "cadeira"]),
    category("desk", true, &["desk", "schreibtisch", "bureau", "escritorio", "scrivania"]),
    category("table", true, &["table", "tisch", "mesa", "tavolo", "tafel"]),
    category("upper_cabinet", false, &["uppercabinet", "upper cabinet", "hangeschrank", "oberschrank", "wall cabinet"]),
    category("sink", true, &["sink", "spule", "spuele", "evier", "fregadero", "lavello"]),
    category("oven", true, &["oven", "backofen", "four ", "horno", "forno"]),
    category("cooker", true, &["cooker", "stove", "herd", "cuisiniere", "cocina", "fornello", "hob"]),
    category("hood", false, &["hood", "dunstabzug", "hotte", "campana", "cappa"]),
    category("fridge", true, &["fridge", "refrigerator", "freezer", "kuhlschrank", "frigo", "nevera", "koelkast"]),
    category("microwave", true, &["microwave", "mikrowelle", "micro-onde", "microondas"]),
    category("kitchen_cabinet", true, &["kitchencabinet", "kitchen cabinet", "unterschrank", "kuchenschrank"]),
    category("bookcase", true, &["bookcase", "bookshelf", "bucherregal", "bibliotheque", "libreria", "estanteria"]),
    category("shelf", true, &["shel", "regal", "etagere", "estante", "scaffale", "rack"]),
    category("wardrobe", true, &["wardrobe", "kleiderschrank", "armoire", "armario", "guardaroba", "closet"]),
    category("dresser", true, &["dresser", "chest", "kommode", "commode", "comoda", "cassettiera", "buffet", "sideboard", "drawers"]),
    category("cabinet", true, &["cabinet", "schrank", "placard", "kast", "cupboard"]),
    category("toilet", false, &["toilet", "wc", "inodoro"]),
    category("bath", false, &["bath", "badewanne", "baignoire", "banera", "vasca", "tub"]),
    category("shower", false, &["shower", "dusche", "douche", "ducha", "doccia"]),
    category("radiator", false, &["radiator", "heizkorper", "heizung", "radiateur", "radiador", "hotwaterradiator"]),
    category("fireplace", false, &["fireplace", "kamin", "cheminee", "chimenea", "camino"]),
    category("stairs", false, &["stair", "treppe", "escalier", "escalera", "scala", "trap ", "ladder"]),
    category("railing", false, &["railing", "gelander", "rampe", "barandilla", "fence", "zaun", "baluster"]),
    category("television", false, &["television", "fernseh", "televis", "tv"]),
    category("computer", false, &["computer", "laptop", "ordinateur", "monitor", "screen"]),
    category("lamp", false, &["lamp", "light", "uplight", "spot", "leuchte", "lampe", "pendant", "halogen"]),
    category("plant", false, &["plant", "flower", "blume", "pflanze", "fleur", "tree", "baum"]),
    category("mirror", false, &["mirror", "spiegel", "miroir", "espejo", "specchio"]),
    category("painting", false, &["pictur", "frame", "painting", "bild", "tableau", "cuadro", "poster"]),
    category("curtain", false, &["curtain", "vorhang", "gardine", "rideau", "cortina", "tenda", "blind", "rollo", "jalousie", "store"]),
    category("rug", false, &["rug", "carpet", "teppich", "tapis", "alfombra", "tappeto", "mat "]),
    category("piano", false, &["piano", "klavier", "flugel"]),
    category("aquarium", false, &["aquarium"]),
    category("books", false, &["book", "buch", "livre", "magazine"]),
    category("mannequin", false, &["mannequin", "person", "man ", "woman"]),
    category("car", false, &["car ", "auto", "voiture", "truck"]),
    category("window", false, &["window", "fenster", "fenetre", "ventana", "finestra", "raam", "janela", "pane"]),
    category("door", false, &["door", "tur ", "tuer", "porte", "puerta", "porta", "deur", "gate"]),
    category("box", true, &["texturablebox", "box", "wurfel", "cube"]),
    category("cylinder", false, &["cylinder", "zylinder"]),
    category("triangle", false, &["triangle", "dreieck"]),
    category("doorway", false, &["doorway", "frame"]),
];

/// What no category names.
pub const OTHER: Category = category("furniture", true, &[]);

/// What lamps are.
pub const LAMP: Category = category("lamp", false, &[]);

/// A door or a window: by its words, otherwise a window when it `is_high`.
#[must_use]
pub fn of_opening(catalogue: &str, name: &str, is_high: bool) -> Category {
    let found = category_of(catalogue, name).word;
    let is_window = found == "window" || (found != "door" && is_high);
    category(if is_window { "window" } else { "door" }, false, &[])
}

/// The kind of a room by its name; empty when no word is known.
#[must_use]
pub fn room_kind(name: &str) -> &'static str {
    let plain = plain(name);
    let found = ROOMS
        .iter()
        .find(|(_, words)| words.iter().any(|word| plain.contains(word)));
    found.map_or("", |(kind, _)| kind)
}

/// Whether rooms of this kind are outside the home.
#[must_use]
pub fn is_outside(kind: &str) -> bool {
    OUTSIDE.contains(&kind)
}

/// The category of a piece by its identifier in a catalogue, else by its name.
#[must_use]
pub fn category_of(catalogue: &str, name: &str) -> Category {
    let id = catalogue.split_once('#').map_or(catalogue, |(_, id)| id);
    let by = |text: &str| {
        let plain = plain(text) + " ";
        let found = CATEGORIES
            .iter()
            .find(|category| category.names.iter().any(|word| plain.contains(word)));
        found.copied()
    };
    // Boxes and cylinders of the catalogue are what their users name them.
    let is_shape = plain(id).starts_with("texturable");
    let (first, second) = if is_shape { (name, id) } else { (id, name) };
    by(first).or_else(|| by(second)).unwrap_or(OTHER)
}

/// Whether a piece is of a kind that `--without` names: its category, or a part of its name.
#[must_use]
pub fn is_of(word: &str, category: &str, name: &str) -> bool {
    let word = plain(word);
    let singular = word.strip_suffix('s').unwrap_or(&word);
    let of_category = category == word || category == singular;
    let is_seat = singular == "chair" && category == "stool";
    of_category || is_seat || (singular.len() >= 4 && plain(name).contains(singular))
}

/// A name of the contract from a text: lower case, `_` between words, at most `most`
/// characters.
#[must_use]
pub fn slug(text: &str, most: usize) -> String {
    let mut name = String::new();
    for c in plain(text).chars() {
        if c.is_ascii_alphanumeric() {
            name.push(c);
        } else if !name.is_empty() && !name.ends_with('_') {
            name.push('_');
        }
    }
    name.truncate(most.min(LONGEST));
    name.trim_matches('_').to_owned()
}

/// Words of a name in camel case, as identifiers of catalogues are.
#[must_use]
pub fn split_camel(text: &str) -> String {
    let mut split = String::new();
    let mut before = ' ';
    for c in text.chars() {
        if c.is_uppercase() && (before.is_lowercase() || before.is_ascii_digit()) {
            split.push(' ');
        }
        split.push(c);
        before = c;
    }
    split
}

/// Lower case without accents.
fn plain(text: &str) -> String {
    let mut plain = String::new();
    for c in text.chars().flat_map(char::to_lowercase) {
        match c {
            'à'..='å' | 'ā' | 'ă' | 'ą' => plain.push('a'),
            'æ' => plain.push_str("ae"),
            'ç' | 'ć' | 'č' => plain.push('c'),
            'è'..='ë' | 'ē' | 'ę' | 'ě' => plain.push('e'),
            'ì'..='ï' | 'ī' => plain.push('i'),
            'ñ' | 'ń' | 'ň' => plain.push('n'),
            'ò'..='ö' | 'ø' | 'ō' | 'ő' => plain.push('o'),
            'œ' => plain.push_str("oe"),
            'ù'..='ü' | 'ū' | 'ů' | 'ű' => plain.push('u'),
            'ý' | 'ÿ' => plain.push('y'),
            'ß' => plain.push_str("ss"),
            'ś' | 'š' => plain.push('s'),
            'ź' | 'ż' | 'ž' => plain.push('z'),
            'ł' => plain.push('l'),
            'ř' => plain.push('r'),
            c => plain.push(c),
        }
    }
    plain
}

/// A license as an SPDX identifier, when the text names one that homes and models use.
#[must_use]
pub fn spdx(text: &str) -> Option<&'static str> {
    let text = text.to_ascii_lowercase();
    let has = |word: &str| text.contains(word);
    if has("cc0") || has("public domain") {
        Some("CC0-1.0")
    } else if has("noncommercial") || has("non-commercial") || has("by-nc") {
        // The version is open in most texts; every version forbids commercial use.
        Some(match has("share") || has("-sa") {
            true => "CC-BY-NC-SA-4.0",
            false => "CC-BY-NC-4.0",
        })
    } else if has("cc-by") || has("cc by") || has("attribution") {
        let four = has("4.0");
        Some(match has("share") || has("-sa") {
            true if four => "CC-BY-SA-4.0",
            true => "CC-BY-SA-3.0",
            false if four => "CC-BY-4.0",
            false => "CC-BY-3.0",
        })
    } else if has("free art") || has("art libre") {
        Some("LAL-1.3")
    } else if has("gpl") || has("gnu general") {
        Some("GPL-2.0-or-later")
    } else {
        None
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rooms_are_known_in_several_languages() {
        for (name, kind) in [
            ("Kitchen", "kitchen"),
            ("Küche", "kitchen"),
            ("Cuisine", "kitchen"),
            ("Salle de bains", "bathroom"),
            ("Bad / WC", "bathroom"),
            ("Bedroom #2", "bedroom"),
            ("Bedrom #3", "bedroom"),
            ("Schlafzimmer", "bedroom"),
            ("Dormitorio 1", "bedroom"),
            ("Living Room", "living_room"),
            ("Wohnzimmer", "living_room"),
            ("Terrasse", "terrace"),
            ("Flur", "hall"),
            ("42", ""),
        ] {
            assert_eq!(room_kind(name), kind, "{name}");
        }
        assert!(is_outside("terrace") && !is_outside("kitchen"));
    }

    #[test]
    fn pieces_have_categories() {
        for (catalogue, name, word) in [
            ("eTeks#armchair", "Fauteuil", "armchair"),
            ("eTeks#kitchenUpperCabinet", "", "upper_cabinet"),
            ("eTeks#squareTable", "Tisch", "table"),
            ("eTeks#coffeeTable", "", "coffee_table"),
            ("eTeks#hotWaterRadiator", "", "radiator"),
            ("eTeks#bed140x190", "", "bed"),
            ("eTeks#texturableBox", "Mirror", "mirror"),
            ("eTeks#texturableBox", "Box", "box"),
            ("eTeks#fridgeFreezer", "", "fridge"),
            ("", "Kühlschrank", "fridge"),
            ("", "xyz", "furniture"),
        ] {
            assert_eq!(
                category_of(catalogue, name).word,
                word,
                "{catalogue} {name}"
            );
        }
    }

    #[test]
    fn names_follow_the_contract() {
        for text in [
            "Fridge & Freezer",
            "Büro-Tisch Ø 80",
            "日本",
            "",
            &"long ".repeat(40),
        ] {
            let name = slug(text, 40);
            assert!(name.len() <= 40);
            assert!(
                name.is_empty() || wheelarm_proto::keys::check_name(&name).is_ok(),
                "{name}"
            );
        }
        assert_eq!(slug("Fridge & Freezer", 40), "fridge_freezer");
        assert_eq!(
            slug(&split_camel("kitchenUpperCabinet"), 64),
            "kitchen_upper_cabinet"
        );
    }

    #[test]
    fn pieces_can_be_left_out_by_words() {
        assert!(is_of("chairs", "chair", "Stuhl"));
        assert!(is_of("chairs", "stool", "Hocker"));
        assert!(!is_of("chairs", "table", "Table"));
        assert!(is_of("rugs", "rug", ""));
        assert!(is_of("piano", "piano", ""));
    }

    #[test]
    fn licenses_are_read() {
        let of_examples =
            "CC-BY Creative Commons Attribution 3.0 Unported license or GNU General Public License";
        assert_eq!(spdx(of_examples), Some("CC-BY-3.0"));
        assert_eq!(spdx("CC0 1.0"), Some("CC0-1.0"));
        assert_eq!(spdx("CC-BY-NC NonCommercial"), Some("CC-BY-NC-4.0"));
        assert_eq!(
            spdx("Attribution-NonCommercial-ShareAlike"),
            Some("CC-BY-NC-SA-4.0")
        );
        assert_eq!(spdx("all rights reserved"), None);
    }
}
