"""USD cameras against GfFrustum at every frame, time codes and render settings."""

from __future__ import annotations

import json
import math

import numpy as np
import pytest

pytest.importorskip("pxr", reason="SKIPPED LOUDLY: usd-core is not installed (pip install usd-core)")
import usd_scene as u
from pxr import Gf, Usd, UsdGeom, UsdRender

ZUP = np.array([[1, 0, 0, 0], [0, 0, 1, 0], [0, -1, 0, 0], [0, 0, 0, 1]], float)

CASES = {
    "plain": {},
    "23.976": {"rate": 24 / 1.001},
    "Z up, centimetres": {"up": "Z", "units": 0.01},
    "offsets": {"horizontalApertureOffset": 2.0, "verticalApertureOffset": -3.0},
    "orthographic": {"projection": "orthographic", "horizontalAperture": 80.0, "verticalAperture": 45.0, "horizontalApertureOffset": 8.0},
    "long lens": {"focalLength": 200.0, "clippingRange": Gf.Vec2f(10, 500)},
    "from 101": {"frames": (101, 105)},
}


def build(up="Y", units=1.0, frames=(1, 5), rate=24.0, **lens):
    """A camera that moves, turns and zooms under a scaled parent."""
    made = u.stage(up, units, frames, rate)
    UsdGeom.XformCommonAPI(UsdGeom.Xform.Define(made, "/World/Rig")).SetScale((2, 1, 3))
    prim = u.camera(made, "/World/Rig/Camera", **lens)
    api = UsdGeom.XformCommonAPI(prim)
    for frame in range(frames[0], frames[1] + 1):
        api.SetTranslate((0.3 * frame, 1, 8), frame)
        api.SetRotate((-5, 4.0 * (frame - frames[0]), 2), UsdGeom.XformCommonAPI.RotationOrderXYZ, frame)
        if "projection" not in lens:
            prim.GetFocalLengthAttr().Set(lens.get("focalLength", 50.0) + (frame - frames[0]), frame)
    u.quad(made, "/World/Card")
    return made, prim


def check(made, prim, gltf, frames, plan=None):
    """Projection from GfFrustum, view from the local-to-world transform without its scale."""
    units = UsdGeom.GetStageMetersPerUnit(made)
    node = gltf.camera_at(frames[0])
    for frame in range(frames[0], frames[1] + 1):
        frustum = UsdGeom.Camera(prim).GetCamera(frame).frustum
        if frustum.GetProjectionType() == Gf.Frustum.Orthographic:
            window = frustum.GetWindow()
            frustum.SetWindow(Gf.Range2d(window.GetMin() * units, window.GetMax() * units))
        near_far = frustum.GetNearFar()
        frustum.SetNearFar(Gf.Range1d(near_far.GetMin() * units, near_far.GetMax() * units))
        want = np.array(frustum.ComputeProjectionMatrix()).T
        np.testing.assert_allclose(gltf.clip_from_camera(node, frame), want, atol=1e-5, rtol=2e-5)
        world = u.matrix(prim, frame)
        root = np.diag([units, units, units, 1.0]) @ (ZUP if UsdGeom.GetStageUpAxis(made) == "Z" else np.eye(4))
        world = root @ world
        got = gltf.world(node, frame)
        np.testing.assert_allclose(got[:3, 3], world[:3, 3], atol=1e-5)
        np.testing.assert_allclose(got[:3, 2], world[:3, 2] / np.linalg.norm(world[:3, 2]), atol=1e-5)
        assert np.linalg.norm(got[:3, 0]) == pytest.approx(1, abs=1e-5)
        if plan:
            seen = np.array(plan[frame]["world_from_camera"]).reshape(4, 4).T
            np.testing.assert_allclose(seen, got, atol=1e-5)
            if plan[frame]["ymag"] is None:
                assert 1 / math.tan(plan[frame]["yfov"] / 2) == pytest.approx(want[1, 1], rel=1e-5)


@pytest.mark.parametrize("case", CASES)
def test_matrices(usd_convert, case):
    frames = CASES[case].get("frames", (1, 5))
    made, prim = build(**CASES[case])
    gltf = usd_convert(made)
    # No render settings: the resolution has the camera's own aspect, up to whole pixels.
    lens = gltf.root["cameras"][0]
    gltf.buzz["resolution"] = [lens["perspective"]["aspectRatio"], 1] if lens["type"] == "perspective" else gltf.buzz["resolution"]
    check(made, prim, gltf, frames)


