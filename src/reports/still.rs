//! A still picture of a scene without a GPU: an orthographic z-buffer, two samples a pixel each way, written as PNG.
//!
//! In: a [`Scene`] and a [`View`]. Out: an sRGB image. Steps: 1. choose the view; 2. draw what is opaque with depth test;
//! 3. gather translucent surfaces in front of it, more opaque where they are seen edge-on, and blend them without sorting
//! (weighted average with exact coverage, after Meshkin 2007); 4. average the samples. Surfaces are translucent when
//! something is inside them, solid otherwise. The report shows it in print and where WebGL is missing.

use super::scene::{Layer, LayerKind, Scene};
use glam::{DMat3, DVec3};
use nalgebra::{Matrix3, SymmetricEigen};
use rayon::prelude::*;
use serde::{Deserialize, Serialize};
use std::io::Write;

/// Where the camera stands: orthographic still and perspective viewer share it.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct View {
    /// Unit direction from the scene to the camera.
    pub toward_camera: DVec3,
    /// Unit direction that is up in the picture.
    pub up: DVec3,
}

impl View {
    /// A three-quarter view of the broad side: along the axis of least extent, turned aside and raised by 28 and 18 degrees,
    /// with the longest axis across the picture and head-side up.
    pub fn broadside(scene: &Scene) -> View {
        let surfaces = scene.layers.iter().filter(|l| l.kind == LayerKind::Surface);
        let mut points: Vec<DVec3> = surfaces.flat_map(|l| l.mesh.points.iter().copied()).collect();
        if points.is_empty() {
            points = scene
                .layers
                .iter()
                .flat_map(|l| l.mesh.points.iter().copied())
                .collect();
        }
        let n = points.len().max(1) as f64;
        let mean = points.iter().sum::<DVec3>() / n;
        let mut covariance = Matrix3::<f64>::zeros();
        for p in &points {
            let d: nalgebra::Vector3<f64> = (*p - mean).into();
            covariance += d * d.transpose() / n;
        }
        let eigen = SymmetricEigen::new(covariance);
        let mut order = [0, 1, 2];
        order.sort_by(|&a, &b| eigen.eigenvalues[b].total_cmp(&eigen.eigenvalues[a]));
        let axis = |k: usize| -> DVec3 {
            let v: DVec3 = eigen.eigenvectors.column(order[k]).into_owned().into();
            // Eigenvectors come with either sign; take the one whose largest component is positive.
            let a = v.abs();
            let largest = if a.x >= a.y && a.x >= a.z {
                v.x
            } else if a.y >= a.z {
                v.y
            } else {
                v.z
            };
            if largest < 0.0 { -v } else { v }
        };
        let (long, thin) = (axis(0), axis(2));
        let mut up = thin.cross(long);
        if up.z < 0.0 {
            up = -up;
        }
        let turned = DMat3::from_axis_angle(up, 28f64.to_radians()) * thin;
        let right = up.cross(turned);
        let toward_camera = DMat3::from_axis_angle(right, -18f64.to_radians()) * turned;
        let toward_camera = toward_camera.try_normalize().unwrap_or(DVec3::NEG_Y);
        let up = (up - toward_camera * up.dot(toward_camera))
            .try_normalize()
            .unwrap_or_else(|| toward_camera.any_orthonormal_vector());
        View { toward_camera, up }
    }
}

/// An 8-bit RGB image, rows from the top.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Image {
    /// Pixels across.
    pub width: usize,
    /// Pixels down.
    pub height: usize,
    /// Red, green, blue of each pixel.
    pub rgb: Vec<u8>,
}

impl Image {
    /// The image as PNG bytes.
    pub fn png(&self) -> Vec<u8> {
        let mut rows = Vec::with_capacity(self.rgb.len() + self.height);
        for row in self.rgb.chunks(3 * self.width.max(1)) {
            rows.push(0);
            rows.extend_from_slice(row);
        }
        let mut zlib = flate2::write::ZlibEncoder::new(Vec::new(), flate2::Compression::new(6));
        zlib.write_all(&rows).expect("writing to memory does not fail");
        let data = zlib.finish().expect("writing to memory does not fail");
        let mut header = Vec::with_capacity(13);
        header.extend_from_slice(&(self.width as u32).to_be_bytes());
        header.extend_from_slice(&(self.height as u32).to_be_bytes());
        header.extend_from_slice(&[8, 2, 0, 0, 0]);
        let mut out = vec![0x89, b'P', b'N', b'G', 0x0D, 0x0A, 0x1A, 0x0A];
        for (kind, bytes) in [(b"IHDR", &header), (b"IDAT", &data), (b"IEND", &Vec::new())] {
            out.extend_from_slice(&(bytes.len() as u32).to_be_bytes());
            out.extend_from_slice(kind);
            out.extend_from_slice(bytes);
            let mut crc = flate2::Crc::new();
            crc.update(kind);
            crc.update(bytes);
            out.extend_from_slice(&crc.sum().to_be_bytes());
        }
        out
    }
}

