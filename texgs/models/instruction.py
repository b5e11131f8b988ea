"""What a user asks for in words."""

from texgs.core.errors import ArgumentError


def require_instruction(instruction: str) -> str:
    """The instruction without blanks around it.

    Raises:
        ArgumentError: if nothing is left.
    """
    if not isinstance(instruction, str) or not instruction.strip():
        raise ArgumentError(
            f"instruction: expected what to do in words, such as 'make it gold', got {instruction!r}"
        )
    return instruction.strip()
