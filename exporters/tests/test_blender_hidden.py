"""What a render hides, in collections, instances of them and scatters: what Cycles shows of each was looked at."""

from __future__ import annotations

import pytest


def collection(bpy, name: str, parent=None, **settings):
    """A collection below another, or nowhere."""
    made = bpy.data.collections.new(name)
    if parent is not None:
        parent.children.link(made)
    for key, value in settings.items():
        setattr(made, key, value)
    return made


def move(ob, target):
    """Have an object in one collection only."""
    for each in list(ob.users_collection):
        each.objects.unlink(ob)
    target.objects.link(ob)
    return ob


def instance(bpy, source, home=None):
    """An empty that instances a collection, in a collection or in the scene."""
    import blender_scene as b

    ob = b.link(bpy.data.objects.new("Instance", None))
    ob.instance_type, ob.instance_collection = "COLLECTION", source
    return move(ob, home) if home is not None else ob


def scatter(bpy, source, name: str = "Scatter"):
    """A square with an object, or the objects of a collection, on each of its four corners, by geometry nodes."""
    import blender_scene as b

    ob = b.plane(name, size=4)
    tree = bpy.data.node_groups.new(name, "GeometryNodeTree")
    for way in ("INPUT", "OUTPUT"):
        tree.interface.new_socket("Geometry", in_out=way, socket_type="NodeSocketGeometry")
    start, end = tree.nodes.new("NodeGroupInput"), tree.nodes.new("NodeGroupOutput")
    kind = "Object" if isinstance(source, bpy.types.Object) else "Collection"
    points, info = tree.nodes.new("GeometryNodeInstanceOnPoints"), tree.nodes.new(f"GeometryNode{kind}Info")
    info.inputs[kind].default_value = source
    if kind == "Object":
        info.inputs["As Instance"].default_value = True
    tree.links.new(start.outputs[0], points.inputs["Points"])
    tree.links.new(info.outputs["Instances" if kind == "Collection" else "Geometry"], points.inputs["Instance"])
    tree.links.new(points.outputs[0], end.inputs[0])
    ob.modifiers.new("g", "NODES").node_group = tree
    return ob


def scattered_asset(bpy, hidden: str):
    """An instanced collection with a scatter whose source is hidden, itself or by its collection."""
    import blender_scene as b

    asset = collection(bpy, "Asset")
    stone = move(b.cube("Stone"), asset if hidden == "object" else collection(bpy, "Sources", asset, hide_render=True))
    stone.hide_render = hidden == "object"
    move(scatter(bpy, stone), asset)
    instance(bpy, asset)


def instance_of_hidden(bpy):
    """An instance of a collection that is itself hidden."""
    import blender_scene as b

    off = collection(bpy, "Off", hide_render=True)
    move(b.cube("Stone"), off)
    instance(bpy, off)


def nested(bpy, inner: bool):
    """An instance in an instance: of a hidden collection, or in one."""
    import blender_scene as b

    asset, outer = collection(bpy, "Asset", hide_render=inner), collection(bpy, "Outer")
    move(b.cube("Stone"), asset)
    instance(bpy, asset, outer if inner else collection(bpy, "Off", outer, hide_render=True))
    instance(bpy, outer)


def collection_info(bpy):
    """A scatter of a collection whose child is hidden."""
    import blender_scene as b

    asset = collection(bpy, "Asset")
    move(b.cube("Stone"), collection(bpy, "Off", asset, hide_render=True))
    scatter(bpy, asset)


def background(bpy):
    """A background scene with a hidden collection."""
    import blender_scene as b

    behind = bpy.data.scenes.new("Set")
    move(b.cube("Stone"), collection(bpy, "Off", behind.collection, hide_render=True))
    move(b.cube("Wall"), behind.collection)
    bpy.context.scene.background_set = behind


def on_parts(bpy, kind: str):
    """A square with a hidden child on its vertices or faces."""
    import blender_scene as b

    parent = b.plane("Square")
    parent.instance_type = kind
    move(b.cube("Stone"), collection(bpy, "Off", bpy.context.scene.collection, hide_render=True)).parent = parent


