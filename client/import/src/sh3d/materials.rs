//! Materials that models use by name without defining them: the default materials of the
//! OBJ loader of Java 3D, which the catalogues of Sweet Home 3D rely on.

use super::Rgb;

/// Names and sRGB colors, sorted by name. The loader's diffuse values were chosen on displays
/// of gamma 1.7; here they are encoded for sRGB.
#[rustfmt::skip]
const COLOURS: [(&str, Rgb); 134] = [
    ("amber", [184, 117, 0]),
    ("amber_trans", [184, 117, 0]),
    ("aqua", [0, 170, 170]),
    ("aqua_filter", [143, 201, 185]),
    ("archwhite", [254, 254, 254]),
    ("archwhite2", [230, 230, 230]),
    ("bflesh", [29, 15, 7]),
    ("black", [7, 7, 7]),
    ("blondhair", [183, 132, 41]),
    ("blue_pure", [0, 0, 255]),
    ("bluegrey", [95, 120, 123]),
    ("bluetint", [42, 209, 248]),
    ("blugrn", [58, 196, 120]),
    ("blutan", [57, 115, 100]),
    ("bluteal", [57, 115, 100]),
    ("bone", [240, 217, 154]),
    ("bone1", [253, 223, 163]),
    ("bone2", [253, 234, 198]),
    ("brass", [165, 98, 0]),
    ("brnhair", [62, 33, 18]),
    ("bronze", [51, 36, 19]),
    ("brown", [60, 21, 0]),
    ("brownlips", [81, 51, 39]),
    ("brownskn", [26, 15, 0]),
    ("brzskin", [144, 123, 102]),
    ("chappie", [186, 93, 36]),
    ("charcoal", [10, 10, 10]),
    ("deepgreen", [0, 26, 11]),
    ("default", [209, 207, 198]),
    ("dkblue", [0, 10, 47]),
    ("dkblue_pure", [0, 0, 78]),
    ("dkbrown", [16, 10, 6]),
    ("dkdkgrey", [19, 19, 19]),
    ("dkgreen", [12, 29, 0]),
    ("dkgrey", [43, 43, 43]),
    ("dkorange", [209, 35, 0]),
    ("dkpurple", [29, 0, 43]),
    ("dkred", [107, 0, 0]),
    ("dkteal", [0, 51, 41]),
    ("emerald", [42, 255, 0]),
    ("fgreen", [0, 41, 3]),
    ("flaqua", [0, 170, 170]),
    ("flblack", [10, 10, 10]),
    ("flblonde", [183, 132, 41]),
    ("flblue_pure", [0, 0, 209]),
    ("flbrown", [70, 19, 5]),
    ("fldkblue_pure", [0, 0, 78]),
    ("fldkdkgrey", [19, 19, 19]),
    ("fldkgreen", [12, 29, 0]),
    ("fldkgreen2", [29, 53, 10]),
    ("fldkgrey", [63, 63, 63]),
    ("fldkolivegreen", [22, 26, 10]),
    ("fldkpurple", [87, 0, 134]),
    ("fldkred", [107, 15, 15]),
    ("flesh", [175, 152, 135]),
    ("fleshtransparent", [205, 124, 77]),
    ("flgrey", [170, 170, 170]),
    ("fllime", [0, 255, 0]),
    ("flltbrown", [120, 71, 45]),
    ("flltgrey", [228, 228, 228]),
    ("flltolivegreen", [38, 45, 17]),
    ("flmintgreen", [77, 123, 89]),
    ("flmustard", [238, 138, 14]),
    ("florange", [255, 89, 0]),
    ("flpinegreen", [68, 104, 60]),
    ("flpurple", [143, 0, 215]),
    ("flred", [255, 0, 0]),
    ("fltan", [200, 161, 77]),
    ("flwhite", [253, 244, 230]),
    ("flwhite1", [255, 255, 255]),
    ("flyellow", [255, 201, 0]),
    ("glass", [167, 168, 176]),
    ("glassblutint", [180, 224, 219]),
    ("glasstransparent", [163, 163, 163]),
    ("gold", [255, 168, 0]),
    ("green", [0, 113, 0]),
    ("greenskn", [0, 55, 0]),
    ("grey", [94, 94, 94]),
    ("hair", [4, 4, 3]),
    ("iris", [0, 47, 130]),
    ("jetflame", [248, 168, 65]),
    ("lavendar", [104, 62, 137]),
    ("lcdgreen", [187, 255, 171]),
    ("lighttan", [207, 153, 105]),
    ("lighttan2", [129, 95, 64]),
    ("lighttan3", [93, 59, 21]),
    ("lighttannew", [222, 190, 131]),
    ("lightyellow", [255, 248, 135]),
    ("lime", [0, 255, 0]),
    ("lips", [244, 116, 123]),
    ("ltbrown", [120, 71, 45]),
    ("ltgrey", [145, 145, 145]),
    ("meh", [180, 224, 219]),
    ("metal", [240, 217, 154]),
    ("mintgrn", [29, 165, 58]),
    ("muscle", [153, 54, 60]),
    ("navy_blue", [0, 0, 45]),
    ("offwhite.cool", [230, 203, 183]),
    ("offwhite.warm", [230, 205, 159]),
    ("olivegreen", [29, 36, 0]),
    ("orange", [255, 89, 0]),
    ("pale_green", [54, 144, 43]),
    ("pale_pink", [198, 100, 152]),
    ("pale_yellow", [205, 193, 99]),
    ("peach", [196, 94, 22]),
    ("periwinkle", [0, 38, 228]),
    ("pink", [253, 90, 202]),
    ("pinktan", [204, 115, 104]),
    ("plasma", [255, 57, 159]),
    ("purple", [170, 0, 255]),
    ("red", [219, 0, 0]),
    ("redbrick", [133, 38, 15]),
    ("redbrown", [121, 13, 0]),
    ("redorange", [216, 24, 0]),
    ("redwood", [115, 34, 0]),
    ("rubber", [17, 17, 17]),
    ("ruby", [255, 0, 0]),
    ("sand_stone", [75, 71, 64]),
    ("sapphire", [28, 0, 255]),
    ("shadow", [35, 29, 25]),
    ("ship2", [255, 255, 255]),
    ("silver", [192, 192, 192]),
    ("skin", [70, 34, 21]),
    ("sky_blue", [75, 188, 224]),
    ("smoked_glass", [10, 10, 10]),
    ("tan", [200, 174, 104]),
    ("taupe", [100, 74, 68]),
    ("teeth", [253, 223, 163]),
    ("violet", [32, 30, 78]),
    ("white", [255, 255, 255]),
    ("yellow", [255, 201, 0]),
    ("yellow_green", [95, 151, 6]),
    ("yellowbrt", [255, 221, 0]),
    ("yelloworng", [237, 113, 0]),
];