const SAMPLES: usize = 2;
/// Rows of pixels drawn by themselves.
const BAND: usize = 48;
const BACKGROUND: [f32; 3] = [0.965, 0.972, 0.98];

/// Depth and colour of what is opaque, and the sums of what is not, one entry a sample.
struct Frame {
    width: usize,
    /// First row of the band.
    top: usize,
    height: usize,
    depth: Vec<f32>,
    colour: Vec<[f32; 3]>,
    veil: Vec<[f32; 4]>,
    transmitted: Vec<f32>,
}

impl Frame {
    fn new(width: usize, top: usize, height: usize) -> Self {
        let n = width * height;
        Self {
            width,
            top,
            height,
            depth: vec![f32::NEG_INFINITY; n],
            colour: vec![BACKGROUND; n],
            veil: vec![[0.0; 4]; n],
            transmitted: vec![1.0; n],
        }
    }
}

/// Vertices of a layer in the picture: x right and y down in samples, z toward the camera in mm.
struct Projection {
    right: DVec3,
    up: DVec3,
    toward: DVec3,
    centre: DVec3,
    scale: f64,
    half: [f64; 2],
}

impl Projection {
    fn fit(scene: &Scene, view: &View, width: usize, height: usize) -> Self {
        let right = view.up.cross(view.toward_camera);
        let axes = [right, view.up, view.toward_camera];
        let (mut lo, mut hi) = ([f64::INFINITY; 3], [f64::NEG_INFINITY; 3]);
        for p in scene
            .layers
            .iter()
            .filter(|l| l.visible)
            .flat_map(|l| &l.mesh.points)
        {
            for k in 0..3 {
                lo[k] = lo[k].min(axes[k].dot(*p));
                hi[k] = hi[k].max(axes[k].dot(*p));
            }
        }
        if lo[0] > hi[0] {
            (lo, hi) = ([-1.0; 3], [1.0; 3]);
        }
        let centre = (0..3).map(|k| 0.5 * (lo[k] + hi[k]) * axes[k]).sum();
        let room = |k: usize, pixels: usize| 0.88 * pixels as f64 / (hi[k] - lo[k]).max(1e-9);
        Self {
            right,
            up: view.up,
            toward: view.toward_camera,
            centre,
            scale: room(0, width).min(room(1, height)),
            half: [0.5 * width as f64, 0.5 * height as f64],
        }
    }

    fn apply(&self, p: DVec3) -> [f64; 3] {
        let d = p - self.centre;
        [
            self.half[0] + self.scale * self.right.dot(d),
            self.half[1] - self.scale * self.up.dot(d),
            self.toward.dot(d),
        ]
    }
}

/// Draws the visible layers; `width` and `height` in pixels.
pub fn render(scene: &Scene, view: &View, width: usize, height: usize) -> Image {
    let (w, h) = (SAMPLES * width, SAMPLES * height);
    let projection = Projection::fit(scene, view, w, h);
    let visible = || {
        scene
            .layers
            .iter()
            .filter(|l| l.visible && !l.mesh.triangles.is_empty())
    };
    let hides_something = visible().any(|l| l.kind != LayerKind::Surface);
    let surfaces = visible().filter(|l| l.kind == LayerKind::Surface).count();
    // Painted surfaces stay solid side by side: a colour on glass cannot be read.
    let is_glass = |l: &Layer| {
        l.kind == LayerKind::Surface && (hides_something || (surfaces > 1 && l.quantity.is_none()))
    };
    // What is solid hides what is behind it, so it is drawn first.
    let solid = visible()
        .filter(|l| !is_glass(l))
        .map(|l| Projected::new(&projection, l, false, height));
    let glass = visible()
        .filter(|l| is_glass(l))
        .map(|l| Projected::new(&projection, l, true, height));
    let layers: Vec<Projected> = solid.chain(glass).collect();
    // Bands of rows know nothing of each other.
    let bands: Vec<Vec<u8>> = (0..height.div_ceil(BAND))
        .into_par_iter()
        .map(|band| {
            let rows = band * BAND..height.min((band + 1) * BAND);
            let mut frame = Frame::new(w, SAMPLES * rows.start, SAMPLES * rows.len());
            for layer in &layers {
                draw(&mut frame, &projection, layer, &layer.of_band[band]);
            }
            resolve(&frame, width, rows.len())
        })
        .collect();
    Image {
        width,
        height,
        rgb: bands.concat(),
    }
}

