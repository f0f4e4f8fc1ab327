"""What Blender's glTF exporter (io_scene_gltf2) reads rightly of the inputs of a Principled BSDF.

It takes the first image it finds anywhere before an input, and a factor directly before it; all else it drops without a
word. So what hangs on an input is compared with the few forms in which that is also what Blender renders:

    a colour    constant x colour attribute x image
    a value     constant x one channel of an image
    alpha       constant x colour attribute's alpha x one channel of an image, clipped or not
    a normal    the tangent-space normal map of an image

and each image with the few ways of placing and encoding one that glTF knows.
"""

from __future__ import annotations

from collections.abc import Iterator

import bpy
import numpy as np

# What glTF holds in one texture, and thus in one place.
PAIRS = (("Base Color", "Alpha"), ("Metallic", "Roughness"))
# Inputs that glTF holds as a constant.
CONSTANTS = ("Emission Strength", "IOR")
NORMALS = ("Normal", "Coat Normal")
# Nodes whose outputs differ between objects that share a mesh, or with the view (which of two sides is seen).
_PLACED = {
    "OBJECT_INFO", "PARTICLE_INFO", "HAIR_INFO", "POINT_INFO", "CAMERA", "LIGHT_PATH", "LAYER_WEIGHT", "FRESNEL", "AMBIENT_OCCLUSION",
}  # fmt: skip
_PLACED_OUTPUTS = {"NEW_GEOMETRY": {"Position", "Normal", "Tangent", "True Normal", "Incoming", "Backfacing"}, "TEX_COORD": {"Camera", "Window", "Reflection"}}
# Nodes that take generated coordinates where they are given none.
_GENERATED = {"TEX_BRICK", "TEX_CHECKER", "TEX_GABOR", "TEX_GRADIENT", "TEX_MAGIC", "TEX_NOISE", "TEX_VORONOI", "TEX_WAVE"}


def trees(tree: bpy.types.NodeTree) -> list[bpy.types.NodeTree]:
    """A node tree and those of the groups in it, each once."""
    found = [tree]
    for each in found:
        found += [n.node_tree for n in each.nodes if n.type == "GROUP" and n.node_tree is not None and n.node_tree not in found]
    return list(dict.fromkeys(found))


def output_target(engine: str) -> str:
    """The target of the output nodes that an engine renders."""
    return "CYCLES" if engine == "CYCLES" else "EEVEE"


def source(socket: bpy.types.NodeSocket) -> bpy.types.NodeSocket | None:
    """The output that an input is linked to, past reroutes."""
    while socket.is_linked:
        socket = socket.links[0].from_socket
        if socket.node.type != "REROUTE":
            return socket
        socket = socket.node.inputs[0]
    return None


def upstream(socket: bpy.types.NodeSocket) -> Iterator[bpy.types.NodeSocket]:
    """All outputs that an input hangs on; all that are linked in a node group on the way."""
    seen = set()
    links = list(socket.links)
    while links:
        out = links.pop().from_socket
        if out in seen:
            continue
        seen.add(out)
        yield out
        links += [link for each in out.node.inputs for link in each.links]
        if out.node.type == "GROUP" and out.node.node_tree is not None:
            links += out.node.node_tree.links


def drop_muted(tree: bpy.types.NodeTree) -> None:
    """Take out muted links, and muted shaders as Blender passes over them: for their first input, or for black."""
    for link in [link for link in tree.links if link.is_muted]:
        tree.links.remove(link)
    for node in [node for node in tree.nodes if node.mute]:
        for link in [link for out in node.outputs if out.type == "SHADER" for link in out.links]:
            target = link.to_socket
            passed = next((inner.from_socket for inner in node.internal_links if inner.to_socket == link.from_socket), None)
            tree.links.remove(link)
            if passed is not None and passed.is_linked:
                tree.links.new(passed.links[0].from_socket, target)


def placed(socket: bpy.types.NodeSocket) -> str | None:
    """What before an input depends on the object's place, its instance or the view."""
    return next((_label(out.node) for out in upstream(socket) if _is_placed(out)), None)


