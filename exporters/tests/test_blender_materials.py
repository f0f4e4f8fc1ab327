"""Materials: what Blender's glTF exporter reads of their nodes, what is baked and what is named."""

from __future__ import annotations

import numpy as np
import pytest
from blender_nodes import colour_of, link, material_of, node, picture, texture


def by(output):
    """An image by some texture coordinates."""
    return lambda blender, shader: texture(blender, shader, node(shader, "TexCoord").outputs[output])


def mapped(kind="POINT", turn=0.0):
    """An image by UV coordinates through a Mapping node."""

    def build(blender, shader):
        mapping = node(shader, "Mapping", vector_type=kind)
        mapping.inputs["Rotation"].default_value[0] = turn
        mapping.inputs["Scale"].default_value = (2, 3, 1)
        link(node(shader, "UVMap").outputs[0], mapping.inputs["Vector"])
        return texture(blender, shader, mapping.outputs[0])

    return build


def mixed(blend="MULTIPLY", factor=1.0, second=(1, 0.5, 0.2, 1)):
    """An image mixed with a colour, or with another node."""

    def build(blender, shader):
        mix = node(shader, "Mix", data_type="RGBA", blend_type=blend)
        mix.inputs[0].default_value = factor
        link(texture(blender, shader), mix.inputs[6])
        if isinstance(second, tuple):
            mix.inputs[7].default_value = second
        else:
            link(second(blender, shader), mix.inputs[7])
        return mix.outputs[2]

    return build


def tinted(blender, shader):
    """A constant x a colour attribute x an image."""
    mix = node(shader, "Mix", data_type="RGBA", blend_type="MULTIPLY")
    mix.inputs[0].default_value, mix.inputs[6].default_value = 1, (0.5, 0.5, 0.5, 1)
    link(mixed(second=lambda _, s: node(s, "VertexColor", layer_name="Tint").outputs["Color"])(blender, shader), mix.inputs[7])
    return mix.outputs[2]


def muted(blender, shader):
    """A product that is switched off."""
    out = mixed()(blender, shader)
    out.node.mute = True
    return out


def tiled(blender, shader):
    """A UDIM."""
    made = blender.data.images.new("Tiles", 4, 4, tiled=True)
    made.tiles.new(1002)
    return texture(blender, shader, image=made)


def cut_out(blender, shader, output="Color", **settings):
    """An output of an image that is transparent on one side."""
    image = picture(blender, **settings)
    pixels = np.array(image.pixels)
    pixels[3::8] = 0
    image.pixels.foreach_set(np.float32(pixels))
    image.pack()
    return texture(blender, shader, image=image).node.outputs[output]


UNREADABLE = {
    "transparent": (cut_out, "a transparent image without its alpha"),
    "generated": (by("Generated"), "an image by generated coordinates"),
    "object": (by("Object"), "an image by object coordinates"),
    "window": (by("Window"), "an image by window coordinates"),
    "reflection": (by("Reflection"), "an image by reflection coordinates"),
    "normal": (by("Normal"), "an image by normal coordinates"),
    "box": (lambda b, s: texture(b, s, projection="BOX"), "an image in box projection"),
    "tube": (lambda b, s: texture(b, s, projection="TUBE"), "an image in tube projection"),
    "clip": (lambda b, s: texture(b, s, extension="CLIP"), "an image with clipped edges"),
    "mapping texture": (mapped("TEXTURE"), "a mapping node of type texture"),
    "mapping vector": (mapped("VECTOR"), "a mapping node of type vector"),
    "mapping about x": (mapped(turn=0.5), "a mapping node of type point"),
    "non-color": (lambda b, s: texture(b, s, image=picture(b, space="Non-Color")), "an image in Non-Color as a colour"),
    "linear": (lambda b, s: texture(b, s, image=picture(b, space="Linear Rec.709", deep=True)), "an image in Linear Rec.709 as a colour"),
    "empty": (lambda b, s: node(s, "TexImage").outputs[0], "an image node that is off or empty"),
    "udim": (tiled, "a tiled image (UDIM)"),
    "mix": (mixed("MIX", 0.75), "mix node"),
    "two images": (mixed(second=lambda b, s: texture(b, s)), "mix node"),
    "half multiplied": (mixed(factor=0.5), "mix node"),
    "brightened": (mixed(second=(2, 2, 2, 1)), "mix node"),
    "muted": (muted, "mix node"),
    "attribute that is none": (lambda _, s: node(s, "Attribute", attribute_name="Nothing").outputs["Color"], "attribute node"),
}
READABLE = {
    "plain": texture,
    "packed channels": lambda b, s: cut_out(b, s, alpha_mode="CHANNEL_PACKED"),
    "uv": by("UV"),
    "uv map": lambda b, s: texture(b, s, node(s, "UVMap", uv_map="UVMap").outputs[0]),
    "mapping": mapped(),
    "mirrored": lambda b, s: texture(b, s, extension="MIRROR"),
    "multiplied": mixed(),
    "tinted": tinted,
    "attribute": lambda _, s: node(s, "Attribute", attribute_name="Tint").outputs["Color"],
}


