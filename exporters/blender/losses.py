"""Names what of a whole scene a picture made from its glTF will not have."""

from __future__ import annotations

import math
from pathlib import Path

import bpy

from ..common.report import Lost
from .prepare import is_animated, rendered_objects

_SURFACES = {"MESH", "CURVE", "SURFACE", "FONT", "META"}
# Which rays a surface may be hidden from, where that makes a difference.
_RAYS = {
    "visible_camera": ("hidden from camera rays", "it is seen here; hide it from the render or leave it out"),
    "visible_glossy": ("hidden from reflections", "mirrors show it here"),
    "visible_transmission": ("hidden from transmission rays", "it is seen through glass here"),
    "visible_shadow": ("without a shadow", "it throws one here"),
}


def name_scene_losses(scene: bpy.types.Scene, view_layer: bpy.types.ViewLayer, lost: Lost) -> None:
    """Things of the whole scene, its view layer and its objects."""
    render = scene.render
    if render.frame_map_old != render.frame_map_new:
        lost.add(scene.name, "time stretching", "set Time Stretching back and scale the keys instead")
    if render.use_motion_blur:
        lost.add(scene.name, "motion blur", "it is not rendered; use the motion vectors (--aov motion) in compositing")
    if render.use_border:
        lost.add(scene.name, "render region", "the whole picture is rendered; pass --crop to buzz-convert")
    if render.use_multiview:
        lost.add(scene.name, "stereoscopy", "pass --stereo and --convergence to buzz-convert")
    if scene.frame_step != 1:
        lost.add(scene.name, f"frame step {scene.frame_step}", f"pass --frames {scene.frame_start}-{scene.frame_end}x{scene.frame_step} to buzz-convert")
    if render.film_transparent:
        lost.add(scene.name, "transparent film", "pass --transparent to buzz-convert")
    if (exposure := getattr(getattr(scene, "cycles", None), "film_exposure", 1.0)) not in (0, 1):
        lost.add(scene.name, f"film exposure {exposure:g}", f"pass --exposure {math.log2(exposure):.3g} to buzz-convert")
    for camera in {m.camera for m in scene.timeline_markers if m.camera} | {scene.camera}:
        if camera is not None and camera.type == "CAMERA" and camera.data.dof.use_dof:
            lost.add(camera.name, "depth of field", "it is not rendered; use depth.Z in compositing")
    if render.use_freestyle and view_layer.use_freestyle:
        lost.add(scene.name, "Freestyle lines", "they are not drawn; render them by themselves (As Render Pass) for compositing")
    if render.use_sequencer and scene.sequence_editor and _strips(scene.sequence_editor):
        lost.add(scene.name, "video sequencer", "the scene is rendered, not its strips; edit the finished frames")
    for other in scene.view_layers:
        if other.use and other != view_layer:
            lost.add(other.name, "further view layer", f"only {view_layer.name!r} is exported; export again with Use for Rendering on in this one only")
    if not view_layer.use_solid:
        lost.add(view_layer.name, "view layer without surfaces", "they are rendered; hide the objects from the render")
    _name_layers(view_layer.layer_collection, lost)
    _name_missing_data(lost)
    rendered = rendered_objects(view_layer)
    for ob in _with_instanced([ob for ob in scene.objects if ob.name_full in rendered]):
        _name_object(ob, lost)
        if render.engine == "CYCLES" and (fine := _adaptive(ob)) is not None:
            lost.add(ob.name, "adaptive subdivision", f"it is subdivided {fine.render_levels} times, near and far; raise its Levels Render")


def _strips(editor: bpy.types.SequenceEditor) -> bool:
    """Whether strips are rendered in place of the scene, as Blender decides it."""
    # Called otherwise before Blender 5.0.
    strips = editor.strips if hasattr(editor, "strips") else editor.sequences
    return any(s.type != "SOUND" and not s.mute and not editor.channels[s.channel].mute for s in strips)