/// A layer as the camera sees it.
struct Projected<'a> {
    layer: &'a Layer,
    glass: bool,
    corners: Vec<[f64; 3]>,
    normals: Vec<DVec3>,
    base: Vec<[f32; 3]>,
    /// The triangles that each band of rows may show, ascending.
    of_band: Vec<Vec<u32>>,
}

impl<'a> Projected<'a> {
    fn new(projection: &Projection, layer: &'a Layer, glass: bool, height: usize) -> Self {
        let corners: Vec<[f64; 3]> = layer.mesh.points.iter().map(|p| projection.apply(*p)).collect();
        let base = (0..corners.len())
            .map(|i| match (&layer.quantity, layer.kind) {
                (Some(q), LayerKind::Surface) if !glass => q.colour(i),
                _ => [layer.colour[0], layer.colour[1], layer.colour[2]],
            })
            .collect();
        Self {
            layer,
            glass,
            normals: layer.mesh.vertex_normals(),
            of_band: triangles_of_bands(&layer.mesh.triangles, &corners, height),
            corners,
            base,
        }
    }
}

fn triangles_of_bands(triangles: &[[u32; 3]], corners: &[[f64; 3]], height: usize) -> Vec<Vec<u32>> {
    let mut of_band = vec![Vec::new(); height.div_ceil(BAND)];
    let band_of = |y: f64| (y / (SAMPLES * BAND) as f64).floor();
    for (i, t) in triangles.iter().enumerate() {
        let [a, b, c] = t.map(|v| corners[v as usize][1]);
        // Negative numbers become 0 and too large ones are cut off below.
        let first = band_of(a.min(b).min(c)).max(0.0) as usize;
        let last = band_of(a.max(b).max(c));
        if last < 0.0 {
            continue;
        }
        for band in of_band.iter_mut().take(last as usize + 1).skip(first) {
            band.push(i as u32);
        }
    }
    of_band
}

fn draw(frame: &mut Frame, projection: &Projection, projected: &Projected, triangles: &[u32]) {
    let Projected {
        layer,
        glass,
        corners,
        normals,
        base,
        ..
    } = projected;
    let light = (projection.toward + 0.35 * projection.up - 0.25 * projection.right).normalize();
    for &triangle in triangles {
        let t = &layer.mesh.triangles[triangle as usize];
        let [a, b, c] = t.map(|i| corners[i as usize]);
        let area = (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0]);
        if area.abs() < 1e-12 {
            continue;
        }
        let range = |k: usize, from: usize, limit: usize| {
            let lo = a[k].min(b[k]).min(c[k]).ceil().max(from as f64) as usize;
            let hi = a[k].max(b[k]).max(c[k]).floor().min((from + limit) as f64 - 1.0);
            (lo, if hi < from as f64 { None } else { Some(hi as usize) })
        };
        let (x, y) = (range(0, 0, frame.width), range(1, frame.top, frame.height));
        let ((x0, Some(x1)), (y0, Some(y1))) = (x, y) else {
            continue;
        };
        for y in y0..=y1 {
            for x in x0..=x1 {
                let (px, py) = (x as f64, y as f64);
                let u = ((px - a[0]) * (c[1] - a[1]) - (py - a[1]) * (c[0] - a[0])) / area;
                let v = ((b[0] - a[0]) * (py - a[1]) - (b[1] - a[1]) * (px - a[0])) / area;
                if u < 0.0 || v < 0.0 || u + v > 1.0 {
                    continue;
                }
                let mix = |f: &dyn Fn(u32) -> DVec3| (1.0 - u - v) * f(t[0]) + u * f(t[1]) + v * f(t[2]);
                let z = ((1.0 - u - v) * a[2] + u * b[2] + v * c[2]) as f32;
                let i = (y - frame.top) * frame.width + x;
                if z <= frame.depth[i] {
                    continue;
                }
                let normal = mix(&|k| normals[k as usize]).normalize_or_zero();
                let tint = mix(&|k| DVec3::from_array(base[k as usize].map(f64::from)));
                let facing = normal.dot(projection.toward).abs();
                let lit = 0.38 + 0.62 * normal.dot(light).abs();
                if *glass {
                    let alpha = 0.10 + 0.62 * (1.0 - facing).powi(3);
                    let shade = (lit * (1.0 - 0.45 * (1.0 - facing).powi(2))) * tint;
                    let veil = &mut frame.veil[i];
                    for k in 0..3 {
                        veil[k] += (alpha * shade[k]) as f32;
                    }
                    veil[3] += alpha as f32;
                    frame.transmitted[i] *= 1.0 - alpha as f32;
                } else {
                    frame.depth[i] = z;
                    frame.colour[i] = [0, 1, 2].map(|k| (lit * tint[k]) as f32);
                }
            }
        }
    }
}

