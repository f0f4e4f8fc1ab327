"""The world: colour, image, rotation, and anything else baked by Cycles. Directions as docs/extras.md states them."""

from __future__ import annotations

import math
from urllib.parse import unquote

import numpy as np
import pytest
from render_tools import read_exr, rgb

# One pixel column of a different colour each: u = (i + 0.5) / 8.
COLOURS = np.array([[i / 8, 1 - i / 8, (i % 2)] for i in range(8)], dtype=np.float32)


def world(blender):
    """A world with nodes; its Background node and tree."""
    made = blender.data.worlds.new("World")
    if made.node_tree is None:
        made.use_nodes = True
    blender.context.scene.world = made
    import blender_scene as b

    b.camera()
    return made.node_tree.nodes["Background"], made.node_tree


def environment(blender, tree, background, tmp_path, suffix=".exr"):
    """An environment texture of eight columns, saved in a file."""
    image = blender.data.images.new("sky", 64, 32, float_buffer=suffix != ".png")
    if suffix != ".png":
        image.colorspace_settings.name = "Linear Rec.709"
    pixels = np.ones((32, 8, 8, 4), dtype=np.float32)
    pixels[..., :3] = COLOURS[None, :, None]
    image.pixels.foreach_set(pixels.reshape(-1))
    image.filepath_raw = str(tmp_path / f"sky{suffix}")
    image.file_format = {".exr": "OPEN_EXR", ".hdr": "HDR", ".png": "PNG"}[suffix]
    image.save()
    node = tree.nodes.new("ShaderNodeTexEnvironment")
    node.image = blender.data.images.load(image.filepath_raw)
    tree.links.new(node.outputs["Color"], background.inputs["Color"])
    return node


def test_no_world_is_black(blender, export):
    import blender_scene as b

    b.camera()
    assert export().buzz["world"]["color"] == [0, 0, 0]


def test_colour_and_strength(blender, export):
    background, _ = world(blender)
    background.inputs["Color"].default_value = (0.1, 0.2, 0.3, 1)
    background.inputs["Strength"].default_value = 2.5
    assert export().buzz["world"] == {"color": pytest.approx([0.1, 0.2, 0.3]), "strength": 2.5}


@pytest.mark.parametrize("suffix", [".exr", ".hdr", ".png"])
def test_image_file_is_copied(blender, export, tmp_path, suffix):
    background, tree = world(blender)
    environment(blender, tree, background, tmp_path, suffix)
    gltf = export()
    assert gltf.buzz["world"]["image"] == f"anim_world{suffix}"
    if suffix != ".exr":
        # Blender marks the EXR files that it saves itself as sRGB-encoded; those are written anew, linear.
        assert (gltf.path.parent / gltf.buzz["world"]["image"]).read_bytes() == (tmp_path / f"sky{suffix}").read_bytes()
    assert gltf.buzz["world"]["rotation"] == 0


@pytest.mark.parametrize(("kind", "sign"), [("POINT", -1), ("TEXTURE", 1)])
def test_mapping_becomes_a_rotation(blender, export, tmp_path, kind, sign):
    background, tree = world(blender)
    node = environment(blender, tree, background, tmp_path)
    mapping, where = tree.nodes.new("ShaderNodeMapping"), tree.nodes.new("ShaderNodeTexCoord")
    mapping.vector_type = kind
    mapping.inputs["Rotation"].default_value = (0, 0, 0.7)
    tree.links.new(where.outputs["Generated"], mapping.inputs["Vector"])
    tree.links.new(mapping.outputs["Vector"], node.inputs["Vector"])
    assert export().buzz["world"]["rotation"] == pytest.approx(sign * 0.7)


@pytest.mark.parametrize("deep", [False, True])
def test_an_image_that_is_written_anew_is_linear(blender, export, deep):
    background, tree = world(blender)
    node = tree.nodes.new("ShaderNodeTexEnvironment")
    node.image = blender.data.images.new("made", 8, 4, float_buffer=deep)
    node.image.pixels.foreach_set(np.tile(np.array([0.25, 2, 0.5, 1], dtype=np.float32), 32))
    tree.links.new(node.outputs["Color"], background.inputs["Color"])
    gltf = export()
    want = [0.25, 2, 0.5] if deep else [0.0513, 1, 0.2159]
    np.testing.assert_allclose(rgb(read_exr(gltf.path.parent / "anim_world.exr")), np.broadcast_to(want, (4, 8, 3)), atol=2e-3)


