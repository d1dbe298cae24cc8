"""Small mesh files, and what came out of them."""

import base64
import json

import numpy as np
import trimesh

from ddenv.world.files.meshes import build, read_parts, unpack

QUADS = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]
CORNERS = [(x, y, z) for x in (0, 1) for y in (0, 2) for z in (0, 3)]
BOX = trimesh.Trimesh(
    CORNERS, [face for a, b, c, d in QUADS for face in ((a, b, c), (a, c, d))], process=False
)


def mesh_of(path, data, **way):
    path.write_bytes(data if isinstance(data, bytes) else data.encode())
    return unpack("m", build(read_parts(path), **{"convex": False, **way}))


def bounds(mesh):
    return [mesh.vertices.min(axis=0).tolist(), mesh.vertices.max(axis=0).tolist()]


def solid(mesh):
    return trimesh.Trimesh(mesh.vertices, mesh.faces, process=False)


AXES = "".join(f"<param name='{axis}' type='float'/>" for axis in "XYZ")
SHAPES = (
    "<triangles count='4'><input semantic='VERTEX' source='#v' offset='1'/><input "
    "semantic='NORMAL' source='#n' offset='0'/>"
    "<p>0 0 0 2 0 1  0 0 0 1 0 3  0 0 0 3 0 2  0 1 0 2 0 3</p></triangles>"
)


def dae(
    asset="",
    nodes="<node name='tip'><instance_geometry url='#g'/></node>",
    shapes=SHAPES,
    positions="0 0 0 1 0 0 0 2 0 0 0 3",
    head="",
):
    """A COLLADA file with one geometry: a tetrahedron of 1 x 2 x 3."""
    return f"""<?xml version="1.0"?>{head}<COLLADA xmlns="http://www.collada.org/2005/11/COLLADASchema" version="1.4.1">
    <asset>{asset}</asset>
    <library_images><image id="i"><init_from>../../etc/passwd</init_from></image></library_images>
    <library_geometries><geometry id="g" name="shape"><mesh>
      <source id="n"><float_array id="b" count="3">0 nan 1</float_array>
        <technique_common><accessor source="#b" count="1" stride="3">{AXES}</accessor></technique_common></source>
      <source id="p"><float_array id="a" count="12">{positions}</float_array>
        <technique_common><accessor source="#a" count="4" stride="3">{AXES}</accessor></technique_common></source>
      <vertices id="v"><input semantic="POSITION" source="#p"/></vertices>{shapes}
    </mesh></geometry></library_geometries>
    <library_controllers><controller id="c"><skin source="#g"/></controller></library_controllers>
    <library_nodes><node id="lib"><translate>0 0 10</translate><instance_geometry url="#g"/></node>
      <node id="circle"><instance_node url="#circle"/></node></library_nodes>
    <library_visual_scenes><visual_scene id="s">{nodes}</visual_scene></library_visual_scenes>
    <scene><instance_visual_scene url="#s"/></scene></COLLADA>"""


def gltf(uri=None, **changes):
    """The text of a .gltf with the same tetrahedron, and the bytes of its buffer."""
    points = np.array([[0, 0, 0], [1, 0, 0], [0, 2, 0], [0, 0, 3]], dtype="<f4").tobytes()
    faces = np.array([0, 2, 1, 0, 1, 3, 0, 3, 2, 1, 2, 3], dtype="<u2").tobytes()
    data = points + faces
    header = {
        "asset": {"version": "2.0"},
        "scene": 0,
        "scenes": [{"nodes": [0]}],
        "nodes": [{"name": "tip", "mesh": 0}],
        "meshes": [
            {
                "name": "shape",
                "primitives": [{"attributes": {"POSITION": 0}, "indices": 1, "material": 7}],
            }
        ],
        "accessors": [
            {"bufferView": 0, "componentType": 5126, "count": 4, "type": "VEC3"},
            {"bufferView": 1, "componentType": 5123, "count": 12, "type": "SCALAR"},
        ],
        "bufferViews": [
            {"buffer": 0, "byteLength": 48},
            {"buffer": 0, "byteOffset": 48, "byteLength": 24},
        ],
        "buffers": [
            {
                "byteLength": 72,
                "uri": uri
                or "data:application/octet-stream;base64," + base64.b64encode(data).decode(),
            }
        ],
        "images": [{"uri": "../../etc/passwd"}],
    }
    return json.dumps({**header, **changes}), data
