"""Instances of collections, geometry nodes, particles, vertices and faces."""

from __future__ import annotations

import math

import numpy as np


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


def test_coordinates_without_a_name_are_no_uv_map(blender, export):
    """Those that a mesh primitive gives to other nodes, under a material that is baked."""
    import blender_scene as b

    b.camera()
    ob = b.cube("Grid")
    tree = blender.data.node_groups.new("Grid", "GeometryNodeTree")
    tree.interface.new_socket("Geometry", in_out="OUTPUT", socket_type="NodeSocketGeometry")
    grid, store, end = (tree.nodes.new(kind) for kind in ("GeometryNodeMeshGrid", "GeometryNodeStoreNamedAttribute", "NodeGroupOutput"))
    coloured = tree.nodes.new("GeometryNodeSetMaterial")
    store.data_type, store.domain = "FLOAT_VECTOR", "CORNER"
    store.inputs["Name"].default_value = "place"
    tree.links.new(grid.outputs["Mesh"], store.inputs["Geometry"])
    tree.links.new(grid.outputs["UV Map"], next(s for s in store.inputs if s.name == "Value" and s.enabled))
    tree.links.new(store.outputs[0], coloured.inputs["Geometry"])
    tree.links.new(coloured.outputs[0], end.inputs[0])
    made, shader = b.material()
    noise = made.node_tree.nodes.new("ShaderNodeTexNoise")
    made.node_tree.links.new(noise.outputs["Color"], shader.inputs["Base Color"])
    coloured.inputs["Material"].default_value = made
    ob.modifiers.new("Grid", "NODES").node_group = tree
    gltf = export(bake=16)
    attributes = gltf.root["meshes"][gltf.root["nodes"][gltf.node("Grid")]["mesh"]]["primitives"][0]["attributes"]
    assert sorted(attributes) == ["NORMAL", "POSITION", "TEXCOORD_0"]