@pytest.mark.parametrize("space", ["sRGB", "Linear Rec.709", "Non-Color", "Linear Rec.2020", "ACEScg"])
@pytest.mark.parametrize("suffix", [".hdr", ".png"])
def test_an_image_of_any_colour_space_is_as_bright_as_in_cycles(blender, export, tmp_path, suffix, space):
    background, tree = world(blender)
    environment(blender, tree, background, tmp_path, suffix).image.colorspace_settings.name = space
    seen = cycles_colours(blender, tmp_path)
    gltf = export()
    if space == {".hdr": "Linear Rec.709", ".png": "sRGB"}[suffix]:
        assert gltf.buzz["world"]["image"] == f"anim_world{suffix}"
        return
    for turn, want in seen.items():
        got = look_up(gltf.path.parent / gltf.buzz["world"]["image"], (math.sin(turn), 0.0, -math.cos(turn)), 0.0)
        np.testing.assert_allclose(got, want, atol=0.02)


def look_up(path, direction, rotation):
    """The radiance that docs/extras.md gives a direction (glTF axes)."""
    pixels = rgb(read_exr(path))
    height, width, _ = pixels.shape
    x, y, z = direction
    # Turned by -rotation about +Y.
    c, s = math.cos(rotation), math.sin(rotation)
    x, z = c * x - s * z, s * x + c * z
    u, v = 0.5 + math.atan2(z, x) / (2 * math.pi), 0.5 - math.asin(y) / math.pi
    return pixels[min(int(v * height), height - 1), min(int(u * width), width - 1)]


@pytest.mark.parametrize("rotated", [False, True])
def test_directions_agree_with_cycles(blender, export, tmp_path, rotated):
    """What Cycles shows through a camera is what the convention says; the same for a baked sky."""
    background, tree = world(blender)
    node = environment(blender, tree, background, tmp_path)
    mapping, where = tree.nodes.new("ShaderNodeMapping"), tree.nodes.new("ShaderNodeTexCoord")
    mapping.inputs["Rotation"].default_value = (0, 0, 0.3 if rotated else 0.0)
    tree.links.new(where.outputs["Generated"], mapping.inputs["Vector"])
    tree.links.new(mapping.outputs["Vector"], node.inputs["Vector"])
    seen = cycles_colours(blender, tmp_path)
    gltf = export()
    for turn, want in seen.items():
        direction = (math.sin(turn), 0.0, -math.cos(turn))
        got = look_up(gltf.path.parent / gltf.buzz["world"]["image"], direction, gltf.buzz["world"]["rotation"])
        np.testing.assert_allclose(got, want, atol=0.02)
    # A Gamma node is beyond a plain image: the sky is baked, and must look the same.
    gamma = tree.nodes.new("ShaderNodeGamma")
    tree.links.new(node.outputs["Color"], gamma.inputs["Color"])
    tree.links.new(gamma.outputs["Color"], background.inputs["Color"])
    gltf = export("baked.gltf")
    assert gltf.buzz["world"]["image"] == "baked_world.exr"
    for turn, want in seen.items():
        direction = (math.sin(turn), 0.0, -math.cos(turn))
        got = look_up(gltf.path.parent / "baked_world.exr", direction, 0.0)
        np.testing.assert_allclose(got, want, atol=0.02)


def cycles_colours(blender, tmp_path) -> dict[float, np.ndarray]:
    """The middle pixel of Cycles renders in four level directions; keys: clockwise turns from Blender's +Y."""
    scene = blender.context.scene
    scene.render.engine = "CYCLES"
    scene.cycles.samples, scene.cycles.use_denoising = 1, False
    scene.world.cycles.sampling_method = "NONE"
    scene.render.resolution_x = scene.render.resolution_y = 9
    scene.render.image_settings.file_format = "OPEN_EXR"
    out = {}
    for turn in (0.2, 1.7, 3.3, 4.8):
        scene.camera.rotation_euler = (math.pi / 2, 0, -turn)
        scene.camera.data.angle = 0.02
        scene.render.filepath = str(tmp_path / "look.exr")
        blender.ops.render.render(write_still=True)
        image = blender.data.images.load(scene.render.filepath, check_existing=False)
        out[turn] = np.array(image.pixels).reshape(9, 9, 4)[4, 4, :3]
        blender.data.images.remove(image)
    return out


def test_animated_strength(blender, export):
    import blender_scene as b

    blender.context.scene.frame_end = 3
    background, _ = world(blender)
    b.key(background.inputs["Strength"], "default_value", {1: 0.0, 3: 2.0})
    gltf = export()
    assert gltf.value("/scenes/0/extras/buzz/world/strength", 2, 0.0) == pytest.approx(1.0)


def test_missing_image_is_named(blender, export, tmp_path):
    background, tree = world(blender)
    image = environment(blender, tree, background, tmp_path).image
    image.filepath = str(tmp_path / "gone.exr")
    image.reload()
    gltf = export()
    assert any("is missing" in feature for feature in gltf.lost_features("World"))


