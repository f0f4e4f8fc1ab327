"""What a render shows of a scene, and a viewport does not, or otherwise."""

from __future__ import annotations

import numpy as np
import pytest


def names(gltf) -> list[str]:
    """What the nodes with a mesh are called, in order of name."""
    return sorted(node["name"] for node in gltf.root["nodes"] if "mesh" in node)


def nodes_tree(blender, ob):
    """Empty geometry nodes on an object: the tree, and what goes in and out."""
    tree = blender.data.node_groups.new("Nodes", "GeometryNodeTree")
    for way in ("INPUT", "OUTPUT"):
        tree.interface.new_socket("Geometry", in_out=way, socket_type="NodeSocketGeometry")
    ob.modifiers.new("Nodes", "NODES").node_group = tree
    return tree, tree.nodes.new("NodeGroupInput").outputs[0], tree.nodes.new("NodeGroupOutput").inputs[0]


@pytest.mark.parametrize("linked", [False, True])
def test_geometry_nodes_know_that_this_is_a_render(blender, export, tmp_path, linked):
    import blender_scene as b

    ob = b.plane("Grass")
    tree, start, end = nodes_tree(blender, ob)
    viewport, switch = tree.nodes.new("GeometryNodeIsViewport"), tree.nodes.new("GeometryNodeSwitch")
    switch.input_type = "GEOMETRY"
    tree.links.new(viewport.outputs[0], switch.inputs["Switch"])
    tree.links.new(start, switch.inputs["True"])
    tree.links.new(tree.nodes.new("GeometryNodeMeshCube").outputs[0], switch.inputs["False"])
    tree.links.new(switch.outputs[0], end)
    if linked:
        blender.data.libraries.write(str(tmp_path / "grass.blend"), {ob})
        blender.ops.wm.read_factory_settings(use_empty=True)
        with blender.data.libraries.load(str(tmp_path / "grass.blend"), link=True) as (_, wanted):
            wanted.objects = ["Grass"]
        b.link(wanted.objects[0])
    b.camera()
    gltf = export()
    assert len(gltf.triangles(gltf.node("Grass"))) == 12


def test_an_ocean_is_as_fine_as_rendered(blender, export):
    import blender_scene as b

    b.camera()
    ocean = b.plane("Sea").modifiers.new("Ocean", "OCEAN")
    ocean.viewport_resolution, ocean.resolution = 1, 4
    gltf = export()
    assert len(gltf.triangles(gltf.node("Sea"))) == 2 * 16 * 16


@pytest.mark.parametrize("kind", ["VERTS", "FACES"])
def test_what_is_copied_on_vertices_or_faces_is_not_there_itself(blender, export, kind):
    import blender_scene as b

    b.camera()
    parent, child, below = b.plane("Parent", size=6), b.cube("Child"), b.cube("Below", location=(0, 0, 5))
    ball = b.link(blender.data.objects.new("Ball", blender.data.metaballs.new("Ball")))
    ball.data.elements.new()
    child.parent, below.parent, ball.parent = parent, child, parent
    parent.instance_type = kind
    gltf = export()
    copies = 4 if kind == "VERTS" else 1
    # Blender shows what is below the child in its own place, too.
    assert [names(gltf).count(name) for name in ("Parent", "Child", "Below")] == [1, copies, copies + 1]
    assert "Ball" in names(gltf)


def test_a_hidden_instance_inside_an_instance_is_not_there(blender, export):
    import blender_scene as b

    b.camera()
    leaf, tree = blender.data.collections.new("Leaf"), blender.data.collections.new("Tree")
    ob = b.cube("Cube")
    blender.context.scene.collection.objects.unlink(ob)
    leaf.objects.link(ob)
    for i, hidden in enumerate((True, False)):
        inner = blender.data.objects.new("Inner", None)
        inner.instance_type, inner.instance_collection, inner.hide_render = "COLLECTION", leaf, hidden
        inner.location = (5 * i, 0, 0)
        tree.objects.link(inner)
    outer = b.link(blender.data.objects.new("Outer", None))
    outer.instance_type, outer.instance_collection = "COLLECTION", tree
    gltf = export()
    assert gltf.world(gltf.node("Cube"), 1)[0, 3] == pytest.approx(5)


