"""Progressive rendering of a loaded scene, its output as an EXR and a display image, and scene files.

From Python::

    from mi_brdfs.rendering.output import display_image, write
    from mi_brdfs.rendering.passes import render

    scene = mi.load_file("scene.xml", optimize=False)  # or meshes are merged, in another order each time
    picture = render(scene, spp=256)
    picture.image                               # the developed tensor
    write(picture.bitmap, "scene.exr")
    write(display_image(picture.bitmap), "scene.png")
"""

MOST_PIXELS = 16384
"""The largest width and height of a picture."""
