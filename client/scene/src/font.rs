//! A dot-matrix font for captions, drawn for this project.

/// Dots per row of a glyph.
const WIDTH: usize = 5;

/// Rows of a glyph; the last two lie below the baseline.
pub(crate) const HEIGHT: usize = 9;

/// Dots from one glyph to the next.
const ADVANCE: usize = WIDTH + 1;

/// The first character that has a glyph; the others follow in the order of ASCII.
const FIRST: char = ' ';

/// Width of a text in dots.
pub(crate) fn text_width(text: &str) -> usize {
    (text.chars().count() * ADVANCE).saturating_sub(1)
}

/// Calls `draw(x, y)` for every dot of a text, from its upper left corner.
pub(crate) fn for_each_dot(text: &str, mut draw: impl FnMut(usize, usize)) {
    for (index, character) in text.chars().enumerate() {
        let glyph = glyph(character);
        for dot in 0..WIDTH * HEIGHT {
            if glyph >> (WIDTH * HEIGHT - 1 - dot) & 1 == 1 {
                draw(index * ADVANCE + dot % WIDTH, dot / WIDTH);
            }
        }
    }
}

/// The rows of a character from its top, of [`WIDTH`] bits each, in the lowest bits; the leftmost dot of a row and the first row are
/// the highest. "?" stands for characters without a glyph.
fn glyph(character: char) -> u64 {
    let index = |c: char| (c as usize).checked_sub(FIRST as usize);
    let known = |c: char| index(c).and_then(|index| GLYPHS.get(index)).copied();
    known(character).or_else(|| known('?')).unwrap_or_default()
}

/// The glyphs of printable ASCII in its order.
#[rustfmt::skip]
const GLYPHS: [u64; 95] = [
    0x0000_0000_0000, 0x0421_0840_1000, 0x0a52_8000_0000, 0x0a57_d5f5_2800, 0x047d_1c5f_1000, 0x18c8_8889_8c00,
    0x0c95_1159_3400, 0x0421_0000_0000, 0x0222_1082_0800, 0x0820_8422_2000, 0x0025_5d52_0000, 0x0021_3e42_0000,
    0x0000_0003_1888, 0x0000_3e00_0000, 0x0000_0006_3000, 0x0108_8888_4000, 0x0e8c_eb98_b800, 0x0461_0842_3800,
    0x0e88_4c88_7c00, 0x1f11_0c18_b800, 0x0232_a5f1_0800, 0x1f87_8218_b800, 0x0644_3d18_b800, 0x1f08_8844_2000,
    0x0e8c_5d18_b800, 0x0e8c_5e11_3000, 0x0063_00c6_0000, 0x0001_8c03_1888, 0x0222_2082_0800, 0x0007_c1f0_0000,
    0x0820_8222_2000, 0x0e88_4c40_1000, 0x0e8d_eb78_3800, 0x0e8c_7f18_c400, 0x1e8c_7d18_f800, 0x0e8c_2108_b800,
    0x1c94_6319_7000, 0x1f84_3d08_7c00, 0x1f84_3d08_4000, 0x0e8c_2f18_bc00, 0x118c_7f18_c400, 0x0e21_0842_3800,
    0x0710_8429_3000, 0x1195_3149_4400, 0x1084_2108_7c00, 0x11dd_6b18_c400, 0x11cd_6718_c400, 0x0e8c_6318_b800,
    0x1e8c_7d08_4000, 0x0e8c_6359_3400, 0x1e8c_7d49_4400, 0x0f84_1c10_f800, 0x1f21_0842_1000, 0x118c_6318_b800,
    0x118c_6315_1000, 0x118c_6b5a_a800, 0x118a_88a8_c400, 0x118a_8842_1000, 0x1f08_8888_7c00, 0x0e42_1084_3800,
    0x1082_0820_8400, 0x0e10_8421_3800, 0x0454_4000_0000, 0x0000_0000_03e0, 0x0820_8000_0000, 0x0003_82f8_bc00,
    0x1087_a318_f800, 0x0003_a108_b800, 0x010b_e318_bc00, 0x0003_a3f8_3800, 0x064a_3884_2000, 0x0003_e318_bc2e,
    0x1087_a318_c400, 0x0403_0842_3800, 0x0201_8421_0a4c, 0x1084_a98a_4800, 0x0c21_0842_3800, 0x0006_ab5a_d400,
    0x0007_a318_c400, 0x0003_a318_b800, 0x0007_a318_fa10, 0x0003_e318_bc21, 0x0005_b308_4000, 0x0003_e0e0_f800,
    0x0847_1084_9800, 0x0004_6319_b400, 0x0004_6315_1000, 0x0004_635a_a800, 0x0004_5445_4400, 0x0004_6318_bc2e,
    0x0007_c444_7c00, 0x0221_1042_0800, 0x0421_0842_1084, 0x0821_0442_2000, 0x0002_2a20_0000,
];

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn letter_l_is_a_stroke_and_a_foot() {
        let mut dots = Vec::new();
        for_each_dot(" L", |x, y| dots.push((x, y)));
        let stroke = (0..HEIGHT - 2).map(|y| (ADVANCE, y));
        let foot = (1..WIDTH).map(|x| (ADVANCE + x, HEIGHT - 3));
        assert_eq!(dots, stroke.chain(foot).collect::<Vec<_>>());
        assert_eq!((text_width(" L"), text_width("")), (11, 0));
        assert_eq!(glyph('\u{e9}'), glyph('?'));
        let glyphs: std::collections::HashSet<_> = (' '..='~').map(glyph).collect();
        assert_eq!(glyphs.len(), 95, "every printable character has its own");
    }
}
