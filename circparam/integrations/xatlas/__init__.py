"""The parts of ``circparam.xatlas``: options, meshes as they are added, their layout, the atlas, OBJ export."""
