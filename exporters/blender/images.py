"""Names of images: Blender's exporter makes file names of them, as they are."""

from __future__ import annotations

import ntpath
import re

import bpy

from .nodes import trees

# What some system has no file names with.
_FORBIDDEN = re.compile(r'[<>:"/\\|?*\x00-\x1f]')
# Bytes: of images that go into one texture, the exporter joins the names.
_LONGEST = 100


def name_as_files(materials: list[bpy.types.Material]) -> dict[str, str]:
    """Give the images of materials names that any system has files by; the artist's names by those of the exporter."""
    artist = {}
    users: dict[bpy.types.Image, list[bpy.types.Node]] = {}
    for tree in dict.fromkeys(each for material in materials if material.node_tree for each in trees(material.node_tree)):
        for node in tree.nodes:
            if node.type == "TEX_IMAGE" and node.image is not None:
                users.setdefault(node.image, []).append(node)
    for image, nodes in users.items():
        called = image.name
        name = _FORBIDDEN.sub("_", called).lstrip(". ").encode()[:_LONGEST].decode(errors="ignore") or "image"
        if name != called:
            if image.library:
                # Its name belongs to another file.
                image = image.copy()
                for node in nodes:
                    node.image = image
            image.name = name
            artist[_stem(image.name)] = _stem(called)
        if image.packed_file and image.source == "FILE":
            # The exporter prefers the name of the file that was packed, perhaps on another system.
            image.filepath_raw = _FORBIDDEN.sub("_", ntpath.basename(image.filepath_raw))
    return artist


def _stem(name: str) -> str:
    return ntpath.splitext(name)[0]
