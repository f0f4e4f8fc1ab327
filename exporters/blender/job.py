"""One export, from an open Blender scene to a glTF file: prepare, sample, write.

The session is changed on the way (switches, temporary objects) and must be a throwaway one; the scripts open a file and
never save it, and the operators in ui.py work on a copy in a background Blender.
"""

from __future__ import annotations

import contextlib
import errno
import io
import os
import re
import tempfile
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import bpy
import numpy as np

from ..common import extras, motion
from ..common.document import Document
from ..common.report import ExportError, InputError, Lost
from . import cameras, world
from .bake import bake_procedural
from .images import name_as_files
from .losses import name_scene_losses, name_scripts
from .materials import as_rendered, prepare_materials
from .output import GENERATOR, Output
from .prepare import prepare, work_in_rec709
from .sample import InstanceTrack, Sampler

# What a disk, a quota or a limit says that has no room.
_FULL = {errno.ENOSPC, errno.EDQUOT, errno.EFBIG}
_YUP_BACK = np.linalg.inv(cameras.YUP)


@dataclass
class Options:
    """What to export; None means the scene's own setting."""

    frames: tuple[int, int] | None = None
    resolution: tuple[int, int] | None = None
    camera: str | None = None
    scene: str | None = None
    bake: int = 1024
    progress: Callable[[str], None] = lambda _line: None


@dataclass
class Result:
    """What was written and what could not be carried."""

    path: Path
    lost: Lost
    root: dict[str, Any]


def export(path: Path, options: Options) -> Result:
    """Export the open file's scene to `path` (.gltf or .glb)."""
    output = Output(Path(path).resolve())
    try:
        return _Export(output, options).run()
    except OSError as error:
        raise output.error(error) from error
    finally:
        output.discard()


