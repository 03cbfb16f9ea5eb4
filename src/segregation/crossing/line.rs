//! A line where half sheets meet, and where points are in its frame.
//!
//! In: stations one step apart, each with the directions of its half sheets. Out: for a point the length along the line, the
//! distance off it and the half sheet it lies on ([`Place`]). Beyond an open end the line goes on straight, so that a sheet which
//! goes on there has coordinates too. `O(stations)` a point.

use glam::DVec3;

/// Deviation from a half sheet's direction, over the distance off the line and in spacings, up to which a point is on it.
const SPREAD: f64 = 0.12;
const WIDTH: f64 = 0.3;
/// The same for noise, standard deviations.
const DEVIATIONS: f64 = 2.5;

/// One point of a line.
#[derive(Clone, Copy, Debug, Default)]
pub struct Station {
    /// Where it is, mm.
    pub place: DVec3,
    /// Direction of the line.
    pub tangent: DVec3,
    /// Directions of the half sheets: 0 and 1 are the halves of one sheet, 2 and 3 of the other.
    pub halves: [DVec3; 4],
}

/// A line.
#[derive(Clone, Debug, Default)]
pub struct Line {
    /// Its points in order.
    pub stations: Vec<Station>,
    /// Whether the last goes on to the first.
    pub closed: bool,
    /// Which half sheets are there.
    pub exists: [bool; 4],
    /// Spacing of the points round it, mm.
    pub spacing_mm: f64,
    /// Noise over spacing.
    pub noise_over_spacing: f64,
    /// Length, mm.
    pub length_mm: f64,
    /// Length up to each station, mm.
    at_mm: Vec<f64>,
    /// Corners of its bounding box, mm.
    bounds: [DVec3; 2],
}

/// A point in the frame of a line.
#[derive(Clone, Copy, Debug)]
pub struct Place {
    /// Length along the line, mm; below 0 or beyond its length when the point lies past an end.
    pub along_mm: f64,
    /// Distance off the line (prolonged at its ends), mm.
    pub off_mm: f64,
    /// Distance from the line itself, mm.
    pub distance_mm: f64,
    /// The half sheet it lies on.
    pub half: Option<u8>,
}

impl Line {
    /// Measures the stations.
    pub fn new(
        stations: Vec<Station>,
        closed: bool,
        exists: [bool; 4],
        spacing_mm: f64,
        noise_over_spacing: f64,
    ) -> Self {
        let mut at_mm = vec![0.0];
        for pair in stations.windows(2) {
            at_mm.push(at_mm[at_mm.len() - 1] + pair[0].place.distance(pair[1].place));
        }
        let mut length_mm = at_mm[at_mm.len() - 1];
        if closed && let (Some(first), Some(last)) = (stations.first(), stations.last()) {
            length_mm += first.place.distance(last.place);
        }
        let first = stations.first().map_or(DVec3::ZERO, |s| s.place);
        Self {
            bounds: stations
                .iter()
                .fold([first; 2], |[low, high], s| [low.min(s.place), high.max(s.place)]),
            stations,
            closed,
            exists,
            spacing_mm,
            noise_over_spacing,
            length_mm,
            at_mm,
        }
    }

    /// Steps from station to station.
    pub fn steps(&self) -> usize {
        self.stations.len() - usize::from(!self.closed)
    }

    /// Length up to a station, mm.
    pub fn at_mm(&self, station: usize) -> f64 {
        self.at_mm[station]
    }

    /// Which halves of sheet 0 or 1 exist, when one does.
    pub fn halves_of(&self, sheet: u8) -> Option<[bool; 2]> {
        let s = 2 * sheet as usize;
        let pair = [self.exists[s], self.exists[s + 1]];
        (pair[0] || pair[1]).then_some(pair)
    }

