//! Four pixels at once.

use super::{SurfaceRef, SurfaceSample};
use glam::Vec3;

/// Where four rays meet one triangle, side by side.
#[derive(Debug, Clone, Copy)]
pub struct FourPoints {
    /// A bit for each ray that meets it.
    pub met: u32,
    /// For each axis: the coordinates of all. See [`SurfaceSample::position`].
    pub position: [[f32; 4]; 3],
    /// See [`SurfaceRef::u`].
    pub u: [f32; 4],
    /// See [`SurfaceRef::v`].
    pub v: [f32; 4],
}

impl FourPoints {
    /// What ray number `ray` meets, if it does, where `seen` is another sample of the triangle: it looks the same everywhere.
    #[inline]
    pub fn of(&self, ray: usize, seen: &SurfaceSample) -> Option<SurfaceSample> {
        let [x, y, z] = self.position.map(|axis| axis[ray]);
        let surface = SurfaceRef { u: self.u[ray], v: self.v[ray], ..seen.surface };
        let is_met = self.met >> ray & 1 == 1;
        is_met.then_some(SurfaceSample { position: Vec3::new(x, y, z), surface, ..*seen })
    }
}
