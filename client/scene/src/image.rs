//! Images: PNG files, captions and contact sheets.

/// Dots per row of a glyph.
const GLYPH_WIDTH: usize = 5;

/// Rows of a glyph; the last two lie below the baseline.
const GLYPH_HEIGHT: usize = 9;

/// Dots from one glyph to the next.
const ADVANCE: usize = GLYPH_WIDTH + 1;

/// Grey of captions and gaps, sRGB.
const PAPER: u8 = 250;
const INK: u8 = 40;

/// Pixels between the pictures of a sheet.
const GAP: usize = 8;

/// Size of a caption's dots in pixels.
const CAPTION_SCALE: usize = 2;

/// Height of the strip that carries a caption, in pixels.
const CAPTION_HEIGHT: usize = GLYPH_HEIGHT * CAPTION_SCALE + 14;

/// A picture in sRGB, 8 bits per channel.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Image {
    pub(crate) width: usize,
    pub(crate) height: usize,
    /// Red, green, blue; row by row from the top.
    pub(crate) rgb: Vec<u8>,
}

impl Image {
    fn blank(width: usize, height: usize) -> Self {
        let rgb = vec![PAPER; width * height * 3];
        Self { width, height, rgb }
    }

    /// The image as a PNG file.
    pub fn to_png(&self) -> Vec<u8> {
        let mut bytes = Vec::new();
        let mut encoder = png::Encoder::new(&mut bytes, self.width as u32, self.height as u32);
        encoder.set_color(png::ColorType::Rgb);
        encoder.set_depth(png::BitDepth::Eight);
        encoder.set_source_srgb(png::SrgbRenderingIntent::Perceptual);
        encoder
            .write_header()
            .and_then(|mut writer| writer.write_image_data(&self.rgb))
            .expect("writing to memory cannot fail and the image has as many bytes as its size says");
        bytes
    }

    /// The bytes with five bits of each channel: an animation takes a third of the bytes, and its colours hardly show it.
    fn coarse(&self) -> Vec<u8> {
        self.rgb.iter().map(|byte| byte & !7 | byte >> 5).collect()
    }

    /// The same image with a line of text below. Characters outside printable ASCII show as "?"; excess text is cut.
    fn with_caption(&self, caption: &str) -> Self {
        let mut image = Self::blank(self.width, self.height + CAPTION_HEIGHT);
        image.paste(self, 0, 0);
        let text_width = text_width(caption) * CAPTION_SCALE;
        let left = self.width.saturating_sub(text_width) / 2;
        let top = self.height + (CAPTION_HEIGHT - GLYPH_HEIGHT * CAPTION_SCALE) / 2;
        for (dot_x, dot_y) in dots(caption) {
            let start = left + dot_x * CAPTION_SCALE;
            let end = self.width.min(start + CAPTION_SCALE);
            for row in 0..CAPTION_SCALE {
                let line = (top + dot_y * CAPTION_SCALE + row) * self.width;
                image.rgb[3 * (line + start.min(end))..3 * (line + end)].fill(INK);
            }
        }
        image
    }

    /// Copies another image, which must fit.
    fn paste(&mut self, other: &Self, left: usize, top: usize) {
        for (row, pixels) in other.rgb.chunks_exact(other.width * 3).enumerate() {
            let at = ((top + row) * self.width + left) * 3;
            self.rgb[at..at + pixels.len()].copy_from_slice(pixels);
        }
    }
}

/// Images with captions in rows of `columns` (at least 1), each in a cell as large as the largest. `None` without
/// images.
pub fn contact_sheet(images: &[(Image, String)], columns: usize) -> Option<Image> {
    let columns = columns.clamp(1, images.len().max(1));
    let cell_width = images.iter().map(|(image, _)| image.width).max()?;
    let cell_height = images.iter().map(|(image, _)| image.height).max()? + CAPTION_HEIGHT;
    let rows = images.len().div_ceil(columns);
    let mut sheet = Image::blank(
        columns * (cell_width + GAP) + GAP,
        rows * (cell_height + GAP) + GAP,
    );
    for (index, (image, caption)) in images.iter().enumerate() {
        let left = GAP + (index % columns) * (cell_width + GAP) + (cell_width - image.width) / 2;
        let top = GAP + (index / columns) * (cell_height + GAP);
        sheet.paste(&image.with_caption(caption), left, top);
    }
    Some(sheet)
}