    /// Sine of the smallest angle between half sheets that exist (1 for right angles and more), the median over the stations.
    pub fn least_sine(&self) -> f64 {
        let sines = self.stations.iter().map(|s| {
            let mut least = 1.0f64;
            for i in 0..4 {
                for j in 0..i {
                    if self.exists[i] && self.exists[j] && s.halves[i].dot(s.halves[j]) > 0.0 {
                        least = least.min(s.halves[i].cross(s.halves[j]).length());
                    }
                }
            }
            least
        });
        crate::segregation::prepare::noise::median(sines.collect()).max(1e-3)
    }

    /// Angle between the sheets, degrees, at most 90; the median over the stations.
    pub fn angle_degrees(&self) -> f64 {
        let angles = self.stations.iter().map(|s| {
            let c = s.halves[0].dot(s.halves[2]).abs();
            c.min(1.0).acos().to_degrees()
        });
        crate::segregation::prepare::noise::median(angles.collect())
    }

    /// Where a point is; `None` beyond `reach_mm`.
    pub fn place(&self, p: DVec3, reach_mm: f64) -> Option<Place> {
        let [low, high] = self.bounds;
        if p.distance_squared(p.clamp(low, high)) > reach_mm * reach_mm {
            return None;
        }
        let count = self.stations.len();
        let mut best: Option<(f64, usize, f64)> = None;
        for k in 0..self.steps() {
            let (a, b) = (self.stations[k].place, self.stations[(k + 1) % count].place);
            let step = b - a;
            let share = (p - a).dot(step) / step.length_squared().max(f64::MIN_POSITIVE);
            let distance = p.distance(a + share.clamp(0.0, 1.0) * step);
            if best.is_none_or(|(d, ..)| distance < d) {
                best = Some((distance, k, share));
            }
        }
        let (distance_mm, k, share) = best?;
        if distance_mm > reach_mm {
            return None;
        }
        let past = !self.closed && (k == 0 && share < 0.0 || k + 1 == self.steps() && share > 1.0);
        let share = if past { share } else { share.clamp(0.0, 1.0) };
        let (a, b) = (&self.stations[k], &self.stations[(k + 1) % count]);
        let step = b.place - a.place;
        let tangent = step.normalize_or_zero();
        let d = p - a.place;
        let d = d - d.dot(tangent) * tangent;
        let blend = share.clamp(0.0, 1.0);
        let off_mm = d.length();
        let mut half = None;
        let mut least = (WIDTH + DEVIATIONS * self.noise_over_spacing) * self.spacing_mm + SPREAD * off_mm;
        for h in (0..4).filter(|&h| self.exists[h]) {
            let ray = a.halves[h].lerp(b.halves[h], blend);
            let ray = (ray - ray.dot(tangent) * tangent).normalize_or_zero();
            let out = d.dot(ray);
            if out > 0.0 && (d - out * ray).length() < least {
                least = (d - out * ray).length();
                half = Some(h as u8);
            }
        }
        Some(Place {
            along_mm: self.at_mm[k] + share * step.length(),
            off_mm,
            distance_mm,
            half,
        })
    }
}

impl Line {
    /// The station at a length along the line, between those there are or straight on beyond its ends.
    pub(super) fn at(&self, along_mm: f64) -> Station {
        let count = self.stations.len();
        let k = self
            .at_mm
            .partition_point(|a| *a <= along_mm)
            .clamp(1, self.steps())
            - 1;
        let (a, b) = (self.stations[k], self.stations[(k + 1) % count]);
        let length = a.place.distance(b.place);
        let share = (along_mm - self.at_mm[k]) / length.max(f64::MIN_POSITIVE);
        let blend = share.clamp(0.0, 1.0);
        Station {
            place: a.place + share * (b.place - a.place),
            tangent: a.tangent.lerp(b.tangent, blend).normalize_or_zero(),
            halves: [0, 1, 2, 3].map(|h| a.halves[h].lerp(b.halves[h], blend).normalize_or_zero()),
        }
    }
}