def test_a_sky_with_a_sun_is_as_bright_as_it_is(blender, export):
    background, tree = world(blender)
    sky = tree.nodes.new("ShaderNodeTexSky")
    sky.sun_disc, sky.sun_elevation, sky.sun_size = True, 0.7, 0.02
    tree.links.new(sky.outputs["Color"], background.inputs["Color"])
    gltf = export("my 100%25.gltf")
    assert gltf.lost_features("World") == ["sun disc in the sky texture"]
    image = blender.data.images.load(str(gltf.path.parent / unquote(gltf.buzz["world"]["image"])))
    width, height = image.size
    pixels = np.array(image.pixels).reshape(height, width, 4)[..., :3].mean(axis=2)
    assert pixels.max() > 65504, "half floats would end here"
    # The disc's own radiance, everywhere in it.
    disc = pixels[pixels > pixels.max() / 2]
    assert 0.5 < len(disc) / (math.pi * (0.01 * width / (2 * math.pi)) ** 2 / math.cos(0.7)) < 2


def test_what_a_world_loses_is_named(blender, export):
    background, tree = world(blender)
    path = tree.nodes.new("ShaderNodeLightPath")
    tree.links.new(path.outputs["Is Camera Ray"], background.inputs["Strength"])
    for rays in ("camera", "diffuse", "glossy", "transmission"):
        setattr(blender.context.scene.world.cycles_visibility, rays, False)
    hidden = {f"world hidden from {rays}" for rays in ("the camera", "diffuse rays", "reflections", "transmission rays")}
    assert set(export().lost_features("World")) == {"light path in the world", *hidden}


def test_mist_without_a_sky_is_named(blender, export):
    background, tree = world(blender)
    mist = tree.nodes.new("ShaderNodeVolumePrincipled")
    tree.links.new(mist.outputs[0], background.outputs[0].links[0].to_node.inputs["Volume"])
    tree.nodes.remove(background)
    gltf = export()
    assert gltf.lost_features("World") == ["world volume"]
    assert gltf.buzz["world"]["color"] == [0, 0, 0]


def test_the_view_layer_decides_about_the_world(blender, export):
    world(blender)
    layer = blender.context.view_layer
    if hasattr(layer, "world_override"):
        layer.world_override = blender.data.worlds.new("Other")
        layer.world_override.node_tree.nodes["Background"].inputs["Color"].default_value = (1, 0, 0, 1)
        assert export().buzz["world"]["color"] == [1, 0, 0]
    layer.use_sky = False
    assert export().buzz["world"]["color"] == [0, 0, 0]


@pytest.mark.parametrize("muted", ["node", "link"])
def test_a_muted_sky_is_black(blender, export, muted):
    background, _ = world(blender)
    what = background if muted == "node" else background.outputs[0].links[0]
    setattr(what, "mute" if muted == "node" else "is_muted", True)
    assert export().buzz["world"]["color"] == [0, 0, 0]


def test_a_muted_mixture_shows_its_first_sky(blender, export):
    background, tree = world(blender)
    background.inputs["Color"].default_value = (0, 1, 0, 1)
    mix = tree.nodes.new("ShaderNodeAddShader")
    end = background.outputs[0].links[0].to_socket
    tree.links.new(background.outputs[0], mix.inputs[0])
    tree.links.new(mix.outputs[0], end)
    mix.mute = True
    assert export().buzz["world"] == {"color": [0, 1, 0], "strength": 1}


@pytest.mark.parametrize("engine", ["CYCLES", "BLENDER_EEVEE"])
@pytest.mark.parametrize("baked", [False, True])
def test_each_engine_has_its_own_output(blender, export, monkeypatch, engine, baked):
    monkeypatch.setattr("exporters.blender.world._BAKED_WIDTH", 16)
    background, tree = world(blender)
    blender.context.scene.render.engine = engine
    outputs = {"CYCLES": tree.nodes.new("ShaderNodeOutputWorld"), "BLENDER_EEVEE": background.outputs[0].links[0].to_node}
    for name, output in outputs.items():
        output.target = name.removeprefix("BLENDER_")
        shown = tree.nodes.new("ShaderNodeBackground")
        shown.inputs["Color"].default_value = (1, 0, 0, 1) if name == engine else (0, 0, 1, 1)
        twice = tree.nodes.new("ShaderNodeAddShader") if baked else shown
        if baked:
            tree.links.new(shown.outputs[0], twice.inputs[0])
            tree.links.new(shown.outputs[0], twice.inputs[1])
        tree.links.new(twice.outputs[0], output.inputs["Surface"])
        output.is_active_output = name != engine
    gltf = export()
    if baked:
        np.testing.assert_allclose(rgb(read_exr(gltf.path.parent / "anim_world.exr"))[4, 8], [2, 0, 0])
    else:
        assert gltf.buzz["world"]["color"] == [1, 0, 0]


