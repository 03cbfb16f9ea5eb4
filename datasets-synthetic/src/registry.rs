//! The names under which data sets can be asked for.

use crate::bones::{self, Bone};
use crate::shapes::{self, Shape};
use glam::DVec3;
use serde::{Deserialize, Serialize};
use std::fmt;
use std::str::FromStr;
use thiserror::Error;

/// What can be made: single shapes, bones, and families of data.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum ShapeKind {
    /// Sphere.
    Sphere,
    /// Ellipsoid 3 : 2 : 1.
    Ellipsoid,
    /// Box 1 : 1.4 : 2.
    Box,
    /// Thin plate.
    Slab,
    /// Triangular prism.
    Prism,
    /// L-shaped block.
    LBlock,
    /// Torus.
    Torus,
    /// Plate with five holes.
    GenusFive,
    /// Knotted tube.
    TrefoilTube,
    /// Capsule.
    Capsule,
    /// Three capsules.
    YOfCapsules,
    /// Two balls and a neck.
    Dumbbell,
    /// Ball with a concentric cavity.
    HollowSphere,
    /// Ball with two cavities.
    TwoCavities,
    /// Blob with three lobes.
    ThreeLobedBlob,
    /// Branching tube.
    TreeTube,
    /// Upper half of a sphere.
    Hemisphere,
    /// Sphere with 4 % of its area missing.
    SphereWithCapMissing,
    /// Side of a cylinder.
    OpenTube,
    /// Moebius band.
    MoebiusBand,
    /// Two squares that cross.
    CrossingPlanes,
    /// The paper's pair of planes.
    PlanesWithBump,
    /// One carpal-like bone.
    Bone(Bone),
    /// The eight carpal-like bones.
    Bones,
    /// Individuals of the eight bones with known modes.
    Population,
    /// Ellipsoids with one mode.
    OneModeFamily,
    /// Ellipsoids with two modes.
    TwoModeFamily,
    /// One bone under known deformations.
    Deformations,
    /// Lesions with known volume change, as meshes and masks.
    Growth,
    /// Label masks with known truth.
    Masks,
}

/// A name that is not in the list.
#[derive(Clone, Debug, PartialEq, Eq, Error)]
#[error("unknown kind '{name}'; one of: {}", ShapeKind::list().iter().map(|k| k.to_string()).collect::<Vec<_>>().join(", "))]
pub struct UnknownKind {
    /// The name given.
    pub name: String,
}

impl ShapeKind {
    /// Every kind, in the order of the documentation.
    pub fn list() -> Vec<ShapeKind> {
        use ShapeKind::*;
        let mut all = vec![
            Sphere,
            Ellipsoid,
            Box,
            Slab,
            Prism,
            LBlock,
            Torus,
            GenusFive,
            TrefoilTube,
            Capsule,
            YOfCapsules,
            Dumbbell,
            HollowSphere,
            TwoCavities,
            ThreeLobedBlob,
            TreeTube,
            Hemisphere,
            SphereWithCapMissing,
            OpenTube,
            MoebiusBand,
            CrossingPlanes,
            PlanesWithBump,
        ];
        all.extend(self::Bone::ALL.map(Bone));
        all.extend([
            Bones,
            Population,
            OneModeFamily,
            TwoModeFamily,
            Deformations,
            Growth,
            Masks,
        ]);
        all
    }

    /// Kinds that are one shape.
    pub fn single_shapes() -> Vec<ShapeKind> {
        Self::list()
            .into_iter()
            .filter(|k| k.shape(0).is_some())
            .collect()
    }

