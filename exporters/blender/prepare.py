"""Make the viewport's evaluation equal to the render's.

Blender's Python (and its glTF exporter) sees the viewport's dependency graph. A render differs: other modifiers are on,
subdivision goes deeper, objects hidden in the viewport are there. The exporter works on a throwaway session (a copy of
the user's file), so the switches are simply set to what the render would use.
"""

from __future__ import annotations

from pathlib import Path

import bpy

from ..common.report import Lost
from .groups import inline_groups
from .nodes import drop_muted, trees

# The space of glTF's colours.
LINEAR = "Linear Rec.709"
# (viewport, render) pairs of properties that modifiers, curves, metaballs and particle settings have.
_LEVELS = (("levels", "render_levels"), ("screw_steps", "render_steps"), ("steps", "render_steps"), ("viewport_resolution", "resolution"))
# Modifiers of what simulations of other objects meet.
_MET = {"COLLISION", "FLUID", "DYNAMIC_PAINT"}


def prepare(scene: bpy.types.Scene, view_layer: bpy.types.ViewLayer) -> None:
    """Set everything that differs between viewport and render to the render's value."""
    _leave_edit_mode(view_layer)
    scene.world = getattr(view_layer, "world_override", None) or scene.world
    if not view_layer.use_sky:
        scene.world = None
    for owner in (scene.world, *bpy.data.lights):
        if owner is not None and owner.node_tree is not None:
            drop_muted(owner.node_tree)
            # Copies of nodes would not move with them, and nodes of a library cannot be linked.
            if not owner.library and not any(map(is_animated, trees(owner.node_tree))):
                inline_groups(owner.node_tree)
    if scene.render.use_simplify:
        scene.render.simplify_subdivision = scene.render.simplify_subdivision_render
        scene.render.simplify_child_particles = scene.render.simplify_child_particles_render
    for collection in bpy.data.collections:
        collection.hide_viewport = collection.hide_render
    _show_layers(view_layer.layer_collection)
    _keep_unseen(scene, view_layer)
    for ob in bpy.data.objects:
        still(ob, "hide_viewport")
        ob.hide_viewport = ob.hide_render and not stays(ob)
        ob.show_instancer_for_viewport = ob.show_instancer_for_render
        for modifier in ob.modifiers:
            _as_rendered(ob, modifier)
        for system in ob.particle_systems:
            _particles(system.settings)
    for ob in view_layer.objects:
        ob.hide_set(False, view_layer=view_layer)
    for curve in bpy.data.curves:
        if curve.render_resolution_u:
            curve.resolution_u = curve.render_resolution_u
        if curve.render_resolution_v:
            curve.resolution_v = curve.render_resolution_v
    for ball in bpy.data.metaballs:
        ball.resolution = ball.render_resolution
    for tree in bpy.data.node_groups:
        _is_render(tree)
    view_layer.update()


def work_in_rec709(lost: Lost) -> None:
    """Have Blender convert the file's colours to those of glTF, if it works in another space (from 5.0 on it may)."""
    space = getattr(bpy.data, "colorspace", None)
    if space is None or space.working_space_interop_id == "lin_rec709_scene":
        return
    if LINEAR not in space.bl_rna.properties["working_space"].enum_items:
        what = f"colours in {space.working_space}"
        lost.add(Path(bpy.data.filepath).name or "the file", what, f"they are taken for {LINEAR}; open the file with Blender's own colour management")
        return
    for owner in bpy.data.user_map():
        keyed = [each for each in (owner, getattr(owner, "node_tree", None)) if each is not None]
        if any(_is_colour(each, curve.data_path) for each in keyed for curve in action_curves(each)):
            what = f"animated colours in {space.working_space}"
            lost.add(owner.name, what, f"their keys are taken for {LINEAR}; choose that working space and key them anew")
    bpy.ops.wm.set_working_color_space(working_space=LINEAR, convert_colors=True)


def _is_colour(owner: bpy.types.ID, path: str) -> bool:
    """Whether a path leads to a colour."""
    where, _, name = path.rpartition(".")
    try:
        holder = owner.path_resolve(where) if where else owner
        return holder.bl_rna.properties[name].subtype == "COLOR"
    except (KeyError, ValueError, AttributeError):
        # What is gone, and custom properties.
        return False


def _leave_edit_mode(view_layer: bpy.types.ViewLayer) -> None:
    """A file saved while a mesh was being edited opens in edit mode, where the evaluated mesh has no attributes."""
    active = view_layer.objects.active
    for ob in view_layer.objects:
        if ob.mode != "OBJECT":
            view_layer.objects.active = ob
            bpy.ops.object.mode_set(mode="OBJECT")
    view_layer.objects.active = active


def _show_layers(layer: bpy.types.LayerCollection) -> None:
    layer.hide_viewport = False
    for child in layer.children:
        _show_layers(child)


