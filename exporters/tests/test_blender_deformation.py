"""Meshes that change their shape, against what Blender evaluates."""

from __future__ import annotations

import numpy as np
import pytest


def test_shape_keys(blender, export):
    import blender_scene as b

    blender.context.scene.frame_end = 5
    b.camera()
    ob = b.cube("Morph")
    ob.shape_key_add(name="Basis")
    up = ob.shape_key_add(name="Up")
    for point in up.data:
        point.co.z += 1.0
    b.key(up, "value", {1: 0.0, 3: 0.5, 5: 1.0}, interpolation="BEZIER")
    gltf = export()
    node = gltf.node("Morph")
    assert len(gltf.root["meshes"][gltf.root["nodes"][node]["mesh"]]["weights"]) == 1, "a straight line needs one target"
    for frame, shift in ((1, 0.0), (3, 0.5), (5, 1.0)):
        assert gltf.posed_points(node, frame)[:, 1].max() == pytest.approx(1 + shift, abs=1e-4)


def test_equal_poses_are_held_once(blender):
    """A mesh whose modifier changes nothing, and one that rests, moves, and rests where it began."""
    import blender_scene as b
    from exporters.blender.sample import Sampler
    from exporters.common.report import Lost

    scene = blender.context.scene
    scene.frame_end = 12
    b.cube("Still").modifiers.new("Bevel", "BEVEL")
    moves = b.cube("Moves").modifiers.new("Wave", "DISPLACE")
    b.key(moves, "strength", {4: 0.0, 6: 1.0, 8: 0.0})
    sampler = Sampler(scene, blender.context.view_layer, (64, 36), Lost())
    sampler.run(1, 12)
    poses = {shape.name: list(shape.poses.values()) for shape in sampler.geometry.shapes}
    assert {name: len(held) for name, held in poses.items()} == {"Still": 12, "Moves": 12}
    assert {name: len(set(map(id, held))) for name, held in poses.items()} == {"Still": 1, "Moves": 3}


def test_a_mesh_that_rests_begins_to_move_when_it_does(blender, export):
    import blender_scene as b

    blender.context.scene.frame_end = 12
    b.camera()
    ob = b.cube("Moves")
    b.key(ob.modifiers.new("Wave", "DISPLACE"), "strength", {4: 0.0, 6: 1.0, 8: 0.0, 10: 0.5})
    gltf = export()
    node = gltf.node("Moves")
    for frame in range(1, 13):
        depsgraph = b.set_frame(frame)
        want = np.array([v.co.z for v in ob.evaluated_get(depsgraph).data.vertices]).max()
        assert gltf.posed_points(node, frame)[:, 1].max() == pytest.approx(want, abs=1e-4), frame


def test_armature(blender, export):
    """A bent bone: deformation is carried pose by pose."""
    import blender_scene as b

    blender.context.scene.frame_end = 5
    b.camera()
    data = blender.data.armatures.new("Rig")
    rig = b.link(blender.data.objects.new("Rig", data))
    blender.context.view_layer.objects.active = rig
    blender.ops.object.mode_set(mode="EDIT")
    bone = data.edit_bones.new("Bone")
    bone.head, bone.tail = (0, 0, 0), (0, 0, 1)
    blender.ops.object.mode_set(mode="OBJECT")
    ob = b.cube("Skin")
    ob.vertex_groups.new(name="Bone").add(range(4), 1.0, "REPLACE")
    ob.modifiers.new("Armature", "ARMATURE").object = rig
    pose = rig.pose.bones["Bone"]
    pose.rotation_mode = "XYZ"
    for frame, angle in ((1, 0.0), (5, 1.0)):
        pose.rotation_euler = (0, angle, 0)
        pose.keyframe_insert("rotation_euler", frame=frame)
    gltf = export()
    node = gltf.node("Skin")
    for frame in (2, 5):
        depsgraph = b.set_frame(frame)
        got = np.unique(np.round(gltf.posed_points(node, frame), 3) + 0.0, axis=0)
        want = np.unique(np.round(b.blender_points(ob, depsgraph), 3) + 0.0, axis=0)
        np.testing.assert_allclose(got, want, atol=2e-3)


def test_changing_topology(blender, export):
    """An animated Build modifier: as many meshes as it has states, each visible in its frames."""
    import blender_scene as b

    blender.context.scene.frame_end = 4
    b.camera()
    ob = b.cube("Growing")
    array = ob.modifiers.new("a", "ARRAY")
    b.key(array, "count", {1: 1, 4: 4})
    gltf = export()
    nodes = [i for i, n in enumerate(gltf.root["nodes"]) if n["name"] == "Growing"]
    assert len(nodes) == 4
    for frame in range(1, 5):
        seen = [n for n in nodes if gltf.visible(n, frame)]
        assert [len(gltf.triangles(n)) for n in seen] == [12 * frame]


@pytest.mark.parametrize("kind", ["armature", "curve keys", "bevel"])
def test_what_deforms_without_a_modifier_moves(blender, export, kind):
    import blender_scene as b

    blender.context.scene.frame_end = 3
    b.camera()
    curve = blender.data.curves.new("Curve", "CURVE")
    curve.dimensions, curve.bevel_depth = "3D", 0.2
    curve.splines.new("POLY").points.add(1)
    curve.splines[0].points[1].co = (1, 0, 0, 1)
    if kind == "armature":
        blender.ops.object.armature_add()
        rig, ob = blender.context.object, b.cube("Thing")
        ob.vertex_groups.new(name="Bone").add(range(8), 1, "REPLACE")
        ob.parent, ob.parent_type = rig, "ARMATURE"
        b.key(rig.pose.bones["Bone"], "location", {1: (0, 0, 0), 3: (2, 0, 0)})
    elif kind == "curve keys":
        ob = b.link(blender.data.objects.new("Thing", curve))
        ob.shape_key_add(name="Basis")
        key = ob.shape_key_add(name="Up")
        for point in key.data:
            point.co.y += 2
        b.key(key, "value", {1: 0.0, 3: 1.0})
    else:
        ob = b.link(blender.data.objects.new("Thing", curve))
        profile = blender.data.curves.new("Profile", "CURVE")
        profile.splines.new("POLY").points.add(2)
        for point, place in zip(profile.splines[0].points, [(0, 0.1, 0, 1), (0.1, 0, 0, 1), (-0.1, 0, 0, 1)], strict=True):
            point.co = place
        b.key(profile.splines[0].points[0], "co", {1: (0, 0.1, 0, 1), 3: (0, 2.1, 0, 1)})
        curve.bevel_mode, curve.bevel_object = "OBJECT", b.link(blender.data.objects.new("Profile", profile))
    gltf = export()
    first, last = (gltf.posed_points(gltf.node("Thing"), frame) for frame in (1, 3))
    assert np.abs(last - first).max() == pytest.approx(2, abs=0.01)


def test_texture_coordinates_that_change_are_named(blender, export):
    import blender_scene as b

    blender.context.scene.frame_end = 3
    b.camera()
    ob = b.plane("Sign")
    ob.data.uv_layers.new()
    warp = ob.modifiers.new("Warp", "UV_WARP")
    b.key(warp, "offset", {1: (0.0, 0.0), 3: (1.0, 0.0)})
    still = b.plane("Still")
    still.data.uv_layers.new()
    still.modifiers.new("Warp", "UV_WARP")
    gltf = export()
    assert gltf.lost_features("Sign") == ["texture coordinates, colours or material slots that change"]
    assert gltf.lost_features("Still") == []
