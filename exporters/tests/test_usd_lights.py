"""UsdLux lights by the formulas of docs/extras.md; domes; the command line."""

from __future__ import annotations

import math
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

pytest.importorskip("pxr", reason="SKIPPED LOUDLY: usd-core is not installed (pip install usd-core)")
import usd_scene as u
from PIL import Image
from pxr import Sdf, UsdGeom, UsdLux

SCRIPT = Path(__file__).resolve().parents[1] / "usd" / "usd_to_gltf.py"


def light(made, kind, **inputs):
    """A light with inputs."""
    prim = made.DefinePrim("/World/Light", kind)
    for name, value in inputs.items():
        prim.GetAttribute(f"inputs:{name}").Set(value)
    return prim


# Kind, inputs, metres per unit, candela or lux, over 683.
CASES = [
    ("SphereLight", {"intensity": 10.0, "radius": 0.5}, 1.0, 10 * math.pi * 0.25),
    ("SphereLight", {"intensity": 10.0, "radius": 50.0}, 0.01, 10 * math.pi * 0.25),
    ("SphereLight", {"intensity": 10.0, "radius": 0.5, "normalize": True}, 1.0, 10 / 4),
    ("SphereLight", {"intensity": 10.0, "radius": 50.0, "normalize": True}, 0.01, 10 / 4 * 1e-4),
    ("RectLight", {"intensity": 3.0, "width": 2.0, "height": 0.5, "exposure": 2.0}, 1.0, 12.0),
    ("RectLight", {"intensity": 3.0, "width": 2.0, "height": 0.5, "normalize": True}, 1.0, 3.0),
    ("DiskLight", {"intensity": 3.0, "radius": 2.0}, 1.0, 3 * math.pi * 4),
    ("DistantLight", {"intensity": 5.0, "angle": 2.0}, 1.0, 5 * math.pi * math.sin(math.radians(1)) ** 2),
    ("DistantLight", {"intensity": 5.0, "angle": 2.0, "normalize": True}, 1.0, 5.0),
    ("DistantLight", {"intensity": 5.0, "angle": 0.0}, 1.0, 5.0),
]


@pytest.mark.parametrize(("kind", "inputs", "units", "want"), CASES)
def test_intensities(usd_convert, kind, inputs, units, want):
    made = u.stage(units=units)
    u.camera(made)
    light(made, kind, **inputs)
    _, data = usd_convert(made).light("Light")
    assert data["intensity"] == pytest.approx(683 * want, rel=1e-5)


def test_shapes_and_directions(usd_convert):
    made = u.stage("Z", 0.01)
    u.camera(made)
    prim = light(made, "RectLight", width=200.0, height=100.0)
    UsdGeom.XformCommonAPI(prim).SetTranslate((0, 0, 300))
    UsdGeom.XformCommonAPI(prim).SetScale((2, 1, 1))
    gltf = usd_convert(made)
    _, data = gltf.light("Light")
    assert data["extras"]["area"] == {"shape": "rectangle", "size": pytest.approx([4, 1])}
    world = gltf.world(gltf.node("Light"), 1)
    np.testing.assert_allclose(world[:3, 3], (0, 3, 0), atol=1e-6)
    np.testing.assert_allclose(-world[:3, 2], (0, -1, 0), atol=1e-6)
    assert np.linalg.norm(world[:3, 0]) == pytest.approx(1)


def test_temperature_and_cone(usd_convert):
    made = u.stage()
    u.camera(made)
    prim = light(made, "SphereLight", enableColorTemperature=True, colorTemperature=3000.0)
    shaping = UsdLux.ShapingAPI.Apply(prim)
    shaping.CreateShapingConeAngleAttr(30.0)
    shaping.CreateShapingConeSoftnessAttr(0.5)
    _, data = usd_convert(made).light("Light")
    warm = np.array(UsdLux.BlackbodyTemperatureAsRgb(3000.0))
    np.testing.assert_allclose(data["color"], warm / warm.max(), rtol=1e-5)
    assert data["type"] == "spot"
    assert data["spot"]["outerConeAngle"] == pytest.approx(math.radians(30))
    assert data["spot"]["innerConeAngle"] == pytest.approx(math.radians(15))


