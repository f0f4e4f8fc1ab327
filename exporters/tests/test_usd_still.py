"""What does not change is sampled once and kept once."""

from __future__ import annotations

import numpy as np
import pytest

pytest.importorskip("pxr", reason="SKIPPED LOUDLY: usd-core is not installed (pip install usd-core)")
import usd_scene as u
from exporters.common.report import Lost
from exporters.usd import mesh
from exporters.usd.walk import Walker
from pxr import Usd, UsdGeom, UsdLux


def move(prim, *frames, step=1.0):
    """Translate along X by `step` a frame."""
    for frame in frames:
        UsdGeom.XformCommonAPI(prim).SetTranslate((step * frame, 0, 0), frame)


def instancer(made, path, prototype):
    """Three instances of what `prototype` makes at a path."""
    prim = UsdGeom.PointInstancer.Define(made, path)
    prototype(f"{path}/Proto")
    prim.CreatePrototypesRel().SetTargets([f"{path}/Proto"])
    prim.CreateProtoIndicesAttr([0, 0, 0])
    prim.CreatePositionsAttr().Set([(0, 0, 0), (3, 0, 0), (6, 0, 0)])
    return prim


def crowd():
    """Still things and things that change, each in its own way; and the paths of those that change."""
    made = u.stage()
    u.camera(made)
    u.quad(made, "/World/Still")
    UsdLux.SphereLight.Define(made, "/World/StillLight")
    instancer(made, "/World/StillMany", lambda path: u.quad(made, path))
    group = UsdGeom.Xform.Define(made, "/World/Rides")
    move(group, 1, 5)
    u.quad(made, "/World/Rides/Card")
    UsdLux.SphereLight.Define(made, "/World/Dims").CreateIntensityAttr().Set(1.0, 1)
    made.GetAttributeAtPath("/World/Dims.inputs:intensity").Set(2.0, 5)
    blink = u.quad(made, "/World/Blink").CreateVisibilityAttr()
    blink.Set("inherited", 1)
    blink.Set("invisible", 3)
    instancer(made, "/World/Moved", lambda path: u.quad(made, path)).GetPositionsAttr().Set([(0, 1, 0), (3, 1, 0), (6, 1, 0)], 5)
    made.GetAttributeAtPath("/World/Moved.positions").Set([(0, 0, 0), (3, 0, 0), (6, 0, 0)], 1)

    def turning(path):
        UsdGeom.Xform.Define(made, path)
        move(u.quad(made, f"{path}/Inner"), 1, 5)

    instancer(made, "/World/Inside", turning)
    return made, {"/World/Rides/Card", "/World/Dims", "/World/Blink", "/World/Moved", "/World/Inside"}


def test_only_what_changes_is_looked_at_again():
    made, changing = crowd()
    walker = Walker(made, Lost())
    everything = {f.key[0] for f in walker.at(Usd.TimeCode(1))}
    assert {f.key[0] for f in walker.at(Usd.TimeCode(2), still=False)} == changing
    assert everything == changing | {"/World/Still", "/World/StillLight", "/World/StillMany", "/World/Camera"}


def test_both_are_where_they_should_be(usd_convert):
    made, _ = crowd()
    gltf = usd_convert(made)
    for frame in (1, 2, 5):
        assert gltf.world(gltf.node("Card"), frame)[0, 3] == pytest.approx(frame)
        assert gltf.visible(gltf.node("Blink"), frame) == (frame < 3)
        assert gltf.light_value("Dims", "intensity", frame, 0) / gltf.light_value("Dims", "intensity", 1, 0) == pytest.approx(1 + (frame - 1) / 4)
        inner = [i for i, n in enumerate(gltf.root["nodes"]) if n["name"] == "Inner"]
        assert [gltf.world(n, frame)[0, 3] for n in inner] == pytest.approx([frame, 3 + frame, 6 + frame])
        protos = [gltf.world(i, frame)[:2, 3] for i, n in enumerate(gltf.root["nodes"]) if n["name"] == "Proto"]
        np.testing.assert_allclose(protos, [(x, y) for y in (0, (frame - 1) / 4) for x in (0, 3, 6)], atol=1e-6)
    assert not gltf.animated((gltf.node("Still"), "translation"))


@pytest.fixture
def made_poses(monkeypatch):
    """The number of times a mesh has been made; a list of one number."""
    count, real = [0], mesh._polygons

    def counting(*arguments, **named):
        count[0] += 1
        return real(*arguments, **named)

    monkeypatch.setattr(mesh, "_polygons", counting)
    return count


def test_points_that_stay_are_read_once(usd_convert, made_poses):
    """Many exporters write the same points at every frame."""
    made = u.stage(frames=(1, 20))
    u.camera(made)
    prim = u.cube(made, "/World/Box", "catmullClark")
    points = prim.GetPointsAttr().Get()
    for frame in range(1, 21):
        prim.GetPointsAttr().Set(points, frame)
    gltf = usd_convert(made)
    assert made_poses == [1]
    assert not gltf.animated((gltf.node("Box"), "weights"))


def test_poses_that_come_again_are_made_once(usd_convert, made_poses):
    """Down for a while, up, down for a while, up again: every frame as it was."""
    made = u.stage(frames=(1, 20))
    u.camera(made)
    prim = u.quad(made, "/World/Card")
    up = {8: 1, 9: 2, 10: 1, 16: 2, 17: 1}
    for frame in range(1, 21):
        prim.GetPointsAttr().Set([(-1, -1, 0), (1, -1, 0), (1, 1, up.get(frame, 0)), (-1, 1, 0)], frame)
    gltf = usd_convert(made)
    assert made_poses == [3]
    for frame in range(1, 21):
        assert gltf.posed_points(gltf.node("Card"), frame)[:, 2].max() == pytest.approx(up.get(frame, 0), abs=1e-4)
