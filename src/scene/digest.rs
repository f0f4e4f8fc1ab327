//! The bytes of a scene, for telling whether an input changed between two runs.

use super::{Mesh, Scene};
use glam::{Vec2, Vec3, Vec4};

impl Scene {
    /// Gives every value that can change a pixel to `feed`, in a fixed order, each with the name of what it belongs to.
    ///
    /// Floats go by their bits (large arrays) or by Rust's shortest exact decimal (small structures).
    pub fn digest(&self, feed: &mut dyn FnMut(&str, &[u8])) {
        for node in &self.nodes {
            feed("node", format!("{node:?}").as_bytes());
        }
        feed("instances", format!("{:?}", self.instances).as_bytes());
        for mesh in &self.meshes {
            mesh.digest(feed);
        }
        for skin in &self.skins {
            feed("skin", format!("{skin:?}").as_bytes());
        }
        for material in &self.materials {
            feed("material", format!("{material:?}").as_bytes());
        }
        for image in &self.images {
            image.digest(feed);
        }
        feed("lights", format!("{:?}", self.lights).as_bytes());
        feed("cameras", format!("{:?}", self.cameras).as_bytes());
        feed("world", format!("{:?}", self.world).as_bytes());
        for channel in &self.channels {
            feed("channel", format!("{:?} {:?}", channel.target, channel.curve.interpolation).as_bytes());
            feed("times", bytemuck::cast_slice(&channel.curve.times));
            feed("values", bytemuck::cast_slice(&channel.curve.values));
        }
        feed("timing", format!("{:?}", self.timing).as_bytes());
        feed("cuts", format!("{:?}", self.cuts).as_bytes());
    }
}

impl Mesh {
    fn digest(&self, feed: &mut dyn FnMut(&str, &[u8])) {
        feed("mesh", format!("{} {}", self.name, self.material).as_bytes());
        if let Some(shape) = &self.shape {
            feed("shape", format!("{shape:?}").as_bytes());
        }
        feed("positions", bytemuck::cast_slice::<Vec3, u8>(&self.positions));
        feed("normals", bytemuck::cast_slice::<Vec3, u8>(&self.normals));
        feed("tangents", bytemuck::cast_slice::<Vec4, u8>(&self.tangents));
        for uvs in &self.uvs {
            feed("uvs", bytemuck::cast_slice::<Vec2, u8>(uvs));
        }
        feed("colors", bytemuck::cast_slice::<Vec4, u8>(&self.colors));
        feed("triangles", bytemuck::cast_slice(&self.triangles));
        for target in &self.morph_targets {
            feed("morph positions", bytemuck::cast_slice::<Vec3, u8>(&target.positions));
            feed("morph normals", bytemuck::cast_slice::<Vec3, u8>(&target.normals));
            feed("morph tangents", bytemuck::cast_slice::<Vec3, u8>(&target.tangents));
        }
        for joints in &self.joints {
            feed("joints", bytemuck::cast_slice(joints));
        }
        for weights in &self.joint_weights {
            feed("joint weights", bytemuck::cast_slice(weights));
        }
    }
}
