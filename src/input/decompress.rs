//! Compressed bytes, never believed: deflate can grow a file 1032-fold and no more, so a promised size beyond that is a lie,
//! and nothing is inflated past what its header promises.

use super::error::{Fault, Flaw, Place};
use flate2::read::{GzDecoder, MultiGzDecoder, ZlibDecoder};
use std::io::Read;

/// The largest factor by which deflate can shrink data (zlib's own documentation).
pub(crate) const DEFLATE_LIMIT: u64 = 1032;

/// Texts (XML, PLY, OBJ) never shrink more than this; only padding bombs do.
const TEXT_LIMIT: u64 = 200;

/// A small text may shrink more.
const TEXT_FLOOR: u64 = 16 << 20;

/// Whether the bytes are gzip.
pub(crate) fn is_gzip(bytes: &[u8]) -> bool {
    bytes.starts_with(&[0x1f, 0x8b])
}

/// A reader of gzip bytes.
pub(crate) fn gzip_reader(bytes: &[u8]) -> impl Read {
    MultiGzDecoder::new(bytes)
}

/// A reader of zlib or gzip bytes, whichever they are.
pub(crate) fn any_reader(bytes: &[u8]) -> Box<dyn Read + '_> {
    if is_gzip(bytes) {
        Box::new(MultiGzDecoder::new(bytes))
    } else {
        Box::new(ZlibDecoder::new(bytes))
    }
}

/// The first `n` bytes of a gzip file, fewer when it is shorter or damaged.
pub(crate) fn gzip_head(bytes: &[u8], n: usize) -> Vec<u8> {
    let mut head = Vec::new();
    // What could be read before the damage is all a sniffer needs.
    let _ = GzDecoder::new(bytes).take(n as u64).read_to_end(&mut head);
    head
}

/// A whole gzipped text.
pub(crate) fn gzip_text(bytes: &[u8]) -> Result<Vec<u8>, Flaw> {
    let limit = TEXT_FLOOR.max(TEXT_LIMIT * bytes.len() as u64);
    let mut out = Vec::new();
    gzip_reader(bytes)
        .take(limit + 1)
        .read_to_end(&mut out)
        .map_err(|e| broken(out.len() as u64, &e))?;
    if out.len() as u64 > limit {
        return Err(Flaw::file(
            Fault::TooLarge,
            format!("{} compressed bytes inflate to more than {limit}", bytes.len()),
            "no real mesh shrinks that much; if it is one, decompress it first",
        ));
    }
    Ok(out)
}

/// A zlib block that must inflate to exactly `expected` bytes.
pub(crate) fn zlib_exact(bytes: &[u8], expected: u64) -> Result<Vec<u8>, Flaw> {
    believable(expected, bytes.len() as u64)?;
    let mut out = Vec::new();
    ZlibDecoder::new(bytes)
        .take(expected + 1)
        .read_to_end(&mut out)
        .map_err(|e| broken(out.len() as u64, &e))?;
    if out.len() as u64 != expected {
        return Err(Flaw::truncated(
            Place::File,
            format!(
                "a compressed block should inflate to {expected} bytes, it gives {}",
                out.len()
            ),
        ));
    }
    Ok(out)
}

/// A whole zlib stream, at most the deflate limit times its own size and `ceiling`.
pub(crate) fn zlib_all(bytes: &[u8], ceiling: u64) -> Result<Vec<u8>, Flaw> {
    let mut out = Vec::new();
    any_reader(bytes)
        .take(ceiling + 1)
        .read_to_end(&mut out)
        .map_err(|e| broken(out.len() as u64, &e))?;
    if out.len() as u64 > ceiling {
        return Err(Flaw::truncated(
            Place::File,
            format!("compressed data inflate to more than the {ceiling} bytes they should"),
        ));
    }
    Ok(out)
}

/// Refuses a promise of `expected` bytes that `packed` compressed bytes cannot keep.
pub(crate) fn believable(expected: u64, packed: u64) -> Result<(), Flaw> {
    let most = packed.saturating_mul(DEFLATE_LIMIT).saturating_add(64);
    if expected > most {
        return Err(Flaw::truncated(
            Place::File,
            format!(
                "the header promises {expected} bytes, but {packed} compressed bytes can hold at most {most}"
            ),
        ));
    }
    Ok(())
}

/// A compressed stream that cannot be inflated further.
pub(crate) fn broken(at: u64, error: &std::io::Error) -> Flaw {
    Flaw::new(
        Place::Byte(at),
        Fault::Truncated,
        format!("the compressed data are damaged ({error})"),
        "the file was not copied whole: copy or export it again",
    )
}
