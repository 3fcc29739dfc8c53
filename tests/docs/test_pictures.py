"""Every picture of the documentation has a command or is kept, and is shown."""

from docs._tools.pictures import COMMANDS, KEPT, PICTURES, ROOT


def test_every_picture_has_a_command_or_is_kept_and_is_shown():
    names = {path.name for path in PICTURES.iterdir()}
    assert names == set(COMMANDS) | KEPT
    pages = "".join(path.read_text() for path in (ROOT / "README.md", *(ROOT / "docs").glob("*.md")))
    assert [name for name in sorted(names) if f"pictures/{name}" not in pages] == []