@pytest.mark.parametrize("case", UNREADABLE)
def test_colours_that_are_read_wrongly_are_named_or_baked(blender, surface, export, case):
    build, _ = UNREADABLE[case]
    link(build(blender, surface), surface.inputs["Base Color"])
    baked = export(bake=16)
    assert baked.root["images"][0]["name"] == "Grey-BaseColor"
    assert material_of(baked)["name"] == "Grey", "one user: no copy"
    assert [f for f in baked.lost_features("Grey") if f.startswith("procedural")] == []


@pytest.mark.parametrize("case", UNREADABLE)
def test_colours_that_are_read_wrongly_are_named_without_baking(blender, surface, export, case):
    build, reason = UNREADABLE[case]
    link(build(blender, surface), surface.inputs["Base Color"])
    assert f"procedural base color ({reason})" in export(bake=0).lost_features("Grey")


@pytest.mark.parametrize("case", READABLE)
def test_colours_that_are_read_rightly_stay(blender, surface, export, case):
    link(READABLE[case](blender, surface), surface.inputs["Base Color"])
    gltf = export(bake=16)
    assert not gltf.lost.items
    assert [i["name"] for i in gltf.root.get("images", [])] == ([] if case == "attribute" else ["Picture"])


@pytest.mark.parametrize("case", ["non-color", "linear", "mix"])
def test_baked_colours(blender, surface, export, case):
    build, _ = UNREADABLE[case]
    link(build(blender, surface), surface.inputs["Base Color"])
    linear = np.array([0.5, 0.25, 0.75])
    if case == "mix":
        linear = 0.25 * ((linear + 0.055) / 1.055) ** 2.4 + 0.75 * np.array([1, 0.5, 0.2])
    gltf = export(bake=16)
    # The square fills its UV map but for a margin of black; the proportions are what counts.
    got = colour_of(blender, gltf, material_of(gltf)["pbrMetallicRoughness"]["baseColorTexture"])
    want = 1.055 * linear ** (1 / 2.4) - 0.055
    np.testing.assert_allclose(got / got.max(), want / want.max(), atol=0.01)


def test_emission_strength_from_an_image_is_baked(blender, surface, export):
    out = texture(blender, surface, image=picture(blender, (0.5, 0.5, 0.5), "Non-Color"))
    factor = node(surface, "Math", operation="MULTIPLY")
    factor.inputs[1].default_value = 8
    link(out, factor.inputs[0])
    link(factor.outputs[0], surface.inputs["Emission Strength"])
    surface.inputs["Emission Color"].default_value = (1, 0.5, 0, 1)
    material = material_of(export(bake=16))
    assert material["extensions"]["KHR_materials_emissive_strength"]["emissiveStrength"] == pytest.approx(4, rel=0.01)
    assert "emissiveTexture" in material


def shine_by_generated(surface):
    """A surface that shines as far as its generated coordinates reach in X."""
    split = node(surface, "SeparateXYZ")
    link(node(surface, "TexCoord").outputs["Generated"], split.inputs[0])
    link(split.outputs["X"], surface.inputs["Emission Color"])
    surface.inputs["Emission Strength"].default_value = 1


