"""Camera matrices against Blender's own, at every frame."""

from __future__ import annotations

import json
import math

import numpy as np
import pytest
from exporters.common.report import InputError

CASES = {
    "plain": {},
    "23.976 from 101": {"fps": (24, 1.001), "start": 101},
    "29.97 negative frames": {"fps": (30, 1.001), "start": -5},
    "vertical fit": {"lens": {"sensor_fit": "VERTICAL", "sensor_height": 20.0}},
    "horizontal fit, portrait": {"size": (36, 64), "lens": {"sensor_fit": "HORIZONTAL"}},
    "auto fit, portrait, shift": {"size": (36, 64), "lens": {"shift_x": 0.1, "shift_y": -0.25}},
    "shift": {"lens": {"shift_x": -0.2, "shift_y": 0.3}},
    "vertical fit, shift": {"lens": {"sensor_fit": "VERTICAL", "shift_x": 0.2, "shift_y": 0.1}},
    "ortho": {"lens": {"type": "ORTHO", "ortho_scale": 7.0}},
    "ortho, portrait, shift": {"size": (36, 64), "lens": {"type": "ORTHO", "ortho_scale": 7.0, "shift_x": 0.2, "shift_y": 0.4}},
    "pixel aspect": {"aspect": (2.0, 1.0), "lens": {"shift_x": 0.1}},
    "tall pixels": {"aspect": (1.0, 1.5), "lens": {"sensor_fit": "VERTICAL"}},
    "percentage": {"percent": 50},
    "field of view": {"lens": {"lens_unit": "FOV", "angle": 1.9}},
}


def build(blender, fps=(24, 1.0), start=1, size=(64, 36), lens=None, aspect=(1.0, 1.0), percent=100):
    """A camera that flies, turns, zooms and shifts for five frames."""
    import blender_scene as b

    scene = blender.context.scene
    scene.render.fps, scene.render.fps_base = fps
    scene.frame_start, scene.frame_end = start, start + 4
    scene.render.resolution_x, scene.render.resolution_y = size
    scene.render.resolution_percentage = percent
    scene.render.pixel_aspect_x, scene.render.pixel_aspect_y = aspect
    ob = b.camera(**(lens or {}))
    b.cube()
    b.key(ob, "location", {start: (0, -8, 2), start + 4: (3, -6, 1)}, interpolation="BEZIER")
    b.key(ob, "rotation_euler", {start: (1.3, 0, 0), start + 4: (1.4, 0.2, 0.6)}, interpolation="BEZIER")
    return scene, ob


def check(blender, gltf, ob, frames, buzz=None):
    """Compare projection and view at every frame, and the renderer's plan where it is there."""
    import blender_scene as b

    plan = {}
    if buzz is not None:
        plan = {f["frame"]: f for f in json.loads(buzz("plan", "--format", "json", gltf.path).stdout)["frames"]}
    for frame in frames:
        depsgraph = b.set_frame(frame)
        node = gltf.camera_at(frame)
        want_p, want_v = b.expected_projection(ob, depsgraph), b.expected_view(ob, depsgraph)
        np.testing.assert_allclose(gltf.clip_from_camera(node, frame), want_p, atol=1e-5, rtol=1e-5)
        np.testing.assert_allclose(np.linalg.inv(gltf.world(node, frame)), want_v, atol=1e-5)
        if plan:
            seen = plan[frame]
            world = np.array(seen["world_from_camera"]).reshape(4, 4).T
            np.testing.assert_allclose(np.linalg.inv(world), want_v, atol=1e-5)
            np.testing.assert_allclose(seen["shift"], [want_p[0, 2], want_p[1, 2]] if seen["ymag"] is None else [-want_p[0, 3], -want_p[1, 3]], atol=1e-5)
            if seen["ymag"] is None:
                assert 1 / math.tan(seen["yfov"] / 2) == pytest.approx(want_p[1, 1], rel=1e-5)
            else:
                assert 1 / seen["ymag"] == pytest.approx(want_p[1, 1], rel=1e-5)


@pytest.mark.parametrize("case", CASES)
def test_matrices(blender, export, case):
    scene, ob = build(blender, **CASES[case])
    check(blender, export(), ob, range(scene.frame_start, scene.frame_end + 1))


@pytest.mark.parametrize("case", CASES)
def test_matrices_in_the_renderer(blender, export, buzz, case):
    scene, ob = build(blender, **CASES[case])
    check(blender, export(), ob, range(scene.frame_start, scene.frame_end + 1), buzz)


def test_animated_lens_shift_and_clip(blender, export):
    import blender_scene as b

    _scene, ob = build(blender)
    b.key(ob.data, "lens", {1: 35.0, 5: 80.0})
    b.key(ob.data, "shift_x", {1: 0.0, 5: 0.3})
    b.key(ob.data, "clip_start", {1: 0.1, 5: 0.5})
    gltf = export()
    check(blender, gltf, ob, range(1, 6))
    for pointer in ("/cameras/0/perspective/yfov", "/cameras/0/perspective/znear", "/cameras/0/extras/shift"):
        assert gltf.animated(pointer)


def test_animated_ortho_scale(blender, export):
    import blender_scene as b

    _, ob = build(blender, lens={"type": "ORTHO"})
    b.key(ob.data, "ortho_scale", {1: 4.0, 5: 9.0})
    check(blender, export(), ob, range(1, 6))


