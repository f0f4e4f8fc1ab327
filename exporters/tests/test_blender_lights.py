"""Lights: kinds, units, colour temperature, animation, areas."""

from __future__ import annotations

import math

import numpy as np
import pytest


def make(blender, kind, **settings):
    import blender_scene as b

    b.camera()
    return b.light(kind, **settings)


def test_point(blender, export):
    make(blender, "POINT", energy=100.0, color=(1, 0.5, 0.25), shadow_soft_size=0.3)
    _, light = export().light("Light")
    assert light["type"] == "point"
    assert light["intensity"] == pytest.approx(683 * 100 / (4 * math.pi))
    assert light["color"] == pytest.approx([1, 0.5, 0.25])
    assert light["extras"]["radius"] == pytest.approx(0.3)


def test_spot(blender, export):
    make(blender, "SPOT", energy=50.0, spot_size=1.2, spot_blend=0.25)
    _, light = export().light("Light")
    assert light["intensity"] == pytest.approx(683 * 50 / (4 * math.pi))
    assert light["spot"]["outerConeAngle"] == pytest.approx(0.6)


@pytest.mark.parametrize("blend", [0.25, 1.0])
def test_a_spots_cone_lets_as_much_light_through_as_in_cycles(blender, export, blend):
    make(blender, "SPOT", spot_size=1.2, spot_blend=blend)
    _, light = export().light("Light")
    half, inner, outer = 0.6, light["spot"]["innerConeAngle"], light["spot"]["outerConeAngle"]
    cosine = np.linspace(math.cos(half), 1, 10_001)
    share = np.clip((cosine - math.cos(half)) / (1 - math.cos(half)) / blend, 0, 1)
    cycles = share * share * (3 - 2 * share)
    # KHR_lights_punctual, Inner and Outer Cone Angles.
    gltf = np.clip((cosine - math.cos(outer)) / (math.cos(inner) - math.cos(outer)), 0, 1) ** 2
    assert gltf.mean() == pytest.approx(cycles.mean(), rel=2e-3)
    assert np.abs(gltf - cycles).max() < 0.16


def test_sun(blender, export):
    make(blender, "SUN", energy=3.0, angle=0.02)
    _, light = export().light("Light")
    assert (light["type"], light["intensity"]) == ("directional", pytest.approx(683 * 3))
    assert light["extras"]["angle"] == pytest.approx(0.02)


@pytest.mark.parametrize(
    ("settings", "shape", "size"),
    [
        ({"shape": "SQUARE", "size": 2.0}, "rectangle", [4, 6]),
        ({"shape": "RECTANGLE", "size": 2.0, "size_y": 0.5}, "rectangle", [4, 1.5]),
        ({"shape": "DISK", "size": 1.0}, "ellipse", [2, 3]),
        ({"shape": "ELLIPSE", "size": 1.0, "size_y": 2.0}, "ellipse", [2, 6]),
    ],
)
def test_area(blender, export, settings, shape, size):
    ob = make(blender, "AREA", energy=40.0)
    for key, value in settings.items():
        setattr(ob.data, key, value)
    ob.scale = (2, 3, 1)
    _, light = export().light("Light")
    assert light["type"] == "spot"
    assert light["spot"] == {"innerConeAngle": 0, "outerConeAngle": pytest.approx(math.pi / 2)}
    assert light["intensity"] == pytest.approx(683 * 40 / math.pi)
    assert light["extras"]["area"]["shape"] == shape
    assert light["extras"]["area"]["size"] == pytest.approx(size)


def test_temperature_and_exposure(blender, export):
    ob = make(blender, "POINT", energy=10.0, color=(0.5, 0.5, 0.5))
    if not hasattr(ob.data, "use_temperature"):
        pytest.skip("this Blender has no light temperature")
    ob.data.use_temperature, ob.data.temperature = True, 3000.0
    if hasattr(ob.data, "exposure"):
        ob.data.exposure = 2.0
    want = np.array(ob.data.temperature_color) * 0.5 * 10 * (4 if hasattr(ob.data, "exposure") else 1) * 683 / (4 * math.pi)
    _, light = export().light("Light")
    np.testing.assert_allclose(np.array(light["color"]) * light["intensity"], want, rtol=1e-5)
    assert max(light["color"]) <= 1


def test_not_normalized_lights_do_not_stop_the_export(blender, export):
    ob = make(blender, "AREA", energy=10.0, size=2.0)
    if not hasattr(ob.data, "normalize"):
        pytest.skip("this Blender always normalises lights")
    ob.data.normalize = False
    _, light = export().light("Light")
    assert light["intensity"] == pytest.approx(683 * 10 / math.pi * 4)


