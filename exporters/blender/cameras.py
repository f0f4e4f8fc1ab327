"""Cameras: what Blender's own projection matrix says, at every sample.

The lens is read back from `Object.calc_matrix_camera`, which knows about fit, shift, resolution and pixel aspect, so
nothing of Blender's camera arithmetic is repeated here.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import bpy
import numpy as np
from mathutils import Matrix

from ..common.document import Document
from ..common.extras import tidy
from ..common.motion import Animation, is_sheared, unscaled
from ..common.report import Lost

# Blender is Z-up, glTF Y-up; cameras and lights look along -Z in both.
YUP = np.array(Matrix.Rotation(-math.pi / 2, 4, "X"))


def view_matrix(world: Matrix) -> np.ndarray:
    """World matrix of a camera or light in glTF axes, scale (as in Blender's renderer) and shear taken off."""
    return unscaled(YUP @ np.array(world))


@dataclass
class CameraTrack:
    """One camera object and its samples; every list has one entry a sample."""

    source: bpy.types.Object
    poses: list[np.ndarray] = field(default_factory=list)
    lens: list[dict[str, float]] = field(default_factory=list)
    node: int = -1
    broken: bool = False
    sheared: bool = False

    def sample(self, depsgraph: bpy.types.Depsgraph, size: tuple[int, int], aspect: tuple[float, float]) -> None:
        """Record pose and lens at the scene's current frame."""
        ob = self.source.evaluated_get(depsgraph)
        data = ob.data
        p = ob.calc_matrix_camera(depsgraph, x=size[0], y=size[1], scale_x=aspect[0], scale_y=aspect[1])
        # Blender gives zeros where near and far, or an orthographic scale, leave no volume.
        if not (np.isfinite(p).all() and p[0][0] and p[1][1] and (np.abs(np.array(ob.matrix_world)) < 1e15).all()):
            self.broken = True
            self.poses.append(np.eye(4))
            self.lens.append({})
            return
        lens = {"near": data.clip_start, "far": data.clip_end, "focal": data.lens}
        if data.type == "ORTHO":
            # P = diag(1/xmag, 1/ymag, ..) with the window's centre in the last column.
            lens |= {"xmag": 1 / p[0][0], "ymag": 1 / p[1][1], "shift_x": -p[0][3], "shift_y": -p[1][3]}
        else:
            lens |= {"yfov": 2 * math.atan(1 / p[1][1]), "shift_x": p[0][2], "shift_y": p[1][2]}
        lens["p00"], lens["p11"] = p[0][0], p[1][1]
        target = data.dof.focus_object
        if target is not None:
            pose = view_matrix(ob.matrix_world)
            spot = YUP @ np.array([*target.evaluated_get(depsgraph).matrix_world.translation, 1.0])
            lens["focus"] = max(float(np.dot(pose[:3, 3] - spot[:3], pose[:3, 2])), 0.0)
        else:
            lens["focus"] = data.dof.focus_distance
        lens["fstop"] = data.dof.aperture_fstop
        self.sheared = self.sheared or is_sheared(np.array(ob.matrix_world)[None])
        self.poses.append(view_matrix(ob.matrix_world))
        self.lens.append(lens)

    def write(self, document: Document, animation: Animation, lost: Lost) -> None:
        """Add camera, node and channels; none where there is no way to look through the camera."""
        data, first = self.source.data, self.lens[0]
        name = self.source.name
        if self.broken:
            lost.add(name, "lens or transform that is no usable number", "the camera is left out; check its clipping, scale, constraints and drivers")
            return
        ortho = "xmag" in first
        if any(("xmag" in lens) != ortho for lens in self.lens):
            lost.add(name, "projection that changes from perspective to orthographic", "the first one is kept; use two cameras and a cut")
            self.lens = [lens if ("xmag" in lens) == ortho else first for lens in self.lens]
        values = {key: np.array([sample[key] for sample in self.lens]) for key in first}
        if data.type not in ("ORTHO", "PERSP"):
            action = "only perspective and orthographic cameras are carried; it is exported as perspective"
            lost.add(name, f"{data.type.lower()} camera", action)
        if min(np.linalg.det(np.array(self.source.matrix_world)[:3, :3]), 0) < 0:
            lost.add(name, "mirrored camera (negative scale)", "the picture is not mirrored; apply the scale of the camera and its parents")
        if self.sheared:
            lost.add(name, "sheared camera", "its picture is not sheared and shows another part; apply the scale of its parents")
        near, far = float(first["near"]), float(first["far"])
        limits = {"znear": tidy(near)} | ({"zfar": tidy(far)} if far > near else {})
        index = len(document.list("cameras"))
        if ortho:
            limits.setdefault("zfar", tidy(near + 1))
            camera: dict = {"type": "orthographic", "orthographic": {"xmag": float(first["xmag"]), "ymag": float(first["ymag"]), **limits}}
        else:
            aspect = float(first["p11"] / first["p00"])
            camera = {"type": "perspective", "perspective": {"aspectRatio": aspect, "yfov": float(first["yfov"]), **limits}}
        camera["name"] = data.name
        camera["extras"] = self._extras(values)
        document.append("cameras", camera)
        node: dict = {"name": name, "camera": index}
        self.node = document.append("nodes", node)
        animation.node(node, self.node, np.array(self.poses))
        kind = "orthographic" if ortho else "perspective"
        lens = ("xmag", "ymag") if ortho else ("yfov",)
        for key in lens:
            animation.pointer(f"/cameras/{index}/{kind}/{key}", values[key])
        animation.pointer(f"/cameras/{index}/{kind}/znear", values["near"])
        animation.pointer(f"/cameras/{index}/{kind}/zfar", values["far"])
        shift = np.stack([values["shift_x"], values["shift_y"]], axis=1)
        animation.pointer(f"/cameras/{index}/extras/shift", shift)
        if "dof" in camera["extras"]:
            animation.pointer(f"/cameras/{index}/extras/dof/focus_distance", values["focus"])

    def _extras(self, values: dict[str, np.ndarray]) -> dict:
        data, first = self.source.data, self.lens[0]
        extras: dict = {"clip": [tidy(first["near"]), tidy(first["far"])]}
        if np.abs(values["shift_x"]).max() > 0 or np.abs(values["shift_y"]).max() > 0:
            extras["shift"] = [float(first["shift_x"]), float(first["shift_y"])]
        if "xmag" not in first:
            # The film area that the picture covers: size = 2 f tan(half angle) = 2 f / P.
            extras["sensor"] = [tidy(2 * first["focal"] / first["p00"]), tidy(2 * first["focal"] / first["p11"])]
        if data.dof.use_dof:
            extras["dof"] = {"focus_distance": tidy(first["focus"]), "fstop": tidy(first["fstop"]), "focal_length": tidy(first["focal"])}
        return extras


def find_cameras(scene: bpy.types.Scene, view_layer: bpy.types.ViewLayer) -> list[bpy.types.Object]:
    """The render camera and the cameras of markers first (they render even from excluded collections), then the others."""
    wanted = [scene.camera, *(m.camera for m in sorted(scene.timeline_markers, key=lambda m: m.frame))]
    wanted += [ob for ob in view_layer.objects if ob.type == "CAMERA" and not ob.hide_render]
    found: list[bpy.types.Object] = []
    for ob in wanted:
        if ob is not None and ob.type == "CAMERA" and ob not in found:
            found.append(ob)
    return found


def marker_cuts(scene: bpy.types.Scene) -> list[tuple[int, bpy.types.Object]]:
    """Markers bound to cameras, in order; a camera hidden from render is skipped, as Blender's renderer does."""
    bound: dict[int, bpy.types.Object] = {}
    for marker in scene.timeline_markers:
        if marker.camera is not None and not marker.camera.hide_render:
            # Of several at one frame, Blender takes the first that was made.
            bound.setdefault(marker.frame, marker.camera)
    return sorted(bound.items())