def name_scripts(lost: Lost) -> None:
    """Drivers and scripts that Blender was not allowed to run, or that fail; it knows once they would have."""
    if bpy.app.autoexec_fail:
        what = f"Python that was not allowed to run ({bpy.app.autoexec_fail_message})"
        lost.add(Path(bpy.data.filepath).name, what, "what it moves rests; if you trust the file, allow it (blender --enable-autoexec, export.py --scripts)")
        return
    for item in bpy.data.user_map():
        for owner in (item, getattr(item, "node_tree", None)):
            data = getattr(owner, "animation_data", None)
            failing = dict.fromkeys(curve.data_path for curve in data.drivers if not curve.driver.is_valid) if data else {}
            if failing:
                what = f"drivers that fail: {_shortened(list(failing))}"
                lost.add(item.name, what, "what they drive rests; mend them (functions of add-ons may not be there), or bake it to keys")


def _shortened(names: list[str]) -> str:
    return ", ".join(names[:5]) + (f" and {len(names) - 5} more" if len(names) > 5 else "")


def _name_missing_data(lost: Lost) -> None:
    """What is linked from a library that has it no more, or is itself not there."""
    missing: dict[str, list[str]] = {}
    for item in bpy.data.user_map():
        if item.is_missing and item.library is not None and not isinstance(item, bpy.types.Library):
            missing.setdefault(item.library.filepath, []).append(item.name)
    for path, names in missing.items():
        shown = _shortened(sorted(names))
        lost.add(path, f"missing library data: {shown}", "it is left out; find it with File > External Data > Find Missing Files, or link it anew")


def _with_instanced(objects: list[bpy.types.Object]) -> list[bpy.types.Object]:
    """Objects that a render may show, with those of the collections that they instance."""
    found: dict[bpy.types.Object, None] = {}
    for ob in (queue := list(objects)):
        if ob in found or (ob.hide_render and not is_animated(ob)):
            continue
        found[ob] = None
        if ob.instance_type == "COLLECTION" and ob.instance_collection is not None:
            queue += ob.instance_collection.all_objects
    return list(found)


def _name_object(ob: bpy.types.Object, lost: Lost) -> None:
    linking = getattr(ob, "light_linking", None)
    if linking is not None and (linking.receiver_collection or linking.blocker_collection):
        lost.add(ob.name, "light linking", "it lights all, and all throw its shadow; use the layer of that light in compositing (--aov lights)")
    if ob.type in _SURFACES:
        for flag, label in (("is_holdout", "holdout"), ("is_shadow_catcher", "shadow catcher")):
            if getattr(ob, flag, False):
                lost.add(ob.name, label, "it is rendered as an ordinary object; use its objectId in compositing")
        for flag, (label, action) in _RAYS.items():
            if not getattr(ob, flag, True):
                lost.add(ob.name, label, action)
    elif ob.type == "LIGHT":
        for flag, label in (("visible_diffuse", "diffuse"), ("visible_glossy", "glossy")):
            if not getattr(ob, flag, True):
                lost.add(ob.name, f"light hidden from {label} rays", "it lights all here; use its layer in compositing (--aov lights)")
    for system in ob.particle_systems:
        if system.settings.type == "HAIR" and system.settings.render_type == "PATH":
            lost.add(ob.name, "hair", "it is left out; convert it to a mesh first (Object > Convert)")


def _adaptive(ob: bpy.types.Object) -> bpy.types.Modifier | None:
    """The subdivision of an object that Cycles makes as fine as its pixels: only the last modifier can be."""
    last = next((modifier for modifier in reversed(ob.modifiers) if modifier.show_render), None)
    # Before Blender 5.0 it was a setting of the object.
    holder = last if hasattr(last, "use_adaptive_subdivision") else getattr(ob, "cycles", None)
    return last if last is not None and last.type == "SUBSURF" and getattr(holder, "use_adaptive_subdivision", False) else None


def _name_layers(layer: bpy.types.LayerCollection, lost: Lost) -> None:
    """What a view layer does to whole collections."""
    if layer.exclude or layer.collection.hide_render:
        return
    for flag, label in (("holdout", "holdout"), ("indirect_only", "indirect only")):
        if getattr(layer, flag):
            lost.add(layer.name, f"{label} collection", "its objects are rendered as ordinary ones; use their objectId in compositing")
    for child in layer.children:
        _name_layers(child, lost)