def is_generated(socket: bpy.types.NodeSocket) -> bool:
    """Whether what is before an input depends on generated coordinates."""
    return any(_takes_generated(out) for out in upstream(socket))


def has_generated(tree: bpy.types.NodeTree) -> bool:
    """Whether generated coordinates are used in a node tree."""
    return any(_takes_generated(link.from_socket) for each in trees(tree) for link in each.links)


def _takes_generated(out: bpy.types.NodeSocket) -> bool:
    node = out.node
    return (node.type == "TEX_COORD" and out.name == "Generated") or (node.type in _GENERATED and not node.inputs["Vector"].is_linked)


def _is_placed(out: bpy.types.NodeSocket) -> bool:
    node = out.node
    if node.type in _PLACED or out.name in _PLACED_OUTPUTS.get(node.type, ()):
        return True
    if node.type == "VECT_TRANSFORM":
        return {node.convert_from, node.convert_to} != {"OBJECT"}
    if node.type == "TEX_COORD" and out.name == "Object" and node.object is not None:
        return True
    return getattr(node, "from_instancer", False) or (node.type == "ATTRIBUTE" and node.attribute_type != "GEOMETRY")


def unreadable_inputs(shader: bpy.types.Node, meshes: list[bpy.types.Mesh]) -> dict[str, str]:
    """Inputs of a Principled BSDF, used on these meshes, that the exporter would get wrong: name -> what it cannot read."""
    reader = _Reader(meshes)
    forms = {
        "Base Color": reader.base_colour,
        "Metallic": reader.value,
        "Roughness": reader.value,
        "Alpha": reader.alpha,
        "Emission Color": reader.emission,
        "Transmission Weight": reader.red,
        "Coat Weight": reader.value,
        "Coat Roughness": reader.value,
        "Specular IOR Level": reader.value,
        "Specular Tint": reader.emission,
        **dict.fromkeys(NORMALS, reader.normal),
        **dict.fromkeys(CONSTANTS, reader.constant),
    }
    found = {}
    for name, form in forms.items():
        socket = shader.inputs.get(name)
        if socket is not None and socket.is_linked and (reason := form(socket)):
            found[name] = reason
    strength = shader.inputs["Emission Strength"]
    if not strength.is_linked and strength.default_value == 0:
        found.pop("Emission Color", None)
    for first, second in PAIRS:
        places = [_place(shader.inputs[name]) for name in (first, second)]
        if None not in places and places[0] != places[1] and not {first, second} & set(found):
            found[second] = f"an image placed unlike that of the {first.lower()}"
    return found