def test_rig_with_scale_track_to_and_follow_path(blender, export):
    """Constraints and unevenly scaled, rotated parents: position and direction, never the scale."""
    import blender_scene as b

    scene = blender.context.scene
    scene.frame_end = 8
    rig = b.link(blender.data.objects.new("Rig", None))
    rig.scale = (2, 1, 0.5)
    rig.rotation_euler = (0.2, 0.3, 0.4)
    curve = blender.data.curves.new("Path", "CURVE")
    curve.dimensions, curve.use_path, curve.path_duration = "3D", True, 8
    spline = curve.splines.new("POLY")
    spline.points.add(3)
    for point, co in zip(spline.points, [(-5, -8, 1), (-2, -9, 2), (2, -9, 3), (5, -7, 1)], strict=True):
        point.co = (*co, 1)
    path = b.link(blender.data.objects.new("Path", curve))
    b.key(curve, "eval_time", {1: 0.0, 8: 8.0})
    target = b.cube("Target")
    b.key(target, "location", {1: (0, 0, 0), 8: (1, 1, 1)})
    ob = b.camera(location=(0, 0, 0))
    ob.parent = rig
    follow = ob.constraints.new("FOLLOW_PATH")
    follow.target = path
    track = ob.constraints.new("TRACK_TO")
    track.target, track.track_axis, track.up_axis = target, "TRACK_NEGATIVE_Z", "UP_Y"
    gltf = export()
    assert gltf.animated((gltf.node("Camera"), "translation"))
    check(blender, gltf, ob, range(1, 9))


def test_sub_frame_samples_where_the_camera_whips(blender, export):
    """A quarter turn a frame: straight lines between frames are wrong, so keys stand between frames."""
    import blender_scene as b

    scene = blender.context.scene
    scene.frame_end = 6
    ob = b.camera()
    b.cube()
    b.key(ob, "rotation_euler", {1: 0.0, 6: 7.0}, index=2)
    gltf = export()
    node = gltf.node("Camera")
    times = gltf.keys((node, "rotation"))
    assert len(times) > 6
    scene.frame_set(3, subframe=0.5)
    depsgraph = blender.context.evaluated_depsgraph_get()
    np.testing.assert_allclose(np.linalg.inv(gltf.world(node, 3.5)), b.expected_view(ob, depsgraph), atol=1e-4)


def test_slow_cameras_have_one_key_a_frame(blender, export):
    import blender_scene as b

    blender.context.scene.frame_end = 25
    ob = b.camera()
    b.key(ob, "location", {1: (0, -8, 2), 25: (2, -8, 2)})
    gltf = export()
    assert len(gltf.keys((gltf.node("Camera"), "translation"))) == 25


def test_sensor_and_depth_of_field_are_carried_and_named(blender, export):
    import blender_scene as b

    ob = b.camera(lens=50.0, sensor_width=36.0)
    focus = b.cube("Focus", location=(0, 2, 2))
    ob.data.dof.use_dof, ob.data.dof.focus_object, ob.data.dof.aperture_fstop = True, focus, 1.4
    ob.rotation_euler = (math.pi / 2, 0, 0)
    gltf = export()
    extras = gltf.root["cameras"][0]["extras"]
    assert extras["sensor"] == pytest.approx([36, 20.25])
    assert extras["dof"] == pytest.approx({"focus_distance": 10, "fstop": 1.4, "focal_length": 50}, rel=1e-5)
    assert gltf.lost_features("Camera") == ["depth of field"]


def test_panoramic_camera_is_named(blender, export):
    import blender_scene as b

    ob = b.camera()
    ob.data.type = "PANO"
    assert "pano camera" in export().lost_features("Camera")


@pytest.mark.parametrize("first", ["PERSP", "ORTHO"])
def test_a_projection_that_changes_is_held_and_named(blender, export, first):
    import blender_scene as b

    camera = b.camera()
    other = {"PERSP": "ORTHO", "ORTHO": "PERSP"}[first]
    b.key(camera.data, "type", {1: first, 2: other}, interpolation="CONSTANT")
    gltf = export()
    assert gltf.root["cameras"][0]["type"] == {"PERSP": "perspective", "ORTHO": "orthographic"}[first]
    assert gltf.lost_features("Camera") == ["projection that changes from perspective to orthographic"]
    want = b.expected_projection(camera, b.set_frame(1))
    for frame in (1, 2):
        np.testing.assert_allclose(gltf.clip_from_camera(gltf.node("Camera"), frame)[:2], want[:2], atol=1e-5)


@pytest.mark.parametrize("case", ["clipping", "scale", "place"])
def test_a_camera_without_a_picture_stops_only_its_own_shots(blender, export, case):
    import blender_scene as b

    b.camera()
    bad = b.camera("Bad")
    if case == "clipping":
        bad.data.clip_start = bad.data.clip_end = 1
    elif case == "scale":
        bad.data.type, bad.data.ortho_scale = "ORTHO", 0
    else:
        bad.location.x = math.nan
    gltf = export()
    assert [camera["name"] for camera in gltf.root["cameras"]] == ["Camera"]
    assert gltf.lost_features("Bad") == ["lens or transform that is no usable number"]
    with pytest.raises(InputError, match="camera 'Bad': its lens or transform is no usable number"):
        export(camera="Bad")


def test_a_sheared_camera_is_named(blender, export):
    import blender_scene as b

    camera = b.camera()
    camera.parent = b.link(blender.data.objects.new("Rig", None))
    camera.parent.scale = (2, 1, 1)
    assert export().lost_features("Camera") == []
    camera.parent.scale = (1, 1, 2)
    assert export().lost_features("Camera") == ["sheared camera"]
