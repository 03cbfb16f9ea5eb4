//! Segregation of a raw cloud: the front door.
//!
//! In: unorganised points in mm, any order, no normals. Out: [`CloudSegregation`]: the triangulation of the prepared points,
//! surface triangles, inside labels when the surface is closed, a way back from every input point, and [`CloudReport`].
//!
//! 1. Prepare: outliers, noise, thinning ([`super::prepare`]).
//! 2. Close ([`super::closure`]), whatever the cloud is: a closed surface shows by its unsupported area how open it is.
//! 3. Decide: open when 1.5 % or more of the area has no points to support it, 3 % with strong noise (`judge`). An open surface is the
//!    greedy one, its sheets joined where they cross ([`super::crossing`]), oriented where that can be done ([`super::orient`]).
//! 4. Second opinions: for strong noise other thinning seeds and pulls; the run with the least to explain is taken ([`super::runs`]).
//! 5. Doubt ([`super::self_check`]): the result looks for its own faults.
//! 6. A doubted result is tried again with the smallest smoothing and, unless the noise is strong, with none, and the first
//!    without doubts is taken: where parts are a few spacings thin or the sampling is patchy, detail reads as noise or outliers.
//!
//! Cost: `O(n log n)` in practice.

use super::balls::Balls;
use super::closure::{Closure, preset_facets};
use super::crossing::{Joined, OpenSurface, join_crossings};
use super::error::SegregationError;
use super::gap_cost::CostRule;
use super::gap_transforms::gap_transforms;
use super::judge::{Judged, sorted};
use super::labels::Segregation;
use super::openness::{patches, rims};
use super::orient::orient;
use super::prepare::{Measured, Prepared, Strength, clean, measure, thin_out};
use super::report::{ClosingReport, CloudReport, ComponentReport, Variation};
use super::runs::{Chosen, Run, choose, opinion_of, run};
use super::self_check::{doubts, pull_opinions, self_check};
use super::settings::{Denoise, SegregationSettings};
use crate::delaunay::{Facet, Triangulation};
use crate::geometry::{Neighbours, TriangleMesh, VertexId};
use glam::DVec3;
use std::collections::BTreeSet;

/// A segregated cloud.
#[derive(Clone, Debug, Default)]
pub struct CloudSegregation {
    /// The triangulation of the points in use.
    pub triangulation: Triangulation,
    /// Triangles and labels.
    pub segregation: Segregation,
    /// The input point each generator came from.
    pub source: Vec<u32>,
    /// For every input point the generator nearest to it: its place on the surface.
    pub nearest: Vec<VertexId>,
    /// Local spacing of the generators, mm.
    pub spacing_mm: Vec<f64>,
    /// Decisions, numbers, holes, doubts.
    pub report: CloudReport,
}

/// Segregates a raw cloud; see the module.
///
/// # Errors
/// [`SegregationError`] when a coordinate is not finite, when the points do not span space, or when the component asked for
/// does not exist.
///
/// # Example
/// ```
/// use glam::DVec3;
/// use medial_scaffold::segregation::{SegregationSettings, segregate_cloud};
/// // A spiral of 800 points on the unit sphere.
/// let points: Vec<DVec3> = (0..800)
///     .map(|i| {
///         let z = 1.0 - (2.0 * f64::from(i) + 1.0) / 800.0;
///         let (r, a) = ((1.0 - z * z).sqrt(), 2.399963 * f64::from(i));
///         DVec3::new(r * a.cos(), r * a.sin(), z)
///     })
///     .collect();
/// let result = segregate_cloud(&points, &SegregationSettings::default())?;
/// assert!(result.report.topology.watertight && result.report.topology.euler == 2);
/// # Ok::<(), medial_scaffold::segregation::SegregationError>(())
/// ```
pub fn segregate_cloud(
    points: &[DVec3],
    settings: &SegregationSettings,
) -> Result<CloudSegregation, SegregationError> {
    check(points)?;
    let measured = measure(points, settings.denoise);
    // A copy for the second try, if there may be one.
    let again = (settings.denoise == Denoise::Auto).then(|| measured.clone());
    let first = segregate_measured(points, measured, Strength::Measured, settings)?;
    if settings.denoise != Denoise::Auto || !first.report.doubtful() {
        return Ok(first);
    }
    for &strength in gentler(&first.report, settings) {
        // Another strength may have fewer components than the one asked for; it is then no better.
        let measured = match (strength, &again) {
            (Strength::Nothing, _) | (_, None) => measure(points, Denoise::Off),
            (_, Some(measured)) => measured.clone(),
        };
        let Ok(mut other) = segregate_measured(points, measured, strength, settings) else {
            continue;
        };
        if !other.report.doubtful() {
            other.segregation.warnings.push(
                match strength {
                    Strength::Nothing => {
                        "dropping outliers and noise gave a surface with doubts, all points as given one without: those are used"
                    }
                    _ => "removing all the noise gave a surface with doubts, removing some of it one without: that is used",
                }
                .to_owned(),
            );
            return Ok(other);
        }
    }
    Ok(first)
}

