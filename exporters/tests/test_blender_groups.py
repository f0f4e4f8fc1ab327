"""Materials through node groups: the same as without that detour."""

from __future__ import annotations

import pytest
from test_blender_materials import link, material_of, node, picture, texture


@pytest.fixture
def result(blender, export):
    """Export and give what a file holds of the only material: its values, images and losses."""

    def run(name: str, bake: int = 16):
        gltf = export(f"{name}.gltf", bake=bake)
        return material_of(gltf), [image["name"] for image in gltf.root.get("images", [])], gltf.lost_features("Grey")

    return run


def group(blender, name="Group", **sockets):
    """A node group with sockets {name: (in or out, kind)}; its input and output nodes."""
    made = blender.data.node_groups.new(name, "ShaderNodeTree")
    for each, (way, kind) in sockets.items():
        made.interface.new_socket(each, in_out=f"{way}PUT", socket_type=f"NodeSocket{kind}")
    return made, made.nodes.new("NodeGroupInput"), made.nodes.new("NodeGroupOutput")


SHADER = {
    "Colour": ("IN", "Color"), "Rough": ("IN", "Float"), "Bump": ("IN", "Vector"), "Light": ("IN", "Float"),
    "Shader": ("OUT", "Shader"), "Part": ("OUT", "Float"),
}  # fmt: skip


def principled_group(blender):
    """A group around a Principled BSDF, as artists build them: of its inputs some are in the group, some outside."""
    made, start, end = group(blender, **SHADER)
    shader = made.nodes.new("ShaderNodeBsdfPrincipled")
    knot = made.nodes.new("NodeReroute")
    link(start.outputs["Colour"], knot.inputs[0])
    link(knot.outputs[0], shader.inputs["Base Color"])
    link(start.outputs["Rough"], shader.inputs["Roughness"])
    link(start.outputs["Bump"], shader.inputs["Normal"])
    link(start.outputs["Light"], shader.inputs["Emission Color"])
    shader.inputs["Metallic"].default_value, shader.inputs["Emission Strength"].default_value = 0.25, 2
    link(shader.outputs[0], end.inputs["Shader"])
    end.inputs["Part"].default_value = 0.75
    return made


def nested(blender, inner):
    """A group that hands all through to another."""
    made, start, end = group(blender, "Outer", **SHADER)
    user = made.nodes.new("ShaderNodeGroup")
    user.node_tree = inner
    for socket in user.inputs:
        link(start.outputs[socket.name], socket)
    for socket in user.outputs:
        link(socket, end.inputs[socket.name])
    return made


def normal_map(blender, surface):
    """A tangent-space normal map."""
    made = node(surface, "NormalMap")
    link(texture(blender, surface, image=picture(blender, (0.5, 0.5, 1), "Non-Color")), made.inputs["Color"])
    return made.outputs[0]


@pytest.mark.parametrize("linked", [False, True])
@pytest.mark.parametrize("deep", [False, True])
def test_principled_in_a_group_is_as_outside(blender, surface, result, deep, linked):
    surface.inputs["Specular IOR Level"].default_value = 0.5
    surface.inputs["Metallic"].default_value, surface.inputs["Emission Strength"].default_value = 0.25, 2
    surface.inputs["Base Color"].default_value, surface.inputs["Roughness"].default_value = (0.1, 0.2, 0.3, 1), 0.125
    surface.inputs["Emission Color"].default_value = (0.5, 0.5, 0.5, 1)
    if linked:
        link(texture(blender, surface), surface.inputs["Base Color"])
        link(normal_map(blender, surface), surface.inputs["Normal"])
    inner = principled_group(blender)
    user = node(surface, "Group", node_tree=nested(blender, inner) if deep else inner)
    user.inputs["Colour"].default_value, user.inputs["Rough"].default_value = (0.1, 0.2, 0.3, 1), 0.125
    user.inputs["Light"].default_value = 0.5
    for there, here in (("Base Color", "Colour"), ("Normal", "Bump")):
        if surface.inputs[there].is_linked:
            link(surface.inputs[there].links[0].from_socket, user.inputs[here])
    end = surface.outputs[0].links[0].to_socket
    number = len(inner.nodes)
    link(user.outputs["Shader"], end)
    grouped = result("grouped")
    link(surface.outputs[0], end)
    plain = result("plain")
    assert grouped == plain
    assert plain[2] == [] and plain[0]["pbrMetallicRoughness"]["metallicFactor"] == 0.25
    assert len(inner.nodes) == number, "the group itself is left alone"


