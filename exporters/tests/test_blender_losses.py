"""What of a scene, its view layer and its objects is named because no picture made from the glTF has it."""

from __future__ import annotations

import wave

import pytest


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


def test_objects_of_every_kind_and_in_instances_are_looked_at(blender, export):
    import blender_scene as b

    b.camera()
    text = b.link(blender.data.objects.new("Text", blender.data.curves.new("Text", "FONT")))
    text.data.body, text.visible_camera = "a", False
    b.cube("Mirrored").visible_glossy = False
    b.light("SUN", "Rim").visible_diffuse = False
    kept, off = blender.data.collections.new("Kept"), blender.data.collections.new("Off")
    inside, hidden = b.cube("Inside"), b.cube("Hidden")
    for ob, collection in ((inside, kept), (hidden, off)):
        blender.context.scene.collection.objects.unlink(ob)
        collection.objects.link(ob)
        ob.is_shadow_catcher = True
    off.hide_render = True
    blender.context.scene.collection.children.link(off)
    empty = b.link(blender.data.objects.new("Instance", None))
    empty.instance_type, empty.instance_collection = "COLLECTION", kept
    gltf = export()
    found = {name: gltf.lost_features(name) for name in ("Text", "Mirrored", "Rim", "Inside", "Hidden")}
    assert found == {
        "Text": ["hidden from camera rays"], "Mirrored": ["hidden from reflections"], "Rim": ["light hidden from diffuse rays"],
        "Inside": ["shadow catcher"], "Hidden": [],
    }  # fmt: skip


def test_what_else_a_render_would_show_is_named(blender, export):
    import blender_scene as b

    scene = blender.context.scene
    b.camera()
    scene.render.use_freestyle = True
    editor = scene.sequence_editor_create()
    strips = editor.strips if hasattr(editor, "strips") else editor.sequences
    strips.new_effect("Fade", "COLOR", 1, 1, **({"length": 3} if blender.app.version >= (5, 0, 0) else {"frame_end": 3}))
    scene.view_layers.new("Back")
    scene.view_layers.new("Off").use = False
    gltf = export()
    assert {"Freestyle lines", "video sequencer"} <= set(gltf.lost_features("Scene"))
    assert (gltf.lost_features("Back"), gltf.lost_features("Off")) == (["further view layer"], [])


@pytest.mark.parametrize("kind", ["sound", "muted", "channel", "shown"])
def test_only_strips_that_are_rendered_are_named(blender, export, tmp_path, kind):
    import blender_scene as b

    b.camera()
    editor = blender.context.scene.sequence_editor_create()
    strips = editor.strips if hasattr(editor, "strips") else editor.sequences
    if kind == "sound":
        with wave.open(str(tmp_path / "a.wav"), "wb") as file:
            file.setparams((1, 2, 8000, 0, "NONE", ""))
            file.writeframes(bytes(16000))
        strips.new_sound("Music", str(tmp_path / "a.wav"), 1, 1)
    else:
        strips.new_effect("Fade", "COLOR", 2, 1, **({"length": 3} if blender.app.version >= (5, 0, 0) else {"frame_end": 3})).mute = kind == "muted"
        editor.channels[2].mute = kind == "channel"
    assert ("video sequencer" in export().lost_features("Scene")) == (kind == "shown")


def test_what_a_library_has_no_more_is_named(blender, export, tmp_path):
    import blender_scene as b

    hero = blender.data.collections.new("Hero")
    hero.objects.link(b.cube())
    library = tmp_path / "hero.blend"
    blender.data.libraries.write(str(library), {hero})
    blender.ops.wm.read_factory_settings(use_empty=True)
    b.camera()
    with blender.data.libraries.load(str(library), link=True) as (_, wanted):
        wanted.collections = ["Hero"]
    empty = b.link(blender.data.objects.new("Instance", None))
    empty.instance_type, empty.instance_collection = "COLLECTION", wanted.collections[0]
    blender.ops.wm.save_as_mainfile(filepath=str(tmp_path / "shot.blend"))
    assert not export().lost_features("//hero.blend")
    library.unlink()
    blender.ops.wm.open_mainfile(filepath=str(tmp_path / "shot.blend"))
    assert export().lost_features("//hero.blend") == ["missing library data: Hero"]


