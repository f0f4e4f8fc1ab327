"""Bakes procedural inputs of materials to image textures, which is the only form that glTF holds them in.

Works on the temporary export scene: each mesh there is a copy, so UV maps and materials can be added freely.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable

import bpy
import numpy as np

from ..common.srgb import encoded
from .materials import CUT_OFF, DEFORMED, PLACED, make_plain, output_of
from .nodes import PAIRS, is_generated, placed, unreadable_inputs

_UV = "buzz-bake"
# How many a mesh of Blender's may have.
_MOST_UVS = 8
# Only what is a colour or a value of the surface itself; a normal cannot be baked through an emission shader.
_COLOURS = ("Base Color", "Emission Color")
# Values, and the channel that glTF reads each from; Blender's exporter wants to see it in the nodes.
_VALUES = {"Metallic": "Blue", "Roughness": "Green", "Alpha": "Red", "Transmission Weight": "Red", "Coat Weight": "Red", "Coat Roughness": "Green"}


def bake_procedural(scene: bpy.types.Scene, size: int, progress: Callable[[str], None]) -> None:
    """Replace procedural inputs of Principled materials by baked images, on every mesh of the scene that has them."""
    slots = [(ob, slot) for ob in scene.collection.objects for slot in ob.material_slots if slot.material.use_nodes]
    for material in {slot.material for _, slot in slots}:
        make_plain(material.node_tree)
    jobs = [(ob, slot, inputs) for ob, slot in slots if (inputs := _to_bake(ob, slot.material))]
    if not jobs:
        return
    users = Counter(slot.material for _, slot in slots)
    scene.render.engine = "CYCLES"
    scene.cycles.samples = 1
    scene.cycles.use_denoising = False
    scene.render.bake.margin = 4
    for ob, slot, inputs in jobs:
        if not _unwrap(scene, ob):
            # It is named with what else is not baked.
            continue
        progress(f"baking {slot.material.name}: {', '.join(inputs).lower()}")
        if users[slot.material] > 1:
            slot.material = slot.material.copy()
        for name in inputs:
            _bake_input(scene, ob, slot, name, size)


def _to_bake(ob: bpy.types.Object, material: bpy.types.Material) -> list[str]:
    """Inputs that have to be baked on an object, for what Blender's exporter reads of their nodes is not what they show."""
    shader = _principled(material.node_tree)
    if shader is None:
        return []
    found = set(unreadable_inputs(shader, [ob.data]))
    if "Emission Strength" in found:
        # An emission is baked as a whole.
        found.add("Emission Color")
    for pair in PAIRS:
        if found & set(pair):
            # One texture in one place holds both.
            found |= {name for name in pair if shader.inputs[name].is_linked}
    return [name for name in (*_COLOURS, *_VALUES) if name in found]


def _principled(tree: bpy.types.NodeTree) -> bpy.types.Node | None:
    node = output_of(tree).inputs["Surface"].links[0].from_node
    return node if node.type == "BSDF_PRINCIPLED" else None


def _unwrap(scene: bpy.types.Scene, ob: bpy.types.Object) -> bool:
    """Make a UV map of its own for the baked images, without overlaps; whether there is room for one."""
    if _UV in ob.data.uv_layers:
        return True
    if len(ob.data.uv_layers) >= _MOST_UVS:
        spare = _unused_uv(ob)
        if spare is None:
            return False
        ob.data.uv_layers.remove(spare)
    # Names, not layers: adding one moves the others in memory.
    active = ob.data.uv_layers.active.name if ob.data.uv_layers.active else None
    ob.data.uv_layers.new(name=_UV, do_init=True)
    ob.data.uv_layers.active = ob.data.uv_layers[_UV]
    _only(scene, ob)
    bpy.ops.object.mode_set(mode="EDIT")
    bpy.ops.mesh.select_all(action="SELECT")
    bpy.ops.uv.smart_project(angle_limit=1.15, island_margin=0.005)
    bpy.ops.object.mode_set(mode="OBJECT")
    if active is not None:
        # What other textures use (the render layer) must stay what it was.
        ob.data.uv_layers.active = ob.data.uv_layers[active]
    return True


def _unused_uv(ob: bpy.types.Object) -> bpy.types.MeshUVLoopLayer | None:
    """A UV map that no material of an object asks for."""
    nodes = [node for slot in ob.material_slots if slot.material.node_tree is not None for node in slot.material.node_tree.nodes]
    asked = {getattr(node, key, "") for node in nodes for key in ("uv_map", "attribute_name")}
    return next((layer for layer in ob.data.uv_layers if not layer.active_render and layer.name not in asked), None)


def _only(scene: bpy.types.Scene, ob: bpy.types.Object) -> None:
    view_layer = scene.view_layers[0]
    for other in view_layer.objects:
        other.select_set(other == ob, view_layer=view_layer)
    view_layer.objects.active = ob


