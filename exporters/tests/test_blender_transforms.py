"""Where things stand, against what Blender evaluates."""

from __future__ import annotations

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
