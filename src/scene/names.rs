//! Names of what can be told apart in a picture: what mattes are picked by.

use super::Scene;

impl Scene {
    /// The name of each object: that of tag 1 first. Objects are named after their nodes, so that those which a node places
    /// many times (`EXT_mesh_gpu_instancing`) share a name.
    pub fn object_names(&self) -> Vec<String> {
        let count = self.instances.iter().map(|i| i.object).max().unwrap_or(0);
        let mut names: Vec<String> = (1..=count).map(|tag| format!("object {tag}")).collect();
        for instance in &self.instances {
            let named = &self.nodes[instance.node].name;
            if let Some(name) = (instance.object as usize).checked_sub(1).and_then(|i| names.get_mut(i))
                && !named.is_empty()
            {
                name.clone_from(named);
            }
        }
        names
    }

    /// The name of each material.
    pub fn material_names(&self) -> Vec<String> {
        let name = |(i, name): (usize, &String)| {
            if name.is_empty() { format!("material {i}") } else { name.clone() }
        };
        self.materials.iter().map(|m| &m.name).enumerate().map(name).collect()
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
        scene.add_material(Material { name: "Gold".into(), ..Material::default() });
        let plane = scene.add_mesh(Mesh::plane(1.0, grey));
        let first = scene.add_instance(plane, DAffine3::IDENTITY);
        scene.add_instance(plane, DAffine3::IDENTITY);
        let node = scene.instances[first].node;
        scene.nodes[node].name = "Floor".into();
        assert_eq!(scene.object_names(), ["Floor", "object 2"]);
        assert_eq!(scene.material_names(), ["material 0", "Gold"]);
        assert!(Scene::default().object_names().is_empty());
    }
}
