"""Where things stand, against what Blender evaluates."""

from __future__ import annotations

import math

import numpy as np
import pytest


def test_parents_and_constraints(blender, export):
    import blender_scene as b

    blender.context.scene.frame_end = 4
    b.camera()
    parent = b.cube("Parent")
    child = b.cube("Child", location=(3, 0, 0))
    child.parent = parent
    copy = b.cube("Copy", location=(0, 0, 3)).constraints.new("COPY_ROTATION")
    copy.target = parent
    b.key(parent, "rotation_euler", {1: (0, 0, 0), 4: (0.3, 0.2, 1.0)})
    gltf = export()
    for name in ("Parent", "Child", "Copy"):
        for frame in range(1, 5):
            depsgraph = b.set_frame(frame)
            want = b.blender_points(blender.data.objects[name], depsgraph)
            np.testing.assert_allclose(b.world_points(gltf, gltf.node(name), frame), want, atol=2e-4)


def test_shear_from_uneven_parents(blender, export):
    import blender_scene as b

    blender.context.scene.frame_end = 4
    b.camera()
    parent = b.link(blender.data.objects.new("Squash", None))
    parent.scale = (3, 1, 0.4)
    child = b.cube("Child")
    child.parent = parent
    b.key(child, "rotation_euler", {1: (0, 0.2, 0.3), 4: (0.6, 0.5, 1.2)})
    gltf = export()
    for frame in range(1, 5):
        depsgraph = b.set_frame(frame)
        np.testing.assert_allclose(b.world_points(gltf, gltf.node("Child"), frame), b.blender_points(child, depsgraph), atol=3e-4)


def test_mirrored_object(blender, export):
    import blender_scene as b

    b.camera()
    ob = b.cube("Mirrored")
    ob.scale = (-1, 2, 1)
    gltf = export()
    assert np.linalg.det(gltf.world(gltf.node("Mirrored"), 1)[:3, :3]) == pytest.approx(-2)


@pytest.mark.parametrize("turned", [(0, 0, 0), (0.3, 0.4, 0.5)])
def test_what_grows_from_nothing_is_flat_not_gone(blender, export, buzz, tmp_path, turned):
    """A scale of 0 in one direction: a renderer has to invert the matrix."""
    import blender_scene as b
    import render_tools as r

    blender.context.scene.frame_end = 3
    b.camera(location=(0, -8, 0), rotation=(math.pi / 2, 0, 0))
    ob = b.cube("Bar")
    ob.rotation_euler = turned
    b.key(ob, "scale", {1: (1, 0, 1), 3: (1, 1, 1)})
    gltf = export()
    node = gltf.node("Bar")
    np.testing.assert_allclose(b.world_points(gltf, node, 3), b.blender_points(ob, b.set_frame(3)), atol=2e-4)
    corner = gltf.world(node, 1) @ (1, 1, 1, 1)
    np.testing.assert_allclose(corner, b.YUP @ np.array(ob.evaluated_get(b.set_frame(1)).matrix_world) @ (1, -1, 1, 1), atol=1e-5)
    buzz(gltf.path, tmp_path / "out", "--aov", "depth", "-q", "full", "-f", "1")
    depth = r.read_exr(r.frames_of(tmp_path / "out")[1])["depth.Z"]
    assert depth[18, 32] == pytest.approx(8, abs=0.1)


def test_a_line_is_not_seen(blender, export):
    import blender_scene as b

    blender.context.scene.frame_end = 3
    b.camera()
    ob = b.cube("Bar")
    ob.rotation_euler = (0.3, 0.4, 0.5)
    b.key(ob, "scale", {1: (1, 0, 0), 3: (1, 1, 1)})
    gltf = export()
    assert not gltf.world(gltf.node("Bar"), 1)[:3, :3].any()