def test_python_that_was_not_run_is_named(blender, tmp_path):
    import blender_scene as b
    from gltf_reader import Gltf
    from test_blender_script import run

    b.camera()
    b.cube().driver_add("location", 0).driver.expression = "max([v for v in (frame, 3)])"
    blender.ops.wm.save_as_mainfile(filepath=str(tmp_path / "shot.blend"))
    for options, place in (((), 0), (("--scripts",), 3)):
        done = run(tmp_path / "shot.blend", tmp_path / "anim.gltf", *options)
        assert done.returncode == 0, done.stderr
        assert ("warning: shot.blend: Python that was not allowed to run" in done.stderr) == (not options)
        gltf = Gltf(tmp_path / "anim.gltf")
        assert gltf.world(gltf.node("Cube"), 1)[0, 3] == place


def test_drivers_that_fail_are_named(blender, export, monkeypatch):
    import blender_scene as b

    b.camera()
    ob, other = b.cube("Lifted"), b.cube("Turned")
    made, _ = b.material("Glowing")
    ob.data.materials.append(made)
    monkeypatch.setattr(blender.context.preferences.filepaths, "use_scripts_auto_execute", True)
    ob.driver_add("location", 2).driver.expression = "no_such_function(frame)"
    other.driver_add("location", 2).driver.expression = "frame * 2"
    made.node_tree.driver_add('nodes["Principled BSDF"].inputs["Metallic"].default_value').driver.variables.new()
    gltf = export()
    assert gltf.lost_features("Lifted") == ["drivers that fail: location"]
    assert gltf.lost_features("Turned") == []
    assert [f for f in gltf.lost_features("Glowing") if "driver" in f] == ['drivers that fail: nodes["Principled BSDF"].inputs["Metallic"].default_value']


@pytest.mark.parametrize(("engine", "after", "named"), [("CYCLES", False, True), ("CYCLES", True, False), ("BLENDER_EEVEE", False, False)])
def test_adaptive_subdivision_is_named(blender, export, engine, after, named):
    import blender_scene as b

    if blender.app.version < (5, 0):
        pytest.skip("a setting of the object before Blender 5.0")
    b.camera()
    blender.context.scene.render.engine = engine
    ob = b.cube()
    ob.modifiers.new("Fine", "SUBSURF").use_adaptive_subdivision = True
    if after:
        ob.modifiers.new("Edge", "BEVEL")
    assert ("adaptive subdivision" in export().lost_features("Cube")) == named


def test_what_principled_has_beyond_gltf_is_named(blender, surface, export):
    names = {"Diffuse Roughness": 0.5, "Subsurface Weight": 0.5, "Thin Film Thickness": 300.0}
    there = [name for name in names if name in surface.inputs]
    for name in there:
        surface.inputs[name].default_value = names[name]
    surface.inputs["Specular Tint"].default_value = (0.2, 0.4, 1, 1)
    labels = {"Diffuse Roughness": "diffuse roughness", "Subsurface Weight": "subsurface scattering", "Thin Film Thickness": "thin film"}
    assert export().lost_features("Grey") == [labels[name] for name in there]
    surface.inputs["Metallic"].default_value = 1.0
    surface.inputs["Base Color"].default_value = (1.5, 0.5, 0.5, 1)
    assert export().lost_features("Grey") == [*(labels[name] for name in there), "base color over 1", "specular tint of a metal"]


@pytest.mark.parametrize(("bright", "lost"), [(0.0, []), (0.5, ["base color over 1"])])
def test_colours_that_are_baked_are_named_where_they_are_cut_off(blender, surface, export, bright, lost):
    tree = surface.id_data
    noise, change = tree.nodes.new("ShaderNodeTexNoise"), tree.nodes.new("ShaderNodeBrightContrast")
    change.inputs["Bright"].default_value = bright
    tree.links.new(noise.outputs["Color"], change.inputs["Color"])
    tree.links.new(change.outputs["Color"], surface.inputs["Base Color"])
    assert export(bake=16).lost_features("Grey") == lost
