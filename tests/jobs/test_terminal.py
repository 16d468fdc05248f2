import io

from rich.table import Table

from jobs.terminal import Terminal

HOSTILE = "\x1b[2J\x1b]0;title\x07\x9b31m\r[red]name[/nothing] :smile: \u202etxt"


def shown(renderable):
    stream = io.StringIO()
    Terminal(file=stream, width=200).print(renderable)
    return stream.getvalue()


def test_no_text_moves_the_cursor_or_is_markup_and_styles_of_our_own_are_as_they_were():
    table = Table(HOSTILE, title=HOSTILE, caption=HOSTILE)
    table.add_row(HOSTILE)
    for renderable in (HOSTILE, table):
        text = shown(renderable)
        assert text.replace("\n", "").isprintable() and "[red]name[/nothing] :smile:" in text
    assert shown("a\nb  é 織") == "a\nb  é 織\n"
    stream = io.StringIO()
    Terminal(file=stream, force_terminal=True, color_system="standard").print("name", style="bold")
    assert stream.getvalue() == "\x1b[1mname\x1b[0m\n"
