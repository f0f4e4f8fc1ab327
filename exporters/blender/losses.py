"""Names what of a whole scene a picture made from its glTF will not have."""

from __future__ import annotations

import math

import bpy

from ..common.report import Lost


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
    if not view_layer.use_solid:
        lost.add(view_layer.name, "view layer without surfaces", "they are rendered; hide the objects from the render")
    _name_layers(view_layer.layer_collection, lost)
    for ob in scene.objects:
        if ob.hide_render:
            continue
        linking = getattr(ob, "light_linking", None)
        if linking is not None and (linking.receiver_collection or linking.blocker_collection):
            lost.add(ob.name, "light linking", "it lights all, and all throw its shadow; use the layer of that light in compositing (--aov lights)")
        for flag, label in (("is_holdout", "holdout"), ("is_shadow_catcher", "shadow catcher")):
            if ob.type == "MESH" and getattr(ob, flag, False):
                lost.add(ob.name, label, "it is rendered as an ordinary object; use its objectId in compositing")
        if ob.type == "MESH" and not getattr(ob, "visible_camera", True):
            lost.add(ob.name, "hidden from camera rays", "it is seen here; hide it from the render or leave it out")
        if ob.type == "MESH" and not getattr(ob, "visible_shadow", True):
            lost.add(ob.name, "without a shadow", "it throws one here")
        for system in ob.particle_systems:
            if system.settings.type == "HAIR" and system.settings.render_type == "PATH":
                lost.add(ob.name, "hair", "it is left out; convert it to a mesh first (Object > Convert)")


def _name_layers(layer: bpy.types.LayerCollection, lost: Lost) -> None:
    """What a view layer does to whole collections."""
    if layer.exclude or layer.collection.hide_render:
        return
    for flag, label in (("holdout", "holdout"), ("indirect_only", "indirect only")):
        if getattr(layer, flag):
            lost.add(layer.name, f"{label} collection", "its objects are rendered as ordinary ones; use their objectId in compositing")
    for child in layer.children:
        _name_layers(child, lost)
