"""What becomes a mesh, and what is named because it does not."""

from __future__ import annotations


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
