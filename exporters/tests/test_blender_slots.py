"""Materials of objects: in slots, overridden, of plain shaders, procedural, none."""

from __future__ import annotations

import numpy as np
import pytest


def test_procedural_colour_is_baked(blender, export):
    import blender_scene as b

    b.camera()
    ob = b.plane("Checked")
    made, shader = b.material()
    checker = made.node_tree.nodes.new("ShaderNodeTexChecker")
    checker.inputs["Color1"].default_value = (1, 0, 0, 1)
    checker.inputs["Color2"].default_value = (0, 0, 1, 1)
    made.node_tree.links.new(checker.outputs["Color"], shader.inputs["Base Color"])
    ob.data.materials.append(made)
    gltf = export(bake=64)
    assert "baseColorTexture" in gltf.root["materials"][0]["pbrMetallicRoughness"]
    assert not gltf.lost_features("Grey")
    path = gltf.path.parent / gltf.root["images"][0]["uri"]
    image = blender.data.images.load(str(path))
    pixels = np.array(image.pixels).reshape(-1, 4)
    assert (pixels[:, 0] > 0.9).sum() > 500
    assert (pixels[:, 2] > 0.9).sum() > 500


def test_procedural_colour_is_named_without_baking(blender, export):
    import blender_scene as b

    b.camera()
    ob = b.plane("Noisy")
    made, shader = b.material()
    noise = made.node_tree.nodes.new("ShaderNodeTexNoise")
    made.node_tree.links.new(noise.outputs["Color"], shader.inputs["Base Color"])
    ob.data.materials.append(made)
    assert export(bake=0).lost_features("Grey") == ["procedural base color (noise node)"]


@pytest.mark.parametrize(("shader", "check"), [
    ("ShaderNodeBsdfDiffuse", lambda m: m["pbrMetallicRoughness"]["baseColorFactor"][:3] == pytest.approx([0.1, 0.2, 0.3], abs=1e-6)),
    ("ShaderNodeBsdfAnisotropic", lambda m: m["pbrMetallicRoughness"].get("metallicFactor", 1) == 1),
    ("ShaderNodeBsdfGlass", lambda m: m["extensions"]["KHR_materials_transmission"]["transmissionFactor"] == 1),
])  # fmt: skip
def test_plain_shaders_become_principled(blender, export, shader, check):
    import blender_scene as b

    b.camera()
    ob = b.cube()
    made, _old = b.material()
    tree = made.node_tree
    new = tree.nodes.new(shader)
    new.inputs["Color"].default_value = (0.1, 0.2, 0.3, 1)
    output = tree.get_output_node("ALL")
    tree.links.new(new.outputs[0], output.inputs["Surface"])
    ob.data.materials.append(made)
    assert check(export().root["materials"][0])


def test_mixed_shaders_are_named(blender, export):
    import blender_scene as b

    b.camera()
    ob = b.cube()
    made, _ = b.material()
    tree = made.node_tree
    mix = tree.nodes.new("ShaderNodeMixShader")
    tree.links.new(mix.outputs[0], tree.get_output_node("ALL").inputs["Surface"])
    ob.data.materials.append(made)
    assert export().lost_features("Grey") == ["Mix Shader shader"]


@pytest.mark.parametrize("own", ["A", "B"])
def test_materials_of_slots_of_the_object(blender, export, own):
    import blender_scene as b

    b.camera()
    first, second = b.material("Red", (1, 0, 0))[0], b.material("Blue", (0, 0, 1))[0]
    a = b.cube("A")
    a.data.materials.append(first)
    other = b.link(blender.data.objects.new("B", a.data))
    other.location = (3, 0, 0)
    slot = blender.data.objects[own].material_slots[0]
    slot.link, slot.material = "OBJECT", second
    gltf = export()
    used = {}
    for name in ("A", "B"):
        mesh = gltf.root["meshes"][gltf.root["nodes"][gltf.node(name)]["mesh"]]
        used[name] = gltf.root["materials"][mesh["primitives"][0]["material"]]["name"]
    assert used == {"A": "Red", "B": "Red", own: "Blue"}


def test_what_has_no_material_is_as_in_blender(blender, export):
    """No slot, an empty slot beside a full one, text, and an instance: base colour 0.8, no metal."""
    import blender_scene as b

    b.camera()
    bare = b.cube("Bare")
    half = b.cube("Half")
    half.data.materials.append(b.material()[0])
    half.data.materials.append(None)
    half.data.polygons[0].material_index = 1
    text = b.link(blender.data.objects.new("Text", blender.data.curves.new("Text", "FONT")))
    text.data.body, text.data.extrude = "a", 0.1
    collection = blender.data.collections.new("Kept")
    collection.objects.link(b.mesh("Inside", [(0, 0, 0), (1, 0, 0), (0, 1, 0)], [(0, 1, 2)]))
    empty = b.link(blender.data.objects.new("Instance", None))
    empty.instance_type, empty.instance_collection = "COLLECTION", collection
    bare.data.color_attributes.new("Tint", "BYTE_COLOR", "CORNER").data.foreach_set("color", [0.0] * 24 * 4)
    gltf = export()
    used = [p["material"] for m in gltf.root["meshes"] for p in m["primitives"]]
    assert sorted(gltf.root["materials"][i]["name"] for i in set(used)) == ["Default Surface", "Grey"]
    shader = next(m for m in gltf.root["materials"] if m["name"] == "Default Surface")["pbrMetallicRoughness"]
    assert shader["baseColorFactor"] == pytest.approx([0.8, 0.8, 0.8, 1])
    assert (shader["metallicFactor"], shader.get("roughnessFactor")) == (0, 0.5)
    # Blender's exporter adds white colours, so that the others count for nothing.
    colours = {p["attributes"]["COLOR_0"] for m in gltf.root["meshes"] for p in m["primitives"] if "COLOR_0" in p["attributes"]}
    assert [np.unique(gltf.accessor(i)).tolist() for i in colours] == [[255]]


def test_material_override(blender, export):
    import blender_scene as b

    b.camera()
    b.cube("Bare")
    b.cube("Full").data.materials.append(b.material()[0])
    blender.context.view_layer.material_override = b.material("Clay")[0]
    assert [m["name"] for m in export().root["materials"]] == ["Clay"]
