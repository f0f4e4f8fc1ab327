"""Menu entry, panel and operators. All work is done in processes of their own on a copy of the file.

So the open file, its selection and its mode are never touched, and Blender stays usable meanwhile.
"""

from __future__ import annotations

import os
import shutil
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import bpy
from bpy.props import BoolProperty, EnumProperty, IntProperty, PointerProperty, StringProperty
from bpy_extras.io_utils import ExportHelper

from . import background, compositor

_PACKAGE = __package__.rsplit(".", 1)[0]
_QUALITIES = (
    ("full", "Full", "Every frame is traced"),
    ("half-pixel", "Half Pixel", "Reused samples lie inside their pixel"),
    ("centred", "Centred", "Inside surfaces are re-centred, edges are traced"),
    ("verified", "Verified", "Every reused sample is proven visible by a ray"),
)
_AFTER = (
    ("NODES", "Load into Compositor", "Add an Image node with the sequence and all its layers"),
    ("FOLDER", "Open Folder", "Show the folder in the file browser of the system"),
    ("NOTHING", "Nothing", "Only write the files"),
)


def _is_camera(_self, ob: bpy.types.Object) -> bool:
    return ob.type == "CAMERA"


class BuzzSettings(bpy.types.PropertyGroup):
    """What the panel asks; kept in the scene."""

    output: StringProperty(name="Output", description="Folder for the glTF and the sequence", default="//buzz/", subtype="DIR_PATH")
    use_range: BoolProperty(name="Own Frame Range", description="Use another range than the scene's")
    first: IntProperty(name="First", default=1)
    last: IntProperty(name="Last", default=250)
    use_resolution: BoolProperty(name="Own Resolution", description="Use another resolution than the scene's")
    width: IntProperty(name="Width", default=1920, min=1, max=65536, subtype="PIXEL")
    height: IntProperty(name="Height", default=1080, min=1, max=65536, subtype="PIXEL")
    camera: PointerProperty(name="Camera", description="One camera for all; empty: the markers', else the scene's", type=bpy.types.Object, poll=_is_camera)
    quality: EnumProperty(name="Quality", items=_QUALITIES, default="centred")
    layers: StringProperty(name="Layers", description="Extra layers of the sequence (--aov)", default="depth,class")
    bake: IntProperty(name="Bake Size", description="Pixels of baked procedural textures; 0 does not bake", default=1024, min=0, max=16384)
    after: EnumProperty(name="Afterwards", items=_AFTER, default="NODES")


class BuzzPreferences(bpy.types.AddonPreferences):
    """Where the renderer is."""

    bl_idname = _PACKAGE
    converter: StringProperty(name="buzz-convert", description="Path of the buzz-convert program; empty: found on the search path", subtype="FILE_PATH")

    def draw(self, _context) -> None:
        """One field, and whether the program is there."""
        self.layout.prop(self, "converter")
        found = background.find_converter(bpy.path.abspath(self.converter))
        self.layout.label(text=f"Found {found}" if found else "Not found: set the path of buzz-convert", icon="CHECKMARK" if found else "ERROR")


class State:
    """The one task that may run; the panel shows it."""

    task: background.Task | None = None


def _preferred_converter() -> str:
    addon = bpy.context.preferences.addons.get(_PACKAGE)
    return bpy.path.abspath(addon.preferences.converter) if addon and addon.preferences else ""


def _save_copy(folder: Path) -> Path:
    """Save a copy of the open file, with all that it reads."""
    file = Path(bpy.data.filepath)
    copy = folder / (file.name or "untitled.blend")
    with _absolute_bakes():
        # copy=True leaves the open file's name and its unsaved state as they are; relative paths are remapped in the copy.
        bpy.ops.wm.save_as_mainfile(filepath=str(copy), copy=True, relative_remap=True, compress=False)
    # Blender looks for disk caches beside the file only.
    caches = file.parent / f"blendcache_{file.stem}"
    if file.name and caches.is_dir():
        try:
            # Links to the files, not to the folder: what was not baked is deleted and made anew, and stays beside the open file.
            shutil.copytree(caches, folder / caches.name, copy_function=os.symlink)
        except OSError:
            # Windows lets not everybody make links.
            shutil.copytree(caches, folder / caches.name, dirs_exist_ok=True)
    return copy


