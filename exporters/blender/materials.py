"""What of a material glTF can hold; the rest is rebuilt as Principled where that is plain, or named.

Blender's exporter reads a Principled BSDF, image textures, colour attributes and constants (see nodes.py); anything else
it drops or turns white without a word.
"""

from __future__ import annotations

import os

import bpy
import numpy as np

from ..common.report import Lost
from .constants import constant, put
from .groups import inline_groups
from .mixtures import is_clear, multiply_alpha, uncovered
from .nodes import CONSTANTS, NORMALS, drop_muted, output_target, source, trees, unreadable_inputs, upstream
from .prepare import is_animated

# The property of a baked image's node that says what in it depends on the object's place or the view.
PLACED = "placed"
# The property of a mesh that is bent out of its first form, and of the node of an image that depends on what that was.
DEFORMED = "deformed"
# The property of a baked image's node that was brighter than the image can be.
CUT_OFF = "cut off"
_DROPPED = {"Diffuse Roughness": "diffuse roughness", "Subsurface Weight": "subsurface scattering", "Thin Film Thickness": "thin film"}


def prepare_materials(materials: list[bpy.types.Material], lost: Lost) -> None:
    """Rebuild what is plain, name what is lost."""
    for material in materials:
        tree = material.node_tree if material.use_nodes else None
        if tree is None:
            continue
        for each in trees(tree):
            # Blender's exporter goes to a frame of its own.
            each.animation_data_clear()
            _drop_broken_groups(each, material.name, lost)
            _hold_movies(each, material.name, lost)
            _name_missing_images(each, material.name, lost)
        make_plain(tree)
        output = output_of(tree)
        if output.inputs["Displacement"].is_linked and source(output.inputs["Displacement"]):
            lost.add(material.name, "displacement", "apply it to the mesh (Displace modifier) or bake a normal map")
        if output.inputs["Volume"].is_linked:
            lost.add(material.name, "volume shader", "only Principled transmission is carried; render the volume separately")
        shader = output.inputs["Surface"].links[0].from_node
        if shader.type != "BSDF_PRINCIPLED":
            shader = _choose_principled(tree, output, shader, material.name, lost)
        _name_losses(shader, meshes_of(material), material.name, lost)


def as_rendered(material: bpy.types.Material, engine: str, lost: Lost) -> None:
    """Leave of a material what one engine renders at one time, for Blender's exporter asks for none; without groups, it reads more."""
    if engine == "CYCLES":
        # It shows both sides of everything.
        material.use_backface_culling = False
    tree = material.node_tree
    shown = tree.get_output_node(output_target(engine)) if tree is not None else None
    if shown is not None:
        for node in [node for node in tree.nodes if node.type == "OUTPUT_MATERIAL" and node != shown]:
            tree.nodes.remove(node)
        shown.target, shown.is_active_output = "ALL", True
    if tree is not None and material.use_nodes:
        if any(is_animated(each) for each in (material, *trees(tree))):
            lost.add(material.name, "animated material", "the values of the first frame are used")
        inline_groups(tree)


def default_surface() -> bpy.types.Material:
    """What Blender shows where there is no material; glTF would have rough metal there."""
    material = bpy.data.materials.new("Default Surface")
    if material.node_tree is None:
        material.use_nodes = True
    return material


def own_copy(material: bpy.types.Material) -> bpy.types.Material:
    """A material of a library, with its node groups, as one of this file: nothing can be linked to nodes of another."""
    copy = material.copy()
    made: dict[bpy.types.NodeTree, bpy.types.NodeTree] = {}
    found = [copy.node_tree] if copy.node_tree is not None else []
    for tree in found:
        for node in tree.nodes:
            if node.type == "GROUP" and node.node_tree is not None and node.node_tree.library:
                if node.node_tree not in made:
                    made[node.node_tree] = node.node_tree.copy()
                    found.append(made[node.node_tree])
                node.node_tree = made[node.node_tree]
    return copy