@pytest.mark.parametrize(("widest", "width"), [(128, 64), (32, 32)])
def test_a_sky_is_baked_as_wide_as_its_image(blender, export, tmp_path, monkeypatch, widest, width):
    monkeypatch.setattr("exporters.blender.world._BAKED_WIDTH", 16)
    monkeypatch.setattr("exporters.blender.world._WIDEST", widest)
    background, tree = world(blender)
    node, turned = environment(blender, tree, background, tmp_path, ".hdr"), tree.nodes.new("ShaderNodeHueSaturation")
    tree.links.new(node.outputs["Color"], turned.inputs["Color"])
    tree.links.new(turned.outputs["Color"], background.inputs["Color"])
    gltf = export()
    assert read_exr(gltf.path.parent / "anim_world.exr")["R"].shape == (width // 2, width)
    assert gltf.lost_features("World") == (["sky of 64 pixels"] if widest < 64 else [])


STRENGTH = "/scenes/0/extras/buzz/world/strength"


def test_only_the_background_that_is_shown_is_followed(blender, export):
    import blender_scene as b

    first, tree = world(blender)
    shown = tree.nodes.new("ShaderNodeBackground")
    tree.links.new(shown.outputs[0], first.outputs[0].links[0].to_socket)
    shown.inputs["Strength"].default_value = 3
    b.key(first.inputs["Strength"], "default_value", {1: 1.0, 2: 9.0})
    gltf = export()
    assert gltf.buzz["world"]["strength"] == 3
    assert not gltf.animated(STRENGTH) and gltf.lost_features("World") == []


def test_a_baked_sky_holds_its_strength(blender, export, monkeypatch):
    import blender_scene as b

    monkeypatch.setattr("exporters.blender.world._BAKED_WIDTH", 16)
    background, tree = world(blender)
    gradient = tree.nodes.new("ShaderNodeTexGradient")
    tree.links.new(gradient.outputs["Color"], background.inputs["Color"])
    b.key(background.inputs["Strength"], "default_value", {1: 2.0, 2: 8.0})
    gltf = export()
    assert not gltf.animated(STRENGTH)
    assert gltf.lost_features("World") == ["animated world nodes"]


def test_a_turning_image_is_named_and_its_strength_followed(blender, export, tmp_path):
    import blender_scene as b

    background, tree = world(blender)
    node = environment(blender, tree, background, tmp_path, ".hdr")
    mapping = tree.nodes.new("ShaderNodeMapping")
    tree.links.new(mapping.outputs["Vector"], node.inputs["Vector"])
    b.key(background.inputs["Strength"], "default_value", {1: 1.0, 2: 2.0})
    assert export().lost_features("World") == []
    b.key(mapping.inputs["Rotation"], "default_value", {1: (0, 0, 0), 2: (0, 0, 3)})
    gltf = export()
    assert gltf.lost_features("World") == ["animated world nodes"]
    assert gltf.value(STRENGTH, 2, 0.0) == 2


def test_constant_nodes_are_what_they_give(blender, export):
    """Sampled in each frame, not baked."""
    import blender_scene as b

    background, tree = world(blender)
    value, tint, half = (tree.nodes.new(f"ShaderNode{kind}") for kind in ("Value", "RGB", "Math"))
    tint.outputs[0].default_value = (0.5, 0.25, 1, 1)
    half.operation, half.inputs[1].default_value = "MULTIPLY", 0.5
    tree.links.new(value.outputs[0], half.inputs[0])
    tree.links.new(half.outputs[0], background.inputs["Strength"])
    tree.links.new(tint.outputs[0], background.inputs["Color"])
    b.key(value.outputs[0], "default_value", {1: 2.0, 2: 6.0})
    gltf = export()
    assert gltf.buzz["world"] == {"color": [0.5, 0.25, 1], "strength": 1}
    assert gltf.value(STRENGTH, 2, 0.0) == 3
    assert gltf.lost_features("World") == []


def test_an_image_of_constant_strength_is_not_baked(blender, export, tmp_path):
    background, tree = world(blender)
    environment(blender, tree, background, tmp_path, ".hdr")
    value = tree.nodes.new("ShaderNodeValue")
    value.outputs[0].default_value = 0.5
    tree.links.new(value.outputs[0], background.inputs["Strength"])
    assert export().buzz["world"] == {"color": [1, 1, 1], "strength": 0.5, "image": "anim_world.hdr", "rotation": 0}
