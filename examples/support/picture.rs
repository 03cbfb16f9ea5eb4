//! A z-buffer for scaffolds: sheets by colour, axial curves magenta, ribs black, wires blue, seams orange.

use flate2::{Compression, Crc, write::ZlibEncoder};
use glam::DVec3;
use medial_scaffold::coarse_scaffold::{CoarseScaffold, CurveKind};
use std::io::Write;
use std::path::Path;

/// An RGB image with depth.
pub struct Picture {
    width: usize,
    height: usize,
    rgb: Vec<[u8; 3]>,
    depth: Vec<f64>,
    right: DVec3,
    up: DVec3,
    out: DVec3,
    centre: DVec3,
    scale: f64,
}

const COLOURS: [[u8; 3]; 14] = [
    [230, 80, 80],
    [80, 150, 230],
    [80, 190, 90],
    [235, 180, 60],
    [160, 110, 220],
    [90, 200, 200],
    [240, 140, 190],
    [150, 150, 150],
    [180, 130, 80],
    [140, 200, 60],
    [90, 90, 200],
    [200, 90, 140],
    [60, 140, 120],
    [220, 220, 110],
];

impl Picture {
    /// A white picture of the box `[lo, hi]` seen along `-out`.
    pub fn new(width: usize, height: usize, [lo, hi]: [DVec3; 2], out: DVec3, up: DVec3) -> Self {
        let out = out.normalize();
        let right = up.cross(out).normalize();
        let up = out.cross(right);
        let centre = 0.5 * (lo + hi);
        let half = 0.5 * (hi - lo);
        let extent = |d: DVec3| half.dot(d.abs());
        let scale = (width as f64 / (2.1 * extent(right))).min(height as f64 / (2.1 * extent(up)));
        Self {
            width,
            height,
            rgb: vec![[255; 3]; width * height],
            depth: vec![f64::NEG_INFINITY; width * height],
            right,
            up,
            out,
            centre,
            scale,
        }
    }

    fn project(&self, p: DVec3) -> DVec3 {
        let q = p - self.centre;
        DVec3::new(
            0.5 * self.width as f64 + self.scale * q.dot(self.right),
            0.5 * self.height as f64 - self.scale * q.dot(self.up),
            q.dot(self.out),
        )
    }

    fn put(&mut self, x: i64, y: i64, z: f64, c: [u8; 3]) {
        if x >= 0 && y >= 0 && (x as usize) < self.width && (y as usize) < self.height {
            let i = x as usize + self.width * y as usize;
            if z > self.depth[i] {
                self.depth[i] = z;
                self.rgb[i] = c;
            }
        }
    }

    /// Draws a shaded triangle.
    pub fn triangle(&mut self, corners: [DVec3; 3], colour: [u8; 3]) {
        let normal = (corners[1] - corners[0])
            .cross(corners[2] - corners[0])
            .normalize_or_zero();
        let light = (self.out + 0.4 * self.right + 0.6 * self.up).normalize();
        let shade = 0.35 + 0.65 * normal.dot(light).abs();
        let colour = colour.map(|c| (f64::from(c) * shade) as u8);
        let [a, b, c] = corners.map(|p| self.project(p));
        let area = (b.x - a.x) * (c.y - a.y) - (c.x - a.x) * (b.y - a.y);
        if area == 0.0 {
            return;
        }
        let lo = a.min(b).min(c);
        let hi = a.max(b).max(c);
        for y in lo.y.floor() as i64..=hi.y.ceil() as i64 {
            for x in lo.x.floor() as i64..=hi.x.ceil() as i64 {
                let (px, py) = (x as f64, y as f64);
                let u = ((px - a.x) * (c.y - a.y) - (c.x - a.x) * (py - a.y)) / area;
                let v = ((b.x - a.x) * (py - a.y) - (px - a.x) * (b.y - a.y)) / area;
                if u >= -1e-9 && v >= -1e-9 && u + v <= 1.0 + 1e-9 {
                    self.put(x, y, a.z + u * (b.z - a.z) + v * (c.z - a.z), colour);
                }
            }
        }
    }

    /// Draws a line a little in front of what it lies on.
    pub fn line(&mut self, p: DVec3, q: DVec3, width: i64, lift: f64, colour: [u8; 3]) {
        let (a, b) = (self.project(p), self.project(q));
        let steps = ((b - a).truncate().length().ceil() as i64).max(1);
        for i in 0..=steps {
            let at = a + (b - a) * (i as f64 / steps as f64);
            for dx in -width..=width {
                for dy in -width..=width {
                    if dx * dx + dy * dy <= width * width {
                        self.put(
                            at.x.round() as i64 + dx,
                            at.y.round() as i64 + dy,
                            at.z + lift,
                            colour,
                        );
                    }
                }
            }
        }
    }

    /// Draws a scaffold.
    pub fn scaffold(&mut self, scaffold: &CoarseScaffold) {
        for (i, sheet) in scaffold.sheets.iter().enumerate() {
            for t in &sheet.mesh.triangles {
                let corners = t.map(|v| sheet.mesh.vertices[v as usize].position);
                self.triangle(corners, COLOURS[i % COLOURS.len()]);
            }
        }
        let lift = 0.004 * scaffold.diagonal_mm;
        for curve in &scaffold.curves {
            let (width, colour) = match curve.kind {
                CurveKind::Axial => (2, [230, 0, 200]),
                CurveKind::Rib => (1, [0, 0, 0]),
                CurveKind::Wire => (2, [0, 0, 230]),
                CurveKind::Seam => (1, [255, 130, 0]),
            };
            for w in curve.polyline.windows(2) {
                self.line(w[0].position, w[1].position, width, lift, colour);
            }
            if curve.closed && curve.polyline.len() > 2 {
                let (a, b) = (curve.polyline[0], curve.polyline[curve.polyline.len() - 1]);
                self.line(a.position, b.position, width, lift, colour);
            }
        }
        for node in &scaffold.nodes {
            self.line(node.position, node.position, 4, 1.5 * lift, [20, 120, 20]);
        }
    }

    /// Writes the picture at half its size, each pixel the mean of four.
    pub fn write_png(&self, path: &Path) -> std::io::Result<()> {
        let (w, h) = (self.width / 2, self.height / 2);
        let mut raw = Vec::with_capacity(h * (3 * w + 1));
        for y in 0..h {
            raw.push(0);
            for x in 0..w {
                for c in 0..3 {
                    let sum: u32 = [(0, 0), (1, 0), (0, 1), (1, 1)]
                        .iter()
                        .map(|(dx, dy)| u32::from(self.rgb[2 * x + dx + self.width * (2 * y + dy)][c]))
                        .sum();
                    raw.push((sum / 4) as u8);
                }
            }
        }
        let mut encoder = ZlibEncoder::new(Vec::new(), Compression::default());
        encoder.write_all(&raw)?;
        let data = encoder.finish()?;
        let mut header = Vec::new();
        header.extend((w as u32).to_be_bytes());
        header.extend((h as u32).to_be_bytes());
        header.extend([8, 2, 0, 0, 0]);
        let mut png = vec![0x89, b'P', b'N', b'G', 13, 10, 26, 10];
        for (name, body) in [(b"IHDR", &header), (b"IDAT", &data), (b"IEND", &Vec::new())] {
            png.extend((body.len() as u32).to_be_bytes());
            let mut crc = Crc::new();
            crc.update(name);
            crc.update(body);
            png.extend(name);
            png.extend(body);
            png.extend(crc.sum().to_be_bytes());
        }
        std::fs::write(path, png)
    }
}
