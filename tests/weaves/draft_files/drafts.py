"""Texts of draft files for tests; each is an imitation of what programs write."""

BALANCED = {
    "WIF": "Version=1.1\nDate=April 20, 1997\nDevelopers=wif@mhsoft.com\nSource Program=Loom\nSource Version=2",
    "TEXT": "Title=Small cloth",
    "COLOR PALETTE": "Range=0,255\nEntries=2",
    "COLOR TABLE": "1=255,255,255\n2=170,16,32",
    "WEAVING": "Rising Shed=true\nShafts=4\nTreadles=4",
    "WARP": "Threads=8\nColor=1\nSpacing=12\nThickness=9\nUnits=Decipoints",
    "WEFT": "Threads=8\nColor=2\nSpacing=0.1\nThickness=0.05\nUnits=Inches",
    "THREADING": "\n".join(f"{end}={(end - 1) % 4 + 1}" for end in range(1, 9)),
    "TIEUP": "1=1,2\n2=2,3\n3=3,4\n4=4,1",
    "TREADLING": "\n".join(f"{pick}={(pick - 1) % 4 + 1}" for pick in range(1, 9)),
}
"""Sections of a 2/2 twill of 8 x 8 threads, white warp and red weft."""

BALANCED_ROWS = ["#..#", "..##", ".##.", "##.."]
"""Its drawing, the last pick first: pick 1 lifts the shafts 1 and 2."""


def wif(**changes):
    """Return the text of the twill with other sections; None leaves one out, _ in a name is a space."""
    sections = BALANCED | {name.replace("_", " "): content for name, content in changes.items()}
    return "\n\n".join(f"[{name}]\n{content}" for name, content in sections.items() if content is not None) + "\n"


def numbered(values):
    return "\n".join(f"{number}={value}" for number, value in enumerate(values, 1))
