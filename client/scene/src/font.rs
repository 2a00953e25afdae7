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
    0x000000000000, 0x042108401000, 0x0a5280000000, 0x0a57d5f52800, 0x047d1c5f1000, 0x18c888898c00,
    0x0c9511593400, 0x042100000000, 0x022210820800, 0x082084222000, 0x00255d520000, 0x00213e420000,
    0x000000031888, 0x00003e000000, 0x000000063000, 0x010888884000, 0x0e8ceb98b800, 0x046108423800,
    0x0e884c887c00, 0x1f110c18b800, 0x0232a5f10800, 0x1f878218b800, 0x06443d18b800, 0x1f0888442000,
    0x0e8c5d18b800, 0x0e8c5e113000, 0x006300c60000, 0x00018c031888, 0x022220820800, 0x0007c1f00000,
    0x082082222000, 0x0e884c401000, 0x0e8deb783800, 0x0e8c7f18c400, 0x1e8c7d18f800, 0x0e8c2108b800,
    0x1c9463197000, 0x1f843d087c00, 0x1f843d084000, 0x0e8c2f18bc00, 0x118c7f18c400, 0x0e2108423800,
    0x071084293000, 0x119531494400, 0x108421087c00, 0x11dd6b18c400, 0x11cd6718c400, 0x0e8c6318b800,
    0x1e8c7d084000, 0x0e8c63593400, 0x1e8c7d494400, 0x0f841c10f800, 0x1f2108421000, 0x118c6318b800,
    0x118c63151000, 0x118c6b5aa800, 0x118a88a8c400, 0x118a88421000, 0x1f0888887c00, 0x0e4210843800,
    0x108208208400, 0x0e1084213800, 0x045440000000, 0x0000000003e0, 0x082080000000, 0x000382f8bc00,
    0x1087a318f800, 0x0003a108b800, 0x010be318bc00, 0x0003a3f83800, 0x064a38842000, 0x0003e318bc2e,
    0x1087a318c400, 0x040308423800, 0x020184210a4c, 0x1084a98a4800, 0x0c2108423800, 0x0006ab5ad400,
    0x0007a318c400, 0x0003a318b800, 0x0007a318fa10, 0x0003e318bc21, 0x0005b3084000, 0x0003e0e0f800,
    0x084710849800, 0x00046319b400, 0x000463151000, 0x0004635aa800, 0x000454454400, 0x00046318bc2e,
    0x0007c4447c00, 0x022110420800, 0x042108421084, 0x082104422000, 0x00022a200000,
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
