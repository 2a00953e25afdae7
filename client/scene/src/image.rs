//! Images: PNG files, captions and contact sheets.

use crate::font;

/// Grey of captions and gaps, sRGB.
const PAPER: u8 = 250;
const INK: u8 = 40;

/// Pixels between the pictures of a sheet.
const GAP: usize = 8;

/// Size of a caption's dots in pixels.
const CAPTION_SCALE: usize = 2;

/// Height of the strip that carries a caption, in pixels.
const CAPTION_HEIGHT: usize = font::HEIGHT * CAPTION_SCALE + 14;

/// A picture in sRGB, 8 bits per channel.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Image {
    width: usize,
    height: usize,
    /// Red, green, blue; row by row from the top.
    rgb: Vec<u8>,
}

impl Image {
    /// An image from its pixels: red, green and blue bytes, row by row from the top.
    ///
    /// # Panics
    /// The number of bytes is not 3 × width × height, or 0.
    pub fn from_rgb(width: usize, height: usize, rgb: Vec<u8>) -> Self {
        assert!(width > 0 && height > 0, "an image has at least one pixel");
        assert_eq!(
            rgb.len(),
            width * height * 3,
            "bytes of a {width} x {height} image"
        );
        Self { width, height, rgb }
    }

    fn blank(width: usize, height: usize) -> Self {
        Self::from_rgb(width, height, vec![PAPER; width * height * 3])
    }

    /// Pixels per row.
    pub fn width(&self) -> usize {
        self.width
    }

    /// Number of rows.
    pub fn height(&self) -> usize {
        self.height
    }

    /// The pixels' red, green and blue bytes, row by row from the top.
    pub fn rgb(&self) -> &[u8] {
        &self.rgb
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

    /// The same image with a line of text below. Characters outside printable ASCII show as "?"; excess text is cut.
    fn with_caption(&self, caption: &str) -> Self {
        let mut image = Self::blank(self.width, self.height + CAPTION_HEIGHT);
        image.paste(self, 0, 0);
        let text_width = font::text_width(caption) * CAPTION_SCALE;
        let left = self.width.saturating_sub(text_width) / 2;
        let top = self.height + (CAPTION_HEIGHT - font::HEIGHT * CAPTION_SCALE) / 2;
        font::for_each_dot(caption, |dot_x, dot_y| {
            for y in 0..CAPTION_SCALE {
                for x in 0..CAPTION_SCALE {
                    image.set(
                        left + dot_x * CAPTION_SCALE + x,
                        top + dot_y * CAPTION_SCALE + y,
                        [INK; 3],
                    );
                }
            }
        });
        image
    }

    fn set(&mut self, x: usize, y: usize, colour: [u8; 3]) {
        if x < self.width && y < self.height {
            let at = (y * self.width + x) * 3;
            self.rgb[at..at + 3].copy_from_slice(&colour);
        }
    }

    /// Copies another image, which must fit.
    fn paste(&mut self, other: &Self, left: usize, top: usize) {
        for (row, pixels) in other.rgb.chunks_exact(other.width * 3).enumerate() {
            let at = ((top + row) * self.width + left) * 3;
            self.rgb[at..at + pixels.len()].copy_from_slice(pixels);
        }
    }
}

/// Two images side by side, tops aligned.
pub fn side_by_side(left: &Image, right: &Image) -> Image {
    let mut image = Image::blank(left.width + GAP + right.width, left.height.max(right.height));
    image.paste(left, 0, 0);
    image.paste(right, left.width + GAP, 0);
    image
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

#[cfg(test)]
mod tests {
    use super::*;

    fn gradient(width: usize, height: usize) -> Image {
        let rgb = (0..width * height)
            .flat_map(|i| [(i % 251) as u8, (i / 3 % 256) as u8, 90])
            .collect();
        Image::from_rgb(width, height, rgb)
    }

    fn pixel(image: &Image, x: usize, y: usize) -> &[u8] {
        &image.rgb[(y * image.width + x) * 3..][..3]
    }

    #[test]
    fn png_decodes_to_the_same_pixels() {
        let image = gradient(37, 23);
        let bytes = image.to_png();
        let mut reader = png::Decoder::new(std::io::Cursor::new(&bytes))
            .read_info()
            .expect("a header");
        let mut pixels = vec![0; reader.output_buffer_size().expect("a small image")];
        let info = reader.next_frame(&mut pixels).expect("pixels");
        assert_eq!(
            (info.width, info.height, info.color_type),
            (37, 23, png::ColorType::Rgb)
        );
        assert_eq!(&pixels[..info.buffer_size()], image.rgb());
    }

    #[test]
    fn sheets_fit_every_cell_with_its_caption() {
        let images: Vec<_> = (0..5).map(|i| (gradient(40 + i, 30), "|".to_owned())).collect();
        let sheet = contact_sheet(&images, 3).expect("there are images");
        assert_eq!(sheet.width(), 3 * (44 + GAP) + GAP);
        assert_eq!(sheet.height(), 2 * (30 + CAPTION_HEIGHT + GAP) + GAP);
        // The last image is in the second column of the second row.
        let (left, top) = (GAP + 44 + GAP, GAP + 30 + CAPTION_HEIGHT + GAP);
        for (x, y) in [(0, 0), (43, 29), (7, 11)] {
            assert_eq!(pixel(&sheet, left + x, top + y), pixel(&images[4].0, x, y));
        }
        let below = (0..44).flat_map(|x| (30..30 + CAPTION_HEIGHT).map(move |y| (x, y)));
        let ink = below
            .filter(|(x, y)| pixel(&sheet, left + x, top + y) == [INK; 3])
            .count();
        assert_eq!(ink, font::HEIGHT * CAPTION_SCALE * CAPTION_SCALE);
        assert!(contact_sheet(&[], 3).is_none());
        assert_eq!(contact_sheet(&images[..1], 9).expect("one").width(), 40 + 2 * GAP);
    }
}
