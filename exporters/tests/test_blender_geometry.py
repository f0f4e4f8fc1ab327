"""Geometry, transforms and materials against what Blender evaluates."""

from __future__ import annotations

import math

import numpy as np
import pytest


def world_points(gltf, node, frame):
    """Sorted world vertices of a node."""
    points = gltf.triangles(node).reshape(-1, 3)
    m = gltf.world(node, frame)
    return np.unique(np.round(points @ m[:3, :3].T + m[:3, 3], 4), axis=0)


def blender_points(ob, depsgraph):
    """Sorted evaluated world vertices in glTF axes."""
    import blender_scene as b

    evaluated = ob.evaluated_get(depsgraph)
    m = b.YUP @ np.array(evaluated.matrix_world)
    points = np.array([v.co for v in evaluated.data.vertices])
    return np.unique(np.round(points @ m[:3, :3].T + m[:3, 3], 4) + 0.0, axis=0)


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
            want = blender_points(blender.data.objects[name], depsgraph)
            np.testing.assert_allclose(world_points(gltf, gltf.node(name), frame), want, atol=2e-4)


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
        np.testing.assert_allclose(world_points(gltf, gltf.node("Child"), frame), blender_points(child, depsgraph), atol=3e-4)


def test_mirrored_object(blender, export):
    import blender_scene as b

    b.camera()
    ob = b.cube("Mirrored")
    ob.scale = (-1, 2, 1)
    gltf = export()
    assert np.linalg.det(gltf.world(gltf.node("Mirrored"), 1)[:3, :3]) == pytest.approx(-2)


def test_render_modifiers_not_viewport_ones(blender, export):
    import blender_scene as b

    b.camera()
    ob = b.cube("Smooth")
    subsurf = ob.modifiers.new("s", "SUBSURF")
    subsurf.levels, subsurf.render_levels = 0, 2
    off = ob.modifiers.new("a", "ARRAY")
    off.show_render = False
    gltf = export()
    assert len(gltf.triangles(gltf.node("Smooth"))) == 6 * 16 * 2


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
        want = np.unique(np.round(blender_points(ob, depsgraph), 3) + 0.0, axis=0)
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


def test_collection_instances(blender, export):
    import blender_scene as b

    blender.context.scene.frame_end = 3
    b.camera()
    source = blender.data.collections.new("Tree")
    ob = b.cube("Leaf", location=(1, 0, 0))
    blender.context.scene.collection.objects.unlink(ob)
    source.objects.link(ob)
    for i in range(3):
        empty = b.link(blender.data.objects.new(f"Tree.{i}", None))
        empty.instance_type, empty.instance_collection = "COLLECTION", source
        empty.location = (0, 3 * i, 0)
    b.key(empty, "location", {1: (0, 6, 0), 3: (0, 9, 0)})
    gltf = export()
    nodes = [i for i, n in enumerate(gltf.root["nodes"]) if n["name"] == "Leaf"]
    assert len({gltf.root["nodes"][n]["mesh"] for n in nodes}) == 1, "instances share their mesh"
    assert sorted(round(-gltf.world(n, 3)[2, 3], 4) for n in nodes) == [0, 3, 9]


def scatter(blender, name: str, size: float):
    """A plane with a small ball on each corner, by geometry nodes."""
    import blender_scene as b

    ob = b.plane(name, size=size)
    tree = blender.data.node_groups.new(name, "GeometryNodeTree")
    tree.interface.new_socket("Geometry", in_out="INPUT", socket_type="NodeSocketGeometry")
    tree.interface.new_socket("Geometry", in_out="OUTPUT", socket_type="NodeSocketGeometry")
    start, end = tree.nodes.new("NodeGroupInput"), tree.nodes.new("NodeGroupOutput")
    points, ball = tree.nodes.new("GeometryNodeInstanceOnPoints"), tree.nodes.new("GeometryNodeMeshIcoSphere")
    tree.links.new(start.outputs[0], points.inputs["Points"])
    tree.links.new(ball.outputs["Mesh"], points.inputs["Instance"])
    tree.links.new(points.outputs[0], end.inputs[0])
    ob.modifiers.new("g", "NODES").node_group = tree


def test_geometry_nodes_instances(blender, export):
    import blender_scene as b

    b.camera()
    scatter(blender, "Scatter", 4)
    gltf = export()
    nodes = [i for i, n in enumerate(gltf.root["nodes"]) if n["name"] == "Scatter"]
    places = sorted(tuple(np.round(gltf.world(n, 1)[[0, 2], 3], 4)) for n in nodes)
    assert places == [(-2, -2), (-2, 2), (2, -2), (2, 2)]
    assert all(len(gltf.triangles(n)) == 20 for n in nodes)