@pytest.mark.parametrize("case", CASES)
def test_matrices_in_the_renderer(usd_convert, buzz, case):
    frames = CASES[case].get("frames", (1, 5))
    made, prim = build(**CASES[case])
    gltf = usd_convert(made)
    plan = {f["frame"]: f for f in json.loads(buzz("plan", "--format", "json", gltf.path).stdout)["frames"]}
    lens = gltf.root["cameras"][0]
    gltf.buzz["resolution"] = [lens["perspective"]["aspectRatio"], 1] if lens["type"] == "perspective" else gltf.buzz["resolution"]
    check(made, prim, gltf, frames, plan)


def test_rates_and_range(usd_convert):
    made, _ = build(rate=24 / 1.001, frames=(101, 105))
    gltf = usd_convert(made)
    assert (gltf.buzz["fps"], gltf.buzz["frame_start"], gltf.buzz["frame_end"]) == ([24000, 1001], 101, 105)
    assert gltf.keys((gltf.camera_at(101), "translation"))[0] == 0


def test_range_from_samples(usd_convert):
    made = u.stage(frames=None)
    prim = u.camera(made)
    for frame in (10, 20):
        UsdGeom.XformCommonAPI(prim).SetTranslate((frame, 0, 0), frame)
    gltf = usd_convert(made)
    assert (gltf.buzz["frame_start"], gltf.buzz["frame_end"]) == (10, 20)


def test_range_from_samples_in_instances(usd_convert):
    made = u.stage(frames=None)
    u.camera(made)
    made.CreateClassPrim("/Model")
    moved = UsdGeom.XformCommonAPI(u.cube(made, "/Model/Part"))
    for frame in (10, 20):
        moved.SetTranslate((frame, 0, 0), frame)
    prim = made.DefinePrim("/World/Instance", "Xform")
    prim.GetReferences().AddInternalReference("/Model")
    prim.SetInstanceable(True)
    gltf = usd_convert(made)
    assert (gltf.buzz["frame_start"], gltf.buzz["frame_end"]) == (10, 20)


def test_range_from_splines(usd_convert):
    from pxr import Ts

    made = u.stage(frames=None)
    curve = Ts.Spline("double")
    for time, value in ((10, 0.0), (20, 8.0)):
        knot = Ts.Knot(time=time, value=value, nextInterp=Ts.InterpLinear)
        curve.SetKnot(knot)
    u.camera(made).AddTranslateXOp().GetAttr().SetSpline(curve)
    gltf = usd_convert(made)
    assert (gltf.buzz["frame_start"], gltf.buzz["frame_end"]) == (10, 20)
    assert gltf.world(gltf.camera_at(10), 15)[0, 3] == pytest.approx(4)


@pytest.mark.parametrize("rate", [-24.0, math.nan, math.inf, 1e-9])
def test_rates_that_are_no_numbers_are_one_clear_error(usd_convert, rate):
    from exporters.common.report import InputError

    made = u.stage(rate=rate)
    u.camera(made)
    with pytest.raises(InputError, match="timeCodesPerSecond is"):
        usd_convert(made)


@pytest.mark.parametrize(
    ("codes", "rate", "span", "frames"),
    [(24.0, 23.976, (1, 12), (1, 12)), (24.0, 24.0, (0.75, 4.25), (1, 5)), (1000.0, 24.0, (10, 1000), (1, 24)), (24.0, 24.0, (-2.5, 0), (-2, 0))],
)
def test_no_frame_is_before_the_start(usd_convert, codes, rate, span, frames):
    made = u.stage(frames=span, rate=codes)
    made.SetFramesPerSecond(rate)
    u.camera(made)
    gltf = usd_convert(made)
    assert (gltf.buzz["frame_start"], gltf.buzz["frame_end"]) == frames