@pytest.mark.parametrize("angles", [(30.0, 90.0), (120.0, 30.0)])
def test_cones_that_open_wide(usd_convert, angles):
    made = u.stage()
    u.camera(made)
    cone = UsdLux.ShapingAPI.Apply(light(made, "SphereLight")).CreateShapingConeAngleAttr()
    for frame, angle in zip((1, 5), angles, strict=True):
        cone.Set(angle, frame)
    gltf = usd_convert(made)
    want = [min(math.radians(angle), math.pi / 2) for angle in angles]
    data = gltf.light("Light")[1]
    assert (data["type"], data["spot"]["outerConeAngle"]) == ("spot", pytest.approx(want[0], abs=1e-6))
    assert [gltf.light_value("Light", "spot/outerConeAngle", f, 0.0) for f in (1, 5)] == pytest.approx(want, abs=1e-6)
    assert gltf.lost_features("/World/Light") == ["cone that opens to 90 degrees and more"]


def test_cones_of_all_directions_are_none(usd_convert):
    made = u.stage()
    u.camera(made)
    UsdLux.ShapingAPI.Apply(light(made, "SphereLight")).CreateShapingConeAngleAttr(90.0)
    gltf = usd_convert(made)
    assert gltf.light("Light")[1]["type"] == "point"
    assert not gltf.lost_features("/World/Light")


def test_animated_and_hidden(usd_convert):
    made = u.stage()
    u.camera(made)
    prim = light(made, "SphereLight", radius=1.0)
    for frame in (1, 5):
        prim.GetAttribute("inputs:intensity").Set(float(frame), frame)
    UsdGeom.Imageable(prim).CreateVisibilityAttr().Set("inherited", 1)
    UsdGeom.Imageable(prim).GetVisibilityAttr().Set("invisible", 4)
    gltf = usd_convert(made)
    assert gltf.light_value("Light", "intensity", 3, 0.0) == pytest.approx(683 * math.pi * 3, rel=1e-5)
    assert [gltf.visible(gltf.node("Light"), f) for f in (3, 4)] == [True, False]


@pytest.mark.parametrize(
    ("kind", "feature"), [("CylinderLight", "cylinder light"), ("GeometryLight", "GeometryLight light"), ("PortalLight", "PortalLight light")]
)
def test_other_lights_are_named(usd_convert, kind, feature):
    made = u.stage()
    u.camera(made)
    light(made, kind)
    assert feature in usd_convert(made).lost_features("/World/Light")


def test_light_linking_is_named(usd_convert):
    made = u.stage()
    u.camera(made)
    for name, kind in (("Only", "SphereLight"), ("AllBut", "SphereLight"), ("Shadow", "SphereLight"), ("Dome", "DomeLight"), ("Free", "SphereLight")):
        api = UsdLux.LightAPI(made.DefinePrim(f"/World/{name}", kind))
        links = api.GetShadowLinkCollectionAPI() if name == "Shadow" else api.GetLightLinkCollectionAPI()
        if name == "AllBut":
            links.ExcludePath("/World/Card")
        elif name != "Free":
            links.CreateIncludeRootAttr(False)
            links.IncludePath("/World/Card")
    gltf = usd_convert(made)
    assert [gltf.lost_features(f"/World/{n}") for n in ("Only", "AllBut", "Shadow", "Dome")] == [["light linking"]] * 4
    assert not gltf.lost_features("/World/Free")


def test_a_sun_all_over_the_sky(usd_convert):
    made = u.stage()
    u.camera(made)
    UsdLux.DistantLight.Define(made, "/World/Light").CreateAngleAttr(180.0)
    assert usd_convert(made).light("Light")[1]["extras"]["angle"] == pytest.approx(math.pi)


