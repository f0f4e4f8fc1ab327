"""The Blender side: an extension (File > Export > Buzz glTF, a Render-properties panel) that is also a script."""


def register() -> None:
    """Called by Blender when the extension is switched on."""
    from . import ui

    ui.register()


def unregister() -> None:
    """Called by Blender when the extension is switched off."""
    from . import ui

    ui.unregister()
