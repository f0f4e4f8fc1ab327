//! What a scene asks of the renderer, worked out once.

use super::{AlphaMode, Scene, Target};
use glam::Vec3;

/// Features that a scene uses; stages and stored fields that none of them needs are left out.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Requirements {
    /// Something has a texture.
    pub textures: bool,
    /// Something is cut out by alpha or mixed with what is behind.
    pub alpha: bool,
    /// Something mirrors.
    pub reflection: bool,
    /// Something lets light through.
    pub refraction: bool,
    /// Something is an analytic shape.
    pub analytic_shapes: bool,
    /// Nodes other than cameras and lights move, are deformed, appear or vanish.
    pub moving_objects: bool,
    /// There are lights, so there are shadows.
    pub lights: bool,
    /// Lights have a size: their shadows are soft.
    pub soft_lights: bool,
    /// The world shines on everything.
    pub ambient_light: bool,
    /// Lights move or change.
    pub changing_lights: bool,
    /// The lens changes: what it frames, or its near or far plane.
    pub lens_change: bool,
}

/// Roughness above which a surface mirrors nothing; see `docs/shading.md`.
pub const MIRROR_ROUGHNESS: f32 = 0.3;

impl Requirements {
    /// What `scene` requires.
    pub fn of(scene: &Scene) -> Self {
        let mut needs = Self::default();
        for material in scene.instances.iter().map(|i| &scene.materials[scene.meshes[i.mesh].material]) {
            needs.textures |= material.has_textures();
            needs.alpha |= material.alpha_mode != AlphaMode::Opaque;
            let may_be_smooth =
                material.roughness < MIRROR_ROUGHNESS || material.metallic_roughness_texture.is_some();
            needs.reflection |=
                may_be_smooth && !material.unlit && (material.specular > 0.0 || material.metallic > 0.0);
            needs.refraction |= material.transmission > 0.0 || material.alpha_mode == AlphaMode::Blend;
        }
        needs.analytic_shapes = scene.shape_count() > 0;
        needs.lights = !scene.lights.is_empty();
        needs.soft_lights = (0..scene.lights.len()).any(|l| scene.light_has_size(l));
        needs.ambient_light = scene.world.color != Vec3::ZERO;
        let moved = scene.moved_nodes();
        needs.moving_objects = scene.instances.iter().any(|i| moved[i.node] || scene.is_deformed(i, &moved));
        needs.changing_lights = scene.lights.iter().any(|l| moved[l.node]);
        for channel in &scene.channels {
            match channel.target {
                Target::LightColor(_)
                | Target::LightIntensity(_)
                | Target::LightRange(_)
                | Target::LightInnerCone(_)
                | Target::LightOuterCone(_)
                | Target::LightSize(_)
                | Target::LightArea(_) => needs.changing_lights = true,
                Target::CameraYfov(_)
                | Target::CameraXmag(_)
                | Target::CameraYmag(_)
                | Target::CameraNear(_)
                | Target::CameraFar(_)
                | Target::CameraShift(_) => needs.lens_change = true,
                _ => {}
            }
        }
        needs
    }

    /// True if frames may differ in more than the camera.
    pub fn motion(&self) -> bool {
        self.moving_objects || self.changing_lights
    }

    /// Stages that a frame goes through in the quality `centred`, in order; `docs/algorithm.md` and `docs/shading.md` say
    /// what each does.
    pub fn stages(&self) -> Vec<&'static str> {
        let all = [
            (true, "trace"),
            (self.lights, "shadow"),
            (self.moving_objects, "ride"),
            (true, "project"),
            (true, "turned"),
            (true, "uncut"),
            (self.moving_objects, "moved"),
            (true, "entering"),
            (true, "centre"),
            (true, "outlines"),
            (self.motion() && self.lights, "relight"),
            (self.lights, "shadow-edges"),
            (self.textures, "texture"),
            (self.lights, "diffuse"),
            (self.lights, "highlights"),
            (self.ambient_light, "skylight"),
            (self.reflection, "reflection"),
            (self.refraction, "refraction"),
        ];
        required(&all)
    }

    /// Names of what is required, for reports.
    pub fn names(&self) -> Vec<&'static str> {
        let all = [
            (self.textures, "textures"),
            (self.alpha, "alpha"),
            (self.reflection, "reflection"),
            (self.refraction, "refraction"),
            (self.analytic_shapes, "analytic-shapes"),
            (self.lights, "lights"),
            (self.soft_lights, "soft-lights"),
            (self.ambient_light, "ambient-light"),
            (self.moving_objects, "moving-objects"),
            (self.changing_lights, "changing-lights"),
            (self.lens_change, "lens-change"),
        ];
        required(&all)
    }
}

fn required(all: &[(bool, &'static str)]) -> Vec<&'static str> {
    all.iter().filter_map(|&(needed, name)| needed.then_some(name)).collect()
}

impl Scene {
    /// For each node: whether an animation moves, hides or shows it or one of its ancestors.
    pub fn moved_nodes(&self) -> Vec<bool> {
        let mut moved = vec![false; self.nodes.len()];
        for channel in &self.channels {
            if let Target::Translation(n) | Target::Rotation(n) | Target::Scale(n) | Target::Visible(n) =
                channel.target
            {
                moved[n] = true;
            }
        }
        for n in 0..moved.len() {
            moved[n] |= self.nodes[n].parent.is_some_and(|p| moved[p]);
        }
        moved
    }

    /// True for instances whose vertices move: skinned to joints that are `moved` ([`Scene::moved_nodes`]), or morphed.
    pub fn is_deformed(&self, instance: &super::Instance, moved: &[bool]) -> bool {
        let skinned = instance.skin.is_some_and(|s| self.skins[s].joints.iter().any(|&j| moved[j]));
        skinned || self.is_morphed(instance)
    }

    /// True for instances with animated morph weights.
    pub fn is_morphed(&self, instance: &super::Instance) -> bool {
        !self.meshes[instance.mesh].morph_targets.is_empty()
            && self.channels.iter().any(|c| c.target == Target::Weights(instance.node))
    }
}