def test_animation(blender, export):
    import blender_scene as b

    blender.context.scene.frame_end = 5
    ob = make(blender, "SPOT", energy=10.0)
    b.key(ob.data, "energy", {1: 10.0, 5: 50.0})
    b.key(ob.data, "color", {1: (1, 1, 1), 5: (1, 0, 0)})
    b.key(ob.data, "spot_size", {1: 1.0, 5: 0.5})
    b.key(ob.data, "shadow_soft_size", {1: 0.0, 5: 0.4})
    b.key(ob, "location", {1: (0, 0, 5), 5: (1, 0, 5)})
    gltf = export()
    assert gltf.light_value("Light", "intensity", 3, 0.0) == pytest.approx(683 * 30 / (4 * math.pi), rel=1e-5)
    assert gltf.light_value("Light", "color", 3, [0, 0, 0]) == pytest.approx([1, 0.5, 0.5], rel=1e-5)
    assert gltf.light_value("Light", "spot/outerConeAngle", 5, 0.0) == pytest.approx(0.25, rel=1e-5)
    assert gltf.light_value("Light", "extras/radius", 3, 0.0) == pytest.approx(0.2, rel=1e-5)
    np.testing.assert_allclose(gltf.world(gltf.node("Light"), 5)[:3, 3], (1, 5, 0), atol=1e-6)


def test_hidden_and_blinking_lights(blender, export):
    import blender_scene as b

    blender.context.scene.frame_end = 3
    make(blender, "POINT", name="Off").hide_render = True
    blink = b.light("POINT", "Blink")
    b.key(blink, "hide_render", {1: False, 2: True}, interpolation="CONSTANT")
    gltf = export()
    assert [gltf.visible(gltf.node("Blink"), f) for f in (1, 2, 3)] == [True, False, False]
    assert all(n["name"] != "Off" for n in gltf.root["nodes"])


def test_what_a_light_loses_is_named(blender, export):
    ob = make(blender, "AREA", spread=1.0)
    ob.data.use_shadow = False
    features = export().lost_features("Light")
    assert {"area light spread", "light without shadows"} <= set(features)


def test_a_sheared_area_light_is_named(blender, export):
    import blender_scene as b

    ob = make(blender, "AREA")
    ob.parent = b.link(blender.data.objects.new("Rig", None))
    ob.parent.scale = (2, 1, 1)
    assert export().lost_features("Light") == []
    ob.rotation_euler = (0.3, 0.2, 0.8)
    assert export().lost_features("Light") == ["sheared area light"]


def test_portals_do_not_shine(blender, export):
    make(blender, "AREA").data.cycles.is_portal = True
    assert "lights" not in export().root.get("extensions", {}).get("KHR_lights_punctual", {})


def test_lights_that_gltf_has_not_are_named(blender, export):
    import blender_scene as b

    make(blender, "SPOT", energy=-5.0).scale = (1, 2, 1)
    linked = b.light("POINT", "Linked")
    linked.light_linking.receiver_collection = blender.data.collections.new("Only these")
    gltf = export()
    assert {"negative light", "spot with different scales"} <= set(gltf.lost_features("Light"))
    assert gltf.lost_features("Linked") == ["light linking"]


@pytest.mark.parametrize("muted", ["node", "link", "other"])
def test_only_the_emission_that_is_shown_shines(blender, export, muted):
    import blender_scene as b

    b.camera()
    data = b.light("SUN", energy=1.0).data
    data.use_nodes = True
    tree = data.node_tree
    emission = next(node for node in tree.nodes if node.type == "EMISSION")
    if muted == "node":
        emission.mute = True
    elif muted == "link":
        emission.outputs[0].links[0].is_muted = True
    else:
        second = tree.nodes.new("ShaderNodeEmission")
        second.inputs["Strength"].default_value = 3
        tree.links.new(second.outputs[0], emission.outputs[0].links[0].to_socket)
    light = export().root["extensions"]["KHR_lights_punctual"]["lights"][0]
    assert light["intensity"] == pytest.approx(683 * 3 if muted == "other" else 0)


def emission_of(blender, kind="POINT", **settings):
    """A light with nodes; its Emission node."""
    data = make(blender, kind, **settings).data
    data.use_nodes = True
    return next(node for node in data.node_tree.nodes if node.type == "EMISSION")


def feed(socket, kind, value=None):
    """Link a new node to an input, and set the node's own value (of its output, or of its first input)."""
    tree = socket.node.id_data
    made = tree.nodes.new(f"ShaderNode{kind}")
    if value is not None:
        (made.outputs if kind in ("Value", "RGB") else made.inputs)[0].default_value = value
    tree.links.new(made.outputs[0], socket)
    return made


