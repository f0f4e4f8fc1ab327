"""The world: a plain colour, an environment image, or anything else rendered into an image by Cycles.

Blender's equirectangular convention is the one docs/extras.md states (its +X is glTF's +X and the image's centre).
"""

from __future__ import annotations

import math
import os
import shutil
from collections.abc import Callable
from pathlib import Path
from typing import Any
from urllib.parse import quote

import bpy
import numpy as np

from ..common.extras import tidy
from ..common.motion import Animation
from ..common.report import Lost
from ..common.srgb import decoded
from .constants import constant
from .nodes import output_target, source, upstream
from .prepare import LINEAR, action_curves, is_animated

# Files that buzz-convert reads, by the colour space that it takes them to be in.
_COPIED = {".hdr": LINEAR, ".exr": LINEAR, ".png": "sRGB", ".jpg": "sRGB", ".jpeg": "sRGB"}
# How wide a sky is baked, and one of wider images at most.
_BAKED_WIDTH, _WIDEST = 1024, 8192
# Which rays the world may be hidden from.
_RAYS = {
    "camera": ("the camera", "it is seen here; pass --transparent to buzz-convert"),
    "diffuse": ("diffuse rays", "it lights surfaces here; use a darker world, and put the backdrop in in compositing"),
    "glossy": ("reflections", "mirrors show it here"),
    "transmission": ("transmission rays", "it is seen through glass here"),
}


def export_world(scene: bpy.types.Scene, folder: Path, stem: str, lost: Lost) -> tuple[dict[str, Any], tuple[str, ...]]:
    """The value of `extras.buzz.world`, an image of which is put into `folder`; and what in it `sample_world` follows."""
    black = {"color": [0, 0, 0], "strength": 1}
    world = scene.world
    if world is None:
        return black, ()
    tree = world.node_tree if world.use_nodes else None
    if tree is None:
        return {"color": [tidy(c) for c in world.color], "strength": 1}, ("color",)
    output, surface = _output(scene), _surface(scene)
    if output is not None and output.inputs["Volume"].is_linked:
        lost.add(world.name, "world volume", "render the mist in compositing, from depth.Z")
    if surface is None:
        return black, ()
    _name_losses(world, tree, lost)
    power = constant(surface.inputs["Strength"]) if surface.type == "BACKGROUND" else None
    if power is not None:
        colour, strength = surface.inputs["Color"], surface.inputs["Strength"]
        shone, tint = tidy(max(power, 0.0)), constant(colour)
        if tint is not None:
            _name_animation(scene, [colour, strength], lost)
            return {"color": [tidy(max(c, 0)) for c in tint], "strength": shone}, ("color", "strength")
        image = _environment(source(colour))
        if image is not None:
            uri = _put_image(image[0], folder, stem)
            if uri is None:
                lost.add(world.name, f"image {image[0].name!r} is missing", "find it with File > External Data > Find Missing Files; the world is black")
                return black, ()
            _name_animation(scene, [strength], lost)
            return {"color": [1, 1, 1], "strength": shone, "image": quote(uri), "rotation": tidy(image[1])}, ("strength",)
    _name_animation(scene, [], lost)
    return {"color": [1, 1, 1], "strength": 1, "image": quote(_bake(scene, folder, stem, lost)), "rotation": 0}, ()


def _output(scene: bpy.types.Scene) -> bpy.types.Node | None:
    """The world output that the scene's engine renders."""
    return scene.world.node_tree.get_output_node(output_target(scene.render.engine))


def _surface(scene: bpy.types.Scene) -> bpy.types.Node | None:
    """The node that the sky is; None where it is black."""
    output = _output(scene)
    shown = source(output.inputs["Surface"]) if output is not None else None
    return shown.node if shown is not None else None


def _name_losses(world: bpy.types.World, tree: bpy.types.NodeTree, lost: Lost) -> None:
    """What rays of one kind see otherwise than those of another, and a sun as a part of the sky."""
    if any(node.type == "LIGHT_PATH" for node in tree.nodes):
        lost.add(world.name, "light path in the world", "what the camera sees lights the scene too; exchange the backdrop in compositing")
    for rays, (label, action) in _RAYS.items():
        if not getattr(getattr(world, "cycles_visibility", None), rays, True):
            lost.add(world.name, f"world hidden from {label}", action)
    if any(node.type == "TEX_SKY" and getattr(node, "sun_disc", False) for node in tree.nodes):
        lost.add(world.name, "sun disc in the sky texture", "it throws no shadow with an edge; turn Sun Disc off and add a Sun light")