def test_generated_coordinates_are_of_the_mesh_before_its_modifiers(blender, surface, export):
    array = blender.data.objects["Square"].modifiers.new("Array", "ARRAY")
    array.count, array.relative_offset_displace = 3, (1.2, 0, 0)
    shine_by_generated(surface)
    gltf = export(bake=64)
    assert material_of(gltf)["extensions"]["KHR_materials_emissive_strength"]["emissiveStrength"] == pytest.approx(3.4, rel=0.05)
    assert gltf.lost_features("Grey") == []


@pytest.mark.parametrize("bent", ["modifier", "shape key", "welded"])
def test_generated_coordinates_are_of_the_mesh_before_it_is_deformed(blender, surface, export, bent):
    import blender_scene as b

    ob = blender.data.objects["Square"]
    if bent == "modifier":
        ob.modifiers.new("Displace", "DISPLACE").direction = "X"
        b.key(ob.modifiers[0], "strength", {1: 4, 2: 8})
    else:
        ob.shape_key_add(name="Basis")
        key = ob.shape_key_add(name="Key")
        key.value = 1
        key.data[1].co.x += 2
        key.data[2].co = key.data[1].co if bent == "welded" else (3, 1, 0)
        ob.modifiers.new("Weld", "WELD")
    shine_by_generated(surface)
    # A texture that is given no coordinates takes these.
    link(node(surface, "TexNoise").outputs["Color"], surface.inputs["Base Color"])
    gltf = export(bake=64)
    strength = material_of(gltf)["extensions"].get("KHR_materials_emissive_strength", {}).get("emissiveStrength", 1)
    # Without the key there is another mesh.
    lost = [f"{name} color by generated coordinates of a mesh that is deformed" for name in ("base", "emission") if bent == "welded"]
    assert gltf.lost_features("Grey") == lost
    assert strength == pytest.approx(2 if lost else 1, rel=0.05)


def test_emission_strength_from_an_image_is_named_without_baking(blender, surface, export):
    link(texture(blender, surface), surface.inputs["Emission Strength"])
    assert export(bake=0).lost_features("Grey") == ["procedural emission strength (image node)"]


@pytest.mark.parametrize("bake", [0, 16])
def test_emission_shader_of_a_procedural_colour(blender, surface, export, bake):
    emission = node(surface, "Emission")
    link(node(surface, "TexChecker").outputs["Color"], emission.inputs["Color"])
    link(emission.outputs[0], surface.id_data.get_output_node("ALL").inputs["Surface"])
    gltf = export(bake=bake)
    assert ("emissiveTexture" in material_of(gltf)) == bool(bake)
    assert gltf.lost_features("Grey") == ([] if bake else ["procedural emission color (checker node)"])
    assert material_of(gltf)["pbrMetallicRoughness"]["baseColorFactor"] == [0, 0, 0, 1]


def test_values(blender, surface, export):
    """A channel of a data image times a constant is read; sRGB data and coloured images are baked."""
    split, factor = node(surface, "SeparateColor"), node(surface, "Math", operation="MULTIPLY")
    factor.inputs[1].default_value = 0.5
    link(texture(blender, surface, image=picture(blender, space="Non-Color")), split.inputs[0])
    link(split.outputs["Green"], factor.inputs[0])
    link(factor.outputs[0], surface.inputs["Roughness"])
    gltf = export(bake=16)
    assert not gltf.lost.items
    assert material_of(gltf)["pbrMetallicRoughness"]["roughnessFactor"] == 0.5
    for space, reason in (("Non-Color", "a coloured image as a value"), ("sRGB", "an image in sRGB as data")):
        colour = (0.5, 0.25, 0.75) if space == "Non-Color" else (0.5, 0.5, 0.5)
        link(texture(blender, surface, image=picture(blender, colour, space)), surface.inputs["Roughness"])
        assert export(bake=0).lost_features("Grey") == [f"procedural roughness ({reason})"]


