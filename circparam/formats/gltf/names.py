"""Names of materials, meshes and nodes of a glTF tree."""

from collections.abc import Sequence

from circparam.formats.gltf.model import Primitive
from circparam.formats.gltf.reading import Tree


def material_of(tree: Tree, primitive: Primitive) -> int:
    """The number of the material of a primitive, −1 if it has none."""
    entry = tree.json["meshes"][primitive.mesh]["primitives"][primitive.number]
    return int(entry.get("material", -1))


def entry_names(tree: Tree, kind: str, used: Sequence[int]) -> tuple[tuple[str, int], ...]:
    """The names of entries of a top-level list with their numbers; entries without a name have none."""
    found = ((tree.item(kind, k).get("name"), k) for k in sorted(set(used)) if k >= 0)
    return tuple((str(name), k) for name, k in found if name)


def node_names(tree: Tree) -> tuple[tuple[str, int], ...]:
    """The name of every node with the number of each mesh that the node or one below it shows."""
    nodes = tree.entries("nodes")
    above = {child: k for k, node in enumerate(nodes) for child in node.get("children", [])}
    pairs: dict[tuple[str, int], None] = {}
    for k, node in enumerate(nodes):
        if "mesh" not in node:
            continue
        at: int | None = k
        while at is not None:
            if name := nodes[at].get("name"):
                pairs[str(name), int(node["mesh"])] = None
            at = above.get(at)
    return tuple(pairs)
