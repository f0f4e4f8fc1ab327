"""Shader nodes and pictures, for the tests of materials."""

from __future__ import annotations

import numpy as np


def node(shader, kind: str, **settings):
    """A new shader node beside another."""
    made = shader.id_data.nodes.new(f"ShaderNode{kind}")
    for key, value in settings.items():
        setattr(made, key, value)
    return made


def link(start, end):
    """Link an output to an input."""
    end.node.id_data.links.new(start, end)


def picture(blender, colour=(0.5, 0.25, 0.75), space="sRGB", deep=False, **settings):
    """An image of one colour."""
    made = blender.data.images.new("Picture", 4, 4, alpha=True, float_buffer=deep)
    made.colorspace_settings.name = space
    made.pixels.foreach_set(np.tile(np.float32((*colour, 1)), 16))
    made.pack()
    for key, value in settings.items():
        setattr(made, key, value)
    return made


def texture(blender, shader, coordinates=None, image=None, **settings):
    """An image texture, by coordinates or not."""
    made = node(shader, "TexImage", image=image or picture(blender), **settings)
    if coordinates is not None:
        link(coordinates, made.inputs["Vector"])
    return made.outputs["Color"]


def colour_of(blender, gltf, info) -> np.ndarray:
    """The mean colour of a glTF texture, as its file holds it."""
    source = gltf.root["textures"][info["index"]]["source"]
    image = blender.data.images.load(str(gltf.path.parent / gltf.root["images"][source]["uri"]))
    image.colorspace_settings.name = "Non-Color"
    return np.array(image.pixels).reshape(-1, 4)[:, :3].mean(axis=0)


def material_of(gltf) -> dict:
    """The only material."""
    assert len(gltf.root["materials"]) == 1
    return gltf.root["materials"][0]
