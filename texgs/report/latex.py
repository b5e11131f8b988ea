"""Tables in LaTeX: a tabular each, to be put into papers, and a document of all."""

from __future__ import annotations

import unicodedata
from collections.abc import Iterable, Mapping, Sequence

SPECIAL = {
    "\\": r"\textbackslash{}",
    "~": r"\textasciitilde{}",
    "^": r"\textasciicircum{}",
    "[": "{[}",  # after the end of a row it would begin an argument
    "]": "{]}",
    "±": r"$\pm$",
    "×": r"$\times$",
    "°": r"$^\circ$",
    "·": r"$\cdot$",
    "≠": r"$\neq$",
    "≤": r"$\leq$",
    "≥": r"$\geq$",
    "→": r"$\rightarrow$",
    "↑": r"$\uparrow$",
    "↓": r"$\downarrow$",
    "−": "$-$",
    "²": r"$^2$",
    "³": r"$^3$",
    "–": "--",
    "—": "---",
    "…": r"\ldots{}",
    "‘": "`",
    "’": "'",
    "“": "``",
    "”": "''",
    "α": r"$\alpha$",
    "β": r"$\beta$",
    "λ": r"$\lambda$",
    "µ": r"$\mu$",
    "μ": r"$\mu$",
    "σ": r"$\sigma$",
    **{letter: f"\\{letter}" for letter in "&%$#_{}"},
}
HEAD = r"""% All tables of a report: pdflatex tables.tex
\documentclass{article}
\usepackage[a3paper,margin=15mm]{geometry}
\usepackage[T1]{fontenc}
\usepackage[utf8]{inputenc}
\usepackage{booktabs}
\usepackage{graphicx}
\newsavebox{\tablebox}
% A table at its own size, or as wide as the page.
\newcommand{\fitted}[1]{\sbox{\tablebox}{\input{#1}\unskip}%
  \ifdim\wd\tablebox>\linewidth\resizebox{\linewidth}{!}{\usebox{\tablebox}}\else\usebox{\tablebox}\fi}
\begin{document}
"""


def tabular(kinds: str, titles: Sequence[str], rows: Iterable[Sequence[str]], caption: str) -> str:
    """Return a table between rules of booktabs, with its caption as a comment.

    Args:
        kinds: of the columns, "l" or "r" each.
        titles: of the columns.
        rows: their cells.
        caption: what the table shows.
    """
    head, *body = (" & ".join(map(escape, row)) + r" \\" for row in (titles, *rows))
    lines = [rf"\begin{{tabular}}{{{kinds}}}", r"\toprule", head, r"\midrule", *body, r"\bottomrule"]
    return "\n".join([f"% {one_line(caption)}", *lines, r"\end{tabular}"]) + "\n"


def document(tables: Mapping[str, tuple[str, str]]) -> str:
    """Return a document with the files NAME.tex of tables, by name their headings and captions."""
    floats = [
        rf"""\begin{{table}}[p]
\centering
\textbf{{{escape(heading)}}}

\medskip
{escape(caption)}

\medskip
\fitted{{{name}.tex}}
\end{{table}}
\clearpage
"""
        for name, (heading, caption) in tables.items()
    ]
    return HEAD + "".join(floats) + "\\end{document}\n"


def escape(text: str) -> str:
    """Return text as LaTeX prints it, in one line."""
    return "".join(map(_printed, one_line(text)))


def one_line(text: str) -> str:
    """Return text without line breaks, which end a row of a table."""
    return " ".join(text.split())


def _printed(letter: str) -> str:
    """Return one letter; one that the fonts of pdflatex may not have by its code."""
    if letter in SPECIAL:
        return SPECIAL[letter]
    is_accented = "LATIN" in unicodedata.name(letter, "") and ord(letter) <= 0x17F  # the encoding T1 has it
    return letter if letter.isascii() or is_accented else rf"\texttt{{U+{ord(letter):04X}}}"
