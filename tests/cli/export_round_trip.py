#!/usr/bin/env python3
"""Compares exports with the file that they were made of, by readers that share no code with ringlock.

Usage: export_round_trip.py FILE.h5 FILE.json FILE.npz FILE.mat
Ends with 77 where h5py, NumPy or SciPy is missing.
"""
import json
import re
import sys

try:
    import h5py
    import numpy as np
    import scipy.io
except ImportError as missing:
    print(f"skipped: {missing}")
    sys.exit(77)


def text_of(value):
    return value.decode() if isinstance(value, bytes) else value


def values_of(dataset):
    values = dataset[()]
    if dataset.dtype.kind == "O":
        return np.array([text_of(v) for v in np.ravel(values)]).reshape(dataset.shape)
    return values


def matlab_name(name):
    out = re.sub(r"[^A-Za-z0-9]", "_", name)
    return out if out[0].isalpha() else "x" + out


def same(a, b):
    a, b = np.asarray(a), np.asarray(b)
    return a.shape == b.shape and np.array_equal(a, b, equal_nan=a.dtype.kind == "f")


def below(tree, path):
    for part in path:
        tree = tree[part]
    return tree


def main(h5_name, json_name, npz_name, mat_name):
    h5 = h5py.File(h5_name)
    with open(json_name, encoding="utf-8") as text:
        tree = json.load(text)
    npz = np.load(npz_name)
    mat = scipy.io.loadmat(mat_name)
    labels = {name: (unit, description) for name, unit, description in npz["labels"]}
    count = 0

    def in_mat(path):
        """Structs of MATLAB are arrays of one record."""
        value = mat
        for part in path:
            value = value[matlab_name(part)]
            if value.dtype.names is not None:
                value = value[0, 0]
        return value

    def check_attributes(path, item):
        nonlocal count
        name = "/".join(path)
        for key, value in item.attrs.items():
            if isinstance(item, h5py.Dataset) and key in ("unit", "description"):
                continue
            count += 1
            value = text_of(value)
            stored = npz[f"{name}@{key}"]
            assert same(stored, value), (name, key)
            told = below(tree, path)["attributes"][key]
            is_nan = isinstance(value, float) and not np.isfinite(value)
            assert told is None if is_nan else same(told, value), (name, key)
            if not isinstance(item, h5py.Dataset):
                field = key + "_attribute" if key in item else key
                found = np.squeeze(in_mat(list(path) + [field]))
                assert same(found if found.size else "", value), (name, key, found, value)

    def check(name, item):
        nonlocal count
        path = name.split("/")
        check_attributes(path, item)
        if not isinstance(item, h5py.Dataset):
            return
        count += 1
        values = values_of(item)
        stored = npz[name]
        assert same(stored, values), name
        assert values.dtype.kind == "U" or stored.dtype == values.dtype, name
        assert labels[name] == (item.attrs["unit"], item.attrs["description"]), name
        told = below(tree, path)
        assert (told["unit"], told["description"]) == labels[name], name
        numbers = np.array(told["values"], dtype=values.dtype).reshape(values.shape)
        assert same(numbers, values), name
        found = in_mat(path)
        if values.dtype.kind == "U":
            found = [np.squeeze(v).item() if v.size else "" for v in np.ravel(found)] if values.size > 1 else [
                np.squeeze(found).item() if found.size else ""]
            found = np.array(found).reshape(values.shape)
            assert same(found, values), name
        else:
            assert same(found, values.reshape(len(values), -1)), name
            assert found.dtype == values.dtype, name
        unit = in_mat(["unit"] + path)
        assert ("" if unit.size == 0 else np.squeeze(unit).item()) == item.attrs["unit"], name

    check_attributes([], h5)
    h5.visititems(check)
    arrays = set(npz.files) - {"labels"}
    assert len(arrays) == count, (len(arrays), count)
    print(f"{count} datasets and attributes are the same in all")


main(*sys.argv[1:])
