//! Numbers as bytes, in both directions.

use super::AtlasError;

/// One end of an encoding: a [`Writer`] appends the values that it is given, a [`Reader`] overwrites them with values that it
/// reads. So one description of the format serves both.
pub(super) trait Codec {
    const READS: bool;

    fn bytes(&mut self, bytes: &mut [u8]) -> Result<(), AtlasError>;

    fn ensure(&self, holds: bool, otherwise: &'static str) -> Result<(), AtlasError> {
        if holds || !Self::READS {
            Ok(())
        } else {
            Err(AtlasError::Malformed(otherwise))
        }
    }

    fn u8(&mut self, number: &mut u8) -> Result<(), AtlasError> {
        self.bytes(std::slice::from_mut(number))
    }

    fn u16(&mut self, number: &mut u16) -> Result<(), AtlasError> {
        let mut bytes = number.to_be_bytes();
        self.bytes(&mut bytes)?;
        *number = u16::from_be_bytes(bytes);
        Ok(())
    }

    fn u64(&mut self, number: &mut u64) -> Result<(), AtlasError> {
        let mut bytes = number.to_be_bytes();
        self.bytes(&mut bytes)?;
        *number = u64::from_be_bytes(bytes);
        Ok(())
    }

    fn floats<'a>(&mut self, numbers: impl IntoIterator<Item = &'a mut f32>) -> Result<(), AtlasError> {
        for number in numbers {
            let mut bytes = number.to_be_bytes();
            self.bytes(&mut bytes)?;
            *number = f32::from_be_bytes(bytes);
            self.ensure(number.is_finite(), "a number is not finite")?;
        }
        Ok(())
    }

    /// A number of variable length: seven bits per byte, lowest first.
    fn varint(&mut self, number: &mut u64) -> Result<(), AtlasError> {
        let (mut left, mut passed) = (*number, 0);
        for shift in (0..64).step_by(7) {
            let mut byte = left as u8 & 0x7f | u8::from(left >= 0x80) << 7;
            self.u8(&mut byte)?;
            passed |= u64::from(byte & 0x7f) << shift;
            left >>= 7;
            if byte < 0x80 {
                *number = passed;
                return Ok(());
            }
        }
        Err(AtlasError::Malformed("a number has too many bytes"))
    }
}

pub(super) struct Writer(pub(super) Vec<u8>);

impl Codec for Writer {
    const READS: bool = false;

    fn bytes(&mut self, bytes: &mut [u8]) -> Result<(), AtlasError> {
        self.0.extend_from_slice(bytes);
        Ok(())
    }
}

pub(super) struct Reader<'a>(pub(super) &'a [u8]);

impl Codec for Reader<'_> {
    const READS: bool = true;

    fn bytes(&mut self, bytes: &mut [u8]) -> Result<(), AtlasError> {
        let (read, left) = self
            .0
            .split_at_checked(bytes.len())
            .ok_or(AtlasError::Malformed("unexpected end"))?;
        bytes.copy_from_slice(read);
        self.0 = left;
        Ok(())
    }
}
