//! Points drawn from a mesh: uniform at random, blue noise, with a density gradient; and what scanners
//! do to them: noise and outliers.
//!
//! * [`uniform`]: independent points, area-uniform or with any density.
//! * [`poisson`]: Poisson-disk (blue-noise) points.
//! * [`corrupt`]: noise, outliers, shuffling; the spacing that noise is measured in.
//!
//! Every function takes a `seed` and draws from its own ChaCha8 stream: the same arguments give the
//! same bytes on every machine and with any number of threads.

pub mod corrupt;
pub mod poisson;
pub mod uniform;

pub use corrupt::{add_noise, add_outliers, mean_spacing, shuffle};
pub use poisson::{sample_poisson, sample_poisson_with_density};
pub use uniform::{density_gradient_x, sample_density_gradient, sample_uniform, sample_with_density};

use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;

/// The crate's random generator: ChaCha8 with one stream for each purpose, so that two uses of one
/// seed are independent.
pub(crate) fn generator(seed: u64, stream: u64) -> ChaCha8Rng {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    rng.set_stream(stream);
    rng
}

/// Streams of [`generator`], one a purpose.
pub(crate) mod stream {
    pub const UNIFORM: u64 = 1;
    pub const POISSON: u64 = 2;
    pub const NOISE: u64 = 3;
    pub const OUTLIERS: u64 = 4;
    pub const SHUFFLE: u64 = 5;
    pub const RIGID: u64 = 6;
    pub const WARP: u64 = 7;
    pub const CROP: u64 = 8;
}