@contextmanager
def _absolute_bakes() -> Iterator[None]:
    """Folders of geometry nodes' bakes, which Blender does not remap, are absolute for as long as a copy is saved."""
    nodes = [m for ob in bpy.data.objects if not ob.library for m in ob.modifiers if m.type == "NODES"]
    kept = [(m, "bake_directory", m.bake_directory) for m in nodes]
    kept += [(bake, "directory", bake.directory) for m in nodes for bake in m.bakes]
    relative = [each for each in kept if each[2].startswith("//")]
    for owner, name, path in relative:
        setattr(owner, name, bpy.path.abspath(path))
    try:
        yield
    finally:
        for owner, name, path in relative:
            setattr(owner, name, path)


class _Runner:
    """What the operators share: a copy of the file, a task, a timer."""

    bl_options = {"REGISTER"}
    _timer = None
    _convert_to: Path | None = None

    def start(self, context, output: Path, convert_to: Path | None):
        """Save a copy and start; finished at once in background mode, else modal."""
        if State.task is not None and not State.task.done:
            self.report({"ERROR"}, "An export is already running; cancel it in the Render properties first")
            return {"CANCELLED"}
        settings = context.scene.buzz
        self._convert_to, self._folder = convert_to, tempfile.TemporaryDirectory(prefix="buzz-")
        copy = _save_copy(Path(self._folder.name))
        # What Blender would not run here, it does not run there; the copy is not in the user's trusted folders.
        trusted = not bpy.app.autoexec_fail
        steps = [("exporting", background.export_command(bpy.app.binary_path, copy, output, self._options(context.scene, settings), trusted))]
        if convert_to is not None:
            converter = background.find_converter(_preferred_converter())
            if converter is None:
                self.report({"ERROR"}, "buzz-convert is not found; set its path in Preferences > Add-ons > Buzz glTF")
                return {"CANCELLED"}
            command = [converter, str(output), str(convert_to), "--quality", settings.quality, "--progress", "plain", "--overwrite"]
            if settings.layers.strip():
                command += ["--aov", settings.layers.replace(" ", "")]
            if context.scene.render.film_transparent:
                command.append("--transparent")
            steps.append(("rendering", command))
        images = [image.name for image in bpy.data.images if image.is_dirty and image.source != "VIEWER"]
        unsaved = [f"{name}: image that is painted but not saved: it is as it was before; save or pack it" for name in images]
        State.task = background.Task(steps, warnings=unsaved)
        if bpy.app.background:
            State.task.wait(print)
            return self._finish(context)
        self._timer = context.window_manager.event_timer_add(0.2, window=context.window)
        context.window_manager.modal_handler_add(self)
        return {"RUNNING_MODAL"}

    @staticmethod
    def _options(scene, settings) -> list[str]:
        # One argument each, so that a name or a number that begins with a minus is not taken for an option.
        options = [f"--scene={scene.name}", f"--bake={settings.bake}"]
        if settings.use_range:
            options.append(f"--frames={settings.first}-{settings.last}")
        if settings.use_resolution:
            options.append(f"--resolution={settings.width}x{settings.height}")
        if settings.camera is not None:
            options.append(f"--camera={settings.camera.name}")
        return options

    def modal(self, context, event):
        """Poll on the timer; Esc in the 3D view does not end a render, the panel's button does."""
        if event.type != "TIMER":
            return {"PASS_THROUGH"}
        task = State.task
        running = task is not None and task.poll()
        context.workspace.status_text_set(f"Buzz: {task.text}" if running else None)
        for area in context.screen.areas:
            if area.type == "PROPERTIES":
                area.tag_redraw()
        return {"PASS_THROUGH"} if running else self._finish(context)

    def _finish(self, context):
        if self._timer is not None:
            context.window_manager.event_timer_remove(self._timer)
            self._timer = None
            context.workspace.status_text_set(None)
        self._folder.cleanup()
        task, State.task = State.task, None
        for line in task.warnings:
            self.report({"WARNING"}, line)
        if task.error is not None:
            self.report({"ERROR"}, task.error)
            return {"CANCELLED"}
        if self._convert_to is not None:
            after = context.scene.buzz.after
            if after == "NODES":
                compositor.load_sequence(context.scene, self._convert_to)
            elif after == "FOLDER":
                background.open_folder(self._convert_to)
        self.report({"INFO"}, f"Buzz: written to {self._convert_to or 'the output folder'}")
        return {"FINISHED"}


class EXPORT_SCENE_OT_buzz_gltf(_Runner, bpy.types.Operator, ExportHelper):
    """Export the shot as glTF with cameras, cuts, lens and lights, for buzz-convert and other viewers"""

    bl_idname = "export_scene.buzz_gltf"
    bl_label = "Export Buzz glTF"
    filename_ext = ".gltf"
    filter_glob: StringProperty(default="*.gltf;*.glb", options={"HIDDEN"})
    check_extension = None

    def execute(self, context):
        """Export to the chosen file."""
        path = Path(bpy.path.abspath(self.filepath))
        return self.start(context, path if path.suffix in (".gltf", ".glb") else path.with_suffix(".gltf"), None)