@pytest.mark.parametrize(("name", "value"), [("intensity", math.nan), ("exposure", 5000.0), ("radius", math.inf)])
def test_lights_that_are_no_numbers_are_named(usd_convert, name, value):
    made = u.stage()
    u.camera(made)
    UsdLux.SphereLight.Define(made, "/World/Light").GetPrim().GetAttribute(f"inputs:{name}").Set(value)
    UsdLux.SphereLight.Define(made, "/World/Other")
    gltf = usd_convert(made)
    assert gltf.lost_features("/World/Light") == ["light whose brightness or size is no usable number"]
    assert len(gltf.root["extensions"]["KHR_lights_punctual"]["lights"]) == 1


def test_values_of_a_wrong_type_are_as_if_absent(usd_convert):
    made = u.stage()
    u.camera(made)
    UsdLux.SphereLight.Define(made, "/World/Light")
    spec = made.GetRootLayer().GetPrimAtPath("/World/Light")
    Sdf.AttributeSpec(spec, "inputs:intensity", Sdf.ValueTypeNames.String).default = "much"
    found = usd_convert(made).light("Light")[1]
    assert found["intensity"] == pytest.approx(683 * math.pi / 4)


@pytest.mark.parametrize(
    ("kind", "scale", "named"),
    [("SphereLight", (1, 2, 1), True), ("SphereLight", (2, 2, 2), False), ("CylinderLight", (3, 1, 1), False), ("DiskLight", (1, 2, 1), False)],
)
def test_round_lights_scaled_unevenly_are_named(usd_convert, kind, scale, named):
    made = u.stage()
    u.camera(made)
    light = getattr(UsdLux, kind).Define(made, "/World/Light")
    UsdGeom.XformCommonAPI(light).SetScale(scale)
    assert ("round light that is scaled unevenly" in usd_convert(made).lost_features("/World/Light")) == named


@pytest.mark.parametrize(("kind", "turn", "named"), [("RectLight", 30, True), ("DiskLight", 30, True), ("RectLight", 0, False)])
def test_sheared_lights_are_named(usd_convert, kind, turn, named):
    made = u.stage()
    u.camera(made)
    UsdGeom.XformCommonAPI(UsdGeom.Xform.Define(made, "/World/Rig")).SetScale((2, 1, 1))
    light = getattr(UsdLux, kind).Define(made, "/World/Rig/Light")
    UsdGeom.XformCommonAPI(light).SetRotate((0, 0, turn))
    assert usd_convert(made).lost_features("/World/Rig/Light") == (["sheared area light"] if named else [])


def test_shadow_colours_are_named(usd_convert):
    made = u.stage()
    u.camera(made)
    light = UsdLux.SphereLight.Define(made, "/World/Light")
    UsdLux.ShadowAPI.Apply(light.GetPrim()).CreateShadowColorAttr((1, 0, 0))
    assert usd_convert(made).lost_features("/World/Light") == ["shadow colour or distance"]


def test_shapes_that_are_lights_are_drawn_and_named(usd_convert):
    made = u.stage()
    u.camera(made)
    UsdLux.LightAPI.Apply(UsdGeom.Sphere.Define(made, "/World/Ball").GetPrim())
    gltf = usd_convert(made)
    assert "mesh" in gltf.root["nodes"][gltf.node("Ball")]
    assert gltf.lost_features("/World/Ball") == ["mesh light"]


def test_names_that_look_like_uris(usd_convert, buzz, tmp_path):
    """The world's image is found again by the renderer."""
    Image.new("RGB", (8, 4), (10, 20, 30)).save(tmp_path / "sky.png")
    made = u.stage(frames=None)
    u.camera(made)
    UsdLux.DomeLight(light(made, "DomeLight")).CreateTextureFileAttr("sky.png")
    gltf = usd_convert(made, "a %25 %20#.gltf")
    assert gltf.buzz["world"]["image"] == "a%20%2525%20%2520%23_world.png"
    assert "missing" not in buzz("plan", gltf.path).stderr