/// The strengths below what was done, strongest first.
fn gentler(report: &CloudReport, settings: &SegregationSettings) -> &'static [Strength] {
    let done = &report.prepare;
    if done.passes > 0 && done.noise_over_spacing >= settings.second_opinion_noise {
        return &[Strength::Light];
    }
    match (done.passes, done.outliers) {
        (0, 0) => &[],
        (0, _) => &[Strength::Nothing],
        _ => &[Strength::Light, Strength::Nothing],
    }
}

fn segregate_measured(
    points: &[DVec3],
    measured: Measured,
    strength: Strength,
    settings: &SegregationSettings,
) -> Result<CloudSegregation, SegregationError> {
    let cleaned = clean(measured, strength);
    let chosen = choose(&cleaned, settings)?;
    finish(points, chosen, &BTreeSet::new(), settings)
}

/// A cloud some of whose surface is known.
pub(super) struct PresetOutcome {
    pub cloud: CloudSegregation,
    /// The given triangles that are Delaunay facets, by input point, sorted.
    pub preset_facets: BTreeSet<[u32; 3]>,
}

/// As [`segregate_cloud`] with triangles (by input point) that are known to be surface. Points are not moved.
pub(super) fn segregate_with_preset(
    points: &[DVec3],
    triangles: &[[u32; 3]],
    settings: &SegregationSettings,
) -> Result<PresetOutcome, SegregationError> {
    let cleaned = clean(measure(points, settings.denoise), Strength::Measured);
    let prepared = thin_out(&cleaned, settings.seed);
    let mut place = vec![u32::MAX; points.len()];
    for (new, &old) in prepared.source.iter().enumerate() {
        place[old as usize] = new as u32;
    }
    let preset: Vec<[u32; 3]> = triangles.iter().map(|t| t.map(|i| place[i as usize])).collect();
    let run = run(prepared, &preset, settings.seed, settings)?;
    let triangulation = &run.closure.triangulation;
    let known: BTreeSet<[u32; 3]> = preset_facets(triangulation, &preset)
        .into_iter()
        .map(|f| sorted(triangulation.facet_vertices(f)))
        .collect();
    let preset_facets = known
        .iter()
        .map(|t| {
            let mut t = t.map(|v| run.prepared.source[v as usize]);
            t.sort_unstable();
            t
        })
        .collect();
    let chosen = Chosen {
        run,
        opinions: Vec::new(),
    };
    Ok(PresetOutcome {
        cloud: finish(points, chosen, &known, settings)?,
        preset_facets,
    })
}

pub(super) fn check(points: &[DVec3]) -> Result<(), SegregationError> {
    match points.iter().position(|p| !p.is_finite()) {
        Some(index) => {
            let p = points[index];
            Err(SegregationError::NotFinite {
                index,
                x: p.x,
                y: p.y,
                z: p.z,
            })
        }
        None => Ok(()),
    }
}

