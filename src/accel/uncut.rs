//! What the near or far plane of one view cut off, and another view sees.

use super::convex::{Convex, MOST_CUT_CORNERS, ROUNDING};
use super::{Accel, Placed};
use crate::scene::{Scene, Shape, View};
use glam::{Affine3A, DMat3, DVec3, Mat3, Vec3, Vec3A};

/// The sides of the new view, its near or far plane, and that of the old one.
const PLANES: usize = 6;

/// A plane relative to the origin of render space: a point is `normal . point + offset` inside.
#[derive(Clone, Copy)]
pub(super) struct Plane {
    normal: DVec3,
    offset: f64,
}

/// What one view sees and a plane of another cut off, in render space.
struct Slab {
    eye: DVec3,
    planes: [Plane; PLANES],
}

impl Accel {
    /// Visits, in any order, what `new` sees of the space that the near or far plane of `old` cut off, as outlines: corners, in order
    /// around, relative to the origin. They are parts of triangles and of flat shapes; of a solid shape that reaches there, the faces of
    /// the box around it. Endless solids are left out.
    pub fn uncut(&self, scene: &Scene, (old, new): (&View, &View), visit: &(dyn Fn(&[Vec3]) + Sync)) {
        if old == new {
            return;
        }
        for slab in self.slabs(old, new) {
            self.outlines(&slab, visit);
            self.outlines_of_shapes(scene, &slab, visit);
        }
    }

    /// The space between the two views' near planes, and that between their far planes, as far as `new` sees them.
    fn slabs(&self, old: &View, new: &View) -> impl Iterator<Item = Slab> {
        let [top, right, bottom, left] = self.sides(new);
        let near = |view: &View| self.behind(view, view.lens.near.max(0.0));
        let far = |view: &View| view.lens.far.is_finite().then(|| self.behind(view, view.lens.far));
        let eye = new.eye - self.origin;
        let slab = move |cut, seen| Slab { eye, planes: [top, right, bottom, left, cut, seen] };
        let within = far(new).map_or(Plane { normal: DVec3::ZERO, offset: 0.0 }, Plane::flipped);
        let nearer = slab(near(old).flipped(), near(new));
        [Some(nearer), far(old).map(|cut| slab(cut, within))].into_iter().flatten()
    }

    /// The planes between which an image shows what it shows, in order around.
    pub(super) fn sides(&self, view: &View) -> [Plane; 4] {
        let corners = [(0, 0), (view.width, 0), (view.width, view.height), (0, view.height)];
        let rays = corners.map(|(x, y)| view.ray(f64::from(x), f64::from(y)));
        let inside = rays.iter().map(|ray| ray.origin + ray.direction - self.origin).sum::<DVec3>() / 4.0;
        [0, 1, 2, 3].map(|i| {
            let (a, b) = (rays[i], rays[(i + 1) % 4]);
            let normal = a.direction.cross(b.origin + b.direction - a.origin).normalize_or_zero();
            let plane = Plane { normal, offset: -normal.dot(a.origin - self.origin) };
            if plane.distance(inside) < 0.0 { plane.flipped() } else { plane }
        })
    }

    /// Inside is what is farther than `depth` before the eye of a view.
    pub(super) fn behind(&self, view: &View, depth: f64) -> Plane {
        Plane { normal: view.forward, offset: -view.forward.dot(view.eye - self.origin) - depth }
    }

    /// Visits what of all triangles lies in a slab.
    fn outlines(&self, slab: &Slab, visit: &(dyn Fn(&[Vec3]) + Sync)) {
        let space = || slab.within(&Affine3A::IDENTITY);
        self.any_placed_within(space, |placed, pending| {
            if let Placed::Tree(placed) = placed {
                let render_from_object = placed.object_from_render.inverse();
                let space = slab.within(&placed.object_from_render);
                self.lower(placed).0.any_within(&space, pending, |_, triangle, rounding| {
                    space.visit_cut(triangle, rounding, &render_from_object, visit);
                    false
                });
            }
            false
        });
    }