/// Transparent ones, sorted by name.
const TRANSPARENT: [&str; 13] = [
    "amber_trans",
    "aqua_filter",
    "bluetint",
    "emerald",
    "fleshtransparent",
    "glassblutint",
    "glasstransparent",
    "meh",
    "plasma",
    "ruby",
    "sapphire",
    "shadow",
    "smoked_glass",
];

/// The color of a material that a model does not define.
#[must_use]
pub fn default_colour(name: &str) -> Option<Rgb> {
    // Exporters number copies: `white.001`.
    let plain = name.split_once(".0").map_or(name, |(plain, _)| plain);
    let found = COLOURS.binary_search_by(|(known, _)| (*known).cmp(plain));
    found.ok().map(|index| COLOURS[index].1)
}

/// The transparency of a material that a model does not define, from 0 (opaque).
#[must_use]
pub fn transparency(name: &str) -> f64 {
    let known = TRANSPARENT.binary_search(&name).is_ok();
    if known { 0.8 } else { 0.0 }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn copies_of_a_material_have_its_colour() {
        assert_eq!(default_colour("white"), Some([255, 255, 255]));
        assert_eq!(default_colour("white.001"), default_colour("white"));
        assert_eq!(
            default_colour("offwhite.warm").map(|c| c[0] > c[2]),
            Some(true)
        );
        assert_eq!(default_colour("no such material"), None);
    }

    #[test]
    fn tables_are_sorted() {
        assert!(COLOURS.is_sorted_by(|a, b| a.0 < b.0));
        assert!(TRANSPARENT.is_sorted());
        assert!(transparency("glassblutint") > 0.5 && transparency("white") < 0.1);
    }
}