def test_uses_of_one_group_have_their_own_values(blender, surface, export):
    import blender_scene as b

    made = principled_group(blender)
    for material, red in ((surface.id_data, 0.5), (b.material("Other")[0].node_tree, 1.0)):
        shader = material.nodes["Principled BSDF"]
        user = node(shader, "Group", node_tree=made)
        user.inputs["Colour"].default_value = (red, 0, 0, 1)
        link(user.outputs["Shader"], shader.outputs[0].links[0].to_socket)
    b.plane("Second").data.materials.append(blender.data.materials["Other"])
    gltf = export()
    factors = {m["name"]: m["pbrMetallicRoughness"]["baseColorFactor"] for m in gltf.root["materials"]}
    assert factors == {"Grey": [0.5, 0, 0, 1], "Other": [1, 0, 0, 1]}
    assert not gltf.lost.items


def test_an_output_of_nothing_is_its_value(blender, surface, export):
    user = node(surface, "Group", node_tree=principled_group(blender))
    link(user.outputs["Part"], surface.inputs["Metallic"])
    gltf = export()
    assert (material_of(gltf)["pbrMetallicRoughness"]["metallicFactor"], gltf.lost.items) == (0.75, [])


def test_a_muted_link_in_a_group_passes_nothing_on(blender, surface, export):
    made = principled_group(blender)
    user = node(surface, "Group", node_tree=made)
    user.inputs["Colour"].default_value = (1, 0, 0, 1)
    link(user.outputs["Shader"], surface.outputs[0].links[0].to_socket)
    next(x for x in made.links if x.to_socket.name == "Base Color").is_muted = True
    made.nodes["Principled BSDF"].inputs["Base Color"].default_value = (0, 0.5, 0, 1)
    assert material_of(export("link.gltf"))["pbrMetallicRoughness"]["baseColorFactor"] == [0, 0.5, 0, 1]


def test_a_muted_principled_in_a_group_is_black(blender, surface, export):
    made = principled_group(blender)
    made.nodes["Principled BSDF"].mute = True
    link(node(surface, "Group", node_tree=made).outputs["Shader"], surface.outputs[0].links[0].to_socket)
    assert material_of(export())["pbrMetallicRoughness"]["baseColorFactor"] == [0, 0, 0, 1]


def test_colours_of_a_group_are_read_without_baking(blender, surface, export):
    """An image in a group times a tint from outside; where a number is between, the image is grey."""
    made, start, end = group(blender, Tint=("IN", "Color"), Colour=("OUT", "Color"), Number=("OUT", "Float"))
    mix = made.nodes.new("ShaderNodeMix")
    mix.data_type, mix.blend_type = "RGBA", "MULTIPLY"
    mix.inputs[0].default_value = 1
    image = made.nodes.new("ShaderNodeTexImage")
    image.image = picture(blender)
    link(image.outputs["Color"], mix.inputs[6])
    link(start.outputs["Tint"], mix.inputs[7])
    link(mix.outputs[2], end.inputs["Colour"])
    link(mix.outputs[2], end.inputs["Number"])
    user = node(surface, "Group", node_tree=made)
    user.inputs["Tint"].default_value = (0.5, 1, 0.25, 1)
    link(user.outputs["Colour"], surface.inputs["Base Color"])
    gltf = export("colour.gltf", bake=0)
    assert not gltf.lost.items
    assert material_of(gltf)["pbrMetallicRoughness"]["baseColorFactor"] == [0.5, 1, 0.25, 1]


def test_what_passes_a_number_is_grey(blender, surface, export):
    made, start, end = group(blender, Number=("IN", "Float"), Colour=("OUT", "Color"))
    link(start.outputs[0], end.inputs[0])
    user = node(surface, "Group", node_tree=made)
    link(texture(blender, surface), user.inputs[0])
    link(user.outputs[0], surface.inputs["Base Color"])
    assert export(bake=0).lost_features("Grey") == ["procedural base color (math node)"]


def test_ramps_and_curves_of_a_group_are_copied(blender):
    from exporters.blender.groups import inline_groups

    made, _, end = group(blender, Colour=("OUT", "Color"))
    ramp, curve = made.nodes.new("ShaderNodeValToRGB"), made.nodes.new("ShaderNodeRGBCurve")
    ramp.color_ramp.interpolation = "CONSTANT"
    ramp.color_ramp.elements.new(0.25).color = (1, 0, 0.5, 1)
    curve.mapping.curves[1].points.new(0.5, 0.75)
    curve.mapping.update()
    link(ramp.outputs[0], curve.inputs["Color"])
    link(curve.outputs[0], end.inputs[0])
    tree = blender.data.materials.new("Ramp").node_tree
    tree.nodes.new("ShaderNodeGroup").node_tree = made
    inline_groups(tree)
    copied = next(n for n in tree.nodes if n.type == "VALTORGB").color_ramp
    assert (copied.interpolation, [e.position for e in copied.elements]) == ("CONSTANT", [0, 0.25, 1])
    assert tuple(copied.elements[1].color) == (1, 0, 0.5, 1)
    points = next(n for n in tree.nodes if n.type == "CURVE_RGB").mapping.curves[1].points
    assert [tuple(p.location) for p in points] == [(0, 0), (0.5, 0.75), (1, 1)]