/// Decision, report and maps.
fn finish(
    points: &[DVec3],
    chosen: Chosen,
    known: &BTreeSet<[u32; 3]>,
    settings: &SegregationSettings,
) -> Result<CloudSegregation, SegregationError> {
    let Chosen {
        run: Run {
            prepared,
            mut closure,
            ..
        },
        opinions,
    } = chosen;
    let judged = Judged::new(&closure, known);
    let decision = judged.decide(settings.threshold(&prepared.report), settings);
    let mut report = CloudReport {
        prepare: prepared.report.clone(),
        second_opinions: opinions,
        islands: closure.islands.clone(),
        closing: closing_report(&closure, prepared.points.len()),
        ..Default::default()
    };
    let mut segregation = if decision.closed {
        report.filled_holes = patches(&closure.triangulation.points, &judged.raw, &judged.bare);
        Segregation {
            triangles: judged.triangles,
            inside: closure.inside.clone(),
            closed: true,
            loose: 0,
            warnings: Vec::new(),
        }
    } else {
        let given = !known.is_empty();
        let mut triangles = open_triangles(&closure, given, settings.cost);
        let mut warnings = Vec::new();
        let mut loose = 0;
        if !given && settings.denoise != Denoise::Off {
            let joined = joined_crossings(points, &prepared, &closure, &triangles)?;
            if let Some(joined) = joined {
                warnings.extend(crossing_warnings(&joined));
                triangles = joined.triangles;
                report.crossings = joined.crossings;
                report.crossing_points_added = joined.added;
                loose = joined.loose;
                closure.used = joined.origin.iter().map(|&o| closure.used[o as usize]).collect();
                closure.spacing_mm = joined.spacing_mm;
                closure.triangulation = joined.triangulation;
            }
        }
        Segregation {
            loose,
            ..open_surface(&closure.triangulation.points, &triangles, warnings)
        }
    };
    report.decision = decision;
    if segregation.closed {
        let mesh = segregation.surface(&closure.triangulation);
        report.self_check = self_check(
            &closure,
            &mesh,
            &judged.bare,
            &prepared.points,
            &prepared.spacing_mm,
        );
        let tried = report
            .second_opinions
            .iter()
            .any(|o| matches!(o.variation, Variation::Pull { .. }));
        if report.self_check.thin_share > 0.0 && report.self_check.narrow_handles.is_empty() && !tried {
            let more = pull_opinions(&closure, settings.least_component_share);
            if report.second_opinions.is_empty() {
                report.second_opinions.push(opinion_of(&mesh, Variation::None));
            }
            report.second_opinions.extend(more);
        }
    }
    let mut mesh = segregation.surface(&closure.triangulation);
    report.components = components(&mesh);
    if let Some(rank) = settings.component {
        pick_component(rank, &mut segregation, &mesh, &closure.triangulation)?;
        mesh = segregation.surface(&closure.triangulation);
    }
    report.topology = mesh.topology();
    report.rims = rims(&mesh.points, &mesh.triangles);
    report.doubts = doubts(&report, settings);
    if !segregation.closed && !report.rims.is_empty() {
        let rim = &report.rims[0];
        segregation.warnings.push(format!(
            "the surface is open: interior and exterior stay joined through {}, the longest {:.3} mm round ({:.3}, {:.3}, {:.3})",
            match report.rims.len() {
                1 => "1 rim".to_owned(),
                n => format!("{n} rims"),
            },
            rim.length_mm,
            rim.place.x,
            rim.place.y,
            rim.place.z
        ));
    }
    segregation
        .warnings
        .extend(report.doubts.iter().map(|d| d.text.clone()));
    let source: Vec<u32> = closure
        .used
        .iter()
        .map(|&i| prepared.source[i as usize])
        .collect();
    Ok(CloudSegregation {
        nearest: nearest_generators(points, &closure.triangulation.points, &source),
        source,
        spacing_mm: closure.spacing_mm,
        triangulation: closure.triangulation,
        segregation,
        report,
    })
}

