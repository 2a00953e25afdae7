//! Big-endian numbers as bytes.

use super::AtlasError;

/// Appends numbers.
#[derive(Debug, Default)]
pub(super) struct Writer(Vec<u8>);

impl Writer {
    pub(super) fn into_bytes(self) -> Vec<u8> {
        self.0
    }

    pub(super) fn bytes(&mut self, bytes: &[u8]) {
        self.0.extend_from_slice(bytes);
    }

    pub(super) fn u8(&mut self, number: u8) {
        self.0.push(number);
    }

    pub(super) fn u16(&mut self, number: u16) {
        self.bytes(&number.to_be_bytes());
    }

    pub(super) fn u32(&mut self, number: u32) {
        self.bytes(&number.to_be_bytes());
    }

    pub(super) fn u64(&mut self, number: u64) {
        self.bytes(&number.to_be_bytes());
    }

    pub(super) fn floats(&mut self, numbers: &[f32]) {
        for number in numbers {
            self.bytes(&number.to_be_bytes());
        }
    }

    /// A variable-length number: seven bits per byte, lowest first.
    pub(super) fn varint(&mut self, mut number: u64) {
        while number >= 0x80 {
            self.u8(number as u8 | 0x80);
            number >>= 7;
        }
        self.u8(number as u8);
    }
}

/// Reads numbers from the front.
#[derive(Debug)]
pub(super) struct Reader<'a>(&'a [u8]);

impl<'a> Reader<'a> {
    pub(super) fn new(bytes: &'a [u8]) -> Self {
        Self(bytes)
    }

    /// The number of bytes left.
    pub(super) fn remaining(&self) -> usize {
        self.0.len()
    }

    pub(super) fn skip(&mut self, count: usize) -> Result<(), AtlasError> {
        self.0 = self
            .0
            .get(count..)
            .ok_or(AtlasError::Malformed("unexpected end"))?;
        Ok(())
    }

    pub(super) fn array<const N: usize>(&mut self) -> Result<[u8; N], AtlasError> {
        let (array, rest) = self
            .0
            .split_first_chunk()
            .ok_or(AtlasError::Malformed("unexpected end"))?;
        self.0 = rest;
        Ok(*array)
    }

    pub(super) fn u8(&mut self) -> Result<u8, AtlasError> {
        self.array().map(u8::from_be_bytes)
    }

    pub(super) fn u16(&mut self) -> Result<u16, AtlasError> {
        self.array().map(u16::from_be_bytes)
    }

    pub(super) fn u32(&mut self) -> Result<u32, AtlasError> {
        self.array().map(u32::from_be_bytes)
    }

    pub(super) fn u64(&mut self) -> Result<u64, AtlasError> {
        self.array().map(u64::from_be_bytes)
    }

    /// A finite number.
    pub(super) fn float(&mut self) -> Result<f32, AtlasError> {
        let number = f32::from_bits(self.u32()?);
        if number.is_finite() {
            Ok(number)
        } else {
            Err(AtlasError::Malformed("a number is not finite"))
        }
    }

    pub(super) fn floats<const N: usize>(&mut self) -> Result<[f32; N], AtlasError> {
        let mut floats = [0.0; N];
        for float in &mut floats {
            *float = self.float()?;
        }
        Ok(floats)
    }

    pub(super) fn varint(&mut self) -> Result<u64, AtlasError> {
        let mut number = 0;
        for shift in (0..64).step_by(7) {
            let byte = self.u8()?;
            number |= u64::from(byte & 0x7f) << shift;
            if byte < 0x80 {
                return Ok(number);
            }
        }
        Err(AtlasError::Malformed("a number has too many bytes"))
    }
}
