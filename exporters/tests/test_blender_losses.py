"""What of a scene, its view layer and its objects is named because no picture made from the glTF has it."""

from __future__ import annotations


def test_film_layers_and_shadows(blender, export):
    import blender_scene as b

    scene = blender.context.scene
    b.camera()
    scene.render.film_transparent, scene.cycles.film_exposure = True, 2.0
    b.cube("Floating").visible_shadow = False
    mask, off = blender.data.collections.new("Mask"), blender.data.collections.new("Off")
    for collection in (mask, off):
        scene.collection.children.link(collection)
        blender.context.view_layer.layer_collection.children[collection.name].holdout = True
    off.hide_render = True
    gltf = export()
    assert {"transparent film", "film exposure 2"} <= set(gltf.lost_features("Scene"))
    exposure = next(item for item in gltf.lost.items if item["feature"] == "film exposure 2")
    assert "--exposure 1 " in exposure["action"]
    assert gltf.lost_features("Floating") == ["without a shadow"]
    assert (gltf.lost_features("Mask"), gltf.lost_features("Off")) == (["holdout collection"], [])


def test_a_view_layer_without_surfaces_is_named(blender, export):
    import blender_scene as b

    b.camera()
    blender.context.view_layer.use_solid = False
    assert export().lost_features("ViewLayer") == ["view layer without surfaces"]