    /// One line for help texts.
    pub fn description(self) -> &'static str {
        use ShapeKind::*;
        match self {
            Sphere => "sphere, radius 10 mm",
            Ellipsoid => "ellipsoid with semi-axes 15, 10, 5 mm: one flat medial sheet",
            Box => "box 10 x 14 x 20 mm: 13 sheets, 12 axial curves, 12 ribs",
            Slab => "thin plate 20 x 14 x 1 mm",
            Prism => "triangular prism: 9 sheets, 7 axial curves, 9 ribs",
            LBlock => "L-shaped block: 16 sheets, 15 axial curves",
            Torus => "torus: one closed wire",
            GenusFive => "plate with five holes: one sheet with six ribs, genus 5",
            TrefoilTube => "tube around a trefoil knot: one closed wire",
            Capsule => "capsule: one wire",
            YOfCapsules => "three capsules from one point: three wires",
            Dumbbell => "two balls joined by a cylinder: one wire",
            HollowSphere => "ball with a concentric cavity: one closed sheet, b2 = 1",
            TwoCavities => "ball with two cavities: b2 = 2",
            ThreeLobedBlob => "blob with three lobes and exact volume",
            TreeTube => "branching tube: 15 wires",
            Hemisphere => "upper half of a sphere: open, one border",
            SphereWithCapMissing => "sphere with 4 % of its area missing: open, one border",
            OpenTube => "side of a cylinder: open, two borders",
            MoebiusBand => "Moebius band: one side, one border",
            CrossingPlanes => "two squares that cross: non-manifold line",
            PlanesWithBump => "two planes, one with an elongated Gaussian bump: one sheet between them",
            Bone(_) => "carpal-like bone",
            Bones => "the eight carpal-like bones of one individual",
            Population => "individuals of the eight bones with seven known modes",
            OneModeFamily => "ellipsoids that differ in one known mode",
            TwoModeFamily => "ellipsoids that differ in two known modes",
            Deformations => {
                "one bone in random poses, with noise, warps, growth, crops, density, missing parts"
            }
            Growth => "lesions at two dates with exactly known volume change, as meshes and masks",
            Masks => "label masks of spheres (4 to 64 voxels) and bones, isotropic, anisotropic, oblique",
        }
    }

    /// The shape, for kinds that are one; `seed` matters for bones only.
    pub fn shape(self, seed: u64) -> Option<Shape> {
        use ShapeKind::*;
        Some(match self {
            Sphere => shapes::sphere(10.0),
            Ellipsoid => shapes::ellipsoid(15.0, 10.0, 5.0),
            Box => shapes::box_shape(10.0, 14.0, 20.0),
            Slab => shapes::slab(1.0),
            Prism => shapes::prism(12.0, 20.0),
            LBlock => shapes::l_block(20.0, 8.0, 5.0),
            Torus => shapes::torus(10.0, 3.0),
            GenusFive => shapes::genus_five(),
            TrefoilTube => shapes::trefoil_tube(4.0, 1.6),
            Capsule => shapes::capsule(20.0, 4.0),
            YOfCapsules => shapes::y_of_capsules(15.0, 3.0),
            Dumbbell => shapes::dumbbell(24.0, 6.0, 2.5),
            HollowSphere => shapes::hollow_sphere(10.0, 5.0),
            TwoCavities => shapes::ball_with_cavities(
                10.0,
                &[
                    (DVec3::new(4.6, 0.0, 0.0), 2.6),
                    (DVec3::new(-4.0, 1.0, 0.0), 3.6),
                ],
            ),
            ThreeLobedBlob => shapes::three_lobed_blob(),
            TreeTube => shapes::tree_tube(3),
            Hemisphere => shapes::hemisphere(10.0),
            SphereWithCapMissing => shapes::sphere_with_cap_missing(10.0, 0.04),
            OpenTube => shapes::open_tube(5.0, 20.0),
            MoebiusBand => shapes::moebius_band(10.0, 6.0),
            CrossingPlanes => shapes::crossing_planes(20.0),
            PlanesWithBump => shapes::planes_with_bump(20.0, 4.0),
            Bone(kind) => bones::bone(kind, seed),
            Bones | Population | OneModeFamily | TwoModeFamily | Deformations | Growth | Masks => {
                return None;
            }
        })
    }
}

impl fmt::Display for ShapeKind {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        use ShapeKind::*;
        f.write_str(match self {
            Sphere => "sphere",
            Ellipsoid => "ellipsoid",
            Box => "box",
            Slab => "slab",
            Prism => "prism",
            LBlock => "l_block",
            Torus => "torus",
            GenusFive => "genus_five",
            TrefoilTube => "trefoil_tube",
            Capsule => "capsule",
            YOfCapsules => "y_of_capsules",
            Dumbbell => "dumbbell",
            HollowSphere => "hollow_sphere",
            TwoCavities => "two_cavities",
            ThreeLobedBlob => "three_lobed_blob",
            TreeTube => "tree_tube",
            Hemisphere => "hemisphere",
            SphereWithCapMissing => "sphere_with_cap_missing",
            OpenTube => "open_tube",
            MoebiusBand => "moebius_band",
            CrossingPlanes => "crossing_planes",
            PlanesWithBump => "planes_with_bump",
            Bone(kind) => kind.name(),
            Bones => "bones",
            Population => "population",
            OneModeFamily => "one_mode_family",
            TwoModeFamily => "two_mode_family",
            Deformations => "deformations",
            Growth => "growth",
            Masks => "masks",
        })
    }
}

impl FromStr for ShapeKind {
    type Err = UnknownKind;

    fn from_str(name: &str) -> Result<Self, UnknownKind> {
        let wanted = name.trim().to_ascii_lowercase().replace('-', "_");
        let found = ShapeKind::list().into_iter().find(|k| k.to_string() == wanted);
        found.ok_or_else(|| UnknownKind {
            name: name.to_string(),
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_are_unique_and_parse_back() {
        let mut names: Vec<String> = ShapeKind::list().iter().map(|k| k.to_string()).collect();
        for kind in ShapeKind::list() {
            assert_eq!(kind.to_string().parse::<ShapeKind>(), Ok(kind));
            assert!(!kind.description().is_empty());
        }
        assert_eq!("L-Block".parse(), Ok(ShapeKind::LBlock));
        names.sort();
        names.dedup();
        assert_eq!(names.len(), ShapeKind::list().len());
        let error = "potato".parse::<ShapeKind>().expect_err("not a kind");
        assert!(error.to_string().contains("y_of_capsules"), "{error}");
    }
}
