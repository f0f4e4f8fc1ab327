"""USD textures: colour spaces, scale and bias, chained transforms, and images that glTF keeps in one."""

from __future__ import annotations

import math
from urllib.parse import unquote

import numpy as np
import pytest

pytest.importorskip("pxr", reason="SKIPPED LOUDLY: usd-core is not installed (pip install usd-core)")
import usd_scene as u
from PIL import Image
from pxr import Gf, Sdf, UsdShade

# 128 / 255 as a linear value that is written sRGB-coded, and as an sRGB code that is written linear.
ENCODED, DECODED = 188, 55
SQUARE = ((0, 0), (1, 0), (1, 1), (0, 1))


@pytest.fixture
def card(usd_convert, tmp_path):
    """Convert a card: card(input, file, output, **texture inputs) gives the document, its material."""

    def run(*textures, transforms=(), circle=False, reader="UsdPrimvarReader_float2", corners=SQUARE, **surface):
        made = u.stage()
        u.camera(made)
        prim = u.quad(made, "/World/Card")
        u.uv(prim, corners)
        material = u.preview(made, "/World/M", **surface)
        for name, file, output, inputs in textures:
            node = u.texture(made, material, name, file, output, **inputs)
            source = UsdShade.Shader(made.GetPrimAtPath(f"/World/M/{name}Reader"))
            source.CreateIdAttr(reader)
            for i, values in enumerate(transforms):
                turn = UsdShade.Shader.Define(made, f"/World/M/{name}Turn{i}")
                turn.CreateIdAttr("UsdTransform2d")
                for key, value in values.items():
                    kind = Sdf.ValueTypeNames.Float if key == "rotation" else Sdf.ValueTypeNames.Float2
                    turn.CreateInput(key, kind).Set(value)
                turn.CreateInput("in", Sdf.ValueTypeNames.Float2).ConnectToSource(source.ConnectableAPI(), "result")
                source = turn
            if circle:
                UsdShade.Shader(made.GetPrimAtPath(f"/World/M/{name}Turn0")).GetInput("in").ConnectToSource(source.ConnectableAPI(), "result")
            node.GetInput("st").ConnectToSource(source.ConnectableAPI(), "result")
        u.bind(prim, material)
        gltf = usd_convert(made)
        return gltf, gltf.root["materials"][0]

    return run


def grey(path, value=128, mode="RGB"):
    """A plain image file; its name."""
    Image.new(mode, (2, 2), (value,) * len(mode) if len(mode) > 1 else value).save(path)
    return path.name


def exr(path, value):
    """A plain OpenEXR file; its name."""
    openexr = pytest.importorskip("OpenEXR")
    header = {"compression": openexr.ZIP_COMPRESSION, "type": openexr.scanlineimage}
    openexr.File(header, {"RGB": np.full((2, 2, 3), value, np.float32)}).write(str(path))
    return path.name


def pixel(gltf, info):
    """The first pixel of a texture."""
    image = gltf.root["images"][gltf.root["textures"][info["index"]]["source"]]
    return Image.open(gltf.path.parent / unquote(image["uri"])).convert("RGBA").getpixel((0, 0))


@pytest.mark.parametrize(
    ("space", "mode", "want"),
    [("raw", "RGB", ENCODED), ("sRGB", "RGB", 128), ("auto", "RGB", 128), ("auto", "L", ENCODED), ("sRGB", "L", 128)],
)
@pytest.mark.parametrize("name", ["diffuseColor", "emissiveColor"])
def test_colours_are_srgb_coded(card, tmp_path, name, space, mode, want):
    gltf, material = card((name, grey(tmp_path / "g.png", mode=mode), "rgb", {"sourceColorSpace": space}))
    info = material["emissiveTexture"] if name == "emissiveColor" else material["pbrMetallicRoughness"]["baseColorTexture"]
    assert pixel(gltf, info)[:3] == (want,) * 3


@pytest.mark.parametrize(("space", "want"), [("raw", 128), ("sRGB", DECODED), ("auto", 128)])
def test_data_are_not_srgb_coded(card, tmp_path, space, want):
    gltf, material = card(("roughness", grey(tmp_path / "g.png"), "g", {"sourceColorSpace": space}))
    assert pixel(gltf, material["pbrMetallicRoughness"]["metallicRoughnessTexture"])[1] == want


def test_sixteen_bit_greys(card, tmp_path):
    Image.fromarray(np.full((2, 2), 32896, np.uint16)).save(tmp_path / "deep.png")
    gltf, material = card(("metallic", "deep.png", "r", {}))
    assert pixel(gltf, material["pbrMetallicRoughness"]["metallicRoughnessTexture"])[2] == 128


