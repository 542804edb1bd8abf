"""What goes wrong with a request, shown as a page of its own."""

from __future__ import annotations


class NoticeError(Exception):
    """There is a message in place of the page: what is so, and what to do."""

    status = 409
    title = "This cannot be shown"

    def __init__(self, message: str, title: str | None = None) -> None:
        """Show a ``message`` of one or two sentences under a ``title``."""
        super().__init__(message)
        self.title = title or self.title


class MissingError(NoticeError):
    """There is nothing of that name."""

    status = 404
    title = "Not found"


class BadRequestError(NoticeError):
    """A value in the address or in what was sent means nothing."""

    status = 400
    title = "This address cannot be understood"
