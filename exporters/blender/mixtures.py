"""Mixtures of a shader with Transparent (leaves, decals): what a Principled BSDF has its alpha for."""

from __future__ import annotations

import bpy

from .constants import constant, converted
from .nodes import placed, source

# A Mix Shader's factor, and whether the other shader is what is left of it.
Cover = tuple[bpy.types.NodeSocket, bool]


def uncovered(surface: bpy.types.NodeSocket) -> tuple[bpy.types.NodeSocket | None, list[Cover]]:
    """The shader that is seen where an input's mixtures with Transparent let it, and by what they do so."""
    covers = []
    shown = source(surface)
    while shown is not None and (mixture := _mixture(shown.node)):
        shown, cover = mixture
        covers.append(cover)
    # Of several constants glTF holds the product only.
    return shown, sorted(covers, key=lambda cover: constant(cover[0]) is None)


def is_clear(shader: bpy.types.Node) -> bool:
    """Whether a shader is Transparent without a colour."""
    colour = constant(shader.inputs["Color"]) if shader.type == "BSDF_TRANSPARENT" and not shader.mute else None
    return colour is not None and min(colour) >= 1


def multiply_alpha(tree: bpy.types.NodeTree, alpha: bpy.types.NodeSocket, cover: Cover) -> None:
    """Have an alpha do what a mixture with Transparent did."""
    factor, rest = cover
    while (inverted := _inverted(factor)) is not None:
        factor, rest = inverted, not rest
    value, before = constant(factor), constant(alpha)
    if value is not None:
        value = min(max(converted(value, factor.type, "VALUE"), 0.0), 1.0)
        value = 1 - value if rest else value
        if before is not None:
            for link in list(alpha.links):
                tree.links.remove(link)
            alpha.default_value = before * value
            return
    out = None if value is not None else source(factor)
    if out is not None and rest:
        left = tree.nodes.new("ShaderNodeMath")
        left.operation, left.inputs[0].default_value = "SUBTRACT", 1.0
        tree.links.new(out, left.inputs[1])
        out = left.outputs[0]
    if before != 1:
        product = tree.nodes.new("ShaderNodeMath")
        product.operation = "MULTIPLY"
        for socket, each, number in zip(product.inputs, (source(alpha), out), (before, value), strict=False):
            if number is None:
                tree.links.new(each, socket)
            else:
                socket.default_value = number
        out = product.outputs[0]
    tree.links.new(out, alpha)


def _mixture(node: bpy.types.Node) -> tuple[bpy.types.NodeSocket, Cover] | None:
    """What a Mix Shader mixes with Transparent, and how; not where that differs between rays or sides, for an alpha does not."""
    if node.type != "MIX_SHADER" or node.mute:
        return None
    factor, *shaders = node.inputs
    first, second = map(source, shaders)
    if first is None or second is None or placed(factor):
        return None
    if factor.is_linked and source(factor) is None:
        return None
    if is_clear(first.node):
        return second, (factor, False)
    return (first, (factor, True)) if is_clear(second.node) else None


def _inverted(socket: bpy.types.NodeSocket) -> bpy.types.NodeSocket | None:
    """The input of which a socket is what is left of one."""
    out = source(socket)
    node = out.node if out is not None and not out.node.mute else None
    if node is not None and node.type == "MATH" and node.operation == "SUBTRACT" and constant(node.inputs[0]) == 1:
        return node.inputs[1]
    return node.inputs["Color"] if node is not None and node.type == "INVERT" and constant(node.inputs[0]) == 1 else None