class _Reader:
    """Compares sockets with the forms above; each method gives what is wrong, or None."""

    def __init__(self, meshes: list[bpy.types.Mesh]) -> None:
        self.meshes = meshes

    def base_colour(self, socket):
        return self._product(socket, {"constant", "Color"}, most=1.0)

    def emission(self, socket):
        return self._product(socket, {"constant"}, most=float("inf"))

    def value(self, socket):
        return self._product(socket, {"constant"}, most=1.0)

    def alpha(self, socket):
        return self._product(_before_clip(socket), {"constant", "Alpha"}, most=1.0)

    def red(self, socket):
        """A value for which the exporter takes red, whichever channel is linked."""
        channel = next((o for o in upstream(socket) if o.node.type in ("SEPARATE_COLOR", "TEX_IMAGE")), None)
        return _label(channel.node) if channel and channel.name not in ("Red", "Color") else self.value(socket)

    def constant(self, socket):
        out = source(socket)
        return _label(out.node) if out else None

    def normal(self, socket):
        out = source(socket)
        if out is None:
            return None
        node = out.node
        if node.type != "NORMAL_MAP" or node.mute or node.inputs["Strength"].is_linked:
            return _label(node)
        if node.space != "TANGENT" or getattr(node, "convention", "OPENGL") != "OPENGL":
            return f"a normal map in {node.space.replace('BLENDER_', '').lower()} space"
        image = source(node.inputs["Color"])
        if image is None or image.node.type != "TEX_IMAGE" or image.name != "Color":
            return _label(image.node if image else node)
        return self._image(image, is_colour=False)

    def _product(self, socket, factors: set[str], most: float):
        """An image, or a constant or attribute out of `factors`, times each other one of `factors` at most once."""
        factors = set(factors)
        while pair := _multiplied(socket):
            for side, other in (pair, pair[::-1]):
                kind = self._factor(side, most)
                if kind in factors:
                    factors.remove(kind)
                    socket = other
                    break
            else:
                return _label(source(socket).node)
        out, kind = source(socket), self._factor(socket, most)
        if out is None or kind is not None:
            return None if kind in factors else _label(out.node if out else socket.node)
        if socket.type == "VALUE" and out.node.type == "SEPARATE_COLOR" and out.node.mode == "RGB" and not out.node.mute:
            out = source(out.node.inputs[0]) or out
        elif socket.type == "VALUE" and out.node.type == "TEX_IMAGE" and out.name == "Color" and not _is_grey(out.node.image):
            return "a coloured image as a value"
        if out.node.type != "TEX_IMAGE" or (socket.type == "RGBA" and out.name != "Color"):
            return _label(out.node)
        return self._image(out, is_colour=socket.type == "RGBA")

    def _factor(self, socket, most: float) -> str | None:
        """Whether a socket is a "constant" or the "Color" or "Alpha" of a colour attribute."""
        value = _constant(socket)
        if value is not None:
            return "constant" if min(value) >= 0 and max(value) <= most else None
        out = source(socket)
        if out.node.mute:
            return None
        name = {"VERTEX_COLOR": "layer_name", "ATTRIBUTE": "attribute_name"}.get(out.node.type)
        if name is None or (out.node.type == "ATTRIBUTE" and out.node.attribute_type != "GEOMETRY"):
            return None
        layer = getattr(out.node, name)
        there = all(layer in m.color_attributes if layer else m.color_attributes for m in self.meshes)
        return out.name if there and (layer or out.node.type == "VERTEX_COLOR") else None

    def _image(self, out, is_colour: bool):
        """What glTF cannot hold of an image texture."""
        node, image = out.node, out.node.image
        if node.mute or image is None:
            return "an image node that is off or empty"
        if node.projection != "FLAT":
            return f"an image in {node.projection.lower()} projection"
        if node.extension == "CLIP":
            return "an image with clipped edges"
        if image.source == "TILED":
            return "a tiled image (UDIM)"
        if out.name == "Alpha" and image.alpha_mode == "NONE":
            return "an image whose alpha is off"
        space = image.colorspace_settings
        # Blender multiplies colours by an alpha that is not used beside them.
        if out.name == "Color" and not node.outputs["Alpha"].is_linked and not space.is_data and _has_holes(image):
            return "a transparent image without its alpha"
        # A PNG file is copied as it is, deep or not; other float images are not encoded as they are decoded.
        deep = image.is_float and not (image.source == "FILE" and image.file_format == "PNG")
        if out.name == "Color" and (deep or (space.name != "sRGB" if is_colour else not space.is_data)):
            return f"an image in {space.name} as {'a colour' if is_colour else 'data'}"
        return self._coordinates(node.inputs["Vector"])

    def _coordinates(self, socket):
        """UV coordinates, moved, turned about Z and scaled by constants, or not."""
        out = source(socket)
        if out is not None and out.node.type == "MAPPING":
            node = out.node
            turned = node.inputs["Rotation"].default_value
            if node.vector_type != "POINT" or node.mute or turned[0] or turned[1] or any(s.is_linked for s in node.inputs[1:]):
                return f"a mapping node of type {node.vector_type.lower()}"
            out = source(node.inputs["Vector"])
            if out is None:
                return "a mapping node of nothing"
        if out is None:
            return None
        node = out.node
        if getattr(node, "from_instancer", False) or node.mute:
            return _label(node)
        if node.type == "UVMAP" or (node.type == "TEX_COORD" and out.name == "UV"):
            return None
        if node.type == "ATTRIBUTE" and node.attribute_type == "GEOMETRY" and out.name == "Vector":
            return None if all(node.attribute_name in m.uv_layers for m in self.meshes) else _label(node)
        return f"an image by {out.name.lower()} coordinates" if node.type == "TEX_COORD" else _label(node)