def scatter_on_vertices(bpy):
    """A square with a scatter on each of its four corners, and nowhere else."""
    import blender_scene as b

    stone = b.cube("Stone")
    stone.hide_render = True
    parent = b.plane("Square")
    parent.instance_type = "VERTS"
    scatter(bpy, stone).parent = parent


@pytest.mark.parametrize(
    ("build", "options", "want"),
    [
        (scattered_asset, ("object",), ["Stone"] * 4), (scattered_asset, ("collection",), ["Stone"] * 4), (instance_of_hidden, (), []),
        (nested, (True,), []), (nested, (False,), []), (collection_info, (), []), (background, (), ["Wall"]),
        (on_parts, ("VERTS",), ["Square"]), (on_parts, ("FACES",), ["Square"]), (scatter_on_vertices, (), ["Square"] + ["Stone"] * 16),
    ],
)  # fmt: skip
def test_hidden_from_render(blender, export, build, options, want):
    import blender_scene as b

    b.camera()
    build(blender, *options)
    gltf = export()
    assert sorted(n["name"] for i, n in enumerate(gltf.root["nodes"]) if "mesh" in n and gltf.visible(i, 1)) == want


@pytest.mark.parametrize("instanced", [True, False])
def test_collections_of_libraries_that_are_hidden_in_viewports(blender, export, tmp_path, instanced):
    import blender_scene as b

    asset = collection(blender, "Asset")
    move(b.cube("Stone"), collection(blender, "Detail", asset, hide_viewport=True))
    blender.data.libraries.write(str(tmp_path / "asset.blend"), {asset})
    blender.ops.wm.read_factory_settings(use_empty=True)
    b.camera()
    with blender.data.libraries.load(str(tmp_path / "asset.blend"), link=True) as (_, wanted):
        wanted.collections = ["Asset"]
    if instanced:
        instance(blender, wanted.collections[0])
    else:
        blender.context.scene.collection.children.link(wanted.collections[0])
    gltf = export()
    assert gltf.visible(gltf.node("Stone"), 1)


def test_members_of_instances_that_blink(blender, export):
    import blender_scene as b

    blender.context.scene.frame_end = 3
    b.camera()
    asset = collection(blender, "Asset")
    lamp = move(b.cube("Lamp"), asset)
    b.key(lamp, "hide_render", {1: True, 2: False, 3: True}, interpolation="CONSTANT")
    instance(blender, asset)
    gltf = export()
    assert [gltf.visible(gltf.node("Lamp"), f) for f in (1, 2, 3)] == [False, True, False]


def test_cameras_of_hidden_collections_move(blender, export):
    import blender_scene as b

    b.camera()
    other = move(b.camera("Other"), collection(blender, "Off", blender.context.scene.collection, hide_render=True))
    b.key(other, "location", {1: (0, 0, 0), 2: (0, 0, 5)})
    gltf = export(camera="Other")
    assert [gltf.world(gltf.node("Other"), f)[1, 3] for f in (1, 2)] == [0, 5]


@pytest.mark.parametrize("hidden", ["object", "collection"])
def test_simulations_meet_what_is_hidden_from_render(blender, export, hidden):
    import blender_scene as b

    blender.context.scene.frame_end = 12
    b.camera()
    floor = b.cube("Floor", location=(0, 0, -1.1))
    floor.modifiers.new("Collision", "COLLISION")
    if hidden == "object":
        floor.hide_render = True
    else:
        move(floor, collection(blender, "Off", blender.context.scene.collection, hide_render=True))
    b.plane("Cloth", size=1).modifiers.new("Cloth", "CLOTH")
    gltf = export()
    assert gltf.posed_points(gltf.node("Cloth"), 12)[:, 1].min() > -0.2
    assert "Floor" not in [n["name"] for n in gltf.root["nodes"]]
