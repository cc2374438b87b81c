"""The mark that ends a list in the files of WuCAPS."""

from aatri.formats.text.text_line import TextLine

END = ("-99", "-99.0")


def ends(entry: TextLine) -> bool:
    """Whether a line ends a list."""
    return entry.words[0] in END
