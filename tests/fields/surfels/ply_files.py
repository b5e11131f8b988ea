"""PLY files by plyfile alone, to compare with and to damage."""

import numpy as np
from plyfile import PlyData, PlyElement


def numbered(name, count):
    """Names name_0, name_1, ..."""
    return [f"{name}_{k}" for k in range(count)]


def vertices(path):
    """Vertices of a file as a structured array."""
    return PlyData.read(path)["vertex"].data


def write_vertices(path, columns, **kind):
    """A PLY file written by plyfile alone."""
    columns = {name: np.asarray(column, np.float32) for name, column in columns.items()}
    array = np.zeros(len(next(iter(columns.values()))), [(name, "f4") for name in columns])
    for name, column in columns.items():
        array[name] = column
    PlyData([PlyElement.describe(array, "vertex")], **kind).write(path)
    return path


def columns_of(path, **changes):
    """Columns of a PLY file, some changed; None removes one."""
    data = vertices(path)
    columns = {name: np.array(data[name]) for name in data.dtype.names} | changes
    return {name: column for name, column in columns.items() if column is not None}
