"""Exporters that carry camera moves from Blender and USD to glTF with nothing lost (see docs/extras.md)."""