def test_what_shares_a_texture_is_baked_together(blender, surface, export):
    """A metallic of noise lies on its own UV map; the roughness, in the same glTF texture, has to follow."""
    link(node(surface, "TexNoise").outputs[0], surface.inputs["Metallic"])
    link(texture(blender, surface, image=picture(blender, (0.5, 0.5, 0.5), "Non-Color")), surface.inputs["Roughness"])
    gltf = export(bake=16)
    names = gltf.root["images"][0]["name"]
    assert "Grey-Metallic" in names
    assert "Grey-Roughness" in names


@pytest.mark.parametrize("asked", [False, True])
def test_a_mesh_that_has_all_uv_maps_gives_up_one_for_baking(blender, surface, export, asked):
    mesh = blender.data.objects["Square"].data
    for i in range(7):
        name = mesh.uv_layers.new(name=f"Map {i}").name
        if asked:
            node(surface, "UVMap", uv_map=name)
    link(node(surface, "TexNoise").outputs["Color"], surface.inputs["Base Color"])
    gltf = export(bake=16)
    assert ("baseColorTexture" in material_of(gltf)["pbrMetallicRoughness"]) != asked
    assert gltf.lost_features("Grey") == (["procedural base color (noise node)"] if asked else [])


@pytest.mark.parametrize(("mode", "names"), [("STRAIGHT", ["Picture"]), ("NONE", ["Grey-Alpha"])])
def test_alpha_that_is_off_is_baked(blender, surface, export, mode, names):
    link(cut_out(blender, surface, "Alpha", alpha_mode=mode), surface.inputs["Alpha"])
    gltf = export(bake=16)
    assert [i["name"] for i in gltf.root["images"]] == names


def test_alpha_clip_is_read(blender, surface, export):
    """1 - (x < cutoff), as Blender's importer writes it."""
    image = texture(blender, surface).node
    below, rest = node(surface, "Math", operation="LESS_THAN"), node(surface, "Math", operation="SUBTRACT")
    below.inputs[1].default_value, rest.inputs[0].default_value = 0.25, 1
    link(image.outputs["Alpha"], below.inputs[0])
    link(below.outputs[0], rest.inputs[1])
    link(rest.outputs[0], surface.inputs["Alpha"])
    gltf = export(bake=16)
    assert not gltf.lost.items
    assert (material_of(gltf)["alphaMode"], material_of(gltf)["alphaCutoff"]) == ("MASK", 0.25)


@pytest.mark.parametrize(("kind", "output", "label"), [
    ("ObjectInfo", "Random", "object info node"),
    ("NewGeometry", "Position", "new geometry node"),
    ("NewGeometry", "Backfacing", "new geometry node"),
    ("TexCoord", "Window", "coord node"),
])  # fmt: skip
def test_what_depends_on_the_place_is_named(blender, surface, export, kind, output, label):
    """Through a node group, for that is how it usually comes."""
    group = blender.data.node_groups.new("Tint", "ShaderNodeTree")
    group.interface.new_socket("Color", in_out="OUTPUT", socket_type="NodeSocketColor")
    group.links.new(group.nodes.new(f"ShaderNode{kind}").outputs[output], group.nodes.new("NodeGroupOutput").inputs[0])
    user = node(surface, "Group", node_tree=group)
    link(user.outputs[0], surface.inputs["Base Color"])
    link(user.outputs[0], surface.inputs["Roughness"])
    features = export(bake=16).lost_features("Grey")
    assert features == [f"{name} that depends on the object's place or the view ({label})" for name in ("base color", "roughness")]


def test_animation_in_a_node_group_is_named(blender, surface, export):
    group = blender.data.node_groups.new("Pulse", "ShaderNodeTree")
    group.interface.new_socket("Color", in_out="OUTPUT", socket_type="NodeSocketColor")
    colour = group.nodes.new("ShaderNodeRGB")
    group.links.new(colour.outputs[0], group.nodes.new("NodeGroupOutput").inputs[0])
    colour.outputs[0].keyframe_insert("default_value", frame=1)
    link(node(surface, "Group", node_tree=group).outputs[0], surface.inputs["Base Color"])
    assert export(bake=16).lost_features("Grey") == ["animated material"]