/// Images of the same size, `rate` per second, as an animated PNG file in an endless loop.
pub(crate) fn to_animated_png(images: &[Image], rate: u16) -> Vec<u8> {
    let Some(first) = images.first() else {
        return Vec::new();
    };
    let mut bytes = Vec::new();
    let mut encoder = png::Encoder::new(&mut bytes, first.width as u32, first.height as u32);
    encoder.set_color(png::ColorType::Rgb);
    encoder.set_depth(png::BitDepth::Eight);
    encoder.set_source_srgb(png::SrgbRenderingIntent::Perceptual);
    encoder.set_compression(png::Compression::High);
    let written = encoder
        .set_animated(images.len() as u32, 0)
        .and_then(|()| encoder.set_frame_delay(1, rate))
        .and_then(|()| encoder.write_header())
        .and_then(|mut writer| {
            images
                .iter()
                .try_for_each(|image| writer.write_image_data(&image.coarse()))
        });
    written.expect("writing to memory cannot fail and images have as many bytes as their size says");
    bytes
}

fn text_width(text: &str) -> usize {
    (text.chars().count() * ADVANCE).saturating_sub(1)
}

/// The dots of a text, from its upper left corner.
fn dots(text: &str) -> impl Iterator<Item = (usize, usize)> {
    const COUNT: usize = GLYPH_WIDTH * GLYPH_HEIGHT;
    text.chars().enumerate().flat_map(|(index, character)| {
        let glyph = glyph(character);
        let dots = (0..COUNT).filter(move |dot| glyph >> (COUNT - 1 - dot) & 1 == 1);
        dots.map(move |dot| (index * ADVANCE + dot % GLYPH_WIDTH, dot / GLYPH_WIDTH))
    })
}

/// The rows of a character from its top, of [`GLYPH_WIDTH`] bits each, in the lowest bits; the leftmost dot of a row and the first row are
/// the highest. "?" replaces characters without a glyph.
fn glyph(character: char) -> u64 {
    let is_known = (' '..='~').contains(&character);
    GLYPHS[if is_known { character } else { '?' } as usize - ' ' as usize]
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

    fn pixel(image: &Image, x: usize, y: usize) -> &[u8] {
        &image.rgb[(y * image.width + x) * 3..][..3]
    }

    #[test]
    fn sheets_fit_every_cell_with_its_caption() {
        let images: Vec<_> = (0..5)
            .map(|i| {
                let mut image = Image::blank(40 + i, 30);
                for (place, byte) in image.rgb.iter_mut().enumerate() {
                    *byte = (place % 251) as u8;
                }
                (image, "|".to_owned())
            })
            .collect();
        let sheet = contact_sheet(&images, 3).expect("there are images");
        assert_eq!(sheet.width, 3 * (44 + GAP) + GAP);
        assert_eq!(sheet.height, 2 * (30 + CAPTION_HEIGHT + GAP) + GAP);
        // The last image is in the second column of the second row.
        let (left, top) = (GAP + 44 + GAP, GAP + 30 + CAPTION_HEIGHT + GAP);
        for (x, y) in [(0, 0), (43, 29), (7, 11)] {
            assert_eq!(pixel(&sheet, left + x, top + y), pixel(&images[4].0, x, y));
        }
        let below = (0..44).flat_map(|x| (30..30 + CAPTION_HEIGHT).map(move |y| (x, y)));
        let ink = below.filter(|(x, y)| pixel(&sheet, left + x, top + y) == [INK; 3]);
        assert_eq!(ink.count(), GLYPH_HEIGHT * CAPTION_SCALE * CAPTION_SCALE);
        // Decoded independently.
        let mut reader = png::Decoder::new(std::io::Cursor::new(sheet.to_png()))
            .read_info()
            .unwrap();
        let mut pixels = vec![0; reader.output_buffer_size().unwrap()];
        reader.next_frame(&mut pixels).unwrap();
        assert_eq!((reader.info().width as usize, pixels), (sheet.width, sheet.rgb));
    }

    #[test]
    fn letter_l_is_a_stroke_and_a_foot() {
        let stroke = (0..GLYPH_HEIGHT - 2).map(|y| (ADVANCE, y));
        let foot = (1..GLYPH_WIDTH).map(|x| (ADVANCE + x, GLYPH_HEIGHT - 3));
        assert!(dots(" L").eq(stroke.chain(foot)));
        assert_eq!((text_width(" L"), glyph('\u{e9}')), (11, glyph('?')));
    }
}
