"""The Blender side: an extension (File > Export > Buzz glTF, a Render-properties panel) that is also a script."""
