"""What of a material glTF can hold; the rest is rebuilt as Principled where that is plain, or named.

Blender's exporter reads a Principled BSDF, image textures, colour attributes and constants; anything else it drops or
turns white without a word.
"""

from __future__ import annotations

import os

import bpy

from ..common.report import Lost
from .prepare import is_animated

# Node types through which Blender's exporter finds its way to an image, a colour attribute or a constant.
_READABLE = {
    "TEX_IMAGE", "RGB", "VALUE", "VERTEX_COLOR", "ATTRIBUTE", "UVMAP", "TEX_COORD", "MAPPING", "NORMAL_MAP",
    "SEPARATE_COLOR", "SEPRGB", "COMBINE_COLOR", "REROUTE", "MIX", "MIX_RGB", "MATH", "FRAME",
}  # fmt: skip
_INPUTS = ("Base Color", "Metallic", "Roughness", "Alpha", "Normal", "Emission Color", "Transmission Weight", "Coat Weight", "Coat Roughness")
_DROPPED = {"Subsurface Weight": "subsurface scattering", "Thin Film Thickness": "thin film"}


def prepare_materials(materials: list[bpy.types.Material], lost: Lost) -> None:
    """Rebuild what is plain, name what is lost."""
    for material in materials:
        tree = material.node_tree if material.use_nodes else None
        if tree is None:
            continue
        if is_animated(material) or is_animated(tree):
            lost.add(material.name, "animated material", "the values of the first frame are used")
        _drop_broken_groups(tree, material.name, lost)
        _name_missing_images(tree, material.name, lost)
        output = tree.get_output_node("ALL") or tree.get_output_node("CYCLES")
        if output is None or not output.inputs["Surface"].is_linked:
            continue
        if output.inputs["Displacement"].is_linked and _upstream(output.inputs["Displacement"]):
            lost.add(material.name, "displacement", "apply it to the mesh (Displace modifier) or bake a normal map")
        if output.inputs["Volume"].is_linked:
            lost.add(material.name, "volume shader", "only Principled transmission is carried; render the volume separately")
        shader = output.inputs["Surface"].links[0].from_node
        if shader.type != "BSDF_PRINCIPLED":
            shader = _rebuild(tree, output, shader, material.name, lost)
        if shader is not None and shader.type == "BSDF_PRINCIPLED":
            _name_losses(shader, material.name, lost)


def procedural_inputs(shader: bpy.types.Node) -> dict[str, str]:
    """Inputs of a Principled BSDF that hang on something glTF cannot hold: input name -> type of the node."""
    found = {}
    for name in _INPUTS:
        socket = shader.inputs.get(name)
        if socket is not None and socket.is_linked:
            bad = [n.type for n in _upstream(socket) if n.type not in _READABLE]
            if bad:
                found[name] = bad[0]
    return found


def _name_losses(shader: bpy.types.Node, name: str, lost: Lost) -> None:
    for socket, kind in procedural_inputs(shader).items():
        label = kind.replace("TEX_", "").replace("_", " ").lower()
        lost.add(name, f"procedural {socket.lower()} ({label} node)", "bake it to an image texture; until then a constant is used")
    for socket, label in _DROPPED.items():
        value = shader.inputs.get(socket)
        if value is not None and (value.is_linked or value.default_value > 0):
            lost.add(name, label, "it is rendered as without it")


def _drop_broken_groups(tree: bpy.types.NodeTree, name: str, lost: Lost) -> None:
    """Take out node groups without a tree (a missing library) or without an output: Blender's exporter stops on them."""
    for node in list(tree.nodes):
        if node.type == "GROUP" and (node.node_tree is None or all(n.type != "GROUP_OUTPUT" for n in node.node_tree.nodes)):
            label = node.node_tree.name if node.node_tree is not None else node.name
            lost.add(name, f"node group {label!r} (missing or without output)", "bring the library back, or the group is left out")
            tree.nodes.remove(node)


def _name_missing_images(tree: bpy.types.NodeTree, name: str, lost: Lost) -> None:
    for node in tree.nodes:
        if node.type != "TEX_IMAGE" or node.image is None:
            continue
        image = node.image
        if image.source == "FILE" and not image.packed_file and not os.path.isfile(bpy.path.abspath(image.filepath, library=image.library)):
            lost.add(name, f"image {image.name!r} is missing", "find it with File > External Data > Find Missing Files")
        if image.source in ("SEQUENCE", "MOVIE"):
            lost.add(name, f"image {image.name!r} is a movie", "its first frame is used for the whole shot")


def _upstream(socket: bpy.types.NodeSocket) -> list[bpy.types.Node]:
    """All nodes that a socket hangs on."""
    found: list[bpy.types.Node] = []
    stack = [link.from_node for link in socket.links]
    while stack:
        node = stack.pop()
        if node not in found:
            found.append(node)
            stack += [link.from_node for s in node.inputs for link in s.links]
    return found


def _rebuild(tree, output, shader, name: str, lost: Lost) -> bpy.types.Node | None:
    """A Principled BSDF in place of another plain shader; None if there is none like it."""
    settings: dict[str, float] = {}
    if shader.type == "BSDF_DIFFUSE":
        settings = {"Roughness": 1.0, "Specular IOR Level": 0.0}
    elif shader.type in ("BSDF_GLOSSY", "BSDF_ANISOTROPIC"):
        settings = {"Metallic": 1.0}
    elif shader.type in ("BSDF_GLASS", "BSDF_REFRACTION"):
        settings = {"Transmission Weight": 1.0}
    elif shader.type == "EMISSION":
        return None
    else:
        label = shader.bl_label or shader.type
        lost.add(name, f"{label} shader", "use a Principled BSDF, directly under the output")
        shader = next((n for n in _upstream(output.inputs["Surface"]) if n.type == "BSDF_PRINCIPLED"), None)
        if shader is not None:
            tree.links.new(shader.outputs[0], output.inputs["Surface"])
        return shader
    new = tree.nodes.new("ShaderNodeBsdfPrincipled")
    for key, value in settings.items():
        new.inputs[key].default_value = value
    for source, target in (("Color", "Base Color"), ("Roughness", "Roughness"), ("IOR", "IOR"), ("Normal", "Normal")):
        old = shader.inputs.get(source)
        if old is None or (source == "Roughness" and shader.type == "BSDF_DIFFUSE"):
            continue
        if old.is_linked:
            tree.links.new(old.links[0].from_socket, new.inputs[target])
        elif source != "Normal":
            new.inputs[target].default_value = old.default_value
    tree.links.new(new.outputs[0], output.inputs["Surface"])
    return new