/// For every point the generator nearest to it; a generator that was not moved is its own point's.
fn nearest_generators(points: &[DVec3], generators: &[DVec3], source: &[u32]) -> Vec<VertexId> {
    let mut nearest = vec![VertexId(u32::MAX); points.len()];
    for (generator, &point) in source.iter().enumerate() {
        if generators[generator] == points[point as usize] {
            nearest[point as usize] = VertexId::from_index(generator);
        }
    }
    let rest: Vec<u32> = (0..points.len() as u32)
        .filter(|&i| nearest[i as usize].0 == u32::MAX)
        .collect();
    if rest.is_empty() {
        return nearest;
    }
    let queries: Vec<DVec3> = rest.iter().map(|&i| points[i as usize]).collect();
    let found = Neighbours::new(generators).nearest_many(&queries);
    for (&i, n) in rest.iter().zip(&found) {
        nearest[i as usize] = VertexId(n.index);
    }
    nearest
}

/// How much larger than the least of its neighbours a spacing may be by chance.
const SCATTER: f64 = 1.25;

/// Spacings taken down to what the neighbours have: at a rim half of a point's neighbours are missing, which makes the
/// spacing there look up to twice as large, enough to join two sheets round their rims.
fn spacing_at_rims(triangles: &[[u32; 3]], spacing_mm: &[f64]) -> Vec<f64> {
    let mut least = spacing_mm.to_vec();
    for _ in 0..2 {
        let before = least.clone();
        for t in triangles {
            let m = t
                .iter()
                .map(|&v| before[v as usize])
                .fold(f64::INFINITY, f64::min);
            for &v in t {
                least[v as usize] = least[v as usize].min(m);
            }
        }
    }
    least
        .iter()
        .zip(spacing_mm)
        .map(|(l, s)| (SCATTER * l).min(*s))
        .collect()
}

/// The greedy surface; found once more with the spacing at its rims put right, unless triangles were given.
fn open_triangles(closure: &Closure, given: bool, cost: CostRule) -> Vec<[u32; 3]> {
    let triangulation = &closure.triangulation;
    let corners = |facets: &[Facet]| -> Vec<[u32; 3]> {
        facets
            .iter()
            .map(|&f| super::labels::smallest_first(triangulation.facet_vertices(f)).map(|v| v.0))
            .collect()
    };
    let triangles = corners(&closure.greedy.facets);
    if given {
        return triangles;
    }
    let spacing = spacing_at_rims(&triangles, &closure.spacing_mm);
    let balls = Balls::new(triangulation);
    let again = gap_transforms(triangulation, &balls, &closure.depths, &spacing, cost, &[]);
    corners(&again.facets)
}

/// Where the sheets of an open surface cross they are joined.
fn joined_crossings(
    points: &[DVec3],
    prepared: &Prepared,
    closure: &Closure,
    triangles: &[[u32; 3]],
) -> Result<Option<Joined>, SegregationError> {
    let measured: Vec<DVec3> = closure
        .used
        .iter()
        .map(|&i| points[prepared.source[i as usize] as usize])
        .collect();
    Ok(join_crossings(&OpenSurface {
        points: &closure.triangulation.points,
        measured: &measured,
        spacing_mm: &closure.spacing_mm,
        triangles,
        noise_over_spacing: match prepared.report.passes {
            0 => 0.0,
            _ => prepared.report.noise_over_spacing,
        },
    })?)
}

fn crossing_warnings(joined: &Joined) -> Vec<String> {
    let mut out: Vec<String> = joined
        .crossings
        .iter()
        .map(|c| {
            format!(
                "{} half sheets meet along {:.3} mm ({} edges) round ({:.3}, {:.3}, {:.3}): {} points within half a spacing of the line are replaced by points on it",
                c.half_sheets, c.length_mm, c.edges, c.place.x, c.place.y, c.place.z, c.replaced_points
            )
        })
        .collect();
    if joined.loose > 0 {
        out.push(format!(
            "{} triangles near crossings are no facets of the triangulation: the scaffold passes through them",
            joined.loose
        ));
    }
    out
}