def test_opacity_is_no_colour(card, tmp_path):
    """Alpha is linear in glTF, whichever channel it was."""
    textures = (("diffuseColor", grey(tmp_path / "g.png"), "rgb", {}), ("opacity", grey(tmp_path / "o.png", 100), "r", {"sourceColorSpace": "raw"}))
    gltf, material = card(*textures)
    assert pixel(gltf, material["pbrMetallicRoughness"]["baseColorTexture"]) == (128, 128, 128, 100)


def test_constant_opacity_alone_counts(card, tmp_path):
    """An alpha channel that the material does not read does not multiply it."""
    gltf, material = card(("diffuseColor", grey(tmp_path / "g.png", 128, "RGBA"), "rgb", {}), opacity=0.5)
    assert material["pbrMetallicRoughness"]["baseColorFactor"][3] == 0.5
    assert pixel(gltf, material["pbrMetallicRoughness"]["baseColorTexture"]) == (128, 128, 128, 255)


def test_exr_data_and_exr_light(card, tmp_path):
    half, four = exr(tmp_path / "half.exr", 0.5), exr(tmp_path / "four.exr", 4.0)
    gltf, material = card(("roughness", half, "r", {}), ("emissiveColor", four, "rgb", {}), ("diffuseColor", four, "rgb", {}))
    pbr = material["pbrMetallicRoughness"]
    assert pixel(gltf, pbr["metallicRoughnessTexture"])[1] == 128
    assert (pixel(gltf, material["emissiveTexture"])[0], material["extensions"]["KHR_materials_emissive_strength"]["emissiveStrength"]) == (255, 4)
    assert gltf.lost_features("/World/M") == ["colours over 1 in four.exr"]


def value(gltf, info, factor):
    """The linear value that a texture and its factor give."""
    code = pixel(gltf, info)[0] / 255
    return factor * (code / 12.92 if code <= 0.04045 else ((code + 0.055) / 1.055) ** 2.4)


@pytest.mark.parametrize(("scale", "bias"), [(2, 0), (0.5, 0), (1, 0.25), (3, 0.5), (2, -0.1)])
def test_scale_and_bias(card, tmp_path, scale, bias):
    file, inputs = grey(tmp_path / "g.png"), {"scale": Gf.Vec4f(scale, scale, scale, 1), "bias": Gf.Vec4f(bias, bias, bias, 0)}
    linear = ((128 / 255 + 0.055) / 1.055) ** 2.4
    want = linear * scale + bias
    gltf, material = card(("emissiveColor", file, "rgb", inputs), ("diffuseColor", file, "rgb", inputs))
    strength = material.get("extensions", {}).get("KHR_materials_emissive_strength", {"emissiveStrength": 1})["emissiveStrength"]
    assert value(gltf, material["emissiveTexture"], material["emissiveFactor"][0] * strength) == pytest.approx(want, abs=0.01)
    pbr = material["pbrMetallicRoughness"]
    factor = pbr.get("baseColorFactor", [1])[0]
    assert value(gltf, pbr["baseColorTexture"], factor) == pytest.approx(min(want, 1), abs=0.01)
    assert bool(gltf.lost_features("/World/M")) == (want > 1)


def test_chained_transforms(card, tmp_path):
    """Three transforms, the first applied to the primvar: one KHR_texture_transform, v counted from the other end."""
    steps = [
        {"scale": Gf.Vec2f(2, 2), "translation": Gf.Vec2f(0.1, 0.2)},
        {"rotation": 30.0, "translation": Gf.Vec2f(0.25, 0)},
        {"scale": Gf.Vec2f(-1.5, -1.5)},
    ]
    gltf, material = card(("diffuseColor", grey(tmp_path / "g.png"), "rgb", {}), transforms=steps)
    info = material["pbrMetallicRoughness"]["baseColorTexture"]["extensions"]["KHR_texture_transform"]
    for s, t in ((0.1, 0.2), (0.7, 0.4)):
        p = np.array([s, t])
        for step in steps:
            a = math.radians(step.get("rotation", 0))
            p = p * step.get("scale", (1, 1))
            p = np.array([[math.cos(a), -math.sin(a)], [math.sin(a), math.cos(a)]]) @ p + step.get("translation", (0, 0))
        r, (x, y) = info["rotation"], (info["scale"][0] * s, info["scale"][1] * (1 - t))
        got = (info["offset"][0] + math.cos(r) * x + math.sin(r) * y, info["offset"][1] - math.sin(r) * x + math.cos(r) * y)
        assert got == (pytest.approx(p[0], abs=1e-6), pytest.approx(1 - p[1], abs=1e-6))
    assert not gltf.lost_features("/World/M")


