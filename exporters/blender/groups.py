"""Puts the nodes of node groups in the groups' place, for what is read of a tree is read of its own nodes.

The groups themselves stay as they are: others may use them.
"""

from __future__ import annotations

import bpy

from .constants import SCALARS, Constant, converted, own_value, put
from .nodes import drop_muted

# What is set by other means, or would be set twice.
_NOT_COPIED = {"rna_type", "name", "parent", "location_absolute", "inputs", "outputs", "internal_links"}
# Here something other than what is written in an unlinked input is used.
_IMPLICIT = ("Normal", "Tangent")


def inline_groups(tree: bpy.types.NodeTree) -> None:
    """Replace all groups by copies of their nodes, but for muted and broken ones and those of which a node cannot be copied."""
    drop_muted(tree)
    kept: set[str] = set()
    while group := next((n for n in tree.nodes if n.type == "GROUP" and n.node_tree is not None and not n.mute and n.name not in kept), None):
        if not _inline(tree, group):
            kept.add(group.name)


def _inline(tree: bpy.types.NodeTree, group: bpy.types.Node) -> bool:
    end = next((n for n in group.node_tree.nodes if n.type == "GROUP_OUTPUT" and n.is_active_output), None)
    copies = _copies(tree, group.node_tree) if end is not None else None
    if copies is None:
        return False
    outer_inputs, outer_outputs = _by_identifier(group.inputs), _by_identifier(group.outputs)

    def targets(socket):
        """Where a link inside the group leads: into a copy, or out of the group."""
        if socket.node == end:
            outer = outer_outputs.get(socket.identifier)
            return [(link.to_socket, socket.type) for link in outer.links] if outer else []
        return [(_by_identifier(copies[socket.node].inputs)[socket.identifier], socket.type)] if socket.node in copies else []

    joined = []
    for link in group.node_tree.links:
        if link.is_muted or not link.is_valid:
            continue
        start = link.from_socket
        kind = start.type
        if start.node.type == "GROUP_INPUT":
            outer = outer_inputs.get(start.identifier)
            start = outer.links[0].from_socket if outer is not None and outer.is_linked else outer
        else:
            start = _by_identifier(copies[start.node].outputs)[start.identifier]
        if start is not None:
            joined += [(start, (kind, way), target) for target, way in targets(link.to_socket)]
    joined += [(socket, (socket.type,), target) for socket in end.inputs if not socket.is_linked for target, _ in targets(socket)]
    for start, way, target in joined:
        if start.is_output:
            _link(tree, start, way, target)
        else:
            _set(tree, start, target)
    tree.nodes.remove(group)
    return True


def _by_identifier(sockets) -> dict[str, bpy.types.NodeSocket]:
    return {socket.identifier: socket for socket in sockets if socket.type != "CUSTOM"}


def _copies(tree: bpy.types.NodeTree, inner: bpy.types.NodeTree) -> dict[bpy.types.Node, bpy.types.Node] | None:
    """A copy in `tree` of each node of a group. None if there is one that cannot be copied."""
    copies = {}
    for node in inner.nodes:
        if node.type in ("GROUP_INPUT", "FRAME") or "OUTPUT" in node.type:
            continue
        # Others (zones, closures, menus) have sockets of their own making.
        copy = _copy(tree, node) if node.bl_idname.startswith("ShaderNode") or node.type == "REROUTE" else None
        if copy is not None:
            copies[node] = copy
        if copy is None or any([s.identifier for s in a] != [s.identifier for s in b] for a, b in ((node.inputs, copy.inputs), (node.outputs, copy.outputs))):
            for made in copies.values():
                tree.nodes.remove(made)
            return None
    return copies


def _copy(tree: bpy.types.NodeTree, node: bpy.types.Node) -> bpy.types.Node:
    copy = tree.nodes.new(node.bl_idname)
    _copy_settings(node, copy)
    for old, new in zip((*node.inputs, *node.outputs), (*copy.inputs, *copy.outputs), strict=False):
        if hasattr(old, "default_value") and old.type == new.type:
            new.default_value = old.default_value
    return copy


def _copy_settings(old: bpy.types.bpy_struct, new: bpy.types.bpy_struct) -> None:
    """What is set in a node, or in a part of one (colour ramp, curves, placing of a texture)."""
    for setting in old.bl_rna.properties:
        name = setting.identifier
        if name in _NOT_COPIED or name.startswith("bl_"):
            continue
        value = getattr(old, name)
        if not setting.is_readonly:
            # An enumeration may be at nothing, where nothing can be set.
            if value != getattr(new, name) and not (setting.type == "ENUM" and value == ""):
                setattr(new, name, value)
        elif setting.type == "POINTER" and value is not None:
            _copy_settings(value, getattr(new, name))
        elif name == "elements":
            _copy_points(value, getattr(new, name), lambda elements, each: elements.new(each.position), least=1)
        elif name == "curves":
            for curve, other in zip(value, new.curves, strict=True):
                _copy_points(curve.points, other.points, lambda points, each: points.new(*each.location), least=2)
            new.update()


def _copy_points(old, new, add, least: int) -> None:
    """The stops of a colour ramp or the points of a curve; of neither all can be taken away."""
    while len(new) > least:
        new.remove(new[-1])
    for each in old[least:]:
        add(new, each)
    for each, other in zip(old, new, strict=True):
        _copy_settings(each, other)


def _link(tree: bpy.types.NodeTree, start: bpy.types.NodeSocket, way: tuple[str, ...], target: bpy.types.NodeSocket) -> None:
    """Link an output to an input by way of sockets of some types, which may make a number of a colour."""
    if start.type not in (*SCALARS, "SHADER") and target.type not in SCALARS and any(kind in SCALARS for kind in way):
        number = tree.nodes.new("ShaderNodeMath")
        number.operation, number.inputs[1].default_value = "MULTIPLY", 1.0
        tree.links.new(start, number.inputs[0])
        start = number.outputs[0]
    tree.links.new(start, target)


def _set(tree: bpy.types.NodeTree, start: bpy.types.NodeSocket, target: bpy.types.NodeSocket) -> None:
    """Give an input the value that stands in a socket of a group, in place of the link."""
    for link in list(target.links):
        tree.links.remove(link)
    value = own_value(start)
    if value is None:
        if hasattr(start, "default_value") and start.type == target.type:
            target.default_value = start.default_value
    elif target.node.type == "REROUTE" or (target.hide_value and target.name not in _IMPLICIT):
        # What stands in such a one itself is not used.
        tree.links.new(_node_of(tree, value, start.type), target)
    elif target.type != "SHADER" and not (target.hide_value and target.name in _IMPLICIT):
        put(target, converted(value, start.type, target.type))


def _node_of(tree: bpy.types.NodeTree, value: Constant, kind: str) -> bpy.types.NodeSocket:
    """The output of a new node that is a constant."""
    if kind == "VECTOR":
        node = tree.nodes.new("ShaderNodeCombineXYZ")
        for socket, each in zip(node.inputs, value, strict=True):
            socket.default_value = each
    else:
        node = tree.nodes.new("ShaderNodeRGB" if kind == "RGBA" else "ShaderNodeValue")
        put(node.outputs[0], value)
    return node.outputs[0]