/// Triangles turned alike as far as they can be.
fn open_surface(points: &[DVec3], triangles: &[[u32; 3]], mut warnings: Vec<String>) -> Segregation {
    let oriented = orient(points, triangles);
    if !oriented.orientable {
        warnings.push(
            "the surface is not orientable: its triangles are turned alike only piece by piece".to_owned(),
        );
    }
    Segregation {
        triangles: oriented.triangles.iter().map(|t| t.map(VertexId)).collect(),
        inside: Vec::new(),
        closed: false,
        loose: 0,
        warnings,
    }
}

fn closing_report(closure: &Closure, prepared: usize) -> ClosingReport {
    ClosingReport {
        greedy_triangles: closure.greedy.facets.len(),
        greedy_undone: closure.greedy.undone,
        diffusion_iterations: closure.iterations,
        pinched: closure.repair.pinched,
        flips: closure.repair.flips,
        left_pinched: closure.repair.left,
        handles_removed: closure.opened.clone(),
        adopted: closure.adopted,
        dropped: closure.dropped,
        off: closure.off,
        off_share: (closure.dropped.max(closure.off)) as f64 / prepared.max(1) as f64,
    }
}

fn components(mesh: &TriangleMesh) -> Vec<ComponentReport> {
    let mut out: Vec<ComponentReport> = mesh
        .components()
        .iter()
        .map(|c| {
            let part = mesh.submesh(c);
            let topology = part.topology();
            ComponentReport {
                points: part.points.len(),
                area_mm2: part.area(),
                volume_mm3: (topology.watertight && topology.oriented).then(|| part.signed_volume()),
                euler: topology.euler,
                boundary_edges: topology.boundary_edges,
                place: part.points.iter().sum::<DVec3>() / part.points.len().max(1) as f64,
            }
        })
        .collect();
    out.sort_by_key(|c| std::cmp::Reverse(c.points));
    out
}

/// Keeps one component of the surface, with the tetrahedra it encloses.
fn pick_component(
    rank: usize,
    segregation: &mut Segregation,
    mesh: &TriangleMesh,
    triangulation: &Triangulation,
) -> Result<(), SegregationError> {
    let mut parts = mesh.components();
    parts.sort_by_key(|c| std::cmp::Reverse(mesh.submesh(c).points.len()));
    let Some(part) = parts.get(rank) else {
        return Err(SegregationError::NoSuchComponent {
            asked: rank,
            found: parts.len(),
        });
    };
    if segregation.inside.is_empty() {
        segregation.triangles = part.iter().map(|&t| segregation.triangles[t as usize]).collect();
        return Ok(());
    }
    let mut on_part = vec![false; triangulation.points.len()];
    for &t in part {
        for v in segregation.triangles[t as usize] {
            on_part[v.index()] = true;
        }
    }
    // The solid behind the component: inside tetrahedra connected to those that touch it through its triangles.
    let mut keep = vec![false; segregation.inside.len()];
    let mut stack: Vec<_> = super::labels::boundary_facets(triangulation, &segregation.inside)
        .into_iter()
        .filter(|&f| triangulation.facet_vertices(f).iter().all(|v| on_part[v.index()]))
        .map(|f| f.tet)
        .collect();
    while let Some(tet) = stack.pop() {
        if std::mem::replace(&mut keep[tet.index()], true) {
            continue;
        }
        stack.extend(
            (0..4)
                .map(|i| triangulation.neighbour(tet, i))
                .filter(|t| segregation.inside[t.index()] && !keep[t.index()]),
        );
    }
    segregation.triangles = super::labels::boundary_triangles(triangulation, &keep);
    segregation.inside = keep;
    Ok(())
}