def test_animated_material_keeps_the_values_of_the_first_frame(blender, surface, export):
    import blender_scene as b

    b.key(surface.inputs["Metallic"], "default_value", {1: 0.0, 5: 0.5})
    blender.context.scene.frame_start, blender.context.scene.frame_end = 5, 6
    gltf = export(bake=0)
    assert gltf.lost_features("Grey") == ["animated material"]
    assert material_of(gltf)["pbrMetallicRoughness"]["metallicFactor"] == 0.5


def test_image_sequence_shows_its_first_frame(blender, surface, export, tmp_path):
    for number, colour in ((1, (1, 0, 0)), (2, (0, 1, 0))):
        frame = picture(blender, colour)
        frame.filepath_raw, frame.file_format = str(tmp_path / f"s{number:04d}.png"), "PNG"
        frame.save()
    image = blender.data.images.load(str(tmp_path / "s0001.png"))
    image.source = "SEQUENCE"
    link(texture(blender, surface, image=image), surface.inputs["Base Color"])
    gltf = export(bake=16)
    assert gltf.lost_features("Grey") == ["image 's0001.png' is a movie"]
    np.testing.assert_allclose(colour_of(blender, gltf, material_of(gltf)["pbrMetallicRoughness"]["baseColorTexture"]), (1, 0, 0), atol=0.01)


def test_volume_without_a_surface_is_not_seen(blender, surface, export):
    tree = surface.id_data
    tree.nodes.remove(surface)
    fog = tree.nodes.new("ShaderNodeVolumePrincipled")
    tree.links.new(fog.outputs[0], tree.get_output_node("ALL").inputs["Volume"])
    gltf = export()
    assert gltf.lost_features("Grey") == ["volume shader"]
    assert material_of(gltf)["pbrMetallicRoughness"]["baseColorFactor"][3] == 0
    assert material_of(gltf)["alphaMode"] == "MASK"


def test_surface_of_nothing_is_black(blender, surface, export):
    surface.id_data.nodes.clear()
    assert material_of(export())["pbrMetallicRoughness"]["baseColorFactor"] == [0, 0, 0, 1]


@pytest.mark.parametrize("space", ["OBJECT", "WORLD"])
def test_normal_maps_of_other_spaces_are_named(blender, surface, export, space):
    normal = node(surface, "NormalMap", space=space)
    link(texture(blender, surface, image=picture(blender, space="Non-Color")), normal.inputs["Color"])
    link(normal.outputs[0], surface.inputs["Normal"])
    gltf = export()
    assert gltf.lost_features("Grey") == [f"procedural normal (a normal map in {space.lower()} space)"]
    assert "normalTexture" not in material_of(gltf)


def test_constant_nodes_are_folded(blender, surface, export):
    """The exporter does not look for them behind a transmission, nor for what is calculated of them."""
    value, less = node(surface, "Value"), node(surface, "Math", operation="SUBTRACT")
    value.outputs[0].default_value = 0.5
    less.inputs[0].default_value = 1
    link(value.outputs[0], surface.inputs["Transmission Weight"])
    link(value.outputs[0], less.inputs[1])
    link(less.outputs[0], surface.inputs["Base Color"])
    gltf = export(bake=0)
    assert not gltf.lost.items
    assert material_of(gltf)["pbrMetallicRoughness"]["baseColorFactor"] == [0.5, 0.5, 0.5, 1]
    assert material_of(gltf)["extensions"]["KHR_materials_transmission"]["transmissionFactor"] == 0.5


def test_what_is_muted_is_passed_over(blender, surface, export):
    tree = surface.id_data
    end = surface.outputs[0].links[0].to_socket
    surface.inputs["Base Color"].default_value = (0, 1, 0, 1)
    mix = node(surface, "MixShader", mute=True)
    link(surface.outputs[0], mix.inputs[1])
    link(node(surface, "Emission").outputs[0], mix.inputs[2])
    tree.links.new(mix.outputs[0], end)
    gltf = export()
    assert material_of(gltf)["pbrMetallicRoughness"]["baseColorFactor"] == [0, 1, 0, 1]
    assert gltf.lost_features("Grey") == []


def test_a_muted_shader_is_black(blender, surface, export):
    surface.mute = True
    assert material_of(export())["pbrMetallicRoughness"]["baseColorFactor"] == [0, 0, 0, 1]