def _label(node: bpy.types.Node) -> str:
    return f"{node.type.replace('TEX_', '').replace('_', ' ').lower()} node"


def _constant(socket: bpy.types.NodeSocket) -> list[float] | None:
    """What an input is without images: unlinked, or linked to a value or colour node of its own type."""
    out = source(socket)
    if out is None:
        value = None if socket.is_linked else socket.default_value
    else:
        value = out.default_value if {"RGB": "RGBA", "VALUE": "VALUE"}.get(out.node.type) == socket.type else None
    return value if value is None else list(value)[:3] if socket.type == "RGBA" else [value]


def _multiplied(socket: bpy.types.NodeSocket) -> list[bpy.types.NodeSocket] | None:
    """The two inputs of which a socket is the plain product."""
    out = source(socket)
    if out is None or out.node.mute:
        return None
    node = out.node
    if socket.type == "VALUE" and node.type == "MATH" and node.operation == "MULTIPLY" and not node.use_clamp:
        return list(node.inputs[:2])
    if socket.type == "RGBA" and node.type == "MIX" and node.data_type == "RGBA" and node.blend_type == "MULTIPLY" and not node.clamp_result:
        return [s for s in node.inputs if s.identifier in ("A_Color", "B_Color")] if _constant(node.inputs[0]) == [1.0] else None
    return None


def _before_clip(socket: bpy.types.NodeSocket) -> bpy.types.NodeSocket:
    """What an alpha clip compares with a constant; the socket itself where there is none."""
    node = _math(socket)
    if node is None:
        return socket
    if node.operation == "ROUND":
        return node.inputs[0]
    below = False
    if node.operation == "SUBTRACT" and _constant(node.inputs[0]) == [1.0] and (before := _math(node.inputs[1])):
        node, below = before, True
    sides = list(node.inputs[:2]) if (node.operation == "LESS_THAN") == below else list(node.inputs[1::-1])
    if node.operation in ("GREATER_THAN", "LESS_THAN") and _constant(sides[1]) and not _constant(sides[0]):
        return sides[0]
    return socket


def _math(socket: bpy.types.NodeSocket) -> bpy.types.Node | None:
    out = source(socket)
    return out.node if out is not None and out.node.type == "MATH" and not out.node.mute else None


def _is_grey(image: bpy.types.Image | None) -> bool:
    """Whether the channels of an image agree: which of them is read then makes no difference."""
    if image is None or image.channels < 3:
        return True
    pixels = np.empty(len(image.pixels), dtype=np.float32)
    image.pixels.foreach_get(pixels)
    colours = pixels.reshape(-1, image.channels)[:, :3]
    return not colours.size or float(np.ptp(colours, axis=1).max()) < 0.02


def _has_holes(image: bpy.types.Image) -> bool:
    """Whether an image is transparent anywhere, and its alpha means that."""
    # The depth is that of the file; in memory there always are four channels.
    if image.channels < 4 or image.depth == 24 or image.alpha_mode not in ("STRAIGHT", "PREMUL"):
        return False
    pixels = np.empty(len(image.pixels), dtype=np.float32)
    image.pixels.foreach_get(pixels)
    return bool(pixels.size) and float(pixels[3::4].min()) < 1


def _place(socket: bpy.types.NodeSocket) -> tuple | None:
    """How the image before an input is laid on the mesh; None without an image."""
    node = next((out.node for out in upstream(socket) if out.node.type == "TEX_IMAGE"), None)
    if node is None:
        return None
    out = source(node.inputs["Vector"])
    mapping = ()
    if out is not None and out.node.type == "MAPPING":
        mapping = tuple(tuple(s.default_value) for s in out.node.inputs[1:])
        out = source(out.node.inputs["Vector"])
    layer = next((getattr(out.node, name) for name in ("uv_map", "attribute_name") if hasattr(out.node, name)), "") if out else ""
    return layer, mapping, node.extension, node.interpolation