def _keep_unseen(scene: bpy.types.Scene, view_layer: bpy.types.ViewLayer) -> None:
    """Have evaluated what is needed though its collections are hidden: what simulations meet, and cameras, as any may be asked for."""
    shown = rendered_objects(view_layer)
    unseen = [ob for ob in view_layer.objects if ob.name_full not in shown and (ob.type == "CAMERA" or _is_met(ob))]
    if unseen:
        kept = bpy.data.collections.new("Unseen")
        scene.collection.children.link(kept)
        kept.hide_render = True
        for ob in unseen:
            kept.objects.link(ob)


def stays(ob: bpy.types.Object) -> bool:
    """Whether an object is evaluated also while it is hidden: it moves on and appears again, or simulations meet it."""
    return _moves(ob, "hide_render") or _is_met(ob)


def _is_met(ob: bpy.types.Object) -> bool:
    """Whether an object has a part in simulations of others, which Blender makes of what the viewport has."""
    return ob.rigid_body is not None or (ob.field is not None and ob.field.type != "NONE") or any(m.type in _MET for m in ob.modifiers)


def _is_render(tree: bpy.types.NodeTree) -> None:
    """Have geometry nodes hear that they are not in a viewport."""
    for link in [link for link in tree.links if link.from_node.bl_idname == "GeometryNodeIsViewport"]:
        tree.links.new(tree.nodes.new("FunctionNodeInputBool").outputs[0], link.to_socket)


def still(ob: bpy.types.Object, path: str) -> None:
    """Take the animation off a property that is about to be set."""
    data = ob.animation_data
    if data is None:
        return
    for driver in list(data.drivers):
        if driver.data_path == path:
            data.drivers.remove(driver)
    for curve in action_curves(ob):
        if curve.data_path == path:
            curve.mute = True


def _as_rendered(ob: bpy.types.Object, modifier: bpy.types.Modifier) -> None:
    owner = f'modifiers["{bpy.utils.escape_identifier(modifier.name)}"]'
    for viewport, render in (("show_viewport", "show_render"), *_LEVELS):
        if not (hasattr(modifier, viewport) and hasattr(modifier, render)):
            continue
        still(ob, f"{owner}.{viewport}")
        setattr(modifier, viewport, getattr(modifier, render))
        if _moves(ob, f"{owner}.{render}"):
            _follow(modifier, viewport, ob, f"{owner}.{render}")


def _moves(ob: bpy.types.Object, path: str) -> bool:
    """Whether a property of an object has a driver or an F-curve."""
    data = ob.animation_data
    drivers = data.drivers if data else []
    return any(curve.data_path == path for curve in [*drivers, *action_curves(ob)])


def _follow(modifier: bpy.types.Modifier, viewport: str, ob: bpy.types.Object, path: str) -> None:
    """A driver that gives the viewport's property what the render's has at each frame."""
    driver = modifier.driver_add(viewport).driver
    driver.type = "SUM"
    target = driver.variables.new().targets[0]
    target.id, target.data_path = ob, path


def _particles(settings: bpy.types.ParticleSettings) -> None:
    settings.display_percentage = 100
    settings.child_percent = settings.rendered_child_count
    settings.display_step = settings.render_step


def rendered_objects(view_layer: bpy.types.ViewLayer) -> set[str]:
    """Names of the objects that are in a collection which the view layer renders."""
    names: set[str] = set()
    stack = [view_layer.layer_collection]
    while stack:
        layer = stack.pop()
        if layer.exclude or layer.collection.hide_render:
            continue
        names |= {ob.name_full for ob in layer.collection.objects}
        stack += list(layer.children)
    return names


def action_curves(owner: bpy.types.ID) -> list[bpy.types.FCurve]:
    """The F-curves of a datablock: of its action and of those in its NLA strips."""
    data = getattr(owner, "animation_data", None)
    if data is None:
        return []
    strips = [strip for track in data.nla_tracks for strip in track.strips]
    for strip in strips:
        # A meta strip holds others.
        strips += strip.strips
    return [curve for holder in (data, *strips) for curve in _curves(holder)]


def _curves(holder: bpy.types.AnimData | bpy.types.NlaStrip) -> list[bpy.types.FCurve]:
    """The F-curves of an action in use, in the old (4.x) and the slotted (5.x) form."""
    action = holder.action
    if action is None:
        return []
    if hasattr(action, "fcurves"):
        return list(action.fcurves)
    from bpy_extras.anim_utils import action_get_channelbag_for_slot

    bag = action_get_channelbag_for_slot(action, holder.action_slot)
    return list(bag.fcurves) if bag else []


def is_animated(owner: bpy.types.ID | None) -> bool:
    """Whether a datablock has an action, NLA strips or drivers of its own."""
    data = getattr(owner, "animation_data", None)
    return data is not None and bool(data.action or data.drivers or any(t.strips for t in data.nla_tracks))
