"""Bakes procedural base colours to image textures, which is the only form that glTF holds them in.

Works on the temporary export scene: each mesh there is a copy, so UV maps and materials can be added freely.
"""

from __future__ import annotations

from collections.abc import Callable

import bpy

from .materials import procedural_inputs

_UV = "buzz-bake"
# Only what is a colour or a value of the surface itself; a normal cannot be baked through an emission shader.
_BAKED = ("Base Color", "Roughness", "Metallic", "Emission Color")
_DATA = ("Roughness", "Metallic")


def bake_procedural(scene: bpy.types.Scene, size: int, progress: Callable[[str], None]) -> None:
    """Replace procedural inputs of Principled materials by baked images, on every mesh of the scene that has them."""
    jobs = []
    for ob in scene.collection.objects:
        for slot in ob.material_slots:
            inputs = _to_bake(slot.material)
            if inputs:
                jobs.append((ob, slot, inputs))
    if not jobs:
        return
    scene.render.engine = "CYCLES"
    scene.cycles.samples = 1
    scene.cycles.use_denoising = False
    scene.render.bake.margin = 4
    for ob, slot, inputs in jobs:
        progress(f"baking {slot.material.name}: {', '.join(inputs).lower()}")
        _unwrap(scene, ob)
        slot.material = slot.material.copy()
        for name in inputs:
            _bake_input(scene, ob, slot, name, size)


def _to_bake(material: bpy.types.Material | None) -> list[str]:
    tree = material.node_tree if material is not None and material.use_nodes else None
    shader = _principled(tree) if tree else None
    return [name for name in _BAKED if name in procedural_inputs(shader)] if shader else []


def _principled(tree: bpy.types.NodeTree) -> bpy.types.Node | None:
    output = tree.get_output_node("ALL") or tree.get_output_node("CYCLES")
    if output is None or not output.inputs["Surface"].is_linked:
        return None
    node = output.inputs["Surface"].links[0].from_node
    return node if node.type == "BSDF_PRINCIPLED" else None


def _unwrap(scene: bpy.types.Scene, ob: bpy.types.Object) -> None:
    """A UV map of its own for the baked images, without overlaps."""
    if _UV in ob.data.uv_layers:
        return
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
    output = tree.get_output_node("ALL") or tree.get_output_node("CYCLES")
    image = bpy.data.images.new(f"{material.name} {name}", size, size, alpha=False)
    if name in _DATA:
        image.colorspace_settings.name = "Non-Color"
    texture = tree.nodes.new("ShaderNodeTexImage")
    texture.image = image
    uv = tree.nodes.new("ShaderNodeUVMap")
    uv.uv_map = _UV
    tree.links.new(uv.outputs["UV"], texture.inputs["Vector"])
    emission = tree.nodes.new("ShaderNodeEmission")
    socket = shader.inputs[name]
    tree.links.new(socket.links[0].from_socket, emission.inputs["Color"])
    tree.links.new(emission.outputs[0], output.inputs["Surface"])
    tree.nodes.active = texture
    others = []
    for other in ob.material_slots:
        # Every material of the object needs an active image, or Blender refuses to bake.
        if other.slot_index != slot.slot_index and other.material is not None and other.material.node_tree is not None:
            nodes = other.material.node_tree.nodes
            spare = nodes.new("ShaderNodeTexImage")
            spare.image = bpy.data.images.new("spare", 4, 4)
            others.append((nodes, spare, nodes.active))
            nodes.active = spare
    _only(scene, ob)
    ob.data.uv_layers.active = ob.data.uv_layers[_UV]
    bpy.ops.object.bake(type="EMIT", margin=4, use_clear=True, target="IMAGE_TEXTURES")
    for nodes, spare, active in others:
        nodes.remove(spare)
        nodes.active = active
    image.pack()
    tree.nodes.remove(emission)
    tree.links.new(shader.outputs[0], output.inputs["Surface"])
    if name in _DATA:
        # glTF reads metallic from blue and roughness from green; Blender's exporter wants to see that in the nodes.
        split = tree.nodes.new("ShaderNodeSeparateColor")
        tree.links.new(texture.outputs["Color"], split.inputs["Color"])
        tree.links.new(split.outputs["Green" if name == "Roughness" else "Blue"], socket)
    else:
        tree.links.new(texture.outputs["Color"], socket)