def test_output_folder_that_is_a_file(tmp_path):
    (tmp_path / "s.usda").write_text("#usda 1.0\n")
    (tmp_path / "file").write_text("")
    for output in ("file/o.gltf", "file/below/o.glb"):
        done = subprocess.run([sys.executable, str(SCRIPT), str(tmp_path / "s.usda"), str(tmp_path / output)], capture_output=True, text=True, check=False)
        assert (done.returncode, len(done.stderr.splitlines())) == (4, 1), done.stderr
        assert "choose another name or folder" in done.stderr


@pytest.mark.parametrize("turn", [0.0, 40.0])
def test_dome(usd_convert, tmp_path, turn):
    """The image's centre is seen along the dome's +Z (OpenEXR); a quarter to its left is +X."""
    Image.new("RGB", (8, 4), (10, 20, 30)).save(tmp_path / "sky.png")
    made = u.stage()
    u.camera(made)
    prim = light(made, "DomeLight", intensity=2.0, exposure=1.0)
    UsdLux.DomeLight(prim).CreateTextureFileAttr("sky.png")
    UsdGeom.XformCommonAPI(prim).SetRotate((0, turn, 0))
    world = usd_convert(made).buzz["world"]
    assert (world["strength"], world["color"]) == (4, [1, 1, 1])
    a = math.radians(turn)
    for local, u_want in (((0, 0, 1), 0.5), ((1, 0, 0), 0.25), ((-1, 0, 0), 0.75)):
        x, z = local[0] * math.cos(a) + local[2] * math.sin(a), -local[0] * math.sin(a) + local[2] * math.cos(a)
        # docs/extras.md: turn by -rotation about +Y, then u = 0.5 + atan2(z, x) / 2 pi.
        c, s = math.cos(world["rotation"]), math.sin(world["rotation"])
        x, z = c * x - s * z, s * x + c * z
        assert 0.5 + math.atan2(z, x) / (2 * math.pi) == pytest.approx(u_want, abs=1e-5)


@pytest.mark.parametrize(("names", "carried"), [("RGB", True), ("RGBZ", True), ("Y", True), (("Combined.R", "Combined.G", "Combined.B"), False), ("", False)])
def test_domes_of_other_channels(usd_convert, buzz, tmp_path, names, carried):
    """A grey one is given colours, which the renderer wants; one of layers alone is named, and so is a damaged one."""
    openexr = pytest.importorskip("OpenEXR")
    header = {"compression": openexr.ZIP_COMPRESSION, "type": openexr.scanlineimage}
    if names:
        openexr.File(header, {n: np.full((4, 8), 0.5, np.float16) for n in names}).write(str(tmp_path / "sky.exr"))
    else:
        (tmp_path / "sky.exr").write_bytes(b"\x76\x2f\x31\x01 and no more")
    made = u.stage(frames=None)
    u.camera(made)
    UsdLux.DomeLight(light(made, "DomeLight")).CreateTextureFileAttr("sky.exr")
    gltf = usd_convert(made)
    assert ("image" in gltf.buzz["world"]) == carried
    assert gltf.lost_features("/World/Light") == ([] if carried else ["dome texture sky.exr is in a format that cannot be read"])
    if carried:
        with openexr.File(str(tmp_path / "anim_world.exr"), separate_channels=True) as image:
            assert [float(image.channels()[c].pixels[0, 0]) for c in "RGB"] == [0.5] * 3
    buzz("plan", gltf.path)


