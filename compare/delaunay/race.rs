//! Times this library: `delaunay-race FILE THREADS REPEATS [full]` prints a line a run,
//! `seconds cpu_seconds finite_tets bytes_a_point peak_bytes_a_point`; with `full` the seconds are those of the full scaffold alone.

use glam::DVec3;
use medial_scaffold::delaunay::{DelaunaySettings, delaunay};
use medial_scaffold::full_scaffold::full_scaffold;
use std::{env, error::Error, fs, time::Instant};

fn main() -> Result<(), Box<dyn Error>> {
    let args: Vec<String> = env::args().collect();
    let (file, threads, repeats) = match args.as_slice() {
        [_, file, threads, repeats, ..] => (file, threads.parse()?, repeats.parse::<usize>()?),
        _ => return Err("usage: delaunay-race FILE THREADS REPEATS [full]".into()),
    };
    rayon::ThreadPoolBuilder::new()
        .num_threads(threads)
        .build_global()?;
    let points: Vec<DVec3> = fs::read(file)?
        .chunks_exact(24)
        .map(|c| {
            let at = |i: usize| f64::from_le_bytes(std::array::from_fn(|k| c[8 * i + k]));
            DVec3::new(at(0), at(1), at(2))
        })
        .collect();
    let n = points.len() as f64;
    let before = memory("VmRSS:")?;
    for _ in 0..repeats {
        let (start, cpu) = (Instant::now(), cpu_seconds()?);
        let t = delaunay(&points, &DelaunaySettings { threads })?;
        let mut seconds = [start.elapsed().as_secs_f64(), cpu_seconds()? - cpu];
        let after = memory("VmRSS:")?;
        let peak = memory("VmHWM:")?;
        if args.len() > 4 {
            let (start, cpu) = (Instant::now(), cpu_seconds()?);
            let scaffold = full_scaffold(&t)?;
            seconds = [start.elapsed().as_secs_f64(), cpu_seconds()? - cpu];
            if scaffold.counts.morse != 1 {
                return Err(format!("{:?}", scaffold.counts).into());
            }
        }
        let [wall, cpu] = seconds;
        let bytes = [after, peak].map(|m| (m - before) / n);
        println!(
            "{wall:.4} {cpu:.2} {} {:.0} {:.0}",
            t.num_finite(),
            bytes[0],
            bytes[1]
        );
    }
    Ok(())
}

/// A field of the process's own memory account in bytes.
fn memory(field: &str) -> Result<f64, Box<dyn Error>> {
    let status = fs::read_to_string("/proc/self/status")?;
    let line = status
        .lines()
        .find(|l| l.starts_with(field))
        .ok_or("no memory account")?;
    let kib: f64 = line.split_whitespace().nth(1).ok_or("no number")?.parse()?;
    Ok(1024.0 * kib)
}

/// Processor time of all threads so far, in ticks of 10 ms.
fn cpu_seconds() -> Result<f64, Box<dyn Error>> {
    let stat = fs::read_to_string("/proc/self/stat")?;
    let after_name = stat.rsplit(')').next().ok_or("no account")?;
    let ticks: Vec<f64> = after_name
        .split_whitespace()
        .skip(11)
        .take(2)
        .flat_map(str::parse)
        .collect();
    Ok(ticks.iter().sum::<f64>() / 100.0)
}