@pytest.mark.parametrize("scale", [(1.5, 0.7), (-1.5, 0.7), (0.5, -0.5)])
def test_a_turned_image_is_seen_as_with_turned_coordinates(card, buzz, tmp_path, scale):
    import render_tools as r

    x, y = np.meshgrid(np.arange(16) * 16, np.arange(16) * 16)
    Image.fromarray(np.stack([x, y, 255 - x], axis=2).astype(np.uint8)).save(tmp_path / "ramps.png")
    a = math.radians(30)
    turned = [(scale[0] * s * math.cos(a) - scale[1] * t * math.sin(a), scale[0] * s * math.sin(a) + scale[1] * t * math.cos(a)) for s, t in SQUARE]
    step = {"rotation": 30.0, "scale": Gf.Vec2f(*scale)}
    seen = []
    for options in ({"transforms": [step]}, {"corners": turned}):
        gltf, _ = card(("diffuseColor", "ramps.png", "rgb", {}), **options)
        buzz(gltf.path, tmp_path / "out", "-q", "full", "-r", "32x24", "-f", "1", "--overwrite")
        seen.append(r.rgb(r.read_exr(r.frames_of(tmp_path / "out")[1])))
    assert np.ptp(seen[0]) > 0.2
    np.testing.assert_allclose(seen[0], seen[1], atol=2e-3)


def test_sheared_coordinates_are_named(card, tmp_path):
    steps = [{"rotation": 30.0}, {"scale": Gf.Vec2f(1, 3)}]
    gltf, _ = card(("diffuseColor", grey(tmp_path / "g.png"), "rgb", {}), transforms=steps)
    assert gltf.lost_features("/World/M") == ["texture transforms that shear together"]


@pytest.mark.parametrize(("first", "second"), [("metallic", "roughness"), ("diffuseColor", "opacity")])
def test_images_in_one_have_to_lie_alike(card, tmp_path, first, second):
    textures = [(first, grey(tmp_path / "a.png"), "rgb" if first == "diffuseColor" else "r"), (second, grey(tmp_path / "b.png"), "r")]
    gltf, _ = card((*textures[0], {"wrapS": "clamp"}), (*textures[1], {"wrapS": "repeat"}))
    assert gltf.lost_features("/World/M") == [f"{first} and {second} placed differently"]
    gltf, _ = card((*textures[0], {"wrapS": "clamp"}), (*textures[1], {"wrapS": "clamp"}))
    assert not gltf.lost_features("/World/M")


def test_black_borders_are_named(card, tmp_path):
    gltf, _ = card(("diffuseColor", grey(tmp_path / "g.png"), "rgb", {"wrapT": "black"}))
    assert gltf.lost_features("/World/M") == ["wrap mode black"]


@pytest.mark.parametrize("node", ["circle of nodes", "ND_place2d_vector2 node"])
def test_coordinates_from_elsewhere_are_named(card, tmp_path, node):
    turns, kind = ({}, {}), {} if node.startswith("circle") else {"reader": node.removesuffix(" node")}
    gltf, _ = card(("diffuseColor", grey(tmp_path / "g.png"), "rgb", {}), transforms=turns, circle=not kind, **kind)
    assert gltf.lost_features("/World/M") == [f"texture coordinates from a {node}"]


@pytest.mark.parametrize("tiles", [(1001,), (1001, 1002), ()])
def test_udim_tiles(card, tmp_path, tiles):
    """One tile is an image like any other; of several the first is used, and that is said once."""
    for tile in tiles:
        grey(tmp_path / f"g.{tile}.png")
    gltf, data = card(("diffuseColor", "g.<UDIM>.png", "rgb", {}))
    assert ("baseColorTexture" in data["pbrMetallicRoughness"]) == bool(tiles)
    want = {1: [], 2: ["UDIM texture"], 0: ["texture g.<UDIM>.png is missing"]}
    assert gltf.lost_features("/World/M") == want[len(tiles)]


def test_empty_files_are_missing(card, tmp_path):
    (tmp_path / "e.png").touch()
    gltf, _ = card(("diffuseColor", "e.png", "rgb", {}))
    assert [f.endswith("e.png is missing") for f in gltf.lost_features("/World/M")] == [True]