def _name_animation(scene: bpy.types.Scene, followed: list[bpy.types.NodeSocket], lost: Lost) -> None:
    """What changes in the sky other than the inputs that are followed."""
    world, tree = scene.world, scene.world.node_tree
    nodes = {out.node for out in upstream(_output(scene).inputs["Surface"])}
    data = tree.animation_data
    paths = {curve.data_path for curve in [*action_curves(tree), *(data.drivers if data else [])]}
    paths -= {socket.path_from_id("default_value") for socket in followed}
    # What they are constants of is followed with them.
    nodes -= {out.node for socket in followed for out in upstream(socket)}
    moves = any(path.startswith(f"{node.path_from_id()}.") for path in paths for node in nodes if node.id_data == tree)
    moves = moves or any(is_animated(node.id_data) for node in nodes if node.id_data != tree)
    moves = moves or any(strip for track in (data.nla_tracks if data else []) for strip in track.strips)
    movies = any(node.type == "TEX_ENVIRONMENT" and node.image is not None and node.image.source in ("SEQUENCE", "MOVIE") for node in nodes)
    if moves or movies:
        lost.add(world.name, "animated world nodes", "the sky of the first frame is used; only colour and strength of a plain Background node are followed")


def animate_world(animation: Animation, samples: list[dict[str, Any]], followed: tuple[str, ...]) -> None:
    """Channels for what of a world is followed."""
    for key in followed:
        animation.pointer(f"/scenes/0/extras/buzz/world/{key}", np.maximum([sample[key] for sample in samples], 0))


def sample_world(scene: bpy.types.Scene) -> dict[str, Any]:
    """Colour and strength now; only of a Background node is either followed."""
    world = scene.world
    tree = world.node_tree if world is not None and world.use_nodes else None
    surface = _surface(scene) if tree is not None else None
    if surface is None or surface.type != "BACKGROUND":
        return {"color": tuple(world.color) if world is not None else (0, 0, 0), "strength": 1.0}
    colour, strength = constant(surface.inputs["Color"]), constant(surface.inputs["Strength"])
    return {"color": (0, 0, 0) if colour is None else tuple(colour), "strength": 1.0 if strength is None else strength}


def _environment(out: bpy.types.NodeSocket | None) -> tuple[bpy.types.Image, float] | None:
    """Image and rotation of an equirectangular Environment Texture turned about the vertical at most, else None."""
    node = out.node if out is not None else None
    if node is None or node.mute or node.type != "TEX_ENVIRONMENT" or node.image is None or node.projection != "EQUIRECTANGULAR":
        return None
    if node.image.source not in ("FILE", "GENERATED") or not _can_be_linear(node.image):
        return None
    vector = node.inputs["Vector"]
    if not vector.is_linked:
        return node.image, 0.0
    mapping = vector.links[0].from_node
    if mapping.mute or mapping.type != "MAPPING":
        plain = mapping.type == "TEX_COORD" and vector.links[0].from_socket.name == "Generated"
        return (node.image, 0.0) if plain else None
    if any(mapping.inputs[n].is_linked for n in ("Location", "Rotation", "Scale") if n in mapping.inputs):
        return None
    where = source(mapping.inputs["Vector"])
    if where is not None and (where.node.type != "TEX_COORD" or where.name != "Generated"):
        return None
    location = mapping.inputs["Location"].default_value if "Location" in mapping.inputs else (0, 0, 0)
    rotation, scale = mapping.inputs["Rotation"].default_value, mapping.inputs["Scale"].default_value
    turned = max(abs(rotation[0]), abs(rotation[1])) > 1e-6
    if turned or max(abs(x) for x in location) > 1e-6 or max(abs(x - 1) for x in scale) > 1e-6:
        return None
    # A Point mapping turns the direction that is looked up, so the sky turns the other way.
    return node.image, (rotation[2] if mapping.vector_type == "TEXTURE" else -rotation[2])


def _can_be_linear(image: bpy.types.Image) -> bool:
    """Whether the pixels of an image, if it has any, are linear or sRGB; Blender itself makes those of deep images linear."""
    # Asking for the size makes Blender load the file, and only then does it know its colour space.
    return not image.size[0] or image.is_float or image.colorspace_settings.is_data or image.colorspace_settings.name in (LINEAR, "sRGB")


