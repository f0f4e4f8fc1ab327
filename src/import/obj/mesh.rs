//! Models as meshes.

use super::{
    super::{ignored::Notes, primitive},
    polygon::Cutter,
};
use crate::scene::Mesh;
use glam::{Vec2, Vec3};

/// The triangles of a model that are whole; none if there is none. What is left out is noted at `place`.
pub(super) fn mesh(
    model: tobj::Model,
    material: usize,
    textured: bool,
    notes: &Notes,
    place: &str,
) -> Option<Mesh> {
    note_what_is_no_number(&model.mesh, notes, place);
    let tobj::Mesh { positions, normals, texcoords, vertex_color, indices, face_arities, .. } = model.mesh;
    let positions: Vec<Vec3> = positions.as_chunks().0.iter().map(|&p| Vec3::from_array(p)).collect();
    let count = positions.len();
    let whole = |&i: &u32| positions.get(i as usize).is_some_and(|p| p.is_finite());
    let mut triangles = triangles(&indices, &face_arities, &positions);
    triangles.retain(|t| t.iter().all(whole) && t[0] != t[1] && t[1] != t[2] && t[2] != t[0]);
    if triangles.is_empty() {
        return None;
    }
    let mut mesh = Mesh { name: model.name, positions, triangles, material, ..Mesh::default() };
    for position in mesh.positions.iter_mut().filter(|p| !p.is_finite()) {
        *position = Vec3::ZERO;
    }
    // If only some corners have them, `tobj` does not say which.
    if normals.len() == count * 3 {
        mesh.normals = normals.as_chunks().0.iter().map(|&n| Vec3::from_array(n)).collect();
        primitive::mend_normals(&mut mesh);
    } else if !normals.is_empty() {
        notes.add("normals (vn)", place, "only some corners have them; faces are flat");
    }
    if vertex_color.len() == count * 3 {
        let color = |c: &[f32; 3]| {
            Vec3::from_array(c.map(|v| if v.is_finite() { v.max(0.0) } else { 0.0 })).extend(1.0)
        };
        mesh.colors = vertex_color.as_chunks().0.iter().map(color).collect();
    }
    if textured {
        // v grows upwards in OBJ.
        let uv =
            |t: &[f32; 2]| Vec2::from_array([t[0], 1.0 - t[1]].map(|v| if v.is_finite() { v } else { 0.0 }));
        mesh.uvs.push(if texcoords.len() == count * 2 {
            texcoords.as_chunks().0.iter().map(uv).collect()
        } else {
            notes.add("textures", place, "corners have no texture coordinates (vt), which count as 0");
            vec![Vec2::ZERO; count]
        });
    }
    Some(mesh)
}

/// `arities`: how many corners each face has; where there are none, three.
fn triangles(indices: &[u32], arities: &[u32], positions: &[Vec3]) -> Vec<[u32; 3]> {
    if arities.is_empty() {
        return indices.as_chunks().0.to_vec();
    }
    let (mut rest, mut cutter, mut out) = (indices, Cutter::default(), Vec::new());
    for &arity in arities {
        let Some((face, after)) = rest.split_at_checked(arity as usize) else { break };
        cutter.cut(face, positions, &mut out);
        rest = after;
    }
    out
}

fn note_what_is_no_number(mesh: &tobj::Mesh, notes: &Notes, place: &str) {
    let parts = [
        (&mesh.positions, "positions", "triangles with such corners are left out"),
        (&mesh.texcoords, "texture coordinates", "they count as 0"),
        (&mesh.vertex_color, "vertex colours", "they count as 0"),
    ];
    for (_, what, effect) in parts.into_iter().filter(|(values, ..)| values.iter().any(|v| !v.is_finite())) {
        notes.add(format!("non-finite {what}"), place, effect);
    }
}
