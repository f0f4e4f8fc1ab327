//! Names of what can be told apart in a picture: what mattes are picked by.

use super::{Instance, Scene};

impl Scene {
    /// The name of the object that an instance belongs to. Objects are named after their nodes, so that those which a node places
    /// many times (`EXT_mesh_gpu_instancing`) share a name.
    pub fn object_name(&self, instance: &Instance) -> String {
        let name = &self.nodes[instance.node].name;
        if name.is_empty() { format!("object {}", instance.object) } else { name.clone() }
    }

    /// The name of an instance's material.
    pub fn material_name(&self, instance: &Instance) -> String {
        let number = self.meshes[instance.mesh].material;
        let name = &self.materials[number].name;
        if name.is_empty() { format!("material {number}") } else { name.clone() }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::{Material, Mesh};
    use glam::DAffine3;

    #[test]
    fn objects_are_named_after_their_nodes() {
        let mut scene = Scene::default();
        let grey = scene.add_material(Material::default());
        let gold = scene.add_material(Material { name: "Gold".into(), ..Material::default() });
        let floor = scene.add_mesh(Mesh::plane(1.0, grey));
        let ring = scene.add_mesh(Mesh::plane(1.0, gold));
        let first = scene.add_instance(floor, DAffine3::IDENTITY);
        scene.add_instance(ring, DAffine3::IDENTITY);
        let node = scene.instances[first].node;
        scene.nodes[node].name = "Floor".into();
        let names =
            |i: usize| (scene.object_name(&scene.instances[i]), scene.material_name(&scene.instances[i]));
        assert_eq!(names(0), ("Floor".into(), "material 0".into()));
        assert_eq!(names(1), ("object 2".into(), "Gold".into()));
    }
}