def _put_image(image: bpy.types.Image, folder: Path, stem: str) -> str | None:
    """Copy or write the environment image beside the glTF; its file name. None if it has no pixels."""
    suffix = Path(image.filepath_raw or image.name).suffix.lower()
    space = image.colorspace_settings
    original = Path(bpy.path.abspath(image.filepath_raw, library=image.library)) if image.filepath_raw else None
    missing = image.source == "FILE" and not image.packed_file and not (original and original.is_file())
    if missing or not image.size[0]:
        return None
    if image.source == "FILE" and space.name == _COPIED.get(suffix):
        target = folder / f"{stem}_world{suffix}"
        if image.packed_file:
            target.write_bytes(image.packed_file.data)
            return target.name
        if original and original.is_file():
            shutil.copyfile(original, target)
            return target.name
    # Anything else (generated, other formats, unusual colour spaces): the pixels, linear, as OpenEXR.
    target = folder / f"{stem}_world.exr"
    width, height = image.size
    copy = bpy.data.images.new("world", width, height, float_buffer=True)
    # Other images Blender encodes as it saves them.
    copy.colorspace_settings.name = "Non-Color"
    pixels = np.empty(width * height * 4, dtype=np.float32)
    image.pixels.foreach_get(pixels)
    if not image.is_float and not space.is_data and space.name != LINEAR:
        rgb = pixels.reshape(-1, 4)[:, :3]
        rgb[:] = decoded(rgb)
    copy.pixels.foreach_set(pixels)
    copy.filepath_raw, copy.file_format = str(target), "OPEN_EXR"
    _save(copy.save, target)
    bpy.data.images.remove(copy)
    return target.name


def _bake(scene: bpy.types.Scene, folder: Path, stem: str, lost: Lost) -> str:
    """Render the world alone with Cycles through an equirectangular camera, as wide as its images; the file name of the image."""
    shown = _output(scene)
    nodes = {out.node for out in upstream(shown.inputs["Surface"])}
    detail = max((node.image.size[0] for node in nodes if node.type == "TEX_ENVIRONMENT" and node.image is not None), default=0)
    if detail > _WIDEST:
        lost.add(scene.world.name, f"sky of {detail} pixels", f"it is baked {_WIDEST} pixels wide; link the image itself to the Background node")
    width = min(max(detail, _BAKED_WIDTH), _WIDEST)
    target = folder / f"{stem}_world.exr"
    sky = bpy.data.scenes.new("world")
    sky.world = scene.world
    data = bpy.data.cameras.new("world")
    data.type = "PANO"
    # The property moved from Cycles' own settings to the camera in Blender 5.0.
    panorama = data if hasattr(data, "panorama_type") else data.cycles
    panorama.panorama_type = "EQUIRECTANGULAR"
    camera = bpy.data.objects.new("world", data)
    # Looking along Blender's +X, upright: the image's centre is then where the convention has it.
    camera.rotation_euler = (math.pi / 2, 0, -math.pi / 2)
    sky.collection.objects.link(camera)
    sky.camera = camera
    sky.render.engine = "CYCLES"
    # A sun's disc is as small as a pixel of the narrowest sky: as many rays as find its share of one, however wide.
    sky.cycles.samples = max(64 * _BAKED_WIDTH**2 // width**2, 4)
    sky.cycles.use_denoising, sky.cycles.pixel_filter_type = False, "BOX"
    sky.render.resolution_x, sky.render.resolution_y, sky.render.resolution_percentage = width, width // 2, 100
    sky.cycles.use_adaptive_sampling = False
    sky.render.image_settings.file_format = "OPEN_EXR"
    # Half floats end far below the sun.
    sky.render.image_settings.color_depth = "32"
    sky.render.filepath = str(target)
    for node in scene.world.node_tree.nodes:
        if node.type == "OUTPUT_WORLD":
            node.target = "CYCLES" if node == shown else "EEVEE"
    # Nothing is lit here, so Cycles need not work out where the sky is bright.
    scene.world.cycles.sampling_method = "NONE"
    sky.frame_set(scene.frame_current)
    _save(lambda: bpy.ops.render.render(write_still=True, scene=sky.name), target)
    bpy.data.scenes.remove(sky)
    return target.name


def _save(save: Callable[[], Any], target: Path) -> None:
    """Have Blender save an image. It may not say that the disk is full; but then nothing more can be written either."""
    try:
        save()
    finally:
        with target.open("r+b") as file:
            size = file.seek(0, os.SEEK_END)
            file.write(bytes(1 << 16))
            file.flush()
            file.truncate(size)
