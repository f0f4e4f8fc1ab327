//! What is done to a primitive's arrays: topology, unused vertices, broken normals and weights.

use super::{document::Element, ignored::Notes};
use crate::{Result, scene::Mesh};
use glam::Vec3;

/// The primitive modes that have area.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Mode {
    Triangles,
    Strip,
    Fan,
}

/// The mode of a primitive; none for points and lines, which are noted.
pub(super) fn mode(element: &Element, notes: &Notes) -> Result<Option<Mode>> {
    let name = match element.index("mode")?.unwrap_or(4) {
        0 => "POINTS",
        1 => "LINES",
        2 => "LINE_LOOP",
        3 => "LINE_STRIP",
        4 => return Ok(Some(Mode::Triangles)),
        5 => return Ok(Some(Mode::Strip)),
        6 => return Ok(Some(Mode::Fan)),
        other => return Err(element.error(format!("unknown mode {other}; export the file again"))),
    };
    notes.add(name, element.place.clone(), "points and lines have no area and are not drawn");
    Ok(None)
}

/// The triangles of a primitive (glTF 2.0, 3.7.2.1).
///
/// Triangles that use a vertex twice are left out: strips are stitched with them, and they have no area however
/// the mesh deforms. Triangles that happen to have no area are kept.
pub(super) fn triangles(mode: Mode, indices: Option<Vec<u32>>, vertices: usize) -> Vec<[u32; 3]> {
    let indices = indices.unwrap_or_else(|| (0..vertices as u32).collect());
    let mut out: Vec<[u32; 3]> = match mode {
        Mode::Triangles => indices.as_chunks::<3>().0.to_vec(),
        Mode::Strip => indices
            .windows(3)
            .enumerate()
            .map(|(i, w)| if i % 2 == 0 { [w[0], w[1], w[2]] } else { [w[0], w[2], w[1]] })
            .collect(),
        Mode::Fan => {
            let hub = indices.first().copied().unwrap_or(0);
            indices.get(1..).unwrap_or(&[]).windows(2).map(|w| [w[0], w[1], hub]).collect()
        }
    };
    out.retain(|[a, b, c]| a != b && b != c && c != a);
    out
}

/// Renumbers the triangles so that they use every vertex, and says which vertices those are; none: they do already.
///
/// Exporters put many meshes into one vertex array; each primitive would otherwise carry all of it.
pub(super) fn keep_used(triangles: &mut [[u32; 3]], vertices: usize) -> Option<Vec<u32>> {
    let corners = triangles.len() * 3;
    if corners.saturating_mul(16) < vertices {
        // Few triangles on a large array: do not even clear a table of its size.
        let mut keep: Vec<u32> = triangles.iter().flatten().copied().collect();
        keep.sort_unstable();
        keep.dedup();
        for corner in triangles.iter_mut().flatten() {
            *corner = keep.partition_point(|k| k < corner) as u32;
        }
        return Some(keep);
    }
    let mut place = vec![u32::MAX; vertices];
    for &corner in triangles.iter().flatten() {
        place[corner as usize] = 0;
    }
    let keep: Vec<u32> = (0..vertices as u32).filter(|&v| place[v as usize] == 0).collect();
    if keep.len() == vertices {
        return None;
    }
    for (new, &old) in keep.iter().enumerate() {
        place[old as usize] = new as u32;
    }
    for corner in triangles.iter_mut().flatten() {
        *corner = place[*corner as usize];
    }
    Some(keep)
}

/// Makes normals and tangents unit vectors; normals that have no direction get their triangles' one.
pub(super) fn mend_normals(mesh: &mut Mesh) {
    if mesh.normals.is_empty() {
        // Without normals, tangents must not be used (glTF 2.0, 3.7.2.1).
        mesh.tangents.clear();
        return;
    }
    let unit = |v: Vec3| v.try_normalize();
    let broken = mesh.normals.iter().any(|&n| unit(n).is_none());
    let mut faces = vec![Vec3::ZERO; if broken { mesh.positions.len() } else { 0 }];
    if broken {
        for triangle in &mesh.triangles {
            let [a, b, c] = triangle.map(|i| mesh.positions[i as usize]);
            let face = (b - a).cross(c - a);
            for &corner in triangle {
                faces[corner as usize] += face;
            }
        }
    }
    for (i, normal) in mesh.normals.iter_mut().enumerate() {
        *normal = unit(*normal).or_else(|| unit(faces[i])).unwrap_or(Vec3::Y);
    }
    for tangent in &mut mesh.tangents {
        match unit(tangent.truncate()) {
            Some(direction) => *tangent = direction.extend(if tangent.w < 0.0 { -1.0 } else { 1.0 }),
            None => {
                // One hole in the tangents: all are derived from the texture coordinates instead.
                mesh.tangents.clear();
                break;
            }
        }
    }
}

/// Makes joint weights sum to 1, and joints without weight harmless.
pub(super) fn mend_joints(mesh: &mut Mesh) {
    let sets = mesh.joints.len().min(mesh.joint_weights.len());
    mesh.joints.truncate(sets);
    mesh.joint_weights.truncate(sets);
    let vertices = mesh.positions.len();
    let whole = |set: usize| mesh.joints[set].len() == vertices && mesh.joint_weights[set].len() == vertices;
    if !(0..sets).all(whole) {
        // note: a set that is missing in between; none is used, so the mesh stays as it was modelled.
        mesh.joints.clear();
        mesh.joint_weights.clear();
        return;
    }
    for vertex in 0..vertices {
        let mut sum = 0.0;
        for set in 0..sets {
            for (joint, weight) in
                mesh.joints[set][vertex].iter_mut().zip(&mut mesh.joint_weights[set][vertex])
            {
                if !weight.is_finite() || *weight <= 0.0 {
                    (*joint, *weight) = (0, 0.0);
                }
                sum += *weight;
            }
        }
        if sum > 0.0 && sum.is_finite() {
            mesh.joint_weights.iter_mut().flat_map(|set| &mut set[vertex]).for_each(|w| *w /= sum);
        } else if sets > 0 {
            mesh.joints[0][vertex][0] = 0;
            mesh.joint_weights[0][vertex] = [1.0, 0.0, 0.0, 0.0];
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn strips_and_fans_turn_all_their_triangles_the_same_way() {
        assert_eq!(triangles(Mode::Strip, None, 4), [[0, 1, 2], [1, 3, 2]]);
        assert_eq!(triangles(Mode::Fan, None, 4), [[1, 2, 0], [2, 3, 0]]);
        assert_eq!(triangles(Mode::Fan, Some(vec![]), 0), [[0; 3]; 0]);
    }

    #[test]
    fn triangles_that_use_a_vertex_twice_are_left_out() {
        assert_eq!(triangles(Mode::Triangles, Some(vec![0, 0, 1, 1, 2, 3, 9]), 10), [[1, 2, 3]]);
    }

    #[test]
    fn only_used_vertices_are_kept_however_large_their_array() {
        for vertices in [10, 100_000] {
            let mut triangles = [[7, 2, 5], [5, 2, 9]];
            assert_eq!(keep_used(&mut triangles, vertices), Some(vec![2, 5, 7, 9]));
            assert_eq!(triangles, [[2, 0, 1], [1, 0, 3]]);
        }
        assert_eq!(keep_used(&mut [[0, 1, 2]], 3), None);
    }
}
