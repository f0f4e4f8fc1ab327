"""What the Blender and the USD exporter share: the glTF document, movement, extras and the list of things lost."""

VERSION = "0.1.0"
