//! Lengths as a user writes them: `0.5mm`, `2%diag`, `1.5x-spacing`, `0.3radius`; a bare number is mm.

use serde::{Deserialize, Serialize};
use std::{fmt, str::FromStr};
use thiserror::Error;

/// A length with the rule that gives its size in mm once a shape is known.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(try_from = "String", into = "String")]
pub enum Length {
    /// Millimetres.
    Millimetres(f64),
    /// Percent of the diagonal of the shape's bounding box.
    PercentDiagonal(f64),
    /// Multiples of the mean spacing of the generators.
    Spacings(f64),
    /// Multiples of the local radius of the medial point the length is used at.
    LocalRadii(f64),
}

/// What a relative [`Length`] is relative to.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct LengthScale {
    /// Diagonal of the axis-aligned bounding box of the shape, mm.
    pub diagonal_mm: f64,
    /// Mean spacing of the generators, mm.
    pub spacing_mm: f64,
}

/// A text that is not a length.
#[derive(Clone, Debug, PartialEq, Eq, Error)]
#[error("`{text}` is not a length; write 0.5mm, 2%diag, 1.5x-spacing or 0.3radius (a bare number is mm)")]
pub struct LengthError {
    /// The text as given.
    pub text: String,
}

impl Length {
    /// The length in mm for a shape of the given scale; `radius_mm` is the radius of the medial point it is used at
    /// (only [`Length::LocalRadii`] reads it).
    pub fn to_mm(self, scale: LengthScale, radius_mm: f64) -> f64 {
        match self {
            Length::Millimetres(v) => v,
            Length::PercentDiagonal(p) => p / 100.0 * scale.diagonal_mm,
            Length::Spacings(x) => x * scale.spacing_mm,
            Length::LocalRadii(x) => x * radius_mm,
        }
    }
}

impl FromStr for Length {
    type Err = LengthError;

    fn from_str(text: &str) -> Result<Self, LengthError> {
        let bad = || LengthError {
            text: text.to_owned(),
        };
        let t = text.trim();
        let (number, make): (&str, fn(f64) -> Length) = if let Some(n) = t.strip_suffix("%diag") {
            (n, Length::PercentDiagonal)
        } else if let Some(n) = t.strip_suffix("x-spacing") {
            (n, Length::Spacings)
        } else if let Some(n) = t.strip_suffix("radius") {
            (n, Length::LocalRadii)
        } else if let Some(n) = t.strip_suffix("mm") {
            (n, Length::Millimetres)
        } else {
            (t, Length::Millimetres)
        };
        let value: f64 = number.trim().parse().map_err(|_| bad())?;
        if value.is_finite() && value >= 0.0 {
            Ok(make(value))
        } else {
            Err(bad())
        }
    }
}

impl fmt::Display for Length {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Length::Millimetres(v) => write!(f, "{v}mm"),
            Length::PercentDiagonal(p) => write!(f, "{p}%diag"),
            Length::Spacings(x) => write!(f, "{x}x-spacing"),
            Length::LocalRadii(x) => write!(f, "{x}radius"),
        }
    }
}

impl TryFrom<String> for Length {
    type Error = LengthError;
    fn try_from(text: String) -> Result<Self, LengthError> {
        text.parse()
    }
}

impl From<Length> for String {
    fn from(length: Length) -> String {
        length.to_string()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lengths_are_read_and_written_back() {
        for text in ["0.5mm", "2%diag", "1.5x-spacing", "0.3radius"] {
            assert_eq!(text.parse::<Length>().expect("a length").to_string(), text);
        }
        assert_eq!("3".parse::<Length>(), Ok(Length::Millimetres(3.0)));
        for text in ["", "mm", "-1mm", "nan", "inf%diag", "2%"] {
            assert!(text.parse::<Length>().is_err(), "{text}");
        }
    }

    #[test]
    fn relative_lengths_scale_with_the_shape() {
        let scale = LengthScale {
            diagonal_mm: 50.0,
            spacing_mm: 0.4,
        };
        assert_eq!(Length::PercentDiagonal(2.0).to_mm(scale, 9.0), 1.0);
        assert_eq!(Length::Spacings(2.0).to_mm(scale, 9.0), 0.8);
        assert_eq!(Length::LocalRadii(0.5).to_mm(scale, 9.0), 4.5);
    }
}
