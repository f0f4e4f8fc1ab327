"""Loads a rendered sequence into the compositor as an Image node with all its layers."""

from __future__ import annotations

import re
from pathlib import Path

import bpy

_NUMBER = re.compile(r"^(.*?)(-?\d+)\.exr$")


def load_sequence(scene: bpy.types.Scene, folder: Path) -> list[bpy.types.Node]:
    """One Image node for each sequence of EXR files in `folder` (left and right of a stereo pair are two)."""
    sequences: dict[str, dict[int, Path]] = {}
    for path in sorted(folder.glob("*.exr")):
        match = _NUMBER.match(path.name)
        if match:
            sequences.setdefault(match[1], {})[int(match[2])] = path
    tree = compositor_tree(scene)
    nodes = []
    for i, (name, frames) in enumerate(sorted(sequences.items())):
        first, last = min(frames), max(frames)
        label = f"Buzz {name.rstrip('.')}"
        node = next((n for n in tree.nodes if n.type == "IMAGE" and n.label == label), None) or tree.nodes.new("CompositorNodeImage")
        image = bpy.data.images.load(str(frames[first]), check_existing=True)
        image.source = "SEQUENCE"
        image.reload()
        node.label, node.image = label, image
        node.location = (-400, -400 * i)
        # Blender shows file number frame - frame_start + 1 + frame_offset.
        node.frame_start, node.frame_duration, node.frame_offset = first, last - first + 1, first - 1
        node.use_auto_refresh = True
        nodes.append(node)
    return nodes


def compositor_tree(scene: bpy.types.Scene) -> bpy.types.NodeTree:
    """The scene's compositing nodes, made if there are none. They became a node group in Blender 5.0."""
    if hasattr(scene, "compositing_node_group"):
        if scene.compositing_node_group is None:
            tree = bpy.data.node_groups.new("Compositing", "CompositorNodeTree")
            tree.interface.new_socket("Image", in_out="OUTPUT", socket_type="NodeSocketColor")
            scene.compositing_node_group = tree
        return scene.compositing_node_group
    scene.use_nodes = True
    return scene.node_tree
