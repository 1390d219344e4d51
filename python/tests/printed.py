"""What the program prints, with its long lines whole."""

WIDTH = 120


def whole_lines(text: str) -> str:
    """Lines that the program broke because the next word would have made them longer, put together again."""
    lines: list[str] = []
    before = hanging = 0
    for line in text.split("\n"):
        indent = len(line) - len(line.lstrip(" "))
        word = len(line.split()[0]) if line.split() else 0
        if lines and word and indent == hanging and before <= WIDTH < before + 1 + word:
            lines[-1] += " " + line.lstrip(" ")
        else:
            column = line.rfind("  ") + 2 if "  " in line else 0
            hanging = column if column > indent else indent + 2
            lines.append(line)
        before = len(line)
    return "\n".join(lines)