def test_instances_on_parts_of_instances(blender, export):
    """Three deep, where several instances have the same persistent_id."""
    import blender_scene as b

    b.camera()
    parent = None
    for depth, kind in enumerate(("VERTS", "FACES", "VERTS")):
        ob = b.plane(f"Level.{depth}", size=4 / (depth + 1))
        ob.parent, ob.instance_type = parent, kind
        parent = ob
    b.cube("Stone", size=0.2).parent = parent
    gltf = export()
    nodes = [i for i, n in enumerate(gltf.root["nodes"]) if n["name"] == "Stone" and gltf.visible(i, 2)]
    places, numbers = [], []
    for made in b.set_frame(2).object_instances:
        if made.object.name == "Stone" and made.parent is not None and made.parent.name == "Level.0":
            places.append(b.YUP[:3, :3] @ np.array(made.matrix_world.translation, dtype=float))
            numbers.append(tuple(made.persistent_id))
    assert len(set(numbers)) < len(numbers)
    assert sorted(np.round(places, 3).tolist()) == sorted(np.round(gltf.world(n, 2)[:3, 3], 3).tolist() for n in nodes)


def test_metaballs_text_and_bevelled_curves_are_meshes(blender, export):
    import blender_scene as b

    b.camera()
    ball = blender.data.metaballs.new("Ball")
    ball.elements.new()
    b.link(blender.data.objects.new("Ball", ball))
    text = blender.data.curves.new("Text", "FONT")
    text.body = "buzz"
    b.link(blender.data.objects.new("Text", text))
    curve = blender.data.curves.new("Tube", "CURVE")
    curve.dimensions, curve.bevel_depth = "3D", 0.1
    curve.splines.new("POLY").points.add(2)
    for i, point in enumerate(curve.splines[0].points):
        point.co = (i, 0, 0, 1)
    b.link(blender.data.objects.new("Tube", curve))
    gltf = export()
    for name in ("Ball", "Text", "Tube"):
        assert len(gltf.triangles(gltf.node(name))) > 20, name


def test_texts_that_count_frames(blender, export):
    import blender_scene as b

    blender.context.scene.frame_end = 3
    b.camera()
    b.link(blender.data.objects.new("Counter", blender.data.curves.new("Counter", "FONT")))

    def count(scene, _=None):
        blender.data.curves["Counter"].body = "1" * scene.frame_current

    blender.app.handlers.frame_change_pre.append(count)
    try:
        gltf = export()
    finally:
        blender.app.handlers.frame_change_pre.remove(count)
    nodes = [i for i, n in enumerate(gltf.root["nodes"]) if n["name"] == "Counter"]
    faces = [sum(len(gltf.triangles(n)) for n in nodes if gltf.visible(n, f)) for f in (1, 2, 3)]
    assert faces == [faces[0], 2 * faces[0], 3 * faces[0]]


def test_volumes_and_wires_are_named(blender, export):
    import blender_scene as b

    b.camera()
    b.link(blender.data.objects.new("Smoke", blender.data.volumes.new("Smoke")))
    data = blender.data.meshes.new("Wire")
    data.from_pydata([(0, 0, 0), (1, 0, 0)], [(0, 1)], [])
    b.link(blender.data.objects.new("Wire", data))
    gltf = export()
    assert gltf.lost_features("Smoke") == ["volume"]
    assert gltf.lost_features("Wire") == ["object without faces"]
    assert next(i for i in gltf.buzz["lost"] if i["object"] == "Smoke")["action"]


def test_particles(blender, export):
    import blender_scene as b

    blender.context.scene.frame_end = 6
    b.camera()
    emitter = b.plane("Emitter", size=2)
    drop = b.cube("Drop", size=0.1)
    drop.hide_render = True
    emitter.modifiers.new("p", "PARTICLE_SYSTEM")
    settings = emitter.particle_systems[0].settings
    settings.count, settings.frame_start, settings.frame_end, settings.lifetime = 10, 1, 3, 50
    settings.render_type, settings.instance_object = "OBJECT", drop
    gltf = export()
    nodes = [i for i, n in enumerate(gltf.root["nodes"]) if n["name"] == "Drop"]
    assert len(nodes) == 10
    assert any(gltf.animated((n, "translation")) for n in nodes)
    assert math.isfinite(gltf.world(nodes[0], 6).sum())


def test_geometry_nodes_may_make_several_meshes_of_one_form(blender, export):
    import blender_scene as b

    b.camera()
    ob = b.cube("Blocks")
    tree = blender.data.node_groups.new("Blocks", "GeometryNodeTree")
    tree.interface.new_socket("Geometry", in_out="INPUT", socket_type="NodeSocketGeometry")
    tree.interface.new_socket("Geometry", in_out="OUTPUT", socket_type="NodeSocketGeometry")
    join, end = tree.nodes.new("GeometryNodeJoinGeometry"), tree.nodes.new("NodeGroupOutput")
    for size in (1, 2, 3):
        block, point = tree.nodes.new("GeometryNodeMeshCube"), tree.nodes.new("GeometryNodePoints")
        block.inputs["Size"].default_value = (size, size, size)
        instances = tree.nodes.new("GeometryNodeInstanceOnPoints")
        tree.links.new(point.outputs[0], instances.inputs["Points"])
        tree.links.new(block.outputs["Mesh"], instances.inputs["Instance"])
        tree.links.new(instances.outputs[0], join.inputs[0])
    tree.links.new(join.outputs[0], end.inputs[0])
    ob.modifiers.new("g", "NODES").node_group = tree
    gltf = export()
    nodes = [i for i, n in enumerate(gltf.root["nodes"]) if n["name"] == "Blocks"]
    sizes = sorted(round(float(np.ptp(gltf.triangles(n)[..., 0])), 4) for n in nodes)
    assert sizes == [1, 2, 3]


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
