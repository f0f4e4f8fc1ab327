"""Frames, rates, cuts, visibility: everything of time that glTF does not know."""

from __future__ import annotations

import json

import numpy as np
import pytest
from exporters.common.extras import rational, simplify_cuts


@pytest.mark.parametrize(
    ("fps", "base", "want"),
    [
        (24, 1.0, (24, 1)), (24, 1.001, (24000, 1001)), (30, 1.001, (30000, 1001)), (60, 1.001, (60000, 1001)), (25, 1.0, (25, 1)),
        (24, float(np.float32(1.001)), (24000, 1001)), (23.976, 1.0, (24000, 1001)), (29.97, 1.0, (30000, 1001)), (12.5, 1.0, (25, 2)),
        (15, 1.0, (15, 1)), (24, 2.0, (12, 1)),
    ],
)  # fmt: skip
def test_rates_are_exact(fps, base, want):
    assert rational(fps, base) == want


def test_first_cut_stands_at_the_first_frame():
    cuts = [{"frame": 20, "node": 1}, {"frame": 30, "node": 2}, {"frame": 40, "node": 2}, {"frame": 90, "node": 3}]
    assert simplify_cuts(cuts, 10, 50) == [{"frame": 10, "node": 1}, {"frame": 30, "node": 2}]
    assert simplify_cuts(cuts, 35, 50) == [{"frame": 35, "node": 2}]
    assert simplify_cuts([], 1, 2) == []


def test_scene_extras(blender, export):
    import blender_scene as b

    scene = blender.context.scene
    scene.render.fps, scene.render.fps_base = 24, 1.001
    scene.frame_start, scene.frame_end = 101, 103
    scene.render.resolution_x, scene.render.resolution_y, scene.render.resolution_percentage = 1920, 1080, 50
    scene.render.pixel_aspect_x = 2.0
    scene.render.use_motion_blur, scene.render.motion_blur_shutter = True, 0.5
    b.camera("Cam.A")
    gltf = export()
    assert gltf.buzz["fps"] == [24000, 1001]
    assert (gltf.buzz["frame_start"], gltf.buzz["frame_end"]) == (101, 103)
    assert gltf.buzz["resolution"] == [960, 540]
    assert gltf.buzz["pixel_aspect"] == 2
    assert gltf.buzz["shutter"] == 0.5
    assert gltf.buzz["cuts"] == [{"frame": 101, "camera": "Cam.A", "node": gltf.node("Cam.A")}]
    assert "motion blur" in gltf.lost_features("Scene")


def test_keys_stand_on_frames(blender, export):
    """Every key's time is (frame - frame_start) / fps, at 23.976 too, within single precision."""
    import blender_scene as b

    scene = blender.context.scene
    scene.render.fps, scene.render.fps_base = 24, 1.001
    scene.frame_start, scene.frame_end = 101, 201
    ob = b.camera()
    b.key(ob, "location", {101: (0, -8, 2), 201: (9, -8, 2)}, interpolation="BEZIER")
    gltf = export()
    frames = gltf.keys((gltf.node("Camera"), "translation")) * 24000 / 1001
    assert np.abs(frames - np.round(frames)).max() < 1e-3
    assert frames[0] == 0
    assert round(frames[-1]) == 100


def cut_scene(blender):
    """Two cameras; the second from frame 7 on, by markers; the camera of a third marker is hidden from render."""
    import blender_scene as b

    scene = blender.context.scene
    scene.frame_start, scene.frame_end = 1, 12
    cameras = [b.camera("Cam.A"), b.camera("Cam.B", location=(6, -6, 3)), b.camera("Cam.C")]
    cameras[2].hide_render = True
    b.cube()
    for frame, ob in ((3, cameras[0]), (7, cameras[1]), (9, cameras[2])):
        scene.timeline_markers.new(f"m{frame}", frame=frame).camera = ob
    return cameras


def test_markers_become_cuts(blender, export):
    cut_scene(blender)
    gltf = export()
    assert [(c["frame"], c["camera"]) for c in gltf.buzz["cuts"]] == [(1, "Cam.A"), (7, "Cam.B")]
    assert gltf.camera_at(2) == gltf.node("Cam.A")
    assert gltf.camera_at(7) == gltf.node("Cam.B")


def test_of_markers_at_one_frame_the_first_counts(blender, export):
    cameras = cut_scene(blender)
    blender.context.scene.timeline_markers.new("Again", frame=7).camera = cameras[0]
    blender.context.scene.frame_set(7)
    assert blender.context.scene.camera == cameras[1]
    gltf = export()
    assert gltf.camera_at(7) == gltf.node("Cam.B")


def test_cameras_of_one_name_are_not_mixed_up(blender, export, tmp_path):
    import blender_scene as b

    here = b.camera("Camera", location=(1, 0, 0))
    blender.data.libraries.write(str(tmp_path / "library.blend"), {here})
    with blender.data.libraries.load(str(tmp_path / "library.blend"), link=True) as (_, wanted):
        wanted.objects = ["Camera"]
    b.link(wanted.objects[0])
    here.location = (2, 0, 0)
    for frame, ob in ((1, wanted.objects[0]), (2, here)):
        blender.context.scene.timeline_markers.new("Cut", frame=frame).camera = ob
    gltf = export()
    assert [gltf.world(gltf.camera_at(frame), frame)[0, 3] for frame in (1, 2)] == [1, 2]


