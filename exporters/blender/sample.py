"""Walks through the frames once and records where everything is: geometry instances, lights, cameras.

The dependency graph's `object_instances` is what a renderer sees: constraints, parents, follow-path, collection and
geometry-nodes instances and particles are all resolved there, so none of them needs code of its own.
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field

import bpy
import numpy as np

from ..common import motion
from ..common.report import Lost
from .cameras import CameraTrack, find_cameras
from .geometry import GeometryStore
from .lights import LightTrack
from .prepare import rendered_objects, stays

_NOT_MESHES = {
    "VOLUME": "volume",
    "CURVES": "hair curves",
    "POINTCLOUD": "point cloud",
    "GREASEPENCIL": "Grease Pencil drawing",
    "GPENCIL": "Grease Pencil drawing",
}
Key = tuple


@dataclass
class InstanceTrack:
    """One piece of geometry in the world; the lists have one entry a sample."""

    name: str
    poses: list[np.ndarray] = field(default_factory=list)
    visible: list[bool] = field(default_factory=list)
    shapes: list[int] = field(default_factory=list)

    def hold(self) -> None:
        """Not there at this sample: keep the last values, unseen."""
        self.poses.append(self.poses[-1])
        self.shapes.append(self.shapes[-1])
        self.visible.append(False)


class Sampler:
    """Samples a scene; afterwards `frames` (with fractions) and the tracks hold everything."""

    def __init__(self, scene: bpy.types.Scene, view_layer: bpy.types.ViewLayer, size: tuple[int, int], lost: Lost) -> None:
        self.scene, self.view_layer, self.size, self.lost = scene, view_layer, size, lost
        self.aspect = (scene.render.pixel_aspect_x, scene.render.pixel_aspect_y)
        self.frames: list[float] = []
        self.instances: dict[Key, InstanceTrack] = {}
        self.lights: dict[Key, LightTrack] = {}
        self.cameras = [CameraTrack(ob) for ob in find_cameras(scene, view_layer)]
        self.geometry = GeometryStore(lost)
        # All else that a render does not show is not in the graph, see prepare.py.
        self._staying = {ob.name_full for ob in bpy.data.objects if stays(ob)}
        self._hidden = {ob.name_full for ob in view_layer.objects} - rendered_objects(view_layer)
        # Frame of each sample in the order in which they were taken (`frames` is put in order of time at the end).
        self.taken: list[float] = []
        self.on_sample: Callable[[], None] = lambda: None

    def run(self, first: int, last: int) -> None:
        """Sample every whole frame, then between frames where something moves too fast for straight lines."""
        for frame in range(first, last + 1):
            self._at(float(frame))
        steps = self._steps()
        for i, n in enumerate(steps):
            for k in range(1, n):
                self._at(first + i + k / n)
        self.taken = list(self.frames)
        order = np.argsort(np.array(self.frames), kind="stable")
        self.frames = [self.frames[i] for i in order]
        for track in [*self.instances.values(), *self.lights.values(), *self.cameras]:
            for name, values in vars(track).items():
                if isinstance(values, list):
                    setattr(track, name, [values[i] for i in order])

    def _steps(self) -> np.ndarray:
        tracks = [t.poses for t in [*self.instances.values(), *self.lights.values(), *self.cameras]]
        if not tracks:
            return np.ones(max(len(self.frames) - 1, 0), dtype=int)
        poses = np.stack([np.array(t) for t in tracks], axis=1)
        places = poses[..., :3, 3].reshape(-1, 3)
        size = float(np.linalg.norm(places.max(axis=0) - places.min(axis=0)))
        return motion.steps_between(poses, max(size, 1.0))

    def _at(self, frame: float) -> None:
        """Record the scene at one time."""
        whole = math.floor(frame)
        self.scene.frame_set(whole, subframe=frame - whole)
        depsgraph = bpy.context.evaluated_depsgraph_get()
        seen: set[Key] = set()
        self.geometry.begin_sample()
        for key, instance, visible in self._walk(depsgraph):
            ob = instance.object
            if not (np.abs(np.array(instance.matrix_world)) < 1e15).all():
                self.lost.add(ob.name, "transform that is no usable number", "it is hidden while that lasts; check its constraints and drivers")
                continue
            if ob.type == "LIGHT":
                track = self.lights.get(key)
                if track is None:
                    track = self.lights[key] = LightTrack(ob.name, ob.original.data)
                    for _ in self.frames:
                        track.sample(ob.data, instance.matrix_world, False)
                track.sample(ob.data, instance.matrix_world, visible)
            else:
                self._geometry(key, instance, visible)
            seen.add(key)
        for tracks in (self.instances, self.lights):
            for key, track in tracks.items():
                if key not in seen:
                    track.hold()
        for camera in self.cameras:
            camera.sample(depsgraph, self.size, self.aspect)
        self.on_sample()
        self.frames.append(frame)

    def _geometry(self, key: Key, instance: bpy.types.DepsgraphObjectInstance, visible: bool) -> None:
        ob = instance.object
        track = self.instances.get(key)
        if track is None:
            if not visible and not self._ever_visible(ob):
                return
            track = self.instances[key] = InstanceTrack(ob.name)
            shape = self.geometry.shape_of(ob, len(self.frames))
            for _ in self.frames:
                track.poses.append(np.array(instance.matrix_world))
                track.visible.append(False)
                track.shapes.append(shape)
        track.poses.append(np.array(instance.matrix_world))
        track.shapes.append(self.geometry.shape_of(ob, len(self.frames)))
        track.visible.append(visible)

    @staticmethod
    def _ever_visible(ob: bpy.types.Object) -> bool:
        """Whether a hidden object may appear later (its visibility is animated)."""
        return ob.original.animation_data is not None

    def _is_shown(self, ob: bpy.types.Object) -> bool:
        return not ob.hide_render and ob.original.name_full not in self._hidden

    def _walk(self, depsgraph: bpy.types.Depsgraph) -> Iterator[tuple[Key, bpy.types.DepsgraphObjectInstance, bool]]:
        """Geometry and lights with a key that is the same at every frame, and whether a render shows them."""
        met: Counter[Key] = Counter()
        for instance in depsgraph.object_instances:
            ob = instance.object
            if ob.type not in ("MESH", "LIGHT", *_NOT_MESHES) or _is_portal(ob):
                continue
            if instance.is_instance:
                parent = instance.parent
                key = (parent.name_full, ob.name_full, ob.data.name, *instance.persistent_id)
                visible = self._is_shown(parent) and not _is_copied_by_parent(parent)
                # Particles and geometry nodes show objects that are themselves hidden; collections and faces do not.
                own = ob.original.name_full != parent.original.name_full and instance.particle_system is None
                if own and parent.original.instance_type != "NONE":
                    visible = visible and not (ob.hide_render and ob.original.name_full in self._staying)
            else:
                key = (ob.name_full,)
                visible = instance.show_self and self._is_shown(ob) and not _is_copied_by_parent(ob)
            if ob.type not in _NOT_MESHES:
                # Where vertices and faces instance each other three deep, numbers of Blender's repeat.
                met[key] += 1
                yield (*key, met[key]), instance, visible
            elif visible and _is_something(ob):
                way = "Volume to Mesh modifier" if ob.type == "VOLUME" else "Object > Convert"
                self.lost.add(ob.name, _NOT_MESHES[ob.type], f"it is left out; convert it to a mesh first ({way})")


def _is_portal(ob: bpy.types.Object) -> bool:
    """A light that only tells Cycles where the sky comes in: it shines not itself."""
    return ob.type == "LIGHT" and ob.data.type == "AREA" and getattr(getattr(ob.data, "cycles", None), "is_portal", False)


def _is_copied_by_parent(ob: bpy.types.Object) -> bool:
    """Whether a render shows only the copies of an object on its parent's vertices or faces; metaballs stay themselves."""
    parent = ob.original.parent
    return parent is not None and parent.instance_type in ("VERTS", "FACES") and ob.original.type != "META"


def _is_something(ob: bpy.types.Object) -> bool:
    """Whether hair or a point cloud has points: geometry nodes may have made a mesh of them."""
    return ob.type not in ("CURVES", "POINTCLOUD") or len(ob.data.points) > 0