@pytest.mark.parametrize(
    ("policy", "p00", "p11"),
    [("expandAperture", 2.0, 2.0), ("cropAperture", 4.0, 4.0), ("adjustApertureWidth", 4.0, 4.0), ("adjustApertureHeight", 2.0, 2.0)],
)
def test_render_settings(usd_convert, policy, p00, p11):
    """A camera of aspect 2 seen in a square picture."""
    made = u.stage()
    u.camera(made, "/World/Other")
    u.camera(made, horizontalAperture=40.0, verticalAperture=20.0, focalLength=40.0)
    settings = UsdRender.Settings.Define(made, "/Render/Settings")
    made.SetMetadata("renderSettingsPrimPath", "/Render/Settings")
    settings.CreateResolutionAttr(Gf.Vec2i(100, 100))
    settings.CreateAspectRatioConformPolicyAttr(policy)
    settings.CreateCameraRel().SetTargets(["/World/Camera"])
    gltf = usd_convert(made)
    assert gltf.buzz["resolution"] == [100, 100]
    assert gltf.buzz["aspect_policy"] == policy
    assert gltf.buzz["cuts"][0]["camera"] == "/World/Camera"
    p = gltf.clip_from_camera(gltf.camera_at(1), 1)
    assert (p[0, 0], p[1, 1]) == (pytest.approx(p00), pytest.approx(p11))


def test_products_override_settings(usd_convert):
    made = u.stage()
    u.camera(made)
    settings = UsdRender.Settings.Define(made, "/Render/Settings")
    settings.CreateResolutionAttr(Gf.Vec2i(100, 100))
    product = UsdRender.Product.Define(made, "/Render/Product")
    product.CreateResolutionAttr(Gf.Vec2i(64, 36))
    product.CreatePixelAspectRatioAttr(2.0)
    settings.CreateProductsRel().SetTargets(["/Render/Product"])
    gltf = usd_convert(made)
    assert (gltf.buzz["resolution"], gltf.buzz["pixel_aspect"]) == ([64, 36], 2)


def test_what_render_settings_ask_for_in_vain_is_named(usd_convert):
    made = u.stage()
    u.camera(made)
    settings = UsdRender.Settings.Define(made, "/Render/Settings")
    assert not usd_convert(made).lost_features("/Render/Settings")
    settings.CreateIncludedPurposesAttr(["default", "proxy"])
    settings.CreateMaterialBindingPurposesAttr(["preview", ""])
    products = [UsdRender.Product.Define(made, f"/Render/{name}").GetPath() for name in ("Beauty", "Wide")]
    settings.CreateProductsRel().SetTargets(products)
    assert usd_convert(made).lost_features("/Render/Settings") == ["includedPurposes", "materialBindingPurposes", "several products"]


@pytest.mark.parametrize(("name", "value"), [("resolution", Gf.Vec2i(0, 100)), ("pixelAspectRatio", 0.0)])
def test_settings_without_pixels_are_one_clear_error(usd_convert, name, value):
    from exporters.common.report import InputError

    made = u.stage()
    u.camera(made)
    settings = UsdRender.Settings.Define(made, "/Render/Settings")
    settings.GetPrim().GetAttribute(name).Set(value)
    with pytest.raises(InputError, match=f"/Render/Settings: .*{name}"):
        usd_convert(made)


@pytest.mark.parametrize("settings", ["text", {"boundCamera": "/World/B"}, {"boundCamera": "/Viewer"}, {}])
def test_the_camera_bound_in_a_viewer(usd_convert, settings):
    made = u.stage()
    u.camera(made, "/World/A")
    u.camera(made, "/World/B")
    made.GetRootLayer().customLayerData = {"cameraSettings": settings}
    want = "/World/B" if settings == {"boundCamera": "/World/B"} else "/World/A"
    assert usd_convert(made).buzz["cuts"][0]["camera"] == want


def test_chosen_camera(usd_convert):
    from exporters.common.report import InputError

    made = u.stage()
    u.camera(made, "/World/A")
    u.camera(made, "/World/B")
    assert usd_convert(made, camera="/World/B").buzz["cuts"][0]["camera"] == "/World/B"
    assert usd_convert(made, camera="B").buzz["cuts"][0]["camera"] == "/World/B"
    with pytest.raises(InputError, match="/World/A"):
        usd_convert(made, camera="/World/C")