def test_cut_starts_a_segment(blender, export, buzz):
    """Frame 7 is the first of a segment whose key frame has the reason `cut`, and no frame is inferred from across it."""
    cut_scene(blender)
    gltf = export()
    plan = json.loads(buzz("plan", "--format", "json", gltf.path).stdout)
    reasons = {k["frame"]: k["reason"] for k in plan["keyframes"]}
    assert [reasons[s["key"]] for s in plan["segments"] if s["first"] == 7] == ["cut"]
    for frame in plan["frames"]:
        if frame["from"] is not None:
            assert (frame["from"] < 7) == (frame["frame"] < 7)


def test_one_camera_for_all(blender, export):
    cut_scene(blender)
    gltf = export(camera="Cam.B")
    assert [c["camera"] for c in gltf.buzz["cuts"]] == ["Cam.B"]


def test_animated_hide_render(blender, export):
    import blender_scene as b

    scene = blender.context.scene
    scene.frame_end = 6
    b.camera()
    ob = b.cube("Blinker")
    child = b.cube("Child", location=(3, 0, 0))
    child.parent = ob
    b.key(ob, "hide_render", {1: False, 3: True, 5: False}, interpolation="CONSTANT")
    gltf = export()
    node = gltf.node("Blinker")
    assert [gltf.visible(node, f) for f in range(1, 7)] == [True, True, False, False, True, True]
    assert all(gltf.visible(gltf.node("Child"), f) for f in range(1, 7)), "hiding is not inherited in Blender"
    assert "KHR_node_visibility" not in gltf.root.get("extensionsRequired", [])


def test_hidden_things_are_left_out_and_viewport_does_not_count(blender, export):
    import blender_scene as b

    b.camera()
    b.cube("Hidden").hide_render = True
    b.cube("Viewport only").hide_viewport = True
    hidden = blender.data.collections.new("Off")
    hidden.hide_render = True
    blender.context.scene.collection.children.link(hidden)
    ob = b.cube("In hidden collection")
    blender.context.scene.collection.objects.unlink(ob)
    hidden.objects.link(ob)
    names = [n["name"] for n in export().root["nodes"]]
    assert "Viewport only" in names
    assert "Hidden" not in names
    assert "In hidden collection" not in names


def test_appearing_late(blender, export):
    import blender_scene as b

    scene = blender.context.scene
    scene.frame_end = 4
    b.camera()
    ob = b.cube("Late")
    b.key(ob, "hide_render", {1: True, 3: False}, interpolation="CONSTANT")
    gltf = export()
    assert [gltf.visible(gltf.node("Late"), f) for f in range(1, 5)] == [False, False, True, True]


def test_named_losses_of_the_scene(blender, export):
    import blender_scene as b

    scene = blender.context.scene
    scene.frame_step = 2
    scene.render.use_border = True
    scene.render.frame_map_new = 200
    features = export().lost_features("Scene")
    assert {"frame step 2", "render region", "time stretching", "no camera"} <= set(features)
    assert b.bpy is blender


def test_a_modifier_is_on_when_the_render_has_it_on(blender, export):
    import blender_scene as b

    blender.context.scene.frame_end = 4
    b.camera()
    ob = b.cube("Two")
    array = ob.modifiers.new("Array", "ARRAY")
    b.key(array, "show_render", {1: False, 3: True}, interpolation="CONSTANT")
    array.driver_add("show_viewport").driver.expression = "0"
    smooth = ob.modifiers.new("Smooth", "SUBSURF")
    smooth.render_levels = 2
    smooth.driver_add("levels").driver.expression = "1"
    gltf = export()
    nodes = [i for i, n in enumerate(gltf.root["nodes"]) if n["name"] == "Two"]
    faces = [sum(len(gltf.triangles(n)) for n in nodes if gltf.visible(n, f)) for f in range(1, 5)]
    assert faces == [192, 192, 384, 384]


def push_down(ob):
    """Move an object's action into an NLA strip."""
    data = ob.animation_data
    data.nla_tracks.new().strips.new("Strip", 1, data.action)
    data.action = None


def test_switches_in_nla_strips(blender, export):
    import blender_scene as b

    scene = blender.context.scene
    scene.frame_end = 3
    b.camera()
    proxy = b.cube("Proxy")
    b.key(proxy, "hide_viewport", {1: True, 3: True})
    more = b.plane("More")
    b.key(more.modifiers.new("Array", "ARRAY"), "show_render", {1: False, 2: True}, interpolation="CONSTANT")
    source = blender.data.collections.new("Source")
    leaf = b.cube("Leaf")
    scene.collection.objects.unlink(leaf)
    source.objects.link(leaf)
    empty = b.link(blender.data.objects.new("Instance", None))
    empty.instance_type, empty.instance_collection = "COLLECTION", source
    b.key(empty, "hide_render", {1: True, 2: False}, interpolation="CONSTANT")
    for ob in (proxy, more, empty):
        push_down(ob)
    scene.frame_set(1)
    gltf = export()
    nodes = [i for i, n in enumerate(gltf.root["nodes"]) if n["name"] == "More"]
    assert [sum(len(gltf.triangles(n)) for n in nodes if gltf.visible(n, f)) for f in (1, 2, 3)] == [2, 4, 4]
    assert [gltf.visible(gltf.node("Leaf"), f) for f in (1, 2, 3)] == [False, True, True]
    assert all(gltf.visible(gltf.node("Proxy"), f) for f in (1, 2, 3))