def test_an_instance_of_a_collection_may_appear(blender, export):
    import blender_scene as b

    blender.context.scene.frame_end = 3
    b.camera()
    kept = blender.data.collections.new("Kept")
    ob = b.cube("Cube")
    blender.context.scene.collection.objects.unlink(ob)
    kept.objects.link(ob)
    late = b.link(blender.data.objects.new("Late", None))
    late.instance_type, late.instance_collection = "COLLECTION", kept
    b.key(late, "hide_render", {1: True, 3: False}, interpolation="CONSTANT")
    gltf = export()
    assert [gltf.visible(gltf.node("Cube"), frame) for frame in (1, 2, 3)] == [False, False, True]


@pytest.mark.parametrize(("kind", "feature"), [("points", ["point cloud"]), ("volume", ["volume"]), ("instances", [])])
def test_what_geometry_nodes_make_of_a_mesh_is_named_for_what_it_is(blender, export, kind, feature):
    import blender_scene as b

    b.camera()
    tree, start, end = nodes_tree(blender, b.plane("Made"))
    if kind == "points":
        points = tree.nodes.new("GeometryNodeMeshToPoints")
        tree.links.new(start, points.inputs[0])
        tree.links.new(points.outputs[0], end)
    elif kind == "volume":
        tree.links.new(tree.nodes.new("GeometryNodeVolumeCube").outputs[0], end)
    else:
        instances = tree.nodes.new("GeometryNodeInstanceOnPoints")
        tree.links.new(start, instances.inputs["Points"])
        tree.links.new(tree.nodes.new("GeometryNodeMeshCube").outputs[0], instances.inputs["Instance"])
        tree.links.new(instances.outputs[0], end)
    gltf = export()
    assert gltf.lost_features("Made") == feature
    assert names(gltf) == (["Made"] * 4 if kind == "instances" else [])


def test_hair_of_which_nodes_make_a_mesh_is_not_lost(blender, export):
    import blender_scene as b

    b.camera()
    for name in ("Hair", "Mesh"):
        ob = b.link(blender.data.objects.new(name, blender.data.hair_curves.new(name)))
        ob.data.add_curves([3])
    tree, _, end = nodes_tree(blender, ob)
    tree.links.new(tree.nodes.new("GeometryNodeMeshCube").outputs[0], end)
    gltf = export()
    assert (gltf.lost_features("Hair"), gltf.lost_features("Mesh")) == (["hair curves"], [])
    assert names(gltf) == ["Mesh"]


def test_objects_are_free_in_their_names(blender, export):
    import blender_scene as b

    b.camera()
    b.cube("shape-1")
    b.plane("shape-0")
    gltf = export()
    assert gltf.lost_features("shape-0") == gltf.lost_features("shape-1") == []
    assert [len(gltf.triangles(gltf.node(name))) for name in ("shape-0", "shape-1")] == [2, 12]


@pytest.mark.parametrize("engine", ["CYCLES", "EEVEE"])
def test_materials_are_those_of_the_engine(blender, export, engine):
    """Cycles shows both sides of every face; of two outputs each engine has its own."""
    import blender_scene as b

    b.camera()
    scene = blender.context.scene
    if engine == "CYCLES":
        scene.render.engine = engine
    made, shader = b.material()
    made.use_backface_culling = True
    shader.inputs["Base Color"].default_value = (0, 1, 0, 1)
    tree = made.node_tree
    next(node for node in tree.nodes if node.type == "OUTPUT_MATERIAL").target = "EEVEE"
    output, red = tree.nodes.new("ShaderNodeOutputMaterial"), tree.nodes.new("ShaderNodeBsdfPrincipled")
    output.target = "CYCLES"
    red.inputs["Base Color"].default_value = (1, 0, 0, 1)
    tree.links.new(red.outputs[0], output.inputs["Surface"])
    b.plane().data.materials.append(made)
    (written,) = export().root["materials"]
    cycles = engine == "CYCLES"
    np.testing.assert_allclose(written["pbrMetallicRoughness"]["baseColorFactor"], (1, 0, 0, 1) if cycles else (0, 1, 0, 1))
    assert written.get("doubleSided", False) == cycles