def radiance(gltf, name="Light"):
    """Colour times intensity."""
    _, light = gltf.light(name)
    return np.array(light["color"]) * light["intensity"]


def test_constant_nodes_of_lights_are_what_they_give(blender, export):
    import blender_scene as b

    plain, _ = emission_of(blender, energy=10.0), b.light("POINT", "Plain", energy=30.0, color=(0.5, 0.25, 1))
    strength = feed(plain.inputs["Strength"], "Math", 1.0)
    strength.inputs[1].default_value = 7
    half = feed(strength.inputs[0], "Math")
    half.operation, half.inputs[1].default_value = "DIVIDE", -0.5
    feed(half.inputs[0], "Value", 2.0)
    feed(plain.inputs["Color"], "RGB", (0.5, 0.25, 1, 1))
    gltf = export()
    assert not gltf.lost.items
    np.testing.assert_allclose(radiance(gltf), radiance(gltf, "Plain"), rtol=1e-6)


@pytest.mark.parametrize("kelvin", [1000.0, 3200.0, 6500.0, 12000.0])
def test_blackbody_is_the_colour_of_a_temperature(blender, export, kelvin):
    import blender_scene as b

    other = b.light("POINT", "Plain", energy=10.0)
    if not hasattr(other.data, "use_temperature"):
        pytest.skip("this Blender has no light temperature")
    other.data.use_temperature, other.data.temperature = True, kelvin
    feed(emission_of(blender, energy=10.0).inputs["Color"], "Blackbody", kelvin)
    gltf = export()
    assert not gltf.lost.items
    want = radiance(gltf, "Plain")
    np.testing.assert_allclose(radiance(gltf), want, rtol=1e-5, atol=1e-6 * want.max())


def test_animated_constants_of_lights_are_followed(blender, export):
    import blender_scene as b

    blender.context.scene.frame_end = 5
    emission = emission_of(blender, energy=10.0)
    flicker, warmth = feed(emission.inputs["Strength"], "Value"), feed(emission.inputs["Color"], "Blackbody")
    b.key(flicker.outputs[0], "default_value", {1: 1.0, 5: 5.0})
    b.key(warmth.inputs[0], "default_value", {1: 6500.0, 5: 2000.0})
    gltf = export()
    assert not gltf.lost.items
    reds = [gltf.light_value("Light", "color", frame, [0, 0, 0])[0] * gltf.light_value("Light", "intensity", frame, 0.0) for frame in (1, 5)]
    np.testing.assert_allclose(np.array(reds) * 4 * math.pi / 6830, [1.0425, 5 * 2.52], rtol=0.02)


def test_an_emission_in_a_group_shines_as_outside(blender, export):
    emission = emission_of(blender, energy=10.0)
    group = blender.data.node_groups.new("Lamp", "ShaderNodeTree")
    group.interface.new_socket("Power", in_out="INPUT", socket_type="NodeSocketFloat")
    group.interface.new_socket("Light", in_out="OUTPUT", socket_type="NodeSocketShader")
    inner = group.nodes.new("ShaderNodeEmission")
    group.links.new(group.nodes.new("NodeGroupInput").outputs[0], inner.inputs["Strength"])
    group.links.new(inner.outputs[0], group.nodes.new("NodeGroupOutput").inputs[0])
    user = emission.id_data.nodes.new("ShaderNodeGroup")
    user.node_tree = group
    user.inputs[0].default_value = 3
    emission.id_data.links.new(user.outputs[0], emission.outputs[0].links[0].to_socket)
    gltf = export()
    assert not gltf.lost.items
    assert radiance(gltf)[0] == pytest.approx(683 * 30 / (4 * math.pi))


@pytest.mark.parametrize("case", ["strength", "shader"])
def test_other_light_nodes_are_named(blender, export, case):
    emission = emission_of(blender, energy=10.0)
    if case == "strength":
        feed(emission.inputs["Strength"], "LightFalloff", 3.0)
    else:
        feed(emission.outputs[0].links[0].to_socket, "AddShader")
    assert export().lost_features("Light") == ["light nodes (texture, IES or falloff)"]


@pytest.mark.parametrize("engine", ["CYCLES", "BLENDER_EEVEE"])
def test_factors_of_a_light_are_those_of_the_engine(blender, export, engine):
    blender.context.scene.render.engine = engine
    make(blender, "POINT", specular_factor=0.0, diffuse_factor=0.5)
    gltf = export()
    followed = engine != "CYCLES"
    assert gltf.light("Light")[1]["extras"].get("specular", 1) == (0 if followed else 1)
    assert gltf.lost_features("Light") == (["diffuse factor 0.5"] if followed else [])
