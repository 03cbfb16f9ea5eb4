//! Numbers as binary files store them: a type, a byte order, and bytes.

use super::error::{Fault, Flaw, Place};

/// The scalar types of the formats that are read.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Scalar {
    I8,
    U8,
    I16,
    U16,
    I32,
    U32,
    I64,
    U64,
    F32,
    F64,
}

/// Byte order of a binary file.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Endian {
    Little,
    Big,
}

impl Scalar {
    /// Bytes of one item.
    pub(crate) fn size(self) -> usize {
        match self {
            Scalar::I8 | Scalar::U8 => 1,
            Scalar::I16 | Scalar::U16 => 2,
            Scalar::I32 | Scalar::U32 | Scalar::F32 => 4,
            Scalar::I64 | Scalar::U64 | Scalar::F64 => 8,
        }
    }

    /// Whether items are floating point.
    pub(crate) fn is_float(self) -> bool {
        matches!(self, Scalar::F32 | Scalar::F64)
    }

    /// One item as a float; `bytes` holds exactly [`Self::size`] bytes. 64-bit integers beyond 2^53 are rounded.
    #[inline]
    pub(crate) fn float(self, bytes: &[u8], endian: Endian) -> f64 {
        match self {
            Scalar::F32 => f64::from(f32::from_bits(self.bits(bytes, endian) as u32)),
            Scalar::F64 => f64::from_bits(self.bits(bytes, endian)),
            Scalar::U64 => self.bits(bytes, endian) as f64,
            _ => self.integer(bytes, endian) as f64,
        }
    }

    /// One item as an integer; floats are truncated, unsigned 64-bit items saturate.
    #[inline]
    pub(crate) fn integer(self, bytes: &[u8], endian: Endian) -> i64 {
        let bits = self.bits(bytes, endian);
        match self {
            Scalar::I8 => i64::from(bits as i8),
            Scalar::I16 => i64::from(bits as i16),
            Scalar::I32 => i64::from(bits as i32),
            Scalar::I64 => bits as i64,
            Scalar::U8 | Scalar::U16 | Scalar::U32 => bits as i64,
            Scalar::U64 => bits.min(i64::MAX as u64) as i64,
            Scalar::F32 | Scalar::F64 => self.float(bytes, endian) as i64,
        }
    }

    #[inline]
    fn bits(self, bytes: &[u8], endian: Endian) -> u64 {
        let mut buffer = [0u8; 8];
        let n = self.size();
        match endian {
            Endian::Little => buffer[..n].copy_from_slice(&bytes[..n]),
            Endian::Big => {
                for (b, &x) in buffer.iter_mut().zip(bytes[..n].iter().rev()) {
                    *b = x;
                }
            }
        }
        u64::from_le_bytes(buffer)
    }

    /// All items of a block as integers.
    pub(crate) fn integers(self, bytes: &[u8], endian: Endian) -> Vec<i64> {
        bytes
            .chunks_exact(self.size())
            .map(|b| self.integer(b, endian))
            .collect()
    }

    /// All items of a block as finite numbers; `start` is the block's offset in the file.
    pub(crate) fn finite(self, bytes: &[u8], endian: Endian, start: usize) -> Result<Vec<f64>, Flaw> {
        bytes
            .chunks_exact(self.size())
            .enumerate()
            .map(|(i, b)| {
                let v = self.float(b, endian);
                if v.is_finite() {
                    Ok(v)
                } else {
                    Err(not_finite(v, start + i * self.size()))
                }
            })
            .collect()
    }
}

/// The flaw of a coordinate that is not a number or infinite.
pub(crate) fn not_finite(value: f64, byte: usize) -> Flaw {
    Flaw::new(
        Place::Byte(byte as u64),
        Fault::Number,
        format!("a coordinate is {value}"),
        "every coordinate must be a finite number: remove or mend that element in the program that wrote the file",
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_type_in_both_orders() {
        for (scalar, little, value) in [
            (Scalar::I8, vec![0xfe], -2.0),
            (Scalar::U8, vec![0xfe], 254.0),
            (Scalar::I16, vec![0xfe, 0xff], -2.0),
            (Scalar::U16, vec![0x01, 0x02], 513.0),
            (Scalar::I32, (-70000i32).to_le_bytes().to_vec(), -70000.0),
            (Scalar::U32, 4_000_000_000u32.to_le_bytes().to_vec(), 4e9),
            (Scalar::I64, (-5i64).to_le_bytes().to_vec(), -5.0),
            (Scalar::U64, 7u64.to_le_bytes().to_vec(), 7.0),
            (Scalar::F32, 1.5f32.to_le_bytes().to_vec(), 1.5),
            (Scalar::F64, (-2.25f64).to_le_bytes().to_vec(), -2.25),
        ] {
            assert_eq!(scalar.float(&little, Endian::Little), value);
            assert_eq!(scalar.integer(&little, Endian::Little), value as i64);
            let big: Vec<u8> = little.iter().rev().copied().collect();
            assert_eq!(scalar.float(&big, Endian::Big), value);
        }
    }
}