@pytest.mark.parametrize("name", ["horizontalAperture", "verticalAperture", "focalLength"])
def test_a_camera_that_takes_no_picture(usd_convert, name):
    """It is named; only where it is the one to look through, the export stops. One that is bad at one frame only is bad."""
    from exporters.common.report import InputError

    made = u.stage()
    bad = u.camera(made, "/World/Bad").GetPrim().GetAttribute(name)
    bad.Set(20.0, 1)
    bad.Set(0.0, 5)
    with pytest.raises(InputError, match=f"camera /World/Bad: {name} is 0"):
        usd_convert(made)
    u.camera(made, "/World/Good")
    gltf = usd_convert(made)
    assert gltf.lost_features("/World/Bad") == [f"camera whose {name} is 0"]
    assert (gltf.buzz["cuts"][0]["camera"], len(gltf.root["cameras"])) == ("/World/Good", 1)
    with pytest.raises(InputError, match=f"camera /World/Bad: {name} is 0"):
        usd_convert(made, camera="Bad")


def test_shutter_and_depth_of_field(usd_convert):
    made = u.stage()
    u.camera(made, fStop=2.8, focusDistance=5.0)
    prim = UsdGeom.Camera(made.GetPrimAtPath("/World/Camera"))
    prim.CreateShutterOpenAttr(-0.25)
    prim.CreateShutterCloseAttr(0.25)
    gltf = usd_convert(made)
    assert gltf.buzz["shutter"] == 0.5
    assert gltf.root["cameras"][0]["extras"]["dof"]["fstop"] == pytest.approx(2.8)
    assert gltf.lost_features("/World/Camera") == ["depth of field"]
    assert Usd.TimeCode.Default() is not None


@pytest.mark.parametrize(("name", "value"), [("exposure", 2.0), ("exposure:time", 0.5), ("exposure:iso", 200.0), ("exposure:fStop", 4.0)])
def test_exposure_is_named(usd_convert, name, value):
    made = u.stage()
    u.camera(made, **{name: value})
    assert usd_convert(made).lost_features("/World/Camera") == ["exposure"]


@pytest.mark.parametrize(("rate", "codes"), [(24.0, 1000.0), (25.0, 5.0), (24 / 1.001, 24000 / 1001), (24 / 1.001, 23.976)])
def test_frames_per_second(usd_convert, rate, codes):
    """A second of movement is as many frames as the stage's framesPerSecond says, whatever its time codes are."""
    made = u.stage(frames=None, rate=codes)
    made.SetFramesPerSecond(rate)
    made.SetStartTimeCode(0)
    made.SetEndTimeCode(codes)
    prim = u.camera(made)
    for second in (0, 1):
        UsdGeom.XformCommonAPI(prim).SetTranslate((second * 24.0, 0, 0), second * codes)
    prim.CreateShutterOpenAttr(0.0)
    prim.CreateShutterCloseAttr(codes / rate / 2)
    gltf = usd_convert(made)
    last = math.ceil(rate - 1e-6)
    assert gltf.buzz["fps"][0] / gltf.buzz["fps"][1] == pytest.approx(rate, rel=1e-6)
    assert (gltf.buzz["frame_start"], gltf.buzz["frame_end"]) == (0, last)
    assert gltf.world(gltf.camera_at(0), 12)[0, 3] == pytest.approx(12 * 24 / rate, abs=1e-4)
    assert gltf.buzz["shutter"] == pytest.approx(0.5, rel=1e-5)


def test_what_a_lens_has_that_is_not_carried_is_named(usd_convert):
    """Clipping planes, a near plane behind an orthographic camera, a stop that opens late."""
    made = u.stage()
    u.camera(made, clippingPlanes=[Gf.Vec4f(0, 0, 1, -2)])
    u.camera(made, "/World/Flat", projection="orthographic", clippingRange=Gf.Vec2f(-5, 5))
    late = u.camera(made, "/World/Late").GetFStopAttr()
    late.Set(0.0, 1)
    late.Set(2.8, 5)
    gltf = usd_convert(made)
    assert gltf.lost_features("/World/Camera") == ["clipping planes"]
    assert gltf.lost_features("/World/Flat") == ["near plane behind the camera"]
    assert gltf.lost_features("/World/Late") == ["depth of field"]
