"""The server's errors, one tree; `api.status` maps each class to one gRPC status code.

GridwrightError
├── InvalidArgumentError       the request breaks a rule, whatever the server's state
├── NotFoundError              no such session
├── AlreadyExistsError         the session id is taken
├── FailedPreconditionError    not in the session's present state
├── OutOfRangeError            older than what the session still takes
├── ResourceExhaustedError     a limit of the server is reached
└── UnavailableError           the server is starting or stopping: try again
"""

from dataclasses import dataclass


@dataclass(frozen=True)
class FieldViolation:
    """One rule that one field breaks; `field` is its path in the request."""

    field: str
    description: str


class GridwrightError(Exception):
    """Base of all errors that may leave the server.

    `reason` is the machine-readable UPPER_SNAKE_CASE reason of google.rpc.ErrorInfo; `metadata` its
    details. The message says what to do.
    """

    def __init__(self, reason: str, message: str, **metadata: object) -> None:
        super().__init__(message)
        self.reason = reason
        self.metadata = {key: str(value) for key, value in metadata.items()}


class InvalidArgumentError(GridwrightError):
    """A request that no state of the server would accept; names every field that is wrong."""

    def __init__(self, violations: list[FieldViolation]) -> None:
        listed = "; ".join(f"{violation.field}: {violation.description}" for violation in violations)
        super().__init__("INVALID_FIELDS", listed)
        self.violations = violations


class NotFoundError(GridwrightError):
    """The session named does not exist."""


class AlreadyExistsError(GridwrightError):
    """The session id asked for is taken."""


class FailedPreconditionError(GridwrightError):
    """The request is right, but not in the session's present state."""


class OutOfRangeError(GridwrightError):
    """An item older than what the session still takes."""


class ResourceExhaustedError(GridwrightError):
    """A limit of the server is reached."""


class UnavailableError(GridwrightError):
    """The server is starting or stopping; the same request may succeed later."""