def make_plain(tree: bpy.types.NodeTree) -> None:
    """Rebuild with a Principled BSDF what looks the same with one; called before baking, and again where that is off."""
    drop_muted(tree)
    surface = output_of(tree).inputs["Surface"]
    shown, covers = uncovered(surface)
    shader = shown.node if shown is not None else None
    settings = _as_principled(tree, shader)
    if settings is not None:
        shader = _new_principled(tree, settings)
    if shader.type == "BSDF_PRINCIPLED":
        tree.links.new(shader.outputs[0], surface)
        for cover in covers:
            multiply_alpha(tree, shader.inputs["Alpha"], cover)
        _fold_constants(tree, shader)


def output_of(tree: bpy.types.NodeTree) -> bpy.types.Node:
    """The material output that is rendered; a new one, where Blender renders black for want of one."""
    return tree.get_output_node("ALL") or tree.get_output_node("CYCLES") or tree.nodes.new("ShaderNodeOutputMaterial")


def meshes_of(material: bpy.types.Material) -> list[bpy.types.Mesh]:
    """The meshes of the export scene that show a material."""
    return [ob.data for ob in bpy.context.scene.objects if any(slot.material == material for slot in ob.material_slots)]


def _as_principled(tree: bpy.types.NodeTree, shader: bpy.types.Node | None) -> dict | None:
    """Settings of a Principled BSDF that looks like another plain shader: values, or inputs to copy. None if there are none."""
    black = {"Base Color": (0, 0, 0, 1), "Roughness": 1.0, "Specular IOR Level": 0.0}
    if shader is None:
        # A surface of nothing is black in Blender, but not there around a volume.
        return {**black, "Alpha": 0.0} if output_of(tree).inputs["Volume"].is_linked else black
    inputs = shader.inputs
    if shader.type == "BSDF_DIFFUSE":
        return {"Base Color": inputs["Color"], "Normal": inputs["Normal"], "Roughness": 1.0, "Specular IOR Level": 0.0}
    if shader.type in ("BSDF_GLOSSY", "BSDF_ANISOTROPIC"):
        return {"Base Color": inputs["Color"], "Roughness": inputs["Roughness"], "Normal": inputs["Normal"], "Metallic": 1.0}
    if shader.type in ("BSDF_GLASS", "BSDF_REFRACTION"):
        copied = {"Base Color": inputs["Color"], "Roughness": inputs["Roughness"], "IOR": inputs["IOR"], "Normal": inputs["Normal"]}
        return {**copied, "Transmission Weight": 1.0}
    if shader.type == "EMISSION":
        return {**black, "Emission Color": inputs["Color"], "Emission Strength": inputs["Strength"]}
    if is_clear(shader):
        return {**black, "Alpha": 0.0}
    return None


def _new_principled(tree: bpy.types.NodeTree, settings: dict) -> bpy.types.Node:
    """A Principled BSDF of values, and of inputs to copy."""
    shader = tree.nodes.new("ShaderNodeBsdfPrincipled")
    for key, value in settings.items():
        if not isinstance(value, bpy.types.NodeSocket):
            shader.inputs[key].default_value = value
        elif value.is_linked:
            tree.links.new(value.links[0].from_socket, shader.inputs[key])
        elif value.type != "VECTOR":
            shader.inputs[key].default_value = value.default_value
    return shader


def _fold_constants(tree: bpy.types.NodeTree, shader: bpy.types.Node) -> None:
    """Put what nodes always give into the inputs themselves, where Blender's exporter always sees it."""
    for socket in shader.inputs:
        value = constant(socket) if socket.is_linked and socket.type in ("VALUE", "RGBA") else None
        if value is not None:
            put(socket, value)
            tree.links.remove(socket.links[0])


def _choose_principled(tree, output, shader, name: str, lost: Lost) -> bpy.types.Node:
    """The Principled BSDF that stands for a mixture of shaders: one in it, else one like its first plain shader, else Blender's grey."""
    lost.add(name, f"{shader.bl_label or shader.type} shader", "use a Principled BSDF, directly under the output")
    nodes = [node for out in upstream(output.inputs["Surface"]) if (node := out.node).id_data == tree]
    chosen = next((n for n in nodes if n.type == "BSDF_PRINCIPLED"), None)
    if chosen is None:
        # The last inputs come first.
        plain = (settings for n in reversed(nodes) if not is_clear(n) and (settings := _as_principled(tree, n)))
        chosen = _new_principled(tree, next(plain, {}))
    tree.links.new(chosen.outputs[0], output.inputs["Surface"])
    _fold_constants(tree, chosen)
    return chosen