def test_a_dome_that_changes_is_taken_where_it_is_first_seen(usd_convert):
    made = u.stage()
    u.camera(made)
    made.SetStartTimeCode(1)
    made.SetEndTimeCode(4)
    dome = made.DefinePrim("/World/Dome", "DomeLight")
    dome.GetAttribute("inputs:intensity").Set(1.0)
    visibility = UsdGeom.Imageable(dome).CreateVisibilityAttr()
    visibility.Set("invisible", 1)
    visibility.Set("inherited", 2)
    for time, colour in ((1, (1, 0, 0)), (2, (0, 1, 0)), (3, (0, 0, 1))):
        dome.GetAttribute("inputs:color").Set(colour, time)
    gltf = usd_convert(made)
    assert gltf.buzz["world"]["color"] == [0, 1, 0]
    assert gltf.lost_features("/World/Dome") == ["dome light that changes"]
    assert not gltf.lost_features("stage.usda")


def test_plain_dome_and_second_dome(usd_convert):
    made = u.stage()
    u.camera(made)
    light(made, "DomeLight", intensity=0.5, color=(0.2, 0.4, 0.8))
    made.DefinePrim("/World/More", "DomeLight")
    gltf = usd_convert(made)
    assert np.array(gltf.buzz["world"]["color"]) * gltf.buzz["world"]["strength"] == pytest.approx([0.1, 0.2, 0.4])
    assert gltf.lost_features("/World/More") == ["second dome light"]


@pytest.mark.parametrize(
    ("content", "arguments", "code", "words"),
    [
        (None, [], 3, "no such file"),
        ("not usd at all", [], 3, "not a USD stage"),
        ("#usda 1.0\n", ["--variant", "a=b"], 3, "has it"),
        ("#usda 1.0\n", ["--variant", "a"], 2, "SET=VALUE"),
        ("#usda 1.0\n", ["--camera", "/Nobody"], 3, "the stage has none"),
        ("#usda 1.0\n", ["--frames", "5-1"], 3, "before the first"),
        ("#usda 1.0\n", ["--resolution", "0x0"], 2, "has no pixels"),
        ("#usda 1.0\n", ["--resolution", "64x0"], 2, "has no pixels"),
        ("#usda 1.0\n", ["--resolution", "10x-5"], 2, "has no pixels"),
    ],
)
def test_command_line(tmp_path, content, arguments, code, words):
    if content is not None:
        (tmp_path / "s.usda").write_text(content)
    command = [sys.executable, str(SCRIPT), str(tmp_path / "s.usda"), str(tmp_path / "o.gltf"), *arguments]
    done = subprocess.run(command, capture_output=True, text=True, timeout=60, check=False)
    assert done.returncode == code, done.stderr
    assert words in done.stderr
    assert "Traceback" not in done.stderr


def test_empty_stage_converts(tmp_path):
    (tmp_path / "s.usda").write_text("#usda 1.0\n")
    done = subprocess.run([sys.executable, str(SCRIPT), str(tmp_path / "s.usda"), str(tmp_path / "o.glb")], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    assert "no camera" in done.stderr


def test_stage_without_lights_is_lit_from_the_camera(usd_convert):
    made = u.stage()
    prim = u.camera(made)
    for frame in (1, 5):
        UsdGeom.XformCommonAPI(prim).SetRotate((0, 10.0 * frame, 0), UsdGeom.XformCommonAPI.RotationOrderXYZ, frame)
    gltf = usd_convert(made)
    node = gltf.node("camera light")
    np.testing.assert_allclose(gltf.world(node, 4), gltf.world(gltf.camera_at(4), 4), atol=1e-6)
    assert gltf.lost_features("stage.usda") == ["no lights"]
    dark = usd_convert(made, camera_light=False)
    assert "KHR_lights_punctual" not in dark.root.get("extensions", {})


def test_stage_without_camera_is_left_to_the_turntable(usd_convert):
    made = u.stage()
    UsdGeom.Cube.Define(made, "/Cube")
    gltf = usd_convert(made)
    # A light that stood still would leave most of an orbit black; `--turntable` lights what nothing else does.
    assert "KHR_lights_punctual" not in gltf.root.get("extensions", {})
    assert gltf.lost_features("stage.usda") == ["no camera"]
