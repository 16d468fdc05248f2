"""Check the order, the words and the sizes of the code; print the table of budgets. `make lint` runs it.

With `--lower`, limits of budgets become what is reached (`make budgets`).
"""

import sys

from tests.lint import architecture, budgets, rooms, words


def main() -> int:
    """Print everything that is wrong, and the table; return 1 if anything is wrong."""
    if "--lower" in sys.argv:
        budgets.lower()
    text, exceeded = budgets.table()
    wrong = [*architecture.problems(), *words.problems(), *rooms.problems(), *exceeded]
    print(text)
    for sentence in wrong:
        print(sentence, file=sys.stderr)
    return bool(wrong)


if __name__ == "__main__":
    sys.exit(main())
