"""The picture of the rooms in CONTRIBUTING.md, drawn from the imports: `make rooms` writes it, `make lint` compares."""

import ast
import re
import sys
from collections.abc import Iterator

from tests.lint.architecture import ORDER, layer
from tests.lint.tree import MODULES, ROOT, graph

DOCUMENT = ROOT / "CONTRIBUTING.md"
BLOCK = re.compile(r"(?<=<!-- rooms -->\n).*?(?=<!-- end of rooms -->)", re.S)


def uses() -> dict[str, list[str]]:
    """Return, for each room, those that it imports, without those that one of these imports already."""
    direct: dict[str, set[str]] = {room: set() for room in ORDER}
    for module, names in graph().items():
        direct[ORDER[layer(module)]] |= {ORDER[layer(name)] for name in names} - {ORDER[layer(module)]}
    indirect: dict[str, set[str]] = {}
    for room in ORDER:
        indirect[room] = direct[room].union(*(indirect[name] for name in direct[room]))
    return {
        room: [name for name in ORDER if name in names and not any(name in indirect[other] for other in names)]
        for room, names in direct.items()
    }


def drawn() -> str:
    """Return the picture as Mermaid, and a row a room."""
    lines = ["```mermaid", "graph LR"]
    lines += [f"  {name} --> {room}" for room, names in uses().items() for name in names]
    lines += ["```", "", "| room | what is in it |", "|---|---|"]
    for room in ORDER:
        sentence = (ast.get_docstring(MODULES[room].tree) or "").partition("\n")[0]
        lines.append(f"| `{room}` | {sentence} |")
    return "\n".join(lines) + "\n"


def problems() -> Iterator[str]:
    """Yield a sentence if the picture is not that of the imports."""
    if BLOCK.findall(DOCUMENT.read_text(encoding="utf-8")) != [drawn()]:
        yield f"{DOCUMENT.name}: the picture of the rooms is not that of the imports: `make rooms`"


def main() -> int:
    text = DOCUMENT.read_text(encoding="utf-8")
    DOCUMENT.write_text(BLOCK.sub(lambda _: drawn(), text), encoding="utf-8")
    return 0


if __name__ == "__main__":
    sys.exit(main())