/// The pixels of a band, as many rows as asked.
fn resolve(frame: &Frame, width: usize, height: usize) -> Vec<u8> {
    let mut rgb = Vec::with_capacity(3 * width * height);
    for y in 0..height {
        for x in 0..width {
            let mut sum = [0f32; 3];
            for (dy, dx) in (0..SAMPLES).flat_map(|dy| (0..SAMPLES).map(move |dx| (dy, dx))) {
                let i = (SAMPLES * y + dy) * frame.width + SAMPLES * x + dx;
                let (veil, t) = (frame.veil[i], frame.transmitted[i]);
                for k in 0..3 {
                    let cover = if veil[3] > 0.0 { veil[k] / veil[3] } else { 0.0 };
                    sum[k] += frame.colour[i][k] * t + cover * (1.0 - t);
                }
            }
            let n = (SAMPLES * SAMPLES) as f32;
            rgb.extend(sum.map(|s| (s / n * 255.0).round().clamp(0.0, 255.0) as u8));
        }
    }
    rgb
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::reports::scene::ball;

    fn pixel(image: &Image, x: usize, y: usize) -> [u8; 3] {
        let i = 3 * (y * image.width + x);
        [image.rgb[i], image.rgb[i + 1], image.rgb[i + 2]]
    }

    #[test]
    fn a_red_ball_is_seen_through_a_glass_ball_and_the_png_inflates_to_its_rows() {
        let mut scene = Scene::default();
        scene.add_surface("", &ball(DVec3::ZERO, 10.0), [0.9, 0.86, 0.76, 1.0], None);
        let mut inner = scene.layers[0].clone();
        inner.kind = LayerKind::Node;
        inner.mesh = ball(DVec3::ZERO, 3.0);
        inner.colour = [0.9, 0.05, 0.05, 1.0];
        scene.layers.push(inner);
        let view = View::broadside(&scene);
        assert!(view.up.dot(view.toward_camera).abs() < 1e-12);
        let image = render(&scene, &view, 120, 90);
        let [r, g, _] = pixel(&image, 60, 45);
        assert!(r > 120 && r > 2 * g, "{r} {g}");
        assert_eq!(pixel(&image, 1, 1), BACKGROUND.map(|c| (c * 255.0).round() as u8));
        let veil = pixel(&image, 60, 45 - 24);
        assert!(veil[0] > 150 && veil != pixel(&image, 1, 1), "{veil:?}");

        let png = image.png();
        let at = png.windows(4).position(|w| w == b"IDAT").expect("image data");
        let mut rows = Vec::new();
        use std::io::Read;
        flate2::read::ZlibDecoder::new(&png[at + 4..])
            .read_to_end(&mut rows)
            .expect("inflates");
        assert_eq!(rows.len(), 90 * (1 + 3 * 120));
        assert_eq!(&rows[1..4], &image.rgb[..3]);
    }

    #[test]
    fn an_empty_scene_is_an_empty_picture() {
        let scene = Scene::default();
        let image = render(&scene, &View::broadside(&scene), 4, 3);
        assert_eq!(image.rgb.len(), 36);
    }
}