    /// Visits what of all flat shapes lies in a slab, and the boxes around others.
    fn outlines_of_shapes(&self, scene: &Scene, slab: &Slab, visit: &(dyn Fn(&[Vec3]) + Sync)) {
        let space = slab.within(&Affine3A::IDENTITY);
        for (instance, placement) in scene.instances.iter().zip(&self.placements) {
            let Some(shape) = scene.meshes[instance.mesh].shape.as_ref().filter(|_| placement.present) else {
                continue;
            };
            let place = |p: Vec3| placement.render_from_object.transform_point3(p);
            for triangle in shape.sheet() {
                let triangle = triangle.map(|p| Vec3A::from(place(p)) - space.eye);
                let reach = triangle.iter().fold(Vec3A::ZERO, |r, p| r.max(p.abs())).max_element();
                space.visit_cut(triangle, space.rounding + ROUNDING * reach, &Affine3A::IDENTITY, visit);
            }
            let Some(faces) = box_around(shape) else { continue };
            let faces = faces.map(|face| face.map(place));
            let reaches =
                |plane: &Plane| faces.iter().flatten().any(|corner| plane.distance(corner.as_dvec3()) >= 0.0);
            if slab.planes.iter().all(reaches) {
                faces.iter().for_each(|face| visit(face));
            }
        }
    }
}

impl Plane {
    pub fn distance(&self, point: DVec3) -> f64 {
        self.normal.dot(point) + self.offset
    }

    fn flipped(self) -> Self {
        Self { normal: -self.normal, offset: -self.offset }
    }
}

impl Slab {
    /// The same in the space of a tree.
    fn within(&self, object_from_render: &Affine3A) -> Convex<PLANES> {
        let eye = object_from_render.transform_point3a(self.eye.as_vec3a());
        let to_local: DMat3 = Mat3::from(object_from_render.matrix3).as_dmat3().inverse().transpose();
        let local = self.planes.map(|plane| {
            let normal = to_local * plane.normal;
            let length = normal.length();
            // A plane that cuts nothing off has no normal.
            let scale = if length > 0.0 { length.recip() } else { 0.0 };
            ((normal * scale).as_vec3a(), (plane.distance(self.eye) * scale) as f32)
        });
        let reach =
            local.iter().fold(eye.abs().max_element(), |reach, (_, distance)| reach.max(distance.abs()));
        Convex { eye, normals: local.map(|l| l.0), distances: local.map(|l| l.1), rounding: ROUNDING * reach }
    }
}

impl Convex<PLANES> {
    /// Visits, in render space, what is inside of a triangle with those corners from the eye.
    fn visit_cut(
        &self,
        triangle: [Vec3A; 3],
        rounding: f32,
        render_from_object: &Affine3A,
        visit: &(dyn Fn(&[Vec3]) + Sync),
    ) {
        let outline = self.cut(triangle, rounding);
        let mut points = [Vec3::ZERO; MOST_CUT_CORNERS];
        for (point, &corner) in points.iter_mut().zip(outline.corners()) {
            *point = render_from_object.transform_point3a(corner + self.eye).into();
        }
        match outline.corners().len() {
            0 => {}
            count => visit(&points[..count]),
        }
    }
}

/// The faces of the box around a solid shape, in object space; none of one that is flat or endless.
fn box_around(shape: &Shape) -> Option<[[Vec3; 4]; 6]> {
    let bounds = shape.bounds().map(|corner| corner.as_vec3());
    let is_solid = bounds[0].cmplt(bounds[1]).all() && bounds.iter().all(|corner| corner.is_finite());
    let corner = |axis: usize, side: usize, (u, v): (usize, usize)| {
        let mut corner = Vec3::ZERO;
        corner[axis] = bounds[side][axis];
        corner[(axis + 1) % 3] = bounds[u][(axis + 1) % 3];
        corner[(axis + 2) % 3] = bounds[v][(axis + 2) % 3];
        corner
    };
    let face = |number: usize| [(0, 0), (1, 0), (1, 1), (0, 1)].map(|uv| corner(number / 2, number % 2, uv));
    is_solid.then(|| std::array::from_fn(face))
}