class RENDER_OT_buzz_export(_Runner, bpy.types.Operator):
    """Export the shot as glTF into the output folder"""

    bl_idname = "render.buzz_export"
    bl_label = "Export"

    convert: BoolProperty(default=False, options={"HIDDEN", "SKIP_SAVE"})

    @classmethod
    def description(cls, _context, properties) -> str:
        """The tooltip of the two buttons."""
        if properties.convert:
            return "Export the shot, render it with buzz-convert and load the sequence"
        return "Export the shot as glTF into the output folder"

    def execute(self, context):
        """Export, and convert if asked."""
        folder = context.scene.buzz.output
        if folder.startswith("//") and not bpy.data.filepath:
            self.report({"ERROR"}, "The output folder is beside the file: save the file first, or choose another folder")
            return {"CANCELLED"}
        folder = Path(bpy.path.abspath(folder))
        stem = Path(bpy.data.filepath).stem or "untitled"
        return self.start(context, folder / f"{stem}.gltf", folder / stem if self.convert else None)


class RENDER_OT_buzz_cancel(bpy.types.Operator):
    """Stop the export or the render; finished frames stay"""

    bl_idname = "render.buzz_cancel"
    bl_label = "Cancel"

    def execute(self, _context):
        """End the process."""
        if State.task is not None:
            State.task.cancel()
        return {"FINISHED"}


class RENDER_PT_buzz(bpy.types.Panel):
    """Everything in one place, under the render engine's own settings."""

    bl_label = "Buzz"
    bl_space_type = "PROPERTIES"
    bl_region_type = "WINDOW"
    bl_context = "render"
    bl_options = {"DEFAULT_CLOSED"}

    def draw(self, context) -> None:
        """The settings, and either two buttons or the progress."""
        layout, settings, scene = self.layout, context.scene.buzz, context.scene
        layout.use_property_split = True
        layout.use_property_decorate = False
        layout.prop(settings, "output")
        column = layout.column(heading="Frame Range")
        column.prop(settings, "use_range", text="Own")
        if settings.use_range:
            column.prop(settings, "first")
            column.prop(settings, "last")
        else:
            column.label(text=f"{scene.frame_start} - {scene.frame_end}")
        column = layout.column(heading="Resolution")
        column.prop(settings, "use_resolution", text="Own")
        if settings.use_resolution:
            column.prop(settings, "width")
            column.prop(settings, "height")
        layout.prop(settings, "camera")
        cuts = sum(1 for m in scene.timeline_markers if m.camera is not None)
        if settings.camera is None and cuts:
            layout.label(text=f"{cuts} markers with cameras", icon="MARKER")
        layout.prop(settings, "quality")
        layout.prop(settings, "layers")
        layout.prop(settings, "bake")
        layout.prop(settings, "after")
        task = State.task
        if task is not None and not task.done:
            layout.progress(factor=task.factor, text=task.text[:80])
            layout.operator(RENDER_OT_buzz_cancel.bl_idname, icon="CANCEL")
            return
        row = layout.row(align=True)
        row.operator(RENDER_OT_buzz_export.bl_idname, icon="EXPORT")
        row.operator(RENDER_OT_buzz_export.bl_idname, text="Export and Convert", icon="RENDER_ANIMATION").convert = True


def _menu(self, _context) -> None:
    self.layout.operator(EXPORT_SCENE_OT_buzz_gltf.bl_idname, text="Buzz glTF (.gltf/.glb)")


_CLASSES = (BuzzSettings, BuzzPreferences, EXPORT_SCENE_OT_buzz_gltf, RENDER_OT_buzz_export, RENDER_OT_buzz_cancel, RENDER_PT_buzz)


def register() -> None:
    """Make everything known to Blender."""
    for cls in _CLASSES:
        bpy.utils.register_class(cls)
    bpy.types.Scene.buzz = PointerProperty(type=BuzzSettings)
    bpy.types.TOPBAR_MT_file_export.append(_menu)


def unregister() -> None:
    """Take everything back."""
    if State.task is not None:
        State.task.cancel()
    bpy.types.TOPBAR_MT_file_export.remove(_menu)
    del bpy.types.Scene.buzz
    for cls in reversed(_CLASSES):
        bpy.utils.unregister_class(cls)