class _Export:
    def __init__(self, output: Output, options: Options) -> None:
        self.output, self.options = output, options
        self.lost = Lost()
        self.scene = _choose_scene(options.scene)
        self.view_layer = next((v for v in self.scene.view_layers if v.use), self.scene.view_layers[0])
        bpy.context.window.scene = self.scene
        bpy.context.window.view_layer = self.view_layer
        self.frames = options.frames or (self.scene.frame_start, self.scene.frame_end)
        if self.frames[1] < self.frames[0]:
            raise InputError(f"frame range {self.frames[0]}-{self.frames[1]}: the last frame is before the first")
        render = self.scene.render
        percent = render.resolution_percentage
        # Blender truncates, BKE_render_resolution().
        own = (max(render.resolution_x * percent // 100, 1), max(render.resolution_y * percent // 100, 1))
        self.size = options.resolution or own

    def run(self) -> Result:
        """Do the whole job."""
        work_in_rec709(self.lost)
        prepare(self.scene, self.view_layer)
        name_scene_losses(self.scene, self.view_layer, self.lost)
        self.options.progress(f"sampling frames {self.frames[0]}-{self.frames[1]}")
        sampler = Sampler(self.scene, self.view_layer, self.size, self.lost)
        sky: list[dict[str, Any]] = []
        sampler.on_sample = lambda: sky.append(world.sample_world(self.scene))
        sampler.run(*self.frames)
        name_scripts(self.lost)
        sky = [sky[i] for i in np.argsort(np.array(sampler.taken), kind="stable")]
        if self.options.bake:
            sampler.geometry.undeform(self.scene, np.array(sampler.taken))
        self.scene.frame_set(self.frames[0])
        self.options.progress(f"writing {len(sampler.geometry.shapes)} meshes")
        document = self._geometry(sampler)
        fps = extras.rational(self.scene.render.fps, self.scene.render.fps_base)
        times = [(frame - self.frames[0]) * fps[1] / fps[0] for frame in sampler.frames]
        animation = motion.Animation(document, times)
        for track in sampler.instances.values():
            self._instance(document, animation, sampler, track)
        for light in sampler.lights.values():
            light.write(document, animation, self.scene.render.engine, self.lost)
        for camera in sampler.cameras:
            camera.write(document, animation, self.lost)
        surround, followed = world.export_world(self.scene, self.output.folder, self.output.stem, self.lost)
        world.animate_world(animation, sky, followed)
        if not document.root.get("extensions", {}).get("KHR_lights_punctual") and _dark(surround):
            self.lost.add(self.scene.name, "no light", "no light is visible in the render and the world is black; show a light, or only emission is seen")
        animation.close()
        self._finish(document, fps, self._cuts(sampler), surround)
        return Result(self.output.path, self.lost, document.root)

    def _geometry(self, sampler: Sampler) -> Document:
        """Have Blender's exporter write the meshes and materials; a document without nodes."""
        shapes = sampler.geometry.shapes
        temporary = bpy.data.scenes.new("export")
        bpy.context.window.scene = temporary
        sampler.geometry.build(temporary, np.array(sampler.taken), self.view_layer.material_override)
        for material in _materials(temporary):
            as_rendered(material, self.scene.render.engine, self.lost)
        if self.options.bake:
            bake_procedural(temporary, self.options.bake, self.options.progress)
        materials = _materials(temporary)
        prepare_materials(materials, self.lost)
        artist = name_as_files(materials)
        target = self.output.folder / f"{self.output.stem}{self.output.path.suffix}"
        if shapes:
            _call_exporter(target)
            document = Document.load(target)
            for image in document.root.get("images", []):
                image["name"] = artist.get(image["name"], image["name"])
        else:
            document = Document()
        bpy.context.window.scene = self.scene
        self._collect(document, sampler)
        return document

    def _collect(self, document: Document, sampler: Sampler) -> None:
        """Read back which mesh each shape became, and drop the nodes."""
        shapes = {shape.node: shape for shape in sampler.geometry.shapes}
        for node in document.root.pop("nodes", []):
            if "mesh" in node:
                shape = shapes[node["name"]]
                shape.mesh_index = node["mesh"]
                # Blender numbers copies (.001); the file gets the artist's name back.
                document.root["meshes"][node["mesh"]]["name"] = shape.name
        for key in ("scenes", "scene", "animations", "skins", "cameras"):
            document.root.pop(key, None)
        for mesh in document.root.get("meshes", []):
            mesh.pop("extras", None)
        used = [e for e in document.root.get("extensionsUsed", []) if e != "KHR_lights_punctual"]
        document.root["extensionsUsed"] = used
        document.root.pop("extensionsRequired", None)

    def _instance(self, document: Document, animation: motion.Animation, sampler: Sampler, track: InstanceTrack) -> None:
        """One node for each shape an instance takes, visible while it takes it."""
        visible = np.array(track.visible)
        numbers = np.array(track.shapes)
        poses = cameras.YUP @ np.array(track.poses) @ _YUP_BACK
        for number in dict.fromkeys(track.shapes):
            shape = sampler.geometry.shapes[number]
            shown = visible & (numbers == number)
            if not shown.any():
                continue
            if not len(shape.mesh.vertices):
                # What geometry nodes have made of it are instances only.
                continue
            if shape.mesh_index is None:
                self.lost.add(track.name, "object without faces", "only faces are rendered; give the curve a bevel or the edges a surface")
                continue
            node: dict = {"name": track.name, "mesh": shape.mesh_index}
            index = animation.add_node(node, poses)
            animation.visibility(node, index, shown)
            if shape.weights is not None:
                animation.weights(index, shape.weights)

    def _cuts(self, sampler: Sampler) -> list[dict[str, Any]]:
        """Which camera is seen when: the one asked for, the markers', or the scene's."""
        # Not by name: a library's camera may be called as one of this file.
        nodes = {track.source: track.node for track in sampler.cameras}
        first, last = self.frames
        if self.options.camera is not None:
            asked = next((ob for ob in nodes if ob.name == self.options.camera), None)
            if asked is None:
                have = ", ".join(sorted(ob.name for ob in nodes)) or "none"
                raise InputError(f"camera {self.options.camera!r}: not in scene {self.scene.name!r}; it has {have}")
            bound = [(first, asked)]
        else:
            bound = cameras.marker_cuts(self.scene)
            if not bound and self.scene.camera is not None:
                bound = [(first, self.scene.camera)]
        for _, ob in bound:
            if nodes.get(ob) == -1:
                raise InputError(f"camera {ob.name!r}: its lens or transform is no usable number; check its clipping, scale, constraints and drivers")
        cuts = [{"frame": frame, "camera": ob.name, "node": nodes[ob]} for frame, ob in bound if ob in nodes]
        if not cuts:
            self.lost.add(self.scene.name, "no camera", "add a camera to the scene, or convert with --turntable")
        return extras.simplify_cuts(cuts, first, last)

    def _finish(self, document: Document, fps: tuple[int, int], cuts: list[dict], surround: dict) -> None:
        """Scene, extras, check, save."""
        render = self.scene.render
        nodes = document.root.get("nodes", [])
        below = {child for node in nodes for child in node.get("children", [])}
        document.root["scenes"] = [{"name": self.scene.name, "nodes": [i for i in range(len(nodes)) if i not in below]}]
        document.root["scene"] = 0
        document.root["scenes"][0]["extras"] = {
            "buzz": extras.scene_extras(
                generator=GENERATOR,
                application=f"Blender {bpy.app.version_string}",
                file=bpy.data.filepath,
                fps=fps,
                frames=self.frames,
                resolution=self.size,
                pixel_aspect=render.pixel_aspect_x / render.pixel_aspect_y,
                shutter=render.motion_blur_shutter if render.use_motion_blur else None,
                cuts=cuts,
                world=surround,
                lost=self.lost,
            )
        }
        if not document.root["scenes"][0]["nodes"]:
            document.root["scenes"][0].pop("nodes")
        extras.check(document.root)
        self.output.publish(document)


def _materials(scene: bpy.types.Scene) -> list[bpy.types.Material]:
    return list(dict.fromkeys(slot.material for ob in scene.collection.objects for slot in ob.material_slots))


def _dark(surround: dict) -> bool:
    """Whether a world sheds no light (an animated one may later)."""
    return "image" not in surround and (surround["strength"] == 0 or not any(surround["color"]))


def _choose_scene(name: str | None) -> bpy.types.Scene:
    if name is None:
        return bpy.context.scene
    if name not in bpy.data.scenes:
        raise InputError(f"scene {name!r}: the file has {', '.join(s.name for s in bpy.data.scenes)}")
    return bpy.data.scenes[name]


def _call_exporter(path: Path) -> None:
    """Blender's glTF exporter on the current scene, geometry and materials only."""
    wanted = {
        "export_format": "GLTF_SEPARATE" if path.suffix == ".gltf" else "GLB",
        "export_texture_dir": f"{path.stem}_textures",
        "export_animations": False,
        "export_morph": True,
        "export_morph_normal": True,
        "export_morph_animation": False,
        "export_try_sparse_sk": False,
        "export_skins": False,
        "export_lights": False,
        "export_cameras": False,
        "export_extras": True,
        "export_apply": False,
        "export_gpu_instances": False,
        "use_active_scene": True,
    }
    # Options come and go between 4.2 and 5.x; those left out here have the values wanted by default.
    known = bpy.ops.export_scene.gltf.get_rna_type().properties.keys()
    log = io.StringIO()
    try:
        with contextlib.redirect_stdout(log), contextlib.redirect_stderr(log):
            bpy.ops.export_scene.gltf(filepath=str(path), **{k: v for k, v in wanted.items() if k in known})
    except RuntimeError as error:
        number = re.search(r"\[Errno (\d+)\]", str(error))
        if number and int(number[1]) in _FULL:
            raise OSError(int(number[1]), os.strerror(int(number[1]))) from None
        lines = [line.strip() for line in str(error).splitlines() if line.strip() and not line.startswith("Location")]
        last = next((line for line in reversed(lines) if "Error" in line), lines[-1])
        mesh = re.findall(r"Extracting primitive: (.*)", log.getvalue())
        where = f" at mesh {mesh[-1]!r}" if mesh else ""
        raise ExportError(f"Blender's glTF exporter failed{where}: {last}; hide that object from the render, or simplify it") from None
    if "Error while saving image" in log.getvalue():
        # Blender goes on without that texture.
        raise OSError(errno.ENOSPC, f"no room for its textures in {tempfile.gettempdir()}")
