"""Words of a user or of a file in plots."""


def words(text: str) -> str:
    r"""A text that Matplotlib shows letter by letter: it takes what is between dollar signs for mathematics.

    Example:
        >>> words("$x_{")
        '\\$x_{'
    """
    return text.replace("$", r"\$")
