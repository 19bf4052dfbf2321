"""Saved reports: what has to come back, and files as older versions wrote them."""

import json
from dataclasses import fields, is_dataclass

import numpy as np

from exudyn_romerr.report.scope import Doubt

NOT_SAVED = {"nodes", "modes", "verdict", "peak", "rms", "end"}  # asked for before, or made of the rest


def same(one, other):
    """Whether two parts of reports are equal: every array to the last bit, every word, in the same order."""
    if isinstance(one, np.ndarray):
        return np.array_equal(one, other)
    if isinstance(one, Doubt):
        return one.__getnewargs__() == other.__getnewargs__()
    if is_dataclass(one):
        names = [field.name for field in fields(one) if field.name not in NOT_SAVED]
        return type(one) is type(other) and all(same(getattr(one, name), getattr(other, name)) for name in names)
    if isinstance(one, dict):
        return list(one) == list(other) and all(same(one[key], other[key]) for key in one)
    if isinstance(one, tuple | list):
        return len(one) == len(other) and all(map(same, one, other))
    return one == other


def rewritten(path, changed=None, without=(), words=()):
    """Change the JSON text of a saved report, or leave parts of it out, and arrays whose names have such words."""
    with np.load(path) as file:
        arrays = {key: file[key] for key in file.files if not any(word in key for word in words)}
    meta = {**json.loads(str(arrays.pop("meta"))), **(changed or {})}
    for key in without:
        del meta[key]
    np.savez(path, meta=np.array(json.dumps(meta)), **arrays)