def _name_losses(shader: bpy.types.Node, meshes: list[bpy.types.Mesh], name: str, lost: Lost) -> None:
    for key, reason in unreadable_inputs(shader, meshes).items():
        socket = shader.inputs[key]
        images = [out.node.image for out in upstream(socket) if out.node.type == "TEX_IMAGE" and out.node.image is not None]
        if key not in NORMALS + CONSTANTS and images and all(image.source != "TILED" for image in images):
            remains = "the image alone is used"
        else:
            # What the exporter would make of it is worse than to go without, or stops it.
            shader.id_data.links.remove(socket.links[0])
            remains = "it is left out" if key in NORMALS else "a constant is used"
        lost.add(name, f"procedural {key.lower()} ({reason})", f"bake it to an image texture; until then {remains}")
    for socket in shader.inputs:
        for what in {out.node[PLACED] for out in upstream(socket) if PLACED in out.node}:
            feature = f"{socket.name.lower()} that depends on the object's place or the view ({what})"
            lost.add(name, feature, "it is baked once, for an object at the origin; bake each object by itself")
        if any(DEFORMED in out.node for out in upstream(socket)):
            feature = f"{socket.name.lower()} by generated coordinates of a mesh that is deformed"
            lost.add(name, feature, "they are those of its shape in the first frame, not of the one before it is deformed; lay the texture by UV")
    for key, label in _DROPPED.items():
        value = shader.inputs.get(key)
        if value is not None and (value.is_linked or value.default_value > 0):
            lost.add(name, label, "it is rendered as without it")
    base = shader.inputs["Base Color"]
    if any(CUT_OFF in out.node for out in upstream(base)) or (not base.is_linked and max(base.default_value[:3]) > 1):
        lost.add(name, "base color over 1", "it is cut off at 1; give it a color that reflects no more than it gets")
    tint, metal = shader.inputs["Specular Tint"], shader.inputs["Metallic"]
    if (metal.is_linked or metal.default_value > 0) and (tint.is_linked or min(tint.default_value) < 1):
        lost.add(name, "specular tint of a metal", "its rim is white; tint the base color instead")


def _drop_broken_groups(tree: bpy.types.NodeTree, name: str, lost: Lost) -> None:
    """Take out node groups without a tree (a missing library) or without an output: Blender's exporter stops on them."""
    for node in list(tree.nodes):
        if node.type == "GROUP" and (node.node_tree is None or all(n.type != "GROUP_OUTPUT" for n in node.node_tree.nodes)):
            label = node.node_tree.name if node.node_tree is not None else node.name
            lost.add(name, f"node group {label!r} (missing or without output)", "bring the library back, or the group is left out")
            tree.nodes.remove(node)


def _hold_movies(tree: bpy.types.NodeTree, name: str, lost: Lost) -> None:
    """Replace movies by stills of their first frame: Blender's exporter leaves them out."""
    for node in tree.nodes:
        if node.type != "TEX_IMAGE" or node.image is None or node.image.source not in ("SEQUENCE", "MOVIE"):
            continue
        lost.add(name, f"image {node.image.name!r} is a movie", "its first frame is used for the whole shot")
        node.image = _still(node.image)


def _still(movie: bpy.types.Image) -> bpy.types.Image:
    """The first frame of a movie or image sequence."""
    if movie.source == "SEQUENCE":
        # The file that was chosen for a sequence is its first.
        still = movie.copy()
        still.source = "FILE"
        return still
    still = bpy.data.images.new(movie.name, *movie.size)
    still.colorspace_settings.name = movie.colorspace_settings.name
    pixels = np.empty(len(movie.pixels), dtype=np.float32)
    movie.pixels.foreach_get(pixels)
    still.pixels.foreach_set(pixels)
    still.pack()
    return still


def _name_missing_images(tree: bpy.types.NodeTree, name: str, lost: Lost) -> None:
    for node in tree.nodes:
        if node.type != "TEX_IMAGE" or node.image is None:
            continue
        image = node.image
        if image.source == "FILE" and not image.packed_file and not os.path.isfile(bpy.path.abspath(image.filepath, library=image.library)):
            lost.add(name, f"image {image.name!r} is missing", "find it with File > External Data > Find Missing Files")
