//! Walks over the bytes of a file and knows where it is, so that every message can name a line or a byte.
//!
//! Text is read by lines or by whitespace-separated tokens, binary by fixed-size items; formats that mix the two (PLY, VTK)
//! switch on the same cursor. Nothing is allocated here: counts from headers are checked against the bytes that are left
//! ([`Scan::promise`]) before anyone reserves memory for them.

use super::error::{Fault, Flaw, Place, quote};

/// A cursor over the bytes of a file.
#[derive(Clone, Debug)]
pub(crate) struct Scan<'a> {
    bytes: &'a [u8],
    at: usize,
    line: u64,
}

impl<'a> Scan<'a> {
    pub(crate) fn new(bytes: &'a [u8]) -> Self {
        Self {
            bytes,
            at: 0,
            line: 1,
        }
    }

    /// Offset of the next byte.
    pub(crate) fn offset(&self) -> usize {
        self.at
    }

    /// Number of the line that holds the next byte.
    pub(crate) fn here(&self) -> Place {
        Place::Line(self.line)
    }

    /// The bytes that are left.
    pub(crate) fn rest(&self) -> &'a [u8] {
        &self.bytes[self.at..]
    }

    /// The next line without its end, or `None` at the end of the file.
    pub(crate) fn line(&mut self) -> Option<&'a [u8]> {
        let rest = self.rest();
        if rest.is_empty() {
            return None;
        }
        let (line, step) = match rest.iter().position(|&b| b == b'\n') {
            Some(end) => (&rest[..end], end + 1),
            None => (rest, rest.len()),
        };
        self.at += step;
        self.line += 1;
        Some(line.strip_suffix(b"\r").unwrap_or(line))
    }

    /// Place of the line that [`Self::line`] returned last.
    pub(crate) fn last_line(&self) -> Place {
        Place::Line(self.line.saturating_sub(1).max(1))
    }

    /// The next token, or `None` at the end of the file.
    pub(crate) fn token(&mut self) -> Option<&'a [u8]> {
        self.skip_blanks();
        let rest = self.rest();
        let end = rest
            .iter()
            .position(u8::is_ascii_whitespace)
            .unwrap_or(rest.len());
        self.at += end;
        (end > 0).then(|| &rest[..end])
    }

    /// The next token without moving past it.
    pub(crate) fn peek(&self) -> Option<&'a [u8]> {
        self.clone().token()
    }

    fn skip_blanks(&mut self) {
        while let Some(b) = self.bytes.get(self.at).filter(|b| b.is_ascii_whitespace()) {
            self.line += u64::from(*b == b'\n');
            self.at += 1;
        }
    }

    /// The next `n` bytes as they are.
    pub(crate) fn take(&mut self, n: usize, what: &str) -> Result<&'a [u8], Flaw> {
        let rest = self.rest();
        let taken = rest.get(..n).ok_or_else(|| {
            Flaw::truncated(
                Place::Byte(self.at as u64),
                format!("{n} bytes of {what} should follow, {} are left", rest.len()),
            )
        })?;
        self.at += n;
        Ok(taken)
    }

    /// The next token as a finite number.
    pub(crate) fn number(&mut self, what: &str) -> Result<f64, Flaw> {
        match self.token() {
            Some(token) => number(token, what, self.here()),
            None => Err(self.ended(what)),
        }
    }

    /// The next token as an integer.
    pub(crate) fn integer(&mut self, what: &str) -> Result<i64, Flaw> {
        match self.token() {
            Some(token) => integer(token, what, self.here()),
            None => Err(self.ended(what)),
        }
    }

    /// The next token as a count, checked like [`Self::promise`].
    pub(crate) fn count(&mut self, what: &str, least_bytes: usize) -> Result<usize, Flaw> {
        let count = self.integer(what)?;
        self.promise(count, what, least_bytes)
    }

    /// A count that a header promises: not negative, and its items, of at least `least_bytes` each, fit into what is left.
    pub(crate) fn promise(&self, count: i64, what: &str, least_bytes: usize) -> Result<usize, Flaw> {
        if count < 0 {
            return Err(Flaw::new(
                self.here(),
                Fault::Header,
                format!("the header says {count} {what}"),
                "a count cannot be negative: export the file again",
            ));
        }
        let left = self.rest().len();
        let needed = (count as u128) * least_bytes as u128;
        if needed > left as u128 {
            return Err(Flaw::truncated(
                self.here(),
                format!(
                    "the header says {count} {what}, which need at least {needed} bytes, but {left} are left"
                ),
            ));
        }
        Ok(count as usize)
    }

    fn ended(&self, what: &str) -> Flaw {
        Flaw::truncated(self.here(), format!("the file ends where {what} should be"))
    }
}

/// A finite number from text.
pub(crate) fn number(token: &[u8], what: &str, place: Place) -> Result<f64, Flaw> {
    let value: Option<f64> = std::str::from_utf8(token).ok().and_then(|t| t.parse().ok());
    match value {
        Some(v) if v.is_finite() => Ok(v),
        Some(_) => Err(Flaw::new(
            place,
            Fault::Number,
            format!("{what} is {}", quote(token)),
            "every coordinate must be a finite number: remove or mend that element in the program that wrote the file",
        )),
        None => Err(Flaw::new(
            place,
            Fault::Number,
            format!("{what} should be a number, found {}", quote(token)),
            "numbers are written with a dot and no thousands separators: mend that line or export again",
        )),
    }
}

/// An integer from text; `3.0` counts as one.
pub(crate) fn integer(token: &[u8], what: &str, place: Place) -> Result<i64, Flaw> {
    let text = std::str::from_utf8(token).unwrap_or("");
    if let Ok(v) = text.parse::<i64>() {
        return Ok(v);
    }
    match text.parse::<f64>() {
        Ok(v) if v.fract() == 0.0 && v.abs() < 9e15 => Ok(v as i64),
        _ => Err(Flaw::new(
            place,
            Fault::Number,
            format!("{what} should be a whole number, found {}", quote(token)),
            "mend that line or export the file again",
        )),
    }
}

/// The tokens of a line.
pub(crate) fn tokens(line: &[u8]) -> impl Iterator<Item = &[u8]> {
    line.split(u8::is_ascii_whitespace).filter(|t| !t.is_empty())
}
