"""Saved reports as older versions wrote them."""

import json

import numpy as np


def rewritten(path, changed=None, without=(), words=()):
    """Change the JSON text of a saved report, or leave parts of it out, and arrays whose names have such words."""
    with np.load(path) as file:
        arrays = {key: file[key] for key in file.files if not any(word in key for word in words)}
    meta = {**json.loads(str(arrays.pop("meta"))), **(changed or {})}
    for key in without:
        del meta[key]
    np.savez(path, meta=np.array(json.dumps(meta)), **arrays)