def _bake_input(scene: bpy.types.Scene, ob: bpy.types.Object, slot: bpy.types.MaterialSlot, name: str, size: int) -> None:
    """Send one input through an emission shader into an image, then read that image instead."""
    material = slot.material
    tree = material.node_tree
    shader = _principled(tree)
    output = output_of(tree)
    socket = shader.inputs[name]
    texture = tree.nodes.new("ShaderNodeTexImage")
    # Colours may be brighter than an image can hold.
    texture.image = bpy.data.images.new(f"{material.name}-{name.replace(' ', '')}", size, size, alpha=False, float_buffer=name in _COLOURS)
    if name in _VALUES:
        texture.image.colorspace_settings.name = "Non-Color"
    uv = tree.nodes.new("ShaderNodeUVMap")
    uv.uv_map = _UV
    tree.links.new(uv.outputs["UV"], texture.inputs["Vector"])
    emission = tree.nodes.new("ShaderNodeEmission")
    _move(tree, socket, emission.inputs["Color"])
    if name == "Emission Color":
        _move(tree, shader.inputs["Emission Strength"], emission.inputs["Strength"])
    if what := placed(emission.inputs["Color"]) or placed(emission.inputs["Strength"]):
        texture[PLACED] = what
    if DEFORMED in ob.data and (is_generated(emission.inputs["Color"]) or is_generated(emission.inputs["Strength"])):
        texture[DEFORMED] = True
    tree.links.new(emission.outputs[0], output.inputs["Surface"])
    tree.nodes.active = texture
    _bake(scene, ob, slot)
    tree.nodes.remove(emission)
    tree.links.new(shader.outputs[0], output.inputs["Surface"])
    if name in _COLOURS:
        brightest = _brightest(texture.image)
        if name == "Emission Color":
            shader.inputs["Emission Strength"].default_value = brightest
        elif brightest > 1.01:
            texture[CUT_OFF] = True
        texture.image = _encoded(texture.image, brightest if name == "Emission Color" else 1.0)
    texture.image.pack()
    if name in _VALUES:
        split = tree.nodes.new("ShaderNodeSeparateColor")
        tree.links.new(texture.outputs["Color"], split.inputs["Color"])
        tree.links.new(split.outputs[_VALUES[name]], socket)
    else:
        tree.links.new(texture.outputs["Color"], socket)


def _move(tree: bpy.types.NodeTree, old: bpy.types.NodeSocket, new: bpy.types.NodeSocket) -> None:
    """Give an input what another one is linked to, or its constant."""
    if old.is_linked:
        tree.links.new(old.links[0].from_socket, new)
        tree.links.remove(old.links[0])
    else:
        new.default_value = old.default_value


def _bake(scene: bpy.types.Scene, ob: bpy.types.Object, slot: bpy.types.MaterialSlot) -> None:
    """Bake what the object emits into the active image of the slot's material."""
    others = []
    for other in ob.material_slots:
        # Every material of the object needs an active image, or Blender refuses to bake.
        if other.slot_index != slot.slot_index and other.material.node_tree is not None:
            nodes = other.material.node_tree.nodes
            spare = nodes.new("ShaderNodeTexImage")
            spare.image = bpy.data.images.new("spare", 4, 4)
            others.append((nodes, spare, nodes.active))
            nodes.active = spare
    _only(scene, ob)
    ob.data.uv_layers.active = ob.data.uv_layers[_UV]
    # Blender looks at the mesh's texture mesh only where a modifier is on it.
    idle = ob.modifiers.new("idle", "SIMPLE_DEFORM")
    idle.angle = 0
    bpy.ops.object.bake(type="EMIT", margin=4, use_clear=True, target="IMAGE_TEXTURES")
    ob.modifiers.remove(idle)
    for nodes, spare, active in others:
        nodes.remove(spare)
        nodes.active = active


def _brightest(deep: bpy.types.Image) -> float:
    """The highest value of a colour in an image; 1 if all is black."""
    return max(float(_pixels(deep)[:, :3].max()), 0.0) or 1.0


def _encoded(deep: bpy.types.Image, factor: float) -> bpy.types.Image:
    """An image of 8 bits, as glTF has them, that holds the colours of a deep one divided by a factor."""
    pixels = _pixels(deep)
    pixels[:, :3] = encoded(np.clip(pixels[:, :3] / factor, 0.0, 1.0))
    image = bpy.data.images.new(deep.name, *deep.size, alpha=False)
    image.pixels.foreach_set(pixels.reshape(-1))
    return image


def _pixels(image: bpy.types.Image) -> np.ndarray:
    pixels = np.empty(len(image.pixels), dtype=np.float32)
    image.pixels.foreach_get(pixels)
    return pixels.reshape(-1, image.channels)
