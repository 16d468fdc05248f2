"""Files of a trained model: its weights, and its card, which holds the SHA-256 of the weights and of itself.

Both are compared with these hashes whenever a model is loaded, so that no damaged file is used.
"""

import hashlib
import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any, Final

from pipeline.atomic import atomic_write
from weaves.errors import BadInput
from weaves.reading import MIB, read_bytes

WEIGHTS, CARD = "model.safetensors", "card.json"
_HASHES: Final = "sha256"  # key of a card: hashes of the weights' file, and of the card without this second hash
_MOST_BYTES: Final = 8 * MIB  # of a card; those of a hundred fabrics have 100 kB
_MOST_WEIGHTS: Final = 256 * MIB  # the largest networks of the recipes have a tenth


def write_model(folder: Path, weights: bytes, card: Mapping[str, Any]) -> None:
    """Write weights and card; the card receives its hashes. The same input gives the same bytes."""
    atomic_write(folder / WEIGHTS, weights)
    atomic_write(folder / CARD, _with_hashes(card, _sha256(weights)))


def read_card(folder: Path) -> dict[str, Any]:
    """Return the card of a trained model; BadInput if it is missing, damaged, or written before cards had hashes."""
    path = folder / CARD
    try:
        content = read_bytes(path, _MOST_BYTES, "a model card")
    except FileNotFoundError as error:
        raise BadInput(str(path), "", "does not exist", "train the model first") from error
    try:
        card = json.loads(content)
    except (ValueError, RecursionError) as error:
        raise _damaged(path) from error
    if not isinstance(card, dict):
        raise _damaged(path)
    hashes = card.get(_HASHES)
    if hashes is None:
        raise BadInput(str(path), "", "has no hashes: it is of an earlier version, or damaged", "train it again")
    if not isinstance(hashes, dict) or content != _with_hashes(card, hashes.get("weights")):
        raise _damaged(path)
    return card


def read_weights(folder: Path, card: Mapping[str, Any]) -> bytes:
    """Return the weights' file that a card from `read_card` belongs to; BadInput if it is missing or another one."""
    path = folder / WEIGHTS
    try:
        content = read_bytes(path, _MOST_WEIGHTS, "a file of weights")
    except FileNotFoundError as error:
        raise BadInput(str(path), "", "does not exist", "train it again") from error
    if _sha256(content) != card[_HASHES]["weights"]:
        raise BadInput(str(path), "", "damaged, its SHA-256 is not the one on the card", "train it again")
    return content


def _with_hashes(card: Mapping[str, Any], weights: Any) -> bytes:
    """Return the bytes of a card with the hash of its weights and its own."""
    own = _encoded({**card, _HASHES: {"weights": weights}})
    return _encoded({**card, _HASHES: {"weights": weights, "card": _sha256(own)}})


def _encoded(card: Mapping[str, Any]) -> bytes:
    return json.dumps(card, indent=1, sort_keys=True).encode() + b"\n"


def _sha256(content: bytes) -> str:
    return hashlib.sha256(content).hexdigest()


def _damaged(path: Path) -> BadInput:
    return BadInput(str(path), "", "damaged, its bytes are not those that were written", "train it again")
