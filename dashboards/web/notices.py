"""What is the matter, said as a page: nothing there, wrongly asked, not readable."""

from __future__ import annotations


class NoticeError(Exception):
    """A page in place of the one asked for: what is so, and what to do."""

    status = 409
    title = "This cannot be shown"

    def __init__(self, message: str, title: str | None = None) -> None:
        """``message``: one or two sentences."""
        super().__init__(message)
        self.title = title or self.title


class MissingError(NoticeError):
    """Nothing of that name."""

    status = 404
    title = "Not found"


class WrongQuestionError(NoticeError):
    """An address with a value that means nothing."""

    status = 400
    title = "This address cannot be understood"
