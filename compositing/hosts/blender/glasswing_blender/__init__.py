"""Glasswing for Blender: captured objects in front of any picture (docs/blender.md)."""

bl_info = {
    "name": "Glasswing environment mattes",
    "author": "Glasswing",
    "version": (0, 1, 0),
    "blender": (3, 4, 0),
    "location": "Image Editor and 3D Viewport > Sidebar > Glasswing",
    "description": "Puts captured objects, with their refraction and blur, over pictures and footage, and into scenes",
    "category": "Compositing",
}

from . import panel


def register():
    panel.register()


def unregister():
    panel.unregister()
