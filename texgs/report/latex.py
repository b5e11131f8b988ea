"""Tables in LaTeX: a tabular each, to be put into papers, and a document of all."""

from __future__ import annotations

import unicodedata
from collections.abc import Mapping

from texgs.report.table import Table, one_line

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


def tabular(table: Table) -> str:
    """A table between rules of booktabs, with its caption as a comment."""
    kinds = "".join("l" if column.digits is None else "r" for column in table.columns)
    lines = [[column.title for column in table.columns], *table.texts()]
    head, *body = (" & ".join(map(escape, line)) + r" \\" for line in lines)
    rows = [rf"\begin{{tabular}}{{{kinds}}}", r"\toprule", head, r"\midrule", *body, r"\bottomrule"]
    return "\n".join([f"% {one_line(table.caption)}", *rows, r"\end{tabular}"]) + "\n"


def document(tables: Mapping[str, Table]) -> str:
    """A document with the files NAME.tex of all tables that have rows, with their captions."""
    floats = [
        rf"""\begin{{table}}[p]
\centering
\textbf{{{escape(table.heading or name)}}}

\medskip
{escape(table.caption)}

\medskip
\fitted{{{name}.tex}}
\end{{table}}
\clearpage
"""
        for name, table in tables.items()
        if table.rows
    ]
    return HEAD + "".join(floats) + "\\end{document}\n"


def escape(text: str) -> str:
    """Text as LaTeX prints it, in one line."""
    return "".join(map(printed, one_line(text)))


def printed(letter: str) -> str:
    """One letter; those that the fonts of pdflatex may not have, by their code."""
    if letter in SPECIAL:
        return SPECIAL[letter]
    if letter.isascii() or is_accented(letter):
        return letter
    return rf"\texttt{{U+{ord(letter):04X}}}"


def is_accented(letter: str) -> bool:
    """Whether this is a letter of the alphabet with an accent that the encoding T1 has."""
    return "LATIN" in unicodedata.name(letter, "") and ord(letter) <= 0x17F
